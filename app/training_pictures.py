"""Pictures of a held-out frame: what the network finds, over it the outlines of what was drawn by hand."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from app import palette
from core.learning.dataset import write_png
from core.learning.held_out import HeldOut, HeldOutFrame
from core.types import Image, Mask

SHOWN = 4
"""Held-out frames of which pictures are made."""
_OPACITY = 0.45


def draw_found(frame: HeldOutFrame) -> Image:
    """Found masks as colours (vessel, then robot), true ones as lines, RGB at working size."""
    colours = palette.ON_PICTURE
    picture = frame.image.astype(np.float32)
    for mask, name in ((frame.vessel, colours.VESSEL), (frame.robot, colours.ROBOT)):
        picture[mask] = (1 - _OPACITY) * picture[mask] + _OPACITY * np.array(palette.rgb(name), np.float32)
    drawn = np.ascontiguousarray(np.clip(picture, 0, 255).astype(np.uint8))
    for mask, name in ((frame.true_vessel, colours.VESSEL_VECTOR), (frame.true_robot, colours.ROBOT_VECTOR)):
        cv2.drawContours(drawn, _outlines(mask), -1, palette.rgb(name), 1, cv2.LINE_AA)
    return drawn


def _outlines(mask: Mask) -> list[np.ndarray]:
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return list(found)


def write_pictures(held_out: HeldOut, folder: Path, when: str) -> list[str]:
    """``<stem>_<when>.png`` of the first frames; returns the paths. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for frame in held_out.frames[:SHOWN]:
        path = folder / f"{frame.stem}_{when}.png"
        write_png(path, draw_found(frame))  # as a whole: the window may be reading the older one
        paths.append(str(path))
    return paths
