"""Numba kernels: the inner loops of the geometry, compiled to machine code.

Call them through ``core.perception.compiled``, which loads this module with the first call; ``core.geometry`` and the stages of
perception document units and sources. Argument types are declared, so that nothing is compiled in the middle of a stream: an array
of another type is a TypeError. Indices are checked, and the interpreter's lock is released while a kernel runs. Numba caches the
machine code in ``__pycache__`` or, where that cannot be written, in the user's cache folder. It does not notice changes in
functions of another file: keep all kernels here.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba import boolean, float32, float64, int32, int64, types, uint8
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Pixels = NDArray[np.int32]
Bytes = NDArray[np.uint8]
FloatMap = NDArray[np.float32]
BoolMap = NDArray[np.bool_]
_Function = TypeVar("_Function", bound=Callable[..., Any])
_njit: Any = numba.njit  # its stubs do not know lists of signatures


def _array(dtype: Any, dimensions: int) -> Any:
    """The type of an argument: an array of any strides, writable or not."""
    return types.Array(dtype, dimensions, "A", readonly=True)


POINTS, VALUES, STARTS = _array(float64, 2), _array(float64, 1), _array(int64, 1)
MAP, MASK = _array(float32, 2), _array(boolean, 2)


def kernel(*signatures: tuple[Any, ...]) -> Callable[[_Function], _Function]:
    """Compile a function for each of these tuples of argument types, or read its machine code from Numba's cache."""

    def compile_now(function: _Function) -> _Function:
        options = {"nogil": True, "error_model": "numpy", "boundscheck": True}
        with contextlib.suppress(RuntimeError, OSError):  # no folder for the cache can be written, or the disk is full
            return cast(_Function, _njit(list(signatures), cache=True, **options)(function))
        return cast(_Function, _njit(list(signatures), **options)(function))

    return compile_now


@kernel((POINTS,))
def arc_length(points: Floats) -> Floats:
    along = np.zeros(max(len(points), 1))
    for i in range(1, len(points)):
        along[i] = along[i - 1] + math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1])
    return along


@kernel((VALUES, float64))
def _last_at_most(along: Floats, position: float) -> int:
    """Index of the last of the ascending values that is at most `position`; -1 for none."""
    low, high = 0, len(along)
    while low < high:
        middle = (low + high) // 2
        if along[middle] <= position:
            low = middle + 1
        else:
            high = middle
    return low - 1


@kernel((POINTS, VALUES, float64, float64[:]))
def _write_point_at(points: Floats, along: Floats, position: float, place: Floats) -> None:
    k = _last_at_most(along, position)
    if k < 0 or k >= len(points) - 1 or along[k] == position:
        k = min(max(k, 0), len(points) - 1)
        place[0], place[1] = points[k, 0], points[k, 1]
        return
    share = (position - along[k]) / (along[k + 1] - along[k])
    for axis in range(2):
        place[axis] = points[k, axis] + share * (points[k + 1, axis] - points[k, axis])


@kernel((POINTS, VALUES, VALUES))
def point_at(points: Floats, along: Floats, position: Floats) -> Floats:
    found = np.empty((len(position), 2))
    for i in range(len(position)):
        _write_point_at(points, along, position[i], found[i])
    return found


@kernel((POINTS, float64))
def resample(points: Floats, step: float) -> Floats:
    along = arc_length(points)
    total = along[-1]
    if total == 0.0:
        return points[:1].copy()
    if not math.isfinite(total / step):
        raise ValueError("a line of points that are no numbers, or steps of nothing")
    count = max(2, int(np.rint(total / step)) + 1)
    found = np.empty((count, 2))
    for i in range(count - 1):
        _write_point_at(points, along, i * (total / (count - 1)), found[i])
    _write_point_at(points, along, total, found[count - 1])
    return found


