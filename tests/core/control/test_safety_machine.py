"""Gate and supervisor together, driven at random: nothing unsafe ever leaves, and the operator always wins.

The rules are told again here in other words than in the code, so that both would have to be wrong in the same way.
"""

import math
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from core.control.bus_monitor import BusReport
from core.control.camera_monitor import FrameReport, RouteState
from core.control.faults import Cause, Fault
from core.control.gate import GateState, GateStep, GoalRequest, JointMeasurement, Source, gate_step
from core.control.health import Beat, DeadmanReport, GateReport, ServoCheckReport
from core.control.joints import Retracted, by_hand, by_program, joint_goals
from core.control.modes import Act, Decision, Event, Mode
from core.types import Command, Reason
from tests.core.healthy import GOOD_BUS, SAFETY, SERVOS, Bench

SEEN: Counter[str] = Counter()
READY: dict[Mode, Bench] = {}
START_MM = (0.3, 0.3, 0.3, 0.3, 100.0, 50.0, 50.0)

numbers = st.one_of(st.floats(-3.0, 3.0), st.sampled_from([math.nan, math.inf, -math.inf, 1e9, -400.0, 1.5, -1.5, 2.5, -2.5]))
seconds = st.sampled_from([0.0, 0.01, 0.02, 0.02, 0.02, 0.03, 0.05, 0.09, 0.12, 0.2])
jumps = st.sampled_from([-50.0, -0.01, 0.6, 1.01, 5.0, 1e6, math.nan, math.inf])
commands = st.builds(
    Command,
    bend=st.floats(-1.0, 1.0),
    pitch=st.floats(-1.0, 1.0),
    advance_mm_s=st.floats(-25, 25),
    delivery_mm_s=st.floats(-25, 25),
)
frames = st.sampled_from(
    [
        {},
        {},
        {"confidence": 0.2},
        {"confidence": math.nan},
        {"finite": False},
        {"same_picture": True},
        {"format_ok": False},
        {"route": RouteState.NONE},
        {"drift_px": math.nan},
        {"captured_s": math.inf},
        {"captured_s": 1.0},
        {"index": 3},
        {"lost": 9},
        *({"refusal": reason} for reason in Reason),
    ]
)
buses = st.sampled_from(
    [
        {},
        {},
        {"port_open": False},
        {"errors": 3},
        {"misses": (0, 3, 0, 0, 0, 0, 0)},
        {"hardware_errors": (0, 0, 0, 0, 0, 0, 1)},
        {"temperatures_c": (math.nan,) * 7},
        {"voltages_v": (9.0,) * 7},
        {"tracking_mm": (2.0,) * 7},
        {"currents_ma": (2000.0,) * 7},
        {"rebooted": True},
        {"watchdog_tripped": True},
    ]
)


