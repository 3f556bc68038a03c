"""JSON lines to a file or to standard output: what cannot be written is one clear error, whenever the system notices."""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from core.errors import UserError


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
