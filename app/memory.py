"""Memory of a program that runs for days: what a closed rig leaves behind goes back to the system."""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Callable

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
