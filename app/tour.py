"""When the tour is shown: once, at the first start on a real screen, and whenever it is asked for."""

from __future__ import annotations

from pathlib import Path

import platformdirs
from PySide6.QtCore import QSettings, QTimer
from PySide6.QtGui import QGuiApplication

from app.operator_window import OperatorWindow

_SEEN = "tour/seen"
_NO_SCREEN = ("offscreen", "minimal", "vnc")
_LOOK_EVERY_MS = 300


def _settings() -> QSettings:
    folder = Path(platformdirs.user_config_dir("LumenPilot", appauthor=False))
    return QSettings(str(folder / "seen.ini"), QSettings.Format.IniFormat)


def was_seen() -> bool:
    """Whether the tour was shown to this user, skipped or not."""
    return str(_settings().value(_SEEN, "")).lower() == "true"


def mark_seen() -> None:
    """Not again by itself. A folder that cannot be written is no reason to disturb anybody."""
    settings = _settings()
    settings.setValue(_SEEN, True)
    settings.sync()


def tour_at_start(window: OperatorWindow, *, asked: bool) -> None:
    """Begin it when the first picture is there: if it was `asked` for, or at the first start on a real screen."""
    if not asked and (QGuiApplication.platformName() in _NO_SCREEN or was_seen()):
        return
    timer = QTimer(window)

    def look() -> None:
        if window.shown_tick is not None:
            timer.stop()
            mark_seen()
            window.show_tour()

    timer.timeout.connect(look)
    timer.start(_LOOK_EVERY_MS)
