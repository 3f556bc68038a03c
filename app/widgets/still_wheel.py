"""Lists and numbers that the wheel does not turn: what it changes by the way nobody has chosen, and nobody has seen."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QAbstractSpinBox, QComboBox, QWidget


class StillWheel(QObject):
    """For all lists and numbers that `dialog` has when it is made; what lies below them is scrolled instead.

    An open list is turned as ever.
    """

    def __init__(self, dialog: QWidget) -> None:
        super().__init__(dialog)
        for control in (*dialog.findChildren(QComboBox), *dialog.findChildren(QAbstractSpinBox)):
            control.setFocusPolicy(Qt.FocusPolicy.StrongFocus)  # nor may it take the focus to them
            control.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Wheel:
            event.ignore()
            return True
        return False
