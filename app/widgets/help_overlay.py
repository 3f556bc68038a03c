"""The operator window's keys."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtWidgets import QMainWindow, QWidget

from app.jog_keys import KEYS
from app.key_sheet import KeyTable, key_names, menu_tables, shown
from app.language import mark
from app.next_step import DEADMAN_KEY
from app.widgets.key_page import KeyPage

_HELD = (mark("Hold to move, release to stop"), tuple((key_names(keys), motion.value) for motion, keys in KEYS.items()))
_DRIVING = (
    mark("While the program drives"),
    ((DEADMAN_KEY, mark("deadman: it drives while held")), (mark("Any key above"), mark("you steer again, at once"))),
)
_ELSE = (
    mark("Mouse and focus"),
    (
        (mark("Click"), mark("destination; right click clears it")),
        (mark("Wheel, drag"), mark("zoom the picture, move it")),
        (mark("Tab, Enter"), mark("go to a control, press or open it")),
    ),
)


def operator_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys that move the robot, and those of the menus."""
    return (*map(shown, (_HELD, _DRIVING)), *menu_tables(window), shown(_ELSE))


def operator_help(parent: QWidget, above: QWidget) -> KeyPage:
    """The page of the operator window, over `parent`; it ends above what the robot is stopped with."""
    return KeyPage(parent, operator_keys, above)
