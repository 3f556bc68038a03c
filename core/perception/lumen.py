"""Where the vessel's wall is: roughly from any place in the lumen, and to a fraction of a pixel across a line through it."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Mask, Points

EROSION_PX = 0.9
SEARCH_PX = 4
"""What a distance map of every second pixel may be wrong by, and a bit."""
SOFTEST = 0.02
"""Per px: a wall that falls less steeply than this says as little as this."""


class RadiusMap:
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


def wall_distances(
    level: NDArray[np.float32], points: Points, normals: Points, expected: NDArray[np.float64], search_px: int = SEARCH_PX
) -> NDArray[np.float64]:
    """How far the walls to both sides of a line are: to a fraction of a pixel.

    Parameters
    ----------
    level : the vessel's mask or probability (h, w); the wall is where it falls through 0.5.
    points, normals : places in the lumen (N, 2), and unit vectors (N, 2) across the line.
    expected : about how far the walls are (N,).
    search_px : how far to both sides of that they are looked for.

    Returns
    -------
    (2, N) in px, along the normals and against them; NaN where a wall is not there: in a branch's opening, or beyond the image's
    border.
    """
    return _crossings(level, points, normals, expected, search_px)[0].reshape(2, -1)


def sharp_walls(
    level: NDArray[np.float32], points: Points, normals: Points, expected: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """``wall_distances``, and how steeply the level falls there, per px (2, N): a network that is not sure draws a soft wall."""
    reach, inside, first = _crossings(level, points, normals, expected, SEARCH_PX)
    rows = np.arange(len(first))
    before, after = np.maximum(first - 2, 0), np.minimum(first + 1, 2 * SEARCH_PX)
    slope = np.maximum((inside[rows, before] - inside[rows, after]) / np.maximum(after - before, 1), SOFTEST)
    return reach.reshape(2, -1), slope.reshape(2, -1)


def _crossings(
    level: NDArray[np.float32], points: Points, normals: Points, expected: NDArray[np.float64], search_px: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Along all normals and then against all: distances (2N,), the level pixel by pixel (2N, 2 `search_px` + 1), and the first
    pixel outside (2N,)."""
    distances = expected[:, None] + np.arange(-search_px, search_px + 1.0)
    np.maximum(distances, 0.0, out=distances)
    count, looked = distances.shape
    x, y = np.empty((2, count, looked)), np.empty((2, count, looked))
    for places, axis in ((x, 0), (y, 1)):
        offset, place = distances * normals[:, axis, None], points[:, axis, None]
        np.add(place, offset, out=places[0])
        np.subtract(place, offset, out=places[1])
    inside = polyline.sample_at(level, x, y).reshape(2 * count, looked)
    first = (inside < 0.5).argmax(axis=1)
    rows = np.arange(2 * count)
    before = first - 1
    here, there = inside[rows, before], inside[rows, first]
    reach = distances[rows % count, before] + (here - 0.5) / np.maximum(here - there, 1e-6)
    # Nowhere outside, or from the start: both have 0 for the first place that is outside.
    return np.where(first > 0, reach, math.nan), inside, first


def two_shapes(
    shapes: NDArray[np.float64], wanted: NDArray[np.float64], weight: NDArray[np.float64], stiffness: float
) -> tuple[float, float]:
    """How much of each of two shapes (2, N) comes nearest to what is `wanted` (N,), by weights; `stiffness` keeps both small."""
    first, second = shapes * weight
    a, b, c = float(first @ shapes[0]) + stiffness, float(first @ shapes[1]), float(second @ shapes[1]) + stiffness
    one, other = float(first @ wanted), float(second @ wanted)
    determinant = a * c - b * b
    return (c * one - b * other) / determinant, (a * other - b * one) / determinant
