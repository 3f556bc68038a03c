"""What happened, with counts and a filter."""

from __future__ import annotations

from datetime import datetime, timedelta

import pytest

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
