"""A skeleton as a graph: chains of pixels between junctions and ends.

The paper follows the skeleton recursively, pixel by pixel. Here each chain of pixels is walked once, in a loop, and everything that
explores the skeleton afterwards walks some ten chains instead of a thousand pixels: no recursion limit, no endless loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from core.perception.compiled import loops
from core.types import Mask, Points


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
    nodes, starts, ends, points, marks = loops.pixels.trace(np.flatnonzero(skeleton), skeleton.shape[1])
    lines = zip(starts.tolist(), ends.tolist(), pairwise(marks.tolist()), strict=True)
    return PixelGraph(nodes, tuple(Chain(start, end, points[first:last]) for start, end, (first, last) in lines))
