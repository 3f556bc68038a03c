"""The application's end of the bus process: talks to it, and notices when it is gone. Only ``request`` waits.

The bus process's end of the link: what the application wants now, whether it stops us, and whether it still lives.

Starts the servo bus's process, which loads its modules for half a second and then waits for the servos that it shall guard.

What application and bus process tell each other. Towards the bus process fixed bytes only: it believes nothing that it reads.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import mmap
import os
import pickle
import select
import signal
import socket
import struct
import subprocess
import threading
import time
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from core.config.safety import JointName, SafetyConfig, ServosConfig
from core.control.faults import Cause, Fault
from core.control.gate import Clamp, Rejection, RejectReason, Source
from core.control.joints import Joints
from core.types import Command
from hardware.processes import SharedSlot, start_child
from hardware.servos import dynamixel_port
from hardware.servos.dynamixel_port import BusProcessLost, LineCounts, ServoError
from hardware.servos.registers import ServoReading

SMALL_BYTES, STATUS_BYTES = 64, 65_536
MEMORY_BYTES = 2 * SharedSlot.size(SMALL_BYTES) + SharedSlot.size(STATUS_BYTES)
_MODULE = "hardware.servos.bus_process"


def slots(memory: mmap.mmap) -> tuple[SharedSlot, SharedSlot, SharedSlot]:
    """Order, heartbeat and status in the shared memory."""
    small = SharedSlot.size(SMALL_BYTES)
    return (
        SharedSlot(memory, 0, SMALL_BYTES),
        SharedSlot(memory, small, SMALL_BYTES),
        SharedSlot(memory, 2 * small, STATUS_BYTES),
    )


class BusProcess:
    """The process and our ends of the three ways to it: ``memory``, ``line`` for STOP, ``socket``. A ``BusLink`` takes it over.

    Raises
    ------
    BusProcessLost
        When it cannot be started: no memory, no descriptors.
    """

    def __init__(self) -> None:
        try:
            with contextlib.ExitStack() as undo, contextlib.ExitStack() as theirs:
                memory_fd = os.memfd_create("servo_bus", os.MFD_CLOEXEC)
                theirs.callback(os.close, memory_fd)
                os.ftruncate(memory_fd, MEMORY_BYTES)
                self.memory = undo.enter_context(mmap.mmap(memory_fd, MEMORY_BYTES))
                line_end, self.line = os.pipe()
                theirs.callback(os.close, line_end)
                undo.callback(os.close, self.line)
                self.socket, socket_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                theirs.callback(socket_end.close)
                undo.callback(self.socket.close)
                self.process = start_child(_MODULE, (memory_fd, line_end, socket_end.fileno()), str(os.getpid()))
                self._ours = undo.pop_all()
        except OSError as error:
            raise BusProcessLost(
                f"the servo bus process cannot be started ({error.strerror}): free memory, then try again"
            ) from None
        os.set_blocking(self.line, False)
        self.socket.setblocking(False)
        self._is_taken = False

    def take_over(self) -> None:
        """From now on it is the caller's to end."""
        self._is_taken = True

    def end(self) -> None:
        """Where nobody took it over: it knows of no servos, so that it may be killed. May be called twice."""
        if self._is_taken:
            return
        self.process.kill()
        self.process.wait()
        self._ours.close()


class BusPhase(StrEnum):
    """Where the bus process is. Into ARMED leads only a request; out of STOPPED and of a latched fault only an acknowledgement."""

    CLOSED = "port closed"
    DISARMED = "disarmed"
    ARMED = "armed"
    STOPPED = "stopped"
    QUIET = "quiet"


@dataclass(frozen=True, slots=True)
class BusOrder:
    """The newest wish. ``command`` None: hold. Times are monotonic; ``captured_s`` is that of the frame behind it."""

    command: Command | None
    source: Source
    issued_s: float
    captured_s: float | None = None


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """The application was well at ``time_s``, and so-and-so may drive (None: nobody)."""

    time_s: float
    permitted: Source | None


@dataclass(frozen=True, slots=True)
class IssuedGoals:
    """The goals that left the gate last, the motion that they are, and the order behind them.

    ``order`` None: it was a hold, or nothing has left the gate since, and the servos keep these goals.
    """

    goals_mm: Joints
    motion: Command
    time_s: float
    order: BusOrder | None

    def kept(self) -> IssuedGoals:
        """The same while nothing new is written: these goals stay, and nobody moves anything."""
        return replace(self, motion=Command(self.motion.bend, self.motion.pitch), order=None)


