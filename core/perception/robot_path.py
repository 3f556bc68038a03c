"""The robot's path from tail to head, found on the pixel graph of its skeleton (METHOD section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from core.config import PathConfig, PerceptionConfig
from core.perception import gaps, path_shape, polyline, trails
from core.perception.entry import Surroundings, is_entry, tail_first
from core.perception.pixel_graph import Chain, PixelGraph, trace
from core.perception.trails import Trail
from core.types import Masks, Point, Points, Reason, Refusal, RobotPath, Skeletons, VesselGraph

SAME_END_PX = 10.0
"""Paths whose heads are this near to each other are the same answer."""
RIVAL_SHARE = 0.8
"""A branch of the same start competes with the chosen one if it is this long against it."""
CONTINUITY_WEIGHT = 0.3
CONTINUITY_PX = 30.0
"""In a stream a candidate that ends where the last one did gets this much more score, falling off over this distance."""
BROKEN_GAP_FACTOR = 3.0
"""Two pieces that face each other across up to this many gap thresholds are one broken robot, not two robots."""


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    trail: Trail
    score: float
    continuity: float


def find(
    skeletons: Skeletons,
    masks: Masks,
    config: PerceptionConfig,
    previous: RobotPath | None = None,
    vessel: VesselGraph | None = None,
    port: Point | None = None,
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

    Returns
    -------
    ``RobotPath``, or ``Refusal`` with NO_ROBOT, TOO_SHORT, SEVERAL_ROBOTS, GAP_TOO_LONG or AMBIGUOUS_PATH.
    """
    traced = trace(skeletons.robot)
    if not traced.chains:
        return Refusal(Reason.NO_ROBOT, "nothing in the image looks like the robot")
    total_px = sum(_length(chain.points) for chain in traced.chains)
    radius_px = float(np.clip(0.5 * cv2.countNonZero(masks.robot.view(np.uint8)) / max(total_px, 1.0), 0.5, 30.0))
    graph = _without_short_links(traced, 3.0 * radius_px)
    pieces = _pieces(graph, masks)
    refusal = _several(graph, pieces, config)
    if refusal is not None:
        return refusal
    around = Surroundings(masks, previous, vessel, port, config.path)
    chosen = [node for nodes, size in pieces if size >= config.path.outlier_share * pieces[0][1] for node in nodes]
    candidates, rivals = _candidates(graph, chosen, around, previous, config.path)
    if not candidates:
        return _why_no_candidate(graph, config.path)
    best = max(candidates, key=lambda candidate: candidate.score + candidate.continuity)
    points = tail_first(best.trail.points, around)
    line, radius_px = path_shape.refine(points, masks, radius_px, config.path.smoothing_px, config.cleaning.extend_ends)
    return RobotPath(
        points=line,
        score=best.score,
        runner_up=_runner_up(best, [*candidates, *rivals]),
        entry_on_border=is_entry(points[0], around),
        bridged_px=_bridged(points, skeletons),
        radius_px=radius_px,
    )


def _length(points: Points) -> float:
    return float(polyline.arc_length(points)[-1])


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
        Chain(int(name[c.start]), int(name[c.end]), c.points)
        for c in kept
        if name[c.start] != name[c.end] or c.start == c.end or _length(c.points) > 2.0 * limit_px
    )
    return PixelGraph(graph.nodes, chains)


def _pieces(graph: PixelGraph, masks: Masks) -> list[tuple[list[int], float]]:
    """Connected pieces as (their nodes, their size in px), largest first. What lies in the vessel counts, if anything does."""
    group = np.arange(len(graph.nodes))
    for chain in graph.chains:
        group[group == group[chain.end]] = group[chain.start]
    inside = np.zeros(len(graph.nodes))
    length = np.zeros(len(graph.nodes))
    for chain in graph.chains:
        length[group[chain.start]] += _length(chain.points)
        inside[group[chain.start]] += _length(chain.points) * _share_inside(chain.points, masks)
    size = inside if inside.any() else length
    names = sorted({int(group[chain.start]) for chain in graph.chains}, key=lambda name: -size[name])
    return [(np.flatnonzero(group == name).tolist(), float(size[name])) for name in names]


