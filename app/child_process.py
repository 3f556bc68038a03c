"""A command of this program in a process of its own, beside the window: long work must take no time from the hand on the robot."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import IO, Any

from PySide6.QtCore import QObject, Signal

from app.letterbox import Letters

ROOT = Path(__file__).resolve().parent.parent
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
        self._letters = Letters(self)

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


def _listen(process: subprocess.Popen[bytes], errors: IO[bytes], given: str, letters: Letters[ChildProcess]) -> None:
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
