"""The whole window over fake engines: what it says as engines start, fail and end, and that it closes at any moment."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QEvent, QRect, Qt
from PySide6.QtWidgets import QAbstractItemView, QApplication, QLabel
from pytestqt.qtbot import QtBot

from app.operator.engine_thread import EnginePhase, EngineThread
from app.operator.window import OperatorWindow
from app.ui import theme
from app.ui.actions import action_of
from app.widgets.event_log import LogKind
from app.widgets.scene_overlay import Layer
from core.config.calibration import CalibrationConfig, ScaleConfig
from core.config.models import Config
from core.config.rig_file import make_rig, read_rig, with_rig, write_rig
from core.control.drive_view import DriveView
from core.control.modes import Act, Mode
from core.control.motion import AT_REST, Jog
from core.devices import DeviceError, EndOfStream
from core.types import Reason, Refusal, Tick
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
    until(qtbot, window.isActiveWindow)
    qtbot.keyClick(window, Key.Key_P)
    assert window.panels.toast.text() == "No snapshot: there is no picture yet"
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
    running.controls.stop()
    monkeypatch.undo()
    assert engine.pilot.acts == [Act.STOP]


def test_what_is_asked_before_the_rig_was_opened_counts(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    """A changed rig is opened once, a closed window opens none, and a rig that is lent none until it is given back."""
    opened: list[str] = []

    def open_engine(config: Config) -> FakeEngine:
        opened.append(config.twin.phantom)
        return FakeEngine(bench)

    closed, lent, changed = (make_window(open_engine) for _ in range(3))
    closed.start()
    closed.close()
    lent.start()
    lent.rig.lend("the rig is being set up")
    until(qtbot, lambda: "being set up" in lent.panels.notice.text)
    qtbot.wait(200)  # longer than the windows take to paint themselves
    assert opened == []
    lent.rig.use_config(lent.rig.config)
    until(qtbot, lambda: lent.shown_tick is not None)
    changed.start()
    twin = changed.rig.config.twin.model_copy(update={"phantom": "y_branch"})
    changed.rig.use_config(changed.rig.config.model_copy(update={"twin": twin}))
    until(qtbot, lambda: changed.shown_tick is not None)
    assert opened == ["s_curve", "y_branch"]


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
    def is_the_same_state() -> bool:
        tick = running.shown_tick
        return tick is not None and tick.scene.pose is not None and running.panels.badge.letter == tick.scene.pose.state.value

    until(qtbot, is_the_same_state)
    until(qtbot, lambda: running.panels.gauge.text.endswith("°"))
    until(qtbot, lambda: running.panels.bars.texts[0].endswith("px"))
    until(qtbot, lambda: running.panels.advice.text.startswith(("Fast", "Slow", "Slowest", "Moderate")))
    until(qtbot, lambda: "total 27.5" in running.panels.performance.text)
    assert "SIM" in running.windowTitle()
    assert running.panels.banner.word == "SIM"


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


def test_silent_camera_leaves_no_stale_overlay_and_no_older_number(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    until(qtbot, lambda: "total 27.5" in running.panels.performance.text)
    engine.silent = True
    until(qtbot, lambda: running.panels.badge.title == "No new picture")
    assert "27.5" not in running.panels.performance.text
    until(qtbot, lambda: running.panels.trends.curves[0].xData[-1] <= -0.5)
    assert running.panels.live.scene is None
    assert running.panels.advice.text == "No advice: no new picture"
    assert running.panels.notice.isVisible()
    engine.silent = False
    until(qtbot, lambda: running.panels.live.scene is not None)
    assert not running.panels.notice.isVisible()


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


def test_keys_move_the_robot_while_held(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    qtbot.keyPress(running, Key.Key_W)
    assert engine.jogs[-1] == Jog(advance=1.0)
    lit = [motion.value for motion, cap in running.panels.jog._caps.items() if cap.is_lit]
    assert lit == ["advance"]
    qtbot.keyRelease(running, Key.Key_W)
    assert engine.jogs[-1] == AT_REST
    assert not any(cap.is_lit for cap in running.panels.jog._caps.values())
    qtbot.keyPress(running, Key.Key_W)
    QApplication.sendEvent(running, QEvent(QEvent.Type.WindowDeactivate))
    assert engine.jogs[-1] == AT_REST, "without the focus no release is heard"


def test_the_arrows_are_the_menu_bars_after_a_tap_on_alt(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    bar, live = running.menuBar(), running.panels.live
    running.activateWindow()
    live.setFocus()
    qtbot.keyClick(live, Key.Key_Alt)
    assert running.focusWidget() is bar
    engine.jogs.clear()
    for key in (Key.Key_Right, Key.Key_W):
        qtbot.keyClick(bar, key)
    assert engine.jogs == [], "who looks for a menu moves nothing"
    assert bar.activeAction() is bar.actions()[1]
    qtbot.keyClick(bar, Key.Key_Space)
    assert engine.pilot.acts == [Act.STOP]
    qtbot.keyClick(bar, Key.Key_Escape)
    assert running.focusWidget() is live
    qtbot.keyPress(live, Key.Key_Right)
    assert engine.jogs[-1] == Jog(bend=1.0)
    qtbot.keyRelease(live, Key.Key_Right)


def test_space_stops_from_any_widget(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    chip = running.panels.overlay_bar._chips[Layer.MASKS]
    chip.setFocus()
    qtbot.keyPress(running, Key.Key_W)
    qtbot.keyClick(chip, Key.Key_Space)
    assert engine.jogs[-1] == AT_REST
    assert engine.pilot.acts == [Act.STOP]
    assert chip.isChecked(), "space is no click here"


def test_digits_switch_overlays_but_not_when_typed_into_the_seed(running: OperatorWindow, qtbot: QtBot) -> None:
    for layer in Layer:
        qtbot.keyClick(running, layer.value.key)
        assert not running.panels.overlay_bar.is_on(layer)
        assert not action_of(running, layer.value.key).isChecked()
    qtbot.keyClick(running, Key.Key_0)
    assert all(running.panels.overlay_bar.is_on(layer) for layer in Layer)
    assert all(action_of(running, layer.value.key).isChecked() for layer in Layer)
    seed = running.panels.picker._seed
    seed.setEnabled(True)
    seed.setFocus()
    qtbot.keyClicks(seed, "12")
    assert running.panels.overlay_bar.is_on(Layer.MASKS)


@pytest.mark.parametrize("way", ["key", "tab and enter"])
def test_a_phantom_is_chosen_by_keyboard(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot, way: str) -> None:
    picker = running.panels.picker
    combo, chosen, moved = picker._combo, [], len(engine.jogs)
    picker.chosen.connect(chosen.append)
    if way == "key":
        qtbot.keyClick(running, Key.Key_P, Qt.KeyboardModifier.ControlModifier)
    else:
        assert combo.focusPolicy() & Qt.FocusPolicy.TabFocus
        combo.setFocus()
        qtbot.keyClick(combo, Key.Key_Return)
    qtbot.waitUntil(combo.view().isVisible)
    qtbot.keyClick(combo.view(), Key.Key_Down)
    qtbot.keyClick(combo.view(), Key.Key_Return)
    qtbot.waitUntil(lambda: chosen == ["tree"])
    assert not combo.view().isVisible()
    assert all(jog.is_rest for jog in engine.jogs[moved:]), "the arrows chose, they moved nothing"


def test_enter_presses_the_button_that_has_the_focus(running: OperatorWindow, qtbot: QtBot) -> None:
    bar = running.panels.overlay_bar
    chip = bar._chips[Layer.MASKS]
    chip.setFocus()
    qtbot.keyClick(chip, Key.Key_Return)
    assert not bar.is_on(Layer.MASKS)
    running.panels.live.setFocus()
    qtbot.keyClick(running.panels.live, Key.Key_Enter)
    assert not bar.is_on(Layer.MASKS), "without a button Enter does nothing"


def test_click_sets_the_target_and_escape_clears_it(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    running.panels.live.clicked.emit(500.0, 280.0)
    assert engine.targets[-1] == (500.0, 280.0)
    until(qtbot, lambda: running.shown_tick is not None and running.shown_tick.scene.route is not None)
    qtbot.keyClick(running, Key.Key_Escape)
    assert engine.targets[-1] is None
    running.panels.live.clicked.emit(500.0, 280.0)
    running.panels.live.cleared.emit()
    assert engine.targets[-1] is None


def test_choosing_a_phantom_opens_it_and_forgets_the_old_world(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    opened: list[str] = []
    engines: list[FakeEngine] = []

    def open_engine(config: Config) -> FakeEngine:
        opened.append(config.twin.phantom)
        engines.append(FakeEngine(bench))
        return engines[-1]

    window = make_window(open_engine)
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    window.panels.live.clicked.emit(500.0, 280.0)
    qtbot.keyPress(window, Key.Key_D)
    window.panels.picker.chosen.emit("tree")
    assert window.rig.phase is EnginePhase.STARTING
    assert not window.panels.live._picture.isVisible(), "the old world is not shown as the new one"
    assert window.target is None
    assert window.controls.jog.held == frozenset()
    until(qtbot, lambda: window.shown_tick is not None)
    assert opened == ["s_curve", "tree"]
    assert engines[0].closed.is_set()
    qtbot.keyRelease(window, Key.Key_D)
    qtbot.keyClick(window, Key.Key_R)
    until(qtbot, lambda: len(opened) == 3)
    assert opened[-1] == "random:1"


def test_a_list_is_reached_by_tab_scrolled_by_keys_and_left_by_escape(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    """While it has the focus the arrows are its own; letters and STOP are the robot's as everywhere."""
    panels = running.panels
    panels.pages.setCurrentWidget(panels.events)
    view = panels.events.findChild(QAbstractItemView)
    for number in range(200):
        panels.events.add(LogKind.OPERATOR, f"event {number}")
    view.verticalScrollBar().setRange(0, max(500, view.verticalScrollBar().maximum()))
    for _ in range(80):
        qtbot.keyClick(running.focusWidget(), Key.Key_Tab)
        if running.focusWidget() is view:
            break
    assert running.focusWidget() is view
    engine.jogs.clear()
    bar = view.verticalScrollBar()
    qtbot.keyClick(view, Key.Key_Down)
    assert bar.value() > 0
    before = bar.value()
    qtbot.keyClick(view, Key.Key_PageDown)
    assert bar.value() > before
    qtbot.keyClick(view, Key.Key_Home)
    qtbot.keyClick(view, Key.Key_Up)
    assert bar.value() == bar.minimum()
    assert engine.jogs == []
    qtbot.keyPress(view, Key.Key_W)
    assert engine.jogs[-1] == Jog(advance=1.0)
    qtbot.keyRelease(view, Key.Key_W)
    qtbot.keyClick(view, Key.Key_Space)
    assert engine.pilot.acts == [Act.STOP]
    qtbot.keyClick(view, Key.Key_Escape)
    assert running.focusWidget() is not view
    qtbot.keyPress(running, Key.Key_Up)
    assert engine.jogs[-1] == Jog(advance=1.0)
    qtbot.keyRelease(running, Key.Key_Up)
    qtbot.mouseClick(view.viewport(), Qt.MouseButton.LeftButton)
    assert running.focusWidget() is not view


