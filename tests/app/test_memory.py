"""What a closed rig leaves behind is given back."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest

from core.system import release_memory


class _Knot:
    def __init__(self) -> None:
        self.me = self


def test_what_refers_to_itself_alone_is_collected() -> None:
    knot = _Knot()
    there = weakref.ref(knot)
    del knot
    release_memory()
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
    release_memory()
    thread = threading.Thread(target=litter)
    thread.start()
    thread.join()
    before_mb = used_mb()
    release_memory()
    assert kept
    assert used_mb() < before_mb - 20


_MANY_THREADS = """
import ctypes, sys, threading
from core.system import limit_heaps
if sys.argv[1] == "shared":
    limit_heaps()
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
libc.fopen.restype = ctypes.c_void_p
together = threading.Barrier(8)
def allocate():
    libc.malloc(1000)
    together.wait()
threads = [threading.Thread(target=allocate) for _ in range(8)]
for thread in threads: thread.start()
for thread in threads: thread.join()
file = ctypes.c_void_p(libc.fopen(sys.argv[2].encode(), b"w"))
libc.malloc_info(0, file)
libc.fclose(file)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have other heaps")
@pytest.mark.parametrize(("how", "fewest", "most"), [("shared", 1, 2), ("default", 3, 64)])
def test_threads_share_two_heaps(how: str, fewest: int, most: int, tmp_path: Path) -> None:
    command = [sys.executable, "-c", _MANY_THREADS, how, str(tmp_path / "heaps.xml")]
    subprocess.run(command, check=True, timeout=60, cwd=Path(__file__).parents[2])
    assert fewest <= (tmp_path / "heaps.xml").read_text(encoding="utf-8").count("<heap nr=") <= most


_PICTURES = """
import resource, sys
import numpy as np
from core.system import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
def picture():
    masks = [np.ones(1_200_000, np.uint8) for _ in range(8)]
for _ in range(5):
    picture()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(50):
    picture()
print((resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before) / 50)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have other heaps")
@pytest.mark.parametrize(("how", "fewest", "most"), [("kept", 0, 50), ("default", 500, 1e6)])
def test_a_picture_takes_its_memory_from_the_one_before(how: str, fewest: float, most: float) -> None:
    """Pages that are asked for anew, 4 kB each, for 10 MB that are freed and needed again."""
    command = [sys.executable, "-c", _PICTURES, how]
    told = subprocess.run(command, check=True, timeout=60, cwd=Path(__file__).parents[2], capture_output=True, text=True)
    assert fewest <= float(told.stdout) <= most
