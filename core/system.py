"""The operating system: sleep of the computer, worker processes, memory and priorities."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable

SLEPT_S = 0.5
"""More than this since the last call is a sleep."""


def slept_s() -> float:
    """Seconds of sleep since the computer was started; the monotonic clock stands still meanwhile."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)


def begin_as_worker() -> None:
    """The first call of every worker process: it ignores Ctrl-C, which its parent handles, and ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def end_with_parent() -> None:
    """End this process when its parent is gone, or it would wait for work for ever."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


_ARENAS = 2
_KEPT_BYTES = 64 << 20
_FROM_HEAP_BYTES = 32 << 20
"""Largest block that glibc takes from a heap."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h


def limit_heaps() -> None:
    """Let all threads allocate from two heaps; to be called before there are threads.

    By default there are up to eight heaps a core, in which the threads of each rig leave holes: 40 rigs one after the other grew
    from 280 to 304 MB, and stay at 264 with two heaps.
    """
    limit = _c_function("mallopt")
    if limit is not None:
        limit(_M_ARENA_MAX, _ARENAS)


def keep_freed_memory() -> None:
    """Let each heap keep what is freed at its end for the next picture: saves 1200 page faults and 1.5 ms a frame."""
    option = _c_function("mallopt")
    if option is not None:
        option(_M_TRIM_THRESHOLD, _KEPT_BYTES)
        option(_M_MMAP_THRESHOLD, _FROM_HEAP_BYTES)


def release_memory() -> None:
    """Collect garbage, 30 MB of cycles per closed rig, and return the memory; only in the thread that owns the windows."""
    gc.collect()
    return_free_memory()


def return_free_memory() -> None:
    """Return free memory of the heaps to the system."""
    trim = _c_function("malloc_trim")
    if trim is not None:
        trim(0)


def _c_function(name: str) -> Callable[..., int] | None:
    """A function of glibc; None where there is another C library, such as musl."""
    if sys.platform != "linux":
        return None
    library = ctypes.CDLL(None)
    return getattr(library, name, None) if hasattr(library, "malloc_trim") else None


_BEHIND = 4
"""Steps of niceness: two threads that both want a core share it as 7 to 3."""


def lower_priority() -> None:
    """Lower the priority of the calling thread, and of those that it starts from now on, below window, pilot and servos.

    For perception, which computes all the time. With it the window freezes for 31 to 75 ms at most, instead of 49 to 84, and the
    time from picture to servo stays the same. It cannot be undone.
    """
    if sys.platform.startswith("linux"):  # where a priority is a thread's own
        thread = threading.get_native_id()
        with contextlib.suppress(OSError):  # not permitted everywhere
            os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + _BEHIND)


MAX_PIXELS = 120_000_000
"""8k (33 million pixels) passes easily; far beyond it a file is rather damaged or hostile than a photograph."""


def limit_pictures() -> None:
    """Let OpenCV refuse larger pictures before it decodes them: a small file may say that it is huge, and takes gigabytes.

    To be called before OpenCV is loaded; the program's other processes inherit it.
    """
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
