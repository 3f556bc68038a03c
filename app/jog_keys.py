"""Keys that move the robot by hand: hold to move, release to stop."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import Enum

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QGuiApplication, QKeyEvent
from PySide6.QtWidgets import QAbstractSpinBox, QApplication, QLineEdit, QWidget

from core.types import Command

BEND_PER_S = 1.2
"""Share of the tendons' full pull per second while a steering key is held."""
PERIOD_MS = 33
_LONGEST_STEP_S = 0.1


class Motion(Enum):
    """One direction that can be held."""

    STEER_LEFT = "steer left"
    STEER_RIGHT = "steer right"
    ADVANCE = "advance"
    RETRACT = "retract"
    PITCH_UP = "pitch up"
    PITCH_DOWN = "pitch down"
    DELIVER = "sheath forward"
    WITHDRAW = "sheath back"


KEYS: dict[Motion, tuple[Qt.Key, ...]] = {
    Motion.STEER_LEFT: (Qt.Key.Key_Left, Qt.Key.Key_A),
    Motion.STEER_RIGHT: (Qt.Key.Key_Right, Qt.Key.Key_D),
    Motion.ADVANCE: (Qt.Key.Key_Up, Qt.Key.Key_W),
    Motion.RETRACT: (Qt.Key.Key_Down, Qt.Key.Key_S),
    Motion.PITCH_UP: (Qt.Key.Key_E,),
    Motion.PITCH_DOWN: (Qt.Key.Key_Q,),
    Motion.DELIVER: (Qt.Key.Key_PageUp,),
    Motion.WITHDRAW: (Qt.Key.Key_PageDown,),
}
_MOTION_OF_KEY = {key: motion for motion, keys in KEYS.items() for key in keys}
_STOP_KEY = Qt.Key.Key_Space
_OTHER_MODIFIERS = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier


class JogKeys(QObject):
    """Turns held keys and held buttons into commands.

    Bend and pitch are positions: they move while a key is held and stay when it is released. Advance and delivery are speeds: they
    are zero when nothing is held. Everything held is released when the window loses the focus, so nothing moves unattended.
    ``changed`` carries the command to send; it comes at each press and release and every 33 ms while something is held.
    """

    changed = Signal(object)
    held_changed = Signal(object)

    def __init__(
        self, window: QWidget, advance_mm_s: float, delivery_mm_s: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(window)
        self._window = window
        self._advance_mm_s = advance_mm_s
        self._delivery_mm_s = delivery_mm_s
        self._clock = clock
        self._held: dict[object, Motion] = {}
        self._bend = 0.0
        self._pitch = 0.0
        self._last_s = 0.0
        self._timer = QTimer(self)
        self._timer.setInterval(PERIOD_MS)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._advance_time)
        application = QApplication.instance()
        if application is not None:
            application.installEventFilter(self)
        if isinstance(application, QGuiApplication):
            application.applicationStateChanged.connect(self._on_application_state)

    @property
    def held(self) -> frozenset[Motion]:
        return frozenset(self._held.values())

    @property
    def command(self) -> Command:
        """What is asked of the robot now."""
        held = self.held
        return Command(
            bend=self._bend,
            pitch=self._pitch,
            advance_mm_s=self._advance_mm_s * _sign(held, Motion.ADVANCE, Motion.RETRACT),
            delivery_mm_s=self._delivery_mm_s * _sign(held, Motion.DELIVER, Motion.WITHDRAW),
        )

    def press(self, source: object, motion: Motion) -> None:
        """`source` (a key, a button) starts to hold `motion`."""
        if self._held.get(source) is motion:
            return
        self._integrate()
        self._held[source] = motion
        self._last_s = self._clock()
        self._timer.start()
        self._announce()

    def release(self, source: object) -> None:
        """`source` lets go."""
        if source not in self._held:
            return
        self._integrate()
        del self._held[source]
        if not self._held:
            self._timer.stop()
        self._announce()

    def release_all(self) -> None:
        """Nothing is held any more; the bend stays where it is. No command when nothing was held."""
        if self._held:
            self._integrate()
            self._held.clear()
            self._timer.stop()
            self._announce()

    def detach(self) -> None:
        """Release everything and listen no more."""
        self.release_all()
        application = QApplication.instance()
        if application is not None:
            application.removeEventFilter(self)

    def reset(self) -> None:
        """Forget everything, for a robot that has just been opened: nothing is held, the head is straight."""
        self.release_all()
        self._bend = self._pitch = 0.0

    @Slot()
    def stop(self) -> None:
        """Stop all motion and straighten the head."""
        self._held.clear()
        self._timer.stop()
        self._bend = self._pitch = 0.0
        self._announce()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            return self._on_press(watched, event)
        if kind == QEvent.Type.KeyRelease and isinstance(event, QKeyEvent):
            return self._on_release(event)
        if kind == QEvent.Type.WindowDeactivate and watched is self._window:
            self.release_all()
        return False

    def _on_press(self, watched: QObject, event: QKeyEvent) -> bool:
        if not isinstance(watched, QWidget) or watched.window() is not self._window or event.modifiers() & _OTHER_MODIFIERS:
            return False
        key = Qt.Key(event.key())
        if key == _STOP_KEY:
            if not event.isAutoRepeat():
                self.stop()
            return True
        motion = _MOTION_OF_KEY.get(key)
        # A field keeps its letters and arrows, and what it does not use must not reach the robot by way of its parent.
        if motion is None or isinstance(self._window.focusWidget(), QAbstractSpinBox | QLineEdit):
            return False
        if not event.isAutoRepeat():
            self.press(key, motion)
        return True

    def _on_release(self, event: QKeyEvent) -> bool:
        """A release counts wherever it goes to, or motion would go on after a menu opened over the window."""
        key = Qt.Key(event.key())
        if event.isAutoRepeat():
            return key in self._held
        if key in self._held:
            self.release(key)
            return True
        return False

    @Slot(Qt.ApplicationState)
    def _on_application_state(self, state: Qt.ApplicationState) -> None:
        if state != Qt.ApplicationState.ApplicationActive:
            self.release_all()

    @Slot()
    def _advance_time(self) -> None:
        self._integrate()
        self.changed.emit(self.command)

    def _integrate(self) -> None:
        """Move bend and pitch by the time since the last step; a stalled GUI makes one short step, not a long one."""
        now = self._clock()
        step = BEND_PER_S * min(max(now - self._last_s, 0.0), _LONGEST_STEP_S)
        self._last_s = now
        held = self.held
        self._bend = _clamp(self._bend + step * _sign(held, Motion.STEER_RIGHT, Motion.STEER_LEFT))
        self._pitch = _clamp(self._pitch + step * _sign(held, Motion.PITCH_UP, Motion.PITCH_DOWN))

    def _announce(self) -> None:
        self.held_changed.emit(self.held)
        self.changed.emit(self.command)


def _sign(held: frozenset[Motion], plus: Motion, minus: Motion) -> int:
    """+1, -1, or 0 when neither or both are held."""
    return (plus in held) - (minus in held)


def _clamp(value: float) -> float:
    return max(-1.0, min(1.0, value))
