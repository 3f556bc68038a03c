"""The link to the servo bus process: ``BusClient`` in the application, ``BusServer`` in the process, and their messages.

Shared memory holds what is repeated (orders and heartbeats one way, status the other), a socket carries requests with an answer,
and STOP has a pipe of its own. Towards the bus process only fixed bytes and JSON go: it trusts nothing that it reads.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import pickle
import select
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from core.config.calibration import ZeroConfig
from core.config.safety import JointConfig, JointName, SafetyConfig, ServosConfig
from core.control.faults import Cause, Fault
from core.control.gate import Clamp, Rejection, RejectReason, Source
from core.control.joints import Joints, Retracted
from core.control.kept_zero import ZeroOffer
from core.control.robot import SentMotion
from core.types import Command
from hardware.processes import MESSAGE_BYTES, DeviceProcess, ParentLink, SharedSlot
from hardware.servos import dynamixel_port
from hardware.servos.dynamixel_port import BusProcessLost, LineCounts, ServoError
from hardware.servos.registers import ServoReading, ServoState
from hardware.simulated_clock import SimulatedClock

_log = logging.getLogger(__name__)
_SLOTS = (64, 64, 65_536)
"""Bytes of an order, a heartbeat and a status in the shared memory."""
_MEMORY_BYTES = sum(map(SharedSlot.size, _SLOTS))
_AT_LOW_MM = 0.05
"""A feed so near to the low end of its envelope stands at it."""
_STOP = b"S"
_STAYS = "stays"
"""Key of the message that the process goes on without the application."""
_PIPE_BYTES = 65_536
END_S = 5.0
"""Longer than a requested torque-off is tried at the end."""
_END_CHECK_S = 0.02
_SUCCESSION_S = 2.0
"""A bus process that only watches gives its port to a new one within this time."""
_RELAXED_S = 15.0
"""And to a program that does not watch, after it has relaxed the wires."""
_WATCHED, _RELAXED, _WORD_S = b"W", b"R", 0.2
"""What is asked for, and how long that may take to arrive."""


class BusPhase(StrEnum):
    """Where the bus process is. Into ARMED leads only a request; out of STOPPED and of a latched fault only an acknowledgement."""

    CLOSED = "port closed"
    DISARMED = "disarmed"
    ARMED = "armed"
    STOPPED = "stopped"
    QUIET = "quiet"


@dataclass(frozen=True, slots=True)
class BusOrder:
    """The newest command. ``command`` None: hold. Times are monotonic; ``captured_s`` is that of the frame behind it.

    ``retracts``: the feeds whose retraction by the operator may go beyond the low end of their envelope.
    """

    command: Command | None
    source: Source
    issued_s: float
    captured_s: float | None = None
    retracts: Retracted = Retracted.NONE


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """The application was well at ``time_s``; ``permitted`` may drive (None: no source may)."""

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
        """The same while nothing new is written: these goals stay, and nothing moves."""
        return replace(self, motion=Command(self.motion.bend, self.motion.pitch), order=None)

    def sent_motion(
        self, cycle: int, rejection: Rejection | None, at_end: tuple[JointName, ...], joints: Sequence[JointConfig]
    ) -> SentMotion:
        """What the pilot is told of it."""
        low_mm = {
            joint.name: goal
            for joint, goal in zip(joints, self.goals_mm, strict=True)
            if joint.is_feed and goal <= joint.low_mm + _AT_LOW_MM
        }
        return SentMotion(
            cycle=cycle,
            time_s=self.time_s,
            motion=self.motion,
            source=self.order.source if self.order is not None and self.order.command is not None else None,
            captured_s=self.order.captured_s if self.order is not None else None,
            rejection=rejection.reason if rejection is not None else None,
            at_end=at_end,
            at_low=low_mm,
        )


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
    firmware : versions of the servos' firmware, by joint; empty while the port is closed.
    releasing : whether tendons are being let go slowly.
    releases, still_tight : how often that has ended, and the tendons of which it is not known that the last time let them out.
    offers : where joints that are not zeroed stand by their kept zeros, for the operator to confirm.
    torque_offs : how often the torque was switched off and read back; ``torque_problem`` why a requested one is not confirmed yet.
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
    releasing: bool = False
    releases: int = 0
    still_tight: tuple[JointName, ...] = ()
    offers: tuple[ZeroOffer, ...] = ()
    torque_offs: int = 0
    torque_problem: str = ""
    firmware: tuple[int, ...] = ()

    @property
    def armed(self) -> bool:
        return self.phase is BusPhase.ARMED

    @property
    def pulls(self) -> bool:
        """Whether a servo of an open bus has torque, or it is not known that none has."""
        if self.phase is BusPhase.CLOSED:
            return False
        return not self.servos or any(isinstance(reading, ServoState) and reading.torque for reading in self.servos)


_SOURCES: tuple[Source | None, ...] = (None, *Source)
_ORDER = struct.Struct("<BBBBdd5d")  # has a command, source, has a frame, retracts, issued, captured, command
_HEARTBEAT = struct.Struct("<Bd")
_ALL_FEEDS = Retracted.ROBOT | Retracted.CATHETER


def pack_order(order: BusOrder) -> bytes:
    """Numbers that are not finite pass: the gate refuses them with a named reason."""
    command = order.command or Command()
    return _ORDER.pack(
        order.command is not None,
        _SOURCES.index(order.source),
        order.captured_s is not None,
        order.retracts,
        order.issued_s,
        0.0 if order.captured_s is None else order.captured_s,
        *astuple(command),
    )


def unpack_order(data: bytes) -> BusOrder | None:
    """The order; None when the bytes are not one."""
    if len(data) != _ORDER.size:
        return None
    has_command, source, has_frame, retracts, issued_s, captured_s, *numbers = _ORDER.unpack(data)
    sender = _SOURCES[source] if source < len(_SOURCES) else None
    if sender is None or max(has_command, has_frame) > 1 or retracts > _ALL_FEEDS:
        return None
    command = Command(*numbers) if has_command else None
    return BusOrder(command, sender, issued_s, captured_s if has_frame else None, Retracted(retracts))


def pack_heartbeat(beat: Heartbeat) -> bytes:
    return _HEARTBEAT.pack(_SOURCES.index(beat.permitted), beat.time_s)


def unpack_heartbeat(data: bytes) -> Heartbeat | None:
    """The heartbeat; None when the bytes are not one, or its time is not a number."""
    if len(data) != _HEARTBEAT.size:
        return None
    source, time_s = _HEARTBEAT.unpack(data)
    if source >= len(_SOURCES) or not math.isfinite(time_s):
        return None
    return Heartbeat(time_s, _SOURCES[source])


def start_bus() -> DeviceProcess:
    """A bus process that waits for its configuration; raises BusProcessLost."""
    return DeviceProcess("hardware.servos.bus_process", "the servo bus process", BusProcessLost, writes_pipe=True)


class BusClient:
    """The application's end of a bus process. Methods may be called from any thread; only ``request`` and ``close`` wait.

    Parameters
    ----------
    prestarted : a process from ``start_bus``; without one, or when it has died meanwhile, one is started.
    backups : folder for the EEPROM of servos before it is changed; None: it is not kept.
    keep : file in which the process keeps where the joints are; None: only as long as it runs.
    searched : zeros of the last search for slack.
    clock : file of a simulated bench's clock; None: the wall clock.

    Raises BusProcessLost: when the process cannot be started.
    """

    def __init__(
        self,
        servos: ServosConfig,
        safety: SafetyConfig,
        prestarted: DeviceProcess | None = None,
        *,
        backups: Path | None = None,
        keep: Path | None = None,
        searched: ZeroConfig | None = None,
        clock: str | None = None,
    ) -> None:
        self._lock, self._requesting = threading.Lock(), threading.Lock()
        self._request_id = 0
        self._fatal = ""
        self._closed = self._stays = False
        self._newest: tuple[int, BusStatus] | None = None
        self._process, memory = DeviceProcess.claim(prestarted, start_bus, _MEMORY_BYTES)
        self._order, self._heartbeat, self._status = SharedSlot.row(memory, _SLOTS)
        with contextlib.suppress(OSError):  # the first request finds out that a process is gone
            self._process.send(
                {
                    "servos": servos.model_dump(),
                    "safety": safety.model_dump(),
                    "backups": None if backups is None else str(backups),
                    "keep": None if keep is None else str(keep),
                    "searched": None if searched is None else searched.model_dump(mode="json"),
                    "clock": clock,
                }
            )

    @property
    def pid(self) -> int:
        """Process id of the bus process."""
        return self._process.pid

    @property
    def failure(self) -> str | None:
        """One line when the bus process is gone without ``close``; None while it runs."""
        code = self._process.exit_code()
        if code is None or self._closed:
            return None
        if self._requesting.acquire(blocking=False):  # else the thread that waits for an answer reads it
            self._read_fatal()
            self._requesting.release()
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
        """STOP. Never fails: a full pipe is full of stops, and a process that is gone moves nothing."""
        with self._lock:
            if not self._closed:
                with contextlib.suppress(OSError):
                    os.write(self._process.pipe, _STOP)

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

        Raises ServoError: what kept it from being done, of the type that it had there; BusProcessLost: the process is gone, or did
        not answer in time.
        """
        with self._requesting:
            self._request_id += 1
            try:
                if self._closed:
                    raise BusProcessLost("the robot is not connected: connect it first")
                self._process.send({"id": self._request_id, "do": what, **details})
                error = self._answer(self._request_id, timeout_s)
            except BlockingIOError:
                raise BusProcessLost("the servo bus process does not listen: connect the robot again") from None
            except OSError:
                self._process.wait(END_S)
                self._read_fatal()
                text = self.failure or "the servo bus process does not talk any more: connect the robot again"
                raise BusProcessLost(text) from None
        if error is not None:
            kind = getattr(dynamixel_port, error[0], ServoError)
            raise kind(error[1]) if isinstance(kind, type) and issubclass(kind, ServoError) else ServoError(error[1])

    def _answer(self, number: int, timeout_s: float) -> list[str] | None:
        """The answer to a request: None, or type and text of the error."""
        until = time.monotonic() + timeout_s
        while (left_s := until - time.monotonic()) > 0.0:
            if (answer := self._process.receive(left_s)) is not None:
                self._fatal = answer.get("fatal", self._fatal)
                self._stays = answer.get(_STAYS, self._stays)
                if answer.get("id") == number:
                    return answer["error"]  # type: ignore[no-any-return]
        raise BusProcessLost("the servo bus process did not answer within {a:g} s: connect the robot again", a=timeout_s)

    def _read_fatal(self) -> None:
        """Read what the process still said. When it left requests of ours unread, the first try fails, the second does not."""
        for _ in range(2):
            with contextlib.suppress(OSError, ValueError):
                while data := self._process.socket.recv(MESSAGE_BYTES):
                    said = json.loads(data)
                    self._fatal = said.get("fatal", self._fatal)
                    self._stays = said.get(_STAYS, self._stays)

    def close(self, patience_s: float = END_S) -> None:
        """Let the process hold the servos and end; kill it when it does not in so long. May be called twice.

        Servos that pull are not left alone: their process stays, watches them, and lets them go when ``unattended_s`` is over. The
        next one gets the port from it.
        """
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self._process.request_end()
        until_s = time.monotonic() + patience_s
        while not self._stays and time.monotonic() < until_s and not self._process.wait(_END_CHECK_S):
            if self._requesting.acquire(blocking=False):  # else the thread that waits for an answer reads it
                self._read_fatal()
                self._requesting.release()
        if self._stays:
            self._process.leave()
        elif not self._process.await_end(0.0):
            _log.error("the servo bus process did not end and was killed: the servos hold by their own watchdogs")
        with self._requesting:
            known = self._fatal
            self._read_fatal()
            if self._fatal != known:
                _log.error(self._fatal)
            with self._lock:
                self._process.release()


