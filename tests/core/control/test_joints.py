"""Command -> joint goals in mm, by hand: pretension 0.3 mm, full pull 2 mm, tendons 10 mm/s, feeds 20 mm/s."""

import math

import pytest

from core.config.safety import JointConfig, SafetyConfig, ServosConfig
from core.control.joints import JointRequest, SentGoals, joint_goals
from core.types import Command

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


def test_tendons_go_there_at_their_speed() -> None:
    assert _goals(Command(bend=1.0)).goals_mm == pytest.approx((0.5, 0.1, 0.3, 0.3, 10.0, 20.0, 20.0))


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


@pytest.mark.parametrize("bend", [-1.0, 0.0, 1.0])
def test_slack_wires_stay_inside_their_envelope_and_speed_at_every_bend(bend: float) -> None:
    goals = (-2.4, -2.3, -2.4, 0.3, 10.0, 20.0, 20.0)
    for _ in range(200):
        before, goals = goals, _goals(Command(bend=bend, pitch=bend), goals).goals_mm
        assert all(-2.4 - 1e-9 <= goal <= 2.8 + 1e-9 for goal in goals[:4])
        assert all(abs(goal - old) <= 0.2 + 1e-9 for goal, old in zip(goals[:4], before[:4], strict=True))
    assert goals[:2] == pytest.approx((0.3 + 2.0 * bend, 0.3 - 2.0 * bend))


def test_feeds_integrate_their_speed_over_the_time_since_the_last_goal() -> None:
    assert _goals(Command(advance_mm_s=5.0, delivery_mm_s=-2.0)).goals_mm[4:] == pytest.approx((10.1, 19.96, 19.96))
    assert _goals(Command(advance_mm_s=-5.0, delivery_mm_s=2.0), elapsed_s=0.05).goals_mm[4:] == pytest.approx((9.75, 20.1, 20.1))


def test_speeds_beyond_the_joints_are_limited() -> None:
    assert _goals(Command(advance_mm_s=500.0, delivery_mm_s=-500.0)).goals_mm[4:] == pytest.approx((10.4, 19.6, 19.6))


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


def test_a_time_that_is_no_number_is_not_obeyed_either() -> None:
    assert all(math.isnan(goal) for goal in _goals(Command(), elapsed_s=math.nan).goals_mm)


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


def test_arriving_exactly_at_the_end_is_no_refusal() -> None:
    assert _goals(Command(advance_mm_s=5.0), (0.3, 0.3, 0.3, 0.3, 399.9, 20.0, 20.0)).at_end == ()


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


def test_a_pretension_outside_the_envelope_leaves_the_decision_to_the_gate() -> None:
    servos = _with("right", high_mm=0.4).model_copy(update={"pretension_mm": 0.5})  # the configuration itself refuses it
    assert _settled(Command(bend=0.5), servos).goals_mm[0] == pytest.approx(0.5)
