"""Frames of a recording at the pace at which they were taken."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Generic, TypeVar

LATE_S = 0.1
"""A frame that is this late is skipped."""

F = TypeVar("F")


class Pacer(Generic[F]):
    """Gives each frame when it is due. Late ones are skipped, as from a camera; what decodes too slowly is played slower."""

    def __init__(self) -> None:
        self._start_s: float | None = None
        self._pending: tuple[F, float] | None = None

    def next(self, decode: Callable[[], tuple[F, float]], timeout_s: float) -> tuple[F, float] | None:
        """The next frame and when it was due (monotonic); None when that is later than in `timeout_s`: then it is kept.

        `decode` gives the next frame and its seconds from the first one on.
        """
        entered_s = time.monotonic()
        while True:
            frame, at_s = self._pending or decode()
            self._pending = None
            now_s = time.monotonic()
            if self._start_s is None:
                self._start_s = now_s - at_s
            late_s = now_s - (self._start_s + at_s)
            left_s = entered_s + timeout_s - now_s
            if -late_s > max(left_s, 0.0):
                self._pending = frame, at_s
                time.sleep(max(left_s, 0.0))
                return None
            if late_s >= LATE_S:
                if left_s > 0.0:
                    continue
                # Decoding is slower than the recording: it is played as fast as it goes, instead of never.
                self._start_s += late_s
            time.sleep(max(-late_s, 0.0))
            return frame, self._start_s + at_s
