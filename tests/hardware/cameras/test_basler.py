"""Basler cameras: one contract on a stand-in for a part of pypylon, and on the vendor's emulated camera where pypylon is there."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from core.config.models import CameraConfig
from core.devices import DeviceError
from core.types import Image
from hardware.cameras import sysfs
from hardware.cameras.basler import BaslerInfo, BaslerSensor, basler_camera, find_cameras, load_pypylon
from hardware.cameras.live import LiveCamera
from hardware.cameras.registry import CAMERA_KINDS, FoundCamera
from tests.hardware.soft_cameras import CONFIG, HEIGHT, PERIOD_S, WIDTH, picture, take_frames, until_back, until_lost

EMULATED = ("0815-0000", "0815-0001")
"""Serial numbers of Basler's emulated cameras."""


# --- the stand-in: names, ranges and behaviour as of pypylon 26.9 ----------------------------------------------------------------


class GenericException(Exception):
    """The base of what pypylon raises."""


@dataclass
class Node:
    """A feature. ``high`` may depend on others; ``values`` are those of an enumeration."""

    value: Any
    low: float = 0
    high: Callable[[], float] = lambda: 0
    step: int = 1
    values: tuple[str, ...] = ()
    writable: bool = True
    now: Callable[[], Any] | None = None

    def GetValue(self) -> Any:
        return self.value if self.now is None else self.now()

    def SetValue(self, value: Any) -> None:
        if not self.writable:
            raise GenericException("Node is not writable. : AccessException thrown in node")
        if self.values and value not in self.values:
            raise GenericException("cannot convert value : InvalidArgumentException thrown")
        if not self.values and not isinstance(self.value, bool):
            assert type(value) is type(self.value)  # its bindings take no float for an integer
            if not self.low <= value <= self.high() or (isinstance(value, int) and (value - self.low) % self.step):
                raise GenericException(f"Value = {value} must be equal or smaller than Max = {self.high()}. : OutOfRangeException")
        self.value = value

    def GetMin(self) -> float:
        return self.low

    def GetMax(self) -> float:
        return self.high()

    def GetInc(self) -> int:
        return self.step

    def GetSettableValues(self) -> tuple[str, ...]:
        return self.values


class Missing:
    """What the node map gives for a feature that the camera does not have."""


AUTOMATIC = ("Off", "Once", "Continuous")