@kernel((POINTS, float64, float64, VALUES))
def cut(points: Floats, start: float, end: float, along: Floats) -> Floats:
    start, end = max(start, 0.0), min(end, along[-1])
    first, last = _last_at_most(along, start) + 1, int(np.searchsorted(along, end))
    inner = max(last - first, 0)
    part = np.empty((inner + 2, 2))
    _write_point_at(points, along, start, part[0])
    part[1 : inner + 1] = points[first : first + inner]
    _write_point_at(points, along, end, part[inner + 1])
    return part


@kernel((POINTS, float64, float64, VALUES))
def nearest(points: Floats, x: float, y: float, along: Floats) -> tuple[float, float, float, float]:
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


@kernel((POINTS, float64, float64, float64))
def extrapolate(points: Floats, length_px: float, over_px: float, bend_share: float) -> Floats:
    along = arc_length(points)
    total = along[-1]
    back_px = min(over_px, total)
    last, middle, first = np.empty(2), np.empty(2), np.empty(2)
    _write_point_at(points, along, total, last)
    _write_point_at(points, along, total - 0.5 * back_px, middle)
    _write_point_at(points, along, total - back_px, first)
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


@kernel((int64, float64, boolean))
def _smoothing_weights(pad: int, sigma: float, keeps_bends: bool) -> Floats:
    """A Gaussian with sum 1; to keep bends, times the parabola that removes its second moment, unless it is too short."""
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


@kernel((POINTS, VALUES, float64[:, :]))
def _smooth_line(points: Floats, weights: Floats, smoothed: Floats) -> None:
    """Weighted means; the line is mirrored through its ends, so it continues straight there and does not shrink."""
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


@kernel((POINTS, STARTS, float64, boolean))
def smooth(points: Floats, starts: Ints, sigma: float, keeps_bends: bool) -> Floats:
    """Consecutive lines, each by itself; a line too short for all of the weights gets as many as it has points for."""
    most = int(np.ceil(3.0 * sigma))
    weights = _smoothing_weights(most, sigma, keeps_bends)
    smoothed = np.empty((len(points), 2))
    for line in range(len(starts) - 1):
        first, last = starts[line], starts[line + 1]
        pad = min(most, last - first - 1)
        if pad < 1:
            smoothed[first:last] = points[first:last]
        else:
            own = weights if pad == most else _smoothing_weights(pad, sigma, keeps_bends)
            _smooth_line(points[first:last], own, smoothed[first:last])
    return smoothed


@kernel((POINTS, STARTS))
def normals(points: Floats, starts: Ints) -> Floats:
    """Of consecutive lines."""
    across = np.empty((len(points), 2))
    for line in range(len(starts) - 1):
        first, last = starts[line], starts[line + 1] - 1
        for i in range(first, last + 1):
            before, after = max(i - 1, first), min(i + 1, last)
            x, y = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
            length = max(math.hypot(x, y), 1e-9)
            across[i, 0], across[i, 1] = -y / length, x / length
    return across


@kernel((POINTS, STARTS, float64))
def resample_lines(points: Floats, starts: Ints, step: float) -> tuple[Floats, Ints]:
    """Consecutive lines resampled, and their starts."""
    lines = [resample(points[starts[line] : starts[line + 1]], step) for line in range(len(starts) - 1)]
    offsets = np.zeros(len(starts), np.int64)
    for i, line in enumerate(lines):
        offsets[i + 1] = offsets[i] + len(line)
    found = np.empty((offsets[-1], 2))
    for i, line in enumerate(lines):
        found[offsets[i] : offsets[i + 1]] = line
    return found, offsets


@kernel((MAP, float64, float64), (MASK, float64, float64))
def _value_at(values: FloatMap | BoolMap, x: float, y: float) -> float:
    height, width = values.shape
    x = min(x, width - 1.0) if x > 0.0 else 0.0  # also NaN
    y = min(y, height - 1.0) if y > 0.0 else 0.0
    column, row = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    right, down = min(column + 1, width - 1), min(row + 1, height - 1)
    x -= column
    y -= row
    left_above, left_below = 1.0 * values[row, column], 1.0 * values[down, column]
    above = left_above + x * (1.0 * values[row, right] - left_above)
    below = left_below + x * (1.0 * values[down, right] - left_below)
    return float(above + y * (below - above))


