"""Starts the twin's process, which loads its modules for seconds and then waits for the twin that it shall be."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
from typing import Any

from core.config import Config
from core.devices import DeviceError
from hardware.child_process import start_child

_MODULE = "hardware.twin.twin_process"
_START_S, _END_S = 60.0, 5.0


class TwinProcess:
    """The process with its shared memory (a file of no length yet) and the pipe that tells of a new picture.

    Raises
    ------
    DeviceError
        When it cannot be started: no memory, no descriptors.
    """

    def __init__(self) -> None:
        try:
            with contextlib.ExitStack() as undo, contextlib.ExitStack() as always:
                self.memory_fd = os.memfd_create("bench_twin", os.MFD_CLOEXEC)
                undo.callback(os.close, self.memory_fd)
                self.wake, wake_end = os.pipe()
                undo.callback(os.close, self.wake)
                always.callback(os.close, wake_end)
                self._process = start_child(_MODULE, (self.memory_fd, wake_end), talks=True)
                self._files = undo.pop_all()
        except OSError as error:
            raise DeviceError(f"the bench twin cannot be started ({error.strerror}): free memory, then try again") from None
        self._has_begun = False
        self.pid = self._process.pid

    def begin(self, config: Config, insertion_mm: float) -> dict[str, Any]:
        """Say what twin it shall be, with the memory in its length; returns what it answers, empty when it is gone."""
        assert self._process.stdin is not None
        self._has_begun = True
        message = {"config": config.model_dump(mode="json"), "insertion_mm": insertion_mm}
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        return self.said(_START_S)

    def said(self, timeout_s: float) -> dict[str, Any]:
        """The next line of the process; empty when there is none."""
        assert self._process.stdout is not None
        ready, _, _ = select.select([self._process.stdout], [], [], timeout_s)
        line = self._process.stdout.readline() if ready else b""
        try:
            found = json.loads(line) if line else {}
        except ValueError:
            found = {}
        return found if isinstance(found, dict) else {}

    def exit_code(self) -> int | None:
        """None while it runs."""
        return self._process.poll()

    def end(self) -> None:
        """The end of its input ends it; while it only loads there is nothing to wait for. May be called twice."""
        if not self._has_begun:
            self._process.kill()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._files.close()
