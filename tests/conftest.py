"""What all tests share: no screen, few threads, no writes to the home folder, no thread left behind."""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hypothesis
import psutil
import pytest
from _pytest.runner import runtestprotocol

if TYPE_CHECKING:
    from hardware.twin.servos.bus import SoftServoBus

# Before anything imports Qt or numpy. QT_QPA_PLATFORM=xcb make test shows real windows.
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(pool, "1")

# The default profile fails an example that takes over 200 ms, as any may on a busy machine, and draws other ones in each run.
_SLOW = hypothesis.HealthCheck.too_slow
hypothesis.settings.register_profile("tests", deadline=None, derandomize=True, database=None, suppress_health_check=[_SLOW])
hypothesis.settings.load_profile("tests")

_home = Path(tempfile.mkdtemp(prefix="lumenpilot_tests_"))
atexit.register(shutil.rmtree, _home, ignore_errors=True)
for variable in ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME"):
    os.environ[variable] = str(_home / variable.lower())
if "XDG_RUNTIME_DIR" not in os.environ:  # Qt warns without one
    runtime = _home / "runtime"
    runtime.mkdir(mode=0o700)
    os.environ["XDG_RUNTIME_DIR"] = str(runtime)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """No collector walks through modules and tests while they are loaded, nor later: none of them becomes garbage."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


@pytest.fixture(autouse=True)
def no_thread_stays_behind() -> Iterator[None]:
    """A thread that outlives its test would work into the next one; threads of pools (daemons) may stay."""
    before = set(threading.enumerate())
    yield
    until = time.monotonic() + 2.0
    while (left := [t for t in threading.enumerate() if t not in before and not t.daemon]) and time.monotonic() < until:
        time.sleep(0.01)
    assert not left, f"threads left running: {[thread.name for thread in left]}"


@pytest.fixture
def start_servos() -> Iterator[Callable[..., SoftServoBus]]:
    """Starts software servos, as ``SoftServoBus`` makes them, which run until the end of the test."""
    from hardware.twin.servos.bus import SoftServoBus

    made: list[SoftServoBus] = []

    def start(*args: Any, **options: Any) -> SoftServoBus:
        made.append(SoftServoBus(*args, **options))
        made[-1].start()
        return made[-1]

    yield start
    for bus in made:
        bus.stop()
    assert [bus.failure for bus in made if bus.failure is not None] == []


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings and rig files lie in a folder of the test."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.fixture
def no_process_stays_behind() -> Iterator[None]:
    """But for Python's own, which an earlier test has started and which stays."""
    yield
    left = []
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            left.append(" ".join(process.cmdline()) or str(process))
    left = [command for command in left if "multiprocessing.resource_tracker" not in command]
    assert not left, f"processes left running: {left}"


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Tests marked ``real_time`` are tried again when they fail.

    An SDK that waits 34 ms for an answer meets a machine that pauses for longer now and then. What is really broken fails thrice.
    """
    if item.get_closest_marker("real_time") is None:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for attempt in range(3):
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
        if attempt == 2 or not any(report.failed for report in reports):
            break
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True
