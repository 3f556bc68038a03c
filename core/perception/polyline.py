"""Arc length on polylines: what several stages of the method need. Points are (N, 2), columns x, y, in pixels."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from core.types import Point, Points

BEND_SHARE = 0.5
"""So much of a line's bend is continued beyond its end: noise bends too."""
REMAP_ROWS = 32_000
"""OpenCV's remap takes less than 32767 rows at a time."""


def arc_length(points: Points) -> NDArray[np.float64]:
    """Distance walked from the first point to each point, shape (N,)."""
    # Called some fifty times a frame: plain ufuncs take a third of the time of diff, cumsum and concatenate.
    along = np.zeros(max(len(points), 1))
    steps = points[1:] - points[:-1]
    np.hypot(steps[:, 0], steps[:, 1], out=along[1:])
    np.add.accumulate(along, out=along)
    return along


def point_at(points: Points, along: NDArray[np.float64], position: NDArray[np.float64]) -> Points:
    """Points at arc-length `position` (M,), given the polyline's ``arc_length`` `along`; clamped to its ends. Shape (M, 2)."""
    found = np.empty((len(position), 2))
    found[:, 0] = np.interp(position, along, points[:, 0])
    found[:, 1] = np.interp(position, along, points[:, 1])
    return found


def resample(points: Points, step_px: float) -> Points:
    """Points evenly spaced by about `step_px` along the polyline, both ends kept; a single point stays as it is."""
    along = arc_length(points)
    total = float(along[-1])
    if total == 0.0:
        return points[:1]
    count = max(2, round(total / step_px) + 1)
    marks = np.arange(count, dtype=np.float64)
    marks *= total / (count - 1)
    marks[-1] = total
    return point_at(points, along, marks)


def cut(points: Points, start_px: float, end_px: float, along: NDArray[np.float64] | None = None) -> Points:
    """The part of the polyline between two arc-length positions, clamped to its ends; inner corners are kept.

    `along` is the polyline's ``arc_length``, where it is known already.
    """
    along = arc_length(points) if along is None else along
    start, end = max(start_px, 0.0), min(end_px, float(along[-1]))
    first, last = int(along.searchsorted(start, "right")), int(along.searchsorted(end))
    inner = points[first:last]
    part = np.empty((len(inner) + 2, 2))
    part[1:-1] = inner
    part[[0, -1]] = point_at(points, along, np.array([start, end]))
    return part


def continued(points: Points, length_px: float, over_px: float) -> Points:
    """How a polyline would go on from its last point, bending as it did before: a point every px, the last point first.

    Its direction and its bend are taken over the last `over_px`, or all of a shorter line, and ``BEND_SHARE`` of the bend goes on.
    """
    along = arc_length(points)
    total = float(along[-1])
    back_px = min(over_px, total)
    last, middle, first = point_at(points, along, np.array([total, total - 0.5 * back_px, total - back_px])).tolist()
    before = math.atan2(middle[1] - first[1], middle[0] - first[0])
    after = math.atan2(last[1] - middle[1], last[0] - middle[0])
    turn = (after - before + math.pi) % (2.0 * math.pi) - math.pi
    per_px = BEND_SHARE * turn / max(0.5 * back_px, 1.0)
    # From the middle of the last half, where its chord has the line's direction, to each further step.
    headings = after + per_px * (0.25 * back_px + 0.5 + np.arange(int(length_px)))
    onward = np.empty((len(headings) + 1, 2))
    onward[0] = last
    np.cos(headings, out=onward[1:, 0])
    np.sin(headings, out=onward[1:, 1])
    return np.add.accumulate(onward, axis=0, out=onward)


def nearest(points: Points, point: Point, along: NDArray[np.float64] | None = None) -> tuple[float, float, Point]:
    """The place on the polyline nearest to `point`: its distance, its arc-length position, and the place itself.

    `along` is the polyline's ``arc_length``, where it is known already.
    """
    if len(points) == 1:
        foot = float(points[0, 0]), float(points[0, 1])
        return float(np.hypot(foot[0] - point[0], foot[1] - point[1])), 0.0, foot
    distance, share = distance_to_segments(points[:-1], points[1:], point)
    best = int(np.argmin(distance))
    place = points[best] + share[best] * (points[best + 1] - points[best])
    along = arc_length(points) if along is None else along
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


