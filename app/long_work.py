"""What all long commands share: progress on standard error, and an end at the next good moment when they are asked to stop."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from app.progress_lines import ProgressLines, asked_teller

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
