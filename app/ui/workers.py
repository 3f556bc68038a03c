"""A thread that does one job after the other, so that the window never waits for a disk or a network.

What a thread has to say to an object of the window, which may be gone by then: Qt destroys it with its window.

A signal that a thread emits of an object that is just being destroyed is that of half-freed memory, and ends the program now and
then. ``QObject.destroyed`` comes too late to prevent it: what makes up the object in Python is gone before. So threads touch no
object of the window at all. They post letters, and the window's own thread, in which objects are destroyed too, reads them out to
those that are still there.

A command of this program in a process of its own, beside the window: long work must take no time from the hand on the robot.

Limits how often texts and plots are renewed: digits that change thirty times a second cannot be read.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Hashable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import IO, Any, Generic, TypeVar

import shiboken6
from PySide6.QtCore import QObject, Qt, Signal, Slot

from core.system import let_the_window_first

Addressee = TypeVar("Addressee", bound=QObject)


class _Letterbox(QObject):
    """The program's one, of the thread that asks for it first: the window's. It belongs to no window."""

    _posted = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._is_open = True
        self._posted.connect(self._read, Qt.ConnectionType.QueuedConnection)
        atexit.register(self._close)  # before PySide's own, which destroys all objects that are left

    def post(self, letter: Callable[[], None]) -> None:
        with self._lock:
            if self._is_open:
                self._posted.emit(letter)

    def _close(self) -> None:
        with self._lock:
            self._is_open = False

    @Slot(object)
    def _read(self, letter: Callable[[], None]) -> None:
        letter()


@cache
def _letterbox() -> _Letterbox:
    return _Letterbox()


class QueuedCallback(Generic[Addressee]):
    """Letters to one object, made in its thread and sent from any.

    It keeps no object alive: what the sender holds of it, a thread could have to destroy.
    """

    def __init__(self, addressee: Addressee) -> None:
        self._addressee = weakref.ref(addressee)
        self._letterbox = _letterbox()

    def send(self, say: Callable[[Addressee], None]) -> None:
        """Have `say` called with the object, in the window's thread and in the order of sending; never once it is gone."""
        self._letterbox.post(lambda: self._deliver(say))

    def _deliver(self, say: Callable[[Addressee], None]) -> None:
        addressee = self._addressee()
        if addressee is not None and shiboken6.isValid(addressee):
            say(addressee)


_log = logging.getLogger(__name__)


class Worker(QObject):
    """Jobs in the order in which they come, urgent ones first. ``stop`` lets those be finished that must not be lost.

    ``done`` carries a job's key and what it gave, ``failed`` its key and one line; ``ended`` comes after the last job once it is
    stopped. Destroyed with its window, it reports nothing more, and its thread ends after its jobs. It is no QThread: Qt aborts the
    program where one is destroyed that still runs, and a driver or a disk that hangs cannot be ended.

    Parameters
    ----------
    behind : it computes for long: the window, and a rig that is driven beside it, come first.
    """

    done = Signal(object, object)
    failed = Signal(object, str)
    ended = Signal()

    def __init__(self, name: str, parent: QObject | None = None, *, behind: bool = False) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self._worker = _Worker(name, QueuedCallback(self), behind=behind)
        self.destroyed.connect(self._worker.end)

    @property
    def pending(self) -> int:
        """Jobs that are not finished, the one in hand included."""
        return self._worker.pending

    def submit(self, key: Hashable, job: Callable[[], object], *, urgent: bool = False, once: bool = False) -> None:
        """Queue a job; with `once` not beside a waiting one of the same key (an urgent call moves that to the front)."""
        self._worker.submit(key, job, urgent=urgent, once=once)

    def forget(self) -> None:
        """Take back what has not begun."""
        self._worker.forget()

    def stop(self, *, finish: bool) -> None:
        """Ask the thread to end, with `finish` after all jobs; returns at once."""
        if not self._worker.end(finish=finish):
            self.ended.emit()

    def wait(self, within_ms: float | None = None) -> bool:
        """Until it has ended, once it is stopped; False when it did not in time. None: for as long as it takes."""
        return self._worker.wait(within_ms)


class _Worker:
    """The thread and its jobs, which know the object that they work for by letters only."""

    def __init__(self, name: str, letters: QueuedCallback[Worker], *, behind: bool) -> None:
        self._name = name
        self._letters = letters
        self._behind = behind
        self._changed = threading.Condition()
        self._jobs: deque[tuple[Hashable, Callable[[], object]]] = deque()
        self._stopping = False
        self._busy: Hashable | None = None
        self._thread: threading.Thread | None = None

    @property
    def pending(self) -> int:
        with self._changed:
            return len(self._jobs) + (self._busy is not None)

    def submit(self, key: Hashable, job: Callable[[], object], *, urgent: bool, once: bool) -> None:
        with self._changed:
            if self._stopping:
                return
            if once and (key == self._busy or any(key == waiting for waiting, _ in self._jobs)):
                if not urgent or key == self._busy:
                    return
                self._jobs = deque(waiting for waiting in self._jobs if waiting[0] != key)
            if urgent:
                self._jobs.appendleft((key, job))
            else:
                self._jobs.append((key, job))
            self._changed.notify()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()

    def forget(self) -> None:
        with self._changed:
            self._jobs.clear()

    def end(self, *, finish: bool = True) -> bool:
        """Whether there is a thread that will say so."""
        with self._changed:
            self._stopping = True
            if not finish:
                self._jobs.clear()
            self._changed.notify()
            return self._thread is not None

    def wait(self, within_ms: float | None) -> bool:
        thread = self._thread
        if thread is not None:
            thread.join(None if within_ms is None else within_ms / 1000)
        return thread is None or not thread.is_alive()

    def _run(self) -> None:
        """The thread."""
        if self._behind:
            let_the_window_first()
        self._work()
        self._letters.send(lambda it: it.ended.emit())

    def _work(self) -> None:
        while True:
            with self._changed:
                self._busy = None
                while not self._jobs and not self._stopping:
                    self._changed.wait()
                if not self._jobs:
                    return
                key, job = self._jobs.popleft()
                self._busy = key
            say = self._outcome(key, job)
            with self._changed:
                self._busy = None  # before it is heard, so that "all saved" is true then
            self._letters.send(say)
            del key, job, say  # what they hold is not kept until the next job comes

    def _outcome(self, key: Hashable, job: Callable[[], object]) -> Callable[[Worker], None]:
        try:
            result = job()
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
            line = " ".join(str(error).split()) or type(error).__name__
            if type(error).__module__.partition(".")[0] not in {"core", "hardware"}:
                _log.error("a job of %s failed", self._name, exc_info=error)
                line = f"unexpected {type(error).__name__}: {line}"
            return lambda it: it.failed.emit(key, line)
        return lambda it: it.done.emit(key, result)


