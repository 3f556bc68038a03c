"""Which joint is asked to move and does not. Pure.

The gate keeps every goal within one step of the measured position, so the distance between them never shows by itself that a joint
is jammed: it stays at the step. What shows it is a goal far ahead while the joint does not come nearer. (One that goes where nobody
sent it is ``stray``'s.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from core.servo_config import JointConfig, JointName

_FAR_SHARE, _MOVED_SHARE = 0.5, 0.2
"""Of the step: so far ahead is the goal, and less than so much the joint moved. A joint that lags so far behind in healthy motion
moves five times as much in the time."""
_SLOW_SHARE = 0.25
"""Of what a joint can do in the time from rest: one that was made slow has moved if it did so much."""


def far_mm(joint: JointConfig) -> float:
    """A goal farther away than this is one that the joint should be on its way to."""
    return _FAR_SHARE * joint.max_step_mm


def moved_mm(joint: JointConfig, within_s: float) -> float:
    """Who moves by more than this in the time is under way."""
    reach_mm = min(joint.max_speed_mm_s * within_s, joint.max_acceleration_mm_s2 * within_s**2 / 2.0)
    return min(_MOVED_SHARE * joint.max_step_mm, _SLOW_SHARE * reach_mm)


@dataclass(slots=True)
class _Lag:
    since_s: float
    from_mm: float
    ahead: bool


@dataclass(frozen=True, slots=True)
class Jam:
    """A joint that stands so far from its goal, for so long."""

    joint: JointConfig
    way_mm: float
    for_s: float


class JamWatch:
    """Fed with every cycle; `limit_s` is how long a joint may stand still with its goal far away."""

    def __init__(self, joints: Sequence[JointConfig], limit_s: float) -> None:
        self._joints = joints
        self._limit_s = limit_s
        self._lags: dict[JointName, _Lag] = {}

    def forget(self) -> None:
        """A new motion begins, or none is going on."""
        self._lags.clear()

    def see(self, goals_mm: Sequence[float], measured_mm: Sequence[float], now_s: float) -> Jam | None:
        """The first joint that is jammed; None when all follow."""
        found = None
        for joint, goal_mm, at_mm in zip(self._joints, goals_mm, measured_mm, strict=True):
            way_mm = goal_mm - at_mm
            lag = self._lags.get(joint.name)
            if abs(way_mm) <= far_mm(joint):
                self._lags.pop(joint.name, None)
            elif lag is None or lag.ahead != (way_mm > 0) or abs(at_mm - lag.from_mm) > moved_mm(joint, self._limit_s):
                self._lags[joint.name] = _Lag(now_s, at_mm, way_mm > 0)
            elif now_s - lag.since_s >= self._limit_s and found is None:
                found = Jam(joint, way_mm, now_s - lag.since_s)
        return found
