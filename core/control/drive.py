"""Advice -> command, for autonomous driving: turns of the head become bend, speeds become feed. Time is injected."""

from __future__ import annotations

import math

from core.policy_config import DriveConfig
from core.types import Advice, Command


class Drive:
    """Follows advice with a rate-limited PI loop.

    Advice says by how much the head is to *turn from where it is now*; the bend that holds a vessel's curve is not part of it. So
    the bend is mainly the integral of the advice, which also takes up slack and set of the wires, with a small part that acts at
    once. The loop is closed by the camera. While there is no advice the bend is kept and the feed stops at once.
    """

    def __init__(self, config: DriveConfig, bend: float = 0.0) -> None:
        self._config = config
        self.take_over(bend)

    def take_over(self, bend: float, pitch: float = 0.0) -> None:
        """Start from the bend (-1..1) that the robot has now, at rest; the first command moves nothing."""
        self._bend = self._integral = _limited(bend, 1.0)
        self._pitch = _limited(pitch, 1.0)
        self._advance_mm_s = 0.0
        self._last_s: float | None = None

    def command(self, advice: Advice | None, now_s: float) -> Command:
        """The command for this moment; `now_s` is on any monotonic clock, the same for all calls."""
        config = self._config
        elapsed_s = 0.0 if self._last_s is None else min(max(0.0, now_s - self._last_s), config.max_gap_s)
        self._last_s = now_s
        if advice is None or not math.isfinite(advice.steer_deg + advice.advance_mm_s):
            self._advance_mm_s, self._integral = 0.0, self._bend
            return Command(bend=self._bend, pitch=self._pitch)
        turn = advice.steer_deg / config.turn_deg
        integral = self._integral + turn * elapsed_s / config.integral_s
        wanted = integral + config.proportional * turn
        reach = config.max_bend_rate_per_s * elapsed_s
        bend = _limited(self._bend + _limited(wanted - self._bend, reach), 1.0)
        # While rate or range hold the bend back, the integral waits, so that it need not unwind later.
        held_back = (wanted - bend) * turn > 0.0
        self._integral = self._integral if held_back else _limited(integral, 1.0)
        self._bend = bend
        self._advance_mm_s = self._feed(advice.advance_mm_s, elapsed_s)
        return Command(bend=bend, pitch=self._pitch, advance_mm_s=self._advance_mm_s)

    def _feed(self, wanted_mm_s: float, elapsed_s: float) -> float:
        """Speeding up is gradual; slowing down, and stopping before a reversal, is not."""
        before = self._advance_mm_s
        if wanted_mm_s * before < 0.0:
            before = 0.0
        if abs(wanted_mm_s) <= abs(before):
            return wanted_mm_s
        return before + _limited(wanted_mm_s - before, self._config.max_acceleration_mm_s2 * elapsed_s)


def _limited(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
