"""The separate pieces of the robot's skeleton: one robot, a broken one, or several (METHOD section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import PerceptionConfig
from core.perception import gaps, polyline
from core.perception.entry import Surroundings, is_at_vessel_end, is_entry
from core.perception.pixel_graph import PixelGraph
from core.types import Mask, Points, Reason, Refusal

HEADING_PX = 12
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
        chain_px = float(polyline.arc_length(chain.points)[-1])
        length[group[chain.start]] += chain_px
        inside[group[chain.start]] += chain_px * float(_at(vessel, chain.points).mean())
    size = inside if inside.any() else length
    names = {int(group[chain.start]) for chain in graph.chains}
    pieces = [Piece(tuple(np.flatnonzero(group == name).tolist()), float(size[name])) for name in names]
    return sorted(pieces, key=lambda piece: -piece.size_px)


def without_reflections(graph: PixelGraph, pieces: list[Piece], around: Surroundings, config: PerceptionConfig) -> list[Piece]:
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


def _comes_in(graph: PixelGraph, piece: Piece, around: Surroundings) -> bool:
    outside_px = int(np.count_nonzero(~_at(around.masks.vessel, _places(graph, piece))))
    return outside_px > COMES_IN_PX or any(is_entry(end, around) for end in _ends(graph, piece))


def _begins_at_vessel_end(graph: PixelGraph, piece: Piece, around: Surroundings) -> bool:
    return any(is_at_vessel_end(end, around) for end in _ends(graph, piece))


def _is_previous(graph: PixelGraph, piece: Piece, around: Surroundings) -> bool:
    """Whether most of a piece lies where the robot of the last frame lay."""
    if around.previous is None:
        return False
    before = np.zeros(around.masks.robot.shape, np.uint8)
    line = np.rint(around.previous.points).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(before, [line], False, 1, 2 * PREVIOUS_PX + 1)
    return bool(_at(before, _places(graph, piece)).mean() > 0.5)


def _sureness(graph: PixelGraph, piece: Piece, around: Surroundings) -> float:
    """The mean probability of robot along a piece, within the vessel if it is there at all: outside, a robot is seen better."""
    places = _places(graph, piece)
    inside = places[_at(around.masks.vessel, places)]
    return float(_at(around.masks.robot_probability, inside if len(inside) else places).mean())


def _ends(graph: PixelGraph, piece: Piece) -> list[Points]:
    degrees = graph.degrees()
    return [graph.nodes[node] for node in piece.nodes if degrees[node] == 1]


def _places(graph: PixelGraph, piece: Piece) -> Points:
    """The points (N, 2) of a piece, columns x, y."""
    return np.vstack([chain.points for chain in graph.chains if chain.start in piece.nodes])


def _at(values: NDArray[Any], places: Points) -> NDArray[Any]:
    """The values (h, w) at places (N, 2)."""
    columns, rows = np.rint(places).astype(np.intp).T
    return np.asarray(values[rows, columns])


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