def smooth(points: Points, sigma: float, *, keeps_bends: bool = False) -> Points:
    """Smoothing along a polyline, `sigma` in points; both ends stay where they are.

    Gaussian means draw a bend inwards, by sigma^2 / 2R on a circle of radius R. With `keeps_bends` the weights have no second
    moment, so that parabolas stay as they are, for some more noise at the same sigma.
    """
    pad = min(len(points) - 1, int(np.ceil(3.0 * sigma)))
    return points if pad < 1 else filtered(np.concatenate(mirrored(points, pad)), pad, sigma, keeps_bends=keeps_bends)


def mirrored(points: Points, pad: int) -> tuple[Points, Points, Points]:
    """A polyline between its own first and last `pad` points, mirrored through its ends.

    The line goes on straight there: smoothed, it does not shrink, and the end itself is kept.
    """
    return 2.0 * points[0] - points[pad:0:-1], points, 2.0 * points[-1] - points[-2 : -pad - 2 : -1]


def filtered(points: Points, pad: int, sigma: float, *, keeps_bends: bool = False) -> Points:
    """Weighted means of 2 `pad` + 1 neighbouring points each, as ``smooth`` has it, shape (N - 2 pad, 2)."""
    kernel = _bend_keeping(pad, sigma) if keeps_bends else _gaussian(pad, sigma)
    smoothed = np.empty((len(points) - 2 * pad, 2))
    for axis in (0, 1):
        smoothed[:, axis] = np.correlate(points[:, axis], kernel)
    return smoothed


def sample(values: NDArray[np.float32], points: Points) -> NDArray[np.float64]:
    """A map (h, w) at sub-pixel places (..., 2), bilinear; places beyond its border get the border's value. Shape (...)."""
    return sample_at(values, points[..., 0], points[..., 1])


def sample_at(values: NDArray[np.float32], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """``sample`` at places given by their coordinates, two arrays of one shape."""
    if x.size == 0:
        return np.zeros(x.shape)
    across, down = x.astype(np.float32).reshape(-1), y.astype(np.float32).reshape(-1)
    found = np.empty(x.shape)
    flat = found.reshape(-1)
    for first in range(0, len(across), REMAP_ROWS):
        part = slice(first, first + REMAP_ROWS)
        seen = cv2.remap(values, across[part], down[part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        flat[part] = seen.ravel()
    return found


def median(values: NDArray[np.float64]) -> float:
    """Median of some ten to hundred numbers: for so few a sorted list takes a tenth of what ``np.median`` does."""
    ordered: list[float] = sorted(values.tolist())
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])


@lru_cache(maxsize=64)
def _gaussian(pad: int, sigma: float) -> NDArray[np.float64]:
    kernel = np.exp(-0.5 * (np.arange(-pad, pad + 1) / sigma) ** 2)
    return np.asarray(kernel / kernel.sum())


def normals(points: Points) -> Points:
    """Unit vectors across a polyline of at least two points, (N, 2)."""
    tangent = np.empty_like(points)
    tangent[1:-1] = points[2:] - points[:-2]
    tangent[0], tangent[-1] = points[1] - points[0], points[-1] - points[-2]
    return across(tangent)


def across(tangent: Points) -> Points:
    """Unit vectors (N, 2) at right angles to some tangents of any length, to their right as seen on screen."""
    length = np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)
    unit = np.empty_like(tangent)
    np.divide(-tangent[:, 1], length, out=unit[:, 0])
    np.divide(tangent[:, 0], length, out=unit[:, 1])
    return unit


@lru_cache(maxsize=64)
def _bend_keeping(pad: int, sigma: float) -> NDArray[np.float64]:
    """A Gaussian times the parabola that leaves it the sum 1 and no second moment; too short for that, the Gaussian."""
    if pad < 2:
        return _gaussian(pad, sigma)
    square = (np.arange(-pad, pad + 1) / sigma) ** 2
    gaussian = np.exp(-0.5 * square)
    zeroth, second, fourth = (float((gaussian * square**power).sum()) for power in range(3))
    return np.asarray(gaussian * (fourth - second * square) / (zeroth * fourth - second**2))
