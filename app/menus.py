"""Menus from tables, so that all windows have theirs in one form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow


@dataclass(frozen=True, slots=True)
class MenuEntry:
    """One entry. ``hint`` is a key that is handled elsewhere and only shown; ``checked`` None means not checkable."""

    text: str
    slot: Callable[[], object]
    keys: tuple[str, ...] = ()
    hint: str = ""
    checked: bool | None = None


def add_menu(window: QMainWindow, title: str, entries: Sequence[MenuEntry | None]) -> list[QAction]:
    """Add a menu to the window's bar; None is a separator. Returns the actions without the separators."""
    menu = window.menuBar().addMenu(title)
    actions = []
    for entry in entries:
        if entry is None:
            menu.addSeparator()
            continue
        action = _action(window, entry)
        menu.addAction(action)
        window.addAction(action)  # keeps the shortcut alive while the menu bar is hidden
        actions.append(action)
    return actions


def _action(window: QMainWindow, entry: MenuEntry) -> QAction:
    action = QAction(f"{entry.text}\t{entry.hint}" if entry.hint else entry.text, window)
    action.setShortcuts([QKeySequence(key) for key in entry.keys])
    action.setAutoRepeat(False)
    if entry.checked is not None:
        action.setCheckable(True)
        action.setChecked(entry.checked)
    slot = entry.slot
    action.triggered.connect(lambda _checked=False: slot())
    return action
