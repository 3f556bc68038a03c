"""The Twin menu: what is marked, what a choice opens, and when nothing may be chosen."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from pytestqt.qtbot import QtBot

from app.operator.twin_menu import with_kept_twin
from app.operator.window import OperatorWindow
from app.ui.actions import plain
from app.ui.layout_state import layout_settings
from core.config.models import Config, TwinConfig, load_config
from tests.app.fakes import FakeBench, FakeEngine, until

MakeWindow = Callable[..., OperatorWindow]
OpenEngine = Callable[[Config], FakeEngine]


@pytest.fixture
def opened() -> list[TwinConfig]:
    """The twins that were opened."""
    return []


@pytest.fixture
def open_engine(bench: FakeBench, opened: list[TwinConfig]) -> OpenEngine:
    def open_one(config: Config) -> FakeEngine:
        opened.append(config.twin)
        return FakeEngine(bench)

    return open_one


@pytest.fixture
def window(make_window: MakeWindow, open_engine: OpenEngine, qtbot: QtBot) -> OperatorWindow:
    layout_settings().clear()  # what other tests have chosen
    window = make_window(open_engine)
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    return window


def _entries(window: OperatorWindow) -> dict[str, QAction]:
    """As they are when the menu opens."""
    menu = next(action.menu() for action in window.menuBar().actions() if plain(action.text()) == "Twin")
    menu.aboutToShow.emit()
    rare = next(action.menu() for action in menu.actions() if action.menu() is not None)
    return {plain(action.text()): action for action in (*menu.actions(), *rare.actions()) if action.text() and not action.menu()}


def _marked(window: OperatorWindow) -> list[str]:
    return [title for title, action in _entries(window).items() if action.isChecked()]


def test_a_look_opens_the_twin_again_and_is_marked(window: OperatorWindow, opened: list[TwinConfig], qtbot: QtBot) -> None:
    assert _marked(window) == ["Clear bench"]
    _entries(window)["Tank of rippling water"].trigger()
    until(qtbot, lambda: len(opened) == 2 and window.shown_tick is not None)
    assert (opened[1].look, opened[1].appearance_seed, opened[1].phantom) == ("tank", 1, opened[0].phantom)
    assert _marked(window) == ["Tank of rippling water"]
    kept = with_kept_twin(load_config()).twin
    assert (kept.look, kept.appearance_seed) == ("tank", 1), "at the next start, too"
    layout_settings().setValue("twin/phantom", "no such phantom")
    assert with_kept_twin(load_config()) == load_config()
    assert window.panels.toast.text() == "Look: Tank of rippling water"
    _entries(window)["Clear bench"].trigger()
    until(qtbot, lambda: len(opened) == 3 and window.shown_tick is not None)
    assert opened[2].look == "bench"
    assert _marked(window) == ["Clear bench"]


def test_key_shows_another_picture_of_the_same_look(window: OperatorWindow, opened: list[TwinConfig], qtbot: QtBot) -> None:
    """The clear bench has only one picture, so that the key draws any of the ten families."""
    qtbot.keyClick(window, Qt.Key.Key_L)
    until(qtbot, lambda: len(opened) == 2 and window.shown_tick is not None)
    assert _marked(window) == ["Any of the ten families"]
    _entries(window)["Fluoroscopy"].trigger()
    until(qtbot, lambda: len(opened) == 3 and window.shown_tick is not None)
    qtbot.keyClick(window, Qt.Key.Key_L)
    until(qtbot, lambda: len(opened) == 4 and window.shown_tick is not None)
    assert [(twin.look, twin.appearance_seed) for twin in opened[1:]] == [(None, 1), ("fluoroscopy", 1), ("fluoroscopy", 2)]


def test_nothing_can_be_chosen_while_another_rig_is_open(window: OperatorWindow, opened: list[TwinConfig], qtbot: QtBot) -> None:
    twin = window.rig.config
    rig = twin.rig.model_copy(update={"name": "camera", "camera": "webcam", "robot": "none"})
    window.rig.use_config(twin.model_copy(update={"rig": rig}))
    assert not any(action.isEnabled() for action in _entries(window).values())
    qtbot.keyClick(window, Qt.Key.Key_L)
    window.rig.use_config(twin)
    own = _entries(window).pop("Your bench's own picture")
    assert not own.isEnabled()  # this phantom is of no bench
    assert all(action.isEnabled() for action in _entries(window).values() if action is not own)
    until(qtbot, lambda: window.shown_tick is not None)
    assert {other.look for other in opened} == {None}
    assert {other.appearance_seed for other in opened} == {0}
