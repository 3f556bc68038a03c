"""Jobs one after the other, urgent ones first, and those that must not be lost finished at the end."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import pytest
import shiboken6
from PySide6.QtCore import QObject, QThread, Signal
from pytestqt.qtbot import QtBot

from app.ui.workers import ChildProcess, QueuedCallback, Worker
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
for _ in range(150):
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


class _Desk(QObject):
    told = Signal(int)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.read: list[tuple[int, bool]] = []

    def hear(self, number: int) -> None:
        self.read.append((number, QThread.currentThread() == self.thread()))


def _from_a_thread(letters: QueuedCallback[_Desk], count: int) -> None:
    def send() -> None:
        for number in range(count):
            letters.send(lambda desk, number=number: desk.hear(number))

    thread = threading.Thread(target=send)
    thread.start()
    thread.join()


def test_they_are_read_in_order_in_the_objects_thread(qtbot: QtBot) -> None:
    desk = _Desk()
    _from_a_thread(QueuedCallback(desk), 50)
    assert desk.read == []
    qtbot.waitUntil(lambda: len(desk.read) == 50)
    assert desk.read == [(number, True) for number in range(50)]


def test_what_is_gone_reads_none_and_is_kept_by_none(qtbot: QtBot) -> None:
    window, other = QObject(), _Desk()
    child, alone = _Desk(window), _Desk()
    for desk in (child, alone, other):
        _from_a_thread(QueuedCallback(desk), 3)
    gone = weakref.ref(alone)
    shiboken6.delete(window)
    del alone
    gc.collect()
    qtbot.waitUntil(lambda: len(other.read) == 3)
    assert gone() is None
    assert child.read == []


def test_a_command_whose_window_closes_while_it_speaks_is_heard_no_more(qtbot: QtBot) -> None:
    speaking = "import sys\nfor _ in range(20000): print('{\"n\": 1}', flush=True)"
    heard = []
    for _ in range(5):
        window = QObject()
        child = ChildProcess([sys.executable, "-c", speaking], window)
        child.told.connect(heard.append)
        child.start()
        already = len(heard)
        qtbot.waitUntil(lambda already=already: len(heard) > already)
        process = child._process
        shiboken6.delete(window)
        until_now = len(heard)
        qtbot.wait(20)
        assert len(heard) == until_now
        process.kill()
        process.wait()


AT_THE_END = """
import threading
from PySide6.QtCore import QCoreApplication, QObject
from app.ui.workers import QueuedCallback

app = QCoreApplication([])
desk = QObject()
letters = QueuedCallback(desk)
begun = threading.Event()

def send():
    while True:
        letters.send(lambda it: None)
        begun.set()

for _ in range(3):
    threading.Thread(target=send, daemon=True).start()
begun.wait()
"""


def test_threads_that_go_on_sending_while_the_program_ends_do_not_hurt_it() -> None:
    done = subprocess.run([sys.executable, "-c", AT_THE_END], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


GARBAGE = """
import threading, time
from PySide6.QtCore import QObject, Qt
from app.ui.window_base import make_application

application, where = make_application(), []

class Unused(QObject):
    def __init__(self):
        super().__init__()
        self.itself, self.child = self, QObject(self)
        self.child.destroyed.connect(lambda: where.append(threading.current_thread().name), Qt.ConnectionType.DirectConnection)

Unused()
thread = threading.Thread(target=lambda: [{"a": number} for number in range(200_000)])
thread.start()
thread.join()
assert where == []
while not where:
    kept = [{"a": number} for number in range(2000)]
    application.processEvents()
    time.sleep(0.01)
print(where)
"""


def test_a_window_that_went_out_of_use_is_destroyed_in_its_own_thread() -> None:
    """Whichever thread allocates: a signal that is just emitted would be that of freed memory."""
    done = subprocess.run([sys.executable, "-c", GARBAGE], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "['MainThread']\n"), done.stderr


def python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


@pytest.fixture
def ended(qtbot: QtBot) -> list[tuple[int, str]]:
    return []


def test_json_objects_are_told_in_the_windows_thread_and_the_last_line_of_an_error_without_its_first_word(
    ended: list[tuple[int, str]], qtbot: QtBot
) -> None:
    code = """
import sys, json
print(json.dumps({'got': sys.stdin.read()})); print('no json'); print('[1]'); print('{"step": 2}')
sys.stderr.write('bar 10 %\\nerror: no such folder\\n\\n')
sys.exit(2)
"""
    threads = set()
    child, told = ChildProcess(python(code), given="αβγ"), []
    child.told.connect(lambda record: (told.append(record), threads.add(threading.current_thread())))
    child.ended.connect(lambda *how: (ended.append(how), threads.add(threading.current_thread())))
    child.start()
    qtbot.waitUntil(lambda: bool(ended), timeout=10_000)
    assert told == [{"got": "αβγ"}, {"step": 2}]
    assert ended == [(2, "no such folder")]
    assert threads == {threading.main_thread()}


def test_a_program_that_is_not_there_ends_at_once(ended: list[tuple[int, str]], qtbot: QtBot) -> None:
    child = ChildProcess(["/nowhere/program"])
    child.ended.connect(lambda code, line: ended.append((code, line)))
    child.start()
    qtbot.waitUntil(lambda: bool(ended), timeout=10_000)
    assert ended[0][0] == 127
    assert "cannot be started" in ended[0][1]


def test_it_runs_at_low_priority_and_can_be_asked_to_end(ended: list[tuple[int, str]], qtbot: QtBot) -> None:
    child = ChildProcess(python("import time, os; print('{}', flush=True); time.sleep(60)"), priority=3)
    told: list[object] = []
    child.told.connect(told.append)
    child.ended.connect(lambda code, line: ended.append((code, line)))
    child.start()
    qtbot.waitUntil(lambda: bool(told), timeout=10_000)
    assert child.pid is not None
    assert os.getpriority(os.PRIO_PROCESS, child.pid) == min(19, os.getpriority(os.PRIO_PROCESS, 0) + 3)
    child.ask_to_end()
    qtbot.waitUntil(lambda: bool(ended), timeout=10_000)
    assert ended[0][0] == -signal.SIGTERM


def test_one_that_is_left_says_no_more(qtbot: QtBot) -> None:
    heard: list[object] = []
    child = ChildProcess(python("print('{}')"))
    child.told.connect(heard.append)
    child.ended.connect(lambda *_: heard.append("ended"))
    child.start()
    child.leave()
    qtbot.waitUntil(lambda: not child.is_running, timeout=10_000)
    qtbot.wait(50)
    assert heard == []