@dataclass
class Device:
    """A camera on its cable. Colour and USB 3, or monochrome and an older GigE model."""

    serial: str
    is_colour: bool = True
    plugged: bool = True
    silent: bool = False
    busy: bool = False
    incomplete: set[int] = field(default_factory=set)
    nodes: dict[str, Node] = field(default_factory=dict)

    def __post_init__(self) -> None:
        nodes = self.nodes
        for size, offset, all_px in (("Width", "OffsetX", 1920), ("Height", "OffsetY", 1200)):
            nodes[size] = Node(all_px, 16, lambda offset=offset, all_px=all_px: all_px - nodes[offset].value, 4)
            nodes[offset] = Node(8, 0, lambda size=size, all_px=all_px: all_px - nodes[size].value, 4)
            nodes[size].value -= 8
        nodes["ExposureAuto"] = Node("Off", values=AUTOMATIC)
        nodes["GainAuto"] = Node("Continuous", values=AUTOMATIC)
        nodes["AcquisitionFrameRateEnable"] = Node(False)
        end = "" if self.is_colour else "Abs"
        limit = "AutoExposureTimeUpperLimit" if self.is_colour else "AutoExposureTimeAbsUpperLimit"
        nodes[f"ExposureTime{end}"] = Node(5000.0, 20.0, lambda: 1e7)
        nodes[limit] = Node(1e6, 20.0, lambda: 1e6)
        nodes[f"AcquisitionFrameRate{end}"] = Node(10.0, 0.01, lambda: 5000.0)
        nodes[f"ResultingFrameRate{end}"] = Node(0.0, writable=False, now=self.rate)
        if self.is_colour:
            nodes["PixelFormat"] = Node("Mono8", values=("Mono8", "Mono12", "BayerRG8", "BayerRG12", "YCbCr422_8"))
            nodes["Gain"] = Node(0.0, 0.0, lambda: 24.0)
            nodes["BalanceWhiteAuto"] = Node("Off", values=AUTOMATIC)
            nodes["BalanceRatioSelector"] = Node("Red", values=("Red", "Green", "Blue"))
            nodes["BalanceRatio"] = Node(1.7, 0.0, lambda: 16.0)
            nodes["LightSourcePreset"] = Node("Off", values=("Off", "Daylight5000K", "Daylight6500K", "Tungsten2800K"))
        else:
            nodes["PixelFormat"] = Node("Mono12", values=("Mono8", "Mono12", "Mono12Packed"))
            nodes["GainRaw"] = Node(136, 136, lambda: 542, 2)
            nodes["GevTimestampTickFrequency"] = Node(125_000_000, writable=False)

    def rate(self) -> float:
        """Frames a second, by rate and exposure."""
        end = "" if self.is_colour else "Abs"
        asked = self.nodes[f"AcquisitionFrameRate{end}"].value if self.nodes["AcquisitionFrameRateEnable"].value else 1e9
        return min(asked, 1e6 / self.nodes[f"ExposureTime{end}"].value, 160.0)

    def GetNode(self, name: str) -> Node | Missing:
        return self.nodes.get(name, Missing())

    def GetVendorName(self) -> str:
        return "Basler"

    def GetModelName(self) -> str:
        return "acA1920-40uc" if self.is_colour else "acA1920-40gm"

    def GetSerialNumber(self) -> str:
        return self.serial


@dataclass
class Result:
    """A grab result; ``number`` None: the time limit passed."""

    number: int | None
    stamp: int = 0
    whole: bool = True
    released: bool = False

    def IsValid(self) -> bool:
        return self.number is not None

    def GrabSucceeded(self) -> bool:
        return self.whole

    def GetBlockID(self) -> int:
        return -1 if self.number is None else self.number

    def GetTimeStamp(self) -> int:
        return self.stamp

    def Release(self) -> None:
        self.released = True


class InstantCamera:
    """Gives the newest frame by the clock, as GrabStrategy_LatestImageOnly does."""

    def __init__(self, device: Device, library: SoftPylon) -> None:
        self.device, self._library = device, library
        self._began_s, self._number = 0.0, -1
        self._is_open = self._is_grabbing = False

    def Open(self) -> None:
        if self.device.busy:
            raise GenericException("The device is controlled by another application. : RuntimeException thrown (file 'x.cpp')")
        self._is_open = True

    def GetNodeMap(self) -> Device:
        return self.device

    def StartGrabbing(self, strategy: str) -> None:
        assert strategy == "LatestImageOnly" and self._is_open
        self._began_s, self._number, self._is_grabbing = time.monotonic(), -1, True

    def RetrieveResult(self, timeout_ms: int, handling: str) -> Result:
        assert handling == "Return"
        until_s = time.monotonic() + timeout_ms / 1000.0
        while self._is_grabbing and self.device.plugged and time.monotonic() < until_s:
            number = int((time.monotonic() - self._began_s) * self.device.rate())
            if number > self._number and not self.device.silent:
                self._number = number
                ticks = 1_000_000_000 if self.device.is_colour else 125_000_000
                stamp = int((self._began_s + number / self.device.rate()) * ticks)
                self._library.results.append(Result(number, stamp, number not in self.device.incomplete))
                return self._library.results[-1]
            time.sleep(0.001)
        return Result(None)

    def IsCameraDeviceRemoved(self) -> bool:
        return not self.device.plugged

    def StopGrabbing(self) -> None:
        self._is_grabbing = False

    def Close(self) -> None:
        self._is_open = False
        if not self.device.plugged:
            raise GenericException("The device has been removed. : RuntimeException thrown")

    def DestroyDevice(self) -> None:
        self._library.alive.remove(self)


