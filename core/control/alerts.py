"""Alerts: the lines that the operator reads and hears, and how often: faults, refused requests, gate rejections and notes.

A sound is a name; its file belongs to the window. To avoid alarm fatigue only what ends or interrupts a motion sounds, and the same
line comes again only after its cooldown.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum

from core.control.faults import Area, Cause, Fault, Reaction
from core.control.gate import Rejection, RejectReason, Source
from core.control.modes import ARMED_MODES, DRIVING_MODES, Decision, Hindrance, Mode, SupervisorState
from core.control.motion import Jog
from core.control.robot import SentMotion


class Note(StrEnum):
    """Lines that are neither a fault nor a refusal."""

    REACHED = "destination reached"
    AT_END = "joint at its end"
    AT_LOW_END = "feed at its low end"
    BEYOND_END = "retracting beyond the end"
    NEW_TARGET = "destination changed"
    TORQUE_OFF = "torque off"
    LET_OUT = "wires let out"
    STILL_TIGHT = "wires not let out"


AlertKey = Cause | Hindrance | RejectReason | Note


class Priority(IntEnum):
    """Higher comes first."""

    HINT = 0
    WARNING = 1
    HOLD = 2
    DISARM = 3
    STOP = 4


@dataclass(frozen=True, slots=True)
class AlertSpec:
    """One line of the table. ``text`` fits a badge (60 characters at most); ``sound`` None is silent."""

    text: str
    what_to_do: str
    priority: Priority
    sound: str | None
    cooldown_s: float


_STYLE: dict[Reaction, tuple[Priority, str | None, float]] = {
    Reaction.WARN: (Priority.WARNING, None, 30.0),
    Reaction.HOLD: (Priority.HOLD, "hold", 3.0),
    Reaction.DISARM: (Priority.DISARM, "disarm", 5.0),
    Reaction.STOP: (Priority.STOP, "stop", 5.0),
}
"""Priority, sound and cooldown of a fault by its reaction."""

_HINTS: dict[Hindrance | RejectReason | Note, tuple[str, str]] = {
    Note.REACHED: ("Target reached", "you drive again: choose the next one, or go on by hand"),
    Note.NEW_TARGET: ("Another target: you drive again", "hand over again to go there"),
    Note.TORQUE_OFF: ("The torque is off: all servos have said so", "the wires hang loose; switch the servos on to drive"),
    Note.LET_OUT: ("The wires were let out slowly", "find the cause before you pull them again"),
    Note.STILL_TIGHT: ("Wires may still be tight", "look at them; let them go by Torque off (page Servos)"),
    Note.AT_END: ("A joint is at the end of its travel", "drive the other way"),
    Note.AT_LOW_END: ("A feed is at the end of its way back", "to pull it out further, slowly: let go, then hold retract again"),
    Note.BEYOND_END: (
        "Pulling out beyond the end: slow, while held",
        "watch the robot; when it is out, say where it is (page Servos, Zero)",
    ),
    Hindrance.IS_STOPPED: ("Stopped", "acknowledge the stop first"),
    Hindrance.UNACKNOWLEDGED: ("A fault is not acknowledged", "read it and acknowledge it"),
    Hindrance.ALREADY_ARMED: ("Armed", "hand over to a target; disarm first for anything else"),
    Hindrance.CAMERA_SETTLING: ("Waiting for steady pictures (1 s)", "the camera must be well for a second"),
    Hindrance.PERCEPTION_SETTLING: ("Waiting for a steady pose (1 s)", "keep the robot in view: it must be seen well for a second"),
    Hindrance.SERVOS_UNCHECKED: ("The servos are not in use", "switch them on; that checks them, too"),
    Hindrance.SERVOS_BUSY: ("The servos are busy", "ask again when that has ended"),
    Hindrance.NOT_YET_ARMED: ("Not armed", "arm first"),
    Hindrance.ALREADY_AUTONOMOUS: ("Already handed over", "touch the controls to take back"),
    Hindrance.NO_TARGET: ("No target chosen", "click the target in the picture"),
    Hindrance.TARGET_BEHIND: ("The target is behind the robot", "choose one ahead, or retract by hand first"),
    Hindrance.DEADMAN_NOT_HELD: ("The deadman is not held", "press and hold it (let it go first if it is down), then hand over"),
    Hindrance.DEADMAN_HELD_BEFORE: ("The deadman was down before arming", "let it go and press it again"),
    Hindrance.DEADMAN_ON_KEYBOARD: (
        "The keyboard alone is no deadman here",
        "hold the pedal, or set keyboard_deadman = true in the rig's file, then F5",
    ),
    Hindrance.OPERATOR_DRIVING: ("The controls are in use", "let go of the controls, then hand over"),
    Hindrance.DRUMS_UNKNOWN: (
        "The servos' drums are not measured",
        "menu Rig, Calibrate: page Drums; until then ways and forces are assumed",
    ),
    Hindrance.FORCE_UNLIMITED: ("The drive cannot limit its force", "by hand you can drive; the program needs other servos"),
    Hindrance.DIRECTIONS_UNKNOWN: (
        "The servos' directions are not learned",
        "menu Rig, Calibrate: page Wiggle and direction; by hand you can drive",
    ),
    Hindrance.DIRECTIONS_ASSUMED: (
        "Up and down are assumed",
        "menu Rig, Calibrate: look, and confirm or swap them on the page Wiggle and direction",
    ),
    Hindrance.STEERING_UNKNOWN: ("The steering is not learned", "menu Rig, Calibrate: page Steering; by hand you can drive"),
    Hindrance.STEERING_WRONG: (
        "Right and left act the wrong way",
        "menu Rig, Calibrate: wiggle again, or turn the robot in its holder; then Steering",
    ),
    Hindrance.MODEL_UNCALIBRATED: (
        "The model's confidence is not calibrated",
        "menu Model, Teach this bench; or main.py teach, or calibrate",
    ),
    Hindrance.MODEL_UNTAUGHT: ("The model was not taught on this bench", "menu Model, Teach this bench; or main.py teach"),
    Hindrance.CHECKS_OFF: (
        "Checks of perception are switched off",
        "set perception.quality.enabled, and max_novelty to 1.25 at most",
    ),
    Hindrance.POLICY_BLIND: ("The policy does not look at the picture", "set policy.name to pursuit or table"),
    Hindrance.NOT_ACCEPTED: ("The rig was not accepted", "close it, then main.py rig accept NAME; by hand you can drive"),
    Hindrance.ACCEPTANCE_OUTDATED: (
        "The rig was changed since it was accepted",
        "main.py rig show NAME says what; close it, then main.py rig accept NAME",
    ),
    RejectReason.NON_FINITE: ("Command is not a number", "nothing to do; report it if it comes again"),
    RejectReason.WRONG_COUNT: ("Command has the wrong number of joints", "report it with the log"),
    RejectReason.FROM_THE_FUTURE: ("Command is from the future", "start the program again"),
    RejectReason.CLOCK_WENT_BACK: ("The clock went back", "start the program again"),
    RejectReason.CLOCK_GAP: ("The servo loop stood still", "close other programs"),
    RejectReason.NOT_ARMED: ("Nobody may drive now", "acknowledge faults, check the servos, arm"),
    RejectReason.WRONG_SOURCE: ("Somebody else drives", "take back, or hand over"),
    RejectReason.NO_COMMAND: ("No command", "nothing to do"),
    RejectReason.STALE_COMMAND: ("Command came too late", "close other programs"),
    RejectReason.OUT_OF_ORDER: ("Command was overtaken", "nothing to do"),
    RejectReason.STALE_POSE: ("Command from too old a picture", "close other programs"),
    RejectReason.NO_MEASUREMENT: ("The servos' positions are unknown", "check the servos"),
    RejectReason.STALE_MEASUREMENT: ("The servos' positions are too old", "check the servo cable"),
    RejectReason.MEASURED_OUT_OF_ENVELOPE: ("A joint is outside its envelope", "move it back by hand, or zero it again"),
    RejectReason.OUT_OF_ENVELOPE: ("Goal outside the envelope", "drive the other way"),
    RejectReason.OVER_RATE: ("Goal too far away", "report it if it comes again"),
    RejectReason.OFF_COURSE: ("A joint was pushed off its course", "look for a jam; then drive on"),
}

ALERTS: dict[AlertKey, AlertSpec] = {
    **{cause: AlertSpec(cause.text, cause.what_to_do, *_STYLE[cause.reaction]) for cause in Cause},
    **{key: AlertSpec(*words, Priority.HINT, None, 2.0) for key, words in _HINTS.items()},
}
"""All lines. Those of faults come from the fault table (``faults.Cause``)."""


_TWIN_LATE = "the twin is behind: close other programs; if it stays, F5 starts it again"
_TWIN_FAILED = "the twin has failed: F5 starts it again, then acknowledge"
_IN_THE_TWIN: dict[AlertKey, str] = {
    **dict.fromkeys((Cause.PORT_LOST, Cause.SUPPLY_LOST, Cause.SERVO_SILENT, Cause.BUS_NOISE, Cause.TORQUE_ON), _TWIN_FAILED),
    **dict.fromkeys((Cause.VOLTAGE_LOW, Cause.VOLTAGE_SAGS, Cause.CAMERA_LOST, Cause.WRONG_FORMAT), _TWIN_FAILED),
    **dict.fromkeys((Cause.BUS_SILENT, Cause.CAMERA_SILENT, Cause.FRAMES_LOST, Cause.FRAMES_DROPPED), _TWIN_LATE),
    **dict.fromkeys((RejectReason.NO_MEASUREMENT, RejectReason.STALE_MEASUREMENT), _TWIN_LATE),
    Cause.CAMERA_MOVED: _TWIN_FAILED,
    Cause.STOP_PRESSED: "acknowledge, switch the servos on, arm again",
    Cause.FRAMES_LOST_LONG: f"{_TWIN_LATE}; then acknowledge",
}
"""What to do where camera and servos are simulated, and have no cable, plug, supply or port."""


def alert_of(key: AlertKey, *, simulated: bool) -> AlertSpec:
    """The line of a key, for a real rig or a simulated one."""
    spec = ALERTS[key]
    return replace(spec, what_to_do=_IN_THE_TWIN[key]) if simulated and key in _IN_THE_TWIN else spec


@dataclass(frozen=True, slots=True)
class Alert:
    """A line to show now. ``detail`` is the measured value; ``times``: how often it came since it was last shown; 0: it goes on."""

    key: AlertKey
    spec: AlertSpec
    detail: str = ""
    times: int = 1
    sound: str | None = None


_MOST_ALERTS = 200
"""Alerts that are kept until the window takes them."""
_SAME_S = 0.5
"""A line that is raised again within this time goes on: controls are read, and held keys seen, more often."""
_NO_ALERT = frozenset({RejectReason.NOT_ARMED, RejectReason.WRONG_SOURCE, RejectReason.NO_COMMAND, RejectReason.OUT_OF_ORDER})
"""Rejections that happen in normal driving."""


class AlertReporter:
    """Throttles repeats and keeps alerts until they are taken. All methods may be called from any thread.

    `simulated` : camera and servos are the twin's.
    """

    def __init__(self, *, simulated: bool = False) -> None:
        self._simulated = simulated
        self._lock = threading.Lock()
        self._alerts: list[Alert] = []
        self._shown_s: dict[AlertKey, float] = {}
        self._raised_s: dict[AlertKey, float] = {}
        self._came: dict[AlertKey, int] = {}

    def take(self) -> tuple[Alert, ...]:
        """The alerts since the last call."""
        with self._lock:
            alerts, self._alerts = tuple(self._alerts), []
            return alerts

    def report_refusal(self, reason: Hindrance, detail: str) -> None:
        """A request is refused: reported each time, without a sound."""
        with self._lock:
            self._alerts.append(Alert(reason, alert_of(reason, simulated=self._simulated), detail))

    def report(
        self, raised: Iterable[tuple[AlertKey, str]], now_s: float, mode: Mode = Mode.ADVISORY, *, changed: bool = False
    ) -> None:
        """Report lines, (key, detail) each, most urgent first; the same line not again within its cooldown.

        At most one of them sounds, the most urgent that has a sound: while disarmed only a stop, and a hold only while the
        program drives. The `mode` is that before these lines; it has `changed` with them: what has ended a motion is
        reported each time.
        """
        with self._lock:
            alerts: list[Alert] = []
            for key, detail in raised:
                spec = alert_of(key, simulated=self._simulated)
                always = changed and spec.priority >= Priority.HOLD
                goes_on = 0.0 <= now_s - self._raised_s.get(key, -math.inf) < _SAME_S
                self._raised_s[key] = now_s
                self._came[key] = self._came.get(key, 0) + (not goes_on)
                # a clock that went back ends the cooldown
                if not always and 0.0 <= now_s - self._shown_s.get(key, -math.inf) < spec.cooldown_s:
                    continue
                is_heard = mode in ARMED_MODES and (mode in DRIVING_MODES or spec.priority is not Priority.HOLD)
                sound = spec.sound if is_heard or spec.priority is Priority.STOP else None
                alerts.append(Alert(key, spec, detail, self._came.pop(key), sound))
                self._shown_s[key] = now_s
            alerts.sort(key=lambda alert: -alert.spec.priority)
            sounding = next((place for place, alert in enumerate(alerts) if alert.sound is not None), None)
            alerts = [alert if place == sounding else replace(alert, sound=None) for place, alert in enumerate(alerts)]
            self._alerts = [*self._alerts, *alerts][-_MOST_ALERTS:]

    def report_turn(
        self,
        before: SupervisorState,
        state: SupervisorState,
        decision: Decision,
        jog: Jog,
        sent: SentMotion | None,
        kept_back: Rejection | None,
        now_s: float,
        *,
        is_beyond: bool = False,
    ) -> None:
        """Report a turn of the pilot: the state `before` and after it, the decision, and what became of controls and command.

        `is_beyond`: the operator holds a retraction that goes beyond the end of a feed's envelope.
        """
        raised: list[tuple[AlertKey, str]] = [(f.cause, f.detail) for f in decision.raised if _matters(f, before)]
        raised += [(reason, "") for refused in decision.refused for reason in refused.reasons]
        permitted = decision.permitted
        if not jog.is_rest and permitted is None:
            if decision.mode is Mode.STOPPED:
                raised.append((Hindrance.IS_STOPPED, ""))
            elif decision.latched is not None:
                raised.append((Hindrance.UNACKNOWLEDGED, ""))
            elif not state.health.servos_ready:
                raised.append((Hindrance.SERVOS_UNCHECKED, ""))
        is_moving = not jog.is_rest or decision.mode in DRIVING_MODES
        if sent is not None and permitted is not None:
            if is_moving and sent.rejection is not None and sent.rejection not in _NO_ALERT:
                raised.append((sent.rejection, ""))
            # the program bends to the end of a tendon's travel in normal driving; at the end of the feed it gets nowhere
            by_program = permitted is Source.PROGRAM and jog.is_rest
            at_end = [name for name in sent.at_end if not by_program or name == "advance"]
            if at_end and (by_program or not jog.is_rest):
                is_low = not by_program and all(name in sent.at_low for name in at_end)
                raised.append((Note.AT_LOW_END if is_low else Note.AT_END, ", ".join(at_end)))
            if is_beyond:
                raised.append((Note.BEYOND_END, ", ".join(f"{name} {at:.1f} mm" for name, at in sent.at_low.items())))
        if kept_back is not None and permitted is not None and is_moving and kept_back.reason not in _NO_ALERT:
            raised.append((kept_back.reason, kept_back.detail))
        self.report(raised, now_s, before.mode, changed=decision.mode is not before.mode)


_ALWAYS = frozenset({Cause.STOP_PRESSED, Cause.ESTOP_PRESSED, Cause.SERVOS_WRONG, Cause.TORQUE_ON})
"""Faults that are told in every mode."""


def _matters(fault: Fault, before: SupervisorState) -> bool:
    """Whether a fault is worth an alert: in ADVISORY the screen shows perception's doubts anyway, and servos that are off endanger
    nothing."""
    cause = fault.cause
    if before.mode in ARMED_MODES or cause in _ALWAYS:
        return True
    if cause.area is Area.SERVOS or cause is Cause.CLOCK:
        return before.health.servos_ready
    return cause.area is Area.HOST and cause.reaction is Reaction.WARN
