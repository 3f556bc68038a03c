"""From the network's probabilities to clean masks: threshold, small components away, small holes filled (METHOD section 2)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import PerceptionConfig
from core.types import Mask, Masks


def clean(vessel_probability: NDArray[np.float32], robot_probability: NDArray[np.float32], config: PerceptionConfig) -> Masks:
    """Masks of vessel and robot without specks and pinholes.

    Parameters
    ----------
    vessel_probability, robot_probability : shape (h, w), 0..1, at working resolution.
    config : thresholds (``segmentation``) and limits of area (``cleaning``).
    """
    cleaning, thresholds = config.cleaning, config.segmentation
    vessel, robot = vessel_probability >= thresholds.vessel_threshold, robot_probability >= thresholds.robot_threshold
    return Masks(
        vessel=clean_mask(vessel, cleaning.min_vessel_area_px, cleaning.max_hole_area_px),
        robot=clean_mask(robot, cleaning.min_robot_area_px, cleaning.max_hole_area_px),
        vessel_probability=vessel_probability,
        robot_probability=robot_probability,
    )


def clean_mask(mask: Mask, min_area_px: int, max_hole_area_px: int) -> Mask:
    """A copy of `mask` without 8-connected components below `min_area_px`, and with holes up to `max_hole_area_px` filled.

    Larger holes stay: a real loop of the vessel encloses one. Background that reaches the image border is never a hole.
    """
    # Areas come from the contours, which cost 0.1 ms at 640x480 where labelling foreground and background costs 1.4 ms.
    cleaned = np.array(mask, np.uint8, order="C")
    contours, hierarchy = cv2.findContours(cleaned, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return cleaned.view(np.bool_)
    parents = hierarchy[0, :, 3].tolist()
    areas = [_enclosed_pixels(contour, is_hole=parent >= 0) for contour, parent in zip(contours, parents, strict=True)]
    components = [0.0 if parent >= 0 else area for area, parent in zip(areas, parents, strict=True)]
    for area, parent in zip(areas, parents, strict=True):
        if parent >= 0 and area > max_hole_area_px:
            components[parent] -= area
    small_holes = [c for c, area, parent in zip(contours, areas, parents, strict=True) if parent >= 0 and area <= max_hole_area_px]
    cv2.drawContours(cleaned, small_holes, -1, 1, cv2.FILLED)
    for contour, parent, area in zip(contours, parents, components, strict=True):
        if parent < 0 and area < min_area_px:
            cv2.drawContours(cleaned, [contour], -1, 0, cv2.FILLED)
    return cleaned.view(np.bool_)


def _enclosed_pixels(contour: cv2.typing.MatLike, is_hole: bool) -> float:
    """Pixels on and inside an outer contour, or strictly inside a hole's contour, by Pick's theorem on the pixel grid."""
    border = len(contour) if len(contour) > 1 else 0
    return cv2.contourArea(contour) + (-0.5 if is_hole else 0.5) * border + 1.0