class ImageFormatConverter:
    OutputPixelFormat = ""

    def ConvertToArray(self, result: Result) -> Image:
        assert self.OutputPixelFormat == "RGB8" and result.number is not None and not result.released
        return picture(result.number)


class SoftPylon:
    """The modules pylon and genicam with some cameras; ``load`` gives them as ``load_pypylon`` does."""

    def __init__(self, *devices: Device) -> None:
        self.devices = list(devices)
        self.results: list[Result] = []
        self.alive: list[InstantCamera] = []
        self.broken = ""

    def load(self) -> tuple[Any, Any]:
        pylon = SimpleNamespace(
            TlFactory=SimpleNamespace(GetInstance=lambda: self),
            InstantCamera=self._made,
            ImageFormatConverter=ImageFormatConverter,
            PixelType_RGB8packed="RGB8",
            GrabStrategy_LatestImageOnly="LatestImageOnly",
            TimeoutHandling_Return="Return",
        )
        genicam = SimpleNamespace(
            GenericException=GenericException,
            IsWritable=lambda node: isinstance(node, Node) and node.writable,
            IsReadable=lambda node: isinstance(node, Node),
        )
        return pylon, genicam

    def _made(self, device: Device) -> InstantCamera:
        self.alive.append(InstantCamera(device, self))
        return self.alive[-1]

    def EnumerateDevices(self) -> tuple[Device, ...]:
        if self.broken:
            raise GenericException(self.broken)
        return tuple(device for device in self.devices if device.plugged)

    def CreateDevice(self, device: Device) -> Device:
        return device


# --- the contract, on both -------------------------------------------------------------------------------------------------------


@dataclass
class Bench:
    """Two cameras to plug and to silence."""

    load: Callable[[], tuple[Any, Any]]
    model: str
    plug: Callable[[int], None]
    silence: Callable[[LiveCamera], None]