@kernel((MAP, VALUES, VALUES), (MASK, VALUES, VALUES))
def sample(values: FloatMap | BoolMap, x: Floats, y: Floats) -> Floats:
    found = np.empty(len(x))
    for i in range(len(x)):
        found[i] = _value_at(values, x[i], y[i])
    return found


@kernel(*((kind, float64, float64, float64, float64, float64, int64) for kind in (MAP, MASK)))
def wall_distance(
    level: FloatMap | BoolMap, x: float, y: float, across_x: float, across_y: float, expected: float, search_px: int
) -> tuple[float, float]:
    """Distance of a wall from (x, y), NaN without one, and the slope of the level there, per px."""
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


@kernel((MAP, POINTS, POINTS, VALUES, int64))
def wall_distances(level: FloatMap, points: Floats, across: Floats, expected: Floats, search_px: int) -> tuple[Floats, Floats]:
    """Where the level falls through 0.5 on both sides of places with unit vectors across them: distances (2, N), NaN where it does
    not (in a branch's opening, beyond the image border), and slopes (2, N), per px. It is searched `search_px` around the expected
    distances (N,).
    """
    count = len(points)
    reach, slope = np.empty((2, count)), np.empty((2, count))
    for side in range(2):
        sign = 1.0 - 2.0 * side
        for i in range(count):
            reach[side, i], slope[side, i] = wall_distance(
                level, points[i, 0], points[i, 1], sign * across[i, 0], sign * across[i, 1], expected[i], search_px
            )
    return reach, slope


SEARCH_PX = 4
"""A wall is searched this far to both sides of where a distance map of every second pixel has it."""
SOFTEST = 0.02
"""Per px: least slope of a wall. Where the network's probability falls less steeply, the wall counts as little as this."""
WIDTH_SHARE = 0.2
"""By how much a vessel's width may differ from what is measured at one place."""
MOST_SHIFT_PX = 2.0
"""Greatest error of the distance map; a wall further off belongs to something else."""


@kernel((MAP, POINTS, STARTS, POINTS, VALUES, float64))
def centre_offsets(
    level: FloatMap, points: Floats, starts: Ints, across: Floats, expected: Floats, sigma: float
) -> tuple[Floats, Floats]:
    """Of consecutive lines: each point's distance from the middle between its walls, and half its width; (N,), (N,).

    0 and NaN where a wall is not seen. `sigma`, in points: smoothing of the width. A vessel's width changes slowly, so where one
    wall is soft, the middle is rather half the smoothed width away from the other one.
    """
    reach, slope = wall_distances(level, points, across, expected, SEARCH_PX)
    count = len(points)
    half, sums = np.empty(count), np.zeros((count, 2))
    for i in range(count):
        half[i] = 0.5 * (reach[0, i] + reach[1, i])
        slope[0, i], slope[1, i] = max(slope[0, i], SOFTEST), max(slope[1, i], SOFTEST)
        if not math.isnan(half[i]):
            sums[i, 1] = min(slope[0, i], slope[1, i]) ** 2
            sums[i, 0] = half[i] * sums[i, 1]
    sums = smooth(sums, starts, sigma, False)
    shift = np.zeros(count)
    for i in range(count):
        if math.isnan(half[i]):
            continue
        # Smoothing mirrors a line through its ends, where a weight of 0 becomes negative.
        around = sums[i, 0] / sums[i, 1] if sums[i, 1] > 1e-6 else half[i]
        around = min(max(around, (1.0 - WIDTH_SHARE) * half[i]), (1.0 + WIDTH_SHARE) * half[i])
        right, left = slope[0, i] ** 2, slope[1, i] ** 2
        wanted = (right * (reach[0, i] - around) + left * (around - reach[1, i])) / (right + left)
        shift[i] = min(max(wanted, -MOST_SHIFT_PX), MOST_SHIFT_PX)
    return shift, half


