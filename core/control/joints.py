"""Command -> goals of the joints (bends become pulls of tendons, speeds are integrated), and joint limits.

Tendons stand around the shaft at their ``angle_deg``; a bend of m mm in the direction phi pulls each by m cos(angle - phi), which
is what the curve takes from its length. Two and four tendons are driven as opposite pairs, three together. Where the robot has two
tendons and a rotation, the shaft is turned until their plane is that of the bend; meanwhile they bend by what lies in their plane.
Bend and pitch of a command are those of the head on the screen, whatever the rotation is.

The mapping starts from the goals that the gate really let through, so nothing winds up while the gate limits or holds. It keeps
within speed and envelope itself, and the gate checks it all the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntFlag, StrEnum

from core.config.safety import JointConfig, JointKind, JointName, SafetyConfig, ServosConfig
from core.messages import Message
from core.types import Command, RobotStatus

Joints = tuple[float, ...]
"""One value per joint, in the order of the configuration; millimetres (degrees of a rotation) unless said otherwise."""

RETRACTION_MM_S = 2.0
"""Greatest speed of a feed below the low end of its envelope."""
_TOUCHING_MM = 1e-9
_BEND_TO_TURN = 0.03
"""A smaller bend, of full bend, does not turn the shaft of two tendons: its direction means nothing."""


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

    A feed may be below the low end of its envelope, where a wrong zero or a retraction has left it: slowly, and not further
    down. While the operator holds its retraction (`retracts`) it has no low end, so that a robot whose insertion is not known
    can be pulled out. Measured positions are finite; `last` is what the gate sent last in this motion.
    """
    joints = list(servos.joints)
    for place, joint in enumerate(servos.joints):
        if not joint.is_feed:
            continue
        lowest_mm = min(at_mm[place], at_mm[place] if last is None else last.goals_mm[place])
        is_held = bool(retracts & (Retracted.ROBOT if joint.kind is JointKind.ADVANCE else Retracted.CATHETER))
        if is_held or lowest_mm < joint.low_mm:
            joints[place] = _beyond_end(joint, -math.inf if is_held else lowest_mm)
    return servos.model_copy(update={"joints": tuple(joints)})


def by_program(servos: ServosConfig, at_mm: Sequence[float], last: SentGoals | None) -> ServosConfig:
    """The servos with the envelope that holds while the program drives: a feed a step at most below its low end stays there, or
    comes back slowly. `at_mm`, `last` : as ``by_hand`` takes them.
    """
    joints = list(servos.joints)
    for place, joint in enumerate(servos.joints):
        if not joint.is_feed:
            continue
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

    All goals are NaN when a number of the command or the time is not finite: the gate rejects NaN by name, while a clamp
    would turn it into full speed (``min(1.0, nan)`` is 1.0). A pause counts as the maximal age of a command at most.

    Parameters
    ----------
    command : bend and pitch beyond -1..1 and speeds beyond the joint's are limited.
    last : what the gate sent last in this motion (``GateState.sent``); None after a start or a hold: then the goals are the
        measured positions, as the first goal moves nothing.
    measured_mm : positions of the joints.
    """
    numbers = (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s, command.rotation_deg_s, now_s)
    if not all(math.isfinite(number) for number in numbers):
        return JointRequest((math.nan,) * len(servos.joints))
    if last is None:
        return JointRequest(tuple(measured_mm))
    elapsed_s = min(max(0.0, now_s - last.time_s), safety.command_max_age_s)
    turned = _turned(command, last.goals_mm, elapsed_s, servos)
    bent = _tendon_goals(_in_shaft(command, sum(goal for goal, _ in turned)), last.goals_mm, elapsed_s, servos)
    # On the way to a bend that fits, one that stands at the end of its envelope would be pulled on by the pretension of all.
    wanted = [
        (min(max(goal, min(joint.low_mm, at)), max(joint.high_mm, at)), ended)
        for (goal, ended), at, joint in zip(bent, last.goals_mm, servos.tendons, strict=False)
    ]
    for kind, speed_mm_s in ((JointKind.ADVANCE, command.advance_mm_s), (JointKind.DELIVERY, command.delivery_mm_s)):
        place = servos.places(kind)
        wanted += _fed(last.goals_mm[place], speed_mm_s, elapsed_s, servos.joints[place])
    wanted += turned
    goals = tuple(goal for goal, _ in wanted)
    return JointRequest(goals, tuple(joint.name for joint, (_, ended) in zip(servos.joints, wanted, strict=True) if ended))


def joint_motion(goals_mm: Sequence[float], speeds_mm_s: Sequence[float], servos: ServosConfig) -> Command:
    """The command that goals and speeds of the joints are: the inverse of ``joint_goals``."""
    rotation = servos.places(JointKind.ROTATION)
    bend, pitch = _on_screen(bend_of(goals_mm, servos.tendons), sum(goals_mm[rotation]))
    full_mm, delivery = servos.max_pull_mm, speeds_mm_s[servos.places(JointKind.DELIVERY)]
    return Command(
        bend / full_mm,
        pitch / full_mm,
        sum(speeds_mm_s[servos.places(JointKind.ADVANCE)]),
        sum(delivery) / len(delivery) if delivery else 0.0,
        sum(speeds_mm_s[rotation]),
    )


def in_unit(joint: JointConfig, text: Message) -> Message:
    """A text with millimetres of a joint in the joint's own unit."""
    return text if joint.unit == "mm" else Message(text.replace(" mm", joint.unit))


