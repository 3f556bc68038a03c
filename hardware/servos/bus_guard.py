"""What the bus process decides: which source may move the servos, with what goals, and what ends a motion. Pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from core.config.safety import JointConfig, JointName, SafetyConfig, ServosConfig
from core.control.bus_monitor import BusMonitor, BusReport
from core.control.faults import Cause, Fault, Reaction, worst
from core.control.gate import (
    Clamp,
    GateState,
    GateStep,
    GoalRequest,
    JointMeasurement,
    Rejection,
    RejectReason,
    Source,
    gate_step,
    measurement_problem,
    outside_envelope,
)
from core.control.joints import Joints, Retracted, by_hand, by_program, joint_goals, joint_motion
from hardware.servos.bus_ipc import BusOrder, Heartbeat, IssuedGoals
from hardware.servos.dynamixel_port import NotReady
from hardware.servos.registers import MissingServo, ServoReading, ServoState
from hardware.servos.tracking import TrackingMonitor

_MENDED_BY_ARMING = frozenset({Cause.WATCHDOG, Cause.REBOOTED})


class OneStep:
    """Keeps the goals of one order within ``max_step_mm`` of where the joints were before it came.

    So a dead application moves a joint by one bounded step at most: an order is good for ``command_max_age_s``, which at full speed
    is more than a step, and the gate's own step is counted from the measured position of each cycle, which moves along.
    """

    def __init__(self, joints: Sequence[JointConfig]) -> None:
        self._joints = joints
        self._order: tuple[float, object] | None = None
        self._from_mm: Joints = ()

    def bounded(self, goals_mm: Joints, order: tuple[float, object], before_mm: Joints) -> Joints:
        """The goals, those too far brought nearer.

        Parameters
        ----------
        order : time and content; what is equal in both is the same order.
        before_mm : positions of the cycle before this one, which no new order can be older than. (Counted from this cycle's, a
            joint that moves would already have moved on since the order was issued.)
        """
        if self._order != order:
            self._order, self._from_mm = order, before_mm
        return tuple(
            min(max(goal, start - joint.max_step_mm), start + joint.max_step_mm) if math.isfinite(goal) else goal
            for goal, start, joint in zip(goals_mm, self._from_mm, self._joints, strict=True)
        )


RELEASE_MM_S = 2.0
"""Speed at which a tendon is let go: the whole pull of 2.8 mm in 1.4 s, so that neither wire nor head snaps back."""
RELAX_MM_S = 1.0
"""And when the operator leaves, and there is no hurry."""
RELEASED = frozenset({Cause.STRAINED, Cause.TRACKING, Cause.HOT})
"""Faults after which the tendons are let go instead of held: the tension that they hold is what went wrong."""
_RELEASE_AGAIN_C = 2.0
"""Servos that get hotter by so much after a release that was broken off are released again."""
_RELEASE_EXTRA_S = 0.5
"""Beyond the time that the way takes; a drum that cannot turn ends it."""
_SLACK_MM = 0.05
"""A tendon with no more pull than this has no tension."""


class ReleaseRamp:
    """Lets the tendons go: their goals move slowly to zero pull, where a tendon has no tension. Pure.

    For every case in which held tension is the danger: a strain, an overheating servo, a program that leaves. The goal moves, and
    not the current: a gear of 350:1 holds a wire without any current, so a current that fades would leave the tension as it is.

    A tendon is never tightened: one that stands at zero pull or below stays there, and goals are at most one step below the
    measured position. Feed and delivery keep their goals: nothing is pulled out of a vessel without an order. Each tendon goes by
    itself: one that cannot be read keeps no other one tight, and is let go from where it is when it tells that.

    Parameters
    ----------
    from_mm : positions of the joints at the start, at `now_s` (monotonic); None: not known.
    """

    def __init__(
        self, joints: Sequence[JointConfig], from_mm: Sequence[float | None], now_s: float, speed_mm_s: float = RELEASE_MM_S
    ) -> None:
        self._joints, self._start_s, self._speed_mm_s = joints, now_s, speed_mm_s
        self._begun: dict[int, tuple[float, float]] = {}
        self._last_mm: dict[int, float] = {}
        self._note(from_mm, now_s)

    def _note(self, at_mm: Sequence[float | None], now_s: float) -> None:
        """Where tendons are, and where and when each was read first."""
        for place, (at, joint) in enumerate(zip(at_mm, self._joints, strict=True)):
            if at is not None and joint.is_tendon:
                self._begun.setdefault(place, (at, now_s))
                self._last_mm[place] = at

    def _end_s(self, place: int, joint: JointConfig) -> float:
        """When a tendon's time is over, wherever it is."""
        from_mm, start_s = self._begun.get(place, (joint.high_mm, self._start_s))
        return start_s + max(0.0, from_mm) / self._speed_mm_s + _RELEASE_EXTRA_S

    @property
    def tight(self) -> tuple[JointName, ...]:
        """The tendons of which it is not known that they were let out."""
        places = [place for place, joint in enumerate(self._joints) if joint.is_tendon]
        return tuple(self._joints[place].name for place in places if self._last_mm.get(place, math.inf) > _SLACK_MM)

    def goals(self, at_mm: Sequence[float | None], now_s: float) -> tuple[float | None, ...] | None:
        """The goals now, None for a joint that keeps its own; None altogether when it is over. A position may be unknown (None)."""
        self._note(at_mm, now_s)
        tight = self.tight
        if not any(joint.name in tight and now_s <= self._end_s(place, joint) for place, joint in enumerate(self._joints)):
            return None
        goals: list[float | None] = []
        for place, (at, joint) in enumerate(zip(at_mm, self._joints, strict=True)):
            if at is None or at <= 0.0 or place not in self._begun:
                goals.append(None)
                continue
            from_mm, start_s = self._begun[place]
            gone_mm = self._speed_mm_s * max(0.0, now_s - start_s)
            goals.append(min(at, max(0.0, from_mm - gone_mm, at - joint.max_step_mm)))
        return tuple(goals)


