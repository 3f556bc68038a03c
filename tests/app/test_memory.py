"""What a closed rig leaves behind is given back."""

from __future__ import annotations

import os
import sys
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest

from app.memory import give_back


class _Knot:
    def __init__(self) -> None:
        self.me = self


def test_what_refers_to_itself_alone_is_collected() -> None:
    knot = _Knot()
    there = weakref.ref(knot)
    del knot
    give_back()
    assert there() is None


@pytest.mark.skipif(sys.platform != "linux", reason="the system's own book of a process")
def test_what_other_threads_have_freed_goes_back_to_the_system() -> None:
    def used_mb() -> float:
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    def litter() -> None:
        """Many small pieces, and one at the end that keeps the heap from shrinking by itself."""
        pieces = [np.ones(8_000) for _ in range(1_000)]  # 64 kB each: below the size from which pages are mapped by themselves
        kept.append(pieces[-1])

    kept: list[np.ndarray] = []
    give_back()
    thread = threading.Thread(target=litter)
    thread.start()
    thread.join()
    before_mb = used_mb()
    give_back()
    assert kept
    assert used_mb() < before_mb - 20
