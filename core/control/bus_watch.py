"""Health of the servo bus: a report per cycle in, active faults out. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from core.control.faults import Cause, Fault
from core.control.strain import CurrentSample, see_currents, strained
from core.safety_config import SafetyConfig
from core.servo_config import JOINT_NAMES, ServosConfig


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
