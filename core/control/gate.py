"""The one gate: nothing goes to the servos but what this pure function returns.

Two kinds of excess are told apart by whether an honest source can produce them (``joints.joint_goals`` is the honest source: it
starts from the goals that were sent last, and keeps within speed and envelope).

*Rejected*, because no honest source asks for it, and a clamp would hide the fault and still move the robot: numbers that are not
finite, wrong counts, times from the future, anything stale, goals more than one position unit beyond the envelope, and goals
farther from the last one than the joint can travel at full speed while a command is valid (``command_max_age_s``). The answer to
every rejection is a hold of all seven joints.

*Limited*, and put on record, because timing, lag and inertia of an honest run do produce it: a step longer than this tick allows at
the joint's speed and acceleration or inside the warn margin, a rounding error at the envelope's end, and a goal farther than
``max_step_mm`` from the measured position, which happens whenever a servo lags. Joints that move the same catheter share the
tightest limit of one of them.

No limit ever keeps a joint moving: the acceleration bounds how a joint gets faster, never how it slows down or stops; and when the
servo falls behind, the goal goes back towards it at up to full speed.

A hold is the measured position, taken once when the hold begins and then kept while the joint stays within ``max_step_mm`` of it:
writing the measured position again and again would let a loaded tendon creep, as every servo rests a little short of its goal.
Without believable positions nothing is sent; the servos then keep their last goal, which was within one step of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from core.control import gate_checks as checks
from core.control.gate_checks import GoalRequest, Measurement, Rejection, RejectReason, Source
from core.control.joint_limits import Goal, Limit, limited_goal, together
from core.control.joints import ONE_CATHETER, Joints, SentGoals
from core.safety_config import SafetyConfig
from core.servo_config import JOINT_NAMES, JointName, ServosConfig

__all__ = ["Clamp", "GateState", "GateStep", "GoalRequest", "Measurement", "RejectReason", "Rejection", "Source", "gate_step"]

_AT_REST: Joints = (0.0,) * len(JOINT_NAMES)
_RECORDED_MM = 1e-9  # smaller differences are the arithmetic's


@dataclass(frozen=True, slots=True)
class Clamp:
    """One joint's goal was limited; ``limit`` is the tightest of the limits."""

    joint: JointName
    asked_mm: float
    allowed_mm: float
    limit: Limit


@dataclass(frozen=True, slots=True)
class GateState:
    """What the gate remembers from one tick to the next. ``goals_mm`` are the last goals that left it."""

    time_s: float | None = None
    goals_mm: Joints | None = None
    speeds_mm_s: Joints = _AT_REST
    moving: bool = False
    issued_s: float | None = None

    @property
    def sent(self) -> SentGoals | None:
        """Where the next command starts from; None when a new motion must start from the measured positions."""
        if not self.moving or self.goals_mm is None or self.time_s is None:
            return None
        return SentGoals(self.goals_mm, self.time_s)


@dataclass(frozen=True, slots=True)
class GateStep:
    """What leaves the gate: the goals to write (None: write nothing), and why they are not what was asked for."""

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
    measurement: Measurement | None,
    permitted: Source | None,
    now_s: float,
    servos: ServosConfig,
    safety: SafetyConfig,
) -> GateStep:
    """One tick of the gate.

    Parameters
    ----------
    state : the state that the last tick returned.
    request : the newest command's goals; None when there is none.
    measurement : the newest positions; None when none were read yet.
    permitted : whose commands the supervisor lets through now; None: nobody's.
    now_s : monotonic clock of the frames and commands.

    Returns
    -------
    GateStep
        Either a rejection with a hold, or seven goals inside every limit, with a record of what was limited.
    """
    mistrust = checks.mistrust(measurement, now_s, servos, safety)
    believed = tuple(measurement.positions_mm) if measurement is not None and mistrust is None else None
    objection = (
        checks.clock_objection(state.time_s, now_s, safety)
        or checks.malformed(request, now_s)
        or checks.not_permitted(request, permitted)
        or checks.stale(request, state.issued_s, now_s, safety)
        or mistrust
    )
    if objection is not None or request is None or believed is None:
        return _hold(state, believed, now_s, objection or Rejection(RejectReason.NO_COMMAND), servos)
    base = state.sent or SentGoals(_inside(believed, servos), now_s)
    if (far := checks.too_far(request, base.goals_mm, servos, safety)) is not None:
        return _hold(state, believed, now_s, far, servos)
    if state.sent is None:
        return _entry(request, base, now_s)
    return _move(state, base, request, believed, now_s, servos, safety)


