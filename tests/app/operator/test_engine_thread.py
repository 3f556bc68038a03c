"""The thread around the engine: newest tick, visible faults, switching, an end at any moment."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from pytestqt.qtbot import QtBot

from app.operator.engine_thread import EngineLike, EnginePhase, EngineStatus, EngineThread
from core.control.modes import Act
from core.devices import DeviceError, EndOfStream
from core.types import Tick
from tests.app.fakes import FakeBench, FakeEngine


@pytest.fixture
def thread(qtbot: QtBot) -> Iterator[EngineThread]:
    engine_thread = EngineThread()
    yield engine_thread
    engine_thread.stop()
    assert engine_thread.wait(5000)


@pytest.fixture
def statuses(thread: EngineThread) -> list[EngineStatus]:
    seen: list[EngineStatus] = []
    thread.status_changed.connect(seen.append)
    return seen


def phases(statuses: list[EngineStatus]) -> list[EnginePhase]:
    return [status.phase for status in statuses]


def raising(error: Exception) -> Callable[[], EngineLike]:
    def open_engine() -> EngineLike:
        raise error

    return open_engine


def test_ticks_arrive_and_the_signal_comes_only_into_an_empty_slot(qtbot: QtBot, thread: EngineThread, bench: FakeBench) -> None:
    signals: list[int] = []
    opened_in: list[int] = []
    thread.tick_ready.connect(lambda: signals.append(1))
    thread.start_engine(lambda: (opened_in.append(threading.get_ident()), FakeEngine(bench, frames_per_second=200))[1])
    qtbot.waitUntil(lambda: thread.ticks.dropped > 5)
    assert len(signals) == 1, "nobody took the tick, so nobody is called again"
    first = thread.ticks.take()
    assert first.frame.index > 5, "the newest, not the oldest"
    qtbot.waitUntil(lambda: len(signals) == 2)
    assert opened_in[0] != threading.get_ident(), "not in the window's thread"


def _niceness() -> int:
    return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has priorities of threads")
def test_the_loop_waits_behind_the_window_and_what_an_engine_starts_does_not(
    qtbot: QtBot, thread: EngineThread, bench: FakeBench
) -> None:
    opened: list[int] = []
    turned: list[int] = []

    class Noting(FakeEngine):
        def step(self, timeout_s: float) -> Tick | None:
            turned.append(_niceness())
            return super().step(timeout_s)

    def open_engine() -> FakeEngine:
        opened.append(_niceness())
        return Noting(bench)

    for count in (1, 2):  # the second one is opened after the first one's loop was told to wait
        turned.clear()
        thread.start_engine(open_engine)
        qtbot.waitUntil(lambda count=count: len(opened) == count and len(turned) > 3)
        assert opened[-1] == _niceness()
        assert turned[-1] > _niceness() or turned[-1] == 19


def test_known_error_becomes_one_line(qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus]) -> None:
    thread.start_engine(raising(DeviceError("camera: no device\n  at /dev/video0; plug it in")))
    qtbot.waitUntil(lambda: EnginePhase.FAULT in phases(statuses))
    assert statuses[-1].message == "camera: no device at /dev/video0; plug it in"


def test_unknown_error_is_named_and_does_not_end_the_thread(
    qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench, caplog: pytest.LogCaptureFixture
) -> None:
    thread.start_engine(raising(ZeroDivisionError("float division by zero")))
    qtbot.waitUntil(lambda: EnginePhase.FAULT in phases(statuses))
    assert statuses[-1].message == "unexpected ZeroDivisionError: float division by zero"
    assert "Traceback" in caplog.text
    with qtbot.waitSignal(thread.tick_ready):
        thread.start_engine(lambda: FakeEngine(bench))


def test_error_in_the_loop_closes_the_engine(
    qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench
) -> None:
    engine = FakeEngine(bench)
    with qtbot.waitSignal(thread.tick_ready):
        thread.start_engine(lambda: engine)
    engine.fail_with = DeviceError("camera lost")
    qtbot.waitUntil(lambda: EnginePhase.FAULT in phases(statuses))
    assert engine.closed.is_set()
    assert thread.pilot is None, "there is no engine any more"


def test_end_of_a_recording_is_no_fault(qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench) -> None:
    engine = FakeEngine(bench)
    engine.fail_with = EndOfStream("clip.mp4: 240 frames")
    thread.start_engine(lambda: engine)
    qtbot.waitUntil(lambda: EnginePhase.ENDED in phases(statuses))
    assert statuses[-1].message == "clip.mp4: 240 frames"


def test_another_order_closes_the_first_engine_before_it_opens_the_next(
    qtbot: QtBot, thread: EngineThread, bench: FakeBench
) -> None:
    first = FakeEngine(bench)
    closed_when_opened: list[bool] = []

    def open_second() -> FakeEngine:
        closed_when_opened.append(first.closed.is_set())
        return FakeEngine(bench)

    with qtbot.waitSignal(thread.tick_ready):
        thread.start_engine(lambda: first)
    thread.start_engine(open_second)
    qtbot.waitUntil(lambda: bool(closed_when_opened))
    assert closed_when_opened == [True]


def test_of_several_orders_the_last_one_runs(
    qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench
) -> None:
    gate = threading.Event()
    slow, skipped, last = FakeEngine(bench), FakeEngine(bench), FakeEngine(bench)

    def open_slow() -> FakeEngine:
        gate.wait(5)
        return slow

    thread.start_engine(open_slow)
    qtbot.waitUntil(lambda: EnginePhase.STARTING in phases(statuses))
    thread.start_engine(lambda: skipped)
    thread.start_engine(lambda: last)
    gate.set()
    qtbot.waitUntil(lambda: EnginePhase.RUNNING in phases(statuses))
    assert slow.closed.is_set(), "opened for nothing, closed at once"
    assert not skipped.closed.is_set(), "never opened"
    assert thread.pilot is last.pilot


def test_stop_while_an_engine_is_being_opened_stops_it(
    qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench
) -> None:
    gate = threading.Event()
    engine, later = FakeEngine(bench), FakeEngine(bench)

    def open_slow() -> FakeEngine:
        gate.wait(5)
        return engine

    assert not thread.stop_opening(), "there is none yet"
    thread.start_engine(open_slow)
    assert thread.stop_opening()
    gate.set()
    qtbot.waitUntil(lambda: EnginePhase.RUNNING in phases(statuses))
    assert engine.pilot.acts == [Act.STOP]
    assert not thread.stop_opening()
    thread.start_engine(lambda: later)
    qtbot.waitUntil(lambda: thread.pilot is later.pilot)
    assert later.pilot.acts == [], "what was stopped before is the rig's own left-over"


def test_stop_before_an_announced_engine_is_opened_stops_it(
    qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench
) -> None:
    engine = FakeEngine(bench)
    thread.announce_engine()
    assert thread.stop_opening()
    thread.start_engine(lambda: engine)
    qtbot.waitUntil(lambda: EnginePhase.RUNNING in phases(statuses))
    assert engine.pilot.acts == [Act.STOP]


def test_stop_while_an_engine_cannot_be_opened_stops_the_next(
    qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench
) -> None:
    gate = threading.Event()
    engine = FakeEngine(bench)

    def open_slow() -> EngineLike:
        gate.wait(5)
        raise DeviceError("nothing there")

    thread.start_engine(open_slow)
    assert thread.stop_opening()
    gate.set()
    qtbot.waitUntil(lambda: EnginePhase.FAULT in phases(statuses))
    thread.start_engine(lambda: engine)
    qtbot.waitUntil(lambda: EnginePhase.RUNNING in phases(statuses))
    assert engine.pilot.acts == [Act.STOP]


MOMENTS = ["before the start", "while opening", "while running", "while the camera is silent", "after a fault"]


@pytest.mark.parametrize("moment", MOMENTS)
def test_stop_ends_the_thread(
    qtbot: QtBot, thread: EngineThread, statuses: list[EngineStatus], bench: FakeBench, moment: str
) -> None:
    engine = FakeEngine(bench)

    def open_slowly() -> FakeEngine:
        time.sleep(0.3 if moment == "while opening" else 0.0)
        if moment == "after a fault":
            raise DeviceError("nothing there")
        engine.silent = moment == "while the camera is silent"
        return engine

    if moment != "before the start":
        thread.start_engine(open_slowly)
        wanted = {"while opening": EnginePhase.STARTING, "after a fault": EnginePhase.FAULT}.get(moment, EnginePhase.RUNNING)
        qtbot.waitUntil(lambda: wanted in phases(statuses))
    thread.stop()
    assert thread.wait(3000)
    assert engine.closed.is_set() is (moment in ("while opening", "while running", "while the camera is silent"))
