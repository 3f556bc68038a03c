"""Commands from advice and from held controls."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.config.models import DriveConfig, JogConfig
from core.config.safety import ServosConfig
from core.control.motion import (
    AdviceController,
    Jog,
    JogIntegrator,
    JogSpeeds,
    Retraction,
    combined,
    hand_speeds,
    next_retraction,
    within_robot,
)
from core.types import Advice, Command, Speed
from tests.core.robots import THREE, TURNED

PLAIN = DriveConfig(
    turn_deg=100.0, proportional=0.0, integral_s=0.5, max_bend_rate_per_s=10.0, max_acceleration_mm_s2=1000.0, max_gap_s=0.1
)


def _advice(steer_deg: float = 0.0, advance_mm_s: float = 5.0) -> Advice:
    return Advice(Speed.MODERATE, advance_mm_s, steer_deg, "test")


def test_the_first_command_moves_nothing() -> None:
    assert AdviceController(PLAIN, bend=0.3).command(_advice(40.0), 7.0) == Command(bend=0.3, advance_mm_s=0.0)


def test_an_advised_turn_is_made_in_the_integral_time() -> None:
    drive = AdviceController(PLAIN)
    bends = [drive.command(_advice(20.0), 0.1 * step).bend for step in range(6)]
    # 20 of 100 degrees are a bend of 0.2; it is made in 0.5 s, in steps of 0.1 s
    assert bends == pytest.approx([0.0, 0.04, 0.08, 0.12, 0.16, 0.2])


def test_without_steering_the_bend_stays() -> None:
    drive = AdviceController(PLAIN, bend=-0.4)
    assert [drive.command(_advice(0.0), 0.1 * step).bend for step in range(3)] == [-0.4] * 3


def test_the_proportional_share_acts_at_once_and_goes_with_the_error() -> None:
    drive = AdviceController(PLAIN.model_copy(update={"proportional": 0.5, "integral_s": 60.0}))
    drive.command(_advice(20.0), 0.0)
    assert drive.command(_advice(20.0), 0.1).bend == pytest.approx(0.1, abs=1e-3)
    assert drive.command(_advice(0.0), 0.2).bend == pytest.approx(0.0, abs=1e-3)


def test_at_the_end_of_its_range_the_bend_does_not_wind_up() -> None:
    drive = AdviceController(PLAIN, bend=0.95)
    for step in range(50):
        drive.command(_advice(90.0), 0.1 * step)
    assert drive.command(_advice(-10.0), 5.0).bend < 1.0  # the very next command for the other side acts


def test_without_advice_the_feed_stops_at_once_and_the_bend_is_kept() -> None:
    drive = AdviceController(PLAIN)
    for step in range(3):
        moving = drive.command(_advice(20.0), 0.1 * step)
    assert moving.advance_mm_s == 5.0
    assert drive.command(None, 0.3) == Command(bend=moving.bend, advance_mm_s=0.0)


def test_the_feed_speeds_up_gradually_and_stops_at_once() -> None:
    drive = AdviceController(PLAIN.model_copy(update={"max_acceleration_mm_s2": 20.0}))
    speeds = [drive.command(_advice(0.0, 5.0), 0.1 * step).advance_mm_s for step in range(4)]
    assert speeds == pytest.approx([0.0, 2.0, 4.0, 5.0])
    assert drive.command(_advice(0.0, 0.0), 0.4).advance_mm_s == 0.0


def test_a_reversal_starts_from_rest() -> None:
    drive = AdviceController(PLAIN.model_copy(update={"max_acceleration_mm_s2": 20.0}))
    for step in range(5):
        drive.command(_advice(0.0, 5.0), 0.1 * step)
    assert drive.command(_advice(0.0, -3.0), 0.5).advance_mm_s == pytest.approx(-2.0)


def test_taking_over_forgets_what_was_driven_before() -> None:
    drive = AdviceController(PLAIN)
    for step in range(4):
        drive.command(_advice(40.0), 0.1 * step)
    drive.take_over(-0.2)
    assert drive.command(_advice(40.0), 0.4) == Command(bend=-0.2)


@given(
    st.lists(
        st.tuples(st.one_of(st.none(), st.floats(-180, 180)), st.floats(-50, 50), st.floats(0.0, 1.0)), min_size=1, max_size=60
    )
)
def test_every_command_is_finite_in_range_and_within_its_rate(turns: list[tuple[float | None, float, float]]) -> None:
    config = DriveConfig()
    drive, now_s, before = AdviceController(config), 0.0, Command()
    for steer, advance_mm_s, wait_s in turns:
        now_s += wait_s
        command = drive.command(None if steer is None else _advice(steer, advance_mm_s), now_s)
        assert math.isfinite(command.bend) and abs(command.bend) <= 1.0
        assert abs(command.bend - before.bend) <= config.max_bend_rate_per_s * min(wait_s, config.max_gap_s) + 1e-9
        assert abs(command.advance_mm_s) <= (0.0 if steer is None else abs(advance_mm_s))
        before = command


HAND = JogConfig(bend_rate_per_s=1.5, advance_mm_s=10.0, delivery_mm_s=5.0)


def servos(**slow_mm_s: float) -> ServosConfig:
    """Some joints may go no faster than that."""
    plain = ServosConfig(max_pull_mm=2.0)
    joints = (
        joint.model_copy(update={"max_speed_mm_s": slow_mm_s.get(joint.name, joint.max_speed_mm_s)}) for joint in plain.joints
    )
    return plain.model_copy(update={"joints": tuple(joints)})


def test_a_rate_of_bend_is_a_pull_of_the_wires() -> None:
    assert hand_speeds(HAND, servos()) == JogSpeeds(advance_mm_s=10.0, delivery_mm_s=5.0, bend_mm_s=3.0, pitch_mm_s=3.0)


def test_a_share_of_full_speed_is_of_all() -> None:
    assert hand_speeds(HAND, servos(), 0.5) == JogSpeeds(advance_mm_s=5.0, delivery_mm_s=2.5, bend_mm_s=1.5, pitch_mm_s=1.5)


def test_the_slowest_joint_that_takes_part_holds_the_others_back() -> None:
    slow = servos(advance=4.0, delivery_2=2.0, left=1.0)
    assert hand_speeds(HAND, slow) == JogSpeeds(advance_mm_s=4.0, delivery_mm_s=2.0, bend_mm_s=1.0, pitch_mm_s=3.0)
    assert hand_speeds(HAND, slow, 0.25) == JogSpeeds(advance_mm_s=2.5, delivery_mm_s=1.25, bend_mm_s=0.75, pitch_mm_s=0.75)


REST, WITHIN, BEYOND = Retraction.REST, Retraction.WITHIN, Retraction.BEYOND


@pytest.mark.parametrize(
    ("state", "pulls", "at_low", "then"),
    [
        (REST, False, False, REST),
        (REST, False, True, REST),
        (REST, True, False, WITHIN),
        (REST, True, True, BEYOND),
        (WITHIN, False, False, REST),
        (WITHIN, False, True, REST),
        (WITHIN, True, False, WITHIN),
        (WITHIN, True, True, WITHIN),  # it arrives at the end: only another pull goes on
        (BEYOND, False, False, REST),
        (BEYOND, False, True, REST),
        (BEYOND, True, False, BEYOND),  # its goal is not known for a moment
        (BEYOND, True, True, BEYOND),
    ],
)
def test_only_a_pull_that_begins_at_the_end_goes_beyond_it(state: Retraction, pulls: bool, at_low: bool, then: Retraction) -> None:
    assert next_retraction(state, pulls=pulls, at_low=at_low) is then


def test_until_the_robot_was_seen_to_follow_bend_and_feed_are_slow() -> None:
    drive = DriveConfig(turn_deg=50.0)
    fast = Advice(Speed.FAST, -8.0, 40.0, "")
    for turns, feeds, bend, feed in ((False, False, 0.02, -3.0), (True, False, 0.15, -3.0), (False, True, 0.02, -8.0)):
        controller = AdviceController(drive)
        for step in range(40):
            now_s = 0.1 * step
            command = controller.command(fast, now_s, turns=turns, feeds=feeds)
            if step == 1:
                assert command.bend == pytest.approx(bend), "10 degrees a second"
        assert command.advance_mm_s == feed


def test_a_held_rotation_is_a_speed() -> None:
    integrator = JogIntegrator(HAND)
    command = integrator.command(Jog(rotation=-0.5), 5.0)
    assert command.rotation_deg_s == -0.5 * HAND.rotation_deg_s
    assert combined([Jog(rotation=0.8), Jog(rotation=0.8)]).rotation == 1.0


def test_controls_of_motions_that_the_robot_does_not_have_are_no_input() -> None:
    jog = Jog(bend=0.1, pitch=0.2, advance=0.3, delivery=0.4, rotation=0.5)
    assert within_robot(jog, ServosConfig()) == replace(jog, rotation=0.0)
    assert within_robot(jog, TURNED) == replace(jog, delivery=0.0, rotation=0.0), "two tendons turn with the bend"
    assert within_robot(Jog(rotation=1.0), THREE).is_rest
    flat = TURNED.model_copy(update={"joints": TURNED.joints[:2]})
    assert within_robot(jog, flat) == Jog(bend=0.1)
