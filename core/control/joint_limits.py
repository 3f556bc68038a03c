"""The limits of one joint, and of those that move the same thing: how far a goal may go in one tick."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

from core.servo_config import JointConfig

_ROUNDING_MM = 1e-9


class Limit(StrEnum):
    """What bounded a goal. ENTRY: the first goal is the measured position; STEP: distance from it; TOGETHER: another's limit."""

    ENTRY = "bumpless start"
    ENVELOPE = "end of the envelope"
    MARGIN = "near the end of the envelope"
    RATE = "speed"
    ACCELERATION = "acceleration"
    STEP = "step from the measured position"
    TOGETHER = "the other servo of the same catheter"


Goal = tuple[float, Limit | None]
"""A joint's goal (mm), and the tightest limit that was applied."""


def joint_room(measured_mm: float, joint: JointConfig) -> tuple[float, float]:
    """Lowest and highest goal inside the envelope and within one step of `measured_mm`; empty (low > high) too far outside."""
    return max(joint.low_mm, measured_mm - joint.max_step_mm), min(joint.high_mm, measured_mm + joint.max_step_mm)


def limited_goal(
    asked_mm: float,
    last_mm: float,
    speed_mm_s: float,
    measured_mm: float,
    passed_s: float,
    joint: JointConfig,
    margin_speed_share: float,
) -> Goal:
    """The goal nearest to `asked_mm` that the joint's limits allow, and the tightest limit that was applied.

    Parameters
    ----------
    last_mm, speed_mm_s : last goal, inside the envelope, and its speed.
    passed_s : time since the last goal.
    margin_speed_share : of the full speed, on the way outwards inside the warn margin.

    Returns
    -------
    tuple
        The goal is inside envelope and step in any case. It lies farther from `last_mm` than the speed allows only when the joint
        was moved away from where it was sent; the gate then rejects it.
    """
    direction = 1.0 if asked_mm > last_mm else -1.0
    to_end_mm = joint.high_mm - last_mm if direction > 0 else last_mm - joint.low_mm
    reach_mm = joint.max_speed_mm_s * passed_s
    # up to the margin at full speed, the rest of the tick slowly
    free_mm = max(0.0, to_end_mm - joint.warn_margin_mm)
    faster_mm_s = max(0.0, speed_mm_s * direction) + joint.max_acceleration_mm_s2 * passed_s
    bounds = (
        (Limit.ENVELOPE, to_end_mm),
        (Limit.RATE, reach_mm),
        (Limit.MARGIN, free_mm + margin_speed_share * (reach_mm - free_mm)),
        (Limit.ACCELERATION, faster_mm_s * passed_s),
    )
    step_mm, limit = abs(asked_mm - last_mm), None
    for name, most_mm in bounds:
        if step_mm > most_mm:
            step_mm, limit = most_mm, name
    goal_mm = last_mm + direction * step_mm
    low_mm, high_mm = joint_room(measured_mm, joint)
    inside_mm = min(max(goal_mm, low_mm), high_mm)
    return inside_mm, Limit.STEP if abs(inside_mm - goal_mm) > _ROUNDING_MM else limit


def together(
    goals: Sequence[Goal], last_mm: Sequence[float], measured_mm: Sequence[float], joints: Sequence[JointConfig]
) -> list[Goal]:
    """The goals of joints that move the same thing: the tightest limit of one of them holds for all, so that none pulls ahead.

    Parameters
    ----------
    goals : of each joint by its own limits.
    last_mm : last goals.

    Returns
    -------
    list
        All go as far as the one that goes least far, and where they would part, none goes. What the step from its measured position
        demands of a joint, as when it was pushed, comes before that; no joint ever goes farther than by its own limits.
    """
    steps = [goal - last for (goal, _), last in zip(goals, last_mm, strict=True)]
    common_mm = max(0.0, min(steps)) + min(0.0, max(steps))  # forwards or backwards; neither where they would part
    found: list[Goal] = []
    for (goal_mm, limit), last, at_mm, joint in zip(goals, last_mm, measured_mm, joints, strict=True):
        low_mm, high_mm = joint_room(at_mm, joint)
        kept_mm = min(max(last + common_mm, low_mm), high_mm)
        found.append((kept_mm, Limit.TOGETHER) if abs(kept_mm - goal_mm) > _ROUNDING_MM else (goal_mm, limit))
    return found
