"""All that the supervisor knows of the world: reports in, active faults out. Pure.

Health of camera and perception: frame by frame reports in, active faults out. Pure; ages count from the capture.

Health of the servo bus: a report per cycle in, active faults out. Pure.

Which servo draws too much current for too long. Pure.

A motor's current ripples: single readings below the limit say nothing against one that is far above it most of the time. Starting
a motor takes a peak. So what counts is half a second in which most readings are beyond the limit, with pauses no longer than those
of a ripple.

The deadmen: keys, pedals and buttons, one of which must be held while the program drives. Pure.

Each is judged by itself, for what one says is no word about another. A press counts when it began while armed, after a release that
this deadman itself has told: what was down before may be a bag on the pedal. Silence, damage and a pulled plug tell nothing of the
hand or foot: nobody holds that deadman meanwhile, but afterwards it is what it was before them, no new press. After a long
interruption nobody knows whether it was let go, and it is as at the start.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from core.config.safety import JOINT_NAMES, SafetyConfig, ServosConfig
from core.control.faults import AFTER_SOME, AREA, AT_ONCE, Area, Cause, Fault
from core.control.gate import RejectReason
from core.types import Reason


class RouteState(StrEnum):
    """Is there a way to the operator's destination?"""

    NONE = "no destination"
    BEHIND = "destination behind the robot"
    READY = "ready"


