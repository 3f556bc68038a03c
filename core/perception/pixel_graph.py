"""A skeleton as a graph: chains of pixels between junctions and ends.

The paper follows the skeleton recursively, pixel by pixel. Here the chains are found with array operations once, without recursion and
without a limit on length, and everything that walks the skeleton walks some ten chains instead of a thousand pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from core.types import Mask, Points

_STEPS = ((-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
"""The 8 neighbours as (dy, dx), the 4 straight ones first."""


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Pixels ``points`` (N, 2) from node ``start`` to node ``end``, both nodes' places included."""

    start: int
    end: int
    points: Points


@dataclass(frozen=True, slots=True, eq=False)
class PixelGraph:
    """``nodes`` (K, 2): one per end pixel, per cluster of junction pixels, and per closed ring (somewhere on it)."""

    nodes: Points
    chains: tuple[Chain, ...]

    def degrees(self) -> NDArray[np.int64]:
        """Chain ends at each node, shape (K,): 1 = end, 3 or more = junction; a ring counts twice at its node; 0 = lone pixel."""
        ends = [node for chain in self.chains for node in (chain.start, chain.end)]
        return np.bincount(ends, minlength=len(self.nodes)) if ends else np.zeros(len(self.nodes), np.int64)


def trace(skeleton: Mask) -> PixelGraph:
    """The pixel graph of a one-pixel skeleton, in the skeleton's own pixel coordinates.

    Neighbouring pixels are linked; a diagonal link is left out where a straight neighbour already makes it, so that a staircase is a
    chain and not a row of junctions. Pixels with three or more links are junctions, and touching ones are one node at their mean.
    """
    rows, columns = np.nonzero(skeleton)
    places = np.column_stack([columns, rows]).astype(np.float64)
    count = len(places)
    if count == 0:
        return PixelGraph(np.empty((0, 2)), ())
    neighbours = _linked_neighbours(skeleton, rows, columns)
    is_junction = (neighbours >= 0).sum(axis=1) >= 3
    clusters, cluster_of = _components(neighbours, is_junction)
    centres = np.column_stack(
        [np.bincount(cluster_of[is_junction], places[is_junction, axis], clusters) for axis in (0, 1)]
    ) / np.maximum(np.bincount(cluster_of[is_junction], minlength=clusters), 1).reshape(-1, 1)
    nodes = [centre for centre in centres]
    chains = []
    for pixels in _ordered_chains(neighbours, is_junction):
        chain = _attach(pixels, neighbours, is_junction, cluster_of, places, nodes)
        if chain is not None:
            chains.append(chain)
    return PixelGraph(np.array(nodes).reshape(-1, 2), tuple(chains))


