"""The mode machine: every mode x every event, every fault x every mode, and each rule of the safety facts by itself."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import pytest

from core.control.bus_monitor import BusReport
from core.control.camera_monitor import FrameArrived, FrameLate, FrameReport, RouteState
from core.control.direction_monitor import HeadSeen, MotionSent
from core.control.faults import AFTER_SOME, AT_ONCE, CAUSES, Area, Cause, Fault, Reaction
from core.control.gate import RejectReason, Source
from core.control.health import (
    Beat,
    DeadmanReport,
    EstopReport,
    GateReport,
    ModelReport,
    Part,
    ServoCheckReport,
    ServoRequestBegun,
    ServosBusy,
)
from core.control.modes import ARMED_MODES, Act, AgainstProgram, Decision, Event, Hindrance, Mode, RequestRefused, SupervisorState
from core.control.supervisor import hindrances, supervise
from core.types import Reason
from tests.core.healthy import GOOD_BUS, SAFETY, SERVOS, TICK_S, Bench

V, R, U, H, S = Mode.ADVISORY, Mode.ARMED, Mode.AUTONOMOUS, Mode.HOLD, Mode.STOPPED
MODES = (V, R, U, H, S)

# --- every mode x every event ----------------------------------------------------------------------

SINGLE_EVENTS: dict[str, Event] = {
    "nothing": FrameArrived(0.0),
    "stop": Act.STOP,
    "acknowledge": Act.ACKNOWLEDGE,
    "arm": Act.ARM,
    "hand over": Act.HAND_OVER,
    "take back": Act.TAKE_BACK,
    "disarm": Act.DISARM,
    "input": Act.INPUT,
    "deadman down": DeadmanReport(True),
    "deadman up": DeadmanReport(False),
    "warning": Fault(Cause.DISK_LOW),
    "fault that holds": Fault(Cause.HEAD_JUMP),
    "servo fault that holds": Fault(Cause.BUS_SILENT),
    "fault that disarms": Fault(Cause.SEVERAL_ROBOTS),
    "servo fault that disarms": Fault(Cause.HOT),
    "fault that stops": Fault(Cause.PORT_LOST),
    "gate rejects": GateReport(RejectReason.OVER_RATE),
    "gate accepts": GateReport(None),
    "model unfit": ModelReport(False),
    "model fit": ModelReport(True),
    "servos checked": ServoCheckReport(),
    "servos wrong": ServoCheckReport(("id 3 missing",)),
    "window lives": Beat(Part.WINDOW),
    "worker lives": Beat(Part.PERCEPTION),
    "frame": FrameReport(9999, 0.0),
    "bus": GOOD_BUS,
    "late frame": FrameLate(),
    "e-stop pressed": EstopReport(True),
    "e-stop released": EstopReport(False),
    "servos are asked": ServoRequestBegun(),
    "servos are busy": ServosBusy(),
    "motion sent": MotionSent(9999.0, 1.0, 1.0),
    "program may not drive": AgainstProgram((Hindrance.MODEL_UNTAUGHT,)),
    "program may drive": AgainstProgram(),
}
#                            ADVISORY ARMED AUTONOMOUS HOLD STOPPED
TABLE: dict[str, tuple[Mode, Mode, Mode, Mode, Mode]] = {
    "nothing":                  (V, R, U, H, S),
    "stop":                     (S, S, S, S, S),
    "acknowledge":              (V, R, U, H, V),
    "arm":                      (R, R, U, H, S),
    "hand over":                (V, R, U, H, S),
    "take back":                (V, R, R, R, S),
    "disarm":                   (V, V, V, V, S),
    "input":                    (V, R, R, R, S),
    "deadman down":             (V, R, U, H, S),
    "deadman up":               (V, R, H, H, S),
    "warning":                  (V, R, U, H, S),
    "fault that holds":         (V, R, H, H, S),
    "servo fault that holds":   (V, R, H, H, S),
    "fault that disarms":       (V, V, V, V, S),
    "servo fault that disarms": (V, V, V, V, S),
    "fault that stops":         (S, S, S, S, S),
    "gate rejects":             (V, R, H, H, S),
    "gate accepts":             (V, R, U, H, S),
    "model unfit":              (V, V, V, V, S),
    "model fit":                (V, R, U, H, S),
    "servos checked":           (V, R, U, H, S),
    "servos wrong":             (V, V, V, V, S),
    "window lives":             (V, R, U, H, S),
    "worker lives":             (V, R, U, H, S),
    "frame":                    (V, R, U, H, S),
    "bus":                      (V, R, U, H, S),
    "late frame":               (V, R, U, H, S),
    "e-stop pressed":           (V, V, V, V, S),
    "e-stop released":          (V, R, U, H, S),
    "servos are asked":         (V, V, V, V, S),
    "servos are busy":          (V, R, U, H, S),
    "motion sent":              (V, R, U, H, S),
    "program may not drive":    (V, V, V, V, S),
    "program may drive":        (V, R, U, H, S),
}  # fmt: skip


def test_the_table_is_complete() -> None:
    assert set(TABLE) == set(SINGLE_EVENTS)
    assert {event for event in SINGLE_EVENTS.values() if isinstance(event, Act)} == set(Act)
    assert {type(event) for event in SINGLE_EVENTS.values()} == set(get_args(Event))
    assert set(MODES) == set(Mode)


@pytest.fixture(scope="module")
def benches() -> dict[Mode, Bench]:
    return {mode: Bench().in_mode(mode) for mode in MODES}


@pytest.mark.parametrize(("name", "before"), list(itertools.product(TABLE, MODES)))
def test_every_event_in_every_mode(name: str, before: Mode, benches: dict[Mode, Bench]) -> None:
    bench = benches[before].copy()
    decision = bench.tick(SINGLE_EVENTS[name])
    after = TABLE[name][MODES.index(before)]
    assert decision.mode is after
    assert bench.state.mode is after
    assert (decision.latched is not None) == (bench.state.latched is not None)
    if after in {S, H}:
        assert decision.permitted is None
    if after is U:
        assert decision.permitted is Source.PROGRAM
    if after in {V, R}:
        assert decision.permitted is not Source.PROGRAM


# --- every fault x every mode ----------------------------------------------------------------------

Inject = Callable[[Bench], object]


def _frames(count: int, **changes: object) -> Inject:
    def inject(bench: Bench) -> None:
        bench.bad_frame(**changes)
        bench.run(count * TICK_S)

    return inject


def _bus(ticks: int = 1, **changes: object) -> Inject:
    def inject(bench: Bench) -> None:
        bench.bus = replace(GOOD_BUS, **changes)
        bench.run(ticks * TICK_S)

    return inject


def _events(*events: Event, ticks: int = 1) -> Inject:
    return lambda bench: bench.run(ticks * TICK_S, *events)


def _mute(kind: type, seconds: float, *, frames_arrive: bool = False) -> Inject:
    def inject(bench: Bench) -> None:
        bench.mute.add(kind)
        for _ in range(round(seconds / TICK_S)):
            bench.tick(*([FrameArrived(bench.now_s)] if frames_arrive else []))

    return inject


def _silent(part: Part) -> Inject:
    def inject(bench: Bench) -> None:
        other = Part.PERCEPTION if part is Part.WINDOW else Part.WINDOW
        bench.mute.add(Beat)
        bench.run(0.53125, Beat(other))

    return inject


def _wrong_way(turn_deg: float, feed_mm_s: float) -> Inject:
    """The head turns, or goes, as far the other way as it is commanded, until autonomy ends."""

    def inject(bench: Bench) -> None:
        for k in range(60):
            head = HeadSeen(0.0, -turn_deg * k, -turn_deg * k, 80.0 - feed_mm_s * k * TICK_S, (0.0, 0.0), (1.0, 0.0))
            bench.frame = lambda report, head=head: replace(report, head=replace(head, captured_s=report.captured_s))
            decision = bench.tick(MotionSent(bench.now_s, turn_deg * k, feed_mm_s))
            if decision.latched is not None and bench.state.mode is not S:
                return

    return inject


def _joint(value: object, place: int, rest: object) -> tuple[object, ...]:
    return tuple(value if n == place else rest for n in range(7))


INJECTIONS: dict[Cause, Inject] = {
    Cause.STOP_PRESSED: _events(Act.STOP),
    Cause.ESTOP_PRESSED: _events(EstopReport(True)),
    Cause.PORT_LOST: _bus(port_open=False),
    Cause.SERVO_ALERT: _bus(hardware_errors=_joint(0x20, 3, 0)),
    Cause.TRACKING: _bus(ticks=8, tracking_mm=_joint(-1.6, 4, 0.0)),
    Cause.STRAINED: _bus(ticks=18, currents_ma=_joint(-601.0, 4, 40.0)),
    Cause.TORQUE_ON: _bus(torque_problem="torque of up is not proven to be off: cut the servos' power"),
    Cause.SERVOS_WRONG: _events(ServoCheckReport(("id 4: model 1060 instead of 1020",))),
    Cause.CLOCK: lambda bench: bench.tick(after_s=1.03125),
    Cause.SUPPLY_LOST: _bus(misses=(3,) * 7),
    Cause.SERVO_SILENT: _bus(misses=_joint(3, 2, 0)),
    Cause.BUS_NOISE: _bus(ticks=6, errors=1),
    Cause.BUS_DEAD: _mute(BusReport, 0.53125),
    Cause.REBOOTED: _bus(rebooted=True),
    Cause.TORQUE_TAKEN: _bus(torque_taken=_joint(True, 3, False)),
    Cause.WATCHDOG: _bus(watchdog_tripped=True),
    Cause.HOT: _bus(temperatures_c=_joint(70.0, 6, 40.0)),
    Cause.VOLTAGE_LOW: _bus(voltages_v=_joint(10.5, 0, 12.0)),
    Cause.WINDOW_HUNG: _silent(Part.WINDOW),
    Cause.HEARTBEAT_LOST: _silent(Part.PERCEPTION),
    Cause.CAMERA_LOST: _mute(FrameReport, 0.53125),
    Cause.CAMERA_FROZEN: _frames(4, same_picture=True),  # with the one that they repeat: five
    Cause.WRONG_FORMAT: _frames(1, format_ok=False),
    Cause.CAMERA_MOVED: _frames(1, drift_px=-6.1),
    Cause.FRAMES_LOST_LONG: _frames(18, delivered=5, lost=15),
    Cause.MODEL_UNFIT: _events(ModelReport(False, "hash differs")),
    Cause.SEVERAL_ROBOTS: _frames(1, refusal=Reason.SEVERAL_ROBOTS),
    Cause.OUTSIDE_VESSEL: _frames(1, refusal=Reason.OUTSIDE_VESSEL),
    Cause.NOT_FINITE_REPEATED: _frames(3, finite=False),
    Cause.COMMANDS_REJECTED: _events(GateReport(RejectReason.NON_FINITE), ticks=3),
    Cause.WRONG_TURN: _wrong_way(1.0, 0.0),
    Cause.WRONG_FEED: _wrong_way(0.0, 5.0),
    Cause.HEAD_LOST_LONG: _frames(16, refusal=Reason.NO_ROBOT),
    Cause.POSE_LOST: _mute(FrameReport, 0.53125, frames_arrive=True),
    Cause.BUS_SILENT: _mute(BusReport, 0.1875),
    Cause.CAMERA_SILENT: _mute(FrameReport, 0.15625),
    Cause.IMAGE_BLACK: _frames(3, refusal=Reason.BLACK),
    Cause.IMAGE_WHITE: _frames(3, refusal=Reason.WHITE),
    Cause.FRAMES_LOST: _frames(1, delivered=5, lost=15),
    Cause.NOT_FINITE: _frames(1, finite=False),
    Cause.COMMAND_REJECTED: _events(GateReport(RejectReason.STALE_POSE)),
    Cause.HEAD_LOST: _frames(3, refusal=Reason.NO_ROBOT),
    Cause.HEAD_JUMP: _frames(1, refusal=Reason.HEAD_JUMP),
    Cause.BRANCH_UNCLEAR: _frames(1, refusal=Reason.AMBIGUOUS_BRANCH),
    Cause.POOR_VIEW: _frames(1, refusal=Reason.BLURRED),
    Cause.CONFIDENCE_LOW: _frames(5, confidence=0.49),
    Cause.UNKNOWN_KIND: _frames(1, refusal=Reason.UNLIKE_TRAINING),
    Cause.POSE_STALE: _mute(FrameReport, 0.15625, frames_arrive=True),
    Cause.NO_TARGET: _frames(1, route=RouteState.NONE),
    Cause.DEADMAN: _mute(DeadmanReport, 0.09375),
    Cause.FRAMES_DROPPED: _frames(1, delivered=10, lost=7),
    Cause.OUT_OF_ORDER: _events(FrameLate()),
    Cause.WARM: _bus(temperatures_c=_joint(65.0, 6, 40.0)),
    Cause.VOLTAGE_SAGS: _bus(voltages_v=_joint(11.0, 0, 12.0)),
    Cause.DISK_LOW: _events(Fault(Cause.DISK_LOW)),
    Cause.DISK_FULL: _events(Fault(Cause.DISK_FULL)),
    Cause.RECORDING_STOPPED: _events(Fault(Cause.RECORDING_STOPPED)),
    Cause.RECORDER_BEHIND: _events(Fault(Cause.RECORDER_BEHIND)),
}


def test_there_is_a_reaction_and_an_injection_for_every_cause() -> None:
    assert set(INJECTIONS) == set(Cause)


@pytest.mark.parametrize("reason", [Reason.BENCH_MOVED, Reason.OTHER_BENCH])
def test_a_bench_that_was_moved_ends_autonomy(reason: Reason) -> None:
    assert AT_ONCE[reason].reaction is Reaction.DISARM


def test_every_refusal_of_perception_means_something() -> None:
    assert set(AT_ONCE) | set(AFTER_SOME) == set(Reason)
    assert not set(AT_ONCE) & set(AFTER_SOME)


REACTIONS = {
    Reaction.WARN: {
        Cause.FRAMES_DROPPED, Cause.OUT_OF_ORDER, Cause.WARM, Cause.VOLTAGE_SAGS, Cause.DISK_LOW, Cause.DISK_FULL,
        Cause.RECORDING_STOPPED, Cause.RECORDER_BEHIND,
    },
    Reaction.STOP: {Cause.STOP_PRESSED, Cause.PORT_LOST, Cause.SERVO_ALERT, Cause.TRACKING, Cause.STRAINED},
    Reaction.HOLD: {
        Cause.BUS_SILENT, Cause.CAMERA_SILENT, Cause.IMAGE_BLACK, Cause.IMAGE_WHITE, Cause.FRAMES_LOST, Cause.NOT_FINITE,
        Cause.COMMAND_REJECTED, Cause.HEAD_LOST, Cause.HEAD_JUMP, Cause.BRANCH_UNCLEAR, Cause.POOR_VIEW, Cause.CONFIDENCE_LOW,
        Cause.UNKNOWN_KIND, Cause.POSE_STALE, Cause.NO_TARGET, Cause.DEADMAN,
    },
}  # fmt: skip


WRONG_WAYS = {Cause.WRONG_TURN, Cause.WRONG_FEED}  # of the program alone


@pytest.mark.parametrize("cause", Cause)
def test_the_reactions_are_those_of_the_fault_table(cause: Cause) -> None:
    assert cause.reaction is next((r for r, causes in REACTIONS.items() if cause in causes), Reaction.DISARM)


def _after(before: Mode, cause: Cause) -> Mode:
    if cause in WRONG_WAYS and before is not U:
        return before
    match cause.reaction:
        case Reaction.HOLD:
            return H if before is U else before
        case Reaction.DISARM:
            return before if before is S else V
        case Reaction.STOP:
            return S
    return before


@pytest.mark.parametrize(("cause", "before"), list(itertools.product(Cause, MODES)))
def test_every_fault_in_every_mode(cause: Cause, before: Mode, benches: dict[Mode, Bench]) -> None:
    bench = benches[before].copy()
    INJECTIONS[cause](bench)
    decision = bench.decision
    assert decision.mode is _after(before, cause)
    driving_only = cause in {Cause.DEADMAN, Cause.NO_TARGET}
    kept = cause.reaction is not Reaction.DISARM or before not in {R, U, H}
    if cause in {Cause.COMMAND_REJECTED, Cause.COMMANDS_REJECTED, *WRONG_WAYS}:
        judged = {U} if cause in WRONG_WAYS else {R, U, H}
        assert (cause in [fault.cause for fault in decision.active]) == (before in judged)
    elif kept and not (driving_only and before not in {U, H}):
        assert cause in [fault.cause for fault in decision.active]
    if cause.reaction >= Reaction.DISARM and before in {R, U, H} and (before is U or cause not in WRONG_WAYS):
        assert decision.latched.cause is cause
        assert decision.permitted is None or decision.permitted is Source.OPERATOR
    if cause.reaction < Reaction.DISARM and before is not S:
        assert decision.latched is None
    if before is U and cause.reaction is not Reaction.WARN:
        assert decision.permitted is not Source.PROGRAM
    if before in {V, R} and cause.area is Area.SERVOS and cause.reaction is not Reaction.WARN:
        assert decision.permitted is None, "hand controls, too"
    if before in {V, R} and cause.area in {Area.CAMERA, Area.PERCEPTION, Area.PROGRAM}:
        assert decision.permitted is Source.OPERATOR
    if before is V and cause is not Cause.CLOCK:  # after which nothing is known
        blanks = cause.area in {Area.CAMERA, Area.PERCEPTION} and cause.reaction >= Reaction.HOLD
        assert (decision.blanked is not None) == blanks
        assert decision.blanked is None or CAUSES.index(decision.blanked.cause) <= CAUSES.index(cause)


# --- arming ----------------------------------------------------------------------------------------


def _refused(decision: Decision, act: Act) -> set[Hindrance | Cause]:
    return {reason for refused in decision.refused if refused.act is act for reason in refused.reasons}


@pytest.mark.parametrize("ends", [Act.INPUT, Act.TAKE_BACK, DeadmanReport(False)])
def test_what_moves_the_robot_when_the_program_does_not_drive_is_no_wrong_way(ends: Event) -> None:
    """The program bends and feeds for two seconds; then the robot goes back, by hand or in a hold."""
    bench, way = Bench().in_mode(U), 0.0
    for k in range(round(5.0 / TICK_S)):
        drives = k * TICK_S < 2.0
        way += TICK_S if drives else -3.0 * TICK_S
        head = HeadSeen(bench.now_s + 0.5 * TICK_S, 10.0 * way, 10.0 * way, 80.0 + 3.0 * way, (0.0, 0.0), (1.0, 0.0))
        bench.frame = lambda report, head=head: replace(report, head=head)
        bench.held = drives or not isinstance(ends, DeadmanReport)
        bench.tick(MotionSent(bench.now_s + TICK_S, 10.0 * way, 3.0) if drives else ends)
        assert not WRONG_WAYS & {fault.cause for fault in bench.state.active}
    direction = bench.state.health.direction
    assert (direction.turns, direction.feeds) == (True, True), "a hold that clears itself need not find out again"


def test_the_program_boots_disarmed_and_nothing_may_move() -> None:
    state, decision = supervise(SupervisorState(), [], 5.0, SERVOS, SAFETY)
    assert decision.mode is V
    assert decision.permitted is None
    assert state.latched is None
    assert [fault.cause for fault in decision.active] == [
        Cause.CAMERA_LOST, Cause.BUS_DEAD, Cause.WINDOW_HUNG, Cause.HEARTBEAT_LOST, Cause.MODEL_UNFIT,
    ]  # fmt: skip
    assert [fault.detail for fault in decision.active] == [
        "no frame yet", "no report yet", "no sign of life yet", "no sign of life yet", "not checked yet",
    ]  # fmt: skip


def test_a_refusal_to_arm_names_all_reasons_at_once() -> None:
    decision = Bench().raw([Act.ARM], 5.0)
    assert _refused(decision, Act.ARM) == {
        Cause.CAMERA_LOST, Cause.BUS_DEAD, Cause.WINDOW_HUNG, Cause.HEARTBEAT_LOST, Cause.MODEL_UNFIT,
        Hindrance.SERVOS_UNCHECKED,
    }  # fmt: skip
    assert decision.mode is V


def test_before_the_first_result_of_perception_a_pose_is_waited_for_and_not_lost() -> None:
    bench = Bench()
    bench.raw([FrameArrived(0.0)], 0.0)
    reasons = hindrances(bench.state, 0.0, SAFETY)
    assert all(Hindrance.PERCEPTION_SETTLING in those and Cause.POSE_LOST not in those for those in reasons)
    bench.raw([FrameReport(0, 0.0, refusal=Reason.NO_ROBOT)], 0.0625)
    assert all(Cause.POSE_LOST in those for those in hindrances(bench.state, 0.0625, SAFETY))


def test_arming_needs_a_whole_second_of_healthy_camera_and_perception() -> None:
    bench = Bench()
    bench.tick(ModelReport(True), ServoCheckReport())
    assert bench.run(0.96875)[-1].active == ()
    decision = bench.tick(Act.ARM)
    assert decision.mode is R, decision.refused
    early = Bench()
    early.tick(ModelReport(True), ServoCheckReport())
    early.run(0.9375)
    assert _refused(early.tick(Act.ARM), Act.ARM) == {Hindrance.CAMERA_SETTLING, Hindrance.PERCEPTION_SETTLING}


def test_an_unsure_pose_blanks_the_advice_before_it_is_a_fault(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    assert bench.tick().blanked is None
    bench.bad_frame(confidence=0.49)
    decision = bench.tick()
    assert (decision.mode, decision.active) == (U, ())
    assert decision.blanked == Fault(Cause.CONFIDENCE_LOW)


@pytest.mark.parametrize("bad", [{"refusal": Reason.NO_ROBOT}, {"confidence": 0.49}])
def test_one_bad_frame_starts_the_second_again_for_perception_only(bad: dict[str, Any], benches: dict[Mode, Bench]) -> None:
    bench = benches[V].copy()
    bench.bad_frame(**bad)
    bench.tick()
    bench.bad_frame()
    bench.run(0.96875)
    assert _refused(bench.tick(Act.ARM, after_s=0.0), Act.ARM) == {Hindrance.PERCEPTION_SETTLING}
    assert bench.tick(Act.ARM).mode is R


@pytest.mark.parametrize(
    ("cause", "hindrance"), [(Cause.CAMERA_MOVED, Hindrance.CAMERA_SETTLING), (Cause.POOR_VIEW, Hindrance.PERCEPTION_SETTLING)]
)
def test_a_fault_starts_the_second_again_for_its_area(cause: Cause, hindrance: Hindrance, benches: dict[Mode, Bench]) -> None:
    bench = benches[V].copy()
    bench.tick(Fault(cause))
    assert _refused(bench.tick(Act.ARM), Act.ARM) == {hindrance}
    bench.tick(Fault(Cause.FRAMES_DROPPED))  # a warning does not
    bench.run(0.9375)
    assert bench.tick(Act.ARM).mode is R


def test_an_active_fault_is_the_reason_not_its_settling(benches: dict[Mode, Bench]) -> None:
    bench = benches[V].copy()
    decision = bench.tick(Act.ARM, Fault(Cause.CAMERA_MOVED), Fault(Cause.CONFIDENCE_LOW), Fault(Cause.DISK_LOW))
    assert _refused(decision, Act.ARM) == {Cause.CAMERA_MOVED, Cause.CONFIDENCE_LOW}


def test_arming_twice_and_arming_when_stopped_are_refused(benches: dict[Mode, Bench]) -> None:
    for mode in (R, U, H):
        assert Hindrance.ALREADY_ARMED in _refused(benches[mode].copy().tick(Act.ARM), Act.ARM)
    assert _refused(benches[R].copy().tick(Act.ARM), Act.ARM) == {Hindrance.ALREADY_ARMED}
    assert _refused(benches[S].copy().tick(Act.ARM), Act.ARM) == {Hindrance.IS_STOPPED, Hindrance.UNACKNOWLEDGED}


def test_wrong_servos_refuse_to_arm_and_say_what_is_wrong(benches: dict[Mode, Bench]) -> None:
    bench = Bench()
    bench.tick(ModelReport(True), ServoCheckReport(("id 3 missing", "id 4: wrong model")))
    bench.run(1.0625)
    decision = bench.tick(Act.ARM)
    assert _refused(decision, Act.ARM) == {Cause.SERVOS_WRONG}
    assert Fault(Cause.SERVOS_WRONG, "id 3 missing; id 4: wrong model") in decision.active
    assert decision.latched is None  # they were not in use
    assert decision.permitted is None
    bench.tick(ServoCheckReport())
    assert bench.tick(Act.ARM).mode is R


def test_a_missing_port_at_start_is_a_reason_not_a_latched_stop() -> None:
    bench = Bench()
    bench.bus = replace(GOOD_BUS, port_open=False)
    decision = bench.run(1.0625)[-1]
    assert decision.mode is V
    assert decision.latched is None
    assert Cause.PORT_LOST in _refused(bench.tick(Act.ARM), Act.ARM)
    assert bench.tick(after_s=5.0).latched is None, "nor is a jump of the clock, with servos that are not in use"


# --- hand-over -------------------------------------------------------------------------------------


def _ready_to_hand_over() -> Bench:
    bench = Bench().in_mode(R)
    bench.held = True
    bench.tick()
    return bench


def test_a_hand_over_with_all_in_place_is_granted() -> None:
    decision = _ready_to_hand_over().tick(Act.HAND_OVER)
    assert decision.mode is U
    assert decision.permitted is Source.PROGRAM
    assert decision.refused == ()


@pytest.mark.parametrize(
    ("route", "reason"), [(RouteState.NONE, Hindrance.NO_TARGET), (RouteState.BEHIND, Hindrance.TARGET_BEHIND)]
)
def test_a_hand_over_needs_a_target_ahead(route: RouteState, reason: Hindrance) -> None:
    bench = _ready_to_hand_over()
    bench.bad_frame(route=route)
    decision = bench.tick(Act.HAND_OVER)
    assert decision.mode is R
    assert _refused(decision, Act.HAND_OVER) == {reason}


@pytest.mark.parametrize("mode", [R, U, H])
def test_nobody_stays_armed_when_the_servos_are_unchecked(mode: Mode) -> None:
    """Asked for in ADVISORY, begun when the operator had armed already: then it could be handed over to unchecked servos."""
    bench = Bench().in_mode(mode)
    decision = bench.tick(ServoRequestBegun())
    assert (decision.mode, decision.permitted, decision.latched) == (V, None, None)
    decision = bench.tick(Act.ARM, Act.HAND_OVER)
    assert decision.mode is V
    assert Hindrance.SERVOS_UNCHECKED in _refused(decision, Act.ARM)
    assert Hindrance.SERVOS_UNCHECKED in _refused(decision, Act.HAND_OVER)


def test_a_hand_over_in_the_tick_in_which_the_servos_become_unchecked_is_refused() -> None:
    decision = _ready_to_hand_over().tick(ServoRequestBegun(), Act.HAND_OVER)
    assert (decision.mode, decision.permitted) == (V, None)
    assert Hindrance.SERVOS_UNCHECKED in _refused(decision, Act.HAND_OVER)


def test_a_hand_over_needs_the_deadman(benches: dict[Mode, Bench]) -> None:
    for mode in (R, H):
        assert _refused(benches[mode].copy().tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_NOT_HELD}
    bench = benches[R]
    assert hindrances(bench.state, bench.now_s, SAFETY) == ((Hindrance.ALREADY_ARMED,), ()), "it is pressed with the hand-over"


def test_a_deadman_that_was_down_before_arming_does_not_count() -> None:
    bench = Bench().in_mode(V)
    bench.held = True
    bench.tick()
    bench.tick(Act.ARM)
    bench.run(0.5)
    assert _refused(bench.tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_HELD_BEFORE}
    bench.held = False
    bench.tick()
    bench.held = True
    bench.tick()
    assert bench.tick(Act.HAND_OVER).mode is U


def test_a_deadman_that_was_down_at_the_first_report_does_not_count() -> None:
    bench = Bench()
    bench.mute.add(DeadmanReport)
    bench.in_mode(R)
    bench.tick(DeadmanReport(True))
    assert _refused(bench.tick(DeadmanReport(True), Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_HELD_BEFORE}


def test_a_deadman_pressed_in_the_tick_that_arms_does_not_count() -> None:
    bench = Bench().in_mode(V)
    bench.held = True
    bench.tick(Act.ARM)
    assert _refused(bench.tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_HELD_BEFORE}


def test_a_deadman_held_through_a_disarm_does_not_count_again() -> None:
    for event in (Act.DISARM, Fault(Cause.SEVERAL_ROBOTS)):
        bench = Bench().in_mode(U)
        bench.tick(event)
        bench.tick(Act.ACKNOWLEDGE)
        bench.run(1.0625)
        assert bench.tick(Act.ARM).mode is R
        assert _refused(bench.tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_HELD_BEFORE}


def test_a_silent_deadman_is_not_held(benches: dict[Mode, Bench]) -> None:
    bench = _ready_to_hand_over()
    bench.mute.add(DeadmanReport)
    bench.tick()
    bench.tick()
    decision = bench.tick(Act.HAND_OVER)
    assert _refused(decision, Act.HAND_OVER) == {Hindrance.DEADMAN_NOT_HELD}


def test_a_deadman_that_is_not_enough_by_itself_neither_hands_over_nor_keeps_driving() -> None:
    bench = _ready_to_hand_over()
    bench.held = False
    key = DeadmanReport(True, source="window", alone=False)
    bench.tick(replace(key, pressed=False))
    bench.tick(key)
    assert _refused(bench.tick(key, Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_ON_KEYBOARD}
    bench.held = True
    bench.tick(key)
    assert bench.tick(key, Act.HAND_OVER).mode is U
    bench.held = False
    assert bench.tick(key).mode is H, "the pedal was released, the key is down"
    bench.held = True
    assert bench.run(0.25, key)[-1].mode is U
    assert bench.tick(replace(key, pressed=False)).mode is U, "the pedal is enough"


LACKS = (Hindrance.DIRECTIONS_UNKNOWN, Hindrance.POLICY_BLIND)


@pytest.mark.parametrize("mode", MODES)
def test_settings_that_loosen_what_a_rig_needs_end_a_hand_over_and_refuse_the_next_one(
    benches: dict[Mode, Bench], mode: Mode
) -> None:
    """Nothing arms itself again when they are as they were; the operator may drive by hand."""
    bench = benches[mode].copy()
    decision = bench.tick(AgainstProgram(LACKS))
    assert decision.mode is (V if mode in ARMED_MODES else mode)
    assert decision.permitted is not Source.PROGRAM
    assert (RequestRefused(Act.HAND_OVER, LACKS) in decision.refused) is (mode in ARMED_MODES)
    assert set(LACKS) <= _refused(bench.tick(Act.ARM), Act.ARM)
    bench.tick(AgainstProgram())
    assert bench.state.mode is (V if mode in ARMED_MODES else mode)
    assert not set(LACKS) & _refused(bench.tick(Act.HAND_OVER), Act.HAND_OVER)


def test_what_a_rig_lacks_outlasts_all_events_and_leaves_the_operator_driving() -> None:
    bench = Bench().in_mode(V)
    bench.state = replace(bench.state, against_program=LACKS)
    for event in SINGLE_EVENTS.values():
        if not isinstance(event, AgainstProgram):
            bench.tick(event)
    bench.tick(after_s=5.0)  # the clock jumps
    bench.tick(Act.ACKNOWLEDGE)
    bench.tick(ModelReport(True), ServoCheckReport())
    bench.run(1.0625)
    decision = bench.tick(Act.ARM)
    assert _refused(decision, Act.ARM) == set(LACKS)
    assert (decision.mode, decision.permitted) == (V, Source.OPERATOR)


def test_a_hand_over_while_the_controls_are_in_use_is_refused() -> None:
    bench = _ready_to_hand_over()
    assert _refused(bench.tick(Act.INPUT, Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.OPERATOR_DRIVING}
    bench.run(0.28125 - TICK_S)
    assert _refused(bench.tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.OPERATOR_DRIVING}
    assert bench.tick(Act.HAND_OVER).mode is U  # 312 ms after the last input


def test_a_hand_over_from_advisory_stopped_or_autonomy_says_so(benches: dict[Mode, Bench]) -> None:
    assert Hindrance.NOT_YET_ARMED in _refused(benches[V].copy().tick(Act.HAND_OVER), Act.HAND_OVER)
    assert Hindrance.IS_STOPPED in _refused(benches[S].copy().tick(Act.HAND_OVER), Act.HAND_OVER)
    assert _refused(benches[U].copy().tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.ALREADY_AUTONOMOUS}


def test_a_hand_over_with_a_fault_that_would_hold_names_it_and_no_warning() -> None:
    decision = _ready_to_hand_over().tick(Act.HAND_OVER, Fault(Cause.POOR_VIEW), Fault(Cause.DISK_LOW))
    assert decision.mode is R
    assert _refused(decision, Act.HAND_OVER) == {Cause.POOR_VIEW}


def test_arming_and_handing_over_in_one_tick_only_arms() -> None:
    bench = Bench().in_mode(V)
    assert bench.tick(Act.HAND_OVER, Act.ARM, DeadmanReport(True)).mode is R


# --- the operator wins -----------------------------------------------------------------------------


@pytest.mark.parametrize("before", [V, R, U, H])
@pytest.mark.parametrize("others", list(itertools.permutations([Act.HAND_OVER, Act.INPUT, Act.ARM])))
def test_the_operators_input_beats_everything_else_in_the_tick(
    before: Mode, others: tuple[Act, ...], benches: dict[Mode, Bench]
) -> None:
    decision = benches[before].copy().tick(*others)
    assert decision.mode is R
    assert decision.permitted is Source.OPERATOR


def test_the_input_beats_a_hand_over_that_would_have_been_granted() -> None:
    assert _ready_to_hand_over().tick(Act.HAND_OVER, Act.INPUT).permitted is Source.OPERATOR


def test_only_a_stop_beats_the_operators_input(benches: dict[Mode, Bench]) -> None:
    decision = benches[U].copy().tick(Act.INPUT, Act.STOP)
    assert decision.mode is S
    assert decision.permitted is None


def test_disarming_beats_taking_back_and_arming(benches: dict[Mode, Bench]) -> None:
    assert benches[U].copy().tick(Act.TAKE_BACK, Act.DISARM).mode is V
    assert benches[U].copy().tick(Act.INPUT, Act.DISARM).mode is V
    assert benches[V].copy().tick(Act.ARM, Act.DISARM).mode is V


def test_after_the_operators_input_autonomy_does_not_come_back_by_itself(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    bench.tick(Act.INPUT)
    assert {decision.mode for decision in bench.run(2.0)} == {R}


# --- hold ------------------------------------------------------------------------------------------


def _held_for(seconds: float) -> Bench:
    """In HOLD for so long by a fault, the deadman still held."""
    bench = Bench().in_mode(U)
    bench.tick(Fault(Cause.HEAD_JUMP))
    bench.run(seconds, Fault(Cause.HEAD_JUMP))
    assert bench.state.mode is H
    return bench


def _ticks_until_autonomy(bench: Bench) -> int | None:
    modes = [decision.mode for decision in bench.run(2.0)]
    return modes.index(U) + 1 if U in modes else None


def test_a_hold_clears_itself_after_all_was_well_for_100_ms() -> None:
    assert _ticks_until_autonomy(_held_for(0.0)) == 5  # well since the first tick; 125 ms later


def test_a_hold_clears_itself_within_half_a_second_and_not_later() -> None:
    assert _ticks_until_autonomy(_held_for(0.34375)) == 5  # 500 ms after the hold began
    assert _ticks_until_autonomy(_held_for(0.375)) is None


def test_exactly_at_the_end_of_the_dwell_time_a_hold_clears_itself() -> None:
    bench = _held_for(0.0)
    bench.run(0.125)
    bench.now_s += TICK_S
    exact = SAFETY.model_copy(update={"hold_dwell_s": 0.125})
    assert supervise(bench.state, bench.reports(), bench.now_s, SERVOS, exact)[1].mode is U


def test_exactly_at_the_end_of_the_quiet_time_a_hand_over_is_granted() -> None:
    bench = _ready_to_hand_over()
    bench.tick(Act.INPUT)
    bench.run(0.25)
    bench.now_s += TICK_S
    exact = SAFETY.model_copy(update={"operator_quiet_s": 0.28125})
    assert supervise(bench.state, [*bench.reports(), Act.HAND_OVER], bench.now_s, SERVOS, exact)[1].mode is U


def test_every_new_fault_starts_the_dwell_again() -> None:
    bench = _held_for(0.0)
    bench.run(0.125)
    assert bench.tick(Fault(Cause.POOR_VIEW)).mode is H
    assert _ticks_until_autonomy(bench) == 5


def test_a_warning_does_not_keep_a_hold() -> None:
    bench = _held_for(0.0)
    assert bench.run(0.15625, Fault(Cause.DISK_LOW))[-1].mode is U


def test_a_hold_says_when_it_no_longer_clears_itself() -> None:
    bench = _held_for(0.5)
    assert not bench.decision.hold_expired
    assert bench.tick().hold_expired
    bench.tick(Act.TAKE_BACK)
    assert not bench.decision.hold_expired


def test_a_hold_without_the_deadman_does_not_clear_itself() -> None:
    bench = Bench().in_mode(H)
    assert _ticks_until_autonomy(bench) is None


def test_a_deadman_pressed_again_at_once_goes_on() -> None:
    bench = Bench().in_mode(H)
    bench.run(0.125)
    bench.held = True
    assert _ticks_until_autonomy(bench) == 5


def test_a_deadman_released_and_pressed_within_one_tick_is_a_loss() -> None:
    for reports in ([DeadmanReport(False), DeadmanReport(True)], [DeadmanReport(True), DeadmanReport(False)]):
        assert Bench().in_mode(U).tick(*reports).mode is H


def test_a_release_in_a_late_tick_is_a_loss_too(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    assert bench.copy().tick(DeadmanReport(True), after_s=0.125).mode is U
    assert bench.tick(DeadmanReport(False), DeadmanReport(True), after_s=0.125).mode is H
    late = benches[U].copy()
    late.now_s += 0.125
    reports = [event for event in late.reports() if not isinstance(event, DeadmanReport)]
    assert late.raw([DeadmanReport(False), DeadmanReport(True), *reports], late.now_s).mode is H


def test_a_deadman_that_is_let_go_is_no_loss_while_another_is_held(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()  # which holds the nameless one
    for pressed in (False, True, False, None):
        assert bench.tick(DeadmanReport(pressed, source="key")).mode is U
    late = benches[U].copy()
    first_s = late.now_s + 0.0625  # the other is heard of again only after it
    key = [DeadmanReport(pressed, first_s, "key") for pressed in (True, False)]
    assert late.raw([*key, *late.reports()], late.now_s + 0.125).mode is U


@pytest.mark.parametrize("before", [U, H])
def test_a_stop_whose_hand_leaves_the_deadman_says_stop_alone(before: Mode, benches: dict[Mode, Bench]) -> None:
    decision = benches[before].copy().tick(Act.STOP, DeadmanReport(False))
    assert [fault.cause for fault in decision.active] == [Cause.STOP_PRESSED]


def test_a_second_deadman_that_is_pressed_before_the_first_one_is_heard_of_again_is_no_loss(benches: dict[Mode, Bench]) -> None:
    """In a late tick: a press lets nothing go, whatever was heard of the other one by then."""
    late = benches[U].copy()
    press = DeadmanReport(True, late.now_s + 0.11, "key")
    assert late.raw([press, *late.reports()], late.now_s + 0.125).mode is U


@pytest.mark.parametrize("pressed", [False, None])
def test_the_last_deadman_that_is_let_go_or_cannot_tell_is_a_loss(benches: dict[Mode, Bench], pressed: bool | None) -> None:
    bench = benches[U].copy()
    bench.tick(DeadmanReport(False, source="key"))
    bench.tick(DeadmanReport(True, source="key"))
    bench.held = False
    assert bench.tick().mode is U
    assert bench.tick(DeadmanReport(pressed, source="key")).mode is H


def test_a_press_of_one_deadman_says_nothing_of_another_that_was_down_before_arming() -> None:
    bench = Bench()
    bench.held = True
    bench.in_mode(R)
    assert _refused(bench.copy().tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_HELD_BEFORE}
    bench.tick(DeadmanReport(False, source="key"))
    bench.tick(DeadmanReport(True, source="key"))
    assert bench.copy().tick(DeadmanReport(True, source="key"), Act.HAND_OVER).mode is U
    bench.tick(DeadmanReport(False, source="key"))
    assert _refused(bench.tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_HELD_BEFORE}


def test_silence_of_the_deadman_holds_within_100_ms() -> None:
    bench = Bench().in_mode(U)
    bench.mute.add(DeadmanReport)
    quiet_s = 0.0
    while bench.tick(after_s=0.015625).mode is U:
        quiet_s += 0.015625
    assert 0.0625 < quiet_s + 0.015625 <= 0.1


def test_a_deadman_silent_for_80_ms_is_still_held_exactly() -> None:
    bench = Bench().in_mode(U)
    safety = SAFETY.model_copy(update={"deadman_timeout_s": 0.0625})
    reports = [event for event in bench.reports() if not isinstance(event, DeadmanReport)]
    assert supervise(bench.state, reports, bench.now_s + 0.0625, SERVOS, safety)[1].mode is U


def test_after_a_short_silence_a_held_deadman_still_counts_after_a_long_one_not() -> None:
    for silence_s, mode in ((0.25, U), (0.5, H), (0.53125, H)):
        bench = Bench().in_mode(U)
        bench.mute.add(DeadmanReport)
        bench.run(silence_s - TICK_S)
        bench.mute.clear()
        assert bench.run(0.25)[-1].mode is mode


def test_a_press_after_a_long_silence_is_as_unknown_as_at_the_start() -> None:
    bench = Bench().in_mode(R)
    bench.mute.add(DeadmanReport)
    bench.run(0.5)
    bench.mute.clear()
    bench.held = True
    bench.tick()
    assert _refused(bench.tick(Act.HAND_OVER), Act.HAND_OVER) == {Hindrance.DEADMAN_HELD_BEFORE}


def test_a_hold_soon_after_the_last_one_is_the_same_hold() -> None:
    bench = _held_for(0.0)
    assert _ticks_until_autonomy(bench.copy()) == 5
    bench.run(0.15625)
    assert bench.state.mode is U
    bench.run(0.5)
    bench.tick(Fault(Cause.HEAD_JUMP))
    assert bench.state.mode is H
    assert _ticks_until_autonomy(bench) is None  # more than half a second after it began


def test_a_hold_long_after_the_last_one_is_a_new_one() -> None:
    bench = _held_for(0.0)
    bench.run(0.15625)
    bench.run(0.96875)
    bench.tick(Fault(Cause.HEAD_JUMP))  # exactly a second after autonomy came back
    assert bench.state.mode is H
    assert _ticks_until_autonomy(bench) == 5


def test_a_new_hand_over_makes_the_next_hold_a_new_one() -> None:
    bench = _held_for(0.0)
    bench.run(0.15625)
    bench.tick(Act.TAKE_BACK)
    bench.tick(Act.HAND_OVER)
    bench.run(0.25)
    bench.tick(Fault(Cause.HEAD_JUMP))
    assert _ticks_until_autonomy(bench) == 5


def test_an_expired_hold_ends_by_a_new_hand_over() -> None:
    bench = _held_for(1.0)
    bench.run(0.25)
    assert bench.state.mode is H
    assert bench.tick(Act.HAND_OVER).mode is U


# --- latches ---------------------------------------------------------------------------------------


def test_the_first_cause_stays_until_acknowledged(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    bench.tick(Fault(Cause.SEVERAL_ROBOTS, "two"))
    bench.tick(Fault(Cause.HOT))
    decision = bench.tick(Act.STOP)
    assert decision.mode is S
    assert decision.latched == Fault(Cause.SEVERAL_ROBOTS, "two")
    assert decision.refused == ()
    bench.run(3.0)
    assert bench.state.latched.cause is Cause.SEVERAL_ROBOTS
    assert bench.tick(Act.ACKNOWLEDGE).latched is None


def test_of_several_faults_in_one_tick_the_worst_is_latched(benches: dict[Mode, Bench]) -> None:
    decision = benches[U].copy().tick(Fault(Cause.POSE_LOST), Fault(Cause.CAMERA_LOST), Fault(Cause.HEAD_JUMP))
    assert decision.latched.cause is Cause.CAMERA_LOST
    stop = benches[U].copy().tick(Fault(Cause.CAMERA_LOST), Fault(Cause.TRACKING))
    assert stop.latched.cause is Cause.TRACKING


def test_nothing_re_arms_itself(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    bench.tick(Fault(Cause.SEVERAL_ROBOTS))
    assert {decision.mode for decision in bench.run(3.0)} == {V}
    assert _refused(bench.tick(Act.ARM), Act.ARM) == {Hindrance.UNACKNOWLEDGED}
    bench.tick(Act.ACKNOWLEDGE)
    assert {decision.mode for decision in bench.run(3.0)} == {V}
    assert bench.tick(Act.ARM).mode is R


def test_an_acknowledgement_does_not_clear_what_its_own_tick_reports(benches: dict[Mode, Bench]) -> None:
    bench = benches[S].copy()
    decision = bench.tick(Act.STOP, Act.ACKNOWLEDGE)
    assert decision.mode is S
    assert _refused(decision, Act.ACKNOWLEDGE) == {Cause.STOP_PRESSED}


def test_a_stop_whose_cause_lasts_comes_back(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    bench.bus = replace(GOOD_BUS, port_open=False)
    bench.tick()
    bench.tick(ServoCheckReport())
    decision = bench.tick(Act.ACKNOWLEDGE)
    assert decision.mode is V  # the servos count as unchecked while the port is gone: a reason not to arm, nothing to stop
    assert decision.permitted is None
    bench.tick(ServoCheckReport())
    assert bench.state.mode is S


def test_after_a_stop_the_servos_must_be_checked_before_anything_moves(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    bench.tick(Act.STOP)
    decision = bench.tick(Act.ACKNOWLEDGE, Act.INPUT)
    assert decision.mode is V
    assert decision.permitted is None
    assert _refused(bench.tick(Act.ARM), Act.ARM) == {Hindrance.SERVOS_UNCHECKED}
    assert bench.tick(ServoCheckReport()).permitted is Source.OPERATOR


@pytest.mark.parametrize(
    "cause",
    [
        Cause.SUPPLY_LOST,
        Cause.SERVO_SILENT,
        Cause.BUS_DEAD,
        Cause.REBOOTED,
        Cause.TORQUE_TAKEN,
        Cause.WATCHDOG,
        Cause.CLOCK,
        Cause.PORT_LOST,
    ],
)
def test_after_these_the_servos_must_be_checked_again(cause: Cause, benches: dict[Mode, Bench]) -> None:
    bench = benches[R].copy()
    bench.tick(Fault(cause))
    bench.tick(Act.ACKNOWLEDGE)
    assert bench.tick().permitted is None
    assert bench.tick(ServoCheckReport()).permitted is Source.OPERATOR


def test_stop_is_latched_also_while_the_servos_are_not_in_use(benches: dict[Mode, Bench]) -> None:
    bench = benches[V].copy()
    bench.tick(ServoRequestBegun())
    decision = bench.tick(Act.STOP)
    assert (bench.state.mode, decision.latched) == (S, Fault(Cause.STOP_PRESSED))


@pytest.mark.parametrize("servos_on", [True, False])
def test_a_pressed_e_stop_must_be_released_and_then_acknowledged(servos_on: bool, benches: dict[Mode, Bench]) -> None:
    bench = benches[V].copy()
    if not servos_on:
        bench.tick(ServoRequestBegun())
    assert bench.tick(EstopReport(True)).latched == Fault(Cause.ESTOP_PRESSED)
    decision = bench.tick(Act.ACKNOWLEDGE)  # a board that has fallen silent says nothing of the button: it is still pressed
    assert decision.latched == Fault(Cause.ESTOP_PRESSED)
    assert _refused(decision, Act.ACKNOWLEDGE) == {Cause.ESTOP_PRESSED}
    assert Cause.ESTOP_PRESSED in _refused(bench.tick(Act.ARM), Act.ARM)
    assert Cause.ESTOP_PRESSED in {fault.cause for fault in bench.tick(after_s=1.5).active}, "known after a gap of the clock, too"
    decision = bench.tick(EstopReport(False))
    assert decision.latched == Fault(Cause.ESTOP_PRESSED), "released: still to be acknowledged"
    bench.run(1.1)
    assert Hindrance.UNACKNOWLEDGED in _refused(bench.tick(Act.ARM), Act.ARM)
    assert bench.tick(Act.ACKNOWLEDGE).latched is None
    assert _refused(bench.tick(Act.ARM), Act.ARM) == {Hindrance.SERVOS_UNCHECKED}
    bench.tick(ServoCheckReport())
    assert bench.tick(Act.ARM).mode is R


def test_a_servo_fault_while_driving_by_hand_is_latched_a_perception_fault_is_not(benches: dict[Mode, Bench]) -> None:
    bench = benches[V].copy()
    assert bench.tick(Fault(Cause.SEVERAL_ROBOTS), Fault(Cause.WINDOW_HUNG)).latched is None
    decision = bench.tick(Fault(Cause.HEARTBEAT_LOST), Fault(Cause.HOT))
    assert decision.latched == Fault(Cause.HOT)
    assert bench.tick().permitted is None  # until acknowledged, though it is over
    assert bench.tick(Act.ACKNOWLEDGE).permitted is Source.OPERATOR


def test_raised_are_only_the_new_faults(benches: dict[Mode, Bench]) -> None:
    bench = benches[V].copy()
    assert [fault.cause for fault in bench.tick(Fault(Cause.HEAD_JUMP)).raised] == [Cause.HEAD_JUMP]
    both = bench.tick(Fault(Cause.HEAD_JUMP), Fault(Cause.POOR_VIEW))
    assert [fault.cause for fault in both.raised] == [Cause.POOR_VIEW]
    bench.tick()
    assert [fault.cause for fault in bench.tick(Fault(Cause.HEAD_JUMP)).raised] == [Cause.HEAD_JUMP]


def test_a_bad_report_counts_even_when_a_better_one_follows_in_the_tick(benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    alert = replace(GOOD_BUS, hardware_errors=(0, 0, 1, 0, 0, 0, 0))
    assert bench.tick(alert, GOOD_BUS).mode is S
    bench = benches[U].copy()
    two = FrameReport(50_000, bench.now_s + TICK_S, Reason.SEVERAL_ROBOTS)
    good = FrameReport(50_001, bench.now_s + TICK_S, confidence=0.9, route=RouteState.READY)
    assert bench.tick(two, good).mode is V


@pytest.mark.parametrize("kind", [FrameReport, BusReport, DeadmanReport])
def test_the_order_of_reports_in_a_late_tick_makes_no_fault(kind: type, benches: dict[Mode, Bench]) -> None:
    """All reports of a tick that comes 125 ms late are in time by its end, whichever of them comes last."""
    bench = benches[U].copy()
    bench.now_s += 0.125
    reports = sorted(bench.reports(), key=lambda event: isinstance(event, kind))
    assert bench.raw(reports, bench.now_s).mode is U


# --- clock -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gap_s", "mode"), [(0.46875, U), (1.0, H), (1.03125, V), (-0.03125, V), (math.nan, V), (math.inf, V)])
def test_only_a_steady_clock_keeps_autonomy(gap_s: float, mode: Mode, benches: dict[Mode, Bench]) -> None:
    bench = benches[U].copy()
    last_s = bench.now_s
    reports = [
        replace(e, captured_s=min(e.captured_s, last_s)) if isinstance(e, FrameReport) and not gap_s > 0 else e
        for e in bench.reports()
    ]
    fresh = [replace(e, captured_s=last_s + gap_s) if isinstance(e, FrameReport) and 0 < gap_s <= 1.0 else e for e in reports]
    decision = bench.raw(fresh, last_s + gap_s)
    assert decision.mode is mode
    if mode is V:
        assert decision.latched.cause is Cause.CLOCK
        assert decision.permitted is None


def test_after_a_jump_of_the_clock_only_the_model_is_still_known(benches: dict[Mode, Bench]) -> None:
    bench = benches[R].copy()
    bench.tick(Act.INPUT)
    bench.state = replace(bench.state, resumed_s=bench.now_s)
    decision = bench.raw([], 3.0)
    assert (bench.state.input_s, bench.state.resumed_s) == (None, None)
    assert {fault.cause for fault in decision.active} == {
        Cause.CLOCK, Cause.CAMERA_LOST, Cause.BUS_DEAD, Cause.WINDOW_HUNG, Cause.HEARTBEAT_LOST,
    }  # fmt: skip
    bench.now_s = 3.0
    bench.tick(Act.ACKNOWLEDGE, ServoCheckReport())
    bench.run(0.9375)
    assert _refused(bench.tick(Act.ARM, after_s=0.0), Act.ARM) == {Hindrance.CAMERA_SETTLING, Hindrance.PERCEPTION_SETTLING}
    assert bench.tick(Act.ARM).mode is R


def test_a_first_time_that_is_no_number_is_not_kept() -> None:
    bench = Bench()
    assert bench.raw([], math.nan).active[0] == Fault(Cause.CLOCK, "from 0.000 s to nan s")
    assert Cause.CLOCK not in [fault.cause for fault in bench.raw([], 50.0).active]


def test_after_a_jump_of_the_clock_camera_and_perception_must_prove_themselves_anew(benches: dict[Mode, Bench]) -> None:
    """Also when the tick of the jump itself brings good reports."""
    bench = benches[V].copy()
    assert bench.tick(after_s=5.0).latched.cause is Cause.CLOCK
    decision = bench.tick(Act.ARM, Act.ACKNOWLEDGE, ServoCheckReport())
    assert _refused(decision, Act.ARM) == {Hindrance.CAMERA_SETTLING, Hindrance.PERCEPTION_SETTLING}
