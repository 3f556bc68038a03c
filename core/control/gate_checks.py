"""What the gate rejects: malformed, not permitted, stale, out of envelope, over rate. Each check names its rejection, or None."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from core.control.joint_limits import joint_room
from core.control.joints import Joints
from core.safety_config import SafetyConfig
from core.servo_config import JOINT_NAMES, ServosConfig

_COUNT = len(JOINT_NAMES)


class Source(StrEnum):
    """Who asks for a motion."""

    OPERATOR = "operator"
    PROGRAM = "program"


class RejectReason(StrEnum):
    """Why the gate let nothing through."""

    NON_FINITE = "number not finite"
    WRONG_COUNT = "wrong number of joints"
    FROM_THE_FUTURE = "time in the future"
    CLOCK_WENT_BACK = "clock went back"
    CLOCK_GAP = "clock jumped ahead"
    NOT_ARMED = "not armed"
    WRONG_SOURCE = "somebody else drives"
    NO_COMMAND = "no command"
    STALE_COMMAND = "command too old"
    OUT_OF_ORDER = "command overtaken by a newer one"
    STALE_POSE = "pose behind the command too old"
    NO_MEASUREMENT = "positions unknown"
    STALE_MEASUREMENT = "positions too old"
    MEASURED_OUT_OF_ENVELOPE = "joint is outside its envelope"
    OUT_OF_ENVELOPE = "goal outside the envelope"
    OVER_RATE = "goal too far away"
    OFF_COURSE = "joint is not where it was sent"


@dataclass(frozen=True, slots=True)
class GoalRequest:
    """Goals (mm) that somebody asks for. ``captured_s`` is when the frame behind them was taken; an operator needs none."""

    goals_mm: Sequence[float]
    source: Source
    issued_s: float
    captured_s: float | None = None


@dataclass(frozen=True, slots=True)
class Measurement:
    """Where the seven joints are (mm), and when that was read."""

    positions_mm: Sequence[float]
    measured_s: float


@dataclass(frozen=True, slots=True)
class Rejection:
    """Nothing of the request was obeyed. ``detail`` adds the joint or the measured value against its threshold."""

    reason: RejectReason
    detail: str = ""


def clock_objection(last_s: float | None, now_s: float, safety: SafetyConfig) -> Rejection | None:
    if not math.isfinite(now_s):
        return Rejection(RejectReason.NON_FINITE, "time")
    if last_s is None:
        return None
    passed_s = now_s - last_s
    if passed_s < 0.0:
        return Rejection(RejectReason.CLOCK_WENT_BACK, f"by {-passed_s:.3f} s")
    if passed_s > safety.clock_gap_s:
        return Rejection(RejectReason.CLOCK_GAP, f"by {passed_s:.3f} s (at most {safety.clock_gap_s:g} s)")
    return None


def malformed(request: GoalRequest | None, now_s: float) -> Rejection | None:
    if request is None:
        return None
    if (wrong := _not_seven_numbers(request.goals_mm)) is not None:
        return wrong
    times = [request.issued_s] if request.captured_s is None else [request.issued_s, request.captured_s]
    if not all(math.isfinite(time_s) for time_s in times):
        return Rejection(RejectReason.NON_FINITE, "time of the command")
    if max(times) > now_s:
        return Rejection(RejectReason.FROM_THE_FUTURE, f"command, by {max(times) - now_s:.3f} s")
    return None


def _not_seven_numbers(values: Sequence[float]) -> Rejection | None:
    if len(values) != _COUNT:
        return Rejection(RejectReason.WRONG_COUNT, f"{len(values)} instead of {_COUNT}")
    for name, value in zip(JOINT_NAMES, values, strict=True):
        if not math.isfinite(value):
            return Rejection(RejectReason.NON_FINITE, name)
    return None


def not_permitted(request: GoalRequest | None, permitted: Source | None) -> Rejection | None:
    if permitted is None:
        return Rejection(RejectReason.NOT_ARMED)
    if request is not None and request.source is not permitted:
        return Rejection(RejectReason.WRONG_SOURCE, f"the {permitted} drives")
    return None


def stale(request: GoalRequest | None, newest_s: float | None, now_s: float, safety: SafetyConfig) -> Rejection | None:
    if request is None:
        return None
    if (age_s := now_s - request.issued_s) > safety.command_max_age_s:
        return Rejection(RejectReason.STALE_COMMAND, _age(age_s, safety.command_max_age_s))
    if newest_s is not None and request.issued_s < newest_s:
        return Rejection(RejectReason.OUT_OF_ORDER)
    if request.source is Source.OPERATOR:
        return None
    if request.captured_s is None:
        return Rejection(RejectReason.STALE_POSE, "no frame behind the command")
    if (age_s := now_s - request.captured_s) > safety.pose_hold_s:
        return Rejection(RejectReason.STALE_POSE, _age(age_s, safety.pose_hold_s))
    return None


def _age(age_s: float, limit_s: float) -> str:
    age, limit = (f"{1000 * seconds:.0f} ms" for seconds in (age_s, limit_s))
    return f"{age} (at most {limit})"


def mistrust(measurement: Measurement | None, now_s: float, servos: ServosConfig, safety: SafetyConfig) -> Rejection | None:
    """Why the measured positions are no ground to stand on, or None."""
    if measurement is None:
        return Rejection(RejectReason.NO_MEASUREMENT)
    if (wrong := _not_seven_numbers(measurement.positions_mm)) is not None:
        return replace(wrong, detail=f"measured position: {wrong.detail}")
    age_s = now_s - measurement.measured_s
    if not math.isfinite(age_s):
        return Rejection(RejectReason.NON_FINITE, "time of the measured positions")
    if age_s < 0.0:
        return Rejection(RejectReason.FROM_THE_FUTURE, f"measured positions, by {-age_s:.3f} s")
    if age_s > safety.measurement_max_age_s:
        return Rejection(RejectReason.STALE_MEASUREMENT, _age(age_s, safety.measurement_max_age_s))
    outside = outside_envelope(measurement.positions_mm, servos)
    return Rejection(RejectReason.MEASURED_OUT_OF_ENVELOPE, outside[0]) if outside else None


def outside_envelope(positions_mm: Sequence[float], servos: ServosConfig) -> tuple[str, ...]:
    """The joints farther outside their envelope than one bounded step brings them back, with their positions."""
    found = []
    for joint, position_mm in zip(servos.joints, positions_mm, strict=True):
        low_mm, high_mm = joint_room(position_mm, joint)
        if low_mm > high_mm:
            found.append(f"{joint.name} at {position_mm:.2f} mm ({joint.low_mm:g} to {joint.high_mm:g} mm)")
    return tuple(found)


def too_far(request: GoalRequest, base_mm: Joints, servos: ServosConfig, safety: SafetyConfig) -> Rejection | None:
    """Goals that no honest source asks for: beyond the envelope, or farther than the joint travels while a command is valid."""
    for joint, goal_mm, from_mm in zip(servos.joints, request.goals_mm, base_mm, strict=True):
        rounding_mm = abs(1.0 / joint.ticks_per_mm)
        if not joint.low_mm - rounding_mm <= goal_mm <= joint.high_mm + rounding_mm:
            detail = f"{joint.name} to {goal_mm:.2f} mm ({joint.low_mm:g} to {joint.high_mm:g} mm)"
            return Rejection(RejectReason.OUT_OF_ENVELOPE, detail)
        most_mm = joint.max_speed_mm_s * safety.command_max_age_s
        if abs(goal_mm - from_mm) > most_mm + rounding_mm:
            return Rejection(RejectReason.OVER_RATE, f"{joint.name} by {abs(goal_mm - from_mm):.2f} mm (at most {most_mm:g} mm)")
    return None
