"""The pilot: inputs of the operator, perception and servos in, commands to the robot out, fifty times a second.

It owns the mode machine and is the only sender. Requests, controls and the deadman come from the window's thread, frames from
perception's, and a thread of its own calls ``tick``, so that neither a slow picture nor a busy window delays the operator's
commands. Advice, the operator's motion, the program's command and what was sent are kept apart.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

from core.config.models import Config
from core.config.safety import JointKind, SafetyConfig
from core.control.alerts import AlertReporter, Note
from core.control.camera_monitor import FrameArrived, FrameLate, RouteState
from core.control.direction_monitor import MotionSent
from core.control.drive_view import AdviceAdherence, CommandLatency, DriveNews, DriveView
from core.control.faults import Cause, Fault
from core.control.frame_reports import FrameReports, is_finite, is_sound
from core.control.gate import Rejection, RejectReason, Source
from core.control.health import Beat, DeadmanReport, EstopReport, GateReport, ModelReport, Part, ServoCheckReport, ServosBusy
from core.control.joints import Retracted
from core.control.kept_zero import ZeroRequest, all_at_zero
from core.control.modes import ARMED_MODES, DRIVING_MODES, Act, AgainstProgram, Decision, Event, Hindrance, Mode, SupervisorState
from core.control.motion import AT_REST, AdviceController, Jog, JogIntegrator, Retraction, combined, next_retraction, within_robot
from core.control.policies import Policy
from core.control.readiness import READY, Readiness
from core.control.robot import BenchClock, GuardedRobot, SentMotion
from core.control.servo_requests import ReleaseEvent, ServoRequests, TorqueRelease
from core.control.supervisor import hindrances, supervise
from core.devices import DeviceError
from core.messages import message
from core.system import SLEPT_S, slept_s
from core.types import Advice, Command, Frame, Image, RobotStatus, Scene

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LatestAdvice:
    """The newest perceived frame: its capture, the advice for it, whether the target is reached."""

    captured_s: float
    advice: Advice | None
    arrived: bool


@dataclass(frozen=True, slots=True)
class Inputs:
    """The inputs since the last turn."""

    events: list[Event]
    jog: Jog = AT_REST
    latest: LatestAdvice | None = None


class InputQueue:
    """Inputs of the pilot from any thread. Events are kept until they are taken; a control counts while it is repeated."""

    def __init__(self, safety: SafetyConfig, events: Iterable[Event] = ()) -> None:
        self._safety = safety
        self._lock = threading.Lock()
        self._events: list[Event] = list(events)
        self._jogs: dict[Hashable, tuple[Jog, float]] = {}
        self._latest: LatestAdvice | None = None

    def post(self, *events: Event) -> None:
        with self._lock:
            self._events += events

    def set_advice(self, latest: LatestAdvice | None, *events: Event) -> None:
        """The advice for a frame together with the `events` that report the frame; None: no advice holds any more."""
        with self._lock:
            self._latest = latest
            self._events += events

    def jog(self, source: Hashable, jog: Jog, now_s: float) -> None:
        """How a control is held. Even the shortest touch is an input of the operator."""
        with self._lock:
            self._jogs[source] = (jog, now_s)
            if not jog.is_rest:
                self._events.append(Act.INPUT)

    def take(self, now_s: float) -> Inputs:
        """The inputs; their events are removed."""
        with self._lock:
            events, self._events = self._events, []
            jogs = [jog for jog, at_s in self._jogs.values() if now_s - at_s <= self._safety.command_max_age_s]
            return Inputs(events, combined(jogs), self._latest)


@dataclass(frozen=True, slots=True)
class LeftOver:
    """The unacknowledged cause that a rig which is opened again takes over from the one before."""

    fault: Fault
    stopped: bool


KEYBOARD = "window"
"""Source of the deadman on the keyboard and the screen. A key whose release is lost (a keyboard out of radio, a remote desktop that
was cut) seems to be held on."""
PERIOD_S = 0.02
"""Of the turns."""
_TURNS_AHEAD = 4
"""A simulated bench is at most so many turns ahead of the pilot: less than ``command_max_age_s``."""
_SHARE_OF_AGE = 2 / 3
"""Nor does it go on beyond this share of the age at which pose and positions are too old; the rest is for the way to the gate."""
_ARRIVED_S = 0.5
"""The program hands the robot back after resting so long at the target."""
_MOST_CHANGES = 200
"""Changes of the view that are kept until the window takes them."""
_SETTLED_S = 1.0
"""After a request the servos' status shows its effect within this time."""
_ENDED_BY_A_FRAME = frozenset(cause.value for cause in (Cause.POSE_STALE, Cause.POSE_LOST, Cause.CAMERA_SILENT, Cause.CAMERA_LOST))
"""Faults that end with the next frame: they do not blank its advice."""


