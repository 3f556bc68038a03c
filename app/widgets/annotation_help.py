"""The annotator's keys."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.widgets.key_page import KeyColumn, KeyPage, KeyTable

_COLUMNS: tuple[tuple[KeyTable, ...], ...] = (
    (
        (
            "Draw",
            (
                ("1   2", "robot line, vessel line; again: more points"),
                ("Click", "set a point; drag moves one"),
                ("Enter, double click", "end the line, take the state, go on"),
                ("Right click, Del", "take a point out; Shift+Del: the whole line"),
                ("Tab", "select the next point"),
                ("Arrows", "move it by 1 px; Ctrl 0.1, Shift 10"),
                ("Arrows, Insert", "no point selected: move the cross, set a point"),
                ("Esc", "let go"),
                ("Ctrl+Z   Ctrl+Shift+Z", "undo, redo, without limit"),
            ),
        ),
    ),
    (
        (
            "Answer",
            (
                ("A   B   C   D", "the pose state"),
                ("X", "can't tell"),
                ("F2", "note"),
                ("G", "take the algorithm's lines or masks"),
            ),
        ),
        (
            "Masks",
            (
                ("3   4", "robot mask, vessel mask"),
                ("T", "brush; Shift or right drag takes away"),
                ("[   ]", "size of the brush"),
                ("S", "simplify the outlines"),
            ),
        ),
    ),
    (
        (
            "Images",
            (
                ("N   P", "next, previous"),
                ("U", "next one without an answer"),
                ("Home   End", "first, last"),
                ("F6", "the list"),
            ),
        ),
        (
            "Picture",
            (
                ("Wheel   +   \N{MINUS SIGN}", "zoom at the cursor"),
                ("Z   F", "close-up of the head, all"),
                ("Space + drag", "move"),
                (",  .   <  >   /", "contrast, light, reset"),
                ("L   K   H", "loupe, masks, algorithm"),
                ("F11   F1", "full screen, this page"),
            ),
        ),
    ),
)
_SHARES = (0.40, 0.32, 0.28)
_KEYS_PX = (158.0, 96.0, 122.0)


def annotation_help(parent: QWidget) -> KeyPage:
    """The page of the annotator, over `parent`."""
    return KeyPage(parent, [KeyColumn(*column) for column in zip(_COLUMNS, _SHARES, _KEYS_PX, strict=True)])
