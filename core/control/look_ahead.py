"""The look-ahead of pure pursuit: what lies ahead of the head on the way. Angles in degrees, lengths in working px."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from core import geometry
from core.config.models import PursuitConfig
from core.control.joints import limited
from core.types import Mask, Point, Points, Scene, VesselGraph

_BEHIND_DEG = 100.0
"""The way lies behind the head when it leaves it at more than this angle."""
_IN_SIGHT_DEG, _IN_SIGHT_PX = 60.0, 90.0
"""Where the way continues within this angle and distance of the head, with free lumen between, it is not behind."""
_ON_ROUTE_PX = 2.0
"""A node of the vessel graph within this distance of the way lies on it."""
_HEAD_MM = 20.0
"""Length of the robot's end that bends."""
SHARP_MM = 12.0, 40.0
"""Between these distances ahead a branch that is too sharp is told."""


@dataclass(frozen=True, slots=True, eq=False)
class LookAhead:
    """The way ahead of the head, in working px.

    Attributes
    ----------
    points : (N, 2) from the place beside the ``head``, or, where that leads back, from the place in sight ahead of it.
    left_px : way left to the ``target``; None: no target.
    error_deg : the missing turn, positive to the right.
    behind : the way leaves backwards.
    turn_deg : sharpest turn within the preview.
    junction_px : distance to the next bifurcation on the way; None: none within the preview.
    """

    head: Point
    points: Points
    left_px: float | None
    target: Point | None
    error_deg: float
    behind: bool
    turn_deg: float
    junction_px: float | None


def look_ahead(scene: Scene, look_ahead_px: float, config: PursuitConfig, rounding_px: float = 0.0) -> LookAhead | None:
    """What lies ahead in a scene, on a way whose corners are rounded over `rounding_px`; None when it has no pose."""
    if scene.pose is None or scene.path is None or scene.centerline is None:
        return None
    head, piece = scene.path.head, scene.centerline.piece
    if scene.route is not None:
        points, left_px, target = scene.route.points, scene.route.length_px, scene.route.target
    else:
        points, left_px, target = geometry.cut(piece, geometry.nearest(piece, head)[1], math.inf), None, None
    if len(points) < 2:
        return None
    heading = _heading(scene.path.points, config.heading_px)
    rounded = geometry.smooth(geometry.resample(points, 2.0), rounding_px / 2.0) if rounding_px > 0.0 else points
    goal = _goal(rounded, head, look_ahead_px)
    straight_deg = _angle_deg(heading, _step(head, goal))
    start, first = rounded[0], geometry.cut(rounded, 0.0, 6.0)[-1]
    # for a head that has to turn into a branch beside it the way lies across, not behind: a way back also begins backwards
    back_deg = min(abs(straight_deg), abs(_angle_deg(heading, _step(start, first))))
    behind = left_px is not None and left_px > config.arrive_px and back_deg > _BEHIND_DEG
    arc_deg = _angle_deg(_step(start, first), _step(start, goal)) if not behind else 0.0
    if behind and scene.masks is not None:
        # in the wide lumen of a bifurcation the other branch's centerline can be the nearer one: the way then seems to lead back,
        # though the head already points into the right branch
        seen_px = _in_sight(points, head, heading, scene.masks.vessel, look_ahead_px)
        if seen_px is not None:
            points, behind = geometry.cut(points, seen_px, math.inf), False
            goal = float(points[0][0]), float(points[0][1])
            straight_deg = _angle_deg(heading, _step(head, goal))
            left_px = math.dist(head, goal) + float(geometry.arc_length(points)[-1])
    preview = geometry.cut(points, 0.0, config.preview_px)
    return LookAhead(
        head=head,
        points=points,
        left_px=left_px,
        target=target,
        error_deg=straight_deg - limited(arc_deg, 45.0),
        behind=behind,
        turn_deg=_turn_deg(preview),
        junction_px=min((at for at, _ in _junctions(scene.vessel_graph, preview, _ON_ROUTE_PX)), default=None),
    )


def _heading(path: Points, length_px: float) -> Point:
    """Direction of the robot's end, from the whole stretch and not from its two end points."""
    along = geometry.arc_length(path)
    end = geometry.resample(geometry.cut(path, float(along[-1]) - length_px, math.inf), 2.0)
    half = max(1, len(end) // 2)
    back, front = end[:half].mean(axis=0), end[-half:].mean(axis=0)
    return float(front[0] - back[0]), float(front[1] - back[1])


def _goal(points: Points, head: Point, distance_px: float) -> Point:
    """The first point of the way that is `distance_px` from the head; the way goes straight on beyond its end.

    A head far beside the way takes a point at 45 degrees at most: the nearest point of the way lies across, and would look as if it
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
    """Arc length of the way's first place ahead of the head to which a straight line stays in the lumen, or None."""
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


def _turn_deg(preview: Points) -> float:
    """Largest angle between the way's first direction and any later one."""
    line = geometry.resample(preview, 5.0)
    if len(line) < 4:
        return 0.0
    steps = line[2:] - line[:-2]
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return float(np.degrees(headings.max() - headings.min()))


def _junctions(graph: VesselGraph | None, line: Points, most_away: float) -> list[tuple[float, Point]]:
    """The bifurcations on a line: how far along it, and where."""
    if graph is None or len(graph.nodes) == 0:
        return []
    degree = np.bincount([node for edge in graph.edges for node in (edge.start, edge.end)], minlength=len(graph.nodes))
    found = ((geometry.nearest(line, (x, y)), (x, y)) for x, y in graph.nodes[degree >= 3].tolist())
    return [(at, place) for (away, at, _), place in found if away <= most_away]


def sharp_branches(
    graph: VesselGraph, route: Points, robot_radius: float, bend_deg: float, span_mm: tuple[float, float], per_mm: float = 1.0
) -> list[tuple[Point, float, float]]:
    """The branches on a route (N, 2) that turn more sharply than the head bends: place, turn, and the turn that the head reaches.

    A head of full bend turns by `bend_deg`. In a wide lumen it tilts away first, by the angle that the free width leaves over its
    length. Turns are taken from 7 mm before a junction to 15 mm behind it. Lengths have `per_mm` units to the millimetre; looked at
    is the part of the route within `span_mm`.
    """
    found, along = [], geometry.arc_length(route)
    for at, place in _junctions(graph, geometry.cut(route, 0.0, span_mm[1] * per_mm), _ON_ROUTE_PX / 3.0 * per_mm):
        if at < span_mm[0] * per_mm:
            continue
        places = geometry.point_at(route, along, at + per_mm * np.array([-12.0, -6.0, -2.0, 10.0, 20.0]))
        turn_deg = abs(_angle_deg(_step(places[0], places[2]), _step(places[3], places[4])))
        x, y = places[1].tolist()
        edge = min(graph.edges, key=lambda one: geometry.nearest(one.points, (x, y))[0])
        radius = float(edge.radius[np.argmin(np.hypot(edge.points[:, 0] - x, edge.points[:, 1] - y))])
        tilt_deg = math.degrees(math.atan2(2.0 * max(0.0, radius - robot_radius), _HEAD_MM * per_mm))
        if turn_deg > bend_deg - tilt_deg:
            found.append((place, turn_deg, bend_deg - tilt_deg))
    return found


def _step(start: Points | Point, end: Points | Point) -> Point:
    return float(end[0] - start[0]), float(end[1] - start[1])


def _angle_deg(start: Point, end: Point) -> float:
    """Signed angle from one direction to another, positive to the right on screen."""
    return math.degrees(math.atan2(start[0] * end[1] - start[1] * end[0], start[0] * end[0] + start[1] * end[1]))
