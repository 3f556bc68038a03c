"""What the bus process decides, without a process: messages, one order's step, and faults 21 to 28 of the safety rules."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.config.safety import SafetyConfig, ServosConfig
from core.control.faults import Cause, Fault
from core.control.gate import Rejection, RejectReason, Source
from core.control.joints import Retracted
from core.control.kept_zero import ZeroRequest
from core.types import Command
from hardware.servos.bus_guard import (
    RELAX_MM_S,
    RELEASE_MM_S,
    Attention,
    BusGuard,
    OneStep,
    ReleaseRamp,
    UnattendedWatch,
    report_of,
)
from hardware.servos.bus_ipc import BusOrder, Heartbeat, pack_heartbeat, pack_order, unpack_heartbeat, unpack_order
from hardware.servos.dynamixel_port import NotReady
from hardware.servos.registers import HardwareError, MissingServo, ServoReading, ServoState
from tools.lockstep import LockStepServos

SERVOS, SAFETY = ServosConfig(), SafetyConfig()
CYCLE_S = 0.02


# --- messages -------------------------------------------------------------------------------------------------------------------


def test_orders_and_heartbeats_come_over_whole() -> None:
    orders = [
        BusOrder(Command(0.1, -0.2, 3.0, -4.0), Source.OPERATOR, 12.5),
        BusOrder(Command(), Source.PROGRAM, 12.5, 12.4),
        *(BusOrder(Command(), Source.OPERATOR, 12.5, None, Retracted(flags)) for flags in range(4)),
        BusOrder(None, Source.OPERATOR, 1e9),
    ]
    assert [unpack_order(pack_order(order)) for order in orders] == orders
    beats = [Heartbeat(1.0, None), Heartbeat(2.0, Source.OPERATOR), Heartbeat(3.0, Source.PROGRAM)]
    assert [unpack_heartbeat(pack_heartbeat(beat)) for beat in beats] == beats
    assert unpack_heartbeat(pack_heartbeat(Heartbeat(math.nan, None))) is None


@given(st.binary(max_size=64))
def test_no_bytes_make_an_order_that_is_none(data: bytes) -> None:
    order, beat = unpack_order(data), unpack_heartbeat(data)
    assert order is None or isinstance(order.source, Source)
    assert beat is None or math.isfinite(beat.time_s)


# --- one order, one step ---------------------------------------------------------------------------------------------------------


def test_one_order_moves_a_joint_by_one_step_at_most() -> None:
    """The steps are 0.6 mm of a tendon and 1 mm of a feed, from where the joint was when the order was first obeyed."""
    step, at = OneStep(SERVOS.joints), (0.0,) * 4 + (10.0, 0.0, 0.0)
    asked = (0.5, -0.7, 0.0, 0.0, 10.9, 2.0, math.nan)
    bounded = step.bounded(asked, (1.0, "a"), at)
    assert bounded[:6] == (0.5, -0.6, 0.0, 0.0, 10.9, 1.0)
    assert math.isnan(bounded[6])
    moved = (0.5, -0.6, 0.0, 0.0, 10.9, 0.9, 0.0)
    further = (0.9, -0.9, 0.0, 0.0, 11.5, 1.5, 0.0)
    assert step.bounded(further, (1.0, "a"), moved) == (0.6, -0.6, 0.0, 0.0, 11.0, 1.0, 0.0)
    assert step.bounded(further, (1.02, "a"), moved) == further


# --- tendons are let go ----------------------------------------------------------------------------------------------------------

PULLED = (2.3, -1.7, 0.3, 0.3, 40.0, 3.0, 3.0)


def test_tendons_are_let_go_slowly_to_no_pull_and_nothing_else_moves() -> None:
    ramp, at_mm = ReleaseRamp(SERVOS.joints, PULLED, 10.0), list(PULLED)
    for now_s, tendons in ((10.0, (2.3, -1.7, 0.3, 0.3)), (10.1, (2.1, -1.7, 0.1, 0.1)), (10.4, (1.5, -1.7, 0.0, 0.0))):
        goals = ramp.goals(at_mm, now_s)
        assert goals[1] is None, "it hangs slack already"
        assert goals[4:] == (None, None, None), "nothing is pulled out of a vessel without an order"
        at_mm = [at if goal is None else goal for goal, at in zip(goals, at_mm, strict=True)]
        assert at_mm[:4] == pytest.approx(tendons)
    assert ramp.goals((0.05, -1.7, 0.0, 0.0, 40.0, 3.0, 3.0), 11.0) is None


def test_without_hurry_they_are_let_go_at_half_the_speed() -> None:
    assert ReleaseRamp(SERVOS.joints, PULLED, 10.0, RELAX_MM_S).goals(PULLED, 10.1)[0] == pytest.approx(2.2)


def test_a_drum_that_does_not_turn_ends_it() -> None:
    ramp = ReleaseRamp(SERVOS.joints, PULLED, 10.0)
    assert ramp.goals(PULLED, 11.6) is not None
    assert ramp.goals(PULLED, 10.0 + 2.3 / RELEASE_MM_S + 0.51) is None
    slack = ReleaseRamp(SERVOS.joints, (-1.7,) * 4 + PULLED[4:], 10.0)
    assert slack.goals((0.3,) * 4 + PULLED[4:], 10.49) is not None
    assert slack.goals((0.3,) * 4 + PULLED[4:], 10.51) is None


def test_a_tendon_that_cannot_be_read_keeps_no_other_one_tight_and_is_named() -> None:
    """One that tells where it is later is let go from there; one that never does is waited for as long as its whole way takes."""
    left, blind = PULLED[1], (PULLED[0], None, None, *PULLED[3:])
    ramp = ReleaseRamp(SERVOS.joints, blind, 10.0)
    goals = ramp.goals(blind, 10.1)
    assert goals[:4] == pytest.approx((2.1, None, None, 0.1))
    at_mm: tuple[float | None, ...] = (0.0, left, None, 0.0, *PULLED[4:])
    assert ramp.goals(at_mm, 11.2) is not None
    assert ramp.tight == ("up",)
    late = ramp.goals((*at_mm[:2], 0.3, *at_mm[3:]), 11.3)
    assert late[2] == pytest.approx(0.3)
    assert ramp.goals((*at_mm[:2], 0.0, *at_mm[3:]), 11.5) is None
    assert ramp.tight == ()
    never = ReleaseRamp(SERVOS.joints, (0.0, 0.0, None, 0.0, *PULLED[4:]), 10.0)
    assert never.goals((0.0, 0.0, None, 0.0, *PULLED[4:]), 11.8) is not None
    assert never.goals((0.0, 0.0, None, 0.0, *PULLED[4:]), 12.0) is None
    assert never.tight == ("up",)


pulls = st.floats(-3.0, 6.0)


@given(st.tuples(*[pulls] * 4), st.tuples(*[pulls] * 4), st.floats(0.0, 10.0))
def test_letting_go_never_tightens_and_is_one_step_at_most(
    begun: tuple[float, ...], at_mm: tuple[float, ...], after_s: float
) -> None:
    goals = ReleaseRamp(SERVOS.joints, (*begun, 1.0, 2.0, 2.0), 50.0).goals((*at_mm, 5.0, 6.0, 6.0), 50.0 + after_s)
    if goals is None:
        assert after_s > 0.5 or max(at_mm) <= 0.05
        return
    assert goals[4:] == (None, None, None)
    for joint, goal, at in zip(SERVOS.joints, goals, at_mm, strict=False):
        assert goal is None if at <= 0.0 else goal is not None and max(0.0, at - joint.max_step_mm) <= goal <= at


# --- the guard -------------------------------------------------------------------------------------------------------------------


class Bench:
    """A guard in simulated time with seven servos that are where the goals are, unless a test says else."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.guard = BusGuard(SERVOS, SAFETY, self.now_s)
        self.positions = [0.0] * 7
        self.goals = [0.0] * 7
        self.beating = True
        self.permitted: Source | None = Source.PROGRAM
        self.command: Command | None = Command(advance_mm_s=5.0)
        self.beat: Heartbeat | None = None
        self.order: BusOrder | None = None
        self.errors = 0
        self.alter: Callable[[ServoState], ServoReading] = lambda state: state
        self.frozen = False

    def readings(self) -> list[ServoReading]:
        return [
            self.alter(
                ServoState(joint.name, joint.id, self.now_s, 0, 0, at, goal, 0.0, 8.0, 12.0, 30.0, HardwareError(0), True, False)
            )
            for joint, at, goal in zip(SERVOS.joints, self.positions, self.goals, strict=True)
        ]

    def cycle(self, pause_s: float = CYCLE_S) -> None:
        """One turn as the loop makes it."""
        self.now_s += pause_s
        if self.beating:
            self.beat = Heartbeat(self.now_s, self.permitted)
            self.order = BusOrder(self.command, Source.PROGRAM, self.now_s, self.now_s)
        fault = self.guard.update(self.readings(), self.errors, self.beat, self.now_s)
        if fault is not None:
            self.guard.end_motion(fault)
        elif self.guard.armed:
            step = self.guard.step(self.order, self.beat, self.now_s)
            if step.goals_mm is not None:
                self.guard.record_sent(step.goals_mm, self.order, self.now_s)
                self.goals = list(step.goals_mm)
                if not self.frozen:
                    self.positions = list(step.goals_mm)

    def arm(self) -> None:
        self.cycle()
        self.guard.check_arming()
        self.guard.set_armed(self.now_s)

    @property
    def cause(self) -> Cause:
        return self.guard.latched.cause

    @property
    def reason(self) -> RejectReason:
        return self.guard.rejection.reason

    def cycles(self, count: int) -> None:
        for _ in range(count):
            self.cycle()

    def until_disarmed(self, most_s: float) -> float:
        """Seconds until the guard is disarmed."""
        start_s = self.now_s
        while self.guard.armed and self.now_s - start_s < most_s:
            self.cycle()
        assert not self.guard.armed
        return self.now_s - start_s


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.arm()
    return bench


