"""The operator window's keys."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.next_step import DEADMAN_KEY, STOP_KEY, Step
from app.widgets.key_page import KeyColumn, KeyPage, KeyTable
from app.widgets.overlays import Layer

_TABLES: tuple[KeyTable, ...] = (
    (
        "Move the robot (hold)",
        (
            ("A  D   or   \N{LEFTWARDS ARROW}  \N{RIGHTWARDS ARROW}", "bend the head left, right"),
            ("W  S   or   \N{UPWARDS ARROW}  \N{DOWNWARDS ARROW}", "advance, retract"),
            ("E   Q", "lift, dip the head"),
            ("PgUp   PgDn", "sheath forward, back"),
            ("X", "straighten the head"),
        ),
    ),
    (
        "Who drives",
        (
            (STOP_KEY, "STOP, in any focus"),
            *((step.value.key, step.value.name.lower()) for step in Step if step is not Step.DISARM),
            (DEADMAN_KEY, "deadman: hold it"),
            ("Any moving key", "takes back at once"),
        ),
    ),
    (
        "Overlays",
        (*((layer.value.key, layer.value.label) for layer in Layer), ("0", "all on or off")),
    ),
    (
        "Window",
        (
            ("Click", "destination"),
            ("Right click, Esc", "clear it"),
            ("P   or   Ctrl+S", "snapshot into your pictures"),
            ("F9", "record, end the recording"),
            ("F10", "save the last 30 s"),
            ("R", "another random phantom"),
            ("F5", "start the rig again"),
            ("Wheel, drag, F", "zoom, move, whole picture"),
            ("Tab, Enter", "go to a button, press it"),
            ("F11", "full screen (Esc leaves)"),
            ("F1", "this page (Esc closes)"),
            ("Ctrl+Q", "quit"),
        ),
    ),
)
_SHARES = (0.29, 0.27, 0.16, 0.28)
_KEYS_PX = (134.0, 116.0, 34.0, 108.0)


def operator_help(parent: QWidget) -> KeyPage:
    """The page of the operator window, over `parent`."""
    return KeyPage(parent, [KeyColumn((table,), *rest) for table, *rest in zip(_TABLES, _SHARES, _KEYS_PX, strict=True)])