@pytest.fixture(params=["stand-in", "emulated"])
def bench(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Bench:
    if request.param == "stand-in":
        soft = SoftPylon(*(Device(serial) for serial in EMULATED))

        def plug(count: int) -> None:
            for k, device in enumerate(soft.devices):
                device.plugged, device.silent = k < count, False

        return Bench(soft.load, "Basler acA1920-40uc", plug, lambda _: setattr(soft.devices[0], "silent", True))
    if find_spec("pypylon") is None:
        pytest.skip("pypylon is not installed (pip install pypylon)")
    monkeypatch.setenv("PYLON_CAMEMU", "2")
    load_pypylon()

    def wait_for_a_trigger(camera: LiveCamera) -> None:
        camera._sensor._nodes.GetNode("TriggerMode").SetValue("On")

    return Bench(load_pypylon, "Basler Emulation", lambda count: monkeypatch.setenv("PYLON_CAMEMU", str(count)), wait_for_a_trigger)


FIRST = CONFIG.model_copy(update={"serial": EMULATED[0]})


def _nodes(sensor: BaslerSensor, *names: str) -> list[Any]:
    return [sensor._nodes.GetNode(name).GetValue() for name in names]


def test_cameras_are_listed(bench: Bench) -> None:
    assert find_cameras(bench.load) == [BaslerInfo(bench.model, serial) for serial in EMULATED]
    bench.plug(0)
    assert find_cameras(bench.load) == []


def test_frames_come_in_rgb_with_their_time(bench: Bench) -> None:
    camera = basler_camera(FIRST, bench.load)
    began_s = time.monotonic()
    camera.open()
    try:
        frames = take_frames(camera, 10)
    finally:
        camera.close()
    assert camera.name == bench.model
    for frame in frames:
        assert frame.image.shape == (HEIGHT, WIDTH, 3) and frame.image.dtype == np.uint8 and frame.image.flags.owndata
    times_s = [began_s, *(frame.captured_s for frame in frames), time.monotonic()]
    assert times_s == sorted(times_s)
    assert not np.array_equal(frames[0].image, frames[-1].image)


def test_the_newest_frame_wins_and_the_skipped_ones_are_counted(bench: Bench) -> None:
    sensor = BaslerSensor(FIRST, bench.load)
    sensor.start()
    try:
        first = sensor.read(2.0)
        time.sleep(10 * PERIOD_S)
        second = sensor.read(2.0)
    finally:
        sensor.stop()
    assert first is not None and second is not None and first.number is not None and second.number is not None
    assert second.number - first.number >= 5


def test_the_camera_is_set_up_as_configured(bench: Bench) -> None:
    sensor = BaslerSensor(FIRST.model_copy(update={"exposure_ms": 8.0, "gain": 6.0}), bench.load)
    sensor.start()
    try:
        assert _nodes(sensor, "Width", "Height", "ExposureAuto", "GainAuto") == [WIDTH, HEIGHT, "Off", "Off"]
        assert _nodes(sensor, "ExposureTime", "Gain", "AcquisitionFrameRate") == [8000.0, pytest.approx(6.0, abs=0.01), 30.0]
        assert _nodes(sensor, "AcquisitionFrameRateEnable", "PixelFormat") == [True, "BayerRG8"]
        x_px, y_px = (sensor._nodes.GetNode(name) for name in ("OffsetX", "OffsetY"))
        assert all(abs(node.GetValue() - node.GetMax() / 2) <= node.GetInc() for node in (x_px, y_px))  # the sensor's middle
    finally:
        sensor.stop()
    automatic = BaslerSensor(FIRST, bench.load)
    automatic.start()
    assert _nodes(automatic, "ExposureAuto") == ["Continuous"]
    automatic.stop()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"height_px": 4097}, r"has no 160x4097: set camera.width_px to \d+ to \d+.*, and camera.height_px to \d+ to \d+"),
        ({"serial": "x"}, f"no Basler camera x; there are: {', '.join(EMULATED)}: set camera.serial"),
        ({"serial": None}, rf"2 Basler cameras \({', '.join(EMULATED)}\): set camera.serial"),
    ],
)
def test_what_is_not_there_is_named(bench: Bench, change: dict[str, object], text: str) -> None:
    with pytest.raises(DeviceError, match=text) as caught:
        basler_camera(FIRST.model_copy(update=change), bench.load).open()
    assert "\n" not in str(caught.value)


def test_without_a_camera_there_is_one_line(bench: Bench) -> None:
    bench.plug(0)
    with pytest.raises(DeviceError, match="no Basler camera: check its cable and supply"):
        basler_camera(CONFIG, bench.load).open()


def test_another_camera_does_not_take_the_place_of_a_lost_one(bench: Bench) -> None:
    bench.plug(1)
    sensor = BaslerSensor(CONFIG, bench.load)
    sensor.start()
    sensor.stop()
    bench.plug(0)
    with pytest.raises(DeviceError, match=f"{bench.model} {EMULATED[0]} is not there any more: check its cable"):
        sensor.start()
    bench.plug(2)  # no choice to be made either: it is known which one
    sensor.start()
    sensor.stop()
    assert sensor.info == BaslerInfo(bench.model, EMULATED[0])


@pytest.mark.parametrize("how", ["silent", "unplugged"])
def test_a_camera_is_lost_and_found(bench: Bench, how: str) -> None:
    camera = basler_camera(FIRST, bench.load)
    camera.open()
    try:
        before = take_frames(camera, 3)[-1]
        if how == "unplugged":
            bench.plug(0)
        bench.silence(camera)
        lost = until_lost(camera)
        bench.plug(2)
        after = until_back(camera)
    finally:
        camera.close()
    assert "cable" in str(lost) and "\n" not in str(lost)
    assert after.index > before.index and after.captured_s > before.captured_s