def test_it_boots_disarmed_and_the_first_goals_are_the_positions() -> None:
    bench = Bench()
    bench.positions[4] = 3.0
    bench.cycle()
    assert not bench.guard.armed
    assert bench.guard.sent is None
    bench.arm()
    bench.cycle()
    assert bench.guard.sent.goals_mm[4] == 3.0
    assert bench.guard.sent.motion.advance_mm_s == 0.0


def test_it_follows_orders_and_tells_what_was_sent(bench: Bench) -> None:
    bench.cycles(50)
    assert bench.goals[4] == pytest.approx(5.0 * 0.98, abs=0.4)
    assert bench.guard.sent.motion.advance_mm_s == pytest.approx(5.0)
    assert bench.guard.sent.order == bench.order


def test_what_was_limited_is_told_as_it_was_sent(bench: Bench) -> None:
    """Asked for 20 mm/s from rest, the joint may get faster by 200 mm/s^2."""
    assert bench.guard.clamp_count == 0
    bench.command = Command(advance_mm_s=20.0, bend=1.0)
    bench.cycles(3)
    assert bench.guard.clamp_count >= len(bench.guard.clamps) > 0
    assert bench.guard.sent.motion.advance_mm_s == pytest.approx(8.0)
    assert 0.0 < bench.guard.sent.motion.bend < 0.3


