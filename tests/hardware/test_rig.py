"""Rigs: what there is, opening live, recorded and calibrated ones, and what is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from core.config.calibration import CalibrationConfig, LensConfig
from core.config.models import CAMERAS, RESOURCES, CameraConfig, Config, load_config
from core.config.rig_file import RigFileError, make_rig, read_rig, with_rig, write_rig
from core.devices import DeviceError
from hardware.cameras import realsense, sysfs
from hardware.cameras.live import LiveCamera
from hardware.cameras.realsense import RealSenseInfo, RealSenseSensor
from hardware.cameras.registry import CAMERA_KINDS
from hardware.cameras.undistorted import UndistortedCamera
from hardware.rig import RigKind, find_devices, open_rig, with_camera, with_port
from hardware.servos.registers import ServoState
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.servos.bus import SoftServoBus
from tests.hardware.soft_cameras import CONFIG, HEIGHT, WIDTH, SoftRealSense, take_frames

LENS = LensConfig(k1=-0.12, center_px=(319.5, 239.5), size_px=(640, 480), residual_px=0.1, pictures=3)


# ---- what there is


def test_every_kind_of_camera_that_a_rig_may_name_is_in_the_table() -> None:
    assert set(CAMERA_KINDS) == set(CAMERAS.own)


@pytest.fixture
def computer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A computer without devices; its folder for /sys."""
    monkeypatch.setattr(sysfs, "DEV", tmp_path / "dev")
    monkeypatch.setattr(sysfs, "SYS", tmp_path)
    monkeypatch.setattr(realsense, "find_cameras", lambda: [])
    return tmp_path


@pytest.mark.parametrize("problem", ["", "RealSense library: no libusb"])
def test_without_hardware_there_is_the_twin_also_when_a_library_cannot_search(
    computer: Path, problem: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> list[RealSenseInfo]:
        raise DeviceError(problem)

    if problem:
        monkeypatch.setattr(realsense, "find_cameras", broken)
    found = find_devices()
    assert found.problems == ((f"RealSense: {problem}",) if problem else ())
    assert [camera.kind for camera in found.cameras] == ["twin"]


def test_a_realsense_and_a_webcam_are_listed_once_each(computer: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for k, name in enumerate(("RealSense L515", "HD Webcam")):
        folder = computer / "class" / "video4linux" / f"video{k}"
        folder.mkdir(parents=True)
        (folder / "name").write_text(name)
    monkeypatch.setattr(realsense, "find_cameras", lambda: [RealSenseInfo("L515", "f123")])
    found = find_devices()
    assert [(camera.kind, camera.serial or camera.device) for camera in found.cameras[:2]] == [
        ("realsense", "f123"),
        ("webcam", str(computer / "dev" / "video1")),
    ]
    config = with_camera(load_config(), found.cameras[0])
    assert (config.rig.camera, config.rig.robot, config.camera.serial) == ("realsense", "none", "f123")
    config = with_port(config, "/dev/ttyUSB0")
    assert (config.rig.robot, config.servos.port) == ("servos", "/dev/ttyUSB0")
    config = with_camera(config, found.cameras[2])
    assert (config.rig.camera, config.rig.robot, config.servos.port) == ("twin", "twin", None)
    assert with_port(config, "/dev/ttyUSB0") == config


# --- rigs ------------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def soft(monkeypatch: pytest.MonkeyPatch) -> Iterator[SoftRealSense]:
    def made(config: CameraConfig) -> LiveCamera:
        return LiveCamera(RealSenseSensor(config, soft.context), config)

    with SoftRealSense() as soft:
        monkeypatch.setattr("hardware.cameras.realsense.realsense_camera", made)
        yield soft


def _rig(**settings: object) -> Config:
    servos = settings.pop("servos", {})
    return Config.model_validate({"rig": {"name": "bench", "camera": "realsense"} | settings, "camera": CONFIG, "servos": servos})


def test_a_live_rig_to_look_only(soft: SoftRealSense) -> None:
    rig = open_rig(_rig(robot="none"))
    try:
        assert (rig.name, rig.kind, rig.robot) == ("bench", RigKind.LIVE, None)
        assert take_frames(rig.camera, 1)[0].image.shape == (HEIGHT, WIDTH, 3)
    finally:
        rig.close()


@pytest.mark.real_time
def test_a_live_rig_with_servos_that_are_checked_but_not_armed(
    soft: SoftRealSense, start_servos: Callable[..., SoftServoBus]
) -> None:
    bus = start_servos(Config().servos, wire_time=True)
    rig = open_rig(_rig(robot="servos", servos={"port": bus.port}))
    try:
        assert rig.kind is RigKind.LIVE
        assert rig.robot is not None
        assert [bus.servo(joint.id).answer(2, 64, 1).data for joint in Config().servos.joints] == [b"\0"] * 7
    finally:
        rig.close()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"robot": "twin"}, 'set rig.robot to "servos" or "none"'),
        ({"robot": "servos"}, "set servos.port"),
        ({"camera": "twin", "robot": "servos"}, "the twin has servos of its own"),
        ({"camera": "twin", "robot": "twin", "servos": {"port": "/dev/ttyUSB0"}}, r"leave servos\.port"),
        ({"camera": "webcam", "robot": "none", "source": "film.mp4"}, "a webcam plays no files"),
        ({"camera": "realsense", "robot": "none", "source": "run.bag"}, "rs-convert"),
        ({"camera": "image_folder"}, "needs rig.source"),
    ],
)
def test_rigs_that_make_no_sense_say_what_to_do(soft: SoftRealSense, settings: dict[str, object], message: str) -> None:
    with pytest.raises(DeviceError, match=message):
        open_rig(_rig(**settings))


