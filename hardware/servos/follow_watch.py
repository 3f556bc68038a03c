"""Whether all joints go where they are sent, and stay where they are held: what ends a motion as "servo does not follow". Pure."""

from __future__ import annotations

from collections.abc import Sequence

from core.control.gate_checks import Measurement
from core.control.joints import Joints
from core.safety_config import SafetyConfig
from core.servo_config import JointConfig
from hardware.servos.jam import JamWatch
from hardware.servos.stray import StrayWatch


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
        self._before: Measurement | None = None
        self._watched_s = 0.0

    def forget(self) -> None:
        """A new motion begins, or none is going on."""
        self._before = None
        for watch in (self._jams, self._strays, self._outside):
            watch.forget()

    def see(self, goals_mm: Joints | None, measurement: Measurement) -> str | None:
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
