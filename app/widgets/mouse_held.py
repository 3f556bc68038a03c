"""A field on the screen that is held with the mouse, like a key."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QHideEvent, QMouseEvent
from PySide6.QtWidgets import QApplication, QWidget

_WINDOW_LOST = (QEvent.Type.WindowDeactivate, QEvent.Type.WindowBlocked, QEvent.Type.Hide, QEvent.Type.Close)


class MouseHeld(QWidget):
    """Calls ``on_held`` when the left mouse button takes it and when it lets go.

    Whatever might have swallowed the release counts as one: the field is hidden or disabled, the window is left by the pointer,
    loses the focus or is blocked by a dialog, the grab is lost, or the release went to somebody else.
    """

    def __init__(self) -> None:
        super().__init__()
        self._held = False

    @property
    def is_held(self) -> bool:
        """Held with the mouse here."""
        return self._held

    def on_held(self, held: bool) -> None:
        """It was taken, or let go."""
        raise NotImplementedError

    def let_go(self) -> None:
        """No longer held with the mouse."""
        if self._held:
            self._held = False
            application = QApplication.instance()
            if application is not None:
                application.removeEventFilter(self)
            self.on_held(False)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and not self._held:
            self._held = True
            application = QApplication.instance()
            if application is not None:
                application.installEventFilter(self)
            self.on_held(True)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        window = self.window()
        if not window.rect().contains(self.mapTo(window, event.position().toPoint())):
            self.let_go()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.let_go()

    def hideEvent(self, event: QHideEvent) -> None:
        self.let_go()
        super().hideEvent(event)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.EnabledChange and not self.isEnabled():
            self.let_go()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Of the whole application, while held: a menu that opens meanwhile gets the release instead of us."""
        kind = event.type()
        lost = (
            (kind == QEvent.Type.MouseButtonRelease and isinstance(event, QMouseEvent) and _is_left(event))
            or (kind in _WINDOW_LOST and watched is self.window())
            or (kind == QEvent.Type.UngrabMouse and watched is self)
            or kind == QEvent.Type.ApplicationDeactivate
        )
        if lost:
            self.let_go()
        return False


def _is_left(event: QMouseEvent) -> bool:
    return event.button() == Qt.MouseButton.LeftButton
