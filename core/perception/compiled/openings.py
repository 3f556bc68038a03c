"""Gates of a junction's opening, lines through it, and ends of vessels: for ``openings``, ``opening_lines``, ``vessel_ends``."""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64
from numpy.typing import NDArray

from core.perception.compiled.jit import MASK, POINTS, VALUES, compiled
from core.perception.compiled.lines import normals
from core.perception.compiled.maps import wall


@compiled(
    (
        *(POINTS, VALUES, VALUES, VALUES, float64, float64, boolean),
        *(float64, float64, float64, float64, float64, int64, float64, float64),
    )
)
def gate(
    points: NDArray[np.float64],
    radius: NDArray[np.float64],
    half_width: NDArray[np.float64],
    along: NDArray[np.float64],
    opening_px: float,
    at_least_px: float,
    far_is_junction: bool,
    step_px: float,
    min_radii: float,
    max_radii: float,
    settled: float,
    beyond_radii: float,
    width_points: int,
    width_radii: float,
    heading_radii: float,
) -> tuple[bool, float, float, float, float, float, float]:
    """Whether there is a gate; its place, the direction outwards, its arc length, and the radius of the branch."""
    none = False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    low = max(min_radii * opening_px, at_least_px)
    usable = along[-1] * (0.5 if far_is_junction else 1.0) - 8.0
    high = min(max(max_radii * opening_px, low + opening_px), usable)
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
        if radius[i] <= settled * own + 0.3:
            index = i
            break
    index = min(index + int(np.rint(beyond_radii * own / step_px)), len(along) - 1 - int(np.rint(8.0 / step_px)))
    farther = min(index + int(np.rint(max(12.0, heading_radii * own) / step_px)), len(along) - 1)
    x, y = points[farther, 0] - points[index, 0], points[farther, 1] - points[index, 1]
    length = max(math.hypot(x, y), 1e-9)
    # The distance to the nearest wall is less than half the width wherever the line is not quite in the middle.
    wide = half_width[index : index + width_points].copy()
    wide = np.sort(wide[np.abs(wide - own) < width_radii * own + 1.0])
    middle = len(wide) // 2
    if len(wide):
        own = wide[middle] if len(wide) % 2 else 0.5 * (wide[middle - 1] + wide[middle])
    return True, points[index, 0], points[index, 1], x / length, y / length, along[index], own


@compiled((POINTS, float64, float64))
def _squared_gap(points: NDArray[np.float64], x: float, y: float) -> tuple[float, int]:
    """The squared distance of (x, y) from the nearest of the points, and which one that is."""
    least, best = math.inf, 0
    for i in range(len(points)):
        across, down = points[i, 0] - x, points[i, 1] - y
        square = across * across + down * down
        if square < least:
            least, best = square, i
    return least, best


@compiled((POINTS, POINTS, float64))
def _first_meeting(line: NDArray[np.float64], others: NDArray[np.float64], near_px: float) -> tuple[int, int]:
    """The first of the line's points that comes as near to one of the others, and from there on nearest; and that one."""
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


