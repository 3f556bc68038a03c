"""The printed board: a chessboard with markers in its white squares (ChArUco), known even where part of it is hidden."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.lens import BoardView
from core.errors import UserError
from core.types import Image

_MARKER_SHARE = 0.75
_MIN_CORNERS = 12
_DICTIONARY, _MARKERS = cv2.aruco.DICT_4X4_50, 50
"""All markers that there are; every white square of a board has one of its own."""


class BoardError(UserError):
    """The board is not in the picture, or too little of it; or there can be no such board."""


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
    """The board as a grey picture without margin, `pixels_per_square` (a multiple of 8) px a square: every module is whole px."""
    size = spec.columns * pixels_per_square, spec.rows * pixels_per_square
    return np.asarray(_board(spec).generateImage(size, marginSize=0, borderBits=1), np.uint8)


def find_board(image: Image, spec: BoardSpec) -> BoardView:
    """The board's inner corners in a picture (H, W, 3).

    Raises
    ------
    BoardError
        Fewer than twelve corners are seen, or all of them lie in a line.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) if image.ndim == 3 else image
    corners, ids, markers, _ = _detector(spec).detectBoard(grey)
    count = 0 if ids is None else len(ids)
    if count < _MIN_CORNERS:
        seen = 0 if markers is None else len(markers)
        why = f"{seen} of its markers and {count} of its {(spec.columns - 1) * (spec.rows - 1)} corners are seen"
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
            f"a board of {spec.columns} x {spec.rows} squares needs {needed} markers, and there are {_MARKERS}: take fewer squares"
        )
    dictionary = cv2.aruco.getPredefinedDictionary(_DICTIONARY)
    return cv2.aruco.CharucoBoard((spec.columns, spec.rows), spec.square_mm, spec.marker_mm, dictionary)


@cache
def _detector(spec: BoardSpec) -> Any:
    return cv2.aruco.CharucoDetector(_board(spec))
