"""Menus from tables, so that all windows have theirs in one form."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QTabWidget

from app.about import show_about
from app.language import tr

KEY_HINT = "key_hint"
"""Property of an action: the key that does the same and is handled elsewhere."""

_STAYS_LAST = "stays_last"


@dataclass(frozen=True, slots=True)
class MenuEntry:
    """One entry. ``hint`` is a key that is handled elsewhere and only shown; ``checked`` None means not checkable."""

    text: str
    slot: Callable[[], object]
    keys: tuple[str, ...] = ()
    hint: str = ""
    checked: bool | None = None


def add_menu(window: QMainWindow, title: str, entries: Sequence[MenuEntry | None]) -> list[QAction]:
    """Add a menu to the window's bar, or entries to the menu of that title; None is a separator.

    Help stays the last menu, Quit and About the last entries of theirs. An entry without a mnemonic (&) gets the first letter that
    is free in its menu. Returns the actions without the separators.
    """
    menu = _menu_of(window, title)
    end = _end_of(menu)
    if menu.actions():
        _separate(menu, end)
    taken = {mnemonic(text) for text in (*(a.text() for a in menu.actions()), *(e.text for e in entries if e is not None))}
    actions = []
    for entry in entries:
        if entry is None:
            _separate(menu, end)
            continue
        action = _action(window, entry, taken)
        if end is None:
            menu.addAction(action)
        else:
            menu.insertAction(end, action)
        window.addAction(action)  # keeps the shortcut alive while the menu bar is hidden
        actions.append(action)
    return actions


def plain(text: str) -> str:
    """The text of an action as it is read: without mnemonic, "&File" or "文件(&F)", and without a hint."""
    return re.sub(r"\(&\w\)", "", text.partition("\t")[0]).replace("&", "")


def mnemonic(text: str) -> str:
    """The letter behind the "&", in lower case; empty without one."""
    return text.partition("&")[2][:1].lower()


def _menu_of(window: QMainWindow, title: str) -> QMenu:
    bar = window.menuBar()
    there = {plain(action.text()): action for action in bar.actions()}
    found = there.get(plain(title))
    if found is not None:
        menu = found.menu()
        assert isinstance(menu, QMenu)
        return menu
    menu = QMenu(title, bar)
    last = plain(tr("&Help"))
    if last in there:
        bar.insertMenu(there[last], menu)
    else:
        bar.addMenu(menu)
    return menu


def _end_of(menu: QMenu) -> QAction | None:
    """The separator above an entry that stays the last one: what is added comes before it."""
    actions = menu.actions()
    if len(actions) < 2 or not actions[-2].isSeparator():
        return None
    last = actions[-1]
    return actions[-2] if QKeySequence("Ctrl+Q") in last.shortcuts() or last.property(_STAYS_LAST) else None


def _separate(menu: QMenu, end: QAction | None) -> None:
    if end is None:
        menu.addSeparator()
    else:
        menu.insertSeparator(end)


def _action(window: QMainWindow, entry: MenuEntry, taken: set[str]) -> QAction:
    text = _with_mnemonic(entry.text, taken)
    action = QAction(f"{text}\t{entry.hint}" if entry.hint else text, window)
    action.setProperty(KEY_HINT, entry.hint)
    action.setShortcuts([QKeySequence(key) for key in entry.keys])
    action.setAutoRepeat(False)
    if entry.checked is not None:
        action.setCheckable(True)
        action.setChecked(entry.checked)
    slot = entry.slot
    action.triggered.connect(lambda _checked=False: slot())
    return action


def _with_mnemonic(text: str, taken: set[str]) -> str:
    """`text` with the first free letter marked: those that begin a word first. `taken` gets it."""
    if mnemonic(text):
        return text
    starts = [k for k, letter in enumerate(text) if _is_key(letter) and (k == 0 or text[k - 1] == " ")]
    for k in (*starts, *range(len(text))):
        letter = text[k].lower()
        if _is_key(letter) and letter not in taken:
            taken.add(letter)
            return f"{text[:k]}&{text[k:]}"
    return text


def _is_key(letter: str) -> bool:
    """Chinese letters are on no keyboard."""
    return letter.isascii() and letter.isalnum()


def add_help_menu(window: QMainWindow, show_keys: Callable[[], object], more: Sequence[MenuEntry | None] = ()) -> None:
    """The last menu, the same in all windows; `more` stands between the keys and what the program is."""
    about = MenuEntry(tr("&About LumenPilot"), partial(show_about, window))
    *_, last = add_menu(window, tr("&Help"), [MenuEntry(tr("&Keys"), show_keys, ("F1", "Shift+F1")), *more, None, about])
    last.setProperty(_STAYS_LAST, True)


def action_of(window: QMainWindow, key: str) -> QAction:
    """The action that has this shortcut. Raises KeyError."""
    wanted = QKeySequence(key)
    for action in window.actions():
        if wanted in action.shortcuts():
            return action
    raise KeyError(key)


def turn_page(pages: QTabWidget, step: int) -> None:
    """The next page (1) or the previous one (-1); after the last comes the first."""
    pages.setCurrentIndex((pages.currentIndex() + step) % pages.count())