def test_where_nothing_is_written_nothing_is_told_as_sent(bench: Bench) -> None:
    """Positions that are too old: the servos keep their goals, and the order of long ago was shown as if it still went out."""
    bench.command = Command(advance_mm_s=5.0, bend=0.5)
    bench.cycles(20)
    bench.alter = lambda state: MissingServo(state.name, state.id, state.time_s, 0, "late") if state.id == 3 else state
    bench.cycles(7)
    assert bench.reason is RejectReason.STALE_MEASUREMENT
    assert bench.guard.sent.order is None
    assert bench.guard.sent.motion == Command(bend=pytest.approx(0.5))
    assert bench.guard.sent.goals_mm == tuple(bench.goals)
    bench.alter = lambda state: state
    bench.cycles(2)
    assert bench.guard.sent.order == bench.order


def _silent_one(servo_id: int | None, state: ServoState) -> ServoReading:
    return MissingServo(state.name, state.id, state.time_s, 1, "silent") if state.id == servo_id else state


def test_servos_that_are_silent_in_turns_disarm() -> None:
    """None misses three answers in a row, and yet there are never positions of all: all stood still, and nothing said why."""
    bench = Bench()
    bench.arm()
    begun_s = bench.now_s
    for turn in range(100):
        bench.alter = partial(_silent_one, (1, 5)[turn % 2])
        bench.cycle()
        if not bench.guard.armed:
            break
    assert not bench.guard.armed
    assert bench.now_s - begun_s == pytest.approx(SAFETY.bus_disarm_s, abs=2.1 * CYCLE_S)
    assert bench.cause is Cause.SERVO_SILENT
    assert bench.guard.latched.detail == "in turns, right, advance: not all in one cycle for 0.5 s"
    bench.alter = lambda state: state
    bench.cycle()
    bench.guard.acknowledge()
    bench.guard.check_arming()


def test_one_whole_cycle_now_and_then_is_enough() -> None:
    bench = Bench()
    bench.arm()
    for turn in range(100):
        bench.alter = partial(_silent_one, (1, 5, None)[turn % 3])
        bench.cycle()
    assert bench.guard.armed


def test_an_order_from_before_the_arming_does_not_count() -> None:
    bench = Bench()
    bench.cycle()
    bench.now_s += 0.001
    bench.guard.set_armed(bench.now_s)
    bench.beating = False
    bench.cycle()
    assert bench.reason is RejectReason.NO_COMMAND


