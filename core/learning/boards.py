"""Random pictures of what benches lie on: plain, wood, cloth, grids, stains, skin, photographs, print, metal; and cables over them.

Painted pictures are float32 (3, h, w), RGB of 0..1: with planes first NumPy spreads a mask (h, w) over the colours at full speed.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

F32 = NDArray[np.float32]
Size = tuple[int, int]
"""Height and width of a picture in px."""

_PHOTOGRAPHS = (
    *("astronaut.png", "brick.png", "camera.png", "cell.png", "chelsea.png", "coffee.png", "coins.png", "grass.png", "gravel.png"),
    *("hubble_deep_field.jpg", "ihc.png", "logo.png", "moon.png", "motorcycle_left.png", "retina.jpg", "rocket.jpg", "text.png"),
)
"""Files in scikit-image's package."""
_KNOTS_PER_CELL = 8
"""Noise is interpolated to so many values a cell before it is turned: OpenCV turns with 32 steps between two values."""


def random_color(rng: Generator, saturation: float | None = None) -> F32:
    """A colour (3, 1, 1), 0..1: of any hue and brightness, often nearly grey."""
    value = rng.uniform(0.03, 0.97)
    saturation = float(rng.beta(0.8, 2.0)) if saturation is None else saturation
    return as_color(colorsys.hsv_to_rgb(rng.random(), saturation, value))


def as_color(levels: tuple[float, float, float]) -> F32:
    """RGB levels 0..1 as (3, 1, 1)."""
    return np.array(levels, np.float32).reshape(3, 1, 1)


def smooth_noise(
    rng: Generator, size: Size, cells: float, sigma: float = 1.0, *, across: float = 1.0, angle_deg: float = 0.0, colors: int = 0
) -> F32:
    """Normal noise (h, w), or (colors, h, w), of `cells` cells a side along a direction and `across` times so many across it."""
    height, width = size
    down, right = max(2, round(cells)), max(2, round(cells * across))
    if angle_deg == 0.0:
        planes = [_cells(rng, sigma, (down, right), size) for _ in range(max(1, colors))]
    else:
        side = int(np.hypot(height, width)) + 2
        knots = min(side, _KNOTS_PER_CELL * down), min(side, _KNOTS_PER_CELL * right)
        turn = np.asarray(cv2.getRotationMatrix2D((width / 2, height / 2), angle_deg, 1.0), np.float64)
        turn[:, 2] += (side - width) / 2, (side - height) / 2
        turn *= np.array([[knots[1] / side], [knots[0] / side]])
        turn[:, 2] -= 0.5
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        coarse = [_cells(rng, sigma, (down, right), knots) for _ in range(max(1, colors))]
        planes = [
            np.asarray(cv2.warpAffine(plane, turn, (width, height), flags=flags, borderMode=cv2.BORDER_REFLECT), np.float32)
            for plane in coarse
        ]
    return np.asarray(np.stack(planes) if colors else planes[0], np.float32)


def _cells(rng: Generator, sigma: float, cells: Size, size: Size) -> F32:
    coarse = rng.standard_normal(cells, np.float32) * np.float32(sigma)
    return np.asarray(cv2.resize(coarse, size[::-1], interpolation=cv2.INTER_CUBIC), np.float32)


def ramp(size: Size, angle_deg: float) -> F32:
    """Distance (h, w) in px along a direction, which is across the grain of ``smooth_noise`` with this angle."""
    angle = np.deg2rad(angle_deg)
    rows = np.arange(size[0], dtype=np.float32)[:, None] * np.float32(np.sin(angle))
    return np.asarray(rows + np.arange(size[1], dtype=np.float32) * np.float32(np.cos(angle)))


def lay_over(picture: F32, cover: F32, color: F32 | float) -> None:
    """Cover `picture` in place: `cover` (h, w), 0..1, with a colour (3, 1, 1), a picture, or one level."""
    picture *= 1 - cover
    picture += cover * color


