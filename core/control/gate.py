"""The gate: nothing goes to the servos but what the pure function ``gate_step`` returns.

*Rejected* is what no honest source asks for (``joints.joint_goals`` is the honest one: it starts from the goals that were sent
last, and keeps within speed and envelope), since a clamp would hide the fault and still move the robot: numbers that are not
finite, wrong counts, times from the future, anything stale, goals more than one position unit beyond the envelope, and goals
further from the last one than the joint can travel at full speed while a command is valid (``command_max_age_s``). Every
rejection holds all joints.

*Limited*, and recorded, is what timing, lag and inertia of an honest run produce: a step longer than this tick allows at the
joint's speed and acceleration or inside the warn margin, a rounding error at the envelope's end, and a goal further than
``max_step_mm`` from the measured position, which happens whenever a servo lags. Joints that move the same catheter share the
tightest limit of one of them. The acceleration bounds how a joint gets faster, never how it slows down or stops; when the servo
falls behind, the goal goes back towards it at up to full speed.

A hold is the measured position, taken once when the hold begins and kept while the joint stays within ``max_step_mm`` of it:
writing each measured position would let a loaded tendon creep, as every servo rests a little short of its goal. Without valid
positions nothing is sent; the servos then keep their last goal, which was within one step of them.

A feed below the low end of its envelope is not out of bounds (further than a step it is while the program drives): it stays there,
or comes back slowly. While the operator holds its retraction that was begun at the end, it goes on backwards, slowly
(``joints.by_hand``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from core.config.safety import JointKind, JointName, SafetyConfig, ServosConfig
from core.control.joints import (
    Goal,
    Joints,
    Limit,
    Retracted,
    SentGoals,
    by_hand,
    by_program,
    in_unit,
    joint_room,
    limited_goal,
    together,
)
from core.messages import message


class Source(StrEnum):
    """The source of a motion."""

    OPERATOR = "operator"
    PROGRAM = "program"


class RejectReason(StrEnum):
    """Why the gate rejected a request."""

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
    """Requested goals (mm). ``captured_s`` is the capture of the frame behind them; the operator's need none.

    ``retracts``: the feeds whose retraction the operator has begun at the low end of their envelope: they may go beyond it.
    """

    goals_mm: Sequence[float]
    source: Source
    issued_s: float
    captured_s: float | None = None
    retracts: Retracted = Retracted.NONE


@dataclass(frozen=True, slots=True)
class JointMeasurement:
    """Positions of the joints (mm), and when they were read."""

    positions_mm: Sequence[float]
    measured_s: float


@dataclass(frozen=True, slots=True)
class Rejection:
    """No part of the request is followed. ``detail`` adds the joint, or the measured value and its threshold."""

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


def malformed(request: GoalRequest | None, now_s: float, servos: ServosConfig) -> Rejection | None:
    if request is None:
        return None
    if (wrong := _not_all_numbers(request.goals_mm, servos)) is not None:
        return wrong
    times = [request.issued_s] if request.captured_s is None else [request.issued_s, request.captured_s]
    if not all(math.isfinite(time_s) for time_s in times):
        return Rejection(RejectReason.NON_FINITE, "time of the command")
    if max(times) > now_s:
        return Rejection(RejectReason.FROM_THE_FUTURE, f"command, by {max(times) - now_s:.3f} s")
    return None


def _not_all_numbers(values: Sequence[float], servos: ServosConfig) -> Rejection | None:
    if len(values) != len(servos.joints):
        return Rejection(RejectReason.WRONG_COUNT, f"{len(values)} instead of {len(servos.joints)}")
    for joint, value in zip(servos.joints, values, strict=True):
        if not math.isfinite(value):
            return Rejection(RejectReason.NON_FINITE, joint.name)
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


def measurement_problem(
    measurement: JointMeasurement | None, now_s: float, servos: ServosConfig, safety: SafetyConfig
) -> Rejection | None:
    """Why the measured positions are not valid; None: they are."""
    if measurement is None:
        return Rejection(RejectReason.NO_MEASUREMENT)
    if (wrong := _not_all_numbers(measurement.positions_mm, servos)) is not None:
        return replace(wrong, detail=message("measured position: {what}", what=wrong.detail))
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
    """The joints too far outside their envelope to come back in one bounded step, with their positions."""
    found = []
    for joint, position_mm in zip(servos.joints, positions_mm, strict=True):
        low_mm, high_mm = joint_room(position_mm, joint)
        if low_mm > high_mm:
            text = message(
                "{joint} at {a:.2f} mm ({b:g} to {c:g} mm)", joint=joint.name, a=position_mm, b=joint.low_mm, c=joint.high_mm
            )
            found.append(in_unit(joint, text))
    return tuple(found)


def too_far(request: GoalRequest, base_mm: Joints, servos: ServosConfig, safety: SafetyConfig) -> Rejection | None:
    """Goals that no honest source asks for: beyond the envelope, or further than the joint travels while a command is valid."""
    for joint, goal_mm, from_mm in zip(servos.joints, request.goals_mm, base_mm, strict=True):
        rounding_mm = abs(1.0 / joint.ticks_per_mm)
        if not joint.low_mm - rounding_mm <= goal_mm <= joint.high_mm + rounding_mm:
            detail = message(
                "{joint} to {a:.2f} mm ({b:g} to {c:g} mm)", joint=joint.name, a=goal_mm, b=joint.low_mm, c=joint.high_mm
            )
            return Rejection(RejectReason.OUT_OF_ENVELOPE, in_unit(joint, detail))
        most_mm = joint.max_speed_mm_s * safety.command_max_age_s
        if abs(goal_mm - from_mm) > most_mm + rounding_mm:
            detail = message("{joint} by {a:.2f} mm (at most {b:g} mm)", joint=joint.name, a=abs(goal_mm - from_mm), b=most_mm)
            return Rejection(RejectReason.OVER_RATE, in_unit(joint, detail))
    return None


_RECORDED_MM = 1e-9  # smaller differences are rounding errors


@dataclass(frozen=True, slots=True)
class Clamp:
    """One joint's goal was limited; ``limit`` is the tightest of the limits."""

    joint: JointName
    asked_mm: float
    allowed_mm: float
    limit: Limit