def within_speeds(command: Command, servos: ServosConfig) -> Command:
    """The command limited to full bend and to the speeds of the joints; 0 for what the robot does not have.

    Raises ValueError when a number is not finite.
    """
    numbers = (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s, command.rotation_deg_s)
    if not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"command is not finite: {command}")

    def fastest(kind: JointKind) -> float:
        return min((joint.max_speed_mm_s for joint in servos.joints if joint.kind is kind), default=0.0)

    return Command(
        bend=limited(command.bend, 1.0),
        pitch=limited(command.pitch, 1.0),
        advance_mm_s=limited(command.advance_mm_s, fastest(JointKind.ADVANCE)),
        delivery_mm_s=limited(command.delivery_mm_s, fastest(JointKind.DELIVERY)),
        rotation_deg_s=limited(command.rotation_deg_s, fastest(JointKind.ROTATION)),
    )


def status_at(positions_mm: Sequence[float], forces_mn: Sequence[float], time_s: float, servos: ServosConfig) -> RobotStatus:
    """The robot's status with its joints at these positions; `forces_mn` of the tendons."""
    delivery = positions_mm[servos.places(JointKind.DELIVERY)]
    return RobotStatus(
        time_s=time_s,
        insertion_mm=sum(positions_mm[servos.places(JointKind.ADVANCE)]),
        delivery_mm=sum(delivery) / len(delivery) if delivery else 0.0,
        tendon_pull_mm=tuple(positions_mm[servos.places(JointKind.TENDON)]),
        tendon_force_mn=tuple(forces_mn),
        rotation_deg=sum(positions_mm[servos.places(JointKind.ROTATION)]),
    )


def bend_of_status(status: RobotStatus, servos: ServosConfig) -> tuple[float, float] | None:
    """Bend and pitch of full pull by a robot's status; None where it is of a robot with another number of tendons."""
    if len(status.tendon_pull_mm) != len(servos.tendons):
        return None
    bend, pitch = _on_screen(bend_of(status.tendon_pull_mm, servos.tendons), status.rotation_deg)
    return bend / servos.max_pull_mm, pitch / servos.max_pull_mm


Bend = tuple[float, float]
"""Pull (mm, or of full pull) to the right and towards the camera."""


def bend_of(pulls_mm: Sequence[float], tendons: Sequence[JointConfig]) -> Bend:
    """The bend by the pulls of the tendons (the first of `pulls_mm`), in the shaft's own directions."""
    if len(tendons) == 3:
        x = y = 0.0
        for pull_mm, joint in zip(pulls_mm, tendons, strict=False):
            across, up = direction(joint)
            x, y = x + pull_mm * across / 1.5, y + pull_mm * up / 1.5
        return x, y
    x = y = 0.0
    for first, joint in _pairs(tendons):
        half_mm = (pulls_mm[first] - pulls_mm[first + 1]) / 2.0
        across, up = direction(joint)
        x, y = x + half_mm * across, y + half_mm * up
    return x, y


