"""What is held on keyboard or screen: said again and again while it is, and let go when nobody can be holding it any more."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Slot
from PySide6.QtGui import QGuiApplication, QKeyEvent
from PySide6.QtWidgets import QApplication, QWidget

_WINDOW_LOST = (QEvent.Type.WindowDeactivate, QEvent.Type.WindowBlocked)
"""Blocked by a dialog, a window gets no release any more, even where the desktop leaves it the focus."""


class HeldInput(QObject):
    """Listens to the keys of the whole application, from its making to ``detach``.

    Subclasses say what a press and a release mean, how all is let go, and what is said every `period_ms` while ``_timer`` runs. All
    is let go when `window` or the application loses the focus, or a dialog blocks it, so that nothing goes on unattended.
    """

    def __init__(self, window: QWidget, period_ms: int) -> None:
        super().__init__(window)
        self._window = window
        self._timer = QTimer(self)
        self._timer.setInterval(period_ms)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._repeat)
        application = QApplication.instance()
        if application is not None:
            application.installEventFilter(self)
        if isinstance(application, QGuiApplication):
            application.applicationStateChanged.connect(self._on_application_state)

    def release_all(self) -> None:
        """Nothing is held any more."""
        raise NotImplementedError

    def detach(self) -> None:
        """Let go and listen no more."""
        self.release_all()
        application = QApplication.instance()
        if application is not None:
            application.removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            return self._on_press(watched, event)
        if kind == QEvent.Type.KeyRelease and isinstance(event, QKeyEvent):
            return self._on_release(event)
        if kind in _WINDOW_LOST and watched is self._window:
            self.release_all()
        return False

    def _on_press(self, watched: QObject, event: QKeyEvent) -> bool:
        """True when the key goes no further."""
        raise NotImplementedError

    def _on_release(self, event: QKeyEvent) -> bool:
        raise NotImplementedError

    def _repeat(self) -> None:
        raise NotImplementedError

    @Slot(Qt.ApplicationState)
    def _on_application_state(self, state: Qt.ApplicationState) -> None:
        if state != Qt.ApplicationState.ApplicationActive:
            self.release_all()


def place_of(event: QKeyEvent) -> tuple[str, int]:
    """Which key of the keyboard it is.

    What a key means may change while it is down: with NumLock the keypad's Up, pressed beside Shift, is let go as an 8, and where
    Shift and Alt together change the layout, Shift itself is let go as another key.
    """
    scan_code = event.nativeScanCode()
    return ("place", scan_code) if scan_code else ("key", event.key())
