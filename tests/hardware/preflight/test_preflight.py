"""The preflight against fakes: folders for /dev and /sys, pseudo-terminals as ports, software servos, spoilt copies of a model."""

from __future__ import annotations

import json
import os
import pty
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from core.config.models import Config, GamepadConfig, PedalConfig, PerceptionConfig, RecordConfig, RigConfig, SegmentationConfig
from core.config.safety import ServosConfig
from core.devices import DeviceError
from core.perception.model_file import INFO, MODELS, ONNX_INT8, SECOND_LOOK
from core.types import Frame, Image
from hardware.cameras import realsense, sysfs
from hardware.cameras.realsense import RealSenseInfo
from hardware.preflight import checks, device_checks
from hardware.preflight import model_checks as model
from hardware.preflight.checks import Check
from hardware.preflight.preflight import CHECKS, Level, driving_checks, level_of, run_checks
from hardware.twin.servos.bus import SoftServoBus
from tests.hardware.soft_pedal import SoftPedal

ROOT = Path(__file__).resolve().parents[3]
L515 = RealSenseInfo("Intel RealSense L515", "f1", "1.5.8.1", "1.5.8.1", "3.2")
D435 = RealSenseInfo("Intel RealSense D435", "d2")


def _bad(check: Check, detail: str, fix: str) -> None:
    """Not ok, and both texts are one line that contains this."""
    assert not check.ok
    assert re.search(detail, check.detail), check.detail
    assert re.search(fix, check.fix), check.fix
    assert "\n" not in check.detail + check.fix


def _good(check: Check, detail: str = "") -> None:
    assert check.ok, check
    assert re.search(detail, check.detail), check.detail
    assert check.fix == ""


# --- the program -----------------------------------------------------------------------------------------------------------------


def test_only_python_3_11_will_do() -> None:
    _good(checks.check_python((3, 11, 9)), r"3\.11\.9")
    _bad(checks.check_python((3, 14, 0)), r"3\.14\.0", r"Python 3\.11")


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    path = tmp_path / "requirements.lock"
    lines = ["# a comment", "# --- to run", "numpy==2.4.6", "openvino-telemetry==1.0", "pyrealsense2==2.54.2.5684", "torch==2.13.0"]
    path.write_text("\n".join([*lines, "# --- to test", "pytest==9.2.0", ""]))
    return path


class _Installed(dict[str, str]):
    def __call__(self, name: str) -> str:
        if name not in self:
            raise metadata.PackageNotFoundError(name)
        return self[name]


def test_packages_are_compared_with_the_lock(lock: Path) -> None:
    there = _Installed({"numpy": "2.4.6", "pyrealsense2": "2.54.2.5684", "torch": "2.13.0+cpu"})
    _good(checks.check_packages(lock, there), "^3 as pinned$")  # what tests need does not count, nor what set-up removes
    there |= {"pyrealsense2": "2.55.1.6486"}
    _bad(checks.check_packages(lock, there), r"pyrealsense2 2\.55\.1\.6486 instead of 2\.54\.2\.5684", "make setup")
    del there["numpy"]
    _bad(checks.check_packages(lock, there), r"numpy missing instead of 2\.4\.6; pyrealsense2", "make setup")
    _bad(checks.check_packages(lock.with_name("gone.lock"), there), "cannot be read", "restore")


def test_the_list_of_libraries_is_the_one_of_set_up() -> None:
    text = (ROOT / "scripts" / "set_up.sh").read_text(encoding="utf-8")
    listed = re.search(r'^libraries="\n(.*?)^"', text, re.MULTILINE | re.DOTALL)
    assert listed
    assert dict(line.split() for line in listed[1].splitlines()) == checks.LIBRARIES


def test_a_missing_library_is_one_command() -> None:
    def load(library: str) -> None:
        if library.startswith("libxcb-c"):
            raise OSError(f"{library}: cannot open shared object file")

    _good(checks.check_libraries(lambda _: None), "12 can be loaded")
    _bad(checks.check_libraries(load), "missing: libxcb-cursor.so.0$", "sudo apt-get install .* libxcb-cursor0$")


