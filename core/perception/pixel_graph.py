"""A skeleton as a graph: chains of pixels between junctions and ends.

The paper follows the skeleton recursively, pixel by pixel. Here each chain of pixels is walked once, in a loop, and everything that
explores the skeleton afterwards walks some ten chains instead of a thousand pixels: no recursion limit, no endless loops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.types import Mask, Points

_STEPS = ((-1, 0), (0, -1), (0, 1), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
"""The 8 neighbours as (dy, dx), the 4 straight ones first."""
_STOP = -1


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Pixels ``points`` (N, 2) from node ``start`` to node ``end``, both nodes' places included."""

    start: int
    end: int
    points: Points


@dataclass(frozen=True, slots=True, eq=False)
class PixelGraph:
    """``nodes`` (K, 2): one per cluster of junction pixels, per end pixel, and per closed ring (somewhere on it)."""

    nodes: Points
    chains: tuple[Chain, ...]

    def degrees(self) -> NDArray[np.int64]:
        """Chain ends at each node, shape (K,): 1 = end, 3 or more = junction; a ring counts twice at its node; 0 = lone pixel."""
        ends = [node for chain in self.chains for node in (chain.start, chain.end)]
        return np.bincount(np.array(ends, np.int64), minlength=len(self.nodes))


def trace(skeleton: Mask) -> PixelGraph:
    """The pixel graph of a one-pixel skeleton, in the skeleton's own pixel coordinates.

    Neighbouring pixels are linked; a diagonal link is left out where a straight neighbour already makes it, so that a staircase is
    a chain and not a row of junctions. Pixels with three or more links are junctions, and touching ones are one node at their
    mean.
    """
    places, neighbours = _linked_pixels(skeleton)
    links = (neighbours > 0).sum(axis=0)
    walk = _Walk(places, neighbours, links)
    for pixel, around in walk.around.items():
        for first in around:
            if first not in walk.cluster and first not in walk.finished:
                walk.chain_from(first, junction=pixel)
    for pixel in (np.flatnonzero(links[1:] <= 1) + 1).tolist():
        if pixel not in walk.finished:
            walk.chain_from(pixel)
    walk.rings(np.flatnonzero(links == 2))
    return PixelGraph(np.array(walk.nodes, np.float64).reshape(-1, 2), tuple(walk.chains))


def _linked_pixels(skeleton: Mask) -> tuple[Points, NDArray[np.int32]]:
    """The skeleton's pixels as points, and the index of each one's linked neighbours, 0 for none; shapes (N + 1, 2), (8, N + 1).

    Pixels are counted from 1; index 0 stands for "no pixel".
    """
    rows, columns = np.divmod(np.flatnonzero(skeleton), skeleton.shape[1])
    if len(rows) == 0:
        return np.zeros((1, 2)), np.zeros((8, 1), np.int32)
    top, left = int(rows[0]), int(columns.min())
    stride = int(columns.max()) - left + 3
    flat = (rows - (top - 1)) * stride + (columns - (left - 1))
    framed = np.zeros((int(rows[-1]) - top + 3) * stride, np.bool_)
    framed[flat] = True
    around = flat + np.array([[dy * stride + dx] for dy, dx in _STEPS])
    linked = framed[around]
    for diagonal, (dy, dx) in enumerate(_STEPS[4:], start=4):
        linked[diagonal] &= ~(linked[_STEPS.index((dy, 0))] | linked[_STEPS.index((0, dx))])
    index = np.empty(len(framed), np.int32)  # read only where a pixel is: filling it would cost more than all the rest
    index[flat] = np.arange(1, len(flat) + 1)
    neighbours = np.zeros((8, len(flat) + 1), np.int32)
    np.copyto(neighbours[:, 1:], index[around], where=linked)
    places = np.zeros((len(flat) + 1, 2))
    places[1:, 0], places[1:, 1] = columns, rows
    return places, neighbours


class _Walk:
    """The state of one tracing. ``cluster`` gives each junction pixel's node, ``around`` its neighbours.

    ``finished`` holds the first and last pixels of the chains that were walked.
    """

    def __init__(self, places: Points, neighbours: NDArray[np.int32], links: NDArray[np.intp]) -> None:
        self.nodes: list[tuple[float, float]] = []
        self.chains: list[Chain] = []
        self.cluster: dict[int, int] = {}
        self.finished: set[int] = set()
        self._places, self._neighbours = places, neighbours
        self._walked: list[list[int]] = []
        # A pixel of a chain has two neighbours, or one and "none", which is 0: both together tell each from the other.
        both = np.bitwise_xor.reduce(neighbours, axis=0)
        both[links >= 3] = _STOP
        both[0] = _STOP
        self._both: list[int] = both.tolist()
        junctions = np.flatnonzero(links >= 3)
        self.around = {
            pixel: [near for near in row if near]
            for pixel, row in zip(junctions.tolist(), neighbours.T[junctions].tolist(), strict=True)
        }
        for pixel in self.around:
            if pixel not in self.cluster:
                self._gather_junction(pixel)
        self._left = len(places) - 1 - len(junctions)

    def _gather_junction(self, pixel: int) -> None:
        members, pending = [], [pixel]
        self.cluster[pixel] = len(self.nodes)
        while pending:
            members.append(pending.pop())
            for near in self.around[members[-1]]:
                if near in self.around and near not in self.cluster:
                    self.cluster[near] = len(self.nodes)
                    pending.append(near)
        across, down = self._places[members].sum(axis=0).tolist()
        self.nodes.append((across / len(members), down / len(members)))

    def _new_node(self, pixel: int) -> int:
        x, y = self._places[pixel].tolist()
        self.nodes.append((x, y))
        return len(self.nodes) - 1

    def _pixels_from(self, pixel: int, previous: int) -> tuple[list[int], int]:
        """The pixels of a chain in order, and the junction pixel that it runs into (0: none)."""
        both = self._both  # this loop is the hot spot: a turn for every pixel
        walked: list[int] = []
        add = walked.append
        while (pair := both[pixel]) >= 0:
            add(pixel)
            previous, pixel = pixel, pair ^ previous
        return walked, pixel

    def chain_from(self, pixel: int, junction: int = 0) -> None:
        """Walk a chain from its first pixel; `junction` is the junction pixel it hangs on, or 0 at an end of the skeleton."""
        walked, last = self._pixels_from(pixel, junction)
        self._walked.append(walked)
        self._left -= len(walked)
        self.finished |= {walked[0], walked[-1]}
        start = self.cluster[junction] if junction else self._new_node(pixel)
        if len(walked) == 1 and not junction and not last:  # a lone pixel
            return
        end = self.cluster[last] if last else self._new_node(walked[-1])
        if start == end and len(walked) <= 2:  # a bump of the junction, not a loop
            return
        points = self._places[[0, *walked, 0]]
        points[0], points[-1] = self.nodes[start], self.nodes[end]
        self.chains.append(Chain(start, end, points[0 if junction else 1 : None if last else -1]))

    def rings(self, candidates: NDArray[np.intp]) -> None:
        """Walk the closed rings that have no junction; `candidates` are all pixels with two links."""
        if not self._left:
            return
        seen = {pixel for chain in self._walked for pixel in chain}
        for first in candidates.tolist():
            if first in seen:
                continue
            ring, previous, pixel = [first], first, int(self._neighbours[:, first].max())
            while pixel != first:
                ring.append(pixel)
                previous, pixel = pixel, self._both[pixel] ^ previous
            seen.update(ring)
            node = self._new_node(first)
            self.chains.append(Chain(node, node, self._places[[*ring, first]]))
