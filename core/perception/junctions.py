"""Where vessels meet: the junction put where the branches' own centerlines meet, not where the skeleton does.

In the widened lumen of a bifurcation the skeleton leaves the trunk's centerline towards the opening, by some pixels over some two
radii to each side. So the part of each branch within the opening is replaced: a trunk goes on smoothly through it, and a side
branch runs to the trunk as its walls do, as far as they can be seen. A stem that might go on into either branch does so into both;
where the branches might be each other's trunk, too, all three go straight to one point. Junctions so near to each other that no
branch in between leaves their openings are taken together: one trunk runs through all of them.

Where branches leave a junction's opening, and which two of them go on as one: its trunk.

Lines through a junction's opening: a trunk that goes on smoothly, and side branches to it, both bent as their walls are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.perception import compiled
from core.types import Mask, Point, Points

STEP_PX = 2.0
"""From point to point of all lines here."""
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
    found, x, y, across, down, position_px, radius_px = compiled.find_gate(
        arm.points,
        arm.radius,
        arm.half_width,
        along,
        wider * arm.opening_px,
        at_least_px,
        arm.far_is_junction,
        STEP_PX,
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
    bent = compiled.bend_trunk(trunk.points, trunk.radius, vessel)
    return Trunk(trunk.ends, bent, trunk.radius)


def side_branch(gate: Gate, trunk: Trunk, vessel: Mask | None = None) -> tuple[int, Points]:
    """Which of the trunk's points a side branch comes from, and its line from there to its gate.

    It leaves the gate in its direction, and goes straight or, where the `vessel` is given, as a parabola that its walls bend; a
    wall of the trunk says nothing of it.
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
    """What each of start, start direction, end and end direction adds to each of `count` points, shape (count, 4)."""
    t = _shares(count)
    return np.column_stack([2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2])


TOGETHER = 1.5
"""A branch from junction to junction that has no gate even with the openings so many times as wide lies within both of them."""
CLEAR_RADII = 1.0
"""The opening reaches at least so many of the branch's radii beyond the junction's new place."""
ROUND_DEG = 100.0
"""Where three arms have no clear trunk: if the way from branch to branch turns by less than this, no one is the others' stem."""
FORKED_PX = 0.5
"""Two trunks that are so far apart have parted."""
MISSED_PX = 6.0
"""A side branch that passes the trunk by so much does not come from it."""


@dataclass(frozen=True, slots=True, eq=False)
class Rebuilt:
    """Junctions anew: their ``places`` along the trunk (M, 2), the trunk's pieces from each to the next (M - 1), and for each arm
    the place that it starts from and its line."""

    places: Points
    pieces: list[Points]
    arms: list[tuple[int, Arm]]


def are_together(arm: Arm, back: Arm) -> bool:
    """Whether a branch between two junctions, seen from both, is too short to leave both openings."""
    return any(gate_of(a, geometry.arc_length(a.points), 0.0, wider=TOGETHER) is None for a in (arm, back))


def rebuild(arms: list[Arm], vessel: Mask, *, is_alone: bool) -> Rebuilt | None:
    """A junction, or some that are together, anew.

    None where too few arms are long enough to tell, where an arm of junctions that are together does not lead to the trunk (it
    comes from a side branch, or there is no single trunk), and where a place would lie outside the vessel.

    Parameters
    ----------
    arms : all branches that lead out of the opening, outwards.
    vessel : the vessel's mask (h, w).
    is_alone : whether that is one junction.
    """
    anew = _anew(arms, vessel, is_alone)
    return anew if anew is not None and _is_inside(anew, vessel) else None


def _is_inside(anew: Rebuilt, vessel: Mask) -> bool:
    """Whether all places are in the vessel and all lines in the picture, which smoothing may leave by a pixel."""
    lines = np.concatenate([*anew.pieces, *(arm.points for _, arm in anew.arms)])
    limit = np.array([vessel.shape[1], vessel.shape[0]])
    return bool((lines >= -1.0).all() and (lines <= limit).all() and (geometry.sample(vessel, anew.places) >= 0.5).all())


