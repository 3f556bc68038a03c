"""``benchmark --window``: the real window on the twin, driven for some seconds, tells its pace."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QObject
from pytestqt.qtbot import QtBot

from app import benchmark_window
from app.benchmark_window import WindowWatch
from core.control.drive_view import DriveView

ROOT = Path(__file__).parents[2]


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

    def __init__(self, window: QObject, after_s: float) -> None: ...
    def start(self) -> None: ...


class _Desk:
    view: DriveView | None = None
    bus = None


class _Window(QObject):
    desk = _Desk()
    shown_tick = None
    max_block_ms = 0.0


def test_only_blocks_that_are_longer_than_all_before_are_told(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark_window, "ScriptedOperator", _Operator)
    window = _Window()
    watch = WindowWatch(window, 600.0)  # type: ignore[arg-type]
    for block_ms in (12.0, 30.04, 30.04, 20.0, 41.0):
        window.max_block_ms = block_ms
        watch._weigh()
    assert [ms for _, ms, _ in watch.readings.blocks] == [12.0, 30.04, 41.0]
    assert watch.result() == {"shown_fps": 0.0}, "nothing was shown"
