"""The robot's path from tail to head, found on the pixel graph of its skeleton (METHOD section 4).

Connected components of the skeleton -> path candidates through the graph and their scores -> the path to sub-pixel precision.
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
from core.messages import message
from core.perception import compiled, skeleton
from core.perception.head_tail import PreviousPath, Surroundings, is_at_vessel_end, is_entry, tail_first, was_the_head
from core.perception.skeleton import PixelChain, PixelGraph, trace
from core.types import Mask, Masks, Point, Points, Reason, Refusal, RobotPath, Skeletons, VesselGraph

Steps = tuple[tuple[int, bool], ...]
"""Chains in walking order, each with whether it is walked from its start to its end."""
HEADING_PX = 10.0
"""Directions at a junction are taken over this length of each chain."""
STEPS_PER_CANDIDATE = 20
"""All starts of a frame together walk at most this many chains for each of ``max_candidates``."""


@dataclass(frozen=True, slots=True, eq=False)
class PathCandidate:
    """A path through the graph that uses no chain twice. ``effective_px``: its length less the cost of its turns at junctions."""

    start: int
    end: int
    points: Points
    length_px: float
    effective_px: float


def explore(graph: PixelGraph, start: int, config: PathConfig, budget: int | None = None) -> list[PathCandidate]:
    """All paths from an end of the skeleton to its other ends, without using a chain twice; longest (effective) first.

    A node may be passed twice: a robot that crosses itself does. Straight continuations are tried first, so that the limits drop
    the unlikely paths: ``max_candidates``, and `budget`, the number of chains walked. Where no other end can be reached (the
    robot's head lies against its own body) the paths that stop at a junction are given instead.
    """
    leaving: list[list[tuple[int, bool]]] = [[] for _ in range(len(graph.nodes))]
    for index, chain in enumerate(graph.chains):
        leaving[chain.start].append((index, True))
        leaving[chain.end].append((index, False))
    degrees = graph.degrees()
    headings = {(index, start): _heading(chain, start) for index, chain in enumerate(graph.chains) for start in (True, False)}
    finished: list[tuple[Steps, float]] = []
    stopped: list[tuple[Steps, float]] = []
    pending: list[tuple[int, Steps, float]] = [(start, (), 0.0)]
    left = STEPS_PER_CANDIDATE * config.max_candidates if budget is None else budget
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
    candidates = [_path_candidate(graph, steps, turning, config) for steps, turning in finished or stopped]
    return sorted(candidates, key=lambda candidate: -candidate.effective_px)


def _heading(chain: PixelChain, from_start: bool) -> NDArray[np.float64]:
    """Unit vector from a chain's node into the chain."""
    points = chain.points if from_start else chain.points[::-1]
    chord = points[min(len(points) - 1, round(HEADING_PX))] - points[0]
    return np.asarray(chord / max(float(np.hypot(chord[0], chord[1])), 1e-9))


def _path_candidate(graph: PixelGraph, steps: Steps, turning: float, config: PathConfig) -> PathCandidate:
    chains = [(graph.chains[index], onward) for index, onward in steps]
    lines = [chain.points if onward else chain.points[::-1] for chain, onward in chains]
    points = np.concatenate([lines[0], *(line[1:] for line in lines[1:])])
    length = _length(points)
    (first, onward), (last, last_onward) = chains[0], chains[-1]
    return PathCandidate(
        start=first.start if onward else first.end,
        end=last.end if last_onward else last.start,
        points=points,
        length_px=length,
        effective_px=length - config.junction_turn_px * turning,
    )


def score(points: Points, length_share: float, config: PathConfig) -> float:
    """The paper's score of a path (N, 2): ``w_l * length + w_s * smoothness + w_c * consistency``.

    `length_share` is its length against the longest candidate, 0..1; the paper prefers shorter ones, so its weight is negative.
    A reversal counts as -1 (signed) or, as in the paper, as +1 (absolute).
    """
    # Steps of one pixel only know multiples of 45 degrees; the paper's form takes them as they are.
    line = geometry.resample(points, config.step_px) if config.step_px > 1.0 else points
    return (
        config.weight_length * length_share
        + config.weight_smoothness * smoothness(line, config.cosine)
        + config.weight_consistency * consistency(line, config.cosine)
    )


def smoothness(line: Points, cosine: Literal["signed", "absolute"]) -> float:
    """Mean cosine of the change of direction at each inner point: 1 for a straight line."""
    steps = _unit_steps(line)
    if len(steps) < 2:
        return 1.0
    before, after = steps[:-1], steps[1:]
    return _mean_cosine(before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1], cosine)


