"""A thread that serves one input device: it waits for bytes or for the time, and can be ended at once."""

from __future__ import annotations

import logging
import math
import os
import select
import threading
from collections.abc import Callable

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
