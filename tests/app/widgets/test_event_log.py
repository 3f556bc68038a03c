"""What happened, with counts and a filter."""

from __future__ import annotations

from datetime import datetime, timedelta

import pytest
from PySide6.QtCore import QPoint
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication, QMenu

from app.widgets.event_log import MOST_ROWS, EventLog, LogKind
from tests.app.widgets.conftest import Own


class WallClock:
    def __init__(self) -> None:
        self.now = datetime(2026, 3, 4, 14, 2, 0)

    def __call__(self) -> datetime:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += timedelta(seconds=seconds)


@pytest.fixture
def wall() -> WallClock:
    return WallClock()


@pytest.fixture
def log(own: Own, wall: WallClock) -> EventLog:
    return own(EventLog(wall), 470, 200)


@pytest.mark.parametrize("visible", [True, False])
def test_log_lists_the_newest_first_with_time_and_kind(log: EventLog, wall: WallClock, visible: bool) -> None:
    log.setVisible(visible)
    log.add(LogKind.MODE, "ADVISORY to ARMED")
    wall.wait(65)
    log.add(LogKind.OPERATOR, "hand\nover")
    assert log.lines == ["14:03:05  operator  hand over", "14:02:00  mode      ADVISORY to ARMED"]


@pytest.mark.parametrize("visible", [True, False])
def test_a_repetition_within_two_seconds_is_counted(log: EventLog, wall: WallClock, visible: bool) -> None:
    log.setVisible(visible)
    for _ in range(3):
        log.add(LogKind.GATE, "clamped")
        wall.wait(2.0)
    wall.wait(0.1)
    log.add(LogKind.GATE, "clamped")
    log.add(LogKind.ALERT, "clamped")
    assert [line[10:] for line in log.lines] == ["alert     clamped", "gate      clamped", "gate      clamped ×3"]
    log.add(LogKind.ALERT, "clamped")
    assert log.lines[0].endswith("×2"), "also after the list was read"


def test_what_alternates_is_counted_by_its_key(log: EventLog, wall: WallClock) -> None:
    for k in range(3):
        log.add(LogKind.GATE, f"right: {k} mm", "right")
        log.add(LogKind.GATE, f"left: {k} mm", "left", times=2)
        wall.wait(1.0)
    assert [line[20:] for line in log.lines] == ["right: 2 mm ×3", "left: 2 mm ×6"], "the first of a second is the upper one"


def test_what_is_repeated_stays_the_newest_but_does_not_change_places_within_a_second(log: EventLog, wall: WallClock) -> None:
    log.show_kind(LogKind.GATE)
    for name in ("a", "b", "b", "a"):
        log.add(LogKind.GATE, name)
        log.add(LogKind.NOTE, name)
    assert [line[-4:] for line in log.lines] == ["b ×2", "a ×2"]
    wall.wait(1.0)
    log.add(LogKind.GATE, "a")
    log.add(LogKind.NOTE, "a")
    assert [line[-4:] for line in log.lines] == ["a ×3", "b ×2"], "and notes are still hidden"


def test_what_is_repeated_is_shown_again_when_its_line_was_dropped(log: EventLog) -> None:
    log.add(LogKind.GATE, "clamped")
    for k in range(MOST_ROWS):
        log.add(LogKind.NOTE, str(k))
    log.add(LogKind.GATE, "clamped")
    assert log.lines[0].endswith("clamped ×2")
    assert len(log.lines) == MOST_ROWS


@pytest.mark.parametrize("visible", [True, False])
def test_log_keeps_the_newest_two_thousand(log: EventLog, visible: bool) -> None:
    log.setVisible(visible)
    for k in range(MOST_ROWS + 7):
        log.add(LogKind.NOTE, str(k))
    assert len(log.lines) == MOST_ROWS
    assert log.lines[-1].endswith("  7")


def test_filter_shows_one_kind_also_of_what_comes_later(log: EventLog, wall: WallClock) -> None:
    log.show()
    log.add(LogKind.NOTE, "a")
    log.add(LogKind.ALERT, "b")
    log.show_kind(LogKind.ALERT)
    log.add(LogKind.NOTE, "c")
    log.add(LogKind.NOTE, "c")
    log.add(LogKind.ALERT, "d")
    assert [line[-1] for line in log.lines] == ["d", "b"]
    log.show_kind(None)
    assert [line.split("  ")[-1].strip() for line in log.lines] == ["d", "c ×2", "b", "a"]


def test_copy_all_takes_what_is_shown(log: EventLog) -> None:
    log.show()
    log.add(LogKind.NOTE, "a")
    log.add(LogKind.ALERT, "b")
    log._view.customContextMenuRequested.emit(QPoint(5, 5))
    menu = log.findChild(QMenu)
    (action,) = menu.actions()
    assert action.text() == "Copy all"
    action.trigger()
    menu.close()
    assert QGuiApplication.clipboard().text() == "14:02:00  alert     b\n14:02:00  note      a"


def test_a_list_that_was_scrolled_down_keeps_its_place(log: EventLog, wall: WallClock) -> None:
    log.show()
    for k in range(60):
        log.add(LogKind.NOTE, str(k))
    QApplication.processEvents()
    view, bar = log._view, log._view.verticalScrollBar()
    bar.setValue(240)
    before = view.indexAt(QPoint(5, 5)).data()
    log.add(LogKind.NOTE, "new")
    assert view.indexAt(QPoint(5, 5)).data() == before
    wall.wait(1.0)
    for repeated in ("40", "55"):  # in view, and above it
        log.add(LogKind.NOTE, repeated)
        assert view.indexAt(QPoint(5, 5)).data() == before
    bar.setValue(0)
    log.add(LogKind.NOTE, "newer")
    assert bar.value() == 0 and view.indexAt(QPoint(5, 5)).data().endswith("newer")