def consistency(line: Points, cosine: Literal["signed", "absolute"]) -> float:
    """Mean cosine between each step and the vector from start to end: 1 for a straight line, 0 for a closed one."""
    steps, chord = _unit_steps(line), line[-1] - line[0]
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


END_PIXELS = 12
"""Pixels behind an end that give its direction."""
FAR_GAP_FACTOR = 3.0
FAR_TURN_SHARE = 0.6
"""Components that face each other (a turn of this share of the allowed one) belong together across this many gap thresholds."""
NEAR_TURN_FACTOR = 1.5
"""Components nearer than the gap threshold belong together even if they turn by this much more than was repaired."""
ENTERING_PX = 10
"""A component of which more lies outside the vessel enters it from there."""
SURER_BY = 0.05
"""A component that enters from nowhere is no robot if the robot's mean probability within the vessel exceeds its by this."""
PREVIOUS_PX = 5
"""A component this near to the last frame's path lies on it."""


@dataclass(frozen=True, slots=True)
class Component:
    """A connected component: its nodes in the pixel graph, and its length within the vessel (or its length, if none is within)."""

    nodes: tuple[int, ...]
    size_px: float


def find_components(graph: PixelGraph, vessel: Mask) -> list[Component]:
    """The connected components, largest first. A cable that lies outside the vessel is small, however long it is."""
    group = np.arange(len(graph.nodes))
    for chain in graph.chains:
        group[group == group[chain.end]] = group[chain.start]
    length, inside = np.zeros(len(group)), np.zeros(len(group))
    for chain in graph.chains:
        chain_px = _length(chain.points)
        length[group[chain.start]] += chain_px
        inside[group[chain.start]] += chain_px * float(_at(vessel, chain.points).mean())
    size = inside if inside.any() else length
    names = {int(group[chain.start]) for chain in graph.chains}
    components = [Component(tuple(np.flatnonzero(group == name).tolist()), float(size[name])) for name in names]
    return sorted(components, key=lambda component: -component.size_px)


def without_reflections(
    graph: PixelGraph, components: list[Component], around: Surroundings, config: PerceptionConfig
) -> list[Component]:
    """The components (largest first) without long lines that cannot be robot: they enter from nowhere, while another one enters.

    A robot enters at the image border, at the port or from outside the vessel; one whose entry is covered begins at an end of the
    vessel. Other components are parts of it beyond something that hides it, or a reflection, a scratch, the board's grain, of which
    the network is less sure. One that an end of the robot faces is kept, for ``check_components`` to judge, and so are those beside
    which the entering one is much smaller, and what was the robot in the last frame.
    """
    large = [component for component in components if component.size_px >= config.path.min_length_px]
    if len(large) < 2 or not config.quality.enabled:
        return components
    entering = [component for component in large if _is_entering(graph, component, around)]
    robot = next((one for one in large if one in entering or any(is_at_vessel_end(e, around) for e in _ends(graph, one))), None)
    if robot is None:
        return components
    headings, least = _headings(graph), _sureness(graph, robot, around) - SURER_BY
    reflections = [
        component
        for component in large
        if component is not robot
        and component not in entering
        and robot.size_px >= config.path.outlier_share * component.size_px
        and not _is_previous(graph, component, around)
        and _sureness(graph, component, around) < least
        and _facing_gap(graph, headings, robot, component, config) is None
    ]
    return [component for component in components if component not in reflections]


def _is_entering(graph: PixelGraph, component: Component, around: Surroundings) -> bool:
    outside_px = int(np.count_nonzero(~_at(around.masks.vessel, _places(graph, component))))
    return outside_px > ENTERING_PX or any(is_entry(end, around) for end in _ends(graph, component))


def _is_previous(graph: PixelGraph, component: Component, around: Surroundings) -> bool:
    """Whether most of a component lies where the robot of the last frame lay."""
    if around.before.path is None:
        return False
    before = np.zeros(around.masks.robot.shape, np.uint8)
    line = np.rint(around.before.path.points).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(before, [line], False, 1, 2 * PREVIOUS_PX + 1)
    return bool(_at(before, _places(graph, component)).mean() > 0.5)