def _entry(request: GoalRequest, base: SentGoals, now_s: float) -> GateStep:
    """The first goals of a motion are the measured positions, whatever is asked for."""
    clamps = tuple(
        Clamp(name, asked, goal, Limit.ENTRY)
        for name, asked, goal in zip(JOINT_NAMES, request.goals_mm, base.goals_mm, strict=True)
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
    limited: list[Goal] = [
        limited_goal(asked_mm, from_mm, speed_mm_s, at_mm, passed_s, joint, safety.margin_speed_share)
        for asked_mm, from_mm, speed_mm_s, at_mm, joint in zip(
            request.goals_mm, base.goals_mm, state.speeds_mm_s, measured_mm, servos.joints, strict=True
        )
    ]
    pair = ONE_CATHETER
    limited[pair] = together(limited[pair], base.goals_mm[pair], measured_mm[pair], servos.joints[pair])
    goals: list[float] = []
    clamps: list[Clamp] = []
    for place, (joint, (goal_mm, limit)) in enumerate(zip(servos.joints, limited, strict=True)):
        asked_mm, from_mm, at_mm = request.goals_mm[place], base.goals_mm[place], measured_mm[place]
        if abs(goal_mm - from_mm) > joint.max_speed_mm_s * passed_s + _RECORDED_MM:
            detail = f"{joint.name} at {at_mm:.2f} mm, sent to {from_mm:.2f} mm"
            return _hold(state, measured_mm, now_s, Rejection(RejectReason.OFF_COURSE, detail), servos)
        goals.append(goal_mm)
        if limit is not None and abs(asked_mm - goal_mm) > _RECORDED_MM:
            clamps.append(Clamp(joint.name, asked_mm, goal_mm, limit))
    speeds = state.speeds_mm_s
    if passed_s > 0.0:
        speeds = tuple((goal - old) / passed_s for goal, old in zip(goals, base.goals_mm, strict=True))
    return GateStep(tuple(goals), GateState(now_s, tuple(goals), speeds, True, request.issued_s), clamps=tuple(clamps))


def _inside(positions_mm: Joints, servos: ServosConfig) -> Joints:
    """The positions, those just outside the envelope brought to its end; that is one bounded step at most."""
    return tuple(min(max(at, joint.low_mm), joint.high_mm) for at, joint in zip(positions_mm, servos.joints, strict=True))


def _hold(state: GateState, measured_mm: Joints | None, now_s: float, why: Rejection, servos: ServosConfig) -> GateStep:
    time_s = now_s if math.isfinite(now_s) else state.time_s
    # on a new time line the times of the old one say nothing
    issued_s = None if why.reason is RejectReason.CLOCK_WENT_BACK else state.issued_s
    held_mm = None if state.moving else state.goals_mm
    if measured_mm is None:
        return GateStep(None, GateState(time_s, held_mm, issued_s=issued_s), why)
    if held_mm is None or not _near(held_mm, measured_mm, servos):
        held_mm = _inside(measured_mm, servos)
    return GateStep(held_mm, GateState(time_s, held_mm, issued_s=issued_s), why)


def _near(goals_mm: Joints, measured_mm: Joints, servos: ServosConfig) -> bool:
    pairs = zip(servos.joints, goals_mm, measured_mm, strict=True)
    return all(abs(goal - at) <= joint.max_step_mm for joint, goal, at in pairs)
