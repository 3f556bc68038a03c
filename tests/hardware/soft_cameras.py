"""Cameras for tests: a RealSense one through the real library, and a stand-in for OpenCV's capture object."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyrealsense2 as rs
import pytest

from core.config.models import CameraConfig
from core.devices import Camera, CameraLost
from core.types import Frame, Image
from hardware.cameras import sysfs

WIDTH, HEIGHT = 160, 120
CONFIG = CameraConfig(width_px=WIDTH, height_px=HEIGHT, frames_per_second=30, lost_after_s=0.2, reconnect_s=0.1)
PERIOD_S = 1.0 / 30.0


def picture(number: int) -> Image:
    """What the camera takes as its frame `number`: noise, so that every byte must be right."""
    return np.random.default_rng(number).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)


OPTIONS = {
    rs.option.enable_auto_exposure: (0, 1, 1, 1),
    rs.option.auto_exposure_priority: (0, 1, 1, 1),
    rs.option.exposure: (1, 10_000, 1, 156),
    rs.option.gain: (0, 4096, 1, 64),
    rs.option.white_balance: (2400, 6500, 10, 4600),
}
STEREO_OPTIONS = {rs.option.exposure: (1, 165_000, 1, 33_000), rs.option.gain: (16, 248, 1, 16)}
"""As the library lists them for the stereo module of a D405: exposure in microseconds."""


class SoftRealSense:
    """A software device of the RealSense library, and a thread that injects frames. ``context`` lists it while it is plugged in.

    `stereo`: a D405, whose colour comes from its stereo module.
    """

    def __init__(self, serial: str = "f1", *, usb: str = "3.2", form: Any = rs.format.rgb8, stereo: bool = False) -> None:
        self.device = rs.software_device()
        about = {
            rs.camera_info.name: f"Intel RealSense {'D405' if stereo else 'L515'}",
            rs.camera_info.serial_number: serial,
            rs.camera_info.firmware_version: "1.5.8.1",
            rs.camera_info.recommended_firmware_version: "1.5.8.1",
            rs.camera_info.usb_type_descriptor: usb,
        }
        for what, text in about.items():
            self.device.register_info(what, text)
        self.sensor = self.device.add_sensor("Stereo Module" if stereo else "RGB Camera")
        for option, (low, high, step, default) in (OPTIONS | (STEREO_OPTIONS if stereo else {})).items():
            limits = rs.option_range()
            limits.min, limits.max, limits.step, limits.default = low, high, step, default
            self.sensor.add_option(option, limits, True)
        if stereo:
            self.sensor.add_video_stream(_stream(rs.format.z16, rs.stream.depth, uid=2))
        self._profile = self.sensor.add_video_stream(_stream(form)).as_video_stream_profile()
        self.plugged = True
        self.silent = False
        self.number = 0
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def context(self) -> Any:
        """What the library sees now."""
        context = rs.context()
        if self.plugged:
            self.device.add_to(context)
        return context

    def inject(self, number: int, stamp_ms: float | None = None) -> None:
        """Frame `number`, stamped with the wall clock as the library's own frames are."""
        frame = rs.software_video_frame()
        frame.pixels, frame.stride, frame.bpp = picture(number), WIDTH * 3, 3
        frame.timestamp = time.time() * 1000.0 if stamp_ms is None else stamp_ms
        frame.domain = rs.timestamp_domain.system_time
        frame.frame_number, frame.profile = number, self._profile
        self.sensor.on_video_frame(frame)

    def __enter__(self) -> SoftRealSense:
        self._thread = threading.Thread(target=self._run, name="soft camera")
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.wait(PERIOD_S):
            if self.plugged and not self.silent:
                self.inject(self.number)
                self.number += 1


def _stream(form: Any, kind: Any = rs.stream.color, uid: int = 1) -> Any:
    stream = rs.video_stream()
    stream.type, stream.index, stream.uid, stream.fmt = kind, 0, uid, form
    stream.width, stream.height, stream.fps, stream.bpp = WIDTH, HEIGHT, 30, 3
    lens = rs.intrinsics()
    lens.width, lens.height, lens.ppx, lens.ppy, lens.fx, lens.fy = WIDTH, HEIGHT, WIDTH / 2, HEIGHT / 2, 150.0, 150.0
    lens.model, lens.coeffs = rs.distortion.none, [0.0] * 5
    stream.intrinsics = lens
    return stream


