"""Command -> joint goals in mm, by hand: pretension 0.3 mm, full pull 2 mm, tendons 10 mm/s, feeds 20 mm/s."""

import math
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.config.safety import JointConfig, SafetyConfig, ServosConfig
from core.control.gate import GateState, GoalRequest, JointMeasurement, Source, gate_step
from core.control.joints import JointRequest, SentGoals, joint_goals, joint_motion
from core.types import Command
from tests.core.robots import ADVANCE, ROTATION, TENDON, THREE, TURNED, robot, tendons

SERVOS, SAFETY = ServosConfig(), SafetyConfig()
REST = (0.3, 0.3, 0.3, 0.3, 10.0, 20.0, 20.0)


def _goals(
    command: Command, last_mm: tuple[float, ...] = REST, elapsed_s: float = 0.02, servos: ServosConfig = SERVOS
) -> JointRequest:
    return joint_goals(command, SentGoals(last_mm, 5.0), (99.0,) * 7, 5.0 + elapsed_s, servos, SAFETY)


def _settled(command: Command, servos: ServosConfig = SERVOS) -> JointRequest:
    """Where the tendons end up when the bend is held."""
    request = JointRequest(REST)
    for _ in range(20):
        request = _goals(command, request.goals_mm, servos=servos)
    return request


def _with(name: str, **changes: float) -> ServosConfig:
    joints = [j.model_copy(update=changes) if j.name == name else j for j in SERVOS.joints]
    return ServosConfig(joints=tuple(JointConfig.model_validate(j.model_dump()) for j in joints))


def test_the_first_goals_of_a_motion_are_the_measured_positions() -> None:
    measured = (0.1, 0.2, 0.3, 0.4, 5.0, 6.0, 7.0)
    assert joint_goals(Command(1.0, 1.0, 20.0, 20.0), None, measured, 5.0, SERVOS, SAFETY) == JointRequest(measured)


@pytest.mark.parametrize(
    ("command", "tendons"),
    [
        (Command(), (0.3, 0.3, 0.3, 0.3)),
        (Command(bend=1.0), (2.3, -1.7, 0.3, 0.3)),
        (Command(bend=-0.5), (-0.7, 1.3, 0.3, 0.3)),
        (Command(pitch=1.0), (0.3, 0.3, 2.3, -1.7)),
        (Command(bend=7.0, pitch=-7.0), (2.3, -1.7, -1.7, 2.3)),
    ],
)
def test_a_bend_pulls_one_tendon_of_the_pair_and_lets_the_other_go(command: Command, tendons: tuple[float, ...]) -> None:
    request = _settled(command)
    assert request.goals_mm[:4] == pytest.approx(tendons)
    assert request.at_end == ()


def test_wires_are_pulled_to_the_pretension_slowly_whatever_is_commanded() -> None:
    """Servos that were switched on pulled slack wires tight at full speed, without a held control."""
    slack = (-2.0, -2.0, 0.3, 0.3, 10.0, 20.0, 20.0)
    assert _goals(Command(), slack).goals_mm[:2] == pytest.approx((-1.98, -1.98))
    assert _goals(Command(bend=1.0), slack).goals_mm[:2] == pytest.approx((-1.98 + 0.18, -1.98 - 0.18))
    tight = (1.0, 1.0, 0.3, 0.3, 10.0, 20.0, 20.0)
    assert _goals(Command(), tight).goals_mm[:2] == pytest.approx((0.98, 0.98))
    goals = slack
    for cycles in (1, 50, 64):
        for _ in range(cycles):
            goals = _goals(Command(), goals).goals_mm
    assert goals[:2] == pytest.approx((0.3, 0.3))


def test_feeds_integrate_their_speed_over_the_time_since_the_last_goal() -> None:
    assert _goals(Command(advance_mm_s=5.0, delivery_mm_s=-2.0)).goals_mm[4:] == pytest.approx((10.1, 19.96, 19.96))
    assert _goals(Command(advance_mm_s=-5.0, delivery_mm_s=2.0), elapsed_s=0.05).goals_mm[4:] == pytest.approx((9.75, 20.1, 20.1))