class Drive(RuleBasedStateMachine):
    """A bench with servos that follow late, jam or are pushed, an engine that asks for sense or nonsense, and an operator."""

    @initialize(mode=st.sampled_from([Mode.ARMED, Mode.AUTONOMOUS, Mode.AUTONOMOUS, *Mode]))
    def start(self, mode: Mode) -> None:
        if mode not in READY:
            READY[mode] = Bench().in_mode(mode)
        self.bench = READY[mode].copy()
        self.gate = GateState()
        self.at_mm = list(START_MM)
        self.sent_mm: tuple[float, ...] | None = None
        self.moving = False
        self.speeds = (0.0,) * 7
        self.last_s = self.bench.now_s
        self.impostor = False
        self.retracts = Retracted.NONE
        self.command = Command()
        self.wild: tuple[float, ...] | None = None
        self.command_age_s = self.frame_age_s = self.measured_age_s = 0.0
        self.follow = 0.7

    # --- what happens ------------------------------------------------------------------------------

    @rule(after_s=seconds, ticks=st.integers(1, 12))
    def time_passes(self, after_s: float, ticks: int) -> None:
        for _ in range(ticks):
            self._tick([], after_s)

    @rule(after_s=jumps)
    def the_clock_jumps(self, after_s: float) -> None:
        before_s = self.bench.now_s
        self._tick([], after_s)
        if not math.isfinite(self.bench.now_s):
            self.bench.now_s = before_s

    @rule(acts=st.lists(st.sampled_from(Act), min_size=1, max_size=3), after_s=seconds)
    def the_operator_acts(self, acts: list[Act], after_s: float) -> None:
        self._tick(acts, after_s)

    @rule(by_hand=st.sampled_from([False, False, False, True]), command=commands, ticks=st.integers(1, 10))
    def somebody_drives(self, by_hand: bool, command: Command, ticks: int) -> None:
        self.command, self.wild = command, None
        for _ in range(ticks):
            self._tick([Act.INPUT] if by_hand else [], 0.02)

    @rule(ticks=st.integers(1, 3))
    def somebody_else_interferes(self, ticks: int) -> None:
        self.impostor = True
        for _ in range(ticks):
            self._tick([], 0.02)
        self.impostor = False

    @rule(place=st.integers(0, 6), offset=numbers, count=st.sampled_from([6, 7, 7, 7, 7, 8]))
    def somebody_asks_for_nonsense(self, place: int, offset: float, count: int) -> None:
        goals = [*self.at_mm, 0.0]
        goals[place] += offset
        self._tick([], 0.02)
        self.wild = tuple(goals[:count])
        self._tick([], 0.02)
        self.wild = None

    @rule(bad=st.sampled_from([math.nan, math.inf]), field=st.sampled_from(["bend", "pitch", "advance_mm_s", "delivery_mm_s"]))
    def the_policy_breaks(self, bad: float, field: str) -> None:
        self.command, self.wild = replace(self.command, **{field: bad}), None
        self._tick([], 0.02)

    @rule(kind=st.integers(0, 2), age_s=st.sampled_from([0.06, 0.12, 0.12, 0.2, 0.2, -1.0, math.nan, math.inf]))
    def things_come_late(self, kind: int, age_s: float) -> None:
        self._tick([], 0.02)
        self.command_age_s, self.frame_age_s, self.measured_age_s = (age_s if n == kind else 0.0 for n in range(3))
        self._tick([], 0.02)
        self.command_age_s = self.frame_age_s = self.measured_age_s = 0.0

    @rule(held=st.booleans(), again=st.booleans())
    def the_deadman_changes(self, held: bool, again: bool) -> None:
        self.bench.held = held
        self._tick([DeadmanReport(not held), DeadmanReport(held)] if again else [], 0.02)

    @rule(frame=frames, bus=buses, ticks=st.integers(1, 4))
    def reports_are_bad_for_a_while(self, frame: dict[str, object], bus: dict[str, object], ticks: int) -> None:
        self.bench.bad_frame(**frame)
        self.bench.bus = replace(GOOD_BUS, **bus)
        for _ in range(ticks):
            self._tick([], 0.02)
        self.bench.bad_frame()
        self.bench.bus = GOOD_BUS

    @rule(kind=st.sampled_from([FrameReport, BusReport, Beat, DeadmanReport]), ticks=st.integers(1, 8))
    def somebody_falls_silent(self, kind: type, ticks: int) -> None:
        self.bench.mute = {kind}
        for _ in range(ticks):
            self._tick([], 0.07)
        self.bench.mute = set()

    @rule(cause=st.sampled_from(Cause))
    def a_fault_is_reported(self, cause: Cause) -> None:
        self._tick([Fault(cause)], 0.02)

    @rule(place=st.integers(0, 6), push_mm=st.one_of(st.floats(-1.0, 1.0), st.sampled_from([-200.0, 300.0, math.nan, 0.95, -0.95])))
    def a_joint_is_pushed(self, place: int, push_mm: float) -> None:
        kept = self.at_mm[place]
        self.at_mm[place] += push_mm
        self._tick([], 0.02)
        if not math.isfinite(self.at_mm[place]) or abs(push_mm) > 1.0:
            self.at_mm[place] = kept

    @rule(
        retracts=st.sampled_from([~Retracted.NONE, Retracted.ROBOT, Retracted.CATHETER, Retracted.NONE]), ticks=st.integers(4, 12)
    )
    def the_operator_pulls_the_feeds_back_at_their_end(self, retracts: Retracted, ticks: int) -> None:
        """Whoever drives says so; only the operator may."""
        self.at_mm[4], self.at_mm[5], self.at_mm[6] = -4.9, -4.95, -4.95
        self.command, self.wild, self.retracts = Command(advance_mm_s=-20.0, delivery_mm_s=-20.0), None, retracts
        for _ in range(ticks):
            self._tick([], 0.02)
        self.retracts = Retracted.NONE
        self._tick([], 0.02)

    @rule(follow=st.sampled_from([0.0, 0.3, 0.7, 1.0]))
    def the_servos_follow(self, follow: float) -> None:
        self.follow = follow

    @rule(hand_over=st.booleans())
    def the_operator_begins_again(self, hand_over: bool) -> None:
        """By the book, as far as the mode allows."""
        self.command, self.wild = Command(advance_mm_s=5.0), None
        self.bench.held = False
        self._tick([Act.ACKNOWLEDGE, ServoCheckReport()], 0.02)
        self._tick([ServoCheckReport()], 0.02)
        for _ in range(22):
            self._tick([], 0.05)
        self._tick([Act.ARM], 0.02)
        self.bench.held = True
        self._tick([], 0.02)
        self._tick([Act.HAND_OVER] if hand_over else [], 0.02)
        for _ in range(20):
            self._tick([], 0.02)

    # --- one tick ----------------------------------------------------------------------------------

    def _tick(self, events: list[Event], after_s: float) -> None:
        before = self.bench.state
        decision = self.bench.tick(*events, after_s=after_s)
        now_s = self.bench.now_s
        measured = JointMeasurement(tuple(self.at_mm), now_s - self.measured_age_s)
        request = self._request(decision.permitted or Source.PROGRAM, now_s)
        step = gate_step(self.gate, request, measured, decision.permitted, now_s, SERVOS, SAFETY)
        self._check_modes(before.mode, before.latched, events, decision, now_s)
        self._check_goals(step, request, measured, decision, now_s)
        self.gate = step.state
        if request.source is Source.PROGRAM:
            self.bench.raw([GateReport(step.rejection.reason if step.rejection is not None else None)], now_s)
        if step.goals_mm is not None:
            self.sent_mm = step.goals_mm
        if self.sent_mm is not None:
            self.at_mm = [at + self.follow * (goal - at) for at, goal in zip(self.at_mm, self.sent_mm, strict=True)]
        SEEN["ticks"] += 1
        SEEN[f"mode {decision.mode}"] += 1
        SEEN["rejected" if step.rejection is not None else f"moved by {request.source}"] += 1
        if step.rejection is not None:
            SEEN[f"because {step.rejection.reason}"] += 1

    def _request(self, source: Source, now_s: float) -> GoalRequest:
        if self.impostor:
            source = Source.OPERATOR if source is Source.PROGRAM else Source.PROGRAM
        goals = self.wild
        if goals is None:
            if source is Source.OPERATOR:
                servos = by_hand(SERVOS, self.at_mm, self.gate.sent, retracts=self.retracts)
            else:
                servos = by_program(SERVOS, self.at_mm, self.gate.sent)
            goals = joint_goals(self.command, self.gate.sent, self.at_mm, now_s, servos, SAFETY).goals_mm
        return GoalRequest(goals, source, now_s - self.command_age_s, now_s - self.frame_age_s, self.retracts)

    def _check_modes(self, before: Mode, latched: object, events: list[Event], decision: Decision, now_s: float) -> None:
        after = decision.mode
        if Act.INPUT in events:
            assert decision.permitted is not Source.PROGRAM
            assert after not in {Mode.AUTONOMOUS, Mode.HOLD}
        if Act.STOP in events:
            assert after is Mode.STOPPED
        if before is Mode.STOPPED and after is not Mode.STOPPED:
            assert Act.ACKNOWLEDGE in events
        if before in {Mode.ADVISORY, Mode.STOPPED} and after in {Mode.ARMED, Mode.AUTONOMOUS, Mode.HOLD}:
            assert Act.ARM in events
            assert decision.active == () or all(fault.cause.name in HARMLESS for fault in decision.active)
        if before is Mode.ARMED and after in {Mode.AUTONOMOUS, Mode.HOLD}:
            assert Act.HAND_OVER in events
        if latched is not None and Act.ACKNOWLEDGE not in events:
            assert self.bench.state.latched == latched
        if self.bench.state.latched is not None:
            assert after in {Mode.ADVISORY, Mode.STOPPED}
        if decision.permitted is Source.PROGRAM:
            deadmen = self.bench.state.health.deadmen.values()
            assert after is Mode.AUTONOMOUS
            assert self.bench.held
            assert all(now_s - deadman.reported_s <= 0.1 for deadman in deadmen)
            frame_s = self.bench.state.health.frames.pose_captured_s
            assert now_s - frame_s <= 0.15

    def _check_goals(
        self, step: GateStep, request: GoalRequest, measured: JointMeasurement, decision: Decision, now_s: float
    ) -> None:
        goals = step.goals_mm
        if goals is None:
            assert step.rejection is not None
            self.moving = False
            return
        assert len(goals) == 7
        assert 0.0 <= now_s - measured.measured_s <= 0.1
        for place, (goal, at, joint) in enumerate(zip(goals, measured.positions_mm, SERVOS.joints, strict=True)):
            assert math.isfinite(goal)
            assert goal <= joint.high_mm
            assert abs(goal - at) <= joint.max_step_mm + 1e-9
            if goal < joint.low_mm:
                self._check_beyond(place, goal, at, request, decision, now_s)
        if step.rejection is not None:
            if self.moving:  # a hold begins where the joints are
                for goal, at, joint in zip(goals, measured.positions_mm, SERVOS.joints, strict=True):
                    assert goal == at or at < joint.low_mm == goal or at > joint.high_mm == goal
            self.moving = False
            return
        assert request.source is decision.permitted
        assert decision.mode is not Mode.STOPPED
        assert 0.0 <= now_s - request.issued_s <= 0.1
        if request.source is Source.PROGRAM:
            assert 0.0 <= now_s - request.captured_s <= 0.15
        self._check_motion(goals, measured, now_s)

    def _check_beyond(self, place: int, goal: float, at: float, request: GoalRequest, decision: Decision, now_s: float) -> None:
        """Below its envelope a feed goes only while it is retracted; else it stays where it stands, or comes back."""
        assert place >= 4
        SEEN["below the envelope"] += 1
        last = self.sent_mm[place] if self.sent_mm is not None else at
        if goal < min(at, last) - 1e-9:
            assert request.retracts & (Retracted.ROBOT if place == 4 else Retracted.CATHETER)
            assert request.source is Source.OPERATOR is decision.permitted
            assert last - goal <= 2.0 * (now_s - self.last_s) + 1e-6
            SEEN["pulled out"] += 1

    def _check_motion(self, goals: tuple[float, ...], measured: JointMeasurement, now_s: float) -> None:
        passed_s = now_s - self.last_s
        speeds = [0.0] * 7
        for place, joint in enumerate(SERVOS.joints):
            goal, at = goals[place], measured.positions_mm[place]
            if not self.moving:  # bumpless
                assert goal == at or at < joint.low_mm == goal or at > joint.high_mm == goal
                continue
            last = self.sent_mm[place]
            step_mm = goal - last
            assert abs(step_mm) <= joint.max_speed_mm_s * passed_s + 1e-6
            if passed_s > 0.0:
                speeds[place] = step_mm / min(passed_s, 0.1)
            faster = abs(speeds[place]) - (abs(self.speeds[place]) if speeds[place] * self.speeds[place] > 0 else 0.0)
            back_to_the_joint = abs(last - at) > joint.max_step_mm - 1e-9
            assert back_to_the_joint or faster <= joint.max_acceleration_mm_s2 * passed_s + 1e-6
            if min(last - joint.low_mm, joint.high_mm - last) < joint.warn_margin_mm and not back_to_the_joint:
                outwards = goal < last if last - joint.low_mm < joint.warn_margin_mm else goal > last
                assert not outwards or abs(step_mm) <= 0.25 * joint.max_speed_mm_s * passed_s + 1e-6
        if not self.moving or passed_s > 0.0:
            self.speeds = tuple(speeds)
        self.moving, self.last_s = True, now_s


