"""Vectors: straight lines through the robot's last 40 px and the centerline beside its head (METHOD section 5); lumen geometry."""

from __future__ import annotations

import math
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.types import Centerline, Mask, Point, Points, Vector

LineFit = Literal["total_least_squares", "least_squares"]
MIN_LENGTH_PX = 4.0
"""A shorter piece has no direction: the rounding of its pixels alone turns it by more than 10 degrees."""


def fit_robot_vector(points: Points, length_px: float, fit: LineFit = "total_least_squares") -> Vector | None:
    """The line through the last `length_px` of the robot's path (N, 2), tail -> head; a shorter path is used whole.

    ``end`` is the projection of the head on the line, ``start`` that of the point `length_px` back. None when the piece is
    shorter than ``MIN_LENGTH_PX`` or has no direction (it ends where it began). `fit` is as in ``fit_line``.
    """
    if len(points) < 2:
        return None
    total = float(geometry.arc_length(points)[-1])
    return fit_line(geometry.cut(points, total - length_px, total), fit)


def fit_vessel_vector(centerline: Centerline, fit: LineFit = "total_least_squares") -> Vector | None:
    """The line through the piece of centerline beside the head, in the robot's direction of travel; None as for the robot."""
    return fit_line(centerline.piece, fit)


def fit_line(piece: Points, fit: LineFit = "total_least_squares") -> Vector | None:
    """Least-squares line through a piece of path, directed from its first to its last point.

    By default it minimises the distances across the line, of points resampled evenly, so that densely traced parts weigh no more
    than others. ``fit = "least_squares"`` is linear regression, the paper's "linear fitting", of the points as they are, with
    errors in y only (in x for a piece that is steeper than it is wide)."""
    even = geometry.resample(piece, 1.0) if fit == "total_least_squares" else piece
    if len(even) < 2 or float(geometry.arc_length(piece)[-1]) < MIN_LENGTH_PX:
        return None
    mean = even.mean(axis=0)
    offset = even - mean
    sxx, syy, sxy = float(offset[:, 0] @ offset[:, 0]), float(offset[:, 1] @ offset[:, 1]), float(offset[:, 0] @ offset[:, 1])
    if fit == "total_least_squares":
        angle = 0.5 * np.arctan2(2.0 * sxy, sxx - syy)
    else:
        angle = np.arctan2(sxy, sxx) if sxx >= syy else np.arctan2(syy, sxy)
    direction = np.array([np.cos(angle), np.sin(angle)])
    first, last = float((piece[0] - mean) @ direction), float((piece[-1] - mean) @ direction)
    if abs(last - first) < 1e-6:
        return None
    places = (mean + along * direction for along in (first, 0.5 * (first + last), last))
    start, center, end = ((float(x), float(y)) for x, y in places)
    return Vector(start, center, end)


EROSION_PX = 0.9
"""Distance to the wall that one step of erosion takes, on average."""
_STEP_PX = 0.5
_WALL_STEPS = 2
"""The thinnest wall that a mask can show; a line that touches a corner of one pixel is within it for less."""


class RadiusMap:
    """Distance to the wall in px at sub-pixel places, from a distance map of every second pixel (0.2 ms instead of 0.9 ms).

    One step of erosion makes the thinnest wall visible on the coarse grid. It takes 0.5 to 1.3 px, depending on the wall's
    direction (measured on straight tubes), so ``EROSION_PX`` is added."""

    def __init__(self, mask: Mask) -> None:
        cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        half = cv2.erode(mask.view(np.uint8), cross, borderType=cv2.BORDER_REPLICATE)[::2, ::2]
        distance = cv2.distanceTransform(np.ascontiguousarray(half), cv2.DIST_L2, 5)
        # A mask that fills the image has no wall, and its distance would be the largest possible number.
        self._map = np.minimum(np.asarray(distance, np.float32), np.float32(max(half.shape)))

    def at(self, points: Points) -> NDArray[np.float64]:
        return 2.0 * geometry.sample(self._map, points / 2.0) + EROSION_PX


def is_walled_off(place: Point, other: Point, vessel: Mask) -> bool:
    """Whether two places lie in two lumens: the straight line between them leaves the vessel's mask (h, w) and enters it again.

    Parts outside at either end do not count: the robot bulges a wall, and a centerline runs on through a gap in the mask.
    """
    steps = max(1, math.ceil(math.dist(place, other) / _STEP_PX))
    width = vessel.shape[1]
    share = np.arange(steps + 1) / steps
    columns = np.minimum(np.maximum(np.rint(place[0] + share * (other[0] - place[0])), 0), width - 1).astype(np.intp)
    rows = np.rint(place[1] + share * (other[1] - place[1])).astype(np.intp)
    inside = vessel.take(rows * width + columns, mode="clip").nonzero()[0]
    return len(inside) > 0 and int(inside[-1] - inside[0]) + 1 - len(inside) >= _WALL_STEPS


def project(
    points: Points, place: Point, vessel: Mask | None, along: NDArray[np.float64] | None = None
) -> tuple[float, float, Point] | None:
    """Project a place on a centerline within its own lumen; the result is that of ``geometry.nearest``.

    Where vessels lie side by side, or one bends back beside itself, the nearest place of all may be beyond a wall. Then the other
    local minima of the distance are tried, the nearest first. None where a wall lies before all of them. Without a mask (None)
    walls are ignored.
    """
    along = geometry.arc_length(points) if along is None else along
    found = geometry.nearest(points, place, along)
    if vessel is None or not is_walled_off(place, found[2], vessel):
        return found
    distance = np.hypot(points[:, 0] - place[0], points[:, 1] - place[1])
    padded = np.concatenate([[np.inf], distance, [np.inf]])
    lowest = np.flatnonzero((distance <= padded[:-2]) & (distance <= padded[2:]))
    for index in lowest[np.argsort(distance[lowest])].tolist():
        first, last = max(index - 1, 0), min(index + 2, len(points))
        found = geometry.nearest(points[first:last], place, along[first:last])
        if not is_walled_off(place, found[2], vessel):
            return found
    return None