def _sureness(graph: PixelGraph, component: Component, around: Surroundings) -> float:
    """Mean robot probability along a component, within the vessel if it is there at all: outside, a robot is seen better."""
    places = _places(graph, component)
    inside = places[_at(around.masks.vessel, places)]
    return float(_at(around.masks.robot_probability, inside if len(inside) else places).mean())


def _ends(graph: PixelGraph, component: Component) -> list[Points]:
    degrees = graph.degrees()
    return [graph.nodes[node] for node in component.nodes if degrees[node] == 1]


def _places(graph: PixelGraph, component: Component) -> Points:
    return np.vstack([chain.points for chain in graph.chains if chain.start in component.nodes])


def _at(values: NDArray[Any], places: Points) -> NDArray[Any]:
    """The values (h, w) at places (N, 2)."""
    columns, rows = np.rint(places).astype(np.intp).T
    return np.asarray(values[rows, columns])


def check_components(graph: PixelGraph, components: list[Component], config: PerceptionConfig) -> Refusal | None:
    """GAP_TOO_LONG when the robot continues beyond a gap, SEVERAL_ROBOTS when the rest is too large to be outliers.

    Either way the end of the largest component would wrongly be taken for the head. ``several_robots_share = 1`` turns the check
    off, and so does a disabled quality gate.
    """
    share, first = config.quality.several_robots_share, components[0]
    others = [component for component in components[1:] if component.size_px >= config.path.min_length_px]
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
                chord = outward[-1] - outward[max(len(outward) - END_PIXELS, 0)]
                headings[node] = chord / max(float(np.hypot(chord[0], chord[1])), 1e-9)
    return headings


def _facing_gap(
    graph: PixelGraph, headings: dict[int, NDArray[np.float64]], first: Component, second: Component, config: PerceptionConfig
) -> float | None:
    """The gap between two components if an end of one faces an end of the other, else None."""
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
"""Distance of the refined path's points."""
TRIM_RADII = 1.2
"""Thinning bends the skeleton's last radius towards a corner of a blunt end."""
END_HEADING_PX = 16.0
"""The end's direction and bend are taken over this length."""
MOST_CUT_PX, MOST_BEYOND_PX, SURE_BEYOND = 5, 12, 0.6
"""Width of what cuts a piece off the robot's end without hiding it (the rim of a clip, a scratch, the shadow of a wall); length of
the piece: a longer one is in the mask; and its probability: a less likely one is as often a bubble or a reflection."""


def refine(points: Points, masks: Masks, radius_px: float, smoothing_px: float, extend: bool) -> tuple[Points, float]:
    """The path (N, 2), tail -> head, through the middle of the robot, and the robot's median radius in px.

    The rough `radius_px` limits the search to the sides; `smoothing_px` is the standard deviation of the smoothing along the
    path, 0 leaves the pixels as they are. With `extend` both ends are continued along their tangent to the mask's edge.
    """
    if smoothing_px == 0.0:
        return points, radius_px
    step = min(STEP_PX, smoothing_px)
    line = geometry.smooth(geometry.resample(points, step), smoothing_px / step)
    if len(line) >= 3:
        # Each point moves across the path to the middle of the robot's probability there.
        across = geometry.normals(line)
        reach = int(np.ceil(1.5 * radius_px + 2.0))
        shift, total = compiled.probability_centres(masks.robot_probability, line, across, reach, radius_px)
        seen = total[total > 1.0]
        thickness = geometry.median(seen) if len(seen) else 2.0 * radius_px
        line, radius_px = line + shift[:, None] * across, 0.5 * thickness
    line = geometry.smooth(line, smoothing_px / step)
    if extend and len(line) > 3:
        line = _to_edge(line, masks, radius_px)
        line = _to_edge(line[::-1], masks, radius_px)[::-1]
    return line, radius_px


def _to_edge(line: Points, masks: Masks, radius_px: float) -> Points:
    """The line with its last point where its own direction leaves the mask."""
    along = geometry.arc_length(line)
    total = float(along[-1])
    trimmed = geometry.cut(line, 0.0, total - min(TRIM_RADII * radius_px, 0.3 * total), along)
    onward = geometry.extrapolate(trimmed, 6.0 * radius_px + 10.0, END_HEADING_PX)
    reach = edge_distance(onward, masks.robot, masks.robot_probability)
    if reach <= 0.0:
        return line
    return np.concatenate([trimmed[:-1], geometry.resample(geometry.cut(onward, 0.0, reach), STEP_PX)])