@kernel((MAP, POINTS, POINTS, int64, float64))
def probability_centres(probability: FloatMap, points: Floats, across: Floats, side: int, most_px: float) -> tuple[Floats, Floats]:
    """Of each place: the offset across of the probability's centre within `side` px (N,), and its sum there (N,).

    Places beyond the image border are left out: with the border's value they would draw a robot outwards. Outwards the probability
    may only fall, so that another part of the robot close by does not count.
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


OPENING_RADII = 0.8, 2.5
"""A junction's opening ends between these multiples of its radius."""
SETTLED = 1.1
"""A branch has left the opening where its radius is at most this factor of its own (and a third of a pixel)."""
BEYOND_RADII = 0.4
"""The skeleton returns to the middle a little later than the radius does."""
WIDTH_POINTS, WIDTH_RADII = 5, 0.3
"""A branch's radius is taken from this many points at its gate whose half width is within this share of it."""
HEADING_RADII = 1.0
"""A branch's direction is taken over this many of its radii, and at least 12 px."""


@kernel((POINTS, VALUES, VALUES, VALUES, float64, float64, boolean, float64))
def find_gate(
    points: Floats,
    radius: Floats,
    half_width: Floats,
    along: Floats,
    opening_px: float,
    at_least_px: float,
    far_is_junction: bool,
    step_px: float,
) -> tuple[bool, float, float, float, float, float, float]:
    """Whether a branch has a gate; its place, its direction outwards, its arc length, and the branch's radius."""
    none = False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    low = max(OPENING_RADII[0] * opening_px, at_least_px)
    usable = along[-1] * (0.5 if far_is_junction else 1.0) - 8.0
    high = min(max(OPENING_RADII[1] * opening_px, low + opening_px), usable)
    if low >= high:
        return none
    first, last = int(np.searchsorted(along, low)), int(np.searchsorted(along, high))
    if first >= last:
        return none
    near, far = int(np.searchsorted(along, opening_px)), int(np.searchsorted(along, 4.0 * opening_px))
    plain = np.sort(radius[near:far].copy())
    own = plain[int(0.4 * len(plain))] if len(plain) else radius[first:last].min()
    index = last - 1
    for i in range(first, last):
        if radius[i] <= SETTLED * own + 0.3:
            index = i
            break
    index = min(index + int(np.rint(BEYOND_RADII * own / step_px)), len(along) - 1 - int(np.rint(8.0 / step_px)))
    farther = min(index + int(np.rint(max(12.0, HEADING_RADII * own) / step_px)), len(along) - 1)
    x, y = points[farther, 0] - points[index, 0], points[farther, 1] - points[index, 1]
    length = max(math.hypot(x, y), 1e-9)
    # The distance to the nearest wall is less than half the width where the line is not quite in the middle.
    wide = half_width[index : index + WIDTH_POINTS].copy()
    wide = np.sort(wide[np.abs(wide - own) < WIDTH_RADII * own + 1.0])
    middle = len(wide) // 2
    if len(wide):
        own = wide[middle] if len(wide) % 2 else 0.5 * (wide[middle - 1] + wide[middle])
    return True, points[index, 0], points[index, 1], x / length, y / length, along[index], own


@kernel((POINTS, float64, float64))
def _squared_gap(points: Floats, x: float, y: float) -> tuple[float, int]:
    """The squared distance of (x, y) from the nearest of the points, and its index."""
    least, best = math.inf, 0
    for i in range(len(points)):
        across, down = points[i, 0] - x, points[i, 1] - y
        square = across * across + down * down
        if square < least:
            least, best = square, i
    return least, best


@kernel((POINTS, POINTS, float64))
def _first_meeting(line: Floats, others: Floats, near_px: float) -> tuple[int, int]:
    """The line's point nearest to the others after it first comes within `near_px`, and the index of that other point."""
    least, end, there = math.inf, 0, 0
    is_near = False
    for i in range(len(line)):
        gap, best = _squared_gap(others, line[i, 0], line[i, 1])
        if gap < least:
            least, end, there = gap, i, best
        elif is_near:
            break
        is_near = is_near or gap < near_px * near_px
    return end, there