@dataclass(frozen=True, slots=True)
class CycleTimes:
    """Of the last ten seconds. ``period`` is from one cycle's start to the next one's, ``work`` the cycle itself."""

    period_p50_ms: float = 0.0
    period_p99_ms: float = 0.0
    work_p50_ms: float = 0.0
    work_p99_ms: float = 0.0


@dataclass(frozen=True, slots=True)
class BusStatus:
    """One cycle of the bus process.

    Attributes
    ----------
    servos : readings in the order of the joints; empty when none were taken in this cycle (port closed, quiet).
    active, latched : faults now, and the first cause of the last disarming.
    fault_counts : how often each cause came up.
    bad_packets, restarts : damaged answers and lost set-ups of servos, counted since the process began.
    rejection, clamps, at_end : what the gate said in this cycle.
    rejections, clamp_count : the same counted.
    zeroed : by joint.
    torque_offs : how often the torque was switched off and read back; ``torque_problem`` why one that is owed is not proven yet.
    """

    cycle: int
    time_s: float
    phase: BusPhase
    servos: tuple[ServoReading, ...]
    active: tuple[Fault, ...]
    latched: Fault | None
    fault_counts: dict[Cause, int]
    sent: IssuedGoals | None
    rejection: Rejection | None
    clamps: tuple[Clamp, ...]
    at_end: tuple[JointName, ...]
    rejections: dict[RejectReason, int]
    clamp_count: int
    line: LineCounts
    bad_packets: int
    restarts: int
    times: CycleTimes
    zeroed: tuple[bool, ...]
    torque_offs: int = 0
    torque_problem: str = ""

    @property
    def armed(self) -> bool:
        return self.phase is BusPhase.ARMED


_SOURCES: tuple[Source | None, ...] = (None, *Source)
_ORDER = struct.Struct("<BBBdd4d")  # has a command, source, has a frame, issued, captured, command
_HEARTBEAT = struct.Struct("<Bd")


def pack_order(order: BusOrder) -> bytes:
    """Fixed bytes; numbers that are not finite pass, since refusing them by name is the gate's office."""
    command = order.command or Command()
    return _ORDER.pack(
        order.command is not None,
        _SOURCES.index(order.source),
        order.captured_s is not None,
        order.issued_s,
        0.0 if order.captured_s is None else order.captured_s,
        command.bend,
        command.pitch,
        command.advance_mm_s,
        command.delivery_mm_s,
    )


def unpack_order(data: bytes) -> BusOrder | None:
    """The order; None when these bytes are none."""
    if len(data) != _ORDER.size:
        return None
    has_command, source, has_frame, issued_s, captured_s, *numbers = _ORDER.unpack(data)
    who = _SOURCES[source] if source < len(_SOURCES) else None
    if who is None or has_command > 1 or has_frame > 1:
        return None
    return BusOrder(Command(*numbers) if has_command else None, who, issued_s, captured_s if has_frame else None)


def pack_heartbeat(beat: Heartbeat) -> bytes:
    return _HEARTBEAT.pack(_SOURCES.index(beat.permitted), beat.time_s)


def unpack_heartbeat(data: bytes) -> Heartbeat | None:
    """The heartbeat; None when these bytes are none, or its time is not a number."""
    if len(data) != _HEARTBEAT.size:
        return None
    source, time_s = _HEARTBEAT.unpack(data)
    if source >= len(_SOURCES) or not math.isfinite(time_s):
        return None
    return Heartbeat(time_s, _SOURCES[source])


STOP = b"S"
_log = logging.getLogger(__name__)
END_S = 5.0
"""Longer than a torque-off that is owed is tried at the end."""
_MESSAGE_BYTES = 65_536


class BusClient:
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

    def put_order(self, order: BusOrder) -> None:
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
            kind = getattr(dynamixel_port, error[0], ServoError)
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


_PIPE_BYTES = 65_536
_LOOK_S = 1.0
"""So often it is looked whether the application is still there, before it has said anything."""


@dataclass(frozen=True, slots=True)
class Request:
    """Something that the application wants done, and answered."""

    id: int
    what: str
    details: dict[str, Any] = field(default_factory=dict)


class BusServer:
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

    def order(self) -> BusOrder | None:
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
