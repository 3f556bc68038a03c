"""How far the operator follows the advice: a number for his own use and for studies, nothing that is acted upon."""

from __future__ import annotations

from collections import deque

from core.control.hand import Jog
from core.types import Advice

_STRAIGHT_DEG = 3.0
"""Advised turns below this are none: keeping the head still follows them."""
_NEEDED = 25
"""Half a second of motion: before, a share says nothing."""


class Follow:
    """Share of the operator's motion in the last seconds that agreed with the advice, tick by tick.

    A tick in which he moves counts as one where he feeds forward or backward as advised and, if a turn is advised, does not steer
    against it; as a half where only one of the two agrees.
    """

    def __init__(self, window_s: float = 10.0) -> None:
        self._window_s = window_s
        self._ticks: deque[tuple[float, float]] = deque()

    def update(self, jog: Jog, advice: Advice | None, now_s: float) -> float | None:
        """The share, 0..1; None as long as the operator moved too little."""
        while self._ticks and not 0.0 <= now_s - self._ticks[0][0] <= self._window_s:
            self._ticks.popleft()
        if advice is not None and not (jog.bend == 0.0 and jog.advance == 0.0):
            self._ticks.append((now_s, 0.5 * _agrees_in_feed(jog, advice) + 0.5 * _agrees_in_steering(jog, advice)))
        if len(self._ticks) < _NEEDED:
            return None
        return sum(agreed for _, agreed in self._ticks) / len(self._ticks)


def _agrees_in_feed(jog: Jog, advice: Advice) -> bool:
    if jog.advance == 0.0:
        return advice.advance_mm_s == 0.0 or jog.bend != 0.0  # steering first, and feeding then, is a way to follow
    return jog.advance * advice.advance_mm_s > 0.0


def _agrees_in_steering(jog: Jog, advice: Advice) -> bool:
    if abs(advice.steer_deg) < _STRAIGHT_DEG:
        return jog.bend == 0.0
    return jog.bend * advice.steer_deg >= 0.0
