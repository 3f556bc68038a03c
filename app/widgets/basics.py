"""Parts that several windows are composed of: cards, columns, layouts, combo boxes and lists that leave the keys to the robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent, QResizeEvent, QWheelEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSpinBox,
    QBoxLayout,
    QComboBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QPushButton,
    QSplitter,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from app.ui import theme
from app.ui.i18n import tr

_SHARE_RANGE = 0.2, 0.9  # of the width, for the left one of two columns
_TOP_PX = 4  # margin above the panels of a window


# ---- layouts


Part = QWidget | QLayout | tuple[QWidget | QLayout, int] | None
"""A part of a layout, with its stretch; None: empty room that takes what is left."""
Margins = tuple[int, int, int, int]
_NO_MARGINS = (0, 0, 0, 0)


def column(*parts: Part, spacing: int = theme.GAP, margins: Margins = _NO_MARGINS) -> QVBoxLayout:
    return _fill(QVBoxLayout(), parts, spacing, margins)


def line(*parts: Part, spacing: int = theme.GAP, margins: Margins = _NO_MARGINS) -> QHBoxLayout:
    return _fill(QHBoxLayout(), parts, spacing, margins)


Box = TypeVar("Box", bound=QBoxLayout)


def _fill(layout: Box, parts: Sequence[Part], spacing: int, margins: Margins) -> Box:
    layout.setContentsMargins(*margins)
    layout.setSpacing(spacing)
    add_parts(layout, *parts)
    return layout


def add_parts(layout: QBoxLayout, *parts: Part) -> None:
    for part in parts:
        if part is None:
            layout.addStretch(1)
            continue
        item, stretch = part if isinstance(part, tuple) else (part, 0)
        if isinstance(item, QWidget):
            layout.addWidget(item, stretch)
        else:
            layout.addLayout(item, stretch)


def row(*widgets: QWidget) -> QWidget:
    """Widgets side by side, equally wide."""
    return holder(line(*((widget, 1) for widget in widgets)))


def holder(layout: QLayout) -> QWidget:
    """A widget that is nothing but the place of a layout."""
    widget = QWidget()
    widget.setLayout(layout)
    return widget


def side(layout: QLayout, narrowest: int, widest: int) -> QWidget:
    """The right one of two columns: beyond a width its dials gain nothing, and the picture everything. Pixels."""
    widget = holder(layout)
    widget.setMinimumWidth(narrowest)
    widget.setMaximumWidth(widest)
    return widget


def set_window_margins(layout: QLayout) -> None:
    """Those of the panels to the window's edges."""
    layout.setContentsMargins(theme.GAP, _TOP_PX, theme.GAP, theme.GAP)


def card_title(text: str) -> QLabel:
    label = QLabel(text)
    label.setObjectName("card_title")
    return label


def card_note(text: str) -> QLabel:
    """The small text at the right of a card's title, for a text that changes."""
    label = QLabel(text)
    label.setObjectName("card_note")
    return label


def text_button(text: str, action: Callable[[], object], tool_tip: str = "", name: str = "") -> QPushButton:
    """A button that takes the focus by Tab only, so that a click leaves the keys to the robot. `name` is for screen readers."""
    button = QPushButton(text)
    button.setToolTip(tool_tip)
    button.setAccessibleName(name)
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    button.clicked.connect(lambda _checked=False: action())
    return button


def button(text: str, slot: Callable[[], object], tip: str = "") -> QPushButton:
    made = QPushButton(text, autoDefault=False)
    made.setToolTip(tip)
    made.clicked.connect(lambda _checked=False: slot())
    return made


def set_main_button(which: QPushButton, is_main: bool) -> None:
    """Whether a button is the next step, and stands out."""
    name = "main_button" if is_main else ""
    if which.objectName() != name:
        which.setObjectName(name)
        which.style().unpolish(which)
        which.style().polish(which)


def enable(on: bool, *controls: QWidget) -> None:
    for control in controls:
        control.setEnabled(on)


def page_tabs() -> QTabWidget:
    pages = QTabWidget(documentMode=True)
    pages.setAccessibleName(tr("Pages"))
    pages.tabBar().setAccessibleName(tr("Pages"))
    pages.tabBar().setDrawBase(False)
    return pages


class Card(QFrame):
    """A rounded panel; with a title, it has a small head line with an optional note on the right."""

    def __init__(self, title: str, content: QWidget | QLayout, note: QWidget | str = "") -> None:
        super().__init__()
        self.setObjectName("card")
        parts: list[Part] = [(content, 1)]
        if title:
            parts.insert(0, line(card_title(title), None, card_note(note) if isinstance(note, str) else note, spacing=8))
        self.setLayout(column(*parts, spacing=4, margins=(12, 7, 12, 9)))


