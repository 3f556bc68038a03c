"""STOP keys: Space and Pause stop the robot, in any window and with any focus.

Pause, and Space with Ctrl, Alt or Meta, always; Space alone except while a text is typed and nothing can move. The press goes by
``RigSession.stop`` to ``Pilot.stop`` (``core/control/pilot.py``): one byte in the STOP pipe of the servo bus process, whose
``BusLoop._handle_stop`` (``hardware/servos/bus_process.py``) holds all servos, and the mode STOPPED until it is acknowledged.
"""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QLineEdit, QPlainTextEdit, QTextEdit, QWidget

NUMBERS_ONLY = "numbers_only"
"""Property of a line edit whose text is a number: Space is STOP there, too."""
COMMAND_MODIFIERS = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier
"""With one of these a letter is a command of the menu, and Space is STOP."""


def application() -> QApplication:
    found = QApplication.instance()
    assert isinstance(found, QApplication)
    return found


def is_stop(watched: QObject, event: QKeyEvent, can_move: bool) -> bool:
    """Whether the press is a STOP.

    Parameters
    ----------
    watched : the widget that the key goes to.
    can_move : whether anything can move, or is about to; then Space is STOP in a text field, too.
    """
    if event.key() == Qt.Key.Key_Pause:
        return True
    if event.key() != Qt.Key.Key_Space:
        return False
    return can_move or bool(event.modifiers() & COMMAND_MODIFIERS) or not takes_a_space(watched)


def takes_a_space(widget: QObject) -> bool:
    """Whether it is a field that a space can be typed in; numbers have none."""
    if not isinstance(widget, QLineEdit | QPlainTextEdit | QTextEdit) or not widget.isEnabled() or widget.isReadOnly():
        return False
    return not (isinstance(widget, QLineEdit) and widget.property(NUMBERS_ONLY))


class StopKeys(QObject):
    """STOP keys in all windows of the program while `owner` is visible, for a dialog that has the servos.

    Parameters
    ----------
    owner : the dialog.
    can_move : asked at each press.
    stop : what STOP does.
    """

    def __init__(self, owner: QWidget, can_move: Callable[[], bool], stop: Callable[[], object]) -> None:
        super().__init__(owner)
        self._owner, self._can_move, self._stop = owner, can_move, stop
        application().installEventFilter(self)

    def detach(self) -> None:
        """Listen no more."""
        application().removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() not in (QEvent.Type.KeyPress, QEvent.Type.ShortcutOverride) or not isinstance(event, QKeyEvent):
            return False
        if not isinstance(watched, QWidget) or not self._owner.isVisible() or not is_stop(watched, event, self._can_move()):
            return False
        if event.type() == QEvent.Type.ShortcutOverride:
            event.accept()  # it comes as a key, whatever shortcut has it
            return True
        if not event.isAutoRepeat():
            self._stop()
        return True
