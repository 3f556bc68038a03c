"""A policy that looks ahead along the route: curvature-limited steering, slow before bends and bifurcations, gentle to the wall.

Everything is taken from the picture: the head and its direction from the robot's path, the way from the operator's route or,
without one, from the centerline's piece. Contact force is used where the rig reports it (the twin does).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from core.config import AdviceConfig
from core.control.stall import BackOff, ContactLimit, Stall
from core.perception import polyline
from core.policy_config import PursuitConfig
from core.types import Advice, Point, Points, RobotStatus, Scene, Speed, VesselGraph

_BEHIND_DEG = 100.0
"""The way lies behind the head when it leaves it at more than this angle."""
_ON_ROUTE_PX = 2.0
_UNFOLLOWED_S = 1.0
"""Who does not take the robot back for so long meant something else; if the reason is gone, the advice is, too."""
_STILL_MM_S = 0.3
"""Servos at rest measure a little motion, too."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The way ahead of the head, in working px.

    ``points`` (N, 2) from the place beside the head; ``left_px`` to the target (None: no target); ``error_deg`` the turn that is
    missing, positive to the right; ``behind`` when the way leaves backwards; ``turn_deg`` the sharpest turn within the preview;
    ``junction_px`` the distance to the next bifurcation on it (None: none in the preview); ``wall`` how much of the room beside the
    centerline the head has used (1: it touches the wall).
    """

    points: Points
    left_px: float | None
    error_deg: float
    behind: bool
    turn_deg: float
    junction_px: float | None
    wall: float


def look_ahead(scene: Scene, look_ahead_px: float, config: PursuitConfig) -> Way | None:
    """What lies ahead in a scene; None when it has no pose."""
    if scene.pose is None or scene.path is None or scene.centerline is None:
        return None
    head = scene.path.head
    points = scene.route.points if scene.route is not None else _ahead_of(scene.centerline.piece, head)
    left_px = scene.route.length_px if scene.route is not None else None
    if len(points) < 2:
        return None
    heading = _heading(scene.path.points, config.heading_px)
    goal = _goal(points, head, look_ahead_px)
    straight_deg = _angle_deg(heading, (goal[0] - head[0], goal[1] - head[1]))
    foot, first = points[0], polyline.cut(points, 0.0, 6.0)[-1]
    # A head that has to turn into a branch beside it has the way across, not behind: one that leads back also begins backwards.
    back_deg = min(abs(straight_deg), abs(_angle_deg(heading, _step(foot, first))))
    behind = left_px is not None and left_px > config.arrive_px and back_deg > _BEHIND_DEG
    arc_deg = _angle_deg(_step(foot, first), _step(foot, goal)) if not behind else 0.0
    error_deg = straight_deg - config.follow_arc * max(-45.0, min(45.0, arc_deg))
    radius_px, robot_px = scene.centerline.radius_px, scene.path.radius_px
    away_px = math.hypot(head[0] - scene.centerline.nearest[0], head[1] - scene.centerline.nearest[1])
    return Way(
        points=points,
        left_px=left_px,
        error_deg=_limited(error_deg, _sharpest_deg(look_ahead_px, config)),
        behind=behind,
        turn_deg=_turn_deg(points, config.preview_px),
        junction_px=_junction_px(scene.vessel_graph, points, config.preview_px),
        wall=away_px / max(radius_px - robot_px, 0.25 * radius_px, 1.0),
    )


class Pursuit:
    """Look-ahead steering with a memory: smoothed steering, and backing off from walls and missed branches until there is room."""

    def __init__(self, config: PursuitConfig, advice: AdviceConfig) -> None:
        self._config = config
        self._words = advice
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._speed_mm_s = 0.0
        self._steer_deg = 0.0
        self._last_s: float | None = None
        self._stall = Stall(self._config)
        self._contact = ContactLimit(self._config)
        self._back: BackOff | None = None
        self._behind_s = 0.0
        self._unfollowed_s = 0.0
        self._insertion_mm: float | None = None

    def __call__(self, scene: Scene, status: RobotStatus | None = None) -> Advice | None:
        """Advice for a scene; `status` adds the contact force and how fast the robot is really fed. None when there is no pose."""
        config = self._config
        ahead_px = config.look_ahead_px + config.look_ahead_s * max(0.0, self._speed_mm_s) * config.pixels_per_mm
        way = look_ahead(scene, ahead_px, config)
        if way is None:
            return None
        elapsed_s = 0.0 if self._last_s is None else max(0.0, scene.captured_s - self._last_s)
        self._last_s = scene.captured_s
        contact_n = status.wall_contact_n if status is not None else None
        self._behind_s = self._behind_s + elapsed_s if way.behind else 0.0
        self._smooth(way.error_deg, elapsed_s)
        fed_mm_s = self._fed(status, elapsed_s)
        stuck = self._stall.update(way.left_px, fed_mm_s, elapsed_s)
        self._unfollowed_s = self._unfollowed_s + elapsed_s if self._back is not None and fed_mm_s >= 0.0 else 0.0
        return self._backing(way, contact_n, stuck, fed_mm_s * elapsed_s) or self._forward(way, contact_n)

    def _fed(self, status: RobotStatus | None, elapsed_s: float) -> float:
        """The robot's feed in mm/s: as measured, since who is advised may do otherwise; as advised where nothing is measured."""
        before_mm, self._insertion_mm = self._insertion_mm, status.insertion_mm if status is not None else None
        if self._insertion_mm is None:
            return self._speed_mm_s
        if before_mm is None or elapsed_s <= 0.0:
            return 0.0
        fed_mm_s = (self._insertion_mm - before_mm) / elapsed_s
        return fed_mm_s if abs(fed_mm_s) > _STILL_MM_S else 0.0

    def _backing(self, way: Way, contact_n: float | None, stuck: bool, fed_mm: float) -> Advice | None:
        """Backwards while there is a reason to, which one picture alone never is; None to go on. `fed_mm` since the last frame."""
        config = self._config
        if self._back is None:
            if way.behind and self._behind_s < config.behind_s:
                return self._advise(0.0, 0.0, "the way seems to lie behind the head: looking again")
            if way.behind:
                self._back = BackOff("the way to the target branches off behind the head", config.retry_mm)
            elif self._contact.exceeded(contact_n, way.left_px):
                self._back = BackOff(f"the robot presses against the wall with {contact_n or 0.0:.2f} N", config.back_off_mm / 2)
            elif stuck:
                self._back = BackOff("the robot is fed but its head does not move", config.back_off_mm)
            else:
                return None
        is_unfollowed = self._unfollowed_s > _UNFOLLOWED_S and not way.behind
        if is_unfollowed or self._back.done(way.behind, -fed_mm):
            self._back, self._unfollowed_s = None, 0.0
            return None
        steer_deg = 0.0 if way.behind else self._steer_deg
        return self._advise(-self._words.slow_mm_s, steer_deg, f"backing off: {self._back.why}")

    def _forward(self, way: Way, contact_n: float | None) -> Advice:
        config, words = self._config, self._words
        limits = [(words.fast_mm_s, "along the route")]
        if way.turn_deg > config.gentle_turn_deg:
            limits.append((words.fast_mm_s * config.gentle_turn_deg / way.turn_deg, "a bend ahead"))
        if way.junction_px is not None:
            limits.append((words.moderate_mm_s, "a bifurcation ahead"))
        if abs(self._steer_deg) > config.slow_steer_deg:
            share = config.slow_steer_deg / abs(self._steer_deg)
            limits.append((max(words.slowest_mm_s, words.moderate_mm_s * share), "the head must turn first"))
        if way.wall > config.wall_share:
            limits.append((words.slow_mm_s, "the head is near the wall"))
        if contact_n is not None and contact_n > config.contact_slow_n:
            limits.append((words.slow_mm_s, "the robot leans on the wall"))
        if way.left_px is not None and way.left_px < config.preview_px:
            limits.append((max(words.slowest_mm_s, words.fast_mm_s * way.left_px / config.preview_px), "the target is near"))
        speed_mm_s, why = min(limits)
        return self._advise(speed_mm_s, self._steer_deg, why)

    def _smooth(self, error_deg: float, elapsed_s: float) -> None:
        wanted = _limited(self._config.gain * error_deg, self._words.max_steer_deg)
        keep = math.exp(-elapsed_s / self._config.smoothing_s) if self._config.smoothing_s > 0.0 and elapsed_s > 0.0 else 0.0
        self._steer_deg = keep * self._steer_deg + (1.0 - keep) * wanted

    def _advise(self, speed_mm_s: float, steer_deg: float, why: str) -> Advice:
        self._speed_mm_s = speed_mm_s
        return Advice(speed_word(abs(speed_mm_s), self._words), speed_mm_s, steer_deg, why)


