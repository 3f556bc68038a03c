"""Locks on files between processes, on every operating system."""

from __future__ import annotations

import errno
import importlib
import os

_LOCKED_BYTE = 0x7FFF_0000
"""On Windows a lock forbids reading and writing: it lies where no file of ours reaches."""


def lock_file(handle: int, *, is_shared: bool = False, waits: bool = False) -> None:
    """Lock an open file until it is closed. Without ``waits`` BlockingIOError is raised when another process holds it.

    Raises OSError where there are no locks (some network drives). On Windows no lock is shared, and waiting ends after ten seconds.
    """
    try:
        fcntl = importlib.import_module("fcntl")
    except ImportError:
        _lock_on_windows(handle, waits=waits)
        return
    fcntl.flock(handle, (fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX) | (0 if waits else fcntl.LOCK_NB))


def _lock_on_windows(handle: int, *, waits: bool) -> None:
    try:
        msvcrt = importlib.import_module("msvcrt")
    except ImportError:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK)) from None
    place = os.lseek(handle, 0, os.SEEK_CUR)
    try:
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_LOCK if waits else msvcrt.LK_NBLCK, 1)
    except OSError as error:
        if error.errno in {errno.EACCES, errno.EDEADLK}:
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)) from None
        raise
    finally:
        os.lseek(handle, place, os.SEEK_SET)
