"""Whether all joints go where they are sent, and stay where they are held: what ends a motion as "servo does not follow". Pure.

Which joint is asked to move and does not. Pure.

The gate keeps every goal within one step of the measured position, so the distance between them never shows by itself that a joint
is jammed: it stays at the step. What shows it is a goal far ahead while the joint does not come nearer. (One that goes where nobody
sent it is ``stray``'s.)

Which joint goes where nobody sent it. Pure.

The gate follows a joint that is not where it was sent: a goal is brought back to within one step of it, and a hold is taken anew
where it is. That is right for a joint that was nudged. One that runs away or is pulled along never stands far from a goal so, and
goes on for ever. So what counts here is the way itself: how far the joint has gone away from its goals, or past them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from core.config.safety import JointConfig, JointName, SafetyConfig
from core.control.gate import JointMeasurement
from core.control.joints import Joints

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


class FollowWatch:
    """A joint that stands far from its goal, runs away or drifts, or stays outside its envelope. Fed with every cycle of a motion.

    Only positions that were measured count, at the times of their measuring: a status that is late, or a process that stood still,
    says nothing against the joints.
    """

    def __init__(self, joints: Sequence[JointConfig], safety: SafetyConfig) -> None:
        self._joints = joints
        self._longest_s = safety.measurement_max_age_s
        self._jams, self._strays, self._outside = (
            JamWatch(joints, safety.tracking_time_s),
            StrayWatch(joints, safety.tracking_time_s),
            JamWatch(joints, safety.tracking_time_s),
        )
        self._before: JointMeasurement | None = None
        self._watched_s = 0.0

    def forget(self) -> None:
        """A new motion begins, or none is going on."""
        self._before = None
        for watch in (self._jams, self._strays, self._outside):
            watch.forget()

    def see(self, goals_mm: Joints | None, measurement: JointMeasurement) -> str | None:
        """What is wrong with a joint; None when all follow.

        Parameters
        ----------
        goals_mm : the last that were written; None when none were in this motion: then a joint belongs inside its envelope.
        """
        before, at_mm = self._before, measurement.positions_mm
        if before is not None and measurement.measured_s <= before.measured_s:
            return None
        self._before = measurement
        if before is None:
            return None
        self._watched_s += min(measurement.measured_s - before.measured_s, self._longest_s)
        now_s, inside_mm = self._watched_s, self._inside(at_mm)
        goals = goals_mm if goals_mm is not None else self._inside(before.positions_mm)
        # all of them, in every cycle: each has its own memory
        outside = self._outside.see(inside_mm, at_mm, now_s)
        jam = self._jams.see(goals, at_mm, now_s)
        astray = self._strays.see(goals, before.positions_mm, at_mm, now_s)
        if outside is not None:
            joint, stays_mm = outside.joint, at_mm[self._joints.index(outside.joint)]
            return f"{joint.name} stays at {stays_mm:.2f} mm, outside its envelope ({joint.low_mm:g} to {joint.high_mm:g} mm)"
        if astray is not None:
            return f"{astray.joint.name} went {abs(astray.gone_mm):.2f} mm where nobody sent it"
        if jam is not None:
            return f"{jam.joint.name} stands {abs(jam.way_mm):.2f} mm from its goal for {1000 * jam.for_s:.0f} ms"
        return None

    def _inside(self, positions_mm: Sequence[float]) -> Joints:
        return tuple(min(max(at, joint.low_mm), joint.high_mm) for at, joint in zip(positions_mm, self._joints, strict=True))
