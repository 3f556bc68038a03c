"""A magnifying glass over the robot's head, in a corner of the live view: 40-px vectors are too small for two metres."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QImage, QMouseEvent, QPainter, QPainterPath, QPaintEvent, QPen, QTransform
from PySide6.QtWidgets import QWidget

from app import theme
from app.language import tr
from app.palette import ON_PICTURE
from app.widgets.loupe_corner import LoupeCorner
from app.widgets.marks_label import MarksLabel
from app.widgets.overlays import Marks
from app.widgets.pencil import on_screen
from core.types import Image, Point, Scene

_SPAN_PX = 110.0
_SHARE_OF_VIEW = 0.36
_ASPECT = 0.75
_LABEL_PX = (11, 16)
_WIDTH_PER_LABEL_PX = 13  # two labels have room beside each other
_CORNERS = ((1, 0), (0, 0), (1, 1), (0, 1))


class HeadLoupe(QWidget):
    """Shows about 110 working pixels around the head with the same marks as the live view.

    ``clicked`` carries the place that was clicked in it, in source pixels: what it hides of the picture is not meant. It stays in
    a corner in which it hides little, and leaves it when the head comes near.
    """

    clicked = Signal(float, float)

    def __init__(self, parent: QWidget, marks: Marks) -> None:
        super().__init__(parent)
        self._parent = parent
        self._marks = marks
        self._image: QImage | None = None
        self._pixels: Image | None = None
        self._to_widget = QTransform()
        self._corner = LoupeCorner()
        self._drawn = MarksLabel(self)
        self._drawn.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAccessibleName(tr("Magnified head"))
        self.hide()

    def show_head(
        self, image: Image, scene: Scene, head_in_view: QPointF, to_view: QTransform, covers: Sequence[QRectF] = ()
    ) -> None:
        """Magnify the surroundings of the head.

        `head_in_view` is where it is on the parent widget, `to_view` leads there; `covers` are what lies over the loupe.
        """
        middle = _middle(scene)
        if middle is None:
            self.hide()
            return
        self._place(head_in_view, to_view, covers)
        span = _SPAN_PX / scene.scale
        zoom = self.width() / span
        left, top = middle[0] + 0.5 - span / 2, middle[1] + 0.5 - self.height() / zoom / 2
        self._cut(image, left, top, span, self.height() / zoom)
        self._to_widget = QTransform(zoom, 0.0, 0.0, zoom, -left * zoom, -top * zoom)
        self._drawn.setGeometry(self.rect())
        least, most = _LABEL_PX
        label_px = max(least, min(self.width() // _WIDTH_PER_LABEL_PX, most))
        self._drawn.record(self._marks, self._to_widget, label_px, self._glass(3.0))
        self.show()
        self.update()

    def _cut(self, image: Image, left: float, top: float, width: float, height: float) -> None:
        """Keep a copy of the part that is visible, with its place in the source."""
        x0, y0 = max(0, int(left) - 1), max(0, int(top) - 1)
        x1, y1 = min(image.shape[1], int(left + width) + 2), min(image.shape[0], int(top + height) + 2)
        part = np.ascontiguousarray(image[y0 : max(y1, y0 + 1), x0 : max(x1, x0 + 1)])
        self._pixels = np.asarray(cv2.cvtColor(part, cv2.COLOR_RGB2BGRA), np.uint8)
        rows, columns = part.shape[:2]
        self._image = QImage(self._pixels.data, columns, rows, 4 * columns, QImage.Format.Format_RGB32)
        self._image.setOffset(QPointF(x0, y0).toPoint())

    def _place(self, head: QPointF, to_view: QTransform, covers: Sequence[QRectF]) -> None:
        room = self._parent.rect()
        width = int(_SHARE_OF_VIEW * min(room.width(), room.height() / _ASPECT))
        corners = [self._rect(k, (width, int(width * _ASPECT))) for k in range(len(_CORNERS))]
        places, weights = self._marks.places()
        corner = self._corner.choose(corners, head, on_screen(places, to_view), weights, covers)
        self.setGeometry(corners[corner].toRect())

    def _rect(self, corner: int, size: tuple[int, int]) -> QRectF:
        right, bottom = _CORNERS[corner]
        room = self._parent.rect()
        return QRectF(
            room.width() - size[0] - 10 if right else 10, room.height() - size[1] - 10 if bottom else 10, size[0], size[1]
        )

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() is not Qt.MouseButton.LeftButton:
            super().mousePressEvent(event)
            return
        place = self._to_widget.inverted()[0].map(event.position())
        self.clicked.emit(place.x() - 0.5, place.y() - 0.5)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """One place is meant, and the first half has told it."""
        event.accept()

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._image is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        glass = self._glass(1.0)
        painter.fillPath(glass, QColor(ON_PICTURE.INK))
        painter.save()
        painter.setClipPath(glass)
        painter.setWorldTransform(self._to_widget)
        painter.drawImage(self._image.offset(), self._image)
        painter.restore()
        painter.setPen(QPen(QColor(ON_PICTURE.TEXT), 2))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawPath(glass)
        painter.end()

    def _glass(self, inset: float) -> QPainterPath:
        glass = QPainterPath()
        glass.addRoundedRect(QRectF(self.rect()).adjusted(inset, inset, -inset, -inset), theme.RADIUS, theme.RADIUS)
        return glass


def _middle(scene: Scene) -> Point | None:
    """Between both vectors, or the head when there is no pose; source pixels."""
    if scene.robot_vector is not None and scene.vessel_vector is not None:
        (ax, ay), (bx, by) = scene.robot_vector.center, scene.vessel_vector.center
        return scene.to_source(((ax + bx) / 2, (ay + by) / 2))
    return scene.to_source(scene.path.head) if scene.path is not None else None