def test_the_camera_is_let_go_when_the_servos_fail(soft: SoftRealSense, tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="does not exist"):
        open_rig(_rig(robot="servos", servos={"port": str(tmp_path / "ttyUSB9")}))
    rig = open_rig(_rig(robot="none"))
    take_frames(rig.camera, 1)
    rig.close()


# ---- rigs


@pytest.mark.usefixtures("own_folder")
def test_a_rig_is_opened_with_its_lens() -> None:
    base = load_config(overrides={"rig": {"robot": "none"}, "twin": {"lens_distortion": -0.12}})
    known = CalibrationConfig(made_utc=datetime.now(UTC), lens=LENS)
    path = write_rig(make_rig(base, "bent", known))
    rig = open_rig(with_rig(base, make_rig(base, "bent", known), path))
    try:
        assert isinstance(rig.camera, UndistortedCamera)
        assert rig.camera.lens == LENS
        frame = None
        while frame is None:
            frame = rig.camera.read(1.0)
        assert frame.image.shape == (480, 640, 3)
    finally:
        rig.close()


@pytest.mark.usefixtures("own_folder")
def test_a_rig_whose_file_is_broken_is_not_opened() -> None:
    path = write_rig(make_rig(load_config(), "bent", None))
    config = with_rig(load_config(), make_rig(load_config(), "bent", None), path)
    path.write_text("format = ")
    with pytest.raises(RigFileError, match="no TOML"):
        open_rig(config)


@pytest.mark.real_time
@pytest.mark.usefixtures("no_process_stays_behind")
@pytest.mark.parametrize("name", ["three_tendons", "two_tendons_rotation"])
def test_a_robot_of_another_shape_is_driven_by_its_own_servos_in_the_twin(name: str) -> None:
    path = RESOURCES / "rigs" / f"{name}.toml"
    rig = open_rig(with_rig(load_config(), read_rig(path), path))
    robot = rig.robot
    assert isinstance(robot, ServoRobot)
    try:
        robot.arm()
        status = robot.bus_status()
        assert status is not None
        at_mm = {servo.name: servo.position_mm for servo in status.servos if isinstance(servo, ServoState)}
        assert [name for name, at in at_mm.items() if at is not None and at > 1.0] == ["advance"], "its wires are slack"
    finally:
        robot.close()
        rig.camera.close()
