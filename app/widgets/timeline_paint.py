"""Pieces that the timeline is painted of: bands of colour, curves, strokes for crowded rows, and the marks of events."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen, QPolygonF

from app import palette
from app.session_marks import Shape


def paint_band(painter: QPainter, lane: QRectF, values: NDArray[np.int64], colours: Sequence[QColor], nothing: QColor) -> None:
    """One colour a pixel: -1 is "none of them", -2 no row at all."""
    table = np.array([0, nothing.rgba(), *(colour.rgba() for colour in colours)], np.uint32)
    pixels = np.ascontiguousarray(table[values + 2])
    image = QImage(pixels.data, len(pixels), 1, 4 * len(pixels), QImage.Format.Format_ARGB32)
    painter.drawImage(lane, image)


def curves(xs: NDArray[np.float64], ys: NDArray[np.float64], gap: NDArray[np.bool_]) -> list[list[QPointF]]:
    """Lines through what is known."""
    known = np.isfinite(ys)
    breaks = np.flatnonzero((known[1:] != known[:-1]) | gap[1:]) + 1
    parts = (part for part in np.split(np.arange(len(xs)), breaks) if len(part) and known[part[0]])
    return [[QPointF(x, y) for x, y in zip(xs[part].tolist(), ys[part].tolist(), strict=True)] for part in parts]


def extents(xs: NDArray[np.float64], ys: NDArray[np.float64]) -> list[QLineF]:
    """Lowest to highest value of every pixel, so that no peak is lost; neighbours touch."""
    columns = np.floor(xs).astype(np.int64)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(columns)) + 1])
    low, high = np.fmin.reduceat(ys, edges), np.fmax.reduceat(ys, edges)
    at = columns[edges]
    beside = np.flatnonzero(np.diff(at) == 1)
    touching_low, touching_high = low.copy(), high.copy()
    touching_low[beside + 1] = np.fmin(low[beside + 1], high[beside])
    touching_high[beside + 1] = np.fmax(high[beside + 1], low[beside])
    kept = np.isfinite(low)
    ends = zip(at[kept].tolist(), touching_low[kept].tolist(), touching_high[kept].tolist(), strict=True)
    return [QLineF(x + 0.5, first - 0.5, x + 0.5, last + 0.5) for x, first, last in ends]


def paint_mark(painter: QPainter, middle: QPointF, shape: Shape, colour_name: str) -> None:
    """The mark of a kind of event, 12 px high."""
    colour = QColor(colour_name)
    is_hollow = shape in (Shape.HOLLOW_TRIANGLE, Shape.RING, Shape.CROSS)
    painter.setPen(QPen(colour, 1.8) if is_hollow else QPen(QColor(palette.PANEL), 1))
    painter.setBrush(Qt.BrushStyle.NoBrush if is_hollow else colour)
    x, y = middle.x(), middle.y()
    if shape in (Shape.TRIANGLE, Shape.HOLLOW_TRIANGLE):
        painter.drawPolygon(QPolygonF([QPointF(x, y - 6), QPointF(x + 6, y + 5), QPointF(x - 6, y + 5)]))
    elif shape is Shape.DIAMOND:
        painter.drawPolygon(QPolygonF([QPointF(x, y - 6.5), QPointF(x + 6.5, y), QPointF(x, y + 6.5), QPointF(x - 6.5, y)]))
    elif shape is Shape.SQUARE:
        painter.drawRect(QRectF(x - 4.5, y - 4.5, 9, 9))
    elif shape is Shape.RING:
        painter.drawEllipse(middle, 4.5, 4.5)
    elif shape is Shape.CROSS:
        painter.drawLine(QPointF(x - 4, y - 4), QPointF(x + 4, y + 4))
        painter.drawLine(QPointF(x - 4, y + 4), QPointF(x + 4, y - 4))
    else:  # a flag on its staff
        painter.setPen(QPen(colour, 1.6))
        painter.drawLine(QPointF(x, y - 7), QPointF(x, y + 7))
        painter.drawPolygon(QPolygonF([QPointF(x, y - 6.5), QPointF(x + 8, y - 3), QPointF(x, y + 0.5)]))
