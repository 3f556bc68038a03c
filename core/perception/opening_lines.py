"""Lines through a junction's opening: a trunk that goes on smoothly, and side branches to it, both bent as their walls are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.perception.lumen import two_shapes, wall_distances
from core.perception.openings import STEP_PX, Gate
from core.types import Points

WALL_SEARCH_PX = 8
WALL_RADII = 1.15
"""A wall farther off than so many radii (and a pixel) is another one's: here is an opening. One so near to the trunk is its own."""
TRUNK_STIFFNESS = 0.5
BRANCH_STIFFNESS = 0.5
"""How hard it is for walls to bend a line, in points of it."""
ONE_WALL = 0.7
"""How much a point counts that has a wall on one side only, whose distance should be the radius."""


@dataclass(frozen=True, slots=True, eq=False)
class Trunk:
    """A curve from one arm's gate to another's (N, 2), and the lumen's radius along it (N,)."""

    ends: tuple[int, int]
    points: Points
    radius: NDArray[np.float64]


def trunk_between(gates: dict[int, Gate], ends: tuple[int, int]) -> Trunk:
    """The smooth curve from one arm's gate to another's, as wide as these are."""
    first, second = gates[ends[0]], gates[ends[1]]
    points = _hermite(first, second)
    radius = first.radius_px + (second.radius_px - first.radius_px) * _shares(len(points))
    return Trunk(ends, points, radius)


def between_walls(trunk: Trunk, level: NDArray[np.float32]) -> Trunk:
    """The trunk bent as its walls do, as far as they can be seen; its ends and its directions there stay."""
    shapes = _humps(len(trunk.points))
    normal, shift, weight = _to_walls(trunk.points, trunk.radius, level)
    size, lean = two_shapes(shapes, shift, weight, TRUNK_STIFFNESS)
    return Trunk(trunk.ends, trunk.points + (size * shapes[0] + lean * shapes[1])[:, None] * normal, trunk.radius)


def side_branch(gate: Gate, trunk: Trunk, level: NDArray[np.float32] | None = None) -> tuple[int, Points]:
    """Which of the trunk's points a side branch comes from, and its line from there to its gate.

    It leaves the gate in its direction, and goes straight or, where the `level` is given, as a parabola that its walls bend.
    """
    start, inward = np.array([gate.place]), -np.array(gate.outward)
    reach = max(40.0, 3.0 * math.sqrt(_squared_gaps(start, trunk.points).min()))
    way = np.arange(0.0, reach + 1.0, STEP_PX)
    straight = start + way[:, None] * inward
    end, mark = _first_meeting(straight, trunk)
    piece = straight[: end + 1]
    if level is not None and len(piece) >= 4:
        normal, shift, weight = _to_walls(piece, np.full(len(piece), gate.radius_px), level, trunk)
        shape = (way / way[end]) ** 2
        seen = shape[: end + 1] * weight
        bend = float(seen @ shift) / (float(seen @ shape[: end + 1]) + BRANCH_STIFFNESS)
        bent = straight + (bend * shape)[:, None] * normal[0]
        end, mark = _first_meeting(bent, trunk)
        piece = bent[: end + 1]
    mark = min(max(mark, 1), len(trunk.points) - 2)
    inner = piece[:-1] if len(piece) > 2 else piece
    return mark, np.concatenate([trunk.points[mark : mark + 1], inner[::-1]])


def _first_meeting(line: Points, trunk: Trunk) -> tuple[int, int]:
    """Where a line first meets the trunk: which of its points, and which of the trunk's."""
    gaps = _squared_gaps(trunk.points, line)
    nearest: list[float] = gaps.min(axis=0).tolist()
    end = next((place for place, gap in enumerate(nearest) if gap < (0.75 * STEP_PX) ** 2), None)
    if end is None:
        end = nearest.index(min(nearest))
    while end + 1 < len(nearest) and nearest[end + 1] < nearest[end]:
        end += 1
    return end, int(gaps[:, end].argmin())


def _squared_gaps(points: Points, others: Points) -> NDArray[np.float64]:
    """The squared distance from each of (N, 2) points to each of (M, 2) others, shape (N, M): a third of the time of roots."""
    gaps = points[:, 0, None] - others[:, 0]
    down = points[:, 1, None] - others[:, 1]
    gaps *= gaps
    down *= down
    gaps += down
    return gaps


def _to_walls(
    points: Points, radius: NDArray[np.float64], level: NDArray[np.float32], trunk: Trunk | None = None
) -> tuple[Points, NDArray[np.float64], NDArray[np.float64]]:
    """Normals of a line (N, 2), how far to move along each to lie as the walls want it (N,), and how much they have to say (N,).

    Between two walls that is the middle; beside one it is a radius off. A wall of the `trunk` says nothing of a side branch.
    """
    normal = polyline.normals(points)
    right, left = _own_walls(points, normal, radius, level, trunk)
    on_right, on_left = np.isfinite(right), np.isfinite(left)
    shift = np.where(on_right, np.where(on_left, 0.5 * (right - left), right - radius), np.where(on_left, radius - left, 0.0))
    weight = np.where(on_right & on_left, 1.0, np.where(on_right | on_left, ONE_WALL, 0.0))
    return normal, np.clip(shift, -0.5 * radius, 0.5 * radius), weight


def _own_walls(
    points: Points, normal: Points, radius: NDArray[np.float64], level: NDArray[np.float32], trunk: Trunk | None
) -> NDArray[np.float64]:
    """Distances of a line's own walls, to the right and to the left (2, N); NaN where there is none."""
    distance = wall_distances(level, points, normal, radius, WALL_SEARCH_PX)
    distance[distance > WALL_RADII * radius + 1.0] = math.nan
    seen = np.isfinite(distance)
    if trunk is not None and seen.any():
        side, place = np.nonzero(seen)
        walls = points[place] + (np.where(side, -1.0, 1.0) * distance[seen])[:, None] * normal[place]
        near = (_squared_gaps(walls, trunk.points) <= (WALL_RADII * trunk.radius + 1.0) ** 2).any(axis=1)
        distance[side[near], place[near]] = math.nan
    return distance


def _hermite(first: Gate, second: Gate) -> Points:
    """A smooth curve from one gate inwards and out through another, a point about every ``STEP_PX``; at least 4 points."""
    span = math.dist(first.place, second.place)
    weights = _hermite_weights(max(4, round(span / STEP_PX) + 1))
    inward = -span * first.outward[0], -span * first.outward[1]
    outward = span * second.outward[0], span * second.outward[1]
    return np.asarray(weights @ np.array([first.place, inward, second.place, outward]))


@lru_cache(maxsize=64)
def _shares(count: int) -> NDArray[np.float64]:
    """From 0 to 1 in `count` even steps."""
    return np.linspace(0.0, 1.0, count)


@lru_cache(maxsize=64)
def _humps(count: int) -> NDArray[np.float64]:
    """Two shapes (2, `count`) that leave a line's ends and its directions there as they are: one to a side, and one leaning."""
    share = _shares(count)
    hump = 16.0 * share**2 * (1.0 - share) ** 2
    return np.stack([hump, hump * (2.0 * share - 1.0)])


@lru_cache(maxsize=64)
def _hermite_weights(count: int) -> NDArray[np.float64]:
    """What each of start, start direction, end and end direction adds to each of `count` points, shape (count, 4)."""
    t = _shares(count)
    return np.column_stack([2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2])
