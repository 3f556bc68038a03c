"""The tour points at the real widgets, leaves the window in use, and never comes uncalled."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.operator import services as tour_module
from app.operator.services import tour_at_start, was_seen
from app.operator.window import OperatorWindow
from app.ui.theme import MIN_WINDOW
from app.widgets.mode_bar import StopButton
from app.widgets.tour_overlay import TourOverlay
from core.config.models import Config
from core.control.modes import Act
from hardware.rig import RigKind
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeEngine, until

Key = Qt.Key


@pytest.fixture(autouse=True)
def own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))


def _stops(tour: TourOverlay) -> Iterator[int]:
    """From stop to stop until it is over."""
    while tour.is_running:
        yield tour.place
        tour.forward()


# ---- places


def test_no_card_covers_stop_or_what_it_speaks_of_and_all_of_its_text_is_on_it(running: OperatorWindow, qtbot: QtBot) -> None:
    panels, tour = running.panels, running.tour
    for size in (MIN_WINDOW, (1280, 720), (1600, 900), (1920, 1080)):
        running.resize(*size)
        QApplication.processEvents()
        stop = QRect(panels.mode_bar.stop.mapTo(panels, QPoint(0, 0)), panels.mode_bar.stop.size())
        running.show_tour()
        seen = []
        for place in _stops(tour):
            QApplication.processEvents()
            card, label = tour.card.geometry(), tour.card._text
            seen.append(tour.card.text)
            assert panels.rect().contains(card), place
            assert not card.intersects(stop), place
            assert tour.light.isValid(), f"{place}: it points at nothing"
            assert panels.rect().adjusted(-6, -6, 6, 6).contains(tour.light), place
            assert not card.intersects(tour.light), place
            assert isinstance(panels.childAt(stop.center()), StopButton), place
            assert label.height() >= label.heightForWidth(label.width()), place
        assert len(seen) == len(set(seen)) == 7


# ---- what stays in use


def test_stop_the_robot_and_the_picture_stay_in_use(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    running.show_tour()
    assert running.tour.card.forward.hasFocus() or running.focusWidget() is running.tour.card.forward
    qtbot.keyClick(running.focusWidget(), Key.Key_Space)
    assert engine.pilot.acts == [Act.STOP]
    assert running.tour.place == 0, "Space pressed no button of the tour"
    stop = running.panels.mode_bar.stop
    qtbot.mouseClick(stop, Qt.MouseButton.LeftButton)
    assert engine.pilot.acts == [Act.STOP, Act.STOP]
    assert running.tour.is_running
    qtbot.keyPress(running.focusWidget(), Key.Key_W)
    assert engine.jogs[-1].advance > 0
    qtbot.keyRelease(running.focusWidget(), Key.Key_W)
    live = running.panels.live
    inside = live.mapTo(running.panels, live.rect().center())
    under = running.panels.childAt(inside)
    assert live.isAncestorOf(under) or under is live, "the shade lets clicks through"


def test_it_works_by_keyboard_alone_and_by_clicks(running: OperatorWindow, qtbot: QtBot) -> None:
    running.show_tour()
    tour = running.tour
    running.panels.mode_bar.stop.setFocus()
    qtbot.keyClick(running.panels.mode_bar.stop, Key.Key_Return)
    assert tour.place == 0, "on a control Enter is the control's"
    tour.card.forward.setFocus()
    qtbot.keyClick(running.focusWidget(), Key.Key_Return)
    assert tour.place == 1
    running.panels.live.setFocus()  # as after a click into the picture
    qtbot.keyClick(running.focusWidget(), Key.Key_Return)
    assert tour.place == 2
    qtbot.keyClick(running.focusWidget(), Key.Key_Backspace)
    assert tour.place == 1
    qtbot.keyClick(running.focusWidget(), Key.Key_Escape)
    assert not tour.is_running
    assert not tour.card.isVisible()
    assert running.focusWidget() is running.panels.live
    running.show_tour()
    assert not tour.card.back.isEnabled()
    qtbot.mouseClick(tour.card.forward, Qt.MouseButton.LeftButton)
    qtbot.mouseClick(tour.card.back, Qt.MouseButton.LeftButton)
    assert tour.place == 0
    qtbot.mouseClick(tour.card.skip, Qt.MouseButton.LeftButton)
    assert not tour.is_running


def test_without_a_robot_it_does_not_speak_of_moving_one(make_window: MakeWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    config = Config.model_validate({"rig": {"camera": "video_file", "robot": "none", "source": "x.mp4"}, "record": {"ring_s": 0}})
    window = make_window(lambda _config: engine, config, RigKind.PLAYBACK)
    window.show_tour()
    texts = [window.tour.card.text for _ in _stops(window.tour)]
    assert len(texts) == 4
    assert not any("arms it" in text or "advances" in text for text in texts)


# ---- when it comes


def test_once_at_the_first_start_on_a_screen_and_whenever_it_is_asked_for(
    running: OperatorWindow, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tour_module, "_LOOK_EVERY_MS", 1)
    tour_at_start(running, asked=False)
    qtbot.wait(30)
    assert not running.tour.is_running, "without a screen"
    assert not was_seen()
    monkeypatch.setattr(tour_module, "_NO_SCREEN", ())
    tour_at_start(running, asked=False)
    until(qtbot, lambda: running.tour.is_running)
    assert was_seen()
    running.tour.end()
    tour_at_start(running, asked=False)
    qtbot.wait(30)
    assert not running.tour.is_running
    tour_at_start(running, asked=True)
    until(qtbot, lambda: running.tour.is_running)
    running.tour.end()
    next(action for action in running.actions() if action.text() == "&Tour").trigger()
    assert running.tour.is_running
