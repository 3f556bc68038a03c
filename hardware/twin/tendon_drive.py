"""Between a bend command and the tendon: slew limit, backlash and dead zone. Tendon friction in the solver gave no hysteresis."""

from __future__ import annotations

from dataclasses import dataclass

MAX_PULL_MM = 2.0
"""Tendon pull at a bend or pitch of 1; the tip bends about 47 degrees per millimetre."""


@dataclass(frozen=True, slots=True)
class DriveProperties:
    """``backlash_mm`` is the play between motor and tendon, ``dead_zone_mm`` the slack that must be taken up before it pulls."""

    slew_mm_s: float = 10.0
    backlash_mm: float = 0.08
    dead_zone_mm: float = 0.02


class TendonDrive:
    """One antagonistic pair. ``pull_mm`` is what reaches the tendons: positive on the first, the second gets its negative."""

    def __init__(self, properties: DriveProperties) -> None:
        self._properties = properties
        self.reset()

    def reset(self) -> None:
        self._motor_mm = 0.0
        self._carried_mm = 0.0

    def step(self, demand: float, duration_s: float) -> float:
        """Move towards `demand` (-1..1) for `duration_s`; returns ``pull_mm``."""
        properties = self._properties
        reach = properties.slew_mm_s * duration_s
        target = max(-1.0, min(1.0, demand)) * MAX_PULL_MM
        self._motor_mm += max(-reach, min(reach, target - self._motor_mm))
        play = properties.backlash_mm / 2
        self._carried_mm = max(self._motor_mm - play, min(self._motor_mm + play, self._carried_mm))
        return self.pull_mm

    @property
    def pull_mm(self) -> float:
        beyond = max(0.0, abs(self._carried_mm) - self._properties.dead_zone_mm)
        return beyond if self._carried_mm > 0 else -beyond
