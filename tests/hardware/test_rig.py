"""Straightened cameras, camera feeds, found cameras, the board in the twin, and rigs that are opened with their lens."""

from __future__ import annotations

import threading
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from core.calibration.camera import BoardSpec, BoardView, find_board, fit_lens, scale_of_board, undistort
from core.config.calibration import CalibrationConfig, LensConfig
from core.config.models import RigConfig, TwinConfig, load_config
from core.config.rig_file import RigFileError, make_rig, with_rig, write_rig
from core.devices import CameraLost, DeviceError
from core.types import Frame
from hardware.cameras import realsense, sysfs
from hardware.cameras.kinds import CAMERA_KINDS
from hardware.cameras.live import CameraFeed
from hardware.cameras.realsense import RealSenseInfo
from hardware.cameras.undistorted import UndistortedCamera
from hardware.rig import find_devices, open_rig, with_camera, with_port
from hardware.twin.rendering.calibration_board import BoardPictures

LENS = LensConfig(k1=-0.12, center_px=(319.5, 239.5), size_px=(640, 480), residual_px=0.1, pictures=3)


class ScriptedCamera:
    """Gives what it is told: frames, None, or errors."""

    name, is_live = "scripted camera", True

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


# ---- what there is


def test_every_kind_of_camera_that_a_rig_may_name_is_in_the_table() -> None:
    assert set(CAMERA_KINDS) == set(get_args(RigConfig.model_fields["camera"].annotation))


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


# ---- the board in the twin


@pytest.mark.parametrize("twin", [{}, {"lens_distortion": -0.12}, {"appearance_seed": 3}])
def test_the_board_in_the_twin_gives_lens_and_scale(twin: dict[str, object]) -> None:
    config = TwinConfig.model_validate({"phantom": "tree", **twin})
    spec = BoardSpec()
    pictures = BoardPictures(config, spec)
    views = [find_board(pictures.picture(k, k), spec) for k in range(3)]
    lens = fit_lens(views, (640, 480))
    scale = scale_of_board([BoardView(undistort(view.pixels, lens), view.board_mm) for view in views], (640, 480))
    middle = pictures.view.unproject(np.array([[319.5, 239.5]]))[0]
    true = 1.0 / pictures.view.pixels_per_mm((float(middle[0]), float(middle[1])))
    assert scale.mm_per_px == pytest.approx(true, rel=0.003)
    assert lens.k1 == pytest.approx(pictures.view.distortion, abs=0.01)
    seen = {tuple(place) for place in np.round(views[0].board_mm / spec.square_mm - 1).astype(int).tolist()}
    index = [row * (spec.columns - 1) + column for column, row in seen]
    assert len(index) >= 12


# ---- rigs


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.mark.usefixtures("own_folder")
def test_a_rig_is_opened_with_its_lens() -> None:
    base = load_config(overrides={"servos": {"driver": "direct"}, "twin": {"own_process": False, "lens_distortion": -0.12}})
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
