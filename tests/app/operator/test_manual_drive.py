"""The operator's requests, controls and alerts, in the whole window over a pilot that keeps what it is told."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QHBoxLayout, QLineEdit, QMenu, QPlainTextEdit, QPushButton, QSpinBox, QWidget
from pytestqt.qtbot import QtBot

from app.operator.engine_thread import EnginePhase
from app.operator.manual_drive import PERIOD_MS, REPEAT_MS, DeadmanKey, JogKeys, OperatorDevices
from app.operator.window import OperatorWindow
from app.settings.fields import NumberEdit
from app.ui.texts import OperatorStep
from app.widgets.jog_panel import KEYS, Motion
from core.config.models import Config
from core.config.safety import JOINT_NAMES, SafetyConfig
from core.control.alerts import ALERTS, Alert
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.kept_zero import ZeroOffer, ZeroRequest
from core.control.modes import Act, Mode
from core.control.motion import AT_REST, Jog
from core.devices import DeviceError, EndOfStream
from hardware.inputs.gamepad import GamepadState
from hardware.rig import RigKind
from hardware.servos.bus_ipc import BusPhase
from tests.app.bus_status import bus, servo
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, FakePilot, until
from tests.hardware.soft_pedal import SoftPedal

Key = Qt.Key


def drive_view(**changes: object) -> DriveView:
    return replace(DriveView(0.0, permitted=Source.OPERATOR, servos_on=True, deadman=False), **changes)


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
    until(qtbot, lambda: jog.readout.endswith("inserted 84 mm"))
    engine.silent = True
    until(qtbot, lambda: running.panels.badge.title == "No new picture")
    until(qtbot, lambda: jog.readout == "bend –, pitch –, inserted – mm")
    engine.bus_status = lambda: bus(time_s=time.monotonic())
    until(qtbot, lambda: jog.readout == "bend 0.00, pitch 0.00, inserted 20 mm")
    zeroed = (True, True, True, True, False, True, True)
    engine.bus_status = lambda: bus(time_s=time.monotonic(), zeroed=zeroed)
    until(qtbot, lambda: jog.readout == "bend 0.00, pitch 0.00, inserted – mm")
    engine.bus_status = lambda: None
    engine.silent = False
    until(qtbot, lambda: jog.readout.endswith("inserted 84 mm"))


# ---- once the pilot is gone


def fails(_window: OperatorWindow, engine: FakeEngine) -> None:
    engine.fail_with = DeviceError("the camera is gone")


def is_another_one(window: OperatorWindow, _engine: FakeEngine) -> None:
    window.rig.use_config(
        window.rig.config.model_copy(update={"rig": window.rig.config.rig.model_copy(update={"name": "bench 2"})})
    )


def is_lent(window: OperatorWindow, _engine: FakeEngine) -> None:
    window.rig.lend("the wizard has camera and servos")


WAITING, CLOSED = ("waiting for the rig", "Waiting for the rig."), ("no rig is open", "No rig is open. F5 opens it again.")


@pytest.mark.parametrize(("end", "says"), [(fails, CLOSED), (is_another_one, WAITING), (is_lent, CLOSED)])
def test_nothing_says_who_drives_once_the_rig_is_over(
    end: Callable[[OperatorWindow, FakeEngine], None],
    says: tuple[str, str],
    make_window: MakeWindow,
    bench: FakeBench,
    qtbot: QtBot,
) -> None:
    """Where it stopped for good, nobody waits for anything: it is opened again by whoever asks for it."""
    engine, may_open = FakeEngine(bench), threading.Event()
    engine.bus_status = lambda: bus(time_s=time.monotonic())
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
    until(qtbot, lambda: "20.0 ms" in panels.servos.bus.text())
    try:
        end(window, engine)
        until(qtbot, lambda: (panels.mode.who, panels.mode_bar.text) == says)
        assert panels.mode.mode is Mode.ADVISORY
        assert not any(part.isEnabled() for part in (panels.mode_bar.main, panels.mode_bar.second, panels.mode_bar.deadman))
        assert not panels.mode_bar.deadman.is_lit
        assert panels.servos.bus.text().startswith("no servo bus")
        assert window.controls.view is None
    finally:
        may_open.set()


def test_a_recording_has_no_robot_to_drive(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot) -> None:
    engine = FakeEngine(bench)
    engine.pilot = None
    window = make_window(lambda _config: engine, kind=RigKind.PLAYBACK)
    window.start()
    until(qtbot, lambda: window.panels.mode.who == "pictures only")
    for key in (Key.Key_F6, Key.Key_W, Key.Key_Space):
        qtbot.keyClick(window, key)
    engine.fail_with = EndOfStream("the last picture was shown")
    until(qtbot, lambda: window.rig.phase is EnginePhase.ENDED)
    qtbot.wait(120)  # two looks
    assert window.panels.mode.who == "pictures only"
    assert window.controls.view is None


def test_servo_requests_of_the_table_reach_the_servos(running: OperatorWindow, engine: FakeEngine) -> None:
    running.panels.servos.reboot_asked.emit(3)
    running.panels.servos.zero_asked.emit(ZeroRequest(positions_mm={"left": 0.0}, kept=("advance",)))
    running.panels.servos.torque_off_asked.emit()
    assert engine.pilot.asked == ["reboot 3", "zero ['left'], kept ['advance']", "torque off"]


def test_servos_without_zeros_are_not_switched_on_but_asked_for_them(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    """F3: kept zeros are offered, and what is confirmed reaches the servos; then F3 switches them on."""
    engine.pilot.view = replace(engine.pilot.view, servos_on=False)
    states = tuple(servo(place, position_mm=None, goal_mm=None) for place in range(7))
    offers = tuple(ZeroOffer(name, 0.3, 0.0, 0, 0.0) for name in JOINT_NAMES)
    lost = partial(bus, *states, phase=BusPhase.DISARMED, zeroed=(False,) * 7, offers=offers)
    engine.bus_status = lambda: lost(time_s=time.monotonic())
    table = running.panels.servos
    until(qtbot, lambda: table.lacks_zeros)
    running.ask_step(OperatorStep.SERVOS_ON)
    assert engine.pilot.asked == []
    assert table.zeros.isVisible()
    table.zeros.set_button.click()
    feeds = ["advance", "delivery_1", "delivery_2"]
    assert engine.pilot.asked == [f"zero {feeds}, kept ['right', 'left', 'up', 'down']"]
    engine.bus_status = lambda: bus(phase=BusPhase.DISARMED, time_s=time.monotonic())
    until(qtbot, lambda: not table.lacks_zeros)
    running.ask_step(OperatorStep.SERVOS_ON)
    assert engine.pilot.asked[-1] == "switch on"
    assert table.zeros is None


NONE = Qt.KeyboardModifier.NoModifier


class Keyboard:
    """A window with a text field and a spin box, and jog keys."""

    def __init__(self, qtbot: QtBot) -> None:
        self.window = QWidget()
        qtbot.addWidget(self.window)
        row = QHBoxLayout(self.window)
        self.text, self.spin = QLineEdit(), QSpinBox()
        row.addWidget(self.text)
        row.addWidget(self.spin)
        self.window.show()
        self.window.setFocus()
        self.can_move = True
        self.jog = JogKeys(self.window, lambda: self.can_move)
        self.jogs: list[Jog] = []
        self.jog.changed.connect(self.jogs.append)
        self.stops: list[bool] = []
        self.jog.stop_pressed.connect(lambda: self.stops.append(True))

    def type(self, into: QWidget, key: Qt.Key = Key.Key_Space, modifier: Qt.KeyboardModifier = NONE) -> None:
        """As it comes from a keyboard."""
        into.setFocus()
        QTest.keyClick(into, key, modifier)

    def key(self, kind: QEvent.Type, key: Qt.Key, *, repeat: bool = False, to: QWidget | None = None) -> QKeyEvent:
        event = QKeyEvent(kind, key, Qt.KeyboardModifier.NoModifier, "", repeat)
        QApplication.sendEvent(to or self.window, event)
        return event

    def press(self, key: Qt.Key, *, repeat: bool = False, to: QWidget | None = None) -> QKeyEvent:
        return self.key(QEvent.Type.KeyPress, key, repeat=repeat, to=to)

    def release(self, key: Qt.Key, *, repeat: bool = False, to: QWidget | None = None) -> QKeyEvent:
        return self.key(QEvent.Type.KeyRelease, key, repeat=repeat, to=to)


@pytest.fixture
def keyboard(qtbot: QtBot) -> Iterator[Keyboard]:
    made = Keyboard(qtbot)
    yield made
    made.jog.detach()


@pytest.mark.parametrize(
    ("key", "jog"),
    [
        (Key.Key_Up, Jog(advance=1.0)),
        (Key.Key_W, Jog(advance=1.0)),
        (Key.Key_Down, Jog(advance=-1.0)),
        (Key.Key_S, Jog(advance=-1.0)),
        (Key.Key_PageUp, Jog(delivery=1.0)),
        (Key.Key_PageDown, Jog(delivery=-1.0)),
        (Key.Key_Right, Jog(bend=1.0)),
        (Key.Key_D, Jog(bend=1.0)),
        (Key.Key_Left, Jog(bend=-1.0)),
        (Key.Key_A, Jog(bend=-1.0)),
        (Key.Key_E, Jog(pitch=1.0)),
        (Key.Key_Q, Jog(pitch=-1.0)),
        (Key.Key_X, Jog(straighten=True)),
        (Key.Key_Z, Jog(rotation=1.0)),
        (Key.Key_C, Jog(rotation=-1.0)),
    ],
)
def test_a_motion_is_there_while_held_and_gone_after(keyboard: Keyboard, key: Qt.Key, jog: Jog) -> None:
    keyboard.press(key)
    assert keyboard.jogs == [jog]
    keyboard.release(key)
    assert keyboard.jogs[-1] == AT_REST


def test_keys_that_are_held_together_are_one_jog(keyboard: Keyboard) -> None:
    """Opposite ones cancel, two of one motion count once, and repeats of the keyboard nothing."""
    keyboard.press(Key.Key_W, repeat=True)
    assert keyboard.jogs == [], "it was down before"
    keyboard.press(Key.Key_W)
    for _ in range(5):
        keyboard.release(Key.Key_W, repeat=True)
        keyboard.press(Key.Key_W, repeat=True)
    assert keyboard.jogs == [Jog(advance=1.0)]
    for key, is_down, held in (
        (Key.Key_D, True, Jog(bend=1.0, advance=1.0)),
        (Key.Key_D, False, Jog(advance=1.0)),
        (Key.Key_S, True, AT_REST),
        (Key.Key_S, False, Jog(advance=1.0)),
        (Key.Key_Up, True, Jog(advance=1.0)),
        (Key.Key_W, False, Jog(advance=1.0)),
        (Key.Key_Up, False, AT_REST),
    ):
        (keyboard.press if is_down else keyboard.release)(key)
        assert keyboard.jogs[-1] == held


def test_holding_sends_again_and_again(keyboard: Keyboard, qtbot: QtBot) -> None:
    keyboard.press(Key.Key_Right)
    qtbot.waitUntil(lambda: len(keyboard.jogs) >= 3)
    keyboard.release(Key.Key_Right)
    sent = len(keyboard.jogs)
    qtbot.wait(100)
    assert len(keyboard.jogs) == sent, "nothing held, nothing sent"


def test_a_held_key_types_nothing_into_a_field_that_is_clicked_meanwhile(keyboard: Keyboard) -> None:
    keyboard.press(Key.Key_W)
    keyboard.text.setFocus()
    QApplication.sendEvent(keyboard.text, QKeyEvent(QEvent.Type.KeyPress, Key.Key_W, NONE, "w", True))
    assert keyboard.text.text() == ""
    keyboard.release(Key.Key_W, to=keyboard.text)
    QApplication.sendEvent(keyboard.text, QKeyEvent(QEvent.Type.KeyPress, Key.Key_W, NONE, "w"))
    assert keyboard.text.text() == "w"


@pytest.mark.parametrize("lost", [QEvent.Type.WindowDeactivate, QEvent.Type.WindowBlocked])
def test_losing_the_focus_or_a_dialog_in_front_lets_go(keyboard: Keyboard, lost: QEvent.Type) -> None:
    """Behind a modal dialog no release is heard, also where the desktop has not given the focus to it."""
    keyboard.press(Key.Key_W)
    keyboard.press(Key.Key_Right)
    QApplication.sendEvent(keyboard.window, QEvent(lost))
    assert keyboard.jog.held == frozenset()
    assert keyboard.jogs[-1] == AT_REST


def test_a_release_counts_wherever_it_goes_to(keyboard: Keyboard, qtbot: QtBot) -> None:
    menu = QMenu()
    qtbot.addWidget(menu)
    keyboard.press(Key.Key_W)
    keyboard.release(Key.Key_W, to=menu)
    assert keyboard.jogs[-1] == AT_REST


def test_a_key_that_means_something_else_when_it_is_let_go_lets_go(keyboard: Keyboard) -> None:
    """With NumLock and Shift (the deadman) down, the keypad's 8 goes down as Up, and comes up as 8 once Shift is up."""
    keypad, scan_code = Qt.KeyboardModifier.KeypadModifier, 80
    down = QKeyEvent(QEvent.Type.KeyPress, Key.Key_Up, keypad | Qt.KeyboardModifier.ShiftModifier, scan_code, 0, 0)
    QApplication.sendEvent(keyboard.window, down)
    assert keyboard.jogs[-1] == Jog(advance=1.0)
    other = QKeyEvent(QEvent.Type.KeyRelease, Key.Key_8, keypad, scan_code + 1, 0, 0)
    QApplication.sendEvent(keyboard.window, other)
    assert keyboard.jog.held == {Motion.ADVANCE}
    up = QKeyEvent(QEvent.Type.KeyRelease, Key.Key_8, keypad, scan_code, 0, 0)
    QApplication.sendEvent(keyboard.window, up)
    assert keyboard.jogs[-1] == AT_REST


