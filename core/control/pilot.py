"""The pilot: from what the operator, perception and the servos say to what is asked of the robot, fifty times a second.

It owns the mode machine and is the only one that sends. The operator's requests, his controls and the deadman come from the
window's thread, frames from perception's, and ``tick`` from a thread of its own, so that neither a slow picture nor a busy window
keeps the operator's hand from the robot. What was advised, asked for, commanded and sent is kept apart.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace

from core.config import Config
from core.control.alerts import Note
from core.control.command_latency import CommandLatency
from core.control.deadman import DeadmanReport
from core.control.drive import Drive
from core.control.drive_view import DriveNews, DriveView, LeftOver
from core.control.faults import Cause, Fault
from core.control.follow import Follow
from core.control.frame_reports import FrameReports, is_finite, is_sound
from core.control.frame_watch import FrameArrived, RouteState
from core.control.gate_checks import Rejection, RejectReason, Source
from core.control.guarded_robot import GuardedRobot, SentMotion
from core.control.hand import AT_REST, Hand, Jog
from core.control.health import Beat, FrameLate, GateReport, ModelReport, Part, ServosBusy, ServosChecked, deadman_down
from core.control.inbox import Inbox, Inputs, Seen
from core.control.modes import ARMED_MODES, DRIVING_MODES, Act, Decision, Hindrance, Latched, Mode, SupervisorState
from core.control.owed_release import OwedRelease
from core.control.policies import Policy
from core.control.servo_requests import ServoRequests
from core.control.supervisor import hindrances, supervise
from core.control.teller import Teller
from core.devices import DeviceError
from core.servo_config import JointName
from core.types import Advice, Command, Frame, RobotStatus, Scene

PERIOD_S = 0.02
_ARRIVED_S = 0.5
_MOST_CHANGES = 200
_SETTLED_S = 1.0
"""What the servos were asked for shows in their status this long after it is done, at the latest."""
_OVER_WITH_A_FRAME = frozenset(cause.value for cause in (Cause.POSE_STALE, Cause.POSE_LOST, Cause.CAMERA_SILENT, Cause.CAMERA_LOST))
"""What blanks the advice of the frame before says nothing against that of the frame that has come."""


class Pilot:
    """Drives a guarded robot. Nothing moves before the operator has switched the servos on.

    Parameters
    ----------
    robot : connected; ``close`` holds it and leaves it open.
    policy : advises, and drives while handed over to.
    config : limits, speeds, thresholds.
    model : whether perception's model passed its check.
    clock : monotonic, the one of the frames.
    left_over : what the operator has not acknowledged yet of the rig before this one: starting again acknowledges nothing.
    """

    def __init__(
        self,
        robot: GuardedRobot,
        policy: Policy,
        config: Config,
        model: ModelReport,
        clock: Callable[[], float] = time.monotonic,
        left_over: LeftOver | None = None,
    ) -> None:
        self._robot, self._policy, self._config, self._clock = robot, policy, config, clock
        self._inbox = Inbox(config.safety, [model])
        self._requests = ServoRequests(robot, self._inbox.post)
        self._release = OwedRelease(is_wanted=config.servos.torque_off_on_stop)
        self._reports = FrameReports(config.policy.pursuit)
        self._state = _start_of(left_over, clock())
        self._permitted: Source | None = None
        self._busy_s = -math.inf
        self._hand, self._drive, self._follow = Hand(config.hand), Drive(config.policy.drive), Follow()
        self._latency = CommandLatency()
        self._must_rest, self._was_at_rest = False, True
        self._asked = Command()
        self._told_cycle = -1
        self._asked_s: float | None = None
        self._arrived_since_s: float | None = None
        self._teller = Teller()
        self._lock = threading.Lock()  # of what follows: other threads read or write it
        self._forget = False
        self._turns_back = False
        self._halted = False
        self._changes: list[DriveView] = []
        self._stop_asked = False
        self._hand_speed = 1.0
        self._view = DriveView(clock(), mode=self._state.mode, latched=left_over.fault if left_over is not None else None)
        if left_over is not None and left_over.stopped:
            self._requests.stopped()
            self._release.stopped()
            robot.stop()  # pressed while this one was being opened, it has reached no servo yet

    # ---- from the window's thread

    def ask(self, act: Act) -> None:
        """A request of the operator. STOP goes to the robot at once, by its own way."""
        if act is Act.STOP:
            self._stop_asked = True
            self._requests.stopped()
            self._robot.stop()
        elif act is Act.ACKNOWLEDGE:
            self._requests.acknowledge()
        self._busy_s = self._clock()
        self._inbox.post(act)

    def switch_on(self) -> bool:
        """Check the servos and switch their torque on. Refused, with an alert, unless in ADVISORY with nothing to acknowledge and
        nothing under way; tells whether it was not. So do the next three."""
        if is_free := self._may_request():
            self._release.switching_on()
            self._requests.switch_on()
        return is_free

    def zero(self, names: Sequence[JointName] | None = None) -> bool:
        """Take the present positions, of all joints or of those named, for zero; refused like ``switch_on``."""
        if is_free := self._may_request():
            self._requests.zero(names)
        return is_free

    def reboot(self, servo_id: int) -> bool:
        """Restart a servo, which clears its hardware error; also while a fault waits to be acknowledged."""
        if is_free := self._may_request(although_latched=True):
            self._requests.reboot(servo_id)
        return is_free

    def torque_off(self) -> bool:
        """Let the wires go slack; also while a fault waits to be acknowledged, and after whatever is under way."""
        if is_free := self._may_request(although_latched=True, although_busy=True):
            self._requests.torque_off(is_lost=self._is_bus_lost(self.view.active))
        return is_free

    def halt(self) -> None:
        """The program ends: from the next turn on nobody drives, and the robot holds."""
        self._requests.stopped()
        self._halted = True

    @property
    def left_over(self) -> LeftOver | None:
        """What the next rig must take over, once this one is closed; None when there is nothing to acknowledge."""
        view = self.view
        if self._stop_asked and view.mode is not Mode.STOPPED:  # no turn has heard it any more
            return LeftOver(Fault(Cause.STOP_PRESSED), True)
        if view.latched is None and view.mode in ARMED_MODES and not self._halted:  # nobody ended it: it broke off
            return LeftOver(Fault(Cause.WORKER_DEAD, "the rig stopped while it was armed"), False)
        return LeftOver(view.latched, view.mode is Mode.STOPPED) if view.latched is not None else None

    def target_changed(self) -> None:
        """Another destination, or none: the operator has the hand again, and no advice for the old one is followed any more."""
        self._inbox.forget_seen()
        self._inbox.post(Act.TAKE_BACK)  # in any mode: a hand-over may have been asked for since the last turn
        if self.view.mode in DRIVING_MODES:
            self._teller.tell([(Note.NEW_TARGET, "")], self._clock())

    def jog(self, source: Hashable, jog: Jog) -> None:
        """How a control is held; to be repeated while it is, since its silence counts as let go."""
        self._inbox.jog(source, jog, self._clock())

    def hand_speed(self, share: float) -> None:
        """The share of full speed, 0..1, at which all controls together move the robot."""
        self._hand_speed = max(0.0, min(1.0, share))

    def deadman(self, source: Hashable, pressed: bool | None) -> None:
        """A deadman as it is now (None: it cannot tell); to be repeated many times a second. One that is held is enough."""
        self._inbox.post(DeadmanReport(pressed, self._clock(), source))

    def window_alive(self) -> None:
        """A sign of life of the window's thread."""
        self._inbox.post(Beat(Part.WINDOW))

    def report(self, fault: Fault) -> None:
        """A fault that another part of the program found."""
        self._inbox.post(fault)

    @property
    def view(self) -> DriveView:
        """The newest view."""
        with self._lock:
            return self._view

    @property
    def can_move(self) -> bool:
        """False when it is certain that nothing moves: ADVISORY, servos off, and nothing asked of them for a moment."""
        busy, view, is_settled = self._requests.busy, self.view, self._clock() - self._busy_s > _SETTLED_S
        return bool(busy) or not is_settled or view.mode is not Mode.ADVISORY or view.servos_on

    def news(self) -> DriveNews:
        """The newest view, and alerts and changes since the last call."""
        alerts = self._teller.take()
        with self._lock:
            changes, self._changes = tuple(self._changes), []
            return DriveNews(self._view, alerts, changes)

    # ---- from perception's thread

    def frame_arrived(self, frame: Frame) -> None:
        """The camera gave a frame, which now goes to perception."""
        self._inbox.post(FrameArrived(frame.captured_s), Beat(Part.WORKER))

    def frame_late(self) -> None:
        """The camera gave a frame that is older than the one before; nobody looked at it."""
        self._inbox.post(FrameLate())

    def worker_alive(self) -> None:
        """A sign of life of perception's thread while there are no frames."""
        self._inbox.post(Beat(Part.WORKER))

    def see(self, frame: Frame, scene: Scene, status: RobotStatus | None, *, has_target: bool) -> Advice | None:
        """Take in what was understood of a frame; returns the advice that may be shown."""
        with self._lock:
            forget, self._forget = self._forget, False
            turns_back, blanked, followed = self._turns_back, self._view.blanked, self._view.mode is Mode.AUTONOMOUS
        if forget:
            self._policy.reset()
        sound = is_sound(scene)
        advice = self._policy(scene, status, followed=followed) if sound else None
        report = self._reports.report(frame, scene, advice, has_target=has_target, sound=sound)
        advice = advice if is_finite(advice) else None
        if turns_back and report.route is RouteState.BEHIND:
            report = replace(report, route=RouteState.READY)  # a policy backs out of a branch that it missed by itself
        arrived = sound and scene.route is not None and scene.route.length_px <= self._config.policy.pursuit.arrive_px
        self._inbox.see(Seen(frame.captured_s, advice, arrived), report, Beat(Part.WORKER))
        return advice if not blanked or blanked in _OVER_WITH_A_FRAME else None

    # ---- from the pilot's own thread

    def tick(self) -> DriveView:
        """One turn: hear, decide, send."""
        now_s = self._clock()
        inputs = self._inbox.take(now_s)
        seen = inputs.seen
        sent = self._robot.sent_motion()
        kept_back = self._robot.kept_back() if sent is None else None
        is_news = sent is not None and sent.cycle != self._told_cycle
        self._told_cycle = sent.cycle if sent is not None else -1
        self._latency.see(sent)
        self._hear(inputs, sent if is_news else None, kept_back, now_s)
        before = self._state
        self._state, decision = supervise(before, inputs.events, now_s, self._config.servos, self._config.safety)
        if decision.mode is Mode.STOPPED and before.mode is not Mode.STOPPED:
            self._requests.stopped()
            self._robot.stop()
        self._let_go(decision, is_new=before.mode is not Mode.STOPPED or Act.STOP in inputs.events, now_s=now_s)
        if self._halted:
            decision = replace(decision, permitted=None)
        was_refused = any(refused.act is Act.HAND_OVER for refused in decision.refused)
        if Act.HAND_OVER in inputs.events and decision.mode is Mode.AUTONOMOUS and not was_refused:
            # Not after a hold that ends by itself: how often a branch was missed, and that it was going back, is true as before.
            with self._lock:
                self._forget = True
        commanded = self._send(decision, inputs.jog, seen, sent, now_s)
        self._teller.tell_turn(before, self._state, decision, inputs.jog, sent if is_news else None, kept_back, now_s)
        view = self._look(decision, inputs, seen, commanded, sent, now_s)
        with self._lock:
            if _has_changed(self._view, view):
                self._changes = [*self._changes, view][-_MOST_CHANGES:]
            self._view = view
            self._turns_back = decision.mode in DRIVING_MODES and not decision.hold_expired
            self._stop_asked = self._stop_asked and Act.STOP not in inputs.events
        return view

    def close(self) -> None:
        """Let nobody drive, and hold the robot. A request that is under way ends when the robot is closed; what a stop owes is
        paid before, also one that no turn has heard any more."""
        if self._stop_asked:
            self._release.stopped()
        if self._release.is_owed and not self._requests.is_letting_go:
            self._requests.torque_off(is_lost=self._is_bus_lost(self.view.active))
        self._requests.close()
        self._robot.hold()
        self._robot.beat(None)

    # ---- parts of a turn

    def _may_request(self, *, although_latched: bool = False, although_busy: bool = False) -> bool:
        """Whether the servos are free for a request, which follows; if not, an alert says why. One at a time."""
        view, busy, reason = self.view, self._requests.busy, None
        if view.mode in ARMED_MODES:
            reason = Hindrance.ALREADY_ARMED
        elif view.latched is not None and not although_latched:
            reason = Hindrance.IS_STOPPED if view.mode is Mode.STOPPED else Hindrance.UNACKNOWLEDGED
        elif busy and not although_busy:
            reason = Hindrance.SERVOS_BUSY
        if reason is None:
            self._busy_s = self._clock()
            return True
        self._teller.refuse(reason, busy if reason is Hindrance.SERVOS_BUSY else "")
        return False

    def _hear(self, inputs: Inputs, sent: SentMotion | None, kept_back: Rejection | None, now_s: float) -> None:
        """Add to the events what servos, controls and the way say now."""
        events, has_let_go = inputs.events, self._requests.take_let_go()
        if (failure := self._robot.failure) is not None:
            events.append(Fault(Cause.BUS_DEAD, failure))
        elif (report := self._robot.report()) is not None:
            events.append(report)
            has_let_go = has_let_go or report.torque_off
        if has_let_go:
            self._release.off()
            self._teller.tell([(Note.TORQUE_OFF, "")], now_s)
        if any(isinstance(event, ServosChecked) and not event.problems for event in events):
            self._release.switched_on()
        if self._release.is_owed and (owed := self._release.fault(is_lost=self._is_bus_lost(self._view.active))) is not None:
            events.append(owed)
        if self._requests.busy:
            self._busy_s = now_s
            events.append(ServosBusy())
        if not inputs.jog.is_rest:
            events.append(Act.INPUT)
            self._asked_s = now_s
        if self._state.mode in {Mode.HOLD, Mode.ARMED}:
            events.append(GateReport(RejectReason.NOT_ARMED))  # nothing is asked for meanwhile, so nothing is wrong with it
        elif sent is not None and self._permitted is Source.PROGRAM and sent.rejection is not RejectReason.NO_COMMAND:
            events.append(GateReport(sent.rejection))
        elif self._state.mode is Mode.AUTONOMOUS and kept_back is not None:
            events.append(GateReport(kept_back.reason))
        if self._has_arrived(inputs.seen, now_s):
            events.append(Act.TAKE_BACK)
            self._teller.tell([(Note.REACHED, "")], now_s)

    def _is_bus_lost(self, active: Sequence[Fault]) -> bool:
        """Whether the bus process is gone, or hangs."""
        return self._robot.failure is not None or any(fault.cause is Cause.BUS_DEAD for fault in active)

    def _let_go(self, decision: Decision, *, is_new: bool, now_s: float) -> None:
        """Pay what a stop owes where no bus process does."""
        if decision.mode is Mode.STOPPED and is_new:
            self._release.stopped()
        if not self._release.is_owed:
            return
        if self._release.is_due(now_s, is_lost=self._is_bus_lost(decision.active), is_busy=bool(self._requests.busy)):
            self._requests.torque_off(is_lost=True)

    def _has_arrived(self, seen: Seen | None, now_s: float) -> bool:
        """The program drove to the destination and has rested there for a moment."""
        if self._state.mode is not Mode.AUTONOMOUS or seen is None or not seen.arrived:
            self._arrived_since_s = None
            return False
        self._arrived_since_s = self._arrived_since_s if self._arrived_since_s is not None else now_s
        return now_s - self._arrived_since_s >= _ARRIVED_S

    def _send(self, decision: Decision, jog: Jog, seen: Seen | None, sent: SentMotion | None, now_s: float) -> Command | None:
        """Ask the robot for the motion of whoever may drive; returns the program's."""
        robot = self._robot
        # nobody drives before it is known where from
        permitted = decision.permitted if sent is not None else None
        if permitted is not self._permitted:
            self._change(permitted, sent)
        self._was_at_rest = jog.is_rest
        self._asked, commanded = Command(), None
        try:
            if permitted is Source.OPERATOR:
                at = sent.motion if sent is not None else None
                self._asked = self._hand.command(self._by_hand(decision, jog), now_s, at, self._hand_speed)
                robot.send(self._asked, source=Source.OPERATOR)
            elif permitted is Source.PROGRAM and seen is not None:
                commanded = self._drive.command(seen.advice, now_s)
                robot.send(commanded, source=Source.PROGRAM, captured_s=seen.captured_s)
            else:
                robot.hold()
        except DeviceError as error:
            self._inbox.post(Fault(Cause.BUS_DEAD, str(error)))
        # after the order: whoever sees the permission finds the order of the permitted one, and no cycle is held at a hand-over
        robot.beat(permitted)
        return commanded

    def _by_hand(self, decision: Decision, jog: Jog) -> Jog:
        """The controls as far as they may count: not when held since before, and not when the operator cannot see what he does."""
        self._must_rest = self._must_rest and not jog.is_rest
        is_blind = any(fault.cause is Cause.WINDOW_HUNG for fault in decision.active)
        return AT_REST if self._must_rest or is_blind else jog

    def _change(self, permitted: Source | None, sent: SentMotion | None) -> None:
        """Another one drives from now on, from where the robot is."""
        at = sent.motion if sent is not None else Command()
        self._hand.take_over(at.bend, at.pitch)
        self._drive.take_over(at.bend, at.pitch)
        # a press that itself ended a hold is a new one
        self._must_rest = self._permitted is None and permitted is Source.OPERATOR and not self._was_at_rest
        self._permitted = permitted

    def _look(
        self,
        decision: Decision,
        inputs: Inputs,
        seen: Seen | None,
        commanded: Command | None,
        sent: SentMotion | None,
        now_s: float,
    ) -> DriveView:
        safety, jog = self._config.safety, inputs.jog
        is_fresh = seen is not None and now_s - seen.captured_s <= safety.pose_disarm_s
        advice = seen.advice if seen is not None and is_fresh and decision.blanked is None else None
        arming, hand_over = hindrances(self._state, now_s, safety)
        by_hand = self._permitted is Source.OPERATOR
        return DriveView(
            time_s=now_s,
            mode=decision.mode,
            permitted=self._permitted,
            latched=decision.latched,
            active=decision.active,
            against_arming=arming,
            against_hand_over=hand_over,
            deadman=deadman_down(self._state.health, now_s, safety),
            servos_on=self._state.health.servos_ready,
            busy=self._requests.busy,
            asked=self._asked,
            asked_s=self._asked_s,
            advice=advice,
            blanked="" if decision.blanked is None else decision.blanked.cause.value,
            commanded=commanded,
            sent=sent.motion if sent is not None and sent.source is not None else None,
            sent_by=sent.source if sent is not None else None,
            latency_s=self._latency.newest_s,
            latency_p95_s=self._latency.p95_s,
            follow_share=self._follow.update(jog, advice, now_s) if by_hand else None,
        )


def _start_of(left_over: LeftOver | None, now_s: float) -> SupervisorState:
    if left_over is None:
        return SupervisorState()
    mode = Mode.STOPPED if left_over.stopped else Mode.ADVISORY
    return SupervisorState(mode=mode, latched=Latched(left_over.fault, now_s))


def _has_changed(before: DriveView, after: DriveView) -> bool:
    if before.mode is not after.mode or before.latched != after.latched:
        return True
    return {fault.cause for fault in before.active} != {fault.cause for fault in after.active}
