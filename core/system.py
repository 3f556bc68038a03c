"""Whether the computer has slept: all ages are told by the monotonic clock, which stands still meanwhile.

What a worker process owes the process that started it.

Memory of a program that runs for days: what a closed rig leaves behind goes back to the system.

Which threads wait when there are more of them than cores.
"""

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
"""More than this since the last look is a sleep."""


def slept_s() -> float:
    """Seconds of sleep since the start."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)


def begin_as_worker() -> None:
    """What every worker does first: Ctrl-C, which reaches it too, is its parent's business, and it ends with that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def end_with_parent() -> None:
    """End this process when its parent is gone: a worker whose parent was killed would wait for work for ever."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


_ARENAS = 2
_KEPT_BYTES = 64 << 20
_FROM_HEAP_BYTES = 32 << 20
"""The most that glibc takes from a heap at all; above it pages are asked of the system."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # malloc.h


def share_heaps() -> None:
    """Let all threads allocate from two heaps. To be called before there are threads.

    By default the C library gives threads up to eight heaps a core. Each rig brings a handful of threads, which leave holes in
    whatever heaps they meet: 40 rigs one after the other grew from 280 to 304 MB, and stay at 264 with two heaps.
    """
    limit = _c_function("mallopt")
    if limit is not None:
        limit(_M_ARENA_MAX, _ARENAS)


def keep_freed() -> None:
    """Let each heap keep what is freed at its end, for the next picture.

    By default the C library hands it back above a few megabytes, and each picture's arrays are cleared page by page anew: 1200 page
    faults a frame, 1.5 of its 30 ms of processor time. ``give_back`` takes it from here, too.
    """
    option = _c_function("mallopt")
    if option is not None:
        option(_M_TRIM_THRESHOLD, _KEPT_BYTES)
        option(_M_MMAP_THRESHOLD, _FROM_HEAP_BYTES)


def give_back() -> None:
    """Collect what nobody refers to any more, and hand what is free back to the system.

    A rig is a knot of callbacks about pictures and physics: 30 MB each would wait for the collector's turn. And the C library keeps
    what was freed for each of its heaps: after sixteen rigs 348 MB, of which 76 were in nobody's use.
    """
    gc.collect()
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
"""Of the 19 steps of niceness: two threads that both want a core share it as 7 to 3."""


def let_the_window_first() -> None:
    """The calling thread, and those that it starts from now on, leave a core to window, pilot and servos when these want one.

    For perception: it computes all the time, they only now and then. In five alternating pairs of ``benchmark --window`` on two
    cores, with the whole engine behind the window by 4 or 10 steps, it stood still for 31 to 75 ms at most instead of for 49 to 84,
    and for 241 in the run in which the machine was busy with something else; from picture to servo it took as long. It cannot be
    taken back.
    """
    if sys.platform.startswith("linux"):  # where a priority is a thread's own
        thread = threading.get_native_id()
        with contextlib.suppress(OSError):  # where it is not to be had the window waits a little longer
            os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + _BEHIND)


MAX_PIXELS = 120_000_000
"""8k (33 million pixels) passes easily; far beyond it a file is rather damaged or hostile than a photograph."""


def limit_pictures() -> None:
    """Let OpenCV refuse larger pictures before it decodes them: a small file may say that it is huge, and takes gigabytes.

    To be called before OpenCV is loaded; the program's other processes inherit it.
    """
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
