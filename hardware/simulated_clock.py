"""The clock of a simulated bench: it runs with the wall clock, and stands still while the program cannot keep up.

The twin's process sets it (``WorldClock``); pilot, gate and pictures of that bench take their times from it (``SimulatedClock``).
All ages are then those of the simulated bench: its limits stay as they are, and a slow computer makes the simulation slow. A rig
with real devices has no such clock.
"""

from __future__ import annotations

import math
import mmap
import os
import struct
import tempfile
import threading
import time
from pathlib import Path

from core.devices import DeviceError
from hardware.processes import SharedSlot

STEP_S = 0.02
"""The world's step: between two of them readers go on with the wall clock, one step at most."""
_CATCH_UP_S = 0.06
"""A world that was late for longer does not make up for it: its clock falls behind the wall clock."""
_PATIENCE_S = 10.0
"""The world waits so long for a program that does not get on, then goes by itself: what hangs must become a fault."""
_SPEED_OVER_S = 2.0
"""Over which the speed of the simulation is measured."""
_TIME, _GRANT = struct.Struct("<2d"), struct.Struct("<d")
_SLOTS = (_TIME.size, _GRANT.size)
_SIZE = sum(map(SharedSlot.size, _SLOTS))


def _open(file: str) -> list[SharedSlot]:
    descriptor = os.open(file, os.O_RDWR)
    try:
        return SharedSlot.row(mmap.mmap(descriptor, _SIZE), _SLOTS)
    finally:
        os.close(descriptor)


def _now_s(world_s: float, behind_s: float) -> float:
    """The time at which the world has made its steps until `world_s`, and is behind the wall clock by `behind_s`."""
    return min(max(time.monotonic() - behind_s, world_s), world_s + STEP_S)


class SimulatedClock:
    """Seconds; never goes back. From any thread. `file` is that of another reader; None makes one, until ``close``.

    Raises DeviceError: no file can be made or opened.
    """

    def __init__(self, file: str | None = None) -> None:
        self._made = file is None
        try:
            if file is None:
                descriptor, file = tempfile.mkstemp(prefix="lumenpilot_clock_")
                os.write(descriptor, bytes(_SIZE))
                os.close(descriptor)
            self.file = file
            self._time, self._grant = _open(file)
        except OSError as error:
            raise DeviceError(f"the bench twin cannot be started ({error.strerror}): free memory, then try again") from None
        self._lock = threading.Lock()
        self._last_s = 0.0
        self._mark: tuple[float, float] | None = None
        self._speed = 1.0

    def __call__(self) -> float:
        with self._lock:
            found = self._time.newest()
            now_s = _now_s(*_TIME.unpack(found[1])) if found is not None else time.monotonic()
            self._last_s = max(self._last_s, now_s)
            return self._last_s

    def grant(self, until_s: float) -> None:
        """Let the world go on until `until_s`; to be repeated, by one thread. Before the first call it goes on by itself."""
        self._grant.put(_GRANT.pack(until_s))

    @property
    def speed(self) -> float:
        """Simulated seconds per second, 0..1, over the last two; for one caller, who asks some times a second."""
        at = time.monotonic(), self()
        if self._mark is None:
            self._mark = at
        elif (passed_s := at[0] - self._mark[0]) >= _SPEED_OVER_S:
            self._speed = min(1.0, (at[1] - self._mark[1]) / passed_s)
            self._mark = at
        return self._speed

    def close(self) -> None:
        """Remove the file."""
        if self._made:
            Path(self.file).unlink(missing_ok=True)


class WorldClock:
    """The end of the world that sets the time; a call reads it, from any thread.

    Without the `file` of the program's ``SimulatedClock`` nothing else reads the time, and nothing is waited for.
    """

    def __init__(self, file: str | None = None) -> None:
        self._time: SharedSlot | None = None
        self._grant: SharedSlot | None = None
        if file is not None:
            self._time, self._grant = _open(file)
        self._granted_s = self._granted_at_s = -math.inf
        self.begin()

    def __call__(self) -> float:
        return _now_s(*self._state)

    @property
    def world_s(self) -> float:
        """Time of the last step."""
        return self._state[0]

    def begin(self) -> None:
        """The steps begin now."""
        self._state = time.monotonic(), 0.0
        self._publish()

    def wait_s(self) -> float:
        """How long until the next step, or until it is worth asking again; 0: it was taken just now, and is to be made."""
        now_s, (world_s, behind_s) = time.monotonic(), self._state
        behind_s = max(behind_s, now_s - world_s - _CATCH_UP_S)
        self._state = world_s, behind_s
        if (left_s := world_s + STEP_S - (now_s - behind_s)) > 0.0:
            return left_s
        if self._must_wait(now_s):
            self._state = world_s, now_s - world_s - STEP_S
            return STEP_S / 10.0
        self._state = world_s + STEP_S, behind_s
        self._publish()
        return 0.0

    def _must_wait(self, now_s: float) -> bool:
        found = self._grant.newest() if self._grant is not None else None
        if found is None:
            return False
        (granted_s,) = _GRANT.unpack(found[1])
        if granted_s > self._granted_s:
            self._granted_s, self._granted_at_s = granted_s, now_s
        is_far_enough = granted_s >= self._state[0] + 2 * STEP_S  # readers go on by a step
        return not is_far_enough and now_s - self._granted_at_s <= _PATIENCE_S

    def _publish(self) -> None:
        if self._time is not None:
            self._time.put(_TIME.pack(*self._state))
