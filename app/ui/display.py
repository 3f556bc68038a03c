"""Whether a window can be opened and Qt can be loaded; asked before either is done."""

from __future__ import annotations

import os
import sys

from core.devices import UserError
from core.program import CALLED


def check_display() -> None:
    """Raise UserError without a display: Qt would end the process with a core dump."""
    if not sys.platform.startswith("linux"):
        return
    display, asked = os.environ.get("DISPLAY"), os.environ.get("QT_QPA_PLATFORM", "")
    if not display and not os.environ.get("WAYLAND_DISPLAY") and not asked:
        raise UserError("no display: start it in a desktop session, or give it a virtual one (xvfb-run -a make run)")
    is_on_x = asked.startswith("xcb") or (not asked and not os.environ.get("WAYLAND_DISPLAY"))
    if not (display and is_on_x):
        return
    from hardware.preflight.checks import x_server_answers  # asks as Qt does; without libxcb Qt reports it itself

    if not x_server_answers(display):
        raise UserError(
            f"the display {display} (DISPLAY) does not answer: it has gone, or this user may not use it (over ssh: ssh -X); "
            "start it in a desktop session, or give it a virtual one (xvfb-run -a make run)"
        )


def check_qt(instead: str) -> None:
    """Raise UserError where Qt, with which overlays are drawn, or a library of the system that it needs does not load.

    `instead` : what else the user can do.
    """
    try:
        from PySide6 import QtWidgets  # noqa: F401
    except ImportError as error:
        raise UserError(
            f"overlays are drawn with Qt, which does not load ({error}): install what {CALLED} doctor names, or {instead}"
        ) from None
