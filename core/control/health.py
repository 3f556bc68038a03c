"""Health of all parts (camera, bus, direction, deadmen, threads, model, gate): reports in, active faults out. Pure.

Each monitor is a frozen value; ``update`` returns the value after a report.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from core.config.safety import SafetyConfig, ServosConfig
from core.control.bus_monitor import BusMonitor, BusReport
from core.control.camera_monitor import CameraMonitor, FrameArrived, FrameLate, FrameReport, RouteState
from core.control.direction_monitor import DirectionMonitor, MotionSent
from core.control.faults import Area, Cause, Fault
from core.control.gate import RejectReason
from core.messages import message


@dataclass(frozen=True, slots=True)
class DeadmanReport:
    """A deadman as it is; repeated many times a second, since silence counts as released.

    Attributes
    ----------
    pressed : None when it cannot tell, as a pedal with a damaged report: then it does not count as held, nor as released.
    said_s : when it was said, which may be a turn of the pilot earlier; None: now.
    source : which deadman it is.
    alone : whether it is enough by itself; the keyboard is not on a real rig, unless its file says so.
    """

    pressed: bool | None
    said_s: float | None = None
    source: Hashable = ""
    alone: bool = True

    def at_s(self, now_s: float) -> float:
        """When it was said, if it is handled now."""
        return now_s if self.said_s is None else min(self.said_s, now_s)


@dataclass(frozen=True, slots=True)
class EstopReport:
    """What the E-stop button's second contact says, which is an input of the pedal board. Silence changes nothing."""

    pressed: bool


class Part(StrEnum):
    """Threads that must show signs of life."""

    WINDOW = "window"
    PERCEPTION = "perception"


@dataclass(frozen=True, slots=True)
class Beat:
    """A sign of life."""

    part: Part


@dataclass(frozen=True, slots=True)
class ModelReport:
    """Whether the model's files have the right hash and it passed its self-test."""

    ok: bool
    detail: str = ""


@dataclass(frozen=True, slots=True)
class ServoCheckReport:
    """Identity, model, mode and limits of all servos were read back; ``problems`` in plain words, empty when all is right."""

    problems: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ServoRequestBegun:
    """A request to the servos begins that takes time; neither source drives until they were checked again."""


@dataclass(frozen=True, slots=True)
class ServosBusy:
    """The bus carries out a request and reports nothing meanwhile, which is no silence. Repeated every turn."""


@dataclass(frozen=True, slots=True)
class GateReport:
    """The gate's answer to the program's last command; None: it went through."""

    rejection: RejectReason | None


Report = (
    FrameReport
    | FrameArrived
    | FrameLate
    | BusReport
    | Beat
    | DeadmanReport
    | EstopReport
    | ModelReport
    | ServoCheckReport
    | ServoRequestBegun
    | ServosBusy
    | GateReport
    | MotionSent
    | Fault
)


FORGOTTEN_S = 0.5
"""A deadman that reports nothing for longer is unknown, as at the start.

Not a setting: a hold may be set to clear itself sooner, or never, but below a deadman's own period no press would ever count.
"""


@dataclass(frozen=True, slots=True)
class Deadman:
    """State of one deadman: a key, pedal or button, one of which must be held while the program drives. Each is judged by itself.

    A press counts when it began while armed, after a release that this deadman itself has reported: what was down before may be a
    bag on the pedal. Silence, damage and a pulled plug say nothing of the hand or foot: the deadman does not count as held
    meanwhile, but afterwards it is what it was before, and makes no new press. After a long interruption it is as at the start.

    Attributes
    ----------
    pressed : the last state that it reported, at ``reported_s``; None: nothing yet, or too long ago.
    counts : the press began while armed.
    interrupted : since then it could not tell.
    alone : it is enough by itself.
    """

    pressed: bool | None = None
    reported_s: float = 0.0
    counts: bool = False
    interrupted: bool = False
    alone: bool = True

    def update(self, pressed: bool | None, said_s: float, *, armed: bool, alone: bool = True) -> Deadman:
        """The state after its report."""
        known = self if said_s - self.reported_s <= FORGOTTEN_S else Deadman()
        if pressed is None:
            return replace(known, interrupted=True)
        return Deadman(pressed, said_s, pressed and (known.counts or (known.pressed is False and armed)), alone=alone)

    def is_down(self, now_s: float, timeout_s: float) -> bool:
        """Whether it reported pressed within `timeout_s`, counting or not."""
        return self.pressed is True and not self.interrupted and now_s - self.reported_s <= timeout_s


