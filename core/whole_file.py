"""Files that are there as a whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path


def write_whole(path: Path, data: bytes) -> None:
    """Write a file aside and rename it: who reads it, even after a crash, finds the old or the new one. A link is followed.

    Raises OSError, which names `path`; nothing is left behind then.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():  # a device or a pipe, whose place no file may take
        target.write_bytes(data)
        return
    aside = target.with_name(f".{secrets.token_hex(8)}.part")  # a name of its own length could be too long
    try:
        aside.write_bytes(data)
        aside.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            aside.unlink()
        raise OSError(error.errno, error.strerror, str(path)) from None