def test_a_joint_from_where_no_goal_leads_hinders_arming_and_is_named() -> None:
    bench = Bench()
    bench.positions[0], bench.positions[4] = 4.0, 402.0
    with pytest.raises(NotReady) as told:
        bench.arm()
    what_to_do = "switch the torque off and move it back by hand, or zero it again"
    assert str(told.value) == (
        f"not armed: outside its envelope: right at 4.00 mm (-2.4 to 2.8 mm): {what_to_do}; "
        f"outside its envelope: advance at 402.00 mm (-5 to 400 mm): {what_to_do}"
    )
    assert not bench.guard.armed
    bench.positions[0], bench.positions[4] = 2.8, 400.8  # one bounded step brings it back
    bench.arm()
    bench.cycle()
    assert bench.guard.sent.goals_mm[4] == 400.0


def test_positions_from_long_ago_and_unknown_ones_hinder_no_arming() -> None:
    bench = Bench()
    bench.positions[4] = 407.0
    bench.cycle()
    bench.alter = lambda state: replace(state, position_mm=None)  # a lost zero, of which the driver tells
    bench.cycles(6)
    bench.guard.check_arming()


def test_why_not_even_a_hold_leaves_is_told_also_while_nobody_may_drive() -> None:
    bench = Bench()
    bench.permitted = None
    bench.arm()
    bench.positions[4] = 402.0  # moved between the check and the first cycle
    bench.cycle()
    assert bench.guard.sent is None
    assert bench.reason is RejectReason.MEASURED_OUT_OF_ENVELOPE
    assert bench.guard.rejection.detail == "advance at 402.00 mm (-5 to 400 mm)"
    bench.positions[4] = 0.0
    bench.cycle()
    assert bench.guard.sent is not None
    assert bench.reason is RejectReason.NOT_ARMED


def test_in_lock_step_the_guard_looks_before_it_arms() -> None:
    servos = LockStepServos(SERVOS, SAFETY, lambda: 100.0)
    servos.cycle()
    servos._at_mm = (0.0, 0.0, 0.0, 0.0, 407.0, 0.0, 0.0)
    with pytest.raises(NotReady, match=r"advance at 407\.00 mm"):
        servos.arm()
    servos.zero(ZeroRequest(positions_mm={"advance": 0.0}))
    servos.arm()
    servos._at_mm = (0.0, 0.0, 0.0, 0.0, 407.0, 0.0, 0.0)
    servos.cycle()
    assert servos.sent_motion() is None
    assert servos.kept_back() == Rejection(RejectReason.MEASURED_OUT_OF_ENVELOPE, "advance at 407.00 mm (-5 to 400 mm)")
    servos.disarm()
    assert servos.kept_back() is None


def test_a_dead_application_moves_a_joint_by_one_step_then_it_holds_then_it_is_disarmed(bench: Bench) -> None:
    bench.command = Command(advance_mm_s=20.0)
    bench.cycles(28)
    before = bench.positions[4]  # where the last order finds it
    bench.cycles(2)
    last, bench.beating = bench.positions[4], False
    bench.cycles(7)
    assert bench.reason is RejectReason.NOT_ARMED
    held = bench.positions[4]
    assert last < held <= before + SERVOS.joints[4].max_step_mm + 1e-9
    assert 0.34 < bench.until_disarmed(1.0) < 0.40
    assert bench.positions[4] == held
    assert bench.cause is Cause.HEARTBEAT_LOST
    assert re.search(r"for 5\d\d ms$", bench.guard.latched.detail)


@pytest.mark.parametrize("permitted", [None, Source.OPERATOR])
def test_nobody_but_the_permitted_one_moves_the_servos(bench: Bench, permitted: Source | None) -> None:
    bench.cycle()
    before, bench.permitted = bench.goals, permitted
    bench.cycles(10)
    assert bench.goals == before
    assert bench.guard.armed


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_rejected_by_name(bench: Bench, number: float) -> None:
    bench.cycle()
    before, bench.command = bench.goals, Command(bend=number)
    bench.cycle()
    assert bench.guard.rejections[RejectReason.NON_FINITE] == 1
    assert bench.goals == before


def _restarted(state: ServoState) -> ServoReading:
    return MissingServo(state.name, state.id, state.time_s, 0, "", restarted=True)


def _silent(state: ServoState) -> ServoReading:
    return MissingServo(state.name, state.id, state.time_s, 3, "no answer") if state.id == 3 else state


