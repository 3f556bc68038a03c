"""Files that are there as a whole or not at all."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import time
from pathlib import Path

LEFT_AFTER_S = 60.0
"""A file aside that nobody has written to for so long was left by a process that was killed."""
_ASIDE = re.compile(r"\.[0-9a-f]{16}\.part")


def write_whole(path: Path, data: bytes, *, durable: bool = False, older: Path | None = None) -> None:
    """Write a file aside and rename it: who reads it, even after a crash, finds the old or the new one. A link is followed.

    An old file's permissions are kept, where the file system lets us. With `durable` all that holds also when the power goes; it
    takes the disk some milliseconds. What was there before is copied to `older`, once the new one has found room.
    Raises OSError, which names `path`; nothing is left behind then, and the old file is as it was.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():  # a device or a pipe, whose place no file may take
        target.write_bytes(data)
        return
    aside = target.with_name(f".{secrets.token_hex(8)}.part")  # as _ASIDE has it; a name of its own length could be too long
    try:
        with aside.open("wb") as file:
            if target.exists():
                with contextlib.suppress(PermissionError):  # a disk of somebody else's that we may write on
                    shutil.copymode(target, aside)
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        if older is not None and target.exists():
            write_whole(older, target.read_bytes(), durable=durable)
        aside.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            aside.unlink()
        raise OSError(error.errno, error.strerror, str(path)) from None
    if durable:
        with contextlib.suppress(OSError):  # some file systems cannot; the new file is in place by now
            sync_folder(target.parent)


def is_aside(path: Path) -> bool:
    """Whether a file bears a name that ``write_whole`` gives a file until it is complete."""
    return _ASIDE.fullmatch(path.name) is not None


def sweep_unfinished(folder: Path) -> None:
    """Remove what a process that was killed a minute ago or longer left of its files; what cannot be removed stays."""
    for path in filter(is_aside, folder.glob(".*.part")):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > LEFT_AFTER_S:
                path.unlink()


def sync_folder(folder: Path) -> None:
    """Force the folder's entries to the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
