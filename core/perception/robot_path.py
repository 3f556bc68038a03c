"""The robot's path from tail to head, found on the pixel graph of its skeleton (METHOD section 4).

Candidates for the robot's path: ways through the pixel graph, and how good each is (METHOD section 4).

The separate pieces of the robot's skeleton: one robot, a broken one, or several (METHOD section 4).

The robot's path to sub-pixel precision: centred in its mask, smooth, and as long as the robot is (METHOD sections 2 and 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.config.models import PathConfig, PerceptionConfig
from core.perception import compiled, skeleton
from core.perception.head_tail import Surroundings, is_at_vessel_end, is_entry, tail_first, was_the_head
from core.perception.skeleton import PixelChain, PixelGraph, trace
from core.types import Mask, Masks, Point, Points, Reason, Refusal, RobotPath, Skeletons, VesselGraph

Steps = tuple[tuple[int, bool], ...]
"""Chains in walking order, each with whether it is walked from its start to its end."""
HEADING_PX = 10.0
"""Directions at a junction are taken over this length of each chain."""
STEPS_PER_CANDIDATE = 20


@dataclass(frozen=True, slots=True, eq=False)
class PathCandidate:
    """A way through the graph that uses no chain twice. ``effective_px`` is its length less what its turns at junctions cost."""

    start: int
    end: int
    points: Points
    length_px: float
    effective_px: float


def max_steps(config: PathConfig) -> int:
    """How many chains may be walked in one frame, by all its starts together."""
    return STEPS_PER_CANDIDATE * config.max_candidates


def explore(graph: PixelGraph, start: int, config: PathConfig, budget: int | None = None) -> list[PathCandidate]:
    """All ways from an end of the skeleton to its other ends, without using a chain twice; longest (effective) first.

    A node may be passed twice: a robot that crosses itself does. Straight continuations are tried first, so that the limits drop
    the unlikely ones: ``max_candidates``, and `budget`, the number of chains walked. Where no other end can be reached (the robot's
    head lies against its own body) the ways that stop at a junction are given instead.
    """
    leaving = _chains_at(graph)
    degrees = graph.degrees()
    headings = {(index, start): _heading(chain, start) for index, chain in enumerate(graph.chains) for start in (True, False)}
    finished: list[tuple[Steps, float]] = []
    stopped: list[tuple[Steps, float]] = []
    pending: list[tuple[int, Steps, float]] = [(start, (), 0.0)]
    left = max_steps(config) if budget is None else budget
    while pending and left > 0 and len(finished) < config.max_candidates:
        left -= 1
        node, steps, turning = pending.pop()
        if steps and degrees[node] == 1:
            finished.append((steps, turning))
            continue
        used = {index for index, _ in steps}
        arriving = -headings[steps[-1][0], not steps[-1][1]] if steps else None
        options = []
        for index, onward in leaving[node]:
            if index not in used:
                turn = 0.0 if arriving is None else 1.0 - float(arriving @ headings[index, onward])
                options.append((turn, index, onward))
        if not options and steps:
            stopped.append((steps, turning))
        for turn, index, onward in sorted(options, reverse=True):
            chain = graph.chains[index]
            pending.append((chain.end if onward else chain.start, (*steps, (index, onward)), turning + turn))
    trails = [_trail(graph, steps, turning, config) for steps, turning in finished or stopped]
    return sorted(trails, key=lambda trail: -trail.effective_px)


def _chains_at(graph: PixelGraph) -> list[list[tuple[int, bool]]]:
    leaving: list[list[tuple[int, bool]]] = [[] for _ in range(len(graph.nodes))]
    for index, chain in enumerate(graph.chains):
        leaving[chain.start].append((index, True))
        leaving[chain.end].append((index, False))
    return leaving


def _heading(chain: PixelChain, from_start: bool) -> NDArray[np.float64]:
    """Unit vector from a chain's node into the chain."""
    points = chain.points if from_start else chain.points[::-1]
    chord = points[min(len(points) - 1, round(HEADING_PX))] - points[0]
    return np.asarray(chord / max(float(np.hypot(chord[0], chord[1])), 1e-9))


