"""Pictures of the printed calibration board in the twin, with the true corners."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import default_rng

from core.calibration.camera import BoardSpec, board_bitmap
from core.config.models import TwinConfig
from core.types import Image, Points
from hardware.twin.phantom import BOARD_MM
from hardware.twin.phantoms import make_phantom
from hardware.twin.rendering.appearance import appearance_of, make_view
from hardware.twin.rendering.background import light_field, paint_board
from hardware.twin.rendering.camera_effects import CameraEffects
from hardware.twin.view import CameraView

_SUPERSAMPLE = 2
_PX_PER_SQUARE, _MARGIN_PX = 64, 28
"""Of the print and of its white margin."""
_PAPER, _TONER = 0.93, 0.09


_PLACEMENTS = ((0.5, 0.5, 2.0), (0.4, 0.42, -4.0), (0.6, 0.42, 5.0), (0.4, 0.58, 184.0), (0.6, 0.58, -3.0))
"""Middle of the board in shares of the picture's width and height, and its rotation in degrees."""


class BoardPictures:
    """The board under the twin's camera with its view, light, lens and noise; deterministic."""

    def __init__(self, config: TwinConfig, spec: BoardSpec) -> None:
        self._spec = spec
        appearance = appearance_of(config)
        size = (config.image_width_px, config.image_height_px)
        self.view = make_view(appearance, size, make_phantom(config.phantom))
        self._middles_mm = self.view.unproject(np.array([(x * (size[0] - 1), y * (size[1] - 1)) for x, y, _ in _PLACEMENTS]))
        rng = default_rng([config.appearance_seed, 811])
        shift = (_SUPERSAMPLE - 1) / 2  # pixel centres at integers, before and after
        magnify = np.array([[_SUPERSAMPLE, 0.0, shift], [0.0, _SUPERSAMPLE, shift], [0.0, 0.0, 1.0]])
        # Several samples per pixel, so that edges of the print have no stairs.
        fine = CameraView(magnify @ self.view.homography, (size[0] * _SUPERSAMPLE, size[1] * _SUPERSAMPLE))
        self._grid_mm = CameraView(fine.homography, fine.size, self.view.distortion).grid_mm()
        coarse = self.view.grid_mm().astype(np.float32)
        scale = self.view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
        self._under = paint_board(appearance, coarse, scale, rng)
        self._light = light_field(appearance, coarse, rng)
        self._camera = CameraEffects(appearance, size, rng)
        self._print = _printed(spec)

    def picture(self, index: int, noise_seed: int = 0) -> Image:
        """The picture with the board at placement `index` (modulo their number)."""
        spot = self._print_coordinates(index)
        paper = cv2.remap(self._print, *spot, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        rows, columns = self._print.shape
        covered = (spot[0] > -0.5) & (spot[0] < columns - 0.5) & (spot[1] > -0.5) & (spot[1] < rows - 0.5)
        alpha, ink = _coarse(covered.astype(np.float32)), _coarse(np.where(covered, paper, np.float32(0.0)))
        scene = (self._under * (1 - alpha[..., None]) + ink[..., None]) * self._light[..., None]
        height, width = alpha.shape
        whole = slice(0, height), slice(0, width)
        return self._camera.add_noise(self._camera.expose(scene.astype(np.float32), whole), noise_seed)

    def corners_px(self, index: int) -> Points:
        """The true inner corners of the board, row by row, in the picture (N, 2)."""
        x, y = np.meshgrid(np.arange(1, self._spec.columns), np.arange(1, self._spec.rows))
        on_sheet = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64) * self._spec.square_mm
        middle_mm, rotation = self._placement(index)
        return self.view.project((on_sheet - np.array(self._spec.size_mm) / 2) @ rotation.T + middle_mm)

    def _placement(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Middle of the printed board on the twin's board in mm, and its rotation matrix."""
        index %= len(_PLACEMENTS)
        angle = np.deg2rad(_PLACEMENTS[index][2])
        return self._middles_mm[index], np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def _print_coordinates(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Position in the print, in its px, of every fine pixel."""
        middle_mm, rotation = self._placement(index)
        on_sheet = (self._grid_mm - middle_mm) @ rotation + np.array(self._spec.size_mm) / 2
        places = (on_sheet / self._spec.square_mm * _PX_PER_SQUARE + _MARGIN_PX - 0.5).astype(np.float32)
        return np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])


def _coarse(fine: np.ndarray) -> np.ndarray:
    """The mean of every pixel's samples."""
    height, width = (side // _SUPERSAMPLE for side in fine.shape)
    return np.asarray(fine.reshape(height, _SUPERSAMPLE, width, _SUPERSAMPLE).mean(axis=(1, 3)))


def _printed(spec: BoardSpec) -> np.ndarray:
    """The sheet with its white margin, brightness 0..1 as float32."""
    ink = board_bitmap(spec, _PX_PER_SQUARE).astype(np.float32) / 255.0
    sheet = np.pad(ink, _MARGIN_PX, constant_values=1.0)
    return np.asarray(_TONER + (_PAPER - _TONER) * sheet, np.float32)
