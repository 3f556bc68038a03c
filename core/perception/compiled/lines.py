"""Polylines, each alone or many one after the other: for ``polyline`` and ``bundle``."""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64
from numpy.typing import NDArray

from core.perception.compiled.jit import POINTS, STARTS, VALUES, compiled


@compiled((POINTS,))
def arc_length(points: NDArray[np.float64]) -> NDArray[np.float64]:
    along = np.zeros(max(len(points), 1))
    for i in range(1, len(points)):
        along[i] = along[i - 1] + math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
    return along


@compiled((VALUES, float64))
def _last_up_to(along: NDArray[np.float64], position: float) -> int:
    """The last of the ascending values that is at most `position`; -1 for none."""
    low, high = 0, len(along)
    while low < high:
        middle = (low + high) // 2
        if along[middle] <= position:
            low = middle + 1
        else:
            high = middle
    return low - 1


@compiled((POINTS, VALUES, float64, float64[:]))
def _place_at(points: NDArray[np.float64], along: NDArray[np.float64], position: float, place: NDArray[np.float64]) -> None:
    k = _last_up_to(along, position)
    if k < 0 or k >= len(points) - 1 or along[k] == position:
        k = min(max(k, 0), len(points) - 1)
        place[0], place[1] = points[k, 0], points[k, 1]
        return
    share = (position - along[k]) / (along[k + 1] - along[k])
    for axis in range(2):
        place[axis] = points[k, axis] + share * (points[k + 1, axis] - points[k, axis])


@compiled((POINTS, VALUES, VALUES))
def point_at(points: NDArray[np.float64], along: NDArray[np.float64], position: NDArray[np.float64]) -> NDArray[np.float64]:
    found = np.empty((len(position), 2))
    for i in range(len(position)):
        _place_at(points, along, position[i], found[i])
    return found