def _trail(graph: PixelGraph, steps: Steps, turning: float, config: PathConfig) -> PathCandidate:
    chains = [(graph.chains[index], onward) for index, onward in steps]
    lines = [chain.points if onward else chain.points[::-1] for chain, onward in chains]
    points = np.concatenate([lines[0], *(line[1:] for line in lines[1:])])
    length = float(geometry.arc_length(points)[-1])
    (first, onward), (last, last_onward) = chains[0], chains[-1]
    return PathCandidate(
        start=first.start if onward else first.end,
        end=last.end if last_onward else last.start,
        points=points,
        length_px=length,
        effective_px=length - config.junction_turn_px * turning,
    )


def score(points: Points, length_share: float, config: PathConfig) -> float:
    """The paper's score of a path: ``w_l * length + w_s * smoothness + w_c * consistency``.

    Parameters
    ----------
    points : the path (N, 2).
    length_share : its length against the longest candidate, 0..1; the paper prefers shorter ones, so its weight is negative.
    config : weights, the step over which directions are taken, and whether a reversal counts as -1 (signed) or, as in the paper,
        as +1 (absolute).
    """
    # Steps of one pixel only know multiples of 45 degrees; the paper's form takes them as they are.
    line = geometry.resample(points, config.step_px) if config.step_px > 1.0 else points
    steps = _unit_steps(line)
    return (
        config.weight_length * length_share
        + config.weight_smoothness * _smoothness(steps, config.cosine)
        + config.weight_consistency * _consistency(line, steps, config.cosine)
    )


def smoothness(line: Points, cosine: Literal["signed", "absolute"]) -> float:
    """Mean cosine of the change of direction at each inner point: 1 for a straight line."""
    return _smoothness(_unit_steps(line), cosine)


def consistency(line: Points, cosine: Literal["signed", "absolute"]) -> float:
    """Mean cosine between each step and the vector from start to end: 1 for a straight line, 0 for a closed one."""
    return _consistency(line, _unit_steps(line), cosine)


def _smoothness(steps: Points, cosine: Literal["signed", "absolute"]) -> float:
    if len(steps) < 2:
        return 1.0
    before, after = steps[:-1], steps[1:]
    return _mean_cosine(before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1], cosine)


def _consistency(line: Points, steps: Points, cosine: Literal["signed", "absolute"]) -> float:
    chord = line[-1] - line[0]
    length = float(np.hypot(chord[0], chord[1]))
    if length == 0.0 or len(steps) == 0:
        return 0.0
    return _mean_cosine(steps @ (chord / length), cosine)


def _unit_steps(line: Points) -> Points:
    steps = line[1:] - line[:-1]
    length = np.hypot(steps[:, 0], steps[:, 1])
    moved = length > 0.0
    return np.asarray(steps[moved] / length[moved, None])


def _mean_cosine(cosines: NDArray[np.float64], cosine: Literal["signed", "absolute"]) -> float:
    return float((np.abs(cosines) if cosine == "absolute" else cosines).sum()) / len(cosines)


PIECES_HEADING_PX = 12
"""Pixels behind an end that give its direction."""
FAR_GAP_FACTOR = 3.0
FAR_TURN_SHARE = 0.6
"""Pieces that look straight at each other (a turn of this share of the allowed one) belong together across this many thresholds."""
NEAR_TURN_FACTOR = 1.5
"""Pieces nearer than the gap threshold belong together even if they turn by this much more than was repaired."""
COMES_IN_PX = 10
"""A piece of which more lies outside the vessel comes in from there."""
SURER_BY = 0.05
"""A line that comes in from nowhere is none of the robot if the robot's mean probability within the vessel exceeds its by this."""
PREVIOUS_PX = 5
"""A piece this near to the last frame's path lies on it."""


@dataclass(frozen=True, slots=True)
class Component:
    """A connected piece: its nodes in the pixel graph, and its length within the vessel (or its length, if no piece is within)."""

    nodes: tuple[int, ...]
    size_px: float


