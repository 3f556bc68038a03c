"""Menus from tables, in one form for all windows; the page of keys, which is read from them; About and the language menu."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction, QActionGroup, QIcon, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QMessageBox, QTabWidget, QWidget

from app.ui.i18n import AUTO, CHINESE, ENGLISH, language_in_use, tr
from core.config.models import RESOURCES
from core.program import program_version

ICON = RESOURCES / "icons" / "lumenpilot.svg"
_SIZE_PX = 72


def program_icon() -> QIcon:
    return QIcon(str(ICON))


def show_about(parent: QWidget) -> QMessageBox:
    """A small dialog; the window behind it goes on, and Space still stops the robot."""
    box = QMessageBox(parent)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.setWindowTitle(tr("About LumenPilot"))
    box.setIconPixmap(program_icon().pixmap(_SIZE_PX, _SIZE_PX))
    box.setText(f"<b>LumenPilot</b> {program_version()}")
    box.setInformativeText(
        tr(
            "Teleoperation assist for a tendon-driven interventional robot: it finds vessel and robot in the picture, tells how "
            "the "
            "robot's head lies against the vessel's centerline, advises, and on request drives.\n\n"
            "For research benches. It is not a medical device; STOP is a stop, not an emergency stop.\n\n"
            "MIT licence. Typeface: Inter, SIL Open Font Licence."
        )
    )
    box.setStandardButtons(QMessageBox.StandardButton.Close)
    box.setModal(False)
    box.show()
    return box


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
        _insert(menu, _separator(menu), end)
    taken = {mnemonic(text) for text in (*(a.text() for a in menu.actions()), *(e.text for e in entries if e is not None))}
    actions = []
    for entry in entries:
        if entry is None:
            _insert(menu, _separator(menu), end)
            continue
        action = _action(window, entry, taken)
        _insert(menu, action, end)
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


def _separator(menu: QMenu) -> QAction:
    separator = QAction(menu)
    separator.setSeparator(True)
    return separator


def _insert(menu: QMenu, action: QAction, end: QAction | None) -> None:
    if end is None:
        menu.addAction(action)
    else:
        menu.insertAction(end, action)


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
    """A key as it is written on the page: "Shift+F6", "←", "PgUp"."""
    text = QKeySequence(sequence).toString(QKeySequence.SequenceFormat.PortableText)
    before, plus, last = text.rpartition("+")
    if text.endswith("+"):  # the key plus itself
        return text
    return f"{before}{plus}{_SIGNS.get(last, last)}"


def key_names(sequences: Sequence[QKeySequence | str | int]) -> str:
    """All keys that do the same, without those that only add Shift to another (for use while Shift is the deadman)."""
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


NATIVE = {ENGLISH: "English", CHINESE: "中文"}
"""Languages are listed by their own names."""


class LanguageMenu(QMenu):
    """One entry for each language; ``chosen`` carries "auto", "en" or "zh".

    Parameters
    ----------
    window : gets it in its Help menu.
    choice : what is set.
    """

    chosen = Signal(str)

    def __init__(self, window: QMainWindow, choice: str) -> None:
        super().__init__(window)
        (entry,) = add_menu(window, tr("&Help"), [MenuEntry(tr("&Language (中文)"), lambda: None)])
        entry.setMenu(self)
        group = QActionGroup(self)
        self._entries: dict[str, QAction] = {}
        for code, text in ((AUTO, tr("As the &system says")), *NATIVE.items()):
            action = QAction(text, group, checkable=True)
            action.triggered.connect(partial(self.chosen.emit, code))
            self.addAction(action)
            self._entries[code] = action
        self.show_choice(choice)

    def show_choice(self, choice: str) -> None:
        self._entries[choice].setChecked(True)


def next_start_text(code: str) -> str:
    """When a choice acts, in the language of now and in the one that was chosen."""
    now = tr("The language changes at the next start of the program")
    other = {CHINESE: "下次启动程序后，界面为中文", ENGLISH: "English from the next start on"}.get(code)
    return f"{now}. {other}" if other is not None and code != language_in_use() else now
