"""The picture that is zoomed and moved by hand."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QPainter, QPixmap

from app.widgets.image_canvas import ImageCanvas


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
        assert self._picture is not None
        assert self._picture.width() == round(200 * self._picture.devicePixelRatio())
        return self._picture.devicePixelRatio()


@pytest.mark.usefixtures("qapp")
def test_a_window_moved_to_a_screen_of_another_density_is_sharp_there_too() -> None:
    canvas = Painted(1.0)
    assert canvas.painted() == 1.0
    canvas.ratio = 2.0
    assert canvas.painted() == 2.0


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