def test_on_a_keyboard_of_another_alphabet_the_letters_are_found_by_their_place(keyboard: Keyboard) -> None:
    """Cyrillic, Greek, Hebrew: only the arrows steered, and nothing pitched."""
    cyrillic = {
        24: ("\N{CYRILLIC CAPITAL LETTER SHORT I}", Motion.PITCH_DOWN),
        38: ("\N{CYRILLIC CAPITAL LETTER EF}", Motion.STEER_LEFT),
    }
    for scan_code, (letter, motion) in cyrillic.items():
        for kind, held in ((QEvent.Type.KeyPress, {motion}), (QEvent.Type.KeyRelease, set())):
            QApplication.sendEvent(keyboard.window, QKeyEvent(kind, ord(letter), NONE, scan_code, 0, 0, letter))
            assert keyboard.jog.held == held
    # French: A lies where others have Q, and is the A that the legend shows
    QApplication.sendEvent(keyboard.window, QKeyEvent(QEvent.Type.KeyPress, Key.Key_A, NONE, 24, 0, 0, "a"))
    assert keyboard.jog.held == {Motion.STEER_LEFT}
    QApplication.sendEvent(keyboard.window, QKeyEvent(QEvent.Type.KeyRelease, Key.Key_A, NONE, 24, 0, 0, "a"))
    assert keyboard.jog.held == set()


