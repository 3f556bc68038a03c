"""Where vessels meet: the junction put where the branches' own centerlines meet, not where the skeleton does.

In the widened lumen of a bifurcation the skeleton leaves the trunk's centerline towards the opening, by some pixels over some two
radii to each side. So the part of each branch within the opening is replaced: a trunk goes on smoothly through it, and a side
branch runs to the trunk as its walls do, as far as they can be seen. A stem that might go on into either branch does so into both;
where the branches might be each other's trunk, too, all three go straight to one point. Junctions so near to each other that no
branch in between leaves their openings are taken together: one trunk runs through all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.perception.lumen import two_shapes, wall_distances
from core.types import Point, Points

STEP_PX = 2.0
OPENING_MIN_RADII = 0.8
OPENING_MAX_RADII = 2.5
"""An opening ends where the lumen is as narrow as the branch itself: looked for between these multiples of its junction's
radius."""
TOGETHER = 1.5
"""A branch from junction to junction that has no gate even with the openings so many times as wide lies within both of them."""
SETTLED = 1.1
"""As narrow as the branch itself: at most this factor of its own radius (and a third of a pixel)."""
BEYOND_RADII = 0.4
"""The skeleton comes back to the middle a little later than the radius does."""
WIDTH_POINTS = 5
WIDTH_RADII = 0.3
"""A branch's radius is that of so many points at its gate which are about as wide as it is."""
HEADING_RADII = 1.0
"""A branch's direction is taken over this many of its radii, and at least 12 px."""
CLEAR_RADII = 1.0
"""The opening reaches at least so many of the branch's radii beyond the junction's new place."""
TRUNK_LEAD_DEG = 10.0
"""Where another pair of a lone junction's three arms is a trunk nearly as likely, by so much, it has no clear one."""
ROUND_DEG = 100.0
"""And where the way from one branch to the other turns by less than this, none of the three is the stem of the others."""
FORKED_PX = 0.5
"""Two trunks that are so far apart have parted."""
WIDER_DEG = 100.0
"""A trunk is as wide as its branches: one that is left twice as wide is as unlikely as this much of a turn."""
WALL_SEARCH_PX = 8
WALL_RADII = 1.15
"""A wall farther off than so many radii (and a pixel) is another one's: here is an opening. One so near to the trunk is its own."""
MISSED_PX = 6.0
"""A side branch that passes the trunk by so much does not come from it."""
TRUNK_STIFFNESS = 0.5
BRANCH_STIFFNESS = 0.5
"""How hard it is for walls to bend a line, in points of it."""
ONE_WALL = 0.7
"""How much a point counts that has a wall on one side only, whose distance should be the radius."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Rebuilt:
    """Junctions anew: their ``places`` along the trunk (M, 2), the trunk's pieces from each to the next (M - 1), and for each arm
    the place that it starts from and its line."""

    places: Points
    pieces: list[tuple[Points, NDArray[np.float64]]]
    arms: list[tuple[int, Arm]]


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


@dataclass(frozen=True, slots=True, eq=False)
class _Trunk:
    """A curve from one arm's gate to another's (N, 2), and the lumen's radius along it (N,)."""

    ends: tuple[int, int]
    points: Points
    radius: NDArray[np.float64]


def are_together(arm: Arm, back: Arm) -> bool:
    """Whether a branch between two junctions, seen from both, is too short to leave both openings."""
    return any(
        _gate(replace(a, opening_px=TOGETHER * a.opening_px), polyline.arc_length(a.points), 0.0) is None for a in (arm, back)
    )


def rebuild(arms: list[Arm], level: NDArray[np.float32], *, is_alone: bool) -> Rebuilt | None:
    """A junction, or some that are together, anew.

    None where too few arms are long enough to tell, where an arm of junctions that are together does not lead to the trunk (it
    comes from a side branch, or there is no single trunk), and where a place would lie outside the vessel.

    Parameters
    ----------
    arms : all branches that lead out of the opening, outwards.
    level : the vessel's mask or probability (h, w).
    is_alone : whether that is one junction.
    """
    anew = _anew(arms, level, is_alone)
    return anew if anew is not None and _is_inside(anew, level) else None


