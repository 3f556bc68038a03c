"""Labels on the picture stay readable: inside the window, and not on top of each other."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QRectF
from PySide6.QtGui import QImage, QPainter, QTransform
from pytestqt.qtbot import QtBot

from app.palette import ON_PICTURE
from app.widgets.pencil import Pencil
from core.types import Point, Vector

ALONG = Vector((100.0, 100.0), (120.0, 100.0), (140.0, 100.0))


class _Noted(Pencil):
    def __init__(self, painter: QPainter) -> None:
        super().__init__(painter, QTransform(), 16)
        self.boxes: list[QRectF] = []

    def _text_box(self, box: QRectF, *arguments: object) -> None:
        self.boxes.append(QRectF(box))


@pytest.fixture
def pencil(qtbot: QtBot) -> Iterator[_Noted]:
    image = QImage(400, 300, QImage.Format.Format_RGB32)
    painter = QPainter(image)
    yield _Noted(painter)
    painter.end()


@pytest.mark.parametrize("point", [(200.0, 150.0), (2.0, 150.0), (398.0, 150.0), (200.0, 295.0), (200.0, 5.0)])
def test_a_tag_stays_inside_the_window(pencil: _Noted, point: Point) -> None:
    pencil.tag(point, "8 px to go", ON_PICTURE.TARGET)
    assert QRectF(0, 0, 400, 300).contains(pencil.boxes[0])


def test_a_tag_makes_way_for_a_label_that_is_there_already(pencil: _Noted) -> None:
    pencil.label_beside((120.0, 100.0), ALONG, 1.0, "d_head 4", ON_PICTURE.D_HEAD)
    below = pencil.boxes[0].top() > 100.0
    assert below
    pencil.tag((120.0, 100.0), "8 px to go", ON_PICTURE.TARGET)
    assert not pencil.boxes[1].intersects(pencil.boxes[0])
    assert pencil.boxes[1].bottom() < 100.0
