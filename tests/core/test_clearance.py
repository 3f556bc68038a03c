"""Room to the wall: lumen radius, less the head's offset, less the robot's radius; warnings with hysteresis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.control.clearance import Ladder, clearance_of
from core.types import Centerline, Pose, PoseState, Reason, Refusal, RobotPath, Scene

POSE = Pose(5.0, 5.0, 3.0, 1.0, False, PoseState.C, 0.9)


def scene(offset_px: float, lumen_px: float = 20.0, robot_px: float = 4.0) -> Scene:
    """A robot that lies beside a level centerline, `offset_px` below it."""
    path = RobotPath(np.array([(10.0, 100.0), (100.0, 100.0 + offset_px)]), 1.0, None, True, 0.0, robot_px)
    line = Centerline(np.array([(50.0, 100.0), (150.0, 100.0)]), (100.0, 100.0), lumen_px)
    return Scene(0, 0.0, (640, 480), 1.0, path=path, centerline=line, pose=POSE)


@pytest.mark.parametrize(
    ("offset_px", "room_px", "share", "breach"),
    [(0.0, 16.0, 1.0, False), (12.0, 4.0, 0.25, False), (16.0, 0.0, 0.0, False), (-20.0, -4.0, -0.25, True)],
)
def test_room_is_counted_from_the_edge_of_the_robot_to_the_wall(
    offset_px: float, room_px: float, share: float, breach: bool
) -> None:
    found = clearance_of(scene(offset_px))
    assert found is not None
    assert (found.room_px, found.share) == pytest.approx((room_px, share))
    assert found.breach is breach
    assert found.room_mm is None


def test_millimetres_need_a_scale() -> None:
    found = clearance_of(scene(10.0), pixels_per_mm=3.0)
    assert found is not None
    assert found.room_mm == pytest.approx(2.0)


def test_the_offset_is_the_distance_from_the_nearest_point_in_any_direction() -> None:
    moved = scene(0.0)
    assert moved.centerline is not None
    found = clearance_of(replace(moved, centerline=replace(moved.centerline, nearest=(97.0, 96.0))))
    assert found is not None
    assert found.room_px == pytest.approx(16.0 - 5.0)


def test_a_robot_as_thick_as_the_lumen_has_no_room_and_a_finite_share() -> None:
    found = clearance_of(scene(2.0, lumen_px=4.0))
    assert found is not None
    assert (found.room_px, found.share) == pytest.approx((-2.0, -2.0))


def test_without_a_pose_nothing_is_known() -> None:
    assert clearance_of(replace(scene(0.0), pose=None, refusal=Refusal(Reason.OUTSIDE_VESSEL))) is None
    assert clearance_of(replace(scene(0.0), centerline=None)) is None
    assert clearance_of(replace(scene(0.0), path=None)) is None


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
