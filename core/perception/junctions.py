"""Where vessels meet: the junction put where the branches' own centerlines meet, not where the skeleton does.

In the widened lumen of a bifurcation the skeleton leaves the trunk's centerline towards the opening, by some pixels over some two
radii to each side. So the part of each branch within the opening is replaced: a trunk goes on smoothly through it, a side branch
runs straight to the trunk, and where no two branches form a trunk all run straight to the point that fits their directions best.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Point, Points

STEP_PX = 2.0
OPENING_MIN_RADII = 0.8
OPENING_MAX_RADII = 2.5
"""An opening ends where the lumen is as narrow as the branch itself: looked for between these multiples of its junction's
radius."""
SETTLED = 1.1
"""As narrow as the branch itself: at most this factor of its own radius (and a third of a pixel)."""
BEYOND_RADII = 0.4
"""The skeleton comes back to the middle a little later than the radius does."""
HEADING_RADII = 1.0
"""A branch's direction is taken over this many of its radii, and at least 12 px."""
CLEAR_RADII = 1.0
"""The opening reaches at least so many of the branch's radii beyond the junction's new place."""
ROUNDS = 3
TRUNK_MAX_TURN_DEG = 50.0
TRUNK_LEAD_DEG = 10.0
"""Two branches are a trunk if they turn less than this, and by so much less than any other two."""


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A branch seen from a junction: its centerline outwards (N, 2), the radius along it (N,), and what its far end is."""

    points: Points
    radius: NDArray[np.float64]
    far_is_junction: bool


@dataclass(frozen=True, slots=True)
class _Gate:
    """Where a branch leaves the opening: the place, the outward direction, and the arc length up to there."""

    place: Point
    outward: Point
    position_px: float
    radius_px: float

    def beyond(self, place: Point) -> float:
        """How far the gate lies beyond a place, in its own direction."""
        return (self.place[0] - place[0]) * self.outward[0] + (self.place[1] - place[1]) * self.outward[1]


def rebuild(centre: Points, radius_px: float, arms: list[Arm]) -> tuple[Points, list[Arm]] | None:
    """The junction's place (2,) and its arms anew, or None where too few arms are long enough to tell.

    Parameters
    ----------
    centre : the skeleton's junction (2,).
    radius_px : lumen radius there.
    arms : all branches at the junction, outwards.
    """
    along = [polyline.arc_length(arm.points) for arm in arms]
    gates: list[_Gate | None] = [_gate(arm, way, radius_px, 0.0) for arm, way in zip(arms, along, strict=True)]
    for _ in range(ROUNDS):
        known = {index: gate for index, gate in enumerate(gates) if gate is not None}
        if len(known) < 2:
            return None
        trunk = _trunk(known)
        if trunk is None:
            place = _meeting_point(list(known.values()), centre, radius_px)
            bridges: dict[int, Points] = {}
        else:
            place, bridges = _on_trunk(trunk, gates, centre, radius_px)
        # The skeleton's junction may lie well inside one arm: seen from the new place, that arm's opening reaches further out.
        inner = [0.0 if gate is None else gate.position_px + CLEAR_RADII * gate.radius_px - gate.beyond(place) for gate in gates]
        if all(gate is None or gate.position_px >= needed for gate, needed in zip(gates, inner, strict=True)):
            break
        gates = [_gate(arm, way, radius_px, needed) for arm, way, needed in zip(arms, along, inner, strict=True)]
    rebuilt = []
    for index, (arm, way, gate) in enumerate(zip(arms, along, gates, strict=True)):
        if gate is None:
            rebuilt.append(_rejoined(arm, way, place))
            continue
        bridge = bridges.get(index)
        if bridge is None:
            bridge = _straight(place, gate.place)
        rest = int(way.searchsorted(gate.position_px + 0.5 * STEP_PX, "right"))
        points = np.concatenate([bridge, arm.points[rest:]])
        radius = np.concatenate([np.full(len(bridge), gate.radius_px), arm.radius[rest:]])
        rebuilt.append(Arm(points, radius, arm.far_is_junction))
    return np.array(place), rebuilt


def _rejoined(arm: Arm, along: NDArray[np.float64], place: Point) -> Arm:
    """An arm too short to have a gate, led from the junction's new place: what lies behind that place would be a hook in it."""
    aside_px, position_px, _ = polyline.nearest(arm.points, place, along)
    rest = along > position_px + max(aside_px, 0.5 * STEP_PX)
    rest[-1] = True
    points, radius = arm.points[rest], arm.radius[rest]
    return Arm(np.concatenate([[place], points]), np.concatenate([radius[:1], radius]), arm.far_is_junction)