class Pilot:
    """Drives a guarded robot. Nothing moves before the operator has switched the servos on.

    Parameters
    ----------
    robot : connected; ``close`` holds it and leaves it open.
    policy : advises, and drives while handed over to.
    model : whether perception's model passed its check.
    clock : monotonic, the one of the frames.
    left_over : what is not acknowledged yet of the rig before this one: starting again acknowledges nothing.
    readiness : what stands against the program's driving of this rig; ``set_readiness`` when settings have changed.
    view : a picture of the rig's calibration, with which the camera's are compared.
    bench_clock : instead of `clock`, that of a simulated bench. It is granted no time in which an input of the pilot would become
        too old because the computer is slow. The time of a real bench waits for nothing.
    """

    def __init__(
        self,
        robot: GuardedRobot,
        policy: Policy,
        config: Config,
        model: ModelReport,
        clock: Callable[[], float] = time.monotonic,
        left_over: LeftOver | None = None,
        readiness: Readiness = READY,
        view: Image | None = None,
        bench_clock: BenchClock | None = None,
    ) -> None:
        self._readiness = readiness
        self._bench_clock = bench_clock
        self._perceived_s = clock() if bench_clock is None else bench_clock()  # the bench waits for its first scene, too
        self._held_s: float | None = None
        self._bus_s: float | None = None
        self._robot, self._policy, self._config, self._clock = robot, policy, config, bench_clock or clock
        self._inputs = InputQueue(config.safety, [model])
        self._requests = ServoRequests(robot, self._inputs.post)
        self._release = TorqueRelease(is_enabled=config.servos.torque_off_on_stop)
        self._simulated = config.rig.camera == "twin"
        self._alerts = AlertReporter(simulated=self._simulated)
        self._reports = FrameReports(config.policy.pursuit, view, config.safety.min_confidence)
        self._state = SupervisorState(against_program=readiness.hindrances)
        if left_over is not None:
            mode = Mode.STOPPED if left_over.stopped else Mode.ADVISORY
            self._state = replace(self._state, mode=mode, latched=left_over.fault)
        self._permitted: Source | None = None
        self._busy_s = -math.inf
        self._jogging, self._following = JogIntegrator(config.hand), AdviceController(config.policy.drive)
        self._adherence, self._latency = AdviceAdherence(), CommandLatency()
        self._must_rest, self._was_at_rest = False, True
        self._retractions = (Retraction.REST, Retraction.REST)  # of robot and catheter
        self._operator_command = Command()
        self._reported_cycle = -1
        self._operator_moved_s: float | None = None
        self._arrived_since_s: float | None = None
        self._lock = threading.Lock()  # of what follows: other threads read or write it
        self._must_reset_policy = False
        self._turns_back = False
        self._halted = False
        self._changes: list[DriveView] = []
        self._is_stop_pending = False
        self._hand_speed = 1.0
        self._view = DriveView(self._clock(), mode=self._state.mode, latched=left_over.fault if left_over is not None else None)
        if left_over is not None and left_over.stopped:
            self._requests.stop()
            self._release.handle(ReleaseEvent.REQUEST)
            robot.stop()  # pressed while this one was being opened, it has reached no servo yet

    # ---- from the window's thread

    def stop(self) -> None:
        """STOP: to the robot at once, by its own pipe; the next turn goes to STOPPED, which only an acknowledgement leaves."""
        self._is_stop_pending = True
        self._requests.stop()
        self._robot.stop()
        self._busy_s = self._clock()
        self._inputs.post(Act.STOP)

    def ask(self, act: Act) -> None:
        """A request of the operator; STOP is ``stop``."""
        if act is Act.ACKNOWLEDGE:
            self._requests.acknowledge()
        self._busy_s = self._clock()
        self._inputs.post(act)

    def switch_on(self) -> bool:
        """Check the servos and switch their torque on; False, and an alert, when refused.

        Granted in ADVISORY only, with nothing to acknowledge and nothing under way.
        """
        if is_free := self._may_request():
            self._release.handle(ReleaseEvent.SWITCH_ON)
            self._requests.switch_on()
        return is_free

    def zero(self, request: ZeroRequest | None = None) -> bool:
        """Set where joints are now, or confirm their kept zeros; refused like ``switch_on``."""
        if is_free := self._may_request():
            self._requests.zero(request or all_at_zero(self._config.servos))
        return is_free

    def reboot(self, servo_id: int) -> bool:
        """Restart a servo, which clears its hardware error; also while a fault waits to be acknowledged."""
        if is_free := self._may_request(although_latched=True):
            self._requests.reboot(servo_id)
        return is_free

    def relax(self) -> bool:
        """Let the wires go slowly, then switch the torque off; also while a fault waits to be acknowledged."""
        if is_free := self._may_request(although_latched=True):
            self._requests.relax()
        return is_free

    def torque_off(self) -> bool:
        """Let the wires go slack; also while a fault waits to be acknowledged, and after whatever is under way."""
        if is_free := self._may_request(although_latched=True, although_busy=True):
            self._requests.torque_off(is_bus_lost=self._is_bus_lost(self.view.active))
        return is_free

    def halt(self) -> None:
        """The program ends: from the next turn on no source is permitted, and the robot holds."""
        self._requests.stop()
        self._halted = True

    @property
    def now_s(self) -> float:
        """The clock of the frames."""
        return self._clock()

    @property
    def simulation_speed(self) -> float:
        """How fast a simulated bench runs, 0..1; for one caller. 1 on a real one."""
        return 1.0 if self._bench_clock is None else self._bench_clock.speed

    @property
    def left_over(self) -> LeftOver | None:
        """What the next rig must take over, once this one is closed; None when there is nothing to acknowledge."""
        view = self.view
        if self._is_stop_pending and view.mode is not Mode.STOPPED:  # no turn has handled it any more
            return LeftOver(Fault(Cause.STOP_PRESSED), True)
        if view.latched is None and view.mode in ARMED_MODES and not self._halted:  # it was not ended: it broke off
            return LeftOver(Fault(Cause.HEARTBEAT_LOST, "the rig stopped while it was armed"), False)
        return LeftOver(view.latched, view.mode is Mode.STOPPED) if view.latched is not None else None

    def target_changed(self) -> None:
        """Another target, or none: control returns to the operator, and advice for the old one is followed no longer."""
        self._inputs.set_advice(None, Act.TAKE_BACK)  # in any mode: a hand-over may have been asked for since the last turn
        if self.view.mode in DRIVING_MODES:
            self._alerts.report([(Note.NEW_TARGET, "")], self._clock())

    def jog(self, source: Hashable, jog: Jog) -> None:
        """How a control is held; to be repeated while it is, since silence counts as released."""
        self._inputs.jog(source, within_robot(jog, self._config.servos), self._clock())

    def hand_speed(self, share: float) -> None:
        """The share of full speed, 0..1, at which all controls together move the robot."""
        self._hand_speed = max(0.0, min(1.0, share))

    def deadman(self, source: Hashable, pressed: bool | None) -> None:
        """A deadman as it is now (None: it cannot tell); to be repeated many times a second. One that is held is enough."""
        is_enough, now_s = source != KEYBOARD or self._readiness.keyboard_deadman, self._clock()
        if source == KEYBOARD:
            self._held_s = now_s if pressed else None
        self._inputs.post(DeadmanReport(pressed, now_s, source, is_enough))

    def estop(self, pressed: bool) -> None:
        """What the E-stop button's own contact says; to be repeated while the board talks."""
        self._inputs.post(EstopReport(pressed))

    def window_alive(self) -> None:
        """A sign of life of the window's thread."""
        self._inputs.post(Beat(Part.WINDOW))

    def set_readiness(self, readiness: Readiness) -> None:
        """What stands against the program's driving under other settings, before they act. It ends a hand-over where it has to."""
        self._readiness = readiness
        self._inputs.post(AgainstProgram(readiness.hindrances))

    def report_fault(self, fault: Fault) -> None:
        """A fault that another part of the program found."""
        self._inputs.post(fault)

    @property
    def view(self) -> DriveView:
        """The newest view."""
        with self._lock:
            return self._view

    @property
    def can_move(self) -> bool:
        """False when it is certain that nothing moves: ADVISORY, servos off, and no request to them for a moment."""
        busy, view, is_settled = self._requests.busy, self.view, self._clock() - self._busy_s > _SETTLED_S
        return bool(busy) or not is_settled or view.mode is not Mode.ADVISORY or view.servos_on

    def news(self) -> DriveNews:
        """The newest view, and alerts and changes since the last call."""
        alerts = self._alerts.take()
        with self._lock:
            changes, self._changes = tuple(self._changes), []
            return DriveNews(self._view, alerts, changes)

    # ---- from perception's thread

    def frame_arrived(self, frame: Frame) -> None:
        """The camera gave a frame, which now goes to perception."""
        self._inputs.post(FrameArrived(frame.captured_s), Beat(Part.PERCEPTION))

    def frame_late(self) -> None:
        """The camera gave a frame that is older than the one before; it is left out."""
        self._inputs.post(FrameLate())

    def perception_alive(self) -> None:
        """A sign of life of perception's thread while there are no frames."""
        self._inputs.post(Beat(Part.PERCEPTION))

    def update_scene(self, frame: Frame, scene: Scene, status: RobotStatus | None, *, has_target: bool) -> Advice | None:
        """Make and queue the advice for a perceived frame; returns the advice that may be shown."""
        with self._lock:
            must_reset, self._must_reset_policy = self._must_reset_policy, False
            turns_back, blanked, followed = self._turns_back, self._view.blanked, self._view.mode is Mode.AUTONOMOUS
        if must_reset:
            self._policy.reset()
        sound = is_sound(scene)
        is_sure = scene.pose is None or scene.pose.confidence >= self._config.safety.min_confidence
        # a policy that saw an unsure pose would remember it when it steers by the next one
        advice = self._policy(scene, status, followed=followed) if sound and is_sure else None
        report = self._reports.report(frame, scene, advice, has_target=has_target, sound=sound)
        advice = advice if is_finite(advice) else None
        if turns_back and report.route is RouteState.BEHIND:
            report = replace(report, route=RouteState.READY)  # a policy backs out of a branch that it missed by itself
        arrived = sound and is_sure and scene.route is not None and scene.route.length_px <= self._config.policy.pursuit.arrive_px
        self._inputs.set_advice(LatestAdvice(frame.captured_s, advice, arrived), report, Beat(Part.PERCEPTION))
        self._perceived_s = frame.captured_s
        return advice if not blanked or blanked in _ENDED_BY_A_FRAME else None

    # ---- from the pilot's own thread

    def tick(self) -> DriveView:
        """One turn: collect events, decide, send."""
        now_s = self._clock()
        inputs = self._inputs.take(now_s)
        latest = inputs.latest
        sent = self._robot.sent_motion()
        kept_back = self._robot.kept_back() if sent is None else None
        is_new = sent is not None and sent.cycle != self._reported_cycle
        self._reported_cycle = sent.cycle if sent is not None else -1
        self._latency.update(sent)
        self._collect_events(inputs, sent if is_new else None, kept_back, now_s)
        before = self._state
        self._state, decision = supervise(before, inputs.events, now_s, self._config.servos, self._config.safety)
        if decision.mode is Mode.STOPPED and before.mode is not Mode.STOPPED:
            self._requests.stop()
            self._robot.stop()
        if decision.mode is Mode.STOPPED and (before.mode is not Mode.STOPPED or Act.STOP in inputs.events):
            self._release.handle(ReleaseEvent.REQUEST)
        if self._release.is_due(now_s, is_bus_lost=self._is_bus_lost(decision.active), is_busy=bool(self._requests.busy)):
            self._requests.torque_off(is_bus_lost=True)
        if self._halted:
            decision = replace(decision, permitted=None)
        was_refused = any(refused.act is Act.HAND_OVER for refused in decision.refused)
        if Act.HAND_OVER in inputs.events and decision.mode is Mode.AUTONOMOUS and not was_refused:
            # not after a hold that ends by itself: how often a branch was missed, and that the robot was backing off, is still true
            with self._lock:
                self._must_reset_policy = True
        program_command = self._send(decision, inputs.jog, latest, sent, now_s)
        is_beyond = Retraction.BEYOND in self._retractions
        self._alerts.report_turn(
            before, self._state, decision, inputs.jog, sent if is_new else None, kept_back, now_s, is_beyond=is_beyond
        )
        view = self._make_view(decision, inputs, program_command, sent, now_s)
        with self._lock:
            if view.is_change_of(self._view):
                self._changes = [*self._changes, view][-_MOST_CHANGES:]
            self._view = view
            self._turns_back = decision.mode in DRIVING_MODES and not decision.hold_expired
            self._is_stop_pending = self._is_stop_pending and Act.STOP not in inputs.events
        if self._bench_clock is not None:
            safety, frame_s = self._config.safety, 1.0 / self._config.twin.live_frames_per_second
            known = (
                (now_s, _TURNS_AHEAD * PERIOD_S),
                (self._held_s, safety.deadman_timeout_s),
                (self._perceived_s, max(_SHARE_OF_AGE * safety.pose_hold_s, 2.0 * frame_s)),
                (None if self._requests.busy else self._bus_s, _SHARE_OF_AGE * safety.measurement_max_age_s),
            )
            self._bench_clock.grant(min(at_s + ahead_s for at_s, ahead_s in known if at_s is not None))
        return view

    def close(self) -> None:
        """Permit no source, and hold the robot. A request that is under way ends when the robot is closed; a torque-off that a stop
        requested is made before, also when no turn has handled the stop any more."""
        if self._is_stop_pending:
            self._release.handle(ReleaseEvent.REQUEST)
        if self._release.is_requested and not self._requests.is_releasing:
            self._requests.torque_off(is_bus_lost=self._is_bus_lost(self.view.active))
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
        self._alerts.report_refusal(reason, busy if reason is Hindrance.SERVOS_BUSY else "")
        return False

    def _collect_events(self, inputs: Inputs, sent: SentMotion | None, kept_back: Rejection | None, now_s: float) -> None:
        """Add to the events what servos, controls and the route report now."""
        events, is_released = inputs.events, self._requests.take_released()
        if (failure := self._robot.failure) is not None:
            events.append(Fault(Cause.BUS_DEAD, failure))
        elif (report := self._robot.report()) is not None:
            events.append(report)
            self._bus_s = now_s
            is_released = is_released or report.torque_off
            if report.let_out:
                note = Note.STILL_TIGHT if report.still_tight else Note.LET_OUT
                self._alerts.report([(note, ", ".join(report.still_tight))], now_s)
        if is_released:
            self._release.handle(ReleaseEvent.CONFIRM)
            self._alerts.report([(Note.TORQUE_OFF, "")], now_s)
        if any(isinstance(event, ServoCheckReport) and not event.problems for event in events):
            self._release.handle(ReleaseEvent.CANCEL)
        if self._is_bus_lost(self._view.active):
            self._release.handle(ReleaseEvent.LOSE_BUS)
        if (fault := self._release.fault) is not None:
            events.append(fault)
        if self._requests.busy:
            self._busy_s = now_s
            events.append(ServosBusy())
        if not inputs.jog.is_rest:
            events.append(Act.INPUT)
            self._operator_moved_s = now_s
        if self._state.mode in {Mode.HOLD, Mode.ARMED}:
            events.append(GateReport(RejectReason.NOT_ARMED))  # no command is expected now, so its absence is no fault
        elif sent is not None and self._permitted is Source.PROGRAM and sent.rejection is not RejectReason.NO_COMMAND:
            events.append(GateReport(sent.rejection))
            turn_deg = sent.motion.bend * self._config.policy.drive.turn_deg
            events.append(MotionSent(sent.time_s, turn_deg, sent.motion.advance_mm_s))
        elif self._state.mode is Mode.AUTONOMOUS and kept_back is not None:
            events.append(GateReport(kept_back.reason))
        if self._has_arrived(inputs.latest, now_s):
            events.append(Act.TAKE_BACK)
            self._alerts.report([(Note.REACHED, "")], now_s)

    def _is_bus_lost(self, active: Sequence[Fault]) -> bool:
        """Whether the bus process is gone, or hangs."""
        return self._robot.failure is not None or any(fault.cause is Cause.BUS_DEAD for fault in active)

    def _has_arrived(self, latest: LatestAdvice | None, now_s: float) -> bool:
        """The program drove to the target and has rested there for a moment."""
        if self._state.mode is not Mode.AUTONOMOUS or latest is None or not latest.arrived:
            self._arrived_since_s = None
            return False
        self._arrived_since_s = self._arrived_since_s if self._arrived_since_s is not None else now_s
        return now_s - self._arrived_since_s >= _ARRIVED_S

    def _send(
        self, decision: Decision, jog: Jog, latest: LatestAdvice | None, sent: SentMotion | None, now_s: float
    ) -> Command | None:
        """Send the permitted source's command; returns the program's."""
        robot = self._robot
        permitted = decision.permitted if sent is not None else None  # a motion starts from a known one
        if permitted is not self._permitted:
            at = sent.motion if sent is not None else Command()
            self._jogging.take_over(at.bend, at.pitch)
            self._following.take_over(at.bend, at.pitch)
            # a control that was held while the source changed must be released first; a press that ended a hold is a new one
            self._must_rest = self._permitted is None and permitted is Source.OPERATOR and not self._was_at_rest
            self._permitted = permitted
        self._was_at_rest = jog.is_rest
        self._operator_command, program_command, used_jog = Command(), None, AT_REST
        try:
            if permitted is Source.OPERATOR:
                self._must_rest = self._must_rest and not jog.is_rest
                is_blind = any(fault.cause is Cause.WINDOW_HUNG for fault in decision.active)
                used_jog = AT_REST if self._must_rest or is_blind else jog
                moving = sent.motion if sent is not None else None
                self._operator_command = self._jogging.command(used_jog, now_s, moving, self._hand_speed)
                retracts = self._hold_retraction(used_jog, sent)
                robot.send(self._operator_command, source=Source.OPERATOR, retracts=retracts)
            elif permitted is Source.PROGRAM and latest is not None:
                known = self._state.health.direction
                followed = latest.advice if decision.blanked is None else None  # unsure: at rest until it is sure, or the hold
                program_command = self._following.command(followed, now_s, turns=known.turns, feeds=known.feeds)
                robot.send(program_command, source=Source.PROGRAM, captured_s=latest.captured_s)
            else:
                robot.hold()
        except DeviceError as error:
            self._inputs.post(Fault(Cause.BUS_DEAD, str(error)))
        if used_jog.is_rest:
            self._retractions = (Retraction.REST, Retraction.REST)
        # after the command: the bus never has the permission before the permitted source's command, so no cycle holds in between
        robot.beat(permitted)
        return program_command

    def _hold_retraction(self, jog: Jog, sent: SentMotion | None) -> Retracted:
        """The feeds whose retraction the operator holds, beyond the end of their envelope."""
        low = set(sent.at_low) if sent is not None else set()
        feeds = [self._config.servos.joints[self._config.servos.places(kind)] for kind in (JointKind.ADVANCE, JointKind.DELIVERY)]
        robot_low, catheter_low = (any(joint.name in low for joint in joints) for joints in feeds)
        robot, catheter = self._retractions
        self._retractions = (
            next_retraction(robot, pulls=jog.advance < 0.0, at_low=robot_low),
            next_retraction(catheter, pulls=jog.delivery < 0.0, at_low=catheter_low),
        )
        found = Retracted.NONE
        for state, feed in zip(self._retractions, (Retracted.ROBOT, Retracted.CATHETER), strict=True):
            found |= feed if state is Retraction.BEYOND else Retracted.NONE
        return found

    def _make_view(
        self, decision: Decision, inputs: Inputs, program_command: Command | None, sent: SentMotion | None, now_s: float
    ) -> DriveView:
        safety, latest = self._config.safety, inputs.latest
        is_fresh = latest is not None and now_s - latest.captured_s <= safety.pose_disarm_s
        advice = latest.advice if latest is not None and is_fresh and decision.blanked is None else None
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
            keyboard_deadman=self._readiness.keyboard_deadman,
            simulated=self._simulated,
            deadman=self._state.health.deadman_down(now_s, safety),
            servos_on=self._state.health.servos_ready,
            busy=self._requests.busy,
            operator_command=self._operator_command,
            operator_moved_s=self._operator_moved_s,
            advice=advice,
            blanked="" if decision.blanked is None else decision.blanked.cause.value,
            program_command=program_command,
            sent=sent.motion if sent is not None and sent.source is not None else None,
            sent_by=sent.source if sent is not None else None,
            latency_s=self._latency.newest_s,
            latency_p95_s=self._latency.p95_s,
            follow_share=self._adherence.update(inputs.jog, advice, now_s) if by_hand else None,
        )


