"""Work beside the window: callbacks queued from threads, a thread of jobs, child processes, and the pace of displays."""

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
from dataclasses import dataclass, field
from functools import cache, partial
from typing import IO, Any, Generic, TypeVar

import shiboken6
from PySide6.QtCore import QObject, Qt, Signal

from core.program import ROOT
from core.system import lower_priority

Receiver = TypeVar("Receiver", bound=QObject)
Job = Callable[[], object]

_log = logging.getLogger(__name__)


class _CallbackQueue(QObject):
    """One for the program, in the window's thread, which creates it; it belongs to no window."""

    _posted = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._is_open = True
        self._posted.connect(self._run, Qt.ConnectionType.QueuedConnection)
        atexit.register(self._close)  # before PySide's own, which destroys all objects that are left

    def post(self, callback: Callable[[], None]) -> None:
        with self._lock:
            if self._is_open:
                self._posted.emit(callback)

    def _close(self) -> None:
        with self._lock:
            self._is_open = False

    def _run(self, callback: Callable[[], None]) -> None:
        callback()


@cache
def _callback_queue() -> _CallbackQueue:
    return _CallbackQueue()


class QueuedCallback(Generic[Receiver]):
    """Calls from any thread to one object of the window's thread, which makes this.

    Threads must not emit signals of a window's objects: of an object that is just being destroyed the signal lies in freed memory,
    and ``QObject.destroyed`` comes too late to prevent it. The receiver is held weakly, so that no thread ever destroys it; nor
    does a collection of garbage (``make_application``).
    """

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = weakref.ref(receiver)
        self._queue = _callback_queue()

    def send(self, call: Callable[[Receiver], None]) -> None:
        """Have `call` called with the receiver, in the window's thread and in the order of sending; never once it is gone."""
        self._queue.post(lambda: self._deliver(call))

    def _deliver(self, call: Callable[[Receiver], None]) -> None:
        receiver = self._receiver()
        if receiver is not None and shiboken6.isValid(receiver):
            call(receiver)


@dataclass(eq=False)
class _JobQueue:
    """What a worker and its thread share; the thread holds no reference to the worker."""

    jobs: deque[tuple[Hashable, Job]] = field(default_factory=deque)
    changed: threading.Condition = field(default_factory=threading.Condition)
    running: Hashable | None = None
    is_stopped: bool = False

    def stop(self, *, finish: bool = True) -> None:
        with self.changed:
            self.is_stopped = True
            if not finish:
                self.jobs.clear()
            self.changed.notify()


class Worker(QObject):
    """A thread that does named jobs, all in order or the latest only.

    ``done`` carries a job's key and its result, ``failed`` its key and one line; ``ended`` comes after the last job once it is
    stopped. Destroyed with its window, it reports nothing more, and its thread ends after its jobs. It is no QThread: Qt aborts the
    program where one is destroyed that still runs, and a driver or a disk that hangs cannot be ended.

    Parameters
    ----------
    latest_only : a new job replaces those that wait.
    behind : its jobs compute for long, at a lower priority than the window and a rig that is driven beside it.
    """

    done = Signal(object, object)
    failed = Signal(object, str)
    ended = Signal()

    def __init__(self, name: str, parent: QObject | None = None, *, latest_only: bool = False, behind: bool = False) -> None:
        super().__init__(parent, objectName=name)
        self._latest_only, self._behind = latest_only, behind
        self._queue = _JobQueue()
        self._thread: threading.Thread | None = None
        self.destroyed.connect(self._queue.stop)

    @property
    def pending(self) -> int:
        """Jobs that are not finished, the running one included."""
        with self._queue.changed:
            return len(self._queue.jobs) + (self._queue.running is not None)

    def submit(self, key: Hashable, job: Job, *, urgent: bool = False, once: bool = False) -> None:
        """Queue a job, an urgent one first; with `once` a key waits once only (an urgent call moves it to the front)."""
        queue = self._queue
        with queue.changed:
            if queue.is_stopped:
                return
            if self._latest_only:
                queue.jobs.clear()
            if once and (key == queue.running or any(key == waiting for waiting, _ in queue.jobs)):
                if not urgent or key == queue.running:
                    return
                queue.jobs = deque(waiting for waiting in queue.jobs if waiting[0] != key)
            if urgent:
                queue.jobs.appendleft((key, job))
            else:
                queue.jobs.append((key, job))
            queue.changed.notify()
            if self._thread is None:
                arguments = (self.objectName(), queue, QueuedCallback(self), self._behind)
                self._thread = threading.Thread(target=_work, args=arguments, name=self.objectName(), daemon=True)
                self._thread.start()

    def cancel_waiting(self) -> None:
        """Drop the jobs that have not begun."""
        with self._queue.changed:
            self._queue.jobs.clear()

    def stop(self, *, finish: bool) -> None:
        """Ask the thread to end, with `finish` after all jobs; returns at once."""
        self._queue.stop(finish=finish)
        if self._thread is None:
            self.ended.emit()

    def wait(self, within_ms: float | None = None) -> bool:
        """Wait for the end of the stopped thread, None: for as long as it takes; False when it did not end in time."""
        if self._thread is None:
            return True
        self._thread.join(None if within_ms is None else within_ms / 1000)
        return not self._thread.is_alive()


