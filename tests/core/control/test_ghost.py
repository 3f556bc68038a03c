"""The predicted next move: where it begins, how long it is, which way it turns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from core import geometry
from core.control.clearance import predict
from core.types import Advice, Points, Pose, PoseState, Reason, Refusal, RobotPath, Scene, Speed

POSE = Pose(5.0, 5.0, 3.0, 1.0, False, PoseState.C, 0.9)
LEVEL = np.column_stack([np.arange(20.0, 101.0), np.full(81, 200.0)])
"""A robot that points to the right of the picture, its head at (100, 200)."""


def scene(points: Points = LEVEL) -> Scene:
    return Scene(0, 0.0, (640, 480), 1.0, path=RobotPath(points, 1.0, None, True, 0.0, 4.0), pose=POSE)


def advice(advance_mm_s: float, steer_deg: float = 0.0) -> Advice:
    return Advice(Speed.SLOW, advance_mm_s, steer_deg, "")


def ghost(advance_mm_s: float, steer_deg: float = 0.0, points: Points = LEVEL) -> Points:
    found = predict(scene(points), advice(advance_mm_s, steer_deg), 2.0, 3.0)
    assert found is not None
    return found


def direction_deg(first: np.ndarray, second: np.ndarray) -> float:
    return math.degrees(math.atan2(second[1] - first[1], second[0] - first[0]))


def test_straight_on_is_speed_times_horizon_times_scale_long() -> None:
    """8 mm/s for 2 s at 3 px/mm: 48 px to the right."""
    found = ghost(8.0)
    np.testing.assert_allclose(found[0], (100.0, 200.0))
    np.testing.assert_allclose(found[-1], (148.0, 200.0), atol=1e-6)


@pytest.mark.parametrize("steer_deg", [30.0, -30.0, 90.0, 170.0, -400.0])
def test_the_arc_keeps_its_length_and_has_turned_by_the_advice_at_its_end(steer_deg: float) -> None:
    """An arc of 48 px that turns by a: it ends at R (sin a, 1 - cos a) with R = 48 / a."""
    found = ghost(8.0, steer_deg)
    turn = math.radians(steer_deg)
    radius = 48.0 / turn
    np.testing.assert_allclose(found[-1], (100.0 + radius * math.sin(turn), 200.0 + radius * (1.0 - math.cos(turn))), atol=1e-6)
    assert geometry.arc_length(found)[-1] == pytest.approx(48.0, rel=0.02)


def test_positive_turns_to_the_right_on_screen() -> None:
    """The picture's y grows downwards: right of a robot that points to the right is down."""
    assert ghost(8.0, 20.0)[-1, 1] > 200.0
    assert ghost(8.0, -20.0)[-1, 1] < 200.0


def test_it_leaves_in_the_direction_of_the_robots_last_pixels() -> None:
    bent = np.vstack([np.column_stack([np.arange(0.0, 100.0), np.full(100, 200.0)]), [(100.0 + k, 200.0 + k) for k in range(41)]])
    found = ghost(8.0, points=bent)
    np.testing.assert_allclose(found[0], (140.0, 240.0))
    assert direction_deg(found[0], found[-1]) == pytest.approx(45.0, abs=0.5)


def test_backwards_it_comes_along_the_robots_own_path_whatever_the_steering() -> None:
    bent = np.array([(20.0, 100.0), (100.0, 100.0), (100.0, 110.0)])
    found = ghost(-5.0, 30.0, bent)  # 30 px: 10 up, then 20 to the left
    np.testing.assert_allclose(found, [(100.0, 110.0), (100.0, 100.0), (80.0, 100.0)])


def test_backwards_it_ends_where_the_robot_does() -> None:
    np.testing.assert_allclose(ghost(-50.0)[-1], LEVEL[0])


@pytest.mark.parametrize(("advance_mm_s", "steer_deg"), [(0.1, 0.0), (-0.1, 0.0), (0.0, 20.0)])
def test_a_slow_move_and_a_turn_in_place_are_long_enough_to_be_seen(advance_mm_s: float, steer_deg: float) -> None:
    assert geometry.arc_length(ghost(advance_mm_s, steer_deg))[-1] == pytest.approx(16.0, rel=0.02)


def test_to_stay_as_it_is_has_no_ghost() -> None:
    assert predict(scene(), advice(0.0, 0.2), 2.0, 3.0) is None


def test_without_a_pose_nothing_is_predicted() -> None:
    assert predict(replace(scene(), pose=None, refusal=Refusal(Reason.NO_ROBOT)), advice(8.0), 2.0, 3.0) is None
    assert predict(replace(scene(), path=None), advice(8.0), 2.0, 3.0) is None


@pytest.mark.parametrize("broken", [math.nan, math.inf])
def test_numbers_that_are_none_predict_nothing(broken: float) -> None:
    assert predict(scene(), advice(broken), 2.0, 3.0) is None
    assert predict(scene(), advice(8.0, broken), 2.0, 3.0) is None


def test_a_robot_too_short_to_point_anywhere_predicts_nothing() -> None:
    assert predict(scene(np.array([(100.0, 200.0), (101.0, 200.0)])), advice(8.0), 2.0, 3.0) is None
