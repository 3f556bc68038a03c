"""The bench twin as a whole: lock-step and bit-equal, or alive in its own thread; its camera passes the cameras' contract."""

import time

import numpy as np
import pytest

from core.config.models import Config, TwinConfig
from core.devices import DeviceError
from core.types import Command
from hardware.rig import RigKind, open_rig
from hardware.twin.world import TwinCamera, TwinWorld


def _world(**changes: object) -> TwinWorld:
    return TwinWorld(TwinConfig(phantom="s_curve", image_width_px=320, image_height_px=240, **changes))  # type: ignore[arg-type]


def test_lock_step_is_bit_equal_for_the_same_seed_and_commands() -> None:
    runs = []
    for _ in range(2):
        world = _world(appearance_seed=3)
        camera = TwinCamera(world, lock_step=True)
        world.robot.connect()
        world.robot.send(Command(bend=0.3, advance_mm_s=10.0))
        runs.append([camera.read(0.0) for _ in range(4)])
    for first, second in zip(*runs, strict=True):
        assert first is not None
        assert second is not None
        np.testing.assert_array_equal(first.image, second.image)
        assert first.captured_s == second.captured_s
    assert [frame.index for frame in runs[0] if frame] == [0, 1, 2, 3]


def test_inserting_shows_a_robot_with_a_truth() -> None:
    world = _world()
    world.insert(60.0)
    assert 50.0 < world.physics.insertion_mm < 75.0
    truth = world.truth()
    assert truth.pose is not None
    assert truth.head_xy is not None
    picture = world.picture(world.physics.robot_points_mm())
    x, y = truth.to_source(truth.head_xy)
    near = picture.robot[max(0, round(y) - 2) : round(y) + 3, max(0, round(x) - 2) : round(x) + 3]
    assert near.any(), "the head of the truth lies at the end of the robot's mask"
    assert not picture.robot[0:2, 0:2].any()


def test_the_living_camera_gives_new_frames_and_stops() -> None:
    world = _world()
    camera = TwinCamera(world)
    camera.open()
    opened_s = time.monotonic()
    try:
        first = camera.read(10.0)
        second = camera.read(10.0)
        assert first is not None
        assert second is not None
        assert second.index > first.index
        assert second.captured_s >= first.captured_s
        assert opened_s <= second.captured_s <= time.monotonic()
    finally:
        camera.close()
    assert not camera.is_live


def test_a_broken_world_is_a_lost_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    world = _world()

    def broken(_duration_s: float) -> None:
        raise FloatingPointError("diverged")

    monkeypatch.setattr(world, "advance", broken)
    camera = TwinCamera(world)
    camera.open()
    with pytest.raises(DeviceError, match="diverged"):
        for _ in range(100):
            camera.read(0.2)
    camera.close()


def test_the_default_rig_is_simulated_and_says_so() -> None:
    rig = open_rig(Config(twin=TwinConfig(phantom="y_branch", image_width_px=320, image_height_px=240)))
    try:
        assert rig.kind is RigKind.SIM
        assert not rig.is_live
        assert rig.robot is not None
        assert rig.robot.status().insertion_mm > 20.0
        assert rig.camera.read(10.0) is not None
    finally:
        rig.close()


def test_an_unknown_phantom_is_one_clear_line() -> None:
    with pytest.raises(DeviceError, match="s_curve"):
        open_rig(Config(twin=TwinConfig(phantom="nope")))


def test_a_robot_whose_driver_falls_silent_is_held() -> None:
    world = _world()
    world.robot.connect()
    world.robot.send(Command(bend=0.4, advance_mm_s=10.0))
    world.start()
    try:
        while world.robot.command_age_s() < 1.0:
            time.sleep(0.05)
    finally:
        world.stop()
    assert world.robot.current_command == Command(bend=0.4)


def test_the_seen_tip_is_the_physical_one() -> None:
    world = _world()
    world.insert(60.0)
    truth = world.truth()
    assert truth.head_xy is not None
    seen = np.array(truth.head_xy)
    scale = 640 / 320
    physical = (world.view.project(np.array([world.physics.head_mm]))[0] + 0.5) * scale - 0.5
    # The look draws the robot with its own radius, which may differ a little from the physical one.
    assert np.hypot(*(seen - physical)) < 2.0


def test_a_target_gives_the_truth_a_route() -> None:
    world = TwinWorld(TwinConfig(phantom="y_branch"))
    world.insert(40.0)
    ends = [world.view.project(world.phantom.graph.nodes[node : node + 1])[0] for node in world.phantom.targets]
    for end in ends:
        assert world.truth((float(end[0]), float(end[1]))).pose is not None
