"""Draws marks and texts on a picture with OpenCV."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from app import palette
from app.palette import ON_PICTURE
from core.config import RESOURCES
from core.types import Image, Point, Points, Vector

SHIFT = 4
"""Bits of sub-pixel places that OpenCV draws at: 1/16 px."""


def to_fixed(outline: Points) -> NDArray[np.int32]:
    """A polyline (N, 2) as OpenCV takes it for sub-pixel drawing."""
    return np.round(outline * (1 << SHIFT)).astype(np.int32).reshape(-1, 1, 2)


class Brush:
    """Draws marks at source-pixel places on the enlarged picture; widths are pixels of a picture 1280 px wide."""

    def __init__(self, canvas: Image, zoom: float, origin: Point, unit: float) -> None:
        self._canvas = canvas
        self._zoom = zoom
        self._origin = np.array(origin)
        self._unit = unit
        self._labels: list[Points] = []

    @property
    def unit(self) -> float:
        return self._unit

    def _at(self, points: Points | list[Point]) -> Points:
        return np.asarray((np.asarray(points, np.float64) + 0.5 - self._origin) * self._zoom - 0.5)

    def _width(self, width: float) -> int:
        return max(1, round(width * self._unit))

    def _lines(self, lines: list[Points], name: str, width: float, *, closed: bool = False) -> None:
        """Polylines given in canvas pixels, first a dark edge, then the colour."""
        fixed = [to_fixed(line) for line in lines]
        for colour, extra in ((palette.rgb(ON_PICTURE.INK), 2.0), (palette.rgb(name), 0.0)):
            cv2.polylines(self._canvas, fixed, closed, colour, self._width(width + extra), cv2.LINE_AA, SHIFT)

    def _fill(self, outline: Points, name: str) -> None:
        fixed = to_fixed(outline)
        cv2.fillPoly(self._canvas, [fixed], palette.rgb(name), cv2.LINE_AA, SHIFT)
        cv2.polylines(self._canvas, [fixed], True, palette.rgb(ON_PICTURE.INK), self._width(1.0), cv2.LINE_AA, SHIFT)

    def polylines(self, lines: tuple[Points, ...], name: str, width: float) -> None:
        drawn = [self._at(line) for line in lines if len(line) > 1]
        if drawn:
            self._lines(drawn, name, width)

    def dashes(self, first: Point, second: Point, name: str, width: float) -> None:
        start, end = self._at([first, second])
        count = max(1, int(np.linalg.norm(end - start) / (8.0 * self._unit)))
        stops = np.linspace(start, end, 2 * count + 1)
        self._lines([stops[k : k + 2] for k in range(0, 2 * count, 2)], name, width)

    def arrow(self, vector: Vector, name: str, width: float) -> None:
        start, end = self._at([vector.start, vector.end])
        along = np.asarray(vector.direction) * self._unit
        across = np.array([-along[1], along[0]])
        self._lines([np.array([start, end])], name, width)
        self._fill(np.array([end + along * 14, end - along * 6 + across * 10, end - along * 6 - across * 10]), name)

    def ring(self, point: Point, name: str, radius: float) -> None:
        turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        (middle,) = self._at([point])
        circle = np.column_stack([np.cos(turn), np.sin(turn)])
        self._lines([middle + circle * radius * self._unit], name, 3.0, closed=True)
        self._fill(middle + circle * 2.5 * self._unit, name)

    def diamond(self, point: Point, name: str, radius: float) -> None:
        (middle,) = self._at([point])
        self._fill(middle + np.array([(0, -1), (1, 0), (0, 1), (-1, 0)]) * radius * self._unit, name)

    def line(self, first: Point, second: Point, name: str, width: float) -> None:
        self._lines([self._at([first, second])], name, width)

    def angle(self, corner: Point, unit_arc: Points, name: str) -> None:
        """The arc from the vessel's direction to the robot's, with the vessel's direction as a thin line through the corner."""
        (middle,) = self._at([corner])
        arc = middle + unit_arc * 70.0 * self._unit
        self._lines([np.array([middle, middle + (arc[0] - middle) * 1.3])], ON_PICTURE.VESSEL_VECTOR, 1.5)
        self._lines([arc], name, 2.5)

    def label_beside(self, point: Point, line: Vector, side: float, text: str, name: str) -> None:
        """A text beside `point`, on one side of `line` (+1: to the right of its direction)."""
        across = np.array([-line.direction[1], line.direction[0]]) * side
        width = text_width(text, "SemiBold", round(20 * self._unit)) + 20 * self._unit
        reach = 22.0 * self._unit + abs(across[0]) * width / 2 + abs(across[1]) * 15.0 * self._unit
        (middle,) = self._at([point])
        middle = middle + across * reach
        gap = np.array([width, 32.0 * self._unit])
        if any((np.abs(middle - other) < gap).all() for other in self._labels):
            middle = middle + across * 32.0 * self._unit
        self._labels.append(middle)
        self._label(middle, text, name)

    def frame(self, origin: Points, size: Point) -> None:
        """A thin rectangle from `origin`, source pixels."""
        corners = origin + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * np.array(size)
        self._lines([self._at(corners)], ON_PICTURE.TEXT, 1.5, closed=True)

    def paste(self, inset: Image, left: int, top: int) -> None:
        """Put a picture into a corner, with a frame."""
        height, width = inset.shape[:2]
        edge = self._width(3.0)
        cv2.rectangle(inset, (0, 0), (width - 1, height - 1), palette.rgb(ON_PICTURE.INK), edge + 2)
        cv2.rectangle(inset, (1, 1), (width - 2, height - 2), palette.rgb(ON_PICTURE.TEXT), edge - 1)
        self._canvas[top : top + height, left : left + width] = inset

    def stamp(self, text: str) -> None:
        self._label(np.array([44.0, self._canvas.shape[0] / self._unit - 30.0]) * self._unit, text, ON_PICTURE.SIM)

    def _label(self, middle: Points, text: str, name: str) -> None:
        """A text on a dark plate around `middle`, moved inside the picture."""
        size = round(20 * self._unit)
        width, height = text_width(text, "SemiBold", size) + size, round(1.5 * size)
        x = float(np.clip(middle[0] - width / 2, 2, max(2, self._canvas.shape[1] - width - 2)))
        y = float(np.clip(middle[1] - height / 2, 2, max(2, self._canvas.shape[0] - height - 2)))
        left, top = round(x), round(y)
        plate = self._canvas[top : top + height, left : left + width]
        plate[:] = (plate * 0.25 + np.array(palette.rgb(ON_PICTURE.INK)) * 0.75).astype(np.uint8)
        put_text(self._canvas, text, (left + size // 2, top + round(1.1 * size)), name, "SemiBold", size)


@cache
def _face(weight: str) -> cv2.FontFace:
    """The program's font, or OpenCV's own when the file is missing."""
    face = cv2.FontFace("sans")
    path = RESOURCES / "fonts" / f"Inter-{weight}.otf"
    if path.is_file():
        face.set(str(path))
    return face


def put_text(canvas: Image, text: str, left_baseline: tuple[int, int], name: str, weight: str, size: int) -> None:
    cv2.putText(canvas, text, left_baseline, palette.rgb(name), _face(weight), max(size, 6), 0)


def text_width(text: str, weight: str, size: int) -> int:
    _, _, width, _ = cv2.getTextSize((8192, 512), text, (0, 256), _face(weight), max(size, 6))
    return int(width)


def fitting_size(text: str, weight: str, size: int, width: int) -> int:
    """The largest size up to `size` at which `text` fits."""
    while size > 8 and text_width(text, weight, size) > width:
        size -= 1
    return size
