"""A skeleton as a graph: chains of pixels between junctions and ends.

The paper follows the skeleton recursively, pixel by pixel. Here each chain of pixels is walked once, in a loop, and everything that
explores the skeleton afterwards walks some ten chains instead of a thousand pixels: no recursion limit, no endless loops.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

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
    links = (neighbours >= 0).sum(axis=1)
    walk = _Walk(places, neighbours, links)
    for pixel in np.flatnonzero(links >= 3).tolist():
        for first in neighbours[pixel].tolist():
            if first >= 0 and walk.cluster[first] < 0 and not walk.seen[first]:
                walk.chain_from(first, previous=pixel)
    for pixel in np.flatnonzero(links <= 1).tolist():
        if not walk.seen[pixel]:
            walk.chain_from(pixel, previous=-1)
    for pixel in np.flatnonzero(~np.frombuffer(walk.seen, np.bool_) & (links == 2)).tolist():
        if not walk.seen[pixel]:
            walk.ring_from(pixel)
    return PixelGraph(np.array(walk.nodes, np.float64).reshape(-1, 2), tuple(walk.chains))


def _linked_pixels(skeleton: Mask) -> tuple[Points, NDArray[np.int32]]:
    """The skeleton's pixels as points (N, 2), and the index of each one's linked neighbours (N, 8), -1 for none."""
    x, y, width, height = cv2.boundingRect(skeleton.view(np.uint8))
    stride = width + 2
    framed = np.zeros((height + 2, stride), np.bool_)
    framed[1:-1, 1:-1] = skeleton[y : y + height, x : x + width]
    flat = np.flatnonzero(framed)
    index = np.full(framed.size, -1, np.int32)
    index[flat] = np.arange(len(flat), dtype=np.int32)
    neighbours = index[flat[:, None] + np.array([dy * stride + dx for dy, dx in _STEPS])]
    for diagonal, (dy, dx) in enumerate(_STEPS[4:], start=4):
        beside = (neighbours[:, _STEPS.index((dy, 0))] >= 0) | (neighbours[:, _STEPS.index((0, dx))] >= 0)
        neighbours[beside, diagonal] = -1
    rows, columns = np.divmod(flat, stride)
    return np.column_stack([columns + (x - 1.0), rows + (y - 1.0)]), np.asarray(neighbours)


@dataclass(slots=True, eq=False)
class _Walk:
    """The state of one tracing. ``cluster`` gives each junction pixel's node, -1 for pixels of chains."""

    places: Points
    neighbours: NDArray[np.int32]
    links: NDArray[np.int64]
    nodes: list[Points] = field(default_factory=list)
    chains: list[Chain] = field(default_factory=list)
    cluster: list[int] = field(default_factory=list)
    seen: bytearray = field(default_factory=bytearray)
    _two: list[list[int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.seen = bytearray(len(self.places))
        self.cluster = [-1] * len(self.places)
        # A chain pixel has at most two neighbours: sorted, they are the last two entries.
        self._two = np.sort(self.neighbours, axis=1)[:, :-3:-1].tolist()
        for pixel in np.flatnonzero(self.links >= 3).tolist():
            if self.cluster[pixel] < 0:
                self._gather_junction(pixel)

    def _gather_junction(self, pixel: int) -> None:
        members, pending = [], [pixel]
        self.cluster[pixel] = len(self.nodes)
        while pending:
            members.append(pending.pop())
            for near in self.neighbours[members[-1]].tolist():
                if near >= 0 and self.links[near] >= 3 and self.cluster[near] < 0:
                    self.cluster[near] = len(self.nodes)
                    pending.append(near)
        self.nodes.append(self.places[members].mean(axis=0))

    def _new_node(self, pixel: int) -> int:
        self.nodes.append(self.places[pixel])
        return len(self.nodes) - 1

    def chain_from(self, pixel: int, previous: int) -> None:
        """Walk a chain from its first pixel; `previous` is the junction pixel it hangs on, or -1 at an end of the skeleton."""
        if self.links[pixel] == 0:
            self.seen[pixel] = True
            self._new_node(pixel)
            return
        origin, current = previous, pixel
        walked: list[int] = []
        cluster, seen, two = self.cluster, self.seen, self._two  # this loop is the hot spot: a turn for every pixel
        while current >= 0 and cluster[current] < 0:
            seen[current] = True
            walked.append(current)
            a, b = two[current]
            previous, current = current, b if a == previous else a
        start = self.cluster[origin] if origin >= 0 else self._new_node(pixel)
        end = self.cluster[current] if current >= 0 else self._new_node(walked[-1])
        if start == end and len(walked) <= 2:  # a bump of the junction, not a loop
            return
        before = [self.nodes[start]] if origin >= 0 else []
        after = [self.nodes[end]] if current >= 0 else []
        points = np.concatenate([np.reshape(before, (-1, 2)), self.places[walked], np.reshape(after, (-1, 2))])
        self.chains.append(Chain(start, end, points))

    def ring_from(self, pixel: int) -> None:
        """Walk a closed ring that has no junction."""
        walked, previous, current = [pixel], pixel, self._two[pixel][0]
        while current != pixel:
            walked.append(current)
            a, b = self._two[current]
            previous, current = current, b if a == previous else a
        for member in walked:
            self.seen[member] = True
        node = self._new_node(pixel)
        self.chains.append(Chain(node, node, self.places[[*walked, pixel]]))
