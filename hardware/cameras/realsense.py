"""Intel RealSense colour cameras (L515 and others).

The colour sensor is driven by itself, not through a pipeline: ``pipeline.start`` without a camera stops the whole interpreter for
15 seconds, and after an unplug a pipeline restarts itself for as long.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyrealsense2 as rs

from core.config.models import CameraConfig
from core.devices import DeviceError
from core.types import Image
from hardware.cameras.live import CaptureClock, LiveCamera, SensorFrame

_log = logging.getLogger(__name__)

_QUEUE_FRAMES = 2
"""The library drops the oldest of more. Its pool starves when some 15 frames are kept, so every frame is copied and let go."""
_RESET_S = 3.0
"""A camera that was reset is still listed for a moment, and then gone for about two seconds."""
_RGB_STEPS_PER_MS, _STEREO_STEPS_PER_MS = 10.0, 1000.0
"""Steps of the exposure: 100 us of an RGB camera, 1 us of a stereo module (librealsense issues 8243, 12006). The D405 has no RGB
camera: its colour comes from the stereo module."""


@dataclass(frozen=True, slots=True)
class RealSenseInfo:
    """A camera that the library can open. ``usb`` is the version of its connection ("3.2", "2.1"), "" when unknown."""

    name: str
    serial: str
    firmware: str = ""
    recommended_firmware: str = ""
    usb: str = ""

    @property
    def is_outdated(self) -> bool:
        """Whether the library was made for a newer firmware."""
        return _numbers(self.firmware) < _numbers(self.recommended_firmware) if self.firmware else False

    def describe(self) -> str:
        """One line for people."""
        parts = [f"{self.name} {self.serial}"]
        parts += [f"firmware {self.firmware}"] if self.firmware else []
        parts += [f"USB {self.usb}"] if self.usb else []
        return ", ".join(parts)


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part.isdigit())


def _info(device: Any, what: Any) -> str:
    return " ".join(str(device.get_info(what)).split()) if device.supports(what) else ""


def describe_device(device: Any) -> RealSenseInfo:
    """Who a device of the library is."""
    return RealSenseInfo(
        name=_info(device, rs.camera_info.name).removeprefix("Software-Device ") or "RealSense",
        serial=_info(device, rs.camera_info.serial_number),
        firmware=_info(device, rs.camera_info.firmware_version),
        recommended_firmware=_info(device, rs.camera_info.recommended_firmware_version),
        usb=_info(device, rs.camera_info.usb_type_descriptor),
    )


def find_cameras(context: Any = None) -> list[RealSenseInfo]:
    """RealSense cameras that are plugged in and may be opened; takes a millisecond without one.

    Raises DeviceError: when the library itself cannot look.
    """
    try:
        return [describe_device(device) for device in (context or rs.context()).query_devices()]
    except RuntimeError as error:
        raise DeviceError(f"RealSense library: {_short(error)}: check libusb and the udev rules") from None


class RealSenseSensor:
    """The colour sensor of one RealSense camera.

    The library's list of devices is made at every start, since an old one may not see a new camera.
    """

    def __init__(self, config: CameraConfig, make_context: Callable[[], Any] = rs.context) -> None:
        self._config, self._make_context = config, make_context
        self._context: Any = None
        self._device: Any = None
        self._sensor: Any = None
        self._queue: Any = None
        self._clock = CaptureClock()
        self._own_serial: str | None = None
        self.info: RealSenseInfo | None = None

    @property
    def name(self) -> str:
        return self.info.name if self.info is not None else "RealSense camera"

    def start(self) -> None:
        try:
            self._context = self._make_context()
            self._device = self._find()
            self.info = describe_device(self._device)
            sensor, profile = self._choose_profile()
            self._set_up(sensor)
            self._queue = rs.frame_queue(_QUEUE_FRAMES)
            self._clock = CaptureClock()
            sensor.open(profile)
            self._sensor = sensor
            sensor.start(self._queue)
            self._own_serial = self.info.serial
        except RuntimeError as error:
            self.stop()
            raise DeviceError(
                "{camera} cannot be started ({why}): close other programs that use it", camera=self.name, why=_short(error)
            ) from None
        except DeviceError:
            self.stop()
            raise

    def read(self, timeout_s: float) -> SensorFrame | None:
        try:
            came, frame = self._queue.try_wait_for_frame(int(1000 * timeout_s))
            if not came:
                return None
            arrived_s, wall_s = time.monotonic(), time.time()
            stamp_s = frame.get_timestamp() / 1000.0
            # The other domain, hardware_clock, is the camera's own.
            on_wall = frame.get_frame_timestamp_domain() in {rs.timestamp_domain.system_time, rs.timestamp_domain.global_time}
            captured_s = self._clock.captured_s(arrived_s, stamp_s, wall_s if on_wall else None)
            return SensorFrame(colour_image(frame), captured_s, int(frame.get_frame_number()))
        except RuntimeError as error:
            raise DeviceError("{camera} is lost ({why}): check its cable", camera=self.name, why=_short(error)) from None

    def stop(self) -> None:
        sensor, self._sensor = self._sensor, None
        if sensor is not None:
            for end in (sensor.stop, sensor.close):
                with contextlib.suppress(RuntimeError):  # an unplugged camera
                    end()
        self._queue = None

    def reset(self) -> float:
        """Only a camera that is still there can be reset; one that was unplugged starts afresh anyway."""
        device, self._device = self._device, None
        try:
            if device is not None and self.info is not None and self.info.serial in {c.serial for c in find_cameras(self._context)}:
                device.hardware_reset()
                return _RESET_S
        except (RuntimeError, DeviceError) as error:
            _log.info("%s was not reset (%s)", self.name, error)
        return 0.0

    def _find(self) -> Any:
        devices = list(self._context.query_devices())
        wanted = self._config.serial if self._config.serial is not None else self._own_serial
        chosen = [device for device in devices if wanted in {None, _info(device, rs.camera_info.serial_number)}]
        if len(chosen) == 1:
            return chosen[0]
        serials = ", ".join(sorted(_info(device, rs.camera_info.serial_number) for device in devices))
        if devices and self._own_serial is not None:
            # Another camera's pictures must not take the place of a lost one's: the operator drives by them.
            raise DeviceError(
                "{camera} {serial} is not there any more (there are: {serials}): plug it in, or start again with another one",
                camera=self.name,
                serial=wanted,
                serials=serials,
            )
        if len(chosen) > 1:
            raise DeviceError(f"{len(chosen)} RealSense cameras ({serials}): set camera.serial to one of them")
        if devices:
            raise DeviceError(f"no RealSense camera {wanted}; there are: {serials}: set camera.serial to one of them")
        raise DeviceError("no RealSense camera: plug it into a USB 3 port; main.py doctor --rig realsense says more")

    def _choose_profile(self) -> tuple[Any, Any]:
        """Sensor and stream of the configured size and rate; RGB before BGR."""
        config, offers = self._config, set()
        for wanted in (rs.format.rgb8, rs.format.bgr8):
            for sensor in self._device.query_sensors():
                for profile in sensor.get_stream_profiles():
                    if profile.stream_type() != rs.stream.color or profile.format() != wanted:
                        continue
                    video = profile.as_video_stream_profile()
                    size = (video.width(), video.height(), video.fps())
                    if size == (config.width_px, config.height_px, config.frames_per_second):
                        return sensor, video
                    offers.add(size)
        there = ", ".join(f"{width}x{height} at {fps}/s" for width, height, fps in sorted(offers)) or "no colour stream"
        asked = f"{config.width_px}x{config.height_px} at {config.frames_per_second}/s"
        usb = " (on USB 2 there is less)" if self.info is not None and self.info.usb.startswith("2") else ""
        raise DeviceError(f"{self.name} has no {asked}{usb}: set camera.width_px and the like to one of {there}")

    def _set_up(self, sensor: Any) -> None:
        config = self._config
        # With priority the L515 falls to 4 to 16 pictures a second in dim light.
        self._set(sensor, rs.option.auto_exposure_priority, 0.0)
        self._set(sensor, rs.option.enable_auto_exposure, float(config.exposure_ms is None))
        if config.exposure_ms is not None:
            is_stereo = any(profile.stream_type() == rs.stream.depth for profile in sensor.get_stream_profiles())
            steps_per_ms = _STEREO_STEPS_PER_MS if is_stereo else _RGB_STEPS_PER_MS
            self._set(sensor, rs.option.exposure, config.exposure_ms * steps_per_ms)
        if config.gain is not None:
            self._set(sensor, rs.option.gain, config.gain)
        self._set(sensor, rs.option.enable_auto_white_balance, float(config.white_balance_k is None))
        if config.white_balance_k is not None:
            self._set(sensor, rs.option.white_balance, float(config.white_balance_k))

    def _set(self, sensor: Any, option: Any, value: float) -> None:
        """Set an option, within its range; one that the camera does not have is left out."""
        if not sensor.supports(option) or sensor.is_option_read_only(option):
            _log.info("%s has no %s", self.name, option)
            return
        limits = sensor.get_option_range(option)
        steps = round((min(max(value, limits.min), limits.max) - limits.min) / limits.step) if limits.step else 0
        sensor.set_option(option, limits.min + steps * limits.step if limits.step else min(max(value, limits.min), limits.max))


def colour_image(frame: Any) -> Image:
    """A copy of a colour frame as RGB (H, W, 3); raises DeviceError for a format that is no colour."""
    data, form = np.asanyarray(frame.get_data()), frame.get_profile().format()
    if form == rs.format.rgb8:
        return np.array(data, np.uint8)
    if form == rs.format.bgr8:
        return np.ascontiguousarray(data[..., ::-1])
    raise DeviceError(f"colour format {form} is not known here")


def realsense_camera(config: CameraConfig, make_context: Callable[[], Any] = rs.context) -> LiveCamera:
    """A RealSense camera as a ``Camera``."""
    return LiveCamera(RealSenseSensor(config, make_context), config)


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:120]
