"""The board and the table under the phantom: colour, texture, uneven light. Helpers for anti-aliased drawing in 1/16 px."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.types import GraphEdge, Points
from hardware.twin.phantom import BOARD_MM, Phantom
from hardware.twin.rendering.appearance import Appearance

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]
Level = tuple[int, int, int]

_SHIFT = 4  # binary digits after the point of cv2's fixed-point coordinates
_TABLE_MARGIN_MM = 6.0


def _fixed_point(points: Points) -> NDArray[np.int32]:
    return np.rint(np.clip(points, -4000, 12000) * (1 << _SHIFT)).astype(np.int32)


def stroke(canvas: U8, points: Points, colour: Level | int, width_px: float) -> None:
    """A polyline (N, 2) in px, `width_px` wide."""
    cv2.polylines(canvas, [_fixed_point(points)], False, colour, max(1, round(width_px)), cv2.LINE_AA, _SHIFT)


def fill(canvas: U8, points: Points, colour: Level | int) -> None:
    """A filled polygon (N, 2) in px."""
    cv2.fillPoly(canvas, [_fixed_point(points)], colour, cv2.LINE_AA, _SHIFT)


def level(rgb: tuple[float, float, float] | NDArray[np.float64], gain: float = 1.0) -> Level:
    """A colour in 0..1 as 8-bit levels."""
    r, g, b = (int(np.clip(255 * gain * value, 0, 255)) for value in rgb)
    return r, g, b


def random_edge(phantom: Phantom, rng: Generator) -> GraphEdge:
    """An edge of the phantom, long ones more often."""
    lengths = np.array([len(edge.points) for edge in phantom.graph.edges], float)
    return phantom.graph.edges[int(rng.choice(len(lengths), p=lengths / lengths.sum()))]


def normals(points: Points) -> Points:
    """Unit normals (N, 2) along a polyline."""
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    return np.column_stack([-tangent[:, 1], tangent[:, 0]])


def smooth_noise(rng: Generator, shape: tuple[int, int], cell_px: float) -> F32:
    """Soft random field of `shape` (H, W) in about -1..1, with features of `cell_px`."""
    height, width = shape
    # Two samples per feature, blurred: with one sample per feature its lattice would be visible.
    step = max(1.0, 0.4 * cell_px)
    coarse = rng.standard_normal((int(height / step) + 8, int(width / step) + 8), np.float32)
    coarse = np.asarray(cv2.GaussianBlur(coarse, (0, 0), 0.4 * cell_px / step)[3:-3, 3:-3], np.float32)
    coarse *= np.float32(0.45 / max(float(coarse.std()), 1e-6))
    return np.asarray(np.clip(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), -1, 1), np.float32)


def paint_board(appearance: Appearance, grid_mm: F32, pixels_per_mm: float, rng: Generator) -> F32:
    """Board with texture on a table, shape (H, W, 3), float32 in 0..1, before any light falls on it unevenly."""
    shape = grid_mm.shape[:2]
    board = np.empty((*shape, 3), np.float32)
    board[:] = np.asarray(appearance.board_rgb, np.float32)
    board += (_texture(appearance, grid_mm, pixels_per_mm, rng) * np.float32(0.25 * appearance.texture_strength))[..., None]
    if appearance.board_texture == "patches":
        _paint_patches(board, appearance, pixels_per_mm, rng)
    if appearance.material == "xray":
        return np.clip(board, 0, 1)
    # Around the board lies the table, behind a thin dark line and a soft shadow.
    outside = np.maximum(
        np.abs(grid_mm[..., 0] - np.float32(BOARD_MM[0] / 2)) - np.float32(BOARD_MM[0] / 2 + _TABLE_MARGIN_MM),
        np.abs(grid_mm[..., 1] - np.float32(BOARD_MM[1] / 2)) - np.float32(BOARD_MM[1] / 2 + _TABLE_MARGIN_MM),
    )
    if float(outside.max()) > 0:
        share = np.clip(outside * np.float32(pixels_per_mm) + np.float32(0.5), 0, 1)[..., None]
        table = np.asarray(appearance.table_rgb, np.float32) * (1 + 0.12 * smooth_noise(rng, shape, 5 * pixels_per_mm))[..., None]
        table *= (1 - 0.5 * np.exp(-np.maximum(outside, 0) / np.float32(2.5)))[..., None]
        board = board * (1 - share) + table * share
    return np.clip(board, 0, 1)


def light_field(appearance: Appearance, grid_mm: F32, rng: Generator) -> F32:
    """Uneven lamp light, (H, W), about 1: brighter towards the lamp, with one soft random stain of light."""
    angle = np.deg2rad(appearance.light_deg)
    along = (grid_mm[..., 0] - np.float32(BOARD_MM[0] / 2)) * np.float32(np.cos(angle) / 100)
    along += (grid_mm[..., 1] - np.float32(BOARD_MM[1] / 2)) * np.float32(np.sin(angle) / 100)
    soft = smooth_noise(rng, grid_mm.shape[:2], grid_mm.shape[1] / 2.5)
    light = np.clip(1 + np.float32(appearance.light_gradient) * (0.6 * along + 0.4 * soft), 0.3, 1.7)
    if appearance.caustics:
        light *= 1 + np.float32(appearance.caustics) * _caustics(grid_mm.shape[:2], grid_mm.shape[1] / 640, rng)
    return np.asarray(light, np.float32)


def _caustics(shape: tuple[int, int], scale: float, rng: Generator) -> F32:
    """Light through rippling water on the ground, in about -0.3..1, (H, W)."""
    lines = np.zeros(shape, np.float32)
    for cell in (70.0, 38.0):
        lines += np.clip(1 - 3.5 * np.abs(smooth_noise(rng, shape, cell * scale)), 0, 1) ** 2
    return np.asarray(np.clip(0.7 * lines - 0.3, -0.3, 1), np.float32)


def _paint_patches(board: F32, appearance: Appearance, pixels_per_mm: float, rng: Generator) -> None:
    """A printed picture on the board: patches of other colours with outlines, as in drawings of organs."""
    shape = board.shape[:2]
    for _ in range(int(rng.integers(2, 7))):
        field = smooth_noise(rng, shape, rng.uniform(18, 70) * pixels_per_mm) - np.float32(rng.uniform(-0.1, 0.45))
        colour = np.clip(np.asarray(appearance.board_rgb) + rng.normal(0, 0.28, 3), 0, 1).astype(np.float32)
        amount = np.clip(field * np.float32(30 * rng.uniform(0.3, 1.5)) + np.float32(0.5), 0, 1)
        board += (amount * np.float32(rng.uniform(0.4, 1.0)))[..., None] * (colour - board)
        outline = np.exp(-((field * np.float32(rng.uniform(20, 60))) ** 2)) * np.float32(rng.uniform(0.0, 0.6))
        board *= (1 - outline)[..., None]


def _texture(appearance: Appearance, grid_mm: F32, pixels_per_mm: float, rng: Generator) -> F32:
    """Texture in about -1..1, (H, W)."""
    shape, kind = grid_mm.shape[:2], appearance.board_texture
    if appearance.material == "xray":
        return _tissue(grid_mm, shape, pixels_per_mm, rng)
    if kind == "speckle":
        return 0.5 * smooth_noise(rng, shape, 1.2 * pixels_per_mm) + 0.5 * smooth_noise(rng, shape, 12 * pixels_per_mm)
    if kind == "wood":
        bend = 3.0 * smooth_noise(rng, shape, 30 * pixels_per_mm)
        rings = np.sin(np.float32(1.1) * (grid_mm[..., 1] + bend) + 2 * smooth_noise(rng, shape, 14 * pixels_per_mm))
        return np.asarray(0.6 * rings + 0.4 * _streaks(rng, shape, pixels_per_mm), np.float32)
    if kind == "grid":
        step = np.float32(rng.choice([5.0, 10.0, 12.7]))
        cell = np.minimum(np.abs((grid_mm / step + np.float32(0.5)) % 1 - np.float32(0.5)).min(axis=2) * step, 1)
        sign = -1.0 if np.mean(appearance.board_rgb) > 0.4 else 1.0
        return np.asarray(sign * 1.4 * np.clip(1.3 - cell * np.float32(min(pixels_per_mm, 4.0)) * 1.2, 0, 1), np.float32)
    if kind == "brushed":
        return _streaks(rng, shape, pixels_per_mm)
    if kind == "cloth":
        weave = np.sin(grid_mm[..., 0] * np.float32(4.0)) * np.sin(grid_mm[..., 1] * np.float32(4.0))
        return np.asarray(0.4 * weave + 0.5 * smooth_noise(rng, shape, 25 * pixels_per_mm), np.float32)
    if kind == "folds":
        return _folds(grid_mm, shape, pixels_per_mm, rng)
    if kind == "layers":
        height = 14 * smooth_noise(rng, shape, 35 * pixels_per_mm) + grid_mm @ rng.normal(0, 0.5, 2).astype(np.float32)
        return np.asarray(np.sin(height * np.float32(2 * np.pi / rng.uniform(1.2, 3.0))), np.float32)
    return 0.15 * smooth_noise(rng, shape, 30 * pixels_per_mm)


def _folds(grid_mm: F32, shape: tuple[int, int], pixels_per_mm: float, rng: Generator) -> F32:
    """Creases of a loose cloth, lit from one side, and its weave."""
    shade = 0.25 * smooth_noise(rng, shape, 1.0 * pixels_per_mm)
    for _ in range(int(rng.integers(2, 5))):
        angle, pitch = rng.uniform(0, np.pi), rng.uniform(30, 110)
        across = grid_mm[..., 0] * np.float32(np.cos(angle)) + grid_mm[..., 1] * np.float32(np.sin(angle))
        crease = np.sin((across + 12 * smooth_noise(rng, shape, 45 * pixels_per_mm)) * np.float32(2 * np.pi / pitch))
        shade += np.float32(rng.uniform(0.4, 1.0)) * np.sign(crease) * np.exp(-4 * np.abs(crease))
    return np.asarray(np.clip(cv2.GaussianBlur(shade, (0, 0), max(0.6, 0.5 * pixels_per_mm)), -1.5, 1.5), np.float32)


def _streaks(rng: Generator, shape: tuple[int, int], pixels_per_mm: float) -> F32:
    """Fine lines along the board's length: brushed metal, printed layers, grain."""
    height, width = shape
    coarse = rng.standard_normal((max(3, int(height / (0.5 * pixels_per_mm))), max(3, width // 60)), np.float32)
    return np.asarray(np.clip(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR) * 0.6, -1, 1), np.float32)


def _tissue(grid_mm: F32, shape: tuple[int, int], pixels_per_mm: float, rng: Generator) -> F32:
    """Soft tissue and a few bone-like bands under X-rays."""
    field = 0.6 * smooth_noise(rng, shape, 40 * pixels_per_mm) + 0.3 * smooth_noise(rng, shape, 9 * pixels_per_mm)
    for _ in range(int(rng.integers(0, 4))):
        angle, place, wide = rng.uniform(0, np.pi), rng.uniform(-60, 60), rng.uniform(4, 16)
        across = (grid_mm[..., 0] - 100) * np.float32(np.cos(angle)) + (grid_mm[..., 1] - 75) * np.float32(np.sin(angle))
        beyond = np.clip((np.abs(across - np.float32(place)) - np.float32(wide)) * np.float32(1.5), -30, 30)
        field -= np.float32(rng.uniform(0.15, 0.5)) / (1 + np.exp(beyond))
    return np.asarray(field, np.float32)