def test_snapshot_key_writes_three_files_says_where_and_names_the_phantom_that_runs(
    running: OperatorWindow, qtbot: QtBot, tmp_path: Path
) -> None:
    running.panels.picker.show_name("tree")  # chosen, and not opened
    qtbot.keyClick(running, Key.Key_P)
    until(qtbot, running.panels.toast.isVisible)
    assert str(tmp_path / "shots") in running.panels.toast.text()
    names = sorted(path.name for path in (tmp_path / "shots").iterdir())
    assert [name.partition("_")[2][-12:] for name in names if name.endswith("overlay.png")]
    record = json.loads(next((tmp_path / "shots").glob("*.json")).read_text())
    assert record["state"] in ("A", "B", "C", "D")
    assert (record["rig"], record["phantom"], record["model"]) == ("SIM", "s_curve", "default")


def test_no_snapshot_of_a_picture_that_is_not_live(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot, tmp_path: Path
) -> None:
    engine.silent = True
    until(qtbot, lambda: running.panels.badge.title == "No new picture")
    qtbot.keyClick(running, Key.Key_P)
    assert running.panels.toast.text() == "No snapshot: the picture is not live"
    engine.silent = False
    until(qtbot, lambda: running.panels.badge.title != "No new picture")
    engine.fail_with = EndOfStream("the end")
    until(qtbot, lambda: running.rig.phase is EnginePhase.ENDED)
    qtbot.keyClick(running, Key.Key_P)
    assert running.panels.toast.text() == "No snapshot: the picture is not live"
    assert not (tmp_path / "shots").exists()


