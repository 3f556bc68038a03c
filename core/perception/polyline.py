"""Arc length on polylines: what several stages of the method need. Points are (N, 2), columns x, y, in pixels."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from core.types import Point, Points

REMAP_ROWS = 32_000
"""OpenCV's remap takes less than 32767 rows at a time."""


def arc_length(points: Points) -> NDArray[np.float64]:
    """Distance walked from the first point to each point, shape (N,)."""
    steps = np.diff(points, axis=0)
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])


def point_at(points: Points, along: NDArray[np.float64], position: NDArray[np.float64]) -> Points:
    """Points at arc-length `position` (M,), given the polyline's ``arc_length`` `along`; clamped to its ends. Shape (M, 2)."""
    return np.column_stack([np.interp(position, along, points[:, 0]), np.interp(position, along, points[:, 1])])


def resample(points: Points, step_px: float) -> Points:
    """Points evenly spaced by about `step_px` along the polyline, both ends kept; a single point stays as it is."""
    along = arc_length(points)
    if along[-1] == 0.0:
        return points[:1]
    count = max(2, round(along[-1] / step_px) + 1)
    return point_at(points, along, np.linspace(0.0, along[-1], count))


def cut(points: Points, start_px: float, end_px: float) -> Points:
    """The part of the polyline between two arc-length positions, clamped to its ends; inner corners are kept."""
    along = arc_length(points)
    start, end = max(start_px, 0.0), min(end_px, float(along[-1]))
    inner = points[(along > start) & (along < end)]
    ends = point_at(points, along, np.array([start, end]))
    return np.concatenate([ends[:1], inner, ends[1:]])


def nearest(points: Points, point: Point) -> tuple[float, float, Point]:
    """The place on the polyline nearest to `point`: its distance, its arc-length position, and the place itself."""
    if len(points) == 1:
        foot = float(points[0, 0]), float(points[0, 1])
        return float(np.hypot(foot[0] - point[0], foot[1] - point[1])), 0.0, foot
    distance, share = distance_to_segments(points[:-1], points[1:], point)
    best = int(np.argmin(distance))
    place = points[best] + share[best] * (points[best + 1] - points[best])
    along = arc_length(points)
    position = along[best] + share[best] * (along[best + 1] - along[best])
    return float(distance[best]), float(position), (float(place[0]), float(place[1]))


def distance_to_segments(start: Points, end: Points, point: Point) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance of `point` to each segment (M,), and where on the segment its foot lies, 0 at `start` to 1 at `end` (M,)."""
    step = end - start
    offset = np.asarray(point, np.float64) - start
    square = np.maximum(np.einsum("ij,ij->i", step, step), 1e-12)
    share = np.clip(np.einsum("ij,ij->i", offset, step) / square, 0.0, 1.0)
    gap = offset - share[:, None] * step
    return np.hypot(gap[:, 0], gap[:, 1]), share


def smooth(points: Points, sigma: float) -> Points:
    """Gaussian smoothing along a polyline, `sigma` in points; both ends stay where they are."""
    pad = min(len(points) - 1, int(np.ceil(3.0 * sigma)))
    if pad < 1:
        return points
    kernel = _gaussian(pad, sigma)
    # Mirrored through its end point, the line goes on straight there: no shrinking, and the end itself is kept.
    longer = np.concatenate([2.0 * points[0] - points[pad:0:-1], points, 2.0 * points[-1] - points[-2 : -pad - 2 : -1]])
    return np.column_stack([np.convolve(longer[:, 0], kernel, mode="valid"), np.convolve(longer[:, 1], kernel, mode="valid")])


def sample(values: NDArray[np.float32], points: Points) -> NDArray[np.float64]:
    """A map (h, w) at sub-pixel places (..., 2), bilinear; places beyond its border get the border's value. Shape (...)."""
    if points.size == 0:
        return np.zeros(points.shape[:-1])
    x, y = (np.ascontiguousarray(points[..., axis], np.float32).reshape(-1, 1) for axis in (0, 1))
    parts = [slice(first, first + REMAP_ROWS) for first in range(0, len(x), REMAP_ROWS)]
    found = [cv2.remap(values, x[part], y[part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for part in parts]
    return np.concatenate(found).astype(np.float64).reshape(points.shape[:-1])


@lru_cache(maxsize=64)
def _gaussian(pad: int, sigma: float) -> NDArray[np.float64]:
    kernel = np.exp(-0.5 * (np.arange(-pad, pad + 1) / sigma) ** 2)
    return np.asarray(kernel / kernel.sum())


def normals(points: Points) -> Points:
    """Unit vectors across a polyline of at least two points, (N, 2)."""
    tangent = np.empty_like(points)
    tangent[1:-1] = points[2:] - points[:-2]
    tangent[0], tangent[-1] = points[1] - points[0], points[-1] - points[-2]
    length = np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)
    return np.column_stack([-tangent[:, 1] / length, tangent[:, 0] / length])
