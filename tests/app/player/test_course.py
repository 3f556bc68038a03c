"""Where the player stops: gaps, places to jump to, and the clock that plays."""

from __future__ import annotations

import numpy as np
import pytest

from app.player.course import Course, JumpKind, PlayClock, course_of, places_of
from core.session.manifest import Event, EventKind
from core.session.reader import Timeline
from tests.app.hand_clock import Clock


def course(times_s: list[float], states: list[int] | None = None, rows: list[int] | None = None) -> Course:
    count = len(times_s)
    whole = np.arange(count)
    return course_of(
        Timeline(
            np.array(rows if rows is not None else whole, np.int64),
            np.array(times_s, np.float64),
            np.zeros(count, np.int64),
            np.array(times_s, np.int64),
            np.zeros(count),
            np.array(states if states is not None else [0] * count, np.int8),
            np.full(count, -1, np.int8),
        )
    )


def test_times_count_from_the_first_row_and_never_go_back() -> None:
    found = course([100.0, 100.1, 100.05, 100.3])
    assert found.first_s == 100.0
    assert found.times_s == pytest.approx([0.0, 0.1, 0.1, 0.3])
    assert found.duration_s == pytest.approx(0.3)
    assert [found.place_at(t) for t in (-1.0, 0.0, 0.05, 0.1, 0.29, 9.0)] == [0, 0, 0, 2, 2, 3]


def test_an_empty_session_has_no_length() -> None:
    assert (len(course([])), course([]).duration_s) == (0, 0.0)
    assert places_of(JumpKind.NOTE, course([]), [Event(1.0, EventKind.NOTE)]).size == 0


def test_gaps_are_long_pauses_and_rows_that_are_missing() -> None:
    assert course([0.0, 0.1, 0.2, 0.7, 0.8]).gaps.tolist() == [3]
    assert course([0.0, 0.1, 0.2, 0.3], rows=[0, 1, 5, 6]).gaps.tolist() == [2]
    # a slow camera has no gaps
    assert course([0.0, 1.0, 2.0, 3.0]).gaps.size == 0


def test_each_kind_has_its_places() -> None:
    shown = course([10.0, 10.1, 10.2, 10.3, 11.9], states=[0, 0, 1, -1, -1])
    events = [
        Event(10.0, EventKind.MODE, "ADVISORY"),
        Event(10.15, EventKind.NOTE, "between two frames: the first that was captured after it"),
        Event(10.2, EventKind.FAULT, "at a frame"),
        Event(99.0, EventKind.OVERRIDE, "after the end"),
        Event(10.1, EventKind.VIDEO, "video_0000.mkv"),
    ]
    places = {kind: places_of(kind, shown, events).tolist() for kind in JumpKind}
    assert places == {
        JumpKind.STATE: [2, 3],
        JumpKind.FAULT: [2],
        JumpKind.OVERRIDE: [4],
        JumpKind.NOTE: [2],
        JumpKind.MODE: [0],
        JumpKind.TARGET: [],
        JumpKind.GAP: [4],
        JumpKind.REPLAY: [],
        JumpKind.ANY: [0, 2, 4],
    }


def test_playing_follows_the_clock_at_its_speed_and_ends() -> None:
    wall, shown = Clock(), course([k / 10 for k in range(21)])
    clock = PlayClock(wall)
    assert not clock.advance(shown, 2.0)
    clock.play()
    wall.now_s += 0.5
    assert clock.advance(shown, 2.0)
    assert clock.position_s == pytest.approx(0.5)
    clock.speed = 0.1
    wall.now_s += 1.0
    clock.advance(shown, 2.0)
    assert clock.position_s == pytest.approx(0.6)
    clock.speed = 8.0
    wall.now_s += 1.0
    assert not clock.advance(shown, 2.0)
    assert (clock.position_s, clock.is_playing) == (2.0, False)


def test_a_long_gap_is_passed_over_and_told() -> None:
    wall, shown = Clock(), course([0.0, 0.1, 0.2, 60.2, 60.3])
    clock = PlayClock(wall)
    clock.play()
    wall.now_s += 0.6
    clock.advance(shown, 60.3)
    assert (clock.position_s, clock.skipped_s) == (pytest.approx(0.6), 0.0)
    wall.now_s += 0.2
    clock.advance(shown, 60.3)
    assert (clock.position_s, clock.skipped_s) == (pytest.approx(60.2), pytest.approx(59.4))
    wall.now_s += 0.01
    clock.advance(shown, 60.3)
    assert clock.skipped_s == 0.0


def test_a_seek_while_playing_starts_from_there() -> None:
    wall, shown = Clock(), course([k / 10 for k in range(100)])
    clock = PlayClock(wall)
    clock.play()
    wall.now_s += 3.0
    clock.seek(1.0)
    wall.now_s += 0.5
    clock.advance(shown, 9.9)
    assert clock.position_s == pytest.approx(1.5)
