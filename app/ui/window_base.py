"""What all windows share: the application, size, common keys and menu entries, how they close, and how long they were blocked."""

from __future__ import annotations

import gc
import logging
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QObject, Qt, QTimer
from PySide6.QtGui import QAction, QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QLabel, QMainWindow

from app.ui import theme
from app.ui.actions import MenuEntry, action_of, add_menu
from app.ui.i18n import tr
from app.ui.opening import OtherWindows, RecentMenu, dropped_paths
from app.widgets.basics import takes_enter
from core.config.models import WindowConfig

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication


INTERVAL_MS = 10


class GuiLatencyMonitor(QObject):
    """How long the GUI thread was blocked: a timer of 10 ms that fires x ms late was blocked for about x ms."""

    def __init__(self, window_s: float = 10.0, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._window_s = window_s
        self._late: deque[tuple[float, float]] = deque()
        self._last_s: float | None = None
        self._timer = QTimer(self, timerType=Qt.TimerType.PreciseTimer, interval=INTERVAL_MS)
        self._timer.timeout.connect(self._beat)

    def start(self) -> None:
        self._last_s = None
        self._late.clear()
        self._timer.start()

    def stop(self) -> None:
        self._timer.stop()

    @property
    def max_block_ms(self) -> float:
        """Longest block of the last ``window_s`` seconds."""
        return max((late for _, late in self._late), default=0.0)

    def _beat(self) -> None:
        now = time.monotonic()
        if self._last_s is not None:
            late_ms = max(0.0, (now - self._last_s) * 1000.0 - INTERVAL_MS)
            # a falling maximum: an older and shorter block can never be the maximum again
            while self._late and self._late[-1][1] <= late_ms:
                self._late.pop()
            self._late.append((now, late_ms))
        while self._late and self._late[0][0] < now - self._window_s:
            self._late.popleft()
        self._last_s = now


_MOST_DROPPED = 4
"""So many windows are opened by one drop at most."""
_FULL_SCREEN_KEY = "F11"
_HINT_MARGIN_PX, _HINT_DOWN_PX = 14, 5


class WindowFrame(QMainWindow):
    """The frame around the panels of a window; subclasses override the methods that begin with an underscore."""

    def __init__(self) -> None:
        super().__init__()
        self._is_shut = False
        self._heartbeat = GuiLatencyMonitor(parent=self)
        escape = QAction(self, shortcut=QKeySequence(Qt.Key.Key_Escape))
        escape.triggered.connect(self._on_escape)
        self.addAction(escape)
        hint = QLabel(tr("F1  keys"), self.menuBar())  # without a parent it would be gone: the menu bar does not keep it
        hint.setObjectName("card_note")
        hint.setContentsMargins(0, _HINT_DOWN_PX, _HINT_MARGIN_PX, 0)
        self.menuBar().setCornerWidget(hint)
        self.others = OtherWindows(self)
        self.setAcceptDrops(True)
        self.setMinimumSize(*theme.MIN_WINDOW)
        self.resize(theme.start_size(self.screen()))

    @property
    def max_block_ms(self) -> float:
        """The longest time that the GUI thread was blocked in the last ten seconds."""
        return self._heartbeat.max_block_ms

    def start(self) -> None:
        """The window is shown: what it is for may begin."""
        self._heartbeat.start()

    # ---- menus: File comes first and View second, Help (``app.ui.actions``) last

    def add_file_menu(self, entries: Sequence[MenuEntry | None], *, has_recent: bool = False) -> None:
        """Ends with Quit; what was opened last stands behind the first entry."""
        recent = [MenuEntry(tr("Open recent"), lambda: None)] if has_recent else []
        ended = [*entries[:1], *recent, *entries[1:], None, MenuEntry(tr("&Quit"), self.close, ("Ctrl+Q",))]
        actions = add_menu(self, tr("&File"), ended)
        if has_recent:
            actions[1].setMenu(RecentMenu(self, self.open_path))

    def add_view_menu(self, entries: Sequence[MenuEntry | None]) -> list[QAction]:
        """Ends with Full screen; returns the actions without the separators."""
        keys = (_FULL_SCREEN_KEY, f"Shift+{_FULL_SCREEN_KEY}")
        full_screen = MenuEntry(tr("&Full screen"), self.toggle_full_screen, keys, checked=False)
        return add_menu(self, tr("&View"), [*entries, None, full_screen])

    # ---- files that are dropped on it

    def open_path(self, path: Path) -> None:
        """Open a session, a folder, a picture, a video or an annotation file, in a window of its own."""
        self.others.open_path(path)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped_paths(event.mimeData()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        for path in dropped_paths(event.mimeData())[:_MOST_DROPPED]:
            self.open_path(path)
        event.acceptProposedAction()

    # ---- keys

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

    def shut_down(self) -> None:
        """Stop everything, hide at once, then wait for what must be finished; only once."""
        if self._is_shut:
            return
        self._is_shut = True
        self.others.leave()  # people work in these windows
        self._let_go()
        self._heartbeat.stop()
        # A repaint that is still queued would find a window without a surface.
        self.setUpdatesEnabled(False)
        self.hide()
        stuck = self._finish()
        for line in stuck:
            logging.getLogger(type(self).__module__).error(line)
        if stuck:
            # Qt would abort on a thread that still runs, or wait for it for ever; the robot is stopped
            os._exit(1)

    def _may_close(self) -> bool:
        """Whether the user, who asks for it, may; not asked when the program ends."""
        return True

    def _let_go(self) -> None:
        """Nothing more is begun or shown: while the window is still on the screen."""

    def _finish(self) -> Sequence[str]:
        """Wait for threads and disks, without a frozen window; a line for each that did not end in its time."""
        return ()


_ENDS, _MAY_ASK = "is_asked_to_end", "may_be_asked"
_SWITCH_S = 0.001
"""How long a thread may keep the interpreter while another waits: at Python's 5 ms the window stood still for 198 to 221 ms, so for
125 to 158 (alternating runs on a busy machine)."""


def make_application(look: WindowConfig | None = None) -> QApplication:
    """The one application object, with names, theme and language; both as `look` has them, else dark and English."""
    from PySide6.QtWidgets import QApplication

    from app.ui import theme
    from app.ui.actions import program_icon
    from app.ui.i18n import ENGLISH, use_language

    sys.setswitchinterval(_SWITCH_S)
    # Qt paints large areas in a thread pool and waits for it; while perception keeps the cores busy, that wait is longer than the
    # painting (measured on two cores: 105 instead of 70 ms from capture to screen).
    os.environ.setdefault("QT_NO_GUI_THREADPOOL", "1")
    application = QApplication.instance()
    if application is None:
        application = QApplication([sys.argv[0]])
        _collect_garbage_here(application)
    assert isinstance(application, QApplication)
    application.setApplicationName("LumenPilot")
    application.setDesktopFileName("lumenpilot")  # the desktop entry that `make install` writes
    application.setWindowIcon(program_icon())
    use_language(application, look.language if look is not None else ENGLISH)
    theme.apply_theme(application, look.theme if look is not None else theme.Theme.DARK)
    return application


_COLLECT_MS = 500


def _collect_garbage_here(application: QObject) -> None:
    """Have garbage collected by a timer of the window's thread alone.

    Python collects in the thread that happens to allocate: one that reads a child's output would destroy a window that went out of
    use, and with it what the window's thread is just emitting a signal of.
    """

    def collect() -> None:
        due = [k for k, (count, limit) in enumerate(zip(gc.get_count(), gc.get_threshold(), strict=True)) if count > limit]
        if due:
            gc.collect(due[-1])

    gc.disable()
    timer = QTimer(application, interval=_COLLECT_MS)
    timer.timeout.connect(collect)
    timer.start()


def close_all(application: QApplication, *, may_ask: bool = False) -> None:
    """Close all windows because the program is asked to end: they ask no questions that only results depend on.

    `may_ask`: a person has asked for it, by Ctrl-C, who can answer what the robot depends on.
    """
    application.setProperty(_ENDS, True)
    application.setProperty(_MAY_ASK, may_ask)
    application.closeAllWindows()
    application.setProperty(_ENDS, False)


def is_asked_to_end() -> bool:
    """Whether a window is closed because the whole program is to end, by Ctrl-C or a termination request."""
    from PySide6.QtCore import QCoreApplication

    application = QCoreApplication.instance()
    return application is not None and bool(application.property(_ENDS))


def may_be_asked() -> bool:
    """Whether there is a person who has asked the program to end, and not the system."""
    from PySide6.QtCore import QCoreApplication

    application = QCoreApplication.instance()
    return application is not None and bool(application.property(_MAY_ASK))


def quit_on_signal(application: QApplication) -> QTimer:
    """Ctrl-C and a termination request close the window properly. Python sees signals only between Qt events, hence the timer."""
    import signal

    from PySide6.QtCore import QTimer

    for number in (signal.SIGINT, signal.SIGTERM):
        # Not at once: a signal may come while a widget is painting, and its window must not go from under it.
        may_ask = number is signal.SIGINT
        signal.signal(number, lambda *_, ask=may_ask: QTimer.singleShot(0, lambda: close_all(application, may_ask=ask)))
    timer = QTimer(application)
    timer.timeout.connect(lambda: None)
    timer.start(200)
    return timer


def run_until_closed(
    application: QApplication,
    window: WindowFrame,
    say: Callable[[str, bool], object],
    then: Callable[[], object] = lambda: None,
) -> int:
    """Show the window, start it, do what is to be done `then`, and run until it is closed; returns the exit code.

    `say` gets a line for the person at the screen, and whether it tells a fault.
    """
    from app.ui.i18n import language_problem

    application.aboutToQuit.connect(window.shut_down)
    signals = quit_on_signal(application)
    try:
        window.show()
        window.start()
        then()
        if language_problem():
            say(language_problem(), True)
        code = application.exec()
    finally:
        window.shut_down()  # does nothing a second time; left running, its threads would be waited for at the interpreter's end
    signals.stop()
    return code
