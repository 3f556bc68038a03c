"""Where vessels meet: the junction put where the branches' own centerlines meet, not where the skeleton does.

In the widened lumen of a bifurcation the skeleton leaves the trunk's centerline towards the opening, by some pixels over some two
radii to each side. So the part of each branch within the opening is replaced: a trunk goes on smoothly through it, a side branch
runs straight to the trunk, and where no two branches form a trunk all run straight to the point that fits their directions best.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Points

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


@dataclass(frozen=True, slots=True, eq=False)
class _Gate:
    """Where a branch leaves the opening: the place, the outward direction, and the arc length up to there."""

    place: NDArray[np.float64]
    outward: NDArray[np.float64]
    position_px: float
    radius_px: float


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
        inner = [
            0.0 if gate is None else gate.position_px + CLEAR_RADII * gate.radius_px - float((gate.place - place) @ gate.outward)
            for gate in gates
        ]
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
        rest = way > gate.position_px + 0.5 * STEP_PX
        points = np.concatenate([bridge, arm.points[rest]])
        radius = np.concatenate([np.full(len(bridge), gate.radius_px), arm.radius[rest]])
        rebuilt.append(Arm(points, radius, arm.far_is_junction))
    return place, rebuilt


def _rejoined(arm: Arm, along: NDArray[np.float64], place: NDArray[np.float64]) -> Arm:
    """An arm too short to have a gate, led from the junction's new place: what lies behind that place would be a hook in it."""
    aside_px, position_px, _ = polyline.nearest(arm.points, (float(place[0]), float(place[1])))
    rest = along > position_px + max(aside_px, 0.5 * STEP_PX)
    rest[-1] = True
    points, radius = arm.points[rest], arm.radius[rest]
    return Arm(np.concatenate([place[None], points]), np.concatenate([radius[:1], radius]), arm.far_is_junction)


def _gate(arm: Arm, along: NDArray[np.float64], radius_px: float, at_least_px: float) -> _Gate | None:
    """Where an arm has left the opening: its lumen is as narrow there as it stays. None for an arm too short to tell."""
    low = max(OPENING_MIN_RADII * radius_px, at_least_px)
    usable = along[-1] * (0.5 if arm.far_is_junction else 1.0) - 8.0
    first, last = np.searchsorted(along, (low, min(max(OPENING_MAX_RADII * radius_px, low + radius_px), usable)))
    if first >= last:
        return None
    plain = np.sort(arm.radius[np.searchsorted(along, radius_px) : np.searchsorted(along, 4.0 * radius_px)])
    own = float(plain[int(0.4 * len(plain))]) if len(plain) else float(arm.radius[first:last].min())
    settled = arm.radius[first:last] <= SETTLED * own + 0.3
    index = int(first + np.argmax(settled)) if settled.any() else int(last - 1)
    index = min(index + round(BEYOND_RADII * own / STEP_PX), len(along) - 1 - round(8.0 / STEP_PX))
    chord = arm.points[min(index + round(max(12.0, HEADING_RADII * own) / STEP_PX), len(along) - 1)] - arm.points[index]
    return _Gate(arm.points[index], chord / max(float(np.hypot(chord[0], chord[1])), 1e-9), float(along[index]), own)


def _trunk(gates: dict[int, _Gate]) -> dict[int, _Gate] | None:
    """The two arms that go on smoothly through the junction, if two clearly do."""
    turns = []
    for i, j in combinations(gates, 2):
        turn = float(np.degrees(np.arccos(np.clip(-gates[i].outward @ gates[j].outward, -1.0, 1.0))))
        turns.append((turn, i, j))
    turns.sort()
    best, i, j = turns[0]
    second = next((turn for turn, *pair in turns[1:] if i in pair or j in pair), np.inf)
    if best > TRUNK_MAX_TURN_DEG or second < best + TRUNK_LEAD_DEG:
        return None
    return {i: gates[i], j: gates[j]}


def _on_trunk(
    trunk: dict[int, _Gate], gates: list[_Gate | None], centre: Points, radius_px: float
) -> tuple[Points, dict[int, Points]]:
    """The place on the trunk where the other arms arrive, and the trunk's curve from there to its two gates."""
    (i, first), (j, second) = trunk.items()
    curve = _hermite(first.place, -first.outward, second.place, second.outward)
    others = [gate for index, gate in enumerate(gates) if gate is not None and index not in trunk]
    marks = []
    for gate in others:
        behind = gate.place - curve
        across = np.abs(behind[:, 0] * gate.outward[1] - behind[:, 1] * gate.outward[0])
        on_way = behind @ gate.outward > 0.0
        if on_way.any():
            marks.append(int(np.argmin(np.where(on_way, across, np.inf))))
    if not marks:
        marks = [int(np.argmin(np.hypot(*(curve - centre).T)))]
    nearest = int(np.argmin(np.hypot(*(curve - centre).T)))
    reach = int(np.ceil(1.5 * radius_px / STEP_PX))
    mark = int(np.clip(round(float(np.mean(marks))), max(nearest - reach, 1), min(nearest + reach, len(curve) - 2)))
    return curve[mark], {i: curve[mark::-1], j: curve[mark:]}


def _hermite(start: Points, start_direction: Points, end: Points, end_direction: Points) -> Points:
    """A smooth curve between two places with given unit directions, a point about every ``STEP_PX``; at least 4 points."""
    span = float(np.hypot(*(end - start)))
    t = np.linspace(0.0, 1.0, max(4, round(span / STEP_PX) + 1))[:, None]
    return np.asarray(
        (2 * t**3 - 3 * t**2 + 1) * start
        + (t**3 - 2 * t**2 + t) * span * start_direction
        + (3 * t**2 - 2 * t**3) * end
        + (t**3 - t**2) * span * end_direction
    )


def _meeting_point(gates: list[_Gate], centre: Points, radius_px: float) -> Points:
    """Least-squares meeting point of the arms' lines, held to the skeleton's junction by a small weight and by its radius."""
    normal_matrix, right = 0.05 * np.eye(2), 0.05 * centre
    for gate in gates:
        across = np.eye(2) - np.outer(gate.outward, gate.outward)
        normal_matrix = normal_matrix + across
        right = right + across @ gate.place
    shift = np.linalg.solve(normal_matrix, right) - centre
    length = float(np.hypot(shift[0], shift[1]))
    return np.asarray(centre + shift * min(1.0, radius_px / max(length, 1e-9)))


def _straight(start: Points, end: Points) -> Points:
    count = max(2, round(float(np.hypot(*(end - start))) / STEP_PX) + 1)
    return np.asarray(start + np.linspace(0.0, 1.0, count)[:, None] * (end - start))
