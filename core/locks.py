"""Locks on files and folders between processes, on every operating system."""

from __future__ import annotations

import errno
import importlib
import os
import weakref
from pathlib import Path

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


class FolderLock:
    """A folder for one holder at a time, until ``release`` or the end of the process. A drive without locks refuses no one."""

    def __init__(self) -> None:
        self._close: weakref.finalize[[int], FolderLock] | None = None

    def take(self, folder: Path) -> bool:
        """Whether the folder is this holder's now; False while another one has it. Raises OSError where it cannot be opened."""
        if self._close is not None:
            return True
        handle = os.open(folder, os.O_RDONLY)
        try:
            lock_file(handle)
        except BlockingIOError:
            os.close(handle)
            return False
        except OSError:
            pass  # a drive without locks
        self._close = weakref.finalize(self, os.close, handle)
        return True

    def release(self) -> None:
        """Let another one take it; may be called twice."""
        if self._close is not None:
            self._close()
            self._close = None