# --- what only the stand-in can do -----------------------------------------------------------------------------------------------


def _started(device: Device, **settings: object) -> BaslerSensor:
    sensor = BaslerSensor(CameraConfig.model_validate({**CONFIG.model_dump(), **settings}), SoftPylon(device).load)
    sensor.start()
    return sensor


def test_pictures_and_times_are_exactly_those_of_the_camera() -> None:
    soft = SoftPylon(Device("1", is_colour=False))
    sensor = BaslerSensor(CONFIG, soft.load)
    sensor.start()
    found = [frame for frame in (sensor.read(1.0) for _ in range(5)) if frame is not None]
    sensor.stop()
    assert len(found) == 5 and soft.alive == []
    assert all(result.released for result in soft.results)
    for frame in found:
        assert frame.number is not None and np.array_equal(frame.image, picture(frame.number))
    for before, after in zip(found, found[1:], strict=False):  # its stamps count 8 ns; arrivals only shift them together
        apart = after.number - before.number
        assert after.captured_s - before.captured_s <= apart * PERIOD_S + 1e-6


def test_an_incomplete_picture_is_none_and_counts_as_lost() -> None:
    device = Device("1", incomplete={number for number in range(300) if number % 3})
    camera = basler_camera(CONFIG, SoftPylon(device).load)
    camera.open()
    frames = take_frames(camera, 4)
    camera.close()
    numbers = [next(k for k in range(300) if np.array_equal(frame.image, picture(k))) for frame in frames]
    assert not device.incomplete & set(numbers)
    assert frames[-1].lost - frames[0].lost == numbers[-1] - numbers[0] - (frames[-1].index - frames[0].index) >= 6


def test_an_older_gige_camera_has_other_names() -> None:
    device = Device("1", is_colour=False)
    sensor = _started(device, exposure_ms=8.0, gain=201.0, white_balance_k=5000)
    value = {name: node.GetValue() for name, node in device.nodes.items()}
    assert (value["ExposureTimeAbs"], value["GainRaw"], value["AcquisitionFrameRateAbs"]) == (8000.0, 200, 30.0)
    assert value["PixelFormat"] == "Mono12"  # it has no colour, and keeps what it is set to
    sensor.stop()


def test_automatic_exposure_never_costs_frames() -> None:
    for device in (Device("1"), Device("2", is_colour=False)):
        _started(device).stop()
        limit = next(node for name, node in device.nodes.items() if name.endswith("UpperLimit"))
        assert device.nodes["ExposureAuto"].value == "Continuous"
        assert limit.value == pytest.approx(0.9e6 / 30)


@pytest.mark.parametrize(("kelvin", "preset"), [(2700, "Tungsten2800K"), (4500, "Daylight5000K"), (9000, "Daylight6500K")])
def test_a_colour_temperature_is_the_nearest_preset(kelvin: int, preset: str) -> None:
    device = Device("1")
    _started(device, white_balance_k=kelvin).stop()
    assert [device.nodes[name].value for name in ("BalanceWhiteAuto", "BalanceRatio")] == ["Off", 1.0]
    assert device.nodes["LightSourcePreset"].value == preset
    _started(device).stop()
    assert device.nodes["BalanceWhiteAuto"].value == "Continuous"


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"exposure_ms": 50.0}, r"gives 20\.0 pictures/s at 160x120: set camera.frames_per_second or camera.exposure_ms"),
        ({"frames_per_second": 200}, r"gives 160\.0 pictures/s at 160x120"),
        ({"width_px": 162}, "has no 162x120: set camera.width_px to 16 to 1920 in steps of 4"),
    ],
)
def test_what_the_camera_cannot_do_is_refused_and_it_is_let_go(settings: dict[str, object], text: str) -> None:
    soft = SoftPylon(Device("1"))
    with pytest.raises(DeviceError, match=text):
        BaslerSensor(CameraConfig.model_validate({**CONFIG.model_dump(), **settings}), soft.load).start()
    assert soft.alive == []


