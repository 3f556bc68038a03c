"""Health of the servo bus: silence, missing answers, disarming, currents."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from core.config.safety import ServosConfig
from core.control.bus_monitor import BusMonitor, BusReport, supply_cause
from core.control.faults import Cause, Fault, Reaction
from tests.core.healthy import GOOD_BUS, SAFETY, SERVOS


def _bus(*reports: tuple[float, BusReport]) -> BusMonitor:
    watch = BusMonitor()
    for now_s, report in reports:
        watch = watch.update(report, now_s, SERVOS, SAFETY)
    return watch


def _bus_causes(watch: BusMonitor, now_s: float) -> list[Cause]:
    return [fault.cause for fault in watch.faults(now_s, SERVOS, SAFETY)]


def _one(value: object, rest: object) -> tuple[object, ...]:
    return (rest, rest, value, rest, rest, rest, rest)


@pytest.mark.parametrize(
    ("age_s", "causes"), [(0.15, []), (0.151, [Cause.BUS_SILENT]), (0.5, [Cause.BUS_SILENT]), (0.501, [Cause.BUS_DEAD])]
)
def test_silence_of_the_bus(age_s: float, causes: list[Cause]) -> None:
    assert _bus_causes(_bus((0.0, GOOD_BUS)), age_s) == causes


@pytest.mark.parametrize(
    ("change", "causes"),
    [
        ({"misses": _one(2, 0)}, []),
        ({"misses": _one(3, 0)}, [Cause.SERVO_SILENT]),
        ({"temperatures_c": _one(64.9, 30.0)}, []),
        ({"temperatures_c": _one(65.0, 30.0)}, [Cause.WARM]),
        ({"temperatures_c": _one(69.9, 30.0)}, [Cause.WARM]),
        ({"temperatures_c": _one(70.0, 30.0)}, [Cause.HOT]),
        ({"temperatures_c": _one(math.nan, 30.0)}, [Cause.HOT]),
        ({"voltages_v": _one(11.1, 12.0)}, []),
        ({"voltages_v": _one(11.0, 12.0)}, [Cause.VOLTAGE_SAGS]),
        ({"voltages_v": _one(10.6, 12.0)}, [Cause.VOLTAGE_SAGS]),
        ({"voltages_v": _one(10.5, 12.0)}, [Cause.VOLTAGE_LOW]),
        ({"voltages_v": _one(math.nan, 12.0)}, [Cause.VOLTAGE_LOW]),
        ({"hardware_errors": _one(0x20, 0)}, [Cause.SERVO_ALERT]),
        ({"port_open": False}, [Cause.PORT_LOST]),
        ({"watchdog_tripped": True}, [Cause.WATCHDOG]),
        ({"rebooted": True}, [Cause.REBOOTED]),
        ({"torque_taken": (False,) * 7}, []),
        ({"torque_taken": (True,) * 7}, [Cause.TORQUE_TAKEN]),
        ({"torque_taken": (True,) * 7, "rebooted": True}, [Cause.REBOOTED, Cause.TORQUE_TAKEN]),
        ({"errors": 5}, []),
        ({"errors": 6}, [Cause.BUS_NOISE]),
        ({"errors": 26, "misses": (3,) * 7}, [Cause.BUS_NOISE, Cause.SERVO_SILENT]),
        ({"misses": (3,) * 7}, [Cause.SUPPLY_LOST]),  # the E-stop: all at once, and the port is there
        ({"errors": 5, "misses": (3, 2, 2, 3, 2, 2, 2)}, [Cause.SUPPLY_LOST]),  # the last answer was cut
        ({"misses": (3, 3, 3, 3, 3, 3, 0)}, [Cause.SERVO_SILENT]),  # a cable in the chain
        ({"misses": (2,) * 7}, []),
        ({"voltages_v": (8.9,) * 7}, [Cause.SUPPLY_LOST]),
        ({"voltages_v": _one(9.0, 8.9)}, [Cause.VOLTAGE_LOW]),
    ],
)
def test_one_report_of_the_bus(change: dict[str, object], causes: list[Cause]) -> None:
    assert _bus_causes(_bus((0.0, replace(GOOD_BUS, **change))), 0.0) == causes


@pytest.mark.parametrize(
    ("volts", "since_well_s", "load_ma", "cause"),
    [
        ((), 0.1, 0.0, None),
        ((12.0,) * 7, 0.0, 0.0, None),
        ((10.6,) * 7, 0.1, 0.0, None),  # sags, which warns
        ((10.4,) * 7, 0.1, 400.0, Cause.SUPPLY_LOST),  # all fell together: the E-stop, or the supply's switch
        ((10.4,) * 7, 2.0, 1500.0, Cause.SUPPLY_LOST),
        ((10.4,) * 7, 2.1, 0.0, Cause.VOLTAGE_LOW),  # a battery that runs down
        ((10.4,) * 7, math.inf, 0.0, Cause.VOLTAGE_LOW),  # a supply that was never enough
        ((10.4,) * 7, 0.1, 1600.0, Cause.VOLTAGE_LOW),  # a weak supply under load
        ((10.4,) * 6 + (10.6,), 0.1, 0.0, Cause.VOLTAGE_LOW),  # a poor plug in the chain
        ((8.9,) * 7, math.inf, 9000.0, Cause.SUPPLY_LOST),
        ((8.9,) * 6 + (9.1,), math.inf, 0.0, Cause.VOLTAGE_LOW),
        ((math.nan,) * 7, 0.1, 0.0, Cause.SUPPLY_LOST),
        ((12.0,) * 6 + (math.nan,), 0.1, 0.0, Cause.VOLTAGE_LOW),
    ],
)
def test_a_supply_that_was_cut_is_told_from_a_weak_one(
    volts: tuple[float, ...], since_well_s: float, load_ma: float, cause: Cause | None
) -> None:
    assert supply_cause(volts, since_well_s, load_ma, SERVOS) is cause


def test_an_e_stop_whose_supply_falls_slowly_is_neither_low_voltage_nor_an_alert_of_the_servos() -> None:
    """12 V to 8 V in 0.8 s; below 9.5 V the servos report an error of their input voltage."""
    watch, found = BusMonitor(), []
    for tick in range(40):
        volts = 12.0 - 0.1 * tick
        errors = (int(volts < 9.5),) * 7
        watch = watch.update(replace(GOOD_BUS, voltages_v=(volts,) * 7, hardware_errors=errors), 0.02 * tick, SERVOS, SAFETY)
        found += [fault.cause for fault in watch.faults(0.02 * tick, SERVOS, SAFETY)]
    assert set(found) == {Cause.VOLTAGE_SAGS, Cause.SUPPLY_LOST}
    alone = replace(GOOD_BUS, hardware_errors=_one(1, 0))
    assert _bus_causes(_bus((0.0, alone)), 0.0) == [Cause.SERVO_ALERT]


def test_bad_packets_count_over_one_second() -> None:
    noisy = replace(GOOD_BUS, errors=3)
    assert _bus_causes(_bus((0.0, noisy), (1.0, noisy)), 1.0) == [Cause.BUS_NOISE]
    assert _bus_causes(_bus((0.0, noisy), (1.0, noisy)), 1.01) == []
    assert _bus((0.0, noisy), (1.01, noisy)).errors == ((1.01, 3),)
    assert _bus((0.0, GOOD_BUS)).errors == ()


@pytest.mark.parametrize("error_mm", [1.501, -1.501, math.nan])
def test_a_tracking_error_for_200_ms_is_a_jam(error_mm: float) -> None:
    bad = replace(GOOD_BUS, tracking_mm=_one(error_mm, 0.0))
    watch = _bus((0.0, bad), (0.1, bad))
    assert Cause.TRACKING not in _bus_causes(watch, 0.19)
    assert Cause.TRACKING in _bus_causes(watch, 0.2)
    blind = _bus((0.0, bad), (0.1, replace(GOOD_BUS, tracking_mm=())))  # not read in between: still astray
    assert Cause.TRACKING in _bus_causes(blind, 0.2)
    mended = _bus((0.0, bad), (0.1, GOOD_BUS), (0.15, bad))
    assert Cause.TRACKING not in _bus_causes(mended, 0.3)
    assert Cause.TRACKING in _bus_causes(mended, 0.36)


def test_a_tracking_error_at_the_limit_is_none() -> None:
    edge = replace(GOOD_BUS, tracking_mm=_one(-1.5, 1.5))
    assert _bus((0.0, edge)).astray_since_s is None


def test_a_restarted_servo_stays_restarted() -> None:
    assert _bus_causes(_bus((0.0, replace(GOOD_BUS, rebooted=True)), (0.1, GOOD_BUS)), 0.1) == [Cause.REBOOTED]


def test_the_details_name_the_joints() -> None:
    bad = BusReport(True, _one(4, 0), 7, _one(0x21, 0), _one(71.0, 66.0), _one(9.9, 10.8), _one(2.0, 0.0))
    assert _bus((0.0, bad)).faults(0.2, SERVOS, SAFETY) == [
        Fault(Cause.BUS_SILENT, "for 200 ms"),
        Fault(Cause.BUS_NOISE, "7 in 1 s (at most 5)"),
        Fault(Cause.SERVO_SILENT, "up"),
        Fault(Cause.SERVO_ALERT, "up 0x21"),
        Fault(Cause.TRACKING, "up off by 2.00 mm (at most 1.5 mm)"),
        Fault(Cause.HOT, "up 71 °C"),
        Fault(Cause.VOLTAGE_LOW, "up 9.9 V"),
    ]
    assert _bus((0.0, GOOD_BUS)).faults(0.6, SERVOS, SAFETY) == [Fault(Cause.BUS_DEAD, "silent for 600 ms")]


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


def test_one_that_is_silent_three_times_in_a_row_is_named_alone() -> None:
    gone = BusReport(misses=(0, 0, 3, 0, 1, 0, 0))
    watch, now_s = _watched([*IN_TURNS * 40, gone])
    assert _faults(watch, now_s) == [Fault(Cause.SERVO_SILENT, "up")]


# --- the rest --------------------------------------------------------------------------------------------------------------------


def test_a_report_without_currents_forgets_no_strain() -> None:
    strained = BusReport(currents_ma=(40.0, 40.0, 40.0, 40.0, -95.0, 40.0, 40.0))
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


MOST_MA = SERVOS.force_limit(SERVOS.joints[2]).strain_ma or math.nan
"""A tendon's servo that draws more is strained; the tests' currents are in 600ths of it."""
BUS_S = 0.02
Current = Callable[[int], float | None]


def seconds_until_strained(
    current_ma: Current, servos: ServosConfig = SERVOS, cycle_s: float = BUS_S, most_s: float = 3.0
) -> float | None:
    """When the fault comes, from the first reading on; `current_ma` of the third joint by cycle. None: not within `most_s`.

    600 stands for ``MOST_MA``.
    """
    watch = BusMonitor()
    for n in range(round(most_s / cycle_s)):
        now_s = 64.0 + n * cycle_s
        drawn = current_ma(n)
        drawn_ma = None if drawn is None else drawn / 600.0 * MOST_MA
        report = replace(GOOD_BUS, currents_ma=(40.0, 40.0, drawn_ma, None, 40.0, 40.0, 40.0))
        watch = watch.update(report, now_s, servos, SAFETY)
        faults = [fault for fault in watch.faults(now_s, servos, SAFETY) if fault.cause is Cause.STRAINED]
        if faults:
            assert faults[0].detail.startswith("up up to ")
            assert faults[0].detail.endswith("(its 20 N are 70 mA)")
            return now_s - 64.0
    return None


def test_it_stops() -> None:
    assert Cause.STRAINED.reaction is Reaction.STOP


@pytest.mark.parametrize("current_ma", [601.0, -601.0, 2300.0, math.nan])
def test_a_current_beyond_the_limit_for_half_a_second(current_ma: float) -> None:
    assert seconds_until_strained(lambda n: current_ma) == pytest.approx(0.5)


@pytest.mark.parametrize(
    "current_ma",
    [
        lambda n: 900.0 if n % 2 == 0 else 100.0,
        lambda n: 700.0 if n % 3 else 300.0,
        lambda n: -900.0 if n % 5 else 0.0,
        lambda n: 900.0 if n % 5 < 3 else 100.0,
        lambda n: 900.0 if n % 3 else None,
    ],
    ids=["every second", "below on the average", "now and then", "60 ms of 100", "not read in every cycle"],
)
def test_a_ripple_that_dips_below_the_limit_hides_nothing(current_ma: Current) -> None:
    found_s = seconds_until_strained(current_ma)
    assert found_s <= 0.62


@pytest.mark.parametrize(
    "current_ma",
    [
        lambda n: 600.0,
        lambda n: 2300.0 if n == 30 else 100.0,
        lambda n: 2300.0 if n % 5 == 0 else 100.0,
        lambda n: 900.0 if n % 4 == 0 else 100.0,
        lambda n: 900.0 if n % 50 < 24 else 100.0,
        lambda n: 900.0 if n % 12 < 5 else 500.0,
        lambda n: None,
        lambda n: 900.0 if n % 12 == 0 else None,
    ],
    ids=[
        "at the limit",
        "one spike",
        "spikes",
        "a spike each 80 ms",
        "0.48 s",
        "starts and stops",
        "no current told",
        "seldom read",
    ],
)
def test_no_strain(current_ma: Current) -> None:
    assert seconds_until_strained(current_ma) is None


@pytest.mark.parametrize("bus_hz", [200.0, 20.0, 5.0])
def test_a_bus_of_any_rate_sees_it(bus_hz: float) -> None:
    servos = SERVOS.model_copy(update={"bus_hz": bus_hz})
    found_s = seconds_until_strained(lambda n: 900.0, servos, 1.0 / bus_hz)
    assert 0.5 <= found_s <= 0.5 + 1.0 / bus_hz + 1e-6


def test_it_is_over_when_the_current_is() -> None:
    watch = BusMonitor()
    for n in range(40):
        watch = watch.update(replace(GOOD_BUS, currents_ma=(900.0 if n < 30 else 40.0,) * 7), n * BUS_S, SERVOS, SAFETY)
    assert watch.strained == ""
