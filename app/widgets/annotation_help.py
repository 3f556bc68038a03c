"""The annotator's keys."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtWidgets import QMainWindow, QWidget

from app.key_sheet import KeyTable, menu_tables, shown
from app.language import mark
from app.widgets.annotation_canvas import CANVAS_KEYS
from app.widgets.key_page import KeyPage

_MOUSE = (
    mark("In the picture, by mouse"),
    (
        (mark("Click, drag"), mark("set a point; move one")),
        (mark("Double click"), mark("end the line, take the state, go on")),
        (mark("Right click"), mark("take a point out; the brush: take away")),
        (mark("Wheel"), mark("zoom at the cursor")),
    ),
)


def annotation_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys of the picture, of the menus, and the mouse."""
    return (shown((mark("In the picture"), CANVAS_KEYS)), shown(_MOUSE), *menu_tables(window))


def annotation_help(parent: QWidget) -> KeyPage:
    """The page of the annotator, over `parent`."""
    return KeyPage(parent, annotation_keys)