def test_a_display(tmp_path: Path) -> None:
    def answers(display: str) -> bool:
        return display == ":5"

    _bad(checks.check_display({}, answers), "none", "xvfb-run")
    _good(checks.check_display({"DISPLAY": ":5"}, answers), "X11, :5")
    _bad(checks.check_display({"DISPLAY": ":6"}, answers), "no X server", "xvfb-run")
    _good(checks.check_display({"QT_QPA_PLATFORM": "offscreen"}, answers), "nothing is shown")
    wayland = {"WAYLAND_DISPLAY": "wayland-0", "XDG_RUNTIME_DIR": str(tmp_path)}
    _bad(checks.check_display(wayland, answers), "wayland-0", "desktop session")
    (tmp_path / "wayland-0").touch()
    _good(checks.check_display(wayland, answers), "Wayland")


def test_no_x_server_is_noticed_by_connecting() -> None:
    assert not checks.x_server_answers(":6123")


# --- the computer ----------------------------------------------------------------------------------------------------------------


def test_cores_and_memory() -> None:
    _good(checks.check_machine(4, lambda: (16.0, 9.0)), "4 cores, 16.0 GB")
    _bad(checks.check_machine(1, lambda: (16.0, 9.0)), "^1 core, ", "2 cores or more")
    _bad(checks.check_machine(4, lambda: (16.0, 0.4)), "0.4 GB free", "close other programs")


def test_room_for_recordings(tmp_path: Path) -> None:
    config = RecordConfig(folder=str(tmp_path / "not" / "yet"))
    _good(checks.check_disk(config, lambda _: (100_000_000_000, 0, 50_000_000_000)), "50.0 GB free of 100.0 GB")
    _bad(checks.check_disk(config, lambda _: (100_000_000_000, 0, 5_000_000_000)), "5.0 GB free", r"7\.0 GB or more")
    (tmp_path / "not").write_text("a file")
    _bad(checks.check_disk(config), "is no folder", "record.folder")


def test_the_date() -> None:
    _good(checks.check_clock(), "UTC")
    _bad(checks.check_clock(lambda: 1e6), "1970.*date is wrong", "set-ntp")


# --- the model -------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    return Path(shutil.copytree(MODELS / "default", tmp_path / "copy"))


def _segmentation(folder: Path | str) -> PerceptionConfig:
    return PerceptionConfig(segmentation=SegmentationConfig(model=str(folder), device="openvino", threads=1))


