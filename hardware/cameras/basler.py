"""Basler cameras (USB 3, GigE) through Basler's package pypylon, an optional extra that is imported when such a camera is used.

Features of a camera have names that differ between its families (SFNC names, and those of older GigE models, "...Abs"): of several
names the first is taken that the camera can set. The source is Basler's product documentation (docs.baslerweb.com).
"""

from __future__ import annotations

import contextlib
import logging
import re
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.config.models import CameraConfig
from core.devices import DeviceError
from core.messages import message
from hardware.cameras.live import CaptureClock, LiveCamera, SensorFrame

_log = logging.getLogger(__name__)

_FORMATS = ("BayerRG8", "BayerGB8", "BayerGR8", "BayerBG8", "RGB8", "BGR8", "RGB8Packed", "BGR8Packed")
"""Pixel formats by preference: colour of 8 bits, raw first (a third of the bandwidth). A camera with none of them keeps its own."""
_TICKS_PER_S = 1e9
"""Of a time stamp, where the camera does not name its tick: nanoseconds (USB 3, ace 2)."""
_LEAST_RATE = 0.97
"""Share of the asked frame rate that the camera must be able to give; less than all is rounding of its period."""
_OF_PERIOD = 0.9
"""Share of a frame's period that automatic exposure may take: more would cost frames."""
_NO_NUMBER = 1 << 63
"""Frame numbers from here on say that the camera does not count."""


