"""A policy that looks ahead along the route: curvature-limited steering, slow before bends and bifurcations, gentle to the wall.

Everything is taken from the picture: the head and its direction from the robot's path, the way from the operator's route or,
without one, from the centerline's piece. Contact force is used where the rig reports it (the twin does).

Does the head move as it is fed, how hard does it press, how far is it to be taken back? Small memories of the pursuit policy.

The way ahead of the head: what a policy that looks ahead takes from a scene. Angles in degrees, lengths in working px.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from core import geometry
from core.config.models import AdviceConfig, PursuitConfig
from core.types import Advice, Mask, Point, Points, RobotStatus, Scene, Speed, VesselGraph

_BEHIND_DEG = 100.0
"""The way lies behind the head when it leaves it at more than this angle."""
_IN_SIGHT_DEG, _IN_SIGHT_PX = 60.0, 90.0
"""Where the way goes on within this angle and distance of the head, and nothing is between, it is not behind."""
_ON_ROUTE_PX = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class LookAhead:
    """The way ahead of the head, in working px.

    ``points`` (N, 2) from the place beside the ``head``, or, where that leads back, from the place in sight ahead of it;
    ``left_px`` to the ``target`` (None: no target); ``error_deg`` the turn that is missing, positive to the right; ``behind`` when
    the way leaves backwards; ``turn_deg`` the sharpest turn within the preview; ``junction_px`` the distance to the next
    bifurcation on it (None: none in the preview); ``wall`` how much of the room beside the centerline the head has used (1: it
    touches the wall).
    """

    head: Point
    points: Points
    left_px: float | None
    target: Point | None
    error_deg: float
    behind: bool
    turn_deg: float
    junction_px: float | None
    wall: float


def look_ahead(scene: Scene, look_ahead_px: float, config: PursuitConfig, rounding_px: float = 0.0) -> LookAhead | None:
    """What lies ahead in a scene, on a way whose corners are rounded over `rounding_px`; None when it has no pose."""
    if scene.pose is None or scene.path is None or scene.centerline is None:
        return None
    head = scene.path.head
    points = scene.route.points if scene.route is not None else _ahead_of(scene.centerline.piece, head)
    left_px = scene.route.length_px if scene.route is not None else None
    if len(points) < 2:
        return None
    heading = _heading(scene.path.points, config.heading_px)
    rounded = geometry.smooth(geometry.resample(points, 2.0), rounding_px / 2.0) if rounding_px > 0.0 else points
    goal = _goal(rounded, head, look_ahead_px)
    straight_deg = _angle_deg(heading, _step(head, goal))
    foot, first = rounded[0], geometry.cut(rounded, 0.0, 6.0)[-1]
    # A head that has to turn into a branch beside it has the way across, not behind: one that leads back also begins backwards.
    back_deg = min(abs(straight_deg), abs(_angle_deg(heading, _step(foot, first))))
    behind = left_px is not None and left_px > config.arrive_px and back_deg > _BEHIND_DEG
    arc_deg = _angle_deg(_step(foot, first), _step(foot, goal)) if not behind else 0.0
    if behind and scene.masks is not None:
        # In the wide lumen of a bifurcation the other branch's centerline can be the nearer one: the way then seems to lead back,
        # though the head already looks into the right branch.
        seen_px = _in_sight(points, head, heading, scene.masks.vessel, look_ahead_px)
        if seen_px is not None:
            points, behind = geometry.cut(points, seen_px, math.inf), False
            goal = float(points[0][0]), float(points[0][1])
            straight_deg = _angle_deg(heading, _step(head, goal))
            left_px = math.dist(head, goal) + float(geometry.arc_length(points)[-1])
    error_deg = straight_deg - config.follow_arc * max(-45.0, min(45.0, arc_deg))
    radius_px, robot_px = scene.centerline.radius_px, scene.path.radius_px
    away_px = math.hypot(head[0] - scene.centerline.nearest[0], head[1] - scene.centerline.nearest[1])
    return LookAhead(
        head=head,
        points=points,
        left_px=left_px,
        target=scene.route.target if scene.route is not None else None,
        error_deg=limited(error_deg, _sharpest_deg(look_ahead_px, config)),
        behind=behind,
        turn_deg=_turn_deg(points, config.preview_px),
        junction_px=_junction_px(scene.vessel_graph, points, config.preview_px),
        wall=away_px / max(radius_px - robot_px, 0.25 * radius_px, 1.0),
    )


def _ahead_of(piece: Points, head: Point) -> Points:
    return geometry.cut(piece, geometry.nearest(piece, head)[1], math.inf)


def _heading(path: Points, length_px: float) -> Point:
    """Direction of the robot's end, from the whole stretch and not from its two end points."""
    along = geometry.arc_length(path)
    end = geometry.resample(geometry.cut(path, float(along[-1]) - length_px, math.inf), 2.0)
    half = max(1, len(end) // 2)
    back, front = end[:half].mean(axis=0), end[-half:].mean(axis=0)
    return float(front[0] - back[0]), float(front[1] - back[1])


def _goal(points: Points, head: Point, distance_px: float) -> Point:
    """The first point of the way that is `distance_px` from the head; the way goes straight on beyond its end.

    A head far beside the way looks farther ahead, at 45 degrees at most: its foot on the way would lie across, and look as if it
    were behind a head that is turned a little outwards.
    """
    distance_px = max(distance_px, math.sqrt(2.0) * math.hypot(points[0][0] - head[0], points[0][1] - head[1]))
    line = geometry.resample(points, 2.0)
    last, before = line[-1], line[max(0, len(line) - 6)]
    length = float(np.hypot(*(last - before)))
    if length > 0.0:
        line = np.vstack([line, last + (last - before) / length * np.arange(2.0, 3.0 * distance_px, 2.0)[:, None]])
    far = np.hypot(line[:, 0] - head[0], line[:, 1] - head[1]) >= distance_px
    found = line[int(np.argmax(far))] if far.any() else line[-1]
    return float(found[0]), float(found[1])


def _in_sight(points: Points, head: Point, heading: Point, vessel: Mask, least_px: float) -> float | None:
    """How far along the way its first place ahead of the head lies to which a straight line stays in the lumen; None: nowhere."""
    line = geometry.resample(points, 2.0)
    for position, (x, y) in zip(geometry.arc_length(line), line.tolist(), strict=True):
        away_px = math.hypot(x - head[0], y - head[1])
        if not least_px <= away_px <= _IN_SIGHT_PX or abs(_angle_deg(heading, (x - head[0], y - head[1]))) > _IN_SIGHT_DEG:
            continue
        between = np.rint(np.linspace(head, (x, y), math.ceil(away_px) + 1)).astype(int)
        across, down = between[:, 0].clip(0, vessel.shape[1] - 1), between[:, 1].clip(0, vessel.shape[0] - 1)
        if vessel[down, across].all():
            return float(position)
    return None


def _turn_deg(points: Points, preview_px: float) -> float:
    """Largest angle between the way's first direction and any later one within the preview."""
    line = geometry.resample(geometry.cut(points, 0.0, preview_px), 5.0)
    if len(line) < 4:
        return 0.0
    steps = line[2:] - line[:-2]
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.degrees(headings.max() - headings.min()))


