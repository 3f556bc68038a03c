"""RealSense cameras and recordings by the real library, on software devices."""

from __future__ import annotations

import time

import numpy as np
import pyrealsense2 as rs
import pytest

from core.devices import DeviceError
from hardware.cameras.realsense import RealSenseInfo, RealSenseSensor, find_cameras, realsense_camera
from tests.hardware.soft_cameras import CONFIG, PERIOD_S, SoftRealSense, picture, take_frames, until_back, until_lost

# --- RealSense -------------------------------------------------------------------------------------------------------------------


def test_cameras_are_listed() -> None:
    camera = SoftRealSense("f7", usb="2.1")
    assert find_cameras(camera.context()) == [RealSenseInfo("Intel RealSense L515", "f7", "1.5.8.1", "1.5.8.1", "2.1")]
    camera.plugged = False
    assert find_cameras(camera.context()) == []


def test_frames_come_exactly_and_with_their_time() -> None:
    with SoftRealSense() as soft:
        camera = realsense_camera(CONFIG, soft.context)
        began_s = time.monotonic()
        camera.open()
        try:
            frames = [(frame, time.monotonic()) for frame in (take_frames(camera, 1)[0] for _ in range(10))]
        finally:
            camera.close()
    first = frames[0][0]
    for frame, seen_s in frames:
        assert any(np.array_equal(frame.image, picture(number)) for number in range(soft.number + 1))
        assert frame.image.flags.owndata
        assert began_s - 0.001 <= frame.captured_s <= seen_s + 0.001
    assert first.lost == 0
    assert camera.name == "Intel RealSense L515"


def test_the_sensor_is_set_up_as_configured() -> None:
    soft = SoftRealSense()
    settings = {"exposure_ms": 8.0, "gain": 9000.0, "white_balance_k": 4013}
    sensor = RealSenseSensor(CONFIG.model_copy(update=settings), soft.context)
    sensor.start()
    wanted = {
        rs.option.enable_auto_exposure: 0.0,
        rs.option.auto_exposure_priority: 0.0,
        rs.option.exposure: 80.0,
        rs.option.gain: 4096.0,  # the most that there is
        rs.option.white_balance: 4010.0,  # in its steps
    }
    assert {option: soft.sensor.get_option(option) for option in wanted} == wanted
    sensor.stop()
    automatic = RealSenseSensor(CONFIG, soft.context)
    automatic.start()
    assert soft.sensor.get_option(rs.option.enable_auto_exposure) == 1.0
    assert soft.sensor.get_option(rs.option.auto_exposure_priority) == 0.0
    automatic.stop()


def test_a_stereo_module_takes_its_exposure_in_microseconds() -> None:
    soft = SoftRealSense(stereo=True)
    sensor = RealSenseSensor(CONFIG.model_copy(update={"exposure_ms": 8.0}), soft.context)
    sensor.start()
    assert soft.sensor.get_option(rs.option.exposure) == 8000.0
    sensor.stop()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width_px": 640}, r"has no 640x120 at 30/s: .*one of 160x120 at 30/s"),
        ({"serial": "other"}, "no RealSense camera other; there are: f1"),
    ],
)
def test_what_the_camera_does_not_have_is_named(change: dict[str, object], message: str) -> None:
    soft = SoftRealSense()
    with pytest.raises(DeviceError, match=message):
        realsense_camera(CONFIG.model_copy(update=change), soft.context).open()


def test_without_a_camera_open_fails_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipeline would stop the whole program for 15 seconds here, so none is made."""
    soft, pipelines = SoftRealSense(), []
    soft.plugged = False
    monkeypatch.setattr(rs, "pipeline", lambda *args: pipelines.append(args))
    with pytest.raises(DeviceError, match="no RealSense camera: plug it"):
        realsense_camera(CONFIG, soft.context).open()
    assert pipelines == []


def test_of_two_cameras_one_must_be_chosen() -> None:
    one, other = SoftRealSense("f1"), SoftRealSense("f2")

    def both() -> object:
        context = one.context()
        other.device.add_to(context)
        return context

    with pytest.raises(DeviceError, match=r"2 RealSense cameras \(f1, f2\): set camera.serial"):
        realsense_camera(CONFIG, both).open()
    chosen = RealSenseSensor(CONFIG.model_copy(update={"serial": "f2"}), both)
    chosen.start()
    chosen.stop()
    assert chosen.info is not None and chosen.info.serial == "f2"


def test_another_realsense_camera_does_not_take_the_place_of_a_lost_one() -> None:
    """Somebody is driving by the pictures of the first."""
    own, other = SoftRealSense("f1"), SoftRealSense("f2")
    there = [own]

    def plugged() -> object:
        context = rs.context()
        for camera in there:
            camera.device.add_to(context)
        return context

    sensor = RealSenseSensor(CONFIG, plugged)
    sensor.start()
    sensor.stop()
    there[:] = [other]
    with pytest.raises(DeviceError, match=r"RealSense L515 f1 is not there any more \(there are: f2\): plug it in"):
        sensor.start()
    there[:] = []
    with pytest.raises(DeviceError, match="no RealSense camera: plug it"):
        sensor.start()
    there[:] = [other, own]  # no choice to be made either: it is known which one
    sensor.start()
    sensor.stop()
    assert sensor.info is not None and sensor.info.serial == "f1"


@pytest.mark.parametrize("how", ["unplugged", "stalled"])
def test_a_realsense_camera_is_lost_and_found(how: str) -> None:
    with SoftRealSense() as soft:
        camera = realsense_camera(CONFIG, soft.context)
        camera.open()
        try:
            before = take_frames(camera, 3)[-1]
            if how == "unplugged":
                soft.plugged = False
            soft.silent = True
            silent_s = time.monotonic()
            until_lost(camera)
            noticed_s = time.monotonic() - silent_s
            soft.plugged, soft.silent = True, False
            after = until_back(camera)
        finally:
            camera.close()
    assert CONFIG.lost_after_s - PERIOD_S - 0.05 <= noticed_s
    assert after.index > before.index
    assert after.captured_s > before.captured_s
    assert camera.name == "Intel RealSense L515"
