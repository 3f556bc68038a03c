"""Where playing is: a position that runs with the clock at some speed. No Qt here."""

from __future__ import annotations

import time
from collections.abc import Callable

from app.session_marks import Course

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_LONGEST_GAP_S = 2.0
"""Nobody wants to look at a frozen picture for longer: what is lost beyond it is passed over, and said."""


class PlayClock:
    """``position_s`` counts from the first row. ``turn`` is called at any rate while it plays.

    ``passed_s`` tells how much of a gap was passed over in the last turn.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._last_s: float | None = None
        self.position_s = 0.0
        self.speed = 1.0
        self.passed_s = 0.0

    @property
    def is_playing(self) -> bool:
        return self._last_s is not None

    def play(self) -> None:
        self._last_s = self._clock()

    def pause(self) -> None:
        self._last_s = None

    def seek(self, position_s: float) -> None:
        """Go on from here, playing or not."""
        self.position_s = max(0.0, position_s)
        if self._last_s is not None:
            self._last_s = self._clock()

    def faster(self, step: int) -> float:
        """One speed up or down; returns it."""
        nearest = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - self.speed))
        self.speed = SPEEDS[max(0, min(len(SPEEDS) - 1, nearest + step))]
        return self.speed

    def turn(self, course: Course, end_s: float) -> bool:
        """Move on; False when `end_s` is reached, where it pauses."""
        if self._last_s is None:
            return False
        now_s = self._clock()
        place = course.place_at(self.position_s)
        self.position_s += (now_s - self._last_s) * self.speed
        self._last_s = now_s
        self.passed_s = 0.0
        if place + 1 < len(course):
            here_s, next_s = float(course.times_s[place]), float(course.times_s[place + 1])
            if next_s - here_s > _LONGEST_GAP_S and here_s + 0.5 < self.position_s < next_s:
                self.passed_s = next_s - self.position_s
                self.position_s = next_s
        if self.position_s >= end_s:
            self.position_s = end_s
            self.pause()
            return False
        return True
