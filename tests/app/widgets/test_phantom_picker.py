"""The choice of a phantom and its seed."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.widgets.phantom_picker import PhantomPicker
from tests.app.widgets.conftest import Own


def test_picker_gives_names_as_the_configuration_writes_them(own: Own) -> None:
    picker = own(PhantomPicker([("s_curve", "S-curve"), ("tree", "Tree")], "tree"))
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    assert (picker.name, picker.title) == ("tree", "Tree")
    picker._combo.setCurrentIndex(0)
    picker._combo.activated.emit(0)
    picker.roll()
    picker.roll()
    assert chosen == ["s_curve", "random:1", "random:2"]
    assert picker.title == "random 2"


def test_seed_counts_when_confirmed_not_at_each_digit(own: Own) -> None:
    holder = own(QWidget())
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
