"""An image with zoom and panning: places there and back, limits, and what is rendered."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QPainter, QPixmap

from app.widgets.image_canvas import ImageCanvas, Viewport, halvings, render


class Painted(ImageCanvas):
    """On a screen of any density."""

    def __init__(self, ratio: float) -> None:
        super().__init__()
        self.ratio = ratio
        self.resize(200, 100)
        self.show_levels((np.random.default_rng(1).integers(0, 255, (100, 200, 3), np.uint8),))

    def devicePixelRatioF(self) -> float:
        return self.ratio

    def painted(self) -> float:
        """Paint, and give the density of what was painted."""
        pixmap = QPixmap(200, 100)
        painter = QPainter(pixmap)
        assert self.paint_picture(painter)
        painter.end()
        assert self._picture.width() == round(200 * self._picture.devicePixelRatio())
        return self._picture.devicePixelRatio()


@pytest.mark.usefixtures("qapp")
def test_a_click_shows_no_hand_and_a_drag_does() -> None:
    canvas = Painted(1.0)
    canvas.zoom_at(4.0, (100.0, 50.0))
    center = canvas.view.center
    canvas.begin_pan(QPointF(50, 50))
    assert canvas.cursor().shape() is Qt.CursorShape.CrossCursor
    canvas.pan_to(QPointF(58, 46))
    assert canvas.cursor().shape() is Qt.CursorShape.ClosedHandCursor
    assert canvas.view.center == pytest.approx((center[0] - 2.0, center[1] + 1.0))
    canvas.end_pan()
    assert canvas.cursor().shape() is Qt.CursorShape.CrossCursor


SIZE, ROOM = (640, 480), (900, 600)


def test_the_whole_picture_lies_in_the_middle() -> None:
    view = Viewport.fitted(SIZE, ROOM)
    assert view.zoom == 1.25
    assert view.to_screen((-0.5, -0.5)) == (50.0, 0.0)
    assert view.to_screen((639.5, 479.5)) == (850.0, 600.0)
    assert view.is_fitted


@pytest.mark.parametrize("zoom", [1.0, 3.7, 25.0])
def test_there_and_back(zoom: float) -> None:
    view = Viewport.fitted(SIZE, ROOM).zoomed(zoom, (200.0, 100.0))
    assert view.to_image(*view.to_screen((123.4, 56.7))) == pytest.approx((123.4, 56.7))
    mapped = view.transform.map(123.4 + 0.5, 56.7 + 0.5)
    assert mapped == pytest.approx(view.to_screen((123.4, 56.7)))


def test_zoom_keeps_the_place_and_ends_at_the_whole_picture() -> None:
    view = Viewport.fitted(SIZE, ROOM)
    fixed = view.to_image(300.0, 200.0)
    near = view.zoomed(4.0, (300.0, 200.0))
    assert near.to_image(300.0, 200.0) == pytest.approx(fixed)
    assert near.zoomed(0.01, (0.0, 0.0)) == view
    assert near.zoomed(1e6, (300.0, 200.0)).zoom == 40.0


def test_the_picture_cannot_be_lost() -> None:
    view = Viewport.fitted(SIZE, ROOM).zoomed(5.0, (0.0, 0.0)).panned(1e6, -1e6)
    left, _ = view.to_screen((-0.5, 0.0))
    assert left == pytest.approx(60.0), "no more than a margin of surroundings"


@pytest.mark.parametrize("size", [(640, 480), (5120, 3840)])
def test_a_pixel_is_rendered_where_it_lies(size: tuple[int, int]) -> None:
    image = np.zeros((size[1], size[0], 3), np.uint8)
    unit = size[0] // 640
    image[100 * unit : 104 * unit, 200 * unit : 204 * unit] = (255, 0, 0)
    for factor in (1.0, 3.0, 8.0):
        view = Viewport.fitted(size, ROOM).zoomed(factor, (300.0, 130.0))
        picture = render(halvings(image), view, 1.0, 1.0, 0.0)
        x, y = view.to_screen((202.0 * unit - 0.5, 102.0 * unit - 0.5))
        assert picture.pixelColor(round(x), round(y)).red() > 200
        assert picture.pixelColor(round(x + 4 * view.zoom * unit), round(y)).red() < 40
