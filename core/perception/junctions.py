"""Junctions of vessels: moved to where the branches' own centerlines meet.

In the widened lumen of a bifurcation the skeleton leaves the trunk's centerline towards the opening, by some pixels over some two
radii to each side. So the part of each branch within the opening is replaced. A *gate* is where a branch leaves the opening. Two
branches form the trunk, which continues smoothly through the opening; a side branch runs to the trunk as its walls do, as far as
they are visible. A stem that might continue into either branch continues into both (fork); where any two branches might form the
trunk, all three go straight to one point (star). Junctions so near to each other that no branch in between leaves their openings
are rebuilt together: one trunk runs through all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.perception import compiled
from core.types import Mask, Point, Points

STEP_PX = 2.0
"""Distance of the points of all lines here."""
TRUNK_LEAD_DEG = 10.0
"""A lone junction has no clear trunk where another pair of its three arms is as unlikely within this."""
WIDER_DEG = 100.0
"""Penalty for a trunk that a branch leaves twice as wide, as a turn."""


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A branch seen from a junction.

    ``points``: its centerline outwards (N, 2). ``radius``: distance to the nearest wall (N,). ``half_width``: half the distance
    from wall to wall (N,), NaN where one is not visible. ``opening_px``: the lumen's radius at this junction."""

    points: Points
    radius: NDArray[np.float64]
    half_width: NDArray[np.float64]
    far_is_junction: bool
    opening_px: float


@dataclass(frozen=True, slots=True)
class Gate:
    """Where a branch leaves the opening: the place, the outward direction, and the arc length up to there."""

    place: Point
    outward: Point
    position_px: float
    radius_px: float

    def beyond(self, place: Point) -> float:
        """Distance of the gate from a place, in the gate's direction."""
        return (self.place[0] - place[0]) * self.outward[0] + (self.place[1] - place[1]) * self.outward[1]


def gate_of(arm: Arm, along: NDArray[np.float64], at_least_px: float, *, wider: float = 1.0) -> Gate | None:
    """The gate of an arm: where its lumen becomes as narrow as it stays. None for an arm that is too short.

    `along` is its arc length (N,); the gate lies at least `at_least_px` along it; `wider` scales the opening.
    """
    found, x, y, across, down, position_px, radius_px = compiled.find_gate(
        arm.points, arm.radius, arm.half_width, along, wider * arm.opening_px, at_least_px, arm.far_is_junction, STEP_PX
    )
    return Gate((x, y), (across, down), position_px, radius_px) if found else None


def _unlikeliness(gates: dict[int, Gate], pair: tuple[int, int]) -> float:
    """Of a trunk between two arms, in degrees: its turn, and a penalty where it is narrower than the other arms."""
    first, second = gates[pair[0]], gates[pair[1]]
    narrow = max(min(first.radius_px, second.radius_px), 0.5)
    widest = max([gate.radius_px for index, gate in gates.items() if index not in pair], default=0.0)
    return turn_deg(first, second) + WIDER_DEG * max(0.0, widest / narrow - 1.0)


def likely_trunks(gates: dict[int, Gate]) -> list[tuple[float, tuple[int, int]]]:
    """All pairs of arms with their unlikeliness as a trunk, in degrees, the likeliest first."""
    return sorted((_unlikeliness(gates, pair), pair) for pair in combinations(gates, 2))


