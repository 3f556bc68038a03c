"""Health of camera, perception, deadmen, window, worker, model, servos and gate: reports in, active faults out. Pure.

Ages count from the capture of a frame. Each monitor is a frozen value; ``update`` returns the value after a report.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from core.config.safety import SafetyConfig, ServosConfig
from core.control.bus_monitor import BusMonitor, BusReport
from core.control.faults import AFTER_SOME, AT_ONCE, Area, Cause, Fault
from core.control.gate import RejectReason
from core.messages import message
from core.types import Reason


class RouteState(StrEnum):
    """Is there a way to the operator's destination?"""

    NONE = "no destination"
    BEHIND = "destination behind the robot"
    READY = "ready"


@dataclass(frozen=True, slots=True)
class FrameReport:
    """One turn of perception.

    Attributes
    ----------
    confidence : of the pose.
    finite : False when any number of the result is not finite.
    delivered, lost : the camera's frames since the last report that arrived (also those skipped for a newer one), or never did.
    drift_px : how far the landmarks moved since the rig was set up; None: not watched.
    """

    index: int
    captured_s: float
    refusal: Reason | None = None
    confidence: float = 0.0
    route: RouteState = RouteState.NONE
    finite: bool = True
    format_ok: bool = True
    same_picture: bool = False
    delivered: int = 1
    lost: int = 0
    drift_px: float | None = None


@dataclass(frozen=True, slots=True)
class FrameArrived:
    """The camera gave a frame; sent before perception, it tells a silent camera from slow perception."""

    captured_s: float


@dataclass(frozen=True, slots=True)
class FrameLate:
    """A frame was overtaken by a newer one, and left out before perception."""


@dataclass(frozen=True, slots=True)
class DeadmanReport:
    """A deadman as it is; repeated many times a second, since silence counts as released.

    Attributes
    ----------
    pressed : None when it cannot tell, as a pedal with a damaged report: then it does not count as held, nor as released.
    said_s : when it was said, which may be a turn of the pilot earlier; None: now.
    source : which deadman it is.
    """

    pressed: bool | None
    said_s: float | None = None
    source: Hashable = ""

    def at_s(self, now_s: float) -> float:
        """When it was said, if it is handled now."""
        return now_s if self.said_s is None else min(self.said_s, now_s)


class Part(StrEnum):
    """Threads that must show signs of life."""

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
    | ModelReport
    | ServosChecked
    | ServosOff
    | ServosBusy
    | GateReport
    | Fault
)


