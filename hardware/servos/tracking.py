"""Whether all joints go where they are sent, and stay where they are held: the fault "servo does not follow". Pure.

The gate keeps every goal within one step of the measured position, and takes a hold where the joint is. So the distance between
goal and position never shows by itself that a joint is jammed, runs away or is pulled along. ``JamMonitor`` finds a goal that is
far ahead while the joint does not come nearer; ``DriftMonitor`` adds up the way that a joint goes away from its goals or past
them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from core.config.safety import JointConfig, JointName, SafetyConfig
from core.control.gate import JointMeasurement
from core.control.joints import Joints, in_unit
from core.messages import message

_FAR_SHARE, _MOVED_SHARE = 0.5, 0.2
"""Of the step: a goal further ahead is far, and a joint that moved less did not move. One that lags so far in healthy motion moves
five times as much in the time."""
_SLOW_SHARE = 0.25
"""Of what a joint can do in the time from rest: a slow joint that did so much has moved."""
_REST_SHARE = 0.5
"""Of what counts as moved: a joint that drifted less in the time is at rest. So none is too slow for one and too fast for the
other."""


def _moved_mm(joint: JointConfig, within_s: float) -> float:
    """A joint that moves by more than this in the time is under way."""
    reach_mm = min(joint.max_speed_mm_s * within_s, joint.max_acceleration_mm_s2 * within_s**2 / 2.0)
    return min(_MOVED_SHARE * joint.max_step_mm, _SLOW_SHARE * reach_mm)


def drift_limit_mm(joint: JointConfig) -> float:
    """How far a healthy joint goes on past a goal that is suddenly behind it, at most: to brake from full speed, and one step."""
    return joint.max_step_mm + joint.braking_mm


@dataclass(slots=True)
class _Lag:
    since_s: float
    from_mm: float
    ahead: bool


@dataclass(frozen=True, slots=True)
class Jam:
    """A joint that stands so far from its goal, for so long."""

    joint: JointConfig
    distance_mm: float
    for_s: float


class JamMonitor:
    """Updated in every cycle; `limit_s` is how long a joint may stand still with its goal far away."""

    def __init__(self, joints: Sequence[JointConfig], limit_s: float) -> None:
        self._joints, self._limit_s = joints, limit_s
        self._lags: dict[JointName, _Lag] = {}

    def reset(self) -> None:
        self._lags.clear()

    def update(self, goals_mm: Sequence[float], measured_mm: Sequence[float], now_s: float) -> Jam | None:
        """The first joint that is jammed; None when all follow."""
        found = None
        for joint, goal_mm, at_mm in zip(self._joints, goals_mm, measured_mm, strict=True):
            distance_mm = goal_mm - at_mm
            lag = self._lags.get(joint.name)
            if abs(distance_mm) <= _FAR_SHARE * joint.max_step_mm:
                self._lags.pop(joint.name, None)
            elif lag is None or lag.ahead != (distance_mm > 0) or abs(at_mm - lag.from_mm) > _moved_mm(joint, self._limit_s):
                self._lags[joint.name] = _Lag(now_s, at_mm, distance_mm > 0)
            elif now_s - lag.since_s >= self._limit_s and found is None:
                found = Jam(joint, distance_mm, now_s - lag.since_s)
        return found


@dataclass(slots=True)
class _Drift:
    gone_mm: float = 0.0
    beyond_s: float | None = None
    since_s: float = -math.inf
    from_mm: float = 0.0


class DriftMonitor:
    """Updated in every cycle; `limit_s` is how long a joint may have drifted further than it takes to brake."""

    def __init__(self, joints: Sequence[JointConfig], limit_s: float) -> None:
        self._joints, self._limit_s = joints, limit_s
        self._drifts: dict[JointName, _Drift] = {}

    def reset(self) -> None:
        self._drifts.clear()

    def update(
        self, goals_mm: Sequence[float], before_mm: Sequence[float], at_mm: Sequence[float], now_s: float
    ) -> tuple[JointConfig, float] | None:
        """The first joint that runs away, and how far (mm); None when all go where they are sent.

        The goals were in force since the positions `before_mm` were measured, and led to `at_mm`.
        """
        found = None
        for joint, goal, before, at in zip(self._joints, goals_mm, before_mm, at_mm, strict=True):
            drift = self._drifts.setdefault(joint.name, _Drift())
            self._move(drift, joint, goal - before, at - before, now_s)
            if drift.beyond_s is not None and now_s - drift.beyond_s >= self._limit_s and found is None:
                found = joint, drift.gone_mm
        return found

    def _move(self, drift: _Drift, joint: JointConfig, way_mm: float, moved: float, now_s: float) -> None:
        led = min(max(moved, min(way_mm, 0.0)), max(way_mm, 0.0))
        # What a joint goes towards its goal takes back its drift: braking for a short hold does not begin a runaway.
        drift.gone_mm = math.copysign(max(0.0, abs(drift.gone_mm) - abs(led)), drift.gone_mm) + moved - led
        if abs(drift.gone_mm) > drift_limit_mm(joint):
            drift.beyond_s = now_s if drift.beyond_s is None else drift.beyond_s
            return
        drift.beyond_s = None
        if abs(drift.gone_mm - drift.from_mm) > _REST_SHARE * _moved_mm(joint, self._limit_s):
            drift.since_s, drift.from_mm = now_s, drift.gone_mm
        elif now_s - drift.since_s >= self._limit_s:
            # At rest: the drift is over. A joint that creeps on comes to stand far from its goal, and is jammed.
            drift.gone_mm, drift.since_s, drift.from_mm = 0.0, now_s, 0.0


class TrackingMonitor:
    """Finds a joint that stands far from its goal, runs away or drifts, or stays outside its envelope. Updated in every cycle.

    Only measured positions count, at the times of their measuring: a late status, or a process that stood still, is no fault of the
    joints.
    """

    def __init__(self, joints: Sequence[JointConfig], safety: SafetyConfig) -> None:
        self._joints = joints
        self._longest_s = safety.measurement_max_age_s
        self._jams = JamMonitor(joints, safety.tracking_time_s)
        self._drifts = DriftMonitor(joints, safety.tracking_time_s)
        self._outside = JamMonitor(joints, safety.tracking_time_s)
        self._before: JointMeasurement | None = None
        self._watched_s = 0.0

    def reset(self) -> None:
        """A new motion begins, or none is going on."""
        self._before = None
        for monitor in (self._jams, self._drifts, self._outside):
            monitor.reset()

    def update(self, goals_mm: Joints | None, measurement: JointMeasurement) -> str | None:
        """What is wrong with a joint; None when all follow.

        Where no goals were written in this motion (None) a joint belongs inside its envelope.
        """
        before, at_mm = self._before, measurement.positions_mm
        if before is not None and measurement.measured_s <= before.measured_s:
            return None
        self._before = measurement
        if before is None:
            return None
        self._watched_s += min(measurement.measured_s - before.measured_s, self._longest_s)
        now_s, inside_mm = self._watched_s, self._inside(at_mm, goals_mm)
        goals = goals_mm if goals_mm is not None else self._inside(before.positions_mm, None)
        # all of them, in every cycle: each has its own memory
        outside = self._outside.update(inside_mm, at_mm, now_s)
        jam = self._jams.update(goals, at_mm, now_s)
        drift = self._drifts.update(goals, before.positions_mm, at_mm, now_s)
        if outside is not None:
            joint, stays_mm = outside.joint, at_mm[self._joints.index(outside.joint)]
            text = message(
                "{joint} stays at {a:.2f} mm, outside its envelope ({b:g} to {c:g} mm)",
                joint=joint.name,
                a=stays_mm,
                b=joint.low_mm,
                c=joint.high_mm,
            )
            return in_unit(joint, text)
        if drift is not None:
            text = message("{joint} went {a:.2f} mm where nobody sent it", joint=drift[0].name, a=abs(drift[1]))
            return in_unit(drift[0], text)
        if jam is not None:
            text = message(
                "{joint} stands {a:.2f} mm from its goal for {b:.0f} ms",
                joint=jam.joint.name,
                a=abs(jam.distance_mm),
                b=1000 * jam.for_s,
            )
            return in_unit(jam.joint, text)
        return None

    def _inside(self, positions_mm: Sequence[float], goals_mm: Joints | None) -> Joints:
        """The positions, clipped to the envelopes; that of a feed which was sent below its low end begins there."""
        lows = [joint.low_mm for joint in self._joints]
        if goals_mm is not None:
            lows = [min(low, goal) for low, goal in zip(lows, goals_mm, strict=True)]
        return tuple(min(max(at, low), joint.high_mm) for at, low, joint in zip(positions_mm, lows, self._joints, strict=True))
