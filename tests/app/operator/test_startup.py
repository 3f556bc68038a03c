"""An error before the window is shown; whom the STOP after an unforeseen one reaches, and what its box says."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtWidgets import QMessageBox
from pytestqt.qtbot import QtBot

from app.operator import startup
from app.operator.engine_thread import EnginePhase
from app.operator.rig_menu import RigMenuController
from app.operator.services import WindowServices
from app.operator.window import OperatorWindow
from app.ui.crash_report import CrashWatch
from core.config.models import Config
from core.control.drive_view import DriveView
from core.control.gate import Source
from core.control.modes import Act, Mode
from core.devices import DeviceError, UserError
from hardware.calibration.bench import CalibrationBench
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, make_scene, until
from tests.app.rig_wizard.test_wizard import StillCamera

DRIVING = DriveView(0.0, Mode.AUTONOMOUS, Source.PROGRAM, servos_on=True, deadman=True)
AT_REST = DriveView(0.0)


@pytest.fixture
def watch(tmp_path: Path) -> CrashWatch:
    return CrashWatch(tmp_path / "crashes", dict)


@pytest.fixture
def side(running: OperatorWindow, watch: CrashWatch, tmp_path: Path) -> Iterator[WindowServices]:
    side = WindowServices(running, tmp_path / "state", watch)
    yield side
    side.close()


def meet_an_error(watch: CrashWatch) -> None:
    try:
        raise RuntimeError("broken")
    except RuntimeError:
        watch.report(sys.exc_info(), "gui")


def box_of(window: OperatorWindow, qtbot: QtBot) -> str:
    """What the box says, once it is there."""
    until(qtbot, lambda: bool(window.findChildren(QMessageBox)))
    (box,) = window.findChildren(QMessageBox)
    return box.informativeText()


def test_an_error_before_the_window_ends_what_was_started_ahead(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ended: list[str] = []
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setattr(startup, "check_display", lambda: None)
    monkeypatch.setattr(startup, "start_ahead", lambda _config: SimpleNamespace(end=lambda: ended.append("ahead")))
    with pytest.raises(UserError):
        startup.run_window(None, None, None, bench=str(tmp_path / "none"))
    assert ended == ["ahead"] and gc.isenabled()


def test_a_running_rig_is_stopped(
    running: OperatorWindow, engine: FakeEngine, side: WindowServices, watch: CrashWatch, qtbot: QtBot
) -> None:
    meet_an_error(watch)
    assert engine.pilot.acts == [Act.STOP]
    assert box_of(running, qtbot).startswith("The servos were stopped. A recording that ran was ended and is whole.")


def test_a_rig_that_is_being_opened_starts_stopped(
    make_window: MakeWindow, bench: FakeBench, watch: CrashWatch, qtbot: QtBot, tmp_path: Path
) -> None:
    engine, may_open = FakeEngine(bench), threading.Event()

    def open_engine(_config: Config) -> FakeEngine:
        may_open.wait(20.0)
        return engine

    window = make_window(open_engine)
    side = WindowServices(window, tmp_path / "state", watch)
    window.start()
    try:
        meet_an_error(watch)
        assert box_of(window, qtbot).startswith("The rig that is being opened starts stopped.")
    finally:
        may_open.set()
    until(qtbot, lambda: engine.pilot.acts == [Act.STOP])
    side.close()


def test_the_wizards_servos_are_stopped(
    running: OperatorWindow, side: WindowServices, watch: CrashWatch, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))

    def open_bench(config: Config, _see: object) -> CalibrationBench:
        return CalibrationBench(config, StillCamera(), None, lambda frame: make_scene(), lambda: None)

    rigs = RigMenuController(running, open_bench, lambda _config: lambda frame: make_scene())
    rigs.new()
    until(qtbot, lambda: rigs.wizard is not None and not rigs.wizard.model.is_busy)
    desk = rigs.wizard.model
    desk.open_camera(running.rig.config)
    until(qtbot, lambda: desk.bench is not None and not desk.is_busy)
    bench = desk.bench
    begun = threading.Event()

    def wiggle() -> None:
        begun.set()
        while True:
            bench.stop.check()

    desk.run("wiggling servo 3", wiggle)
    until(qtbot, begun.is_set)
    meet_an_error(watch)
    until(qtbot, lambda: not desk.is_busy)
    assert box_of(running, qtbot).startswith("The servos were stopped.")
    rigs.close()


def test_without_servos_nothing_is_said_to_be_stopped(
    running: OperatorWindow, engine: FakeEngine, side: WindowServices, watch: CrashWatch, qtbot: QtBot
) -> None:
    engine.fail_with = DeviceError("the camera is gone")
    until(qtbot, lambda: running.rig.phase is EnginePhase.FAULT)
    meet_an_error(watch)
    assert engine.pilot.acts == []
    assert box_of(running, qtbot).startswith("No servos were in use, so there was nothing to stop.")


def test_what_could_not_be_stopped_is_not_said_to_be(
    running: OperatorWindow,
    engine: FakeEngine,
    side: WindowServices,
    watch: CrashWatch,
    qtbot: QtBot,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken() -> None:
        raise ValueError("no way to the servos")

    monkeypatch.setattr(engine.pilot, "stop", broken)
    meet_an_error(watch)
    assert box_of(running, qtbot).startswith("It is not certain that the servos were stopped: press Space.")


def test_who_goes_on_and_drives_is_stopped_again_and_told(
    running: OperatorWindow, engine: FakeEngine, side: WindowServices, watch: CrashWatch, qtbot: QtBot
) -> None:
    meet_an_error(watch)
    engine.pilot.view = DRIVING
    meet_an_error(watch)
    assert engine.pilot.acts == [Act.STOP, Act.STOP]
    until(qtbot, lambda: any("the servos were stopped again" in line for line in running.panels.events.lines))
    assert len(running.findChildren(QMessageBox)) == 1


@pytest.mark.parametrize("view", [AT_REST, DriveView(0.0, Mode.STOPPED)])
def test_an_error_with_every_repaint_does_not_stop_what_is_at_rest_each_time(
    view: DriveView, running: OperatorWindow, engine: FakeEngine, side: WindowServices, watch: CrashWatch
) -> None:
    engine.pilot.view = view
    for _ in range(5):
        meet_an_error(watch)
    assert engine.pilot.acts == [Act.STOP]


def test_a_recording_that_is_begun_after_the_first_error_goes_on(
    running: OperatorWindow, side: WindowServices, watch: CrashWatch, qtbot: QtBot
) -> None:
    meet_an_error(watch)
    running.recorder.toggle()
    until(qtbot, lambda: running.recorder.status.frames >= 1)
    meet_an_error(watch)
    qtbot.wait(100)
    assert running.recorder.status.recording
