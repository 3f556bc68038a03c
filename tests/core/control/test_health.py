"""Reports in, faults out: every threshold on either side; deadmen."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from core.config.safety import SafetyConfig
from core.control.faults import Cause, Fault, Reaction, worst
from core.control.gate import RejectReason
from core.control.health import (
    FORGOTTEN_S,
    Beat,
    Deadman,
    DeadmanReport,
    FrameMonitor,
    FrameReport,
    GateReport,
    Health,
    Part,
    RouteState,
    ServosBusy,
    ServosChecked,
)
from core.types import Reason
from tests.core.healthy import GOOD_BUS, SAFETY, SERVOS, TICK_S


def _watch(*reports: FrameReport, now_s: float | None = None) -> FrameMonitor:
    watch = FrameMonitor()
    for report in reports:
        watch = watch.update(report, report.captured_s if now_s is None else now_s, SAFETY)
    return watch


def _good(count: int, first: int = 0, **changes: object) -> list[FrameReport]:
    report = FrameReport(0, 0.0, confidence=0.9, route=RouteState.READY)
    return [
        replace(report, index=first + n, captured_s=(first + n) * TICK_S, **changes)  # type: ignore[arg-type]
        for n in range(count)
    ]


def _causes(watch: FrameMonitor, now_s: float | None = None) -> set[Cause]:
    newest_s = watch.newest.captured_s if watch.newest is not None else 0.0
    return {fault.cause for fault in watch.faults(newest_s if now_s is None else now_s, SAFETY)}


# --- frames ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("age_s", "causes"),
    [
        (0.15, set()),
        (0.151, {Cause.CAMERA_SILENT, Cause.POSE_STALE}),
        (0.5, {Cause.CAMERA_SILENT, Cause.POSE_STALE}),
        (0.501, {Cause.CAMERA_LOST, Cause.POSE_LOST}),
    ],
)
def test_ages_of_frame_and_pose(age_s: float, causes: set[Cause]) -> None:
    assert _causes(_watch(*_good(1)), age_s) == causes


def test_a_living_camera_with_slow_perception_is_no_silent_camera() -> None:
    watch = _watch(*_good(1)).arrived(0.3, 0.3)
    assert _causes(watch, 0.4) == {Cause.POSE_STALE}
    assert _causes(FrameMonitor().arrived(0.0, 0.0), 0.1) == {Cause.POSE_LOST}
    assert FrameMonitor().arrived(0.0, 0.0).faults(0.1, SAFETY) == [Fault(Cause.POSE_LOST, "no pose yet")]


@pytest.mark.parametrize("captured_s", [0.2, 0.1, 0.51, math.nan, math.inf, -math.inf])
def test_an_arrival_that_is_older_or_from_the_future_is_ignored(captured_s: float) -> None:
    watch = FrameMonitor().arrived(0.2, 0.2)
    assert watch.arrived(captured_s, 0.5) == watch


def test_results_out_of_order_are_dropped_and_counted() -> None:
    first, second, third = _good(3)
    bad = replace(first, refusal=Reason.SEVERAL_ROBOTS)
    watch = _watch(first, second, third, bad, second, now_s=1.0)
    assert watch.out_of_order == 2
    assert watch.newest == third
    assert _watch(third, third, now_s=1.0).out_of_order == 1
    assert _watch(third, replace(third, index=9, captured_s=0.03), now_s=1.0).out_of_order == 1
    assert _watch(third, replace(third, index=9), now_s=1.0).out_of_order == 0


def test_a_camera_that_was_opened_again_counts_from_the_beginning() -> None:
    before = replace(_good(1)[0], index=500, captured_s=1.0)
    assert _watch(before, replace(before, index=0, captured_s=1.5), now_s=9.0).out_of_order == 1
    assert _watch(before, replace(before, index=0, captured_s=1.501), now_s=9.0).out_of_order == 0
    assert _watch(before, replace(before, index=0, captured_s=0.4), now_s=9.0).out_of_order == 1


@pytest.mark.parametrize("captured_s", [math.nan, math.inf, 5.001])
def test_a_frame_from_the_future_is_a_broken_result(captured_s: float) -> None:
    watch = _watch(*_good(1), now_s=5.0).update(replace(_good(1)[0], index=1, captured_s=captured_s), 5.0, SAFETY)
    assert watch.newest is not None
    assert watch.newest.index == 0
    assert Cause.NOT_FINITE in _causes(watch, 0.1)
    assert not watch.well
    again = watch.update(replace(_good(1)[0], index=2, captured_s=math.nan), 5.0, SAFETY)
    assert again.broken_run == 2


@pytest.mark.parametrize(("count", "frozen"), [(4, False), (5, True)])
def test_five_equal_pictures_are_a_frozen_camera(count: int, frozen: bool) -> None:
    first, *rest = _good(count)
    assert (Cause.CAMERA_FROZEN in _causes(_watch(first, *(replace(r, same_picture=True) for r in rest)))) == frozen


def test_a_different_picture_ends_the_row_of_equal_ones() -> None:
    frames = [replace(r, same_picture=n != 4) for n, r in enumerate(_good(8))]
    assert _watch(*frames[:4]).equal_run == 4  # the very first cannot be equal to anything
    assert _watch(*frames).equal_run == 4


@pytest.mark.parametrize(("reason", "cause"), [(Reason.BLACK, Cause.IMAGE_BLACK), (Reason.WHITE, Cause.IMAGE_WHITE)])
def test_three_dark_or_bright_pictures(reason: Reason, cause: Cause) -> None:
    bad = [replace(r, refusal=reason) for r in _good(4, first=1)]
    assert cause not in _causes(_watch(*_good(1), *bad[:2]))
    assert cause in _causes(_watch(*_good(1), *bad[:3]))
    mixed = [*bad[:2], replace(bad[2], refusal=Reason.BLURRED), bad[3]]
    assert cause not in _causes(_watch(*_good(1), *mixed))


def test_the_head_is_lost_after_three_frames_and_for_long_after_half_a_second() -> None:
    gone = [replace(r, refusal=Reason.NO_ROBOT) for r in _good(3, first=1)]
    assert _causes(_watch(*_good(1), *gone[:2])) == set()
    assert _causes(_watch(*_good(1), *gone)) == {Cause.HEAD_LOST}
    assert Cause.HEAD_LOST in _causes(_watch(*_good(1), *gone), 0.5)
    late = _causes(_watch(*_good(1), *gone), 0.501)
    assert Cause.HEAD_LOST_LONG in late
    assert Cause.HEAD_LOST not in late
    # without a frame before, from the first one on
    assert Cause.HEAD_LOST_LONG not in _causes(_watch(*gone), 0.53125)
    assert Cause.HEAD_LOST_LONG in _causes(_watch(*gone), 0.532)


def test_dark_pictures_never_become_a_lost_head() -> None:
    dark = [replace(r, refusal=Reason.BLACK) for r in _good(2, first=1)]
    assert Cause.IMAGE_BLACK not in _causes(_watch(*_good(1), *dark), 3.0)


@pytest.mark.parametrize("broken", [{"finite": False}, {"confidence": math.nan}, {"confidence": math.inf}])
def test_a_result_that_is_not_finite_is_discarded(broken: dict[str, object]) -> None:
    bad = _good(3, first=1, **broken)
    watch = _watch(*_good(1), bad[0])
    assert _causes(watch) == {Cause.NOT_FINITE}
    assert watch.pose_captured_s == 0.0
    assert not watch.well
    assert _causes(_watch(*_good(1), *bad[:2])) == {Cause.NOT_FINITE}
    assert _causes(_watch(*_good(1), *bad)) == {Cause.NOT_FINITE_REPEATED}
    mended = _watch(*_good(1), *bad[:2], *_good(1, first=3), *_good(2, first=4, **broken))
    assert _causes(mended) == {Cause.NOT_FINITE}
    assert _causes(_watch(*_good(1), bad[0], *_good(1, first=3))) == set()


def test_confidence_has_hysteresis() -> None:
    def after(*values: float) -> bool:
        return _watch(*(replace(r, confidence=c) for r, c in zip(_good(len(values)), values, strict=True))).unsure

    assert not after(0.5)
    assert after(0.499)
    assert after(0.499, 0.549)
    assert not after(0.499, 0.55)
    assert after(0.499, 0.55, 0.499)
    assert not after(0.499, 0.55, 0.5)


def test_a_confident_pose_before_a_refusal_says_nothing_about_confidence() -> None:
    unsure, refused = replace(_good(1)[0], confidence=0.1), replace(_good(1, first=1)[0], refusal=Reason.HEAD_JUMP)
    assert _causes(_watch(unsure)) == {Cause.CONFIDENCE_LOW}
    assert _causes(_watch(unsure, refused)) == {Cause.HEAD_JUMP}
    assert not _watch(unsure, refused).well


def test_a_refusal_keeps_the_route_and_the_age_of_the_last_pose() -> None:
    watch = _watch(*_good(1), replace(_good(1, first=1)[0], refusal=Reason.HEAD_JUMP, route=RouteState.NONE))
    assert watch.route is RouteState.READY
    assert watch.pose_captured_s == 0.0
    assert _watch(*_good(1, route=RouteState.BEHIND)).route is RouteState.BEHIND
    assert _watch(*_good(1)).well


@pytest.mark.parametrize(
    ("drift", "moved"), [(None, False), (6.0, False), (-6.0, False), (6.01, True), (-6.01, True), (math.nan, True)]
)
def test_landmarks_that_drift_mean_a_moved_camera(drift: float | None, moved: bool) -> None:
    assert (Cause.CAMERA_MOVED in _causes(_watch(*_good(1, drift_px=drift)))) == moved


@pytest.mark.parametrize(
    ("delivered", "lost", "causes"),
    [
        (27, 2, set()),  # too few to tell
        (24, 5, set()),
        (24, 6, {Cause.FRAMES_DROPPED}),  # exactly 20 %
        (23, 7, {Cause.FRAMES_LOST}),
        (27, 3, set()),  # exactly 10 %
        (26, 4, {Cause.FRAMES_DROPPED}),
    ],
)
def test_lost_frames(delivered: int, lost: int, causes: set[Cause]) -> None:
    assert _causes(_watch(*_good(1, delivered=delivered, lost=lost))) == causes


def test_loss_is_counted_over_three_seconds() -> None:
    bad, late = _good(1, delivered=20, lost=20)[0], replace(_good(1)[0], index=1, delivered=30)
    assert _causes(_watch(bad, replace(late, captured_s=3.0))) == {Cause.FRAMES_LOST_LONG}
    assert _causes(_watch(bad, replace(late, captured_s=3.01))) == set()


def test_loss_that_stays_for_half_a_second_is_loss_for_long() -> None:
    bad = _good(1, delivered=20, lost=20)[0]
    assert Cause.FRAMES_LOST in _causes(_watch(bad), 0.5)
    assert Cause.FRAMES_LOST_LONG in _causes(_watch(bad), 0.501)
    mended = _watch(
        bad, replace(bad, index=1, captured_s=0.4, delivered=200, lost=0), replace(bad, index=2, captured_s=0.6, lost=80)
    )
    assert Cause.FRAMES_LOST in _causes(mended, 0.7)


def test_the_details_are_measured_values() -> None:
    watch = _watch(*_good(1, delivered=20, lost=20, drift_px=9.4, confidence=0.3))
    assert watch.faults(0.2, SAFETY) == [
        Fault(Cause.CAMERA_SILENT, "newest frame 200 ms old"),
        Fault(Cause.POSE_STALE, "200 ms old"),
        Fault(Cause.CAMERA_MOVED, "by 9 px (at most 6 px)"),
        Fault(Cause.FRAMES_LOST, "50 %"),
        Fault(Cause.CONFIDENCE_LOW, "30 % (at least 50 %)"),
    ]
    assert [fault.detail for fault in watch.faults(0.6, SAFETY)][:2] == ["newest frame 600 ms old", "600 ms old"]
    dropped = _watch(*_good(1, delivered=26, lost=4)).faults(0.0, SAFETY)
    assert dropped == [Fault(Cause.FRAMES_DROPPED, "13 %")]


# --- hosts, model, gate ----------------------------------------------------------------------------


def _take(health: Health, *reports: Beat | GateReport, now_s: float = 0.0, armed: bool = True) -> Health:
    for report in reports:
        health = health.update(report, armed=armed, now_s=now_s, servos=SERVOS, safety=SAFETY)
    return health


def _host_faults(health: Health, now_s: float) -> dict[Cause, str]:
    return {fault.cause: fault.detail for fault in health.faults(now_s, SERVOS, SAFETY)}


def test_signs_of_life_are_told_apart() -> None:
    health = _take(Health(), Beat(Part.WINDOW), now_s=1.0)
    assert Cause.WINDOW_HUNG not in _host_faults(health, 1.5)
    assert _host_faults(health, 1.6)[Cause.WINDOW_HUNG] == "silent for 600 ms"
    assert _host_faults(health, 1.1)[Cause.WORKER_DEAD] == "no sign of life yet"
    assert Cause.WORKER_DEAD not in _host_faults(_take(health, Beat(Part.WORKER), now_s=1.0), 1.5)


BROKEN = (
    RejectReason.NON_FINITE, RejectReason.WRONG_COUNT, RejectReason.FROM_THE_FUTURE, RejectReason.OUT_OF_ENVELOPE,
    RejectReason.OVER_RATE,
)  # fmt: skip


@pytest.mark.parametrize("reason", RejectReason)
def test_what_the_gate_rejects(reason: RejectReason) -> None:
    run = [_host_faults(_take(Health(), *[GateReport(reason)] * count), 0.0) for count in (1, 2, 3)]
    if reason in {RejectReason.NOT_ARMED, RejectReason.WRONG_SOURCE}:  # not the program's fault
        assert all(Cause.COMMAND_REJECTED not in faults and Cause.COMMANDS_REJECTED not in faults for faults in run)
        return
    assert run[0][Cause.COMMAND_REJECTED] == reason.value
    assert Cause.COMMAND_REJECTED in run[1]
    if reason in BROKEN:
        assert run[2][Cause.COMMANDS_REJECTED] == "3 in a row"
    else:
        assert Cause.COMMANDS_REJECTED not in run[2]


def test_only_a_command_that_goes_through_ends_the_row_of_broken_ones() -> None:
    broken, stale = GateReport(RejectReason.OVER_RATE), GateReport(RejectReason.STALE_POSE)
    held = GateReport(RejectReason.NOT_ARMED)
    assert Cause.COMMANDS_REJECTED in _host_faults(_take(Health(), broken, held, stale, broken, held, broken), 0.0)
    assert Cause.COMMAND_REJECTED in _host_faults(_take(Health(), broken, broken, GateReport(None), broken), 0.0)
    ended = _host_faults(_take(Health(), broken, GateReport(None)), 0.0)
    assert Cause.COMMAND_REJECTED not in ended


@pytest.mark.parametrize("ends", [lambda health: _take(health, GateReport(None)), Health.disarmed])
def test_a_row_of_broken_commands_begins_with_none(ends: Callable[[Health], Health]) -> None:
    broken = [GateReport(RejectReason.OVER_RATE)] * (SAFETY.broken_results - 1)
    again = _take(ends(_take(Health(), *broken)), *broken)
    assert Cause.COMMANDS_REJECTED not in _host_faults(again, 0.0)
    assert Cause.COMMANDS_REJECTED in _host_faults(_take(again, broken[0]), 0.0)


def test_only_servos_that_are_as_configured_are_no_longer_restarted() -> None:
    restarted = Health().update(replace(GOOD_BUS, rebooted=True), armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
    for problems, is_over in ((("advance has another model",), False), ((), True)):
        health = restarted.update(ServosChecked(problems), armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
        assert (Cause.REBOOTED not in _host_faults(health, 0.0)) is is_over


def test_the_bus_may_be_silent_over_a_request_only_while_the_servos_are_off() -> None:
    heard = Health().update(GOOD_BUS, armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
    on = heard.update(ServosChecked(()), armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
    for health, is_excused in ((heard, True), (on, False)):
        busy = health.update(ServosBusy(), armed=False, now_s=5.0, servos=SERVOS, safety=SAFETY)
        assert (Cause.BUS_DEAD not in _host_faults(busy, 5.0)) is is_excused


def _bus_goes_quiet(health: Health, ended: Fault | None) -> Health:
    """As many reports of a bus process that is not armed as make it sure."""
    report = replace(GOOD_BUS, armed=False, ended=ended)
    for number in range(SAFETY.missed_answers):
        health = health.update(report, armed=True, now_s=number * TICK_S, servos=SERVOS, safety=SAFETY)
    return health


def test_servos_that_the_bus_process_has_disarmed_are_off_for_its_reason_or_for_none() -> None:
    on = Health().update(ServosChecked(()), armed=True, now_s=0.0, servos=SERVOS, safety=SAFETY)
    quiet = _bus_goes_quiet(on, None)
    assert (quiet.servos_ready, quiet.reported) == (False, (Fault(Cause.SERVOS_WRONG, "the servo process is not armed"),))
    hot = Fault(Cause.HOT, "advance: 71 C")
    assert _bus_goes_quiet(on, hot).reported == (hot,)


def test_servos_that_were_never_on_have_not_gone_off() -> None:
    assert _bus_goes_quiet(Health(), None).reported == ()


def test_what_the_gate_says_while_nothing_is_armed_counts_for_nothing() -> None:
    assert _take(Health(), *[GateReport(RejectReason.OVER_RATE)] * 5, armed=False) == Health()


def test_the_worst_fault_is_the_one_named_first_in_the_list_of_causes() -> None:
    faults = (Fault(Cause.POSE_LOST), Fault(Cause.CAMERA_LOST), Fault(Cause.HEAD_JUMP))
    assert worst(faults, Reaction.DISARM) == Fault(Cause.CAMERA_LOST)
    assert worst(faults, Reaction.HOLD) == Fault(Cause.HEAD_JUMP)
    assert worst(faults, Reaction.STOP) is None


# --- deadmen --------------------------------------------------------------------------------------


TIMEOUT_S = 0.078125
STEP_S = 0.0625


def _heard(script: str) -> Deadman:
    """After a report every 62.5 ms: ``-`` up, ``D`` down, ``?`` cannot tell, ``_`` none; armed from ``A`` to ``a``."""
    deadman, armed, now_s = Deadman(), False, 8.0
    for what in script:
        if what in "Aa":
            armed = what == "A"
            continue
        now_s += STEP_S
        if what != "_":
            deadman = deadman.update({"-": False, "D": True, "?": None}[what], now_s, armed=armed)
    return deadman


@pytest.mark.parametrize(
    ("script", "counts"),
    [
        ("A-D", True),
        ("-AD", True),  # the release may be from before
        ("-DAD", False),  # down since before arming
        ("AD", False),  # down at the first word: unknown since when
        ("A?D", False),  # what it could not tell is no release
        ("-DA?D", False),
        ("-DA???D", False),
        ("-DA_D", False),
        ("-DA-D", True),  # let go and pressed again
        ("-DA?-D", True),
        ("A-?D", True),  # the release was told, whatever came between
        ("A-D?D", True),  # held all the time, as far as is known
        ("A-D??DDD", True),
        ("A-D_______D", True),  # 0.5 s
        ("A-D________D", False),  # and more: as at the start
        ("A-D????????D", False),
        ("A-________D", False),
        ("A-D________-D", True),
        ("A-D-", False),
        ("A-D-aD", False),  # pressed once more when it is armed no longer
    ],
)
def test_a_press_counts_when_it_began_while_armed_from_a_release_that_was_told(script: str, counts: bool) -> None:
    assert _heard(script).counts is counts


def test_a_deadman_is_forgotten_only_after_more_than_half_a_second() -> None:
    held = Deadman().update(False, 1.0, armed=True).update(True, 1.0, armed=True)
    assert held.update(True, 1.0 + FORGOTTEN_S, armed=True).counts
    assert not held.update(True, 1.0 + FORGOTTEN_S + 0.0078125, armed=True).counts


@pytest.mark.parametrize(
    ("script", "down"), [("-", False), ("D", True), ("-D", True), ("-D?", False), ("-D?D", True), ("?", False)]
)
def test_it_is_down_only_while_it_tells_so(script: str, down: bool) -> None:
    deadman = _heard(script)
    assert deadman.is_down(8.0 + STEP_S * len(script) + TIMEOUT_S, TIMEOUT_S) is down
    assert not deadman.is_down(8.0 + STEP_S * len(script) + TIMEOUT_S + 0.0078125, TIMEOUT_S)


def test_one_that_is_held_is_enough_and_one_that_is_only_down_is_none() -> None:
    held, stuck, up = _heard("A-D"), _heard("-DA"), _heard("A--")
    now_s = 8.0 + 2 * STEP_S
    safety = SafetyConfig(deadman_timeout_s=TIMEOUT_S)
    for deadmen, is_held in (({0: up, 1: stuck, 2: held}, True), ({0: up, 1: stuck}, False), ({}, False)):
        assert Health(deadmen=deadmen).deadman_held(now_s, safety) is is_held


def test_what_was_said_counts_from_then_and_never_from_the_future() -> None:
    assert [DeadmanReport(True, said_s).at_s(5.0) for said_s in (None, 4.75, 5.25)] == [5.0, 4.75, 5.0]