def stroke(size: Size, points_px: NDArray[np.floating], width_px: float) -> F32:
    """A line through (N, 2) points x, y, with smooth edges, as (h, w) of 0..1."""
    mask = np.zeros(size, np.uint8)
    cv2.polylines(mask, [_fixed(points_px)], False, 255, max(1, round(width_px)), cv2.LINE_AA, 4)
    return mask * np.float32(1 / 255)


def _fixed(points_px: NDArray[np.floating]) -> NDArray[np.int32]:
    """Points for OpenCV's drawing with four binary places."""
    return np.asarray(np.rint(points_px * 16), np.int32).reshape(-1, 1, 2)


def filled(size: Size, corners_px: NDArray[np.floating], rim_px: int = 0) -> F32:
    """A polygon (N, 2) as (h, w) of 0..1; with `rim_px` its outline alone."""
    mask = np.zeros(size, np.uint8)
    if rim_px:
        cv2.polylines(mask, [_fixed(corners_px)], True, 255, rim_px, cv2.LINE_AA, 4)
    else:
        cv2.fillPoly(mask, [_fixed(corners_px)], 255, cv2.LINE_AA, 4)
    return mask * np.float32(1 / 255)


def random_curve(rng: Generator, size: Size, knots: int = 6, wild_px: float = 60.0) -> F32:
    """Points (N, 2) of a smooth curve, half of them across the whole picture; steps between knots vary by `wild_px`."""
    sides = np.array(size[::-1], np.float64)
    if rng.random() < 0.5:
        begin, end = rng.uniform(-0.1, 1.1, (2, 2)) * sides
        along = (end - begin) / max(1e-6, float(np.linalg.norm(end - begin))) * max(size) * 0.9
        points = (begin + end) / 2 + np.linspace(-1, 1, knots)[:, None] * along + rng.normal(0, 0.4 * wild_px, (knots, 2))
    else:
        points = np.cumsum(rng.normal(0, wild_px, (knots, 2)), axis=0) + rng.random(2) * sides
    smooth = cv2.resize(points.astype(np.float32).reshape(knots, 1, 2), (1, 24 * knots), interpolation=cv2.INTER_CUBIC)
    return np.asarray(smooth, np.float32).reshape(-1, 2)


def lay_cable(rng: Generator, picture: F32) -> None:
    """A cable or wire over `picture`, in place; some with a shadow and a bright line along them."""
    size = picture.shape[1], picture.shape[2]
    points, width, color = random_curve(rng, size), float(rng.uniform(2, 14)), random_color(rng)
    if rng.random() < 0.6:
        shadow = stroke(size, points + rng.normal(0, 5, 2), width)
        picture *= 1 - float(rng.uniform(0.1, 0.5)) * cv2.GaussianBlur(shadow, (0, 0), float(rng.uniform(1, 5)))
    lay_over(picture, stroke(size, points, width), color)
    if rng.random() < 0.5 and width > 4:
        shine = stroke(size, points + rng.normal(0, 0.2 * width, 2), 0.2 * width)
        lay_over(picture, shine * np.float32(rng.uniform(0.2, 0.6)), 1.0)


def paint_board(rng: Generator, size: Size, kind: str | None = None) -> F32:
    """A board (3, h, w), 0..1; `kind` is a key of ``BOARDS``, or drawn with their shares."""
    if kind is None:
        kind = str(rng.choice(list(BOARDS), p=[share for share, _ in BOARDS.values()]))
    color = random_color(rng)
    picture = np.empty((3, *size), np.float32)
    picture[:] = color
    BOARDS[kind][1](rng, picture, color)
    if rng.random() < 0.5:
        picture += smooth_noise(rng, size, rng.uniform(2, 6), rng.uniform(0.01, 0.08))
    if rng.random() < 0.4:
        picture *= 1 + smooth_noise(rng, size, rng.uniform(40, 128), rng.uniform(0.01, 0.06))
    return np.clip(picture, 0, 1, out=picture)


def _plain(rng: Generator, picture: F32, color: F32) -> None:
    pass


