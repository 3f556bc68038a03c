"""A software foot pedal on a pseudo-terminal with fault injection."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import tempfile
import threading
import time
import tty
from pathlib import Path

from hardware.inputs.pedal import NUMBERS, PERIOD_S, PedalLine, line_bytes

_STOP_REPORTS = 5
"""Number of reports with STOP after even the shortest press, as in the firmware (resources/pedal)."""


class SoftPedal:
    """Two switches and the firmware that reports them on ``port`` every 20 ms. A context manager that starts and stops it.

    All methods may be called from any thread.
    """

    def __init__(self, seed: int = 0) -> None:
        self._random = random.Random(seed)
        self._lock = threading.RLock()
        self._number = 0
        self._deadman_closed = False
        self._stop_closed = True
        self._stop_wire = True
        self._stop_left = 0
        self._estop = False
        self._muted = self._stuck = False
        self._damaged = 0
        self._noise = b""
        self._folder: Path | None = None
        self._pty: tuple[int, int] | None = None
        self._end = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> SoftPedal:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def port(self) -> str:
        """Path of the serial port; the same after ``vanish`` and ``reappear``.

        Raises
        ------
        RuntimeError
            When the pedal has not been started.
        """
        if self._folder is None:
            raise RuntimeError("start the pedal first")
        return str(self._folder / "pedal")

    def start(self) -> None:
        """Open the port and report; does nothing when it runs."""
        if self._thread is None:
            self._folder = Path(tempfile.mkdtemp(prefix="lumenpilot_pedal_"))
            self._end.clear()
            self.reappear()
            self._thread = threading.Thread(target=self._run, name="twin-pedal", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Close the port; may be called twice."""
        if self._thread is not None:
            self._end.set()
            self._thread.join()
            self._thread = None
            self.vanish()
            shutil.rmtree(str(self._folder), ignore_errors=True)
            self._folder = None

    def press(self) -> None:
        """Close the dead-man switch."""
        self._deadman_closed = True

    def release(self) -> None:
        self._deadman_closed = False

    def press_stop(self) -> None:
        """Press STOP, which opens its normally closed switch."""
        self._stop_left = _STOP_REPORTS
        self._stop_closed = False

    def release_stop(self) -> None:
        self._stop_closed = True

    def press_estop(self) -> None:
        """Open the second contact of the E-stop button."""
        self._estop = True

    def release_estop(self) -> None:
        self._estop = False

    def break_stop_wire(self, broken: bool = True) -> None:
        self._stop_wire = not broken

    def mute(self, on: bool = True) -> None:
        """A hanging firmware: nothing is sent."""
        self._muted = on

    def stick(self, on: bool = True) -> None:
        """The same report number again and again, as from a stale buffer."""
        self._stuck = on

    def damage(self, count: int) -> None:
        """Flip one bit in each of the next `count` reports."""
        self._damaged = count

    def garbage(self, count: int) -> None:
        """Send `count` random bytes before the next report."""
        self._noise = self._random.randbytes(count)

    def vanish(self) -> None:
        """Unplug: the port disappears."""
        with self._lock:
            if self._pty is not None:
                Path(self.port).unlink(missing_ok=True)
                for end in self._pty:
                    os.close(end)
                self._pty = None

    def reappear(self) -> None:
        """Plug it in again, at the same path. The firmware restarts."""
        with self._lock:
            if self._pty is None:
                # The open slave end keeps the line alive between two programs.
                master, slave = os.openpty()
                tty.setraw(slave)
                os.set_blocking(master, False)
                Path(self.port).symlink_to(os.ttyname(slave))
                self._pty = master, slave
                self._number = 0

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._end.wait(max(0.0, due_s - time.monotonic())):
            due_s = max(due_s + PERIOD_S, time.monotonic())
            with self._lock:
                self._report()

    def _report(self) -> None:
        """Send one report."""
        if not (self._stop_closed and self._stop_wire):
            self._stop_left = _STOP_REPORTS
        line = bytearray(line_bytes(PedalLine(self._number, self._deadman_closed, self._stop_left > 0, self._estop)))
        self._stop_left = max(0, self._stop_left - 1)
        if not self._stuck:
            self._number = (self._number + 1) % NUMBERS
        if self._damaged:
            self._damaged -= 1
            line[self._random.randrange(len(line) - 1)] ^= 1 << self._random.randrange(8)
        noise, self._noise = self._noise, b""
        if self._pty is not None and not self._muted:
            with contextlib.suppress(BlockingIOError):  # no reader: the buffer is full, and the bytes are lost
                os.write(self._pty[0], noise + bytes(line))