@compiled((POINTS, float64))
def resample(points: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    along = arc_length(points)
    total = along[-1]
    if total == 0.0:
        return points[:1].copy()
    if not math.isfinite(total / step):
        raise ValueError("a line of points that are no numbers, or steps of nothing")
    count = max(2, int(np.rint(total / step)) + 1)
    found = np.empty((count, 2))
    for i in range(count - 1):
        _place_at(points, along, i * (total / (count - 1)), found[i])
    _place_at(points, along, total, found[count - 1])
    return found


@compiled((POINTS, float64, float64, VALUES))
def cut(points: NDArray[np.float64], start: float, end: float, along: NDArray[np.float64]) -> NDArray[np.float64]:
    start, end = max(start, 0.0), min(end, along[-1])
    first, last = _last_up_to(along, start) + 1, int(np.searchsorted(along, end))
    inner = max(last - first, 0)
    part = np.empty((inner + 2, 2))
    _place_at(points, along, start, part[0])
    part[1 : inner + 1] = points[first : first + inner]
    _place_at(points, along, end, part[inner + 1])
    return part


@compiled((POINTS, float64, float64, VALUES))
def nearest(points: NDArray[np.float64], x: float, y: float, along: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Distance, position along the line, and the place (x, y)."""
    if len(points) == 1:
        return math.hypot(points[0, 0] - x, points[0, 1] - y), 0.0, points[0, 0], points[0, 1]
    least, best, share = math.inf, 0, 0.0
    for i in range(len(points) - 1):
        along_x, along_y = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        to_x, to_y = x - points[i, 0], y - points[i, 1]
        part = min(max((to_x * along_x + to_y * along_y) / max(along_x * along_x + along_y * along_y, 1e-12), 0.0), 1.0)
        gap_x, gap_y = to_x - part * along_x, to_y - part * along_y
        square = gap_x * gap_x + gap_y * gap_y
        if square < least:
            least, best, share = square, i, part
    return (
        math.sqrt(least),
        along[best] + share * (along[best + 1] - along[best]),
        points[best, 0] + share * (points[best + 1, 0] - points[best, 0]),
        points[best, 1] + share * (points[best + 1, 1] - points[best, 1]),
    )


@compiled((POINTS, float64, float64, float64))
def continued(points: NDArray[np.float64], length_px: float, over_px: float, bend_share: float) -> NDArray[np.float64]:
    along = arc_length(points)
    total = along[-1]
    back_px = min(over_px, total)
    last, middle, first = np.empty(2), np.empty(2), np.empty(2)
    _place_at(points, along, total, last)
    _place_at(points, along, total - 0.5 * back_px, middle)
    _place_at(points, along, total - back_px, first)
    before = math.atan2(middle[1] - first[1], middle[0] - first[0])
    after = math.atan2(last[1] - middle[1], last[0] - middle[0])
    turn = (after - before + math.pi) % (2.0 * math.pi) - math.pi
    per_px = bend_share * turn / max(0.5 * back_px, 1.0)
    count = max(int(length_px), 0)
    onward = np.empty((count + 1, 2))
    onward[0] = last
    for i in range(count):
        # From the middle of the last half, where its chord has the line's direction, to each further step.
        heading = after + per_px * (0.25 * back_px + 0.5 + i)
        onward[i + 1, 0] = onward[i, 0] + math.cos(heading)
        onward[i + 1, 1] = onward[i, 1] + math.sin(heading)
    return onward


@compiled((int64, float64, boolean))
def _weights(pad: int, sigma: float, keeps_bends: bool) -> NDArray[np.float64]:
    """A Gaussian of the sum 1; to keep bends, times the parabola that leaves it no second moment, unless it is too short."""
    square = np.empty(2 * pad + 1)
    weights = np.empty(2 * pad + 1)
    zeroth = second = fourth = 0.0
    for i in range(2 * pad + 1):
        square[i] = ((i - pad) / sigma) ** 2
        weights[i] = math.exp(-0.5 * square[i])
        zeroth += weights[i]
        second += weights[i] * square[i]
        fourth += weights[i] * square[i] * square[i]
    if not keeps_bends or pad < 2:
        return weights / zeroth
    return weights * (fourth - second * square) / (zeroth * fourth - second * second)


@compiled((POINTS, VALUES, float64[:, :]))
def _filter(points: NDArray[np.float64], weights: NDArray[np.float64], smoothed: NDArray[np.float64]) -> None:
    """Weighted means, the line mirrored through its ends: so it goes on straight there, and does not shrink."""
    count, pad = len(points), len(weights) // 2
    padded = np.empty(count + 2 * pad)
    for axis in range(2):
        for i in range(pad):
            padded[i] = 2.0 * points[0, axis] - points[pad - i, axis]
            padded[count + pad + i] = 2.0 * points[count - 1, axis] - points[count - 2 - i, axis]
        for i in range(count):
            padded[pad + i] = points[i, axis]
        for i in range(count):
            total = 0.0
            for k in range(2 * pad + 1):
                total += weights[k] * padded[i + k]
            smoothed[i, axis] = total


@compiled((POINTS, STARTS, float64, boolean))
def smooth(points: NDArray[np.float64], starts: NDArray[np.int64], sigma: float, keeps_bends: bool) -> NDArray[np.float64]:
    """Lines one after the other, each for itself; one too short for all of the weights gets as many as it has points for."""
    most = int(np.ceil(3.0 * sigma))
    weights = _weights(most, sigma, keeps_bends)
    smoothed = np.empty((len(points), 2))
    for line in range(len(starts) - 1):
        first, last = starts[line], starts[line + 1]
        pad = min(most, last - first - 1)
        if pad < 1:
            smoothed[first:last] = points[first:last]
        else:
            _filter(points[first:last], weights if pad == most else _weights(pad, sigma, keeps_bends), smoothed[first:last])
    return smoothed


@compiled((POINTS, STARTS))
def normals(points: NDArray[np.float64], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Of lines one after the other."""
    across = np.empty((len(points), 2))
    for line in range(len(starts) - 1):
        first, last = starts[line], starts[line + 1] - 1
        for i in range(first, last + 1):
            before, after = max(i - 1, first), min(i + 1, last)
            x, y = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
            length = max(math.hypot(x, y), 1e-9)
            across[i, 0], across[i, 1] = -y / length, x / length
    return across


@compiled((POINTS, STARTS, float64))
def resample_all(
    points: NDArray[np.float64], starts: NDArray[np.int64], step: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Of lines one after the other; with where each one starts."""
    lines = [resample(points[starts[line] : starts[line + 1]], step) for line in range(len(starts) - 1)]
    anew = np.zeros(len(starts), np.int64)
    for i, line in enumerate(lines):
        anew[i + 1] = anew[i] + len(line)
    found = np.empty((anew[-1], 2))
    for i, line in enumerate(lines):
        found[anew[i] : anew[i + 1]] = line
    return found, anew