class Attention(Enum):
    """What is done for servos that hold while the application is silent or gone."""

    REST = "rest"
    """Nothing: the servos' own watchdogs trip, which any packet would keep from it."""
    LOOK = "look"
    """They are read once."""
    RELAX = "relax"
    """They are let go slowly, then switched off."""


LINGER_S = 0.2
"""After disarming for silence the servos are polled for so long, to see that they hold."""
_TRIPPED_S = 0.5
"""So long after the servos' watchdogs should have tripped they are looked at for the first time."""
_LOOK_EVERY_S = 1.0
_STRAINED_LOOKS = 3
"""A current that is too high at so many looks in a row is no peak."""


@dataclass(frozen=True, slots=True)
class UnattendedWatch:
    """Heat, supply, current and errors of servos that hold without an application, from look to look. Pure.

    Attributes
    ----------
    looked_s : when, last.
    strained : by joint, at how many looks in a row the current was too high.
    problem : why they must not hold on, "" for nothing.
    """

    looked_s: float = -math.inf
    strained: tuple[int, ...] = ()
    problem: str = ""

    def next(self, silent_s: float, now_s: float, servos: ServosConfig) -> Attention:
        """What is to be done now; `silent_s` is since the application's last sign of life."""
        if silent_s <= servos.heartbeat_timeout_s + LINGER_S + servos.watchdog_s + _TRIPPED_S:
            return Attention.REST
        if self.problem or silent_s >= servos.unattended_s:
            return Attention.RELAX
        return Attention.LOOK if now_s - self.looked_s >= _LOOK_EVERY_S else Attention.REST

    def update(self, readings: Sequence[ServoReading], now_s: float, servos: ServosConfig) -> UnattendedWatch:
        """The state after a look. A servo that does not answer keeps what was known; NaN counts as too much."""
        before = self.strained or (0,) * len(servos.joints)
        strained, problem = [], ""
        for joint, reading, count in zip(servos.joints, readings, before, strict=True):
            if not isinstance(reading, ServoState):
                strained.append(count)
                continue
            ma, most_ma = reading.current_ma, servos.force_limit(joint).strain_ma
            strained.append(0 if ma is None or most_ma is None or abs(ma) <= most_ma else count + 1)
            if reading.torque and not problem:
                problem = _against_holding(joint, reading, strained[-1], servos)
        return UnattendedWatch(now_s, tuple(strained), problem)


def _against_holding(joint: JointConfig, state: ServoState, strained: int, servos: ServosConfig) -> str:
    if not state.temperature_c < servos.hottest_c(joint):
        return f"{joint.name} {state.temperature_c:.0f} °C"
    if not state.voltage_v > servos.lowest_v(joint):
        return f"{joint.name} {state.voltage_v:.1f} V"
    if state.error:
        return f"{joint.name} reports an error ({int(state.error):#04x})"
    return f"{joint.name} draws too much current" if strained >= _STRAINED_LOOKS else ""


