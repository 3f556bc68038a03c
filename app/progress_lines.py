"""Progress for another program: one JSON object a line on standard output, instead of a bar on a terminal."""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

from rich.progress import Progress, TaskID

_EVERY_S = 0.1


class Teller:
    """Writes the lines. ``is_heard`` becomes False when nobody reads them any more: the window that had asked is gone."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.is_heard = True

    def tell(self, record: dict[str, Any]) -> None:
        """Write an object; when it cannot be written, that is remembered and nothing is raised."""
        with self._lock:
            if not self.is_heard:
                return
            try:
                sys.stdout.write(json.dumps(record, allow_nan=False) + "\n")
                sys.stdout.flush()
            except (BrokenPipeError, ValueError, OSError):
                self.is_heard = False


class ProgressLines(Progress):
    """Draws nothing; tells ``{"what", "done", "total", "left_s"}`` ten times a second at most, and at the end of each task."""

    def __init__(self, teller: Teller) -> None:
        super().__init__(disable=True, auto_refresh=False)
        self._teller = teller
        self._told_s = -_EVERY_S

    def update(self, task_id: TaskID, **changes: Any) -> None:
        super().update(task_id, **changes)
        self._tell(task_id)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        super().advance(task_id, advance)
        self._tell(task_id)

    def _tell(self, task_id: TaskID) -> None:
        task, now_s = self._tasks[task_id], time.monotonic()
        if now_s - self._told_s < _EVERY_S and not task.finished:
            return
        self._told_s = now_s
        left_s = task.time_remaining
        record = {"what": task.description, "done": task.completed, "total": task.total}
        self._teller.tell(record | {"left_s": None if left_s is None else round(left_s, 1)})


_ASKED: list[Teller] = []
"""Empty: people look at a terminal. One process has one standard output, so there is one at most."""


def tell_progress() -> Teller:
    """From now on every progress bar of this process is told as lines."""
    if not _ASKED:
        _ASKED.append(Teller())
    return _ASKED[0]


def asked_teller() -> Teller | None:
    """Who tells, when another program asked for lines."""
    return _ASKED[0] if _ASKED else None