def _work(name: str, queue: _JobQueue, worker: QueuedCallback[Worker], behind: bool) -> None:
    """The thread of a worker."""
    if behind:
        lower_priority()
    while True:
        with queue.changed:
            queue.changed.wait_for(lambda: queue.jobs or queue.is_stopped)
            if not queue.jobs:
                break
            key, job = queue.jobs.popleft()
            queue.running = key
        report = _outcome(name, key, job)
        with queue.changed:
            queue.running = None  # before the report arrives, so that ``pending`` counts the job no more
        worker.send(report)
        del key, job, report  # what they hold is not kept until the next job comes
    worker.send(lambda it: it.ended.emit())


def _outcome(name: str, key: Hashable, job: Job) -> Callable[[Worker], None]:
    try:
        result = job()
    except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
        line = error_line(error)
        if line.startswith("unexpected"):
            _log.error("a job of %s failed", name, exc_info=error)
        return lambda it: it.failed.emit(key, line)
    return lambda it: it.done.emit(key, result)


def error_line(error: Exception) -> str:
    """The message of an expected error (of ``core`` and ``hardware``) in one line; of any other one its type, too."""
    text = " ".join(str(error).split()) or type(error).__name__
    expected = type(error).__module__.partition(".")[0] in {"core", "hardware"}
    return text if expected else f"unexpected {type(error).__name__}: {text}"


LOW_PRIORITY = 14
"""Added to the niceness of commands beside a window."""
NOT_STARTED = 127
"""Exit code of a process that could not be started, as a shell has it."""
_TAIL_BYTES = 8192
"""Of standard error: its last line is in there."""


def command_of(*arguments: str) -> list[str]:
    """The command line of one of this program's own commands."""
    return [sys.executable, str(ROOT / "main.py"), *arguments]


def module_of(name: str, *arguments: str) -> list[str]:
    """The command line of a module of this program that is not a command for people."""
    return [sys.executable, "-m", name, *arguments]


class ChildProcess(QObject):
    """A process beside the window, from ``start`` to ``ended``: long work takes no time from the operator's controls.

    ``told`` carries every line of its standard output that is a JSON object, as a dictionary. ``ended`` carries its exit code
    (negative: the signal that ended it) and the last line that it wrote to standard error, "" when there was none.

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
        self._callback = QueuedCallback(self)

    @property
    def is_running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process is not None else None

    def start(self) -> None:
        """Start it; what prevents that comes by ``ended``."""
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
            self._callback.send(lambda it: it._on_over(NOT_STARTED, why))
            return
        with contextlib.suppress(OSError, AttributeError):  # Windows has other priorities
            os.setpriority(os.PRIO_PROCESS, self._process.pid, os.getpriority(os.PRIO_PROCESS, 0) + self._priority)
        arguments = (self._process, errors, self._given, self._callback)
        threading.Thread(target=_read_child, args=arguments, name="child process", daemon=True).start()

    def ask_to_end(self) -> None:
        """Send a termination request: long work keeps what it has."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        if self.is_running and self._process is not None:
            self._process.kill()

    def leave(self) -> None:
        """Report nothing more of it; the process goes on by itself."""
        self._is_left = True

    def _signal(self, number: int) -> None:
        if self.is_running and self._process is not None:
            self._process.send_signal(number)

    def _on_record(self, record: dict[str, Any]) -> None:
        if not self._is_left:
            self.told.emit(record)

    def _on_over(self, code: int, last: str) -> None:
        if not self._is_left:
            self.ended.emit(code, last)


def _read_child(process: subprocess.Popen[bytes], errors: IO[bytes], given: str, child: QueuedCallback[ChildProcess]) -> None:
    """The thread that reads a child's output."""
    if process.stdin is not None:
        with contextlib.suppress(OSError), process.stdin:  # one that ends without having read it all is no fault here
            process.stdin.write(given.encode())
    assert process.stdout is not None
    with process.stdout as lines:
        for line in lines:
            with contextlib.suppress(ValueError, RecursionError):
                record = json.loads(line)
                if isinstance(record, dict):
                    child.send(partial(ChildProcess._on_record, record=record))
    code = process.wait()
    with errors:
        size = errors.seek(0, os.SEEK_END)
        errors.seek(max(0, size - _TAIL_BYTES))
        said = [line.strip() for line in errors.read().decode(errors="replace").splitlines() if line.strip()]
    last = said[-1].removeprefix("error: ") if said else ""
    child.send(lambda it: it._on_over(code, last))


class Pace:
    """``due()`` is True at most once per ``interval_s``, and the first time: digits that change at 30 Hz cannot be read."""

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
