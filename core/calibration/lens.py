"""The lens: straight lines that are seen bent. Two radial terms, fitted to a flat board, whatever angle it is seen at.

A board that lies flat is seen through an unknown perspective (eight numbers a picture) and the lens (two, the same for all
pictures). Focal length and pose are not needed to straighten a picture, so they are not asked for: one good picture is enough, and
the camera need not be moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from core.calibration_config import LensConfig
from core.errors import UserError
from core.types import Image, Points

F32 = NDArray[np.float32]
_NEWTON_STEPS = 8
_MIN_POINTS = 24
_HUBER_PX = 0.5
_MAX_K = 0.5
_SMALL_K2_PX = 7.0
"""A point's error against the second term's size: 0.2 px for a k2 of 0.03."""


class LensError(UserError):
    """The lens cannot be told from these pictures."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """A flat board in one picture: points in pixels (N, 2) and where they are on the board, in mm (N, 2)."""

    pixels: Points
    board_mm: Points


def distort(points: Points, lens: LensConfig) -> Points:
    """Where points (N, 2) of the straightened picture are seen through the lens, in pictures of ``lens.size_px``."""
    return _distort(np.asarray(points, np.float64), lens.k1, lens.k2, np.array(lens.center_px), _half(lens.size_px))


def straighten(points: Points, lens: LensConfig) -> Points:
    """Where seen points (N, 2) are in the straightened picture; the inverse of ``distort`` (Newton steps on the radius)."""
    center, half = np.array(lens.center_px), _half(lens.size_px)
    offset = (np.asarray(points, np.float64) - center) / half
    seen = np.hypot(offset[:, 0], offset[:, 1])
    radius = seen.copy()
    for _ in range(_NEWTON_STEPS):
        square = radius * radius
        value = radius * (1 + lens.k1 * square + lens.k2 * square * square) - seen
        slope = 1 + 3 * lens.k1 * square + 5 * lens.k2 * square * square
        radius = np.maximum(radius - value / np.maximum(slope, 1e-3), 0.0)
    share = np.divide(radius, seen, out=np.ones_like(radius), where=seen > 1e-12)
    return np.asarray(center + half * offset * share[:, None])


def scaled_to(lens: LensConfig, size: tuple[int, int]) -> LensConfig | None:
    """The same lens in pictures of another `size`; None when those show something else (another aspect)."""
    if size == lens.size_px:
        return lens
    across, down = size[0] / lens.size_px[0], size[1] / lens.size_px[1]
    if abs(across / down - 1.0) > 0.01:
        return None
    x, y = ((value + 0.5) * factor - 0.5 for value, factor in zip(lens.center_px, (across, down), strict=True))
    return lens.model_copy(update={"center_px": (x, y), "size_px": size})


def maps(lens: LensConfig) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
    """For ``cv2.remap``: where every pixel of the straightened picture is taken from, in its fast fixed-point form."""
    width, height = lens.size_px
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    seen = distort(np.column_stack([x.ravel(), y.ravel()]), lens).astype(np.float32).reshape(height, width, 2)
    places, shares = cv2.convertMaps(seen[..., 0], seen[..., 1], cv2.CV_16SC2)
    return np.asarray(places, np.int16), np.asarray(shares, np.uint16)


def straightened(image: Image, places: NDArray[np.int16], shares: NDArray[np.uint16]) -> Image:
    """The picture without the lens's distortion; what was never seen takes the colour of the border beside it."""
    return np.asarray(cv2.remap(image, places, shares, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def fit_lens(views: Sequence[BoardView], size: tuple[int, int]) -> LensConfig:
    """The lens that makes all boards flat.

    Parameters
    ----------
    views : pictures of the same camera; their points should reach far into the picture's corners.
    size : (width, height) of the pictures.

    Raises
    ------
    LensError
        Too few points, or no lens explains them.
    """
    count = sum(len(view.pixels) for view in views)
    if not views or count < _MIN_POINTS:
        raise LensError(f"the lens needs {_MIN_POINTS} points of the board, {count} were seen: show the whole board")
    center, half = np.array([(size[0] - 1) / 2, (size[1] - 1) / 2]), _half(size)
    start = [0.0, 0.0, *(number for view in views for number in _homography(view))]

    def misses(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        parts = []
        for k, view in enumerate(views):
            flat = _project(numbers[2 + 8 * k : 10 + 8 * k], view.board_mm)
            parts.append(_distort(flat, numbers[0], numbers[1], center, half) - view.pixels)
        # Where the board does not reach, nothing but its smallness is known of the second term.
        return np.append(np.concatenate(parts).ravel(), _SMALL_K2_PX * numbers[1])

    from scipy.optimize import least_squares  # half a second that nobody else needs

    found = least_squares(misses, start, x_scale="jac", loss="soft_l1", f_scale=_HUBER_PX, max_nfev=300)
    k1, k2 = (float(value) for value in found.x[:2])
    residual = float(np.sqrt(np.mean(np.sum(misses(found.x)[:-1].reshape(-1, 2) ** 2, axis=1))))
    if not (abs(k1) <= _MAX_K and abs(k2) <= _MAX_K and np.isfinite(residual)):
        raise LensError("no lens explains these pictures: print the board at 100 %, lay it flat, and take them again")
    try:
        return LensConfig(
            k1=k1, k2=k2, center_px=(float(center[0]), float(center[1])), size_px=size, residual_px=residual, pictures=len(views)
        )
    except ValidationError:
        raise LensError("the lens found would fold the picture's corners: show the board in them, too, and take more") from None


def plane_of(view: BoardView) -> NDArray[np.float64]:
    """The perspective (3, 3) from board millimetres to pixels; `view` is straightened already."""
    return np.append(_homography(view), 1.0).reshape(3, 3)


def _homography(view: BoardView) -> NDArray[np.float64]:
    matrix, _ = cv2.findHomography(view.board_mm, view.pixels, 0)
    if matrix is None:
        raise LensError("the board was seen in a line only: lay it flat under the camera")
    return np.asarray(matrix.ravel()[:8] / matrix[2, 2], np.float64)


def _project(numbers: NDArray[np.float64], points_mm: Points) -> Points:
    matrix = np.append(numbers, 1.0).reshape(3, 3)
    mapped = np.column_stack([points_mm, np.ones(len(points_mm))]) @ matrix.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def _distort(points: Points, k1: float, k2: float, center: NDArray[np.float64], half: float) -> Points:
    offset = (points - center) / half
    square = np.sum(offset**2, axis=1, keepdims=True)
    return np.asarray(center + half * offset * (1 + k1 * square + k2 * square * square))


def _half(size: tuple[int, int]) -> float:
    return float(np.hypot(*size) / 2)
