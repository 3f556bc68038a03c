"""How evenly the bus process turns."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from hardware.servos.bus_messages import CycleTimes

_RENEW_CYCLES = 25


class Stopwatch:
    """Percentiles over the last `cycles`, renewed every now and then."""

    def __init__(self, cycles: int) -> None:
        self._periods: deque[float] = deque(maxlen=cycles)
        self._works: deque[float] = deque(maxlen=cycles)
        self._last_s: float | None = None
        self._noted = 0
        self.summary = CycleTimes()

    def note(self, started_s: float, ended_s: float) -> None:
        """One cycle, by the monotonic clock."""
        if self._last_s is not None:
            self._periods.append(1000.0 * (started_s - self._last_s))
        self._last_s = started_s
        self._works.append(1000.0 * (ended_s - started_s))
        self._noted += 1
        if self._noted % _RENEW_CYCLES == 0:
            self.summary = CycleTimes(*_percentiles(self._periods), *_percentiles(self._works))


def _percentiles(values: Sequence[float]) -> tuple[float, float]:
    """The median and the 99th percentile."""
    ordered = sorted(values)
    return ordered[len(ordered) // 2], ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))]