@pytest.mark.parametrize(
    ("alter", "cause", "stops"),
    [
        (_silent, Cause.SERVO_SILENT, False),
        (lambda s: replace(s, error=HardwareError.OVERLOAD, torque=False) if s.id == 2 else s, Cause.SERVO_ALERT, True),
        (lambda s: replace(s, temperature_c=70.0) if s.id == 5 else s, Cause.HOT, False),
        (lambda s: replace(s, voltage_v=10.5) if s.id == 4 else s, Cause.VOLTAGE_LOW, False),
        (lambda s: replace(s, voltage_v=10.5), Cause.SUPPLY_LOST, False),
        (lambda s: replace(s, torque=False) if s.id == 7 else s, Cause.TORQUE_TAKEN, False),
        (lambda s: MissingServo(s.name, s.id, s.time_s, 0, "", restarted=True) if s.id == 7 else s, Cause.REBOOTED, False),
        (lambda s: replace(s, watchdog_tripped=True) if s.id == 1 else s, Cause.WATCHDOG, False),
    ],
    ids=["21 silent", "23 overload", "24 hot", "24 voltage", "E-stop", "29 torque off", "27 restarted", "watchdog"],
)
def test_faults_of_servos(bench: Bench, alter: Callable[[ServoState], ServoReading], cause: Cause, stops: bool) -> None:
    bench.cycle()
    bench.alter = alter
    bench.cycle()
    assert (bench.guard.armed, bench.guard.stopped) == (False, stops)
    assert bench.cause is cause
    assert bench.guard.fault_counts[cause] == 1
    with pytest.raises(NotReady, match="acknowledge first"):
        bench.guard.check_arming()


def test_fault_22_six_bad_packets_in_a_second(bench: Bench) -> None:
    for errors in (2, 2, 1):
        bench.errors = errors
        bench.cycle()
        assert bench.guard.armed
    bench.errors = 1
    bench.cycle()
    assert bench.cause is Cause.BUS_NOISE


def test_fault_25_a_jam(bench: Bench) -> None:
    bench.cycles(20)
    bench.frozen = True
    assert 0.2 < bench.until_disarmed(2.0) < 0.6
    assert bench.guard.stopped
    assert bench.cause is Cause.TRACKING
    assert "advance stands" in bench.guard.latched.detail


def test_fault_26_the_port_is_lost(bench: Bench) -> None:
    bench.guard.end_motion(bench.guard.lose_port())
    assert (bench.guard.armed, bench.guard.stopped) == (False, True)
    bench.guard.acknowledge()
    with pytest.raises(NotReady, match=r"servo port lost$"):
        bench.guard.check_arming()


def test_fault_35_the_process_stood_still(bench: Bench) -> None:
    bench.cycle()
    bench.cycle(pause_s=1.5)
    assert bench.cause is Cause.CLOCK


def test_the_first_cause_stays_until_acknowledged_and_nothing_arms_itself(bench: Bench) -> None:
    bench.alter = lambda state: replace(state, temperature_c=80.0)
    bench.cycle()
    bench.alter = lambda state: replace(state, error=HardwareError.OVERLOAD)
    bench.cycle()
    assert bench.cause is Cause.HOT
    bench.guard.acknowledge()
    assert bench.guard.latched is None
    with pytest.raises(NotReady, match="hardware error"):
        bench.guard.check_arming()
    bench.alter = lambda state: state
    bench.cycles(5)
    assert not bench.guard.armed
    bench.arm()
    assert bench.guard.armed


def test_a_warning_and_what_arming_mends_hinder_no_arming() -> None:
    for changes, cause in (({"temperature_c": 66.0}, Cause.WARM), ({"watchdog_tripped": True}, Cause.WATCHDOG)):
        bench = Bench()
        _altered(**changes)(bench)
        assert [fault.cause for fault in bench.guard.active] == [cause]
        bench.guard.check_arming()


def test_disarmed_no_order_is_followed() -> None:
    bench = Bench()
    bench.cycle()
    assert bench.guard.step(bench.order, bench.beat, bench.now_s).rejection.reason is RejectReason.NOT_ARMED


def test_disarmed_a_silent_application_is_no_fault() -> None:
    bench = Bench()
    bench.beating = False
    bench.cycles(100)
    assert bench.guard.active == ()


def test_no_readings_at_all_are_no_measurement(bench: Bench) -> None:
    bench.guard.update([], 0, bench.beat, bench.now_s)


def test_positions_are_as_old_as_the_oldest(bench: Bench) -> None:
    bench.cycle()
    bench.alter = lambda state: replace(state, time_s=state.time_s - 0.2) if state.id == 3 else state
    bench.cycle()
    assert bench.reason is RejectReason.STALE_MEASUREMENT