def find_pieces(graph: PixelGraph, vessel: Mask) -> list[Component]:
    """The connected pieces, largest first. A cable that lies outside the vessel is small, however long it is."""
    group = np.arange(len(graph.nodes))
    for chain in graph.chains:
        group[group == group[chain.end]] = group[chain.start]
    length, inside = np.zeros(len(group)), np.zeros(len(group))
    for chain in graph.chains:
        chain_px = float(geometry.arc_length(chain.points)[-1])
        length[group[chain.start]] += chain_px
        inside[group[chain.start]] += chain_px * float(_at(vessel, chain.points).mean())
    size = inside if inside.any() else length
    names = {int(group[chain.start]) for chain in graph.chains}
    pieces = [Component(tuple(np.flatnonzero(group == name).tolist()), float(size[name])) for name in names]
    return sorted(pieces, key=lambda piece: -piece.size_px)


def without_reflections(
    graph: PixelGraph, pieces: list[Component], around: Surroundings, config: PerceptionConfig
) -> list[Component]:
    """The pieces (largest first) without long lines that no robot can be: they come in from nowhere, while another piece does.

    A robot comes in at the image border, at the port or from outside the vessel; one whose entry is covered begins at an end of the
    vessel. What lies elsewhere is a part of it beyond something that hides it, or a reflection, a scratch, the board's grain: of
    these the network is less sure. One that an end of the robot looks at is kept, for ``check_pieces`` to judge, and so are those
    beside which what comes in is but a bit, and what was the robot in the last frame.
    """
    large = [piece for piece in pieces if piece.size_px >= config.path.min_length_px]
    if len(large) < 2 or not config.quality.enabled:
        return pieces
    coming = [piece for piece in large if _comes_in(graph, piece, around)]
    robot = next((piece for piece in large if piece in coming or _begins_at_vessel_end(graph, piece, around)), None)
    if robot is None:
        return pieces
    headings, least = _headings(graph), _sureness(graph, robot, around) - SURER_BY
    none = [
        piece
        for piece in large
        if piece is not robot
        and piece not in coming
        and robot.size_px >= config.path.outlier_share * piece.size_px
        and not _is_previous(graph, piece, around)
        and _sureness(graph, piece, around) < least
        and _facing_gap(graph, headings, robot, piece, config) is None
    ]
    return [piece for piece in pieces if piece not in none]


def _comes_in(graph: PixelGraph, piece: Component, around: Surroundings) -> bool:
    outside_px = int(np.count_nonzero(~_at(around.masks.vessel, _places(graph, piece))))
    return outside_px > COMES_IN_PX or any(is_entry(end, around) for end in _ends(graph, piece))


def _begins_at_vessel_end(graph: PixelGraph, piece: Component, around: Surroundings) -> bool:
    return any(is_at_vessel_end(end, around) for end in _ends(graph, piece))


def _is_previous(graph: PixelGraph, piece: Component, around: Surroundings) -> bool:
    """Whether most of a piece lies where the robot of the last frame lay."""
    if around.previous is None:
        return False
    before = np.zeros(around.masks.robot.shape, np.uint8)
    line = np.rint(around.previous.points).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(before, [line], False, 1, 2 * PREVIOUS_PX + 1)
    return bool(_at(before, _places(graph, piece)).mean() > 0.5)


def _sureness(graph: PixelGraph, piece: Component, around: Surroundings) -> float:
    """The mean probability of robot along a piece, within the vessel if it is there at all: outside, a robot is seen better."""
    places = _places(graph, piece)
    inside = places[_at(around.masks.vessel, places)]
    return float(_at(around.masks.robot_probability, inside if len(inside) else places).mean())


def _ends(graph: PixelGraph, piece: Component) -> list[Points]:
    degrees = graph.degrees()
    return [graph.nodes[node] for node in piece.nodes if degrees[node] == 1]


def _places(graph: PixelGraph, piece: Component) -> Points:
    """The points (N, 2) of a piece, columns x, y."""
    return np.vstack([chain.points for chain in graph.chains if chain.start in piece.nodes])


