"""Processes of our own beside the application's: the servo bus and the twin.

A slot of depth one between two processes: the newest value wins, and neither side ever waits for the other.

A thread that serves one input device: it waits for bytes or for the time, and can be ended at once.
"""

from __future__ import annotations

import logging
import math
import mmap
import os
import select
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]


def start_child(module: str, ends: Sequence[int], *arguments: str, talks: bool = False) -> subprocess.Popen[bytes]:
    """``python -m module``, whose first arguments are the file descriptors `ends`, which it inherits; raises OSError.

    In a session of its own: Ctrl-C and Ctrl-Z in the application's terminal do not reach it. One that `talks` has pipes for its
    standard input and output, others have none.
    """
    path = os.pathsep.join(filter(None, (str(_ROOT), os.environ.get("PYTHONPATH", ""))))
    quiet = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    stream = subprocess.PIPE if talks else subprocess.DEVNULL
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, *map(str, ends), *arguments],
        stdin=stream,
        stdout=stream,
        pass_fds=ends,
        start_new_session=True,
        env={**os.environ, **quiet, "PYTHONPATH": path},
    )


_HEAD = struct.Struct("<QII")  # sequence number from 1, length, CRC over both and the data
_KEY = struct.Struct("<QI")
_TRIES = 4


class SharedSlot:
    """One writer, one reader, in shared memory.

    Parameters
    ----------
    memory : mapped in both processes.
    offset, capacity : the slot's place, and how many bytes a value may have.

    Notes
    -----
    No lock: a process that is stopped or killed while it holds one stops the other. Values go in turn into two halves, each with a
    checksum; a half that is being written, or was left half-written, is no value, and the other one still holds the value before.
    """

    def __init__(self, memory: mmap.mmap, offset: int, capacity: int) -> None:
        self._memory = memory
        self._offset = offset
        self._capacity = capacity
        self._written = 0
        self._read: tuple[int, bytes] | None = None

    @staticmethod
    def size(capacity: int) -> int:
        """Bytes of memory for values of `capacity` bytes."""
        return 2 * (_HEAD.size + capacity)

    def put(self, data: bytes) -> None:
        """Replace the value.

        Raises
        ------
        ValueError
            When it is longer than the slot.
        """
        if len(data) > self._capacity:
            raise ValueError(f"{len(data)} bytes do not fit into a slot of {self._capacity}")
        self._written += 1
        at = self._half(self._written)
        check = zlib.crc32(data, zlib.crc32(_KEY.pack(self._written, len(data))))
        self._memory[at : at + _HEAD.size] = bytes(_HEAD.size)
        self._memory[at + _HEAD.size : at + _HEAD.size + len(data)] = data
        self._memory[at : at + _HEAD.size] = _HEAD.pack(self._written, len(data), check)

    def newest(self) -> tuple[int, bytes] | None:
        """Number and bytes of the newest whole value; None before the first."""
        known = self._read[0] if self._read is not None else 0
        for _ in range(_TRIES):
            numbers = sorted(((self._number(half), half) for half in (0, 1)), reverse=True)
            if numbers[0][0] == known:
                break
            found = next((value for _, half in numbers if (value := self._whole(half)) is not None), None)
            if found is not None and found[0] >= known:
                self._read = found
                break
        return self._read

    def _number(self, half: int) -> int:
        """What a half says it holds; 0 while it is being written."""
        at = self._half(half)
        number: int = _HEAD.unpack(self._memory[at : at + _HEAD.size])[0]
        return number

    def _half(self, number: int) -> int:
        return self._offset + (number % 2) * (_HEAD.size + self._capacity)

    def _whole(self, half: int) -> tuple[int, bytes] | None:
        at = self._half(half)
        number, length, check = _HEAD.unpack(self._memory[at : at + _HEAD.size])
        if number == 0 or length > self._capacity:
            return None
        data = self._memory[at + _HEAD.size : at + _HEAD.size + length]
        return (number, data) if zlib.crc32(data, zlib.crc32(_KEY.pack(number, length))) == check else None


_log = logging.getLogger(__name__)


class DeviceThread:
    """Runs `serve` until it returns; `serve` waits only by ``wait`` and returns soon after ``stopping`` turned True.

    Parameters
    ----------
    name : of the thread.
    serve : what it does; called in the thread.
    failed : called in the thread with what `serve` raised: the one thing that must be seen is that nobody serves any more.
    """

    def __init__(self, name: str, serve: Callable[[], None], failed: Callable[[Exception], None]) -> None:
        self._name = name
        self._serve = serve
        self._failed = failed
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._wake = (-1, -1)

    @property
    def stopping(self) -> bool:
        return self._stop.is_set()

    def start(self) -> None:
        """Start; does nothing when it runs."""
        if self._thread is None:
            self._stop.clear()
            self._wake = os.pipe()
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and wait for that; may be called twice, but not from within `serve`."""
        if self._thread is not None:
            self._stop.set()
            os.write(self._wake[1], b"!")
            self._thread.join()
            self._thread = None
            for end in self._wake:
                os.close(end)

    def wait(self, device: int | None, timeout_s: float) -> bool:
        """Wait until the file descriptor `device` can be read or is lost (True), for `timeout_s` at most, or for ``close``."""
        poll = select.poll()  # select would refuse a file descriptor above 1023
        poll.register(self._wake[0], select.POLLIN)
        if device is not None:
            poll.register(device, select.POLLIN)
        ready = [end for end, _ in poll.poll(math.ceil(1000.0 * max(0.0, timeout_s)))]
        return device in ready and not self.stopping

    def _run(self) -> None:
        try:
            self._serve()
        except Exception as error:  # noqa: BLE001 - top of the thread
            _log.exception("the thread %s ended", self._name)
            self._failed(error)