@dataclass(frozen=True, slots=True)
class FrameReport:
    """What one turn of perception says.

    ``delivered`` and ``lost`` count the camera's frames since the last report: those that arrived (also those skipped for a newer
    one) and those that never did. ``confidence`` is the pose's; ``finite`` is False when any number of the result is not finite.
    ``drift_px`` is how far the landmarks moved since the rig was set up (None: not watched).
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
    """The camera gave a frame; sent from beside the camera, it tells a silent camera from slow perception."""

    captured_s: float


@dataclass(frozen=True, slots=True)
class FrameWatch:
    """What is remembered of the frames. ``well``: the newest one gave a pose."""

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


def see_arrival(watch: FrameWatch, captured_s: float, now_s: float) -> FrameWatch:
    """The watch after a frame came; a time that is older, in the future or no number is ignored."""
    known_s = watch.arrived_s if watch.arrived_s is not None else -math.inf
    return replace(watch, arrived_s=captured_s) if known_s < captured_s <= now_s else watch


def see_late(watch: FrameWatch, now_s: float) -> FrameWatch:
    """The watch after a frame that was overtaken by a newer one: it is counted, and counts for nothing else."""
    return replace(watch, out_of_order=watch.out_of_order + 1, out_of_order_s=now_s)


def see_frame(watch: FrameWatch, report: FrameReport, now_s: float, safety: SafetyConfig) -> FrameWatch:
    """The watch after a report. A report that is overtaken by a newer one is dropped and counted."""
    if not (math.isfinite(report.captured_s) and report.captured_s <= now_s):
        # such a time would look fresh for ever; the picture is as good as none
        return replace(watch, broken_run=watch.broken_run + 1, well=False)
    newest = watch.newest
    if newest is not None:
        later_s = report.captured_s - newest.captured_s
        # after a longer silence the camera was opened again, and counts from the beginning
        if later_s < 0.0 or (report.index <= newest.index and later_s <= safety.frame_disarm_s):
            return see_late(watch, now_s)
    watch = _count_loss(see_arrival(watch, report.captured_s, now_s), report, now_s, safety)
    again = newest is not None and report.refusal is not None and newest.refusal is report.refusal
    watch = replace(
        watch,
        newest=report,
        equal_run=watch.equal_run + 1 if report.same_picture and newest is not None else 1,
        refusal_run=watch.refusal_run + 1 if again else 1,
        # since the last frame that was different
        refusal_since_s=watch.refusal_since_s if again else newest.captured_s if newest is not None else report.captured_s,
    )
    if not (report.finite and math.isfinite(report.confidence)):
        return replace(watch, broken_run=watch.broken_run + 1, well=False)
    watch = replace(watch, broken_run=0)
    if report.refusal is not None:
        return replace(watch, well=False)
    needed = safety.min_confidence + (safety.confidence_hysteresis if watch.unsure else 0.0)
    return replace(watch, pose_captured_s=report.captured_s, well=True, unsure=report.confidence < needed, route=report.route)


def _count_loss(watch: FrameWatch, report: FrameReport, now_s: float, safety: SafetyConfig) -> FrameWatch:
    kept = tuple(count for count in watch.counts if now_s - count[0] <= safety.frame_loss_window_s)
    counts = (*kept, (now_s, report.delivered, report.lost))
    share = _lost_share(counts, safety)
    since_s = watch.loss_since_s if watch.loss_since_s is not None else now_s
    return replace(watch, counts=counts, loss_since_s=since_s if share > safety.frame_loss_hold_share else None)


def _lost_share(counts: tuple[tuple[float, int, int], ...], safety: SafetyConfig) -> float:
    lost = sum(count[2] for count in counts)
    total = lost + sum(count[1] for count in counts)
    return lost / total if total >= safety.frame_loss_min_frames else 0.0


def frame_faults(watch: FrameWatch, now_s: float, safety: SafetyConfig) -> list[Fault]:
    """The active faults of camera and perception."""
    faults = _age_faults(watch, now_s, safety)
    if watch.newest is not None:
        faults += [*_camera_faults(watch, watch.newest, now_s, safety), *_result_faults(watch, watch.newest, now_s, safety)]
    return faults


def _age_faults(watch: FrameWatch, now_s: float, safety: SafetyConfig) -> list[Fault]:
    if watch.arrived_s is None:
        return [Fault(Cause.CAMERA_LOST, "no frame yet")]
    faults = []
    age_s = now_s - watch.arrived_s
    if age_s > safety.frame_disarm_s:
        faults.append(Fault(Cause.CAMERA_LOST, f"newest frame {1000 * age_s:.0f} ms old"))
    elif age_s > safety.frame_hold_s:
        faults.append(Fault(Cause.CAMERA_SILENT, f"newest frame {1000 * age_s:.0f} ms old"))
    pose_age_s = math.inf if watch.pose_captured_s is None else now_s - watch.pose_captured_s
    if pose_age_s > safety.pose_disarm_s:
        faults.append(Fault(Cause.POSE_LOST, "no pose yet" if math.isinf(pose_age_s) else f"{1000 * pose_age_s:.0f} ms old"))
    elif pose_age_s > safety.pose_hold_s:
        faults.append(Fault(Cause.POSE_STALE, f"{1000 * pose_age_s:.0f} ms old"))
    return faults


def _camera_faults(watch: FrameWatch, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
    faults = []
    if watch.equal_run >= safety.equal_frames:
        faults.append(Fault(Cause.CAMERA_FROZEN, f"{watch.equal_run} identical pictures"))
    if not newest.format_ok:
        faults.append(Fault(Cause.WRONG_FORMAT))
    if newest.drift_px is not None and not abs(newest.drift_px) <= safety.max_drift_px:
        moved = f"by {newest.drift_px:.0f} px (at most {safety.max_drift_px:g} px)"
        faults.append(Fault(Cause.CAMERA_MOVED, moved if math.isfinite(newest.drift_px) else "it shows something else"))
    share = _lost_share(watch.counts, safety)
    if watch.loss_since_s is not None:
        long = now_s - watch.loss_since_s > safety.frame_loss_disarm_s
        faults.append(Fault(Cause.FRAMES_LOST_LONG if long else Cause.FRAMES_LOST, f"{100 * share:.0f} %"))
    elif share > safety.frame_loss_warn_share:
        faults.append(Fault(Cause.FRAMES_DROPPED, f"{100 * share:.0f} %"))
    if now_s - watch.out_of_order_s <= safety.frame_loss_window_s:
        faults.append(Fault(Cause.OUT_OF_ORDER, f"{watch.out_of_order} until now"))
    return faults


def _result_faults(watch: FrameWatch, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
    faults = []
    if watch.broken_run >= safety.broken_results:
        faults.append(Fault(Cause.NOT_FINITE_REPEATED, f"{watch.broken_run} in a row"))
    elif watch.broken_run > 0:
        faults.append(Fault(Cause.NOT_FINITE))
    if newest.refusal is not None:
        faults += _refusal_faults(watch, newest.refusal, now_s, safety)
    elif watch.unsure:
        faults.append(
            Fault(Cause.CONFIDENCE_LOW, f"{100 * newest.confidence:.0f} % (at least {100 * safety.min_confidence:.0f} %)")
        )
    return faults


def _refusal_faults(watch: FrameWatch, refusal: Reason, now_s: float, safety: SafetyConfig) -> list[Fault]:
    if (cause := AT_ONCE.get(refusal)) is not None:
        return [Fault(cause)]
    cause, enough = AFTER_SOME[refusal], safety.dark_frames
    if refusal is Reason.NO_ROBOT:
        enough = safety.head_lost_frames
        if now_s - watch.refusal_since_s > safety.head_lost_disarm_s:
            cause, enough = Cause.HEAD_LOST_LONG, 1
    return [Fault(cause, f"{watch.refusal_run} frames")] if watch.refusal_run >= enough else []


STRAIN_S = 0.5
_RIPPLE_S, _RIPPLE_CYCLES = 0.06, 2.5
_ROUNDING_S = 1e-9


@dataclass(frozen=True, slots=True)
class CurrentSample:
    """The seven currents (mA, whatever their direction) at a moment; None where a servo tells none, or did not answer."""

    time_s: float
    currents_ma: tuple[float | None, ...]


def see_currents(
    samples: tuple[CurrentSample, ...], currents_ma: Sequence[float | None], now_s: float, servos: ServosConfig
) -> tuple[CurrentSample, ...]:
    """The samples with those of now, as far back as they matter."""
    oldest_s = STRAIN_S + 2.0 * _pause_s(servos)
    kept = tuple(sample for sample in samples if 0.0 <= now_s - sample.time_s <= oldest_s)
    return (*kept, CurrentSample(now_s, tuple(None if ma is None else abs(ma) for ma in currents_ma)))


def strained(samples: Sequence[CurrentSample], servos: ServosConfig) -> str:
    """The first joint that is strained as of the newest sample, and by how much; "" for none.

    A reading that is no number counts as too much; one that is missing counts as none, and does not prove anything.
    """
    for place, name in enumerate(JOINT_NAMES):
        found = [(sample.time_s, ma) for sample in samples if (ma := _at(sample, place)) is not None]
        beyond = [(time_s, ma) for time_s, ma in found if not ma <= servos.max_current_ma]
        if (run := _lasting([time_s for time_s, _ in beyond], samples[-1].time_s, _pause_s(servos))) is None:
            continue
        since = [ma for time_s, ma in found if time_s >= run]
        over = [ma for time_s, ma in beyond if time_s >= run]
        if 2 * len(over) >= len(since):
            lasted_ms = 1000.0 * (beyond[-1][0] - run)
            return f"{name} up to {max(over):.0f} mA for {lasted_ms:.0f} ms (at most {servos.max_current_ma:.0f} mA)"
    return ""


def _lasting(times_s: Sequence[float], now_s: float, pause_s: float) -> float | None:
    """Since when it has lasted, if for ``STRAIN_S`` at least and without a longer pause."""
    starts = [time_s for time_s in times_s if times_s[-1] - time_s >= STRAIN_S - _ROUNDING_S]
    if not starts:
        return None
    run = [*(time_s for time_s in times_s if time_s >= starts[-1]), now_s]
    pauses = (after - before for before, after in zip(run, run[1:], strict=False))
    return starts[-1] if max(pauses) <= pause_s + _ROUNDING_S else None


def _pause_s(servos: ServosConfig) -> float:
    return max(_RIPPLE_S, _RIPPLE_CYCLES / servos.bus_hz)


def _at(sample: CurrentSample, place: int) -> float | None:
    return sample.currents_ma[place] if place < len(sample.currents_ma) else None


@dataclass(frozen=True, slots=True)
class BusReport:
    """One cycle of the bus; tuples are per joint, in the order of JOINT_NAMES, and empty when not read in this cycle.

    ``misses`` are answers missed in a row by now; ``errors`` the bad packets (CRC, garbage, short) since the last report, after the
    retry; ``hardware_errors`` the servos' register 70; ``tracking_mm`` goal minus measured position; ``currents_ma`` None for a
    servo that tells none; ``armed`` whether the bus process follows orders, and ``ended`` why it does not any more;
    ``torque_off`` that all servos have said since the last report that their torque is off, and ``torque_problem`` why one that was
    asked for is not proven yet.
    """

    port_open: bool = True
    misses: Sequence[int] = ()
    errors: int = 0
    hardware_errors: Sequence[int] = ()
    temperatures_c: Sequence[float] = ()
    voltages_v: Sequence[float] = ()
    tracking_mm: Sequence[float] = ()
    currents_ma: Sequence[float | None] = ()
    rebooted: bool = False
    watchdog_tripped: bool = False
    armed: bool = True
    ended: Fault | None = None
    torque_off: bool = False
    torque_problem: str = ""


@dataclass(frozen=True, slots=True)
class BusWatch:
    """What is remembered of the bus. What a report leaves out keeps its last reading. ``disarmed_run`` counts reports in a row.

    ``gap_run`` counts the cycles in which not all servos have answered, without one between in which they have (time says nothing:
    the process may have stood still), and ``gaps`` says whose answers were missed in them.
    """

    seen_s: float | None = None
    newest: BusReport = BusReport()
    errors: tuple[tuple[float, int], ...] = ()
    astray_since_s: float | None = None
    astray: str = ""
    currents: tuple[CurrentSample, ...] = ()
    strained: str = ""
    rebooted: bool = False
    disarmed_run: int = 0
    gap_run: int = 0
    gaps: frozenset[str] = frozenset()


def see_bus(watch: BusWatch, report: BusReport, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> BusWatch:
    """The watch after a report. A restarted servo stays so until the servos are checked again (``checked``)."""
    kept = tuple(entry for entry in watch.errors if now_s - entry[0] <= safety.bus_errors_window_s)
    errors = (*kept, (now_s, report.errors)) if report.errors > 0 else kept
    old, since_s, astray = watch.newest, watch.astray_since_s, watch.astray
    if report.tracking_mm:
        astray = _beyond(report.tracking_mm, servos.tracking_error_mm)
        began_s = since_s if since_s is not None else now_s
        since_s = began_s if astray else None
    currents, strain = watch.currents, watch.strained
    if report.currents_ma:
        currents = see_currents(currents, report.currents_ma, now_s, servos)
        strain = strained(currents, servos)
    gap_run, gaps = watch.gap_run, watch.gaps
    if report.misses:
        missing = {name for name, misses in zip(JOINT_NAMES, report.misses, strict=False) if misses > 0}
        gap_run, gaps = (gap_run + 1, gaps | missing) if missing else (0, frozenset())
    newest = replace(
        report,
        hardware_errors=report.hardware_errors or old.hardware_errors,
        temperatures_c=report.temperatures_c or old.temperatures_c,
        voltages_v=report.voltages_v or old.voltages_v,
    )
    disarmed_run = 0 if report.armed else watch.disarmed_run + 1
    rebooted = watch.rebooted or report.rebooted
    return BusWatch(now_s, newest, errors, since_s, astray, currents, strain, rebooted, disarmed_run, gap_run, gaps)


def excused(watch: BusWatch, now_s: float) -> BusWatch:
    """The watch of a bus that is busy with a request: it counts as heard."""
    return replace(watch, seen_s=now_s)


def armed_anew(watch: BusWatch) -> BusWatch:
    """The watch after all servos were checked and armed: what arming has mended is over, though no report has said so yet."""
    mended = replace(watch.newest, watchdog_tripped=False, torque_problem="")
    return replace(checked(watch), newest=mended)


def checked(watch: BusWatch) -> BusWatch:
    """The watch after all servos were found, checked and, if restarted, zeroed."""
    return replace(watch, rebooted=False, disarmed_run=0)


def _beyond(tracking_mm: Sequence[float], limit_mm: float) -> str:
    """The first joint that is farther from its goal than allowed; a reading that is no number counts as beyond."""
    for name, error_mm in zip(JOINT_NAMES, tracking_mm, strict=False):
        if not abs(error_mm) <= limit_mm:
            return f"{name} off by {error_mm:.2f} mm (at most {limit_mm:g} mm)"
    return ""


def bus_faults(watch: BusWatch, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> list[Fault]:
    """The active faults of the servos and their bus."""
    faults = []
    age_s = math.inf if watch.seen_s is None else now_s - watch.seen_s
    if age_s > safety.bus_disarm_s:
        faults.append(Fault(Cause.BUS_DEAD, "no report yet" if math.isinf(age_s) else f"silent for {1000 * age_s:.0f} ms"))
    elif age_s > safety.bus_hold_s:
        faults.append(Fault(Cause.BUS_SILENT, f"for {1000 * age_s:.0f} ms"))
    newest = watch.newest
    if not newest.port_open:
        faults.append(Fault(Cause.PORT_LOST))
    # Before the silence that it makes: what comes first is what the operator is told.
    bad = sum(count for time_s, count in watch.errors if now_s - time_s <= safety.bus_errors_window_s)
    if bad > safety.bus_errors:
        faults.append(Fault(Cause.BUS_NOISE, f"{bad} in {safety.bus_errors_window_s:g} s (at most {safety.bus_errors})"))
    if silent := [n for n, misses in zip(JOINT_NAMES, newest.misses, strict=False) if misses >= safety.missed_answers]:
        faults.append(Fault(Cause.SERVO_SILENT, ", ".join(silent)))
    elif watch.gap_run > safety.bus_disarm_s * servos.bus_hz:
        # Each by itself answers often enough. But positions of all at once, which the motion goes by, are never there.
        names = ", ".join(name for name in JOINT_NAMES if name in watch.gaps)
        faults.append(Fault(Cause.SERVO_SILENT, f"in turns, {names}: not all in one cycle for {safety.bus_disarm_s:g} s"))
    if alerted := [f"{n} {bits:#04x}" for n, bits in zip(JOINT_NAMES, newest.hardware_errors, strict=False) if bits != 0]:
        faults.append(Fault(Cause.SERVO_ALERT, ", ".join(alerted)))
    if watch.astray_since_s is not None and now_s - watch.astray_since_s >= safety.tracking_time_s:
        faults.append(Fault(Cause.TRACKING, watch.astray))
    if watch.strained:
        faults.append(Fault(Cause.STRAINED, watch.strained))
    if newest.torque_problem:
        faults.append(Fault(Cause.TORQUE_ON, newest.torque_problem))
    if watch.rebooted:
        faults.append(Fault(Cause.REBOOTED))
    if newest.watchdog_tripped:
        faults.append(Fault(Cause.WATCHDOG))
    return [*faults, *_supply_faults(newest, servos, safety)]


def _supply_faults(newest: BusReport, servos: ServosConfig, safety: SafetyConfig) -> list[Fault]:
    """Heat and voltage; comparisons are turned so that a reading that is no number counts as too hot or too low."""
    faults = []
    warm_c, sagging_v = (
        servos.max_temperature_c - safety.temperature_warn_margin_c,
        servos.min_voltage_v + safety.voltage_warn_margin_v,
    )
    for hot_c, cause in ((servos.max_temperature_c, Cause.HOT), (warm_c, Cause.WARM)):
        if found := [f"{n} {c:.0f} °C" for n, c in zip(JOINT_NAMES, newest.temperatures_c, strict=False) if not c < hot_c]:
            faults.append(Fault(cause, ", ".join(found)))
            break
    for low_v, cause in ((servos.min_voltage_v, Cause.VOLTAGE_LOW), (sagging_v, Cause.VOLTAGE_SAGS)):
        if found := [f"{n} {v:.1f} V" for n, v in zip(JOINT_NAMES, newest.voltages_v, strict=False) if not v > low_v]:
            faults.append(Fault(cause, ", ".join(found)))
            break
    return faults


FORGOTTEN_S = 0.5
"""Nothing is known any more of a deadman that told nothing for longer.

