"""What every window of the program is: its size, the keys and menu entries that mean the same in all of them, and how it closes."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence

from PySide6.QtCore import QEvent, Qt, Slot
from PySide6.QtGui import QAction, QCloseEvent, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QLabel, QMainWindow

from app import theme
from app.heartbeat import Heartbeat
from app.language import tr
from app.menus import MenuEntry, action_of, add_menu
from app.widgets.enter_key import takes_enter

_FULL_SCREEN_KEY = "F11"
_HINT_MARGIN_PX, _HINT_DOWN_PX = 14, 5


class WindowFrame(QMainWindow):
    """The frame around the panels of a window. What is special to one is said by overriding what begins with an underscore."""

    def __init__(self) -> None:
        super().__init__()
        self._is_shut = False
        self._heartbeat = Heartbeat(parent=self)
        escape = QAction(self)
        escape.setShortcut(QKeySequence(Qt.Key.Key_Escape))
        escape.triggered.connect(self._on_escape)
        self.addAction(escape)
        hint = QLabel(tr("F1  keys"), self.menuBar())  # without a parent it would be gone: the menu bar does not keep it
        hint.setObjectName("card_note")
        hint.setContentsMargins(0, _HINT_DOWN_PX, _HINT_MARGIN_PX, 0)
        self.menuBar().setCornerWidget(hint)
        self.setMinimumSize(*theme.MIN_WINDOW)
        self.resize(theme.start_size(self.screen()))

    @property
    def max_block_ms(self) -> float:
        """The longest time that the GUI thread was blocked in the last ten seconds."""
        return self._heartbeat.max_block_ms

    def start(self) -> None:
        """The window is shown: what it is for may begin."""
        self._heartbeat.start()

    # ---- menus: File comes first and View second, Help (``app.menus``) last

    def add_file_menu(self, entries: Sequence[MenuEntry | None]) -> None:
        """Ends with Quit."""
        add_menu(self, tr("&File"), [*entries, None, MenuEntry(tr("&Quit"), self.close, ("Ctrl+Q",))])

    def add_view_menu(self, entries: Sequence[MenuEntry | None]) -> list[QAction]:
        """Ends with Full screen; returns the actions without the separators."""
        keys = (_FULL_SCREEN_KEY, f"Shift+{_FULL_SCREEN_KEY}")
        full_screen = MenuEntry(tr("&Full screen"), self.toggle_full_screen, keys, checked=False)
        return add_menu(self, tr("&View"), [*entries, None, full_screen])

    # ---- keys

    @Slot()
    def _on_escape(self) -> None:
        """Back by one step: a window says which; the last step is out of full screen."""
        if self.isFullScreen():
            self.toggle_full_screen()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter presses the button that has the focus: Space, which does it elsewhere, has another use here."""
        if isinstance(self.focusWidget(), QAbstractButton) and takes_enter(self, event):
            return
        super().keyPressEvent(event)

    def toggle_full_screen(self) -> None:
        """Full screen, without the menu bar, and back."""
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.WindowStateChange:  # the desktop can end full screen too
            self.menuBar().setVisible(not self.isFullScreen())
            action_of(self, _FULL_SCREEN_KEY).setChecked(self.isFullScreen())

    # ---- the end

    def closeEvent(self, event: QCloseEvent) -> None:
        if self._may_close():
            self.shut_down()
            event.accept()
        else:
            event.ignore()

    @Slot()
    def shut_down(self) -> None:
        """Let go of everything, be gone from the screen at once, then wait for what must be finished; only once."""
        if self._is_shut:
            return
        self._is_shut = True
        self._let_go()
        self._heartbeat.stop()
        # A repaint that is still queued would find a window without a surface.
        self.setUpdatesEnabled(False)
        self.hide()
        stuck = self._finish()
        for line in stuck:
            logging.getLogger(type(self).__module__).error(line)
        if stuck:
            # Qt would abort on a thread that still runs, or wait for it for ever; nobody drives any more
            os._exit(1)

    def _may_close(self) -> bool:
        """Whether the user, who asks for it, may; not asked when the program ends."""
        return True

    def _let_go(self) -> None:
        """Nothing more is begun or shown: while the window is still on the screen."""

    def _finish(self) -> Sequence[str]:
        """Wait for threads and disks, without a frozen window; a line for each that did not end in its time."""
        return ()
