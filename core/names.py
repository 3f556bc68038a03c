"""What files and folders are called, for people and for other files."""

from __future__ import annotations

import os
from pathlib import Path


def name_as_text(name: str | Path) -> str:
    """A name as files, figures and terminals can hold it: what is no UTF-8 in it, as in old archives, is shown as bytes."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def name_of(path: Path) -> str:
    """What a file or folder is called, however it was given: "." and ".." have names, too. A link keeps its own."""
    return os.path.basename(os.path.abspath(path))