class Columns(QSplitter):
    """Two columns with a handle between them. The left one keeps its `share` of the width when the window grows."""

    def __init__(self, left: QWidget, right: QWidget, share: float) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._share = share
        self.addWidget(left)
        self.addWidget(right)
        self.setChildrenCollapsible(False)
        self.setHandleWidth(theme.GAP)
        handle = self.handle(1)
        handle.setToolTip(tr("Drag to give one side more room"))
        handle.setAccessibleName(tr("Border between the columns"))
        self.splitterMoved.connect(self._on_moved)

    @property
    def share(self) -> float:
        return self._share

    def set_share(self, share: float) -> None:
        """Another share, as far as the columns allow it."""
        least, most = _SHARE_RANGE
        self._share = max(least, min(most, share))
        self._place()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._place()

    def _place(self) -> None:
        room = self.width() - self.handleWidth()
        if room > 0:
            left = round(room * self._share)
            self.setSizes([left, room - left])

    def _on_moved(self, _position: int, _handle: int) -> None:
        left, right = self.sizes()
        self._share = left / max(1, left + right)


class OnResize(QObject):
    """Calls `action` whenever `watched` has another size, as long as `owner` lives; with `moves` also at another place."""

    def __init__(self, watched: QWidget, owner: QObject, action: Callable[[], object], *, moves: bool = False) -> None:
        super().__init__(owner)
        self._action = action
        self._types = (QEvent.Type.Resize, QEvent.Type.Move) if moves else (QEvent.Type.Resize,)
        watched.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in self._types:
            self._action()
        return False


# ---- keys and wheel


def takes_enter(dialog: QWidget, event: QKeyEvent) -> bool:
    """Whether a key press of `dialog` was Enter, which presses the focused button or opens the focused list.

    Space, which does it elsewhere, stops the robot. Enter is done with also where it means nothing.
    """
    if event.key() not in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
        return False
    focus = dialog.focusWidget()
    if not event.isAutoRepeat():
        if isinstance(focus, QAbstractButton):
            focus.click()
        elif isinstance(focus, QComboBox):
            focus.showPopup()
    return True


def name_list(combo: QComboBox, name: str) -> None:
    """Set accessible name and description: under Linux Qt gives a screen reader the choice instead of the name."""
    combo.setAccessibleName(name)
    combo.setAccessibleDescription(name)


class QuietCombo(QComboBox):
    """A click opens it, or Enter when it has the focus; in the open list the arrows move, Enter chooses and Escape closes.

    Closed it takes no key and no turn of the wheel, which would choose unnoticed.

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
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat():
            self.showPopup()
            return
        event.ignore()

    def hidePopup(self) -> None:
        super().hidePopup()
        if not self._keeps_focus:
            self.clearFocus()


Key = Qt.Key
SCROLL_KEYS = frozenset({Key.Key_Up, Key.Key_Down, Key.Key_PageUp, Key.Key_PageDown, Key.Key_Home, Key.Key_End})
"""Keys that a focused list uses itself, so that they do not reach the robot."""


class ScrollKeys(QObject):
    """Makes `view` a list or table without selection, which the arrow keys scroll by a row, a page or to an end.

    It takes the focus by Tab only: a click into the list must not take the arrows from the robot. All other keys are the parent's.
    """

    def __init__(self, view: QAbstractItemView, row_px: int) -> None:
        super().__init__(view)
        self._bar, self._row_px = view.verticalScrollBar(), row_px
        view.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        view.setTabKeyNavigation(False)
        view.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        view.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        view.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        view.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.KeyPress or not isinstance(event, QKeyEvent):
            return False
        bar, key = self._bar, Qt.Key(event.key())
        positions = {
            Key.Key_Up: bar.value() - self._row_px,
            Key.Key_Down: bar.value() + self._row_px,
            Key.Key_PageUp: bar.value() - bar.pageStep(),
            Key.Key_PageDown: bar.value() + bar.pageStep(),
            Key.Key_Home: bar.minimum(),
            Key.Key_End: bar.maximum(),
        }
        event.setAccepted(key in positions)
        bar.setValue(positions.get(key, bar.value()))
        return True


class StillWheel(QObject):
    """Ignores the wheel on combo and spin boxes that `dialog` has now; what contains them scrolls instead."""

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