def _share_inside(points: Points, masks: Masks) -> float:
    places = np.rint(points).astype(int)
    return float(masks.vessel[places[:, 1], places[:, 0]].mean())


def _several(graph: PixelGraph, pieces: list[tuple[list[int], float]], config: PerceptionConfig) -> Refusal | None:
    """Refuse when a second piece is too large to be an outlier, or when the robot goes on beyond a gap that was not repaired."""
    share = config.quality.several_robots_share
    for nodes, size in pieces[1:] if share < 1.0 else []:
        if size < config.path.min_length_px:
            continue
        gap_px = _facing_gap(graph, pieces[0][0], nodes, config)
        if gap_px is not None and size >= min(share * pieces[0][1], config.quality.min_robot_length_px):
            detail = f"two pieces of the robot are {gap_px:.0f} px apart (repaired up to {config.gaps.gap_threshold_px:.0f} px)"
            return Refusal(Reason.GAP_TOO_LONG, detail)
        if size >= share * pieces[0][1]:
            detail = f"a second one of {size:.0f} px beside one of {pieces[0][1]:.0f} px (allowed: {100 * share:.0f} %)"
            return Refusal(Reason.SEVERAL_ROBOTS, detail)
    return None


def _facing_gap(graph: PixelGraph, first: list[int], second: list[int], config: PerceptionConfig) -> float | None:
    """The gap between two pieces if an end of one looks at an end of the other, else None."""
    degrees = graph.degrees()
    headings = {}
    for chain in graph.chains:
        for node, outward in ((chain.start, chain.points[::-1]), (chain.end, chain.points)):
            if degrees[node] == 1:
                chord = outward[-1] - outward[max(len(outward) - 12, 0)]
                headings[node] = chord / max(float(np.hypot(chord[0], chord[1])), 1e-9)
    found = []
    for a in first:
        for b in second:
            if a in headings and b in headings:
                distance = float(np.hypot(*(graph.nodes[a] - graph.nodes[b])))
                turns = gaps.turns_deg(tuple(graph.nodes[a]), tuple(headings[a]), tuple(graph.nodes[b]), tuple(headings[b]))
                if distance < BROKEN_GAP_FACTOR * config.gaps.gap_threshold_px and max(turns) < 0.6 * config.gaps.max_turn_deg:
                    found.append(distance)
    return min(found, default=None)


def _candidates(
    graph: PixelGraph, nodes: list[int], around: Surroundings, previous: RobotPath | None, config: PathConfig
) -> tuple[list[_Candidate], list[_Candidate]]:
    """The best branch of each start, scored, and those other branches of the same starts that are nearly as long."""
    degrees = graph.degrees()
    ends = [node for node in nodes if degrees[node] == 1]
    starts = [node for node in ends if is_entry(graph.nodes[node], around)] or ends
    winners, others = [], []
    for start in starts:
        valid = [trail for trail in trails.explore(graph, start, config) if trail.length_px >= config.min_length_px]
        if valid:
            winners.append(valid[0])
            others += [trail for trail in valid[1:] if trail.effective_px >= RIVAL_SHARE * valid[0].effective_px]
    longest = max((trail.length_px for trail in winners), default=1.0)

    def scored(trail: Trail) -> _Candidate:
        gap = 0.0 if previous is None else float(np.hypot(*(trail.points[-1] - previous.points[-1])))
        continuity = 0.0 if previous is None else CONTINUITY_WEIGHT * float(np.exp(-gap / CONTINUITY_PX))
        return _Candidate(trail, trails.score(trail.points, trail.length_px / longest, config), continuity)

    return [scored(trail) for trail in winners], [scored(trail) for trail in others]


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
