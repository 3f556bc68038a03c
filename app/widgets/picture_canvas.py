"""A picture that is looked at closely: zoom at the wheel, moved by hand, drawn as sharply as the screen can show it."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QResizeEvent, QWheelEvent
from PySide6.QtWidgets import QWidget

from app.palette import ON_PICTURE
from app.picture_view import PictureView, render
from core.types import Image, Point

_WHEEL_FACTOR = 1.2
_CLOSE_UP = 5.0


class PictureCanvas(QWidget):
    """Shows the visible part of an image; who draws on it takes ``levels`` and ``view`` and calls ``paint_picture`` first."""

    def __init__(self) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setCursor(Qt.CursorShape.CrossCursor)
        self._levels: tuple[Image, ...] = ()
        self._view = PictureView((1, 1), (1, 1), 1.0, (0.0, 0.0))
        self._picture: QImage | None = None
        self._light = (1.0, 0.0)
        self._pan_from: QPointF | None = None
        self._is_pannable = False

    @property
    def view(self) -> PictureView:
        return self._view

    @property
    def levels(self) -> tuple[Image, ...]:
        """The image and its halvings; none: nothing is shown."""
        return self._levels

    @property
    def light(self) -> tuple[float, float]:
        """Contrast and brightness."""
        return self._light

    @property
    def is_panning(self) -> bool:
        return self._pan_from is not None

    @property
    def is_pannable(self) -> bool:
        """Whether a key is held with which any click moves the picture."""
        return self._is_pannable

    def show_levels(self, levels: tuple[Image, ...]) -> None:
        """Another image, the whole of it; none: nothing."""
        if levels:
            size = levels[0].shape[1], levels[0].shape[0]
            self._view = PictureView.fitted(size, self._room)
        self._levels = levels
        self._pan_from = None
        self._renew_picture()

    def set_light(self, contrast: float, brightness: float) -> None:
        """How greys are shown; the image itself is not changed."""
        self._light = (contrast, brightness)
        self._renew_picture()

    def fit(self) -> None:
        """The whole image."""
        self._set_view(PictureView.fitted(self._view.size, self._view.room))

    def zoom_at(self, factor: float, at: Point) -> None:
        """Zoom by a factor; the widget's place `at` stays over the same place of the image."""
        self._set_view(self._view.zoomed(factor, at))

    def close_up_at(self, middle: Point) -> None:
        """A place of the image several times as large; once more: the whole image."""
        whole = PictureView.fitted(self._view.size, self._view.room)
        near = replace(whole, zoom=whole.zoom * _CLOSE_UP, center=middle).inside()
        self._set_view(whole if self._view == near else near)

    def see(self, point: Point) -> None:
        """Bring a place of the image into sight."""
        if not self._view.shows(point, 20.0):
            self._set_view(replace(self._view, center=point).inside())

    # ---- moved by hand

    def begin_pan(self, position: QPointF) -> None:
        self._pan_from = position

    def pan_to(self, position: QPointF) -> None:
        if self._pan_from is not None:
            step = position - self._pan_from
            self._pan_from = position
            self._renew_cursor()  # only now: a click may mean something else
            self._set_view(self._view.panned(step.x(), step.y()))

    def end_pan(self) -> None:
        self._pan_from = None
        self._renew_cursor()

    def set_pannable(self, on: bool) -> None:
        self._is_pannable = on
        self._renew_cursor()

    def wheelEvent(self, event: QWheelEvent) -> None:
        turns = event.angleDelta().y() / 120.0
        if turns and self._levels:
            self.zoom_at(_WHEEL_FACTOR**turns, (event.position().x(), event.position().y()))
        event.accept()

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._view = self._view.in_room(self._room)
        self._renew_picture()

    # ---- painting

    def paint_picture(self, painter: QPainter) -> bool:
        """The visible part, or a dark ground and False where there is no image."""
        if not self._levels:
            painter.fillRect(self.rect(), QColor(ON_PICTURE.INK))
            return False
        ratio = self.devicePixelRatioF()
        if self._picture is None or self._picture.devicePixelRatio() != ratio:  # also on a screen of another density
            self._picture = render(self._levels, self._view, ratio, *self._light)
        painter.drawImage(QPointF(0, 0), self._picture)
        return True

    @property
    def _room(self) -> tuple[int, int]:
        return max(1, self.width()), max(1, self.height())

    def _set_view(self, view: PictureView) -> None:
        if view != self._view:
            self._view = view
            self._renew_picture()

    def _renew_picture(self) -> None:
        self._picture = None
        self.update()

    def _renew_cursor(self) -> None:
        if self._pan_from is not None:
            self.setCursor(Qt.CursorShape.ClosedHandCursor)
        else:
            self.setCursor(Qt.CursorShape.OpenHandCursor if self._is_pannable else Qt.CursorShape.CrossCursor)
