"""Clearance to the wall, and the prediction of the head's path."""

import math
from dataclasses import replace

import numpy as np
import pytest

from core import geometry
from core.control.clearance import BreachWatch, Clearance, Ladder, clearance_of, predict
from core.types import Advice, Centerline, Points, Pose, PoseState, Reason, Refusal, RobotPath, Scene, Speed

POSE = Pose(5.0, 5.0, 3.0, 1.0, False, PoseState.C, 0.9)


def scene(offset_px: float, angle_deg: float = 0.0, lumen_px: float = 20.0, robot_px: float = 4.0) -> Scene:
    """A robot over a level centerline at y = 100; its tip is `offset_px` below it, and it points down by `angle_deg`."""
    way = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    points = np.array([100.0, 100.0 + offset_px]) - np.arange(60.0, -1.0, -2.0)[:, None] * way
    path = RobotPath(points, 1.0, None, True, 0.0, robot_px)
    line = Centerline(np.array([(50.0, 100.0), (150.0, 100.0)]), (100.0, 100.0), lumen_px)
    return Scene(0, 0.0, (640, 480), 1.0, path=path, centerline=line, pose=POSE)


@pytest.mark.parametrize(
    ("offset_px", "room_px", "share"), [(0.0, 16.0, 1.0), (12.0, 4.0, 0.25), (16.0, 0.0, 0.0), (-20.0, -4.0, -0.25)]
)
def test_room_is_counted_from_the_edge_of_the_robot_to_the_wall(offset_px: float, room_px: float, share: float) -> None:
    found = clearance_of(scene(offset_px))
    assert (found.room_px, found.share) == pytest.approx((room_px, share))
    assert found.room_mm is None


@pytest.mark.parametrize(("angle_deg", "room_px"), [(30.0, 20.0 - 4.0 - 12.0 + 2.0), (90.0, 20.0 - 12.0), (-30.0, 2.0)])
def test_a_round_head_has_its_centre_one_radius_behind_its_tip(angle_deg: float, room_px: float) -> None:
    """Tip 12 px off the centerline. Pointing straight at the wall, nothing but the tip counts: 8 px of the 20 are left."""
    found = clearance_of(scene(12.0, angle_deg))
    assert found.room_px == pytest.approx(room_px)


def test_millimetres_need_a_scale() -> None:
    found = clearance_of(scene(10.0), pixels_per_mm=3.0)
    assert found.room_mm == pytest.approx(2.0)


def test_a_robot_as_thick_as_the_lumen_has_no_room_and_a_finite_share() -> None:
    found = clearance_of(scene(2.0, lumen_px=4.0))
    assert (found.room_px, found.share) == pytest.approx((-2.0, -2.0))


def test_without_a_pose_nothing_is_known() -> None:
    assert clearance_of(replace(scene(0.0), pose=None, refusal=Refusal(Reason.OUTSIDE_VESSEL))) is None
    assert clearance_of(replace(scene(0.0), centerline=None)) is None
    assert clearance_of(replace(scene(0.0), path=None)) is None


def told(*rooms_px: float | None, period_s: float = 0.1) -> list[bool]:
    watch = BreachWatch()
    return [watch.update(None if px is None else Clearance(px, 0.0), k * period_s) for k, px in enumerate(rooms_px)]


def test_a_breach_is_told_after_it_has_lasted() -> None:
    assert told(-4.0, -4.0, -4.0, -4.0) == [False, False, True, True]
    assert told(-9.0, 5.0, -9.0, -9.0, 5.0) == [False] * 5, "a head that was found too far ahead for a moment"


def test_a_breach_is_over_when_the_head_is_clearly_out_again() -> None:
    assert told(-4.0, -4.0, -4.0, -2.5, -1.6, -1.4, -2.5) == [False, False, True, True, True, False, False]


def test_the_unknown_and_a_clock_that_went_back_begin_anew() -> None:
    assert told(-4.0, -4.0, -4.0, None, -4.0, -4.0, -4.0) == [False, False, True, False, False, False, True]
    watch = BreachWatch()
    assert [watch.update(Clearance(-4.0, 0.0), time_s) for time_s in (50.0, 1.0, 1.1, 1.3)] == [False, False, False, True]


