"""When a picture was taken, on the monotonic clock, from whatever clock the camera stamps its pictures with."""

from __future__ import annotations

from collections import deque

_BELIEVABLE_S = 0.5
"""A picture that claims to be older than this, or from the future, has a stamp of another clock."""
_STALLED_S = 10.0
"""But of a clock that has proved to be ours, a picture may have waited so long, while the computer was busy."""
_REMEMBERED = 300


class CaptureClock:
    """Maps stamps to monotonic seconds; never later than the arrival, never before the picture before.

    A stamp on a clock that this computer has too (wall or monotonic) tells the age of the picture itself. Of the camera's own
    clock only the rate is known: the quickest of the last pictures is taken to have arrived at once, and the others to have waited
    so much longer. Then an age is too short by the quickest way through cable and driver, but delays on top of it show.
    """

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=_REMEMBERED)
        self._stamp_s: float | None = None
        self._is_ours = False
        self._newest_s = float("-inf")

    def captured_s(self, arrived_s: float, stamp_s: float | None, now_on_its_clock_s: float | None = None) -> float:
        """The time of capture.

        Parameters
        ----------
        arrived_s : monotonic, when the picture came.
        stamp_s : the camera's stamp, in seconds of any clock; None: it has none.
        now_on_its_clock_s : what that clock showed at the arrival; None: only the camera knows.
        """
        captured_s = arrived_s
        age_s = now_on_its_clock_s - stamp_s if stamp_s is not None and now_on_its_clock_s is not None else -1.0
        if 0.0 <= age_s <= (_STALLED_S if self._is_ours else _BELIEVABLE_S):
            self._is_ours = True
            captured_s = arrived_s - age_s
        elif stamp_s is not None:
            captured_s = stamp_s + self._offset_s(arrived_s, stamp_s)
        self._newest_s = max(self._newest_s, min(captured_s, arrived_s))
        return self._newest_s

    def _offset_s(self, arrived_s: float, stamp_s: float) -> float:
        """From the camera's clock to ours, as the quickest picture had it."""
        if self._stamp_s is not None and not 0.0 <= stamp_s - self._stamp_s <= 10.0:
            self._offsets.clear()  # the camera was started again, or its clock was set
        self._stamp_s = stamp_s
        self._offsets.append(arrived_s - stamp_s)
        return min(self._offsets)