def test_a_camera_that_another_program_has_is_one_line() -> None:
    soft = SoftPylon(Device("1", busy=True))
    with pytest.raises(DeviceError) as caught:
        basler_camera(CONFIG, soft.load).open()
    assert str(caught.value) == (
        "Basler acA1920-40uc cannot be started (The device is controlled by another application.): close other programs that use it"
    )
    assert soft.alive == []


def test_an_unplugged_camera_is_noticed_at_once() -> None:
    soft = SoftPylon(Device("1"))
    sensor = BaslerSensor(CONFIG, soft.load)
    sensor.start()
    soft.devices[0].plugged = False
    with pytest.raises(DeviceError, match="acA1920-40uc is lost: check its cable"):
        sensor.read(0.1)
    sensor.stop()
    assert soft.alive == []


# --- doctor, wizard, and without the package -------------------------------------------------------------------------------------


@pytest.fixture
def plugged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SoftPylon:
    """A computer with the package, and its folder for /sys; no camera yet."""
    soft = SoftPylon()
    monkeypatch.setattr(sysfs, "SYS", tmp_path)
    monkeypatch.setattr("hardware.cameras.basler.find_cameras", lambda: find_cameras(soft.load))
    monkeypatch.setattr("hardware.cameras.registry.find_spec", lambda _: object())
    return soft


def _plug_usb(folder: Path) -> None:
    device = folder / "bus" / "usb" / "devices" / "2-1"
    device.mkdir(parents=True)
    for name, text in {"idVendor": "2676", "product": "acA1920-40uc", "serial": "1", "speed": "5000"}.items():
        (device / name).write_text(text + "\n")


KIND = CAMERA_KINDS["basler"]


def test_search_and_check(plugged: SoftPylon, tmp_path: Path) -> None:
    check = KIND.check
    assert check is not None
    missing = check(CONFIG)
    assert (missing.ok, missing.detail) == (False, "no Basler camera") and "USB 3 port" in missing.fix
    _plug_usb(tmp_path)
    forbidden = check(CONFIG)
    assert "cannot be opened" in forbidden.detail and "69-basler-cameras.rules" in forbidden.fix
    plugged.devices[:] = [Device("1")]
    assert (check(CONFIG).ok, check(CONFIG).detail) == (True, "Basler acA1920-40uc 1")
    assert KIND.find() == [FoundCamera("basler", "Basler acA1920-40uc 1", serial="1")]
    plugged.devices.append(Device("2"))
    assert (check(CONFIG).ok, check(CONFIG).detail) == (False, "2 Basler cameras: 1, 2")
    other = check(CONFIG.model_copy(update={"serial": "3"}))
    assert (other.ok, other.detail) == (False, "no Basler camera 3; there are: 1, 2")
    plugged.broken = "No network. : RuntimeException thrown"
    with pytest.raises(DeviceError, match=r"pylon cannot look for cameras: No network\.$"):
        KIND.find()


def test_without_the_package_one_line_says_what_to_install(
    plugged: SoftPylon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pypylon", None)
    monkeypatch.setattr("hardware.cameras.registry.find_spec", find_spec)
    monkeypatch.setattr("hardware.cameras.basler.find_cameras", find_cameras)
    assert KIND.find() == ()  # most computers have no such camera
    _plug_usb(tmp_path)
    wanted = "Basler cameras need the package pypylon: pip install pypylon"
    with pytest.raises(DeviceError, match=f"^{wanted}$"):
        KIND.find()
    assert KIND.live is not None and KIND.check is not None
    with pytest.raises(DeviceError, match=f"^{wanted}$"):
        KIND.live(CONFIG).open()
    found = KIND.check(CONFIG)
    assert not found.ok and found.fix.endswith("pip install pypylon")