def shift(kind: QEvent.Type, key: Qt.Key, scan_code: int) -> QKeyEvent:
    return QKeyEvent(kind, key, Qt.KeyboardModifier.AltModifier, scan_code, 0, 0)


@pytest.mark.parametrize("becomes", [Key.Key_unknown, Key.Key_Mode_switch, Key.Key_Meta, Key.Key_Shift])
def test_a_shift_that_is_another_key_when_it_is_let_go_holds_no_deadman(keyboard: Keyboard, becomes: Qt.Key) -> None:
    """Where Alt and Shift together change the layout, a Shift that comes up beside Alt is no Shift any more."""
    deadman, said = DeadmanKey(keyboard.window), list[bool]()
    deadman.reported.connect(said.append)
    QApplication.sendEvent(keyboard.window, shift(QEvent.Type.KeyPress, Key.Key_Shift, 50))
    QApplication.sendEvent(keyboard.window, shift(QEvent.Type.KeyRelease, Key.Key_Alt, 64))
    assert deadman.is_held
    assert said == [True]
    QApplication.sendEvent(keyboard.window, shift(QEvent.Type.KeyRelease, becomes, 50))
    assert not deadman.is_held
    assert said == [True, False]
    deadman.detach()


def test_of_two_shifts_the_first_that_comes_up_lets_go_of_the_deadman(keyboard: Keyboard) -> None:
    deadman = DeadmanKey(keyboard.window)
    for scan_code in (50, 62):
        QApplication.sendEvent(keyboard.window, shift(QEvent.Type.KeyPress, Key.Key_Shift, scan_code))
    QApplication.sendEvent(keyboard.window, shift(QEvent.Type.KeyRelease, Key.Key_Shift, 62))
    assert not deadman.is_held
    deadman.detach()


