"""The mode machine: which source may drive, and why not.

ADVISORY: the operator drives, the program advises. ARMED: the same, and control may be handed over to the program. AUTONOMOUS: the
program drives while the deadman is held. HOLD: an autonomous motion is interrupted. STOPPED: nothing moves, latched.

Arming arms the *program*. The operator drives by hand in ADVISORY, too, as soon as the servos were checked: they must be able to
bring back a robot that perception lost. So a fault of camera or perception never takes the hand controls away, one of the servos
always does. Settings that loosen what a LIVE rig needs disarm it.

In one tick, in whatever order its events come: an acknowledgement is handled first and never clears what the same tick reports;
every report counts, even when a later one in the tick is better; faults take effect; then requests, the more careful ones last; and
the operator's input comes last of all and ends autonomy. Only a stop beats it.

Nothing re-arms itself: only a request of the operator leads out of ADVISORY and STOPPED. HOLD alone clears itself, within
``hold_clear_s`` and with the deadman held; later it needs another hand-over.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence, Set
from dataclasses import replace

from core.config.safety import SafetyConfig, ServosConfig
from core.control.camera_monitor import RouteState
from core.control.direction_monitor import DirectionMonitor
from core.control.faults import Area, Cause, Fault, Reaction, first_fault, worst
from core.control.gate import Source
from core.control.health import DeadmanReport, Health, Report
from core.control.modes import (
    ARMED_MODES,
    DRIVING_MODES,
    Act,
    AgainstProgram,
    Decision,
    Event,
    Hindrance,
    Mode,
    RequestRefused,
    SupervisorState,
)


def supervise(
    state: SupervisorState, events: Sequence[Event], now_s: float, servos: ServosConfig, safety: SafetyConfig
) -> tuple[SupervisorState, Decision]:
    """One tick, at least every 20 ms: the state after `events`, in any order, and the decision. `now_s` is the frames' clock."""
    were_on = state.health.servos_ready
    state, now_s, clock = _read_clock(state, now_s, safety)
    acts = {event for event in events if isinstance(event, Act)}
    if Act.ACKNOWLEDGE in acts:
        if state.mode is Mode.STOPPED:  # nothing moves by an acknowledgement, whatever was checked meanwhile
            state = replace(state, mode=Mode.ADVISORY, health=replace(state.health, servo_problems=None))
        state = replace(state, latched=None)
    reports = [event for event in events if not isinstance(event, Act | AgainstProgram)]
    for event in events:
        if isinstance(event, AgainstProgram):
            state = replace(state, against_program=event.hindrances)
    before = state.active
    health, active = _collect_faults(state, reports, now_s, servos, safety)
    stop = [Fault(Cause.STOP_PRESSED)] if Act.STOP in acts else []
    if stop:  # the hand that presses it leaves the deadman, which no longer matters
        active = tuple(fault for fault in active if fault.cause is not Cause.DEADMAN)
    in_use = were_on or health.servos_ready
    state = _react(replace(state, health=health, active=(*stop, *clock, *active)), in_use, now_s, safety)
    refused = []
    if state.mode in ARMED_MODES and state.against_program:
        refused.append(RequestRefused(Act.HAND_OVER, state.against_program))
        state = replace(state, mode=Mode.ADVISORY, health=state.health.disarmed())
    if Act.ACKNOWLEDGE in acts and state.latched is not None:
        refused.append(RequestRefused(Act.ACKNOWLEDGE, (state.latched.cause,)))
    state, denied = _handle_requests(state, acts, now_s, safety)
    if state.mode is not Mode.AUTONOMOUS:
        state = replace(state, health=state.health.not_driven())
    return state, _decide(state, before, (*refused, *denied), now_s, safety)