def test_a_pause_counts_as_no_more_than_a_commands_longest_life() -> None:
    assert _goals(Command(advance_mm_s=10.0), elapsed_s=0.1).goals_mm[4] == pytest.approx(11.0)
    assert _goals(Command(advance_mm_s=10.0), elapsed_s=3.0).goals_mm[4] == pytest.approx(11.0)


def test_no_time_and_time_that_goes_back_move_nothing() -> None:
    for elapsed_s in (0.0, -1.0):
        assert _goals(Command(1.0, 1.0, 20.0, 20.0), elapsed_s=elapsed_s).goals_mm == REST


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["bend", "pitch", "advance_mm_s", "delivery_mm_s"])
def test_what_is_not_finite_comes_out_as_nan_in_all_joints_never_as_full_speed(field: str, bad: float) -> None:
    assert all(math.isnan(goal) for goal in _goals(Command(**{field: bad})).goals_mm)
    assert all(math.isnan(goal) for goal in joint_goals(Command(**{field: bad}), None, REST, 5.0, SERVOS, SAFETY).goals_mm)


def test_the_advance_stops_at_its_ends_and_says_so() -> None:
    inner = (0.3, 0.3, 0.3, 0.3, 399.95, 20.0, 20.0)
    outwards = _goals(Command(advance_mm_s=5.0), inner)
    assert outwards.goals_mm[4] == pytest.approx(400.0)
    assert outwards.at_end == ("advance",)
    assert _goals(Command(advance_mm_s=-5.0), inner).at_end == ()
    at_low = (0.3, 0.3, 0.3, 0.3, -5.0, 20.0, 20.0)
    assert _goals(Command(advance_mm_s=-5.0), at_low).goals_mm[4] == -5.0
    assert _goals(Command(advance_mm_s=-5.0), at_low).at_end == ("advance",)
    assert _goals(Command(advance_mm_s=5.0), at_low).goals_mm[4] == pytest.approx(-4.9)


def test_both_delivery_joints_stop_where_one_of_them_must() -> None:
    """They move the same catheter."""
    request = _goals(Command(delivery_mm_s=10.0), (0.3, 0.3, 0.3, 0.3, 10.0, 399.95, 20.0))
    assert request.goals_mm[5:] == pytest.approx((400.0, 20.05))
    assert request.at_end == ("delivery_1",)


def test_the_slower_delivery_joint_sets_the_speed_of_both() -> None:
    request = _goals(Command(delivery_mm_s=10.0), servos=_with("delivery_2", max_speed_mm_s=5.0))
    assert request.goals_mm[5:] == pytest.approx((20.1, 20.1))


@pytest.mark.parametrize(
    ("name", "change", "bend", "tendons"),
    [
        ("right", {"high_mm": 1.3}, 1.0, (1.3, -0.7)),  # the puller ends first
        ("left", {"low_mm": -1.2}, 1.0, (1.8, -1.2)),  # the other cannot let go further
        ("left", {"high_mm": 1.3}, -1.0, (-0.7, 1.3)),
        ("right", {"low_mm": -1.2}, -1.0, (-1.2, 1.8)),
    ],
)
def test_an_end_stops_both_tendons_of_a_pair_so_that_no_wire_hangs(
    name: str, change: dict[str, float], bend: float, tendons: tuple[float, float]
) -> None:
    request = _settled(Command(bend=bend), _with(name, **change))
    assert request.goals_mm[:2] == pytest.approx(tendons)
    assert request.at_end == ("right", "left")


def test_a_pretension_outside_the_envelope_pulls_nothing_out_of_it() -> None:
    servos = _with("right", high_mm=0.4).model_copy(update={"pretension_mm": 0.5})  # the configuration itself refuses it
    assert _settled(Command(bend=0.5), servos).goals_mm[0] == pytest.approx(0.4)