def test_space_stops_once_and_lets_go_even_in_a_text_field(keyboard: Keyboard) -> None:
    keyboard.press(Key.Key_Right)
    keyboard.press(Key.Key_Space, to=keyboard.text)
    keyboard.press(Key.Key_Space, repeat=True, to=keyboard.text)
    assert keyboard.jogs[-1] == AT_REST
    assert keyboard.stops == [True]
    assert keyboard.text.text() == ""


def test_where_nothing_can_move_a_space_is_typed(keyboard: Keyboard) -> None:
    page = QPlainTextEdit()
    keyboard.window.layout().addWidget(page)
    keyboard.can_move = False
    keyboard.type(keyboard.text)
    keyboard.type(keyboard.text, modifier=Qt.KeyboardModifier.ShiftModifier)
    keyboard.type(page)
    assert (keyboard.text.text(), page.toPlainText(), keyboard.stops) == ("  ", " ", [])
    keyboard.can_move = True
    keyboard.type(keyboard.text)
    keyboard.type(page)
    assert (keyboard.text.text(), page.toPlainText(), keyboard.stops) == ("  ", " ", [True, True])


@pytest.mark.parametrize(
    ("key", "modifier"),
    [
        (Key.Key_Pause, NONE),
        (Key.Key_Pause, Qt.KeyboardModifier.ShiftModifier),
        (Key.Key_Space, Qt.KeyboardModifier.ControlModifier),
        (Key.Key_Space, Qt.KeyboardModifier.AltModifier),
    ],
)
@pytest.mark.parametrize("can_move", [True, False])
def test_a_key_is_stop_in_any_focus_and_at_any_moment(
    keyboard: Keyboard, key: Qt.Key, modifier: Qt.KeyboardModifier, can_move: bool
) -> None:
    keyboard.can_move = can_move
    for number, place in enumerate((keyboard.text, keyboard.spin, keyboard.window), 1):
        keyboard.type(place, key, modifier)
        assert len(keyboard.stops) == number
    assert keyboard.text.text() == ""


