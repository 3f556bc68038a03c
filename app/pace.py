"""Limits how often texts and plots are renewed: digits that change thirty times a second cannot be read."""

from __future__ import annotations

import time
from collections.abc import Callable


class Pace:
    """``due()`` is True at most once per ``interval_s``, and the first time."""

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
