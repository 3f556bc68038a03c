"""Frames of a set that cannot be read are left out and said once, at the end: one damaged picture must not cost a night's run."""

from __future__ import annotations

import sys

from core.errors import UserError


class LeftOut:
    """Counts them; what could not be read twice counts once."""

    def __init__(self) -> None:
        self._problems: dict[str, None] = {}

    def __len__(self) -> int:
        return len(self._problems)

    def add(self, error: UserError) -> None:
        self._problems[str(error)] = None

    def tell(self, done: int) -> None:
        """A note on standard error; raises UserError where nothing at all was `done`."""
        if not self._problems:
            return
        first = next(iter(self._problems))
        if not done:
            raise UserError(f"none of {len(self)} frames could be read; the first: {first}")
        sys.stderr.write(f"note: {len(self)} of {len(self) + done} frames could not be read and are left out; the first: {first}\n")
