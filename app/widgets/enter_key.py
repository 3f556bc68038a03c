"""Enter presses the button that has the focus, and opens the list: Space, which does it elsewhere, stops the robot."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractButton, QComboBox, QWidget


def takes_enter(dialog: QWidget, event: QKeyEvent) -> bool:
    """Whether a key press of `dialog` was Enter; it is done with then, also where it means nothing."""
    if event.key() not in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
        return False
    focus = dialog.focusWidget()
    if not event.isAutoRepeat():
        if isinstance(focus, QAbstractButton):
            focus.click()
        elif isinstance(focus, QComboBox):
            focus.showPopup()
    return True
