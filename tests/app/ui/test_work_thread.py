"""Jobs one after the other, urgent ones first, and those that must not be lost finished at the end."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.ui.workers import Worker
from core.devices import UserError

ROOT = Path(__file__).parents[3]


def test_in_order_urgent_first_once_per_key(qtbot: QtBot) -> None:
    thread, done = Worker("test"), []
    begun, gate = threading.Event(), threading.Event()
    thread.done.connect(lambda key, result: done.append((key, result)))
    thread.submit("first", lambda: (begun.set(), gate.wait(5))[1])
    assert begun.wait(5)
    for key in ("a", "b", "a"):
        thread.submit(key, lambda k=key: k.upper(), once=True)
    thread.submit("now", lambda: "!", urgent=True)
    assert thread.pending == 4
    gate.set()
    qtbot.waitUntil(lambda: len(done) == 4)
    assert done == [("first", True), ("now", "!"), ("a", "A"), ("b", "B")]
    thread.stop(finish=False)
    assert thread.wait(2000)


def test_a_failure_is_one_line_and_the_next_job_runs(qtbot: QtBot) -> None:
    thread, heard = Worker("test"), []
    thread.failed.connect(lambda key, line: heard.append((key, line)))
    thread.done.connect(lambda key, _result: heard.append((key, "done")))

    def fail() -> None:
        raise UserError("the disk\nis full")

    thread.submit("bad", fail)
    thread.submit("good", lambda: None)
    qtbot.waitUntil(lambda: len(heard) == 2)
    assert heard == [("bad", "the disk is full"), ("good", "done")]
    thread.stop(finish=False)
    assert thread.wait(2000)


def test_stopping_finishes_what_must_not_be_lost(qtbot: QtBot) -> None:
    for finish in (True, False):
        thread, ran = Worker("test"), []
        gate = threading.Event()
        thread.submit("gate", lambda gate=gate: gate.wait(5))
        for number in range(5):
            thread.submit(number, lambda n=number, ran=ran: ran.append(n))
        thread.stop(finish=finish)
        thread.submit("late", lambda ran=ran: ran.append("late"))
        gate.set()
        assert thread.wait(2000)
        assert ran == ([0, 1, 2, 3, 4] if finish else [])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has priorities of threads")
def test_one_that_computes_for_long_waits_behind_the_window(qtbot: QtBot) -> None:
    def niceness() -> int:
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    found: dict[str, object] = {}
    threads = [Worker("behind", behind=True), Worker("beside")]
    for thread in threads:
        name = thread.objectName()
        thread.done.connect(lambda key, result: found.update({key: result}))
        thread.submit(name, niceness)
        thread.stop(finish=True)
        assert thread.wait(2000)
    qtbot.waitUntil(lambda: len(found) == 2)
    assert found == {"behind": min(19, niceness() + 4), "beside": niceness()}


DESTROYED = """
import random, threading, time
from PySide6.QtCore import QCoreApplication, QEvent, QObject
from app.ui.workers import Worker

app = QCoreApplication([])
heard = []
for _ in range(400):
    window = QObject()
    threads = [Worker("test", window) for _ in range(4)]
    for thread in threads:
        thread.done.connect(lambda *_: heard.append(1))
        for k in range(30):
            thread.submit(k, lambda: bytes(100))
    until = time.monotonic() + random.uniform(0, 0.004)
    while time.monotonic() < until:
        app.processEvents()
    window.deleteLater()
    del window
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    before = len(heard)
    app.processEvents()
    assert len(heard) == before, "one that is gone has reported"
    del threads, thread
assert heard
until = time.monotonic() + 30
while threading.active_count() > 1 and time.monotonic() < until:
    time.sleep(0.01)
print("fine", threading.active_count(), flush=True)
"""


def test_one_that_is_destroyed_with_its_window_while_it_reports_ends_nothing() -> None:
    """Its signal would be that of freed memory, which now and then ended the program when a window was closed.

    Its threads end after their jobs, and so does the program by itself.
    """
    done = subprocess.run([sys.executable, "-c", DESTROYED], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "fine 1\n", "")
