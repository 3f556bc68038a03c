"""Pixels to millimetres, in the plane in which the robot moves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from core.calibration.lens import BoardView, plane_of
from core.calibration_config import ScaleConfig
from core.errors import UserError
from core.types import Point, Scene

_STEP_PX = 0.5
_CLICK_PX = 0.7
"""How well a person hits a place, in pixels of the picture."""
_MIN_CLICK_PX = 40.0


class ScaleError(UserError):
    """The scale cannot be told from this."""


def scale_of_board(views: Sequence[BoardView], size: tuple[int, int]) -> ScaleConfig:
    """The scale from pictures of a board that lies in the robot's plane; points are straightened.

    With several pictures the one that shows the most of the board gives the plane; how far the others disagree with it is the
    uncertainty. With one picture it is that of its fit.

    Raises
    ------
    ScaleError
        Without a picture.
    """
    if not views:
        raise ScaleError("no picture of the board was taken")
    middle = (size[0] - 1) / 2, (size[1] - 1) / 2
    planes = [np.linalg.inv(plane_of(view)) for view in views]
    scales = [_local(plane, middle) for plane in planes]
    best = max(range(len(views)), key=lambda k: len(views[k].pixels))
    plane = planes[best] / planes[best][2, 2]
    uncertainty = _fit_error(views[best], plane)
    if len(views) > 1:
        uncertainty = max(uncertainty, float(np.std(scales, ddof=1)) / float(np.mean(scales)))
    numbers = [float(value) for value in plane.ravel()]
    a, b, c, d, e, f, g, h, i = numbers
    return ScaleConfig(
        mm_per_px=scales[best], size_px=size, method="board", uncertainty_share=uncertainty, plane=(a, b, c, d, e, f, g, h, i)
    )


def scale_of_clicks(first: Point, second: Point, length_mm: float, size: tuple[int, int]) -> ScaleConfig:
    """The scale from a known length between two places of the picture.

    Raises
    ------
    ScaleError
        When the length is none, or the places are too near to each other to tell.
    """
    if not (math.isfinite(length_mm) and length_mm > 0.0):
        raise ScaleError("give the length between the two places in millimetres")
    apart_px = math.dist(first, second)
    if apart_px < _MIN_CLICK_PX:
        raise ScaleError(f"the two places are {apart_px:.0f} px apart: take two at least {_MIN_CLICK_PX:.0f} px apart")
    share = math.sqrt(2.0) * _CLICK_PX / apart_px
    return ScaleConfig(mm_per_px=length_mm / apart_px, size_px=size, method="two clicks", uncertainty_share=share)


def mm_per_px_at(scale: ScaleConfig, point: Point | None, size: tuple[int, int]) -> float:
    """Millimetres per pixel of a picture of `size` at `point` (None: its middle); mean of all directions."""
    zoom = max(size) / max(scale.size_px)
    if scale.plane is None or point is None:
        return scale.mm_per_px / zoom
    x, y = ((value + 0.5) / zoom - 0.5 for value in point)
    return _local(np.array(scale.plane).reshape(3, 3), (x, y)) / zoom


def mm_per_working_px(scale: ScaleConfig | None, scene: Scene) -> float | None:
    """Millimetres per working pixel at the robot's head, where there is one; None without a scale for such pictures."""
    if scale is None or not scale.fits(scene.source_size):
        return None
    head = scene.to_source(scene.path.head) if scene.path is not None else None
    return mm_per_px_at(scale, head, scene.source_size) / scene.scale


def _local(plane: np.ndarray, at: Point) -> float:
    """Root of the area that a pixel covers."""
    here, right, down = (_mapped(plane, (at[0] + dx, at[1] + dy)) for dx, dy in ((0.0, 0.0), (_STEP_PX, 0.0), (0.0, _STEP_PX)))
    u, v = (right - here) / _STEP_PX, (down - here) / _STEP_PX
    return math.sqrt(abs(float(u[0] * v[1] - u[1] * v[0])))


def _mapped(plane: np.ndarray, point: Point) -> np.ndarray:
    mapped = plane @ np.array([point[0], point[1], 1.0])
    return np.asarray(mapped[:2] / mapped[2])


def _fit_error(view: BoardView, plane: np.ndarray) -> float:
    """Standard error of the scale by what the plane leaves over: two ends of a board, each as uncertain as its corners together."""
    mapped = np.array([_mapped(plane, (float(x), float(y))) for x, y in view.pixels])
    left_mm = float(np.sqrt(np.mean(np.sum((mapped - view.board_mm) ** 2, axis=1))))
    spread_mm = float(np.sqrt(np.mean(np.sum((view.board_mm - view.board_mm.mean(axis=0)) ** 2, axis=1))))
    return left_mm / spread_mm / math.sqrt(len(view.pixels))
