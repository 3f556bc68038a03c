"""Hold to move, release to stop; nothing moves unattended."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QHBoxLayout, QLineEdit, QMenu, QSpinBox, QWidget
from pytestqt.qtbot import QtBot

from app.jog_keys import BEND_PER_S, KEYS, JogKeys, Motion
from core.types import Command

Key = Qt.Key


class Bench:
    """A window with a text field and a spin box, jog keys, and a clock that the test turns."""

    def __init__(self, qtbot: QtBot) -> None:
        self.now_s = 100.0
        self.window = QWidget()
        qtbot.addWidget(self.window)
        row = QHBoxLayout(self.window)
        self.text, self.spin = QLineEdit(), QSpinBox()
        row.addWidget(self.text)
        row.addWidget(self.spin)
        self.window.show()
        self.window.setFocus()
        self.jog = JogKeys(self.window, 10.0, 5.0, clock=lambda: self.now_s)
        self.commands: list[Command] = []
        self.jog.changed.connect(self.commands.append)

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
    ("key", "advance", "delivery"),
    [
        (Key.Key_Up, 10.0, 0.0),
        (Key.Key_W, 10.0, 0.0),
        (Key.Key_Down, -10.0, 0.0),
        (Key.Key_S, -10.0, 0.0),
        (Key.Key_PageUp, 0.0, 5.0),
        (Key.Key_PageDown, 0.0, -5.0),
    ],
)
def test_speed_is_there_while_held_and_zero_after(bench: Bench, key: Qt.Key, advance: float, delivery: float) -> None:
    bench.press(key)
    assert bench.commands == [Command(advance_mm_s=advance, delivery_mm_s=delivery)]
    bench.release(key)
    assert bench.commands[-1] == Command()


@pytest.mark.parametrize(
    ("key", "bend", "pitch"),
    [
        (Key.Key_Right, 1, 0),
        (Key.Key_D, 1, 0),
        (Key.Key_Left, -1, 0),
        (Key.Key_A, -1, 0),
        (Key.Key_E, 0, 1),
        (Key.Key_Q, 0, -1),
    ],
)
def test_bend_moves_while_held_and_stays_after(bench: Bench, key: Qt.Key, bend: int, pitch: int) -> None:
    bench.press(key)
    assert bench.commands[-1] == Command()
    bench.now_s += 0.1
    bench.release(key)
    step = 0.1 * BEND_PER_S
    assert bench.commands[-1].bend == pytest.approx(bend * step)
    assert bench.commands[-1].pitch == pytest.approx(pitch * step)
    bench.now_s += 5.0
    bench.press(Key.Key_W)
    assert bench.commands[-1].bend == pytest.approx(bend * step), "time without a key does not count"


def test_holding_sends_again_and_again(bench: Bench, qtbot: QtBot) -> None:
    bench.press(Key.Key_Right)
    qtbot.waitUntil(lambda: len(bench.commands) >= 3)
    bench.release(Key.Key_Right)
    sent = len(bench.commands)
    qtbot.wait(100)
    assert len(bench.commands) == sent, "nothing held, nothing sent"


def test_bend_ends_at_the_full_pull(bench: Bench) -> None:
    bench.press(Key.Key_Right)
    for _ in range(50):
        bench.now_s += 0.1
        bench.jog._advance_time()
    assert bench.commands[-1].bend == 1.0


def test_a_stalled_window_makes_no_jump(bench: Bench) -> None:
    bench.press(Key.Key_Right)
    bench.now_s += 30.0
    bench.release(Key.Key_Right)
    assert bench.commands[-1].bend == pytest.approx(0.1 * BEND_PER_S)


def test_opposite_keys_cancel(bench: Bench) -> None:
    bench.press(Key.Key_W)
    bench.press(Key.Key_S)
    assert bench.commands[-1].advance_mm_s == 0.0
    bench.release(Key.Key_S)
    assert bench.commands[-1].advance_mm_s == 10.0


def test_two_keys_of_one_motion_count_once(bench: Bench) -> None:
    bench.press(Key.Key_W)
    bench.press(Key.Key_Up)
    assert bench.commands[-1].advance_mm_s == 10.0
    bench.release(Key.Key_W)
    assert bench.commands[-1].advance_mm_s == 10.0, "the other key is still down"


def test_auto_repeat_is_ignored(bench: Bench) -> None:
    bench.press(Key.Key_W)
    for _ in range(5):
        bench.release(Key.Key_W, repeat=True)
        bench.press(Key.Key_W, repeat=True)
    assert bench.commands == [Command(advance_mm_s=10.0)]


def test_a_key_that_was_down_before_does_not_count(bench: Bench) -> None:
    bench.press(Key.Key_W, repeat=True)
    assert bench.jog.held == frozenset()


def test_losing_the_focus_stops_motion_and_keeps_the_bend(bench: Bench) -> None:
    bench.press(Key.Key_W)
    bench.press(Key.Key_Right)
    bench.now_s += 0.1
    QApplication.sendEvent(bench.window, QEvent(QEvent.Type.WindowDeactivate))
    assert bench.jog.held == frozenset()
    assert bench.commands[-1] == Command(bend=pytest.approx(0.1 * BEND_PER_S))


def test_a_release_counts_wherever_it_goes_to(bench: Bench, qtbot: QtBot) -> None:
    menu = QMenu()
    qtbot.addWidget(menu)
    bench.press(Key.Key_W)
    bench.release(Key.Key_W, to=menu)
    assert bench.commands[-1] == Command()


def test_space_stops_and_straightens_even_in_a_text_field(bench: Bench) -> None:
    bench.press(Key.Key_Right)
    bench.press(Key.Key_W)
    bench.now_s += 0.1
    bench.press(Key.Key_Space, to=bench.text)
    assert bench.commands[-1] == Command()
    assert bench.text.text() == ""
    bench.release(Key.Key_W)
    assert bench.jog.command == Command()


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


def test_reset_forgets_the_bend(bench: Bench) -> None:
    bench.press(Key.Key_Right)
    bench.now_s += 0.1
    bench.jog.reset()
    assert bench.jog.command == Command()


def test_every_motion_has_a_key_and_no_key_two_motions() -> None:
    assert set(KEYS) == set(Motion)
    keys = [key for group in KEYS.values() for key in group]
    assert len(keys) == len(set(keys))