def test_ladder_climbs_at_once_and_comes_down_below_the_band() -> None:
    ladder = Ladder((0.85, 1.0), 0.1)
    seen = [ladder.update(value) for value in (0.5, 0.86, 0.84, 0.80, 0.76, 0.74, 1.2, 0.95, 0.91, 0.89, 0.70)]
    assert seen == [0, 1, 1, 1, 1, 0, 2, 2, 2, 1, 0]


LEVEL = np.column_stack([np.arange(20.0, 101.0), np.full(81, 200.0)])
"""A robot that points to the right of the picture, its head at (100, 200)."""


def robot_scene(points: Points = LEVEL) -> Scene:
    return Scene(0, 0.0, (640, 480), 1.0, path=RobotPath(points, 1.0, None, True, 0.0, 4.0), pose=POSE)


def advice(advance_mm_s: float, steer_deg: float = 0.0) -> Advice:
    return Advice(Speed.SLOW, advance_mm_s, steer_deg, "")


def predicted(advance_mm_s: float, steer_deg: float = 0.0, points: Points = LEVEL) -> Points:
    return predict(robot_scene(points), advice(advance_mm_s, steer_deg), 2.0, 3.0)


def direction_deg(first: np.ndarray, second: np.ndarray) -> float:
    return math.degrees(math.atan2(second[1] - first[1], second[0] - first[0]))


def test_straight_on_is_speed_times_horizon_times_scale_long() -> None:
    """8 mm/s for 2 s at 3 px/mm: 48 px to the right."""
    found = predicted(8.0)
    np.testing.assert_allclose(found[0], (100.0, 200.0))
    np.testing.assert_allclose(found[-1], (148.0, 200.0), atol=1e-6)


@pytest.mark.parametrize("steer_deg", [30.0, -30.0, 90.0, 170.0, -400.0])
def test_the_arc_keeps_its_length_and_has_turned_by_the_advice_at_its_end(steer_deg: float) -> None:
    """An arc of 48 px that turns by a: it ends at R (sin a, 1 - cos a) with R = 48 / a."""
    found = predicted(8.0, steer_deg)
    turn = math.radians(steer_deg)
    radius = 48.0 / turn
    np.testing.assert_allclose(found[-1], (100.0 + radius * math.sin(turn), 200.0 + radius * (1.0 - math.cos(turn))), atol=1e-6)
    assert geometry.arc_length(found)[-1] == pytest.approx(48.0, rel=0.02)


def test_positive_turns_to_the_right_on_screen() -> None:
    """The picture's y grows downwards: right of a robot that points to the right is down."""
    assert predicted(8.0, 20.0)[-1, 1] > 200.0
    assert predicted(8.0, -20.0)[-1, 1] < 200.0


def test_it_leaves_in_the_direction_of_the_robots_last_pixels() -> None:
    bent = np.vstack([np.column_stack([np.arange(0.0, 100.0), np.full(100, 200.0)]), [(100.0 + k, 200.0 + k) for k in range(41)]])
    found = predicted(8.0, points=bent)
    np.testing.assert_allclose(found[0], (140.0, 240.0))
    assert direction_deg(found[0], found[-1]) == pytest.approx(45.0, abs=0.5)


def test_backwards_it_comes_along_the_robots_own_path_whatever_the_steering() -> None:
    bent = np.array([(20.0, 100.0), (100.0, 100.0), (100.0, 110.0)])
    found = predicted(-5.0, 30.0, bent)  # 30 px: 10 up, then 20 to the left
    np.testing.assert_allclose(found, [(100.0, 110.0), (100.0, 100.0), (80.0, 100.0)])


def test_a_robot_too_short_to_point_anywhere_predicts_nothing() -> None:
    assert predict(robot_scene(np.array([(100.0, 200.0), (101.0, 200.0)])), advice(8.0), 2.0, 3.0) is None