WALL_SEARCH_PX = 8
WALL_RADII = 1.15
"""A wall more than this many radii (and a pixel) away belongs to another vessel; one this near to the trunk is the trunk's."""
ONE_WALL = 0.7
"""Weight of a point that has a wall on one side only, whose distance should be the radius."""
STIFFNESS = 0.5
"""Resistance of a line against being bent by its walls, in points of it."""
MEETING_STEPS = 0.75
"""A side branch this many steps from a trunk has come to it, and goes on for as long as it comes nearer."""


@kernel((POINTS, POINTS, VALUES, MASK, POINTS, VALUES))
def _wall_shifts(
    points: Floats, across: Floats, radius: Floats, vessel: BoolMap, trunk: Floats, trunk_radius: Floats
) -> tuple[Floats, Floats]:
    """How far to move each point across to suit its walls (N,), and the weight of that (N,)."""
    shift, weight = np.zeros(len(points)), np.zeros(len(points))
    reach = np.empty(2)
    for i in range(len(points)):
        for side in range(2):
            sign = 1.0 - 2.0 * side
            x, y = sign * across[i, 0], sign * across[i, 1]
            distance, _ = wall_distance(vessel, points[i, 0], points[i, 1], x, y, radius[i], WALL_SEARCH_PX)
            if distance > WALL_RADII * radius[i] + 1.0:
                distance = math.nan
            wall_x, wall_y = points[i, 0] + distance * x, points[i, 1] + distance * y
            for k in range(len(trunk)):  # a wall of NaN is near to no point
                gap_x, gap_y = trunk[k, 0] - wall_x, trunk[k, 1] - wall_y
                limit = WALL_RADII * trunk_radius[k] + 1.0
                if gap_x * gap_x + gap_y * gap_y <= limit * limit:
                    distance = math.nan
                    break
            reach[side] = distance
        right, left = reach[0], reach[1]
        if math.isnan(right) and math.isnan(left):
            continue
        if math.isnan(left):
            wanted, weight[i] = right - radius[i], ONE_WALL
        elif math.isnan(right):
            wanted, weight[i] = radius[i] - left, ONE_WALL
        else:
            wanted, weight[i] = 0.5 * (right - left), 1.0
        shift[i] = min(max(wanted, -0.5 * radius[i]), 0.5 * radius[i])
    return shift, weight


@kernel((VALUES, VALUES, VALUES, VALUES, float64))
def _fit_two_shapes(first: Floats, second: Floats, wanted: Floats, weight: Floats, stiffness: float) -> tuple[float, float]:
    """Weighted least squares: the factors of two shapes (N,) that fit `wanted`; the stiffness keeps both small."""
    a = c = stiffness
    b = one = other = 0.0
    for i in range(len(wanted)):
        a += weight[i] * first[i] * first[i]
        b += weight[i] * first[i] * second[i]
        c += weight[i] * second[i] * second[i]
        one += weight[i] * first[i] * wanted[i]
        other += weight[i] * second[i] * wanted[i]
    determinant = a * c - b * b
    return (c * one - b * other) / determinant, (a * other - b * one) / determinant


@kernel((POINTS, VALUES, MASK))
def bend_trunk(points: Floats, radius: Floats, vessel: BoolMap) -> Floats:
    count = len(points)
    across = normals(points, np.array([0, count]))
    shift, weight = _wall_shifts(points, across, radius, vessel, points[:0], radius[:0])
    # Two shapes that keep a line's ends and its directions there: a symmetric and an antisymmetric one.
    hump, leaning = np.empty(count), np.empty(count)
    for i in range(count):
        share = i / max(count - 1, 1)
        hump[i] = 16.0 * share**2 * (1.0 - share) ** 2
        leaning[i] = hump[i] * (2.0 * share - 1.0)
    size, lean = _fit_two_shapes(hump, leaning, shift, weight, STIFFNESS)
    bent = np.empty((count, 2))
    for i in range(count):
        for axis in range(2):
            bent[i, axis] = points[i, axis] + (size * hump[i] + lean * leaning[i]) * across[i, axis]
    return bent


