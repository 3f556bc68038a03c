"""What the page of keys says, read from the menus of a window as they are: an entry that has a key cannot be missing or wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu

from app.language import tr
from app.menus import KEY_HINT, plain

KeyTable = tuple[str, tuple[tuple[str, str], ...]]
"""A title, and (key, what it does) below it."""

_BETWEEN = "   "
_SIGNS = {
    "Left": "\N{LEFTWARDS ARROW}",
    "Right": "\N{RIGHTWARDS ARROW}",
    "Up": "\N{UPWARDS ARROW}",
    "Down": "\N{DOWNWARDS ARROW}",
    "-": "\N{MINUS SIGN}",
}


def key_name(sequence: QKeySequence | str | int) -> str:
    """As it is written on the page: "Shift+F6", "←", "PgUp"."""
    text = QKeySequence(sequence).toString(QKeySequence.SequenceFormat.PortableText)
    before, plus, last = text.rpartition("+")
    if text.endswith("+"):  # the key plus itself
        return text
    return f"{before}{plus}{_SIGNS.get(last, last)}"


def key_names(sequences: Sequence[QKeySequence | str | int]) -> str:
    """All keys that do the same. One that only adds Shift to another (for a hand that holds the deadman) is left out."""
    names = [key_name(sequence) for sequence in sequences]
    return _BETWEEN.join(name for name in names if name.removeprefix("Shift+") == name or name.removeprefix("Shift+") not in names)


def shown(table: KeyTable) -> KeyTable:
    """A table that stands in the code, in the language of the window."""
    title, rows = table
    return tr(title), tuple((tr(key), tr(text)) for key, text in rows)


def menu_tables(window: QMainWindow) -> tuple[KeyTable, ...]:
    """A table for each menu, with its entries that have a key."""
    tables = []
    for action in window.menuBar().actions():
        menu = action.menu()
        rows = tuple(_rows_of(menu)) if isinstance(menu, QMenu) else ()
        if rows:
            tables.append((plain(action.text()), rows))
    return tuple(tables)


def _rows_of(menu: QMenu) -> Iterator[tuple[str, str]]:
    for action in menu.actions():
        inner = action.menu()
        if isinstance(inner, QMenu):
            yield from _rows_of(inner)
        elif keys := _keys_of(action):
            yield keys, plain(action.text())


def _keys_of(action: QAction) -> str:
    hint = str(action.property(KEY_HINT) or "")
    return _BETWEEN.join(part for part in (key_names(action.shortcuts()), hint) if part)
