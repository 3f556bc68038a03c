"""A thread that does one job after the other, so that the window never waits for a disk or a network."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections import deque
from collections.abc import Callable, Hashable
from functools import partial

from PySide6.QtCore import QObject, Signal

from app.thread_priority import let_the_window_first

_log = logging.getLogger(__name__)


class _Lifeline:
    """Whether the object that reports is still there: Qt may destroy it, as a child of a window, while its thread reports.

    Then the signal would be that of freed memory. So it cannot be destroyed meanwhile, and nothing is reported afterwards.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._is_cut = False

    def cut(self) -> None:
        """The object is being destroyed; waits for a report that is under way."""
        with self._lock:
            self._is_cut = True

    def report(self, report: Callable[[], None]) -> None:
        with self._lock:
            if not self._is_cut:
                with contextlib.suppress(RuntimeError):  # it has just begun to be destroyed, and has no signals any more
                    report()


class WorkThread(QObject):
    """Jobs in the order in which they come, urgent ones first. ``stop`` lets those be finished that must not be lost.

    ``done`` carries a job's key and what it gave, ``failed`` its key and one line; ``ended`` comes after the last job once it is
    stopped. It is no QThread: Qt aborts the program where one is destroyed that still runs, and a driver or a disk that hangs
    cannot be ended.

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
        self._behind = behind
        self._changed = threading.Condition()
        self._jobs: deque[tuple[Hashable, Callable[[], object]]] = deque()
        self._stopping = False
        self._busy: Hashable | None = None
        self._thread: threading.Thread | None = None
        self._lifeline = _Lifeline()
        self.destroyed.connect(self._lifeline.cut)

    @property
    def pending(self) -> int:
        """Jobs that are not finished, the one in hand included."""
        with self._changed:
            return len(self._jobs) + (self._busy is not None)

    def submit(self, key: Hashable, job: Callable[[], object], *, urgent: bool = False, once: bool = False) -> None:
        """Queue a job; with `once` not beside a waiting one of the same key (an urgent call moves that to the front)."""
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
                self._thread = threading.Thread(target=self._run, name=self.objectName(), daemon=True)
                self._thread.start()

    def forget(self) -> None:
        """Take back what has not begun."""
        with self._changed:
            self._jobs.clear()

    def stop(self, *, finish: bool) -> None:
        """Ask the thread to end, with `finish` after all jobs; returns at once."""
        with self._changed:
            self._stopping = True
            if not finish:
                self._jobs.clear()
            self._changed.notify()
            is_over = self._thread is None
        if is_over:
            self.ended.emit()

    def wait(self, within_ms: float | None = None) -> bool:
        """Until it has ended, once it is stopped; False when it did not in time. None: for as long as it takes."""
        thread = self._thread
        if thread is not None:
            thread.join(None if within_ms is None else within_ms / 1000)
        return thread is None or not thread.is_alive()

    def _run(self) -> None:
        """The thread."""
        if self._behind:
            let_the_window_first()
        self._work()
        self._lifeline.report(self._tell_ended)

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
            try:
                result = job()
            except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
                line = " ".join(str(error).split()) or type(error).__name__
                if type(error).__module__.partition(".")[0] not in {"core", "hardware"}:
                    _log.error("a job of %s failed", self.objectName(), exc_info=error)
                    line = f"unexpected {type(error).__name__}: {line}"
                self._finished(partial(self._tell_failed, key, line))
            else:
                self._finished(partial(self._tell_done, key, result))

    def _finished(self, report: Callable[[], None]) -> None:
        """Report after the job no longer counts as pending, so that "all saved" is true when it is heard."""
        with self._changed:
            self._busy = None
        self._lifeline.report(report)

    # Signals are looked up only while the object is there.

    def _tell_done(self, key: Hashable, result: object) -> None:
        self.done.emit(key, result)

    def _tell_failed(self, key: Hashable, line: str) -> None:
        self.failed.emit(key, line)

    def _tell_ended(self) -> None:
        self.ended.emit()