@kernel((float64, float64, float64, float64, float64, POINTS, VALUES, MASK, boolean, float64))
def side_branch(
    x: float,
    y: float,
    inward_x: float,
    inward_y: float,
    radius_px: float,
    trunk: Floats,
    trunk_radius: Floats,
    vessel: BoolMap,
    is_bent: bool,
    step_px: float,
) -> tuple[int, Floats]:
    """From a gate at (x, y) inwards: the index of the trunk's point where the branch begins, and its line from there."""
    reach = max(40.0, 3.0 * math.sqrt(_squared_gap(trunk, x, y)[0]))
    count = int(np.ceil((reach + 1.0) / step_px))
    line = np.empty((count, 2))
    for i in range(count):
        line[i, 0], line[i, 1] = x + i * step_px * inward_x, y + i * step_px * inward_y
    end, mark = _first_meeting(line, trunk, MEETING_STEPS * step_px)
    if is_bent and end >= 3:
        across, radius = np.empty((end + 1, 2)), np.full(end + 1, radius_px)
        across[:, 0], across[:, 1] = -inward_y, inward_x
        shift, weight = _wall_shifts(line[: end + 1], across, radius, vessel, trunk, trunk_radius)
        wanted, resisting = 0.0, STIFFNESS
        for i in range(end + 1):
            shape = (i / end) ** 2
            wanted += shape * weight[i] * shift[i]
            resisting += shape * weight[i] * shape
        for i in range(count):
            bend = wanted / resisting * (i / end) ** 2
            line[i, 0] -= bend * inward_y
            line[i, 1] += bend * inward_x
        end, mark = _first_meeting(line, trunk, MEETING_STEPS * step_px)
    mark = min(max(mark, 1), len(trunk) - 2)
    inner = end if end >= 2 else end + 1
    branch = np.empty((inner + 1, 2))
    branch[0] = trunk[mark]
    for i in range(inner):
        branch[i + 1] = line[inner - 1 - i]
    return mark, branch


END_WIDTH_SHARE = 0.15
"""A part narrower or wider than the vessel by more than this share (and a pixel) is its end, or a branch's opening."""
END_LEAST_POINTS = 3
END_STIFFNESS = 0.15
"""As ``STIFFNESS``, for turning and bending a vessel's end."""


@kernel((POINTS, float64, float64, int64, MASK))
def bend_end(onward: Floats, radius_px: float, lost_px: float, step: int, vessel: BoolMap) -> Floats:
    """A vessel's end, points 1 px apart, turned and bent into the middle as far as both walls are seen, then straight."""
    count = len(onward)
    across = normals(onward, np.array([0, count]))
    seen, wanted = np.empty(count), np.empty(count)
    found = 0
    for i in range(0, min(int(lost_px) + 1, count), step):
        right, _ = wall_distance(vessel, onward[i, 0], onward[i, 1], across[i, 0], across[i, 1], radius_px, WALL_SEARCH_PX)
        left, _ = wall_distance(vessel, onward[i, 0], onward[i, 1], -across[i, 0], -across[i, 1], radius_px, WALL_SEARCH_PX)
        if abs(0.5 * (right + left) - radius_px) < END_WIDTH_SHARE * radius_px + 1.0:  # not where one is not seen
            seen[found], wanted[found] = i / max(lost_px, 1.0), 0.5 * (right - left)
            found += 1
    led = np.empty((count, 2))
    if found < END_LEAST_POINTS:
        led[:] = onward
        return led
    seen, wanted = seen[:found], wanted[:found]
    turn, bend = _fit_two_shapes(seen, seen**2, wanted, np.ones(found), END_STIFFNESS)
    last = seen[-1]
    for i in range(count):
        share = i / max(lost_px, 1.0)
        shift = turn * share + bend * (share * share if share <= last else last * (2.0 * share - last))
        for axis in range(2):
            led[i, axis] = onward[i, axis] + shift * across[i, axis]
    return led


