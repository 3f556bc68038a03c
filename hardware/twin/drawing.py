"""Strokes, filled shapes and levels: thin wrappers around cv2's anti-aliased drawing in 1/16 px."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.types import GraphEdge, Points
from hardware.twin.phantom import Phantom

U8 = NDArray[np.uint8]
Level = tuple[int, int, int]

_SHIFT = 4


def fixed(points: Points) -> NDArray[np.int32]:
    """Pixel points in cv2's fixed point."""
    return np.rint(np.clip(points, -4000, 12000) * (1 << _SHIFT)).astype(np.int32)


def stroke(canvas: U8, points: Points, colour: Level | int, width_px: float) -> None:
    """A polyline (N, 2) in px, `width_px` wide."""
    cv2.polylines(canvas, [fixed(points)], False, colour, max(1, round(width_px)), cv2.LINE_AA, _SHIFT)


def fill(canvas: U8, points: Points, colour: Level | int) -> None:
    """A filled polygon (N, 2) in px."""
    cv2.fillPoly(canvas, [fixed(points)], colour, cv2.LINE_AA, _SHIFT)


def level(rgb: tuple[float, float, float] | NDArray[np.float64], gain: float = 1.0) -> Level:
    """A colour in 0..1 as 8-bit levels."""
    r, g, b = (int(np.clip(255 * gain * value, 0, 255)) for value in rgb)
    return r, g, b


def random_edge(phantom: Phantom, rng: Generator) -> GraphEdge:
    """An edge of the phantom, long ones more often."""
    lengths = np.array([len(edge.points) for edge in phantom.graph.edges], float)
    return phantom.graph.edges[int(rng.choice(len(lengths), p=lengths / lengths.sum()))]


def normals(points: Points) -> Points:
    """Unit normals (N, 2) along a polyline."""
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    return np.column_stack([-tangent[:, 1], tangent[:, 0]])