def edge_distance(places: Points, mask: Mask, probability: NDArray[np.float32]) -> float:
    """Length of a line of points, 1 px apart, within a mask: to a fraction of a pixel, where the probability falls through 0.5.

    It goes on where the probability is ``SURE_BEYOND`` beyond at most ``MOST_CUT_PX``: that piece may be too small for the mask.
    """
    height, width = mask.shape
    in_image = np.all((np.rint(places) >= 0) & (np.rint(places) < (width, height)), axis=1)
    shown = len(places) if in_image.all() else int(np.argmin(in_image))
    columns, rows = np.rint(places[:shown]).astype(np.intp).T
    within = mask[rows, columns]
    inside = shown if within.all() else int(np.argmin(within))
    if inside in (0, len(places)):  # it never was in the mask, or never leaves it
        return 0.0
    level = geometry.sample(probability, places).tolist()
    last, most = inside - 1, min(inside + MOST_CUT_PX + MOST_BEYOND_PX, shown)
    while seen := [k for k in range(last + 1, min(last + 2 + MOST_CUT_PX, most)) if level[k] >= SURE_BEYOND and not within[k]]:
        last = seen[0]
    if last == most - 1:  # no small piece
        last = inside - 1
    first = max(last - 1, 0)
    for k, (here, there) in enumerate(pairwise(level[first : min(last + 3 + MOST_CUT_PX, max(shown, inside + 2))]), first):
        if here >= 0.5 > there:
            return float(k + (here - 0.5) / (here - there))
    return float(last)


MAX_CHAINS = 80
"""A robot with all its false branches has some ten; a graph of more is a mesh, and any path through it is as good as another."""
MAX_ALL_CHAINS = 150
"""The same for all components together, of which a broken robot and some specks have some tens."""
SAME_END_PX = 10.0
"""Paths whose heads are this near to each other are the same answer."""
RIVAL_SHARE = 0.8
"""A branch of the same start competes with the chosen one if it is this long against it."""
CONTINUITY_WEIGHT = 0.3
CONTINUITY_PX = 30.0
"""In a stream a candidate that ends where the last one did gets this much more score, falling off over this distance."""


@dataclass(frozen=True, slots=True, eq=False)
class _Scored:
    path: PathCandidate
    score: float
    continuity: float


