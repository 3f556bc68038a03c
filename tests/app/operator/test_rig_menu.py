"""The Rig menu: what is listed, what may be chosen when, and the rig that is lent to the wizard and comes back."""

from __future__ import annotations

import threading
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.operator.engine_thread import EnginePhase
from app.operator.rig_menu import RigMenuController
from app.operator.window import OperatorWindow
from core.config.calibration import CalibrationConfig, ScaleConfig
from core.config.models import Config, load_config
from core.config.rig_file import make_rig, read_rig, rig_path, with_rig, write_rig
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.modes import Mode
from core.devices import DeviceError
from core.session.manifest import read_manifest
from hardware.calibration.bench import CalibrationBench
from hardware.cameras.registry import FoundCamera
from hardware.rig import FoundDevices
from tests.app.fakes import FakeBench, FakeEngine, make_scene, until
from tests.app.rig_wizard.test_wizard import StillCamera

KNOWN = CalibrationConfig(
    made_utc=datetime.now(UTC).replace(microsecond=0),
    scale=ScaleConfig(mm_per_px=0.25, size_px=(640, 480), method="board", uncertainty_share=0.001),
)


pytestmark = pytest.mark.usefixtures("own_folder")


@pytest.fixture
def opened() -> list[Config]:
    """The configurations with which rigs were opened."""
    return []


@pytest.fixture
def window(
    make_window: Callable[..., OperatorWindow], bench: FakeBench, opened: list[Config], qtbot: QtBot, tmp_path: Path
) -> OperatorWindow:
    def open_engine(config: Config) -> FakeEngine:
        opened.append(config)
        return FakeEngine(bench)

    window = make_window(open_engine, load_config(overrides={"record": {"ring_s": 0, "folder": str(tmp_path / "sessions")}}))
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    return window


def _desk(window: OperatorWindow) -> RigMenuController:
    def bench(config: Config, see: object) -> CalibrationBench:
        return CalibrationBench(config, StillCamera(), None, lambda frame: make_scene(), lambda: None)

    return RigMenuController(window, bench, lambda _config: lambda frame: make_scene())


def _left_with_a_driver_that_hangs(window: OperatorWindow, qtbot: QtBot) -> tuple[RigMenuController, threading.Event]:
    """A desk whose wizard was cancelled while it opened a camera; the driver comes back when the event is set."""
    go_on = threading.Event()

    def hang(_config: Config, _see: object) -> CalibrationBench:
        go_on.wait(20.0)
        raise DeviceError("the camera does not answer: check its cable")

    desk = RigMenuController(window, hang, lambda _config: lambda frame: make_scene())
    desk.new()
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.model.is_busy)
    desk.wizard.camera_page.name_edit.setText("bench 7")
    desk.wizard.camera_page.open_button.click()
    desk.wizard.reject()
    return desk, go_on


def test_rigs_are_listed_and_broken_ones_cannot_be_chosen(window: OperatorWindow) -> None:
    write_rig(make_rig(load_config(), "bench 1", KNOWN))
    rig_path("broken").write_text("format = ")
    desk = _desk(window)
    assert desk.entries == ["bench 1", "broken"]
    assert [action.isEnabled() for action in desk._rigs] == [True, False]
    assert "no TOML" in desk._rigs[1].toolTip()


