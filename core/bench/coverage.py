"""Where in a vessel tree the robot has been: the tree in short cells along its centerlines, each covered or not yet."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.config.models import CleaningConfig
from core.perception import skeleton
from core.perception.vessel_graph import build_graph
from core.types import Mask, Points, VesselGraph

CELL_PX = 20.0
"""Length of a cell along the centerline, working pixels."""
_LEAST_PX = 12
"""Pixels of the robot in a cell from which on it has been there: a robot 3 px wide over a fifth of the cell."""
_DONE_SHARE = 0.5
"""A branch is done when so many of its cells are covered: the end of a narrow one cannot be reached."""
_SIDE_SHARE = 0.33
"""An end this far from the middle of the tree, as a share of half its extent, is at the left, right, upper or lower side."""
OUTSIDE, OPEN, COVERED, ASKED = range(4)
"""What a pixel of ``VesselCoverage.tree`` is: no vessel, not covered yet, covered, in the branch that is asked for next."""
_SHORTEST_CELLS = 2
"""A branch of fewer cells is a bulge of the mask, and is not asked for."""


class Side(StrEnum):
    """Where in the tree a branch ends."""

    UPPER_LEFT = "upper left"
    TOP = "top"
    UPPER_RIGHT = "upper right"
    LEFT = "left"
    MIDDLE = "middle"
    RIGHT = "right"
    LOWER_LEFT = "lower left"
    BOTTOM = "bottom"
    LOWER_RIGHT = "lower right"


_SIDES = tuple(Side)
"""In rows of three, as they lie in the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class VesselBranch:
    """An edge of the vessel graph in cells.

    Attributes
    ----------
    covered : whether the robot has been in each cell.
    side : where the branch ends.
    is_end : it ends in the picture or at its border, not at a junction.
    is_wanted : long enough to be asked for.
    """

    covered: tuple[bool, ...]
    side: Side
    is_end: bool
    is_wanted: bool

    @property
    def is_done(self) -> bool:
        return sum(self.covered) >= _DONE_SHARE * len(self.covered)


class VesselCoverage:
    """Cells of a vessel, and which of them a robot has covered.

    Parameters
    ----------
    vessel : the lumen, bool (h, w).
    known : bool (h, w); cells in which the empty bench is not known, since the robot always lies there, count as covered.
    """

    def __init__(self, vessel: Mask, known: Mask | None = None) -> None:
        cleaning = CleaningConfig()
        graph = build_graph(skeleton.thin(vessel), vessel, cleaning)
        lines, self._edge_of = _cells_of(graph)
        self._edges = _ends_of(graph, vessel)
        self._cell_of = _nearest_cell(lines, vessel)
        count = len(lines)
        self._covered = np.zeros(count, bool)
        if known is not None and count:
            all_px = np.bincount(self._cell_of.ravel(), minlength=count + 1)[1:]
            hidden = np.bincount(self._cell_of[~known], minlength=count + 1)[1:]
            self._covered = 2 * hidden > all_px

    @property
    def share(self) -> float:
        """Share of the cells that are covered, 0..1; 1 for a mask without a centerline."""
        return float(self._covered.mean()) if len(self._covered) else 1.0

    def cells_under(self, robot: Mask) -> NDArray[np.bool_]:
        """The cells (K,) that the robot's mask (h, w) covers."""
        counts = np.bincount(self._cell_of[robot], minlength=len(self._covered) + 1)[1:]
        return np.asarray(counts >= _LEAST_PX)

    def new_cells(self, robot: Mask) -> int:
        """How many cells that were not covered the robot's mask (h, w) covers."""
        return int((self.cells_under(robot) & ~self._covered).sum())

    def add(self, robot: Mask) -> int:
        """Cover the cells under the robot's mask (h, w); returns how many were not covered before."""
        under = self.cells_under(robot)
        count = int((under & ~self._covered).sum())
        self._covered |= under
        return count

    def branches(self) -> tuple[VesselBranch, ...]:
        """All branches as they are now."""
        found = []
        for edge, (side, is_end) in enumerate(self._edges):
            cells = np.flatnonzero(self._edge_of == edge)
            covered = tuple(bool(self._covered[cell]) for cell in cells)
            found.append(VesselBranch(covered, side, is_end, len(cells) >= _SHORTEST_CELLS))
        return tuple(found)

    def tree(self) -> NDArray[np.uint8]:
        """The vessel (h, w) as it is shown: OUTSIDE, OPEN, COVERED, or ASKED for the first branch that is missing."""
        kinds = np.where(self._covered, COVERED, OPEN).astype(np.uint8)
        branches = self.branches()
        asked = next((place for place, branch in enumerate(branches) if branch in missing(branches)[:1]), None)
        if asked is not None:
            kinds[(self._edge_of == asked) & ~self._covered] = ASKED
        return np.concatenate([np.array([OUTSIDE], np.uint8), kinds])[self._cell_of]


def missing(branches: tuple[VesselBranch, ...]) -> tuple[VesselBranch, ...]:
    """The branches that are not done: ends of the tree, or, where all of these are done, what lies between."""
    wanted = [branch for branch in branches if branch.is_wanted and not branch.is_done]
    ends = [branch for branch in wanted if branch.is_end]
    return tuple(ends or wanted)


def _cells_of(graph: VesselGraph) -> tuple[list[Points], NDArray[np.intp]]:
    """The centerline of each cell, and the edge that it belongs to."""
    lines: list[Points] = []
    edges: list[int] = []
    for index, edge in enumerate(graph.edges):
        length = float(geometry.arc_length(edge.points)[-1])
        count = max(1, round(length / CELL_PX))
        for place in range(count):
            lines.append(geometry.cut(edge.points, length * place / count, length * (place + 1) / count))
            edges.append(index)
    return lines, np.array(edges, np.intp)


def _ends_of(graph: VesselGraph, vessel: Mask) -> list[tuple[Side, bool]]:
    """For each edge where it ends, and whether the tree ends there."""
    x, y, width, height = cv2.boundingRect(vessel.view(np.uint8))
    middle, half = np.array([x + width / 2, y + height / 2]), np.maximum(np.array([width / 2, height / 2]), 1.0)
    degree = np.zeros(len(graph.nodes), int)
    for edge in graph.edges:
        degree[edge.start] += 1
        degree[edge.end] += 1
    found = []
    for edge in graph.edges:
        start, end = degree[edge.start] == 1, degree[edge.end] == 1
        at = edge.points[-1] if end else edge.points[0] if start else edge.points[len(edge.points) // 2]
        column, row = (1 + int(share > _SIDE_SHARE) - int(share < -_SIDE_SHARE) for share in (at - middle) / half)
        found.append((_SIDES[3 * row + column], bool(start or end)))
    return found


def _nearest_cell(lines: list[Points], vessel: Mask) -> NDArray[np.int32]:
    """The number, from 1, of the cell that is nearest to each pixel of the vessel (h, w); 0 elsewhere."""
    drawn = np.zeros(vessel.shape, np.int32)
    for number, points in enumerate(lines, 1):
        cv2.polylines(drawn, [np.round(points).astype(np.int32).reshape(-1, 1, 2)], False, number, 1, cv2.LINE_8)
    if not lines:
        return drawn
    _, labels = cv2.distanceTransformWithLabels((drawn == 0).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    number_of = np.zeros(int(labels.max()) + 1, np.int32)
    number_of[labels[drawn > 0]] = drawn[drawn > 0]
    return np.where(vessel, number_of[labels], 0).astype(np.int32)
