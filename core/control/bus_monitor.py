"""Health of the servo bus: a report per cycle in, active faults out. Pure.

A motor's current ripples, and starting a motor takes a peak. So what counts as strain is half a second in which most readings are
above the limit, with pauses no longer than those of a ripple.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from core.config.safety import SafetyConfig, ServosConfig
from core.control.faults import Cause, Fault
from core.control.joints import in_unit
from core.messages import message


@dataclass(frozen=True, slots=True)
class BusReport:
    """One cycle of the bus; tuples are per joint, in the order of the configuration, and empty when not read in this cycle.

    Attributes
    ----------
    misses : answers missed in a row by now.
    errors : bad packets (CRC, garbage, short) since the last report, after the retry.
    hardware_errors : the servos' register 70.
    tracking_mm : goal minus measured position.
    currents_ma : None for a servo that reports none.
    rebooted : a servo has restarted, so that its zero is lost.
    limit_lost : the servo has another force limit than it was given: another master, or a fault of the line.
    torque_taken : the torque is off while the bus is armed, though the servo neither restarted nor reports an error: another master
        on the line has switched it off. The zero is kept.
    armed, ended : whether the bus process follows commands, and why it does not any more.
    torque_off : all servos have said since the last report that their torque is off.
    torque_problem : why a torque-off that was requested is not proven yet.
    let_out : tendons were let go slowly since the last report; ``still_tight`` those that may not have been.
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
    torque_taken: Sequence[bool] = ()
    limit_lost: Sequence[bool] = ()
    watchdog_tripped: bool = False
    armed: bool = True
    ended: Fault | None = None
    torque_off: bool = False
    torque_problem: str = ""
    let_out: bool = False
    still_tight: Sequence[str] = ()


STRAIN_S = 0.5
"""So long a current must be above the limit."""
_NO_SUPPLY_SHARE = 0.75
"""Of the recommended supply: when all servos tell less, it is not weak but going away, and they fall silent next."""
_FALL_S = 2.0
"""A supply that was cut falls from well to too low within this time; a battery that runs down takes longer."""
_SPARE_V = 0.5
"""Above the lowest supply: a servo has enough."""
_LOAD_MA = 1500.0
"""Together the servos draw more only while several pull hard: then a weak supply sags at all of them, too."""
_VOLTAGE_ERROR = 0x01
"""Bit of the servos' register 70 (Hardware Error Status): the supply is beyond their own limits."""
_RIPPLE_S, _RIPPLE_CYCLES = 0.06, 2.5
"""Longest pause of a ripple, in seconds and in cycles of the bus; the longer of both counts."""
_ROUNDING_S = 1e-9


def supply_cause(volts: Sequence[float], since_well_s: float, load_ma: float, servos: ServosConfig) -> Cause | None:
    """What is wrong with the supply: cut, by E-stop or switch, or too low; None: neither.

    Volts are by joint (empty: not known; NaN counts as too low); `since_well_s` since all servos had enough, with some to spare
    (infinite: never); `load_ma` is the sum of the amounts of all currents.
    """
    low = [not v > servos.lowest_v(joint) for joint, v in zip(servos.joints, volts, strict=False)]
    if not any(low):
        return None
    is_gone = all(
        v < _NO_SUPPLY_SHARE * servos.model_of(joint).recommended_v for joint, v in zip(servos.joints, volts, strict=False)
    )
    fell = all(low) and since_well_s <= _FALL_S and load_ma <= _LOAD_MA
    return Cause.SUPPLY_LOST if is_gone or fell else Cause.VOLTAGE_LOW


@dataclass(frozen=True, slots=True)
class CurrentSample:
    """The amounts of the currents (mA) at a moment; None where a servo reports none, or did not answer."""

    time_s: float
    currents_ma: tuple[float | None, ...]


def _strain(samples: Sequence[CurrentSample], servos: ServosConfig) -> str:
    """The first joint that is strained as of the newest sample, and by how much; "" for none.

    NaN counts as too much; a missing reading counts as none, and proves nothing.
    """
    pause_s = _longest_pause_s(servos) + _ROUNDING_S
    for place, joint in enumerate(servos.joints):
        limit = servos.force_limit(joint)
        if (most_ma := limit.strain_ma) is None:
            continue
        found = [(s.time_s, ma) for s in samples if place < len(s.currents_ma) and (ma := s.currents_ma[place]) is not None]
        above = [(time_s, ma) for time_s, ma in found if not ma <= most_ma]
        starts = [time_s for time_s, _ in above if above[-1][0] - time_s >= STRAIN_S - _ROUNDING_S]
        if not starts:
            continue
        run = [*(time_s for time_s, _ in above if time_s >= starts[-1]), samples[-1].time_s]
        if max(after - before for before, after in zip(run, run[1:], strict=False)) > pause_s:
            continue
        since = [ma for time_s, ma in found if time_s >= starts[-1]]
        over = [ma for time_s, ma in above if time_s >= starts[-1]]
        if 2 * len(over) >= len(since):
            lasted_ms = 1000.0 * (above[-1][0] - starts[-1])
            return message(
                "{joint} up to {a:.0f} mA for {b:.0f} ms (its {c:g} N are {d:.0f} mA)",
                joint=joint.name,
                a=max(over),
                b=lasted_ms,
                c=joint.max_force_n,
                d=limit.current_ma or 0.0,
            )
    return ""


