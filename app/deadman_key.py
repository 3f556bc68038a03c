"""The deadman on the keyboard and on the screen: Shift, or a field that is held with the mouse."""

from __future__ import annotations

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from app.held_input import HeldInput, place_of

REPEAT_MS = 25
"""Silence of 80 ms counts as let go, so it is said three times in that time."""
_KEY = Qt.Key.Key_Shift


class DeadmanKey(HeldInput):
    """``reported`` comes with True every 25 ms while it is held, and with False at once when it is let go or the focus is lost.

    A key that was down when the window got the focus does not count: only a press does.
    """

    reported = Signal(bool)

    def __init__(self, window: QWidget) -> None:
        super().__init__(window, REPEAT_MS)
        self._holders: set[str] = set()
        self._places: set[tuple[str, int]] = set()

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

    def release_all(self) -> None:
        """Nobody holds it."""
        self._places.clear()
        for holder in tuple(self._holders):
            self.hold(holder, False)

    def _on_press(self, watched: QObject, event: QKeyEvent) -> bool:
        is_ours = isinstance(watched, QWidget) and watched.window() is self._window
        if event.key() == _KEY and is_ours and not event.isAutoRepeat():
            self._places.add(place_of(event))
            self.hold("key", True)
        return False

    def _on_release(self, event: QKeyEvent) -> bool:
        """The first Shift that comes up counts, and whatever a Shift that went down has become meanwhile."""
        if not event.isAutoRepeat() and (event.key() == _KEY or place_of(event) in self._places):
            self._places.clear()
            self.hold("key", False)
        return False

    def _repeat(self) -> None:
        self.reported.emit(True)