def _read_clock(state: SupervisorState, now_s: float, safety: SafetyConfig) -> tuple[SupervisorState, float, list[Fault]]:
    """The state at `now_s`. A jump of the clock invalidates all times: everything known but the model's check is reset."""
    if math.isfinite(now_s) and state.time_s is None:
        return replace(state, time_s=now_s, camera_unwell_s=now_s, perception_unwell_s=now_s), now_s, []
    last_s = state.time_s if state.time_s is not None else 0.0
    if 0.0 <= now_s - last_s <= safety.clock_gap_s:
        return replace(state, time_s=now_s), now_s, []
    known_s = now_s if math.isfinite(now_s) else last_s
    fresh = replace(
        state,
        time_s=known_s if math.isfinite(now_s) else state.time_s,
        health=Health(model=state.health.model, estop_pressed=state.health.estop_pressed),
        camera_unwell_s=known_s,
        perception_unwell_s=known_s,
        input_s=None,
        resumed_s=None,
    )
    return fresh, known_s, [Fault(Cause.CLOCK, f"from {last_s:.3f} s to {now_s:.3f} s")]


def _collect_faults(
    state: SupervisorState, reports: Sequence[Report], now_s: float, servos: ServosConfig, safety: SafetyConfig
) -> tuple[Health, tuple[Fault, ...]]:
    """The health after all reports, and the faults that are active then or were in between."""
    driving = state.mode in DRIVING_MODES

    def faults(health: Health) -> dict[Cause, Fault]:
        return {fault.cause: fault for fault in health.faults(now_s, servos, safety, driving=driving)}

    health = replace(state.health, reported=())
    active = faults(health)
    brought: dict[Cause, Fault] = {}
    for report in reports:
        health = health.update(report, armed=state.mode in ARMED_MODES, now_s=now_s, servos=servos, safety=safety)
        before, active = active, faults(health)
        brought |= {cause: fault for cause, fault in active.items() if cause not in before}
        # another one may be held, as of when this was said: in a late tick that one's next report is still to come
        is_let_go = isinstance(report, DeadmanReport) and not (report.pressed or health.deadman_held(report.at_s(now_s), safety))
        if driving and is_let_go:
            brought[Cause.DEADMAN] = Fault(Cause.DEADMAN)
    return health, tuple((brought | active).values())


def _react(state: SupervisorState, in_use: bool, now_s: float, safety: SafetyConfig) -> SupervisorState:
    """The state after the active faults took effect. Servos not `in_use` hinder arming, but there is nothing to stop.

    A pressed E-stop is latched all the same: it must be released, and then acknowledged.
    """
    state = _note_unwell(state, now_s)
    faults = tuple(f for f in state.active if in_use or f.cause.area is not Area.SERVOS or f.cause is Cause.ESTOP_PRESSED)
    recheck = any(fault.cause.recheck for fault in state.active)
    stop, disarm = worst(faults, Reaction.STOP), worst(faults, Reaction.DISARM)
    if state.mode is Mode.ADVISORY:
        # a jump of the clock resets what is known of the servos: they are off, and the operator is told
        told = (fault for fault in faults if fault.cause.area is Area.SERVOS or (in_use and fault.cause is Cause.CLOCK))
        disarm = worst(tuple(told), Reaction.DISARM)
    if stop is not None:
        state, recheck = _leave(state, Mode.STOPPED, stop), True
    elif disarm is not None and state.mode is not Mode.STOPPED:
        state = _leave(state, Mode.ADVISORY, disarm)
    elif state.mode is Mode.AUTONOMOUS and any(fault.holds for fault in faults):
        # soon after the last one it is the same hold, or one with a fault that comes and goes would never expire
        again = state.resumed_s is not None and now_s - state.resumed_s < safety.hold_repeat_s
        state = replace(state, mode=Mode.HOLD, hold_since_s=state.hold_since_s if again else now_s, well_since_s=None)
    elif state.mode is Mode.HOLD:
        state = _clear_hold(state, now_s, safety)
    if recheck:
        state = replace(state, health=replace(state.health, servo_problems=None))
    if state.mode in ARMED_MODES and not state.health.servos_ready:
        # no fault: the operator's request requires a check of the servos
        state = replace(state, mode=Mode.ADVISORY, health=state.health.disarmed())
    return state


