"""The pilot: from what the operator, perception and the servos say to what is asked of the robot, fifty times a second.

It owns the mode machine and is the only one that sends. The operator's requests, his controls and the deadman come from the
window's thread, frames from perception's, and ``tick`` from a thread of its own, so that neither a slow picture nor a busy window
keeps the operator's hand from the robot. What was advised, asked for, commanded and sent is kept apart.

The pilot's thread: a turn every 20 ms, whatever perception and the window do.

What came in for the pilot since its last turn, from whatever thread.

What the pilot tells the operator: which of the lines of a turn, and each only as often as it is worth.

How far the operator follows the advice: a number for his own use and for studies, nothing that is acted upon.

From the capture of a frame to the first servo command that was made from it.

What the window shows of driving: one frozen picture of the pilot's newest turn.

What the operator asks of the servos and what takes them time: done one after another, beside the pilot's turns.

The torque-off that a stop owes (``servos.torque_off_on_stop``), where the bus process that pays it is gone or hangs.
"""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from core.config.models import Config
from core.config.safety import JointName, SafetyConfig
from core.control.alerts import ALERTS, Alert, AlertKey, AlertQueue, Note, raise_alerts
from core.control.faults import AREA, REACTION, Area, Cause, Fault, Reaction
from core.control.frame_reports import FrameReports, is_finite, is_sound
from core.control.gate import Rejection, RejectReason, Source
from core.control.health import (
    Beat,
    DeadmanReport,
    FrameArrived,
    FrameLate,
    GateReport,
    ModelReport,
    Part,
    RouteState,
    ServosBusy,
    ServosChecked,
    ServosOff,
    deadman_down,
)
from core.control.modes import ARMED_MODES, DRIVING_MODES, Act, Decision, Event, Hindrance, Latched, Mode, SupervisorState
from core.control.motion import AT_REST, AdviceController, Jog, JogIntegrator, combined
from core.control.policies import Policy
from core.control.robot import GuardedRobot, SentMotion
from core.control.supervisor import hindrances, supervise
from core.devices import DeviceError
from core.system import SLEPT_S, slept_s
from core.types import Advice, Command, Frame, RobotStatus, Scene


