"""The vessel's skeleton as a graph of smooth, sub-pixel centerlines with the lumen's radius along them (METHOD section 2).

Also: the middle of a vessel that the image border cuts lengthwise, and the ends of vessels, where thinning turns the last radius or
two of a skeleton towards a corner, and stops short of the image border.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.config.models import CleaningConfig
from core.geometry import Bundle
from core.perception import compiled
from core.perception import skeleton as pixel_graph
from core.perception.junctions import Arm, are_together, rebuild
from core.perception.vectors import RadiusMap
from core.types import GraphEdge, Mask, Points, VesselGraph

WIDTH_RADII = 4.0
"""A width measured this many radii away counts by 1/e: a vessel that the picture cuts lengthwise may taper."""
ALONG = 0.87
"""Cosine of the angle to the border up to which a vessel is cut lengthwise. One that runs out of the picture lacks a wall only over
a short length at its end, which is replaced (``led_on``)."""
END_RADII = 1.5
"""This near to its ends a line runs into a corner, or through a junction's opening, where the width is not the vessel's."""
MAP_PX = 2.0
MAP_SHARE = 0.03
"""Error of the distance map: this, and a share of the radius, because steps from pixel to pixel are not straight."""


def by_wall_in_view(
    lines: Bundle, step_px: float, normal: Points, reach: NDArray[np.float64], shift: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    """`shift` (N,) by the distance map, but by the visible wall where the image border cuts off one side of the vessel.

    Beyond the border the map continues as if there were no wall, and would draw the line out of the picture. Where the border is
    nearer than the wall, `reach` (N,), the middle is as far from the visible wall as it is where both walls are visible; where
    they are nowhere on a line, the middle of the visible part is taken.

    Parameters
    ----------
    lines, step_px : places in the lumen, and their distance along a line.
    normal : unit vectors (N, 2) across the lines.
    reach : distance to the nearest wall (N,).
    shift : offset (N,) of each point from the middle of the map, along the normals.
    shape : of the picture, (h, w).
    """
    nearest, limit = _to_nearest_border(lines.points, shape), (1.0 + MAP_SHARE) * reach + MAP_PX
    near = np.flatnonzero(nearest < limit)  # mostly the ends of some vessels, or nothing at all
    if not len(near):
        return shift
    ahead, behind = (_to_border(lines.points[near], sign * normal[near], shape) for sign in (1.0, -1.0))
    across = np.minimum(ahead, behind)
    found = (across < limit[near]) & (nearest[near] >= ALONG * across)
    if not found.any():
        return shift
    cut = near[found]
    is_cut = np.zeros(len(lines.points), np.bool_)
    is_cut[cut] = True
    is_plain = ~is_cut & (step_px * _to_ends(lines) > END_RADII * reach)
    half = lines.split(np.where(is_plain, reach + np.abs(shift), np.nan))
    known, away = np.concatenate([_from_the_nearest(values) for values in half], axis=1)
    belief = np.exp(-step_px * away[cut] / (WIDTH_RADII * reach[cut]))
    towards = np.clip(belief * (known[cut] - reach[cut]), -reach[cut], across[found])
    moved = shift.copy()
    moved[cut] = np.where(ahead[found] < behind[found], towards, -towards)
    return moved


def _to_border(points: Points, direction: Points, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Distance from places in the picture (N, 2) along unit vectors (N, 2) to its border: to the last pixels' centres."""
    limit = np.array([shape[1] - 1.0, shape[0] - 1.0])
    room = np.where(direction > 0.0, limit - points, points)
    return np.asarray(np.maximum((room / np.maximum(np.abs(direction), 1e-9)).min(axis=1), 0.0))