def test_a_whole_model_passes_and_a_flipped_bit_is_found(copied: Path) -> None:
    _good(model.check_model("default"), "SHA-256")
    data = bytearray((copied / ONNX_INT8).read_bytes())
    data[len(data) // 2] ^= 1
    (copied / ONNX_INT8).write_bytes(data)
    _bad(model.check_model(str(copied)), "SHA-256 differs", "restore the model folder")
    _bad(model.check_self_test(_segmentation(copied)), "not run: .*SHA-256", "restore")
    _bad(model.check_model(str(copied / "gone")), "no model", "restore|set perception")


@pytest.mark.parametrize("part", ["calibration", "familiarity"])
def test_a_model_that_is_not_calibrated_is_told(copied: Path, part: str) -> None:
    assert "calibrated" not in model.check_model(str(copied)).detail
    manifest = json.loads((copied / INFO).read_text())
    (copied / INFO).write_text(json.dumps(manifest | {part: None}))
    found = model.check_model(str(copied))
    assert found.ok
    assert found.detail.endswith("its confidence is not calibrated: it drives no real rig")


def test_a_model_that_has_lost_its_second_look_does_not_pass(copied: Path) -> None:
    shutil.rmtree(copied / SECOND_LOOK)
    _bad(model.check_model(str(copied)), "second_look.*missing", "restore the model folder")
    _bad(model.check_self_test(_segmentation(copied)), "not run: .*second_look", "restore")


def test_the_shipped_model_passes_and_eight_bits_that_a_processor_gets_wrong_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first look is exact here, the second one is off where it looks at one window by itself."""
    _good(model.check_self_test(_segmentation("default")), "state . .true .., theta off by")
    apart = model._apart
    off = iter((0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    monkeypatch.setattr(model, "_apart", lambda some, others: next(off) + 0.0 * apart(some, others))
    _bad(model.check_self_test(_segmentation("default")), "eight-bit network is off by 1.000", "precision to fp32")


# --- cameras ---------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def dev(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "dev"
    (folder / "v4l" / "by-id").mkdir(parents=True)
    monkeypatch.setattr(sysfs, "DEV", folder)
    return folder


@pytest.fixture
def sys_(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "sys"
    folder.mkdir()
    monkeypatch.setattr(sysfs, "SYS", folder)
    return folder


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch, dev: Path, sys_: Path) -> list[RealSenseInfo]:
    """The RealSense cameras that the library finds; there is nothing else."""
    found: list[RealSenseInfo] = []
    monkeypatch.setattr(realsense, "find_cameras", lambda: found)
    return found


def _plug_realsense(sys_: Path, mbit_s: str) -> None:
    folder = sys_ / "bus" / "usb" / "devices" / "2-1"
    folder.mkdir(parents=True)
    for name, text in {"idVendor": "8086", "product": "Intel(R) RealSense(TM) L515", "serial": "f1", "speed": mbit_s}.items():
        (folder / name).write_text(text + "\n")


def _plug_webcam(dev: Path, sys_: Path, number: int, title: str) -> None:
    for index in (0, 1):  # the second node carries metadata
        folder = sys_ / "class" / "video4linux" / f"video{2 * number + index}"
        folder.mkdir(parents=True)
        (folder / "name").write_text(title + "\n")
        (folder / "index").write_text(f"{index}\n")
        (dev / folder.name).touch()
    (dev / "v4l" / "by-id" / f"usb-{title}-index0").symlink_to(dev / f"video{2 * number}")


def _rig(**settings: object) -> Config:
    camera = {name: settings.pop(name) for name in ("serial", "device") if name in settings}
    return Config.model_validate({"rig": {"robot": "none"} | settings, "camera": camera})


def test_the_twin_needs_no_camera_and_a_recording_must_be_there(tmp_path: Path) -> None:
    _good(device_checks.check_camera(Config()), "twin needs none")
    config = _rig(camera="video_file", source=str(tmp_path / "v.mp4"))
    _bad(device_checks.check_camera(config), "is not there", "rig.source")
    (tmp_path / "v.mp4").touch()
    _good(device_checks.check_camera(config), "v.mp4")
    _bad(device_checks.check_camera(_rig(camera="image_folder")), "None is not there", "rig.source")


@pytest.mark.parametrize(
    ("there", "settings", "detail", "fix"),
    [
        ([L515], {}, r"L515 f1, firmware 1\.5\.8\.1, USB 3\.2", None),
        ([L515, D435], {"serial": "d2"}, "D435 d2", None),
        ([], {}, "no RealSense camera", "plug it"),
        ([L515, D435], {}, "2 RealSense cameras: f1, d2", "camera.serial"),
        ([L515], {"serial": "x"}, "no RealSense camera x", "serial"),
        ([replace(L515, usb="2.1")], {}, r"USB 2\.1", "USB 3 port"),
        ([replace(L515, firmware="1.5.1.3")], {}, r"1\.5\.1\.3", r"firmware to 1\.5\.8\.1"),
    ],
)
def test_a_realsense_camera(
    plugged: list[RealSenseInfo], there: list[RealSenseInfo], settings: dict[str, object], detail: str, fix: str | None
) -> None:
    plugged += there
    check = device_checks.check_camera(_rig(camera="realsense", **settings))
    if fix is None:
        _good(check, detail)
    else:
        _bad(check, detail, fix)


def test_a_realsense_camera_on_usb_2_and_one_that_cannot_be_opened(plugged: list[RealSenseInfo], sys_: Path) -> None:
    _plug_realsense(sys_, "480")
    _bad(device_checks.check_camera(_rig(camera="realsense")), "cannot be opened", "udevadm trigger")
    plugged.append(RealSenseInfo("Intel RealSense L515", "f1"))
    _bad(device_checks.check_camera(_rig(camera="realsense")), "L515 f1", "USB 3 port")


def test_webcams(dev: Path, sys_: Path, plugged: list[RealSenseInfo]) -> None:
    _bad(device_checks.check_camera(_rig(camera="webcam")), "no webcam", "plug it in")
    _plug_webcam(dev, sys_, 0, "Logi")
    _plug_webcam(dev, sys_, 1, "Industrial")
    _good(device_checks.check_camera(_rig(camera="webcam")), "Logi, the first of 2")
    stable = dev / "v4l" / "by-id" / "usb-Industrial-index0"
    _good(device_checks.check_camera(_rig(camera="webcam", device=str(stable))), "Industrial")
    _good(device_checks.check_camera(_rig(camera="webcam", device="2")), "Industrial")
    gone = _rig(camera="webcam", device=str(dev / "video9"))
    _bad(device_checks.check_camera(gone), "video9 is not there; webcams: .*Logi.*Industrial", "camera.device")
    plugged.append(L515)
    found = device_checks.list_cameras()
    _good(found, r"L515 f1.*; Logi \(.*usb-Logi-index0\); Industrial")


class _Camera:
    """Gives `image` `rate` times a second, by its own count of time."""

    name = "soft"

    def __init__(self, image: Image, rate: float = 30.0, problem: str | None = None) -> None:
        self._image, self._rate, self._problem = image, rate, problem
        self.closed = False
        self._index = -1

    def open(self) -> None:
        if self._problem:
            raise DeviceError(self._problem)

    def read(self, timeout_s: float) -> Frame | None:
        time.sleep(0.002)
        self._index += 1
        return Frame(self._index, self._index / self._rate, self._image)

    def close(self) -> None:
        self.closed = True


def _scene() -> Image:
    return np.random.default_rng(0).integers(40, 200, (120, 160, 3), np.uint8)


def test_what_a_real_rig_lacks_for_driving_by_program_is_told_with_what_to_do(own_folder: None) -> None:
    assert device_checks.check_readiness(Config()).ok
    twin = Config.model_validate({"policy": {"name": "random"}})
    assert device_checks.check_readiness(twin).ok
    real = {"rig": {"camera": "webcam", "robot": "servos"}, "servos": {"port": "/dev/ttyUSB0"}, "policy": {"name": "random"}}
    found = device_checks.check_readiness(Config.model_validate(real))
    assert not found.ok
    for lack in (
        "directions are not learned",
        "steering is not learned",
        "not taught on this bench",
        "does not look at the picture",
    ):
        assert lack in found.detail
    for remedy in ("menu Rig, Calibrate", "menu Model, Teach this bench", "policy.name"):
        assert remedy in found.fix
    looked_at = Config.model_validate(real | {"rig": {"camera": "webcam", "robot": "none"}})
    assert device_checks.check_readiness(looked_at).ok
    gone = Config.model_validate(real | {"rig": {"camera": "webcam", "robot": "servos", "file": "/nowhere/lab.toml"}})
    assert "no such rig file" in device_checks.check_readiness(gone).detail
    assert "was not accepted" in found.detail
    assert device_checks.check_acceptance(twin).ok
    _bad(device_checks.check_acceptance(Config.model_validate(real)), "no acceptance is recorded", "main.py rig accept")


def test_a_real_camera_is_tried() -> None:
    config, good = _rig(camera="webcam"), _Camera(_scene())
    _good(device_checks.check_picture(Config()), "only real cameras")
    _good(device_checks.check_picture(config, lambda _: good, 0.05), r"160x120, 30\.0 frames/s, 0 lost, brightness 1\d\d of 255")
    assert good.closed
    _bad(
        device_checks.check_picture(config, lambda _: _Camera(_scene(), rate=12.0), 0.05),
        r"12\.0 frames/s",
        "should give 30: more light",
    )
    _bad(device_checks.check_picture(config, lambda _: _Camera(np.zeros_like(_scene())), 0.05), "black", "lens cap")
    lost = _Camera(_scene(), problem="webcam cannot be opened")
    _bad(device_checks.check_picture(config, lambda _: lost, 0.05), "cannot be opened", "close other programs")
    assert lost.closed


# --- servos ----------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def line() -> Iterator[str]:
    master, slave = pty.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_without_a_port_nothing_is_wrong() -> None:
    for check in (
        device_checks.check_servo_port(None),
        device_checks.check_servos(ServosConfig()),
        device_checks.check_forces(ServosConfig()),
        device_checks.check_latency(None),
    ):
        _good(check, "not configured")


def test_the_servo_port(line: str, tmp_path: Path) -> None:
    _good(device_checks.check_servo_port(line), "is free")
    _bad(device_checks.check_servo_port(None, wanted=True), "the rig has servos, but no port", "servos.port")
    stable = tmp_path / "usb-U2D2"
    stable.symlink_to(line)
    _good(device_checks.check_servo_port(str(stable)), re.escape(line))
    _bad(device_checks.check_servo_port(str(tmp_path / "gone")), "is not there", "by-id")
    (tmp_path / "file").touch()
    _bad(device_checks.check_servo_port(str(tmp_path / "file")), "no serial port", "servos.port")
    _bad(device_checks.check_servo_port("/dev/null"), "no serial port", "servos.port")


def test_a_program_that_holds_the_port_without_a_lock_is_named(line: str, tmp_path: Path) -> None:
    script = tmp_path / "wizard.py"
    script.write_text(f"import os, sys\nos.open({line!r}, os.O_RDWR | os.O_NOCTTY)\nprint(flush=True)\nsys.stdin.read()\n")
    with subprocess.Popen([sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        named = rf"in use by another program: python\S* wizard.py \(process {other.pid}\)"
        _bad(device_checks.check_servo_port(line), named, f"fuser -v {line}")
        other.communicate()
    _good(device_checks.check_servo_port(line), "is free")


def test_a_port_that_another_program_holds(line: str) -> None:
    from hardware.servos.dynamixel_port import ServoLine

    other = ServoLine(line, 57600)
    other.open()
    try:
        _bad(device_checks.check_servo_port(line), "in use by another program", f"fuser -v {line}")
        _bad(device_checks.check_servos(ServosConfig(port=line)), "not asked: .*in use", "see the servo port")
    finally:
        other.close()
    _good(device_checks.check_servo_port(line))


def test_a_port_without_permission_names_the_group(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_checks.os, "access", lambda *_: False)
    monkeypatch.setattr(device_checks, "_group", lambda _: "dialout")
    _bad(
        device_checks.check_servo_port(line), "no permission for .*group dialout", r"usermod -aG dialout \$USER, then log in again"
    )


@pytest.mark.parametrize(("text", "ok"), [("1", True), ("2", True), ("16", False)])
def test_the_latency_of_an_ftdi_adapter(sys_: Path, dev: Path, text: str, ok: bool) -> None:
    port = dev / "ttyUSB0"
    port.touch()
    (dev / "usb-U2D2").symlink_to(port)
    _good(device_checks.check_latency(str(port)), "no latency timer")
    timer = sys_ / "bus" / "usb-serial" / "devices" / "ttyUSB0" / "latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text(text + "\n")
    check = device_checks.check_latency(str(dev / "usb-U2D2"))
    if ok:
        _good(check, f"^{text} ms")
    else:
        _bad(check, "^16 ms", f"echo 1 . sudo tee {timer}")


def test_the_factorys_bus_speed_is_said_to_be_too_slow_and_how_to_change_it() -> None:
    for baud, slow in ((57_600, "57600 baud: about 24 cycles a second instead of 50"), (115_200, "about 49 cycles")):
        check = device_checks.check_bus_speed(ServosConfig(port="/dev/none", baud=baud))
        _bad(check, slow, r"Baud Rate \(8\) of all seven to 1 Mbps, then servos.baud = 1000000")
    _good(device_checks.check_bus_speed(ServosConfig(port="/dev/none", baud=1_000_000)), "1000000 baud")
    _good(device_checks.check_bus_speed(ServosConfig()), "not configured")


@pytest.mark.parametrize(("setting", "ok"), [("on", True), ("auto", False)])
def test_usb_autosuspend_of_the_adapter(sys_: Path, dev: Path, setting: str, ok: bool) -> None:
    port = dev / "ttyUSB0"
    port.touch()
    (dev / "usb-U2D2").symlink_to(port)
    _good(device_checks.check_adapter_power(str(port)), "is no USB adapter")
    usb = sys_ / "devices" / "pci0" / "usb1" / "1-2"
    tty = usb / "1-2:1.0" / "ttyUSB0"
    (tty / "tty" / "ttyUSB0").mkdir(parents=True)
    (usb / "power").mkdir()
    (usb / "idVendor").write_text("0403\n")
    control = usb / "power" / "control"
    control.write_text(f"{setting}\n")
    node = sys_ / "class" / "tty" / "ttyUSB0"
    node.mkdir(parents=True)
    (node / "device").symlink_to(tty)
    check = device_checks.check_adapter_power(str(dev / "usb-U2D2"))
    if ok:
        _good(check, "no USB autosuspend")
    else:
        _bad(check, "USB autosuspend may put it to sleep", f"echo on . sudo tee {control}")
    _good(device_checks.check_adapter_power(None), "not configured")


def _programs(folder: Path, monkeypatch: pytest.MonkeyPatch, **scripts: str) -> None:
    """The only programs that there are."""
    for name, script in scripts.items():
        path = folder / name.replace("_", "-")
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def test_whether_screen_lock_and_sleep_can_be_inhibited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _good(device_checks.check_screen_lock("twin"), "not configured")
    _programs(tmp_path, monkeypatch)
    _bad(device_checks.check_screen_lock("servos"), "systemd-inhibit is not there", "desktop's settings")
    _programs(tmp_path, monkeypatch, systemd_inhibit="exit 0")
    _bad(device_checks.check_screen_lock("servos"), "is not known", "desktop's settings")
    _programs(tmp_path, monkeypatch, busctl="echo 'b false'")
    _bad(device_checks.check_screen_lock("servos"), "no org.freedesktop.ScreenSaver", "desktop's settings")
    _programs(tmp_path, monkeypatch, busctl="exit 1")
    _bad(device_checks.check_screen_lock("servos"), "no org.freedesktop.ScreenSaver", "desktop's settings")
    _programs(tmp_path, monkeypatch, busctl="echo 'b true'")
    _good(device_checks.check_screen_lock("servos"), "inhibited while the servos follow")


@pytest.fixture
def bus(start_servos: Callable[..., SoftServoBus]) -> SoftServoBus:
    return start_servos(ServosConfig(), wire_time=True)


@pytest.mark.real_time
def test_servos_answer_and_nothing_is_changed(bus: SoftServoBus) -> None:
    config = ServosConfig(port=bus.port)
    before = [bytes(bus.servo(joint.id).answer(2, 0, 147).data) for joint in config.joints]
    _good(device_checks.check_servos(config), r"7 answer, XM430-W350, firmware \d+; 1\d\.\d V at least, \d+ .C at most, torque off")
    after = [bytes(bus.servo(joint.id).answer(2, 0, 147).data) for joint in config.joints]
    tick = slice(120, 122)  # the realtime tick counts on
    assert [data[: tick.start] + data[tick.stop :] for data in before] == [data[: tick.start] + data[tick.stop :] for data in after]
    _good(device_checks.check_servo_port(bus.port), "is free")


@pytest.mark.real_time
def test_a_silent_servo_is_named(bus: SoftServoBus) -> None:
    config = ServosConfig(port=bus.port)
    bus.faults.mute(3)
    _bad(device_checks.check_servos(config), r"servo up \(id 3\)", "supply on")


@pytest.mark.real_time
def test_a_weak_supply_and_an_overloaded_servo_are_found(bus: SoftServoBus) -> None:
    demanding = ServosConfig(port=bus.port, min_voltage_v=20.0)
    _bad(device_checks.check_servos(demanding), "V at least", "20 V or more")
    bus.modify_servo(6, lambda servo: servo.heat(75.0))
    _bad(device_checks.check_servos(ServosConfig(port=bus.port)), "75 .C at most", "cool below 70 .C")
    bus.modify_servo(2, lambda servo: servo.alert(32))
    _bad(device_checks.check_servos(ServosConfig(port=bus.port)), "hardware error, .*left: overload", "restart that servo")


def test_forces_are_told_with_what_limits_them() -> None:
    plain = ServosConfig(port="/dev/servos")
    _good(device_checks.check_forces(plain), r"at most right 20 N \(70 mA\), .*advance 29 N \(105 mA\)")
    small = ServosConfig(port="/dev/servos", model=1240)
    _good(
        device_checks.check_forces(small),
        r"right \d+ N \(\d+ mA\) by XC330-M288, whose motor goes on when its own bus watchdog trips",
    )
    loads = ServosConfig(port="/dev/servos", model=1060)
    _bad(device_checks.check_forces(loads), r"right 3\.2 of 10 mm/s, .*delivery_2 4\.8 of 20 mm/s", "raise the joint's max_force_n")


# --- controls --------------------------------------------------------------------------------------------------------------------


def test_controls_that_are_not_configured() -> None:
    _good(device_checks.check_pedal(PedalConfig()), "not configured")
    _good(device_checks.check_gamepad(GamepadConfig(enabled=False)), "not configured")


def test_a_missing_gamepad_and_a_missing_pedal(tmp_path: Path) -> None:
    _bad(device_checks.check_gamepad(GamepadConfig(device=str(tmp_path / "js0"))), "is not there", "plug it in")
    _bad(device_checks.check_pedal(PedalConfig(port=str(tmp_path / "pedal"))), "does not exist", "pedal.port")


def test_a_gamepad_is_named(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "js0")
    _good(device_checks.check_gamepad(GamepadConfig(device=str(tmp_path / "js0"))), "js0")


@pytest.mark.real_time
def test_the_pedal_is_heard() -> None:
    with SoftPedal() as pedal:
        config = PedalConfig(port=pedal.port)
        _good(device_checks.check_pedal(config), "deadman released")
        pedal.press_stop()
        _bad(device_checks.check_pedal(config), "STOP is pressed", "release STOP")
        pedal.release_stop()
        pedal.press_estop()
        _bad(device_checks.check_pedal(config), "E-stop is pressed", "release the E-stop")
        pedal.release_estop()
        pedal.mute()
        _bad(device_checks.check_pedal(config, listen_s=0.1), "is silent", "power")


# --- all of it -------------------------------------------------------------------------------------------------------------------


def test_all_checks_are_made_one_after_the_other_and_named_as_in_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    config = Config(
        rig=RigConfig(camera="image_folder", robot="none", source=str(tmp_path)),
        record=RecordConfig(folder=str(tmp_path), warn_free_mb=0.0, warn_free_share=0.0),
        perception=_segmentation(tmp_path / "no model"),
        gamepad=GamepadConfig(enabled=False),
    )
    made = list(run_checks(config))
    assert [check.name for check in made] == list(CHECKS)
    assert all(check.ok == (check.fix == "") for check in made)
    assert {check.name for check in made if not check.ok} == {"model", "self-test"}
    assert made[0].to_json().keys() == {"name", "ok", "detail", "fix"}


# --- before driving ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "detail", "level"),
    [
        ("model", "network.onnx: SHA-256 differs", Level.BAD),
        ("self-test", "gives no pose", Level.BAD),
        ("camera", "USB 2", Level.BAD),
        ("adapter latency", "16 ms", Level.BAD),
        ("packages", "numpy 1 instead of 2", Level.BAD),
        ("clock", "now 1970-01-01 00:00 UTC: the date is wrong, and sessions are named by it", Level.WARNING),
        ("recordings", "0.1 GB free", Level.WARNING),
        ("cores and memory", "1 core", Level.WARNING),
        ("gamepad", "no permission", Level.WARNING),
        ("bus speed", "57600 baud", Level.WARNING),
        ("adapter power", "USB autosuspend", Level.WARNING),
        ("screen lock", "cannot be inhibited", Level.WARNING),
    ],
)
def test_only_what_driving_needs_stands_against_it(name: str, detail: str, level: Level) -> None:
    assert level_of(Check(name, False, detail, "mend it")) is level
    assert level_of(Check(name, True, "as it should be")) is Level.GOOD
    assert level_of(Check(name, True, "not configured")) is Level.UNUSED


def test_a_damaged_model_and_a_lost_camera_are_found_without_opening_any_device() -> None:
    config = Config.model_validate(
        {
            "perception": {"segmentation": {"model": "no_such_model"}},
            "rig": {"camera": "webcam", "robot": "none"},
            "camera": {"device": "/dev/no_such_camera"},
            "servos": {"port": "/dev/no_such_port"},
        }
    )
    found = {check.name: check for check in driving_checks(config)}
    assert {"model", "self-test", "camera", "recordings", "clock"} <= found.keys()
    assert not {"picture", "servos", "servo port", "foot pedal"} & found.keys(), "the open rig has these in use"
    for name in ("model", "self-test", "camera"):
        assert level_of(found[name]) is Level.BAD
        assert found[name].fix