HARMLESS = {
    "FRAMES_DROPPED",
    "OUT_OF_ORDER",
    "WARM",
    "VOLTAGE_SAGS",
    "DISK_LOW",
    "DISK_FULL",
    "RECORDING_STOPPED",
    "RECORDER_BEHIND",
    "DEADMAN",
    "NO_TARGET",
}


def test_nothing_unsafe_ever_leaves_whatever_happens() -> None:
    SEEN.clear()
    run_state_machine_as_test(
        Drive, settings=settings(max_examples=100, stateful_step_count=50, suppress_health_check=list(HealthCheck))
    )
    assert SEEN["ticks"] >= 10_000
    # the machine went everywhere; how often depends on what else is imported, because Hypothesis takes constants from there
    for visited in (*(f"mode {mode}" for mode in Mode), "moved by program", "moved by operator", "pulled out"):
        assert SEEN[visited] >= 5, SEEN
    assert len([reason for reason in SEEN if reason.startswith("because")]) >= 10, SEEN


@pytest.mark.parametrize("command", [Command(1.0, 1.0, 20.0, 10.0), Command(-1.0, 0.3, -20.0, -10.0)])
def test_an_honest_source_is_never_rejected_however_long_it_drives(command: Command) -> None:
    """From the middle of the envelope to its ends, at 50 Hz, with servos that lag."""
    gate, at, sent = GateState(), [0.3, 0.3, 0.3, 0.3, 390.0, 10.0, 10.0], None
    now_s = 10.0
    for _ in range(2000):
        now_s += 0.02
        goals = joint_goals(command, gate.sent, at, now_s, SERVOS, SAFETY).goals_mm
        step = gate_step(
            gate, GoalRequest(goals, Source.OPERATOR, now_s), JointMeasurement(at, now_s), Source.OPERATOR, now_s, SERVOS, SAFETY
        )
        assert step.rejection is None
        sent, gate = step.goals_mm, step.state
        at = [here + 0.4 * (goal - here) for here, goal in zip(at, sent, strict=True)]
    assert at[4] == pytest.approx(400.0 if command.advance_mm_s > 0 else -5.0, abs=0.01)
