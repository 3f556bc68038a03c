"""From the capture of a frame to the first servo command that was made from it."""

from __future__ import annotations

from collections import deque

import numpy as np

from core.control.guarded_robot import SentMotion

_KEPT = 100


class CommandLatency:
    """Takes what left the gate, cycle by cycle; a frame that several commands were made from counts once."""

    def __init__(self) -> None:
        self._captured_s: float | None = None
        self._latencies_s: deque[float] = deque(maxlen=_KEPT)

    @property
    def newest_s(self) -> float | None:
        return self._latencies_s[-1] if self._latencies_s else None

    @property
    def p95_s(self) -> float | None:
        """The 95th percentile of the last hundred."""
        return float(np.percentile(self._latencies_s, 95)) if self._latencies_s else None

    def see(self, sent: SentMotion | None) -> None:
        if sent is not None and sent.captured_s is not None and sent.captured_s != self._captured_s:
            self._captured_s = sent.captured_s
            self._latencies_s.append(sent.time_s - sent.captured_s)
