"""Effects of lens and sensor: blur, vignette, colour and tone, noise, compression. Prepared once per view."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.types import Image
from hardware.twin.rendering.appearance import Appearance

F32 = NDArray[np.float32]
Window = tuple[slice, slice]

_SIDE_PX = 640.0
_NOISE_SLACK = 48


class CameraEffects:
    """Turns scene colours (float32, 0..1) into an image; ``reach_px`` is the reach of its blur."""

    def __init__(self, appearance: Appearance, size: tuple[int, int], rng: Generator) -> None:
        self._appearance = appearance
        self._size = size
        scale = max(size) / _SIDE_PX
        self._sigma = appearance.blur_px * scale
        self._motion = _motion_kernel(appearance.motion_px * scale, appearance.motion_deg)
        self.reach_px = int(np.ceil(3 * self._sigma)) + self._motion.shape[0] // 2 + 1
        self._colour = _colour_matrix(appearance)
        self._tone = _tone_table(appearance)
        self._gain = _gain(appearance, size)
        self._noise = _noise_pool(appearance, size, rng)

    def expose(self, scene: F32, window: Window) -> Image:
        """The noise-free image of `scene` (h, w, 3), which lies at `window` of the whole picture."""
        seen = scene
        if self._sigma > 0.15:
            seen = np.asarray(cv2.GaussianBlur(seen, (0, 0), self._sigma, borderType=cv2.BORDER_REPLICATE), np.float32)
        if self._motion.shape[0] > 1:
            seen = np.asarray(cv2.filter2D(seen, -1, self._motion, borderType=cv2.BORDER_REPLICATE), np.float32)
        coloured = np.asarray(cv2.transform(seen, self._colour), np.float32)
        if self._gain is not None:
            coloured *= self._gain[window]
        levels = cv2.convertScaleAbs(np.maximum(coloured, 0), alpha=255.0)
        return np.asarray(cv2.LUT(levels, self._tone), np.uint8)

    def add_noise(self, image: Image, noise_seed: int) -> Image:
        """`image` with sensor noise (and compression) drawn by `noise_seed`."""
        noisy = image.copy()
        if self._noise is not None:
            height, width = image.shape[:2]
            draw = np.random.default_rng([noise_seed, 104729])
            y, x = (int(v) for v in draw.integers(0, _NOISE_SLACK, 2))
            cv2.add(image, self._noise[y : y + height, x : x + width], dst=noisy, dtype=cv2.CV_8U)
        if self._appearance.jpeg_quality:
            noisy = _recompressed(noisy, self._appearance.jpeg_quality)
        return noisy


def _recompressed(image: Image, quality: int) -> Image:
    """The image after JPEG; swapped red and blue change only the tint of the artefacts."""
    _, data = cv2.imencode(".jpg", image, [int(cv2.IMWRITE_JPEG_QUALITY), quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def _motion_kernel(length_px: float, direction_deg: float) -> F32:
    """A line of `length_px`, as a kernel of odd size."""
    half = int(np.ceil(length_px / 2))
    if length_px < 1:
        return np.ones((1, 1), np.float32)
    canvas = np.zeros((2 * half + 1, 2 * half + 1), np.uint8)
    step = np.array([np.cos(np.deg2rad(direction_deg)), np.sin(np.deg2rad(direction_deg))]) * length_px / 2
    ends = np.rint((half + np.array([-step, step])) * 256).astype(int)
    cv2.line(canvas, ends[0].tolist(), ends[1].tolist(), 255, 1, cv2.LINE_AA, 8)
    kernel = canvas.astype(np.float32)
    return np.asarray(kernel / kernel.sum(), np.float32)


def _colour_matrix(appearance: Appearance) -> F32:
    """Saturation, then white balance and exposure, as one 3x3 matrix."""
    luma = np.tile(np.array([0.299, 0.587, 0.114]), (3, 1))
    saturation = appearance.saturation * np.eye(3) + (1 - appearance.saturation) * luma
    gains = np.asarray(appearance.white_balance) * appearance.exposure
    if appearance.saturation == 0:
        gains = np.full(3, appearance.exposure)
    return np.asarray(np.diag(gains) @ saturation, np.float32)


def _tone_table(appearance: Appearance) -> NDArray[np.uint8]:
    levels = np.arange(256) / 255.0
    toned = np.clip(0.5 + appearance.contrast * (levels ** (1 / appearance.gamma) - 0.5), 0, 1)
    return np.asarray(np.rint(255 * toned), np.uint8)


def _gain(appearance: Appearance, size: tuple[int, int]) -> F32 | None:
    """Fall-off towards the corners, an X-ray collimator's rounded black frame, and lamps of two colours; (H, W, 1) or (H, W, 3)."""
    tinted = any(value != 1.0 for lamp in appearance.lamp_rgb for value in lamp)
    if not appearance.vignette and not appearance.collimator and not tinted:
        return None
    width, height = size
    x = np.linspace(-1, 1, width, dtype=np.float32)[None, :]
    y = np.linspace(-1, 1, height, dtype=np.float32)[:, None]
    gain = 1 - np.float32(appearance.vignette) * (x * x * width**2 + y * y * height**2) / np.float32(width**2 + height**2)
    if appearance.collimator:
        corner = np.maximum(np.maximum(np.abs(x), np.abs(y)), (np.abs(x) + np.abs(y)) / np.float32(1.75))
        gain *= np.clip((np.float32(appearance.collimator) - corner) * 40 + 1, 0.08, 1)
    if tinted:
        angle = np.deg2rad(appearance.light_deg)
        near = (0.5 + 0.5 * np.clip(1.2 * (x * np.float32(np.cos(angle)) + y * np.float32(np.sin(angle))), -1, 1))[..., None]
        lamp, other = (np.asarray(rgb, np.float32) for rgb in appearance.lamp_rgb)
        return np.asarray(gain[..., None] * (other + near * (lamp - other)), np.float32)
    return np.asarray(gain, np.float32)[..., None]


def _noise_pool(appearance: Appearance, size: tuple[int, int], rng: Generator) -> NDArray[np.int16] | None:
    """A field of noise larger than the picture; each frame uses another section, which is cheaper than drawing."""
    if not appearance.noise:
        return None
    shape = (size[1] + _NOISE_SLACK, size[0] + _NOISE_SLACK)
    if appearance.saturation == 0:
        grey = rng.standard_normal(shape, np.float32)
        noise = np.repeat(grey[..., None], 3, axis=2)
    else:
        noise = rng.standard_normal((*shape, 3), np.float32)
    grain = appearance.noise_grain_px * max(size) / _SIDE_PX
    if grain > 0.2:
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), grain), np.float32)
        noise /= max(float(noise[::4, ::4].std()), 1e-6)
    return np.asarray(np.rint(appearance.noise * noise), np.int16)