def _longest_pause_s(servos: ServosConfig) -> float:
    return max(_RIPPLE_S, _RIPPLE_CYCLES / servos.bus_hz)


@dataclass(frozen=True, slots=True)
class BusMonitor:
    """State of the bus. What a report leaves out keeps its last reading.

    Attributes
    ----------
    reported_s : of the last report; None: there was none yet.
    disarmed_run : reports in a row in which the bus process was not armed.
    powered_s : when all servos had enough supply last, with some to spare.
    gap_run, gaps : cycles in a row in which not all servos have answered (time says nothing: the process may have been suspended),
        and the joints whose answers were missed in them.
    """

    reported_s: float | None = None
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
    powered_s: float = -math.inf

    def update(self, report: BusReport, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> BusMonitor:
        """The state after a report. A restarted servo counts as restarted until the servos are checked again."""
        errors = tuple(entry for entry in self.errors if now_s - entry[0] <= safety.bus_errors_window_s)
        if report.errors > 0:
            errors = (*errors, (now_s, report.errors))
        since_s, astray = self.astray_since_s, self.astray
        if report.tracking_mm:
            astray = _first_astray(report.tracking_mm, servos)
            since_s = (since_s if since_s is not None else now_s) if astray else None
        currents, strained = self.currents, self.strained
        if report.currents_ma:
            oldest_s = STRAIN_S + 2.0 * _longest_pause_s(servos)
            newest_ma = CurrentSample(now_s, tuple(None if ma is None else abs(ma) for ma in report.currents_ma))
            currents = (*(sample for sample in currents if 0.0 <= now_s - sample.time_s <= oldest_s), newest_ma)
            strained = _strain(currents, servos)
        gap_run, gaps = self.gap_run, self.gaps
        if report.misses:
            missing = {name for name, misses in zip(servos.names, report.misses, strict=False) if misses > 0}
            gap_run, gaps = (gap_run + 1, gaps | missing) if missing else (0, frozenset())
        powered_s = self.powered_s
        if report.voltages_v and all(spare_v > _SPARE_V for spare_v in _spare_v(report.voltages_v, servos)):
            powered_s = now_s
        newest = replace(
            report,
            hardware_errors=report.hardware_errors or self.newest.hardware_errors,
            temperatures_c=report.temperatures_c or self.newest.temperatures_c,
            voltages_v=report.voltages_v or self.newest.voltages_v,
        )
        disarmed_run = 0 if report.armed else self.disarmed_run + 1
        rebooted = self.rebooted or report.rebooted
        return BusMonitor(
            now_s, newest, errors, since_s, astray, currents, strained, rebooted, disarmed_run, gap_run, gaps, powered_s
        )

    def busy(self, now_s: float) -> BusMonitor:
        """The state while the bus is busy with a request: its silence is no fault."""
        return replace(self, reported_s=now_s)

    def checked(self) -> BusMonitor:
        """The state after all servos were found, checked and, if restarted, zeroed."""
        return replace(self, rebooted=False, disarmed_run=0)

    def armed(self) -> BusMonitor:
        """The state after all servos were checked and armed: what arming repairs is over, though no report has said so yet."""
        repaired = replace(self.newest, watchdog_tripped=False, torque_problem="")
        return replace(self.checked(), newest=repaired)

    def faults(self, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> list[Fault]:
        """The active faults of the servos and their bus. NaN counts as too hot or too low."""
        newest = self.newest
        found: list[tuple[Cause, str | bool]] = []
        age_s = math.inf if self.reported_s is None else now_s - self.reported_s
        if age_s > safety.bus_disarm_s:
            found.append(
                (Cause.BUS_DEAD, "no report yet" if math.isinf(age_s) else message("silent for {a:.0f} ms", a=1000 * age_s))
            )
        elif age_s > safety.bus_hold_s:
            found.append((Cause.BUS_SILENT, message("for {a:.0f} ms", a=1000 * age_s)))
        found.append((Cause.PORT_LOST, not newest.port_open))
        # before the silence that it causes: the first one is what the operator reads
        bad = sum(count for time_s, count in self.errors if now_s - time_s <= safety.bus_errors_window_s)
        if bad > safety.bus_errors:
            found.append(
                (Cause.BUS_NOISE, message("{a} in {b:g} s (at most {c})", a=bad, b=safety.bus_errors_window_s, c=safety.bus_errors))
            )
        silent = _listed(servos.names, newest.misses, lambda misses: misses >= safety.missed_answers, "")
        if (
            silent and min(newest.misses) > 0 and bad <= safety.bus_errors
        ):  # the port is still there, so the adapter has its power, and the servos have none
            found.append((Cause.SUPPLY_LOST, "all servos fell silent together"))
        elif silent:
            found.append((Cause.SERVO_SILENT, silent))
        elif self.gap_run > safety.bus_disarm_s * servos.bus_hz:
            # each one answers often enough, but the positions of all, which the motion needs, are never there
            names = ", ".join(name for name in servos.names if name in self.gaps)
            found.append((Cause.SERVO_SILENT, f"in turns, {names}: not all in one cycle for {safety.bus_disarm_s:g} s"))
        is_astray = self.astray_since_s is not None and now_s - self.astray_since_s >= safety.tracking_time_s
        # room to each joint's own limit: its model's, or a tighter one of the configuration
        cooler_c = [servos.hottest_c(joint) - c for joint, c in zip(servos.joints, newest.temperatures_c, strict=False)]
        spare_v = _spare_v(newest.voltages_v, servos)
        load_ma = sum(abs(ma) for ma in newest.currents_ma if ma is not None)
        is_gone = supply_cause(newest.voltages_v, now_s - self.powered_s, load_ma, servos) is Cause.SUPPLY_LOST
        # what a servo says of a supply that is going away is no defect of the servo
        errors = [bits & ~_VOLTAGE_ERROR if is_gone else bits for bits in newest.hardware_errors]
        hot, low = (
            _short(servos.names, newest.temperatures_c, cooler_c, 0.0, " {:.0f} °C"),
            _short(servos.names, newest.voltages_v, spare_v, 0.0, " {:.1f} V"),
        )
        warm = _short(servos.names, newest.temperatures_c, cooler_c, safety.temperature_warn_margin_c, " {:.0f} °C")
        sags = _short(servos.names, newest.voltages_v, spare_v, safety.voltage_warn_margin_v, " {:.1f} V")
        found += [
            (Cause.SERVO_ALERT, _listed(servos.names, errors, lambda bits: bits != 0, " {:#04x}")),
            (Cause.TRACKING, is_astray and self.astray),
            (Cause.STRAINED, self.strained),
            (Cause.TORQUE_ON, newest.torque_problem),
            (Cause.REBOOTED, self.rebooted),
            (Cause.SERVOS_WRONG, _listed(servos.names, newest.limit_lost, bool, " has lost its force limit")),
            (Cause.TORQUE_TAKEN, _listed(servos.names, newest.torque_taken, bool, "")),
            (Cause.WATCHDOG, newest.watchdog_tripped),
            (Cause.HOT, hot),
            (Cause.WARM, not hot and warm),
            (Cause.SUPPLY_LOST, is_gone and not silent and message("{a:.1f} V at most", a=max(newest.voltages_v))),
            (Cause.VOLTAGE_LOW, not is_gone and low),
            (Cause.VOLTAGE_SAGS, not low and sags),
        ]
        return [Fault(cause, "" if told is True else told) for cause, told in found if told]


def _spare_v(volts: Sequence[float], servos: ServosConfig) -> list[float]:
    """Room of each servo's supply to the lowest that it may have."""
    return [v - servos.lowest_v(joint) for joint, v in zip(servos.joints, volts, strict=False)]


def _listed(names: Sequence[str], values: Sequence[Any], is_bad: Callable[[Any], bool], how: str) -> str:
    """The joints whose value is bad, with the value as text."""
    return ", ".join(f"{name}{how.format(value)}" for name, value in zip(names, values, strict=False) if is_bad(value))


def _short(names: Sequence[str], values: Sequence[float], rooms: Sequence[float], margin: float, how: str) -> str:
    """The joints whose room to a limit is not above `margin`, with the value as text; NaN counts as no room."""
    pairs = zip(names, values, rooms, strict=False)
    return ", ".join(f"{name}{how.format(value)}" for name, value, room in pairs if not room > margin)


def _first_astray(tracking_mm: Sequence[float], servos: ServosConfig) -> str:
    """The first joint that is too far from its goal; NaN counts as too far."""
    for joint, error in zip(servos.joints, tracking_mm, strict=False):
        if not abs(error) <= (limit := servos.astray_mm(joint)):
            return in_unit(joint, message("{joint} off by {a:.2f} mm (at most {b:g} mm)", joint=joint.name, a=error, b=limit))
    return ""
