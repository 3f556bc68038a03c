"""Hold to move, release to stop; nothing moves unattended."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QHBoxLayout, QLineEdit, QMenu, QPlainTextEdit, QPushButton, QSpinBox, QWidget
from pytestqt.qtbot import QtBot

from app.operator.manual_drive import PERIOD_MS, REPEAT_MS, DeadmanKey, JogKeys
from app.settings.fields import NumberEdit
from app.widgets.jog_panel import KEYS, Motion
from core.config.safety import SafetyConfig
from core.control.motion import AT_REST, Jog

Key = Qt.Key
NONE = Qt.KeyboardModifier.NoModifier


class Bench:
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
def bench(qtbot: QtBot) -> Iterator[Bench]:
    made = Bench(qtbot)
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
    ],
)
def test_a_motion_is_there_while_held_and_gone_after(bench: Bench, key: Qt.Key, jog: Jog) -> None:
    bench.press(key)
    assert bench.jogs == [jog]
    bench.release(key)
    assert bench.jogs[-1] == AT_REST


def test_motions_that_are_held_together_are_one_jog(bench: Bench) -> None:
    bench.press(Key.Key_W)
    bench.press(Key.Key_D)
    assert bench.jogs[-1] == Jog(bend=1.0, advance=1.0)


def test_holding_sends_again_and_again(bench: Bench, qtbot: QtBot) -> None:
    bench.press(Key.Key_Right)
    qtbot.waitUntil(lambda: len(bench.jogs) >= 3)
    bench.release(Key.Key_Right)
    sent = len(bench.jogs)
    qtbot.wait(100)
    assert len(bench.jogs) == sent, "nothing held, nothing sent"


def test_opposite_keys_cancel(bench: Bench) -> None:
    bench.press(Key.Key_W)
    bench.press(Key.Key_S)
    assert bench.jogs[-1].advance == 0.0
    bench.release(Key.Key_S)
    assert bench.jogs[-1].advance == 1.0


def test_two_keys_of_one_motion_count_once(bench: Bench) -> None:
    bench.press(Key.Key_W)
    bench.press(Key.Key_Up)
    assert bench.jogs[-1].advance == 1.0
    bench.release(Key.Key_W)
    assert bench.jogs[-1].advance == 1.0, "the other key is still down"


def test_auto_repeat_is_ignored(bench: Bench) -> None:
    bench.press(Key.Key_W)
    for _ in range(5):
        bench.release(Key.Key_W, repeat=True)
        bench.press(Key.Key_W, repeat=True)
    assert bench.jogs == [Jog(advance=1.0)]


def test_a_held_key_types_nothing_into_a_field_that_is_clicked_meanwhile(bench: Bench) -> None:
    bench.press(Key.Key_W)
    bench.text.setFocus()
    QApplication.sendEvent(bench.text, QKeyEvent(QEvent.Type.KeyPress, Key.Key_W, NONE, "w", True))
    assert bench.text.text() == ""
    bench.release(Key.Key_W, to=bench.text)
    QApplication.sendEvent(bench.text, QKeyEvent(QEvent.Type.KeyPress, Key.Key_W, NONE, "w"))
    assert bench.text.text() == "w"


def test_a_key_that_was_down_before_does_not_count(bench: Bench) -> None:
    bench.press(Key.Key_W, repeat=True)
    assert bench.jog.held == frozenset()


@pytest.mark.parametrize("lost", [QEvent.Type.WindowDeactivate, QEvent.Type.WindowBlocked])
def test_losing_the_focus_or_a_dialog_in_front_lets_go(bench: Bench, lost: QEvent.Type) -> None:
    """Behind a modal dialog no release is heard, also where the desktop has not given the focus to it."""
    bench.press(Key.Key_W)
    bench.press(Key.Key_Right)
    QApplication.sendEvent(bench.window, QEvent(lost))
    assert bench.jog.held == frozenset()
    assert bench.jogs[-1] == AT_REST


def test_a_release_counts_wherever_it_goes_to(bench: Bench, qtbot: QtBot) -> None:
    menu = QMenu()
    qtbot.addWidget(menu)
    bench.press(Key.Key_W)
    bench.release(Key.Key_W, to=menu)
    assert bench.jogs[-1] == AT_REST


def test_a_key_that_means_something_else_when_it_is_let_go_lets_go(bench: Bench) -> None:
    """With NumLock and Shift (the deadman) down, the keypad's 8 goes down as Up, and comes up as 8 once Shift is up."""
    keypad, scan_code = Qt.KeyboardModifier.KeypadModifier, 80
    down = QKeyEvent(QEvent.Type.KeyPress, Key.Key_Up, keypad | Qt.KeyboardModifier.ShiftModifier, scan_code, 0, 0)
    QApplication.sendEvent(bench.window, down)
    assert bench.jogs[-1] == Jog(advance=1.0)
    other = QKeyEvent(QEvent.Type.KeyRelease, Key.Key_8, keypad, scan_code + 1, 0, 0)
    QApplication.sendEvent(bench.window, other)
    assert bench.jog.held == {Motion.ADVANCE}
    up = QKeyEvent(QEvent.Type.KeyRelease, Key.Key_8, keypad, scan_code, 0, 0)
    QApplication.sendEvent(bench.window, up)
    assert bench.jogs[-1] == AT_REST


