"""Webcams and industrial UVC cameras through OpenCV and V4L2, found by their stable path."""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from core.config.models import CameraConfig
from core.devices import DeviceError
from hardware.cameras import sysfs
from hardware.cameras.live import CaptureClock, LiveCamera, SensorFrame

_log = logging.getLogger(__name__)

_SELECT_TIMEOUT = "OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT"
"""Seconds that OpenCV waits for a frame; its own 10 would keep a lost camera from being found again."""
_AT_ONCE_S = 0.5
"""A camera that is gone says so sooner; one that is still starting makes us wait for the time limit."""
_MANUAL, _AUTOMATIC = 1.0, 3.0
"""Exposure modes of V4L2."""
_EXPOSURE_STEPS_PER_MS = 10.0
_SET_CONTROL, _EXPOSURE_PRIORITY = 0xC008561C, 0x009A0903
"""VIDIOC_S_CTRL, and the control by which a camera may lower its rate in dim light (linux/videodev2.h)."""
_QUEUE_FRAMES = 2


class WebcamSensor:
    """A V4L2 camera; `open_capture` makes OpenCV's capture object of a device node."""

    def __init__(self, config: CameraConfig, open_capture: Callable[..., Any] = cv2.VideoCapture) -> None:
        self._config, self._open_capture = config, open_capture
        self._capture: Any = None
        self._clock = CaptureClock()
        self._title = config.device or "webcam"
        self._own: tuple[Path | None, str] | None = None  # stable path and name, by which a camera is known again
        self._is_new = True

    @property
    def name(self) -> str:
        return self._title

    def start(self) -> None:
        node = self._find()
        os.environ.setdefault(_SELECT_TIMEOUT, "1")
        capture = self._open_capture(str(node), cv2.CAP_V4L2)
        try:
            if not capture.isOpened():
                raise DeviceError(
                    "{camera} ({node}) cannot be opened: close other programs that use it, or join the group video",
                    camera=self.name,
                    node=node,
                )
            self._set_up(capture, node)
        except DeviceError:
            capture.release()
            raise
        self._capture = capture
        self._clock = CaptureClock()
        self._is_new = True

    def read(self, timeout_s: float) -> SensorFrame | None:
        """The next picture. V4L2 has its own time limit of a second, which the first picture may exceed; a lost camera fails at
        once."""
        asked_s = time.monotonic()
        if not self._capture.grab():
            if self._is_new and time.monotonic() - asked_s > _AT_ONCE_S:
                return None
            raise DeviceError("{camera} is lost: check its cable", camera=self.name)
        self._is_new = False
        arrived_s = time.monotonic()
        # V4L2 stamps frames on the monotonic clock. Some drivers do not, and say 0, or use another one.
        stamp_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        came, image = self._capture.retrieve()
        if not came or image is None:
            return None  # a damaged picture
        if image.ndim == 2:
            image = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
        captured_s = self._clock.captured_s(arrived_s, stamp_s if stamp_s > 0.0 else None, arrived_s)
        return SensorFrame(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8), captured_s)

    def stop(self) -> None:
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.release()

    def reset(self) -> float:
        """Only opening it again resets a V4L2 device."""
        return 0.0

    def _find(self) -> Path:
        wanted = self._config.device
        devices = sysfs.video_devices()
        if wanted is None and self._own is not None:
            # Another camera's pictures must not take the place of a lost one's: the operator drives by them.
            node = next((device.node for device in devices if (device.stable, device.title) == self._own), None)
            if node is None:
                raise DeviceError(f"{self.name} is not there any more: plug it in, or start again with another one")
        elif wanted is None:
            if not devices:
                raise DeviceError("no webcam: plug it in; main.py doctor --rig webcam says more")
            node = devices[0].node
            self._own = (devices[0].stable, devices[0].title)
        else:
            node = sysfs.webcam_node(wanted)
            if not node.exists():
                paths = ", ".join(device.path for device in devices) or "none"
                raise DeviceError(
                    "webcam {camera} is not there; webcams: {paths}: plug it in, or set camera.device", camera=wanted, paths=paths
                )
        # Resolved at every start: plugged in again, the stable path may lead to another number.
        node = node.resolve()
        self._title = next((device.title for device in devices if device.node.resolve() == node), self._title)
        return node

    def _set_up(self, capture: Any, node: Path) -> None:
        config = self._config
        # The pixel format first: it decides which sizes and rates there are.
        self._set(capture, cv2.CAP_PROP_FOURCC, float(cv2.VideoWriter.fourcc(*config.pixel_format)), "camera.pixel_format")
        self._set(capture, cv2.CAP_PROP_FRAME_WIDTH, config.width_px, "camera.width_px")
        self._set(capture, cv2.CAP_PROP_FRAME_HEIGHT, config.height_px, "camera.height_px")
        self._set(capture, cv2.CAP_PROP_FPS, config.frames_per_second, "camera.frames_per_second")
        self._set(capture, cv2.CAP_PROP_BUFFERSIZE, _QUEUE_FRAMES, "the length of the queue")
        size = (int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        if size != (config.width_px, config.height_px):
            asked = f"{config.width_px}x{config.height_px}"
            raise DeviceError(f"{self.name} gives {size[0]}x{size[1]} instead of {asked}: set camera.width_px and camera.height_px")
        _keep_rate(node)
        automatic = config.exposure_ms is None
        self._set(capture, cv2.CAP_PROP_AUTO_EXPOSURE, _AUTOMATIC if automatic else _MANUAL, "automatic exposure")
        if config.exposure_ms is not None:
            self._set(capture, cv2.CAP_PROP_EXPOSURE, config.exposure_ms * _EXPOSURE_STEPS_PER_MS, "camera.exposure_ms")
        if config.gain is not None:
            self._set(capture, cv2.CAP_PROP_GAIN, config.gain, "camera.gain")
        self._set(capture, cv2.CAP_PROP_AUTO_WB, float(config.white_balance_k is None), "automatic white balance")
        if config.white_balance_k is not None:
            self._set(capture, cv2.CAP_PROP_WB_TEMPERATURE, config.white_balance_k, "camera.white_balance_k")

    def _set(self, capture: Any, what: int, value: float, title: str) -> None:
        if not capture.set(what, value):
            _log.info("%s does not take %s = %g", self.name, title, value)


def _keep_rate(node: Path) -> None:
    """Forbid fewer frames in dim light, which OpenCV cannot; many cameras have no such setting."""
    with contextlib.suppress(OSError):
        handle = os.open(node, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            fcntl.ioctl(handle, _SET_CONTROL, struct.pack("Ii", _EXPOSURE_PRIORITY, 0))
        finally:
            os.close(handle)


def webcam_camera(config: CameraConfig) -> LiveCamera:
    """A V4L2 camera as a ``Camera``."""
    return LiveCamera(WebcamSensor(config), config)