@compiled((POINTS, POINTS, VALUES, MASK, int64, float64, float64, POINTS, VALUES))
def _to_walls(
    points: NDArray[np.float64],
    across: NDArray[np.float64],
    radius: NDArray[np.float64],
    vessel: NDArray[np.bool_],
    search_px: int,
    most_radii: float,
    one_wall: float,
    trunk: NDArray[np.float64],
    trunk_radius: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far to move each point across to lie as its walls want it (N,), and how much they have to say (N,)."""
    shift, weight = np.zeros(len(points)), np.zeros(len(points))
    reach = np.empty(2)
    for i in range(len(points)):
        for side in range(2):
            sign = 1.0 - 2.0 * side
            x, y = sign * across[i, 0], sign * across[i, 1]
            distance, _ = wall(vessel, points[i, 0], points[i, 1], x, y, radius[i], search_px)
            if distance > most_radii * radius[i] + 1.0:
                distance = math.nan
            wall_x, wall_y = points[i, 0] + distance * x, points[i, 1] + distance * y
            for k in range(len(trunk)):  # nothing is near to a wall that is none
                gap_x, gap_y = trunk[k, 0] - wall_x, trunk[k, 1] - wall_y
                limit = most_radii * trunk_radius[k] + 1.0
                if gap_x * gap_x + gap_y * gap_y <= limit * limit:
                    distance = math.nan
                    break
            reach[side] = distance
        right, left = reach[0], reach[1]
        if math.isnan(right) and math.isnan(left):
            continue
        if math.isnan(left):
            wanted, weight[i] = right - radius[i], one_wall
        elif math.isnan(right):
            wanted, weight[i] = radius[i] - left, one_wall
        else:
            wanted, weight[i] = 0.5 * (right - left), 1.0
        shift[i] = min(max(wanted, -0.5 * radius[i]), 0.5 * radius[i])
    return shift, weight


@compiled((VALUES, VALUES, VALUES, VALUES, float64))
def _two_shapes(
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    wanted: NDArray[np.float64],
    weight: NDArray[np.float64],
    stiffness: float,
) -> tuple[float, float]:
    """How much of each of two shapes (N,) comes nearest to what is wanted, by weights; the stiffness keeps both small."""
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


@compiled((POINTS, VALUES, MASK, int64, float64, float64, float64))
def trunk_between_walls(
    points: NDArray[np.float64],
    radius: NDArray[np.float64],
    vessel: NDArray[np.bool_],
    search_px: int,
    most_radii: float,
    one_wall: float,
    stiffness: float,
) -> NDArray[np.float64]:
    count = len(points)
    across = normals(points, np.array([0, count]))
    shift, weight = _to_walls(points, across, radius, vessel, search_px, most_radii, one_wall, points[:0], radius[:0])
    # Two shapes that leave a line's ends and its directions there as they are: one to a side, and one leaning.
    hump, leaning = np.empty(count), np.empty(count)
    for i in range(count):
        share = i / max(count - 1, 1)
        hump[i] = 16.0 * share**2 * (1.0 - share) ** 2
        leaning[i] = hump[i] * (2.0 * share - 1.0)
    size, lean = _two_shapes(hump, leaning, shift, weight, stiffness)
    bent = np.empty((count, 2))
    for i in range(count):
        for axis in range(2):
            bent[i, axis] = points[i, axis] + (size * hump[i] + lean * leaning[i]) * across[i, axis]
    return bent


@compiled(
    (float64, float64, float64, float64, float64, POINTS, VALUES, MASK, boolean, float64, float64, int64, float64, float64, float64)
)
def side_branch(
    x: float,
    y: float,
    inward_x: float,
    inward_y: float,
    radius_px: float,
    trunk: NDArray[np.float64],
    trunk_radius: NDArray[np.float64],
    vessel: NDArray[np.bool_],
    is_bent: bool,
    step_px: float,
    meeting_px: float,
    search_px: int,
    most_radii: float,
    one_wall: float,
    stiffness: float,
) -> tuple[int, NDArray[np.float64]]:
    """From a gate at (x, y) inwards: which of the trunk's points the branch comes from, and its line from there."""
    reach = max(40.0, 3.0 * math.sqrt(_squared_gap(trunk, x, y)[0]))
    count = int(np.ceil((reach + 1.0) / step_px))
    line = np.empty((count, 2))
    for i in range(count):
        line[i, 0], line[i, 1] = x + i * step_px * inward_x, y + i * step_px * inward_y
    end, mark = _first_meeting(line, trunk, meeting_px)
    if is_bent and end >= 3:
        across, radius = np.empty((end + 1, 2)), np.full(end + 1, radius_px)
        across[:, 0], across[:, 1] = -inward_y, inward_x
        shift, weight = _to_walls(line[: end + 1], across, radius, vessel, search_px, most_radii, one_wall, trunk, trunk_radius)
        wanted, resisting = 0.0, stiffness
        for i in range(end + 1):
            shape = (i / end) ** 2
            wanted += shape * weight[i] * shift[i]
            resisting += shape * weight[i] * shape
        for i in range(count):
            bend = wanted / resisting * (i / end) ** 2
            line[i, 0] -= bend * inward_y
            line[i, 1] += bend * inward_x
        end, mark = _first_meeting(line, trunk, meeting_px)
    mark = min(max(mark, 1), len(trunk) - 2)
    inner = end if end >= 2 else end + 1
    branch = np.empty((inner + 1, 2))
    branch[0] = trunk[mark]
    for i in range(inner):
        branch[i + 1] = line[inner - 1 - i]
    return mark, branch


@compiled((POINTS, float64, float64, int64, MASK, int64, float64, int64, float64))
def end_between_walls(
    onward: NDArray[np.float64],
    radius_px: float,
    lost_px: float,
    step: int,
    vessel: NDArray[np.bool_],
    search_px: int,
    width_share: float,
    least: int,
    stiffness: float,
) -> NDArray[np.float64]:
    """A vessel's end, 1 px from point to point, turned and bent into the middle as far as both walls are seen, then straight."""
    count = len(onward)
    across = normals(onward, np.array([0, count]))
    seen, wanted = np.empty(count), np.empty(count)
    found = 0
    for i in range(0, min(int(lost_px) + 1, count), step):
        right, _ = wall(vessel, onward[i, 0], onward[i, 1], across[i, 0], across[i, 1], radius_px, search_px)
        left, _ = wall(vessel, onward[i, 0], onward[i, 1], -across[i, 0], -across[i, 1], radius_px, search_px)
        if abs(0.5 * (right + left) - radius_px) < width_share * radius_px + 1.0:  # not where one is not seen
            seen[found], wanted[found] = i / max(lost_px, 1.0), 0.5 * (right - left)
            found += 1
    led = np.empty((count, 2))
    if found < least:
        led[:] = onward
        return led
    seen, wanted = seen[:found], wanted[:found]
    turn, bend = _two_shapes(seen, seen**2, wanted, np.ones(found), stiffness)
    last = seen[-1]
    for i in range(count):
        share = i / max(lost_px, 1.0)
        shift = turn * share + bend * (share * share if share <= last else last * (2.0 * share - last))
        for axis in range(2):
            led[i, axis] = onward[i, axis] + shift * across[i, axis]
    return led
