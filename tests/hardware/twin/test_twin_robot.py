"""The twin's robot: clamps, refuses, holds."""

from __future__ import annotations

import math
import threading

import pytest

from core.devices import DeviceError, Robot
from core.types import Command
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import TwinPhysics
from hardware.twin.world import MAX_ADVANCE_MM_S, MAX_DELIVERY_MM_S, TwinRobot


@pytest.fixture(scope="module")
def physics() -> TwinPhysics:
    return TwinPhysics(make_phantom("y_branch"))


@pytest.fixture
def robot(physics: TwinPhysics) -> TwinRobot:
    physics.reset()
    robot = TwinRobot(physics)
    robot.connect()
    return robot


def test_it_is_a_robot(robot: TwinRobot) -> None:
    as_protocol: Robot = robot
    assert as_protocol.name == "bench twin"
    assert as_protocol.status().insertion_mm == 0.0


def test_a_command_within_limits_is_sent_as_it_is(robot: TwinRobot) -> None:
    command = Command(bend=0.3, pitch=-0.2, advance_mm_s=5.0, delivery_mm_s=-1.0)
    assert robot.send(command) == command
    assert robot.current_command == command


@pytest.mark.parametrize(
    ("asked", "sent"),
    [
        (Command(bend=3.0), Command(bend=1.0)),
        (Command(bend=-1.001, pitch=2.0), Command(bend=-1.0, pitch=1.0)),
        (Command(advance_mm_s=1e9), Command(advance_mm_s=MAX_ADVANCE_MM_S)),
        (Command(advance_mm_s=-1e9), Command(advance_mm_s=-MAX_ADVANCE_MM_S)),
        (Command(delivery_mm_s=99.0), Command(delivery_mm_s=MAX_DELIVERY_MM_S)),
    ],
)
def test_it_clamps_and_returns_what_was_really_sent(robot: TwinRobot, asked: Command, sent: Command) -> None:
    assert robot.send(asked) == sent
    assert robot.current_command == sent


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("key", ["bend", "pitch", "advance_mm_s", "delivery_mm_s"])
def test_it_refuses_what_is_not_finite_and_keeps_the_command(robot: TwinRobot, key: str, bad: float) -> None:
    before = robot.send(Command(bend=0.1))
    with pytest.raises(ValueError, match="not finite"):
        robot.send(Command(**{key: bad}))
    assert robot.current_command == before


def test_hold_stops_all_motion_and_keeps_the_bend(robot: TwinRobot) -> None:
    robot.send(Command(bend=0.4, pitch=0.1, advance_mm_s=5.0, delivery_mm_s=2.0))
    robot.hold()
    assert robot.current_command == Command(bend=0.4, pitch=0.1)


def test_closed_it_holds_and_refuses_until_connected_again(robot: TwinRobot) -> None:
    robot.send(Command(bend=0.4, advance_mm_s=5.0))
    robot.close()
    robot.close()
    assert robot.current_command == Command(bend=0.4)
    with pytest.raises(DeviceError, match="connect"):
        robot.send(Command(advance_mm_s=1.0))
    robot.connect()
    assert robot.current_command == Command()


def test_status_and_commands_come_from_other_threads_while_it_steps(robot: TwinRobot, physics: TwinPhysics) -> None:
    done, seen = threading.Event(), []

    def operate() -> None:
        while not done.is_set():
            robot.send(Command(bend=0.2, advance_mm_s=20.0))
            seen.append(robot.status())

    operator = threading.Thread(target=operate)
    operator.start()
    for _ in range(25):
        physics.step(robot.current_command, 0.02)
    done.set()
    operator.join()
    assert physics.insertion_mm == pytest.approx(10.0, abs=1.5)
    assert all(later.time_s >= earlier.time_s for earlier, later in zip(seen, seen[1:], strict=False))
