"""The bus process's end of the link: what the application wants now, whether it stops us, and whether it still lives."""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import pickle
import select
import socket
import time
from dataclasses import dataclass, field
from typing import Any

from hardware.servos.bus_messages import BusStatus, Heartbeat, Order, unpack_heartbeat, unpack_order
from hardware.servos.bus_start import MEMORY_BYTES, slots

_PIPE_BYTES = 65_536
_LOOK_S = 1.0
"""So often it is looked whether the application is still there, before it has said anything."""


@dataclass(frozen=True, slots=True)
class Request:
    """Something that the application wants done, and answered."""

    id: int
    what: str
    details: dict[str, Any] = field(default_factory=dict)


class GuardEnd:
    """Only ``first_message`` and ``wait`` wait.

    Parameters
    ----------
    memory_fd, line_fd, socket_fd : inherited from the application, which is the process `parent`; taken over.
    """

    def __init__(self, memory_fd: int, line_fd: int, socket_fd: int, parent: int) -> None:
        self._parent = parent
        self._memory = mmap.mmap(memory_fd, MEMORY_BYTES)
        os.close(memory_fd)
        self._line = line_fd
        os.set_blocking(line_fd, False)
        self._socket = socket.socket(fileno=socket_fd)
        self._order, self._heartbeat, self._status = slots(self._memory)
        self._poll = select.poll()
        self._poll.register(line_fd, select.POLLIN)
        self._poll.register(socket_fd, select.POLLIN)
        self._gone = False

    @property
    def is_alone(self) -> bool:
        """The application is gone: its ends are closed, or, should a child of it keep them open, it is no longer our parent."""
        return self._gone or os.getppid() != self._parent

    def first_message(self) -> dict[str, Any] | None:
        """The configuration; None when the application was gone before it could say it. It may take as long as it likes.

        One that said it and is gone is no reason to end at once: with it may have come a request or STOP, which is still owed.
        """
        self._socket.settimeout(_LOOK_S)
        while True:
            try:
                message = json.loads(self._socket.recv(_PIPE_BYTES) or b"null")
            except TimeoutError:  # started ahead, and not needed yet
                if self.is_alone:
                    return None
            except (OSError, ValueError):
                return None
            else:
                self._socket.setblocking(False)
                return message if isinstance(message, dict) else None

    def wait(self, timeout_s: float) -> tuple[bool, bool]:
        """Until there is news or the time is over: is there some in the pipe for STOP, is there a request?"""
        ready = {fd for fd, _ in self._poll.poll(max(0.0, timeout_s) * 1000.0)}
        return self._line in ready, self._socket.fileno() in ready

    def take_stop(self) -> bool:
        """Whether somebody pressed STOP since the last call. The pipe's end sets ``is_alone``."""
        with contextlib.suppress(BlockingIOError):
            data = os.read(self._line, _PIPE_BYTES)
            self._gone = self._gone or not data
            return bool(data)
        return False

    def take_request(self) -> Request | None:
        """The next request; None when there is none, or it is not to be understood."""
        try:
            data = self._socket.recv(_PIPE_BYTES)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        if not data:
            self._gone = True
            return None
        with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
            message = json.loads(data)
            return Request(int(message.pop("id")), str(message.pop("do")), message)
        return None

    def answer(self, request: Request, error: Exception | None) -> None:
        """Tell how a request ended. An application that does not listen gets no answer."""
        self._say({"id": request.id, "error": None if error is None else [type(error).__name__, str(error)]})

    def last_words(self, text: str) -> None:
        """Why this process ends."""
        self._say({"id": 0, "fatal": text})

    def _say(self, message: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):
            self._socket.send(json.dumps(message).encode(), socket.MSG_DONTWAIT)

    def order(self) -> Order | None:
        found = self._order.newest()
        return unpack_order(found[1]) if found is not None else None

    def heartbeat(self) -> Heartbeat | None:
        """The newest heartbeat; one from the future is none."""
        found = self._heartbeat.newest()
        beat = unpack_heartbeat(found[1]) if found is not None else None
        return beat if beat is not None and beat.time_s <= time.monotonic() else None

    def publish(self, status: BusStatus) -> None:
        self._status.put(pickle.dumps(status, pickle.HIGHEST_PROTOCOL))

    def close(self) -> None:
        self._socket.close()
        self._memory.close()
        with contextlib.suppress(OSError):
            os.close(self._line)
