"""The operator's requests, controls and alerts, in the whole window over a pilot that keeps what it is told."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot
from tests.app.widgets.test_servo_widgets import bus

from app.operator.engine_thread import EnginePhase
from app.operator.window import OperatorWindow
from app.widgets.jog_panel import Motion
from core.config.models import Config
from core.control.alerts import ALERTS, Alert
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.modes import Act, Mode
from core.devices import DeviceError, EndOfStream
from hardware.rig import RigKind
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, until

Key = Qt.Key


def drive_view(**changes: object) -> DriveView:
    return replace(DriveView(0.0, permitted=Source.OPERATOR, servos_on=True, deadman=False), **changes)  # type: ignore[arg-type]


def test_the_keys_of_the_steps_reach_the_pilot(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    for key in (Key.Key_F4, Key.Key_F6, Key.Key_F7, Key.Key_F8):
        qtbot.keyClick(running, key)
    assert engine.pilot.acts == [Act.ACKNOWLEDGE, Act.ARM, Act.HAND_OVER, Act.TAKE_BACK]
    qtbot.keyClick(running, Key.Key_F6, Qt.KeyboardModifier.ShiftModifier)
    assert engine.pilot.acts[-1] is Act.DISARM
    qtbot.keyClick(running, Key.Key_F3)
    assert engine.pilot.asked == ["switch on"]


def test_handing_over_is_heard_while_shift_is_held_as_deadman(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    qtbot.keyPress(running, Key.Key_Shift)
    until(qtbot, lambda: engine.pilot.deadman_said[-3:] == [True] * 3)
    qtbot.keyClick(running, Key.Key_F7, Qt.KeyboardModifier.ShiftModifier)
    assert engine.pilot.acts == [Act.HAND_OVER]
    qtbot.keyRelease(running, Key.Key_Shift)
    assert engine.pilot.deadman_said[-1] is False


def test_the_deadman_is_let_go_with_the_focus(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    running.panels.mode_bar.deadman_changed.emit(True)
    assert engine.pilot.deadman_said[-1] is True
    QApplication.sendEvent(running, QEvent(QEvent.Type.WindowDeactivate))
    assert engine.pilot.deadman_said[-1] is False


def test_the_window_shows_signs_of_life_as_long_as_it_turns(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    before = engine.pilot.beats
    until(qtbot, lambda: engine.pilot.beats >= before + 3)


def test_alerts_are_shown_logged_and_heard(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[str] = []
    monkeypatch.setattr(running.controls.sounds, "play", heard.append)
    latched = Fault(Cause.TRACKING, "left off by 1.8 mm")
    engine.pilot.view = drive_view(mode=Mode.STOPPED, permitted=None, latched=latched, active=(latched,), servos_on=False)
    engine.pilot.alerts = [Alert(Cause.TRACKING, ALERTS[Cause.TRACKING], latched.detail, 0, "stop")]
    until(qtbot, lambda: heard == ["stop"])
    assert running.panels.alerts.isVisible()
    assert running.panels.mode.accessibleName() == "Mode: STOPPED"
    assert any("does not follow" in line for line in running.panels.events.lines)


def test_alerts_stay_above_the_notice_that_no_picture_comes(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot) -> None:
    running.resize(1100, 660)
    causes = (Cause.TRACKING, Cause.WARM, Cause.DISK_LOW)
    engine.pilot.alerts = [Alert(cause, ALERTS[cause], "", 0, None) for cause in causes]
    until(qtbot, lambda: len(running.panels.alerts.texts) == 3)
    engine.silent = True
    panels = running.panels
    until(qtbot, panels.notice.isVisible)
    panels.notice.setGeometry(panels.live.rect())
    until(qtbot, lambda: panels.notice.isVisible() and panels.badge.title == "No new picture")
    for row in panels.alerts._rows:
        assert panels.live.childAt(row.mapTo(panels.live, row.rect().center())) is row


def test_the_speed_by_hand_reaches_the_pilot_and_that_of_the_next_rig(
    make_window: MakeWindow, engines: list[FakeEngine], qtbot: QtBot
) -> None:
    window = make_window()
    window.start()
    until(qtbot, lambda: len(engines) == 1 and engines[0].pilot.speed == 1.0)
    window.panels.jog.speed_changed.emit(0.2)
    assert engines[0].pilot.speed == 0.2
    window.rig.restart()
    until(qtbot, lambda: len(engines) == 2 and engines[1].pilot.speed == 0.2)


def test_what_a_rig_that_is_closed_still_says_is_nothing_of_the_next_ones(
    make_window: MakeWindow, bench: FakeBench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_close = threading.Event()

    class Slow(FakeEngine):
        def close(self) -> None:
            may_close.wait(20.0)
            super().close()

    engine = Slow(bench)
    rigs = iter([engine])
    window = make_window(lambda _config: next(rigs, None) or FakeEngine(bench))
    window.start()
    until(qtbot, lambda: window.controls.view is not None)
    heard: list[str] = []
    recorder = window.recorder
    monkeypatch.setattr(recorder, "keep_alert", lambda alert, _time_s: heard.append(alert.detail))
    opened = recorder.open_rig
    monkeypatch.setattr(recorder, "open_rig", lambda *about: (heard.append("the next rig"), opened(*about)))
    engine.pilot.alerts = [Alert(Cause.TRACKING, ALERTS[Cause.TRACKING], "the last word")]
    try:
        window.rig.restart()
        engine.pilot.alerts = [Alert(Cause.TRACKING, ALERTS[Cause.TRACKING], "while it is closed")]
        until(qtbot, lambda: not engine.pilot.alerts)
        assert heard == ["the last word", "the next rig"]
    finally:
        may_close.set()


def test_the_keys_on_the_screen_work_wherever_those_of_the_keyboard_do(
    make_window: MakeWindow, bench: FakeBench, qtbot: QtBot
) -> None:
    """Without a picture, too: who has a robot in a vessel must be able to bring it back by hand."""
    engine = FakeEngine(bench)
    engine.silent = True
    window = make_window(lambda _config: engine)
    window.start()
    cap = window.panels.jog._caps[Motion.RETRACT]
    assert not cap.isEnabled()
    until(qtbot, lambda: window.rig.phase is EnginePhase.RUNNING and cap.isEnabled())
    assert window.panels.jog.toolTip() == ""
    engine.silent = False
    until(qtbot, lambda: window.shown_tick is not None)
    assert cap.isEnabled()
    engine.fail_with = DeviceError("gone")
    until(qtbot, lambda: window.rig.phase is EnginePhase.FAULT and not cap.isEnabled())
    assert window.panels.jog.toolTip() == "Fault"


def test_who_brings_the_robot_back_without_a_picture_sees_how_far_it_is_in(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    """By its servos, where they answer and are zeroed; else nobody knows."""
    jog = running.panels.jog
    until(qtbot, lambda: jog.readout.endswith("in 84 mm"))
    engine.silent = True
    until(qtbot, lambda: running.panels.badge.title == "No new picture")
    until(qtbot, lambda: jog.readout == "bend –, pitch –, in – mm")
    engine.bus_status = lambda: bus(time_s=time.monotonic())  # type: ignore[assignment,return-value]
    until(qtbot, lambda: jog.readout == "bend 0.00, pitch 0.00, in 20 mm")
    zeroed = (True, True, True, True, False, True, True)
    engine.bus_status = lambda: bus(time_s=time.monotonic(), zeroed=zeroed)  # type: ignore[assignment,return-value]
    until(qtbot, lambda: jog.readout == "bend 0.00, pitch 0.00, in – mm")
    engine.bus_status = lambda: None  # type: ignore[assignment,return-value]
    engine.silent = False
    until(qtbot, lambda: jog.readout.endswith("in 84 mm"))


def test_a_recording_has_nobody_to_drive(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    engine = FakeEngine(bench)
    engine.pilot = None  # type: ignore[assignment]
    window = make_window(lambda _config: engine, kind=RigKind.PLAYBACK)
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    qtbot.keyClick(window, Key.Key_F6)
    qtbot.keyClick(window, Key.Key_W)
    qtbot.keyClick(window, Key.Key_Space)
    qtbot.wait(120)
    assert window.controls.view is None


# ---- once the pilot is gone


def fails(_window: OperatorWindow, engine: FakeEngine) -> None:
    engine.fail_with = DeviceError("the camera is gone")


def is_opened_anew(window: OperatorWindow, _engine: FakeEngine) -> None:
    window.rig.restart()


def is_another_one(window: OperatorWindow, _engine: FakeEngine) -> None:
    window.rig.use_config(
        window.rig.config.model_copy(update={"rig": window.rig.config.rig.model_copy(update={"name": "bench 2"})})
    )


def is_lent(window: OperatorWindow, _engine: FakeEngine) -> None:
    window.rig.lend("the wizard has camera and servos")


WAITING, CLOSED = ("waiting for the rig", "Waiting for the rig."), ("no rig is open", "No rig is open. F5 opens it again.")


@pytest.mark.parametrize(
    ("end", "says"), [(fails, CLOSED), (is_opened_anew, WAITING), (is_another_one, WAITING), (is_lent, CLOSED)]
)
def test_nothing_says_who_drives_once_the_rig_is_over(
    end: Callable[[OperatorWindow, FakeEngine], None],
    says: tuple[str, str],
    make_window: MakeWindow,
    bench: FakeBench,
    qtbot: QtBot,
) -> None:
    """Where it stopped for good, nobody waits for anything: it is opened again by whoever asks for it."""
    engine, may_open = FakeEngine(bench), threading.Event()
    engine.bus_status = lambda: bus(time_s=time.monotonic())  # type: ignore[assignment,return-value]
    rigs = iter([engine])

    def open_engine(_config: Config) -> FakeEngine:
        if (first := next(rigs, None)) is not None:
            return first
        may_open.wait(20.0)
        return FakeEngine(bench)

    window = make_window(open_engine)
    window.start()
    engine.pilot.view = drive_view(mode=Mode.AUTONOMOUS, permitted=Source.PROGRAM, deadman=True)
    panels = window.panels
    until(qtbot, lambda: panels.mode.who == "the program drives" and panels.mode_bar.deadman.is_lit)
    until(qtbot, lambda: "20.0 ms" in panels.servos.bus_text)
    try:
        end(window, engine)
        until(qtbot, lambda: (panels.mode.who, panels.mode_bar.text) == says)
        assert panels.mode.mode is Mode.ADVISORY
        assert not any(part.isEnabled() for part in (panels.mode_bar.main, panels.mode_bar.second, panels.mode_bar.deadman))
        assert not panels.mode_bar.deadman.is_lit
        assert panels.servos.bus_text.startswith("no servo bus")
        assert window.controls.view is None
    finally:
        may_open.set()


def test_a_recording_that_is_over_still_has_no_robot(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    engine = FakeEngine(bench)
    engine.pilot = None  # type: ignore[assignment]
    window = make_window(lambda _config: engine, kind=RigKind.PLAYBACK)
    window.start()
    until(qtbot, lambda: window.panels.mode.who == "pictures only")
    engine.fail_with = EndOfStream("the last picture was shown")
    until(qtbot, lambda: window.rig.phase is EnginePhase.ENDED)
    qtbot.wait(120)  # two looks
    assert window.panels.mode.who == "pictures only"


def test_servo_requests_of_the_table_reach_the_servos(running: OperatorWindow, engine: FakeEngine) -> None:
    running.panels.servos.reboot_asked.emit(3)
    running.panels.servos.zero_asked.emit(None)
    running.panels.servos.zero_asked.emit(["left"])
    running.panels.servos.torque_off_asked.emit()
    assert engine.pilot.asked == ["reboot 3", "zero None", "zero ['left']", "torque off"]