def direction(tendon: JointConfig) -> Bend:
    """The unit vector of a tendon's direction."""
    return unit_vector(tendon.angle_deg or 0.0)


def unit_vector(angle_deg: float) -> Bend:
    """Cosine and sine, without rounding for whole quarters of a turn."""
    quarters, rest_deg = divmod(angle_deg, 90.0)
    if rest_deg == 0.0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
    return math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))


def _pairs(tendons: Sequence[JointConfig]) -> Iterator[tuple[int, JointConfig]]:
    """Places and first tendons of the opposite pairs."""
    return ((first, tendons[first]) for first in range(0, len(tendons), 2))


def _in_shaft(command: Command, rotation_deg: float) -> Bend:
    """A command's bend in the directions of a shaft that is turned so far."""
    if rotation_deg == 0.0:
        return limited(command.bend, 1.0), limited(command.pitch, 1.0)
    x, y = unit_vector(rotation_deg)
    bend, pitch = limited(command.bend, 1.0), limited(command.pitch, 1.0)
    return bend * x + pitch * y, pitch * x - bend * y


def _on_screen(bend: Bend, rotation_deg: float) -> Bend:
    """The inverse of ``_in_shaft``."""
    if rotation_deg == 0.0:
        return bend
    x, y = unit_vector(rotation_deg)
    return bend[0] * x - bend[1] * y, bend[0] * y + bend[1] * x


def _turned(command: Command, last_mm: Joints, elapsed_s: float, servos: ServosConfig) -> list[tuple[float, bool]]:
    """The goal of the rotation, empty without one: two tendons are turned into the plane of the bend, others as commanded."""
    place = servos.places(JointKind.ROTATION)
    joints = servos.joints[place]
    if not joints:
        return []
    (at_deg,), tendons = last_mm[place], servos.tendons
    if len(tendons) != 2:
        return _fed([at_deg], command.rotation_deg_s, elapsed_s, joints)
    away_deg = _to_plane(command, at_deg + (tendons[0].angle_deg or 0.0))
    if away_deg is None:
        return _fed([at_deg], command.rotation_deg_s, elapsed_s, joints)
    low_deg, high_deg = joints[0].low_mm, joints[0].high_mm
    ways = sorted((away_deg, away_deg + 180.0, away_deg - 180.0), key=abs)
    way_deg = next((way for way in ways if low_deg <= at_deg + way <= high_deg), ways[0])
    step_deg = limited(way_deg, joints[0].max_speed_mm_s * elapsed_s)
    goal_deg = min(max(at_deg + step_deg, low_deg), high_deg)
    return [(goal_deg, abs(goal_deg - at_deg - step_deg) > _TOUCHING_MM)]


def _to_plane(command: Command, plane_deg: float) -> float | None:
    """How far (-90..90) the plane of two tendons must be turned to be that of the bend; None where that has no direction."""
    if math.hypot(command.bend, command.pitch) < _BEND_TO_TURN:
        return None
    return math.remainder(math.degrees(math.atan2(command.pitch, command.bend)) - plane_deg, 180.0)


def _tendon_goals(bend: Bend, last_mm: Joints, elapsed_s: float, servos: ServosConfig) -> list[tuple[float, bool]]:
    """A bend moves the tendons of a pair against each other at their speed; to the pretension they go together, and slowly.

    So servos that were just switched on pull slack wires tight at ``pretension_mm_s``, whatever the operator does.
    """
    if len(servos.tendons) == 3:
        return _three_goals(bend, last_mm, elapsed_s, servos)
    goals = []
    for first, joint in _pairs(servos.tendons):
        across, up = direction(joint)
        pulling, letting = servos.joints[first], servos.joints[first + 1]
        common_mm, bent_mm = (last_mm[first] + last_mm[first + 1]) / 2.0, (last_mm[first] - last_mm[first + 1]) / 2.0
        fastest_mm_s = min(pulling.max_speed_mm_s, letting.max_speed_mm_s)
        tighter_mm = limited(servos.pretension_mm - common_mm, min(servos.pretension_mm_s, fastest_mm_s) * elapsed_s)
        common_mm += tighter_mm
        asked_mm = limited(bend[0] * across + bend[1] * up, 1.0) * servos.max_pull_mm
        pull_mm = _pair_pull(asked_mm, pulling, letting, common_mm)
        bent_mm += limited(pull_mm - bent_mm, fastest_mm_s * elapsed_s - abs(tighter_mm))
        goals += [(common_mm + bent_mm, pull_mm != asked_mm), (common_mm - bent_mm, pull_mm != asked_mm)]
    return goals


