"""``desktop``: the program in the menu of the user's desktop."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from core.devices import UserError
from core.program import ROOT, is_installed


class MenuChange(StrEnum):
    """What is done to the menu."""

    INSTALL = "install"
    UNINSTALL = "uninstall"


def desktop(change: Annotated[MenuChange, typer.Argument(help="what to do", show_default=False)]) -> None:
    """Put the program into the menu of your desktop, or take it out again."""
    bash = shutil.which("bash")
    if bash is None or not sys.platform.startswith("linux"):
        raise UserError("desktop entries are for Linux, and made with bash; elsewhere start the program by its command")
    environment = dict(os.environ)
    if is_installed():
        environment["LUMENPILOT_COMMAND"] = str(Path(sys.executable).with_name("lumenpilot"))
    sys.exit(subprocess.run([bash, str(ROOT / "scripts" / "desktop.sh"), change.value], env=environment, check=False).returncode)