# --- robots of other shapes ------------------------------------------------------------------------


def _driven(command: Command, servos: ServosConfig, seconds: float = 3.2) -> tuple[float, ...]:
    """Where the joints of a straight robot at its pretension end up; speed and envelope hold in every step."""
    goals: tuple[float, ...] = tuple(0.3 if joint.is_tendon else 0.0 for joint in servos.joints)
    for _ in range(round(seconds / 0.02)):
        before, request = goals, joint_goals(command, SentGoals(goals, 5.0), goals, 5.02, servos, SAFETY)
        goals = request.goals_mm
        for joint, old, new in zip(servos.joints, before, goals, strict=True):
            assert joint.low_mm - 1e-9 <= new <= joint.high_mm + 1e-9
            assert abs(new - old) <= 0.02 * joint.max_speed_mm_s + 1e-9
    return goals


@pytest.mark.parametrize("servos", [THREE, TURNED, SERVOS], ids=["three", "two and rotation", "four"])
@pytest.mark.parametrize(("bend", "pitch"), [(0.5, 0.0), (-0.8, 0.0), (0.0, 0.6), (0.4, -0.4), (-0.3, -0.5), (0.0, 0.0)])
def test_every_shape_bends_the_head_where_it_is_commanded(servos: ServosConfig, bend: float, pitch: float) -> None:
    goals = _driven(Command(bend, pitch), servos)
    motion = joint_motion(goals, (0.0,) * len(goals), servos)
    assert (motion.bend, motion.pitch) == pytest.approx((bend, pitch), abs=1e-6)
    count = len(servos.tendons)
    assert sum(goals[:count]) == pytest.approx(0.3 * count), "the pretension stays"


def test_three_tendons_share_a_bend_by_their_directions() -> None:
    up, left, right = _driven(Command(bend=1.0), THREE)[:3]
    assert (up, left, right) == pytest.approx((0.3, 0.3 - 2.0 * math.cos(math.pi / 6), 0.3 + 2.0 * math.cos(math.pi / 6)))


def test_one_end_stops_all_three_tendons_in_the_bends_direction() -> None:
    short = robot(*tendons(90.0, 210.0, 330.0), ADVANCE)
    joints = tuple(one.model_copy(update={"high_mm": 1.3} if one.name == "tendon_3" else {}) for one in short.joints)
    short = short.model_copy(update={"joints": joints})
    goals = _driven(Command(bend=1.0), short)
    assert goals[2] == pytest.approx(1.3)
    motion = joint_motion(goals, (0.0,) * len(goals), short)
    assert motion.pitch == pytest.approx(0.0, abs=1e-9)
    assert motion.bend == pytest.approx(1.0 / (2.0 * math.cos(math.pi / 6)))


@pytest.mark.parametrize("servos", [SERVOS, THREE], ids=["four", "three"])
def test_a_tendon_at_its_end_is_not_pulled_on_by_the_pretension_while_the_others_turn_the_bend(servos: ServosConfig) -> None:
    """The gate would reject it, and a command that is held would move nothing any more."""
    joints = tuple(joint.model_copy(update={"high_mm": 1.2}) if joint.is_tendon else joint for joint in servos.joints)
    servos = servos.model_copy(update={"joints": joints})
    at: tuple[float, ...] = (0.0,) * len(joints)
    for command in (Command(pitch=1.0), Command(bend=0.9, pitch=1.0)):
        for _ in range(10):
            at = joint_goals(command, SentGoals(at, 0.0), at, 0.02, servos, SAFETY).goals_mm
            assert all(joint.low_mm <= goal <= joint.high_mm + 1e-9 for joint, goal in zip(joints, at, strict=True))