Not a setting: a hold may be asked to clear itself sooner, or never, but below a deadman's own period no press would ever count.
"""


@dataclass(frozen=True, slots=True)
class DeadmanReport:
    """A deadman as it is; repeated many times a second, for silence counts as released.

    ``pressed`` is None when it cannot tell, as a pedal with a damaged report: then nobody holds it, but it was not let go either.
    ``said_s`` is when it was said, which may be a turn of the pilot earlier (None: now), and ``source`` which deadman it is.
    """

    pressed: bool | None
    said_s: float | None = None
    source: Hashable = ""

    def at_s(self, now_s: float) -> float:
        """When it was said, for who hears it now."""
        return now_s if self.said_s is None else min(self.said_s, now_s)


@dataclass(frozen=True, slots=True)
class Deadman:
    """What is known of one.

    ``pressed`` is the last that it told (None: nothing yet, or too long ago), at ``reported_s``. ``counts``: the press began while
    armed. ``interrupted``: since then it could not tell.
    """

    pressed: bool | None = None
    reported_s: float = 0.0
    counts: bool = False
    interrupted: bool = False

    def is_down(self, now_s: float, timeout_s: float) -> bool:
        """Is it down as far as it tells, and heard of within `timeout_s`? Whether that counts is another question."""
        return self.pressed is True and not self.interrupted and now_s - self.reported_s <= timeout_s


def see_deadman(deadman: Deadman, pressed: bool | None, said_s: float, *, armed: bool) -> Deadman:
    """What is known of a deadman after its report."""
    known = deadman if said_s - deadman.reported_s <= FORGOTTEN_S else Deadman()
    if pressed is None:
        return replace(known, interrupted=True)
    return Deadman(pressed, said_s, pressed and (known.counts or (known.pressed is False and armed)))


def is_held(deadmen: Iterable[Deadman], now_s: float, timeout_s: float) -> bool:
    """Is one of them held, by a press that began while armed?"""
    return any(deadman.counts and deadman.is_down(now_s, timeout_s) for deadman in deadmen)


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
