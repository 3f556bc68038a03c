"""The Rig menu: what is listed, what may be chosen when, and the rig that is lent to the wizard and comes back."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.operator_devices import OperatorDevices
from app.operator_window import OperatorWindow
from app.rig_desk import RigDesk
from core.calibration_config import CalibrationConfig, ScaleConfig
from core.config import Config, load_config
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.modes import Mode
from core.rig_file import make_rig, rig_path, write_rig
from hardware.calibration_bench import CalibrationBench
from hardware.gamepad import GamepadState
from hardware.rig_search import FoundCamera
from tests.app.fakes import FakeBench, FakeEngine, make_scene, until
from tests.app.test_rig_wizard import StillCamera

KNOWN = CalibrationConfig(
    made_utc=datetime.now(UTC).replace(microsecond=0),
    scale=ScaleConfig(mm_per_px=0.25, size_px=(640, 480), method="board", uncertainty_share=0.001),
)


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.fixture
def opened() -> list[Config]:
    """The configurations with which rigs were opened."""
    return []


@pytest.fixture
def window(make_window: Callable[..., OperatorWindow], bench: FakeBench, opened: list[Config], qtbot: QtBot) -> OperatorWindow:
    def open_engine(config: Config) -> FakeEngine:
        opened.append(config)
        return FakeEngine(bench)

    window = make_window(open_engine, load_config(overrides={"record": {"ring_s": 0}}))
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    return window


def _desk(window: OperatorWindow, switched: list[str] | None = None) -> RigDesk:
    def bench(config: Config, see: object) -> CalibrationBench:
        return CalibrationBench(config, StillCamera(), None, lambda frame: make_scene(), lambda: None)

    return RigDesk(window, (switched if switched is not None else []).append, bench, lambda _config: lambda frame: make_scene())


def test_rigs_are_listed_and_broken_ones_cannot_be_chosen(window: OperatorWindow) -> None:
    write_rig(make_rig(load_config(), "bench 1", KNOWN))
    rig_path("broken").write_text("format = ")
    desk = _desk(window)
    assert desk.entries == ["bench 1", "broken"]
    assert [action.isEnabled() for action in desk._rigs] == [True, False]
    assert "no TOML" in desk._rigs[1].toolTip()


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


def test_a_rig_of_another_kind_gets_a_window_of_its_own(window: OperatorWindow, opened: list[Config]) -> None:
    live = load_config(overrides={"rig": {"camera": "webcam", "robot": "none"}})
    write_rig(make_rig(live, "real bench", None))
    switched: list[str] = []
    desk = _desk(window, switched)
    desk.choose("real bench")
    desk.choose_camera(FoundCamera("realsense", "L515", serial="f1"))
    assert switched == ["real bench", "realsense"]
    assert len(opened) == 1


def test_another_camera_of_the_same_kind_needs_no_restart(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    _desk(window).choose_camera(FoundCamera("twin", "Bench twin"))
    until(qtbot, lambda: len(opened) == 2)


@pytest.mark.parametrize(
    ("view", "why"),
    [
        (DriveView(0.0, mode=Mode.ARMED), "the robot is armed"),
        (DriveView(0.0, mode=Mode.AUTONOMOUS), "the robot is armed"),
        (DriveView(0.0, mode=Mode.HOLD), "the robot is armed"),
        (DriveView(0.0, mode=Mode.STOPPED), "not acknowledged"),
        (DriveView(0.0, latched=Fault(Cause.SERVO_ALERT)), "not acknowledged"),
        (DriveView(0.0, busy="checking the servos"), "wait: checking the servos"),
    ],
)
def test_nobody_takes_the_rig_away_while_it_matters(
    window: OperatorWindow, opened: list[Config], monkeypatch: pytest.MonkeyPatch, view: DriveView, why: str
) -> None:
    write_rig(make_rig(load_config(), "bench 1", KNOWN))
    desk = _desk(window)
    monkeypatch.setattr(type(window.desk), "view", property(lambda _self: view))
    for action in (lambda: desk.choose("bench 1"), desk.new, desk.calibrate, lambda: desk.choose_camera(FoundCamera("twin", "t"))):
        action()
    assert why in desk.hindrance()
    assert desk.wizard is None
    assert len(opened) == 1
    assert why in window.panels.toast.text()


def test_the_wizard_gets_a_rig_that_is_closed_and_gives_it_back(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    desk = _desk(window)
    desk.new()
    until(qtbot, lambda: desk.wizard is not None)
    assert window.shown_tick is None
    assert desk.wizard is not None
    assert desk.wizard.isModal()
    assert len(opened) == 1
    until(qtbot, lambda: not desk.wizard.desk.is_busy)
    desk.wizard.reject()
    assert desk.wizard is None
    until(qtbot, lambda: len(opened) == 2)
    until(qtbot, lambda: window.shown_tick is not None)


def test_a_saved_rig_is_opened(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    desk = _desk(window)
    desk.new()
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.desk.is_busy)
    wizard = desk.wizard
    assert wizard is not None
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
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.desk.is_busy)
    assert desk.wizard is not None
    assert desk.wizard.windowTitle() == "Calibrate bench 1"
    assert desk.wizard.camera_page.rig_name == "bench 1"
    desk.wizard.reject()


def test_the_pedals_and_gamepads_stop_reaches_the_wizard(qtbot: QtBot) -> None:
    stops: list[str] = []
    config = Config.model_validate({"gamepad": {"enabled": False}})
    devices = OperatorDevices(config, lambda: None, stop=lambda: stops.append("stop"))
    devices._on_gamepad(GamepadState(0.0, 0.0, 0.0, 0.0, None, False, 1.0))
    assert stops == []
    devices._on_gamepad(GamepadState(0.0, 0.0, 0.0, 0.0, None, True, 1.0))
    assert stops == ["stop"]
    devices.close()


def test_at_the_programs_end_the_wizard_gives_everything_back(window: OperatorWindow, opened: list[Config], qtbot: QtBot) -> None:
    desk = _desk(window)
    desk.new()
    until(qtbot, lambda: desk.wizard is not None and not desk.wizard.desk.is_busy)
    wizard = desk.wizard
    assert wizard is not None
    wizard.camera_page.open_button.click()
    until(qtbot, lambda: wizard.desk.bench is not None and not wizard.desk.is_busy)
    desk.close()
    desk.close()
    assert wizard.desk.bench is None
    assert len(opened) == 1  # no rig is opened again
