"""The robot's path from tail to head, found on the pixel graph of its skeleton (METHOD section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from core.config import PathConfig, PerceptionConfig
from core.perception import path_shape, polyline, trails
from core.perception.entry import Surroundings, is_entry, tail_first, was_the_head
from core.perception.pieces import check_pieces, find_pieces, without_reflections
from core.perception.pixel_graph import Chain, PixelGraph, trace
from core.perception.trails import Trail
from core.types import Masks, Point, Points, Reason, Refusal, RobotPath, Skeletons, VesselGraph

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


def _candidates(
    graph: PixelGraph, nodes: list[int], around: Surroundings, previous: RobotPath | None, config: PathConfig
) -> tuple[list[_Candidate], list[_Candidate]]:
    """The best branch of each start, scored, and those other branches of the same starts that are nearly as long."""
    degrees = graph.degrees()
    ends = [node for node in nodes if degrees[node] == 1]
    entries = [node for node in ends if is_entry(graph.nodes[node], around)]
    winners, others = [], []
    starts = entries or ends
    share = trails.max_steps(config) // max(len(starts), 1)
    for start in starts:
        valid = [trail for trail in trails.explore(graph, start, config, share) if trail.length_px >= config.min_length_px]
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

    def scored(trail: Trail) -> _Candidate:
        gap = 0.0 if previous is None else float(np.hypot(*(trail.points[-1] - previous.points[-1])))
        continuity = 0.0 if previous is None else CONTINUITY_WEIGHT * float(np.exp(-gap / CONTINUITY_PX))
        return _Candidate(trail, trails.score(trail.points, trail.length_px / longest, config), continuity)

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