def equal_trunks(likely: list[tuple[float, tuple[int, int]]]) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Of the three pairs of three arms, the two that are nearly equally likely, their common arm first; None for a clear trunk."""
    if len(likely) != 3:
        return None
    (best, ends), (other, others), _ = likely
    if other >= best + TRUNK_LEAD_DEG:
        return None
    (stem,) = set(ends) & set(others)
    (first,), (second,) = set(ends) - {stem}, set(others) - {stem}
    return (stem, first), (stem, second)


def turn_deg(first: Gate, second: Gate) -> float:
    """The turns of a line that enters through one gate, goes straight to the other, and leaves through it."""
    x, y = second.place[0] - first.place[0], second.place[1] - first.place[1]
    length = max(math.hypot(x, y), 1e-9)
    coming = -(first.outward[0] * x + first.outward[1] * y) / length
    going = (second.outward[0] * x + second.outward[1] * y) / length
    return math.degrees(math.acos(min(1.0, max(-1.0, coming))) + math.acos(min(1.0, max(-1.0, going))))


def meeting_point(gates: list[Gate]) -> Point:
    """Least-squares meeting point of the arms' lines, drawn to their gates' middle by a small weight."""
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
    """The trunk bent by its walls, as far as they are visible; its ends and its directions there stay.

    A point is drawn to the middle between two walls, or to a radius from one wall, by at most half a radius.
    """
    return replace(trunk, points=compiled.bend_trunk(trunk.points, trunk.radius, vessel))


def side_branch(gate: Gate, trunk: Trunk, vessel: Mask | None = None) -> tuple[int, Points]:
    """The index of the trunk's point where a side branch begins, and its line from there to its gate.

    It leaves the gate in its direction, straight or, where the `vessel` is given, as a parabola that its walls bend; the trunk's
    walls do not count.
    """
    return compiled.side_branch(
        *gate.place,
        -gate.outward[0],
        -gate.outward[1],
        gate.radius_px,
        trunk.points,
        trunk.radius,
        _NOTHING if vessel is None else vessel,
        vessel is not None,
        STEP_PX,
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
    """Weights of start, start direction, end and end direction for each of `count` points, shape (count, 4)."""
    t = _shares(count)
    return np.column_stack([2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2])


TOGETHER = 1.5
"""A branch from junction to junction that has no gate with openings this many times as wide lies within both of them."""
CLEAR_RADII = 1.0
"""The opening reaches at least this many of the branch's radii beyond the junction's new place."""
ROUND_DEG = 100.0
"""Three arms without a clear trunk form a star if the path between the two less likely ends turns by less than this."""
FORKED_PX = 0.5
"""Distance at which two trunks have parted."""
MISSED_PX = 6.0
"""A side branch that passes the trunk at this distance does not come from it."""


@dataclass(frozen=True, slots=True, eq=False)
class Rebuilt:
    """Rebuilt junctions: their ``places`` along the trunk (M, 2), the trunk's pieces from each to the next (M - 1), and for each
    arm the index of its place, and its line."""

    places: Points
    pieces: list[Points]
    arms: list[tuple[int, Arm]]


def are_together(arm: Arm, back: Arm) -> bool:
    """Whether a branch between two junctions, seen from both, is too short to leave both openings."""
    return any(gate_of(a, geometry.arc_length(a.points), 0.0, wider=TOGETHER) is None for a in (arm, back))


def rebuild(arms: list[Arm], vessel: Mask, *, is_alone: bool) -> Rebuilt | None:
    """Rebuild a junction, or some that belong together, from all branches that lead out of the opening, outwards.

    None where too few arms have a gate, where an arm of several junctions does not lead to the trunk (it comes from a side
    branch, or there is no single trunk), and where a place would lie outside the vessel's mask (h, w).
    """
    rebuilt = _rebuild(arms, vessel, is_alone)
    if rebuilt is None:
        return None
    lines = np.concatenate([*rebuilt.pieces, *(arm.points for _, arm in rebuilt.arms)])
    limit = np.array([vessel.shape[1], vessel.shape[0]])
    # All places are in the vessel, and all lines in the picture, which smoothing may leave by a pixel.
    is_inside = (lines >= -1.0).all() and (lines <= limit).all() and (geometry.sample(vessel, rebuilt.places) >= 0.5).all()
    return rebuilt if is_inside else None


def _rebuild(arms: list[Arm], vessel: Mask, is_alone: bool) -> Rebuilt | None:
    along = [geometry.arc_length(arm.points) for arm in arms]
    gates = (gate_of(arm, positions, 0.0) for arm, positions in zip(arms, along, strict=True))
    known = {index: gate for index, gate in enumerate(gates) if gate is not None}
    if len(known) < 2:
        return None
    likely = likely_trunks(known)
    equal = equal_trunks(likely) if is_alone and len(known) == len(arms) else None
    if equal is not None:
        (_, first), (_, second) = equal
        from_branch_to_branch = turn_deg(known[first], known[second])
        return _star(arms, along, known) if from_branch_to_branch < ROUND_DEG else _fork(arms, along, known, equal, vessel)
    trunk = trunk_between(known, likely[0][1])
    bridges = {index: side_branch(gate, trunk) for index, gate in known.items() if index not in trunk.ends}
    # The skeleton's junction may lie well inside one arm: seen from the new place, that arm's opening reaches further out.
    moved = False
    for index, gate in list(known.items()):
        needed = gate.position_px + CLEAR_RADII * gate.radius_px - gate.beyond(_point(trunk.points[_mark(index, trunk, bridges)]))
        if gate.position_px < needed:
            known[index] = gate_of(arms[index], along[index], needed) or gate
            moved = True
    if moved:
        trunk = trunk_between(known, likely_trunks(known)[0][1])
    trunk = between_walls(trunk, vessel)
    # A branch that does not come from the trunk mostly shows it without its walls, too. It is tested first, and saves the others.
    straight = {index: _missed_px(line) for index, (_, line) in bridges.items()}
    bridges = {}
    for index in sorted(known.keys() - set(trunk.ends), key=lambda index: -straight.get(index, 0.0)):
        mark, line = side_branch(known[index], trunk, vessel)
        if _missed_px(line) > MISSED_PX:
            if not is_alone:
                return None
            line = geometry.resample(np.array([trunk.points[mark], known[index].place]), STEP_PX)
        bridges[index] = mark, line
    return _assembled(arms, along, known, trunk, bridges)


def _missed_px(line: Points) -> float:
    """Distance at which a side branch passes the trunk, on which its line begins."""
    return math.dist(line[0].tolist(), line[1].tolist())


def _mark(index: int, trunk: Trunk, bridges: dict[int, tuple[int, Points]]) -> int:
    """Index of the trunk's point where an arm begins."""
    if index in bridges:
        return bridges[index][0]
    marks = [mark for mark, _ in bridges.values()] or [len(trunk.points) // 2]
    return min(marks) if index == trunk.ends[0] else max(marks)


def _assembled(
    arms: list[Arm], along: list[NDArray[np.float64]], gates: dict[int, Gate], trunk: Trunk, bridges: dict[int, tuple[int, Points]]
) -> Rebuilt:
    for index in range(len(arms)):
        if index not in gates:  # too short to have a gate
            near = arms[index].points[min(2, len(arms[index].points) - 1)]
            mark = int(np.hypot(*(trunk.points - near).T).argmin())
            bridges[index] = min(max(mark, 1), len(trunk.points) - 2), np.empty((0, 2))
    marks = sorted({mark for mark, _ in bridges.values()}) or [len(trunk.points) // 2]
    pieces = [trunk.points[first : last + 1] for first, last in pairwise(marks)]
    rebuilt = []
    for index, (arm, positions) in enumerate(zip(arms, along, strict=True)):
        mark = _mark(index, trunk, bridges)
        if index not in gates:
            rebuilt.append((marks.index(mark), _rejoined(arm, positions, _point(trunk.points[mark]))))
            continue
        gate = gates[index]
        if index in bridges:
            bridge = bridges[index][1]
        else:
            bridge = trunk.points[mark::-1] if index == trunk.ends[0] else trunk.points[mark:]
        rebuilt.append((marks.index(mark), _bridged(arm, positions, gate, bridge)))
    return Rebuilt(trunk.points[marks], pieces, rebuilt)


def _bridged(arm: Arm, along: NDArray[np.float64], gate: Gate, bridge: Points) -> Arm:
    """An arm with `bridge`, from the junction to its gate, in place of its part within the opening."""
    rest = int(along.searchsorted(gate.position_px + 0.5 * STEP_PX, "right"))
    radius = np.concatenate([np.full(len(bridge), gate.radius_px), arm.radius[rest:]])
    return replace(arm, points=np.concatenate([bridge, arm.points[rest:]]), radius=radius)


def _rejoined(arm: Arm, along: NDArray[np.float64], place: Point) -> Arm:
    """An arm without a gate, from the junction's new place on; its part behind that place would be a hook."""
    aside_px, position_px, _ = geometry.nearest(arm.points, place, along)
    rest = along > position_px + max(aside_px, 0.5 * STEP_PX)
    rest[-1] = True
    points, radius = arm.points[rest], arm.radius[rest]
    link = geometry.resample(np.array([place, points[0]]), STEP_PX)[:-1]
    radius = np.concatenate([np.full(len(link), radius[0]), radius])
    return replace(arm, points=np.concatenate([link, points]), radius=radius)


def _fork(
    arms: list[Arm],
    along: list[NDArray[np.float64]],
    gates: dict[int, Gate],
    trunks: tuple[tuple[int, int], tuple[int, int]],
    vessel: Mask,
) -> Rebuilt:
    """A junction whose stem continues smoothly into both branches, and ends where they part."""
    curves = [between_walls(trunk_between(gates, ends), vessel).points for ends in trunks]
    common = np.stack([curve[: min(len(curves[0]), len(curves[1]))] for curve in curves])
    is_apart = np.hypot(*(common[0] - common[1]).T) > FORKED_PX
    last = common.shape[1] - 2
    mark = min(max(int(is_apart.argmax()), 2), last) if is_apart.any() else last
    shared = common[:, : mark + 1].mean(axis=0)
    stem = trunks[0][0]
    bridges = {stem: shared[::-1]}
    for (_, branch), curve in zip(trunks, curves, strict=True):
        bridges[branch] = np.concatenate([shared[-1:], curve[mark + 1 :]])
    return Rebuilt(shared[-1:], [], [(0, _bridged(arm, along[k], gates[k], bridges[k])) for k, arm in enumerate(arms)])


def _star(arms: list[Arm], along: list[NDArray[np.float64]], gates: dict[int, Gate]) -> Rebuilt:
    """A junction of which any two arms might be the trunk: all go straight to the point that fits their directions best."""
    place = meeting_point(list(gates.values()))
    straight = [geometry.resample(np.array([place, gates[index].place]), STEP_PX) for index in range(len(arms))]
    return Rebuilt(np.array([place]), [], [(0, _bridged(arm, along[k], gates[k], straight[k])) for k, arm in enumerate(arms)])


def _point(values: Points) -> Point:
    return float(values[0]), float(values[1])
