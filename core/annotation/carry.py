"""Masks carried from one picture of a bench to the next: the vessel stays, the robot is found by what has changed.

Camera and phantom do not move. Where both pictures are alike, a pixel is robot if it was robot. Where they differ, a graph cut
decides by the colours of robot and background in the picture before.
"""

from __future__ import annotations

import cv2
import numpy as np

from core.annotation.masks import TOLERANCE_PX, fill, polygons_of
from core.annotation.model import MaskTarget
from core.annotation.outline import Polygons
from core.types import Image, Mask

_SIDE_PX = 640
"""The robot is carried in pictures whose longer side is this, or less."""
_CHANGED, _USUAL_FACTOR = 5.0, 4.0
"""Pixels have changed that differ by more than the first in Lab, and by more than so many times the usual difference of both
pictures. Measured on 32 pairs of pictures of four independent benches: median Dice .90, of the robot left where it was .19; 0 in
four pairs, three of which show another robot."""
_BLUR_PX = 1.5
"""Pictures are smoothed by this before they are compared."""
_ROUNDS = 3
"""Of colour models and cut."""
_VESSEL_MARGIN_PX = 4
"""The robot may stick out of the drawn vessel by so much."""
_AROUND_PX = 24
"""Background around the robot, and around what has changed, whose colours are compared."""
_SMALL_SHARE = 0.05
"""Pieces below this share of the robot's area are reflections and shadows."""


def carried_masks(before: Image, masks: Polygons, image: Image) -> Polygons:
    """A proposal for the masks of a picture (H, W, 3) from those of another one of the same size, `before`, of the same bench.

    The vessel's polygons are the same; the robot's are new, none where no robot was drawn.
    """
    vessel = tuple(polygon for polygon in masks if polygon.target is MaskTarget.VESSEL)
    height, width = image.shape[:2]
    robot = fill(masks, MaskTarget.ROBOT, (width, height))
    if not robot.any() or before.shape != image.shape:
        return vessel
    lumen = fill(masks, MaskTarget.VESSEL, (width, height))
    scale = min(1.0, _SIDE_PX / max(width, height))
    size = round(width * scale), round(height * scale)
    pictures = [_shrunk(one, size) for one in (before, image)]
    small = [cv2.resize(mask.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0 for mask in (robot, lumen)]
    if not small[0].any():  # too thin for the smaller picture
        return vessel
    found = _moved_robot(pictures[0], pictures[1], small[0], small[1]).astype(np.float32)
    whole = cv2.resize(found, (width, height), interpolation=cv2.INTER_LINEAR) > 0.5
    return vessel + polygons_of(np.asarray(whole, np.bool_), MaskTarget.ROBOT, TOLERANCE_PX)


def _shrunk(image: Image, size: tuple[int, int]) -> Image:
    if size == (image.shape[1], image.shape[0]):
        return image
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _changed(before: Image, after: Image) -> Mask:
    """Where two pictures of a bench differ, whatever their exposure."""
    lab = [
        cv2.cvtColor(cv2.GaussianBlur(one, (0, 0), _BLUR_PX).astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
        for one in (before, after)
    ]
    step = lab[1] - lab[0]
    step -= np.median(step.reshape(-1, 3), axis=0)
    away = np.sqrt((step**2).sum(axis=2))
    usual = float(np.median(away))
    return np.asarray(away > max(_CHANGED, _USUAL_FACTOR * usual), np.bool_)


def _moved_robot(before: Image, after: Image, robot: Mask, lumen: Mask) -> Mask:
    """The robot's mask (h, w) in `after`, of that in `before`; `lumen` is the vessel, empty where it is not drawn."""
    changed = _changed(before, after)
    margin = np.ones((2 * _VESSEL_MARGIN_PX + 1, 2 * _VESSEL_MARGIN_PX + 1), np.uint8)
    may_be = cv2.dilate((robot | lumen).view(np.uint8), margin) > 0 if lumen.any() else np.ones_like(robot)
    x, y, width, height = cv2.boundingRect((robot | (changed & may_be)).view(np.uint8))
    rows, columns = (slice(max(0, low - _AROUND_PX), low + length + _AROUND_PX) for low, length in ((y, height), (x, width)))
    whole = np.zeros_like(robot)
    window = rows, columns
    robot, changed, may_be = robot[window], changed[window], may_be[window]
    # The robot's colours are those of the picture before: both pictures lie side by side in one cut.
    labels = np.full((2, *robot.shape), cv2.GC_BGD, np.uint8)
    labels[0][robot] = cv2.GC_FGD
    labels[1][robot & ~changed] = cv2.GC_FGD
    labels[1][changed & may_be] = cv2.GC_PR_FGD
    both = np.ascontiguousarray(np.concatenate([before[window], after[window]]))
    cut = np.ascontiguousarray(labels.reshape(-1, robot.shape[1]))
    cv2.setRNGSeed(0)
    cv2.grabCut(both, cut, (0, 0, 0, 0), np.zeros((1, 65)), np.zeros((1, 65)), _ROUNDS, cv2.GC_INIT_WITH_MASK)
    found = ((cut == cv2.GC_FGD) | (cut == cv2.GC_PR_FGD))[robot.shape[0] :]
    solid = cv2.morphologyEx(found.astype(np.uint8), cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3)))
    count, parts, stats, _ = cv2.connectedComponentsWithStats(solid)
    large = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] >= _SMALL_SHARE * robot.sum()]
    whole[window] = np.isin(parts, large)
    return whole
