"""Labels on the picture stay readable: inside the window, and not on top of each other."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QRectF
from PySide6.QtGui import QImage, QPainter, QTransform
from pytestqt.qtbot import QtBot

from app.ui.theme import ON_PICTURE
from app.widgets.scene_painter import ScenePainter
from core.types import Point, Vector


class _Noted(ScenePainter):
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


@pytest.mark.parametrize("start", [(100.0, 100.0), (8.0, 150.0), (340.0, 285.0), (10.0, 20.0)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_labels_beside_one_line_do_not_cover_each_other(pencil: _Noted, start: Point, side: float) -> None:
    """At its middle and both of its ends, also beside the window's edge."""
    end = (start[0] + 40.0, start[1] + 6.0)
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    line = Vector(start, middle, end)
    pencil.label_beside(middle, line, -side, "θ -9°", ON_PICTURE.THETA)
    pencil.label_beside(end, line, side, "d_head 13", ON_PICTURE.D_HEAD)
    pencil.label_beside(start, line, side, "d_tail 10", ON_PICTURE.D_TAIL)
    for k, box in enumerate(pencil.boxes):
        assert QRectF(0, 0, 400, 300).contains(box)
        assert not any(box.intersects(other) for other in pencil.boxes[:k])