def _note_unwell(state: SupervisorState, now_s: float) -> SupervisorState:
    areas = {fault.cause.area for fault in state.active if fault.holds}
    if Area.CAMERA in areas:
        state = replace(state, camera_unwell_s=now_s)
    if Area.PERCEPTION in areas or state.health.frames.unsure or not state.health.frames.well:
        state = replace(state, perception_unwell_s=now_s)
    return state


def _leave(state: SupervisorState, mode: Mode, fault: Fault) -> SupervisorState:
    """Out of autonomy; the first cause is kept."""
    return replace(state, mode=mode, health=state.health.disarmed(), latched=state.latched or fault)


def _clear_hold(state: SupervisorState, now_s: float, safety: SafetyConfig) -> SupervisorState:
    """Back to autonomy when all was well for the dwell time, soon enough after the hold began."""
    if any(fault.holds for fault in state.active):
        return replace(state, well_since_s=None)
    since_s = state.well_since_s if state.well_since_s is not None else now_s
    if now_s - since_s >= safety.hold_dwell_s and not _hold_expired(state, now_s, safety):
        return replace(state, mode=Mode.AUTONOMOUS, resumed_s=now_s)
    return replace(state, well_since_s=since_s)


def _hold_expired(state: SupervisorState, now_s: float, safety: SafetyConfig) -> bool:
    return state.mode is Mode.HOLD and now_s - state.hold_since_s > safety.hold_clear_s


def _handle_requests(
    state: SupervisorState, acts: Set[Act], now_s: float, safety: SafetyConfig
) -> tuple[SupervisorState, tuple[RequestRefused, ...]]:
    """The state after the operator's requests, and the refused ones."""
    refused = []
    if Act.INPUT in acts:
        state = replace(state, input_s=now_s)
    for act, against, mode in ((Act.ARM, _against_arming, Mode.ARMED), (Act.HAND_OVER, _against_hand_over, Mode.AUTONOMOUS)):
        if act in acts:
            if reasons := against(state, now_s, safety):
                refused.append(RequestRefused(act, reasons))
            else:
                state = replace(state, mode=mode, resumed_s=None, health=replace(state.health, direction=DirectionMonitor()))
    if state.mode in DRIVING_MODES and not acts.isdisjoint({Act.INPUT, Act.TAKE_BACK}):
        state = replace(state, mode=Mode.ARMED)
    if state.mode in ARMED_MODES and Act.DISARM in acts:
        state = replace(state, mode=Mode.ADVISORY, health=state.health.disarmed())
    return state, tuple(refused)


def _against_arming(state: SupervisorState, now_s: float, safety: SafetyConfig) -> tuple[Hindrance | Cause, ...]:
    reasons: list[Hindrance | Cause] = []
    if state.mode is Mode.STOPPED:
        reasons.append(Hindrance.IS_STOPPED)
    if state.mode in ARMED_MODES:
        reasons.append(Hindrance.ALREADY_ARMED)
    if state.latched is not None:
        reasons.append(Hindrance.UNACKNOWLEDGED)
    active = [fault for fault in state.active if fault.holds]
    reasons += _reasons(state, active)
    areas = {fault.cause.area for fault in active}
    if Area.CAMERA not in areas and now_s - state.camera_unwell_s < safety.healthy_s:
        reasons.append(Hindrance.CAMERA_SETTLING)
    if Area.PERCEPTION not in areas and now_s - state.perception_unwell_s < safety.healthy_s:
        reasons.append(Hindrance.PERCEPTION_SETTLING)
    if state.health.servo_problems is None:
        reasons.append(Hindrance.SERVOS_UNCHECKED)
    return (*reasons, *state.against_program)


