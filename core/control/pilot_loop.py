"""The pilot's thread: a turn every 20 ms, whatever perception and the window do."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Protocol

from core.control.faults import Cause, Fault
from core.control.pilot import PERIOD_S
from core.host_sleep import SLEPT_S, slept_s

_log = logging.getLogger(__name__)


class Turns(Protocol):
    """What is turned."""

    def tick(self) -> object: ...
    def report(self, fault: Fault) -> None: ...
    def close(self) -> None: ...


class PilotLoop:
    """Turns a pilot until it is closed. When a turn fails the loop ends, ``failure`` says why, and the robot holds by itself.

    `asleep_s` tells how long the computer has been asleep since it was started.
    """

    def __init__(self, pilot: Turns, asleep_s: Callable[[], float] = slept_s) -> None:
        self._pilot, self._asleep_s = pilot, asleep_s
        self._closing = threading.Event()
        self.failure: str | None = None
        self._thread = threading.Thread(target=self._run, name="pilot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the turns, then hold the robot."""
        self._closing.set()
        self._thread.join()
        self._pilot.close()

    def _run(self) -> None:
        due_s = time.monotonic()
        before_s = self._asleep_s()
        try:
            while not self._closing.wait(max(0.0, due_s - time.monotonic())):
                if (now_s := self._asleep_s()) - before_s > SLEPT_S:
                    self._pilot.report(Fault(Cause.CLOCK, f"the computer slept for {now_s - before_s:.0f} s"))
                before_s = now_s
                self._pilot.tick()
                due_s = max(due_s + PERIOD_S, time.monotonic())
        except Exception as error:  # noqa: BLE001 - top of the thread: its silence stops the robot, and this says why
            _log.error("the pilot stopped", exc_info=error)
            self.failure = f"driving stopped by an unexpected {type(error).__name__}: {error}; start the rig again"