def test_no_camera_is_looked_for_while_the_robot_is_armed(
    window: OperatorWindow, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The look asks the cameras' drivers, in the window's thread: a window that hangs disarms."""
    looks: list[bool] = []

    def look() -> FoundDevices:
        looks.append(True)
        return FoundDevices((FoundCamera("twin", "Bench twin"),), ())

    monkeypatch.setattr("app.operator.rig_menu.find_devices", look)
    desk = _desk(window)
    pilot = window.rig.pilot
    pilot.view = DriveView(0.0, mode=Mode.AUTONOMOUS)
    until(qtbot, lambda: desk.hindrance() != "")
    desk._cameras.aboutToShow.emit()
    assert looks == []
    (line,) = desk._cameras.actions()
    assert line.text() == "The rig stays as it is: the robot is armed: disarm it first"
    assert not line.isEnabled()
    pilot.view = DriveView(0.0)
    until(qtbot, lambda: desk.hindrance() == "")
    desk._cameras.aboutToShow.emit()
    assert [action.text() for action in desk._cameras.actions()] == ["Bench twin"]


def test_a_chosen_rig_is_opened_in_this_window_and_shows_millimetres(
    window: OperatorWindow, opened: list[Config], qtbot: QtBot
) -> None:
    write_rig(make_rig(load_config(), "bench 1", KNOWN))
    desk = _desk(window)
    assert "mm" not in window.panels.bars.texts[0]
    desk.choose("bench 1")
    until(qtbot, lambda: len(opened) == 2)
    assert opened[1].rig.name == "bench 1"
    until(qtbot, lambda: "mm" in window.panels.bars.texts[0])
    pixels, millimetres = (float(text.split()[0]) for text in window.panels.bars.texts[0].split(" = "))
    assert millimetres == pytest.approx(0.25 * pixels, abs=0.02)
    assert [action.isChecked() for action in desk._rigs] == [True]


def test_the_wizard_is_refused_for_a_drive_without_servos(window: OperatorWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    desk, config = _desk(window), load_config()
    other = config.model_copy(update={"servos": config.servos.model_copy(update={"driver": "stepper board"})})
    monkeypatch.setattr(desk._rig, "reread_config", lambda: other)
    said: list[str] = []
    window.say = lambda text, **_: said.append(text)
    desk.calibrate()
    assert desk.wizard is None
    assert said == [
        "The rig stays as it is: the wizard knows DYNAMIXEL servos only: write the ids and signs of the joints into the rig file"
    ]


def test_a_rig_of_another_kind_is_opened_in_this_window(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    """Banner, title, phantoms and what is recorded follow, in both directions; it is the camera that was chosen."""
    live = load_config(overrides={"rig": {"camera": "webcam", "robot": "none"}})
    write_rig(make_rig(live, "real bench", None))
    desk, panels, picker = _desk(window), window.panels, window.panels.picker
    assert (panels.banner.word, picker.isVisible()) == ("SIM", True)
    desk.choose("real bench")
    assert (panels.banner.word, picker.isVisible()) == ("LIVE", False), "before anything of the new rig is seen"
    assert "no servos" in panels.banner.toolTip()
    assert window.windowTitle().endswith("LIVE")
    assert panels.notice.text.startswith("Starting: real bench")
    until(qtbot, lambda: len(opened) == 2 and window.shown_tick is not None)
    qtbot.keyClick(window, Qt.Key.Key_R)  # another phantom
    assert window.rig.config.rig.name == "real bench"
    window.recorder.toggle()
    until(qtbot, lambda: window.recorder.status.recording)
    window.recorder.toggle()
    until(qtbot, lambda: window.recorder.status.saved is not None)
    saved = window.recorder.status.saved
    assert saved is not None
    assert (read_manifest(saved).kind, read_manifest(saved).rig) == ("LIVE", "real bench")
    desk.choose_camera(FoundCamera("realsense", "L515", serial="f1"))
    until(qtbot, lambda: len(opened) == 3)
    assert opened[2].camera.serial == "f1"
    desk.choose_camera(FoundCamera("twin", "Bench twin"))
    assert (panels.banner.word, picker.isVisible()) == ("SIM", True)
    until(qtbot, lambda: len(opened) == 4)
    drives = {"rig": {"camera": "webcam", "robot": "servos"}, "servos": {"port": "/dev/ttyUSB0"}}
    window.rig.use_config(load_config(overrides=drives))
    assert "move real servos" in panels.banner.toolTip()


def test_a_click_says_where_the_robot_is_inserted(
    make_window: Callable[..., OperatorWindow], bench: FakeBench, qtbot: QtBot, tmp_path: Path
) -> None:
    config = load_config(overrides={"record": {"ring_s": 0, "folder": str(tmp_path / "sessions")}})
    path = write_rig(make_rig(config, "bench 1", KNOWN))
    engine = FakeEngine(bench)
    window = make_window(lambda _config: engine, with_rig(config, read_rig(path), path))
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    desk = _desk(window)
    desk.ask_port()
    assert "Click where the robot is inserted" in window.panels.toast.text()
    window.choose_target(639.0, 120.0)
    assert engine.targets[-1:] != [(639.0, 120.0)], "no target this time"
    known = read_rig(path).calibration
    assert known is not None and known.port is not None
    assert (known.port.x_share, known.port.y_share) == (1.0, pytest.approx(120 / 479))
    assert known.scale == KNOWN.scale
    assert engine.perceptions[-1].path.port_x_share == 1.0, "at once, without opening the rig anew"
    window.choose_target(100.0, 100.0)
    assert engine.targets[-1] == (100.0, 100.0)
    desk.ask_port()
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    window.choose_target(200.0, 100.0)
    assert engine.targets[-1] == (200.0, 100.0), "Escape has left it as it was"
    window.preview(config.perception)
    assert engine.perceptions[-1].path.port_x_share == 1.0, "settings that are tried out leave the rig its port"
    desk.forget_port()
    assert engine.perceptions[-1].path.port_x_share is None


def test_a_rig_without_a_file_has_nowhere_to_keep_a_port(window: OperatorWindow) -> None:
    _desk(window).ask_port()
    assert "save one first" in window.panels.toast.text()
    window.choose_target(100.0, 100.0)
    assert window.rig.engine._engine.targets[-1] == (100.0, 100.0)


@pytest.mark.parametrize(
    ("view", "why"),
    [
        (DriveView(0.0, mode=Mode.ARMED), "the robot is armed"),
        (DriveView(0.0, mode=Mode.STOPPED), "not acknowledged"),
        (DriveView(0.0, latched=Fault(Cause.SERVO_ALERT)), "not acknowledged"),
        (DriveView(0.0, busy="checking the servos"), "wait: checking the servos"),
    ],
)
def test_nobody_takes_the_rig_away_while_it_matters(
    window: OperatorWindow, opened: list[Config], view: DriveView, why: str
) -> None:
    write_rig(make_rig(load_config(), "bench 1", KNOWN))
    desk = _desk(window)
    window.controls._timer.stop()
    window.controls.view = view
    for action in (lambda: desk.choose("bench 1"), desk.new, desk.calibrate, lambda: desk.choose_camera(FoundCamera("twin", "t"))):
        action()
    assert why in desk.hindrance()
    assert desk.wizard is None
    assert len(opened) == 1
    assert why in window.panels.toast.text()


def test_the_wizard_gets_a_rig_that_is_closed_and_gives_it_back(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    desk = _desk(window)
    desk.new()
    window.rig.restart()  # F5, before the rig is closed: gives up the wizard
    until(qtbot, lambda: len(opened) == 2 and window.shown_tick is not None)
    assert desk.wizard is None
    assert "ask for the wizard again" in window.panels.toast.text()
    desk.new()
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.model.is_busy)
    assert window.shown_tick is None
    assert desk.wizard.isModal()
    assert not window.panels.mode_bar.stop.isEnabled(), "one bright STOP: that of the wizard"
    assert len(opened) == 2
    desk.wizard.reject()
    assert desk.wizard is None
    assert window.panels.mode_bar.stop.isEnabled()
    until(qtbot, lambda: len(opened) == 3 and window.shown_tick is not None)


def test_a_rig_that_cannot_be_opened_leaves_the_wizard_its_turn(
    make_window: Callable[..., OperatorWindow], qtbot: QtBot, tmp_path: Path
) -> None:
    """Asked for while the rig is being opened, by the one whose camera is missing."""
    go_on = threading.Event()

    def fail(_config: Config) -> FakeEngine:
        go_on.wait(20.0)
        raise DeviceError("no camera")

    window = make_window(fail, load_config(overrides={"record": {"ring_s": 0, "folder": str(tmp_path / "sessions")}}))
    window.start()
    until(qtbot, lambda: window.rig.phase is EnginePhase.STARTING)
    desk = _desk(window)
    desk.new()
    go_on.set()
    until(qtbot, lambda: desk.wizard is not None)
    desk.wizard.reject()


def test_a_rig_that_the_wizard_still_holds_is_waited_for(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    desk, go_on = _left_with_a_driver_that_hangs(window, qtbot)
    assert "Waiting for the wizard" in desk.hindrance()
    desk.new()
    assert desk.wizard is None
    assert "Waiting for the wizard to give camera and servos back" in window.panels.toast.text()
    assert len(opened) == 1
    go_on.set()
    until(qtbot, lambda: len(opened) == 2)


def test_a_saved_rig_is_opened(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    desk = _desk(window)
    desk.new()
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.model.is_busy)
    wizard = desk.wizard
    wizard.camera_page.name_edit.setText("bench 7")
    wizard.camera_page.open_button.click()
    until(qtbot, lambda: wizard.camera_page.may_leave)
    while wizard.page is not wizard.summary_page:
        wizard.next()
    wizard.next()
    until(qtbot, lambda: len(opened) == 2)
    assert opened[1].rig.name == "bench 7"
    assert desk.entries == ["bench 7"]


def test_calibrating_begins_with_what_is_known(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    write_rig(make_rig(load_config(), "bench 1", KNOWN))
    desk = _desk(window)
    desk.choose("bench 1")
    until(qtbot, lambda: len(opened) == 2 and window.shown_tick is not None)
    desk.calibrate()
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.model.is_busy)
    assert desk.wizard.windowTitle() == "Calibrate bench 1"
    assert desk.wizard.camera_page.rig_name == "bench 1"
    desk.wizard.reject()


def test_at_the_programs_end_the_wizard_gives_everything_back(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    desk = _desk(window)
    desk.new()
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.model.is_busy)
    wizard = desk.wizard
    wizard.camera_page.open_button.click()
    until(qtbot, lambda: wizard.model.bench is not None and not wizard.model.is_busy)
    desk.close()
    desk.close()
    assert wizard.model.bench is None
    assert len(opened) == 1  # no rig is opened again


def test_a_dropped_folder_of_pictures_is_looked_at(
    window: OperatorWindow, opened: list[Config], qtbot: QtBot, tmp_path: Path
) -> None:
    desk = _desk(window)
    window.open_path(tmp_path)
    until(qtbot, lambda: len(opened) == 2)
    assert (opened[1].rig.source, opened[1].rig.camera, opened[1].rig.robot) == (str(tmp_path), "image_folder", "none")
    desk.choose_source(tmp_path / "gone.mp4")
    assert "no such file" in window.panels.toast.text()
    assert len(opened) == 2
