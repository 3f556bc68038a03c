"""What all tests share: no screen, few threads, no writes to the home folder, no thread left behind."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

# Before anything imports Qt or numpy. QT_QPA_PLATFORM=xcb make test shows real windows.
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(pool, "1")

_home = Path(tempfile.mkdtemp(prefix="lumenpilot_tests_"))
atexit.register(shutil.rmtree, _home, ignore_errors=True)
for variable in ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME"):
    os.environ[variable] = str(_home / variable.lower())
if "XDG_RUNTIME_DIR" not in os.environ:  # Qt warns without one
    runtime = _home / "runtime"
    runtime.mkdir(mode=0o700)
    os.environ["XDG_RUNTIME_DIR"] = str(runtime)


@pytest.fixture(autouse=True)
def no_thread_stays_behind() -> Iterator[None]:
    """A thread that outlives its test would work into the next one; threads of pools (daemons) may stay."""
    before = set(threading.enumerate())
    yield
    until = time.monotonic() + 2.0
    while (left := [t for t in threading.enumerate() if t not in before and not t.daemon]) and time.monotonic() < until:
        time.sleep(0.01)
    assert not left, f"threads left running: {[thread.name for thread in left]}"