def test_two_tendons_bend_only_as_far_as_the_shaft_is_turned_into_the_plane() -> None:
    first = joint_goals(Command(bend=0.5), SentGoals((0.3, 0.3, 0.0, 0.0), 5.0), (0.3, 0.3, 0.0, 0.0), 5.02, TURNED, SAFETY)
    assert abs(first.goals_mm[3]) == pytest.approx(1.2), "60 degrees a second"
    assert abs(first.goals_mm[0] - 0.3) < 0.05, "its plane is still across the picture"
    goals = _driven(Command(bend=0.5), TURNED)
    assert abs(goals[3]) == pytest.approx(90.0)
    assert abs(goals[0] - goals[1]) == pytest.approx(2.0)


def test_a_shaft_at_its_end_is_turned_the_other_way_round() -> None:
    at = (0.3, 0.3, 0.0, 195.0)
    angle = math.radians(195.0 + 90.0 + 40.0)  # the plane is 40 degrees further than the shaft is now
    command = Command(bend=0.5 * math.cos(angle), pitch=0.5 * math.sin(angle))
    assert joint_goals(command, SentGoals(at, 5.0), at, 5.02, TURNED, SAFETY).goals_mm[3] == pytest.approx(195.0 - 1.2)


def test_a_turned_shaft_of_four_tendons_keeps_the_bend() -> None:
    names = [{**TENDON, "name": name} for name in ("right", "left", "up", "down")]
    servos = robot(*names, ADVANCE, ROTATION)
    goals = _driven(Command(bend=0.5, rotation_deg_s=30.0), servos, seconds=3.0)
    assert goals[-1] == pytest.approx(90.0)
    assert goals[:4] == pytest.approx((0.3, 0.3, 0.3 - 1.0, 0.3 + 1.0), abs=0.03)
    motion = joint_motion(goals, (*(0.0,) * 5, 30.0), servos)
    assert (motion.bend, motion.pitch, motion.rotation_deg_s) == pytest.approx((0.5, 0.0, 30.0), abs=0.02)


def test_a_small_bend_turns_nothing() -> None:
    assert _driven(Command(bend=0.01), TURNED)[3] == 0.0


@pytest.mark.parametrize(
    ("joints", "problem"),
    [
        ((*tendons(0.0), ADVANCE), "1 tendons; a robot has 2, 3 or 4"),
        ((ADVANCE, *tendons(0.0, 180.0)), "their order must be tendon, advance, delivery, rotation"),
        ((*tendons(0.0, 90.0), ADVANCE), "angle_deg must be evenly spaced, in the order 0, 180"),
        ((*tendons(0.0, 120.0, 230.0), ADVANCE), "in the order 0, 120, 240 from the first"),
        ((*tendons(0.0, 180.0), ADVANCE, {**ADVANCE, "name": "other", "kind": "advance"}), "there may be one advance only"),
        ((*tendons(0.0, 180.0), {**ADVANCE, "name": "tendon_1", "kind": "advance"}), "two have the same name"),
        (({**TENDON, "name": "one"}, *tendons(180.0), ADVANCE), "joint one: a tendon needs angle_deg"),
        (({**ADVANCE, "name": "odd"}, *tendons(0.0, 180.0)), "kind"),
        (tendons(0.0), "at least 2"),
        ((*tendons(0.0, 180.0), *({**ADVANCE, "name": f"delivery_{n}"} for n in range(11))), "at most 12"),
    ],
)
def test_joints_that_make_no_robot_are_refused_in_one_line(joints: list[dict[str, Any]], problem: str) -> None:
    with pytest.raises(ValueError, match=re.escape(problem)):
        robot(*joints)


