"""Webcams on a stand-in for OpenCV and folders in place of /dev and /sys."""

from __future__ import annotations

import re
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.devices import DeviceError
from hardware.cameras.live import LiveCamera
from hardware.cameras.webcam import WebcamSensor
from tests.hardware.soft_cameras import CONFIG, SoftWebcam, picture, take_frames, until_back, until_lost


@pytest.fixture
def webcam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SoftWebcam:
    return SoftWebcam(tmp_path, monkeypatch)


def _sensor(webcam: SoftWebcam, **changes: object) -> WebcamSensor:
    return WebcamSensor(CONFIG.model_copy(update=changes), webcam.open_capture)


def test_a_webcam_gives_rgb_with_the_kernels_time(webcam: SoftWebcam) -> None:
    sensor = _sensor(webcam)
    webcam.stamp_ms = lambda taken_s: 1000.0 * (taken_s - 0.02)
    began_s = time.monotonic()
    sensor.start()
    shot = sensor.read(0.1)
    arrived_s = time.monotonic()
    sensor.stop()
    assert np.array_equal(shot.image, picture(0))
    assert began_s - 0.025 <= shot.captured_s <= arrived_s - 0.015
    assert sensor.name == "Soft Webcam"


def test_another_webcam_does_not_take_the_place_of_a_lost_one(webcam: SoftWebcam) -> None:
    """No camera is named, so that the first one is meant; later on it is that one."""
    sensor = _sensor(webcam)
    sensor.start()
    assert sensor.read(0.1) is not None
    sensor.stop()
    webcam.unplug(0)
    other = webcam.sys / "class" / "video4linux" / "video2"
    other.mkdir(parents=True)
    (other / "name").write_text("Laptop Camera\n")
    (other / "index").write_text("0\n")
    (webcam.dev / "video2").touch()
    with pytest.raises(DeviceError, match="Soft Webcam is not there any more: plug it in"):
        sensor.start()
    webcam.plug(4)
    sensor.start()
    sensor.stop()
    assert [Path(node).name for node, _ in webcam.captures] == ["video0", "video4"]


def test_the_first_picture_may_take_longer_than_the_time_limit(webcam: SoftWebcam, monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = _sensor(webcam)
    sensor.start()
    capture, grab = webcam.captures[0][1], webcam.captures[0][1].grab

    def slow() -> bool:
        time.sleep(0.6)
        return False

    monkeypatch.setattr(capture, "grab", slow)
    assert sensor.read(0.1) is None
    monkeypatch.setattr(capture, "grab", grab)
    assert sensor.read(0.1) is not None
    monkeypatch.setattr(capture, "grab", slow)
    with pytest.raises(DeviceError, match="is lost"):
        sensor.read(0.1)
    sensor.stop()


def test_a_webcam_without_stamps_counts_from_the_arrival(webcam: SoftWebcam) -> None:
    sensor = _sensor(webcam)
    webcam.stamp_ms = lambda _: 0.0
    sensor.start()
    before_s = time.monotonic()
    shot = sensor.read(0.1)
    sensor.stop()
    assert before_s <= shot.captured_s <= time.monotonic()


def test_a_damaged_picture_is_left_out(webcam: SoftWebcam) -> None:
    sensor = _sensor(webcam)
    webcam.damaged = {0}
    sensor.start()
    assert sensor.read(0.1) is None
    assert sensor.read(0.1) is not None
    sensor.stop()


def test_a_webcam_is_set_up_as_configured(webcam: SoftWebcam) -> None:
    webcam.refuses = {cv2.CAP_PROP_GAIN}  # not every camera has everything
    sensor = _sensor(webcam, exposure_ms=5.0, gain=10.0, white_balance_k=5000, pixel_format="YUYV")
    sensor.start()
    settings = webcam.captures[0][1].settings
    sensor.stop()
    assert next(iter(settings)) == cv2.CAP_PROP_FOURCC
    assert settings[cv2.CAP_PROP_FOURCC] == cv2.VideoWriter.fourcc(*"YUYV")
    assert settings[cv2.CAP_PROP_FPS] == 30
    assert (settings[cv2.CAP_PROP_AUTO_EXPOSURE], settings[cv2.CAP_PROP_EXPOSURE]) == (1.0, 50.0)
    assert (settings[cv2.CAP_PROP_AUTO_WB], settings[cv2.CAP_PROP_WB_TEMPERATURE]) == (0.0, 5000)


def test_another_size_than_asked_for_is_refused(webcam: SoftWebcam) -> None:
    webcam.size = (1280, 720)
    with pytest.raises(DeviceError, match=r"gives 1280x720 instead of 160x120: set camera\.width_px"):
        _sensor(webcam).start()
    assert webcam.captures[0][1].released


def test_webcams_are_named_by_path_number_or_not_at_all(webcam: SoftWebcam) -> None:
    for wanted in (None, "0", str(webcam.stable)):
        sensor = _sensor(webcam, device=wanted)
        sensor.start()
        sensor.stop()
    assert {node for node, _ in webcam.captures} == {str(webcam.dev / "video0")}
    with pytest.raises(DeviceError, match=r"webcam 7 is not there; webcams: .*usb-Soft-index0"):
        _sensor(webcam, device="7").start()
    webcam.unplug(0)
    with pytest.raises(DeviceError, match="no webcam: plug it in"):
        _sensor(webcam).start()


def test_a_webcam_is_lost_and_found_under_another_number(webcam: SoftWebcam) -> None:
    camera = LiveCamera(_sensor(webcam, device=str(webcam.stable)), CONFIG)
    camera.open()
    try:
        before = take_frames(camera, 2)[-1]
        webcam.unplug(0)
        assert re.search("is lost: check its cable|is not there", str(until_lost(camera)))
        webcam.plug(3)
        after = until_back(camera)
    finally:
        camera.close()
    assert after.index > before.index
    assert webcam.captures[-1][0] == str(webcam.dev / "video3")
    assert all(capture.released for _, capture in webcam.captures)