def _at(values: NDArray[Any], places: Points) -> NDArray[Any]:
    """The values (h, w) at places (N, 2)."""
    columns, rows = np.rint(places).astype(np.intp).T
    return np.asarray(values[rows, columns])


def check_pieces(graph: PixelGraph, pieces: list[Component], config: PerceptionConfig) -> Refusal | None:
    """GAP_TOO_LONG when the robot goes on beyond a gap, SEVERAL_ROBOTS when the rest is too large to be outliers.

    Either way the largest piece's end would be taken for the head, wrongly. ``several_robots_share = 1`` turns the check off, and
    so does a disabled quality gate.
    """
    share, first = config.quality.several_robots_share, pieces[0]
    others = [piece for piece in pieces[1:] if piece.size_px >= config.path.min_length_px]
    if share >= 1.0 or not config.quality.enabled or not others:
        return None
    headings = _headings(graph)
    for other in others:
        gap_px = _facing_gap(graph, headings, first, other, config)
        if gap_px is not None:
            detail = f"the robot seems to go on {gap_px:.0f} px beyond its end"
            return Refusal(Reason.GAP_TOO_LONG, f"{detail} (repaired: straight gaps to {config.gaps.gap_threshold_px:.0f} px)")
    rest_px = sum(other.size_px for other in others)
    if rest_px < share * first.size_px:
        return None
    detail = f"{rest_px:.0f} px in {len(others)} more piece(s) beside one of {first.size_px:.0f} px (allowed: {100 * share:.0f} %)"
    return Refusal(Reason.SEVERAL_ROBOTS, detail)


def _headings(graph: PixelGraph) -> dict[int, NDArray[np.float64]]:
    """Unit vectors out of the skeleton's ends."""
    degrees, headings = graph.degrees(), {}
    for chain in graph.chains:
        for node, outward in ((chain.start, chain.points[::-1]), (chain.end, chain.points)):
            if degrees[node] == 1:
                chord = outward[-1] - outward[max(len(outward) - PIECES_HEADING_PX, 0)]
                headings[node] = chord / max(float(np.hypot(chord[0], chord[1])), 1e-9)
    return headings


def _facing_gap(
    graph: PixelGraph, headings: dict[int, NDArray[np.float64]], first: Component, second: Component, config: PerceptionConfig
) -> float | None:
    """The gap between two pieces if an end of one looks at an end of the other, else None."""
    threshold_px, max_turn_deg = config.gaps.gap_threshold_px, config.gaps.max_turn_deg
    found = []
    for a in first.nodes:
        for b in second.nodes:
            if a not in headings or b not in headings:
                continue
            gap_px = float(np.hypot(*(graph.nodes[a] - graph.nodes[b])))
            turn_deg = max(skeleton.turns_deg(graph.nodes[a], headings[a], graph.nodes[b], headings[b]))
            far = gap_px < FAR_GAP_FACTOR * threshold_px and turn_deg < FAR_TURN_SHARE * max_turn_deg
            near = gap_px < threshold_px and turn_deg < NEAR_TURN_FACTOR * max_turn_deg
            if far or near:
                found.append(gap_px)
    return min(found, default=None)


STEP_PX = 2.0
TRIM_RADII = 1.2
"""Thinning bends the skeleton's last radius towards a corner of a blunt end."""
END_HEADING_PX = 16.0
"""The end's direction and bend are taken over this length."""


def refine(points: Points, masks: Masks, radius_px: float, smoothing_px: float, extend: bool) -> tuple[Points, float]:
    """The path through the middle of the robot, and the robot's median radius in px.

    Parameters
    ----------
    points : pixel path (N, 2), tail -> head.
    masks : the robot's clean mask and probability.
    radius_px : rough radius of the robot, which limits how far to the sides is looked.
    smoothing_px : standard deviation of the smoothing along the path; 0 leaves the pixels as they are.
    extend : whether both ends are continued along their tangent to the mask's edge.
    """
    if smoothing_px == 0.0:
        return points, radius_px
    step = min(STEP_PX, smoothing_px)
    line = geometry.smooth(geometry.resample(points, step), smoothing_px / step)
    line, radius_px = _centred(line, masks.robot_probability, radius_px)
    line = geometry.smooth(line, smoothing_px / step)
    if extend and len(line) > 3:
        line = _to_edge(line, masks, radius_px)
        line = _to_edge(line[::-1], masks, radius_px)[::-1]
    return line, radius_px


