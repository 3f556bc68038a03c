"""The application's end of the bus process: talks to it, and notices when it is gone. Only ``request`` waits."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import pickle
import select
import signal
import subprocess
import threading
import time
from typing import Any

from core.safety_config import SafetyConfig
from core.servo_config import ServosConfig
from hardware.servos import errors
from hardware.servos.bus_messages import BusStatus, Heartbeat, Order, pack_heartbeat, pack_order
from hardware.servos.bus_start import BusProcess, slots
from hardware.servos.errors import BusProcessLost, ServoError

STOP = b"S"
_log = logging.getLogger(__name__)
END_S = 5.0
"""Longer than a torque-off that is owed is tried at the end."""
_MESSAGE_BYTES = 65_536


class BusLink:
    """A running bus process: one that was started before, or a new one. Methods may be called from any thread.

    Three ways lead to it: shared memory for what is repeated (orders, heartbeats, status), a socket for requests with an answer,
    and a pipe of its own for STOP. A byte in that pipe means stop; its end means that the application is gone, however it went.

    Raises
    ------
    BusProcessLost
        When the process cannot be started.
    """

    def __init__(self, servos: ServosConfig, safety: SafetyConfig, process: BusProcess | None = None) -> None:
        self._lock = threading.Lock()
        self._asking = threading.Lock()
        self._asked = 0
        self._fatal = ""
        self._closed = False
        if process is not None and process.process.poll() is not None:  # gone while it waited, with no servos to lose
            process.end()
            process = None
        started = process or BusProcess()
        started.take_over()
        self._process, self._memory, self._line, self._socket = started.process, started.memory, started.line, started.socket
        self._order, self._heartbeat, self._status = slots(self._memory)
        self._newest: tuple[int, BusStatus] | None = None
        with contextlib.suppress(OSError):  # a process that is gone already is found out by the first request
            self._socket.send(json.dumps({"servos": servos.model_dump(), "safety": safety.model_dump()}).encode())

    @property
    def pid(self) -> int:
        """Process id of the bus process."""
        return self._process.pid

    @property
    def failure(self) -> str | None:
        """One line when the bus process is gone though nobody closed it; None while it runs."""
        code = self._process.poll()
        if code is None or self._closed:
            return None
        self._hear()
        how = self._fatal or (f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}")
        return f"the servo bus process ended ({how}): the servos stopped by themselves; connect the robot again"

    def put_order(self, order: Order) -> None:
        """Replace the newest order."""
        with self._lock:
            if not self._closed:
                self._order.put(pack_order(order))

    def put_heartbeat(self, beat: Heartbeat) -> None:
        """Say that the application is well."""
        with self._lock:
            if not self._closed:
                self._heartbeat.put(pack_heartbeat(beat))

    def stop(self) -> None:
        """STOP. Never fails: a full pipe is full of stops, and behind a closed one nobody moves the servos."""
        with self._lock:
            if not self._closed:
                with contextlib.suppress(OSError):
                    os.write(self._line, STOP)

    def status(self) -> BusStatus | None:
        """The newest status, the last one also when the process is gone; None before the first."""
        with self._lock:
            if not self._closed and (found := self._status.newest()) is not None:
                number, data = found
                if self._newest is None or self._newest[0] != number:
                    self._newest = number, pickle.loads(data)
            return self._newest[1] if self._newest is not None else None

    def request(self, what: str, timeout_s: float, **details: Any) -> None:
        """Have the bus process do something, and wait for it.

        Raises
        ------
        ServoError
            What kept it from being done, of the type that it had there.
        BusProcessLost
            The process is gone, or did not answer in time.
        """
        with self._asking:
            self._asked += 1
            message = json.dumps({"id": self._asked, "do": what, **details}).encode()
            try:
                if self._closed:
                    raise BusProcessLost("the robot is not connected: connect it first")
                self._socket.send(message)
                error = self._answer(self._asked, timeout_s)
            except BlockingIOError:
                raise BusProcessLost("the servo bus process does not listen: connect the robot again") from None
            except OSError:
                raise BusProcessLost(self._gone()) from None
        if error is not None:
            kind = getattr(errors, error[0], ServoError)
            raise kind(error[1]) if isinstance(kind, type) and issubclass(kind, ServoError) else ServoError(error[1])

    def _answer(self, number: int, timeout_s: float) -> list[str] | None:
        """The answer to a request: None, or type and text of the error."""
        until = time.monotonic() + timeout_s
        while (left_s := until - time.monotonic()) > 0.0:
            ready, _, _ = select.select([self._socket], [], [], left_s)
            if ready and (data := self._socket.recv(_MESSAGE_BYTES)) == b"":
                raise ConnectionResetError
            if ready:
                answer = json.loads(data)
                self._fatal = answer.get("fatal", self._fatal)
                if answer.get("id") == number:
                    return answer["error"]  # type: ignore[no-any-return]
        raise BusProcessLost(f"the servo bus process did not answer within {timeout_s:g} s: connect the robot again")

    def _hear(self) -> None:
        """Take in why the process ended, unless somebody who waits for an answer does."""
        if self._asking.acquire(blocking=False):
            self._drain()
            self._asking.release()

    def _drain(self) -> None:
        """Read all that the process still said. When it left requests of ours unread, the first try fails, the second does not."""
        for _ in range(2):
            with contextlib.suppress(OSError, ValueError):
                while data := self._socket.recv(_MESSAGE_BYTES):
                    self._fatal = json.loads(data).get("fatal", self._fatal)

    def _gone(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(END_S)
        self._drain()
        return self.failure or "the servo bus process does not talk any more: connect the robot again"

    def close(self, patience_s: float = END_S) -> None:
        """Let the process hold the servos and end; kill it when it does not in so long. May be called twice."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            with contextlib.suppress(OSError):
                self._socket.send(b'{"id": 0, "do": "end"}')  # a forked child of ours may keep the pipe open
            os.close(self._line)
        try:
            self._process.wait(patience_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            _log.error("the servo bus process did not end and was killed: the servos hold by their own watchdogs")
        with self._asking:
            told = self._fatal
            self._drain()
            self._socket.close()
        if self._fatal != told:
            _log.error(self._fatal)
        with self._lock:
            self._memory.close()