@dataclass(frozen=True, slots=True)
class FrameMonitor:
    """State of camera and perception.

    Attributes
    ----------
    well : the newest frame gave a pose.
    equal_run, refusal_run, broken_run : frames in a row with the same picture, the same refusal, a result that is not finite.
    refusal_since_s : capture of the last frame before this run of refusals.
    unsure : the confidence is below the limit, with hysteresis.
    counts : (time, frames delivered, frames lost) of the reports in the window of frame loss.
    """

    arrived_s: float | None = None
    newest: FrameReport | None = None
    pose_captured_s: float | None = None
    well: bool = False
    equal_run: int = 0
    refusal_run: int = 0
    refusal_since_s: float = 0.0
    broken_run: int = 0
    unsure: bool = False
    route: RouteState = RouteState.NONE
    counts: tuple[tuple[float, int, int], ...] = ()
    loss_since_s: float | None = None
    out_of_order: int = 0
    out_of_order_s: float = -math.inf

    def arrived(self, captured_s: float, now_s: float) -> FrameMonitor:
        """The state after a frame came; a time that is older, in the future or NaN is ignored."""
        known_s = self.arrived_s if self.arrived_s is not None else -math.inf
        return replace(self, arrived_s=captured_s) if known_s < captured_s <= now_s else self

    def late(self, now_s: float) -> FrameMonitor:
        """The state after a frame that was overtaken by a newer one."""
        return replace(self, out_of_order=self.out_of_order + 1, out_of_order_s=now_s)

    def update(self, report: FrameReport, now_s: float, safety: SafetyConfig) -> FrameMonitor:
        """The state after a report. A report that is overtaken by a newer one is dropped and counted."""
        if not (math.isfinite(report.captured_s) and report.captured_s <= now_s):
            # such a time would look fresh for ever: the result counts as broken
            return replace(self, broken_run=self.broken_run + 1, well=False)
        newest = self.newest
        if newest is not None:
            later_s = report.captured_s - newest.captured_s
            # after a longer silence the camera was opened again, and counts from the beginning
            if later_s < 0.0 or (report.index <= newest.index and later_s <= safety.frame_disarm_s):
                return self.late(now_s)
        kept = (count for count in self.counts if now_s - count[0] <= safety.frame_loss_window_s)
        counts = (*kept, (now_s, report.delivered, report.lost))
        is_lossy = _lost_share(counts, safety) > safety.frame_loss_hold_share
        again = newest is not None and report.refusal is not None and newest.refusal is report.refusal
        state = replace(
            self.arrived(report.captured_s, now_s),
            newest=report,
            counts=counts,
            loss_since_s=(self.loss_since_s if self.loss_since_s is not None else now_s) if is_lossy else None,
            equal_run=self.equal_run + 1 if report.same_picture and newest is not None else 1,
            refusal_run=self.refusal_run + 1 if again else 1,
            refusal_since_s=self.refusal_since_s if again else (newest or report).captured_s,
        )
        if not (report.finite and math.isfinite(report.confidence)):
            return replace(state, broken_run=state.broken_run + 1, well=False)
        state = replace(state, broken_run=0)
        if report.refusal is not None:
            return replace(state, well=False)
        needed = safety.min_confidence + (safety.confidence_hysteresis if state.unsure else 0.0)
        return replace(state, pose_captured_s=report.captured_s, well=True, unsure=report.confidence < needed, route=report.route)

    def faults(self, now_s: float, safety: SafetyConfig) -> list[Fault]:
        """The active faults of camera and perception."""
        if self.arrived_s is None:
            faults = [Fault(Cause.CAMERA_LOST, "no frame yet")]
        else:
            age_s = now_s - self.arrived_s
            faults = _age_fault(
                age_s, safety.frame_hold_s, safety.frame_disarm_s, Cause.CAMERA_SILENT, Cause.CAMERA_LOST, "newest frame "
            )
            pose_age_s = math.inf if self.pose_captured_s is None else now_s - self.pose_captured_s
            faults += _age_fault(pose_age_s, safety.pose_hold_s, safety.pose_disarm_s, Cause.POSE_STALE, Cause.POSE_LOST, "")
        if self.newest is None:
            return faults
        return [*faults, *self._camera_faults(self.newest, now_s, safety), *self._result_faults(self.newest, now_s, safety)]

    def _camera_faults(self, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
        faults = []
        if self.equal_run >= safety.equal_frames:
            faults.append(Fault(Cause.CAMERA_FROZEN, message("{a} identical pictures", a=self.equal_run)))
        if not newest.format_ok:
            faults.append(Fault(Cause.WRONG_FORMAT))
        if newest.drift_px is not None and not abs(newest.drift_px) <= safety.max_drift_px:
            moved = message("by {a:.0f} px (at most {b:g} px)", a=newest.drift_px, b=safety.max_drift_px)
            faults.append(Fault(Cause.CAMERA_MOVED, moved if math.isfinite(newest.drift_px) else "it shows something else"))
        share = _lost_share(self.counts, safety)
        if self.loss_since_s is not None:
            long = now_s - self.loss_since_s > safety.frame_loss_disarm_s
            faults.append(Fault(Cause.FRAMES_LOST_LONG if long else Cause.FRAMES_LOST, f"{100 * share:.0f} %"))
        elif share > safety.frame_loss_warn_share:
            faults.append(Fault(Cause.FRAMES_DROPPED, f"{100 * share:.0f} %"))
        if now_s - self.out_of_order_s <= safety.frame_loss_window_s:
            faults.append(Fault(Cause.OUT_OF_ORDER, message("{a} until now", a=self.out_of_order)))
        return faults

    def _result_faults(self, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
        faults = []
        if self.broken_run >= safety.broken_results:
            faults.append(Fault(Cause.NOT_FINITE_REPEATED, message("{a} in a row", a=self.broken_run)))
        elif self.broken_run > 0:
            faults.append(Fault(Cause.NOT_FINITE))
        refusal = newest.refusal
        if refusal is None:
            if self.unsure:
                least = f"at least {100 * safety.min_confidence:.0f} %"
                faults.append(Fault(Cause.CONFIDENCE_LOW, f"{100 * newest.confidence:.0f} % ({least})"))
            return faults
        if (cause := AT_ONCE.get(refusal)) is not None:
            return [*faults, Fault(cause)]
        cause, enough = AFTER_SOME[refusal], safety.dark_frames
        if refusal is Reason.NO_ROBOT:
            enough = safety.head_lost_frames
            if now_s - self.refusal_since_s > safety.head_lost_disarm_s:
                cause, enough = Cause.HEAD_LOST_LONG, 1
        if self.refusal_run >= enough:
            faults.append(Fault(cause, message("{a} frames", a=self.refusal_run)))
        return faults


def _lost_share(counts: tuple[tuple[float, int, int], ...], safety: SafetyConfig) -> float:
    lost = sum(count[2] for count in counts)
    total = lost + sum(count[1] for count in counts)
    return lost / total if total >= safety.frame_loss_min_frames else 0.0


def _age_fault(age_s: float, hold_s: float, disarm_s: float, hold: Cause, disarm: Cause, what: str) -> list[Fault]:
    detail = "no pose yet" if math.isinf(age_s) else f"{what}{1000 * age_s:.0f} ms old"
    if age_s > disarm_s:
        return [Fault(disarm, detail)]
    return [Fault(hold, detail)] if age_s > hold_s else []


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
    """

    pressed: bool | None = None
    reported_s: float = 0.0
    counts: bool = False
    interrupted: bool = False

    def update(self, pressed: bool | None, said_s: float, *, armed: bool) -> Deadman:
        """The state after its report."""
        known = self if said_s - self.reported_s <= FORGOTTEN_S else Deadman()
        if pressed is None:
            return replace(known, interrupted=True)
        return Deadman(pressed, said_s, pressed and (known.counts or (known.pressed is False and armed)))

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

    frames: FrameMonitor = field(default_factory=FrameMonitor)
    bus: BusMonitor = field(default_factory=BusMonitor)
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

    def update(self, report: Report, *, armed: bool, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> Health:
        """The state after a report. Only while `armed` does a new press of a deadman count, and the gate's answer."""
        match report:
            case FrameReport():
                return replace(self, frames=self.frames.update(report, now_s, safety))
            case FrameArrived(captured_s):
                return replace(self, frames=self.frames.arrived(captured_s, now_s))
            case FrameLate():
                return replace(self, frames=self.frames.late(now_s))
            case BusReport():
                return replace(self, bus=self.bus.update(report, now_s, servos, safety))._disarmed_by_bus(safety)
            case Beat(Part.WINDOW):
                return replace(self, window_s=now_s)
            case Beat():
                return replace(self, worker_s=now_s)
            case DeadmanReport(pressed, _, source):
                deadman = self.deadmen.get(source, Deadman()).update(pressed, report.at_s(now_s), armed=armed)
                return replace(self, deadmen={**self.deadmen, source: deadman})
            case ModelReport():
                return replace(self, model=report)
            case ServosChecked(problems):
                return replace(self, servo_problems=problems, bus=self.bus if problems else self.bus.armed())
            case ServosOff():
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
        """The state after disarming: presses of deadmen and rejected commands from before do not count for the next time."""
        deadmen = {source: replace(deadman, counts=False) for source, deadman in self.deadmen.items()}
        return replace(self, deadmen=deadmen, rejection=None, rejected_run=0)

    def deadman_held(self, now_s: float, safety: SafetyConfig) -> bool:
        """Whether a deadman is held, by a press that began while armed."""
        return any(deadman.counts and deadman.is_down(now_s, safety.deadman_timeout_s) for deadman in self.deadmen.values())

    def deadman_down(self, now_s: float, safety: SafetyConfig) -> bool | None:
        """Whether a deadman is down, whenever the press began; None: none has ever reported."""
        deadmen = self.deadmen.values()
        return any(deadman.is_down(now_s, safety.deadman_timeout_s) for deadman in deadmen) if deadmen else None

    def faults(self, now_s: float, servos: ServosConfig, safety: SafetyConfig, *, driving: bool = False) -> list[Fault]:
        """All active faults; `driving`: also those that are faults only while the program drives."""
        faults = [*self.reported, *self.frames.faults(now_s, safety), *self.bus.faults(now_s, servos, safety)]
        for beat_s, cause in ((self.window_s, Cause.WINDOW_HUNG), (self.worker_s, Cause.WORKER_DEAD)):
            if beat_s is None or now_s - beat_s > servos.heartbeat_timeout_s:
                silence = "no sign of life yet" if beat_s is None else message("silent for {a:.0f} ms", a=1000 * (now_s - beat_s))
                faults.append(Fault(cause, silence))
        if self.servo_problems:
            faults.append(Fault(Cause.SERVOS_WRONG, "; ".join(self.servo_problems)))
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