def _centred(line: Points, probability: NDArray[np.float32], radius_px: float) -> tuple[Points, float]:
    """Each point moved across the path to the middle of the robot's probability there, and the median of the half widths."""
    if len(line) < 3:
        return line, radius_px
    across = geometry.normals(line)
    shift, total = compiled.probability_centres(probability, line, across, int(np.ceil(1.5 * radius_px + 2.0)), radius_px)
    seen = total[total > 1.0]
    thickness = geometry.median(seen) if len(seen) else 2.0 * radius_px
    return line + shift[:, None] * across, 0.5 * thickness


def _to_edge(line: Points, masks: Masks, radius_px: float) -> Points:
    """The last point replaced by where the path's own direction leaves the mask."""
    along = geometry.arc_length(line)
    total = float(along[-1])
    trimmed = geometry.cut(line, 0.0, total - min(TRIM_RADII * radius_px, 0.3 * total), along)
    onward = geometry.continued(trimmed, 6.0 * radius_px + 10.0, END_HEADING_PX)
    reach = edge_distance(onward, masks.robot, masks.robot_probability)
    if reach <= 0.0:
        return line
    return np.concatenate([trimmed[:-1], geometry.resample(geometry.cut(onward, 0.0, reach), STEP_PX)])


def edge_distance(places: Points, mask: Mask, probability: NDArray[np.float32]) -> float:
    """How far a line of points, 1 px apart, runs in a mask: to a fraction of a pixel, where the probability falls through 0.5."""
    height, width = mask.shape
    inside = 0
    for x, y in places.tolist():
        column, row = round(x), round(y)
        if not (0 <= column < width and 0 <= row < height and mask[row, column]):
            break
        inside += 1
    if inside in (0, len(places)):  # it never was in the mask, or never leaves it
        return 0.0
    first = max(inside - 2, 0)
    level = geometry.sample(probability, places[first : inside + 2]).tolist()
    for k, (here, there) in enumerate(pairwise(level)):
        if here >= 0.5 > there:
            return float(first + k + (here - 0.5) / (here - there))
    return float(inside - 1)


MAX_CHAINS = 80
"""A robot with all its false branches has some ten; a graph of more is a mesh, and any way through it is as good as another."""
MAX_ALL_CHAINS = 150
"""The same for all pieces together, of which a broken robot and some specks have some tens: more are not even looked at."""
SAME_END_PX = 10.0
"""Paths whose heads are this near to each other are the same answer."""
RIVAL_SHARE = 0.8
"""A branch of the same start competes with the chosen one if it is this long against it."""
CONTINUITY_WEIGHT = 0.3
CONTINUITY_PX = 30.0
"""In a stream a candidate that ends where the last one did gets this much more score, falling off over this distance."""


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    trail: PathCandidate
    score: float
    continuity: float