def test_joints_of_older_files_get_their_kind_and_a_rotation_has_units_of_its_own() -> None:
    plain = [joint.model_dump(mode="json", exclude={"kind", "angle_deg"}) for joint in SERVOS.joints]
    assert ServosConfig.model_validate({"joints": plain}) == SERVOS
    assert [joint.kind.value for joint in SERVOS.joints] == ["tendon"] * 4 + ["advance", "delivery", "delivery"]
    said = TURNED.joints[3].model_dump(mode="json")
    assert (said["low_deg"], said["max_speed_deg_s"], said["max_torque_nmm"], said["deg_per_turn"]) == (-200.0, 60.0, 80.0, 360.0)
    assert not any("_mm" in key for key in said if key != "max_torque_nmm")
    assert ServosConfig.model_validate(TURNED.model_dump()) == TURNED
    limit = TURNED.force_limit(TURNED.joints[3])
    assert 60.0 < limit.force_n <= 80.0, "N mm, by whole mA"
    assert not limit.is_weak
    assert limit.speed_mm_s == pytest.approx(104.0 * 6.0), "degrees a second, at 104 turns a minute"
    assert TURNED.astray_mm(TURNED.joints[3]) == 15.0


@pytest.mark.parametrize("servos", [THREE, TURNED], ids=["three", "two and rotation"])
def test_the_gate_takes_the_joints_of_every_shape(servos: ServosConfig) -> None:
    count, now_s = len(servos.joints), 100.0
    at = tuple(0.3 if joint.is_tendon else 0.0 for joint in servos.joints)
    state = GateState()
    for turn in range(50):
        now_s = 100.0 + 0.02 * turn
        wanted = joint_goals(Command(bend=0.5, advance_mm_s=5.0), state.sent, at, now_s, servos, SAFETY)
        request = GoalRequest(wanted.goals_mm, Source.OPERATOR, now_s)
        step = gate_step(state, request, JointMeasurement(at, now_s), Source.OPERATOR, now_s, servos, SAFETY)
        assert step.rejection is None
        state, at = step.state, step.goals_mm or at
    motion = joint_motion(at, state.speeds_mm_s, servos)
    assert motion.advance_mm_s == pytest.approx(5.0)
    assert motion.bend > 0.2
    wrong = gate_step(
        state, GoalRequest((0.3,) * 7, Source.OPERATOR, now_s), JointMeasurement(at, now_s), Source.OPERATOR, now_s, servos, SAFETY
    )
    assert wrong.rejection.detail == f"7 instead of {count}"


_SHARE = st.floats(-1.5, 1.5)


@pytest.mark.parametrize("servos", [THREE, TURNED], ids=["three", "two and rotation"])
@given(st.lists(st.tuples(_SHARE, _SHARE, st.floats(-40.0, 40.0), st.floats(-100.0, 100.0), st.floats(0.0, 0.12)), max_size=12))
def test_no_commands_lead_out_of_the_limits_and_the_gate_rejects_none_of_them(
    servos: ServosConfig, commands: list[tuple[float, float, float, float, float]]
) -> None:
    now_s, state = 100.0, GateState()
    at: tuple[float, ...] = tuple(0.3 if joint.is_tendon else 0.0 for joint in servos.joints)
    for bend, pitch, speed, turn, pause_s in commands:
        for _ in range(3):
            now_s += max(0.001, pause_s)
            command = Command(bend, pitch, speed, speed, turn)
            wanted = joint_goals(command, state.sent, at, now_s, servos, SAFETY)
            before = state.sent
            request = GoalRequest(wanted.goals_mm, Source.OPERATOR, now_s)
            step = gate_step(state, request, JointMeasurement(at, now_s), Source.OPERATOR, now_s, servos, SAFETY)
            assert step.rejection is None, step.rejection
            for joint, goal, here in zip(servos.joints, step.goals_mm, at, strict=True):
                assert joint.low_mm - 1e-9 <= goal <= joint.high_mm + 1e-9
                assert abs(goal - here) <= joint.max_step_mm + 1e-9
            if before is not None:
                for joint, old, goal in zip(servos.joints, before.goals_mm, step.goals_mm, strict=True):
                    assert abs(goal - old) <= joint.max_speed_mm_s * min(pause_s + 0.001, 0.1) + 1e-9
            state, at = step.state, step.goals_mm