def report_of(readings: Sequence[ServoReading], *, armed: bool, errors: int, rebooted: bool = False) -> BusReport:
    """A cycle's readings as the supervisor wants them; values of a servo that is missing in this cycle are left out for all."""
    states = [reading for reading in readings if isinstance(reading, ServoState)]
    missing = [reading for reading in readings if isinstance(reading, MissingServo)]
    whole = bool(states) and not missing
    errors_mm = [
        state.goal_mm - state.position_mm for state in states if state.goal_mm is not None and state.position_mm is not None
    ]
    return BusReport(
        misses=tuple(reading.misses if isinstance(reading, MissingServo) else 0 for reading in readings),
        errors=errors,
        # a servo with an error may be the only one that answers
        hardware_errors=tuple(int(r.error) if isinstance(r, ServoState) else 0 for r in readings),
        temperatures_c=tuple(state.temperature_c for state in states) if whole else (),
        voltages_v=tuple(state.voltage_v for state in states) if whole else (),
        # goals mean something only while they are followed
        tracking_mm=() if not whole else tuple(errors_mm) if armed and len(errors_mm) == len(readings) else (0.0,) * len(readings),
        currents_ma=tuple(reading.current_ma if isinstance(reading, ServoState) else None for reading in readings),
        rebooted=rebooted or any(reading.restarted for reading in missing),
        # a servo that has switched itself off has an error; one that has restarted has lost its status block
        limit_lost=tuple(armed and isinstance(r, ServoState) and not r.is_limited for r in readings),
        torque_taken=tuple(armed and isinstance(r, ServoState) and not r.torque and not r.error for r in readings),
        watchdog_tripped=any(state.watchdog_tripped for state in states),
    )


