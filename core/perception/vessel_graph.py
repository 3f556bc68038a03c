"""The vessel's skeleton as a graph of smooth, sub-pixel centerlines with the lumen's radius along them (METHOD section 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import CleaningConfig
from core.perception import bundle, pixel_graph, polyline
from core.perception.bundle import Bundle
from core.perception.junctions import Arm, rebuild
from core.types import GraphEdge, Mask, Point, Points, VesselGraph

MAX_CHAINS = 200
"""A vessel tree with all its spurs has some twenty to fifty chains of pixels; a skeleton of more is a mesh of noise."""
STEP_PX = 2.0
SMOOTHING_PX = 9.0
"""Standard deviation of the smoothing along the way, which keeps bends: more than a radius of boundary noise."""
SPUR_RADII = 1.5
"""A spur of thinning runs from the middle to a bump or corner of the wall: at most about one and a half lumen radii."""
END_TRIM_RADII = 1.0
BORDER_RADII = 1.2
"""Where the image cuts a vessel off at a slant, the skeleton runs into the sharp corner this near to the border."""
RADIUS_POINTS = 30
"""So many points of a vessel's end tell its radius there."""
EROSION_PX = 0.9
"""Thinning turns the last part of a vessel towards a corner of its end."""


@dataclass(slots=True, eq=False)
class _Line:
    start: int
    end: int
    points: Points
    radius: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


class _RadiusMap:
    """Distance to the wall in px at sub-pixel places, from a distance map of every second pixel (0.2 ms instead of 0.9 ms).

    One step of erosion lets the thinnest wall show on the coarse grid. It takes 0.5 to 1.3 px, depending on the wall's direction
    (measured on straight tubes), so ``EROSION_PX`` is given back.
    """

    def __init__(self, mask: Mask) -> None:
        cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
        half = cv2.erode(mask.view(np.uint8), cross, borderType=cv2.BORDER_REPLICATE)[::2, ::2]
        distance = cv2.distanceTransform(np.ascontiguousarray(half), cv2.DIST_L2, 5)
        # A mask that fills the image has no wall, and its distance would be the largest number there is.
        self._map = np.minimum(np.asarray(distance, np.float32), np.float32(max(half.shape)))

    def at(self, points: Points) -> NDArray[np.float64]:
        return 2.0 * polyline.sample(self._map, points / 2.0) + EROSION_PX


def build_graph(skeleton: Mask, mask: Mask, config: CleaningConfig) -> VesselGraph:
    """The vessel graph of a skeleton; empty where that is a mesh of more than ``MAX_CHAINS`` chains.

    Parameters
    ----------
    skeleton : one-pixel skeleton of the vessel, shape (h, w).
    mask : the vessel's mask it came from: radius, centring, and how far the ends reach.
    config : whether spurs are pruned.
    """
    traced = pixel_graph.trace(skeleton)
    if len(traced.chains) > MAX_CHAINS:
        return VesselGraph(np.empty((0, 2)), ())
    radius = _RadiusMap(mask)
    lines = [_Line(chain.start, chain.end, chain.points) for chain in traced.chains]
    if config.prune_spurs:
        radius_at = radius.at(traced.nodes)
        for _ in range(3):
            kept = _without_spurs(lines, _degrees(lines, len(traced.nodes)), radius_at)
            if len(kept) == len(lines):
                break
            lines = _merged(kept)
    _centre(lines, radius)
    nodes = traced.nodes.copy()
    if config.rebuild_junctions:
        _rebuild_junctions(lines, nodes, radius)
    if config.extend_ends:
        _straighten_ends(lines, nodes, radius, mask.shape)
    return _packed(lines, nodes)