def load_pypylon() -> tuple[Any, Any]:
    """The modules pylon and genicam; raises DeviceError when they are not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of its bindings; made an error, they end the process
            from pypylon import genicam, pylon
    except ModuleNotFoundError:
        raise DeviceError(message("Basler cameras need the package pypylon: pip install pypylon")) from None
    except ImportError as error:
        raise DeviceError("pypylon cannot be loaded ({why}): pip install --force-reinstall pypylon", why=_short(error)) from None
    return pylon, genicam


Load = Callable[[], tuple[Any, Any]]


@dataclass(frozen=True, slots=True)
class BaslerInfo:
    """A camera that pylon can open."""

    name: str
    serial: str


def _info(device: Any) -> BaslerInfo:
    return BaslerInfo(f"{device.GetVendorName()} {device.GetModelName()}".strip(), device.GetSerialNumber())


def find_cameras(load: Load = load_pypylon) -> list[BaslerInfo]:
    """Basler cameras on USB and on the network, which is asked for a quarter of a second.

    Raises DeviceError: without pypylon, or when it cannot look.
    """
    pylon, genicam = load()
    try:
        return [_info(device) for device in pylon.TlFactory.GetInstance().EnumerateDevices()]
    except genicam.GenericException as error:
        raise DeviceError("pylon cannot look for cameras: {why}", why=_short(error)) from None


class BaslerSensor:
    """One Basler camera; `load` gives the modules pylon and genicam.

    Sizes are cut out of the middle of the sensor. What `config` does not name stays as the camera's own start-up set has it,
    binning for example.
    """

    def __init__(self, config: CameraConfig, load: Load = load_pypylon) -> None:
        self._config, self._load = config, load
        self._pylon: Any = None
        self._genicam: Any = None
        self._camera: Any = None
        self._nodes: Any = None
        self._converter: Any = None
        self._ticks_per_s = _TICKS_PER_S
        self._clock = CaptureClock()
        self._own_serial: str | None = None
        self.info: BaslerInfo | None = None

    @property
    def name(self) -> str:
        return self.info.name if self.info is not None else "Basler camera"

    def start(self) -> None:
        self._pylon, self._genicam = self._load()
        try:
            factory = self._pylon.TlFactory.GetInstance()
            device = self._find(factory.EnumerateDevices())
            self.info = _info(device)
            # By its own default such a camera runs freely, whatever triggers its start-up set has.
            self._camera = self._pylon.InstantCamera(factory.CreateDevice(device))
            self._camera.Open()
            self._nodes = self._camera.GetNodeMap()
            self._set_up()
            self._converter = self._pylon.ImageFormatConverter()
            self._converter.OutputPixelFormat = self._pylon.PixelType_RGB8packed
            self._clock = CaptureClock()
            self._camera.StartGrabbing(self._pylon.GrabStrategy_LatestImageOnly)
            self._own_serial = self.info.serial
        except self._genicam.GenericException as error:
            self.stop()
            raise DeviceError(
                "{camera} cannot be started ({why}): close other programs that use it", camera=self.name, why=_short(error)
            ) from None
        except DeviceError:
            self.stop()
            raise

    def read(self, timeout_s: float) -> SensorFrame | None:
        """The newest picture. One that arrived incomplete is left out; the next one's number shows that it is lost."""
        try:
            result = self._camera.RetrieveResult(int(1000 * timeout_s), self._pylon.TimeoutHandling_Return)
            arrived_s = time.monotonic()
            if not result.IsValid():
                if self._camera.IsCameraDeviceRemoved():
                    raise DeviceError("{camera} is lost: check its cable", camera=self.name)
                return None
            try:
                if not result.GrabSucceeded():
                    return None
                image = np.asarray(self._converter.ConvertToArray(result), np.uint8)
                stamp, number = result.GetTimeStamp(), result.GetBlockID()
            finally:
                result.Release()
        except self._genicam.GenericException as error:
            raise DeviceError("{camera} is lost ({why}): check its cable", camera=self.name, why=_short(error)) from None
        captured_s = self._clock.captured_s(arrived_s, stamp / self._ticks_per_s if stamp > 0 else None)
        return SensorFrame(image, captured_s, number if 0 <= number < _NO_NUMBER else None)

    def stop(self) -> None:
        camera, self._camera, self._nodes = self._camera, None, None
        if camera is not None:
            for end in (camera.StopGrabbing, camera.Close, camera.DestroyDevice):
                with contextlib.suppress(self._genicam.GenericException):  # an unplugged camera
                    end()

    def reset(self) -> float:
        """Only opening it again: a network camera that is reset is away for longer than it takes to plug it in again."""
        return 0.0

    def _find(self, devices: Any) -> Any:
        wanted = self._config.serial if self._config.serial is not None else self._own_serial
        chosen = [device for device in devices if wanted in {None, device.GetSerialNumber()}]
        if len(chosen) == 1:
            return chosen[0]
        serials = ", ".join(sorted(device.GetSerialNumber() for device in devices))
        if self._own_serial is not None:
            # Another camera's pictures must not take the place of a lost one's: the operator drives by them.
            raise DeviceError(
                "{camera} {serial} is not there any more: check its cable and supply", camera=self.name, serial=wanted
            )
        if chosen:
            raise DeviceError("{a} Basler cameras ({serials}): set camera.serial to one of them", a=len(chosen), serials=serials)
        if serials:
            raise DeviceError(
                "no Basler camera {serial}; there are: {serials}: set camera.serial to one of them", serial=wanted, serials=serials
            )
        raise DeviceError(message("no Basler camera: check its cable and supply; main.py doctor --rig basler says more"))

    def _set_up(self) -> None:
        config = self._config
        self._choose(_FORMATS, "PixelFormat")
        self._set_size()
        period_us = 1e6 / config.frames_per_second
        self._set(_OF_PERIOD * period_us, "AutoExposureTimeUpperLimit", "AutoExposureTimeAbsUpperLimit")
        self._choose(("Continuous" if config.exposure_ms is None else "Off",), "ExposureAuto")
        if config.exposure_ms is not None:
            self._set(1000.0 * config.exposure_ms, "ExposureTime", "ExposureTimeAbs")
        if config.gain is not None:
            self._choose(("Off",), "GainAuto")
            self._set(config.gain, "Gain", "GainRaw")
        self._set_white_balance()
        if (enable := self._settable("AcquisitionFrameRateEnable")) is not None:
            enable.SetValue(True)
        self._set(config.frames_per_second, "AcquisitionFrameRate", "AcquisitionFrameRateAbs")
        rate = self._value("ResultingFrameRate", "BslResultingAcquisitionFrameRate", "ResultingFrameRateAbs")
        if rate is not None and rate < _LEAST_RATE * config.frames_per_second:
            raise DeviceError(
                "{camera} gives {rate:.1f} pictures/s at {size}: set camera.frames_per_second or camera.exposure_ms lower",
                camera=self.name,
                rate=rate,
                size=f"{config.width_px}x{config.height_px}",
            )
        self._ticks_per_s = float(self._value("GevTimestampTickFrequency") or _TICKS_PER_S)

    def _set_size(self) -> None:
        """The asked size, out of the middle of the sensor; refused with what there is."""
        for offset in ("OffsetX", "OffsetY"):  # they take from the largest size
            self._set(0, offset)
        asked = {"Width": self._config.width_px, "Height": self._config.height_px}
        nodes = {name: self._nodes.GetNode(name) for name in asked}
        limits = {name: (int(node.GetMin()), int(node.GetMax()), int(node.GetInc())) for name, node in nodes.items()}
        if any(not low <= asked[name] <= high or (asked[name] - low) % step for name, (low, high, step) in limits.items()):
            raise DeviceError(
                "{camera} has no {size}: set camera.width_px to {widths}, and camera.height_px to {heights}",
                camera=self.name,
                size=f"{asked['Width']}x{asked['Height']}",
                widths=_range(*limits["Width"]),
                heights=_range(*limits["Height"]),
            )
        for name, node in nodes.items():
            if node.GetValue() != asked[name]:
                node.SetValue(asked[name])
        for name in ("OffsetX", "OffsetY"):
            if (offset_node := self._settable(name)) is not None:
                self._set((offset_node.GetMin() + offset_node.GetMax()) // 2, name)

    def _set_white_balance(self) -> None:
        """Automatic, or the preset of a light source next to the asked temperature, which is in its name (Daylight6500K)."""
        kelvin = self._config.white_balance_k
        self._choose(("Continuous" if kelvin is None else "Off",), "BalanceWhiteAuto")
        preset = self._settable("LightSourcePreset", "BslLightSourcePreset")
        if kelvin is None or preset is None:
            return
        for colour in ("Red", "Green", "Blue"):  # neutral: on some models a preset acts on top of them
            self._choose((colour,), "BalanceRatioSelector")
            self._set(1.0, "BalanceRatio", "BalanceRatioAbs")
        named = {name: int(found[1]) for name in preset.GetSettableValues() if (found := re.search(r"(\d{4,5})K$", name))}
        if named:
            preset.SetValue(min(named, key=lambda name: abs(named[name] - kelvin)))

    def _settable(self, *names: str) -> Any:
        """The first of these features that can be set now; None: the camera has none."""
        nodes = [self._nodes.GetNode(name) for name in names]
        return next((node for node in nodes if node is not None and self._genicam.IsWritable(node)), None)

    def _value(self, *names: str) -> float | None:
        nodes = [self._nodes.GetNode(name) for name in names]
        return next((node.GetValue() for node in nodes if node is not None and self._genicam.IsReadable(node)), None)

    def _set(self, value: float, *names: str) -> None:
        """Set a number, within its range and in its steps; one that the camera does not have is left out."""
        node = self._settable(*names)
        if node is None:
            _log.info("%s has no %s", self.name, names[0])
            return
        low, high = node.GetMin(), node.GetMax()
        within = min(max(value, low), high)
        node.SetValue(low + int(within - low) // node.GetInc() * node.GetInc() if isinstance(low, int) else float(within))

    def _choose(self, wanted: tuple[str, ...], name: str) -> None:
        """Set a feature to the first of these values that it can have."""
        node = self._settable(name)
        there = set(node.GetSettableValues()) if node is not None else set()
        value = next((value for value in wanted if value in there), None)
        if value is not None:
            node.SetValue(value)
        else:
            _log.info("%s has no %s = %s", self.name, name, " or ".join(wanted))


def _range(low: int, high: int, step: int) -> str:
    return f"{low} to {high}" if step == 1 else f"{low} to {high} in steps of {step}"


def _short(error: Exception) -> str:
    """Without where in Basler's sources it was raised."""
    return " ".join(str(error).partition(" : ")[0].split())[:120]


def basler_camera(config: CameraConfig, load: Load = load_pypylon) -> LiveCamera:
    """A Basler camera as a ``Camera``."""
    return LiveCamera(BaslerSensor(config, load), config)