def test_what_was_sent_stays_told_until_more_is_sent(bench: Bench) -> None:
    bench.cycles(3)
    sent = bench.guard.sent
    bench.guard.step(bench.order, bench.beat, bench.now_s)
    assert bench.guard.sent is sent
    assert sent.order is not None


def test_the_operator_alone_pulls_a_feed_out_of_its_envelope() -> None:
    for source in Source:
        bench = Bench()
        bench.positions[4] = bench.goals[4] = SERVOS.joints[4].low_mm
        bench.arm()
        bench.beating = False
        for _ in range(20):
            now_s = bench.now_s + CYCLE_S
            bench.beat = Heartbeat(now_s, source)
            bench.order = BusOrder(Command(advance_mm_s=-1.0), source, now_s, now_s, Retracted.ROBOT)
            bench.cycle()
        assert (bench.positions[4] < SERVOS.joints[4].low_mm - 0.1) is (source is Source.OPERATOR)
        assert bench.guard.rejection is None
        assert bench.guard.at_end == (("advance",) if source is Source.PROGRAM else ())


def test_servos_that_are_too_hot_are_relaxed_where_they_hold_and_only_then(bench: Bench) -> None:
    """Not while the motion goes on, which must end first, nor without torque, where nothing holds."""
    assert not Bench().guard.must_relax, "not before the first reading"
    bench.alter = lambda state: replace(state, temperature_c=90.0)
    assert bench.guard.update(bench.readings(), 0, bench.beat, bench.now_s) is not None
    assert not bench.guard.must_relax
    bench.guard.disarm()
    assert bench.guard.must_relax
    bench.alter = lambda state: replace(state, temperature_c=90.0 if state.id == 5 else 30.0)
    bench.cycle()
    assert bench.guard.must_relax, "one is enough"
    bench.guard.release_ramp(bench.now_s)
    assert not bench.guard.must_relax, "they were"
    hot = bench.alter
    for bench.alter in (lambda state: state, hot):
        bench.cycle()
    assert bench.guard.must_relax, "they had cooled down"
    bench.alter = lambda state: replace(state, temperature_c=90.0, torque=False)
    bench.cycle()
    assert not bench.guard.must_relax


def test_tendons_that_have_not_told_where_they_are_for_long_are_not_let_go(bench: Bench) -> None:
    bench.cycle()
    bench.alter = lambda state: replace(state, position_mm=None) if state.id == 1 else state
    bench.cycle()
    assert bench.guard.release_ramp(bench.now_s).tight == (), "a moment ago it did"
    assert bench.guard.release_ramp(bench.now_s + SAFETY.measurement_max_age_s + 0.01) is None


def test_stops_and_restarts_are_counted(bench: Bench) -> None:
    bench.alter = _silent
    bench.cycle()
    assert bench.guard.restarts == 0
    bench.guard.end_motion(Fault(Cause.STOP_PRESSED))
    assert bench.guard.fault_counts[Cause.STOP_PRESSED] == 1
    bench.guard.end_motion(Fault(Cause.HOT))
    assert bench.guard.stopped, "until it is acknowledged"
    bench.alter = _restarted
    bench.cycle()
    assert bench.guard.restarts == len(SERVOS.joints)


# --- what is reported ------------------------------------------------------------------------------------------------------------


def test_goals_count_where_they_are_followed_and_values_where_all_tell_theirs() -> None:
    bench = Bench()
    bench.goals[4] = 0.3
    states = bench.readings()
    for armed in (True, False):
        report = report_of(states, armed=armed, errors=0)
        assert report.tracking_mm == (0.0,) * 4 + (0.3 if armed else 0.0,) + (0.0,) * 2
    assert report.temperatures_c == (30.0,) * 7
    assert report_of([replace(states[0], goal_mm=None), *states[1:]], armed=True, errors=0).tracking_mm == (0.0,) * 7
    gap = report_of([*states[:6], MissingServo("delivery_2", 7, bench.now_s, 1, "silent")], armed=True, errors=0)
    assert (gap.temperatures_c, gap.voltages_v, gap.tracking_mm) == ((), (), ())
    assert gap.misses == (0,) * 6 + (1,)


def test_what_only_an_armed_servo_can_lose() -> None:
    state = replace(Bench().readings()[0], is_limited=False, torque=False)
    for armed in (True, False):
        report = report_of([state], armed=armed, errors=0)
        assert (report.limit_lost, report.torque_taken, report.rebooted) == ((armed,), (armed,), False)
    switched_off = report_of([replace(state, error=HardwareError.OVERLOAD)], armed=True, errors=0)
    assert switched_off.torque_taken == (False,), "it did so itself"
    assert report_of([state], armed=True, errors=0, rebooted=True).rebooted


# --- every state x event ---------------------------------------------------------------------------------------------------------