def find(
    skeletons: Skeletons,
    masks: Masks,
    config: PerceptionConfig,
    *,
    vessel: VesselGraph | None = None,
    port: Point | None = None,
    before: PreviousPath = PreviousPath(),  # noqa: B008 (it is frozen)
) -> RobotPath | Refusal:
    """The robot's path, tail -> head, or the reason for none.

    Starts are the ends at the image border or at the insertion port; a robot that enters inside the image starts at any end. From
    each start the longest branch is kept (shortened by the cost of its turns at junctions), and the best scored of these is the
    robot.

    Returns ``RobotPath``, or ``Refusal`` with NO_ROBOT, TOO_SHORT, SEVERAL_ROBOTS, GAP_TOO_LONG or AMBIGUOUS_PATH.

    Parameters
    ----------
    skeletons : with the robot's gaps repaired.
    masks : the robot's mask and probability give radius, middle and ends; the vessel's mask tells robot from foreign cables.
    config : all of perception's settings.
    vessel : the vessel graph; its ends tell tail from head where the image border does not.
    port : where the robot is inserted, if known.
    before : of a stream; the last frame's path decides between nearly equal candidates.
    """
    traced = trace(skeletons.robot)
    if not traced.chains:
        return Refusal(Reason.NO_ROBOT, "nothing in the image looks like the robot")
    if len(traced.chains) > MAX_ALL_CHAINS:
        return Refusal(Reason.AMBIGUOUS_PATH, f"it is a mesh of {len(traced.chains)} branches (at most {MAX_ALL_CHAINS})")
    total_px = sum(_length(chain.points) for chain in traced.chains)
    radius_px = float(np.clip(0.5 * cv2.countNonZero(masks.robot.view(np.uint8)) / max(total_px, 1.0), 0.5, 30.0))
    graph = _without_short_links(traced, 3.0 * radius_px)
    components = find_components(graph, masks.vessel)
    if not components:
        return Refusal(Reason.TOO_SHORT, message("{a:.0f} px long (at least {b:.0f} px)", a=total_px, b=config.path.min_length_px))
    around = Surroundings(masks, vessel, port, config.path, before)
    components = without_reflections(graph, components, around, config)
    refusal = check_components(graph, components, config)
    if refusal is not None:
        return refusal
    least_px = config.path.outlier_share * components[0].size_px
    chosen = [node for component in components if component.size_px >= least_px for node in component.nodes]
    taken = set(chosen)
    chains = sum(chain.start in taken for chain in graph.chains)
    if chains > MAX_CHAINS:
        return Refusal(Reason.AMBIGUOUS_PATH, f"it is a mesh of {chains} branches (at most {MAX_CHAINS})")
    candidates, rivals = _candidates(graph, chosen, around, config.path)
    if not candidates:
        longest = max(_length(chain.points) for chain in graph.chains)
        if longest < config.path.min_length_px:
            return Refusal(
                Reason.TOO_SHORT, message("{a:.0f} px long (at least {b:.0f} px)", a=longest, b=config.path.min_length_px)
            )
        return Refusal(Reason.AMBIGUOUS_PATH, "the robot's outline is closed: it shows no end")
    eligible = candidates if before.path is None else [*candidates, *rivals]
    best = max(eligible, key=lambda candidate: candidate.score + candidate.continuity)
    must_show_head = config.quality.enabled and before.path is None  # in a stream it may have just arrived: ``check_in_view``
    if must_show_head and all(is_entry(place, around) for place in best.path.points[[0, -1]]):
        return Refusal(Reason.AMBIGUOUS_PATH, "both of its ends lie at the image border, so its head may be out of view")
    points = tail_first(best.path.points, around)
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
    """The graph with junctions nearer than `limit_px` along a chain merged.

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
    graph: PixelGraph, nodes: list[int], around: Surroundings, config: PathConfig
) -> tuple[list[_Scored], list[_Scored]]:
    """The best branch of each start, scored, and those other branches of the same starts that are nearly as long."""
    degrees, previous = graph.degrees(), around.before.path
    ends = [node for node in nodes if degrees[node] == 1]
    entries = [node for node in ends if is_entry(graph.nodes[node], around)]
    winners, others = [], []
    starts = entries or ends
    budget = STEPS_PER_CANDIDATE * config.max_candidates // max(len(starts), 1)
    for start in starts:
        valid = [path for path in explore(graph, start, config, budget) if path.length_px >= config.min_length_px]
        if not valid:
            continue
        worth = [path.effective_px - config.outside_cost * _outside_end(path.points, around.masks) for path in valid]
        best = int(np.argmax(worth))
        winners.append((worth[best], valid[best]))
        others += [(w, path) for w, path in zip(worth, valid, strict=True) if path is not valid[best]]
    most = max((worth for worth, _ in winners), default=0.0)
    rivals = [path for worth, path in others if worth >= RIVAL_SHARE * most]
    # Where no end is known to be the entry, the tips of side branches are starts too: only the longest paths are the robot.
    chosen = [path for worth, path in winners if entries or worth >= RIVAL_SHARE * most]
    longest = max((path.length_px for path in chosen), default=1.0)

    def scored(path: PathCandidate) -> _Scored:
        gap = 0.0 if previous is None else float(np.hypot(*(path.points[-1] - previous.points[-1])))
        continuity = 0.0 if previous is None else CONTINUITY_WEIGHT * float(np.exp(-gap / CONTINUITY_PX))
        return _Scored(path, score(path.points, path.length_px / longest, config), continuity)

    return [scored(path) for path in chosen], [scored(path) for path in rivals]


def _outside_end(points: Points, masks: Masks) -> float:
    """Length of the path's last part outside the vessel; 0 where all of it is outside."""
    inside = _at(masks.vessel, points)
    return float(np.argmax(inside[::-1])) if inside.any() else 0.0


def _runner_up(best: _Scored, all_candidates: list[_Scored]) -> float | None:
    """Score of the best candidate with another pair of ends."""
    ends = best.path.points[[0, -1]]
    different = []
    for other in all_candidates:
        theirs = other.path.points[[0, -1]]
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