def find(
    skeletons: Skeletons,
    masks: Masks,
    config: PerceptionConfig,
    previous: RobotPath | None = None,
    vessel: VesselGraph | None = None,
    port: Point | None = None,
    earlier: RobotPath | None = None,
    *,
    came_from_within: bool = False,
) -> RobotPath | Refusal:
    """The robot's path, tail -> head, or why there is none.

    Starts are the ends at the image border or at the insertion port; a robot that enters inside the image starts at any end. From
    each start the longest branch is kept (shortened by what its turns at junctions cost), and the best scored of these is the
    robot.

    Parameters
    ----------
    skeletons : with the robot's gaps repaired.
    masks : the robot's mask and probability give radius, middle and ends; the vessel's mask tells robot from foreign cables.
    config : all of perception's settings.
    previous : the path of the last frame, which decides between nearly equal candidates.
    vessel : the vessel graph; its ends tell tail from head where the image border does not.
    port : where the robot is inserted, if known.
    earlier : in a stream, the path from before a gap; it says nothing but which end is the head.
    came_from_within : the head of one of these was seen well within the picture: at the image border it is no entry.

    Returns
    -------
    ``RobotPath``, or ``Refusal`` with NO_ROBOT, TOO_SHORT, SEVERAL_ROBOTS, GAP_TOO_LONG or AMBIGUOUS_PATH.
    """
    traced = trace(skeletons.robot)
    if not traced.chains:
        return Refusal(Reason.NO_ROBOT, "nothing in the image looks like the robot")
    if len(traced.chains) > MAX_ALL_CHAINS:
        return Refusal(Reason.AMBIGUOUS_PATH, f"it is a mesh of {len(traced.chains)} branches (at most {MAX_ALL_CHAINS})")
    total_px = sum(_length(chain.points) for chain in traced.chains)
    radius_px = float(np.clip(0.5 * cv2.countNonZero(masks.robot.view(np.uint8)) / max(total_px, 1.0), 0.5, 30.0))
    graph = _without_short_links(traced, 3.0 * radius_px)
    pieces = find_pieces(graph, masks.vessel)
    if not pieces:
        return Refusal(Reason.TOO_SHORT, f"{total_px:.0f} px long (at least {config.path.min_length_px:.0f} px)")
    around = Surroundings(masks, previous, vessel, port, config.path, earlier, came_from_within)
    pieces = without_reflections(graph, pieces, around, config)
    refusal = check_pieces(graph, pieces, config)
    if refusal is not None:
        return refusal
    chosen = [node for piece in pieces if piece.size_px >= config.path.outlier_share * pieces[0].size_px for node in piece.nodes]
    taken = set(chosen)
    chains = sum(chain.start in taken for chain in graph.chains)
    if chains > MAX_CHAINS:
        return Refusal(Reason.AMBIGUOUS_PATH, f"it is a mesh of {chains} branches (at most {MAX_CHAINS})")
    candidates, rivals = _candidates(graph, chosen, around, previous, config.path)
    if not candidates:
        return _why_no_candidate(graph, config.path)
    eligible = candidates if previous is None else [*candidates, *rivals]
    best = max(eligible, key=lambda candidate: candidate.score + candidate.continuity)
    must_show_head = config.quality.enabled and previous is None  # in a stream it may have just arrived there: ``check_in_view``
    if must_show_head and all(is_entry(place, around) for place in best.trail.points[[0, -1]]):
        return Refusal(Reason.AMBIGUOUS_PATH, "both of its ends lie at the image border, so its head may be out of view")
    points = tail_first(best.trail.points, around)
    if config.quality.enabled and was_the_head(points, around):
        return Refusal(Reason.AMBIGUOUS_PATH, "it reaches the image border at its head, which may be out of view")
    line, radius_px = refine(points, masks, radius_px, config.path.smoothing_px, config.cleaning.extend_ends)
    return RobotPath(
        points=line,
        score=best.score,
        runner_up=_runner_up(best, [*candidates, *rivals]),
        entry_on_border=is_entry(points[0], around),
        bridged_px=_bridged(points, skeletons),
        radius_px=radius_px,
    )


def _length(points: Points) -> float:
    return float(geometry.arc_length(points)[-1])


def _without_short_links(graph: PixelGraph, limit_px: float) -> PixelGraph:
    """Junctions that are nearer than `limit_px` along a chain made one.

    A robot that crosses itself is thinned to two junctions with a short link, which both strands pass; as one node of four chains
    it lets both strands through.
    """
    degrees = graph.degrees()
    name = np.arange(len(graph.nodes))
    kept = []
    for chain in graph.chains:
        short = chain.start != chain.end and min(degrees[chain.start], degrees[chain.end]) >= 3 and _length(chain.points) < limit_px
        if short and name[chain.start] != name[chain.end]:
            name[name == name[chain.end]] = name[chain.start]
        else:
            kept.append(chain)
    if len(kept) == len(graph.chains):
        return graph
    chains = tuple(
        PixelChain(int(name[c.start]), int(name[c.end]), c.points)
        for c in kept
        if name[c.start] != name[c.end] or c.start == c.end or _length(c.points) > 2.0 * limit_px
    )
    return PixelGraph(graph.nodes, chains)