ROOT = Path(__file__).resolve().parents[2]
LOW_PRIORITY = 14
NOT_STARTED = 127
"""Exit code of a process that there never was, as a shell has it."""
_TAIL_BYTES = 8192


def command_of(*arguments: str) -> list[str]:
    """The command line of one of this program's own commands."""
    return [sys.executable, str(ROOT / "main.py"), *arguments]


def module_of(name: str, *arguments: str) -> list[str]:
    """The command line of one of this program's modules that is no command for people."""
    return [sys.executable, "-m", name, *arguments]


class ChildProcess(QObject):
    """One process, from ``start`` to ``ended``.

    ``told`` carries every line of its standard output that is a JSON object, as a dictionary. ``ended`` carries its exit code
    (negative: the signal that ended it) and the last line that it wrote to standard error, "" when there is none.

    Parameters
    ----------
    command : see ``command_of``.
    given : what it reads from standard input.
    priority : added to this process's niceness; windows that people work with get 0.
    """

    told = Signal(object)
    ended = Signal(int, str)

    def __init__(
        self, command: Sequence[str], parent: QObject | None = None, *, given: str = "", priority: int = LOW_PRIORITY
    ) -> None:
        super().__init__(parent)
        self._command, self._given, self._priority = list(command), given, priority
        self._process: subprocess.Popen[bytes] | None = None
        self._is_left = False
        self._letters = QueuedCallback(self)

    @property
    def is_running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process is not None else None

    def start(self) -> None:
        """Start it; what hinders that comes by ``ended``."""
        errors: IO[bytes] | None = None
        try:
            errors = tempfile.TemporaryFile()  # which a full disk or a read-only one refuses
            self._process = subprocess.Popen(
                self._command,
                cwd=None if self._command[1:2] != ["-m"] else ROOT,
                stdin=subprocess.PIPE if self._given else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                start_new_session=True,  # a Ctrl-C in the window's terminal is for the window, which tells this one
            )
        except OSError as error:
            if errors is not None:
                errors.close()
            why = f"cannot be started ({error.strerror or error})"
            self._letters.send(lambda it: it._on_over(NOT_STARTED, why))
            return
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, self._process.pid, os.getpriority(os.PRIO_PROCESS, 0) + self._priority)
        listening = (self._process, errors, self._given, self._letters)
        threading.Thread(target=_listen, args=listening, name="child process", daemon=True).start()

    def ask_to_end(self) -> None:
        """A termination request: long work keeps what it has."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        self._signal(signal.SIGKILL)

    def leave(self) -> None:
        """Hear no more of it; it goes on by itself."""
        self._is_left = True

    def _signal(self, number: int) -> None:
        if self.is_running and self._process is not None:
            self._process.send_signal(number)

    def _on_heard(self, record: dict[str, Any]) -> None:
        if not self._is_left:
            self.told.emit(record)

    def _on_over(self, code: int, last: str) -> None:
        if not self._is_left:
            self.ended.emit(code, last)


def _listen(process: subprocess.Popen[bytes], errors: IO[bytes], given: str, letters: QueuedCallback[ChildProcess]) -> None:
    """The thread."""
    if process.stdin is not None:
        with contextlib.suppress(OSError), process.stdin:  # one that ends without having read it all is no fault here
            process.stdin.write(given.encode())
    assert process.stdout is not None
    with process.stdout as lines:
        for line in lines:
            record = _record(line)
            if record is not None:
                letters.send(partial(ChildProcess._on_heard, record=record))
    code, last = process.wait(), _last_line(errors)
    letters.send(lambda it: it._on_over(code, last))


def _record(line: bytes) -> dict[str, Any] | None:
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) else None


def _last_line(errors: IO[bytes]) -> str:
    """What a command said last, without the word that all errors begin with."""
    with errors:
        size = errors.seek(0, os.SEEK_END)
        errors.seek(max(0, size - _TAIL_BYTES))
        lines = [line.strip() for line in errors.read().decode(errors="replace").splitlines() if line.strip()]
    return lines[-1].removeprefix("error: ") if lines else ""


class Pace:
    """``due()`` is True at most once per ``interval_s``, and the first time."""

    def __init__(self, interval_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._interval_s = interval_s
        self._clock = clock
        self._next_s = -float("inf")

    def due(self) -> bool:
        now = self._clock()
        if now < self._next_s:
            return False
        self._next_s = now + self._interval_s
        return True

    def reset(self) -> None:
        """The next ``due()`` is True."""
        self._next_s = -float("inf")