def test_what_takes_no_space_leaves_it_to_stop(keyboard: Keyboard) -> None:
    keyboard.can_move = False
    locked, numbers, button = QLineEdit(), NumberEdit(is_whole=False), QPushButton()
    locked.setReadOnly(True)
    for number, widget in enumerate((locked, numbers, button, keyboard.spin, keyboard.window), 1):
        if widget.parent() is None and widget is not keyboard.window:
            keyboard.window.layout().addWidget(widget)
        keyboard.type(widget)
        assert len(keyboard.stops) == number, widget


def test_typing_shortcuts_and_keys_of_another_window_do_not_move_the_robot(keyboard: Keyboard, qtbot: QtBot) -> None:
    for field in (keyboard.text, keyboard.spin):
        field.setFocus()
        keyboard.press(Key.Key_W, to=field)
        keyboard.press(Key.Key_Up, to=field)
    assert keyboard.spin.value() == 1, "the arrow went to the field"
    save = QKeyEvent(QEvent.Type.KeyPress, Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    QApplication.sendEvent(keyboard.window, save)
    other = QWidget()
    qtbot.addWidget(other)
    keyboard.press(Key.Key_W, to=other)
    assert keyboard.jog.held == frozenset()
    assert keyboard.jogs == []


def test_every_motion_has_a_key_and_no_key_two_motions() -> None:
    assert set(KEYS) == set(Motion)
    keys = [key for group in KEYS.values() for key in group]
    assert len(keys) == len(set(keys))


def test_no_setting_lets_go_of_a_key_or_deadman_before_it_is_repeated() -> None:
    """With a late timer to spare: it is the window's."""
    for name, repeat_ms in (("command_max_age_s", PERIOD_MS), ("deadman_timeout_s", REPEAT_MS)):
        for share in (0.5, 1.0, 1.4):
            with pytest.raises(ValueError, match=name):
                SafetyConfig.model_validate({name: share * repeat_ms / 1000.0})


@pytest.fixture
def pedal() -> Iterator[SoftPedal]:
    with SoftPedal() as made:
        yield made


def test_a_gamepads_state_is_a_jog_a_deadman_and_a_stop(qtbot: QtBot) -> None:
    pilot = FakePilot()
    devices = OperatorDevices(Config.model_validate({"gamepad": {"enabled": False}}), lambda: pilot, pilot.stop)
    devices._on_gamepad(GamepadState(0.5, -0.25, 1.0, 0.0, None, False, 1.0))
    assert pilot.jogs == [Jog(0.5, -0.25, 1.0, 0.0)]
    assert pilot.deadman_said == []
    devices._on_gamepad(GamepadState(0.0, 0.0, 0.0, 0.0, True, True, 1.0))
    assert pilot.deadman_said == [True]
    assert pilot.acts == [Act.STOP]
    devices.close()
    devices = OperatorDevices(Config.model_validate({"gamepad": {"enabled": False}}), lambda: None, lambda: None)
    devices._on_gamepad(GamepadState(0.5, 0.0, 0.0, 0.0, True, True, 1.0))  # without a rig nothing happens
    devices.close()


@pytest.mark.real_time
def test_a_pedal_on_its_line_is_deadman_and_stop(qtbot: QtBot, pedal: SoftPedal) -> None:
    pilot = FakePilot()
    config = Config.model_validate({"gamepad": {"enabled": False}, "pedal": {"port": pedal.port}})
    devices = OperatorDevices(config, lambda: pilot, pilot.stop)
    said: list[tuple[str, bool]] = []
    devices.said.connect(lambda text, bad: said.append((text, bad)))
    devices.start()
    try:
        until(qtbot, lambda: len(pilot.deadman_said) > 3)
        pedal.press()
        until(qtbot, lambda: pilot.deadman_said[-1] is True)
        pedal.release()
        until(qtbot, lambda: pilot.deadman_said[-1] is False)
        pedal.press_stop()
        until(qtbot, lambda: Act.STOP in pilot.acts)
        pedal.press_estop()
        until(qtbot, lambda: pilot.estop_said[-1] is True)
        pedal.release_estop()
        until(qtbot, lambda: pilot.estop_said[-1] is False)
        pedal.vanish()
        until(qtbot, lambda: any(bad for _, bad in said))
        assert pilot.deadman_said[-1] is None
    finally:
        devices.close()


def test_a_pedal_that_cannot_be_opened_is_told_with_what_to_do(qtbot: QtBot) -> None:
    config = Config.model_validate({"gamepad": {"enabled": False}, "pedal": {"port": "/dev/serial/by-id/none"}})
    devices = OperatorDevices(config, lambda: None, lambda: None)
    with qtbot.waitSignal(devices.said) as told:
        devices.start()
    devices.close()
    assert "/dev/serial/by-id/none" in told.args[0]
    assert told.args[1] is True
