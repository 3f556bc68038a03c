"""What is remembered of the servo bus from report to report, and what faults that makes."""

from __future__ import annotations

from core.config.safety import SafetyConfig, ServosConfig
from core.control.bus_monitor import BusMonitor, BusReport
from core.control.faults import Cause, Fault

SERVOS, SAFETY = ServosConfig(), SafetyConfig()
CYCLE_S = 1.0 / 64.0  # no rounding


def _misses(*joints: int) -> tuple[int, ...]:
    return tuple(int(joint in joints) for joint in range(7))


def _watched(reports: list[BusReport], watch: BusMonitor | None = None, start_s: float = 0.0) -> tuple[BusMonitor, float]:
    """The watch after a report in each cycle, and the time of the last one."""
    watch, now_s = watch or BusMonitor(), start_s
    for now_s in (start_s + CYCLE_S * n for n in range(len(reports))):
        watch = watch.update(reports[round((now_s - start_s) / CYCLE_S)], now_s, SERVOS, SAFETY)
    return watch, now_s


def _faults(watch: BusMonitor, now_s: float) -> list[Fault]:
    return watch.faults(now_s, SERVOS, SAFETY)


# --- silent in turns -------------------------------------------------------------------------------------------------------------

IN_TURNS = [BusReport(misses=_misses(0)), BusReport(misses=_misses(4))]


def test_servos_that_are_silent_in_turns_are_a_fault_after_half_a_second_of_cycles() -> None:
    """25 of them, at 50 a second."""
    watch, now_s = _watched([*IN_TURNS * 12, IN_TURNS[0]])
    assert _faults(watch, now_s) == []
    watch, now_s = _watched([IN_TURNS[1]], watch, now_s + CYCLE_S)
    assert _faults(watch, now_s) == [Fault(Cause.SERVO_SILENT, "in turns, right, advance: not all in one cycle for 0.5 s")]


def test_a_process_that_stands_still_between_two_gaps_is_none() -> None:
    watch, now_s = _watched(IN_TURNS * 6)
    watch, now_s = _watched(IN_TURNS * 6, watch, now_s + 0.8)
    assert _faults(watch, now_s) == []


def test_a_cycle_in_which_all_answer_ends_it_and_who_was_silent_before_is_forgotten() -> None:
    watch, now_s = _watched([*IN_TURNS * 40, BusReport(misses=_misses())])
    assert _faults(watch, now_s) == []
    late = [BusReport(misses=_misses(1)), BusReport(misses=_misses(2))]
    watch, now_s = _watched([*late * 12, late[0]], watch, now_s + CYCLE_S)
    assert _faults(watch, now_s) == []
    watch, now_s = _watched([late[1]], watch, now_s + CYCLE_S)
    assert [fault.detail for fault in _faults(watch, now_s)] == ["in turns, left, up: not all in one cycle for 0.5 s"]


def test_a_report_that_read_nothing_neither_makes_a_gap_nor_ends_one() -> None:
    unread = BusReport()
    watch, now_s = _watched([*IN_TURNS * 12, *[unread] * 20, IN_TURNS[0]])
    assert _faults(watch, now_s) == []
    watch, now_s = _watched([unread, IN_TURNS[1]], watch, now_s + CYCLE_S)
    assert [fault.cause for fault in _faults(watch, now_s)] == [Cause.SERVO_SILENT]


def test_one_that_is_silent_three_times_in_a_row_is_named_alone() -> None:
    gone = BusReport(misses=(0, 0, 3, 0, 1, 0, 0))
    watch, now_s = _watched([*IN_TURNS * 40, gone])
    assert _faults(watch, now_s) == [Fault(Cause.SERVO_SILENT, "up")]


# --- the rest --------------------------------------------------------------------------------------------------------------------


def test_a_report_without_currents_forgets_no_strain() -> None:
    strained = BusReport(currents_ma=(40.0, 40.0, 40.0, 40.0, -601.0, 40.0, 40.0))
    watch, now_s = _watched([*[strained] * 60, *[BusReport()] * 6])
    assert [fault.cause for fault in _faults(watch, now_s)] == [Cause.STRAINED]


def test_a_silent_bus_says_for_how_long() -> None:
    watch, now_s = _watched([BusReport()])
    assert _faults(watch, now_s + 0.1875) == [Fault(Cause.BUS_SILENT, "for 188 ms")]
    assert _faults(watch, now_s + 0.4994) == [Fault(Cause.BUS_SILENT, "for 499 ms")]


def test_reports_of_servos_that_follow_nobody_are_counted_in_a_row() -> None:
    off, on = BusReport(armed=False), BusReport()
    assert _watched([])[0].disarmed_run == 0
    assert _watched([off, off, off])[0].disarmed_run == 3
    assert _watched([off, off, on])[0].disarmed_run == 0
    assert _watched([off, off])[0].checked().disarmed_run == 0
