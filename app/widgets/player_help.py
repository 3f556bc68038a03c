"""The player's keys."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtWidgets import QMainWindow, QWidget

from app.key_sheet import KeyTable, menu_tables, shown
from app.language import mark
from app.widgets.key_page import KeyPage

_ELSE = (
    mark("Mouse and focus"),
    (
        (mark("Click, drag"), mark("on the timeline: go there")),
        (mark("Shift+drag"), mark("on the timeline: select")),
        (mark("Wheel"), mark("on the timeline or picture: zoom")),
        (mark("Tab, Enter"), mark("go to a control, press it")),
        ("Esc", mark("close, cancel, unselect")),
    ),
)


def player_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys of the menus, and the mouse."""
    return (*menu_tables(window), shown(_ELSE))


def player_help(parent: QWidget) -> KeyPage:
    """The page of the player, over `parent`."""
    return KeyPage(parent, player_keys)
