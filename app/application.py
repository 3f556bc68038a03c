"""The application that every window runs in: display, names, theme and language; and a window from its opening to its end."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from core.config import WindowConfig
from core.errors import UserError

if TYPE_CHECKING:
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication

    from app.window_frame import WindowFrame

_ENDS = "is_asked_to_end"
_SWITCH_S = 0.001
"""How long a thread may keep the interpreter while another waits: at Python's 5 ms the window stood still for 198 to 221 ms, so for
125 to 158 (alternating runs on a busy machine)."""


def make_application(look: WindowConfig | None = None) -> QApplication:
    """The one application object, with names, theme and language; both as `look` has them, else dark and English."""
    from PySide6.QtWidgets import QApplication

    from app import theme
    from app.about import program_icon
    from app.language import ENGLISH, use_language

    sys.setswitchinterval(_SWITCH_S)
    # Qt paints large areas in a thread pool and waits for it; while perception keeps the cores busy, that wait is longer than the
    # painting (measured on two cores: 105 instead of 70 ms from capture to screen).
    os.environ.setdefault("QT_NO_GUI_THREADPOOL", "1")
    application = QApplication.instance() or QApplication([sys.argv[0]])
    assert isinstance(application, QApplication)
    application.setApplicationName("LumenPilot")
    application.setDesktopFileName("lumenpilot")  # the desktop entry that `make install` writes
    application.setWindowIcon(program_icon())
    use_language(application, look.language if look is not None else ENGLISH)
    theme.apply_theme(application, look.theme if look is not None else theme.Theme.DARK)
    return application


def check_display() -> None:
    """Qt would end the process with a core dump; better one line."""
    if not sys.platform.startswith("linux"):
        return
    display, asked = os.environ.get("DISPLAY"), os.environ.get("QT_QPA_PLATFORM", "")
    if not display and not os.environ.get("WAYLAND_DISPLAY") and not asked:
        raise UserError("no display: start it in a desktop session, or give it a virtual one (xvfb-run -a make run)")
    is_on_x = asked.startswith("xcb") or (not asked and not os.environ.get("WAYLAND_DISPLAY"))
    if not (display and is_on_x):
        return
    from hardware.checks.program import x_server_answers  # asks as Qt does; without libxcb Qt has its own say

    if not x_server_answers(display):
        raise UserError(
            f"the display {display} (DISPLAY) does not answer: it has gone, or this user may not use it (over ssh: ssh -X); "
            "start it in a desktop session, or give it a virtual one (xvfb-run -a make run)"
        )


def close_all(application: QApplication) -> None:
    """Close all windows because the program is asked to end: where only results would be lost, nobody may be there to answer."""
    application.setProperty(_ENDS, True)
    application.closeAllWindows()
    application.setProperty(_ENDS, False)


def is_asked_to_end() -> bool:
    """Whether a window is closed because the whole program is to end, by Ctrl-C or a termination request."""
    from PySide6.QtCore import QCoreApplication

    application = QCoreApplication.instance()
    return application is not None and bool(application.property(_ENDS))


def quit_on_signal(application: QApplication) -> QTimer:
    """Ctrl-C and a termination request close the window properly. Python sees signals only between Qt events, hence the timer."""
    import signal

    from PySide6.QtCore import QTimer

    for number in (signal.SIGINT, signal.SIGTERM):
        # Not at once: a signal may come while a widget is painting, and its window must not go from under it.
        signal.signal(number, lambda *_: QTimer.singleShot(0, lambda: close_all(application)))
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
    from app.language import language_problem

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