def _junction_px(graph: VesselGraph | None, points: Points, preview_px: float) -> float | None:
    if graph is None or len(graph.nodes) == 0:
        return None
    degree = np.bincount([node for edge in graph.edges for node in (edge.start, edge.end)], minlength=len(graph.nodes))
    line = geometry.cut(points, 0.0, preview_px)
    found = []
    for x, y in graph.nodes[degree >= 3].tolist():
        away_px, position, _ = geometry.nearest(line, (x, y))
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


def limited(value: float, limit: float) -> float:
    """`value`, at most `limit` to either side of zero."""
    return max(-limit, min(limit, value))


_FAR_MM = 60.0
"""Farther than this the robot is not taken back for a branch that it missed."""
_RAISE = 1.25
_FORGET_PX = 60.0
_STILL_MM_S = 0.3
"""Servos at rest measure a little motion, too."""
_STATUS_GAP_S = 0.5
"""What happened between two statuses farther apart is not known."""
_SHORTEST_S = 0.02
"""Frames and statuses come no faster than this: two that do are one moment, and a way divided by it would be a wild speed."""
_REST_S = 0.3
"""Who is not fed for so long rests; a shorter pause is one of the measurement."""
_FARTHER_PX = 6.0
_SAME_BRANCH_PX = 100.0
"""The way left jumps by the lumen's width where the head changes from one branch's centerline to the other's."""


