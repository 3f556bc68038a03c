"""Lines through a junction's opening: a trunk that goes on smoothly, and side branches to it, both bent as their walls are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.perception.compiled import loops
from core.perception.openings import STEP_PX, Gate
from core.types import Mask, Points

WALL_SEARCH_PX = 8
WALL_RADII = 1.15
"""A wall farther off than so many radii (and a pixel) is another one's: here is an opening. One so near to the trunk is its own."""
TRUNK_STIFFNESS = 0.5
BRANCH_STIFFNESS = 0.5
"""How hard it is for walls to bend a line, in points of it."""
ONE_WALL = 0.7
"""How much a point counts that has a wall on one side only, whose distance should be the radius."""
MEETING_PX = 0.75 * STEP_PX
"""A side branch that is this near to a trunk has come to it, and goes on for as long as it comes nearer."""
_NOTHING = np.empty((0, 0), np.bool_)


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


def between_walls(trunk: Trunk, vessel: Mask) -> Trunk:
    """The trunk bent as its walls do, as far as they can be seen; its ends and its directions there stay.

    Between two walls a point is wanted in the middle; beside one it is wanted a radius off. Either way by at most half a radius.
    """
    bent = loops.openings.trunk_between_walls(
        trunk.points, trunk.radius, vessel, WALL_SEARCH_PX, WALL_RADII, ONE_WALL, TRUNK_STIFFNESS
    )
    return Trunk(trunk.ends, bent, trunk.radius)


def side_branch(gate: Gate, trunk: Trunk, vessel: Mask | None = None) -> tuple[int, Points]:
    """Which of the trunk's points a side branch comes from, and its line from there to its gate.

    It leaves the gate in its direction, and goes straight or, where the `vessel` is given, as a parabola that its walls bend; a
    wall of the trunk says nothing of it.
    """
    return loops.openings.side_branch(
        *gate.place,
        -gate.outward[0],
        -gate.outward[1],
        gate.radius_px,
        trunk.points,
        trunk.radius,
        _NOTHING if vessel is None else vessel,
        vessel is not None,
        STEP_PX,
        MEETING_PX,
        WALL_SEARCH_PX,
        WALL_RADII,
        ONE_WALL,
        BRANCH_STIFFNESS,
    )


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
def _hermite_weights(count: int) -> NDArray[np.float64]:
    """What each of start, start direction, end and end direction adds to each of `count` points, shape (count, 4)."""
    t = _shares(count)
    return np.column_stack([2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2])