@pytest.mark.parametrize("error", [EndOfStream("the end"), DeviceError("unplugged")])
def test_nothing_is_held_any_more_after_the_end(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot, error: Exception
) -> None:
    qtbot.keyPress(running, Key.Key_D)
    qtbot.keyPress(running, Key.Key_W)
    engine.fail_with = error
    until(qtbot, lambda: running.rig.phase in (EnginePhase.ENDED, EnginePhase.FAULT))
    assert running.controls.jog.held == frozenset()
    assert running.panels.jog.readout.startswith("bend –")


def test_the_last_picture_of_a_recording_is_shown(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    """The end may come before the last picture's time on the screen; the picture is shown nevertheless."""

    class Short(FakeEngine):
        def step(self, timeout_s: float) -> Tick | None:
            if self._index == 3:
                raise EndOfStream("the end")
            return super().step(timeout_s)

    window = make_window(lambda _config: Short(bench), kind=RigKind.PLAYBACK)
    shown: list[int] = []
    show_tick = window.panels.show_tick

    def spy(tick: Tick, max_block_ms: float) -> None:
        shown.append(tick.frame.index)
        show_tick(tick, max_block_ms)

    window.panels.show_tick = spy
    window._pace._due_s = time.monotonic() + 60.0  # no picture's time comes before the end
    window.start()
    until(qtbot, lambda: window.rig.phase is EnginePhase.ENDED)
    assert shown == [3]
    assert window.panels.live._picture.isVisible()


def test_help_and_full_screen_and_what_escape_leaves_first(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    running.panels.live.clicked.emit(500.0, 280.0)
    qtbot.keyClick(running, Key.Key_F11)
    assert running.isFullScreen()
    assert not running.menuBar().isVisible()
    assert running.panels.banner.isVisible(), "the banner is permanent"
    qtbot.keyClick(running, Key.Key_F1)
    assert running.panels.help.isVisible()
    assert running.panels.help.mapTo(running, running.panels.help.rect().topLeft()).y() > running.panels.banner.geometry().bottom()
    qtbot.keyClick(running, Key.Key_Escape)
    assert not running.panels.help.isVisible()
    qtbot.keyClick(running, Key.Key_Escape)
    assert not running.isFullScreen()
    assert running.menuBar().isVisible()
    running.showFullScreen()
    assert not running.menuBar().isVisible()
    assert action_of(running, "F11").isChecked()
    running.showNormal()  # as the desktop does it
    assert running.menuBar().isVisible()
    assert not action_of(running, "F11").isChecked()
    assert engine.targets[-1] is not None, "the target is cleared last"
    qtbot.keyClick(running, Key.Key_Escape)
    assert engine.targets[-1] is None


SCREENS = {(1920, 1080): (1600, 900), (1366, 768): (1358, 728), (1280, 720): (1272, 680), (800, 600): (1100, 660)}


def test_window_opens_no_larger_than_the_screen() -> None:
    for size, expected in SCREENS.items():
        screen = SimpleNamespace(availableGeometry=lambda size=size: QRect(0, 0, *size))
        assert theme.start_size(screen).toTuple() == expected


def test_everything_has_room(running: OperatorWindow, qtbot: QtBot) -> None:
    shown = running.panels
    everywhere = (shown.live, shown.badge, shown.gauge, shown.bars, shown.clearance, shown.mode, shown.mode_bar)
    on_pages = (shown.jog, shown.trends, shown.servos, shown.commands, shown.events)
    for size in ((1100, 660), (1280, 720), (1600, 900), (1920, 1080)):
        running.resize(*size)
        qtbot.wait(30)
        assert (running.width(), running.height()) == size
        for widget in (*everywhere, *on_pages):
            page = next((k for k in range(shown.pages.count()) if shown.pages.widget(k).isAncestorOf(widget)), None)
            page = page if page is not None else shown.pages.indexOf(widget)
            if page >= 0:
                shown.pages.setCurrentIndex(page)
                qtbot.wait(10)
            assert widget.isVisible(), widget
            assert widget.height() >= max(widget.minimumSizeHint().height(), widget.minimumHeight()), widget
            assert widget.width() >= widget.minimumWidth(), widget
        assert shown.live.width() >= 0.5 * size[0]


def test_the_page_of_keys_leaves_stop_in_sight_and_in_reach(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    """F1 lies beside the keys that drive: the first click on STOP is a STOP also while the page is open."""
    panels, stop, bar = running.panels, running.panels.mode_bar.stop, running.panels.mode_bar
    qtbot.keyClick(running, Key.Key_F1)
    for count, size in enumerate(((1100, 660), (1280, 720), (1600, 900)), 1):
        running.resize(*size)
        qtbot.wait(30)
        assert panels.help.isVisible()
        assert running.childAt(stop.mapTo(running, stop.rect().center())) is stop
        assert panels.help.geometry().bottom() < bar.mapTo(panels.help.parentWidget(), bar.rect().topLeft()).y()
        qtbot.mouseClick(running.windowHandle(), Qt.MouseButton.LeftButton, pos=stop.mapTo(running, stop.rect().center()))
        assert engine.pilot.acts == [Act.STOP] * count
        assert panels.help.isVisible()


def test_a_screen_of_720_lines_is_enough(running: OperatorWindow, qtbot: QtBot) -> None:
    """In a low window the trends have a page of their own; the legend names only what is drawn."""
    assert running.minimumSizeHint().height() <= 660
    assert theme.MIN_WINDOW[1] <= 660
    legends = [label for label in running.findChildren(QLabel) if "\N{GREEK SMALL LETTER THETA}" in label.text()]
    for size, is_page in (((1280, 680), True), ((1600, 900), False), ((1280, 720), True)):
        running.resize(*size)
        qtbot.wait(30)
        trends = running.panels.trends
        assert (running.panels.pages.indexOf(running.panels._trends_card) >= 0) is is_page
        if is_page:
            running.panels.pages.setCurrentWidget(running.panels._trends_card)
            qtbot.wait(30)
        assert trends._angle._box.height() >= 36
        assert ("d_head" in legends[0].text()) is trends.has_distances


ROOT = Path(__file__).resolve().parents[3]

PROGRAM = """
import os, signal, sys, time
from PySide6.QtCore import QTimer
from app.operator import window as operator_window
from app.operator.window import OperatorWindow
from app.ui.window_base import make_application, quit_on_signal
from core.config.models import Config
from hardware.rig import RigKind
from tests.app.fakes import FakeBench, FakeEngine

how, after_ms = sys.argv[1], int(sys.argv[2])
if len(sys.argv) > 3:
    operator_window._STOP_WITHIN_MS = 300

class StuckEngine(FakeEngine):
    def step(self, timeout_s):
        time.sleep(30.0 if len(sys.argv) > 3 else 0.0)
        return super().step(timeout_s)

def open_engine(config):
    time.sleep(0.3)
    return StuckEngine(FakeBench())

application = make_application()
window = OperatorWindow(Config(), open_engine, RigKind.SIM, [("tree", "Tree")])
application.aboutToQuit.connect(window.shut_down)
window.show()
window.start()
quit_on_signal(application)
end = {
    "close": window.close,
    "quit": application.quit,
    "SIGINT": lambda: os.kill(os.getpid(), signal.SIGINT),
    "SIGTERM": lambda: os.kill(os.getpid(), signal.SIGTERM),
}
QTimer.singleShot(after_ms, end[how])
sys.exit(application.exec())
"""


@pytest.mark.parametrize(
    ("how", "after_ms"),
    [
        ("close", 80),
        ("SIGINT", 900),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (("close", 0), ("close", 150), ("close", 900), ("quit", 150), ("quit", 900), ("SIGTERM", 150))
        ),
    ],
)
def test_exit_code_0_and_not_a_word(how: str, after_ms: int) -> None:
    """At 0 ms the rig is only announced, at 80 and 150 ms it is being opened, at 900 ms pictures run.

    Or not yet, on a slow machine: no less a moment.
    """
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, how, str(after_ms)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "")


def test_a_driver_that_never_returns_does_not_keep_the_window() -> None:
    command = [sys.executable, "-c", PROGRAM, "close", "2500", "stuck"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "the rig's driver did not return within 0.3 s; leaving without it\n"
