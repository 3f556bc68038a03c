"""Whether the computer has slept: all ages are told by the monotonic clock, which stands still meanwhile."""

from __future__ import annotations

import time

SLEPT_S = 0.5
"""More than this since the last look is a sleep."""


def slept_s() -> float:
    """Seconds of sleep since the start."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.clock_gettime(time.CLOCK_MONOTONIC)
