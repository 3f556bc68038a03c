"""Measures how long the GUI thread was blocked."""

from __future__ import annotations

import time
from collections import deque

from PySide6.QtCore import QObject, Qt, QTimer, Slot

INTERVAL_MS = 10


class Heartbeat(QObject):
    """A timer of 10 ms in the GUI thread; a beat that comes late by x ms means that the thread was busy for about x ms."""

    def __init__(self, window_s: float = 10.0, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._window_s = window_s
        self._late: deque[tuple[float, float]] = deque()
        self._last_s: float | None = None
        self._timer = QTimer(self)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.setInterval(INTERVAL_MS)
        self._timer.timeout.connect(self._beat)

    def start(self) -> None:
        self._last_s = None
        self._late.clear()
        self._timer.start()

    def stop(self) -> None:
        self._timer.stop()

    @property
    def max_block_ms(self) -> float:
        """Longest block of the last ``window_s`` seconds."""
        return max((late for _, late in self._late), default=0.0)

    @Slot()
    def _beat(self) -> None:
        now = time.monotonic()
        if self._last_s is not None:
            late_ms = max(0.0, (now - self._last_s) * 1000.0 - INTERVAL_MS)
            # a falling maximum: an older and shorter block can never be the maximum again
            while self._late and self._late[-1][1] <= late_ms:
                self._late.pop()
            self._late.append((now, late_ms))
        while self._late and self._late[0][0] < now - self._window_s:
            self._late.popleft()
        self._last_s = now
