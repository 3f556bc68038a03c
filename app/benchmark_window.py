"""``benchmark --window``: the operator window as it runs, with a robot that is being driven: pace, blocking, memory."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
from PySide6.QtCore import QObject, QTimer

from app.benchmark_command import quantiles
from app.operator_window import OperatorWindow
from app.scripted_operator import ScriptedOperator

_WARM_UP_S = 10.0
_FIRST_WITHIN_S = 60.0
"""A rig that shows nothing for so long is not waited for."""
_LOOK_EVERY_MS = 5


@dataclass(slots=True)
class _Readings:
    shown: int = 0
    last_index: int = -1
    first_shown_s: float | None = None
    dropped: int = 0
    blocks: list[tuple[float, float, str]] = field(default_factory=list)
    bus_p99_ms: float | None = None
    latency_ms: list[float] = field(default_factory=list)
    servo_ms: list[float] = field(default_factory=list)
    memory_mb: list[tuple[float, float]] = field(default_factory=list)


class WindowWatch(QObject):
    """Takes readings, from the first picture on for `seconds`, then closes the window.

    Half of that is driven by hand, the rest handed over.
    """

    def __init__(self, window: OperatorWindow, seconds: float) -> None:
        super().__init__(window)
        self._window = window
        self._seconds = seconds
        self._ended_s = time.monotonic() + _FIRST_WITHIN_S
        self.ended_early = False
        self._process = psutil.Process()
        self.readings = _Readings()
        self._operator = ScriptedOperator(window, seconds / 2.0)
        self._timers: list[QTimer] = []
        for interval_ms, slot in ((_LOOK_EVERY_MS, self._look), (1000, self._weigh)):
            timer = QTimer(self)
            timer.timeout.connect(slot)
            timer.start(interval_ms)
            self._timers.append(timer)

    def _look(self) -> None:
        tick, now = self._window.shown_tick, time.monotonic()
        if tick is not None and tick.frame.index != self.readings.last_index:
            self.readings.last_index = tick.frame.index
            self.readings.shown += 1
            self.readings.dropped = tick.dropped_frames
            self.readings.latency_ms.append((now - tick.frame.captured_s) * 1e3)
            if self.readings.first_shown_s is None:
                self.readings.first_shown_s = now
                self._ended_s = now + self._seconds
                self._weigh()
                self._operator.start()
        view, servo_ms = self._window.desk.view, self.readings.servo_ms
        if view is not None and view.latency_s is not None and servo_ms[-1:] != [view.latency_s * 1e3]:
            servo_ms.append(view.latency_s * 1e3)
        if now >= self._ended_s:
            for timer in self._timers:
                timer.stop()
            self._operator.stop()
            self._window.close()

    def _weigh(self) -> None:
        """Once a second from the first picture on; the heartbeat keeps a block for ten, so one longer than any before is new."""
        seen = self.readings
        if seen.first_shown_s is None:
            return
        at_s = time.monotonic() - seen.first_shown_s
        view, bus, block_ms = self._window.desk.view, self._window.desk.bus, self._window.max_block_ms
        if block_ms > max((ms for _, ms, _ in seen.blocks), default=0.0):
            seen.blocks.append((at_s, block_ms, view.mode.value if view is not None else ""))
        if bus is not None and at_s >= _WARM_UP_S:
            seen.bus_p99_ms = max(seen.bus_p99_ms or 0.0, bus.times.period_p99_ms)
        seen.memory_mb.append((at_s, self._process.memory_info().rss / 2**20))

    def end(self) -> None:
        """The window has gone, perhaps before its time."""
        now = time.monotonic()
        self.ended_early, self._ended_s = now < self._ended_s, min(now, self._ended_s)

    def result(self) -> dict[str, Any]:
        """Pace since the first shown frame; memory 10 s after it, at the end, and its growth per minute in between.

        The bus's cycle is the worst 99th percentile of ten seconds after these; of the blocks, from 10 s before the first frame on,
        those that were the longest so far.
        """
        seen = self.readings
        if seen.first_shown_s is None:
            return {"shown_fps": 0.0}
        lasted_s = max(self._ended_s - seen.first_shown_s, 1e-9)
        steady = [(at, mb) for at, mb in seen.memory_mb if at >= _WARM_UP_S] or seen.memory_mb[-1:]
        span_min = max((steady[-1][0] - steady[0][0]) / 60.0, 1e-9)
        return {
            "seconds": round(lasted_s, 1),
            "shown_fps": round(seen.shown / lasted_s, 2),
            "frames_dropped": seen.dropped,
            "capture_to_screen_ms": quantiles(seen.latency_ms),
            "capture_to_servo_ms": quantiles(seen.servo_ms) if seen.servo_ms else None,
            "driven_by_program_s": round(self._operator.driven_s, 1),
            "bus_cycle_p99_ms": round(seen.bus_p99_ms, 1) if seen.bus_p99_ms is not None else None,
            "gui_max_block_ms": round(seen.blocks[-1][1], 1) if seen.blocks else 0.0,
            "gui_longer_blocks": [{"at_s": round(at_s, 1), "ms": round(ms, 1), "mode": mode} for at_s, ms, mode in seen.blocks],
            "memory_mb": {"after_10_s": round(steady[0][1], 1), "end": round(steady[-1][1], 1)},
            "memory_growth_mb_per_min": round((steady[-1][1] - steady[0][1]) / span_min, 2) if len(steady) > 1 else None,
        }


def measure_window(seconds: float, config_path: Path | None) -> dict[str, Any]:
    """Run the window on the twin for some seconds and tell how it went."""
    from app.application import make_application, quit_on_signal
    from app.window_command import finish_loading, make_window, window_config

    config, kind = window_config("twin", config_path, None)
    application = make_application()
    finish_loading()
    window = make_window(config, kind)
    application.aboutToQuit.connect(window.shut_down)
    window.show()
    window.start()
    watch = WindowWatch(window, seconds)
    signals = quit_on_signal(application)
    application.exec()
    signals.stop()
    watch.end()
    if watch.readings.first_shown_s is None:
        sys.stderr.write("note: no picture was shown; start the window (python main.py) to see why\n")
    elif watch.ended_early:
        sys.stderr.write(f"note: closed before its {seconds:g} s; the figures are of the time until then\n")
    return watch.result()
