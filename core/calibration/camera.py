"""Calibration of the camera: the printed ChArUco board, the lens's distortion, and the scale in the plane in which the robot moves.

A flat board is seen through an unknown perspective (eight numbers a picture) and the lens (two radial terms, the same for all
pictures). Focal length and pose are not needed to undistort a picture: one good picture is enough, and the camera need not be
moved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from core.config.calibration import LensConfig, ScaleConfig
from core.devices import UserError
from core.messages import message
from core.types import Image, Point, Points, Scene

F32 = NDArray[np.float32]
_NEWTON_STEPS = 8
_MIN_POINTS = 24
_HUBER_PX = 0.5
_MAX_K = 0.5
_SMALL_K2_PX = 7.0
"""Weight of the second term's size as a residual: 0.2 px for a k2 of 0.03."""


class LensError(UserError):
    """The lens cannot be fitted to these pictures."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """A flat board in one picture: points in pixels (N, 2) and where they are on the board, in mm (N, 2)."""

    pixels: Points
    board_mm: Points


def distort(points: Points, lens: LensConfig) -> Points:
    """Where points (N, 2) of the undistorted picture are seen through the lens, in pictures of ``lens.size_px``."""
    return _distort(np.asarray(points, np.float64), lens.k1, lens.k2, np.array(lens.center_px), _half(lens.size_px))


def undistort(points: Points, lens: LensConfig) -> Points:
    """Where seen points (N, 2) are in the undistorted picture; the inverse of ``distort`` (Newton steps on the radius)."""
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
    """The same lens in pictures of another `size`; None when those have another aspect."""
    if size == lens.size_px:
        return lens
    across, down = size[0] / lens.size_px[0], size[1] / lens.size_px[1]
    if abs(across / down - 1.0) > 0.01:
        return None
    x, y = ((value + 0.5) * factor - 0.5 for value, factor in zip(lens.center_px, (across, down), strict=True))
    return lens.model_copy(update={"center_px": (x, y), "size_px": size})


def maps(lens: LensConfig) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
    """Maps for ``cv2.remap`` of the undistorted picture, in its fast fixed-point form."""
    width, height = lens.size_px
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    seen = distort(np.column_stack([x.ravel(), y.ravel()]), lens).astype(np.float32).reshape(height, width, 2)
    places, shares = cv2.convertMaps(seen[..., 0], seen[..., 1], cv2.CV_16SC2)
    return np.asarray(places, np.int16), np.asarray(shares, np.uint16)


def undistorted(image: Image, places: NDArray[np.int16], shares: NDArray[np.uint16]) -> Image:
    """The picture without the lens's distortion; places that were not seen take the colour of the border."""
    return np.asarray(cv2.remap(image, places, shares, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def fit_lens(views: Sequence[BoardView], size: tuple[int, int]) -> LensConfig:
    """The lens that makes all boards flat, by least squares; `size` is (width, height) of the pictures.

    All views are of one camera, and their points should reach far into the picture's corners. Raises LensError: too few points,
    or no lens explains them.
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
        # where the board does not reach, the second term is undetermined: it is kept small
        return np.append(np.concatenate(parts).ravel(), _SMALL_K2_PX * numbers[1])

    from scipy.optimize import least_squares  # takes half a second

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
    """The perspective (3, 3) from board millimetres to pixels; `view` is undistorted already."""
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


_MARKER_SHARE = 0.75
_MIN_CORNERS = 12
_DICTIONARY, _MARKERS = cv2.aruco.DICT_4X4_50, 50
"""The dictionary and its number of markers; every white square of a board has its own."""


class BoardError(UserError):
    """The board is not in the picture, or too little of it; or no such board can be made."""


@dataclass(frozen=True, slots=True)
class BoardSpec:
    """Squares across and down, and the side of one in mm. The default fits on A4 and on the twin's board."""

    columns: int = 10
    rows: int = 7
    square_mm: float = 18.0

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the chessboard."""
        return self.columns * self.square_mm, self.rows * self.square_mm

    @property
    def marker_mm(self) -> float:
        return _MARKER_SHARE * self.square_mm


def board_bitmap(spec: BoardSpec, pixels_per_square: int = 32) -> NDArray[np.uint8]:
    """The board as a grey picture without margin, `pixels_per_square` (a multiple of 8) px a square."""
    size = spec.columns * pixels_per_square, spec.rows * pixels_per_square
    return np.asarray(_board(spec).generateImage(size, marginSize=0, borderBits=1), np.uint8)


def find_board(image: Image, spec: BoardSpec) -> BoardView:
    """The board's inner corners in a picture (H, W, 3).

    Raises BoardError: fewer than twelve corners are seen, or all of them lie in a line.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) if image.ndim == 3 else image
    corners, ids, markers, _ = _detector(spec).detectBoard(grey)
    count = 0 if ids is None else len(ids)
    if count < _MIN_CORNERS:
        seen = 0 if markers is None else len(markers)
        why = message(
            "{a} of its markers and {b} of its {c} corners are seen", a=seen, b=count, c=(spec.columns - 1) * (spec.rows - 1)
        )
        raise BoardError(f"no board: {why}; lay it flat under the camera, without glare, as large as the picture")
    order = np.asarray(ids).ravel()
    places = np.asarray(_board(spec).getChessboardCorners(), np.float64)[order, :2]
    if len({float(x) for x in places[:, 0]}) < 3 or len({float(y) for y in places[:, 1]}) < 3:
        raise BoardError("only a strip of the board is seen: show three rows and three columns of it at least")
    return BoardView(np.asarray(corners, np.float64).reshape(-1, 2), places)


@cache
def _board(spec: BoardSpec) -> Any:
    needed = spec.columns * spec.rows // 2
    if needed > _MARKERS:
        raise BoardError(
            "a board of {a} x {b} squares needs {c} markers, and there are {count}: take fewer squares",
            a=spec.columns,
            b=spec.rows,
            c=needed,
            count=_MARKERS,
        )
    dictionary = cv2.aruco.getPredefinedDictionary(_DICTIONARY)
    return cv2.aruco.CharucoBoard((spec.columns, spec.rows), spec.square_mm, spec.marker_mm, dictionary)


@cache
def _detector(spec: BoardSpec) -> Any:
    return cv2.aruco.CharucoDetector(_board(spec))


_STEP_PX = 0.5
_CLICK_PX = 0.7
"""Standard error of a click, in pixels of the picture."""
_MIN_CLICK_PX = 40.0


class ScaleError(UserError):
    """The scale cannot be measured."""


def scale_of_board(views: Sequence[BoardView], size: tuple[int, int]) -> ScaleConfig:
    """The scale from undistorted pictures of a board that lies in the robot's plane. Raises ScaleError without a picture.

    The picture that shows the most of the board gives the plane; the uncertainty is that of its fit, or the disagreement with the
    other pictures if that is larger.
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

    Raises ScaleError: the length is not positive, or the places are too near to each other.
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
    """Millimetres per working pixel at the robot's head, if it was found; None without a scale for such pictures."""
    if scale is None or not scale.fits(scene.source_size):
        return None
    head = scene.to_source(scene.path.head) if scene.path is not None else None
    return mm_per_px_at(scale, head, scene.source_size) / scene.scale


def _local(plane: np.ndarray, at: Point) -> float:
    """Millimetres per pixel at a place: root of the area that a pixel covers."""
    here, right, down = (_mapped(plane, (at[0] + dx, at[1] + dy)) for dx, dy in ((0.0, 0.0), (_STEP_PX, 0.0), (0.0, _STEP_PX)))
    u, v = (right - here) / _STEP_PX, (down - here) / _STEP_PX
    return math.sqrt(abs(float(u[0] * v[1] - u[1] * v[0])))


def _mapped(plane: np.ndarray, point: Point) -> np.ndarray:
    mapped = plane @ np.array([point[0], point[1], 1.0])
    return np.asarray(mapped[:2] / mapped[2])


def _fit_error(view: BoardView, plane: np.ndarray) -> float:
    """Standard error of the scale from the residuals of the plane."""
    mapped = np.array([_mapped(plane, (float(x), float(y))) for x, y in view.pixels])
    left_mm = float(np.sqrt(np.mean(np.sum((mapped - view.board_mm) ** 2, axis=1))))
    spread_mm = float(np.sqrt(np.mean(np.sum((view.board_mm - view.board_mm.mean(axis=0)) ** 2, axis=1))))
    return left_mm / spread_mm / math.sqrt(len(view.pixels))
