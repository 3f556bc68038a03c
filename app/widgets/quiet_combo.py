"""A list that opens only on purpose: the keys of an operator window belong to the robot."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent, QWheelEvent
from PySide6.QtWidgets import QComboBox

_OPENING = (Qt.Key.Key_Return, Qt.Key.Key_Enter)


def name_list(combo: QComboBox, name: str) -> None:
    """Under Linux Qt tells a screen reader what is chosen instead of the name, so the name is its description, too."""
    combo.setAccessibleName(name)
    combo.setAccessibleDescription(name)


class QuietCombo(QComboBox):
    """A click opens it, or Enter when Tab has come to it; in the open list the arrows choose, Enter takes and Escape leaves.

    Closed it takes no key and no turn of the wheel: neither may choose something by the way.

    Parameters
    ----------
    name : for screen readers.
    keeps_focus : in a dialog, which is gone through by keyboard. Else the keys are the robot's again once the list is closed.
    """

    def __init__(self, name: str, *, keeps_focus: bool = False) -> None:
        super().__init__()
        self._keeps_focus = keeps_focus
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        name_list(self, name)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in _OPENING and not event.isAutoRepeat():
            self.showPopup()
            return
        event.ignore()

    def hidePopup(self) -> None:
        super().hidePopup()
        if not self._keeps_focus:
            self.clearFocus()