def _three_goals(bend: Bend, last_mm: Joints, elapsed_s: float, servos: ServosConfig) -> list[tuple[float, bool]]:
    """The same of three tendons: what each of them may pull or let go limits the bend of all, in its direction."""
    tendons = servos.tendons
    last = last_mm[: len(tendons)]
    fastest_mm_s = min(joint.max_speed_mm_s for joint in tendons)
    common_mm = sum(last) / len(last)
    tighter_mm = limited(servos.pretension_mm - common_mm, min(servos.pretension_mm_s, fastest_mm_s) * elapsed_s)
    bent = [at - common_mm for at in last]
    common_mm += tighter_mm
    size = max(1.0, math.hypot(*bend))
    asked = [(bend[0] * x + bend[1] * y) / size * servos.max_pull_mm for x, y in map(direction, tendons)]
    rooms = [
        max(0.0, joint.high_mm - common_mm if pull_mm > 0.0 else common_mm - joint.low_mm)
        for pull_mm, joint in zip(asked, tendons, strict=True)
    ]
    share = min((room / abs(pull_mm) for pull_mm, room in zip(asked, rooms, strict=True) if pull_mm), default=1.0)
    ended, share = share < 1.0, min(1.0, share)
    ways = [share * pull_mm - at for pull_mm, at in zip(asked, bent, strict=True)]
    reach_mm, longest_mm = fastest_mm_s * elapsed_s - abs(tighter_mm), max(map(abs, ways))
    part = min(1.0, reach_mm / longest_mm) if longest_mm > 0.0 else 0.0
    return [(common_mm + at + part * way, ended) for at, way in zip(bent, ways, strict=True)]


def _pair_pull(asked_mm: float, one: JointConfig, other: JointConfig, common_mm: float) -> float:
    """One tendon pulls as far as the other lets go, within the envelope of both, so that no wire hangs slack."""
    most_mm = max(0.0, min(one.high_mm - common_mm, common_mm - other.low_mm))
    least_mm = min(0.0, max(one.low_mm - common_mm, common_mm - other.high_mm))
    return min(max(asked_mm, least_mm), most_mm)


def _fed(last_mm: Sequence[float], speed_mm_s: float, elapsed_s: float, joints: Sequence[JointConfig]) -> list[tuple[float, bool]]:
    """Joints that move the same catheter move equally: where one of them must stop, all of them do. Empty without joints."""
    if not joints:
        return []
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

    The goal is inside envelope and step. It lies further from `last_mm` than the speed allows only when the joint was moved
    away from its goal; the gate then rejects it.

    Parameters
    ----------
    last_mm, speed_mm_s : last goal, inside the envelope, and its speed.
    passed_s : time since the last goal.
    margin_speed_share : of the full speed, on the way outwards inside the warn margin.
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
    if not goals:
        return []
    steps = [goal - last for (goal, _), last in zip(goals, last_mm, strict=True)]
    common_mm = max(0.0, min(steps)) + min(0.0, max(steps))  # forwards or backwards; neither where they would part
    found: list[Goal] = []
    for (goal_mm, limit), last, at_mm, joint in zip(goals, last_mm, measured_mm, joints, strict=True):
        low_mm, high_mm = joint_room(at_mm, joint)
        kept_mm = min(max(last + common_mm, low_mm), high_mm)
        found.append((kept_mm, Limit.TOGETHER) if abs(kept_mm - goal_mm) > _ROUNDING_MM else (goal_mm, limit))
    return found
