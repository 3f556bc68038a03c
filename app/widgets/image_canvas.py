"""An image of any size with zoom, panning, contrast and brightness; only its visible part is rendered."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QResizeEvent, QTransform, QWheelEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QSlider, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.ui.theme import ON_PICTURE
from core.types import Image, Point

_ZOOM_MAX = 40.0
_MARGIN_PX = 60.0  # around the image, which may be in view
_LARGE_PIXEL = 1 / 3  # image pixels per screen pixel
_WHEEL_FACTOR = 1.2
_CLOSE_UP = 5.0


@dataclass(frozen=True, slots=True)
class Viewport:
    """``zoom`` screen pixels per image pixel; the image point ``center`` lies in the middle of a widget of ``room``."""

    size: tuple[int, int]
    room: tuple[int, int]
    zoom: float
    center: Point

    @classmethod
    def fitted(cls, size: tuple[int, int], room: tuple[int, int]) -> Viewport:
        """The whole image."""
        zoom = min(room[0] / size[0], room[1] / size[1])
        return cls(size, room, max(zoom, 1e-3), ((size[0] - 1) / 2, (size[1] - 1) / 2))

    @property
    def is_fitted(self) -> bool:
        return self.zoom <= Viewport.fitted(self.size, self.room).zoom * 1.0001

    @property
    def transform(self) -> QTransform:
        """From the picture (pixel (0, 0) covers 0..1) to the widget."""
        left, top = (self.room[axis] / 2 - (self.center[axis] + 0.5) * self.zoom for axis in (0, 1))
        return QTransform(self.zoom, 0.0, 0.0, self.zoom, left, top)

    def to_image(self, x: float, y: float) -> Point:
        """The place of the image, pixel centres at integers, under a place of the widget."""
        return (x - self.room[0] / 2) / self.zoom + self.center[0], (y - self.room[1] / 2) / self.zoom + self.center[1]

    def to_screen(self, point: Point) -> Point:
        return (
            (point[0] - self.center[0]) * self.zoom + self.room[0] / 2,
            (point[1] - self.center[1]) * self.zoom + self.room[1] / 2,
        )

    def zoomed(self, factor: float, at: Point) -> Viewport:
        """Larger or smaller, with the widget's place `at` over the same place of the image."""
        least = Viewport.fitted(self.size, self.room).zoom
        zoom = min(max(self.zoom * factor, least), max(_ZOOM_MAX, least))
        if zoom <= least * 1.0001:
            return Viewport.fitted(self.size, self.room)
        fixed = self.to_image(*at)
        x, y = (fixed[axis] - (at[axis] - self.room[axis] / 2) / zoom for axis in (0, 1))
        return replace(self, zoom=zoom, center=(x, y)).inside()

    def panned(self, dx: float, dy: float) -> Viewport:
        return replace(self, center=(self.center[0] - dx / self.zoom, self.center[1] - dy / self.zoom)).inside()

    def in_room(self, room: tuple[int, int]) -> Viewport:
        """The same in a widget of another size."""
        return Viewport.fitted(self.size, room) if self.is_fitted else replace(self, room=room).inside()

    def inside(self) -> Viewport:
        """Moved so far that the image does not leave the widget."""
        center = []
        for value, size, room in zip(self.center, self.size, self.room, strict=True):
            middle, slack = (size - 1) / 2, (size - room / self.zoom) / 2
            reach = max(0.0, slack + _MARGIN_PX / self.zoom)
            center.append(min(max(value, middle - reach), middle + reach))
        return replace(self, center=(center[0], center[1]))

    def shows(self, point: Point, margin_px: float) -> bool:
        """Whether a place of the image lies in the widget, at least `margin_px` from its border."""
        x, y = self.to_screen(point)
        return margin_px <= x <= self.room[0] - margin_px and margin_px <= y <= self.room[1] - margin_px


def halvings(image: Image) -> tuple[Image, ...]:
    """The image and its halves, quarters, ... down to about 1000 px, for quick and clean pictures of the whole."""
    levels = [image]
    while max(levels[-1].shape[:2]) > 2000:
        height, width = levels[-1].shape[:2]
        half = (width + 1) // 2, (height + 1) // 2
        levels.append(np.asarray(cv2.resize(levels[-1], half, interpolation=cv2.INTER_AREA), np.uint8))
    return tuple(levels)


