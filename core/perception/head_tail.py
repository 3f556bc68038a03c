"""Which end of the robot is its tail: the one where it enters (METHOD section 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from core import geometry
from core.config.models import PathConfig
from core.types import Mask, Masks, Point, Points, RobotPath, VesselGraph

END_PART_PX = 20.0
"""How much of each end is compared for thickness."""
STILL_HEAD_PX = 15.0
"""An end this near to the last frame's head is that head, also where it has just reached the image border, if it was seen to come
there from within the picture, or the robot's other end lies at an end of the vessel."""
ALONG_PX, ALONG_STEP_PX, ALONG_SHARE = 30.0, 10.0, 0.5
"""A robot lies along an earlier path if so much of the shorter of both is no farther from it than a lumen is wide."""
NEAR_PX = 20
"""Where the robot meets the border is looked for this far around an end beside it."""
OUTSIDE_LEAD_PX = 10.0
"""The end that runs this much farther outside the vessel than the other is the tail."""
NEARER_BY = 0.6
"""An end is at the vessel's end only if the other end is clearly farther from one: this share or less of its distance."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What tells tail from head, besides the path itself.

    ``earlier`` is the path from before a gap in a stream, or None. ``came_from_within``: the head of ``previous`` or ``earlier``
    was seen well within the picture before it was where it is.
    """

    masks: Masks
    previous: RobotPath | None
    vessel: VesselGraph | None
    port: Point | None
    config: PathConfig
    earlier: RobotPath | None = None
    came_from_within: bool = False


def is_entry(place: Points, around: Surroundings) -> bool:
    """Whether a place (2,) lies at the image border or at the insertion port."""
    return _is_at_border(place, around.masks.robot, around.config) or _at_port(place, around)


def was_the_head(points: Points, around: Surroundings) -> bool:
    """Whether what is taken for the tail of an ordered path was the head before a gap, and well within the picture by then.

    The path lies as it lay then: nothing has turned it about, but the other end reached the image border while nobody saw it.
    """
    turned = around.came_from_within and _as_earlier(points, around) < -ALONG_STEP_PX
    return turned and not _at_port(points[0], around)


def may_go_on_outside(place: Points, mask: Mask, config: PathConfig) -> bool:
    """Whether the robot's mask meets the image border at a place (2,), so that nobody can tell whether the robot ends there."""
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

    Asked in this order, the first clear answer counts: the one end at border or port (unless it is a head that has just arrived
    there); the last frame's tail and head, or which way the path from before a gap ran here; the end that lies farther outside the
    vessel; the one end at an end of the vessel; the thicker end; and at last the end nearer to an end of the vessel.
    """
    for looks_like_tail, margin in (
        (_entry, 0.5),
        (_as_before, 1.0),
        (_as_earlier, ALONG_STEP_PX),
        (_outside_vessel, OUTSIDE_LEAD_PX),
        (_at_vessel_end, 0.5),
        (_thickness, 0.2),
        (_vessel_end_distance, 0.0),
    ):
        lead = looks_like_tail(points, around) - looks_like_tail(points[::-1], around)
        if abs(lead) > margin:
            return points if lead > 0 else points[::-1]
    return points


def _entry(points: Points, around: Surroundings) -> float:
    before = around.previous or around.earlier
    arrived = before is not None and float(np.hypot(*(points[0] - before.points[-1]))) <= STILL_HEAD_PX
    if arrived and (around.came_from_within or is_at_vessel_end(points[-1], around)):
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
    if around.previous is None:
        return 0.0
    before = around.previous.points
    return -float(np.hypot(*(points[0] - before[0])) + np.hypot(*(points[-1] - before[-1])))


def _as_earlier(points: Points, around: Surroundings) -> float:
    """How far the path goes on along the one of before a gap."""
    return goes_along_px(points, around.earlier.points) if around.earlier is not None else 0.0


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
    """How far the path runs outside the vessel before it enters it, in px."""
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
    """Whether something so far from an end of the vessel, of that radius, lies at it."""
    return distance <= 2.0 * radius + 5.0


def _at_vessel_end(points: Points, around: Surroundings) -> float:
    if around.vessel is None or not around.vessel.edges:
        return 0.0
    here, radius = _distance_to_vessel_end(points[0], around.vessel)
    there, _ = _distance_to_vessel_end(points[-1], around.vessel)
    return float(_is_near(here, radius) and here < NEARER_BY * there)


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