@dataclass(frozen=True, slots=True)
class LatestAdvice:
    """The newest frame that was understood: when it was captured, the advice for it, whether the destination is reached."""

    captured_s: float
    advice: Advice | None
    arrived: bool


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything heard since the turn before."""

    events: list[Event]
    jog: Jog = AT_REST
    seen: LatestAdvice | None = None


class InputQueue:
    """Events are kept until they are taken; controls are states that must be repeated, since silence means let go.

    A frame's advice comes together with the report that vets it.
    """

    def __init__(self, safety: SafetyConfig, events: Iterable[Event] = ()) -> None:
        self._safety = safety
        self._lock = threading.Lock()
        self._events: list[Event] = list(events)
        self._jogs: dict[Hashable, tuple[Jog, float]] = {}
        self._seen: LatestAdvice | None = None

    def post(self, *events: Event) -> None:
        with self._lock:
            self._events += events

    def see(self, seen: LatestAdvice, *events: Event) -> None:
        """A frame was understood; `events` report it."""
        with self._lock:
            self._seen = seen
            self._events += events

    def forget_seen(self) -> None:
        """What was advised until now was for another destination."""
        with self._lock:
            self._seen = None

    def jog(self, source: Hashable, jog: Jog, now_s: float) -> None:
        """How a control is held. Even the shortest touch is an input of the operator."""
        with self._lock:
            self._jogs[source] = (jog, now_s)
            if not jog.is_rest:
                self._events.append(Act.INPUT)

    def take(self, now_s: float) -> Inputs:
        """What came in; the events are gone from here."""
        with self._lock:
            events, self._events = self._events, []
            jogs = [jog for jog, at_s in self._jogs.values() if now_s - at_s <= self._safety.command_max_age_s]
            return Inputs(events, combined(jogs), self._seen)


_MOST_ALERTS = 200
_NOT_WORTH_A_WORD = frozenset(
    {RejectReason.NOT_ARMED, RejectReason.WRONG_SOURCE, RejectReason.NO_COMMAND, RejectReason.OUT_OF_ORDER}
)


class AlertReporter:
    """Keeps alerts until they are taken. Its methods may be called from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._queue = AlertQueue()
        self._alerts: list[Alert] = []

    def take(self) -> tuple[Alert, ...]:
        """The alerts since the last call."""
        with self._lock:
            alerts, self._alerts = tuple(self._alerts), []
            return alerts

    def refuse(self, reason: Hindrance, detail: str) -> None:
        """Something was asked for that is not done: told each time, and without a sound."""
        with self._lock:
            self._alerts.append(Alert(reason, ALERTS[reason], detail))

    def tell(self, raised: list[tuple[AlertKey, str]], now_s: float, mode: Mode = Mode.ADVISORY, *, changed: bool = False) -> None:
        """These lines, (key, detail) each; `mode` is the one until now."""
        if raised:
            armed, driving = mode in ARMED_MODES, mode in DRIVING_MODES
            with self._lock:
                self._queue, alerts = raise_alerts(self._queue, raised, now_s, armed=armed, driving=driving, changed=changed)
                self._alerts = [*self._alerts, *alerts][-_MOST_ALERTS:]

    def tell_turn(
        self,
        before: SupervisorState,
        state: SupervisorState,
        decision: Decision,
        jog: Jog,
        sent: SentMotion | None,
        kept_back: Rejection | None,
        now_s: float,
    ) -> None:
        """What a turn is worth: the state `before` and after it, what was decided, and what became of controls and order."""
        raised: list[tuple[AlertKey, str]] = [(f.cause, f.detail) for f in decision.raised if _matters(f, before)]
        raised += [(reason, "") for refused in decision.refused for reason in refused.reasons]
        if not jog.is_rest and decision.permitted is None:
            raised += [(reason, "") for reason in _why_not_by_hand(decision, state)]
        if sent is not None and decision.permitted is not None:
            if sent.rejection is not None and sent.rejection not in _NOT_WORTH_A_WORD:
                raised.append((sent.rejection, ""))
            # The program bends to the end of a tendon's travel as a matter of course; a feed that has none left goes nowhere.
            by_program = decision.permitted is Source.PROGRAM and jog.is_rest
            at_end = [name for name in sent.at_end if not by_program or name == "advance"]
            if at_end and (by_program or not jog.is_rest):
                raised.append((Note.AT_END, ", ".join(at_end)))
        is_tried = not jog.is_rest or decision.mode in DRIVING_MODES
        if kept_back is not None and decision.permitted is not None and is_tried and kept_back.reason not in _NOT_WORTH_A_WORD:
            raised.append((kept_back.reason, kept_back.detail))
        self.tell(raised, now_s, before.mode, changed=decision.mode is not before.mode)


def _why_not_by_hand(decision: Decision, state: SupervisorState) -> tuple[Hindrance, ...]:
    """What to tell the operator who moves the controls while nobody may drive."""
    if decision.mode is Mode.STOPPED:
        return (Hindrance.IS_STOPPED,)
    if decision.latched is not None:
        return (Hindrance.UNACKNOWLEDGED,)
    return (Hindrance.SERVOS_UNCHECKED,) if not state.health.servos_ready else ()


def _matters(fault: Fault, before: SupervisorState) -> bool:
    """Is it worth an alert? In ADVISORY perception's doubts are on the screen anyway, and idle servos endanger nobody."""
    if before.mode in ARMED_MODES or fault.cause in {Cause.STOP_PRESSED, Cause.SERVOS_WRONG, Cause.TORQUE_ON}:
        return True
    if AREA[fault.cause] is Area.SERVOS or fault.cause is Cause.CLOCK:
        return before.health.servos_ready
    return AREA[fault.cause] is Area.HOST and REACTION[fault.cause] is Reaction.WARN