def _gate(arm: Arm, along: NDArray[np.float64], radius_px: float, at_least_px: float) -> _Gate | None:
    """Where an arm has left the opening: its lumen is as narrow there as it stays. None for an arm too short to tell."""
    low = max(OPENING_MIN_RADII * radius_px, at_least_px)
    usable = float(along[-1]) * (0.5 if arm.far_is_junction else 1.0) - 8.0
    high = min(max(OPENING_MAX_RADII * radius_px, low + radius_px), usable)
    if low >= high:
        return None
    first, last, near, far = along.searchsorted((low, high, radius_px, 4.0 * radius_px)).tolist()
    if first >= last:
        return None
    opening = arm.radius[first:last]
    plain = sorted(arm.radius[near:far].tolist())
    own = plain[int(0.4 * len(plain))] if plain else float(opening.min())
    settled = opening <= SETTLED * own + 0.3
    index = int(settled.argmax())
    index = first + index if settled[index] else last - 1
    index = min(index + round(BEYOND_RADII * own / STEP_PX), len(along) - 1 - round(8.0 / STEP_PX))
    x, y = arm.points[index].tolist()
    far_x, far_y = arm.points[min(index + round(max(12.0, HEADING_RADII * own) / STEP_PX), len(along) - 1)].tolist()
    length = max(math.hypot(far_x - x, far_y - y), 1e-9)
    return _Gate((x, y), ((far_x - x) / length, (far_y - y) / length), float(along[index]), own)


def _trunk(gates: dict[int, _Gate]) -> dict[int, _Gate] | None:
    """The two arms that go on smoothly through the junction, if two clearly do."""
    turns = []
    for (i, first), (j, second) in combinations(gates.items(), 2):
        cosine = -first.outward[0] * second.outward[0] - first.outward[1] * second.outward[1]
        turns.append((math.degrees(math.acos(min(1.0, max(-1.0, cosine)))), i, j))
    turns.sort()
    best, i, j = turns[0]
    rival = next((turn for turn, *pair in turns[1:] if i in pair or j in pair), math.inf)
    if best > TRUNK_MAX_TURN_DEG or rival < best + TRUNK_LEAD_DEG:
        return None
    return {i: gates[i], j: gates[j]}


def _on_trunk(
    trunk: dict[int, _Gate], gates: list[_Gate | None], centre: Points, radius_px: float
) -> tuple[Point, dict[int, Points]]:
    """The place on the trunk where the other arms arrive, and the trunk's curve from there to its two gates."""
    (i, first), (j, second) = trunk.items()
    curve = _hermite(first, second)
    marks = []
    for index, gate in enumerate(gates):
        if gate is None or index in trunk:
            continue
        back_x, back_y = gate.place[0] - curve[:, 0], gate.place[1] - curve[:, 1]
        across = np.abs(back_x * gate.outward[1] - back_y * gate.outward[0])
        on_way = back_x * gate.outward[0] + back_y * gate.outward[1] > 0.0
        if on_way.any():
            marks.append(int(np.where(on_way, across, np.inf).argmin()))
    nearest = int(np.hypot(curve[:, 0] - centre[0], curve[:, 1] - centre[1]).argmin())
    reach = math.ceil(1.5 * radius_px / STEP_PX)
    mark = round(sum(marks) / len(marks)) if marks else nearest
    mark = min(max(mark, nearest - reach, 1), nearest + reach, len(curve) - 2)
    x, y = curve[mark].tolist()
    return (x, y), {i: curve[mark::-1], j: curve[mark:]}


def _hermite(first: _Gate, second: _Gate) -> Points:
    """A smooth curve from one gate inwards and out through another, a point about every ``STEP_PX``; at least 4 points."""
    span = math.dist(first.place, second.place)
    weights = _hermite_weights(max(4, round(span / STEP_PX) + 1))
    inward = -span * first.outward[0], -span * first.outward[1]
    outward = span * second.outward[0], span * second.outward[1]
    return np.asarray(weights @ np.array([first.place, inward, second.place, outward]))


@lru_cache(maxsize=64)
def _hermite_weights(count: int) -> NDArray[np.float64]:
    """What each of start, start direction, end and end direction adds to each of `count` points, shape (count, 4)."""
    t = np.linspace(0.0, 1.0, count)
    return np.column_stack([2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2])


def _meeting_point(gates: list[_Gate], centre: Points, radius_px: float) -> Point:
    """Least-squares meeting point of the arms' lines, held to the skeleton's junction by a small weight and by its radius."""
    centre_x, centre_y = centre.tolist()
    # The sum over the gates of the projection across each one's direction: (xx, xy; xy, yy) . place = (right, below).
    xx = yy = 0.05
    xy, right, below = 0.0, 0.05 * centre_x, 0.05 * centre_y
    for gate in gates:
        (x, y), (u, v) = gate.place, gate.outward
        xx, xy, yy = xx + v * v, xy - u * v, yy + u * u
        right, below = right + v * (v * x - u * y), below + u * (u * y - v * x)
    determinant = xx * yy - xy * xy
    shift_x = (yy * right - xy * below) / determinant - centre_x
    shift_y = (xx * below - xy * right) / determinant - centre_y
    share = min(1.0, radius_px / max(math.hypot(shift_x, shift_y), 1e-9))
    return centre_x + share * shift_x, centre_y + share * shift_y


def _straight(start: Point, end: Point) -> Points:
    weights = _line_weights(max(2, round(math.dist(start, end) / STEP_PX) + 1))
    return np.asarray(weights @ np.array([start, end]))


@lru_cache(maxsize=64)
def _line_weights(count: int) -> NDArray[np.float64]:
    """What start and end add to each of `count` points of a straight line, shape (count, 2)."""
    t = np.linspace(0.0, 1.0, count)
    return np.column_stack([1.0 - t, t])
