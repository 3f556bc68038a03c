"""The bench twin as a whole, in lock-step (bit-equal) and in real time, with its camera."""

import math
import time

import numpy as np
import pytest

from core.config.models import TwinConfig
from core.devices import DeviceError
from core.types import Command
from hardware.twin.world import MAX_ADVANCE_MM_S, MAX_DELIVERY_MM_S, TwinCamera, TwinWorld


def _world(**changes: object) -> TwinWorld:
    return TwinWorld(TwinConfig(phantom="s_curve", image_width_px=320, image_height_px=240, **changes))


def test_lock_step_is_bit_equal_for_the_same_seed_and_commands() -> None:
    runs = []
    for _ in range(2):
        world = _world(appearance_seed=3)
        camera = TwinCamera(world, lock_step=True)
        world.send(Command(bend=0.3, advance_mm_s=10.0))
        runs.append([camera.read(0.0) for _ in range(4)])
    for first, second in zip(*runs, strict=True):
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


@pytest.mark.real_time
def test_the_real_time_camera_gives_new_frames_and_stops() -> None:
    world = _world()
    camera = TwinCamera(world)
    camera.open()
    opened_s = time.monotonic()
    try:
        first = camera.read(10.0)
        second = camera.read(10.0)
        assert second.index > first.index
        assert second.captured_s >= first.captured_s
        assert opened_s <= second.captured_s <= time.monotonic()
    finally:
        camera.close()


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


@pytest.mark.parametrize(
    ("asked", "sent"),
    [
        (Command(0.3, -0.2, 5.0, -1.0), Command(0.3, -0.2, 5.0, -1.0)),
        (Command(bend=3.0), Command(bend=1.0)),
        (Command(bend=-1.001, pitch=2.0), Command(bend=-1.0, pitch=1.0)),
        (Command(advance_mm_s=1e9), Command(advance_mm_s=MAX_ADVANCE_MM_S)),
        (Command(advance_mm_s=-1e9), Command(advance_mm_s=-MAX_ADVANCE_MM_S)),
        (Command(delivery_mm_s=99.0), Command(delivery_mm_s=MAX_DELIVERY_MM_S)),
    ],
)
def test_commands_are_clamped(asked: Command, sent: Command) -> None:
    world = _world()
    assert world.send(asked) == world.command == sent


def test_a_command_that_is_not_finite_is_refused() -> None:
    world = _world()
    before = world.send(Command(bend=0.1))
    for key, bad in (("bend", math.nan), ("pitch", math.inf), ("advance_mm_s", -math.inf), ("delivery_mm_s", math.nan)):
        with pytest.raises(ValueError, match="not finite"):
            world.send(Command(**{key: bad}))
    assert world.command == before