_STRAIGHT_DEG = 3.0
"""Advised turns below this are none: keeping the head still follows them."""
_NEEDED = 25
"""Half a second of motion: before, a share says nothing."""


class AdviceAdherence:
    """Share of the operator's motion in the last seconds that agreed with the advice, tick by tick.

    A tick in which he moves counts as one where he feeds forward or backward as advised and, if a turn is advised, does not steer
    against it; as a half where only one of the two agrees.
    """

    def __init__(self, window_s: float = 10.0) -> None:
        self._window_s = window_s
        self._ticks: deque[tuple[float, float]] = deque()

    def update(self, jog: Jog, advice: Advice | None, now_s: float) -> float | None:
        """The share, 0..1; None as long as the operator moved too little."""
        while self._ticks and not 0.0 <= now_s - self._ticks[0][0] <= self._window_s:
            self._ticks.popleft()
        if advice is not None and not (jog.bend == 0.0 and jog.advance == 0.0):
            self._ticks.append((now_s, 0.5 * _agrees_in_feed(jog, advice) + 0.5 * _agrees_in_steering(jog, advice)))
        if len(self._ticks) < _NEEDED:
            return None
        return sum(agreed for _, agreed in self._ticks) / len(self._ticks)


def _agrees_in_feed(jog: Jog, advice: Advice) -> bool:
    if jog.advance == 0.0:
        return advice.advance_mm_s == 0.0 or jog.bend != 0.0  # steering first, and feeding then, is a way to follow
    return jog.advance * advice.advance_mm_s > 0.0


def _agrees_in_steering(jog: Jog, advice: Advice) -> bool:
    if abs(advice.steer_deg) < _STRAIGHT_DEG:
        return jog.bend == 0.0
    return jog.bend * advice.steer_deg >= 0.0


_KEPT = 100


class CommandLatency:
    """Takes what left the gate, cycle by cycle; a frame that several commands were made from counts once."""

    def __init__(self) -> None:
        self._captured_s: float | None = None
        self._latencies_s: deque[float] = deque(maxlen=_KEPT)

    @property
    def newest_s(self) -> float | None:
        return self._latencies_s[-1] if self._latencies_s else None

    @property
    def p95_s(self) -> float | None:
        """The 95th percentile of the last hundred."""
        return float(np.percentile(self._latencies_s, 95)) if self._latencies_s else None

    def see(self, sent: SentMotion | None) -> None:
        if sent is not None and sent.captured_s is not None and sent.captured_s != self._captured_s:
            self._captured_s = sent.captured_s
            self._latencies_s.append(sent.time_s - sent.captured_s)


_REST = Command()


@dataclass(frozen=True, slots=True)
class LeftOver:
    """What a rig that is opened again takes over from the one before: the cause that nobody has acknowledged yet."""

    fault: Fault
    stopped: bool


