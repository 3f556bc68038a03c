"""The lumen's walls as thin boxes for the contact solver, pushed outward from the outline of the lumen. Lengths in mm."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skimage.measure import approximate_polygon, find_contours

from core.types import Points, VesselGraph
from hardware.twin.lumen_field import lumen_discs
from hardware.twin.phantom import Phantom

_THICKNESSES_MM = (1.0, 0.6, 0.35, 0.2)
_GRID_MM = 0.25
_TOLERANCE_MM = 0.1
_MAX_PIECE_MM = 6.0


@dataclass(frozen=True, slots=True)
class Wall:
    """A box: centre, half length along ``angle_rad``, half thickness across; its inner face lies on the lumen's outline."""

    x: float
    y: float
    half_length: float
    half_thickness: float
    angle_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """Where the robot enters: a point and the unit direction into the lumen."""

    point: NDArray[np.float64]
    inward: NDArray[np.float64]
    radius: float

    @property
    def angle_rad(self) -> float:
        return float(np.arctan2(self.inward[1], self.inward[0]))


def port_of(phantom: Phantom) -> Port:
    """The phantom's port, with the direction of its first 2 mm of centerline."""
    for edge in phantom.graph.edges:
        if phantom.port in (edge.start, edge.end):
            points, radius = (edge.points, edge.radius) if edge.start == phantom.port else (edge.points[::-1], edge.radius[::-1])
            step = points[5] - points[0]
            return Port(points[0], step / np.linalg.norm(step), float(radius[0]))
    raise ValueError(f"phantom {phantom.name}: node {phantom.port} has no edge, so it cannot be the port")


def lumen_outline(graph: VesselGraph) -> list[Points]:
    """Closed outlines (N, 2) of the union of discs along the centerlines, to about 0.02 mm."""
    centers, radii = lumen_discs(graph)
    low = np.floor((centers - radii[:, None]).min(axis=0)) - 2.0
    high = np.ceil((centers + radii[:, None]).max(axis=0)) + 2.0
    columns, rows = ((high - low) / _GRID_MM).astype(int)
    x, y = low[0] + _GRID_MM * np.arange(columns), low[1] + _GRID_MM * np.arange(rows)
    depth = np.full((rows, columns), -1.0)
    for (cx, cy), radius in zip(centers, radii, strict=True):
        # Each disc only touches a window around it; one millimetre outside is enough to interpolate the zero line.
        reach = radius + 1.0
        i = slice(int((cy - reach - low[1]) / _GRID_MM), int((cy + reach - low[1]) / _GRID_MM) + 2)
        j = slice(int((cx - reach - low[0]) / _GRID_MM), int((cx + reach - low[0]) / _GRID_MM) + 2)
        np.maximum(depth[i, j], radius - np.hypot(y[i, None] - cy, x[None, j] - cx), out=depth[i, j])
    return [low + _GRID_MM * contour[:, ::-1] for contour in find_contours(depth, 0.0)]


def wall_boxes(phantom: Phantom, outlines: list[Points]) -> tuple[list[Wall], Port]:
    """The walls of a phantom along its ``lumen_outline``, open at its port."""
    port, discs = port_of(phantom), lumen_discs(phantom.graph)
    walls = []
    for outline in outlines:
        corners = approximate_polygon(outline, _TOLERANCE_MM)
        for start, end in itertools.pairwise(corners):
            length = float(np.linalg.norm(end - start))
            if length < 1e-6:
                continue
            along = (end - start) / length
            # Outlines keep the lumen on a fixed hand, islands too: here (x right, y down) on their left as seen on screen.
            outward = np.array([along[1], -along[0]])
            count = int(np.ceil(length / _MAX_PIECE_MM))
            for piece in range(count):
                ends = start + np.outer((piece, piece + 1), along) * length / count
                middle = ends.mean(axis=0)
                if not _in_mouth(middle, port):
                    thickness = _thickness(ends, outward, discs)
                    x, y = middle + outward * thickness / 2
                    angle = float(np.arctan2(along[1], along[0]))
                    walls.append(Wall(float(x), float(y), length / count / 2, thickness / 2, angle))
    return walls, port


def _thickness(ends: Points, outward: NDArray[np.float64], discs: tuple[Points, NDArray[np.float64]]) -> float:
    """As thick as may be without sticking out into the lumen behind, which happens at the sharp divider of two branches."""
    centers, radii = discs
    for thickness in _THICKNESSES_MM[:-1]:
        outer = ends + outward * thickness
        depth = radii - np.linalg.norm(outer[:, None] - centers, axis=2)
        if depth.max() < 0.1:
            return thickness
    return _THICKNESSES_MM[-1]


def _in_mouth(point: NDArray[np.float64], port: Port) -> bool:
    """The rounded cap of the lumen behind the port, through which the robot comes."""
    offset = point - port.point
    return float(offset @ port.inward) < 0.0 and float(np.linalg.norm(offset)) < 1.2 * port.radius + 1.0
