"""The choice of a phantom and its seed."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from app.widgets.phantom_picker import PhantomPicker


def test_picker_gives_names_as_the_configuration_writes_them(qtbot: QtBot) -> None:
    picker = PhantomPicker([("s_curve", "S-curve"), ("tree", "Tree")], "tree")
    qtbot.addWidget(picker)
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    assert (picker.name, picker.title) == ("tree", "Tree")
    picker._combo.setCurrentIndex(0)
    picker._combo.activated.emit(0)
    picker.roll()
    picker.roll()
    assert chosen == ["s_curve", "random:1", "random:2"]
    assert picker.title == "random 2"


def test_the_wheel_chooses_nothing(qtbot: QtBot) -> None:
    picker = PhantomPicker([("s_curve", "S-curve"), ("tree", "Tree")], "random:5")
    qtbot.addWidget(picker)
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    for widget in (picker._combo, picker._seed):
        for notch in (-120, 120):
            middle = QPointF(widget.rect().center())
            event = QWheelEvent(
                middle,
                widget.mapToGlobal(middle),
                QPoint(),
                QPoint(0, notch),
                Qt.MouseButton.NoButton,
                Qt.KeyboardModifier.NoModifier,
                Qt.ScrollPhase.NoScrollPhase,
                False,
            )
            QApplication.sendEvent(widget, event)
    assert chosen == []
    assert picker.name == "random:5"


def test_picker_shows_a_random_phantom_of_the_configuration(qtbot: QtBot) -> None:
    picker = PhantomPicker([("tree", "Tree")], "random:77")
    qtbot.addWidget(picker)
    assert picker.name == "random:77"


def test_seed_counts_when_confirmed_not_at_each_digit(qtbot: QtBot) -> None:
    holder = QWidget()
    qtbot.addWidget(holder)
    picker = PhantomPicker([("tree", "Tree")], "random:1")
    QVBoxLayout(holder).addWidget(picker)
    holder.show()
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    picker._seed.setFocus()
    picker._seed.selectAll()
    QTest.keyClicks(picker._seed, "42")
    assert chosen == []
    QTest.keyClick(picker._seed, Qt.Key.Key_Return)
    assert chosen == ["random:42"]


@pytest.mark.parametrize("came_by", ["key", "configuration"])
def test_the_seed_before_this_one_can_be_typed_again(qtbot: QtBot, came_by: str) -> None:
    picker = PhantomPicker([("tree", "Tree")], "random:1")
    qtbot.addWidget(picker)
    picker.show()
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    if came_by == "key":
        picker.roll()
    else:
        picker.show_name("random:2")
    assert picker.name == "random:2"
    picker._seed.setFocus()
    picker._seed.selectAll()
    QTest.keyClicks(picker._seed, "1")
    QTest.keyClick(picker._seed, Qt.Key.Key_Return)
    assert chosen[-1:] == ["random:1"]
