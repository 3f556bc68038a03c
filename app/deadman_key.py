"""The deadman on the keyboard and on the screen: Shift, or a field that is held with the mouse."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QGuiApplication, QKeyEvent
from PySide6.QtWidgets import QApplication, QWidget

REPEAT_MS = 25
"""Silence of 80 ms counts as let go, so it is said three times in that time."""
_KEY = Qt.Key.Key_Shift


class DeadmanKey(QObject):
    """``reported`` comes with True every 25 ms while it is held, and with False at once when it is let go or the focus is lost.

    A key that was down when the window got the focus does not count: only a press does.
    """

    reported = Signal(bool)

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._holders: set[str] = set()
        self._timer = QTimer(self)
        self._timer.setInterval(REPEAT_MS)
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._repeat)
        application = QApplication.instance()
        if application is not None:
            application.installEventFilter(self)
        if isinstance(application, QGuiApplication):
            application.applicationStateChanged.connect(self._on_application_state)

    @property
    def is_held(self) -> bool:
        return bool(self._holders)

    def hold(self, holder: str, on: bool) -> None:
        """The key or the mouse takes it, or lets go."""
        before = self.is_held
        if on:
            self._holders.add(holder)
        else:
            self._holders.discard(holder)
        if self.is_held is not before:
            if self.is_held:
                self._timer.start()
            else:
                self._timer.stop()
            self.reported.emit(self.is_held)

    def release(self) -> None:
        """Nobody holds it."""
        for holder in tuple(self._holders):
            self.hold(holder, False)

    def detach(self) -> None:
        """Let go and listen no more."""
        self.release()
        application = QApplication.instance()
        if application is not None:
            application.removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.KeyPress and isinstance(event, QKeyEvent) and event.key() == _KEY:
            if isinstance(watched, QWidget) and watched.window() is self._window and not event.isAutoRepeat():
                self.hold("key", True)
        elif kind == QEvent.Type.KeyRelease and isinstance(event, QKeyEvent) and event.key() == _KEY:
            if not event.isAutoRepeat():
                self.hold("key", False)
        elif kind == QEvent.Type.WindowDeactivate and watched is self._window:
            self.release()
        return False

    @Slot(Qt.ApplicationState)
    def _on_application_state(self, state: Qt.ApplicationState) -> None:
        if state != Qt.ApplicationState.ApplicationActive:
            self.release()

    @Slot()
    def _repeat(self) -> None:
        self.reported.emit(True)