@dataclass(frozen=True, slots=True)
class GateState:
    """State of the gate. ``goals_mm`` are the last goals that left it; ``speeds_mm_s`` theirs, empty at rest."""

    time_s: float | None = None
    goals_mm: Joints | None = None
    speeds_mm_s: Joints = ()
    moving: bool = False
    issued_s: float | None = None

    @property
    def sent(self) -> SentGoals | None:
        """Where the next command starts; None when a new motion must start from the measured positions."""
        if not self.moving or self.goals_mm is None or self.time_s is None:
            return None
        return SentGoals(self.goals_mm, self.time_s)


@dataclass(frozen=True, slots=True)
class GateStep:
    """Result of a tick: the goals to write (None: write nothing), and why they differ from the requested ones."""

    goals_mm: Joints | None
    state: GateState
    rejection: Rejection | None = None
    clamps: tuple[Clamp, ...] = ()

    @property
    def is_hold(self) -> bool:
        return self.rejection is not None


def gate_step(
    state: GateState,
    request: GoalRequest | None,
    measurement: JointMeasurement | None,
    permitted: Source | None,
    now_s: float,
    servos: ServosConfig,
    safety: SafetyConfig,
) -> GateStep:
    """One tick of the gate.

    Returns either a rejection with a hold, or goals of all joints inside every limit, with a record of what was limited.

    Parameters
    ----------
    state : as returned by the last tick.
    request, measurement : the newest ones, or None.
    permitted : the source that the supervisor permits now.
    now_s : monotonic clock of the frames and commands.
    """
    if measurement is not None and _not_all_numbers(measurement.positions_mm, servos) is None:
        if permitted is Source.PROGRAM:
            servos = by_program(servos, measurement.positions_mm, state.sent)
        else:
            retracts = request.retracts if request is not None and request.source is Source.OPERATOR else Retracted.NONE
            servos = by_hand(servos, measurement.positions_mm, state.sent, retracts=retracts)
    mistrust = measurement_problem(measurement, now_s, servos, safety)
    believed = tuple(measurement.positions_mm) if measurement is not None and mistrust is None else None
    objection = (
        clock_objection(state.time_s, now_s, safety)
        or malformed(request, now_s, servos)
        or not_permitted(request, permitted)
        or stale(request, state.issued_s, now_s, safety)
        or mistrust
    )
    if objection is not None or request is None or believed is None:
        return _hold(state, believed, now_s, objection or Rejection(RejectReason.NO_COMMAND), servos)
    base = state.sent or SentGoals(_inside(believed, servos), now_s)
    if (far := too_far(request, base.goals_mm, servos, safety)) is not None:
        return _hold(state, believed, now_s, far, servos)
    if state.sent is None:
        return _entry(request, base, now_s, servos)
    return _move(state, base, request, believed, now_s, servos, safety)


