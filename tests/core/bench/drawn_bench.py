"""A drawn bench for the tests: a board with discs, a tube across it, and a robot in the tube."""

import cv2
import numpy as np

from core.types import Image, Mask

SIZE = (320, 240)


def board(seed: int = 1, y: int = 120, discs: int = 25) -> Image:
    """A board with discs and a bright tube across it, which leaves the picture 10 px lower than it enters it."""
    rng = np.random.default_rng(seed)
    picture = np.full((SIZE[1], SIZE[0], 3), (150, 120, 90), np.uint8)
    for _ in range(discs):
        x, y0 = rng.integers(10, SIZE[0] - 10), rng.integers(10, SIZE[1] - 10)
        cv2.circle(picture, (int(x), int(y0)), int(rng.integers(3, 9)), [int(c) for c in rng.integers(30, 220, 3)], cv2.FILLED)
    cv2.line(picture, (0, y), (SIZE[0], y + 10), (200, 190, 180), 30)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.7), np.uint8)


def tube(y: int = 120) -> Mask:
    """Its lumen."""
    drawn = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    cv2.line(drawn, (0, y), (SIZE[0], y + 10), 1, 30)
    return drawn > 0


def noisy(picture: Image, sigma: float, seed: int, gain: float = 1.0) -> Image:
    noise = np.random.default_rng(seed).normal(0.0, sigma, picture.shape)
    return np.clip(np.rint(picture * gain + noise), 0, 255).astype(np.uint8)


def with_line(
    picture: Image, start: tuple[int, int], end: tuple[int, int], color: tuple[int, int, int] = (20, 20, 20), width: int = 7
) -> Image:
    return np.asarray(cv2.line(picture.copy(), start, end, color, width), np.uint8)