class PortSuccession:
    """How a bus process that only watches gives its port to the next one: a socket that is named after the port."""

    def __init__(self, port: str) -> None:
        self.must_relax = False
        """Whether who asks does not watch: the wires are relaxed and the torque is off before the port is given away."""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._heir: socket.socket | None = None
        with contextlib.suppress(
            OSError
        ):  # the name of a pseudo-terminal that is gone may be in use: then the watch just ends in time
            self._socket.bind(_succession(port))
            self._socket.listen(1)

    def wait(self, timeout_s: float) -> bool:
        """Whether another process of the same user asks for the port; waits for one so long."""
        until_s = time.monotonic() + timeout_s
        if self._heir is not None:  # the wires are being relaxed for it
            time.sleep(max(0.0, timeout_s))
            return False
        ready, _, _ = select.select([self._socket], [], [], max(0.0, timeout_s))
        try:
            heir, _ = self._socket.accept() if ready else (None, None)
        except OSError:  # the name is taken
            heir = None
        if heir is None:
            time.sleep(max(0.0, until_s - time.monotonic()))
            return False
        _, user, _ = struct.unpack("3i", heir.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")))
        if user != os.getuid():
            heir.close()
            return False
        heir.settimeout(_WORD_S)
        with contextlib.suppress(OSError):
            self.must_relax = heir.recv(1) == _RELAXED
        self._heir = heir
        return True

    def close(self) -> None:
        """The port is free, or the watch is over: the other process is told by the end of the connection."""
        for one in (self._socket, self._heir):
            if one is not None:
                one.close()


def _succession(port: str) -> str:
    return f"\0lumenpilot servos {os.path.realpath(port)}"


def ask_for_port(port: str, *, relaxed: bool = False) -> bool:
    """Ask a bus process that only watches for its port, and wait until it is free; False when there is no such process.

    `relaxed`: for a program that will not watch the servos itself; their wires are let out and the torque is off before.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.settimeout(_RELAXED_S if relaxed else _SUCCESSION_S)
        try:
            asking.connect(_succession(port))
            asking.sendall(_RELAXED if relaxed else _WATCHED)
            return asking.recv(1) == b""
        except OSError:
            return False


@dataclass(frozen=True, slots=True)
class Request:
    """Something that the application wants done, and answered."""

    id: int
    what: str
    details: dict[str, Any] = field(default_factory=dict)


def wall_clock_s() -> float:
    return time.monotonic()


class BusServer(ParentLink):
    """The bus process's end. Only ``first_message`` and ``wait`` wait. ``now_s`` is the clock of the orders."""

    def __init__(self, arguments: Sequence[str]) -> None:
        super().__init__(arguments)
        self._poll = select.poll()
        self._poll.register(self.pipe, select.POLLIN)
        self._poll.register(self.socket, select.POLLIN)
        self.now_s: Callable[[], float] = wall_clock_s

    def first_message(self) -> dict[str, Any] | None:
        """The configuration; the application has given the memory its length by then."""
        message = super().first_message()
        if message is not None:
            self._order, self._heartbeat, self._status = SharedSlot.row(self.map_memory(_MEMORY_BYTES), _SLOTS)
            if (clock := message.get("clock")) is not None:
                self.now_s = SimulatedClock(clock)
        return message

    def wait(self, timeout_s: float) -> tuple[bool, bool]:
        """Wait for news, at most so long: is there some in the pipe for STOP, is there a request?"""
        ready = {fd for fd, _ in self._poll.poll(max(0.0, timeout_s) * 1000.0)}
        return self.pipe in ready, self.socket.fileno() in ready

    def read_stop(self) -> bool:
        """Whether STOP was pressed since the last call. The pipe's end sets ``is_alone``."""
        with contextlib.suppress(BlockingIOError):
            data = os.read(self.pipe, _PIPE_BYTES)
            self._is_cut = self._is_cut or not data
            return bool(data)
        return False

    def read_request(self) -> Request | None:
        """The next request; None without one, or it cannot be understood."""
        try:
            data = self.socket.recv(MESSAGE_BYTES)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        if not data:
            self._is_cut = True
            return None
        with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
            message = json.loads(data)
            return Request(int(message.pop("id")), str(message.pop("do")), message)
        return None

    def answer(self, request: Request, error: Exception | None) -> None:
        """Tell how a request ended."""
        self.send({"id": request.id, "error": None if error is None else [type(error).__name__, str(error)]})

    def send_stay(self) -> None:
        """Tell that this process goes on without the application."""
        self.send({"id": 0, _STAYS: True})

    def send_fatal(self, text: str) -> None:
        """Tell why this process ends."""
        self.send({"id": 0, "fatal": text})

    def order(self) -> BusOrder | None:
        found = self._order.newest()
        return unpack_order(found[1]) if found is not None else None

    def heartbeat(self) -> Heartbeat | None:
        """The newest heartbeat; one from the future does not count."""
        found = self._heartbeat.newest()
        beat = unpack_heartbeat(found[1]) if found is not None else None
        return beat if beat is not None and beat.time_s <= self.now_s() else None

    def publish(self, status: BusStatus) -> None:
        self._status.put(pickle.dumps(status, pickle.HIGHEST_PROTOCOL))
