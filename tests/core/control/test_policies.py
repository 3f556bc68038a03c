"""Advice by the paper's state table."""

import math

import pytest

from core.config.models import AdviceConfig
from core.control.policies import table_policy
from core.types import Pose, PoseState, Scene, Speed

CONFIG = AdviceConfig()


def _scene(state: PoseState, theta: float, c_head: float = 3.0, c_tail: float = 1.0) -> Scene:
    pose = Pose(abs(theta), theta, c_head, c_tail, c_head * c_tail < 0, state, 1.0)
    return Scene(0, 0.0, (640, 480), 1.0, pose=pose)


@pytest.mark.parametrize(
    ("state", "speed", "steers"),
    [
        (PoseState.A, Speed.FAST, False),
        (PoseState.B, Speed.SLOW, False),
        (PoseState.C, Speed.SLOWEST, True),
        (PoseState.D, Speed.MODERATE, True),
    ],
)
def test_the_papers_table(state: PoseState, speed: Speed, steers: bool) -> None:
    advice = table_policy(_scene(state, 20.0), CONFIG)
    assert advice.speed is speed
    assert (advice.steer_deg != 0) == steers


@pytest.mark.parametrize("theta", [20.0, -20.0])
@pytest.mark.parametrize("state", [PoseState.C, PoseState.D])
def test_the_turn_closes_theta(state: PoseState, theta: float) -> None:
    advice = table_policy(_scene(state, theta), CONFIG)
    assert math.copysign(1, advice.steer_deg) == -math.copysign(1, theta)


def test_c_steers_hardest_and_never_beyond_the_limit() -> None:
    c, d = (table_policy(_scene(state, 20.0), CONFIG) for state in (PoseState.C, PoseState.D))
    assert abs(c.steer_deg) > abs(d.steer_deg)
    extreme = table_policy(_scene(PoseState.C, 170.0), CONFIG)
    assert extreme.steer_deg == -CONFIG.max_steer_deg


def test_a_parallel_robot_that_is_off_the_line_turns_towards_it() -> None:
    advice = table_policy(_scene(PoseState.C, 0.0, c_head=9.0, c_tail=9.0), CONFIG)
    assert advice.steer_deg < 0
