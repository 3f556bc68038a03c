"""What people read and hear: one table of texts, and a queue that throttles repeats. Pure.

A fault that the program reacted to, a request that was refused and a command that the gate rejected all have their line here. The
sound is a name; files belong to the window. Alert fatigue makes people ignore alarms: only what ends or interrupts a motion sounds,
and the same line comes again only after its cooldown.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum

from core.control.faults import REACTION, Cause, Reaction
from core.control.gate import RejectReason
from core.control.modes import Hindrance


class Note(StrEnum):
    """What is worth a line without being a fault or a refusal."""

    REACHED = "destination reached"
    AT_END = "joint at its end"
    NEW_TARGET = "destination changed"
    TORQUE_OFF = "torque off"


AlertKey = Cause | Hindrance | RejectReason | Note


class Priority(IntEnum):
    """How urgent; higher comes first."""

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

_FAULT_TEXTS: dict[Cause, tuple[str, str]] = {
    Cause.STOP_PRESSED: ("STOP pressed", "acknowledge, check the servos, arm again; an emergency needs the power cut"),
    Cause.PORT_LOST: ("Servo port lost", "plug the servo cable in, check the servos, then acknowledge"),
    Cause.SERVO_ALERT: ("A servo reports a hardware error", "free the wire, restart the servo, acknowledge, then zero it"),
    Cause.TRACKING: ("A servo does not follow: jam or slack wire", "look for a jam or a slack wire, then acknowledge"),
    Cause.STRAINED: ("A servo draws too much current", "free the wire or what it moves, let it cool, then acknowledge"),
    Cause.TORQUE_ON: ("The torque is not proven to be off", "cut the servos' power; until they say so it is tried again"),
    Cause.SERVOS_WRONG: ("Servos are not as configured", "compare ids, model and mode with the configuration"),
    Cause.CLOCK: ("The clock jumped or the computer slept", "check the robot, acknowledge, arm again"),
    Cause.SERVO_SILENT: ("A servo does not answer", "check its cable and power, then acknowledge"),
    Cause.BUS_NOISE: ("Too many bad packets from the servos", "check plugs and shielding of the servo cable, then acknowledge"),
    Cause.BUS_DEAD: ("Nothing heard from the servo bus", "acknowledge, then switch the servos on: that starts it again"),
    Cause.REBOOTED: ("A servo restarted and lost its zero", "acknowledge, then zero the servos again"),
    Cause.WATCHDOG: ("The servos' watchdog tripped", "check the servos, then acknowledge"),
    Cause.HOT: ("A servo is too hot", "let it cool, lower the pretension, then acknowledge"),
    Cause.VOLTAGE_LOW: ("The servos' supply voltage is too low", "check the power supply, then acknowledge"),
    Cause.WINDOW_HUNG: ("The window does not answer", "acknowledge when it answers again; restart it if it does not"),
    Cause.WORKER_DEAD: ("The perception worker stopped", "start again with F5, then acknowledge"),
    Cause.CAMERA_LOST: ("Camera lost", "plug the camera in and start again, then acknowledge"),
    Cause.CAMERA_FROZEN: ("The camera gives the same picture", "start the camera again, then acknowledge"),
    Cause.WRONG_FORMAT: ("The camera's picture has the wrong format", "set the camera's size and colour format, then acknowledge"),
    Cause.CAMERA_MOVED: ("The camera was moved", "put it back, or start again with F5, then acknowledge"),
    Cause.FRAMES_LOST_LONG: ("Too many camera frames lost", "check the USB port and cable, then acknowledge"),
    Cause.MODEL_UNFIT: ("The model is missing or damaged", "put the model back or choose another one in the configuration"),
    Cause.SEVERAL_ROBOTS: ("Several robots in view", "leave one robot in the picture, then acknowledge"),
    Cause.OUTSIDE_VESSEL: ("The robot seems outside the vessel", "look at the phantom; retract by hand, then acknowledge"),
    Cause.NOT_FINITE_REPEATED: ("Perception gave broken results", "start again with F5, then acknowledge"),
    Cause.COMMANDS_REJECTED: ("The program's commands were rejected", "acknowledge; if it comes again, report it with the log"),
    Cause.HEAD_LOST_LONG: ("The robot's head is lost", "bring the robot back into view by hand, then acknowledge"),
    Cause.POSE_LOST: ("No pose for half a second", "wait for a pose or drive by hand, then acknowledge"),
    Cause.BUS_SILENT: ("The servo bus is silent", "wait a moment; if it stays, check the cable"),
    Cause.CAMERA_SILENT: ("No new picture from the camera", "wait a moment; if it stays, check the cable"),
    Cause.IMAGE_BLACK: ("The picture is black", "take the lens cap off or switch the lamp on"),
    Cause.IMAGE_WHITE: ("The picture is overexposed", "dim the lamp or lower the exposure"),
    Cause.FRAMES_LOST: ("Many camera frames are lost", "check the USB port and cable"),
    Cause.NOT_FINITE: ("Perception gave a broken result", "wait for the next picture"),
    Cause.COMMAND_REJECTED: ("The gate rejected a command", "wait a moment, or drive by hand"),
    Cause.HEAD_LOST: ("The robot's head is out of sight", "bring the robot back into view by hand"),
    Cause.HEAD_JUMP: ("The head jumped in the picture", "wait for the next pictures"),
    Cause.BRANCH_UNCLEAR: ("Two branches fit", "click the destination in the picture"),
    Cause.POOR_VIEW: ("Robot or vessel not clearly seen", "improve light and focus, remove what covers them"),
    Cause.CONFIDENCE_LOW: ("Perception is not sure enough", "improve light and focus, or drive by hand"),
    Cause.UNKNOWN_KIND: ("The picture is of an unknown kind", "teach the model pictures of this rig, or drive by hand"),
    Cause.POSE_STALE: ("The pose is too old", "wait a moment; close other programs if it stays"),
    Cause.NO_TARGET: ("No way to a destination", "click a destination ahead of the robot"),
    Cause.DEADMAN: ("Deadman released", "press it again at once, or hand over again"),
    Cause.FRAMES_DROPPED: ("The camera drops frames", "check the USB port and cable"),
    Cause.OUT_OF_ORDER: ("The camera's pictures come out of order", "nothing to do: late ones are left out; check the driver"),
    Cause.WARM: ("A servo is getting hot", "pause soon and let it cool"),
    Cause.VOLTAGE_SAGS: ("The servos' supply voltage sags", "check the power supply"),
    Cause.DISK_LOW: ("The disk is nearly full", "make room or end the recording"),
    Cause.DISK_FULL: ("Disk full: recording stopped", "make room and record again; driving goes on"),
    Cause.RECORDING_STOPPED: ("The recording stopped", "do what it says and record again; driving goes on"),
    Cause.RECORDER_BEHIND: ("The recorder drops frames", "close other programs or record at a lower rate"),
}

_HINTS: dict[Hindrance | RejectReason | Note, tuple[str, str]] = {
    Note.REACHED: ("Destination reached", "you drive again: choose the next one, or go on by hand"),
    Note.NEW_TARGET: ("Another destination: you drive again", "hand over again to go there"),
    Note.TORQUE_OFF: ("The torque is off: all servos have said so", "the wires hang loose; switch the servos on to drive"),
    Note.AT_END: ("A joint is at the end of its travel", "drive the other way"),
    Hindrance.IS_STOPPED: ("Stopped", "acknowledge the stop first"),
    Hindrance.UNACKNOWLEDGED: ("A fault is not acknowledged", "read it and acknowledge it"),
    Hindrance.ALREADY_ARMED: ("Armed", "hand over to a destination; disarm first for anything else"),
    Hindrance.CAMERA_SETTLING: ("The camera is not well for long enough", "wait a second"),
    Hindrance.PERCEPTION_SETTLING: ("Perception is not well for long enough", "wait until the pose is steady for a second"),
    Hindrance.SERVOS_UNCHECKED: ("The servos follow nobody", "switch them on; that checks them, too"),
    Hindrance.SERVOS_BUSY: ("The servos are busy", "ask again when that has ended"),
    Hindrance.NOT_YET_ARMED: ("Not armed", "arm first"),
    Hindrance.ALREADY_AUTONOMOUS: ("Already handed over", "touch the controls to take back"),
    Hindrance.NO_DESTINATION: ("No destination chosen", "click the destination in the picture"),
    Hindrance.DESTINATION_BEHIND: ("The destination is behind the robot", "choose one ahead, or retract by hand first"),
    Hindrance.DEADMAN_NOT_HELD: ("The deadman is not held", "press and hold it (let it go first if it is down), then hand over"),
    Hindrance.DEADMAN_HELD_BEFORE: ("The deadman was down before arming", "let it go and press it again"),
    Hindrance.OPERATOR_DRIVING: ("The controls are in use", "let go of the controls, then hand over"),
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


def _spec(words: tuple[str, str], style: tuple[Priority, str | None, float]) -> AlertSpec:
    return AlertSpec(words[0], words[1], *style)


ALERTS: dict[AlertKey, AlertSpec] = {
    **{cause: _spec(words, _STYLE[REACTION[cause]]) for cause, words in _FAULT_TEXTS.items()},
    **{key: _spec(words, (Priority.HINT, None, 2.0)) for key, words in _HINTS.items()},
}
"""Every line that there is."""


@dataclass(frozen=True, slots=True)
class Alert:
    """A line to show now. ``detail`` is the measured value; ``repeats`` counts how often it was held back since the last time."""

    key: AlertKey
    spec: AlertSpec
    detail: str = ""
    repeats: int = 0
    sound: str | None = None


@dataclass(frozen=True, slots=True)
class AlertQueue:
    """When each line was last shown, and how often it was held back since."""

    shown_s: dict[AlertKey, float] = field(default_factory=dict)
    held_back: dict[AlertKey, int] = field(default_factory=dict)


def raise_alerts(
    queue: AlertQueue,
    raised: Iterable[tuple[AlertKey, str]],
    now_s: float,
    *,
    armed: bool,
    driving: bool = True,
    changed: bool = False,
) -> tuple[AlertQueue, tuple[Alert, ...]]:
    """Which of the `raised` lines, (key, detail) each, to show now.

    Parameters
    ----------
    armed : else only a stop sounds.
    driving : whether the program drives, or did: else nothing is held, and nothing sounds as if it were.
    changed : the mode has changed with them: what has ended a motion is told each time.

    Returns
    -------
    tuple
        The queue after it, and the alerts, most urgent first; the same line not again within its cooldown. At most one of them, the
        most urgent that has one, sounds.
    """
    shown_s, held_back = dict(queue.shown_s), dict(queue.held_back)
    alerts: list[Alert] = []
    for key, detail in raised:
        spec = ALERTS[key]
        # on a clock that went back the cooldown says nothing
        is_told_again = changed and spec.priority >= Priority.HOLD
        if not is_told_again and key in shown_s and 0.0 <= now_s - shown_s[key] < spec.cooldown_s:
            held_back[key] = held_back.get(key, 0) + 1
            continue
        is_heard = armed and (driving or spec.priority is not Priority.HOLD)
        sound = spec.sound if is_heard or spec.priority is Priority.STOP else None
        alerts.append(Alert(key, spec, detail, held_back.pop(key, 0), sound))
        shown_s[key] = now_s
    alerts.sort(key=lambda alert: -alert.spec.priority)
    sounding = next((place for place, alert in enumerate(alerts) if alert.sound is not None), None)
    quiet = [alert if place == sounding else replace(alert, sound=None) for place, alert in enumerate(alerts)]
    return AlertQueue(shown_s, held_back), tuple(quiet)
