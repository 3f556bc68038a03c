"""The engine's loop."""

import numpy as np
import pytest

from core.control.engine import Engine
from core.control.faults import Cause, Fault
from core.control.modes import Hindrance
from core.devices import DeviceError
from core.types import Frame, Point, Reason, Refusal, RobotStatus, Scene
from tests.core.pilot_bench import Bench, scene_at


class _Camera:
    name = "test"

    def __init__(self, indices: list[int]) -> None:
        self._indices = indices

    def open(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        if not self._indices:
            return None
        index = self._indices.pop(0)
        return Frame(index, index / 30, np.zeros((4, 4, 3), np.uint8))

    def close(self) -> None: ...


def _engine(indices: list[int]) -> tuple[Engine, list[Point | None], list[str]]:
    targets: list[Point | None] = []
    closed: list[str] = []

    def perceive(frame: Frame, target: Point | None = None) -> Scene:
        targets.append(target)
        return Scene(frame.index, frame.captured_s, (4, 4), 1.0, refusal=Refusal(Reason.BLACK))

    return Engine(_Camera(indices), perceive, lambda _: None, lambda: closed.append("closed")), targets, closed


def test_dropped_frames_are_counted_from_the_indices_and_the_rate_from_the_times() -> None:
    engine, _, _ = _engine([0, 1, 4, 5])
    ticks = [engine.step(0.0) for _ in range(5)]
    assert [tick.dropped_frames for tick in ticks if tick] == [0, 0, 2, 2]
    assert ticks[-1] is None
    assert ticks[1].frames_per_second == pytest.approx(30.0)


def test_the_target_reaches_perception_and_can_be_cleared() -> None:
    engine, targets, _ = _engine([0, 1, 2])
    engine.step(0.0)
    engine.set_target((3.0, 4.0))
    engine.step(0.0)
    engine.set_target(None)
    engine.step(0.0)
    assert targets == [None, (3.0, 4.0), None]


def test_an_engine_with_a_pilot_turns_it_and_closes_it_before_the_rig() -> None:
    order: list[str] = []
    bench = Bench()
    bench.robot.hold = lambda: order.append("hold")

    def perceive(frame: Frame, target: Point | None = None) -> Scene:
        return scene_at(frame.index, frame.captured_s)

    engine = Engine(_Camera([0, 1]), perceive, lambda _: None, lambda: order.append("rig closed"), bench.pilot, bench.robot)
    tick = engine.step(0.0)
    assert tick.status.insertion_mm == 10.0
    engine.close()
    assert order[-2:] == ["hold", "rig closed"]


def test_pictures_go_on_when_the_robot_is_lost() -> None:
    bench = Bench()

    def lost() -> RobotStatus:
        raise DeviceError("the servo bus process ended")

    bench.robot.status = lost
    perceive = lambda frame, target=None: scene_at(frame.index, frame.captured_s)  # noqa: E731
    engine = Engine(_Camera([0]), perceive, lambda _: None, lambda: None, bench.pilot, bench.robot)
    tick = engine.step(0.0)
    assert tick.status is None
    engine.close()


def test_a_pilot_that_fails_is_a_device_error_with_its_reason(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench()
    bench.robot.report = lambda: 1 // 0
    engine = Engine(_Camera([0]), lambda *_: None, lambda _: None, lambda: None, bench.pilot, bench.robot)
    engine._loop._thread.join(5.0)
    with pytest.raises(DeviceError, match="driving stopped by an unexpected ZeroDivisionError"):
        engine.step(0.0)
    engine.close()
    assert "Traceback" in caplog.text


class _LostCamera(_Camera):
    def read(self, timeout_s: float) -> Frame | None:
        raise DeviceError("camera unplugged: plug it in")


def test_a_lost_camera_leaves_the_operator_the_hand() -> None:
    bench = Bench()
    camera = _LostCamera([])
    engine = Engine(camera, lambda *_: None, lambda _: None, lambda: None, bench.pilot, bench.robot, turns_pilot=False)
    assert engine.step(0.0) is None
    assert engine.problem == "camera unplugged: plug it in"
    assert Fault(Cause.CAMERA_LOST, engine.problem) in bench.pilot._inputs.take(bench.now_s).events
    engine.close()


def test_a_lost_camera_without_a_robot_ends_the_turns() -> None:
    engine = Engine(_LostCamera([]), lambda *_: None, lambda _: None, lambda: None)
    with pytest.raises(DeviceError, match="unplugged"):
        engine.step(0.0)


# ---- frames that are late, or none


class _ScriptCamera(_Camera):
    """Gives these frames."""

    def __init__(self, frames: list[Frame]) -> None:
        super().__init__([])
        self._frames = frames

    def read(self, timeout_s: float) -> Frame | None:
        return self._frames.pop(0) if self._frames else None


def _frame(index: int, captured_s: float, image: np.ndarray | None = None) -> Frame:
    return Frame(index, captured_s, np.zeros((4, 4, 3), np.uint8) if image is None else image)


def _scripted(*frames: Frame) -> tuple[Engine, list[int]]:
    perceived: list[int] = []

    def perceive(frame: Frame, target: Point | None = None) -> Scene:
        perceived.append(frame.index)
        return Scene(frame.index, frame.captured_s, (4, 4), 1.0, refusal=Refusal(Reason.BLACK))

    return Engine(_ScriptCamera(list(frames)), perceive, lambda _: None, lambda: None), perceived


def test_a_frame_that_was_overtaken_is_left_out_and_counted() -> None:
    engine, perceived = _scripted(_frame(0, 0.0), _frame(2, 0.2), _frame(1, 0.1), _frame(3, 0.3))
    ticks = [engine.step(0.0) for _ in range(4)]
    assert perceived == [0, 2, 3]
    assert [tick.dropped_frames for tick in ticks if tick] == [0, 1, 2]


def test_a_camera_that_counts_anew_or_whose_clock_slipped_once_is_not_late() -> None:
    engine, perceived = _scripted(_frame(7, 5.0), _frame(0, 5.5), _frame(1, 99.0), _frame(2, 5.6))
    for _ in range(4):
        engine.step(0.0)
    assert perceived == [7, 0, 1, 2]


@pytest.mark.parametrize("image", [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3), np.uint16), np.zeros((0, 4, 3), np.uint8)])
def test_a_picture_that_is_none_is_told_and_not_looked_at(image: np.ndarray) -> None:
    bench = Bench()
    camera = _ScriptCamera([_frame(0, bench.now_s - 0.01, image)])
    engine = Engine(camera, lambda *_: None, lambda _: None, lambda: None, bench.pilot, bench.robot, turns_pilot=False)
    assert engine.step(0.0) is None
    assert "not 8-bit RGB" in engine.problem
    bench.pilot.tick()
    assert Cause.WRONG_FORMAT in {fault.cause for fault in bench.pilot.view.active}
    engine.close()


def test_what_was_understood_for_another_target_is_no_way_to_this_one() -> None:
    bench = Bench()

    def perceive(frame: Frame, target: Point | None = None) -> Scene:
        engine.set_target((300.0, 60.0))  # the operator clicks while the frame is being looked at
        return scene_at(frame.index, frame.captured_s)

    camera = _ScriptCamera([_frame(0, bench.now_s - 0.02), _frame(1, bench.now_s - 0.01)])
    engine = Engine(camera, perceive, lambda _: None, lambda: None, bench.pilot, bench.robot, turns_pilot=False)
    engine.set_target((200.0, 60.0))
    engine.step(0.0)
    assert bench.pilot.tick().against_hand_over.count(Hindrance.NO_TARGET) == 1
    engine.step(0.0)
    assert Hindrance.NO_TARGET not in bench.pilot.tick().against_hand_over
    engine.close()