@kernel((uint8[:], int64, int64[:], uint8[:]))
def thin(framed: Bytes, stride: int, outer: Ints, table: Bytes) -> None:
    """Thin a mask of 0 and 1 with a frame of 0 around it, row by row in one array, in place.

    `outer` are the pixels at its edges. `table`: for each of 256 neighbourhoods the sub-iterations (1, 2, 3: both) in which a pixel
    is removed. After one of its neighbours is removed, a pixel is queued for both sub-iterations; others are not examined again.
    """
    around = (-stride - 1, -stride, -stride + 1, 1, stride + 1, stride, stride - 1, -1)  # clockwise from the upper left
    size = 0
    for i in range(len(framed)):
        size += framed[i]
    waits = np.zeros(len(framed), np.uint8)
    first, second, gone = np.empty(size, np.int32), np.empty(size, np.int32), np.empty(size, np.int32)
    in_first = in_second = len(outer)
    for k in range(len(outer)):
        first[k] = second[k] = outer[k]
        waits[outer[k]] = 3
    kind = 1
    while in_first or in_second:
        queue, count = (first, in_first) if kind == 1 else (second, in_second)
        going = 0
        for k in range(count):
            i = queue[k]
            waits[i] &= 3 - kind
            if framed[i]:
                bits = 0
                for n in range(8):
                    bits |= framed[i + around[n]] << n
                if table[bits] & kind:
                    gone[going] = i
                    going += 1
        if kind == 1:
            in_first = 0
        else:
            in_second = 0
        for k in range(going):
            framed[gone[k]] = 0
        for k in range(going):
            for n in range(8):
                i = gone[k] + around[n]
                if framed[i] and waits[i] != 3:
                    if not waits[i] & 1:
                        first[in_first] = i
                        in_first += 1
                    if not waits[i] & 2:
                        second[in_second] = i
                        in_second += 1
                    waits[i] = 3
        kind = 3 - kind