def _wood(rng: Generator, picture: F32, color: F32) -> None:
    """Grain of two sizes between two tones; some boards with seams along it."""
    size, angle = picture.shape[1:], float(rng.uniform(0.1, 180))
    grain = smooth_noise(rng, size, rng.uniform(2, 4), across=rng.uniform(8, 30), angle_deg=angle)
    grain += smooth_noise(rng, size, 4, 0.5, across=rng.uniform(30, 80), angle_deg=angle)
    lay_over(picture, np.asarray(1 / (1 + np.exp(-2 * grain)), np.float32), color * np.float32(rng.uniform(0.5, 0.9)))
    if rng.random() < 0.6:
        beside = (ramp(size, angle) + float(rng.uniform(0, 99))) % float(rng.uniform(50, 140))
        picture *= np.where(beside < float(rng.uniform(0.6, 1.8)), np.float32(rng.uniform(0.5, 0.85)), np.float32(1))


def _cloth(rng: Generator, picture: F32, color: F32) -> None:
    """Folds lit from one side; half of the cloths with a weave."""
    size = picture.shape[1:]
    height = smooth_noise(rng, size, rng.uniform(2, 5), across=rng.uniform(0.5, 2), angle_deg=rng.uniform(0.1, 180))
    # Blurred, or slopes would show the steps of OpenCV's interpolation.
    height = np.abs(cv2.blur(height, (7, 7))) ** np.float32(rng.uniform(0.5, 1.2))
    angle = float(rng.uniform(0, 2 * np.pi))
    slope = cv2.Sobel(height, cv2.CV_32F, 1, 0) * float(np.cos(angle)) + cv2.Sobel(height, cv2.CV_32F, 0, 1) * float(np.sin(angle))
    slope /= slope.std() + 1e-6
    picture *= 1 + float(rng.uniform(0.05, 0.25)) * np.clip(slope, -2.5, 2.5)
    if rng.random() < 0.5:
        pitch, turn = 2 * np.pi / float(rng.uniform(2, 6)), float(rng.uniform(0, 180))
        weave = np.sin(ramp(size, turn) * np.float32(pitch)) * np.sin(ramp(size, turn + 90) * np.float32(pitch))
        picture *= 1 + float(rng.uniform(0.02, 0.12)) * weave


def _grid(rng: Generator, picture: F32, color: F32) -> None:
    """Ruled lines in one or two directions; some with every second field tinted."""
    size, other = picture.shape[1:], random_color(rng)
    pitch, width, angle = float(rng.uniform(10, 60)), float(rng.uniform(0.5, 2.0)), float(rng.uniform(0, 180))
    along, across = ramp(size, angle), ramp(size, angle + 90)
    away = np.abs(along % pitch - pitch / 2)
    if rng.random() < 0.7:
        np.minimum(away, np.abs(across % pitch - pitch / 2), out=away)
    lay_over(picture, np.clip(width - away + 0.5, 0, 1) * np.float32(rng.uniform(0.2, 0.9)), other)
    if rng.random() < 0.2:
        odd = (np.floor_divide(along, pitch) + np.floor_divide(across, pitch)) % 2 != 0
        lay_over(picture, odd * np.float32(0.5), other)


def _stains(rng: Generator, picture: F32, color: F32) -> None:
    """Noise of four sizes, in colours or not."""
    colors = 3 if rng.random() < 0.6 else 0
    for cells in (3, 8, 24, 64):
        picture += smooth_noise(rng, picture.shape[1:], cells, rng.uniform(0.01, 0.12), colors=colors)


def _skin(rng: Generator, picture: F32, color: F32) -> None:
    """Skin tones with blotches, veins and pores."""
    size = picture.shape[1:]
    tone = colorsys.hsv_to_rgb(rng.uniform(0.01, 0.09), rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.95))
    picture[:] = as_color(tone)
    picture += smooth_noise(rng, size, rng.uniform(4, 10), rng.uniform(0.01, 0.04)) * as_color((0.4, 1.0, 1.0))
    for _ in range(int(rng.integers(0, 4))):
        vein = cv2.GaussianBlur(stroke(size, random_curve(rng, size, wild_px=40), rng.uniform(2, 8)), (0, 0), rng.uniform(1, 3))
        picture -= vein * as_color((1.0, 0.7, 0.4)) * np.float32(rng.uniform(0.02, 0.12))
    picture *= 1 + smooth_noise(rng, size, rng.uniform(60, 128), rng.uniform(0.01, 0.06))