def test_on_a_keyboard_of_another_alphabet_the_letters_are_found_by_their_place(bench: Bench) -> None:
    """Cyrillic, Greek, Hebrew: only the arrows steered, and nothing pitched."""
    cyrillic = {
        24: ("\N{CYRILLIC CAPITAL LETTER SHORT I}", Motion.PITCH_DOWN),
        38: ("\N{CYRILLIC CAPITAL LETTER EF}", Motion.STEER_LEFT),
    }
    for scan_code, (letter, motion) in cyrillic.items():
        for kind, held in ((QEvent.Type.KeyPress, {motion}), (QEvent.Type.KeyRelease, set())):
            QApplication.sendEvent(bench.window, QKeyEvent(kind, ord(letter), NONE, scan_code, 0, 0, letter))
            assert bench.jog.held == held
    # French: A lies where others have Q, and is the A that the legend shows
    QApplication.sendEvent(bench.window, QKeyEvent(QEvent.Type.KeyPress, Key.Key_A, NONE, 24, 0, 0, "a"))
    assert bench.jog.held == {Motion.STEER_LEFT}
    QApplication.sendEvent(bench.window, QKeyEvent(QEvent.Type.KeyRelease, Key.Key_A, NONE, 24, 0, 0, "a"))
    assert bench.jog.held == set()


def shift(kind: QEvent.Type, key: Qt.Key, scan_code: int) -> QKeyEvent:
    return QKeyEvent(kind, key, Qt.KeyboardModifier.AltModifier, scan_code, 0, 0)


@pytest.mark.parametrize("becomes", [Key.Key_unknown, Key.Key_Mode_switch, Key.Key_Meta, Key.Key_Shift])
def test_a_shift_that_is_another_key_when_it_is_let_go_holds_no_deadman(bench: Bench, becomes: Qt.Key) -> None:
    """Where Alt and Shift together change the layout, a Shift that comes up beside Alt is no Shift any more."""
    deadman, said = DeadmanKey(bench.window), list[bool]()
    deadman.reported.connect(said.append)
    QApplication.sendEvent(bench.window, shift(QEvent.Type.KeyPress, Key.Key_Shift, 50))
    QApplication.sendEvent(bench.window, shift(QEvent.Type.KeyRelease, Key.Key_Alt, 64))
    assert deadman.is_held
    assert said == [True]
    QApplication.sendEvent(bench.window, shift(QEvent.Type.KeyRelease, becomes, 50))
    assert not deadman.is_held
    assert said == [True, False]
    deadman.detach()


def test_of_two_shifts_the_first_that_comes_up_lets_go_of_the_deadman(bench: Bench) -> None:
    deadman = DeadmanKey(bench.window)
    for scan_code in (50, 62):
        QApplication.sendEvent(bench.window, shift(QEvent.Type.KeyPress, Key.Key_Shift, scan_code))
    QApplication.sendEvent(bench.window, shift(QEvent.Type.KeyRelease, Key.Key_Shift, 62))
    assert not deadman.is_held
    deadman.detach()


def test_space_stops_once_and_lets_go_even_in_a_text_field(bench: Bench) -> None:
    bench.press(Key.Key_Right)
    bench.press(Key.Key_Space, to=bench.text)
    bench.press(Key.Key_Space, repeat=True, to=bench.text)
    assert bench.jogs[-1] == AT_REST
    assert bench.stops == [True]
    assert bench.text.text() == ""


def test_where_nothing_can_move_a_space_is_typed(bench: Bench) -> None:
    page = QPlainTextEdit()
    bench.window.layout().addWidget(page)
    bench.can_move = False
    bench.type(bench.text)
    bench.type(bench.text, modifier=Qt.KeyboardModifier.ShiftModifier)
    bench.type(page)
    assert (bench.text.text(), page.toPlainText(), bench.stops) == ("  ", " ", [])
    bench.can_move = True
    bench.type(bench.text)
    bench.type(page)
    assert (bench.text.text(), page.toPlainText(), bench.stops) == ("  ", " ", [True, True])


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
    bench: Bench, key: Qt.Key, modifier: Qt.KeyboardModifier, can_move: bool
) -> None:
    bench.can_move = can_move
    for number, place in enumerate((bench.text, bench.spin, bench.window), 1):
        bench.type(place, key, modifier)
        assert len(bench.stops) == number
    assert bench.text.text() == ""


def test_what_takes_no_space_leaves_it_to_stop(bench: Bench) -> None:
    bench.can_move = False
    locked, numbers, button = QLineEdit(), NumberEdit(is_whole=False), QPushButton()
    locked.setReadOnly(True)
    for number, widget in enumerate((locked, numbers, button, bench.spin, bench.window), 1):
        if widget.parent() is None and widget is not bench.window:
            bench.window.layout().addWidget(widget)
        bench.type(widget)
        assert len(bench.stops) == number, widget


def test_typing_does_not_move_the_robot(bench: Bench) -> None:
    for field in (bench.text, bench.spin):
        field.setFocus()
        bench.press(Key.Key_W, to=field)
        bench.press(Key.Key_Up, to=field)
    assert bench.jog.held == frozenset()
    assert bench.spin.value() == 1, "the arrow went to the field"


def test_shortcuts_are_no_motion(bench: Bench) -> None:
    event = QKeyEvent(QEvent.Type.KeyPress, Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    QApplication.sendEvent(bench.window, event)
    assert bench.jog.held == frozenset()


def test_keys_of_another_window_are_not_ours(bench: Bench, qtbot: QtBot) -> None:
    other = QWidget()
    qtbot.addWidget(other)
    bench.press(Key.Key_W, to=other)
    assert bench.jog.held == frozenset()


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
