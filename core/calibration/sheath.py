"""How far the catheter's sheath covers the robot, as far as two pictures of the same robot tell. Pure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Image, Points

F64 = NDArray[np.float64]
_HALF_WIDTH_PX = 8
_STEP_PX = 1.0
_HEAD_PX = 20.0
"""The head may have moved by a hair; what changes there says nothing of the sheath."""
_BEYOND_PX = 20
_LEAST_LENGTH = 3
_LEAST_CHANGE = 3.5
_NOISE_FACTOR = 3.5
_GAP = 6
"""Of a ringed robot the sheath changes the dark parts much more than the light ones."""


def sheath_growth(path: Points, first: Image, second: Image) -> float:
    """By how many px along the robot the sheath goes farther in the second picture than in the first; 0: no difference seen.

    Parameters
    ----------
    path : the robot (N, 2), tail -> head, the same in both pictures.
    first, second : mean pictures (H, W, 3).
    """
    one, other = _band(path, first), _band(path, second)
    change = np.abs(one - other).mean(axis=(1, 2))
    usable = len(change) - int(_HEAD_PX / _STEP_PX)
    if usable < _BEYOND_PX + _LEAST_LENGTH:
        return 0.0
    change = change[:usable]
    start, end = _longest_run(change > max(_LEAST_CHANGE, _NOISE_FACTOR * float(np.median(change))))
    if end - start < _LEAST_LENGTH:
        return 0.0
    # Beyond the changed place both pictures show the bare robot: the one that looks like that in the place itself is the shorter.
    beyond = np.concatenate([band[end + 2 : min(end + 2 + _BEYOND_PX, usable)] for band in (one, other)])
    if len(beyond) < _BEYOND_PX:
        return 0.0
    bare = np.median(beyond, axis=0)
    strange = [float(np.abs(band[start:end].mean(axis=0) - bare).mean()) for band in (one, other)]
    length_px = (end - start) * _STEP_PX
    return length_px if strange[1] > strange[0] else -length_px


def _band(path: Points, image: Image) -> F64:
    """Colours across the robot at every step along it: (steps, places across, 3)."""
    line = polyline.resample(path, _STEP_PX)
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, None]
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    across = np.arange(-_HALF_WIDTH_PX, _HALF_WIDTH_PX + 1)
    places = (line[:, None, :] + across[None, :, None] * normal[:, None, :]).astype(np.float32)
    seen = cv2.remap(image, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen, np.float64)


def _longest_run(changed: NDArray[np.bool_]) -> tuple[int, int]:
    """Start and end of the longest run, small gaps bridged."""
    best, start, last = (0, 0), -1, -_GAP - 1
    for place in np.flatnonzero(changed).tolist():
        if place - last > _GAP:
            start = place
        last = place
        if last + 1 - start > best[1] - best[0]:
            best = start, last + 1
    return best