def speed_word(speed_mm_s: float, config: AdviceConfig) -> Speed:
    """The paper's word nearest to a speed; STOP for none."""
    if speed_mm_s == 0.0:
        return Speed.STOP
    words = {
        Speed.SLOWEST: config.slowest_mm_s,
        Speed.SLOW: config.slow_mm_s,
        Speed.MODERATE: config.moderate_mm_s,
        Speed.FAST: config.fast_mm_s,
    }
    return min(words, key=lambda word: abs(words[word] - speed_mm_s))


def _ahead_of(piece: Points, head: Point) -> Points:
    return polyline.cut(piece, polyline.nearest(piece, head)[1], math.inf)


def _heading(path: Points, length_px: float) -> Point:
    """Direction of the robot's end, from the whole stretch and not from its two end points."""
    along = polyline.arc_length(path)
    end = polyline.resample(polyline.cut(path, float(along[-1]) - length_px, math.inf), 2.0)
    half = max(1, len(end) // 2)
    back, front = end[:half].mean(axis=0), end[-half:].mean(axis=0)
    return float(front[0] - back[0]), float(front[1] - back[1])


def _goal(points: Points, head: Point, distance_px: float) -> Point:
    """The first point of the way that is `distance_px` from the head; the way goes straight on beyond its end.

    A head far beside the way looks farther ahead, at 45 degrees at most: its foot on the way would lie across, and look as if it
    were behind a head that is turned a little outwards.
    """
    distance_px = max(distance_px, math.sqrt(2.0) * math.hypot(points[0][0] - head[0], points[0][1] - head[1]))
    line = polyline.resample(points, 2.0)
    last, before = line[-1], line[max(0, len(line) - 6)]
    length = float(np.hypot(*(last - before)))
    if length > 0.0:
        line = np.vstack([line, last + (last - before) / length * np.arange(2.0, 3.0 * distance_px, 2.0)[:, None]])
    far = np.hypot(line[:, 0] - head[0], line[:, 1] - head[1]) >= distance_px
    found = line[int(np.argmax(far))] if far.any() else line[-1]
    return float(found[0]), float(found[1])


def _turn_deg(points: Points, preview_px: float) -> float:
    """Largest angle between the way's first direction and any later one within the preview."""
    line = polyline.resample(polyline.cut(points, 0.0, preview_px), 5.0)
    if len(line) < 4:
        return 0.0
    steps = line[2:] - line[:-2]
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.degrees(headings.max() - headings.min()))


def _junction_px(graph: VesselGraph | None, points: Points, preview_px: float) -> float | None:
    if graph is None or len(graph.nodes) == 0:
        return None
    degree = np.bincount([node for edge in graph.edges for node in (edge.start, edge.end)], minlength=len(graph.nodes))
    line = polyline.cut(points, 0.0, preview_px)
    found = []
    for x, y in graph.nodes[degree >= 3].tolist():
        away_px, position, _ = polyline.nearest(line, (x, y))
        if away_px <= _ON_ROUTE_PX:
            found.append(position)
    return min(found, default=None)


def _sharpest_deg(look_ahead_px: float, config: PursuitConfig) -> float:
    """The angle to a point at the look-ahead distance on the tightest arc that is steered for."""
    return math.degrees(math.asin(min(1.0, look_ahead_px / (2.0 * config.min_bend_radius_px))))


def _step(start: Points | Point, end: Points | Point) -> Point:
    return float(end[0] - start[0]), float(end[1] - start[1])


def _angle_deg(start: Point, end: Point) -> float:
    """Signed angle from one direction to another, positive to the right on screen."""
    return math.degrees(math.atan2(start[0] * end[1] - start[1] * end[0], start[0] * end[0] + start[1] * end[1]))


def _limited(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
