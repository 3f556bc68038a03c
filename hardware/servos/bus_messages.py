"""What application and bus process tell each other. Towards the bus process fixed bytes only: it believes nothing that it reads."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, replace
from enum import StrEnum

from core.control.faults import Cause, Fault
from core.control.gate import Clamp, Rejection, RejectReason, Source
from core.control.joints import Joints
from core.servo_config import JointName
from core.types import Command
from hardware.servos.line import LineCounts
from hardware.servos.status_block import ServoReading


class BusPhase(StrEnum):
    """Where the bus process is. Into ARMED leads only a request; out of STOPPED and of a latched fault only an acknowledgement."""

    CLOSED = "port closed"
    DISARMED = "disarmed"
    ARMED = "armed"
    STOPPED = "stopped"
    QUIET = "quiet"


@dataclass(frozen=True, slots=True)
class Order:
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
class Sent:
    """The goals that left the gate last, the motion that they are, and the order behind them.

    ``order`` None: it was a hold, or nothing has left the gate since, and the servos keep these goals.
    """

    goals_mm: Joints
    motion: Command
    time_s: float
    order: Order | None

    def kept(self) -> Sent:
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
    sent: Sent | None
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


def pack_order(order: Order) -> bytes:
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


def unpack_order(data: bytes) -> Order | None:
    """The order; None when these bytes are none."""
    if len(data) != _ORDER.size:
        return None
    has_command, source, has_frame, issued_s, captured_s, *numbers = _ORDER.unpack(data)
    who = _SOURCES[source] if source < len(_SOURCES) else None
    if who is None or has_command > 1 or has_frame > 1:
        return None
    return Order(Command(*numbers) if has_command else None, who, issued_s, captured_s if has_frame else None)


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
