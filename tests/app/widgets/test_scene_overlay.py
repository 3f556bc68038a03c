"""A scene as shapes in source pixels."""

from __future__ import annotations

import numpy as np
import pytest

from app.widgets.scene_overlay import Layer, OverlayBar, scene_shapes
from core.types import Pose, PoseState, RobotPath, Scene, Vector
from tests.app.widgets.conftest import Own

VESSEL = Vector((0.0, 10.0), (20.0, 10.0), (40.0, 10.0))
ROBOT = Vector((0.0, 14.0), (15.0, 27.0), (30.0, 40.0))
POSE = Pose(40.9, 40.9, 30.0, 4.0, False, PoseState.C, 0.9)


def scene(scale: float = 1.0, **parts: object) -> Scene:
    return Scene(0, 0.0, (640, 480), scale, **parts)


def test_measures_end_at_their_feet() -> None:
    shapes = scene_shapes(scene(robot_vector=ROBOT, vessel_vector=VESSEL, pose=POSE))
    assert shapes.head_foot == pytest.approx((30.0, 10.0))
    assert shapes.tail_foot == pytest.approx((0.0, 10.0))


def test_working_pixels_become_source_pixels() -> None:
    """Half scale: working pixel 0 covers source pixels 0 and 1, so its centre is at 0.5."""
    path = RobotPath(np.array([[0.0, 0.0], [10.0, 0.0]]), 1.0, None, True, 0.0, 3.0)
    shapes = scene_shapes(scene(0.5, path=path))
    assert shapes.head == pytest.approx((20.5, 0.5))
    assert shapes.robot_line is not None
    np.testing.assert_allclose(shapes.robot_line, [[0.5, 0.5], [20.5, 0.5]])


def test_lines_and_points_are_mapped_alike_where_x_and_y_differ() -> None:
    path = RobotPath(np.array([[0.0, 0.0], [9.5, 9.5]]), 1.0, None, True, 0.0, 3.0)
    shapes = scene_shapes(scene(0.5, scale_xy=(0.5, 0.4), path=path))
    assert shapes.head == pytest.approx((19.5, 24.5))
    np.testing.assert_allclose(shapes.robot_line[-1], (19.5, 24.5))


def test_arc_turns_from_the_vessel_to_the_robot_the_short_way() -> None:
    shapes = scene_shapes(scene(robot_vector=ROBOT, vessel_vector=VESSEL, pose=POSE))
    np.testing.assert_allclose(shapes.angle_arc[0], VESSEL.direction)
    np.testing.assert_allclose(shapes.angle_arc[-1], ROBOT.direction)
    back = Vector((0.0, 0.0), (-1.0, -0.1), (-2.0, -0.2))
    turned = scene_shapes(scene(robot_vector=back, vessel_vector=VESSEL, pose=POSE)).angle_arc
    assert turned[:, 1].max() <= 1e-9, "just under a half turn to the left stays above the line"


def test_without_a_pose_nothing_is_measured() -> None:
    shapes = scene_shapes(scene(robot_vector=ROBOT, vessel_vector=VESSEL))
    assert shapes.head_foot is None
    assert shapes.angle_arc is None
    assert shapes.robot_vector is not None


def test_chips_switch_their_layer(own: Own) -> None:
    bar = own(OverlayBar())
    seen: list[tuple[Layer, bool]] = []
    bar.toggled.connect(lambda layer, on: seen.append((layer, on)))
    bar.toggle(Layer.VECTORS)
    assert seen == [(Layer.VECTORS, False)]
    assert not bar.is_on(Layer.VECTORS)
    bar.set_all(True)
    assert seen[-1] == (Layer.VECTORS, True)
