"""What maps show at sub-pixel places: for ``polyline``, ``vessel_graph`` and ``path_shape``."""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64
from numpy.typing import NDArray

from core.perception.compiled.jit import MAP, MASK, POINTS, STARTS, VALUES, compiled
from core.perception.compiled.lines import smooth


@compiled((MAP, float64, float64), (MASK, float64, float64))
def _value_at(values: NDArray[np.float32] | NDArray[np.bool_], x: float, y: float) -> float:
    height, width = values.shape
    x = min(x, width - 1.0) if x > 0.0 else 0.0  # also what is no number
    y = min(y, height - 1.0) if y > 0.0 else 0.0
    column, row = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    right, down = min(column + 1, width - 1), min(row + 1, height - 1)
    x -= column
    y -= row
    left_above, left_below = 1.0 * values[row, column], 1.0 * values[down, column]
    above = left_above + x * (1.0 * values[row, right] - left_above)
    below = left_below + x * (1.0 * values[down, right] - left_below)
    return float(above + y * (below - above))


@compiled((MAP, VALUES, VALUES), (MASK, VALUES, VALUES))
def sample(values: NDArray[np.float32] | NDArray[np.bool_], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    found = np.empty(len(x))
    for i in range(len(x)):
        found[i] = _value_at(values, x[i], y[i])
    return found


@compiled(*((kind, float64, float64, float64, float64, float64, int64) for kind in (MAP, MASK)))
def wall(
    level: NDArray[np.float32] | NDArray[np.bool_],
    x: float,
    y: float,
    across_x: float,
    across_y: float,
    expected: float,
    search_px: int,
) -> tuple[float, float]:
    """How far a wall is from (x, y), NaN where there is none, and how steeply the level falls there, per px."""
    old = here = math.nan
    distance = farther = 0.0
    for k in range(-search_px, search_px + 1):
        distance, farther = farther, max(expected + k, 0.0)
        there = _value_at(level, x + farther * across_x, y + farther * across_y)
        if there < 0.5:
            if k == -search_px:
                return math.nan, 0.0
            reach = distance + (here - 0.5) / max(here - there, 1e-6)
            steps, inner = (2, old) if k > 1 - search_px else (1, here)
            outer = there
            if k < search_px:
                farther = max(expected + k + 1, 0.0)
                outer = _value_at(level, x + farther * across_x, y + farther * across_y)
                steps += 1
            return reach, (inner - outer) / steps
        old, here = here, there
    return math.nan, 0.0


@compiled((MAP, POINTS, POINTS, VALUES, int64))
def walls(
    level: NDArray[np.float32],
    points: NDArray[np.float64],
    across: NDArray[np.float64],
    expected: NDArray[np.float64],
    search_px: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the level falls through 0.5 to both sides of places with unit vectors across them: distances (2, N), NaN where it does
    not (in a branch's opening, beyond the image's border), and slopes (2, N), per px.

    It is looked for so far to both sides of where it is expected (N,).
    """
    count = len(points)
    reach, slope = np.empty((2, count)), np.empty((2, count))
    for side in range(2):
        sign = 1.0 - 2.0 * side
        for i in range(count):
            reach[side, i], slope[side, i] = wall(
                level, points[i, 0], points[i, 1], sign * across[i, 0], sign * across[i, 1], expected[i], search_px
            )
    return reach, slope


@compiled((MAP, POINTS, STARTS, POINTS, VALUES, int64, float64, float64, float64, float64))
def between_walls(
    level: NDArray[np.float32],
    points: NDArray[np.float64],
    starts: NDArray[np.int64],
    across: NDArray[np.float64],
    expected: NDArray[np.float64],
    search_px: int,
    softest: float,
    sigma: float,
    width_share: float,
    most_px: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of lines one after the other: how far each point lies beside the middle between its walls, and half its width; (N,), (N,)."""
    reach, slope = walls(level, points, across, expected, search_px)
    count = len(points)
    half, sums = np.empty(count), np.zeros((count, 2))
    for i in range(count):
        half[i] = 0.5 * (reach[0, i] + reach[1, i])
        slope[0, i], slope[1, i] = max(slope[0, i], softest), max(slope[1, i], softest)
        if not math.isnan(half[i]):
            sums[i, 1] = min(slope[0, i], slope[1, i]) ** 2
            sums[i, 0] = half[i] * sums[i, 1]
    sums = smooth(sums, starts, sigma, False)
    shift = np.zeros(count)
    for i in range(count):
        if math.isnan(half[i]):
            continue
        # Smoothing mirrors a line through its ends, where a weight that is nothing becomes less.
        around = sums[i, 0] / sums[i, 1] if sums[i, 1] > 1e-6 else half[i]
        around = min(max(around, (1.0 - width_share) * half[i]), (1.0 + width_share) * half[i])
        right, left = slope[0, i] ** 2, slope[1, i] ** 2
        wanted = (right * (reach[0, i] - around) + left * (around - reach[1, i])) / (right + left)
        shift[i] = min(max(wanted, -most_px), most_px)
    return shift, half


@compiled((MAP, POINTS, POINTS, int64, float64))
def middles(
    probability: NDArray[np.float32], points: NDArray[np.float64], across: NDArray[np.float64], side: int, most_px: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Of each place: how far across the middle of the probability lies within so many px (N,), and its sum there (N,).

    What lies beyond the image's border is not seen: sampled as what is beside it, a robot there would be drawn outwards. Looking
    outwards the probability may only fall: another stretch of robot close by does not pull.
    """
    height, width = probability.shape
    shift, total = np.zeros(len(points)), np.zeros(len(points))
    for i in range(len(points)):
        moment = 0.0
        for sign in (1, -1):
            least = math.inf
            for k in range(side + 1):
                x, y = points[i, 0] + sign * k * across[i, 0], points[i, 1] + sign * k * across[i, 1]
                if not (-0.5 < x < width - 0.5 and -0.5 < y < height - 0.5):
                    break
                least = min(least, _value_at(probability, x, y))
                if k or sign > 0:  # the place itself counts once
                    total[i] += least
                    moment += sign * k * least
        if total[i] > 1.0:
            shift[i] = min(max(moment / total[i], -most_px), most_px)
    return shift, total
