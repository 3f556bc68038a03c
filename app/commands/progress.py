"""What all long commands share: progress on standard error, and an end at the next good moment when they are asked to stop.

Progress for another program: one JSON object a line on standard output, instead of a bar on a terminal.

JSON lines to a file or to standard output: what cannot be written is one clear error, whenever the system notices.

Where a command writes: never over what it reads, nor over what somebody may still need.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from types import FrameType, TracebackType
from typing import IO, Any, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from core.devices import UserError
from core.session.manifest import EVENTS, FRAMES, MANIFEST

_EVERY_S = 0.1


class ProgressWriter:
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

    def __init__(self, teller: ProgressWriter) -> None:
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


_ASKED: list[ProgressWriter] = []
"""Empty: people look at a terminal. One process has one standard output, so there is one at most."""


def tell_progress() -> ProgressWriter:
    """From now on every progress bar of this process is told as lines."""
    if not _ASKED:
        _ASKED.append(ProgressWriter())
    return _ASKED[0]


def asked_teller() -> ProgressWriter | None:
    """Who tells, when another program asked for lines."""
    return _ASKED[0] if _ASKED else None


console = Console(stderr=True, markup=False, emoji=False)
"""Where long work says what it has done, beside its bar."""


def progress_bar() -> Progress:
    """The bar that all long commands show, on standard error; as lines where another program asked for them."""
    if (teller := asked_teller()) is not None:
        return ProgressLines(teller)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TaskProgressColumn())
    return Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console)


class Interrupt:
    """Ctrl-C and a termination request ask the work to stop at the next good moment instead of tearing it down."""

    def __init__(self) -> None:
        self.asked = False
        self._old: dict[int, Any] = {}

    def __enter__(self) -> Interrupt:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._old[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._old.items():
            signal.signal(number, handler)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.asked = True


class LineOutput:
    """Writes every line at once, so that what is done survives an interruption. A context; None is standard output."""

    def __init__(self, path: Path | None) -> None:
        self._name = str(path) if path is not None else "standard output"
        try:
            self._file = self._open(path)
        except OSError as error:
            raise self._error(error) from None

    def _open(self, path: Path | None) -> IO[str]:
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            return path.open("w", encoding="utf-8", buffering=1)
        if sys.__stdout__ is None:  # started with a closed one
            raise UserError("standard output is closed; name a file with --jsonl")
        return open(sys.stdout.fileno(), "w", encoding="utf-8", buffering=1, closefd=False)

    def _error(self, error: OSError) -> UserError:
        return UserError(f"{self._name}: cannot be written ({error.strerror}); choose another file")

    def write(self, text: str) -> None:
        """One line; raises UserError."""
        try:
            self._file.write(text + "\n")
        except OSError as error:
            raise self._error(error) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self._file.close()
        except OSError as failure:  # what a failed write left in the buffer fails again
            if kind is None:
                raise self._error(failure) from None


def is_same(first: Path, second: Path) -> bool:
    """Whether both names lead to one file or folder, be it there already or not."""
    try:
        return first.samefile(second)
    except OSError:
        return os.path.realpath(first) == os.path.realpath(second)  # Path.resolve raises on links in a loop


def check_no_input(output: Path, inputs: Iterable[Path], option: str) -> None:
    """Raise UserError when `output`, given by `option`, is one of the `inputs`."""
    if any(is_same(output, path) for path in inputs):
        raise UserError(f"{output}: is an input, which {option} would overwrite; choose another one")


def check_apart(output: Path, others: Iterable[Path], option: str, writer: str) -> None:
    """Raise UserError when `output`, given by `option`, is one of the files that the option `writer` writes, too."""
    if any(is_same(output, path) for path in others):
        raise UserError(f"{output}: is written by {writer}, too; choose another file for {option}")


def check_can_write(output: Path, option: str) -> None:
    """Raise UserError when the file `output`, given by `option`, cannot be written: now, and not after long work.

    One that is not there yet is not made before there is something to write.
    """
    try:
        is_new = not output.exists()
        output.open("a").close()
        if is_new:
            output.unlink()
    except OSError as error:
        raise UserError(f"{output}: cannot be written ({error.strerror}); choose another {option}") from None


def check_no_session(folder: Path, option: str) -> None:
    """Raise UserError when `folder`, given by `option`, is a recorded session, whose files must stay as they are."""
    if any((folder / name).is_file() for name in (MANIFEST, FRAMES, EVENTS)) or any(folder.glob("video_*.mkv")):
        raise UserError(f"{folder}: is a recorded session, which {option} would damage; choose another folder")
