"""Where the vessel's wall is, roughly, from any place in the lumen; and which places lie in one lumen."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Mask, Point, Points

EROSION_PX = 0.9
_STEP_PX = 0.5
_WALL_STEPS = 2
"""As thin as the thinnest wall that a mask can show; a line that touches a corner of one pixel is within it for less."""


class RadiusMap:
    """Distance to the wall in px at sub-pixel places, from a distance map of every second pixel (0.2 ms instead of 0.9 ms).

    One step of erosion lets the thinnest wall show on the coarse grid. It takes 0.5 to 1.3 px, depending on the wall's direction
    (measured on straight tubes), so ``EROSION_PX`` is given back.
    """

    def __init__(self, mask: Mask) -> None:
        cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        half = cv2.erode(mask.view(np.uint8), cross, borderType=cv2.BORDER_REPLICATE)[::2, ::2]
        distance = cv2.distanceTransform(np.ascontiguousarray(half), cv2.DIST_L2, 5)
        # A mask that fills the image has no wall, and its distance would be the largest number there is.
        self._map = np.minimum(np.asarray(distance, np.float32), np.float32(max(half.shape)))

    def at(self, points: Points) -> NDArray[np.float64]:
        return 2.0 * polyline.sample(self._map, points / 2.0) + EROSION_PX


def is_walled_off(place: Point, other: Point, vessel: Mask) -> bool:
    """Whether the straight line between two places leaves the vessel's mask (h, w) and comes into it again: they lie in two lumens.

    What lies outside at either end does not count: the robot bulges a wall, and a centerline runs on through a gap in the mask.
    """
    steps = max(1, math.ceil(math.dist(place, other) / _STEP_PX))
    width = vessel.shape[1]
    share = np.arange(steps + 1) / steps
    columns = np.minimum(np.maximum(np.rint(place[0] + share * (other[0] - place[0])), 0), width - 1).astype(np.intp)
    rows = np.rint(place[1] + share * (other[1] - place[1])).astype(np.intp)
    inside = vessel.take(rows * width + columns, mode="clip").nonzero()[0]
    return len(inside) > 0 and int(inside[-1] - inside[0]) + 1 - len(inside) >= _WALL_STEPS


def foot(
    points: Points, place: Point, vessel: Mask | None, along: NDArray[np.float64] | None = None
) -> tuple[float, float, Point] | None:
    """The place of a centerline that is nearest to a place within its own lumen, as ``polyline.nearest`` tells it.

    Where vessels lie side by side, or one bends back beside itself, the nearest place of all may be beyond a wall. Then the other
    places are asked to which the distance has a minimum, the nearest first. None where a wall lies before all of them; without a
    mask (None) nobody can tell.
    """
    along = polyline.arc_length(points) if along is None else along
    found = polyline.nearest(points, place, along)
    if vessel is None or not is_walled_off(place, found[2], vessel):
        return found
    distance = np.hypot(points[:, 0] - place[0], points[:, 1] - place[1])
    padded = np.concatenate([[np.inf], distance, [np.inf]])
    lowest = np.flatnonzero((distance <= padded[:-2]) & (distance <= padded[2:]))
    for index in lowest[np.argsort(distance[lowest])].tolist():
        first, last = max(index - 1, 0), min(index + 2, len(points))
        found = polyline.nearest(points[first:last], place, along[first:last])
        if not is_walled_off(place, found[2], vessel):
            return found
    return None
