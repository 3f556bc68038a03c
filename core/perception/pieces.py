"""The separate pieces of the robot's skeleton: one robot, a broken one, or several (METHOD section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.config import PerceptionConfig
from core.perception import gaps, polyline
from core.perception.pixel_graph import PixelGraph
from core.types import Mask, Reason, Refusal

HEADING_PX = 12
"""Pixels behind an end that give its direction."""
FAR_GAP_FACTOR = 3.0
FAR_TURN_SHARE = 0.6
"""Pieces that look straight at each other (a turn of this share of the allowed one) belong together across this many thresholds."""
NEAR_TURN_FACTOR = 1.5
"""Pieces nearer than the gap threshold belong together even if they turn by this much more than was repaired."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A connected piece: its nodes in the pixel graph, and its length within the vessel (or its length, if no piece is within)."""

    nodes: tuple[int, ...]
    size_px: float


def find_pieces(graph: PixelGraph, vessel: Mask) -> list[Piece]:
    """The connected pieces, largest first. A cable that lies outside the vessel is small, however long it is."""
    group = np.arange(len(graph.nodes))
    for chain in graph.chains:
        group[group == group[chain.end]] = group[chain.start]
    length, inside = np.zeros(len(group)), np.zeros(len(group))
    for chain in graph.chains:
        places = np.rint(chain.points).astype(int)
        chain_px = float(polyline.arc_length(chain.points)[-1])
        length[group[chain.start]] += chain_px
        inside[group[chain.start]] += chain_px * float(vessel[places[:, 1], places[:, 0]].mean())
    size = inside if inside.any() else length
    names = {int(group[chain.start]) for chain in graph.chains}
    pieces = [Piece(tuple(np.flatnonzero(group == name).tolist()), float(size[name])) for name in names]
    return sorted(pieces, key=lambda piece: -piece.size_px)


def check_pieces(graph: PixelGraph, pieces: list[Piece], config: PerceptionConfig) -> Refusal | None:
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
                chord = outward[-1] - outward[max(len(outward) - HEADING_PX, 0)]
                headings[node] = chord / max(float(np.hypot(chord[0], chord[1])), 1e-9)
    return headings


def _facing_gap(
    graph: PixelGraph, headings: dict[int, NDArray[np.float64]], first: Piece, second: Piece, config: PerceptionConfig
) -> float | None:
    """The gap between two pieces if an end of one looks at an end of the other, else None."""
    threshold_px, max_turn_deg = config.gaps.gap_threshold_px, config.gaps.max_turn_deg
    found = []
    for a in first.nodes:
        for b in second.nodes:
            if a not in headings or b not in headings:
                continue
            gap_px = float(np.hypot(*(graph.nodes[a] - graph.nodes[b])))
            turn_deg = max(gaps.turns_deg(graph.nodes[a], headings[a], graph.nodes[b], headings[b]))
            far = gap_px < FAR_GAP_FACTOR * threshold_px and turn_deg < FAR_TURN_SHARE * max_turn_deg
            near = gap_px < threshold_px and turn_deg < NEAR_TURN_FACTOR * max_turn_deg
            if far or near:
                found.append(gap_px)
    return min(found, default=None)