def _candidates(
    graph: PixelGraph, nodes: list[int], around: Surroundings, previous: RobotPath | None, config: PathConfig
) -> tuple[list[_Candidate], list[_Candidate]]:
    """The best branch of each start, scored, and those other branches of the same starts that are nearly as long."""
    degrees = graph.degrees()
    ends = [node for node in nodes if degrees[node] == 1]
    entries = [node for node in ends if is_entry(graph.nodes[node], around)]
    winners, others = [], []
    starts = entries or ends
    share = max_steps(config) // max(len(starts), 1)
    for start in starts:
        valid = [trail for trail in explore(graph, start, config, share) if trail.length_px >= config.min_length_px]
        if not valid:
            continue
        worth = [trail.effective_px - config.outside_cost * _outside_end(trail.points, around.masks) for trail in valid]
        best = int(np.argmax(worth))
        winners.append((worth[best], valid[best]))
        others += [(w, trail) for w, trail in zip(worth, valid, strict=True) if trail is not valid[best]]
    most = max((worth for worth, _ in winners), default=0.0)
    rivals = [trail for worth, trail in others if worth >= RIVAL_SHARE * most]
    # Where no end is known to be the entry, the tips of side branches are starts too: only the longest ways are the robot.
    chosen = [trail for worth, trail in winners if entries or worth >= RIVAL_SHARE * most]
    longest = max((trail.length_px for trail in chosen), default=1.0)

    def scored(trail: PathCandidate) -> _Candidate:
        gap = 0.0 if previous is None else float(np.hypot(*(trail.points[-1] - previous.points[-1])))
        continuity = 0.0 if previous is None else CONTINUITY_WEIGHT * float(np.exp(-gap / CONTINUITY_PX))
        return _Candidate(trail, score(trail.points, trail.length_px / longest, config), continuity)

    return [scored(trail) for trail in chosen], [scored(trail) for trail in rivals]


def _outside_end(points: Points, masks: Masks) -> float:
    """How long the path's last part outside the vessel is; 0 where all of it is outside."""
    inside = masks.vessel[np.rint(points[:, 1]).astype(int), np.rint(points[:, 0]).astype(int)]
    return float(np.argmax(inside[::-1])) if inside.any() else 0.0


def _runner_up(best: _Candidate, all_candidates: list[_Candidate]) -> float | None:
    """Score of the best candidate with another pair of ends."""
    ends = best.trail.points[[0, -1]]
    different = []
    for other in all_candidates:
        theirs = other.trail.points[[0, -1]]
        same = min(np.abs(ends - theirs).max(), np.abs(ends - theirs[::-1]).max()) <= SAME_END_PX
        if not same:
            different.append(other.score)
    return max(different, default=None)


def _bridged(points: Points, skeletons: Skeletons) -> float:
    """Length of those repaired gaps that lie on the path."""
    length = 0.0
    for bridge in skeletons.bridges:
        if all(float(np.hypot(*(points - np.asarray(end)).T).min()) <= 2.0 for end in bridge):
            length += float(np.hypot(bridge[0][0] - bridge[1][0], bridge[0][1] - bridge[1][1]))
    return length


def _why_no_candidate(graph: PixelGraph, config: PathConfig) -> Refusal:
    longest = max(_length(chain.points) for chain in graph.chains)
    if longest < config.min_length_px:
        return Refusal(Reason.TOO_SHORT, f"{longest:.0f} px long (at least {config.min_length_px:.0f} px)")
    return Refusal(Reason.AMBIGUOUS_PATH, "the robot's outline is closed: it shows no end")
