"""Where vessels meet: the junction put where the branches' own centerlines meet, not where the skeleton does.

In the widened lumen of a bifurcation the skeleton leaves the trunk's centerline towards the opening, by some pixels over some two
radii to each side. So the part of each branch within the opening is replaced: a trunk goes on smoothly through it, and a side
branch runs to the trunk as its walls do, as far as they can be seen. A stem that might go on into either branch does so into both;
where the branches might be each other's trunk, too, all three go straight to one point. Junctions so near to each other that no
branch in between leaves their openings are taken together: one trunk runs through all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.perception.opening_lines import Trunk, between_walls, side_branch, trunk_between
from core.perception.openings import STEP_PX, Arm, Gate, equal_trunks, gate_of, likely_trunks, meeting_point, turn_deg
from core.types import Mask, Point, Points

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
    return any(gate_of(a, polyline.arc_length(a.points), 0.0, wider=TOGETHER) is None for a in (arm, back))


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
    return bool((lines >= -1.0).all() and (lines <= limit).all() and (polyline.sample(vessel, anew.places) >= 0.5).all())


def _anew(arms: list[Arm], vessel: Mask, is_alone: bool) -> Rebuilt | None:
    along = [polyline.arc_length(arm.points) for arm in arms]
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
            line = polyline.resample(np.array([trunk.points[mark], known[index].place]), STEP_PX)
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
    aside_px, position_px, _ = polyline.nearest(arm.points, place, along)
    rest = along > position_px + max(aside_px, 0.5 * STEP_PX)
    rest[-1] = True
    points, radius = arm.points[rest], arm.radius[rest]
    way = polyline.resample(np.array([place, points[0]]), STEP_PX)[:-1]
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
    straight = [polyline.resample(np.array([place, gates[index].place]), STEP_PX) for index in range(len(arms))]
    return Rebuilt(np.array([place]), [], [(0, _bridged(arm, along[k], gates[k], straight[k])) for k, arm in enumerate(arms)])


def _point(values: Points) -> Point:
    return float(values[0]), float(values[1])