def _entry(request: GoalRequest, base: SentGoals, now_s: float, servos: ServosConfig) -> GateStep:
    """The first goals of a motion are the measured positions, whatever is asked for."""
    clamps = tuple(
        Clamp(joint.name, asked, goal, Limit.ENTRY)
        for joint, asked, goal in zip(servos.joints, request.goals_mm, base.goals_mm, strict=True)
        if abs(asked - goal) > _RECORDED_MM
    )
    return GateStep(base.goals_mm, GateState(now_s, base.goals_mm, moving=True, issued_s=request.issued_s), clamps=clamps)


def _move(
    state: GateState,
    base: SentGoals,
    request: GoalRequest,
    measured_mm: Joints,
    now_s: float,
    servos: ServosConfig,
    safety: SafetyConfig,
) -> GateStep:
    passed_s = min(now_s - base.time_s, safety.command_max_age_s)
    speeds = state.speeds_mm_s or (0.0,) * len(servos.joints)
    limited: list[Goal] = [
        limited_goal(asked_mm, from_mm, speed_mm_s, at_mm, passed_s, joint, safety.margin_speed_share)
        for asked_mm, from_mm, speed_mm_s, at_mm, joint in zip(
            request.goals_mm, base.goals_mm, speeds, measured_mm, servos.joints, strict=True
        )
    ]
    pair = servos.places(JointKind.DELIVERY)  # joints of one catheter: driven apart they would stretch or buckle it
    limited[pair] = together(limited[pair], base.goals_mm[pair], measured_mm[pair], servos.joints[pair])
    goals: list[float] = []
    clamps: list[Clamp] = []
    for place, (joint, (goal_mm, limit)) in enumerate(zip(servos.joints, limited, strict=True)):
        asked_mm, from_mm, at_mm = request.goals_mm[place], base.goals_mm[place], measured_mm[place]
        if abs(goal_mm - from_mm) > joint.max_speed_mm_s * passed_s + _RECORDED_MM:
            detail = message("{joint} at {a:.2f} mm, sent to {b:.2f} mm", joint=joint.name, a=at_mm, b=from_mm)
            return _hold(state, measured_mm, now_s, Rejection(RejectReason.OFF_COURSE, in_unit(joint, detail)), servos)
        goals.append(goal_mm)
        if limit is not None and abs(asked_mm - goal_mm) > _RECORDED_MM:
            clamps.append(Clamp(joint.name, asked_mm, goal_mm, limit))
    if passed_s > 0.0:
        speeds = tuple((goal - old) / passed_s for goal, old in zip(goals, base.goals_mm, strict=True))
    return GateStep(tuple(goals), GateState(now_s, tuple(goals), speeds, True, request.issued_s), clamps=tuple(clamps))


def _inside(positions_mm: Joints, servos: ServosConfig) -> Joints:
    """The positions, clipped to the envelope; that is one bounded step at most."""
    return tuple(min(max(at, joint.low_mm), joint.high_mm) for at, joint in zip(positions_mm, servos.joints, strict=True))


def _hold(state: GateState, measured_mm: Joints | None, now_s: float, why: Rejection, servos: ServosConfig) -> GateStep:
    time_s = now_s if math.isfinite(now_s) else state.time_s
    # times from before the clock went back do not count
    issued_s = None if why.reason is RejectReason.CLOCK_WENT_BACK else state.issued_s
    held_mm = None if state.moving else state.goals_mm
    if measured_mm is None:
        return GateStep(None, GateState(time_s, held_mm, issued_s=issued_s), why)
    if held_mm is None or not _near(held_mm, measured_mm, servos):
        held_mm = _inside(measured_mm, by_program(servos, measured_mm, None))
    return GateStep(held_mm, GateState(time_s, held_mm, issued_s=issued_s), why)


def _near(goals_mm: Joints, measured_mm: Joints, servos: ServosConfig) -> bool:
    pairs = zip(servos.joints, goals_mm, measured_mm, strict=True)
    return all(abs(goal - at) <= joint.max_step_mm for joint, goal, at in pairs)