@kernel((int64[:], int64))
def _link_pixels(flat: Ints, width: int) -> tuple[Floats, Floats, Pixels, Ints, Ints]:
    """Of a skeleton's pixels, counted from 1 (0 stands for none): x, y, their neighbours (N, 8), how many, and ``both``.

    ``both`` is, of a chain's pixel, the XOR of its neighbours: with one of them it gives the other; -1 of a junction's.
    """
    count = len(flat)
    left, right = width, 0
    for i in range(count):
        column = flat[i] % width
        left, right = min(left, column), max(right, column)
    top = flat[0] // width if count else 0
    stride = max(right - left, 0) + 3
    size = ((flat[count - 1] // width - top if count else 0) + 3) * stride
    is_set, index = np.zeros(size, np.bool_), np.empty(size, np.int32)
    place, x, y = np.empty(count + 1, np.int64), np.zeros(count + 1), np.zeros(count + 1)
    for i in range(count):
        row, column = flat[i] // width, flat[i] % width
        place[i + 1] = (row - top + 1) * stride + column - left + 1
        x[i + 1], y[i + 1] = column, row
        is_set[place[i + 1]] = True
        index[place[i + 1]] = i + 1
    # Straight neighbours first; a diagonal one is linked only where no straight one makes the link.
    step_x, step_y = (0, -1, 1, 0, -1, 1, -1, 1), (-1, 0, 0, 1, -1, -1, 1, 1)
    near = np.zeros((count + 1, 8), np.int32)
    links = np.zeros(count + 1, np.int64)
    both = np.full(count + 1, -1, np.int64)
    for i in range(1, count + 1):
        pair = 0
        for k in range(8):
            there = place[i] + step_y[k] * stride + step_x[k]
            if not is_set[there]:
                continue
            if k >= 4 and (is_set[place[i] + step_y[k] * stride] or is_set[place[i] + step_x[k]]):
                continue
            near[i, links[i]] = index[there]
            pair ^= index[there]
            links[i] += 1
        if links[i] < 3:
            both[i] = pair
    return x, y, near, links, both


@kernel((float64[::1], float64[::1], int32[:, ::1], int64[::1]))
def _junction_nodes(x: Floats, y: Floats, near: Pixels, links: Ints) -> tuple[Floats, Ints, int]:
    """Junction pixels that touch are one node: room for all nodes (N, 2), the node of each pixel or -1, and how many there are."""
    nodes = np.empty((len(links), 2))
    node_of = np.full(len(links), -1, np.int64)
    many, pending = 0, np.empty(len(links), np.int64)
    for i in range(1, len(links)):
        if links[i] < 3 or node_of[i] >= 0:
            continue
        members, waiting = 0, 1
        across = down = 0.0
        pending[0], node_of[i] = i, many
        while waiting:
            waiting -= 1
            pixel = pending[waiting]
            members += 1
            across, down = across + x[pixel], down + y[pixel]
            for k in range(links[pixel]):
                other = near[pixel, k]
                if links[other] >= 3 and node_of[other] < 0:
                    node_of[other] = many
                    pending[waiting] = other
                    waiting += 1
        nodes[many, 0], nodes[many, 1] = across / members, down / members
        many += 1
    return nodes, node_of, many


@kernel((int64[:], int64))
def trace_graph(flat: Ints, width: int) -> tuple[Floats, Ints, Ints, Floats, Ints]:
    """The graph of a skeleton's pixels, given by their sorted flat indices in a picture of `width` columns.

    Nodes (K, 2); the first and the last node of each chain (C,), (C,); the chains' consecutive points (N, 2), and their starts
    (C + 1,).
    """
    count = len(flat)
    x, y, near, links, both = _link_pixels(flat, width)
    nodes, node_of, many = _junction_nodes(x, y, near, links)
    # First the chains that hang on a junction, then those between two ends, then rings.
    points = np.empty((3 * count + 3, 2))
    starts, ends, marks = np.empty(count + 1, np.int64), np.empty(count + 1, np.int64), np.zeros(count + 2, np.int64)
    walked_by = np.zeros(count + 1, np.bool_)
    chains = filled = 0
    for turn in range(3):
        for i in range(1, count + 1):
            is_asked = links[i] >= 3 if turn == 0 else links[i] <= 1 if turn == 1 else links[i] == 2
            if not is_asked:
                continue
            for k in range(links[i] if turn == 0 else 1):
                first = near[i, k] if turn == 0 else i
                if node_of[first] >= 0 or walked_by[first]:
                    continue
                junction = i if turn == 0 else 0
                begin, walked = filled, 0
                if turn == 0:
                    points[filled] = nodes[node_of[i]]
                    filled += 1
                previous, pixel = junction, first
                if turn == 2:
                    previous = max(near[first, 0], near[first, 1])
                    previous = both[first] ^ previous  # so that the ring is walked towards the greater neighbour
                while both[pixel] >= 0 and not (turn == 2 and walked and pixel == first):
                    points[filled, 0], points[filled, 1] = x[pixel], y[pixel]
                    filled += 1
                    walked += 1
                    walked_by[pixel] = True
                    last = pixel
                    previous, pixel = pixel, both[pixel] ^ previous
                if turn == 0:
                    start = node_of[i]
                else:
                    nodes[many, 0], nodes[many, 1] = x[first], y[first]
                    start = many
                    many += 1
                if turn == 2:
                    end = start
                    points[filled, 0], points[filled, 1] = x[first], y[first]
                    filled += 1
                elif turn == 1 and walked == 1 and pixel == 0:  # a lone pixel
                    filled = begin
                    continue
                elif pixel:
                    end = node_of[pixel]
                    points[filled] = nodes[end]
                    filled += 1
                else:
                    nodes[many, 0], nodes[many, 1] = x[last], y[last]
                    end = many
                    many += 1
                if turn < 2 and start == end and walked <= 2:  # a bump of the junction, not a loop
                    filled = begin
                    continue
                starts[chains], ends[chains] = start, end
                chains += 1
                marks[chains] = filled
    return nodes[:many].copy(), starts[:chains].copy(), ends[:chains].copy(), points[:filled].copy(), marks[: chains + 1].copy()
