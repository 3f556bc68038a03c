"""From the network's probabilities to clean masks: threshold, small components away, small holes filled (METHOD section 2)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import PerceptionConfig
from core.types import Mask, Masks

MAX_OUTLINES = 500
"""A mask of more pieces and holes is noise: those of real images have some tens before cleaning."""
MAX_EDGE_SHARE = 0.08
"""Along the rows of a real mask it changes some ten times in 640 px. A share of 0.08 is a stripe pattern of 12 px."""


def clean(vessel_probability: NDArray[np.float32], robot_probability: NDArray[np.float32], config: PerceptionConfig) -> Masks:
    """Masks of vessel and robot without specks and pinholes.

    Parameters
    ----------
    vessel_probability, robot_probability : shape (h, w), 0..1, at working resolution.
    config : thresholds (``segmentation``) and limits of area (``cleaning``).
    """
    cleaning, thresholds = config.cleaning, config.segmentation
    vessel = vessel_probability >= thresholds.vessel_threshold
    return Masks(
        vessel=clean_mask(vessel, cleaning.min_vessel_area_px, cleaning.max_hole_area_px),
        robot=clean_robot(robot_probability, config),
        vessel_probability=vessel_probability,
        robot_probability=robot_probability,
    )


def clean_robot(robot_probability: NDArray[np.float32], config: PerceptionConfig) -> Mask:
    """The robot's mask alone."""
    robot = robot_probability >= config.segmentation.robot_threshold
    return clean_mask(robot, config.cleaning.min_robot_area_px, config.cleaning.max_hole_area_px)


def clean_mask(mask: Mask, min_area_px: int, max_hole_area_px: int) -> Mask:
    """A copy of `mask` without 8-connected components below `min_area_px`, and with holes up to `max_hole_area_px` filled.

    Larger holes stay: a real loop of the vessel encloses one. Background that reaches the image border is never a hole. Of a mask
    that is scattered over more than ``MAX_OUTLINES`` pieces and holes nothing is left: cleaning it costs most, and it is noise.
    """
    if _is_noise(mask):
        return np.zeros(mask.shape, np.bool_)
    whole = np.array(mask, np.uint8, order="C")
    x, y, width, height = cv2.boundingRect(whole)
    cleaned = whole[y : y + height, x : x + width]
    # Areas come from the contours, which cost 0.1 ms at 640x480 where labelling foreground and background costs 1.4 ms.
    contours, hierarchy = cv2.findContours(cleaned, cv2.RETR_TREE, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return whole.view(np.bool_)
    if len(contours) > MAX_OUTLINES:
        return np.zeros(mask.shape, np.bool_)
    parents: list[int] = hierarchy[0, :, 3].tolist()
    is_hole = [_depth(parents, index) % 2 == 1 for index in range(len(parents))]
    areas = [_enclosed_pixels(contour, hole) for contour, hole in zip(contours, is_hole, strict=True)]
    is_filled = [hole and area <= max_hole_area_px for hole, area in zip(is_hole, areas, strict=True)]
    cv2.drawContours(cleaned, [contours[index] for index in range(len(contours)) if is_filled[index]], -1, 1, cv2.FILLED)
    open_holes: dict[int, list[int]] = {}
    for index, parent in enumerate(parents):
        if is_hole[index] and not is_filled[index]:
            open_holes.setdefault(parent, []).append(index)
    for index, parent in enumerate(parents):
        if is_hole[index] or (parent >= 0 and is_filled[parent]):
            continue
        holes = open_holes.get(index, [])
        if areas[index] - sum(areas[hole] for hole in holes) < min_area_px:
            # Drawn together with its holes, a component goes and what lies in its holes stays.
            cv2.drawContours(cleaned, [contours[part] for part in (index, *holes)], -1, 0, cv2.FILLED)
    return whole.view(np.bool_)


def _is_noise(mask: Mask) -> bool:
    """Whether a mask begins and ends so often along its rows that nobody needs to follow its outlines; every eighth row tells."""
    rows = mask[::8]
    edges = int(np.count_nonzero(rows[:, 1:] != rows[:, :-1]))
    return edges > max(MAX_EDGE_SHARE * rows.size, MAX_OUTLINES)


def _depth(parents: list[int], index: int) -> int:
    """How many contours lie around this one: an even number around a component's outline, an odd one around a hole's."""
    depth = 0
    while (index := parents[index]) >= 0:
        depth += 1
    return depth


def _enclosed_pixels(contour: cv2.typing.MatLike, is_hole: bool) -> float:
    """Pixels on and inside an outer contour, or strictly inside a hole's contour, by Pick's theorem on the pixel grid."""
    border = len(contour) if len(contour) > 1 else 0
    return cv2.contourArea(contour) + (-0.5 if is_hole else 0.5) * border + 1.0
