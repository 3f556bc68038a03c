"""Frames are undistorted where they come in, and feeds of them."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from core.config.calibration import LensConfig
from core.devices import CameraLost, DeviceError
from core.types import Frame
from hardware.cameras.live import CameraFeed
from hardware.cameras.undistorted import UndistortedCamera

LENS = LensConfig(k1=-0.12, center_px=(319.5, 239.5), size_px=(640, 480), residual_px=0.1, pictures=3)


class ScriptedCamera:
    """Gives what it is told: frames, None, or errors."""

    name = "scripted camera"

    def __init__(self, *script: Frame | Exception | None) -> None:
        self._script = list(script)
        self.is_closed = False

    def open(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        if not self._script:
            time.sleep(0.005)
            return Frame(0, time.monotonic(), np.zeros((480, 640, 3), np.uint8))
        item = self._script.pop(0)
        if isinstance(item, Exception):
            raise item
        return item

    def close(self) -> None:
        self.is_closed = True


def _frame(image: np.ndarray) -> Frame:
    return Frame(7, 1.5, image, 3)


# ---- the lens where frames come in


def test_frames_come_straightened_and_keep_the_rest() -> None:
    image = np.full((480, 640, 3), 50, np.uint8)
    image[:, 60:64] = 255  # a straight line, as a bent lens shows it
    frame = UndistortedCamera(ScriptedCamera(_frame(image)), LENS).read(0.1)
    assert (frame.index, frame.captured_s, frame.lost) == (7, 1.5, 3)
    columns = [int(np.argmax(frame.image[row, :200, 0])) for row in (5, 240, 474)]
    assert columns[0] < columns[1] - 2  # barrel: the corners go outwards
    assert columns[0] == pytest.approx(columns[2], abs=1)


@pytest.mark.parametrize(
    "image", [np.zeros((720, 1280, 3), np.uint8), np.zeros((480, 640), np.uint8), np.zeros((480, 640, 3), np.uint16)]
)
def test_what_is_no_such_picture_is_passed_on(image: np.ndarray) -> None:
    frame = UndistortedCamera(ScriptedCamera(_frame(image)), LENS).read(0.1)
    assert frame.image is image


def test_no_lens_no_work() -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    frame = UndistortedCamera(ScriptedCamera(_frame(image)), None).read(0.1)
    assert frame.image is image


# ---- the feed


def test_a_feed_gives_only_pictures_of_after_the_question() -> None:
    camera = ScriptedCamera()
    feed = CameraFeed(camera)
    asked_s = time.monotonic()
    frames = feed.next_frames(3, 5.0)
    assert all(frame.captured_s > asked_s for frame in frames)
    feed.close()
    feed.close()
    assert camera.is_closed


def test_pictures_of_a_slow_simulation_are_waited_for_by_its_own_clock() -> None:
    """A wizard on a busy computer told the user of the twin to check its cable."""
    clock, now_s = threading.Lock(), [100.0]

    class Slow(ScriptedCamera):
        def read(self, timeout_s: float) -> Frame | None:
            time.sleep(0.02)
            with clock:
                now_s[0] += 0.001
                return Frame(0, now_s[0], np.zeros((4, 4, 3), np.uint8))

    feed = CameraFeed(Slow(), clock=lambda: now_s[0])
    assert len(feed.next_frames(5, 0.01)) == 5
    feed.close()


def test_a_lost_camera_is_told_and_found_again() -> None:
    back = threading.Event()

    class Flaky(ScriptedCamera):
        def read(self, timeout_s: float) -> Frame | None:
            if not back.is_set():
                raise CameraLost("the camera is lost: check its cable")
            return super().read(timeout_s)

    feed = CameraFeed(Flaky())
    try:
        with pytest.raises(DeviceError, match="check its cable"):
            feed.next_frames(1, 0.3)
        back.set()
        assert feed.next_frames(1, 5.0)
        assert feed.problem is None
    finally:
        feed.close()


def test_a_camera_that_is_gone_for_good_ends_the_feed() -> None:
    feed = CameraFeed(ScriptedCamera(DeviceError("unplugged")))
    with pytest.raises(DeviceError, match="unplugged"):
        feed.next_frames(1, 0.3)
    feed.close()