def _anew(arms: list[Arm], vessel: Mask, is_alone: bool) -> Rebuilt | None:
    along = [geometry.arc_length(arm.points) for arm in arms]
    gates: list[Gate | None] = [gate_of(arm, way, 0.0) for arm, way in zip(arms, along, strict=True)]
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
    # Who comes from elsewhere mostly shows it without its walls, too. It is asked first, with its walls, and they decide: where it
    # does come from elsewhere the others need not be asked.
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
    """By how much a side branch passes the trunk: its line begins on it."""
    return math.dist(line[0].tolist(), line[1].tolist())


def _mark(index: int, trunk: Trunk, bridges: dict[int, tuple[int, Points]]) -> int:
    """Which point of the trunk an arm starts from."""
    if index in bridges:
        return bridges[index][0]
    marks = [mark for mark, _ in bridges.values()] or [len(trunk.points) // 2]
    return min(marks) if index == trunk.ends[0] else max(marks)


def _assembled(
    arms: list[Arm],
    along: list[NDArray[np.float64]],
    gates: dict[int, Gate],
    trunk: Trunk,
    bridges: dict[int, tuple[int, Points]],
) -> Rebuilt:
    for index in range(len(arms)):
        if index not in gates:  # too short to have a gate
            near = arms[index].points[min(2, len(arms[index].points) - 1)]
            mark = int(np.hypot(*(trunk.points - near).T).argmin())
            bridges[index] = min(max(mark, 1), len(trunk.points) - 2), np.empty((0, 2))
    marks = sorted({mark for mark, _ in bridges.values()}) or [len(trunk.points) // 2]
    pieces = [trunk.points[first : last + 1] for first, last in pairwise(marks)]
    anew = []
    for index, (arm, way) in enumerate(zip(arms, along, strict=True)):
        mark = _mark(index, trunk, bridges)
        if index not in gates:
            anew.append((marks.index(mark), _rejoined(arm, way, _point(trunk.points[mark]))))
            continue
        gate = gates[index]
        if index in bridges:
            bridge = bridges[index][1]
        else:
            bridge = trunk.points[mark::-1] if index == trunk.ends[0] else trunk.points[mark:]
        anew.append((marks.index(mark), _bridged(arm, way, gate, bridge)))
    return Rebuilt(trunk.points[marks], pieces, anew)


def _bridged(arm: Arm, along: NDArray[np.float64], gate: Gate, bridge: Points) -> Arm:
    """An arm with a line from the junction to its gate in place of what it had within the opening."""
    rest = int(along.searchsorted(gate.position_px + 0.5 * STEP_PX, "right"))
    radius = np.concatenate([np.full(len(bridge), gate.radius_px), arm.radius[rest:]])
    return arm.along(np.concatenate([bridge, arm.points[rest:]]), radius)


def _rejoined(arm: Arm, along: NDArray[np.float64], place: Point) -> Arm:
    """An arm too short to have a gate, led from the junction's new place: what lies behind that place would be a hook in it."""
    aside_px, position_px, _ = geometry.nearest(arm.points, place, along)
    rest = along > position_px + max(aside_px, 0.5 * STEP_PX)
    rest[-1] = True
    points, radius = arm.points[rest], arm.radius[rest]
    way = geometry.resample(np.array([place, points[0]]), STEP_PX)[:-1]
    return arm.along(np.concatenate([way, points]), np.concatenate([np.full(len(way), radius[0]), radius]))


def _fork(
    arms: list[Arm],
    along: list[NDArray[np.float64]],
    gates: dict[int, Gate],
    trunks: tuple[tuple[int, int], tuple[int, int]],
    vessel: Mask,
) -> Rebuilt:
    """A junction whose stem goes on smoothly into both branches, and ends where they part."""
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
    """A junction any two of whose arms might be the trunk: all go straight to the point that fits their directions best."""
    place = meeting_point(list(gates.values()))
    straight = [geometry.resample(np.array([place, gates[index].place]), STEP_PX) for index in range(len(arms))]
    return Rebuilt(np.array([place]), [], [(0, _bridged(arm, along[k], gates[k], straight[k])) for k, arm in enumerate(arms)])


def _point(values: Points) -> Point:
    return float(values[0]), float(values[1])
