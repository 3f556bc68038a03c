"""Advice after the paper's state table, and the engine's loop."""

import math

import numpy as np
import pytest

from core.config import AdviceConfig
from core.control.engine import Engine
from core.control.policy import table_policy
from core.types import Command, Frame, Point, Pose, PoseState, Reason, Refusal, RobotStatus, Scene, Speed

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
    assert advice is not None
    assert advice.speed is speed
    assert (advice.steer_deg != 0) == steers


@pytest.mark.parametrize("theta", [20.0, -20.0])
@pytest.mark.parametrize("state", [PoseState.C, PoseState.D])
def test_the_turn_closes_theta(state: PoseState, theta: float) -> None:
    advice = table_policy(_scene(state, theta), CONFIG)
    assert advice is not None
    assert math.copysign(1, advice.steer_deg) == -math.copysign(1, theta)


def test_c_steers_hardest_and_never_beyond_the_limit() -> None:
    c, d = (table_policy(_scene(state, 20.0), CONFIG) for state in (PoseState.C, PoseState.D))
    assert c is not None
    assert d is not None
    assert abs(c.steer_deg) > abs(d.steer_deg)
    extreme = table_policy(_scene(PoseState.C, 170.0), CONFIG)
    assert extreme is not None
    assert extreme.steer_deg == -CONFIG.max_steer_deg


def test_a_parallel_robot_that_is_off_the_line_turns_towards_it() -> None:
    advice = table_policy(_scene(PoseState.C, 0.0, c_head=9.0, c_tail=9.0), CONFIG)
    assert advice is not None
    assert advice.steer_deg < 0


def test_no_pose_no_advice() -> None:
    assert table_policy(Scene(0, 0.0, (640, 480), 1.0, refusal=Refusal(Reason.NO_ROBOT)), CONFIG) is None


class _Camera:
    name, is_live = "test", False

    def __init__(self, indices: list[int]) -> None:
        self._indices = indices

    def open(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        if not self._indices:
            return None
        index = self._indices.pop(0)
        return Frame(index, index / 30, np.zeros((4, 4, 3), np.uint8))

    def close(self) -> None: ...


class _Robot:
    name = "test"

    def __init__(self) -> None:
        self.held = False

    def connect(self) -> None: ...

    def send(self, command: Command) -> Command:
        return Command(bend=min(command.bend, 0.5))

    def status(self) -> RobotStatus:
        return RobotStatus(0.0, 12.0, 0.0, (0, 0, 0, 0), (0, 0, 0, 0))

    def hold(self) -> None:
        self.held = True

    def close(self) -> None: ...


def _engine(indices: list[int], robot: _Robot | None = None) -> tuple[Engine, list[Point | None], list[str]]:
    targets: list[Point | None] = []
    closed: list[str] = []

    def perceive(frame: Frame, target: Point | None = None) -> Scene:
        targets.append(target)
        return Scene(frame.index, frame.captured_s, (4, 4), 1.0, refusal=Refusal(Reason.BLACK))

    return Engine(_Camera(indices), robot, perceive, lambda _: None, lambda: closed.append("closed")), targets, closed


def test_dropped_frames_are_counted_from_the_indices_and_the_rate_from_the_times() -> None:
    engine, _, _ = _engine([0, 1, 4, 5])
    ticks = [engine.step(0.0) for _ in range(5)]
    assert [tick.dropped_frames for tick in ticks if tick] == [0, 0, 2, 2]
    assert ticks[-1] is None
    assert ticks[1] is not None
    assert ticks[1].frames_per_second == pytest.approx(30.0)


def test_what_was_really_sent_is_shown_not_what_was_asked() -> None:
    robot = _Robot()
    engine, _, closed = _engine([0], robot)
    engine.jog(Command(bend=1.0))
    tick = engine.step(0.0)
    assert tick is not None
    assert tick.sent == Command(bend=0.5)
    assert tick.status is not None
    assert tick.status.insertion_mm == 12.0
    engine.close()
    assert robot.held
    assert closed == ["closed"]


def test_the_target_reaches_perception_and_can_be_cleared() -> None:
    engine, targets, _ = _engine([0, 1, 2])
    engine.step(0.0)
    engine.set_target((3.0, 4.0))
    engine.step(0.0)
    engine.set_target(None)
    engine.step(0.0)
    assert targets == [None, (3.0, 4.0), None]


def test_an_engine_without_a_robot_ignores_jogging() -> None:
    engine, _, _ = _engine([0])
    engine.jog(Command(bend=1.0))
    tick = engine.step(0.0)
    assert tick is not None
    assert tick.sent is None
    assert tick.status is None
