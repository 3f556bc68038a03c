"""The gate, by hand.

Tendons: -2.4..2.8 mm, margin 0.3 mm, 10 mm/s, 200 mm/s2, step 0.6 mm. Feeds: -5..400 mm, margin 2 mm, 20 mm/s, step 1 mm.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from core.config.safety import JOINT_NAMES, JointConfig, JointName, SafetyConfig, ServosConfig
from core.control.gate import Clamp, GateState, GateStep, GoalRequest, JointMeasurement, RejectReason, Source, gate_step
from core.control.joints import Limit, Retracted, by_hand, by_program, joint_goals
from core.types import Command

SERVOS, SAFETY = ServosConfig(), SafetyConfig()
AT = (0.3, 0.3, 0.3, 0.3, 10.0, 20.0, 20.0)
TICK = 0.02
NOW = 100.0
TENDON_TICK_MM = 40.0 / 4096


def _place(name: JointName) -> int:
    return JOINT_NAMES.index(name)


def _moved(values: Sequence[float] = AT, **changes: float) -> tuple[float, ...]:
    return tuple(changes.get(name, value) for name, value in zip(JOINT_NAMES, values, strict=True))


def _running(
    goals: Sequence[float] = AT, speeds: Sequence[float] = (0.0,) * 7, ago_s: float = TICK, issued_s: float = NOW - TICK
) -> GateState:
    return GateState(NOW - ago_s, tuple(goals), tuple(speeds), True, issued_s)


def _ask(goals: Sequence[float] = AT, *, age_s: float = 0.0, frame_age_s: float | None = 0.05) -> GoalRequest:
    return GoalRequest(goals, Source.PROGRAM, NOW - age_s, None if frame_age_s is None else NOW - frame_age_s)


def _at(positions: Sequence[float] = AT, age_s: float = 0.005) -> JointMeasurement:
    return JointMeasurement(positions, NOW - age_s)


def _step(
    state: GateState | None = None,
    request: GoalRequest | None = None,
    measurement: JointMeasurement | None = None,
    permitted: Source | None = Source.PROGRAM,
    now_s: float = NOW,
    servos: ServosConfig = SERVOS,
) -> GateStep:
    return gate_step(state or _running(), request or _ask(), measurement or _at(), permitted, now_s, servos, SAFETY)


def _reason(step: GateStep) -> RejectReason | None:
    return step.rejection.reason if step.rejection is not None else None


def _with(name: JointName, **changes: float) -> ServosConfig:
    joints = [j.model_copy(update=changes) if j.name == name else j for j in SERVOS.joints]
    return ServosConfig(joints=tuple(JointConfig.model_validate(j.model_dump()) for j in joints))


# --- what is rejected ------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", JOINT_NAMES)
def test_a_goal_that_is_not_finite_is_rejected_by_name_and_all_hold(name: JointName, bad: float) -> None:
    step = _step(request=_ask(_moved(**{name: bad})))
    assert _reason(step) is RejectReason.NON_FINITE
    assert step.rejection.detail == name
    assert step.goals_mm == AT
    assert step.is_hold


@pytest.mark.parametrize("count", [0, 6, 8])
def test_seven_goals_no_more_no_fewer(count: int) -> None:
    step = _step(request=_ask((0.3,) * count))
    assert _reason(step) is RejectReason.WRONG_COUNT
    assert step.rejection.detail == f"{count} instead of 7"


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_times_that_are_no_numbers_are_rejected(bad: float) -> None:
    assert _reason(_step(request=GoalRequest(AT, Source.PROGRAM, bad, NOW))) is RejectReason.NON_FINITE
    assert _reason(_step(request=GoalRequest(AT, Source.PROGRAM, NOW, bad))) is RejectReason.NON_FINITE
    assert _reason(_step(measurement=JointMeasurement(AT, bad))) is RejectReason.NON_FINITE
    assert _reason(_step(now_s=bad)) is RejectReason.NON_FINITE


def test_times_from_the_future_are_rejected() -> None:
    """They would look fresh for ever."""
    assert _reason(_step(request=_ask(age_s=-0.001))) is RejectReason.FROM_THE_FUTURE
    assert _reason(_step(request=_ask(frame_age_s=-0.001))) is RejectReason.FROM_THE_FUTURE
    assert _reason(_step(measurement=_at(age_s=-0.001))) is RejectReason.FROM_THE_FUTURE
    assert _reason(_step(request=_ask(age_s=0.0, frame_age_s=0.0), measurement=_at(age_s=0.0))) is None


# ages on either side of the limit, by more than the arithmetic's rounding at a time of 100 s
@pytest.mark.parametrize(
    ("age_s", "reason"), [(0.0999, None), (0.1001, RejectReason.STALE_COMMAND), (50.0, RejectReason.STALE_COMMAND)]
)
def test_a_command_older_than_100_ms_is_dropped(age_s: float, reason: RejectReason | None) -> None:
    assert _reason(_step(_running(issued_s=0.0), _ask(age_s=age_s))) is reason


@pytest.mark.parametrize(("age_s", "reason"), [(0.1499, None), (0.1501, RejectReason.STALE_POSE), (None, RejectReason.STALE_POSE)])
def test_a_pose_older_than_150_ms_is_not_followed(age_s: float | None, reason: RejectReason | None) -> None:
    assert _reason(_step(request=_ask(frame_age_s=age_s))) is reason


def test_the_ages_limits_themselves_are_still_good() -> None:
    state = GateState(0.0, AT, (0.0,) * 7, True, 0.0)
    request = GoalRequest(AT, Source.PROGRAM, 0.0, 0.0)
    assert gate_step(state, request, JointMeasurement(AT, 0.0), Source.PROGRAM, 0.1, SERVOS, SAFETY).rejection is None
    fresh = GoalRequest(AT, Source.PROGRAM, 0.15, 0.0)
    assert gate_step(state, fresh, JointMeasurement(AT, 0.15), Source.PROGRAM, 0.15, SERVOS, SAFETY).rejection is None
    late = GoalRequest(AT, Source.PROGRAM, 1.0, 1.0)
    assert gate_step(state, late, JointMeasurement(AT, 1.0), Source.PROGRAM, 1.0, SERVOS, SAFETY).rejection is None


def test_an_operator_needs_no_frame() -> None:
    request = GoalRequest(AT, Source.OPERATOR, NOW, None)
    assert _reason(_step(request=request, permitted=Source.OPERATOR)) is None
    assert _reason(_step(request=replace(request, captured_s=0.0), permitted=Source.OPERATOR)) is None


@pytest.mark.parametrize(
    ("permitted", "source", "reason"),
    [
        (None, Source.PROGRAM, RejectReason.NOT_ARMED),
        (None, Source.OPERATOR, RejectReason.NOT_ARMED),
        (Source.OPERATOR, Source.PROGRAM, RejectReason.WRONG_SOURCE),
        (Source.PROGRAM, Source.OPERATOR, RejectReason.WRONG_SOURCE),
        (Source.PROGRAM, Source.PROGRAM, None),
        (Source.OPERATOR, Source.OPERATOR, None),
    ],
)
def test_only_who_is_permitted_moves_anything(permitted: Source | None, source: Source, reason: RejectReason | None) -> None:
    assert _reason(_step(request=replace(_ask(), source=source), permitted=permitted)) is reason


def test_without_a_command_everything_holds() -> None:
    step = gate_step(_running(), None, _at(), Source.PROGRAM, NOW, SERVOS, SAFETY)
    assert _reason(step) is RejectReason.NO_COMMAND
    assert step.goals_mm == AT
    assert _reason(gate_step(_running(), None, _at(), None, NOW, SERVOS, SAFETY)) is RejectReason.NOT_ARMED


def test_a_command_that_a_newer_one_overtook_is_not_obeyed() -> None:
    state = _running(issued_s=NOW - 0.01)
    assert _reason(_step(state, _ask(age_s=0.011))) is RejectReason.OUT_OF_ORDER
    assert _reason(_step(state, _ask(age_s=0.01))) is None  # the same one again, as the bus is faster than the camera
    assert _step(state, _ask(age_s=0.005)).state.issued_s == NOW - 0.005


def test_a_rejection_does_not_forget_the_newest_command() -> None:
    state = _running(issued_s=NOW - 0.01)
    assert _step(state, permitted=None).state.issued_s == NOW - 0.01
    assert _step(state, measurement=_at(age_s=1.0)).state.issued_s == NOW - 0.01
    assert _step(GateState(), _ask(age_s=0.03)).state.issued_s == NOW - 0.03  # nor does the start of a motion


@pytest.mark.parametrize(
    ("measurement", "reason"),
    [
        (JointMeasurement((0.3,) * 6, NOW), RejectReason.WRONG_COUNT),
        (JointMeasurement(_moved(left=math.nan), NOW), RejectReason.NON_FINITE),
        (JointMeasurement(AT, NOW - 0.0999), None),
        (JointMeasurement(AT, NOW - 0.1001), RejectReason.STALE_MEASUREMENT),
        (JointMeasurement(_moved(left=3.5), NOW), RejectReason.MEASURED_OUT_OF_ENVELOPE),
        (JointMeasurement(_moved(left=-3.1), NOW), RejectReason.MEASURED_OUT_OF_ENVELOPE),
    ],
)
def test_positions_that_cannot_be_believed_are_no_ground_to_move_or_to_hold(
    measurement: JointMeasurement, reason: RejectReason | None
) -> None:
    step = _step(measurement=measurement)
    assert _reason(step) is reason
    assert (step.goals_mm is None) == (reason is not None)  # nothing is sent: the servos keep their last goal


def test_which_position_was_wrong_is_said() -> None:
    step = _step(measurement=_at(_moved(up=math.nan)))
    assert step.rejection.detail == "measured position: up"
    outside = _step(measurement=_at(_moved(up=3.5)))
    assert outside.rejection.detail == "up at 3.50 mm (-2.4 to 2.8 mm)"


def test_no_positions_yet() -> None:
    step = gate_step(GateState(), _ask(), None, Source.PROGRAM, NOW, SERVOS, SAFETY)
    assert _reason(step) is RejectReason.NO_MEASUREMENT
    assert step.goals_mm is None


@pytest.mark.parametrize("name", ["right", "advance"])
def test_goals_beyond_the_envelope_are_rejected_but_for_one_position_unit(name: JointName) -> None:
    joint = SERVOS.joints[_place(name)]
    for end, sign in ((joint.high_mm, 1.0), (joint.low_mm, -1.0)):
        state, here = _running(_moved(**{name: end})), _at(_moved(**{name: end}))
        rounded = _step(state, _ask(_moved(**{name: end + sign * 0.9 * TENDON_TICK_MM})), here)
        assert _reason(rounded) is None
        assert rounded.goals_mm[_place(name)] == end
        assert [clamp.limit for clamp in rounded.clamps] == [Limit.ENVELOPE]
        beyond = _step(state, _ask(_moved(**{name: end + sign * 1.1 * TENDON_TICK_MM})), here)
        assert _reason(beyond) is RejectReason.OUT_OF_ENVELOPE


@pytest.mark.parametrize(("name", "most_mm"), [("right", 1.0), ("advance", 2.0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_goal_farther_than_a_command_can_reach_in_its_life_is_rejected(name: JointName, most_mm: float, sign: float) -> None:
    """10 mm/s or 20 mm/s over 100 ms, and one position unit."""
    start = AT[_place(name)]
    far = start + sign * (most_mm + 1.1 * TENDON_TICK_MM)
    near = start + sign * (most_mm + 0.9 * TENDON_TICK_MM)
    step = _step(request=_ask(_moved(**{name: far})))
    assert _reason(step) is RejectReason.OVER_RATE
    assert step.goals_mm == AT
    assert _reason(_step(request=_ask(_moved(**{name: near})))) is None


def test_a_position_unit_is_measured_whatever_the_servos_sign() -> None:
    servos = _with("right", sign=-1)
    assert _reason(_step(request=_ask(_moved(right=1.3 + 0.9 * TENDON_TICK_MM)), servos=servos)) is None


def test_a_clock_that_goes_back_is_rejected_once_and_then_believed() -> None:
    late = GateState(NOW + 50.0, AT, (0.0,) * 7, True, NOW + 50.0)
    step = _step(late)
    assert _reason(step) is RejectReason.CLOCK_WENT_BACK
    assert step.goals_mm == AT
    assert _reason(_step(step.state, now_s=NOW)) is None


def test_a_pause_of_more_than_a_second_is_rejected_once() -> None:
    state = _running(ago_s=1.001)
    step = _step(state)
    assert _reason(step) is RejectReason.CLOCK_GAP
    assert step.rejection.detail == "by 1.001 s (at most 1 s)"
    assert _reason(_step(step.state)) is None
    assert _reason(_step(_running(ago_s=0.999))) is None


def test_a_time_that_is_no_number_changes_no_time() -> None:
    step = _step(now_s=math.nan)
    assert step.goals_mm is None
    assert step.state.time_s == NOW - TICK


@pytest.mark.parametrize(("name", "most_mm"), [("right", 1.0), ("advance", 2.0)])
def test_one_position_unit_more_is_still_rounding(name: JointName, most_mm: float) -> None:
    joint, start = SERVOS.joints[_place(name)], 0.5 if name == "right" else 10.0
    for sign in (1.0, -1.0):
        state, here = _running(_moved(**{name: start})), _at(_moved(**{name: start}))
        assert _reason(_step(state, _ask(_moved(**{name: start + sign * (most_mm + TENDON_TICK_MM)})), here)) is None
    if name == "advance":  # numbers that are exact in binary
        for end, sign in ((joint.high_mm, 1.0), (joint.low_mm, -1.0)):
            state, here = _running(_moved(advance=end)), _at(_moved(advance=end))
            assert _reason(_step(state, _ask(_moved(advance=end + sign * TENDON_TICK_MM)), here)) is None


def test_a_rejection_says_what_was_measured_against_what() -> None:
    def detail(step: GateStep) -> str:
        return step.rejection.detail

    assert detail(_step(_running(issued_s=0.0), _ask(age_s=0.25))) == "250 ms (at most 100 ms)"
    assert detail(_step(request=_ask(frame_age_s=0.25))) == "250 ms (at most 150 ms)"
    assert detail(_step(request=_ask(frame_age_s=2.0))) == "2000 ms (at most 150 ms)"
    assert detail(_step(request=_ask(frame_age_s=None))) == "no frame behind the command"
    assert detail(_step(measurement=_at(age_s=0.25))) == "250 ms (at most 100 ms)"
    assert detail(_step(request=_ask(age_s=-0.5, frame_age_s=0.1))) == "command, by 0.500 s"
    assert detail(_step(request=_ask(age_s=-0.1, frame_age_s=-0.5))) == "command, by 0.500 s"
    assert detail(_step(measurement=_at(age_s=-0.5))) == "measured positions, by 0.500 s"
    assert detail(_step(_running(ago_s=-2.0))) == "by 2.000 s"
    assert detail(_step(permitted=Source.OPERATOR)) == "the operator drives"
    assert detail(_step(request=_ask(_moved(advance=13.0)))) == "advance by 3.00 mm (at most 2 mm)"
    assert detail(_step(request=_ask(_moved(right=3.0)))) == "right to 3.00 mm (-2.4 to 2.8 mm)"


def test_a_clock_that_goes_back_by_little_is_noticed_too() -> None:
    assert _reason(_step(_running(ago_s=-0.001))) is RejectReason.CLOCK_WENT_BACK


# --- holds -----------------------------------------------------------------------------------------


def test_a_hold_is_the_measured_position_not_the_last_goal() -> None:
    here = _moved(right=0.1, advance=9.6)
    step = _step(measurement=_at(here), permitted=None)
    assert step.goals_mm == here
    assert step.state.sent is None
    assert not any(step.state.speeds_mm_s)


def test_a_hold_keeps_its_first_position_so_that_a_loaded_tendon_does_not_creep() -> None:
    first = _step(measurement=_at(_moved(right=0.30)), permitted=None)
    for rest in (0.28, 0.26, -0.29):
        again = _step(first.state, measurement=_at(_moved(right=rest)), permitted=None)
        assert again.goals_mm == first.goals_mm
    dragged = _step(first.state, measurement=_at(_moved(right=-0.31)), permitted=None)  # more than a step away
    assert dragged.goals_mm == _moved(right=-0.31)


def test_a_hold_survives_a_cycle_without_positions() -> None:
    first = _step(permitted=None)
    blind = _step(first.state, measurement=_at(age_s=1.0), permitted=None)
    assert blind.goals_mm is None
    again = _step(blind.state, measurement=_at(_moved(right=0.28)), permitted=None)
    assert again.goals_mm == AT


def test_when_positions_come_back_after_a_motion_the_hold_is_where_the_joints_are_then() -> None:
    blind = _step(_running(_moved(advance=10.5)), measurement=_at(age_s=1.0))
    again = _step(blind.state, measurement=_at(_moved(advance=10.4)), permitted=None)
    assert again.goals_mm == _moved(advance=10.4)


def test_a_joint_just_outside_is_held_at_its_end() -> None:
    step = _step(measurement=_at(_moved(right=2.9, left=-2.5)), permitted=None)
    assert step.goals_mm == _moved(right=2.8, left=-2.4)
    assert _step(measurement=_at(_moved(advance=401.0)), permitted=None).goals_mm == _moved(advance=400.0)  # one whole step
    assert _step(measurement=_at(_moved(advance=401.01)), permitted=None).goals_mm is None


def test_a_hold_one_whole_step_away_is_kept() -> None:
    first = _step(permitted=None)
    assert _step(first.state, measurement=_at(_moved(advance=9.0)), permitted=None).goals_mm == AT
    assert _step(first.state, measurement=_at(_moved(advance=8.99)), permitted=None).goals_mm == _moved(advance=8.99)


# --- bumpless start --------------------------------------------------------------------------------


def test_the_first_goals_are_the_measured_positions_whatever_is_asked() -> None:
    step = _step(GateState(), _ask(_moved(right=0.6)), _at(_moved(up=0.25)))
    assert step.rejection is None
    assert step.goals_mm == _moved(up=0.25)
    assert step.clamps == (Clamp("right", 0.6, 0.3, Limit.ENTRY), Clamp("up", 0.3, 0.25, Limit.ENTRY))
    assert step.state.sent.goals_mm == step.goals_mm
    assert step.state.sent.time_s == NOW
    assert _step(GateState()).clamps == ()


def test_a_motion_that_starts_far_from_the_measured_positions_is_rejected() -> None:
    step = _step(GateState(), _ask(_moved(advance=12.1)))
    assert _reason(step) is RejectReason.OVER_RATE
    assert step.goals_mm == AT
    assert step.state.sent is None


def test_after_a_hold_a_motion_starts_anew() -> None:
    held = _step(permitted=None)
    first = _step(held.state, _ask(_moved(advance=10.1)), _at(_moved(advance=9.9)))
    assert first.goals_mm == _moved(advance=9.9)
    later = gate_step(
        first.state, GoalRequest(_moved(advance=10.1), Source.PROGRAM, NOW, NOW), _at(_moved(advance=9.9)), Source.PROGRAM,
        NOW + TICK, SERVOS, SAFETY,
    )  # fmt: skip
    assert later.goals_mm[4] == pytest.approx(9.98)  # from rest: 200 mm/s2 over 20 ms twice


# --- what is limited -------------------------------------------------------------------------------


def _limited(
    name: JointName,
    asked: float,
    *,
    last: float,
    speed: float = 0.0,
    at: float | None = None,
    ago_s: float = TICK,
    servos: ServosConfig = SERVOS,
) -> tuple[float | None, Limit | None]:
    speeds = [0.0] * 7
    speeds[_place(name)] = speed
    step = _step(
        _running(_moved(**{name: last}), speeds, ago_s),
        _ask(_moved(**{name: asked})),
        _at(_moved(**{name: last if at is None else at})),
        servos=servos,
    )
    assert step.rejection is None or step.rejection.reason is RejectReason.OFF_COURSE
    if step.rejection is not None or step.goals_mm is None:
        return None, None
    if step.clamps:
        clamp = step.clamps[0]
        assert (clamp.joint, clamp.asked_mm, clamp.allowed_mm) == (name, asked, step.goals_mm[_place(name)])
    return step.goals_mm[_place(name)], step.clamps[0].limit if step.clamps else None


@pytest.mark.parametrize(
    ("asked", "speed", "goal", "limit"),
    [
        (10.05, 0.0, 10.05, None),  # 2.5 mm/s: slower than 200 mm/s2 reach in 20 ms
        (10.08, 0.0, 10.08, None),
        (10.09, 0.0, 10.08, Limit.ACCELERATION),
        (9.91, 0.0, 9.92, Limit.ACCELERATION),
        (10.40, 10.0, 10.28, Limit.ACCELERATION),  # (10 + 4) mm/s over 20 ms
        (10.30, 20.0, 10.30, None),
        (10.50, 20.0, 10.40, Limit.RATE),
        (9.50, -20.0, 9.60, Limit.RATE),
        (9.50, 20.0, 9.92, Limit.ACCELERATION),  # a reversal starts from rest
        (10.00, 20.0, 10.00, None),  # stopping is never delayed
        (10.01, -20.0, 10.01, None),
    ],
)
def test_speed_and_acceleration(asked: float, speed: float, goal: float, limit: Limit | None) -> None:
    found, by = _limited("advance", asked, last=10.0, speed=speed)
    assert found == pytest.approx(goal)
    assert by is limit


@pytest.mark.parametrize(
    ("last", "asked", "goal", "limit"),
    [
        (397.5, 397.9, 397.9, None),  # before the margin: full speed, 0.4 mm a tick
        (397.8, 398.2, 398.05, Limit.MARGIN),  # 0.2 mm to the margin, then a quarter of the rest
        (398.0, 398.4, 398.1, Limit.MARGIN),
        (399.9, 400.0, 400.0, None),
        (399.95, 400.005, 400.0, Limit.ENVELOPE),
        (400.0, 400.0, 400.0, None),
        (399.5, 399.1, 399.1, None),  # inwards at full speed
        (-3.0, -3.4, -3.1, Limit.MARGIN),
        (-4.98, -5.005, -5.0, Limit.ENVELOPE),
        (-4.5, -4.1, -4.1, None),
    ],
)
def test_near_the_end_slowly_and_at_the_end_not_at_all(last: float, asked: float, goal: float, limit: Limit | None) -> None:
    speed = 20.0 if asked > last else -20.0
    found, by = _limited("advance", asked, last=last, speed=speed)
    assert found == pytest.approx(goal, abs=1e-9)
    assert by is limit


def test_the_end_itself_is_reached_exactly_and_never_passed() -> None:
    found, _ = _limited("advance", 400.005, last=399.93, speed=20.0)
    assert found == 400.0


@pytest.mark.parametrize(
    ("last", "asked", "at", "goal", "limit"),
    [
        (0.3, 0.5, 0.0, 0.5, None),
        (0.5, 0.7, 0.0, 0.6, Limit.STEP),  # the servo lags by half a millimetre
        (0.6, 0.8, 0.0, 0.6, Limit.STEP),  # stuck: no further than one step
        (-0.5, -0.7, 0.0, -0.6, Limit.STEP),
        (0.6, 0.6, -0.1, 0.5, Limit.STEP),  # pushed back: the goal follows
        (-0.6, -0.6, 0.1, -0.5, Limit.STEP),
        (0.6, 0.6, -0.19, 0.41, Limit.STEP),
        (0.6, 0.6, -0.21, None, None),  # further than full speed brings the goal back: off course
    ],
)
def test_never_farther_than_one_step_from_the_measured_position(
    last: float, asked: float, at: float, goal: float | None, limit: Limit | None
) -> None:
    found, by = _limited("right", asked, last=last, speed=10.0 if asked > 0 else -10.0, at=at)
    assert found == (goal if goal is None else pytest.approx(goal))
    assert by is limit


def test_a_joint_pushed_off_course_holds_where_it_is() -> None:
    here = _moved(right=-0.6)
    step = _step(_running(), _ask(), _at(here))
    assert _reason(step) is RejectReason.OFF_COURSE
    assert step.goals_mm == here
    assert step.rejection.detail == "right at -0.60 mm, sent to 0.30 mm"


def test_a_joint_a_little_outside_comes_back_inside() -> None:
    found, _ = _limited("right", 2.7, last=2.8, speed=-10.0, at=3.0)
    assert found == pytest.approx(2.7)


def test_a_long_tick_counts_as_no_more_than_a_commands_life() -> None:
    assert _limited("right", 1.2, last=0.3, speed=10.0, ago_s=0.9, at=0.8)[0] == pytest.approx(1.2)
    assert _limited("right", 1.305, last=0.3, speed=10.0, ago_s=0.9, at=0.8)[0] == pytest.approx(1.3)


def test_the_speed_is_remembered_for_the_next_tick() -> None:
    step = _step(_running(speeds=(0.0,) * 4 + (20.0, -20.0, -20.0)), _ask(_moved(advance=10.3, delivery_1=19.8, delivery_2=19.8)))
    assert step.state.speeds_mm_s == pytest.approx((0.0, 0.0, 0.0, 0.0, 15.0, -10.0, -10.0))
    assert step.state.time_s == NOW
    assert step.state.goals_mm == step.goals_mm


def test_asking_twice_at_the_same_time_moves_once_and_keeps_the_speed() -> None:
    state = _running(speeds=(0.0,) * 4 + (20.0, 0.0, 0.0), ago_s=0.0, issued_s=NOW)
    step = _step(state, _ask(_moved(advance=10.3)))
    assert step.goals_mm == AT
    assert step.state.speeds_mm_s[4] == 20.0
    assert [clamp.limit for clamp in step.clamps] == [Limit.RATE]


def test_every_clamp_of_a_tick_is_on_record() -> None:
    step = _step(request=_ask(_moved(right=0.5, advance=10.3)))
    assert step.clamps == (
        Clamp("right", 0.5, pytest.approx(0.38), Limit.ACCELERATION),
        Clamp("advance", 10.3, pytest.approx(10.08), Limit.ACCELERATION),
    )


def _delivered(
    asked_mm: tuple[float, float], last: tuple[float, float], at: tuple[float, float] | None, speed: float
) -> tuple[tuple[float, float], dict[str, Limit]]:
    """How far the two joints of the delivery catheter are sent, with the limits on record."""
    goals = _moved(delivery_1=last[0], delivery_2=last[1])
    here = _moved(delivery_1=(at or last)[0], delivery_2=(at or last)[1])
    asked = _moved(delivery_1=last[0] + asked_mm[0], delivery_2=last[1] + asked_mm[1])
    step = _step(_running(goals, speeds=(0.0,) * 5 + (speed, speed)), _ask(asked), _at(here))
    assert step.rejection is None
    moved = step.goals_mm[5] - last[0], step.goals_mm[6] - last[1]
    return moved, {clamp.joint: clamp.limit for clamp in step.clamps}


@pytest.mark.parametrize(
    ("asked", "last", "at", "moved", "limits"),
    [
        ((-0.4, -0.4), (20.0, 120.0), None, (-0.4, -0.4), {}),  # one was zeroed again: it is the same catheter all the same
        # near an end at a quarter of the speed, both, whichever of them is near it
        ((-0.4, -0.4), (-4.0, 96.0), None, (-0.1, -0.1), {"delivery_1": Limit.MARGIN, "delivery_2": Limit.TOGETHER}),
        ((-0.4, -0.4), (96.0, -4.0), None, (-0.1, -0.1), {"delivery_1": Limit.TOGETHER, "delivery_2": Limit.MARGIN}),
        ((-0.005, -0.005), (-5.0, 95.0), None, (0.0, 0.0), {"delivery_1": Limit.ENVELOPE, "delivery_2": Limit.TOGETHER}),
        ((0.4, 0.4), (-5.0, 95.0), None, (0.4, 0.4), {}),  # and away from it both go
        # one lags by 0.9 mm, or is stuck: the other waits for it
        ((-0.4, -0.4), (20.0, 20.0), (20.9, 20.0), (-0.1, -0.1), {"delivery_1": Limit.STEP, "delivery_2": Limit.TOGETHER}),
        ((-0.4, -0.4), (20.0, 20.0), (21.0, 20.0), (0.0, 0.0), {"delivery_1": Limit.STEP, "delivery_2": Limit.TOGETHER}),
        # pushed back: its goal follows it, and the other stands still
        ((-0.4, -0.4), (20.0, 20.0), (21.2, 20.0), (0.2, 0.0), {"delivery_1": Limit.STEP, "delivery_2": Limit.TOGETHER}),
        ((0.0, -0.4), (20.0, 20.0), None, (0.0, 0.0), {"delivery_2": Limit.TOGETHER}),
        ((0.3, -0.4), (20.0, 20.0), None, (0.0, 0.0), {"delivery_1": Limit.TOGETHER, "delivery_2": Limit.TOGETHER}),
    ],
)
def test_the_two_servos_of_one_catheter_share_the_tightest_limit(
    asked: tuple[float, float],
    last: tuple[float, float],
    at: tuple[float, float] | None,
    moved: tuple[float, float],
    limits: dict[str, Limit],
) -> None:
    found, by = _delivered(asked, last, at, speed=20.0 if asked[0] > 0 else -20.0)
    assert found == pytest.approx(moved, abs=1e-9)
    assert by == limits


@pytest.mark.parametrize("speed_mm_s", [-20.0, -10.0, 10.0, 20.0])
@pytest.mark.parametrize("apart_mm", [-100.0, -1.5, 1.5, 100.0])
def test_a_catheter_is_never_stretched_on_its_way_to_an_end(speed_mm_s: float, apart_mm: float) -> None:
    end, way = (-5.0, 1.0) if speed_mm_s < 0 else (400.0, -1.0)
    near, far = end + 8.0 * way, end + (8.0 + abs(apart_mm)) * way
    at = _moved(delivery_1=near, delivery_2=far) if apart_mm > 0 else _moved(delivery_1=far, delivery_2=near)
    state, now_s = GateState(NOW, at, moving=True), NOW
    for _ in range(150):
        now_s += TICK
        goals = joint_goals(Command(delivery_mm_s=speed_mm_s), state.sent, at, now_s, SERVOS, SAFETY).goals_mm
        request = GoalRequest(goals, Source.OPERATOR, now_s)
        step = gate_step(state, request, JointMeasurement(at, now_s), Source.OPERATOR, now_s, SERVOS, SAFETY)
        assert step.goals_mm[5] - step.goals_mm[6] == pytest.approx(at[5] - at[6], abs=1e-9)
        at, state = step.goals_mm, step.state
    assert min(abs(at[5] - end), abs(at[6] - end)) < 0.01


def test_a_joint_without_a_margin_is_not_slowed() -> None:
    found, limit = _limited("advance", 399.95, last=399.6, speed=20.0, servos=_with("advance", warn_margin_mm=0.0))
    assert (found, limit) == (pytest.approx(399.95), None)


def test_a_dead_host_leaves_every_joint_within_one_step_of_where_it_was() -> None:
    """Ten ticks at full request against servos that do not move at all."""
    state = _step(GateState()).state
    for tick in range(1, 11):
        goals = tuple(goal + 0.3 for goal in (state.goals_mm or AT))
        now = NOW + tick * TICK
        step = gate_step(
            state, GoalRequest(goals, Source.PROGRAM, now, now), JointMeasurement(AT, now), Source.PROGRAM, now, SERVOS, SAFETY
        )
        state = step.state
        reach = [
            abs(goal - at) <= joint.max_step_mm + 1e-9 for goal, at, joint in zip(step.goals_mm, AT, SERVOS.joints, strict=True)
        ]
        assert all(reach)
    assert [clamp.limit for clamp in step.clamps] == [Limit.STEP] * 7


# --- a feed below the low end of its envelope ------------------------------------------------------------------------------------

_BOTH = Retracted.ROBOT | Retracted.CATHETER


def _by_hand(
    at: float,
    to: float,
    *,
    retracts: bool,
    name: JointName = "advance",
    permitted: Source | None = Source.OPERATOR,
    source: Source = Source.OPERATOR,
) -> GateStep:
    """One tick of a motion that was under way at `at`, towards `to`."""
    places = _moved(**{name: at})
    state = _running(places, _moved((0.0,) * 7, **{name: math.copysign(2.0, to - at)}))
    request = GoalRequest(_moved(**{name: to}), source, NOW, NOW, _BOTH if retracts else Retracted.NONE)
    return gate_step(state, request, _at(places), permitted, NOW, SERVOS, SAFETY)


@pytest.mark.parametrize(
    ("at", "to", "retracts", "permitted", "goal", "reason"),
    [
        # within the envelope nothing has changed
        (-5.0, -5.04, False, Source.OPERATOR, -5.0, RejectReason.OUT_OF_ENVELOPE),
        (10.0, 10.2, False, Source.OPERATOR, 10.12, None),
        # a retraction that was begun at the end goes on, at 2 mm/s
        (-5.0, -5.04, True, Source.OPERATOR, -5.04, None),
        (-30.0, -30.04, True, Source.OPERATOR, -30.04, None),
        (-30.0, -30.2, True, Source.OPERATOR, -30.04, None),
        (-30.0, -30.3, True, Source.OPERATOR, -30.0, RejectReason.OVER_RATE),
        # let go, it stays; forwards it comes back, as slowly
        (-30.0, -30.0, False, Source.OPERATOR, -30.0, None),
        (-30.0, -30.04, False, Source.OPERATOR, -30.0, RejectReason.OUT_OF_ENVELOPE),
        (-30.0, -29.8, False, Source.OPERATOR, -29.96, None),
        (-30.0, -29.8, True, Source.OPERATOR, -29.96, None),
        # the program gets nowhere there; without a permission the feed stays where it is
        (-30.0, -30.04, True, Source.PROGRAM, None, RejectReason.WRONG_SOURCE),
        (-5.0, -5.04, True, Source.PROGRAM, -5.0, RejectReason.WRONG_SOURCE),
        (-30.0, -30.04, True, None, -30.0, RejectReason.NOT_ARMED),
    ],
)
def test_below_its_envelope_a_feed_goes_by_hand_only_slowly_and_held(
    at: float, to: float, retracts: bool, permitted: Source | None, goal: float | None, reason: RejectReason | None
) -> None:
    step = _by_hand(at, to, retracts=retracts, permitted=permitted)
    assert _reason(step) is reason
    assert (step.goals_mm[4] if step.goals_mm is not None else None) == (None if goal is None else pytest.approx(goal))


@pytest.mark.parametrize("at", [-5.0, -30.0])
def test_the_program_cannot_say_that_it_retracts(at: float) -> None:
    step = _by_hand(at, at - 0.04, retracts=True, permitted=Source.PROGRAM, source=Source.PROGRAM)
    assert _reason(step) in {RejectReason.OUT_OF_ENVELOPE, RejectReason.MEASURED_OUT_OF_ENVELOPE}
    assert step.goals_mm is None or step.goals_mm[4] == at


@pytest.mark.parametrize(("name", "at"), [("right", -2.4), ("down", -2.4), ("right", -3.1)])
def test_a_tendon_never_leaves_its_envelope(name: JointName, at: float) -> None:
    step = _by_hand(at, at - 0.04, retracts=True, name=name)
    assert _reason(step) in {RejectReason.OUT_OF_ENVELOPE, RejectReason.MEASURED_OUT_OF_ENVELOPE}


@pytest.mark.parametrize("at", [400.0, 403.0])
def test_the_high_end_stays_where_it_is(at: float) -> None:
    step = _by_hand(at, at + 0.04, retracts=True)
    assert _reason(step) in {RejectReason.OUT_OF_ENVELOPE, RejectReason.MEASURED_OUT_OF_ENVELOPE}


def test_a_robot_whose_insertion_is_wrong_comes_out_completely_and_stops_with_the_hand() -> None:
    """It is 35 mm in where the program says -5; the servos lag by half a step."""
    at, state, now_s = _moved(advance=-5.0), GateState(), NOW
    for tick in range(1000):
        now_s += TICK
        held = tick % 400 != 399  # a control that is let go in between
        command = Command(advance_mm_s=-20.0 if held else 0.0)
        retracts = Retracted.ROBOT if held else Retracted.NONE
        servos = by_hand(SERVOS, at, state.sent, retracts=retracts)
        request = GoalRequest(
            joint_goals(command, state.sent, at, now_s, servos, SAFETY).goals_mm, Source.OPERATOR, now_s, retracts=retracts
        )
        step = gate_step(state, request, JointMeasurement(at, now_s), Source.OPERATOR, now_s, SERVOS, SAFETY)
        assert step.rejection is None
        before, goal = state.goals_mm or at, step.goals_mm[4]
        assert 0.0 <= before[4] - goal <= 2.0 * TICK + 1e-9
        assert held or goal == before[4]
        at, state = tuple(here + 0.5 * (to - here) for here, to in zip(at, step.goals_mm, strict=True)), step.state
    assert at[4] < -5.0 - 38.0


@pytest.mark.parametrize(
    ("measurement", "reason"),
    [
        (None, RejectReason.NO_MEASUREMENT),
        (JointMeasurement(AT[:6], NOW), RejectReason.WRONG_COUNT),
        (JointMeasurement(_moved(advance=math.nan), NOW), RejectReason.NON_FINITE),
    ],
)
def test_by_hand_nothing_goes_by_positions_that_are_none(measurement: JointMeasurement | None, reason: RejectReason) -> None:
    request = GoalRequest(AT, Source.OPERATOR, NOW, None, retracts=_BOTH)
    step = gate_step(_running(), request, measurement, Source.OPERATOR, NOW, SERVOS, SAFETY)
    assert _reason(step) is reason
    assert step.goals_mm is None


def test_from_the_very_end_a_feed_comes_back_at_its_full_speed() -> None:
    at = _moved(advance=-5.0)
    assert by_hand(SERVOS, at, None, retracts=Retracted.NONE).joints[4].max_speed_mm_s == 20.0
    assert by_hand(SERVOS, _moved(advance=-5.01), None, retracts=Retracted.NONE).joints[4].max_speed_mm_s == 2.0


@pytest.mark.parametrize(("held", "pulled"), [(Retracted.ROBOT, "advance"), (Retracted.CATHETER, "delivery_1")])
def test_a_retraction_that_is_held_is_that_of_one_feed(held: Retracted, pulled: JointName) -> None:
    """The other one keeps its end and its speed."""
    at = _moved(advance=-5.0, delivery_1=-5.0, delivery_2=-5.0)
    free = [joint.name for joint in by_hand(SERVOS, at, None, retracts=held).joints if joint.low_mm == -math.inf]
    assert free == (["advance"] if pulled == "advance" else ["delivery_1", "delivery_2"])
    lower = {name: -5.04 for name in JOINT_NAMES[4:] if name not in free}
    request = GoalRequest(_moved(at, **lower), Source.OPERATOR, NOW, None, held)
    assert _reason(gate_step(_running(at), request, _at(at), Source.OPERATOR, NOW, SERVOS, SAFETY)) is RejectReason.OUT_OF_ENVELOPE


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("at_mm", [-5.02, -5.5])
def test_a_program_that_holds_a_feed_below_its_end_does_not_drive_it_in(at_mm: float, moving: bool) -> None:
    """It went in by up to a whole step, without a command."""
    at = _moved(advance=at_mm)
    state = _running(_moved(advance=-5.0)) if moving else GateState(NOW - TICK)
    for held in (None, GoalRequest(at, Source.PROGRAM, NOW - 1.0, NOW - 1.0)):  # nothing is asked for, or something too old
        step = gate_step(state, held, _at(at), Source.PROGRAM, NOW, SERVOS, SAFETY)
        assert step.is_hold
        assert step.goals_mm == at


def test_a_program_feeds_from_below_the_end_slowly_and_never_further_down() -> None:
    at, state, now_s = _moved(advance=-5.5), GateState(), NOW
    for tick in range(60):
        now_s += TICK
        command = Command(advance_mm_s=-20.0 if tick < 20 else 20.0)
        servos = by_program(SERVOS, at, state.sent)
        goals = joint_goals(command, state.sent, at, now_s, servos, SAFETY).goals_mm
        request = GoalRequest(goals, Source.PROGRAM, now_s, now_s)
        step = gate_step(state, request, JointMeasurement(at, now_s), Source.PROGRAM, now_s, SERVOS, SAFETY)
        assert step.rejection is None
        before = (state.goals_mm or at)[4]
        assert step.goals_mm[4] >= before  # the servo sags, which is no reason to follow it
        assert before >= -5.0 or step.goals_mm[4] - before <= 2.0 * TICK + 1e-9
        at, state = _moved(step.goals_mm, advance=step.goals_mm[4] - 0.1), step.state
    assert at[4] > -5.0
