"""The player's keys."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtWidgets import QMainWindow, QWidget

from app.key_sheet import KeyTable, menu_tables
from app.widgets.key_page import KeyPage

_ELSE = (
    "Mouse and focus",
    (
        ("Click, drag", "on the timeline: go there"),
        ("Shift+drag", "on the timeline: select"),
        ("Wheel", "on the timeline or picture: zoom"),
        ("Tab, Enter", "go to a control, press it"),
        ("Esc", "close, cancel, unselect"),
    ),
)


def player_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys of the menus, and the mouse."""
    return (*menu_tables(window), _ELSE)


def player_help(parent: QWidget) -> KeyPage:
    """The page of the player, over `parent`."""
    return KeyPage(parent, player_keys)
