"""All that the supervisor knows of the world: reports in, active faults out. Pure."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from core.control.bus_watch import BusReport, BusWatch, armed_anew, bus_faults, checked, excused, see_bus
from core.control.deadman import Deadman, DeadmanReport, is_held, see_deadman
from core.control.faults import AREA, Area, Cause, Fault
from core.control.frame_watch import (
    FrameArrived,
    FrameReport,
    FrameWatch,
    RouteState,
    frame_faults,
    see_arrival,
    see_frame,
    see_late,
)
from core.control.gate_checks import RejectReason
from core.safety_config import SafetyConfig
from core.servo_config import ServosConfig


class Part(StrEnum):
    """Who must show signs of life."""

    WINDOW = "window"
    WORKER = "worker"


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
class ServosChecked:
    """Identity, model, mode and limits of all servos were read back; ``problems`` in plain words, empty when all is right."""

    problems: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ServosOff:
    """The operator has something done to the servos that takes them time; nobody drives until they were checked again."""


@dataclass(frozen=True, slots=True)
class ServosBusy:
    """The bus does what it was asked for and tells nothing meanwhile; its silence is none. Said again and again."""


@dataclass(frozen=True, slots=True)
class FrameLate:
    """A frame was overtaken by a newer one, and left out before anybody looked at it."""


@dataclass(frozen=True, slots=True)
class GateReport:
    """What the gate said to the program's last request; None: it went through."""

    rejection: RejectReason | None


Report = (
    FrameReport
    | FrameArrived
    | FrameLate
    | BusReport
    | Beat
    | DeadmanReport
    | ModelReport
    | ServosChecked
    | ServosOff
    | ServosBusy
    | GateReport
    | Fault
)

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


@dataclass(frozen=True, slots=True)
class Health:
    """What the reports so far say, of the ``deadmen`` by source. ``servo_problems`` is None while the servos are not checked."""

    frames: FrameWatch = field(default_factory=FrameWatch)
    bus: BusWatch = field(default_factory=BusWatch)
    deadmen: Mapping[Hashable, Deadman] = field(default_factory=dict)
    window_s: float | None = None
    worker_s: float | None = None
    model: ModelReport = field(default_factory=lambda: ModelReport(False, "not checked yet"))
    servo_problems: tuple[str, ...] | None = None
    rejection: RejectReason | None = None
    rejected_run: int = 0
    reported: tuple[Fault, ...] = ()

    @property
    def servos_ready(self) -> bool:
        return self.servo_problems == ()


def take(health: Health, report: Report, *, armed: bool, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> Health:
    """The health after a report. Only while `armed` does a press of the deadman count that begins now, and what the gate says."""
    match report:
        case FrameReport():
            return replace(health, frames=see_frame(health.frames, report, now_s, safety))
        case FrameArrived(captured_s):
            return replace(health, frames=see_arrival(health.frames, captured_s, now_s))
        case FrameLate():
            return replace(health, frames=see_late(health.frames, now_s))
        case BusReport():
            return _see_bus(replace(health, bus=see_bus(health.bus, report, now_s, servos, safety)), safety)
        case Beat(Part.WINDOW):
            return replace(health, window_s=now_s)
        case Beat():
            return replace(health, worker_s=now_s)
        case DeadmanReport(pressed, _, source):
            seen = see_deadman(health.deadmen.get(source, Deadman()), pressed, report.at_s(now_s), armed=armed)
            return replace(health, deadmen={**health.deadmen, source: seen})
        case ModelReport():
            return replace(health, model=report)
        case ServosChecked(problems):
            bus = health.bus if problems else armed_anew(health.bus)
            return replace(health, servo_problems=problems, bus=bus)
        case ServosOff():
            return replace(health, servo_problems=None, bus=checked(health.bus))
        case ServosBusy():
            return health if health.servos_ready else replace(health, bus=excused(health.bus, now_s))
        case GateReport(rejection):
            return _see_gate(health, rejection) if armed else health
        case Fault():
            return replace(health, reported=(*health.reported, report))


def _see_bus(health: Health, safety: SafetyConfig) -> Health:
    """Servos that were on, and that the bus process has disarmed by itself, are off: with its reason."""
    if not health.servos_ready or health.bus.disarmed_run < safety.missed_answers:
        return health
    ended = health.bus.newest.ended or Fault(Cause.SERVOS_WRONG, "the servo process is not armed")
    if AREA[ended.cause] not in {Area.SERVOS, Area.OPERATOR}:
        ended = Fault(Cause.WATCHDOG, f"{ended.cause.value}, {ended.detail}" if ended.detail else ended.cause.value)
    return replace(health, servo_problems=None, reported=(*health.reported, ended))


def _see_gate(health: Health, rejection: RejectReason | None) -> Health:
    if rejection in _NOT_THE_PROGRAMS_FAULT:
        return replace(health, rejection=None)
    run = health.rejected_run + 1 if rejection in _BROKEN else health.rejected_run if rejection is not None else 0
    return replace(health, rejection=rejection, rejected_run=run)


def disarmed(health: Health) -> Health:
    """A press of a deadman from before, and rejected commands, do not count for the next time."""
    deadmen = {source: replace(deadman, counts=False) for source, deadman in health.deadmen.items()}
    return replace(health, deadmen=deadmen, rejection=None, rejected_run=0)


def deadman_held(health: Health, now_s: float, safety: SafetyConfig) -> bool:
    """Is a deadman held, by a press that began while armed?"""
    return is_held(health.deadmen.values(), now_s, safety.deadman_timeout_s)


def deadman_down(health: Health, now_s: float, safety: SafetyConfig) -> bool | None:
    """Is a deadman down, whenever that began? None: none has ever reported."""
    deadmen = health.deadmen.values()
    return any(deadman.is_down(now_s, safety.deadman_timeout_s) for deadman in deadmen) if deadmen else None


def driving_faults(health: Health, now_s: float, safety: SafetyConfig) -> list[Fault]:
    """What is a fault only while the program drives."""
    faults = []
    if not deadman_held(health, now_s, safety):
        faults.append(Fault(Cause.DEADMAN))
    if health.frames.route is not RouteState.READY:
        faults.append(Fault(Cause.NO_TARGET, health.frames.route.value))
    return faults


def faults_now(health: Health, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> list[Fault]:
    """All active faults, but for those of ``driving_faults``."""
    faults = [
        *health.reported,
        *frame_faults(health.frames, now_s, safety),
        *bus_faults(health.bus, now_s, servos, safety),
    ]
    for beat_s, cause in ((health.window_s, Cause.WINDOW_HUNG), (health.worker_s, Cause.WORKER_DEAD)):
        if beat_s is None or now_s - beat_s > servos.heartbeat_timeout_s:
            silence = "no sign of life yet" if beat_s is None else f"silent for {1000 * (now_s - beat_s):.0f} ms"
            faults.append(Fault(cause, silence))
    if health.servo_problems:
        faults.append(Fault(Cause.SERVOS_WRONG, "; ".join(health.servo_problems)))
    if not health.model.ok:
        faults.append(Fault(Cause.MODEL_UNFIT, health.model.detail))
    if health.rejected_run >= safety.broken_results:
        faults.append(Fault(Cause.COMMANDS_REJECTED, f"{health.rejected_run} in a row"))
    elif health.rejection is not None:
        faults.append(Fault(Cause.COMMAND_REJECTED, health.rejection.value))
    return faults
