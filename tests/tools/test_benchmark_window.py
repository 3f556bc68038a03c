"""``benchmark --window``: the real window on the twin, driven for some seconds, tells its pace."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QObject
from pytestqt.qtbot import QtBot

from core.control.drive_view import DriveView
from core.types import Frame, Scene, Tick
from tools import benchmarks
from tools.benchmarks import WindowWatch

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_it_runs_the_window_and_ends_by_itself() -> None:
    done = subprocess.run(
        [sys.executable, "main.py", "benchmark", "--window", "12", "--json"],
        cwd=ROOT,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    found = found.get("window", found)
    assert found["shown_fps"] > 0.0
    assert found["bus_cycle_p99_ms"] >= 20.0, "50 Hz is 20 ms, and the slowest of a hundred cycles no faster"
    assert found["gui_max_block_ms"] == found["gui_longer_blocks"][-1]["ms"]
    assert found["capture_to_screen_ms"]["p50"] > 0.0


class _Operator:
    driven_s = 0.0
    started = 0

    def __init__(self, window: QObject, after_s: float) -> None: ...
    def start(self) -> None:
        _Operator.started += 1

    def stop(self) -> None: ...


class _Desk:
    view: DriveView | None = None
    bus = None


class _Window(QObject):
    desk = _Desk()
    shown_tick: Tick | None = None
    max_block_ms = 0.0
    closed = False

    def close(self) -> None:
        self.closed = True


def test_only_blocks_that_are_longer_than_all_before_are_told(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmarks, "ScriptedOperator", _Operator)
    window = _Window()
    watch = WindowWatch(window, 600.0)  # type: ignore[arg-type]
    assert watch.result() == {"shown_fps": 0.0}, "nothing was shown"
    watch.readings.first_shown_s = 0.0
    for block_ms in (12.0, 30.04, 30.04, 20.0, 41.0):
        window.max_block_ms = block_ms
        watch._weigh()
    assert [ms for _, ms, _ in watch.readings.blocks] == [12.0, 30.04, 41.0]


def test_the_seconds_begin_with_the_first_picture(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the rig takes to open on a slow machine."""
    now = 1000.0
    monkeypatch.setattr(benchmarks, "ScriptedOperator", _Operator)
    monkeypatch.setattr("tools.benchmarks.time.monotonic", lambda: now)
    monkeypatch.setattr(_Operator, "started", 0)
    window = _Window()
    watch = WindowWatch(window, 12.0)  # type: ignore[arg-type]
    now = 1050.0
    watch._look()
    watch._weigh()
    assert (window.closed, _Operator.started) == (False, 0)
    assert not watch.readings.memory_mb, "nor is what was there before it opened of any interest"
    frame = Frame(0, now, np.zeros((4, 4, 3), np.uint8))
    window.shown_tick = Tick(frame, Scene(0, now, (4, 4), 1.0), None, None, None, 0, 20.0)
    watch._look()
    now = 1061.0
    watch._look()
    assert (window.closed, _Operator.started) == (False, 1)
    now = 1062.0
    watch._look()
    assert window.closed
    watch.end()
    assert not watch.ended_early
    assert watch.result()["seconds"] == 12.0
    assert [at_s for at_s, _ in watch.readings.memory_mb] == [0.0]


def test_a_rig_that_shows_nothing_is_not_waited_for_for_ever(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(benchmarks, "ScriptedOperator", _Operator)
    monkeypatch.setattr("tools.benchmarks.time.monotonic", lambda: now)
    window = _Window()
    watch = WindowWatch(window, 600.0)  # type: ignore[arg-type]
    now = 1060.0
    watch._look()
    assert window.closed
    assert watch.result() == {"shown_fps": 0.0}
