"""Which end of the robot is its tail: the one where it enters (METHOD section 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from core import geometry
from core.config.models import PathConfig
from core.perception.centerline import plan_route
from core.types import Mask, Masks, Point, Points, RobotPath, VesselGraph

END_PART_PX = 20.0
"""How much of each end is compared for thickness."""
STILL_HEAD_PX = 15.0
"""An end this near to the last frame's head is that head; also at the image border, if it came there from within the picture, or
the robot's other end lies at an end of the vessel."""
ALONG_PX, ALONG_STEP_PX, ALONG_SHARE = 30.0, 10.0, 0.5
"""A robot lies along an earlier path if this share of the shorter of both is no further from it than a lumen is wide."""
NEAR_PX = 20
"""Half side of the area around an end in which the robot may meet the border."""
OUTSIDE_LEAD_PX = 10.0
"""The end that runs this much further outside the vessel than the other is the tail."""
OPENING_LEAD_PX = 20.0
"""The end that is this much nearer than the other to the vessel's only opening is the tail."""
NEARER_BY = 0.6
"""An end is at the vessel's end only if the other end is clearly further from one: this share or less of its distance."""


@dataclass(frozen=True, slots=True, eq=False)
class PreviousPath:
    """What a stream knows of the robot from the frames before.

    ``path`` is the last frame's. After a gap: None, and ``before_gap`` still tells which end is the head.
    ``came_from_within``: the head of either was seen well within the picture before it was where it is, so at the image border it
    is no entry."""

    path: RobotPath | None = None
    before_gap: RobotPath | None = None
    came_from_within: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What tells tail from head, besides the path itself; ``port`` is where the robot is inserted, if known."""

    masks: Masks
    vessel: VesselGraph | None
    port: Point | None
    config: PathConfig
    before: PreviousPath = PreviousPath()


def is_entry(place: Points, around: Surroundings) -> bool:
    """Whether a place (2,) lies at the image border or at the insertion port."""
    return _is_at_border(place, around.masks.robot, around.config) or _at_port(place, around)


def was_the_head(points: Points, around: Surroundings) -> bool:
    """Whether the tail of an ordered path was the head before a gap, and well within the picture by then.

    The robot has not turned: its other end has reached the image border during the gap.
    """
    turned = around.before.came_from_within and _as_earlier(points, around) < -ALONG_STEP_PX
    return turned and not _at_port(points[0], around)


def may_go_on_outside(place: Points, mask: Mask, config: PathConfig) -> bool:
    """Whether the robot's mask meets the image border at a place (2,), so that the robot may not end there."""
    return _is_at_border(place, mask, config) and _meets_border(place, mask)


def _is_at_border(place: Points, mask: Mask, config: PathConfig) -> bool:
    height, width = mask.shape
    x, y = float(place[0]), float(place[1])
    return bool(min(x, y, width - 1 - x, height - 1 - y) <= config.border_px)


def _at_port(place: Points, around: Surroundings) -> bool:
    port = around.port
    return port is not None and math.dist((place[0], place[1]), port) <= around.config.port_px


def tail_first(points: Points, around: Surroundings) -> Points:
    """The path ordered from tail to head.

    The first clear answer counts: the one end at border or port (unless it is a head that has just arrived there); the last frame's
    tail and head, or the direction of the path before a gap; the end further outside the vessel; the one end at an end of the
    vessel; the end nearer, along the vessel, to the one place where the vessel meets the image border; the thicker end; and at last
    the end nearer to an end of the vessel.
    """
    for looks_like_tail, margin in (
        (_entry, 0.5),
        (_as_before, 1.0),
        (_as_earlier, ALONG_STEP_PX),
        (_outside_vessel, OUTSIDE_LEAD_PX),
        (_at_vessel_end, 0.5),
        (_from_opening, OPENING_LEAD_PX),
        (_thickness, 0.2),
        (_vessel_end_distance, 0.0),
    ):
        lead = looks_like_tail(points, around) - looks_like_tail(points[::-1], around)
        if abs(lead) > margin:
            return points if lead > 0 else points[::-1]
    return points


def _entry(points: Points, around: Surroundings) -> float:
    before = around.before.path or around.before.before_gap
    arrived = before is not None and float(np.hypot(*(points[0] - before.points[-1]))) <= STILL_HEAD_PX
    if arrived and (around.before.came_from_within or is_at_vessel_end(points[-1], around)):
        return 0.0
    if not is_entry(points[0], around):
        return 0.0
    # An end that stops short of the border, of a robot whose other end comes from outside the vessel, is a head about to leave.
    ahead_px = _outside_vessel(points[::-1], around) - _outside_vessel(points, around)
    return float(ahead_px <= OUTSIDE_LEAD_PX or _at_port(points[0], around) or _meets_border(points[0], around.masks.robot))


