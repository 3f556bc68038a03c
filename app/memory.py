"""Memory that a closed rig leaves behind."""

from __future__ import annotations

import ctypes
import gc
import sys


def give_back() -> None:
    """Collect what nobody refers to any more, and hand what is free back to the system.

    A rig is a knot of callbacks about pictures and physics: 30 MB each would wait for the collector's turn. And the C library keeps
    what was freed for each of its threads: after sixteen rigs 348 MB, of which 76 were in nobody's use.
    """
    gc.collect()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc has it, musl has not
        if trim is not None:
            trim(0)