class SoftCapture:
    """OpenCV's capture object of a webcam: gives `picture` after `picture`, does not take every setting, and can be lost."""

    def __init__(self, webcam: SoftWebcam) -> None:
        self._webcam = webcam
        self.settings: dict[int, float] = {}
        self.released = False

    def isOpened(self) -> bool:
        return self._webcam.plugged

    def set(self, what: int, value: float) -> bool:
        self.settings[what] = value
        return what not in self._webcam.refuses

    def get(self, what: int) -> float:
        if what == cv2.CAP_PROP_POS_MSEC:
            return self._webcam.stamp_ms(self._taken_s)
        return {cv2.CAP_PROP_FRAME_WIDTH: self._webcam.size[0], cv2.CAP_PROP_FRAME_HEIGHT: self._webcam.size[1]}[what]

    def grab(self) -> bool:
        self._webcam.gate.wait(5.0)
        time.sleep(PERIOD_S)
        self._taken_s = time.monotonic()
        return self._webcam.plugged and not self.released

    def retrieve(self) -> tuple[bool, Any]:
        number = self._webcam.number
        self._webcam.number += 1
        return (False, None) if number in self._webcam.damaged else (True, np.ascontiguousarray(picture(number)[..., ::-1]))

    def release(self) -> None:
        self.released = True


class SoftWebcam:
    """A webcam and the folders in which the kernel lists it. ``gate`` closed: its driver hangs."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch) -> None:
        self.dev, self.sys = folder / "dev", folder / "sys"
        patch.setattr(sysfs, "DEV", self.dev)
        patch.setattr(sysfs, "SYS", self.sys)
        self.plugged = True
        self.size = (WIDTH, HEIGHT)
        self.number = 0
        self.damaged: set[int] = set()
        self.refuses: set[int] = set()
        self.stamp_ms: Callable[[float], float] = lambda taken_s: 1000.0 * taken_s
        self.gate = threading.Event()
        self.gate.set()
        self.captures: list[tuple[str, SoftCapture]] = []
        (self.dev / "v4l" / "by-id").mkdir(parents=True)
        self.plug(0)

    @property
    def stable(self) -> Path:
        """Its path in /dev/v4l/by-id."""
        return self.dev / "v4l" / "by-id" / "usb-Soft-index0"

    def plug(self, number: int) -> None:
        """Plug it in as /dev/video<number>."""
        folder = self.sys / "class" / "video4linux" / f"video{number}"
        folder.mkdir(parents=True)
        (folder / "name").write_text("Soft Webcam\n")
        (folder / "index").write_text("0\n")
        (self.dev / folder.name).touch()
        self.stable.symlink_to(self.dev / folder.name)
        self.plugged = True

    def unplug(self, number: int) -> None:
        """Pull it out."""
        self.plugged = False
        folder = self.sys / "class" / "video4linux" / f"video{number}"
        for path in (folder / "name", folder / "index", self.stable, self.dev / folder.name):
            path.unlink()
        folder.rmdir()

    def open_capture(self, node: str, _: int) -> SoftCapture:
        """In place of cv2.VideoCapture."""
        self.captures.append((node, SoftCapture(self)))
        return self.captures[-1][1]


def take_frames(camera: Camera, count: int) -> list[Frame]:
    found: list[Frame] = []
    until_s = time.monotonic() + 10.0
    while len(found) < count and time.monotonic() < until_s:
        frame = camera.read(0.5)
        if frame is not None:
            found.append(frame)
    assert len(found) == count
    return found


def until_lost(camera: Camera) -> CameraLost:
    """The loss as ``read`` tells it; the frames before it are dropped."""
    until_s = time.monotonic() + 10.0
    while time.monotonic() < until_s:
        try:
            camera.read(0.05)
        except CameraLost as error:
            return error
    raise AssertionError("nobody noticed")


def until_back(camera: Camera) -> Frame:
    until_s = time.monotonic() + 10.0
    while time.monotonic() < until_s:
        try:
            frame = camera.read(0.05)
        except CameraLost:
            continue
        if frame is not None:
            return frame
    raise AssertionError("it did not come back")
