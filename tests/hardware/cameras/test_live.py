"""Live cameras over a scripted sensor, the clock of their pictures, and feeds."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from core.control.engine import Engine
from core.devices import CameraLost, DeviceError
from core.types import Frame, Point, Scene
from hardware.cameras.live import CaptureClock, LiveCamera, SensorFrame
from tests.hardware.soft_cameras import CONFIG, PERIOD_S, until_back, until_lost

# --- the clock -------------------------------------------------------------------------------------------------------------------


def test_a_clock_that_the_computer_shares_tells_the_age() -> None:
    clock = CaptureClock()
    assert clock.captured_s(100.0, 5000.0, 5000.03) == pytest.approx(99.97)
    assert clock.captured_s(100.04, 5000.033, 5000.08) == pytest.approx(99.993)


def test_of_a_clock_of_its_own_only_the_rate_counts() -> None:
    clock = CaptureClock()
    # arrivals 0, 20 and 5 ms later than the quickest
    assert clock.captured_s(100.000, 7.000) == pytest.approx(100.000)
    assert clock.captured_s(100.053, 7.033) == pytest.approx(100.033)
    assert clock.captured_s(100.071, 7.066) == pytest.approx(100.066)
    assert clock.captured_s(200.0, 1.0) == pytest.approx(200.0)  # it was started again


@pytest.mark.parametrize("now_s", [4000.0, 5000.9])
def test_a_shared_clock_that_makes_no_sense_is_not_believed(now_s: float) -> None:
    """The wall clock was set between two pictures, or the stamp is of another clock."""
    assert CaptureClock().captured_s(100.0, 5000.0, now_s) == 100.0


def test_after_a_stall_the_pictures_that_waited_are_as_old_as_they_are() -> None:
    """What lay in the queue while the computer was busy must not be taken for new: somebody drives by it."""
    clock = CaptureClock()
    for k in range(30):
        clock.captured_s(100.0 + k / 30, 5000.0 + k / 30, 5000.01 + k / 30)
    assert clock.captured_s(102.0, 5001.22, 5002.0) == pytest.approx(101.22)
    assert clock.captured_s(102.01, 5001.26, 5002.01) == pytest.approx(101.26)


def test_capture_never_goes_back_and_never_lies_in_the_future() -> None:
    clock = CaptureClock()
    assert clock.captured_s(100.0, 50.0, 50.0) == 100.0
    assert clock.captured_s(100.01, 49.9, 50.01) == 100.0
    assert clock.captured_s(100.02, None) == 100.02


# --- any live camera -------------------------------------------------------------------------------------------------------------


class _Script:
    """A sensor that does what the test says."""

    name = "script"

    def __init__(self) -> None:
        self.shots: list[SensorFrame | DeviceError | None] = []
        self.refuses_to_start = 0
        self.calls: list[str] = []
        self.hangs = threading.Event()
        self.hangs.set()

    def start(self) -> None:
        self.calls.append("start")
        if self.refuses_to_start:
            self.refuses_to_start -= 1
            raise DeviceError("script: not there")

    def read(self, timeout_s: float) -> SensorFrame | None:
        self.hangs.wait()
        if not self.shots:
            time.sleep(0.005)
            return None
        shot = self.shots.pop(0)
        if isinstance(shot, DeviceError):
            raise shot
        return shot

    def stop(self) -> None:
        self.calls.append("stop")

    def reset(self) -> float:
        self.calls.append("reset")
        return 0.0


def _shot(number: int | None, at_s: float) -> SensorFrame:
    return SensorFrame(np.zeros((2, 2, 3), np.uint8), at_s, number)


@pytest.fixture
def script() -> _Script:
    return _Script()


@pytest.fixture
def camera(script: _Script) -> Iterator[LiveCamera]:
    camera = LiveCamera(script, CONFIG)
    yield camera
    script.hangs.set()
    camera.close()


def _newest(camera: LiveCamera) -> Frame:
    time.sleep(0.05)
    frame = camera.read(1.0)
    assert frame is not None
    return frame


def test_a_camera_that_is_not_there_is_an_error_at_open(script: _Script, camera: LiveCamera) -> None:
    script.refuses_to_start = 1
    with pytest.raises(DeviceError, match="not there"):
        camera.open()
    with pytest.raises(DeviceError, match="not open"):
        camera.read(0.0)
    camera.open()  # and may be tried again
    assert script.calls.count("start") == 2


def test_missing_numbers_are_lost_frames_and_a_count_that_goes_back_is_none(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(number, 10.0 + place * PERIOD_S) for place, number in enumerate([5, 6, 9, 9, 2, 3])]
    camera.open()
    frame = _newest(camera)
    assert (frame.index, frame.lost) == (5, 2)  # 7 and 8; the 9 that came twice with another time is new


@pytest.mark.parametrize("counts", [True, False])
def test_a_camera_that_is_slower_than_asked_for_loses_frames(counts: bool, script: _Script, camera: LiveCamera) -> None:
    """In dim light some cameras slow down and count on as if nothing was missing; others do not count at all."""
    periods = [0, 1, 2.4, 3, 5, 6, 9]  # jitter, then one frame left out, then two
    script.shots = [_shot(place if counts else None, 10.0 + period * PERIOD_S) for place, period in enumerate(periods)]
    camera.open()
    frame = _newest(camera)
    assert (frame.index, frame.lost) == (6, 3)


def test_the_newest_frame_wins(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(number, 10.0 + number * PERIOD_S) for number in range(51)]
    camera.open()
    frame = _newest(camera)
    assert (frame.index, frame.lost) == (50, 0)
    assert frame.captured_s == pytest.approx(10.0 + 50 * PERIOD_S)
    assert camera.read(0.0) is None


def test_a_camera_that_repeats_its_last_picture_is_lost(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(3, 10.0)] * 100_000
    camera.open()
    assert _newest(camera).index == 0
    assert "no picture" in str(until_lost(camera))


def test_a_lost_camera_is_reset_and_comes_back_with_its_index_going_on(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(7, 10.0), DeviceError("script is lost: check its cable")]
    camera.open()
    assert str(until_lost(camera)) == "script is lost: check its cable"
    script.refuses_to_start = 2
    script.shots = [_shot(0, 20.0)]
    frame = until_back(camera)
    assert (frame.index, frame.lost, camera.reconnects) == (1, 0, 1)
    assert script.calls[:6] == ["start", "stop", "reset", "start", "start", "start"]


def test_a_driver_that_hangs_is_noticed_from_outside(script: _Script, camera: LiveCamera) -> None:
    script.shots = [_shot(0, 10.0)]
    camera.open()
    assert _newest(camera).index == 0
    script.hangs.clear()
    assert "no picture" in str(until_lost(camera))


def test_a_driver_that_breaks_is_for_good(script: _Script, camera: LiveCamera) -> None:
    script.shots = ["no shot at all"]
    camera.open()
    with pytest.raises(DeviceError, match=r"no longer read \(AttributeError.*F5") as caught:
        for _ in range(100):
            camera.read(0.05)
    assert not isinstance(caught.value, CameraLost)


def test_a_rig_outlives_a_lost_camera(script: _Script, camera: LiveCamera) -> None:
    def perceive(frame: Frame, target: Point | None = None) -> Scene:
        return Scene(frame.index, frame.captured_s, (2, 2), 1.0)

    script.shots = [_shot(0, 10.0), DeviceError("gone")]
    camera.open()
    engine = Engine(camera, perceive, lambda _: None, camera.close)
    ticks = [engine.step(0.1)]
    until_lost(camera)
    ticks += [engine.step(0.0) for _ in range(3)]
    script.shots = [_shot(0, 20.0)]
    while ticks[-1] is None:
        ticks.append(engine.step(0.5))
    engine.close()
    assert [tick.frame.index for tick in ticks if tick is not None] == [0, 1]
