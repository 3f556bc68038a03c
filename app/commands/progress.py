"""Progress and output of long commands: bars on standard error or JSON lines for another program, interruption, result files."""

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
from typing import Any, Self

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

from core.devices import UserError, disk_errors
from core.session.manifest import EVENTS, FRAMES, MANIFEST

_EVERY_S = 0.1
"""Between two lines for another program, at least."""


class ProgressWriter:
    """Writes JSON lines on standard output. ``is_read`` becomes False when the reader has gone: the window that had asked."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.is_read = True

    def write(self, record: dict[str, Any]) -> None:
        """Write an object; raises nothing when that fails."""
        with self._lock:
            if self.is_read:
                try:
                    sys.stdout.write(json.dumps(record, allow_nan=False) + "\n")
                    sys.stdout.flush()
                except (ValueError, OSError):
                    self.is_read = False


class ProgressLines(Progress):
    """Draws nothing; writes ``{"what", "done", "total", "left_s"}`` ten times a second at most, and at the end of each task."""

    def __init__(self, writer: ProgressWriter) -> None:
        super().__init__(disable=True, auto_refresh=False)
        self._writer = writer
        self._written_s = -_EVERY_S

    def update(self, task_id: TaskID, **changes: Any) -> None:
        super().update(task_id, **changes)
        self._write(task_id)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        super().advance(task_id, advance)
        self._write(task_id)

    def _write(self, task_id: TaskID) -> None:
        task, now_s = self._tasks[task_id], time.monotonic()
        if now_s - self._written_s < _EVERY_S and not task.finished:
            return
        self._written_s = now_s
        left_s = task.time_remaining
        record = {"what": task.description, "done": task.completed, "total": task.total}
        self._writer.write(record | {"left_s": None if left_s is None else round(left_s, 1)})


_writers: list[ProgressWriter] = []
"""One at most; empty: progress is a bar on a terminal."""
console = Console(stderr=True, markup=False, emoji=False)
"""For what long commands say beside their bar."""


def report_progress() -> None:
    """From now on every progress bar of this process is written as JSON lines."""
    if not _writers:
        _writers.append(ProgressWriter())


def progress_writer() -> ProgressWriter | None:
    """The writer of JSON lines, when another program asked for them."""
    return _writers[0] if _writers else None


def progress_bar() -> Progress:
    """The bar of all long commands on standard error, or JSON lines."""
    if (writer := progress_writer()) is not None:
        return ProgressLines(writer)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TaskProgressColumn())
    return Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console)


class Interrupt:
    """A context in which Ctrl-C and a termination request set ``asked`` and raise nothing."""

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


def end_like_an_interrupt() -> None:
    """Take a termination request, which a window sends, as Ctrl-C before ``Interrupt`` handles both."""

    def end(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, end)


class LineOutput:
    """JSON lines, each written at once: what is done survives an interruption. A context; None is standard output."""

    def __init__(self, path: Path | None) -> None:
        self._name = str(path) if path is not None else "standard output"
        try:
            if path is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                self._file = path.open("w", encoding="utf-8", buffering=1)
            elif sys.__stdout__ is None:  # started with a closed one
                raise UserError("standard output is closed; name a file with --jsonl")
            else:
                self._file = open(sys.stdout.fileno(), "w", encoding="utf-8", buffering=1, closefd=False)
        except OSError as error:
            raise self._error(error) from None

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
        except OSError as failure:  # a failed write fails again when the buffer is written
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
    """Raise UserError when the file `output`, given by `option`, cannot be written; none is left there that was not."""
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


def make_folder(folder: Path) -> None:
    """Make a folder for results; raises UserError where it cannot be written."""
    with disk_errors(UserError, folder, "cannot be written", "; choose another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-probe"
        probe.write_bytes(b"")
        probe.unlink()


class LeftOut:
    """Frames of a set that cannot be read: one damaged picture does not end a night's run. The same problem counts once."""

    def __init__(self) -> None:
        self._problems: dict[str, None] = {}

    def __len__(self) -> int:
        return len(self._problems)

    def add(self, error: UserError) -> None:
        self._problems[str(error)] = None

    def print_note(self, done: int) -> None:
        """On standard error; raises UserError where nothing at all was `done`."""
        if not self._problems:
            return
        first = next(iter(self._problems))
        if not done:
            raise UserError(f"none of {len(self)} frames could be read; the first: {first}")
        sys.stderr.write(f"note: {len(self)} of {len(self) + done} frames could not be read and are left out; the first: {first}\n")
