"""What can go wrong, and what the program then does: one table.

WARN tells the operator. HOLD stops an autonomous motion and may clear itself within half a second. DISARM holds, leaves autonomy
and latches. STOP does the same in every mode and blocks the bus. Faults of camera and perception from HOLD on blank the advice.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum

from core.types import Reason


class Reaction(IntEnum):
    """Mildest first."""

    WARN = 0
    HOLD = 1
    DISARM = 2
    STOP = 3


class Area(StrEnum):
    """Whose fault it is."""

    CAMERA = "camera"
    PERCEPTION = "perception"
    PROGRAM = "program"
    SERVOS = "servos"
    HOST = "host"
    OPERATOR = "operator"


class Cause(StrEnum):
    """A fault. The value is the name kept in files; texts for people are in ``alerts.ALERTS``. Worst and most telling first."""

    STOP_PRESSED = "stop pressed"
    PORT_LOST = "servo port lost"
    SERVO_ALERT = "servo reports a hardware error"
    TRACKING = "servo does not follow"
    STRAINED = "servo draws too much current"
    TORQUE_ON = "torque not proven to be off"
    SERVOS_WRONG = "servos are not as configured"
    CLOCK = "clock jumped"
    BUS_NOISE = "bad packets on the servo bus"  # before the silence that it makes: what is named first is told
    SERVO_SILENT = "servo silent"
    BUS_DEAD = "servo bus lost"
    REBOOTED = "servo restarted"
    WATCHDOG = "bus watchdog tripped"
    HOT = "servo too hot"
    VOLTAGE_LOW = "supply voltage too low"
    WINDOW_HUNG = "window hangs"
    WORKER_DEAD = "worker stopped"
    CAMERA_LOST = "camera lost"
    CAMERA_FROZEN = "camera frozen"
    WRONG_FORMAT = "wrong picture format"
    CAMERA_MOVED = "camera moved"
    FRAMES_LOST_LONG = "too many frames lost for long"
    MODEL_UNFIT = "model unfit"
    SEVERAL_ROBOTS = "several robots in view"
    OUTSIDE_VESSEL = "robot outside the vessel"
    NOT_FINITE_REPEATED = "results not finite again and again"
    COMMANDS_REJECTED = "commands rejected again and again"
    HEAD_LOST_LONG = "head lost for long"
    POSE_LOST = "pose lost"
    BUS_SILENT = "servo bus silent"
    CAMERA_SILENT = "no new frame"
    IMAGE_BLACK = "picture black"
    IMAGE_WHITE = "picture overexposed"
    FRAMES_LOST = "too many frames lost"
    NOT_FINITE = "result not finite"
    COMMAND_REJECTED = "command rejected"
    HEAD_LOST = "head lost"
    HEAD_JUMP = "pose jumped"
    BRANCH_UNCLEAR = "two branches fit"
    POOR_VIEW = "robot or vessel not clear"
    CONFIDENCE_LOW = "confidence too low"
    UNKNOWN_KIND = "picture of an unknown kind"
    POSE_STALE = "pose stale"
    NO_TARGET = "no way to a destination"
    DEADMAN = "deadman released"
    FRAMES_DROPPED = "frames dropped"
    OUT_OF_ORDER = "pictures out of order"
    WARM = "servo getting hot"
    VOLTAGE_SAGS = "supply voltage sags"
    DISK_LOW = "disk nearly full"
    DISK_FULL = "disk full"
    RECORDING_STOPPED = "recording stopped"
    RECORDER_BEHIND = "recorder drops frames"


@dataclass(frozen=True, slots=True)
class Fault:
    """A cause that is active; ``detail`` adds the measured value against its threshold. Other code reports its faults so, too."""

    cause: Cause
    detail: str = ""


_TABLE: dict[tuple[Area, Reaction], tuple[Cause, ...]] = {
    (Area.OPERATOR, Reaction.STOP): (Cause.STOP_PRESSED,),
    (Area.OPERATOR, Reaction.HOLD): (Cause.NO_TARGET, Cause.DEADMAN),
    (Area.SERVOS, Reaction.STOP): (Cause.PORT_LOST, Cause.SERVO_ALERT, Cause.TRACKING, Cause.STRAINED),
    (Area.SERVOS, Reaction.DISARM): (
        Cause.TORQUE_ON,
        Cause.SERVOS_WRONG,
        Cause.SERVO_SILENT,
        Cause.BUS_NOISE,
        Cause.BUS_DEAD,
        Cause.REBOOTED,
        Cause.WATCHDOG,
        Cause.HOT,
        Cause.VOLTAGE_LOW,
    ),
    (Area.SERVOS, Reaction.HOLD): (Cause.BUS_SILENT,),
    (Area.SERVOS, Reaction.WARN): (Cause.WARM, Cause.VOLTAGE_SAGS),
    (Area.HOST, Reaction.DISARM): (Cause.CLOCK, Cause.WINDOW_HUNG, Cause.WORKER_DEAD),
    (Area.HOST, Reaction.WARN): (Cause.DISK_LOW, Cause.DISK_FULL, Cause.RECORDING_STOPPED, Cause.RECORDER_BEHIND),
    (Area.CAMERA, Reaction.DISARM): (
        Cause.CAMERA_LOST,
        Cause.CAMERA_FROZEN,
        Cause.WRONG_FORMAT,
        Cause.CAMERA_MOVED,
        Cause.FRAMES_LOST_LONG,
    ),
    (Area.CAMERA, Reaction.HOLD): (Cause.CAMERA_SILENT, Cause.IMAGE_BLACK, Cause.IMAGE_WHITE, Cause.FRAMES_LOST),
    (Area.CAMERA, Reaction.WARN): (Cause.FRAMES_DROPPED, Cause.OUT_OF_ORDER),
    (Area.PERCEPTION, Reaction.DISARM): (
        Cause.MODEL_UNFIT,
        Cause.SEVERAL_ROBOTS,
        Cause.OUTSIDE_VESSEL,
        Cause.NOT_FINITE_REPEATED,
        Cause.HEAD_LOST_LONG,
        Cause.POSE_LOST,
    ),
    (Area.PERCEPTION, Reaction.HOLD): (
        Cause.NOT_FINITE,
        Cause.HEAD_LOST,
        Cause.HEAD_JUMP,
        Cause.BRANCH_UNCLEAR,
        Cause.POOR_VIEW,
        Cause.CONFIDENCE_LOW,
        Cause.UNKNOWN_KIND,
        Cause.POSE_STALE,
    ),
    (Area.PROGRAM, Reaction.DISARM): (Cause.COMMANDS_REJECTED,),
    (Area.PROGRAM, Reaction.HOLD): (Cause.COMMAND_REJECTED,),
}
CAUSES = tuple(Cause)
REACTION = {cause: reaction for (_, reaction), causes in _TABLE.items() for cause in causes}
AREA = {cause: area for (area, _), causes in _TABLE.items() for cause in causes}

RECHECK = frozenset({Cause.SERVO_SILENT, Cause.PORT_LOST, Cause.BUS_DEAD, Cause.REBOOTED, Cause.WATCHDOG, Cause.CLOCK})
"""After these, as after every stop, nothing is known about the servos: before anything moves again they must be checked, and zeroed
if they restarted."""

AT_ONCE: dict[Reason, Cause] = {
    Reason.UNREADABLE: Cause.WRONG_FORMAT,
    Reason.NO_MODEL: Cause.MODEL_UNFIT,
    Reason.SEVERAL_ROBOTS: Cause.SEVERAL_ROBOTS,
    Reason.OUTSIDE_VESSEL: Cause.OUTSIDE_VESSEL,
    Reason.AMBIGUOUS_BRANCH: Cause.BRANCH_UNCLEAR,
    Reason.HEAD_JUMP: Cause.HEAD_JUMP,
    Reason.LOW_CONFIDENCE: Cause.CONFIDENCE_LOW,
    Reason.UNLIKE_TRAINING: Cause.UNKNOWN_KIND,
    Reason.BLURRED: Cause.POOR_VIEW,
    Reason.NO_VESSEL: Cause.POOR_VIEW,
    Reason.TOO_SHORT: Cause.POOR_VIEW,
    Reason.GAP_TOO_LONG: Cause.POOR_VIEW,
    Reason.AMBIGUOUS_PATH: Cause.POOR_VIEW,
}
"""What a refusal of perception means at its first frame."""

AFTER_SOME: dict[Reason, Cause] = {
    Reason.BLACK: Cause.IMAGE_BLACK,
    Reason.WHITE: Cause.IMAGE_WHITE,
    Reason.NO_ROBOT: Cause.HEAD_LOST,
}
"""What a refusal means after some frames in a row; ``frame_watch`` counts them."""


def worst(faults: tuple[Fault, ...], reaction: Reaction) -> Fault | None:
    """The fault that is named first among those with exactly this reaction; None when there is none."""
    found = [fault for fault in faults if REACTION[fault.cause] is reaction]
    return min(found, key=lambda fault: CAUSES.index(fault.cause), default=None)