def _is_inside(anew: Rebuilt, level: NDArray[np.float32]) -> bool:
    """Whether all places are in the vessel and all lines in the picture, which smoothing may leave by a pixel."""
    lines = np.concatenate([*(points for points, _ in anew.pieces), *(arm.points for _, arm in anew.arms)])
    limit = np.array([level.shape[1], level.shape[0]])
    return bool((lines >= -1.0).all() and (lines <= limit).all() and (polyline.sample(level, anew.places) >= 0.5).all())


def _anew(arms: list[Arm], level: NDArray[np.float32], is_alone: bool) -> Rebuilt | None:
    along = [polyline.arc_length(arm.points) for arm in arms]
    gates: list[_Gate | None] = [_gate(arm, way, 0.0) for arm, way in zip(arms, along, strict=True)]
    known = {index: gate for index, gate in enumerate(gates) if gate is not None}
    if len(known) < 2:
        return None
    equal = _equal_trunks(known) if is_alone and len(known) == len(arms) else None
    if equal is not None:
        (_, first), (_, second) = equal
        from_branch_to_branch = _turn_deg(known[first], known[second])
        return _star(arms, along, known) if from_branch_to_branch < ROUND_DEG else _fork(arms, along, known, equal, level)
    trunk = _trunk(known)
    bridges = {index: _side_branch(gate, trunk) for index, gate in known.items() if index not in trunk.ends}
    # The skeleton's junction may lie well inside one arm: seen from the new place, that arm's opening reaches further out.
    for index, gate in list(known.items()):
        needed = gate.position_px + CLEAR_RADII * gate.radius_px - gate.beyond(_point(trunk.points[_mark(index, trunk, bridges)]))
        if gate.position_px < needed:
            known[index] = _gate(arms[index], along[index], needed) or gate
    trunk = _between_walls(_trunk(known), level)
    bridges = {index: _side_branch(gate, trunk, level) for index, gate in known.items() if index not in trunk.ends}
    missed = {index for index, (_, line) in bridges.items() if math.dist(line[0].tolist(), line[1].tolist()) > MISSED_PX}
    if missed and not is_alone:
        return None
    for index in missed:
        mark, _ = bridges[index]
        bridges[index] = mark, polyline.resample(np.array([trunk.points[mark], known[index].place]), STEP_PX)
    return _assembled(arms, along, known, trunk, bridges)