class BusGuard:
    """State from cycle to cycle: armed or not, the first cause, and what the gate remembers."""

    def __init__(self, servos: ServosConfig, safety: SafetyConfig, now_s: float) -> None:
        self._servos, self._safety = servos, safety
        self.armed = self.stopped = False
        self.latched: Fault | None = None
        self.active: tuple[Fault, ...] = ()
        self.fault_counts: Counter[Cause] = Counter()
        self.restarts = 0
        self.sent: IssuedGoals | None = None
        self.rejection: Rejection | None = None
        self.clamps: tuple[Clamp, ...] = ()
        self.at_end: tuple[JointName, ...] = ()
        self.rejections: Counter[RejectReason] = Counter()
        self.clamp_count = 0
        self.followed: BusOrder | None = None
        self._too_hot_c = self._released_at_c = -math.inf
        self._watch = BusMonitor()
        self._gate = GateState()
        self._one_step = OneStep(servos.joints)
        self._tracking = TrackingMonitor(servos.joints, safety)
        self._written_mm: Joints | None = None
        self._measurement: JointMeasurement | None = None
        self._before: JointMeasurement | None = None
        self._told_mm: dict[int, tuple[float, float]] = {}
        self._orders: dict[Source, BusOrder] = {}
        self._request_s = self._cycle_s = self._armed_s = now_s

    def silence_s(self, beat: Heartbeat | None, now_s: float) -> float:
        """How long the application has given no sign of life; a request is one, too (``note_request``)."""
        return now_s - max(self._request_s, beat.time_s if beat is not None else self._request_s)

    def note_request(self, now_s: float) -> None:
        """The application asked for something, and waits for the answer."""
        self._request_s = now_s

    def update(self, readings: Sequence[ServoReading], errors: int, beat: Heartbeat | None, now_s: float) -> Fault | None:
        """Evaluate one cycle's readings; the fault that ends the motion, when one is going on and must end."""
        report = report_of(readings, armed=self.armed, errors=errors)
        self.restarts += sum(isinstance(reading, MissingServo) and reading.restarted for reading in readings)
        self._watch = self._watch.update(report, now_s, self._servos, self._safety)
        # a whole set of positions replaces the last one; one with gaps does not
        found = [(r.position_mm, r.time_s) for r in readings if isinstance(r, ServoState) and r.position_mm is not None]
        for place, reading in enumerate(readings):
            if isinstance(reading, ServoState) and reading.position_mm is not None:
                self._told_mm[place] = (reading.position_mm, reading.time_s)
        if readings and len(found) == len(readings):
            self._before = self._measurement
            self._measurement = JointMeasurement(tuple(at for at, _ in found), min(time_s for _, time_s in found))
        faults = self._watch.faults(now_s, self._servos, self._safety)
        if self.armed:
            faults += self._motion_faults(beat, now_s)
        self._cycle_s = now_s
        self._note_heat(readings)
        self._activate(faults)
        return (worst(self.active, Reaction.STOP) or worst(self.active, Reaction.DISARM)) if self.armed else None

    def _motion_faults(self, beat: Heartbeat | None, now_s: float) -> list[Fault]:
        faults = []
        silence_s, gap_s = self.silence_s(beat, now_s), now_s - self._cycle_s
        if silence_s > self._servos.heartbeat_timeout_s:
            faults.append(Fault(Cause.HEARTBEAT_LOST, f"no heartbeat of the application for {1000 * silence_s:.0f} ms"))
        if not 0.0 <= gap_s <= self._safety.clock_gap_s:
            faults.append(Fault(Cause.CLOCK, f"the bus process stood still for {gap_s:.2f} s"))
        if self._measurement is not None and (problem := self._tracking.update(self._written_mm, self._measurement)) is not None:
            faults.append(Fault(Cause.TRACKING, problem))
        return faults

    def _note_heat(self, readings: Sequence[ServoReading]) -> None:
        """By how much the hottest servo with torque is above its limit; NaN counts as hot."""
        above = [
            reading.temperature_c - self._servos.hottest_c(joint)
            for reading, joint in zip(readings, self._servos.joints, strict=False)
            if isinstance(reading, ServoState) and reading.torque
        ]
        self._too_hot_c = max((0.0 if math.isnan(one) else one for one in above), default=-math.inf)
        if self._too_hot_c < 0.0:
            self._released_at_c = -math.inf

    def _activate(self, faults: Sequence[Fault]) -> None:
        known = {fault.cause for fault in self.active}
        self.active = tuple(faults)
        self.fault_counts.update(fault.cause for fault in faults if fault.cause not in known)

    def lose_port(self) -> Fault:
        """The servos' state is unknown from now on; returns the fault."""
        self._watch, self._measurement, self._before, self._told_mm = BusMonitor(), None, None, {}
        fault = Fault(Cause.PORT_LOST)
        self._activate([fault])
        return fault

    def end_motion(self, fault: Fault) -> None:
        """Disarmed, and the first cause latched; a fault that stops also blocks arming until it is acknowledged."""
        self.stopped = self.stopped or fault.cause.reaction is Reaction.STOP
        self.latched = self.latched or fault
        if fault.cause is Cause.STOP_PRESSED:
            self.fault_counts[fault.cause] += 1
        self.disarm()

    def disarm(self) -> None:
        """No more goals; nothing is latched."""
        self.armed = False
        self.sent = None  # where the next motion starts is not where this one ended
        self._gate, self._written_mm = GateState(), None
        self._tracking.reset()
        self._orders.clear()
        self.followed = None
        self.rejection, self.clamps, self.at_end = None, (), ()

    @property
    def must_relax(self) -> bool:
        """Whether servos that hold are too hot: they are relaxed before they shut themselves down, whatever the mode.

        A release that was broken off, by STOP, is made again when they get hotter still.
        """
        return not self.armed and self._too_hot_c >= max(0.0, self._released_at_c + _RELEASE_AGAIN_C)

    def release_ramp(self, now_s: float, speed_mm_s: float = RELEASE_MM_S) -> ReleaseRamp | None:
        """The ramp that lets the tendons go from where they are; None when that is known of none."""
        told, oldest_s = self._told_mm, now_s - self._safety.measurement_max_age_s
        at_mm = [
            told[place][0] if place in told and told[place][1] >= oldest_s else None for place in range(len(self._servos.joints))
        ]
        if all(at is None for at, joint in zip(at_mm, self._servos.joints, strict=True) if joint.is_tendon):
            return None
        self._released_at_c = max(self._released_at_c, self._too_hot_c)
        return ReleaseRamp(self._servos.joints, at_mm, now_s, speed_mm_s)

    def acknowledge(self) -> None:
        """The operator has seen the cause. Faults that are still there go on to hinder arming."""
        self.latched, self.stopped = None, False

    def check_arming(self) -> None:
        """Raise NotReady with all reasons that hinder arming, but for those that the driver finds."""
        reasons = []
        if self.latched is not None:
            reasons.append(f"acknowledge first: {_text(self.latched)}")
        if self.armed:
            reasons.append("already armed")
        hinder = [f for f in self.active if f.holds and f.cause not in _MENDED_BY_ARMING]
        reasons += [_text(fault) for fault in hinder]
        # No goal leads from outside the envelope, so nothing would ever move, but for a feed below its low end, which the operator
        # pulls out or brings back. Joints without a zero have no positions.
        at = self._measurement
        if at is not None and self._cycle_s - at.measured_s <= self._safety.measurement_max_age_s:
            advice = "switch the torque off and move it back by hand, or zero it again"
            servos = by_hand(self._servos, at.positions_mm, None, retracts=Retracted.NONE)
            reasons += [f"outside its envelope: {joint}: {advice}" for joint in outside_envelope(at.positions_mm, servos)]
        if reasons:
            raise NotReady("not armed: {why}", why="; ".join(reasons))

    def set_armed(self, now_s: float) -> None:
        """The driver has armed the servos. Orders from before do not count."""
        self._watch = BusMonitor()
        self._gate, self._measurement, self._before, self._told_mm = GateState(), None, None, {}
        self._written_mm = None
        self._tracking.reset()
        self.armed = True
        self._request_s = self._cycle_s = self._armed_s = now_s

    def step(self, order: BusOrder | None, beat: Heartbeat | None, now_s: float) -> GateStep:
        """The goals for this cycle, through the gate."""
        # A permission is good no longer than an order: the application that gives it must still be watching.
        fresh = beat is not None and now_s - beat.time_s <= self._safety.command_max_age_s
        permitted: Source | None = beat.permitted if self.armed and beat is not None and fresh else None
        self.followed = self._order_of(permitted, order, now_s)
        request, at_end = self._goal_request(self.followed, now_s)
        step = gate_step(self._gate, request, self._measurement, permitted, now_s, self._servos, self._safety)
        self._gate = step.state
        self.rejection, self.clamps = step.rejection, step.clamps
        if step.goals_mm is None:
            # Not even a hold is sent. Why comes first: before there was a hold, no source is permitted to drive.
            self.rejection = measurement_problem(self._measurement, now_s, self._servos, self._safety) or step.rejection
            self.sent = self.sent.kept() if self.sent is not None else None
        self.at_end = () if step.is_hold else at_end
        self.clamp_count += len(step.clamps)
        if step.rejection is not None:
            self.rejections[step.rejection.reason] += 1
        return step

    def _order_of(self, permitted: Source | None, newest: BusOrder | None, now_s: float) -> BusOrder | None:
        """The newest order of the permitted source, while it is valid; else the newest of all, which the gate refuses by name.

        At a hand-over the new source's order is there before its permission: the cycle between them goes on with the order before,
        instead of holding. Any source may hold.
        """
        if newest is None or newest.command is None:
            self._orders.clear()
            return newest
        self._orders[newest.source] = newest
        found = self._orders.get(permitted) if permitted is not None else None
        is_valid = found is not None and 0.0 <= now_s - found.issued_s <= self._safety.command_max_age_s
        return found if is_valid else newest

    def _goal_request(self, order: BusOrder | None, now_s: float) -> tuple[GoalRequest | None, tuple[JointName, ...]]:
        """What the gate is asked for, and the joints at the end of their envelope."""
        if order is None or order.command is None or self._measurement is None or order.issued_s < self._armed_s:
            return None, ()
        at_mm = tuple(self._measurement.positions_mm)
        before_mm = tuple((self._before or self._measurement).positions_mm)
        if order.source is Source.OPERATOR:
            servos = by_hand(self._servos, at_mm, self._gate.sent, retracts=order.retracts)
        else:
            servos = by_program(self._servos, at_mm, self._gate.sent)
        wanted = joint_goals(order.command, self._gate.sent, at_mm, now_s, servos, self._safety)
        goals_mm = self._one_step.bounded(wanted.goals_mm, (order.issued_s, order.command), before_mm)
        return GoalRequest(goals_mm, order.source, order.issued_s, order.captured_s, order.retracts), wanted.at_end

    def record_sent(self, goals_mm: Joints, order: BusOrder | None, now_s: float) -> None:
        """These goals went out, as the servos count them."""
        self._written_mm = goals_mm
        motion = joint_motion(goals_mm, self._gate.speeds_mm_s, self._servos)
        self.sent = IssuedGoals(goals_mm, motion, now_s, order if self.rejection is None else None)


def _text(fault: Fault) -> str:
    return f"{fault.cause} ({fault.detail})" if fault.detail else fault.cause.value
