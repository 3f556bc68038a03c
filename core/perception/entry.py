"""Which end of the robot is its tail: the one where it enters (METHOD section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from core.config import PathConfig
from core.perception import polyline
from core.types import Masks, Point, Points, RobotPath, VesselGraph

END_PART_PX = 20.0
THICKER_BY = 1.25
"""A tail this much thicker than the head is taken for one; less is noise of the mask."""
NEARER_BY = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What tells tail from head, besides the path itself."""

    masks: Masks
    previous: RobotPath | None
    vessel: VesselGraph | None
    port: Point | None
    config: PathConfig


def is_entry(place: Points, around: Surroundings) -> bool:
    """Whether a place (2,) lies at the image border or at the insertion port."""
    height, width = around.masks.robot.shape
    x, y = float(place[0]), float(place[1])
    if min(x, y, width - 1 - x, height - 1 - y) <= around.config.border_px:
        return True
    return around.port is not None and float(np.hypot(x - around.port[0], y - around.port[1])) <= around.config.port_px


def tail_first(points: Points, radius_px: float, around: Surroundings) -> Points:
    """The path ordered from tail to head.

    Asked in this order, the first clear answer counts: the one end at border or port; the last frame's tail and head; the one end
    outside the vessel; the end at an end of the vessel; the thicker end; and at last the end nearer to an end of the vessel.
    """
    for tail_score in (_entry, _as_before, _outside_vessel, _at_vessel_end, _thickness, _vessel_end_distance):
        first, last = tail_score(points, radius_px, around), tail_score(points[::-1], radius_px, around)
        if first != last:
            return points if first > last else points[::-1]
    return points


def _entry(points: Points, _radius_px: float, around: Surroundings) -> float:
    return float(is_entry(points[0], around))


def _as_before(points: Points, _radius_px: float, around: Surroundings) -> float:
    if around.previous is None:
        return 0.0
    before = around.previous.points
    return -float(np.hypot(*(points[0] - before[0])) + np.hypot(*(points[-1] - before[-1])))


def _outside_vessel(points: Points, radius_px: float, around: Surroundings) -> float:
    part = np.rint(polyline.cut(points, 0.0, max(3.0 * radius_px, 6.0))).astype(int)
    height, width = around.masks.vessel.shape
    inside = around.masks.vessel[np.clip(part[:, 1], 0, height - 1), np.clip(part[:, 0], 0, width - 1)]
    return float(inside.mean() < 0.5)


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


def _at_vessel_end(points: Points, _radius_px: float, around: Surroundings) -> float:
    if around.vessel is None or not around.vessel.edges:
        return 0.0
    here, radius = _distance_to_vessel_end(points[0], around.vessel)
    there, _ = _distance_to_vessel_end(points[-1], around.vessel)
    return float(here <= 2.0 * radius + 5.0 and here < NEARER_BY * there)


def _thickness(points: Points, _radius_px: float, around: Surroundings) -> float:
    distance = cv2.distanceTransform(np.ascontiguousarray(around.masks.robot).view(np.uint8), cv2.DIST_L2, 3)

    def thick(part: Points) -> float:
        places = np.rint(part).astype(int)
        return float(np.median(distance[places[:, 1], places[:, 0]]))

    length = float(polyline.arc_length(points)[-1])
    part = min(END_PART_PX, 0.3 * length)
    here, there = thick(polyline.cut(points, 0.2 * part, part)), thick(polyline.cut(points, length - part, length - 0.2 * part))
    return float(here > THICKER_BY * there)


def _vessel_end_distance(points: Points, _radius_px: float, around: Surroundings) -> float:
    if around.vessel is None or not around.vessel.edges:
        return 0.0
    return -_distance_to_vessel_end(points[0], around.vessel)[0]
