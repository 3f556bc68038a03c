"""The printed board laid into the twin, under the twin's own camera: what a calibration sees there, with the truth known."""

from __future__ import annotations

from dataclasses import dataclass

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
"""Of the print, which has a white margin."""
_PAPER, _TONER = 0.93, 0.09


@dataclass(frozen=True, slots=True)
class Placement:
    """Where the middle of the printed board lies on the twin's board, and how it is turned."""

    middle_mm: tuple[float, float]
    turn_deg: float


def placements(view: CameraView) -> tuple[Placement, ...]:
    """Five ways to lay the board: in the middle of the picture, and towards its four corners."""
    width, height = view.size
    shares = ((0.5, 0.5, 2.0), (0.4, 0.42, -4.0), (0.6, 0.42, 5.0), (0.4, 0.58, 184.0), (0.6, 0.58, -3.0))
    places = view.unproject(np.array([(x * (width - 1), y * (height - 1)) for x, y, _ in shares]))
    return tuple(Placement((float(x), float(y)), turn) for (x, y), (_, _, turn) in zip(places, shares, strict=True))


class BoardPictures:
    """The board before the twin's camera: the same view, light, lens and noise; deterministic."""

    def __init__(self, config: TwinConfig, spec: BoardSpec) -> None:
        self._spec = spec
        appearance = appearance_of(config)
        size = (config.image_width_px, config.image_height_px)
        self.view = make_view(appearance, size, make_phantom(config.phantom))
        self.placements = placements(self.view)
        rng = default_rng([config.appearance_seed, 811])
        # several samples a pixel: an edge of the print is as soft as the lens makes it, not a staircase
        fine = CameraView(_magnified(_SUPERSAMPLE) @ self.view.homography, (size[0] * _SUPERSAMPLE, size[1] * _SUPERSAMPLE))
        self._grid_mm = CameraView(fine.homography, fine.size, self.view.distortion).grid_mm()
        coarse = self.view.grid_mm().astype(np.float32)
        scale = self.view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
        self._under = paint_board(appearance, coarse, scale, rng)
        self._light = light_field(appearance, coarse, rng)
        self._camera = CameraEffects(appearance, size, rng)
        self._print = _printed(spec)

    def picture(self, index: int, noise_seed: int = 0) -> Image:
        """The picture with the board laid in the `index`-th way (they repeat)."""
        placement = self.placements[index % len(self.placements)]
        spot = self._sheet_places(placement)
        paper = cv2.remap(self._print, *spot, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        rows, columns = self._print.shape
        covered = (spot[0] > -0.5) & (spot[0] < columns - 0.5) & (spot[1] > -0.5) & (spot[1] < rows - 0.5)
        alpha, ink = _coarse(covered.astype(np.float32)), _coarse(np.where(covered, paper, np.float32(0.0)))
        scene = (self._under * (1 - alpha[..., None]) + ink[..., None]) * self._light[..., None]
        height, width = alpha.shape
        whole = slice(0, height), slice(0, width)
        return self._camera.add_noise(self._camera.expose(scene.astype(np.float32), whole), noise_seed)

    def corners_px(self, index: int) -> Points:
        """The truth: the board's inner corners, row by row, in the picture (N, 2)."""
        x, y = np.meshgrid(np.arange(1, self._spec.columns), np.arange(1, self._spec.rows))
        on_sheet = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64) * self._spec.square_mm
        return self.view.project(self._on_board(self.placements[index % len(self.placements)], on_sheet))

    def _on_board(self, placement: Placement, on_sheet_mm: Points) -> Points:
        angle = np.deg2rad(placement.turn_deg)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return np.asarray((on_sheet_mm - np.array(self._spec.size_mm) / 2) @ turn.T + placement.middle_mm)

    def _sheet_places(self, placement: Placement) -> tuple[np.ndarray, np.ndarray]:
        """For every fine pixel its place in the print, in px of the print."""
        angle = np.deg2rad(placement.turn_deg)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        on_sheet = (self._grid_mm - placement.middle_mm) @ turn + np.array(self._spec.size_mm) / 2
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


def _magnified(factor: int) -> np.ndarray:
    """Pixel centres at integers, before and after."""
    shift = (factor - 1) / 2
    return np.array([[factor, 0.0, shift], [0.0, factor, shift], [0.0, 0.0, 1.0]])