def _reasons(state: SupervisorState, active: Collection[Fault]) -> list[Hindrance | Cause]:
    """The active faults as reasons against a request; a pose is not lost, but waited for, before perception said anything."""
    is_first = state.health.frames.newest is None
    return [Hindrance.PERCEPTION_SETTLING if is_first and one.cause is Cause.POSE_LOST else one.cause for one in active]


def _against_hand_over(state: SupervisorState, now_s: float, safety: SafetyConfig) -> tuple[Hindrance | Cause, ...]:
    reasons: list[Hindrance | Cause] = []
    if state.mode is Mode.STOPPED:
        reasons.append(Hindrance.IS_STOPPED)
    if state.mode is Mode.ADVISORY:
        reasons.append(Hindrance.NOT_YET_ARMED)
    if state.mode is Mode.AUTONOMOUS:
        reasons.append(Hindrance.ALREADY_AUTONOMOUS)
    if state.health.servo_problems is None:
        reasons.append(Hindrance.SERVOS_UNCHECKED)
    reasons += _reasons(state, [fault for fault in state.active if fault.holds and fault.cause.area is not Area.OPERATOR])
    if state.health.frames.route is RouteState.NONE:
        reasons.append(Hindrance.NO_TARGET)
    if state.health.frames.route is RouteState.BEHIND:
        reasons.append(Hindrance.TARGET_BEHIND)
    if state.health.only_weak_held(now_s, safety):
        reasons.append(Hindrance.DEADMAN_ON_KEYBOARD)
    elif not state.health.deadman_held(now_s, safety):
        down = state.health.deadman_down(now_s, safety)
        reasons.append(Hindrance.DEADMAN_HELD_BEFORE if down else Hindrance.DEADMAN_NOT_HELD)
    if state.input_s is not None and now_s - state.input_s < safety.operator_quiet_s:
        reasons.append(Hindrance.OPERATOR_DRIVING)
    return (*reasons, *state.against_program)


def hindrances(
    state: SupervisorState, now_s: float, safety: SafetyConfig
) -> tuple[tuple[Hindrance | Cause, ...], tuple[Hindrance | Cause, ...]]:
    """Why arming, and why a hand-over, would be refused now; without the deadman, which is pressed with the hand-over."""
    deadman = {Hindrance.DEADMAN_NOT_HELD, Hindrance.DEADMAN_HELD_BEFORE, Hindrance.DEADMAN_ON_KEYBOARD}
    over = _against_hand_over(state, now_s, safety)
    return _against_arming(state, now_s, safety), tuple(reason for reason in over if reason not in deadman)


def _decide(
    state: SupervisorState, before: Collection[Fault], refused: tuple[RequestRefused, ...], now_s: float, safety: SafetyConfig
) -> Decision:
    known = {fault.cause for fault in before}
    blank = [fault for fault in state.active if fault.holds and fault.cause.area in {Area.CAMERA, Area.PERCEPTION}]
    return Decision(
        mode=state.mode,
        permitted=_permitted(state),
        blanked=first_fault(blank) or (Fault(Cause.CONFIDENCE_LOW) if state.health.frames.unsure else None),
        hold_expired=_hold_expired(state, now_s, safety),
        latched=state.latched,
        active=state.active,
        raised=tuple(fault for fault in state.active if fault.cause not in known),
        refused=refused,
    )


def _permitted(state: SupervisorState) -> Source | None:
    if not state.health.servos_ready:
        return None
    if state.mode is Mode.AUTONOMOUS:
        return Source.PROGRAM
    causes = [fault.cause for fault in state.active if fault.holds]
    if state.latched is not None:
        causes.append(state.latched.cause)
    by_hand = state.mode in {Mode.ADVISORY, Mode.ARMED}
    return Source.OPERATOR if by_hand and all(cause.area is not Area.SERVOS for cause in causes) else None
