"""Where the vessel's wall is: roughly from any place in the lumen, and to a fraction of a pixel across a line through it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.perception.compiled import maps
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


def walls(
    level: NDArray[np.float32], points: Points, normals: Points, expected: NDArray[np.float64], search_px: int = SEARCH_PX
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How far the walls to both sides of a line are, to a fraction of a pixel, and how steeply the level falls there.

    Parameters
    ----------
    level : the vessel's mask or probability (h, w); the wall is where it falls through 0.5.
    points, normals : places in the lumen (N, 2), and unit vectors (N, 2) across the line.
    expected : about how far the walls are (N,).
    search_px : how far to both sides of that they are looked for.

    Returns
    -------
    Distances (2, N) in px, along the normals and against them; NaN where a wall is not there: in a branch's opening, or beyond the
    image's border. And the level's slopes (2, N), per px, at least ``SOFTEST``: a network that is not sure draws a soft wall.
    """
    reach, slope = maps.walls(level, points, normals, expected, search_px)
    return reach, np.maximum(slope, SOFTEST, out=slope)
