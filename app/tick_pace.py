"""When a tick is shown: thirty times a second at most; and how old the one is that is on the screen."""

from __future__ import annotations

import time

from PySide6.QtCore import QObject, Qt, QTimer, Signal, Slot

SHOW_EVERY_S = 1.0 / 30.0
_CHECK_EVERY_MS = 100


class TickPace(QObject):
    """``due`` says to show the newest tick now; ``checked`` carries, ten times a second, the seconds since the last was shown."""

    due = Signal()
    checked = Signal(float)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._due_s = 0.0
        self._shown_s = 0.0
        self._later = QTimer(self)
        self._later.setSingleShot(True)
        self._later.setTimerType(Qt.TimerType.PreciseTimer)
        self._later.timeout.connect(self.due)
        self._check = QTimer(self)
        self._check.setInterval(_CHECK_EVERY_MS)
        self._check.timeout.connect(self._on_check)

    def start(self) -> None:
        """Tell the age from now on."""
        self._check.start()

    def stop(self) -> None:
        self._check.stop()
        self._later.stop()

    @Slot()
    def tick_came(self) -> None:
        """It is due now, or when a thirtieth of a second has passed since the last one was."""
        wait_s = self._due_s - time.monotonic()
        if wait_s <= 0.0:
            self.due.emit()
        elif not self._later.isActive():
            self._later.start(int(wait_s * 1000) + 1)

    def tick_shown(self) -> None:
        """A tick is on the screen from now on."""
        self._shown_s = time.monotonic()
        # on average, not at least, a thirtieth apart: a tick that comes early by a hair must not be shown a whole period later
        self._due_s = max(self._due_s, self._shown_s - SHOW_EVERY_S) + SHOW_EVERY_S

    @Slot()
    def _on_check(self) -> None:
        self.checked.emit(time.monotonic() - self._shown_s)
