"""A thread that does one job after the other, so that the window never waits for a disk or a network."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Hashable

from PySide6.QtCore import QObject, Signal

from app.letterbox import Letters
from app.thread_priority import let_the_window_first

_log = logging.getLogger(__name__)


class WorkThread(QObject):
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
        self._worker = _Worker(name, Letters(self), behind=behind)
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

    def __init__(self, name: str, letters: Letters[WorkThread], *, behind: bool) -> None:
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

    def _outcome(self, key: Hashable, job: Callable[[], object]) -> Callable[[WorkThread], None]:
        try:
            result = job()
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
            line = " ".join(str(error).split()) or type(error).__name__
            if type(error).__module__.partition(".")[0] not in {"core", "hardware"}:
                _log.error("a job of %s failed", self._name, exc_info=error)
                line = f"unexpected {type(error).__name__}: {line}"
            return lambda it: it.failed.emit(key, line)
        return lambda it: it.done.emit(key, result)
