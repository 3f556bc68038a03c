"""Command -> goals of the seven joints in mm (bends become pulls of antagonistic tendons, speeds are integrated), and joint limits.

The mapping starts from the goals that the gate really let through, so nothing winds up while the gate limits or holds. It keeps
within speed and envelope itself, and the gate checks it all the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntFlag, StrEnum

from core.config.safety import JOINT_NAMES, TENDONS, JointConfig, JointName, SafetyConfig, ServosConfig
from core.types import Command

Joints = tuple[float, ...]
"""One value per joint, in the order of JOINT_NAMES; millimetres unless said otherwise."""
NO_GOALS: Joints = (math.nan,) * len(JOINT_NAMES)

FEEDS = range(len(TENDONS), len(JOINT_NAMES))
"""Indices of the joints that feed robot and catheter."""
ONE_CATHETER = slice(JOINT_NAMES.index("delivery_1"), JOINT_NAMES.index("delivery_2") + 1)
"""Indices of the joints that move the same catheter: driven apart they would stretch or buckle it."""

RETRACTION_MM_S = 2.0
"""Greatest speed of a feed below the low end of its envelope."""
_TOUCHING_MM = 1e-9
_ADVANCE = JOINT_NAMES.index("advance")


class Retracted(IntFlag):
    """The feeds that the operator holds back, with a control that was pressed at the low end: each goes beyond its own end only."""

    NONE = 0
    ROBOT = 1
    CATHETER = 2


@dataclass(frozen=True, slots=True)
class SentGoals:
    """The goals that were sent last (mm), and when."""

    goals_mm: Joints
    time_s: float


def by_hand(servos: ServosConfig, at_mm: Sequence[float], last: SentGoals | None, *, retracts: Retracted) -> ServosConfig:
    """The servos with the envelope that holds while the operator drives.

    A feed may be below the low end of its envelope, where a wrong zero or a retraction has left it: slowly, and not further down.
    While the operator holds its retraction (`retracts`) it has no low end, so that a robot whose insertion is not known can be
    pulled out.

    Parameters
    ----------
    at_mm : measured positions, finite.
    last : what the gate sent last in this motion.
    """
    joints = list(servos.joints)
    for place in FEEDS:
        joint = joints[place]
        lowest_mm = min(at_mm[place], at_mm[place] if last is None else last.goals_mm[place])
        is_held = bool(retracts & (Retracted.ROBOT if joint.name == "advance" else Retracted.CATHETER))
        if is_held or lowest_mm < joint.low_mm:
            joints[place] = _beyond_end(joint, -math.inf if is_held else lowest_mm)
    return servos.model_copy(update={"joints": tuple(joints)})


def by_program(servos: ServosConfig, at_mm: Sequence[float], last: SentGoals | None) -> ServosConfig:
    """The servos with the envelope that holds while the program drives: a feed a step at most below its low end stays there, or
    comes back slowly. `at_mm`, `last` : as ``by_hand`` takes them.
    """
    joints = list(servos.joints)
    for place in FEEDS:
        joint = joints[place]
        from_mm = at_mm[place] if last is None else last.goals_mm[place]
        if joint.low_mm - joint.max_step_mm <= from_mm < joint.low_mm:
            joints[place] = _beyond_end(joint, from_mm)
    return servos.model_copy(update={"joints": tuple(joints)})


def _beyond_end(joint: JointConfig, low_mm: float) -> JointConfig:
    return joint.model_copy(update={"low_mm": low_mm, "max_speed_mm_s": min(joint.max_speed_mm_s, RETRACTION_MM_S)})


@dataclass(frozen=True, slots=True)
class JointRequest:
    """Goals to request of the gate, and the joints that the end of their envelope stopped short."""

    goals_mm: Joints
    at_end: tuple[JointName, ...] = ()


def joint_goals(
    command: Command, last: SentGoals | None, measured_mm: Sequence[float], now_s: float, servos: ServosConfig, safety: SafetyConfig
) -> JointRequest:
    """The goals of a command now.

    Parameters
    ----------
    command : bend and pitch beyond -1..1 and speeds beyond the joint's are limited.
    last : what the gate sent last in this motion (``GateState.sent``); None after a start or a hold: then the goals are the
        measured positions, as the first goal moves nothing.
    measured_mm : positions of the seven joints.

    Returns
    -------
    JointRequest
        All seven goals are NaN when a number of the command or the time is not finite: the gate rejects NaN by name, while a clamp
        would turn it into full speed (``min(1.0, nan)`` is 1.0). A pause counts as the maximal age of a command at most.
    """
    numbers = (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s, now_s)
    if not all(math.isfinite(number) for number in numbers):
        return JointRequest(NO_GOALS)
    if last is None:
        return JointRequest(tuple(measured_mm))
    elapsed_s = min(max(0.0, now_s - last.time_s), safety.command_max_age_s)
    wanted = [*_tendon_goals(command, last.goals_mm, elapsed_s, servos)]
    wanted += _fed([last.goals_mm[_ADVANCE]], command.advance_mm_s, elapsed_s, servos.joints[_ADVANCE : _ADVANCE + 1])
    wanted += _fed(last.goals_mm[ONE_CATHETER], command.delivery_mm_s, elapsed_s, servos.joints[ONE_CATHETER])
    goals = tuple(goal for goal, _ in wanted)
    return JointRequest(goals, tuple(joint.name for joint, (_, ended) in zip(servos.joints, wanted, strict=True) if ended))


def _tendon_goals(command: Command, last_mm: Joints, elapsed_s: float, servos: ServosConfig) -> list[tuple[float, bool]]:
    """A bend moves the tendons of a pair against each other at their speed; to the pretension they go together, and slowly.

    So servos that were just switched on pull slack wires tight at ``pretension_mm_s``, whatever the operator does.
    """
    goals = []
    for first, share in ((0, command.bend), (2, command.pitch)):
        pulling, letting = servos.joints[first], servos.joints[first + 1]
        common_mm, bent_mm = (last_mm[first] + last_mm[first + 1]) / 2.0, (last_mm[first] - last_mm[first + 1]) / 2.0
        fastest_mm_s = min(pulling.max_speed_mm_s, letting.max_speed_mm_s)
        tighter_mm = limited(servos.pretension_mm - common_mm, min(servos.pretension_mm_s, fastest_mm_s) * elapsed_s)
        common_mm += tighter_mm
        asked_mm = limited(share, 1.0) * servos.max_pull_mm
        pull_mm = _pair_pull(asked_mm, pulling, letting, common_mm)
        bent_mm += limited(pull_mm - bent_mm, fastest_mm_s * elapsed_s - abs(tighter_mm))
        goals += [(common_mm + bent_mm, pull_mm != asked_mm), (common_mm - bent_mm, pull_mm != asked_mm)]
    return goals


def _pair_pull(asked_mm: float, one: JointConfig, other: JointConfig, common_mm: float) -> float:
    """One tendon pulls as far as the other lets go, within the envelope of both, so that no wire hangs slack."""
    most_mm = max(0.0, min(one.high_mm - common_mm, common_mm - other.low_mm))
    least_mm = min(0.0, max(one.low_mm - common_mm, common_mm - other.high_mm))
    return min(max(asked_mm, least_mm), most_mm)


def _fed(last_mm: Sequence[float], speed_mm_s: float, elapsed_s: float, joints: Sequence[JointConfig]) -> list[tuple[float, bool]]:
    """Joints that move the same catheter move equally: where one of them must stop, all of them do."""
    speed_mm_s = limited(speed_mm_s, min(joint.max_speed_mm_s for joint in joints))
    asked_mm = speed_mm_s * elapsed_s
    forward = asked_mm > 0
    rooms = [joint.high_mm - old if forward else old - joint.low_mm for joint, old in zip(joints, last_mm, strict=True)]
    step_mm = limited(asked_mm, max(0.0, min(rooms)))
    ended = abs(asked_mm) > abs(step_mm) + _TOUCHING_MM
    return [(old + step_mm, ended and room <= abs(step_mm) + _TOUCHING_MM) for old, room in zip(last_mm, rooms, strict=True)]


def limited(value: float, limit: float) -> float:
    """`value`, at most `limit` to either side of zero."""
    return max(-limit, min(limit, value))


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
        The goal is inside envelope and step. It lies further from `last_mm` than the speed allows only when the joint was moved
        away from its goal; the gate then rejects it.
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
    """The goals of joints that move the same catheter: the tightest limit of one of them holds for all, so that none pulls ahead.

    `goals` are of each joint by its own limits. All go as far as the one with the shortest step, and where they would part, none
    moves. The maximal step from its measured position comes before that, as when a joint was pushed; no joint ever exceeds its own
    limits.
    """
    steps = [goal - last for (goal, _), last in zip(goals, last_mm, strict=True)]
    common_mm = max(0.0, min(steps)) + min(0.0, max(steps))  # forwards or backwards; neither where they would part
    found: list[Goal] = []
    for (goal_mm, limit), last, at_mm, joint in zip(goals, last_mm, measured_mm, joints, strict=True):
        low_mm, high_mm = joint_room(at_mm, joint)
        kept_mm = min(max(last + common_mm, low_mm), high_mm)
        found.append((kept_mm, Limit.TOGETHER) if abs(kept_mm - goal_mm) > _ROUNDING_MM else (goal_mm, limit))
    return found