def _photograph(rng: Generator, picture: F32, color: F32) -> None:
    """A part of a photograph, half of them out of focus, dimmed, and tinted with the board's colour."""
    some = photographs()
    if not some:
        return _stains(rng, picture, color)
    whole, (height, width) = some[int(rng.integers(len(some)))], picture.shape[1:]
    scale = float(rng.uniform(0.6, 2.5))
    rows, columns = int(min(whole.shape[0], height * scale)), int(min(whole.shape[1], width * scale))
    top, left = int(rng.integers(whole.shape[0] - rows + 1)), int(rng.integers(whole.shape[1] - columns + 1))
    part = cv2.resize(whole[top : top + rows, left : left + columns], (width, height), interpolation=cv2.INTER_AREA)
    if rng.random() < 0.5:
        part = cv2.GaussianBlur(part, (0, 0), float(rng.uniform(0.5, 5)))
    tint = color * np.float32(rng.uniform(0, 0.3))
    np.multiply(part.transpose(2, 0, 1), np.float32(rng.uniform(0.4, 1) / 255), out=picture)
    picture += tint


@cache
def photographs() -> tuple[NDArray[np.uint8], ...]:
    """The photographs (H, W, 3) RGB that scikit-image ships; none where they were left out of the installation."""
    import skimage

    folder = Path(skimage.__file__).parent / "data"
    images = (cv2.imread(str(folder / name), cv2.IMREAD_COLOR) for name in _PHOTOGRAPHS if (folder / name).is_file())
    return tuple(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8) for image in images if image is not None)


def _print(rng: Generator, picture: F32, color: F32) -> None:
    """Letters, lines, discs and circles."""
    height, width = size = picture.shape[1:]
    for _ in range(int(rng.integers(1, 12))):
        mask, (x, y) = np.zeros(size, np.uint8), (int(rng.integers(width)), int(rng.integers(height)))
        kind = rng.random()
        if kind < 0.5:
            text, font = "".join(rng.choice(list("abcXYZ0123 -"), 8)), int(rng.integers(0, 4))
            cv2.putText(mask, text, (x - 40, y), font, rng.uniform(0.3, 1.4), 255, int(rng.integers(1, 3)), cv2.LINE_AA)
        elif kind < 0.75:
            end = int(rng.integers(width)), int(rng.integers(height))
            cv2.line(mask, (x, y), end, 255, int(rng.integers(1, 4)), cv2.LINE_AA)
        else:
            cv2.circle(mask, (x, y), int(rng.integers(4, 60)), 255, int(rng.choice([-1, 1, 2])), cv2.LINE_AA)
        lay_over(picture, mask * np.float32(1 / 255), random_color(rng))


def _brushed(rng: Generator, picture: F32, color: F32) -> None:
    """Metal with fine strokes in one direction."""
    size = picture.shape[1:]
    across = size[1] / 4
    picture *= 1 + smooth_noise(rng, size, 3, rng.uniform(0.02, 0.1), across=across, angle_deg=rng.uniform(0.1, 180))


BOARDS: dict[str, tuple[float, Callable[[Generator, F32, F32], None]]] = {
    "plain": (0.19, _plain),
    "wood": (0.15, _wood),
    "cloth": (0.15, _cloth),
    "grid": (0.10, _grid),
    "stains": (0.11, _stains),
    "skin": (0.04, _skin),
    "photograph": (0.10, _photograph),
    "print": (0.08, _print),
    "brushed": (0.08, _brushed),
}
"""Share of the boards of each kind, and what paints it into a picture of one colour."""
