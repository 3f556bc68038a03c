"""Lists of the operator window that Tab reaches: the arrows scroll there, and everywhere else they are the robot's."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QListView, QTableView

Key = Qt.Key
SCROLL_KEYS = frozenset({Key.Key_Up, Key.Key_Down, Key.Key_PageUp, Key.Key_PageDown, Key.Key_Home, Key.Key_End})
"""What a list keeps for itself while it has the focus, so that none of them reaches the robot by way of its parent."""


def listen_to_tab(view: QAbstractItemView) -> None:
    """By Tab only: a click into the list must not take the arrows from the robot."""
    view.setFocusPolicy(Qt.FocusPolicy.TabFocus)


def scroll(view: QAbstractItemView, event: QKeyEvent, row_px: int) -> bool:
    """Scroll by a row, a page or to an end; False for any other key."""
    bar = view.verticalScrollBar()
    ways = {
        Key.Key_Up: bar.value() - row_px,
        Key.Key_Down: bar.value() + row_px,
        Key.Key_PageUp: bar.value() - bar.pageStep(),
        Key.Key_PageDown: bar.value() + bar.pageStep(),
        Key.Key_Home: bar.minimum(),
        Key.Key_End: bar.maximum(),
    }
    place = ways.get(Key(event.key()))
    if place is None:
        return False
    bar.setValue(place)
    event.accept()
    return True


class ScrolledList(QListView):
    """A list that nobody chooses from."""

    def __init__(self, row_px: int) -> None:
        super().__init__()
        self._row_px = row_px
        listen_to_tab(self)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not scroll(self, event, self._row_px):
            event.ignore()


class ScrolledTable(QTableView):
    """A table that nobody chooses from."""

    def __init__(self, row_px: int) -> None:
        super().__init__()
        self._row_px = row_px
        self.setTabKeyNavigation(False)
        listen_to_tab(self)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not scroll(self, event, self._row_px):
            event.ignore()
