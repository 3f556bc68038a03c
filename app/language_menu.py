"""Help, Language: which language the windows speak from the next start of the program on."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMainWindow, QMenu

from app.language import AUTO, CHINESE, ENGLISH, language_in_use, tr
from app.menus import MenuEntry, add_menu

NATIVE = {ENGLISH: "English", CHINESE: "中文"}
"""Languages are called by their own names, so that whoever needs one finds it."""


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
            action = QAction(text, group)
            action.setCheckable(True)
            action.triggered.connect(partial(self.chosen.emit, code))
            self.addAction(action)
            self._entries[code] = action
        self.show_choice(choice)

    def show_choice(self, choice: str) -> None:
        """Mark what is set."""
        self._entries[choice].setChecked(True)


def next_start_text(code: str) -> str:
    """When a choice acts, in the language of now and in the one that was chosen."""
    now = tr("The language changes at the next start of the program")
    other = {CHINESE: "下次启动程序后，界面为中文", ENGLISH: "English from the next start on"}.get(code)
    return f"{now}. {other}" if other is not None and code != language_in_use() else now