def _in_state(state: str) -> Bench:
    bench = Bench()
    bench.arm()
    bench.cycles(3)
    if state != "armed":
        bench.guard.disarm()
    if state in {"fault", "stopped"}:
        bench.guard.end_motion(Fault(Cause.HOT if state == "fault" else Cause.STOP_PRESSED))
    return bench


def _state_of(guard: BusGuard) -> str:
    return "armed" if guard.armed else "stopped" if guard.stopped else "fault" if guard.latched is not None else "off"


def _arm(bench: Bench) -> None:
    with suppress(NotReady):
        bench.arm()


def _altered(**changes: object) -> Callable[[Bench], None]:
    def inject(bench: Bench) -> None:
        bench.alter = lambda state: replace(state, **changes)
        bench.cycle()

    return inject


def _application_dies(bench: Bench) -> None:
    bench.beating = False
    bench.cycles(30)


EVENTS: dict[str, tuple[Callable[[Bench], object], tuple[str, str, str, str]]] = {
    #                                                                                   off        armed      fault      stopped
    "a cycle": (Bench.cycle,                                                          ("off",     "armed",   "fault",   "stopped")),
    "arm": (_arm,                                                                     ("armed",   "armed",   "fault",   "stopped")),
    "acknowledge": (lambda bench: bench.guard.acknowledge(),                          ("off",     "armed",   "off",     "off")),
    "disarm": (lambda bench: bench.guard.disarm(),                                    ("off",     "off",     "fault",   "stopped")),
    "STOP": (lambda bench: bench.guard.end_motion(Fault(Cause.STOP_PRESSED)),         ("stopped",) * 4),
    "port lost": (lambda bench: bench.guard.end_motion(bench.guard.lose_port()),      ("stopped",) * 4),
    "too hot": (_altered(temperature_c=90.0),                                         ("off",     "fault",   "fault",   "stopped")),
    "overload": (_altered(error=HardwareError.OVERLOAD),                              ("off",     "stopped", "fault",   "stopped")),
    "torque taken": (_altered(torque=False),                                          ("off",     "fault",   "fault",   "stopped")),
    "all restarted": (lambda bench: (setattr(bench, "alter", _restarted), bench.cycle()),
                                                                                      ("off",     "fault",   "fault",   "stopped")),
    "application dies": (_application_dies,                                           ("off",     "fault",   "fault",   "stopped")),
    "stands still": (lambda bench: bench.cycle(pause_s=1.5),                          ("off",     "fault",   "fault",   "stopped")),
}  # fmt: skip


@pytest.mark.parametrize(("event", "place"), list(product(EVENTS, range(4))))
def test_every_event_in_every_state(event: str, place: int) -> None:
    inject, after = EVENTS[event]
    bench = _in_state(("off", "armed", "fault", "stopped")[place])
    before, first = list(bench.goals), bench.guard.latched
    inject(bench)
    assert _state_of(bench.guard) == after[place]
    if place == 2 and event in {"STOP", "port lost"}:
        assert bench.guard.latched is first, "the first cause stays"
    if after[place] != "armed":
        assert bench.guard.sent is None
        at = list(bench.goals)
        bench.cycles(3)
        assert bench.goals == at
        assert place == 1 or at == before, "nothing moves that was not armed"


# --- whose order: at a hand-over the next one's order is there before his permission ----------------------------------------------


def _hand_over(bench: Bench, *, order_first: bool) -> None:
    """One cycle that falls between the two writes of a hand-over from the program to the operator."""
    bench.cycle()
    bench.now_s += CYCLE_S
    order = BusOrder(Command(advance_mm_s=5.0), Source.OPERATOR, bench.now_s)
    bench.order, bench.beat = (order, bench.beat) if order_first else (bench.order, Heartbeat(bench.now_s, Source.OPERATOR))
    bench.beating = False
    bench.cycle(0.0)


def test_the_cycle_between_order_and_permission_goes_on_with_the_order_before(bench: Bench) -> None:
    _hand_over(bench, order_first=True)
    assert bench.guard.rejection is None
    assert bench.guard.followed.source is Source.PROGRAM
    bench.beat = Heartbeat(bench.now_s, Source.OPERATOR)
    bench.cycle()
    assert bench.guard.rejection is None
    assert bench.guard.followed.source is Source.OPERATOR


def test_a_permission_without_an_order_of_its_own_holds(bench: Bench) -> None:
    _hand_over(bench, order_first=False)
    assert bench.reason is RejectReason.WRONG_SOURCE


