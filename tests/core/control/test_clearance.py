"""Room to the wall: lumen radius, less the offset of the head's centre, less the robot's radius; warnings with hysteresis."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from core.control.clearance import BreachWatch, Clearance, Ladder, clearance_of
from core.types import Centerline, Pose, PoseState, Reason, Refusal, RobotPath, Scene

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
    assert found is not None
    assert (found.room_px, found.share) == pytest.approx((room_px, share))
    assert found.room_mm is None


@pytest.mark.parametrize(("angle_deg", "room_px"), [(30.0, 20.0 - 4.0 - 12.0 + 2.0), (90.0, 20.0 - 12.0), (-30.0, 2.0)])
def test_a_round_head_has_its_centre_one_radius_behind_its_tip(angle_deg: float, room_px: float) -> None:
    """Tip 12 px off the centerline. Pointing straight at the wall, nothing but the tip counts: 8 px of the 20 are left."""
    found = clearance_of(scene(12.0, angle_deg))
    assert found is not None
    assert found.room_px == pytest.approx(room_px)


def test_millimetres_need_a_scale() -> None:
    found = clearance_of(scene(10.0), pixels_per_mm=3.0)
    assert found is not None
    assert found.room_mm == pytest.approx(2.0)


def test_a_breach_is_more_than_an_error_of_the_picture() -> None:
    assert [Clearance(room_px, 0.0).breach for room_px in (1.0, -1.0, -3.0, -3.1)] == [False, False, False, True]


def test_a_robot_as_thick_as_the_lumen_has_no_room_and_a_finite_share() -> None:
    found = clearance_of(scene(2.0, lumen_px=4.0))
    assert found is not None
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


def test_ladder_leaps_over_a_level_in_both_directions() -> None:
    ladder = Ladder((0.85, 1.0), 0.1)
    assert [ladder.update(value) for value in (1.5, 0.1)] == [2, 0]


def test_a_limit_itself_is_not_exceeded_and_the_unknown_starts_anew() -> None:
    ladder = Ladder((0.85, 1.0), 0.1)
    assert ladder.update(1.0) == 1
    assert ladder.update(1.01) == 2
    assert ladder.update(None) == 0
    assert ladder.update(0.95) == 1, "the breach before the gap is forgotten"
