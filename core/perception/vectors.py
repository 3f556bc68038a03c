"""Straight lines through the robot's last 40 px and through the vessel's centerline beside the head (METHOD section 5)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from core.perception import polyline
from core.types import Centerline, Point, Points, Vector

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
    total = float(polyline.arc_length(points)[-1])
    return fit_line(polyline.cut(points, total - length_px, total), fit)


def fit_vessel_vector(centerline: Centerline, fit: LineFit = "total_least_squares") -> Vector | None:
    """The line through the piece of centerline beside the head, in the robot's direction of travel; None as for the robot."""
    return fit_line(centerline.piece, fit)


def fit_line(piece: Points, fit: LineFit = "total_least_squares") -> Vector | None:
    """Least-squares line through a piece of path, directed from its first to its last point.

    By default the distances *across* the line are made least, of points resampled evenly, so that densely traced parts weigh no
    more than others. With ``fit = "least_squares"`` it is the linear regression that the paper's "linear fitting" means: of the
    points as they are, with errors in y only (in x for a piece that is steeper than it is wide).
    """
    even = polyline.resample(piece, 1.0) if fit == "total_least_squares" else piece
    if len(even) < 2 or float(polyline.arc_length(piece)[-1]) < MIN_LENGTH_PX:
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