def render(levels: tuple[Image, ...], view: Viewport, ratio: float, contrast: float, brightness: float) -> QImage:
    """The visible part as it lies in the widget.

    Parameters
    ----------
    levels : the image and its halvings.
    view : where it lies; `ratio` device pixels per widget pixel.
    contrast, brightness : grey g becomes ``(g - 128) * contrast + 128 + brightness``.
    """
    level = 0
    while level + 1 < len(levels) and view.zoom * ratio * 2 ** (level + 1) <= 1.0:
        level += 1
    image = levels[level]
    height, width = image.shape[:2]
    across, down = view.size[0] / width, view.size[1] / height  # image pixels per pixel of the level
    left, top = view.to_image(0.0, 0.0)
    step = 1.0 / (view.zoom * ratio)
    # device pixel centre -> place in the level, pixel centres at integers
    shift_x, shift_y = ((edge + 0.5 + 0.5 * step) / per_px - 0.5 for edge, per_px in ((left, across), (top, down)))
    matrix = np.array([[step / across, 0.0, shift_x], [0.0, step / down, shift_y]])
    room = max(1, round(view.room[0] * ratio)), max(1, round(view.room[1] * ratio))
    # Cubic shows edges where they are when pixels are large, for twice the time; between level and screen is less than a factor 2.
    how = (cv2.INTER_CUBIC if step < _LARGE_PIXEL else cv2.INTER_LINEAR) | cv2.WARP_INVERSE_MAP
    # beyond the image it is dark: a replicated border would look like more of the image
    x0, y0 = (max(0, round(value * ratio)) for value in view.to_screen((-0.5, -0.5)))
    x1, y1 = (round(value * ratio) for value in view.to_screen((view.size[0] - 0.5, view.size[1] - 0.5)))
    x1, y1 = min(x1, room[0]), min(y1, room[1])
    pixels = np.empty((room[1], room[0], 4), np.uint8)
    pixels[:] = (*theme.rgb(ON_PICTURE.INK)[::-1], 255)
    if x1 > x0 and y1 > y0:
        matrix[:, 2] += matrix[:, :2] @ (x0, y0)
        shown = cv2.warpAffine(image, matrix, (x1 - x0, y1 - y0), flags=how, borderMode=cv2.BORDER_REPLICATE)
        if contrast != 1.0 or brightness != 0.0:
            greys = np.clip((np.arange(256) - 128.0) * contrast + 128.0 + brightness, 0, 255).astype(np.uint8)
            shown = cv2.LUT(shown, greys)
        pixels[y0:y1, x0:x1] = cv2.cvtColor(shown, cv2.COLOR_RGB2BGRA)
    picture = QImage(pixels.data, room[0], room[1], 4 * room[0], QImage.Format.Format_RGB32).copy()
    picture.setDevicePixelRatio(ratio)
    return picture


