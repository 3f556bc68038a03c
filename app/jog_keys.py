"""Keys that move the robot by hand: hold to move, release to stop. STOP stops everything, whatever has the focus."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QAbstractSpinBox, QLineEdit, QMenuBar, QWidget

from app.held_input import HeldInput, place_of
from app.language import mark
from app.stop_key import is_stop
from app.widgets.scroll_keys import SCROLL_KEYS
from core.control.hand import AT_REST, Jog

PERIOD_MS = 33


class Motion(Enum):
    """One direction that can be held."""

    STEER_LEFT = mark("steer left")
    STEER_RIGHT = mark("steer right")
    ADVANCE = mark("advance")
    RETRACT = mark("retract")
    PITCH_UP = mark("pitch up")
    PITCH_DOWN = mark("pitch down")
    DELIVER = mark("sheath forward")
    WITHDRAW = mark("sheath back")
    STRAIGHTEN = mark("straighten the head")


KEYS: dict[Motion, tuple[Qt.Key, ...]] = {
    Motion.STEER_LEFT: (Qt.Key.Key_Left, Qt.Key.Key_A),
    Motion.STEER_RIGHT: (Qt.Key.Key_Right, Qt.Key.Key_D),
    Motion.ADVANCE: (Qt.Key.Key_Up, Qt.Key.Key_W),
    Motion.RETRACT: (Qt.Key.Key_Down, Qt.Key.Key_S),
    Motion.PITCH_UP: (Qt.Key.Key_E,),
    Motion.PITCH_DOWN: (Qt.Key.Key_Q,),
    Motion.DELIVER: (Qt.Key.Key_PageUp,),
    Motion.WITHDRAW: (Qt.Key.Key_PageDown,),
    Motion.STRAIGHTEN: (Qt.Key.Key_X,),
}
_MOTION_OF_KEY = {key: motion for motion, keys in KEYS.items() for key in keys}
_BY_PLACE = {
    24: Qt.Key.Key_Q, 25: Qt.Key.Key_W, 26: Qt.Key.Key_E, 38: Qt.Key.Key_A, 39: Qt.Key.Key_S, 40: Qt.Key.Key_D, 53: Qt.Key.Key_X,
}  # fmt: skip
"""Where these letters lie, in the numbers of X11 and Wayland, for a layout that has the letters of another alphabet there."""
_FIRST_LETTER, _FIRST_OTHER_KEY = 0x80, 0x0100_0000
_OTHER_MODIFIERS = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier


class JogKeys(HeldInput):
    """Turns held keys and held buttons into a ``Jog``.

    Everything held is released when the window loses the focus, so nothing moves unattended. ``changed`` carries the jog; it comes
    at each press and release and every 33 ms while something is held, since its silence counts as let go. ``stop_pressed`` comes
    from a key of STOP in any window of the program that has the focus; ``can_move`` is asked when Space is pressed in a text field.
    """

    changed = Signal(object)
    held_changed = Signal(object)
    stop_pressed = Signal()

    def __init__(self, window: QWidget, can_move: Callable[[], bool] = lambda: True) -> None:
        super().__init__(window, PERIOD_MS)
        self._can_move = can_move
        self._held: dict[object, Motion] = {}

    @property
    def held(self) -> frozenset[Motion]:
        return frozenset(self._held.values())

    @property
    def jog(self) -> Jog:
        """How the controls are held now."""
        held = self.held
        return Jog(
            bend=_sign(held, Motion.STEER_RIGHT, Motion.STEER_LEFT),
            pitch=_sign(held, Motion.PITCH_UP, Motion.PITCH_DOWN),
            advance=_sign(held, Motion.ADVANCE, Motion.RETRACT),
            delivery=_sign(held, Motion.DELIVER, Motion.WITHDRAW),
            straighten=Motion.STRAIGHTEN in held,
        )

    def press(self, source: object, motion: Motion) -> None:
        """`source` (a key, a button) starts to hold `motion`."""
        if self._held.get(source) is not motion:
            self._held[source] = motion
            self._timer.start()
            self._announce()

    def release(self, source: object) -> None:
        """`source` lets go."""
        if source in self._held:
            del self._held[source]
            if not self._held:
                self._timer.stop()
            self._announce()

    def release_all(self) -> None:
        """Nothing is held any more; nothing is said when nothing was held."""
        if self._held:
            self._held.clear()
            self._timer.stop()
            self._announce()

    def _on_press(self, watched: QObject, event: QKeyEvent) -> bool:
        if not isinstance(watched, QWidget):
            return False
        key = _key_of(event)
        if is_stop(watched, event, self._can_move()):  # wherever it goes to: menus, lists and dialogs too
            if not event.isAutoRepeat():
                self.stop_pressed.emit()
                self.release_all()
            return True
        if event.isAutoRepeat() and place_of(event) in self._held:
            return True  # a field or menu that gets the focus meanwhile is not typed into by it
        if watched.window() is not self._window or event.modifiers() & _OTHER_MODIFIERS:
            return False
        motion = _MOTION_OF_KEY.get(key)
        # A field keeps its letters and arrows, and what it does not use must not reach the robot by way of its parent.
        focus = self._window.focusWidget()
        # A tap on Alt gives the keys to the menu bar, where the arrows go from menu to menu.
        if motion is None or isinstance(focus, QAbstractSpinBox | QLineEdit | QMenuBar):
            return False
        if isinstance(focus, QAbstractItemView) and key in SCROLL_KEYS:
            return False
        if not event.isAutoRepeat():
            self.press(place_of(event), motion)
        return True

    def _on_release(self, event: QKeyEvent) -> bool:
        """A release counts wherever it goes to, or motion would go on after a menu opened over the window."""
        place = place_of(event)
        if event.isAutoRepeat():
            return place in self._held
        if place in self._held:
            self.release(place)
            return True
        return False

    def _repeat(self) -> None:
        self.changed.emit(self.jog)

    def _announce(self) -> None:
        self.held_changed.emit(self.held)
        self.changed.emit(self.jog if self._held else AT_REST)


def _key_of(event: QKeyEvent) -> Qt.Key:
    """By its letter; where that is none of the Latin ones, by the place of the keyboard where theirs would be."""
    key = Qt.Key(event.key())
    return _BY_PLACE.get(event.nativeScanCode(), key) if _FIRST_LETTER <= key < _FIRST_OTHER_KEY else key


def _sign(held: frozenset[Motion], plus: Motion, minus: Motion) -> int:
    """+1, -1, or 0 when neither or both are held."""
    return (plus in held) - (minus in held)