def test_the_order_before_is_good_for_no_longer_than_an_order_is(bench: Bench) -> None:
    _hand_over(bench, order_first=True)
    reasons = []
    for _ in range(6):  # the program is still permitted, and says nothing any more
        bench.now_s += CYCLE_S
        bench.beat = Heartbeat(bench.now_s, Source.PROGRAM)
        bench.order = BusOrder(Command(advance_mm_s=5.0), Source.OPERATOR, bench.now_s)
        bench.cycle(0.0)
        reasons.append(bench.guard.rejection.reason if bench.guard.rejection is not None else None)
    # at 100 ms sharp either may be
    assert reasons[:3] == [None] * 3
    assert reasons[4:] == [RejectReason.WRONG_SOURCE] * 2


def test_a_hold_is_everybodys(bench: Bench) -> None:
    bench.cycle()
    bench.beating = False
    bench.order = BusOrder(None, Source.OPERATOR, bench.now_s)
    bench.beat = Heartbeat(bench.now_s, Source.PROGRAM)
    bench.cycle()
    assert bench.reason is RejectReason.NO_COMMAND
    assert bench.guard.followed is bench.order
    bench.order = BusOrder(Command(advance_mm_s=5.0), Source.OPERATOR, bench.now_s)
    bench.cycle()
    assert bench.reason is RejectReason.WRONG_SOURCE


# --- servos that hold without an application -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("silent_s", "looked_ago_s", "problem", "attention"),
    [
        (0.1, 99.0, "", Attention.REST),
        (1.39, 99.0, "hot", Attention.REST),  # 0.5 s heartbeat, 0.2 s polled, 0.2 s watchdog, 0.5 s more: they must trip first
        (1.41, 99.0, "", Attention.LOOK),
        (1.41, 0.9, "", Attention.REST),
        (1.41, 1.0, "", Attention.LOOK),
        (1.41, 0.1, "right 71 °C", Attention.RELAX),
        (299.9, 0.5, "", Attention.REST),
        (300.0, 0.5, "", Attention.RELAX),
    ],
)
def test_servos_without_an_application_rest_until_their_watchdogs_have_tripped_then_are_looked_at_and_then_relaxed(
    silent_s: float, looked_ago_s: float, problem: str, attention: Attention
) -> None:
    assert UnattendedWatch(100.0 - looked_ago_s, (), problem).next(silent_s, 100.0, SERVOS) is attention


def test_before_the_first_look_there_is_none_to_wait_for() -> None:
    assert UnattendedWatch().next(1.5, 100.0, SERVOS) is Attention.LOOK


def _held(**changes: object) -> ServoState:
    joint = SERVOS.joints[0]
    state = ServoState(joint.name, joint.id, 100.0, 0, 0, 0.3, 0.3, 0.0, 8.0, 12.0, 30.0, HardwareError(0), True, True)
    return replace(state, **changes)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({}, ""),
        ({"temperature_c": 69.0}, ""),
        ({"temperature_c": 70.0}, "right 70 °C"),
        ({"temperature_c": math.nan}, "right nan °C"),
        ({"temperature_c": 90.0, "torque": False}, ""),
        ({"voltage_v": 10.4}, "right 10.4 V"),
        ({"voltage_v": SERVOS.lowest_v(SERVOS.joints[0])}, "right 10.5 V"),
        ({"error": HardwareError(4)}, "right reports an error (0x04)"),
        ({"current_ma": -900.0}, ""),
        ({"current_ma": None}, ""),
    ],
)
def test_what_a_look_finds(changes: dict[str, object], problem: str) -> None:
    others = [MissingServo(joint.name, joint.id, 100.0, 1, "no answer") for joint in SERVOS.joints[1:]]
    assert UnattendedWatch().update([_held(**changes), *others], 100.0, SERVOS) == UnattendedWatch(
        100.0, (int("current_ma" in changes and changes["current_ma"] is not None),) + (0,) * 6, problem
    )


def test_the_first_joint_that_must_not_hold_on_is_told() -> None:
    states = [replace(_held(temperature_c=90.0), name=joint.name, id=joint.id) for joint in SERVOS.joints]
    assert UnattendedWatch().update(states, 100.0, SERVOS).problem == "right 90 °C"


def test_a_current_that_is_too_high_at_three_looks_in_a_row_is_no_peak() -> None:
    others = [MissingServo(joint.name, joint.id, 100.0, 1, "no answer") for joint in SERVOS.joints[1:]]
    watch = UnattendedWatch()
    for ma, problem in ((700, ""), (700, ""), (20, ""), (700, ""), (700, ""), (700, "right draws too much current")):
        watch = watch.update([_held(current_ma=float(ma)), *others], 100.0, SERVOS)
        assert watch.problem == problem
