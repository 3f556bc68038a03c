"""Which joint is asked to move and does not. Pure.

The gate keeps every goal within one step of the measured position, so the distance between them never shows by itself that a joint
is jammed: it stays at the step. What shows it is a goal far ahead while the joint does not come nearer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from core.servo_config import JointConfig, JointName

_FAR_SHARE, _MOVED_SHARE = 0.5, 0.2
"""Of the step: so far ahead is the goal, and less than so much the joint moved. A joint that lags so far behind in healthy motion
moves five times as much in the time."""


@dataclass(slots=True)
class _Lag:
    since_s: float
    from_mm: float
    ahead: bool


class JamWatch:
    """Fed with every cycle; `limit_s` is how long a joint may stand still with its goal far away."""

    def __init__(self, joints: Sequence[JointConfig], limit_s: float) -> None:
        self._joints = joints
        self._limit_s = limit_s
        self._lags: dict[JointName, _Lag] = {}

    def forget(self) -> None:
        """A new motion begins, or none is going on."""
        self._lags.clear()

    def see(self, goals_mm: Sequence[float], measured_mm: Sequence[float], now_s: float) -> str | None:
        """What is wrong with the first joint that is jammed; None when all follow."""
        found = None
        for joint, goal_mm, at_mm in zip(self._joints, goals_mm, measured_mm, strict=True):
            way_mm = goal_mm - at_mm
            lag = self._lags.get(joint.name)
            if abs(way_mm) <= _FAR_SHARE * joint.max_step_mm:
                self._lags.pop(joint.name, None)
            elif lag is None or lag.ahead != (way_mm > 0) or abs(at_mm - lag.from_mm) > _MOVED_SHARE * joint.max_step_mm:
                self._lags[joint.name] = _Lag(now_s, at_mm, way_mm > 0)
            elif now_s - lag.since_s >= self._limit_s and found is None:
                found = f"{joint.name} stands {abs(way_mm):.2f} mm from its goal for {1000 * (now_s - lag.since_s):.0f} ms"
        return found