def _linked_neighbours(skeleton: Mask, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> NDArray[np.int32]:
    """Index of each pixel's linked neighbours, shape (N, 8), -1 for none."""
    height, width = skeleton.shape
    index = np.full((height + 2, width + 2), -1, np.int32)
    index[rows + 1, columns + 1] = np.arange(len(rows), dtype=np.int32)
    flat = (rows + 1) * (width + 2) + columns + 1
    offsets = np.array([dy * (width + 2) + dx for dy, dx in _STEPS])
    neighbours = index.ravel()[flat[:, None] + offsets]
    for diagonal, (dy, dx) in enumerate(_STEPS[4:], start=4):
        beside = (neighbours[:, _STEPS.index((dy, 0))] >= 0) | (neighbours[:, _STEPS.index((0, dx))] >= 0)
        neighbours[beside, diagonal] = -1
    return neighbours


def _links_within(neighbours: NDArray[np.int32], member: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Pairs (from, to) of linked pixels that are both members; each link appears in both directions."""
    kept = (neighbours >= 0) & member[:, None] & member[neighbours]
    origin, slot = np.nonzero(kept)
    return origin, neighbours[origin, slot]


def _components(neighbours: NDArray[np.int32], member: NDArray[np.bool_]) -> tuple[int, NDArray[np.int64]]:
    """Connected groups among the member pixels: their number and each pixel's group (-1 outside)."""
    group = np.full(len(member), -1, np.int64)
    if not member.any():
        return 0, group
    origin, target = _links_within(neighbours, member)
    links = csr_array((np.ones(len(origin), np.int8), (origin, target)), shape=(len(member), len(member)))
    _, label = connected_components(links, directed=False)
    names, group[member] = np.unique(label[member], return_inverse=True)
    return len(names), group


def _ordered_chains(neighbours: NDArray[np.int32], is_junction: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """The pixels between junctions, as one array per chain in walking order.

    One breadth-first search from a made-up source that is linked to one end of every chain walks them all at once; sorting its order
    by chain, stably, leaves each chain in order. A closed ring has no end: it is opened between two of its pixels.
    """
    inner = ~is_junction
    if not inner.any():
        return []
    count = len(inner)
    groups, group = _components(neighbours, inner)
    origin, target = _links_within(neighbours, inner)
    links = np.bincount(origin, minlength=count)
    ends = np.flatnonzero(inner & (links <= 1))
    start = np.full(groups, -1, np.int64)
    start[group[ends[::-1]]] = ends[::-1]
    closed = np.flatnonzero(start < 0)
    if len(closed):
        first = {int(g): int(np.flatnonzero(group == g)[0]) for g in closed}
        start[closed] = [first[int(g)] for g in closed]
        cut = np.zeros(len(origin), bool)
        for pixel in first.values():
            other = int(target[np.flatnonzero(origin == pixel)[-1]])
            cut |= ((origin == pixel) & (target == other)) | ((origin == other) & (target == pixel))
        origin, target = origin[~cut], target[~cut]
    origin = np.concatenate([origin, np.full(groups, count)])
    target = np.concatenate([target, start])
    links_array = csr_array((np.ones(len(origin), np.int8), (origin, target)), shape=(count + 1, count + 1))
    order = breadth_first_order(links_array, count, directed=True, return_predecessors=False)[1:]
    by_chain = order[np.argsort(group[order], kind="stable")]
    return np.split(by_chain, np.cumsum(np.bincount(group[inner], minlength=groups))[:-1])


def _attach(
    pixels: NDArray[np.intp],
    neighbours: NDArray[np.int32],
    is_junction: NDArray[np.bool_],
    cluster_of: NDArray[np.int64],
    places: Points,
    nodes: list[Points],
) -> Chain | None:
    """Hang a chain between its nodes, adding a node to `nodes` for an end of the skeleton; None for a pixel stuck to one junction."""

    def junctions_at(pixel: np.intp) -> list[int]:
        near = neighbours[pixel]
        near = near[near >= 0]
        return [int(cluster) for cluster in cluster_of[near[is_junction[near]]]]

    def new_node(pixel: np.intp) -> int:
        nodes.append(places[pixel])
        return len(nodes) - 1

    line = places[pixels]
    at_start, at_end = junctions_at(pixels[0]), junctions_at(pixels[-1])
    if len(pixels) == 1:
        if len(at_start) == 2:
            at_start, at_end = at_start[:1], at_start[1:]
            if at_start == at_end:
                return None
        elif at_start:
            at_end = []
        else:
            new_node(pixels[0])
            return None
    elif not at_start and not at_end and pixels[0] in neighbours[pixels[-1]] and len(pixels) > 2:
        node = new_node(pixels[0])
        return Chain(node, node, np.concatenate([line, line[:1]]))
    start = at_start[0] if at_start else new_node(pixels[0])
    end = at_end[0] if at_end else new_node(pixels[-1])
    before = [nodes[start]] if at_start else []
    after = [nodes[end]] if at_end else []
    return Chain(start, end, np.concatenate([*(place[None] for place in before), line, *(place[None] for place in after)]))
