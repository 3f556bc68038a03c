"""Bulky foreign things beside the vessel: boxes of equipment, and hands, bare or gloved."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator

from hardware.twin.drawing import U8, fill, stroke
from hardware.twin.lumen_field import LumenField
from hardware.twin.phantom import BOARD_MM
from hardware.twin.view import View

_SKIN_AND_GLOVES = ((225, 180, 150), (190, 135, 105), (120, 80, 60), (90, 130, 200), (120, 100, 190), (235, 235, 230), (50, 55, 60))


def cast_shadow(canvas: U8, mask: U8, strength: float, blur_px: float) -> None:
    """Darken `canvas` (H, W, 3) where `mask` (H, W, 0..255) is set, with soft edges."""
    x, y, width, height = cv2.boundingRect(mask)
    pad = int(3 * blur_px) + 1
    window = slice(max(y - pad, 0), y + height + pad), slice(max(x - pad, 0), x + width + pad)
    if width and height:
        soft = cv2.GaussianBlur(mask[window], (0, 0), max(0.8, blur_px)).astype(np.float32)
        canvas[window] = (canvas[window] * (1 - np.float32(strength / 255) * soft)[..., None]).astype(np.uint8)


def place_object(canvas: U8, view: View, field: LumenField, rng: Generator) -> None:
    """Paint one object with its shadow on `canvas` (H, W, 3) where it covers no lumen; where there is no room, nothing."""
    for _ in range(6):
        mask = np.zeros(canvas.shape[:2], np.uint8)
        if rng.random() < 0.6:
            _box(mask, view, rng)
            colour = np.full(3, rng.choice([rng.uniform(10, 70), rng.uniform(120, 245)])) + rng.uniform(-12, 12, 3)
        else:
            _hand(mask, view, rng)
            colour = np.asarray(_SKIN_AND_GLOVES[int(rng.integers(len(_SKIN_AND_GLOVES)))], float)
        if mask.any() and not np.any((mask > 0) & (field.distance_mm < field.reach_mm - 1)):
            break
    else:
        return
    scale = view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
    cast_shadow(canvas, mask, 0.5, 1.5 * scale)
    # Rounded by its own blurred outline: darker towards the rim.
    height = cv2.GaussianBlur(mask, (0, 0), 2.5 * scale).astype(np.float32) / np.float32(255)
    alpha = mask.astype(np.float32)[..., None] / 255
    painted = colour.astype(np.float32) * (0.5 + 0.55 * height)[..., None]
    canvas[:] = np.clip(canvas * (1 - alpha) + painted * alpha, 0, 255).astype(np.uint8)


def _box(mask: U8, view: View, rng: Generator) -> None:
    """A rectangle, more often near the rim of the board than in its middle."""
    side, angle = rng.uniform(8, 45, 2), rng.normal(0, 0.3)
    place = rng.uniform((-10, -10), np.array(BOARD_MM) + 10)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * side / 2 @ turn + place
    fill(mask, view.project(corners), 255)


def _hand(mask: U8, view: View, rng: Generator) -> None:
    """A palm at the rim of the picture with fingers that point inwards."""
    width, height = view.size
    scale = view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
    root = rng.uniform((0, 0), (width, height))
    axis = int(rng.integers(2))
    root[axis] = view.size[axis] * int(rng.integers(2))
    inward = np.array([width / 2, height / 2]) - root
    aim = np.arctan2(inward[1], inward[0]) + rng.normal(0, 0.5)
    palm = root - 12 * scale * np.array([np.cos(aim), np.sin(aim)])
    cv2.circle(mask, (int(palm[0]), int(palm[1])), int(26 * scale), 255, -1, cv2.LINE_AA)
    for finger in range(int(rng.integers(1, 5))):
        direction = aim + (finger - 1.5) * 0.3
        knuckle = palm + 22 * scale * np.array([np.cos(direction), np.sin(direction)])
        bend = direction + rng.normal(0, 0.3)
        middle = knuckle + rng.uniform(12, 22) * scale * np.array([np.cos(direction), np.sin(direction)])
        tip = middle + rng.uniform(10, 20) * scale * np.array([np.cos(bend), np.sin(bend)])
        stroke(mask, np.array([knuckle, middle, tip]), 255, 13 * scale)
