"""The loupe of the annotator: what lies under the cursor, magnified, in the corner that is least in the way."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPen

from app import theme
from app.annotation_hand import Drawing
from app.palette import ON_PICTURE
from app.picture_view import PictureView, render
from app.widgets.annotation_paint import draw
from core.types import Image, Point

_SIDE = 210
_ZOOM = 4.0
_ZOOM_RANGE = (4.0, 40.0)
_NEAR_PX = 40.0


class AnnotationLoupe:
    """Paints itself onto the canvas. It changes its corner only when the cursor or the drawn lines come near."""

    def __init__(self) -> None:
        self._corner = 0

    def paint(
        self,
        painter: QPainter,
        levels: tuple[Image, ...],
        view: PictureView,
        drawing: Drawing,
        focus: Point,
        light: tuple[float, float],
    ) -> None:
        """Magnify the surroundings of `focus`, a place of the image."""
        width, height = view.room
        side = min(_SIDE, width // 3, height // 2)
        keep_clear = [focus, *drawing.annotation.robot, *drawing.annotation.vessel]
        frame = self._place(side, view.room, [view.to_screen(point) for point in keep_clear])
        ratio = painter.device().devicePixelRatioF()
        zoom = min(max(_ZOOM * view.zoom, _ZOOM_RANGE[0]), _ZOOM_RANGE[1])
        inner = PictureView(view.size, (side, side), zoom, focus)
        glass = QPainterPath()
        glass.addRoundedRect(frame, theme.RADIUS, theme.RADIUS)
        painter.save()
        painter.setClipPath(glass)
        painter.drawImage(frame.topLeft(), render(levels[:1], inner, ratio, *light))
        shift = inner.transform
        shift.setMatrix(shift.m11(), 0, 0, 0, shift.m22(), 0, shift.dx() + frame.left(), shift.dy() + frame.top(), 1)
        draw(painter, shift, drawing, 0, is_loupe=True)
        paint_cross(painter, frame.center(), 14.0)
        painter.restore()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(ON_PICTURE.TEXT), 2))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRoundedRect(frame, theme.RADIUS, theme.RADIUS)

    def _place(self, side: int, room: tuple[int, int], keep_clear: Iterable[Point]) -> QRectF:
        frames = [QRectF(x, y, side, side) for y in (10, room[1] - side - 10) for x in (room[0] - side - 10, 10)]
        points = list(keep_clear)
        gaps = [min(_gap(frame, point) for point in points) for frame in frames]
        if gaps[self._corner] < _NEAR_PX:
            # the cursor counts for more than the lines: never below it
            self._corner = int(
                np.argmax([min(_gap(frame, points[0]), 200.0) + gap for frame, gap in zip(frames, gaps, strict=True)])
            )
        return frames[self._corner]


def _gap(frame: QRectF, point: Point) -> float:
    """Distance of a point to a rectangle, 0 inside."""
    dx = max(frame.left() - point[0], 0.0, point[0] - frame.right())
    dy = max(frame.top() - point[1], 0.0, point[1] - frame.bottom())
    return float(np.hypot(dx, dy))


def paint_cross(painter: QPainter, at: QPointF, reach: float) -> None:
    """A cross with an open middle."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    for name, width in ((ON_PICTURE.INK, 3.0), (ON_PICTURE.TEXT, 1.2)):
        painter.setPen(QPen(QColor(name), width))
        for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            painter.drawLine(at + QPointF(x, y) * 3.0, at + QPointF(x, y) * reach)
