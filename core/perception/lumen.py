"""Where the vessel's wall is, roughly, from any place in the lumen."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Mask, Points

EROSION_PX = 0.9


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