class ImageCanvas(QWidget):
    """Shows the visible part of an image. A subclass that draws on it uses ``view`` and calls ``paint_picture`` first."""

    def __init__(self) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setCursor(Qt.CursorShape.CrossCursor)
        self.levels: tuple[Image, ...] = ()  # the image and its halvings; empty: nothing is shown
        self.view = Viewport((1, 1), (1, 1), 1.0, (0.0, 0.0))
        self.light = (1.0, 0.0)  # contrast and brightness
        self.is_pannable = False  # a key is held with which any click moves the picture
        self._picture: QImage | None = None
        self._pan_from: QPointF | None = None

    @property
    def is_panning(self) -> bool:
        return self._pan_from is not None

    def show_levels(self, levels: tuple[Image, ...]) -> None:
        """Show another image, all of it; without levels nothing is shown."""
        if levels:
            size = levels[0].shape[1], levels[0].shape[0]
            self.view = Viewport.fitted(size, self._room)
        self.levels = levels
        self._pan_from = None
        self._renew_picture()

    def set_light(self, contrast: float, brightness: float) -> None:
        """How greys are shown; the image itself is not changed."""
        self.light = (contrast, brightness)
        self._renew_picture()

    def fit(self) -> None:
        """The whole image."""
        self._set_view(Viewport.fitted(self.view.size, self.view.room))

    def zoom_at(self, factor: float, at: Point) -> None:
        """Zoom by a factor; the widget's place `at` stays over the same place of the image."""
        self._set_view(self.view.zoomed(factor, at))

    def close_up_at(self, middle: Point) -> None:
        """Magnify a place of the image; a second call shows the whole image."""
        whole = Viewport.fitted(self.view.size, self.view.room)
        near = replace(whole, zoom=whole.zoom * _CLOSE_UP, center=middle).inside()
        self._set_view(whole if self.view == near else near)

    def scroll_to(self, point: Point) -> None:
        if not self.view.shows(point, 20.0):
            self._set_view(replace(self.view, center=point).inside())

    # ---- panning

    def begin_pan(self, position: QPointF) -> None:
        self._pan_from = position

    def pan_to(self, position: QPointF) -> None:
        if self._pan_from is not None:
            step = position - self._pan_from
            self._pan_from = position
            self._renew_cursor()  # only now, as a click may mean something else
            self._set_view(self.view.panned(step.x(), step.y()))

    def end_pan(self) -> None:
        self._pan_from = None
        self._renew_cursor()

    def set_pannable(self, on: bool) -> None:
        self.is_pannable = on
        self._renew_cursor()

    def wheelEvent(self, event: QWheelEvent) -> None:
        turns = event.angleDelta().y() / 120.0
        if turns and self.levels:
            self.zoom_at(_WHEEL_FACTOR**turns, (event.position().x(), event.position().y()))
        event.accept()

    def resizeEvent(self, event: QResizeEvent) -> None:
        self.view = self.view.in_room(self._room)
        self._renew_picture()

    # ---- painting

    def paint_picture(self, painter: QPainter) -> bool:
        """The visible part, or a dark ground and False where there is no image."""
        if not self.levels:
            painter.fillRect(self.rect(), QColor(ON_PICTURE.INK))
            return False
        ratio = self.devicePixelRatioF()
        if self._picture is None or self._picture.devicePixelRatio() != ratio:  # also on a screen of another density
            self._picture = render(self.levels, self.view, ratio, *self.light)
        painter.drawImage(QPointF(0, 0), self._picture)
        return True

    @property
    def _room(self) -> tuple[int, int]:
        return max(1, self.width()), max(1, self.height())

    def _set_view(self, view: Viewport) -> None:
        if view != self.view:
            self.view = view
            self._renew_picture()

    def _renew_picture(self) -> None:
        self._picture = None
        self.update()

    def _renew_cursor(self) -> None:
        if self._pan_from is not None:
            self.setCursor(Qt.CursorShape.ClosedHandCursor)
        else:
            self.setCursor(Qt.CursorShape.OpenHandCursor if self.is_pannable else Qt.CursorShape.CrossCursor)


_STEP = 10


class LightSliders(QWidget):
    """Contrast and brightness of an image as it is shown.

    ``changed`` carries contrast (1 = as it is) and brightness (0 = as it is, in grey levels).
    """

    changed = Signal(float, float)

    def __init__(self) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setVerticalSpacing(2)
        self._contrast = self._add_slider(grid, 0, tr("Contrast"), ", .")
        self._brightness = self._add_slider(grid, 1, tr("Brightness"), "< >")

    def _add_slider(self, grid: QGridLayout, row: int, name: str, keys: str) -> QSlider:
        for column, text, role in ((0, name, "TEXT_DIM"), (2, keys, "TEXT_FAINT")):
            label = QLabel(text)
            theme.set_sheet(label, f"color: @{role}; font-size: 12px;")
            grid.addWidget(label, row, column)
        slider = QSlider(Qt.Orientation.Horizontal)
        slider.setRange(-100, 100)
        slider.setPageStep(_STEP)
        slider.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        slider.setAccessibleName(name)
        slider.setToolTip(tr("{name} of the picture on the screen  (keys {keys}; / resets both)", name=name, keys=keys))
        slider.valueChanged.connect(lambda _value: self.changed.emit(*self.light))
        grid.addWidget(slider, row, 1)
        return slider

    @property
    def light(self) -> tuple[float, float]:
        return 4.0 ** (self._contrast.value() / 100.0), float(self._brightness.value())

    def step(self, contrast: int = 0, brightness: int = 0) -> None:
        self._contrast.setValue(self._contrast.value() + contrast * _STEP)
        self._brightness.setValue(self._brightness.value() + brightness * _STEP)

    def reset(self) -> None:
        self._contrast.setValue(0)
        self._brightness.setValue(0)