def _meets_border(place: Points, mask: Mask) -> bool:
    """Whether the robot's mask reaches the image border near a place, as a robot does that comes from beyond it."""
    x, y = (int(value) for value in place)
    height, width = mask.shape
    rows, columns = (slice(max(v - NEAR_PX, 0), v + NEAR_PX + 1) for v in (y, x))
    sides = (mask[:2, columns], mask[-2:, columns], mask[rows, :2], mask[rows, -2:])
    near = (y < NEAR_PX, y >= height - NEAR_PX, x < NEAR_PX, x >= width - NEAR_PX)
    return any(is_near and bool(side.any()) for side, is_near in zip(sides, near, strict=True))


def _as_before(points: Points, around: Surroundings) -> float:
    if around.before.path is None:
        return 0.0
    before = around.before.path.points
    return -float(np.hypot(*(points[0] - before[0])) + np.hypot(*(points[-1] - before[-1])))


def _as_earlier(points: Points, around: Surroundings) -> float:
    earlier = around.before.before_gap
    return goes_along_px(points, earlier.points) if earlier is not None else 0.0


def goes_along_px(points: Points, before: Points) -> float:
    """How far a path goes on along an earlier one, in its direction; negative: against it. 0 where it lies elsewhere.

    A robot slides along itself and cannot turn about in a vessel, however far it has moved meanwhile.
    """
    along = geometry.arc_length(before)
    places = [geometry.nearest(before, (x, y), along) for x, y in geometry.resample(points, ALONG_STEP_PX).tolist()]
    beside = [position for distance, position, _ in places if distance <= ALONG_PX]
    shorter_px = min(float(along[-1]), float(geometry.arc_length(points)[-1]))
    if len(beside) < 2 or ALONG_STEP_PX * len(beside) < ALONG_SHARE * shorter_px:
        return 0.0
    return beside[-1] - beside[0]


def _outside_vessel(points: Points, around: Surroundings) -> float:
    """Length of the path before it enters the vessel, in px."""
    places = np.rint(points).astype(int)
    inside = around.masks.vessel[places[:, 1], places[:, 0]]
    return float(geometry.arc_length(points)[np.argmax(inside)]) if inside.any() else 0.0


def _distance_to_vessel_end(place: Points, vessel: VesselGraph) -> tuple[float, float]:
    """Distance to the nearest end of the vessel graph, and the lumen's radius there."""
    degrees = np.bincount([node for edge in vessel.edges for node in (edge.start, edge.end)], minlength=len(vessel.nodes))
    found = [
        (float(np.hypot(*(vessel.nodes[node] - place))), float(radius))
        for edge in vessel.edges
        for node, radius in ((edge.start, edge.radius[0]), (edge.end, edge.radius[-1]))
        if degrees[node] == 1
    ]
    return min(found, default=(np.inf, 0.0))


def is_at_vessel_end(place: Points, around: Surroundings) -> bool:
    """Whether a place (2,) lies at an end of the vessel graph."""
    if around.vessel is None:
        return False
    return _is_near(*_distance_to_vessel_end(place, around.vessel))


def _is_near(distance: float, radius: float) -> bool:
    """Whether a place at this distance from an end of the vessel with this radius lies at it."""
    return distance <= 2.0 * radius + 5.0


def _at_vessel_end(points: Points, around: Surroundings) -> float:
    if around.vessel is None or not around.vessel.edges:
        return 0.0
    here, radius = _distance_to_vessel_end(points[0], around.vessel)
    there, _ = _distance_to_vessel_end(points[-1], around.vessel)
    return float(_is_near(here, radius) and here < NEARER_BY * there)


def _from_opening(points: Points, around: Surroundings) -> float:
    """Negative distance in px, along the vessel, from this end to the vessel's only opening: an end of it at the image border.

    0 without one, or with several.
    """
    graph = around.vessel
    if graph is None or not graph.edges:
        return 0.0
    degrees = np.bincount([node for edge in graph.edges for node in (edge.start, edge.end)], minlength=len(graph.nodes))
    openings = [node for node in graph.nodes[degrees == 1] if _is_at_border(node, around.masks.vessel, around.config)]
    if len(openings) != 1:
        return 0.0
    (x, y), (to_x, to_y) = points[0], openings[0]
    route = plan_route(graph, (float(x), float(y)), (float(to_x), float(to_y)))
    return -route.length_px if route is not None else 0.0


def _thickness(points: Points, around: Surroundings) -> float:
    """Logarithm of the robot's radius near this end."""
    x, y, width, height = cv2.boundingRect(np.rint(points).astype(np.int32))
    margin = 32
    left, top = max(x - margin, 0), max(y - margin, 0)
    window = np.ascontiguousarray(around.masks.robot[top : y + height + margin, left : x + width + margin])
    distance = cv2.distanceTransform(window.view(np.uint8), cv2.DIST_L2, 3)
    part_px = min(END_PART_PX, 0.3 * float(geometry.arc_length(points)[-1]))
    places = np.rint(geometry.cut(points, 0.2 * part_px, part_px)).astype(int) - (left, top)
    return float(np.log(max(np.median(distance[places[:, 1], places[:, 0]]), 0.5)))


def _vessel_end_distance(points: Points, around: Surroundings) -> float:
    if around.vessel is None or not around.vessel.edges:
        return 0.0
    return -_distance_to_vessel_end(points[0], around.vessel)[0]
