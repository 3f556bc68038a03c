"""A scene of one straight tube."""

import numpy as np

from core.learning.scenes import BenchScene

RADIUS_PX = 14.0
"""Of the tube."""


def toy_scene(*, pictures: bool = False, size: tuple[int, int] = (96, 128)) -> BenchScene:
    """A tube from left to right in the middle with three robots in it; pictures are grey with a dark robot."""
    height, width = size
    middle = (height - 1) / 2
    away = np.abs(np.arange(height, dtype=np.float32) - np.float32(middle))[:, None].repeat(width, axis=1)
    lines = tuple(
        np.column_stack([np.linspace(-5, end, 40), np.full(40, middle + shift)]) for end, shift in ((70, 0), (90, 4), (110, -4))
    )
    rows, columns = np.mgrid[:height, :width]
    shown = []
    for line in lines[:2] if pictures else ():
        robot = (np.abs(rows - line[0, 1]) < 3) & (columns <= line[-1, 0])
        image = np.full((height, width, 3), 120, np.uint8)
        image[robot] = 20
        shown.append((image, robot))
    empty = np.full((height, width, 3), 120, np.uint8) if pictures else None
    return BenchScene(away - np.float32(RADIUS_PX), away / np.float32(RADIUS_PX), lines, 3.0, tuple(shown), empty)