def _straighten_ends(lines: list[_Line], nodes: Points, radius: _RadiusMap, shape: tuple[int, ...]) -> None:
    """Ends of vessels without the hook that thinning leaves there; at the image border they go on to the border."""
    degrees = _degrees(lines, len(nodes)).tolist()
    changed = []
    for line in lines:
        ends = [side for side, node in (("start", line.start), ("end", line.end)) if degrees[node] == 1 and len(line.points) >= 4]
        for side in ends:
            backwards = side == "start"
            last = line.radius[:RADIUS_POINTS] if backwards else line.radius[-RADIUS_POINTS:]
            own_radius = polyline.median(last)  # in the corner where the skeleton ends the radius would be nearly nothing
            points = _straight_end(line.points[::-1] if backwards else line.points, own_radius, shape)
            line.points = points[::-1] if backwards else points
            nodes[line.start if backwards else line.end] = points[-1]
            if backwards and len(ends) == 2:
                line.radius = radius.at(line.points)  # the other end asks for it
        if ends:
            changed.append(line)
    _measure(changed, radius)


def _straight_end(points: Points, radius_px: float, shape: tuple[int, ...]) -> Points:
    trim = round(END_TRIM_RADII * radius_px / STEP_PX)
    right, bottom = shape[1] - 1.0, shape[0] - 1.0
    x, y = points[-1].tolist()
    if min(x, y, right - x, bottom - y) < 1.5 * radius_px:
        to_side = np.minimum(points, (right, bottom) - points)
        clear = np.minimum(to_side[::-1, 0], to_side[::-1, 1]) >= BORDER_RADII * radius_px
        trim = max(trim, int(clear.argmax()))
    kept = points[: len(points) - min(trim, 2 * len(points) // 3)]
    x, y = kept[-1].tolist()
    from_x, from_y = kept[max(len(kept) - 1 - round(max(radius_px, 10.0) / STEP_PX), 0)].tolist()
    length = max(math.hypot(x - from_x, y - from_y), 1e-9)
    direction = (x - from_x) / length, (y - from_y) / length
    to_border = border_distance((x, y), direction, shape)
    reach = to_border if to_border < 3.0 * radius_px else math.dist(points[-1], (x, y))
    if reach < 0.5:
        return kept
    steps = np.append(np.arange(STEP_PX, reach, STEP_PX), reach)
    return np.concatenate([kept, (x, y) + steps[:, None] * direction])


def border_distance(place: Point, direction: Point, shape: tuple[int, ...]) -> float:
    """How far it is from a place along a unit direction to the image's last row or column of pixels."""
    limits = (shape[1] - 1.0, shape[0] - 1.0)
    reaches = [
        ((limit if step > 0 else 0.0) - start) / step
        for start, step, limit in zip(place, direction, limits, strict=True)
        if abs(step) > 1e-9
    ]
    return max(0.0, min(reaches, default=0.0))


def _rebuild_junctions(lines: list[_Line], nodes: Points, radius: _RadiusMap) -> None:
    degrees = _degrees(lines, len(nodes))
    sizes = radius.at(nodes)
    at_node: dict[int, list[tuple[_Line, bool]]] = {}
    for line in lines:
        at_node.setdefault(line.start, []).append((line, True))
        at_node.setdefault(line.end, []).append((line, False))
    for node in np.flatnonzero(degrees >= 3).tolist():
        touching = at_node[node]
        arms = [
            Arm(line.points, line.radius, bool(degrees[line.end] >= 3))
            if outward
            else Arm(line.points[::-1], line.radius[::-1], bool(degrees[line.start] >= 3))
            for line, outward in touching
        ]
        anew = rebuild(nodes[node], float(sizes[node]), arms)
        if anew is None:
            continue
        nodes[node] = anew[0]
        for (line, outward), arm in zip(touching, anew[1], strict=True):
            if line.start == line.end:
                if outward:
                    back = next(b for (other, away), b in zip(touching, anew[1], strict=True) if other is line and not away)
                    _close_loop(line, arm, back)
                continue
            line.points, line.radius = (arm.points, arm.radius) if outward else (arm.points[::-1], arm.radius[::-1])


def _close_loop(line: _Line, out: Arm, back: Arm) -> None:
    """A line from a junction to itself: its first half as seen from its start, its second half as seen from its end."""
    count = len(line.points)
    first, second = max(1, len(out.points) - (count - count // 2)), max(1, len(back.points) - count // 2)
    line.points = np.concatenate([out.points[:first], back.points[:second][::-1]])
    line.radius = np.concatenate([out.radius[:first], back.radius[:second][::-1]])


def _packed(lines: list[_Line], nodes: Points) -> VesselGraph:
    """The graph with only those nodes that are still used."""
    used = sorted({node for line in lines for node in (line.start, line.end)})
    number = {node: index for index, node in enumerate(used)}
    edges = tuple(GraphEdge(number[line.start], number[line.end], line.points, line.radius) for line in lines)
    return VesselGraph(nodes[used], edges)


def _degrees(lines: list[_Line], count: int) -> NDArray[np.int64]:
    return np.bincount(np.array([node for line in lines for node in (line.start, line.end)], np.int64), minlength=count)


def _without_spurs(lines: list[_Line], degrees: NDArray[np.int64], radius_at: NDArray[np.float64]) -> list[_Line]:
    spurs: dict[int, list[tuple[float, int]]] = {}
    for index, line in enumerate(lines):
        ends = (line.start, line.end) if degrees[line.start] == 1 else (line.end, line.start)
        tip, root = ends
        if degrees[tip] == 1 and degrees[root] >= 3:
            length = float(polyline.arc_length(line.points)[-1])
            if length < SPUR_RADII * radius_at[root]:
                spurs.setdefault(root, []).append((length, index))
    doomed: set[int] = set()
    for root, found in spurs.items():
        # A junction that has nothing but spurs is a blob: its longest spur stays, as the vessel.
        found.sort()
        doomed |= {index for _, index in (found[:-1] if len(found) == degrees[root] else found)}
    return [line for index, line in enumerate(lines) if index not in doomed]


def _merged(lines: list[_Line]) -> list[_Line]:
    """The lines with each node of degree two dissolved into one longer line."""
    merged = list(lines)
    at_node: dict[int, list[_Line]] = {}
    for line in merged:
        at_node.setdefault(line.start, []).append(line)
        at_node.setdefault(line.end, []).append(line)
    for node, touching in at_node.items():
        if len(touching) != 2 or touching[0] is touching[1]:
            continue
        first, second = touching
        ahead = first.points if first.end == node else first.points[::-1]
        behind = second.points if second.start == node else second.points[::-1]
        far = second.end if second.start == node else second.start
        first.start = first.start if first.end == node else first.end
        first.end, first.points = far, np.concatenate([ahead, behind[1:]])
        merged = [line for line in merged if line is not second]
        at_node[far] = [first if line is second else line for line in at_node[far]]
    return merged


def _centre(lines: list[_Line], radius: _RadiusMap) -> None:
    """All lines made even, smooth and centred in the lumen, with the radius along them."""
    even = bundle.smooth(
        bundle.resample(Bundle.of([line.points for line in lines]), STEP_PX), SMOOTHING_PX / STEP_PX, keeps_bends=True
    )
    normal = bundle.normals(even)
    probe = 0.5 * radius.at(even.points)[:, None] * normal
    wider, narrower = np.split(radius.at(np.concatenate([even.points + probe, even.points - probe])), 2)
    counts = np.diff(even.starts)
    # A line of one or two points has no inner point to centre.
    shift = np.where(np.repeat(counts, counts) < 3, 0.0, 0.5 * (wider - narrower))
    moved = Bundle(even.points + shift[:, None] * normal, even.starts)
    centred = bundle.smooth(moved, SMOOTHING_PX / STEP_PX, keeps_bends=True)
    for line, points in zip(lines, centred.split(centred.points), strict=True):
        line.points = points
    _measure(lines, radius)


def _measure(lines: list[_Line], radius: _RadiusMap) -> None:
    """The radius along some lines as they are now."""
    if lines:
        whole = Bundle.of([line.points for line in lines])
        for line, values in zip(lines, whole.split(radius.at(whole.points)), strict=True):
            line.radius = values
