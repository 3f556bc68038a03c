"""Which joint goes where nobody sent it. Pure.

The gate follows a joint that is not where it was sent: a goal is brought back to within one step of it, and a hold is taken anew
where it is. That is right for a joint that was nudged. One that runs away or is pulled along never stands far from a goal so, and
goes on for ever. So what counts here is the way itself: how far the joint has gone away from its goals, or past them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from core.servo_config import JointConfig, JointName
from hardware.servos.jam import moved_mm

_RESTS_SHARE = 0.5
"""Of what a joint must move in the time to be no jam: no joint is too slow for the one and too fast for the other."""


def stray_limit_mm(joint: JointConfig) -> float:
    """How far a healthy joint goes on past a goal that is suddenly behind it, at most: to brake from full speed, and one step."""
    return joint.max_step_mm + joint.max_speed_mm_s**2 / (2.0 * joint.max_acceleration_mm_s2)


@dataclass(slots=True)
class _Stray:
    gone_mm: float = 0.0
    beyond_s: float | None = None
    since_s: float = -math.inf
    from_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class Astray:
    """A joint that has gone so far where nobody sent it."""

    joint: JointConfig
    gone_mm: float


class StrayWatch:
    """Fed with every cycle; `limit_s` is how long a joint may be farther astray than it takes to brake."""

    def __init__(self, joints: Sequence[JointConfig], limit_s: float) -> None:
        self._joints = joints
        self._limit_s = limit_s
        self._strays: dict[JointName, _Stray] = {}

    def forget(self) -> None:
        """A new motion begins, or none is going on."""
        self._strays.clear()

    def see(self, goals_mm: Sequence[float], before_mm: Sequence[float], at_mm: Sequence[float], now_s: float) -> Astray | None:
        """The first joint that is astray; None when all go where they are sent.

        Parameters
        ----------
        goals_mm : in force since the positions `before_mm` were measured.
        at_mm : where that led.
        """
        found = None
        for joint, goal, before, at in zip(self._joints, goals_mm, before_mm, at_mm, strict=True):
            stray = self._strays.setdefault(joint.name, _Stray())
            self._move(stray, joint, goal - before, at - before, now_s)
            if stray.beyond_s is not None and now_s - stray.beyond_s >= self._limit_s and found is None:
                found = Astray(joint, stray.gone_mm)
        return found

    def _move(self, stray: _Stray, joint: JointConfig, way_mm: float, moved: float, now_s: float) -> None:
        led = min(max(moved, min(way_mm, 0.0)), max(way_mm, 0.0))
        # Whoever goes where he is sent is led again, whatever was before: braking for a short hold is no beginning of a flight.
        stray.gone_mm = math.copysign(max(0.0, abs(stray.gone_mm) - abs(led)), stray.gone_mm) + moved - led
        if abs(stray.gone_mm) > stray_limit_mm(joint):
            stray.beyond_s = now_s if stray.beyond_s is None else stray.beyond_s
            return
        stray.beyond_s = None
        if abs(stray.gone_mm - stray.from_mm) > _RESTS_SHARE * moved_mm(joint, self._limit_s):
            stray.since_s, stray.from_mm = now_s, stray.gone_mm
        elif now_s - stray.since_s >= self._limit_s:
            # It has come to rest: what it went is over. One that creeps on comes to stand far from its goal, and is jammed.
            stray.gone_mm, stray.since_s, stray.from_mm = 0.0, now_s, 0.0