@dataclass(frozen=True, slots=True)
class DriveView:
    """Who drives, what hinders, and what was advised, asked for, commanded and sent, each by itself.

    Attributes
    ----------
    time_s : monotonic.
    mode : the supervisor's decision.
    permitted : whose orders leave; None: nobody's, also while the robot could not yet be told anything.
    latched, active : first cause of the last disarming until it is acknowledged; all faults now.
    against_arming, against_hand_over : why either request would be refused now; empty: it would be granted. Hand-over's reasons do
        not name the deadman, which the operator takes when he hands over.
    deadman : held now, whether the press counts or not; None when no deadman has reported yet.
    servos_on : checked, torque on, following the permitted one's orders.
    busy : what the servos are doing that takes time ("checking the servos"), else empty.
    asked, asked_s : the operator's motion, and when it last was not rest (None: never).
    advice : the policy's; None when there is none or it is blanked.
    blanked : why there is no advice, in plain words, when a fault blanks it.
    commanded : what the program asks of the robot while it drives; None when it does not drive.
    sent, sent_by : the motion that left the gate last, and whose it was; None: a hold, or nothing yet.
    latency_s, latency_p95_s : from the capture of a frame to the first servo command made from it: the newest, and the p95
        of the last hundred.
    follow_share : how far the operator's motions of the last ten seconds agreed with the advice, 0..1; None: he made too few.
    """

    time_s: float
    mode: Mode = Mode.ADVISORY
    permitted: Source | None = None
    latched: Fault | None = None
    active: tuple[Fault, ...] = ()
    against_arming: tuple[Hindrance | Cause, ...] = ()
    against_hand_over: tuple[Hindrance | Cause, ...] = ()
    deadman: bool | None = None
    servos_on: bool = False
    busy: str = ""
    asked: Command = _REST
    asked_s: float | None = None
    advice: Advice | None = None
    blanked: str = ""
    commanded: Command | None = None
    sent: Command | None = None
    sent_by: Source | None = None
    latency_s: float | None = None
    latency_p95_s: float | None = None
    follow_share: float | None = None


@dataclass(frozen=True, slots=True)
class DriveNews:
    """What happened in the turns since the window last looked, oldest first; none of it is lost when the window is slow.

    ``changes`` are the views in which mode, faults or the latched cause changed: the record of driving does not depend on pictures.
    """

    view: DriveView
    alerts: tuple[Alert, ...] = ()
    changes: tuple[DriveView, ...] = ()


class Interrupted(DeviceError):
    """STOP, or the wish to let the wires go, came while the servos were being switched on."""