class PilotLoop:
    """Calls ``tick`` of a pilot every 20 ms until closed. When a turn fails the loop ends, and ``failure`` says why.

    `asleep_s` tells how long the computer has been asleep since it was started.
    """

    def __init__(self, pilot: Pilot, asleep_s: Callable[[], float] = slept_s) -> None:
        self._pilot, self._asleep_s = pilot, asleep_s
        self._closing = threading.Event()
        self.failure: str | None = None
        self._thread = threading.Thread(target=self._run, name="pilot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the turns, then hold the robot."""
        self._closing.set()
        self._thread.join()
        self._pilot.close()

    def _run(self) -> None:
        due_s = time.monotonic()
        before_s = self._asleep_s()
        try:
            while not self._closing.wait(max(0.0, due_s - time.monotonic())):
                if (now_s := self._asleep_s()) - before_s > SLEPT_S:
                    self._pilot.report_fault(Fault(Cause.CLOCK, message("the computer slept for {a:.0f} s", a=now_s - before_s)))
                before_s = now_s
                self._pilot.tick()
                due_s = max(due_s + PERIOD_S, time.monotonic())
        except Exception as error:  # noqa: BLE001 - top of the thread: its silence stops the robot, and this says why
            _log.error("the pilot stopped", exc_info=error)
            self.failure = message(
                "driving stopped by an unexpected {kind}: {why}; start the rig again", kind=type(error).__name__, why=error
            )