_NOT_THE_PROGRAMS_FAULT = frozenset({RejectReason.NOT_ARMED, RejectReason.WRONG_SOURCE})
_BROKEN = frozenset(
    {
        RejectReason.NON_FINITE,
        RejectReason.WRONG_COUNT,
        RejectReason.FROM_THE_FUTURE,
        RejectReason.OUT_OF_ENVELOPE,
        RejectReason.OVER_RATE,
    }
)
"""Rejections that only a defect of the program can cause."""


@dataclass(frozen=True, slots=True)
class Health:
    """State of all parts after the reports so far. ``servo_problems``: None while the servos are not checked."""

    frames: CameraMonitor = field(default_factory=CameraMonitor)
    bus: BusMonitor = field(default_factory=BusMonitor)
    direction: DirectionMonitor = field(default_factory=DirectionMonitor)
    deadmen: Mapping[Hashable, Deadman] = field(default_factory=dict)
    window_s: float | None = None
    perception_s: float | None = None
    model: ModelReport = field(default_factory=lambda: ModelReport(False, "not checked yet"))
    servo_problems: tuple[str, ...] | None = None
    rejection: RejectReason | None = None
    rejected_run: int = 0
    reported: tuple[Fault, ...] = ()
    estop_pressed: bool = False

    @property
    def servos_ready(self) -> bool:
        return self.servo_problems == ()

    def update(self, report: Report, *, armed: bool, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> Health:
        """The state after a report. Only while `armed` does a new press of a deadman count, and the gate's answer."""
        match report:
            case FrameReport():
                head = report.head if report.confidence >= safety.min_confidence else None
                direction = self.direction.observe(head) if head is not None else self.direction
                return replace(self, frames=self.frames.update(report, now_s, safety), direction=direction)
            case MotionSent():
                return replace(self, direction=self.direction.drive(report)) if armed else self
            case FrameArrived(captured_s):
                return replace(self, frames=self.frames.arrived(captured_s, now_s))
            case FrameLate():
                return replace(self, frames=self.frames.late(now_s))
            case BusReport():
                return replace(self, bus=self.bus.update(report, now_s, servos, safety))._disarmed_by_bus(safety)
            case Beat(Part.WINDOW):
                return replace(self, window_s=now_s)
            case Beat():
                return replace(self, perception_s=now_s)
            case DeadmanReport(pressed, _, source, alone):
                deadman = self.deadmen.get(source, Deadman()).update(pressed, report.at_s(now_s), armed=armed, alone=alone)
                return replace(self, deadmen={**self.deadmen, source: deadman})
            case EstopReport(pressed):
                return replace(self, estop_pressed=pressed)
            case ModelReport():
                return replace(self, model=report)
            case ServoCheckReport(problems):
                return replace(self, servo_problems=problems, bus=self.bus if problems else self.bus.armed())
            case ServoRequestBegun():
                return replace(self, servo_problems=None, bus=self.bus.checked())
            case ServosBusy():
                return self if self.servos_ready else replace(self, bus=self.bus.busy(now_s))
            case GateReport(rejection):
                return self._gated(rejection) if armed else self
            case Fault():
                return replace(self, reported=(*self.reported, report))

    def _disarmed_by_bus(self, safety: SafetyConfig) -> Health:
        """Servos that were on, and that the bus process has disarmed by itself, are off: with its reason."""
        if not self.servos_ready or self.bus.disarmed_run < safety.missed_answers:
            return self
        ended = self.bus.newest.ended or Fault(Cause.SERVOS_WRONG, "the servo process is not armed")
        if ended.cause.area not in {Area.SERVOS, Area.OPERATOR}:
            ended = Fault(Cause.WATCHDOG, f"{ended.cause.value}, {ended.detail}" if ended.detail else ended.cause.value)
        return replace(self, servo_problems=None, reported=(*self.reported, ended))

    def _gated(self, rejection: RejectReason | None) -> Health:
        if rejection in _NOT_THE_PROGRAMS_FAULT:
            return replace(self, rejection=None)
        run = self.rejected_run + 1 if rejection in _BROKEN else self.rejected_run if rejection is not None else 0
        return replace(self, rejection=rejection, rejected_run=run)

    def disarmed(self) -> Health:
        """The state after disarming: presses of deadmen, rejected commands and motions from before do not count the next time."""
        deadmen = {source: replace(deadman, counts=False) for source, deadman in self.deadmen.items()}
        return replace(self, deadmen=deadmen, rejection=None, rejected_run=0, direction=DirectionMonitor())

    def not_driven(self) -> Health:
        """The state while the program does not drive: what moves the robot then is no motion against the program."""
        direction = DirectionMonitor(turns=self.direction.turns, feeds=self.direction.feeds)
        return replace(self, direction=direction) if self.direction.sent else self

    def deadman_held(self, now_s: float, safety: SafetyConfig) -> bool:
        """Whether a deadman that is enough by itself is held, by a press that began while armed."""
        return any(held.alone for held in self._held(now_s, safety))

    def only_weak_held(self, now_s: float, safety: SafetyConfig) -> bool:
        """Whether deadmen are held so, but none that is enough by itself."""
        held = self._held(now_s, safety)
        return bool(held) and not any(deadman.alone for deadman in held)

    def _held(self, now_s: float, safety: SafetyConfig) -> list[Deadman]:
        return [one for one in self.deadmen.values() if one.counts and one.is_down(now_s, safety.deadman_timeout_s)]

    def deadman_down(self, now_s: float, safety: SafetyConfig) -> bool | None:
        """Whether a deadman is down, whenever the press began; None: none has ever reported."""
        deadmen = self.deadmen.values()
        return any(deadman.is_down(now_s, safety.deadman_timeout_s) for deadman in deadmen) if deadmen else None

    def faults(self, now_s: float, servos: ServosConfig, safety: SafetyConfig, *, driving: bool = False) -> list[Fault]:
        """All active faults; `driving`: also those that are faults only while the program drives."""
        faults = [*self.reported, *self.frames.faults(now_s, safety), *self.bus.faults(now_s, servos, safety)]
        faults += self.direction.faults()
        for beat_s, cause in ((self.window_s, Cause.WINDOW_HUNG), (self.perception_s, Cause.HEARTBEAT_LOST)):
            if beat_s is None or now_s - beat_s > servos.heartbeat_timeout_s:
                silence = "no sign of life yet" if beat_s is None else message("silent for {a:.0f} ms", a=1000 * (now_s - beat_s))
                faults.append(Fault(cause, silence))
        if self.servo_problems:
            faults.append(Fault(Cause.SERVOS_WRONG, "; ".join(self.servo_problems)))
        if self.estop_pressed:
            faults.append(Fault(Cause.ESTOP_PRESSED))
        if not self.model.ok:
            faults.append(Fault(Cause.MODEL_UNFIT, self.model.detail))
        if self.rejected_run >= safety.broken_results:
            faults.append(Fault(Cause.COMMANDS_REJECTED, message("{a} in a row", a=self.rejected_run)))
        elif self.rejection is not None:
            faults.append(Fault(Cause.COMMAND_REJECTED, self.rejection.value))
        if driving and not self.deadman_held(now_s, safety):
            faults.append(Fault(Cause.DEADMAN))
        if driving and self.frames.route is not RouteState.READY:
            faults.append(Fault(Cause.NO_TARGET, self.frames.route.value))
        return faults
