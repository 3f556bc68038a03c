"""Windows look at the next start as they did when they were closed; whatever is broken is ignored."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QByteArray
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QLabel, QMainWindow, QTabWidget
from pytestqt.qtbot import QtBot

from app.operator.window import OperatorWindow
from app.ui.actions import action_of, plain
from app.ui.layout_state import LayoutState, layout_settings
from app.widgets.basics import Columns
from app.widgets.scene_overlay import Layer
from app.widgets.scene_panels import overlay_actions
from tests.app.conftest import MakeWindow


@pytest.fixture(autouse=True)
def nothing_kept() -> Iterator[None]:
    layout_settings().clear()
    yield
    layout_settings().clear()


class Arranged:
    """A window with columns, pages and switches."""

    def __init__(self, qtbot: QtBot) -> None:
        self.window = QMainWindow()
        self.window.setMinimumSize(300, 200)
        self.window.resize(800, 400)
        self.columns = Columns(QLabel("left"), QLabel("right"), 0.6)
        self.window.setCentralWidget(self.columns)
        self.pages = QTabWidget()
        for name in ("Drive", "Servos", "Problems"):
            page = QLabel()
            page.setAccessibleName("Problems of it" if name == "Problems" else "")
            self.pages.addTab(page, name)
        self.pages.setParent(self.window)
        self.switches = {name: QAction(self.window, checkable=True, checked=True) for name in ("ghost", "masks")}
        self.keeper = LayoutState(self.window, "test", self.columns, self.pages, self.switches)
        qtbot.addWidget(self.window)
        self.window.show()


@pytest.fixture
def first(qtbot: QtBot) -> Arranged:
    return Arranged(qtbot)


def test_the_next_window_is_as_the_last_one_was(first: Arranged, qtbot: QtBot) -> None:
    first.window.resize(640, 420)
    first.columns.set_share(0.45)
    first.pages.setCurrentIndex(2)
    first.pages.setTabText(2, "Problems 3")
    first.switches["ghost"].trigger()
    first.window.close()
    second = Arranged(qtbot)
    assert second.window.size().toTuple() == (640, 420)
    assert second.columns.share == pytest.approx(0.45, abs=0.01)
    assert second.pages.currentIndex() == 2, "by its name, not by its title"
    assert not second.switches["ghost"].isChecked()
    assert second.switches["masks"].isChecked()


def test_reset_puts_all_back_now_and_at_the_next_start(first: Arranged, qtbot: QtBot) -> None:
    first.columns.set_share(0.45)
    first.pages.setCurrentIndex(1)
    for switch in first.switches.values():
        switch.trigger()
    first.window.close()
    second = Arranged(qtbot)
    menus = {plain(action.text()): action.menu() for action in second.window.menuBar().actions()}
    assert [plain(action.text()) for action in menus["View"].actions()] == ["Reset layout"]
    second.keeper.reset()
    assert second.columns.share == pytest.approx(0.6)
    assert second.pages.currentIndex() == 0
    assert all(switch.isChecked() for switch in second.switches.values())
    third = Arranged(qtbot)
    assert third.columns.share == pytest.approx(0.6)
    assert all(switch.isChecked() for switch in third.switches.values())


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("geometry", QByteArray(b"\x00\x01broken")),
        ("geometry", 17),
        ("columns/main", "nan"),
        ("columns/main", ["0.5", "0.5"]),
        ("page/right", "No such page"),
        ("switch/ghost", "perhaps"),
    ],
)
def test_broken_values_are_ignored(qtbot: QtBot, key: str, value: object) -> None:
    settings = layout_settings()
    settings.setValue(f"test/{key}", value)
    settings.sync()
    made = Arranged(qtbot)
    assert made.window.size().toTuple() == (800, 400)
    assert made.columns.share == pytest.approx(0.6)
    assert made.pages.currentIndex() == 0
    assert made.switches["ghost"].isChecked()


def test_a_broken_file_is_ignored(qtbot: QtBot, first: Arranged) -> None:
    first.window.close()
    path = layout_settings().fileName()
    with open(path, "wb") as file:
        file.write(b"\x00\xff[[[\n=\n%%%")
    made = Arranged(qtbot)
    assert made.window.size().toTuple() == (800, 400)
    made.window.close()


def test_overlays_of_the_operator_window_are_kept(make_window: MakeWindow) -> None:
    def arranged() -> OperatorWindow:
        window = make_window()
        LayoutState(window, "operator", window.panels.columns, window.panels.pages, overlay_actions(window))
        return window

    window = arranged()
    window.panels.overlay_bar.toggle(Layer.LOUPE)
    window.panels.pages.setCurrentIndex(2)
    name = window.panels.pages.tabText(2)
    window.close()
    again = arranged()
    assert not again.panels.overlay_bar.is_on(Layer.LOUPE)
    assert not action_of(again, Layer.LOUPE.value.key).isChecked()
    assert again.panels.pages.tabText(again.panels.pages.currentIndex()) == name
