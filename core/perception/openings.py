"""Where branches leave a junction's opening, and which two of them go on as one: its trunk."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from core.perception.compiled import loops
from core.types import Point, Points

STEP_PX = 2.0
"""From point to point of all lines here."""
OPENING_MIN_RADII = 0.8
OPENING_MAX_RADII = 2.5
"""An opening ends where the lumen is as narrow as the branch itself: looked for between these multiples of its junction's
radius."""
SETTLED = 1.1
"""As narrow as the branch itself: at most this factor of its own radius (and a third of a pixel)."""
BEYOND_RADII = 0.4
"""The skeleton comes back to the middle a little later than the radius does."""
WIDTH_POINTS = 5
WIDTH_RADII = 0.3
"""A branch's radius is that of so many points at its gate which are about as wide as it is."""
HEADING_RADII = 1.0
"""A branch's direction is taken over this many of its radii, and at least 12 px."""
TRUNK_LEAD_DEG = 10.0
"""Where another pair of a lone junction's three arms is a trunk nearly as likely, by so much, it has no clear one."""
WIDER_DEG = 100.0
"""A trunk is as wide as its branches: one that is left twice as wide is as unlikely as this much of a turn."""


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A branch seen from a junction.

    Its centerline outwards (N, 2), the nearest wall's distance along it (N,), half the way from wall to wall across it (N,), NaN
    where one is not seen, whether it ends in a junction, and the lumen's radius at this one.
    """

    points: Points
    radius: NDArray[np.float64]
    half_width: NDArray[np.float64]
    far_is_junction: bool
    opening_px: float

    def along(self, points: Points, radius: NDArray[np.float64]) -> Arm:
        """The same arm led along another line."""
        return Arm(points, radius, self.half_width, self.far_is_junction, self.opening_px)


@dataclass(frozen=True, slots=True)
class Gate:
    """Where a branch leaves the opening: the place, the outward direction, and the arc length up to there."""

    place: Point
    outward: Point
    position_px: float
    radius_px: float

    def beyond(self, place: Point) -> float:
        """How far the gate lies beyond a place, in its own direction."""
        return (self.place[0] - place[0]) * self.outward[0] + (self.place[1] - place[1]) * self.outward[1]


def gate_of(arm: Arm, along: NDArray[np.float64], at_least_px: float, *, wider: float = 1.0) -> Gate | None:
    """Where an arm has left the opening: its lumen is as narrow there as it stays. None for an arm too short to tell.

    `along` is its arc length (N,); the gate lies at least `at_least_px` along it, and the opening counts as `wider` as it is.
    """
    found, x, y, across, down, position_px, radius_px = loops.openings.gate(
        arm.points,
        arm.radius,
        arm.half_width,
        along,
        wider * arm.opening_px,
        at_least_px,
        arm.far_is_junction,
        STEP_PX,
        OPENING_MIN_RADII,
        OPENING_MAX_RADII,
        SETTLED,
        BEYOND_RADII,
        WIDTH_POINTS,
        WIDTH_RADII,
        HEADING_RADII,
    )
    return Gate((x, y), (across, down), position_px, radius_px) if found else None


def _unlikeliness(gates: dict[int, Gate], pair: tuple[int, int]) -> float:
    """Of a trunk between two arms, in degrees: how much it turns, and how much narrower it is than the others."""
    first, second = gates[pair[0]], gates[pair[1]]
    narrow = max(min(first.radius_px, second.radius_px), 0.5)
    widest = max([gate.radius_px for index, gate in gates.items() if index not in pair], default=0.0)
    return turn_deg(first, second) + WIDER_DEG * max(0.0, widest / narrow - 1.0)


def likely_trunks(gates: dict[int, Gate]) -> list[tuple[float, tuple[int, int]]]:
    """All pairs of arms, each with how unlikely a trunk it is, in degrees: the two that go on most smoothly and are wide enough for
    the others come first."""
    return sorted((_unlikeliness(gates, pair), pair) for pair in combinations(gates, 2))


def equal_trunks(likely: list[tuple[float, tuple[int, int]]]) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Of the three pairs of three arms, the two that are a trunk nearly alike, the arm of both first; None for a clear trunk."""
    if len(likely) != 3:
        return None
    (best, ends), (other, others), _ = likely
    if other >= best + TRUNK_LEAD_DEG:
        return None
    (stem,) = set(ends) & set(others)
    (first,), (second,) = set(ends) - {stem}, set(others) - {stem}
    return (stem, first), (stem, second)


def turn_deg(first: Gate, second: Gate) -> float:
    """By how much a line turns that comes in through one gate, goes straight to the other, and leaves through it."""
    x, y = second.place[0] - first.place[0], second.place[1] - first.place[1]
    length = max(math.hypot(x, y), 1e-9)
    coming = -(first.outward[0] * x + first.outward[1] * y) / length
    going = (second.outward[0] * x + second.outward[1] * y) / length
    return math.degrees(math.acos(min(1.0, max(-1.0, coming))) + math.acos(min(1.0, max(-1.0, going))))


def meeting_point(gates: list[Gate]) -> Point:
    """Least-squares meeting point of the arms' lines, held to their gates' middle by a small weight."""
    centre_x, centre_y = (sum(gate.place[axis] for gate in gates) / len(gates) for axis in (0, 1))
    # The sum over the gates of the projection across each one's direction: (xx, xy; xy, yy) . place = (right, below).
    xx = yy = 0.05
    xy, right, below = 0.0, 0.05 * centre_x, 0.05 * centre_y
    for gate in gates:
        (x, y), (u, v) = gate.place, gate.outward
        xx, xy, yy = xx + v * v, xy - u * v, yy + u * u
        right, below = right + v * (v * x - u * y), below + u * (u * y - v * x)
    determinant = xx * yy - xy * xy
    return (yy * right - xy * below) / determinant, (xx * below - xy * right) / determinant
