"""Reports in, faults out: every threshold on either side; deadmen."""

from dataclasses import replace

import pytest

from core.config.safety import SafetyConfig
from core.control.camera_monitor import FrameReport
from core.control.direction_monitor import HeadSeen, MotionSent
from core.control.faults import Cause, Fault, Reaction, worst
from core.control.gate import RejectReason
from core.control.health import FORGOTTEN_S, Beat, Deadman, DeadmanReport, GateReport, Health, Part, ServoCheckReport, ServosBusy
from tests.core.healthy import GOOD_BUS, SAFETY, SERVOS, TICK_S


def _take(health: Health, *reports: Beat | GateReport | FrameReport | MotionSent, now_s: float = 0.0, armed: bool = True) -> Health:
    for report in reports:
        health = health.update(report, armed=armed, now_s=now_s, servos=SERVOS, safety=SAFETY)
    return health


def _host_faults(health: Health, now_s: float) -> dict[Cause, str]:
    return {fault.cause: fault.detail for fault in health.faults(now_s, SERVOS, SAFETY)}


def test_signs_of_life_are_told_apart() -> None:
    health = _take(Health(), Beat(Part.WINDOW), now_s=1.0)
    assert Cause.WINDOW_HUNG not in _host_faults(health, 1.5)
    assert _host_faults(health, 1.6)[Cause.WINDOW_HUNG] == "silent for 600 ms"
    assert _host_faults(health, 1.1)[Cause.HEARTBEAT_LOST] == "no sign of life yet"
    assert Cause.HEARTBEAT_LOST not in _host_faults(_take(health, Beat(Part.PERCEPTION), now_s=1.0), 1.5)


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


def test_only_servos_that_are_as_configured_are_no_longer_restarted() -> None:
    restarted = Health().update(replace(GOOD_BUS, rebooted=True), armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
    for problems, is_over in ((("advance has another model",), False), ((), True)):
        health = restarted.update(ServoCheckReport(problems), armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
        assert (Cause.REBOOTED not in _host_faults(health, 0.0)) is is_over


def test_the_bus_may_be_silent_over_a_request_only_while_the_servos_are_off() -> None:
    heard = Health().update(GOOD_BUS, armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
    on = heard.update(ServoCheckReport(()), armed=False, now_s=0.0, servos=SERVOS, safety=SAFETY)
    for health, is_excused in ((heard, True), (on, False)):
        busy = health.update(ServosBusy(), armed=False, now_s=5.0, servos=SERVOS, safety=SAFETY)
        assert (Cause.BUS_DEAD not in _host_faults(busy, 5.0)) is is_excused


def test_only_poses_that_are_sure_enough_show_the_direction() -> None:
    health = _take(Health(), MotionSent(0.0, 0.0, 1.0))
    head = HeadSeen(0.0, 0.0, 0.0, 80.0, (0.0, 0.0), (1.0, 0.0))
    for confidence, seen in ((SAFETY.min_confidence - 0.01, 0), (SAFETY.min_confidence, 1)):
        assert len(_take(health, FrameReport(1, 0.0, confidence=confidence, head=head)).direction.seen) == seen


def _bus_goes_quiet(health: Health, ended: Fault | None) -> Health:
    """As many reports of a bus process that is not armed as make it sure."""
    report = replace(GOOD_BUS, armed=False, ended=ended)
    for number in range(SAFETY.missed_answers):
        health = health.update(report, armed=True, now_s=number * TICK_S, servos=SERVOS, safety=SAFETY)
    return health


def test_servos_that_the_bus_process_has_disarmed_are_off_for_its_reason_or_for_none() -> None:
    on = Health().update(ServoCheckReport(()), armed=True, now_s=0.0, servos=SERVOS, safety=SAFETY)
    quiet = _bus_goes_quiet(on, None)
    assert (quiet.servos_ready, quiet.reported) == (False, (Fault(Cause.SERVOS_WRONG, "the servo process is not armed"),))
    hot = Fault(Cause.HOT, "advance: 71 C")
    assert _bus_goes_quiet(on, hot).reported == (hot,)


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