class WallContactMonitor:
    """Tells a head that meets the wall from a body that leans on it.

    The longer a body lies in a winding vessel, the harder it leans on the wall, at any speed: going slow because of that only makes
    it lean longer. What matters is a force that *rises* faster than the body's own, which the average over the way fed follows.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._lean_n: float | None = None

    def rises(self, contact_n: float | None, fed_mm: float) -> bool:
        """Take in one frame, `fed_mm` after the last; `contact_n` is None where the rig does not know it."""
        if contact_n is None:
            return False
        before_n = contact_n if self._lean_n is None else self._lean_n
        self._lean_n = contact_n + (before_n - contact_n) * math.exp(-abs(fed_mm) / self._config.lean_mm)
        return contact_n > self._lean_n + self._config.contact_slow_n


class ContactLimit:
    """The contact force above which the robot backs off, if it still rises.

    A long body in a winding vessel leans on the wall wherever its head is: backing off would not get it out of there. Where a force
    rises again and again at the same place, each back-off raises the limit a little, up to the hard one, which always counts, until
    the head has come well past that place.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._limit_n = config.contact_back_off_n
        self._raised_at_px: float | None = None

    def exceeded(self, contact_n: float | None, rises: bool, left_px: float | None) -> bool:
        """Whether to back off; `contact_n` is None where the rig does not know it, ``rises`` is what ``Lean`` says of it."""
        if self._raised_at_px is not None and left_px is not None and left_px < self._raised_at_px - _FORGET_PX:
            self._limit_n, self._raised_at_px = self._config.contact_back_off_n, None
        if contact_n is None or contact_n <= self._limit_n or not (rises or contact_n > self._config.contact_limit_n):
            return False
        self._limit_n = min(_RAISE * max(contact_n, self._limit_n), self._config.contact_limit_n)
        self._raised_at_px = left_px
        return True


class Feed:
    """How fast the robot is fed, and how far since the last frame: measured between two of its statuses, by their own times.

    Frames and statuses do not come in step. A frame that finds the status of the one before knows nothing new of the feed; taken
    for a rest, it would hide for ever that a robot is fed and does not move.
    """

    def __init__(self) -> None:
        self._known: tuple[float, float] | None = None
        self._speed_mm_s = 0.0
        self._silent_s = 0.0

    def update(self, status: RobotStatus | None, advised_mm_s: float, elapsed_s: float) -> tuple[float, float]:
        """Speed in mm/s and way in mm since the frame before, `elapsed_s` ago; as advised where nothing is measured."""
        if status is None:
            self._known = None
            return advised_mm_s, advised_mm_s * elapsed_s
        before, self._known = self._known, (status.time_s, status.insertion_mm)
        since_s, fed_mm = (0.0, 0.0) if before is None else (status.time_s - before[0], status.insertion_mm - before[1])
        if since_s == 0.0 and fed_mm:
            since_s = max(elapsed_s, _SHORTEST_S)  # of several servos one was late, and its time is that of all
        self._silent_s = self._silent_s + elapsed_s if since_s == 0.0 else 0.0
        if not 0.0 <= since_s <= _STATUS_GAP_S or self._silent_s > _STATUS_GAP_S:
            self._speed_mm_s = 0.0
            return 0.0, 0.0
        if since_s == 0.0:
            return self._speed_mm_s, 0.0
        self._speed_mm_s = fed_mm / since_s if abs(fed_mm) > _STILL_MM_S * since_s else 0.0
        return self._speed_mm_s, fed_mm if self._speed_mm_s else 0.0


