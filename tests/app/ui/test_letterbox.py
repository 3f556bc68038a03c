"""Letters from threads to objects of the window, which may be gone when they arrive."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import shiboken6
from PySide6.QtCore import QObject, QThread, Signal
from pytestqt.qtbot import QtBot

from app.ui.workers import ChildProcess, QueuedCallback

ROOT = Path(__file__).parents[3]


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
            letters.send(lambda desk, number=number: desk.hear(number))  # type: ignore[misc]

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
        qtbot.waitUntil(lambda already=already: len(heard) > already)  # type: ignore[misc]
        process = child._process
        shiboken6.delete(window)
        until_now = len(heard)
        qtbot.wait(20)
        assert len(heard) == until_now
        assert process is not None
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
