"""Straight lines through the robot's last 40 px and through the vessel's centerline beside the head (METHOD section 5).

Where the vessel's wall is, roughly, from any place in the lumen; and which places lie in one lumen.
"""

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
"""A shorter piece says nothing about a direction: its pixels' rounding alone turns it by more than 10 degrees."""


def fit_robot_vector(points: Points, length_px: float, fit: LineFit = "total_least_squares") -> Vector | None:
    """The line through the last `length_px` of the robot's path, pointing to the head.

    Parameters
    ----------
    points : robot's centerline (N, 2), tail -> head.
    length_px : arc length that is used, counted back from the head; a shorter path is used whole.
    fit : how the line is fitted, see ``fit_line``.

    Returns
    -------
    Vector with ``end`` = foot of the head on the line, ``start`` = foot of the point `length_px` back, or None when the piece is
    shorter than ``MIN_LENGTH_PX`` or has no direction (it ends where it began).
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

    By default the distances *across* the line are made least, of points resampled evenly, so that densely traced parts weigh no
    more than others. With ``fit = "least_squares"`` it is the linear regression that the paper's "linear fitting" means: of the
    points as they are, with errors in y only (in x for a piece that is steeper than it is wide).
    """
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
    start, center, end = (_point(mean + along * direction) for along in (first, 0.5 * (first + last), last))
    return Vector(start, center, end)


def _point(values: Points) -> Point:
    return float(values[0]), float(values[1])


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
        return 2.0 * geometry.sample(self._map, points / 2.0) + EROSION_PX


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
