"""The annotator's keys."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtWidgets import QMainWindow, QWidget

from app.key_sheet import KeyTable, menu_tables
from app.widgets.annotation_canvas import CANVAS_KEYS
from app.widgets.key_page import KeyPage

_MOUSE = (
    "In the picture, by mouse",
    (
        ("Click, drag", "set a point; move one"),
        ("Double click", "end the line, take the state, go on"),
        ("Right click", "take a point out; the brush: take away"),
        ("Wheel", "zoom at the cursor"),
    ),
)


def annotation_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys of the picture, of the menus, and the mouse."""
    return (("In the picture", CANVAS_KEYS), _MOUSE, *menu_tables(window))


def annotation_help(parent: QWidget) -> KeyPage:
    """The page of the annotator, over `parent`."""
    return KeyPage(parent, annotation_keys)