class Stall:
    """Notices that the robot is fed but neither the way left shrinks nor the head moves.

    Both: where the way bends sharply a head slides sideways before it goes on, and one that shakes against a wall does not move on.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._start: tuple[float, Point] | None = None
        self._fed_mm = 0.0
        self._watched_s = 0.0
        self._rested_s = 0.0
        self._blind_s = 0.0
        self.lost_mm = 0.0
        """What was fed in vain when it was last told."""

    def update(self, left_px: float | None, head: Point, speed_mm_s: float, elapsed_s: float) -> bool:
        """Take in one frame; True when there was no progress for the configured time.

        Without a target, or a way to it, it cannot tell; a frame or two in which the way was not found change nothing.
        """
        self._rested_s = 0.0 if speed_mm_s else self._rested_s + elapsed_s
        self._blind_s = 0.0 if left_px is not None else self._blind_s + elapsed_s
        if speed_mm_s < 0.0 or max(self._rested_s, self._blind_s) >= _REST_S:
            self.forget()
            return False
        if self._start is None:
            if speed_mm_s and left_px is not None:
                self._start = left_px, head
            return False
        self._fed_mm += speed_mm_s * elapsed_s
        self._watched_s += elapsed_s
        if self._watched_s < self._config.stuck_s or left_px is None:
            return False
        before_px, before = self._start
        self.lost_mm = self._fed_mm
        fed_px = self._fed_mm * self._config.pixels_per_mm
        stuck = max(before_px - left_px, math.dist(before, head)) < self._config.stuck_share * fed_px
        self.forget()
        self._start = left_px, head
        return stuck

    def forget(self) -> None:
        """Watch anew, from the next frame on."""
        self._start, self._fed_mm, self._watched_s = None, 0.0, 0.0


class RetryCounter:
    """How often the robot was taken back without its head having come farther since; feeding on would only press and buckle it.

    Where the head is counts only where it was taken back: there it stood still, and no single frame beside a branch, from where the
    way left seems shorter, hides what it comes farther later. A frame in which no way was found tells nothing.
    """

    def __init__(self) -> None:
        self.count = 0
        self._nearest_px: float | None = None
        self._target: Point | None = None

    def forget(self) -> None:
        """It may be tried again."""
        self.count, self._nearest_px = 0, None

    def see(self, way: LookAhead) -> None:
        """Take in where the robot is to go: for another target it may be tried again."""
        if way.left_px is None:
            return
        if way.target != self._target:
            self.forget()
        self._target = way.target

    def add(self, way: LookAhead) -> None:
        """Taken back once more. Without a way to a target nobody knows whether the head came farther, and nothing is counted."""
        if way.left_px is None:
            return
        if self._nearest_px is None or way.left_px < self._nearest_px - _FARTHER_PX:
            self.count, self._nearest_px = 1, way.left_px
        else:
            self.count += 1


class TargetMissMonitor:
    """How often the same branch was missed for the same target; a head that cannot bend that far would miss it for ever."""

    def __init__(self) -> None:
        self.count = 0
        self._left_px = 0.0
        self._target: Point | None = None

    def forget(self) -> None:
        """It may be tried again."""
        self.count = 0

    def add(self, way: LookAhead) -> None:
        """Missed once more."""
        self._check(way)
        self.count += 1
        self._left_px, self._target = way.left_px or 0.0, way.target

    def at(self, way: LookAhead) -> int:
        """How often the branch here was missed."""
        self._check(way)
        return self.count

    def _check(self, way: LookAhead) -> None:
        if way.left_px is None:
            return  # a frame in which no way was found tells nothing
        if way.target != self._target or abs(way.left_px - self._left_px) > _SAME_BRANCH_PX:
            self.count = 0


@dataclass(slots=True)
class BackOff:
    """A way back of ``distance_mm``, counted from where the reason for it is gone."""

    why: str
    distance_mm: float
    _cleared_mm: float = field(default=0.0, init=False)
    _moved_mm: float = field(default=0.0, init=False)

    def done(self, still: bool, moved_mm: float) -> bool:
        """Whether it has gone far enough; `still`: the reason for it is still there; `moved_mm`: since the last call."""
        self._moved_mm += max(0.0, moved_mm)
        self._cleared_mm = 0.0 if still else self._cleared_mm + max(0.0, moved_mm)
        return self._cleared_mm >= self.distance_mm or self._moved_mm >= _FAR_MM


_UNFOLLOWED_S = 1.0
"""Who does not take the robot back for so long meant something else; if the reason is gone, the advice is, too."""
_STRANDED_S = 3.0
"""Who is advised to go back for so long and does not move at all cannot: the feed is at the end of its travel, say."""
_LONGEST_S = 0.15
"""A frame counts for no longer than this, so that after a pause no single one decides."""
_PAUSE_S = 0.5
"""What was watched before such a pause says nothing of what comes after it."""


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
        self._lean = WallContactMonitor(self._config)
        self._misses = TargetMissMonitor()
        self._tries = RetryCounter()
        self._feed = Feed()
        self._back: BackOff | None = None
        self._behind_s = 0.0
        self._unfollowed_s = 0.0
        self._still_s = 0.0
        self._is_stranded = False
        self._stranded_for: Point | None = None
        self._is_miss_counted = False

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        """Advice for a scene; `status` adds the contact force and how fast the robot is really fed. None when there is no pose.

        Of a robot that does not do what is advised, although it is `followed`, more is concluded than of one that others drive.
        """
        config = self._config
        ahead_px = config.look_ahead_px + config.look_ahead_s * max(0.0, self._speed_mm_s) * config.pixels_per_mm
        # Who missed a branch has turned too late: each new try begins to turn earlier.
        way = look_ahead(scene, ahead_px, config, self._misses.count * config.rounding_px)
        if way is None:
            return None
        since_s = 0.0 if self._last_s is None else max(0.0, scene.captured_s - self._last_s)
        self._last_s = scene.captured_s
        elapsed_s = min(since_s, _LONGEST_S)
        if since_s > _PAUSE_S:
            self._stall.forget()
            self._behind_s = 0.0
        contact_n = status.wall_contact_n if status is not None else None
        # Counted down, not forgotten: where head and branch lie in a wide bifurcation, single frames still see the way ahead.
        self._behind_s = max(0.0, self._behind_s + (elapsed_s if way.behind else -elapsed_s))
        self._smooth(way.error_deg, since_s)
        fed_mm_s, fed_mm = self._feed.update(status, self._speed_mm_s, elapsed_s)
        stuck = self._stall.update(way.left_px, way.head, fed_mm_s, elapsed_s)
        self._tries.see(way)
        gave_up = self._back is None and (self._misses.count >= config.most_misses or self._tries.count >= config.most_tries)
        otherwise = fed_mm_s >= 0.0 if self._back is not None else gave_up and fed_mm_s != 0.0
        self._unfollowed_s = self._unfollowed_s + elapsed_s if otherwise else 0.0
        still = followed and self._back is not None and way.behind and fed_mm_s == 0.0
        self._still_s = self._still_s + elapsed_s if still else 0.0
        self._is_stranded = self._is_stranded and way.behind and fed_mm_s == 0.0 and way.target == self._stranded_for
        self._is_miss_counted = self._is_miss_counted and self._behind_s > 0.0
        rises = self._lean.rises(contact_n, fed_mm)
        return self._backing(way, contact_n, rises, stuck, fed_mm) or self._given_up(way) or self._forward(way, rises)

    def _backing(self, way: LookAhead, contact_n: float | None, rises: bool, stuck: bool, fed_mm: float) -> Advice | None:
        """Backwards while there is a reason to, which one picture alone never is; None to go on. `fed_mm` since the last frame."""
        config = self._config
        if self._is_stranded:
            return self._advise(0.0, 0.0, "the robot cannot go back any farther: take over, or choose another destination")
        if self._back is None:
            if way.behind and self._behind_s < config.behind_s:
                return self._advise(0.0, 0.0, "the way seems to lie behind the head: looking again")
            if way.behind:
                if not self._is_miss_counted:  # the same one, whoever has driven meanwhile
                    self._misses.add(way)
                self._is_miss_counted = True
                self._back = BackOff("the way to the target branches off behind the head", config.retry_mm)
            elif self._contact.exceeded(contact_n, rises, way.left_px):
                self._tries.add(way)
                self._back = BackOff(f"the robot presses against the wall with {contact_n or 0.0:.2f} N", config.back_off_mm / 2)
            elif stuck:
                self._tries.add(way)
                # All that was fed in vain lies bent behind the head.
                self._back = BackOff("the robot is fed but its head does not move", max(config.back_off_mm, self._stall.lost_mm))
            else:
                return None
        if self._still_s > _STRANDED_S:
            self._back, self._still_s, self._is_stranded, self._stranded_for = None, 0.0, True, way.target
            return self._backing(way, contact_n, rises, stuck, fed_mm)
        is_unfollowed = self._unfollowed_s > _UNFOLLOWED_S and not way.behind
        is_done = self._back.done(way.behind, -fed_mm)
        if is_unfollowed or is_done:
            self._back, self._unfollowed_s = None, 0.0
            self._is_miss_counted = self._is_miss_counted and not is_done
            return None
        steer_deg = 0.0 if way.behind else self._steer_deg
        # The way back is free, the head follows its own body: only time is lost here, and the body leans meanwhile.
        return self._advise(-self._words.fast_mm_s, steer_deg, f"backing off: {self._back.why}")

    def _given_up(self, way: LookAhead) -> Advice | None:
        if self._unfollowed_s > _UNFOLLOWED_S:
            self._misses.forget()  # the operator goes on by hand
            self._tries.forget()
        if (count := self._misses.at(way)) >= self._config.most_misses:
            return self._advise(0.0, 0.0, f"missed the branch {count} times: take over, or choose another destination")
        if (count := self._tries.count) >= self._config.most_tries:
            return self._advise(0.0, 0.0, f"came no farther in {count} tries: take over, or choose another destination")
        return None

    def _forward(self, way: LookAhead, rises: bool) -> Advice:
        config, words = self._config, self._words
        limits = [(words.fast_mm_s, "along the route")]
        if way.turn_deg > config.gentle_turn_deg:
            limits.append((words.fast_mm_s * config.gentle_turn_deg / way.turn_deg, "a bend ahead"))
        if way.junction_px is not None:
            limits.append((words.moderate_mm_s, "a bifurcation ahead"))
        if abs(self._steer_deg) > config.slow_steer_deg:
            # No jump where it begins: an error that trembles about the limit must not make the feed stutter.
            share = (config.slow_steer_deg / abs(self._steer_deg)) ** 2
            limits.append((max(words.slowest_mm_s, words.fast_mm_s * share), "the head must turn first"))
        if way.wall > config.wall_share:
            limits.append((words.moderate_mm_s, "the head is near the wall"))
        if rises:
            limits.append((words.slow_mm_s, "the robot meets the wall"))
        if way.left_px is not None and way.left_px < config.brake_px:
            limits.append((max(words.slowest_mm_s, words.fast_mm_s * way.left_px / config.brake_px), "the target is near"))
        speed_mm_s, why = min(limits)
        return self._advise(speed_mm_s, self._steer_deg, why)

    def _smooth(self, error_deg: float, elapsed_s: float) -> None:
        wanted = limited(self._config.gain * error_deg, self._words.max_steer_deg)
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