def _mark(index: int, trunk: _Trunk, bridges: dict[int, tuple[int, Points]]) -> int:
    """Which point of the trunk an arm starts from."""
    if index in bridges:
        return bridges[index][0]
    marks = [mark for mark, _ in bridges.values()] or [len(trunk.points) // 2]
    return min(marks) if index == trunk.ends[0] else max(marks)


def _assembled(
    arms: list[Arm],
    along: list[NDArray[np.float64]],
    gates: dict[int, _Gate],
    trunk: _Trunk,
    bridges: dict[int, tuple[int, Points]],
) -> Rebuilt:
    for index in range(len(arms)):
        if index not in gates:  # too short to have a gate
            near = arms[index].points[min(2, len(arms[index].points) - 1)]
            mark = int(np.hypot(*(trunk.points - near).T).argmin())
            bridges[index] = min(max(mark, 1), len(trunk.points) - 2), np.empty((0, 2))
    marks = sorted({mark for mark, _ in bridges.values()}) or [len(trunk.points) // 2]
    pieces = [(trunk.points[first : last + 1], trunk.radius[first : last + 1]) for first, last in pairwise(marks)]
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


def _bridged(arm: Arm, along: NDArray[np.float64], gate: _Gate, bridge: Points) -> Arm:
    """An arm with a line from the junction to its gate in place of what it had within the opening."""
    rest = int(along.searchsorted(gate.position_px + 0.5 * STEP_PX, "right"))
    radius = np.concatenate([np.full(len(bridge), gate.radius_px), arm.radius[rest:]])
    return replace(arm, points=np.concatenate([bridge, arm.points[rest:]]), radius=radius)


def _rejoined(arm: Arm, along: NDArray[np.float64], place: Point) -> Arm:
    """An arm too short to have a gate, led from the junction's new place: what lies behind that place would be a hook in it."""
    aside_px, position_px, _ = polyline.nearest(arm.points, place, along)
    rest = along > position_px + max(aside_px, 0.5 * STEP_PX)
    rest[-1] = True
    points, radius = arm.points[rest], arm.radius[rest]
    way = polyline.resample(np.array([place, points[0]]), STEP_PX)[:-1]
    return replace(arm, points=np.concatenate([way, points]), radius=np.concatenate([np.full(len(way), radius[0]), radius]))


def _gate(arm: Arm, along: NDArray[np.float64], at_least_px: float) -> _Gate | None:
    """Where an arm has left the opening: its lumen is as narrow there as it stays. None for an arm too short to tell."""
    radius_px = arm.opening_px
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
    # The distance to the nearest wall is less than half the width wherever the line is not quite in the middle.
    wide = arm.half_width[index : index + WIDTH_POINTS]
    wide = wide[np.abs(wide - own) < WIDTH_RADII * own + 1.0]
    return _Gate(
        (x, y), ((far_x - x) / length, (far_y - y) / length), float(along[index]), polyline.median(wide) if len(wide) else own
    )


def _unlikeliness(gates: dict[int, _Gate], pair: tuple[int, int]) -> float:
    """Of a trunk between two arms, in degrees: how much it turns, and how much narrower it is than the others."""
    first, second = gates[pair[0]], gates[pair[1]]
    narrow = max(min(first.radius_px, second.radius_px), 0.5)
    widest = max((gate.radius_px for index, gate in gates.items() if index not in pair), default=0.0)
    return _turn_deg(first, second) + WIDER_DEG * max(0.0, widest / narrow - 1.0)


def _equal_trunks(gates: dict[int, _Gate]) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Of three arms, the two pairs that are a trunk nearly alike, the arm of both first; None for a clear trunk."""
    if len(gates) != 3:
        return None
    (best, ends), (other, others), _ = sorted((_unlikeliness(gates, pair), pair) for pair in combinations(gates, 2))
    if other >= best + TRUNK_LEAD_DEG:
        return None
    (stem,) = set(ends) & set(others)
    (first,), (second,) = set(ends) - {stem}, set(others) - {stem}
    return (stem, first), (stem, second)


def _fork(
    arms: list[Arm],
    along: list[NDArray[np.float64]],
    gates: dict[int, _Gate],
    trunks: tuple[tuple[int, int], tuple[int, int]],
    level: NDArray[np.float32],
) -> Rebuilt:
    """A junction whose stem goes on smoothly into both branches, and ends where they part."""
    curves = [_between_walls(_trunk_of(gates, ends), level).points for ends in trunks]
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


def _star(arms: list[Arm], along: list[NDArray[np.float64]], gates: dict[int, _Gate]) -> Rebuilt:
    """A junction any two of whose arms might be the trunk: all go straight to the point that fits their directions best."""
    place = _meeting_point(list(gates.values()))
    straight = [polyline.resample(np.array([place, gates[index].place]), STEP_PX) for index in range(len(arms))]
    return Rebuilt(np.array([place]), [], [(0, _bridged(arm, along[k], gates[k], straight[k])) for k, arm in enumerate(arms)])


def _meeting_point(gates: list[_Gate]) -> Point:
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


def _trunk(gates: dict[int, _Gate]) -> _Trunk:
    """The curve through the opening between the two arms that go on most smoothly and are wide enough for the others."""
    return _trunk_of(gates, min(combinations(gates, 2), key=lambda pair: _unlikeliness(gates, pair)))


def _trunk_of(gates: dict[int, _Gate], ends: tuple[int, int]) -> _Trunk:
    first, second = gates[ends[0]], gates[ends[1]]
    points = _hermite(first, second)
    return _Trunk(ends, points, np.linspace(first.radius_px, second.radius_px, len(points)))


def _between_walls(trunk: _Trunk, level: NDArray[np.float32]) -> _Trunk:
    """The trunk bent as its walls do, as far as they can be seen; its ends and its directions there stay."""
    share = np.linspace(0.0, 1.0, len(trunk.points))
    hump = 16.0 * share**2 * (1.0 - share) ** 2
    shapes = np.stack([hump, hump * (2.0 * share - 1.0)])
    normal, shift, weight = _to_walls(trunk.points, trunk.radius, level)
    size, lean = two_shapes(shapes, shift, weight, TRUNK_STIFFNESS)
    return replace(trunk, points=trunk.points + (size * shapes[0] + lean * shapes[1])[:, None] * normal)


def _turn_deg(first: _Gate, second: _Gate) -> float:
    """By how much a line turns that comes in through one gate, goes straight to the other, and leaves through it."""
    x, y = second.place[0] - first.place[0], second.place[1] - first.place[1]
    length = max(math.hypot(x, y), 1e-9)
    cosines = -(first.outward[0] * x + first.outward[1] * y) / length, (second.outward[0] * x + second.outward[1] * y) / length
    return sum(math.degrees(math.acos(min(1.0, max(-1.0, cosine)))) for cosine in cosines)


def _to_walls(
    points: Points, radius: NDArray[np.float64], level: NDArray[np.float32], trunk: _Trunk | None = None
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
    points: Points, normal: Points, radius: NDArray[np.float64], level: NDArray[np.float32], trunk: _Trunk | None
) -> NDArray[np.float64]:
    """Distances of a line's own walls, to the right and to the left (2, N); NaN where there is none."""
    places, directions = np.concatenate([points, points]), np.concatenate([normal, -normal])
    limit = np.concatenate([radius, radius])
    distance = wall_distances(level, places, directions, limit, WALL_SEARCH_PX)
    distance[distance > WALL_RADII * limit + 1.0] = math.nan
    seen = np.flatnonzero(np.isfinite(distance))
    if trunk is not None and len(seen):
        walls = places[seen] + distance[seen, None] * directions[seen]
        away = np.hypot(walls[:, None, 0] - trunk.points[:, 0], walls[:, None, 1] - trunk.points[:, 1])
        distance[seen[(away - WALL_RADII * trunk.radius).min(axis=1) <= 1.0]] = math.nan
    return distance.reshape(2, -1)


def _side_branch(gate: _Gate, trunk: _Trunk, level: NDArray[np.float32] | None = None) -> tuple[int, Points]:
    """Which of the trunk's points a side branch comes from, and its line from there to its gate.

    It leaves the gate in its direction, and goes straight or, where the `level` is given, as a parabola that its walls bend.
    """
    start, inward = np.array(gate.place), -np.array(gate.outward)
    reach = max(40.0, 3.0 * float(np.hypot(*(trunk.points - start).T).min()))
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


def _first_meeting(line: Points, trunk: _Trunk) -> tuple[int, int]:
    """Where a line first meets the trunk: which of its points, and which of the trunk's."""
    gaps = np.hypot(trunk.points[:, None, 0] - line[:, 0], trunk.points[:, None, 1] - line[:, 1])
    nearest = gaps.min(axis=0)
    close = np.flatnonzero(nearest < 0.75 * STEP_PX)
    end = int(close[0]) if len(close) else int(nearest.argmin())
    while end + 1 < len(nearest) and nearest[end + 1] < nearest[end]:
        end += 1
    return end, int(gaps[:, end].argmin())


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


def _point(values: Points) -> Point:
    return float(values[0]), float(values[1])
