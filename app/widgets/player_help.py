"""The player's keys."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.widgets.key_page import KeyColumn, KeyPage, KeyTable
from app.widgets.overlays import Layer

_TABLES: tuple[KeyTable, ...] = (
    (
        "Play",
        (
            ("Space", "play, pause"),
            ("\N{LEFTWARDS ARROW}   \N{RIGHTWARDS ARROW}", "one frame back, on"),
            ("Shift + arrow", "one second"),
            ("Ctrl + arrow", "ten seconds"),
            ("Home   End", "first, last frame"),
            ("[   ]   R", "slower, faster, as recorded"),
            ("T", "go to a time in ms"),
        ),
    ),
    (
        "Jump",
        (
            ("N   P", "next, previous"),
            ("K", "of which kind: the next one"),
            ("F6", "the list of events"),
            ("+   \N{MINUS SIGN}", "zoom the timeline"),
            ("Ctrl + 0", "the whole session"),
            ("Click, drag", "on the timeline: go there"),
            ("Wheel", "on the timeline: zoom"),
        ),
    ),
    (
        "Keep",
        (
            ("I   O", "selection from here, to here"),
            ("Shift + drag", "on the timeline: select"),
            ("E", "selection as video"),
            ("S   Ctrl+S", "snapshot of this picture"),
            ("M", "note at this time"),
            ("Esc", "close, cancel, unselect"),
            ("F1   F11   Ctrl+Q", "keys, full screen, quit"),
        ),
    ),
    (
        "Overlays",
        (*((f"{layer.value.key}", layer.value.label) for layer in Layer), ("0", "all on or off"), ("F", "whole picture")),
    ),
)
_SHARES = (0.27, 0.27, 0.29, 0.17)
_KEYS_PX = (118.0, 104.0, 124.0, 34.0)


def player_help(parent: QWidget) -> KeyPage:
    """The page of the player, over `parent`."""
    return KeyPage(parent, [KeyColumn((table,), *rest) for table, *rest in zip(_TABLES, _SHARES, _KEYS_PX, strict=True)])
