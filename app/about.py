"""What the program is: name, version, what it is not."""

from __future__ import annotations

import tomllib
from functools import cache

from PySide6.QtCore import Qt
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QMessageBox, QWidget

from app.language import tr
from core.config import RESOURCES

ICON = RESOURCES / "icons" / "lumenpilot.svg"
_SIZE_PX = 72


@cache
def program_version() -> str:
    """As pyproject.toml beside the resources says; empty when it is not there."""
    try:
        text = (RESOURCES.parent / "pyproject.toml").read_text(encoding="utf-8")
        return str(tomllib.loads(text)["project"]["version"])
    except (OSError, tomllib.TOMLDecodeError, KeyError):
        return ""


def program_icon() -> QIcon:
    """The icon of all windows."""
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