class ServoRequests:
    """A request that fails tells the supervisor, in the driver's words, that the servos are not in order.

    Parameters
    ----------
    robot : whose servos.
    post : takes the outcome, from another thread.
    """

    def __init__(self, robot: GuardedRobot, post: Callable[[Event], None]) -> None:
        self._robot, self._post = robot, post
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="servo request")
        self._lock = threading.Lock()
        self._stops = 0
        self._offs = self._offs_done = 0
        self._blocked = self._let_go = False
        self._releases: list[Future[None]] = []
        self._waiting: list[str] = []

    @property
    def busy(self) -> str:
        """What is being done; "" for nothing."""
        with self._lock:
            return self._waiting[0] if self._waiting else ""

    @property
    def is_letting_go(self) -> bool:
        """Whether a torque-off is under way, or waits."""
        return any(not release.done() for release in self._releases)

    def take_let_go(self) -> bool:
        """Whether the torque went off since the last call, of all servos of a robot that is not connected and reports nothing."""
        with self._lock:
            let_go, self._let_go = self._let_go, False
        return let_go

    def stopped(self) -> None:
        """STOP: what is running or waiting must not switch anything on, and nothing does before an acknowledgement."""
        with self._lock:
            self._stops += 1
            self._blocked = True

    def switch_on(self) -> None:
        """Check the servos and switch their torque on; a bus process that is gone is started again."""
        with self._lock:
            asked = self._stops, self._offs
        self._request("checking the servos", lambda: self._switch_on(asked))

    def acknowledge(self) -> None:
        """The operator has seen why the servos were stopped."""
        with self._lock:
            self._blocked = False
        self._request("acknowledging", self._robot.acknowledge)

    def zero(self, names: Sequence[JointName] | None = None) -> None:
        """The present positions are zero, of all joints or of those named; the wires must be slack."""
        self._request("zeroing the servos", lambda: self._off_and(lambda: self._robot.zero(names)))

    def reboot(self, servo_id: int) -> None:
        """Restart a servo, which clears its hardware error."""
        self._request(f"restarting servo {servo_id}", lambda: self._off_and(lambda: self._robot.reboot(servo_id)))

    def torque_off(self, *, is_lost: bool = False) -> None:
        """Let the wires go slack, at once after what is under way; servos that are being switched on are not. `is_lost`: nothing is
        heard from their bus, and nobody need wait for its hold."""
        with self._lock:
            self._offs += 1
            asked = self._offs
        release = self._request("switching the torque off", lambda: self._switch_off(asked, is_lost=is_lost))
        self._releases = [one for one in (*self._releases, release) if one is not None and not one.done()]

    def close(self) -> None:
        """Let nothing more begin but a torque-off that waits; one that is under way is waited for. All else that is ends by itself
        when the robot is closed."""
        self.stopped()
        self._worker.shutdown(wait=False, cancel_futures=True)
        wait([release for release in self._releases if not release.cancelled()])
        with self._lock:
            owes_off = self._offs_done < self._offs
        if owes_off:
            try:
                self._robot.torque_off()
            except DeviceError as error:
                _log.error("the torque is not proven to be off: %s", error)

    def _request(self, what: str, do: Callable[[], None]) -> Future[None] | None:
        def run() -> None:
            try:
                do()
            except DeviceError as error:
                self._post(ServosChecked((str(error),)))
            except Exception as error:  # noqa: BLE001 - top of the thread: nobody would ever look at the future
                _log.error("%s failed", what, exc_info=error)
                self._post(ServosChecked((f"{what} failed ({type(error).__name__}: {error}): start the rig again",)))
            finally:
                self._ended(what)

        with self._lock:
            self._waiting.append(what)
        try:
            return self._worker.submit(run)
        except RuntimeError:  # closed already
            self._ended(what)
            return None

    def _ended(self, what: str) -> None:
        with self._lock:
            self._waiting.remove(what)

    def _switch_on(self, asked: tuple[int, int]) -> None:
        robot = self._robot
        self._post(ServosOff())
        self._check(asked)
        if robot.failure is not None:
            robot.connect()
        for step in (robot.disarm, robot.acknowledge, robot.arm):
            self._check(asked)
            step()
        try:
            self._check(asked)
        except Interrupted:
            robot.stop()
            raise
        with self._lock:
            self._offs_done = max(self._offs_done, asked[1])  # what was asked for before is over, whatever became of it
        self._post(ServosChecked())

    def _switch_off(self, asked: int, *, is_lost: bool) -> None:
        """Also where the bus process is gone, and where not all servos are there to connect: no reason to let the others pull."""
        self._post(ServosOff())
        with contextlib.suppress(DeviceError):  # nor is a hold that fails
            if self._robot.failure is not None:
                self._robot.connect()
            elif not is_lost:
                self._robot.disarm()
        self._robot.torque_off()
        with self._lock:
            self._offs_done = asked
            self._let_go = self._let_go or self._robot.failure is not None  # no report tells it

    def _check(self, asked: tuple[int, int]) -> None:
        """Raise Interrupted when something came since that speaks against switching on."""
        with self._lock:
            is_stopped, is_off = self._blocked or self._stops != asked[0], self._offs != asked[1]
        if is_stopped:
            raise Interrupted("stopped meanwhile: acknowledge, then switch the servos on again")
        if is_off:
            raise Interrupted("the torque was switched off meanwhile: switch the servos on again")

    def _off_and(self, do: Callable[[], None]) -> None:
        """Nobody drives any more before the servos were switched on again."""
        self._post(ServosOff())
        self._robot.disarm()
        do()


AGAIN_S = 10.0
"""A cable that is plugged in again is found after this long, at the latest."""
_LOST = Fault(Cause.TORQUE_ON, "the servo bus was lost")


