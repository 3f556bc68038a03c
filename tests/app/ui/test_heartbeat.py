"""How long the window could not react."""

from __future__ import annotations

import time

import pytest
from pytestqt.qtbot import QtBot

from app.ui import window_base
from app.ui.window_base import GuiLatencyMonitor


def test_a_busy_slot_is_measured(qtbot: QtBot) -> None:
    beat, began_s = GuiLatencyMonitor(), time.monotonic()
    beat.start()
    qtbot.wait(60)
    time.sleep(0.15)  # what a slow slot does
    qtbot.wait(40)
    assert 120 <= beat.max_block_ms <= 1000 * (time.monotonic() - began_s), "in milliseconds"
    beat.stop()


def test_blocks_are_forgotten_after_the_window(monkeypatch: pytest.MonkeyPatch, qtbot: QtBot) -> None:
    now = [50.0]
    monkeypatch.setattr(window_base.time, "monotonic", lambda: now[0])
    beat = GuiLatencyMonitor(window_s=10.0)
    for step_s in (0.0, 0.010, 0.110, 0.010, 0.060):
        now[0] += step_s
        beat._beat()
    assert beat.max_block_ms == pytest.approx(100.0)
    now[0] += 10.0 - 0.065
    beat._last_s = now[0] - 0.010
    beat._beat()
    assert beat.max_block_ms == pytest.approx(50.0), "the block of 100 ms is older than ten seconds"