def _to_nearest_border(points: Points, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Distance from places in the picture (N, 2) to its nearest side, to the last pixels' centres."""
    return np.asarray(np.minimum(points, (shape[1] - 1.0, shape[0] - 1.0) - points).min(axis=1))


def _to_ends(lines: Bundle) -> NDArray[np.int64]:
    """Number of points from each point (N,) to the nearer end of its line."""
    counts = np.diff(lines.starts)
    place = np.arange(len(lines.points)) - np.repeat(lines.starts[:-1], counts)
    return np.asarray(np.minimum(place, np.repeat(counts, counts) - 1 - place), np.int64)


def _from_the_nearest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values (N,) of a line with NaN interpolated, and the distance, in points, of the nearest known value; shape (2, N).

    Of a line without any known value the values are 0, infinitely far away.
    """
    places, known = np.arange(len(values)), np.flatnonzero(np.isfinite(values))
    if not len(known):
        return np.stack([np.zeros(len(values)), np.full(len(values), np.inf)])
    following = np.searchsorted(known, places)
    before, after = known[np.maximum(following - 1, 0)], known[np.minimum(following, len(known) - 1)]
    return np.stack([np.interp(places, known, values[known]), np.minimum(np.abs(places - before), np.abs(places - after))])


TRIM_RADII = 1.5
BORDER_RADII = 1.2
"""Where the image cuts a vessel off at a slant, the skeleton runs into the sharp corner this near to the border."""
HEADING_PX = 24.0
"""A vessel's direction and bend at its end are taken over this length, and at least a radius."""
REACH_RADII = 3.0
"""An end this near to the image's border goes on to it."""


def led_on(points: Points, radius_px: float, vessel: Mask) -> Points:
    """A centerline with its last part, which thinning has turned aside, replaced by one that runs between the walls.

    It ends as far out as the skeleton did, or at the image border. The end in question comes last in the points (N, 2), and has
    the lumen's `radius_px`.
    """
    limit = np.array([vessel.shape[1] - 1.0, vessel.shape[0] - 1.0])
    kept = points[: len(points) - min(_hook(points, radius_px, limit), 2 * len(points) // 3)]
    lost_px = math.dist(points[-1].tolist(), kept[-1].tolist())
    onward = geometry.extrapolate(kept, max(REACH_RADII * radius_px, 1.5 * lost_px) + 1.0, max(radius_px, HEADING_PX))
    onward = compiled.bend_end(onward, radius_px, lost_px, round(STEP_PX), vessel)
    way_out = _way_out(onward, limit)
    reach = lost_px if way_out is None or way_out > max(REACH_RADII * radius_px, lost_px) else way_out
    if reach < 0.5:
        return kept
    return np.concatenate([kept[:-1], geometry.resample(geometry.cut(onward, 0.0, reach), STEP_PX)])


def _hook(points: Points, radius_px: float, limit: NDArray[np.float64]) -> int:
    """Number of the last points that thinning may have turned aside."""
    count = round(TRIM_RADII * radius_px / STEP_PX)
    if float(np.minimum(points[-1], limit - points[-1]).min()) < 1.5 * radius_px:
        to_side = np.minimum(points, limit - points)
        clear = np.minimum(to_side[::-1, 0], to_side[::-1, 1]) >= BORDER_RADII * radius_px
        count = max(count, int(clear.argmax()))
    return count


def _way_out(onward: Points, limit: NDArray[np.float64]) -> float | None:
    """Length of a line of points, 1 px apart, up to the image's last row or column; None: it does not reach them."""
    beyond = np.maximum(-onward, onward - limit).max(axis=1)
    first = int((beyond >= 0.0).argmax())
    if beyond[first] < 0.0:
        return None
    before = beyond[first - 1] if first else beyond[first] - 1.0
    return max(0.0, float(first - beyond[first] / (beyond[first] - before)))


MAX_CHAINS = 200
"""A vessel tree with all its spurs has some twenty to fifty chains of pixels; a skeleton of more is a mesh of noise."""
STEP_PX = 2.0
SMOOTHING_PX = 9.0
"""Standard deviation of the smoothing along the way, which keeps bends: more than a radius of boundary noise."""
WIDTH_PX = 20.0
"""Standard deviation of the smoothing of a vessel's width."""
SPUR_RADII = 1.5
"""A spur of thinning runs from the middle to a bump or corner of the wall: at most about one and a half lumen radii."""
RADIUS_POINTS = 30
"""Points of a vessel's end that give its radius there."""


@dataclass(slots=True, eq=False)
class _Line:
    start: int
    end: int
    points: Points
    radius: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    half_width: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """Of the centred line; not valid for parts that are replaced later."""


def build_graph(skeleton: Mask, mask: Mask, config: CleaningConfig, probability: NDArray[np.float32] | None = None) -> VesselGraph:
    """The vessel graph of a one-pixel skeleton (h, w); empty where that is a mesh of more than ``MAX_CHAINS`` chains.

    The vessel's `mask` tells radius and middle, and how far the ends reach; the `probability` that it came from, 0.5 at its
    edge, tells walls to a smaller fraction of a pixel, and how soft they are.
    """
    traced = pixel_graph.trace(skeleton)
    if len(traced.chains) > MAX_CHAINS:
        return VesselGraph(np.empty((0, 2)), ())
    radius = RadiusMap(mask)
    # A junction of pixels has only two chains where its third one was too short.
    lines = _merged([_Line(chain.start, chain.end, chain.points) for chain in traced.chains])
    if config.prune_spurs:
        radius_at = radius.at(traced.nodes)
        for _ in range(3):
            kept = _without_spurs(lines, _degrees(lines, len(traced.nodes)), radius_at)
            if len(kept) == len(lines):
                break
            lines = _merged(kept)
    _centre(lines, radius, mask.astype(np.float32) if probability is None else probability)
    nodes = traced.nodes.copy()
    if config.rebuild_junctions:
        nodes = _rebuild_junctions(lines, nodes, radius, mask)
    if config.extend_ends:
        _lead_on_ends(lines, nodes, mask)
    return _packed(lines, nodes, radius)


def _lead_on_ends(lines: list[_Line], nodes: Points, mask: Mask) -> None:
    """Remove the hook that thinning leaves at ends of vessels; near the image border, continue to it."""
    degrees = _degrees(lines, len(nodes)).tolist()
    starts = [(line, -1, line.start) for line in lines if degrees[line.start] == 1]
    ends = [(line, 1, line.end) for line in lines if degrees[line.end] == 1]
    for line, side, node in (*starts, *ends):
        if len(line.points) >= 4:
            # The median, because in the corner where the skeleton ends the radius is nearly 0.
            radius_px = geometry.median(line.radius[::side][-RADIUS_POINTS:])
            points = led_on(line.points[::side], radius_px, mask)
            line.points, nodes[node] = points[::side], points[-1]


def _rebuild_junctions(lines: list[_Line], nodes: Points, radius: RadiusMap, mask: Mask) -> Points:
    """Rebuild the junctions and the lines at them; returns the nodes, of which some may be new."""
    degrees, sizes = _degrees(lines, len(nodes)).tolist(), radius.at(nodes).tolist()
    places: list[Points] = list(nodes)
    pending = _openings(lines, degrees, sizes)
    while pending:
        group, inner = pending.pop(0)
        sides = [
            (line, outward)
            for line in lines
            for outward in (True, False)
            if line not in inner and (line.start if outward else line.end) in group
        ]
        rebuilt = rebuild([_arm(line, outward, degrees, sizes) for line, outward in sides], mask, is_alone=len(group) == 1)
        if rebuilt is None:
            if len(group) > 1:
                pending += [({node}, []) for node in sorted(group)]
            continue
        numbers = sorted(group)[: len(rebuilt.places)]
        numbers += range(len(places), len(places) + len(rebuilt.places) - len(numbers))
        places += [np.empty(2)] * (len(rebuilt.places) - len(group))
        for number, place in zip(numbers, rebuilt.places, strict=True):
            places[number] = place
        lines[:] = [line for line in lines if line not in inner]
        lines += [_Line(*ends, piece) for ends, piece in zip(pairwise(numbers), rebuilt.pieces, strict=True)]
        arms = {(id(line), outward): rebuilt.arms[index] for index, (line, outward) in enumerate(sides)}
        for line in {id(line): line for line, _ in sides}.values():
            out, back = arms.get((id(line), True)), arms.get((id(line), False))
            if out is not None:
                line.start = numbers[out[0]]
            if back is not None:
                line.end = numbers[back[0]]
            _lead(line, out[1] if out is not None else None, back[1] if back is not None else None)
    return np.array(places).reshape(-1, 2)


def _openings(lines: list[_Line], degrees: list[int], sizes: list[float]) -> list[tuple[set[int], list[_Line]]]:
    """Groups of junctions to rebuild together, with the lines between them."""
    group_of = {node: {node} for node, degree in enumerate(degrees) if degree >= 3}
    inner: list[_Line] = []
    with_island: set[int] = set()
    for line in lines:
        if line.start == line.end or line.start not in group_of or line.end not in group_of:
            continue
        if not are_together(_arm(line, True, degrees, sizes), _arm(line, False, degrees, sizes)):
            continue
        if group_of[line.start] is group_of[line.end]:
            with_island.add(line.start)  # two lines round an island: no single trunk runs through such an opening
            continue
        inner.append(line)
        joined = group_of[line.start] | group_of[line.end]
        group_of |= dict.fromkeys(joined, joined)
    groups = list({id(group): group for group in group_of.values()}.values())
    whole = [group for group in groups if not group & with_island]
    apart = [{node} for group in groups if group & with_island for node in group]
    return [(group, [line for line in inner if line.start in group]) for group in whole] + [(group, []) for group in apart]


def _arm(line: _Line, outward: bool, degrees: list[int], sizes: list[float]) -> Arm:
    """A line seen from its start (`outward`) or from its end. Nodes beyond the lists are junctions that were added meanwhile."""
    near, far = (line.start, line.end) if outward else (line.end, line.start)
    step = 1 if outward else -1
    far_is_junction = far >= len(degrees) or degrees[far] >= 3
    return Arm(line.points[::step], line.radius[::step], line.half_width[::step], far_is_junction, sizes[near])


def _lead(line: _Line, out: Arm | None, back: Arm | None) -> None:
    """Replace a line by the arms that it is, seen from its start and from its end: both, where it returns to the same opening."""
    if out is not None and back is not None:
        # The first half as seen from its start, the second half as seen from its end.
        count = len(line.points)
        first, second = max(1, len(out.points) - (count - count // 2)), max(1, len(back.points) - count // 2)
        line.points = np.concatenate([out.points[:first], back.points[:second][::-1]])
        line.radius = np.concatenate([out.radius[:first], back.radius[:second][::-1]])
    elif out is not None:
        line.points, line.radius = out.points, out.radius
    elif back is not None:
        line.points, line.radius = back.points[::-1], back.radius[::-1]


def _packed(lines: list[_Line], nodes: Points, radius: RadiusMap) -> VesselGraph:
    """The graph with only those nodes that are still used, and the radius along the final lines."""
    used = sorted({node for line in lines for node in (line.start, line.end)})
    number = {node: index for index, node in enumerate(used)}
    whole = Bundle.of([line.points for line in lines])
    measured = zip(lines, whole.split(radius.at(whole.points)), strict=True)
    edges = tuple(GraphEdge(number[line.start], number[line.end], line.points, values) for line, values in measured)
    return VesselGraph(nodes[used], edges)


def _degrees(lines: list[_Line], count: int) -> NDArray[np.int64]:
    return np.bincount(np.array([node for line in lines for node in (line.start, line.end)], np.int64), minlength=count)


def _without_spurs(lines: list[_Line], degrees: NDArray[np.int64], radius_at: NDArray[np.float64]) -> list[_Line]:
    spurs: dict[int, list[tuple[float, int]]] = {}
    for index, line in enumerate(lines):
        ends = (line.start, line.end) if degrees[line.start] == 1 else (line.end, line.start)
        tip, root = ends
        if degrees[tip] == 1 and degrees[root] >= 3:
            length = float(geometry.arc_length(line.points)[-1])
            if length < SPUR_RADII * radius_at[root]:
                spurs.setdefault(root, []).append((length, index))
    doomed: set[int] = set()
    for root, found in spurs.items():
        # A junction that has only spurs is a blob: its longest spur stays, as the vessel.
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


def _centre(lines: list[_Line], radius: RadiusMap, level: NDArray[np.float32]) -> None:
    """Make all lines even, smooth and centred in the lumen, with the radius along them.

    They are centred twice: by the distance map, to some half a pixel from anywhere in the lumen (where both walls are in the
    picture), and then between both walls, to a fraction of a pixel. Where a wall is not visible, beside an opening, the first
    result stays.
    """
    even = Bundle.of([line.points for line in lines]).resample(STEP_PX).smooth(SMOOTHING_PX / STEP_PX, keeps_bends=True)
    # A line's ends stay in their nodes, and one of two points has no others.
    inner = np.ones(len(even.points), np.bool_)
    inner[even.starts[:-1]] = inner[even.starts[1:] - 1] = False
    normal = even.normals()
    reach = radius.at(even.points)
    probe = 0.5 * reach[:, None] * normal
    wider, narrower = np.split(radius.at(np.concatenate([even.points + probe, even.points - probe])), 2)
    shift = by_wall_in_view(even, STEP_PX, normal, reach, 0.5 * (wider - narrower), level.shape)
    centred = _moved(even, normal, np.where(inner, shift, 0.0))
    normal = centred.normals()
    expected, sigma = radius.at(centred.points), WIDTH_PX / STEP_PX
    shift, half_width = compiled.centre_offsets(level, centred.points, centred.starts, normal, expected, sigma)
    centred = _moved(centred, normal, np.where(inner, shift, 0.0))
    for line, *values in zip(lines, *map(centred.split, (centred.points, radius.at(centred.points), half_width)), strict=True):
        line.points, line.radius, line.half_width = values


def _moved(lines: Bundle, normal: Points, shift: NDArray[np.float64]) -> Bundle:
    """The lines with all points moved across them, smoothed."""
    return Bundle(lines.points + shift[:, None] * normal, lines.starts).smooth(SMOOTHING_PX / STEP_PX, keeps_bends=True)
