"""The whole window over fake engines: what it says as engines start, fail and end, and that it closes at any moment."""

from __future__ import annotations

import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.operator.engine_thread import EnginePhase, EngineThread
from app.operator.window import OperatorWindow
from app.ui import theme
from core.config.calibration import CalibrationConfig, ScaleConfig
from core.config.models import Config, load_config
from core.config.rig_file import make_rig, read_rig, with_rig, write_rig
from core.control.drive_view import DriveView
from core.control.modes import Act, Mode
from core.control.motion import AT_REST
from core.devices import DeviceError, EndOfStream
from core.types import Reason, Refusal
from hardware.rig import RigKind
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, until

Key = Qt.Key


# ---- starting and failing


def test_window_is_there_at_once_and_says_what_it_waits_for(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    gate = threading.Event()
    opened: list[bool] = []

    def open_engine(_config: Config) -> FakeEngine:
        opened.append(gate.wait(20.0))
        return FakeEngine(bench)

    window = make_window(open_engine)
    window.start()
    assert opened == [], "the window has not waited for the rig"
    assert window.panels.notice.isVisible()
    assert window.panels.notice.text.startswith("Starting: S-curve")
    assert window.panels.badge.letter == "-"
    gate.set()
    until(qtbot, lambda: window.shown_tick is not None)
    assert opened == [True]
    until(qtbot, lambda: not window.panels.notice.isVisible())


def test_stop_before_the_first_rig_is_opened_is_kept_for_it(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    engine = FakeEngine(bench)
    window = make_window(lambda _config: engine)
    window.start()
    window.controls.stop()
    until(qtbot, lambda: window.shown_tick is not None)
    assert engine.pilot.acts[0] is Act.STOP


def test_stop_in_the_moment_in_which_a_rig_is_opened_is_not_lost(
    running: OperatorWindow, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = iter([None, engine.pilot])
    monkeypatch.setattr(EngineThread, "pilot", property(lambda _self: next(found)))
    running.controls.ask(Act.STOP)
    monkeypatch.undo()
    assert engine.pilot.acts == [Act.STOP]


def test_a_rig_that_is_lent_before_it_was_opened_stays_lent(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    opened: list[Config] = []

    def open_engine(config: Config) -> FakeEngine:
        opened.append(config)
        return FakeEngine(bench)

    window = make_window(open_engine)
    window.start()
    window.rig.lend("the rig is being set up")
    until(qtbot, lambda: "being set up" in window.panels.notice.text)
    qtbot.wait(200)  # longer than the window takes to paint itself
    assert opened == []
    window.rig.use_config(window.rig.config)
    until(qtbot, lambda: window.shown_tick is not None)
    assert len(opened) == 1


def test_a_rig_that_is_changed_before_it_was_opened_is_opened_once(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    opened: list[str] = []

    def open_engine(config: Config) -> FakeEngine:
        opened.append(config.twin.phantom)
        return FakeEngine(bench)

    window = make_window(open_engine)
    window.start()
    twin = window.rig.config.twin.model_copy(update={"phantom": "y_branch"})
    window.rig.use_config(window.rig.config.model_copy(update={"twin": twin}))
    until(qtbot, lambda: window.shown_tick is not None)
    qtbot.wait(200)  # longer than the window takes to paint itself
    assert opened == ["y_branch"]


def test_a_window_that_is_closed_before_its_rig_was_opened_opens_none(make_window: MakeWindow, qtbot: QtBot) -> None:
    opened: list[Config] = []

    def open_engine(config: Config) -> FakeEngine:
        opened.append(config)
        raise DeviceError("nobody is there any more")

    window = make_window(open_engine)
    window.start()
    window.close()
    qtbot.wait(200)  # longer than the window takes to paint itself
    assert opened == []


def test_millimetres_are_those_of_the_calibrated_rig(
    make_window: MakeWindow, bench: FakeBench, tmp_path: Path, qtbot: QtBot
) -> None:
    scale = ScaleConfig(mm_per_px=0.2, size_px=(1280, 960), method="board", uncertainty_share=0.001)
    known = CalibrationConfig(made_utc=datetime(2025, 3, 4, tzinfo=UTC), scale=scale)
    config = Config.model_validate({"record": {"ring_s": 0}})
    path = write_rig(make_rig(config, "bench 1", known), tmp_path / "bench 1.toml")
    window = make_window(lambda _config: FakeEngine(bench), with_rig(config, read_rig(path), path))
    window.start()
    assert window.panels.live._pixels_per_mm == pytest.approx(2.5)
    until(qtbot, lambda: "mm" in window.panels.bars.texts[0])
    until(qtbot, lambda: "mm" in window.panels.clearance.text)
    assert window.panels.clearance._pixels_per_mm == pytest.approx(2.5, rel=0.01)
    window.rig.use_config(config)
    until(qtbot, lambda: "px" in window.panels.clearance.text and "mm" not in window.panels.clearance.text)
    assert "mm" not in window.panels.bars.texts[0], "nobody has measured any, beside each other neither"


def test_everything_is_shown(running: OperatorWindow, qtbot: QtBot) -> None:
    tick = running.shown_tick
    assert tick is not None
    pose = tick.scene.pose
    assert pose is not None
    assert running.panels.badge.letter == pose.state.value
    assert running.panels.gauge.text.endswith("°")
    assert running.panels.bars.texts[0].endswith("px")
    assert running.panels.advice.text.startswith(("Fast", "Slow", "Slowest", "Moderate"))
    until(qtbot, lambda: "total 27.5" in running.panels.performance.text)
    assert "SIM" in running.windowTitle()
    assert running.panels.banner.word == "SIM"


def test_texts_follow_within_a_fraction_of_a_second(running: OperatorWindow, qtbot: QtBot) -> None:
    before = running.panels.gauge.text
    until(qtbot, lambda: running.panels.gauge.text != before)


def test_fault_is_one_visible_line_and_f5_starts_again(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    working: list[bool] = []

    def open_engine(_config: Config) -> FakeEngine:
        if not working:
            raise DeviceError("bench twin: physics went out of bounds; start again")
        return FakeEngine(bench)

    window = make_window(open_engine)
    window.start()
    until(qtbot, lambda: "physics went out of bounds" in window.panels.notice.text)
    assert window.panels.badge.title == "Fault"
    assert window.panels.advice.text.startswith("No advice")
    working.append(True)
    qtbot.keyClick(window, Key.Key_F5)
    until(qtbot, lambda: window.shown_tick is not None)


@pytest.mark.parametrize("mode", [Mode.ARMED, Mode.AUTONOMOUS, Mode.HOLD])
def test_f5_breaks_no_armed_rig_off(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot, mode: Mode) -> None:
    """Once more it is free as soon as the rig shows nothing new: F5 is the way out then."""
    engine.pilot.view = DriveView(0.0, mode=mode)
    until(qtbot, lambda: running.controls.view is not None and running.controls.view.mode is mode)
    orders = running.rig.orders
    qtbot.keyClick(running, Key.Key_F5)
    assert "The rig stays as it is: the robot is armed: disarm it first" in running.panels.toast.text()
    assert (running.rig.orders, running.rig.phase) == (orders, EnginePhase.RUNNING)
    engine.silent = True
    until(qtbot, lambda: running.panels.badge.title == "No new picture")
    qtbot.keyClick(running, Key.Key_F5)
    assert running.rig.orders == orders + 1


def test_fault_while_running_blanks_everything(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    engine.fail_with = DeviceError("camera lost: plug it in")
    until(qtbot, lambda: "camera lost" in running.panels.notice.text)
    assert running.shown_tick is None
    assert running.panels.live.scene is None
    assert running.panels.gauge.text == "–"
    assert running.panels.bars.texts == ("–", "–")


def test_end_of_a_recording(make_window: MakeWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    window = make_window(lambda _config: engine, kind=RigKind.PLAYBACK)
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    engine.fail_with = EndOfStream("clip.mp4: 240 frames")
    until(qtbot, lambda: window.panels.notice.text == "Recording is over. clip.mp4: 240 frames")
    assert window.panels.banner.word == "PLAYBACK"
    assert window.panels.picker is None


def test_silent_camera_leaves_no_stale_overlay(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    engine.silent = True
    until(qtbot, lambda: running.panels.badge.title == "No new picture")
    assert running.panels.live.scene is None
    assert running.panels.advice.text == "No advice: no new picture"
    assert running.panels.notice.isVisible()
    engine.silent = False
    until(qtbot, lambda: running.panels.live.scene is not None)
    assert not running.panels.notice.isVisible()


def test_with_no_new_picture_no_number_of_an_older_one_stands(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    until(qtbot, lambda: "total 27.5" in running.panels.performance.text)
    engine.silent = True
    until(qtbot, lambda: running.panels.badge.title == "No new picture")
    assert "27.5" not in running.panels.performance.text
    until(qtbot, lambda: running.panels.trends.curves[0].xData[-1] <= -0.5)


def test_a_camera_that_never_gives_a_picture_says_why(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    engine = FakeEngine(bench)
    engine.silent = True
    window = make_window(lambda _config: engine)
    window.start()
    until(qtbot, lambda: "Waiting for the first picture" in window.panels.notice.text)
    engine.problem = "webcam 0 sends no picture: close other programs that use it"
    until(qtbot, lambda: "webcam 0 sends no picture" in window.panels.notice.text)
    assert window.panels.badge.title == "No picture"
    engine.problem = None
    until(qtbot, lambda: "Waiting for the first picture" in window.panels.notice.text)
    engine.silent = False
    until(qtbot, lambda: window.shown_tick is not None)


def test_the_banners_word_needs_its_room(running: OperatorWindow) -> None:
    running.resize(*theme.MIN_WINDOW)
    banner = running.panels.banner
    assert banner.width() >= banner.minimumWidth() > 90


def test_a_hand_that_holds_the_deadman_can_record(running: OperatorWindow, qtbot: QtBot) -> None:
    qtbot.keyClick(running, Key.Key_F9, Qt.KeyboardModifier.ShiftModifier)
    until(qtbot, lambda: running.recorder.status.recording)
    running.recorder.stop("enough")


def test_warnings_of_the_servo_page_begin_where_it_is_set(make_window: MakeWindow, bench: FakeBench) -> None:
    window = make_window(lambda _config: FakeEngine(bench), load_config(overrides={"safety": {"temperature_warn_margin_c": 20.0}}))
    window.start()
    assert window.panels.servos._safety.temperature_warn_margin_c == 20.0


def test_what_was_put_off_for_an_older_picture_is_not_shown_any_more(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    panels, tick = running.panels, running.shown_tick
    assert tick is not None
    engine.silent = True
    until(qtbot, lambda: panels.badge.title == "No new picture")
    panels.show_tick(tick, 0.0)
    panels.blank("No new picture", "it was unplugged in this moment")
    qtbot.wait(50)
    assert panels.badge.title == "No new picture"
    assert panels.live.scene is None


def test_refusal_is_named_and_the_picture_goes_on(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    engine.refusal = Refusal(Reason.OUTSIDE_VESSEL, "41 % inside, 60 % needed")
    until(qtbot, lambda: running.panels.badge.title == "Robot is outside the vessel")
    assert running.panels.badge.letter == "-"
    assert running.panels.advice.text == "No advice: robot is outside the vessel"
    assert running.panels.gauge.text == "–"
    tick = running.shown_tick
    until(qtbot, lambda: running.shown_tick is not tick)


def test_missing_model_says_what_to_do_while_the_picture_goes_on(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    engine.refusal = Refusal(Reason.NO_MODEL, "default/network.onnx: hash differs")
    until(qtbot, lambda: running.panels.badge.title == "No model")
    assert "Put back resources/models/default" in running.panels.badge.why
    assert "hash differs" in running.panels.badge.why
    tick = running.shown_tick
    until(qtbot, lambda: running.shown_tick is not tick)


# ---- closing


MOMENTS = [
    "before the start",
    "while starting",
    "before the first picture",
    "while running",
    "while switching",
    "while a key is held",
    "after a fault",
    "while a snapshot is written",
    "in full screen",
]


@pytest.mark.parametrize("moment", MOMENTS)
def test_it_can_be_closed_at_any_moment(
    make_window: MakeWindow, bench: FakeBench, qtbot: QtBot, tmp_path: Path, moment: str
) -> None:
    engines: list[FakeEngine] = []

    def open_engine(_config: Config) -> FakeEngine:
        if moment == "after a fault":
            raise DeviceError("nothing there")
        if moment == "while starting" or engines:
            time.sleep(0.2)
        engine = FakeEngine(bench)
        engine.silent = moment == "before the first picture"
        engines.append(engine)
        return engine

    config = Config.model_validate({"window": {"pictures_folder": str(tmp_path)}})
    window = make_window(open_engine, config)
    if moment != "before the start":
        window.start()
    if moment in ("while running", "while switching", "while a key is held", "while a snapshot is written", "in full screen"):
        until(qtbot, lambda: window.shown_tick is not None)
    if moment == "before the first picture":
        until(qtbot, lambda: window.rig.phase is EnginePhase.RUNNING)
    if moment == "after a fault":
        until(qtbot, lambda: window.rig.phase is EnginePhase.FAULT)
    if moment == "while switching":
        assert window.panels.picker is not None
        window.panels.picker.roll()
    if moment == "while a key is held":
        qtbot.keyPress(window, Key.Key_W)
    if moment == "while a snapshot is written":
        qtbot.keyClick(window, Key.Key_P)
    if moment == "in full screen":
        qtbot.keyClick(window, Key.Key_F11)
    assert window.close()
    assert not window.rig.engine.isRunning()
    assert not window.isVisible()
    assert all(engine.closed.is_set() for engine in engines)
    if moment == "while a key is held":
        assert engines[0].jogs[-1] == AT_REST, "the robot was stopped before the rig was closed"
    if moment == "while a snapshot is written":
        assert len(list(tmp_path.iterdir())) == 3


def test_closing_twice_is_nothing_special(running: OperatorWindow) -> None:
    running.close()
    running.shut_down()
    assert running.close()