class OwedRelease:
    """Owed from a stop on until all servos have let go, or were switched on again. A living bus process pays it by itself.

    Parameters
    ----------
    is_wanted : whether a stop switches the torque off at all.
    """

    def __init__(self, *, is_wanted: bool) -> None:
        self._is_wanted = is_wanted
        self._is_owed = self._is_left = False
        self._is_off = False  # it has been proven since the servos were asked to switch on
        self._tried_s = -math.inf

    @property
    def is_owed(self) -> bool:
        return self._is_owed

    def stopped(self) -> None:
        """A stop, or another one; the next try need not wait. The bus process may have paid it before it is heard of here."""
        if self._is_wanted and not self._is_off:
            self._is_owed, self._tried_s = True, -math.inf

    def off(self) -> None:
        """All servos have said that their torque is off."""
        self._is_owed, self._is_left, self._is_off = False, False, True

    def switching_on(self) -> None:
        """From now on nobody knows that it is off."""
        self._is_off = False

    def switched_on(self) -> None:
        """By the operator, who has seen the stop."""
        self._is_owed = self._is_left = self._is_off = False

    def fault(self, *, is_lost: bool) -> Fault | None:
        """What the operator must know from the moment on when nobody pays it, until it is paid; also while it is tried."""
        self._is_left = self._is_left or (self._is_owed and is_lost)
        return _LOST if self._is_left else None

    def is_due(self, now_s: float, *, is_lost: bool, is_busy: bool) -> bool:
        """Whether it must be asked for now."""
        if not (self._is_owed and is_lost) or is_busy or now_s - self._tried_s < AGAIN_S:
            return False
        self._tried_s = now_s
        return True


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
        self._inbox = InputQueue(config.safety, [model])
        self._requests = ServoRequests(robot, self._inbox.post)
        self._release = OwedRelease(is_wanted=config.servos.torque_off_on_stop)
        self._reports = FrameReports(config.policy.pursuit)
        self._state = _start_of(left_over, clock())
        self._permitted: Source | None = None
        self._busy_s = -math.inf
        self._hand, self._drive, self._follow = JogIntegrator(config.hand), AdviceController(config.policy.drive), AdviceAdherence()
        self._latency = CommandLatency()
        self._must_rest, self._was_at_rest = False, True
        self._asked = Command()
        self._told_cycle = -1
        self._asked_s: float | None = None
        self._arrived_since_s: float | None = None
        self._teller = AlertReporter()
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
        self._inbox.see(LatestAdvice(frame.captured_s, advice, arrived), report, Beat(Part.WORKER))
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

    def _has_arrived(self, seen: LatestAdvice | None, now_s: float) -> bool:
        """The program drove to the destination and has rested there for a moment."""
        if self._state.mode is not Mode.AUTONOMOUS or seen is None or not seen.arrived:
            self._arrived_since_s = None
            return False
        self._arrived_since_s = self._arrived_since_s if self._arrived_since_s is not None else now_s
        return now_s - self._arrived_since_s >= _ARRIVED_S

    def _send(
        self, decision: Decision, jog: Jog, seen: LatestAdvice | None, sent: SentMotion | None, now_s: float
    ) -> Command | None:
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
        seen: LatestAdvice | None,
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


_log = logging.getLogger(__name__)


class Turns(Protocol):
    """What is turned."""

    def tick(self) -> object: ...
    def report(self, fault: Fault) -> None: ...
    def close(self) -> None: ...


class PilotLoop:
    """Turns a pilot until it is closed. When a turn fails the loop ends, ``failure`` says why, and the robot holds by itself.

    `asleep_s` tells how long the computer has been asleep since it was started.
    """

    def __init__(self, pilot: Turns, asleep_s: Callable[[], float] = slept_s) -> None:
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
                    self._pilot.report(Fault(Cause.CLOCK, f"the computer slept for {now_s - before_s:.0f} s"))
                before_s = now_s
                self._pilot.tick()
                due_s = max(due_s + PERIOD_S, time.monotonic())
        except Exception as error:  # noqa: BLE001 - top of the thread: its silence stops the robot, and this says why
            _log.error("the pilot stopped", exc_info=error)
            self.failure = f"driving stopped by an unexpected {type(error).__name__}: {error}; start the rig again"
