"""The fault table: for every cause its area, the reaction, what the operator reads and what they should do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Self

from core.types import Reason


class Reaction(IntEnum):
    """What the supervisor does, mildest first.

    WARN shows an alert. HOLD stops an autonomous motion and may clear itself within half a second. DISARM holds, leaves autonomy
    and latches. STOP does the same in every mode and blocks the bus. Faults of camera and perception from HOLD on blank the advice.
    Priority, sound and cooldown of the alert follow from the reaction (``alerts.ALERTS``).
    """

    WARN = 0
    HOLD = 1
    DISARM = 2
    STOP = 3


class Area(StrEnum):
    """The part of the system in which a fault is."""

    CAMERA = "camera"
    PERCEPTION = "perception"
    PROGRAM = "program"
    SERVOS = "servos"
    HOST = "host"
    OPERATOR = "operator"


class Cause(StrEnum):
    """The fault table, worst and most telling cause first. The value is the name in files.

    Attributes
    ----------
    text : fits a badge (60 characters at most).
    what_to_do : for the operator.
    recheck : nothing is known about the servos after it, as after every stop: they must be checked before anything moves again.
    """

    area: Area
    reaction: Reaction
    text: str
    what_to_do: str
    recheck: bool

    def __new__(
        cls,
        value: str,
        area: Area = Area.HOST,
        reaction: Reaction = Reaction.WARN,
        text: str = "",
        what_to_do: str = "",
        recheck: bool = False,
    ) -> Self:  # the defaults are there for type checkers, which take Cause(value) for a call of this
        member = str.__new__(cls, value)
        member._value_ = value
        member.area, member.reaction, member.text, member.what_to_do, member.recheck = area, reaction, text, what_to_do, recheck
        return member

    # fmt: off
    STOP_PRESSED = ("stop pressed", Area.OPERATOR, Reaction.STOP,
        "STOP pressed", "acknowledge, check the servos, arm again; an emergency needs the power cut")
    ESTOP_PRESSED = ("e-stop pressed", Area.SERVOS, Reaction.DISARM,
        "E-stop pressed", "release the E-stop, acknowledge, then zero the servos and arm again", True)
    PORT_LOST = ("servo port lost", Area.SERVOS, Reaction.STOP,
        "Servo port lost", "plug the servo cable in, check the servos, then acknowledge", True)
    SERVO_ALERT = ("servo reports a hardware error", Area.SERVOS, Reaction.STOP,
        "A servo reports a hardware error", "free the wire, restart the servo, acknowledge, then zero it")
    TRACKING = ("servo does not follow", Area.SERVOS, Reaction.STOP,
        "A servo does not follow: jam or slack wire", "look for a jam or a slack wire, then acknowledge")
    STRAINED = ("servo draws too much current", Area.SERVOS, Reaction.STOP,
        "A servo draws too much current", "free what blocks, let it cool, then acknowledge")
    TORQUE_ON = ("torque not proven to be off", Area.SERVOS, Reaction.DISARM,
        "The torque is not proven to be off", "cut the servos' power; until they say so it is tried again")
    SERVOS_WRONG = ("servos are not as configured", Area.SERVOS, Reaction.DISARM,
        "Servos are not as configured", "compare ids, model and mode with the configuration")
    CLOCK = ("clock jumped", Area.HOST, Reaction.DISARM,
        "The clock jumped or the computer slept", "check the robot, acknowledge, arm again", True)
    # before the silence that it causes: the first cause is the one that is shown
    BUS_NOISE = ("bad packets on the servo bus", Area.SERVOS, Reaction.DISARM,
        "Too many bad packets from the servos", "check plugs and shielding of the servo cable, then acknowledge")
    SUPPLY_LOST = ("servo power lost", Area.SERVOS, Reaction.DISARM,
        "No servo power: E-stop pressed, or supply off", "release the E-stop or switch the supply on; acknowledge, zero", True)
    SERVO_SILENT = ("servo silent", Area.SERVOS, Reaction.DISARM,
        "A servo does not answer", "check its cable and power, then acknowledge", True)
    BUS_DEAD = ("servo bus lost", Area.SERVOS, Reaction.DISARM,
        "Nothing heard from the servo bus", "acknowledge, then switch the servos on: that starts it again", True)
    REBOOTED = ("servo restarted", Area.SERVOS, Reaction.DISARM,
        "A servo restarted and lost its zero", "acknowledge, then zero the servos again", True)
    TORQUE_TAKEN = ("torque switched off by another program", Area.SERVOS, Reaction.DISARM,
        "Another program switched the torque off", "end that program (doctor names it), check the wires, then acknowledge", True)
    WATCHDOG = ("bus watchdog tripped", Area.SERVOS, Reaction.DISARM,
        "The servos' watchdog tripped", "check the servos, then acknowledge", True)
    HOT = ("servo too hot", Area.SERVOS, Reaction.DISARM,
        "A servo is too hot", "let it cool, lower the pretension, then acknowledge")
    VOLTAGE_LOW = ("supply voltage too low", Area.SERVOS, Reaction.DISARM,
        "The servos' supply voltage is too low", "check the power supply, then acknowledge")
    WINDOW_HUNG = ("window hangs", Area.HOST, Reaction.DISARM,
        "The window does not answer", "acknowledge when it answers again; restart it if it does not")
    HEARTBEAT_LOST = ("worker stopped", Area.HOST, Reaction.DISARM,
        "The perception worker stopped", "start again with F5, then acknowledge")
    CAMERA_LOST = ("camera lost", Area.CAMERA, Reaction.DISARM,
        "Camera lost", "plug the camera in and start again, then acknowledge")
    CAMERA_FROZEN = ("camera frozen", Area.CAMERA, Reaction.DISARM,
        "The camera gives the same picture", "start the camera again, then acknowledge")
    WRONG_FORMAT = ("wrong picture format", Area.CAMERA, Reaction.DISARM,
        "The camera's picture has the wrong format", "set the camera's size and colour format, then acknowledge")
    CAMERA_MOVED = ("camera moved", Area.CAMERA, Reaction.DISARM,
        "The camera was moved", "put it back, or calibrate the rig and make its bench again (without: F5); acknowledge")
    FRAMES_LOST_LONG = ("too many frames lost for long", Area.CAMERA, Reaction.DISARM,
        "Too many camera frames lost", "check the USB port and cable, then acknowledge")
    MODEL_UNFIT = ("model unfit", Area.PERCEPTION, Reaction.DISARM,
        "The model is missing or damaged", "put the model back or choose another one in the configuration")
    SEVERAL_ROBOTS = ("several robots in view", Area.PERCEPTION, Reaction.DISARM,
        "Several robots in view", "leave one robot in the picture, then acknowledge")
    OUTSIDE_VESSEL = ("robot outside the vessel", Area.PERCEPTION, Reaction.DISARM,
        "The robot seems outside the vessel", "look at the phantom; retract by hand, then acknowledge")
    NOT_FINITE_REPEATED = ("results not finite again and again", Area.PERCEPTION, Reaction.DISARM,
        "Perception gave broken results", "start again with F5, then acknowledge")
    COMMANDS_REJECTED = ("commands rejected again and again", Area.PROGRAM, Reaction.DISARM,
        "The program's commands were rejected", "acknowledge; if it comes again, report it with the log")
    WRONG_TURN = ("head turns against the command", Area.PROGRAM, Reaction.DISARM,
        "The head turns the other way than it is steered", "check the tendons; Rig, Calibrate: Wiggle, Steering; acknowledge")
    WRONG_FEED = ("robot moves against the feed", Area.PROGRAM, Reaction.DISARM,
        "The robot moves the other way than it is fed", "check the feed's direction; Rig, Calibrate: Wiggle; acknowledge")
    HEAD_LOST_LONG = ("head lost for long", Area.PERCEPTION, Reaction.DISARM,
        "The robot's head is lost", "bring the robot back into view by hand, then acknowledge")
    POSE_LOST = ("pose lost", Area.PERCEPTION, Reaction.DISARM,
        "No pose for half a second", "wait for a pose or drive by hand, then acknowledge")
    BUS_SILENT = ("servo bus silent", Area.SERVOS, Reaction.HOLD,
        "The servo bus is silent", "wait a moment; if it stays, check the cable")
    CAMERA_SILENT = ("no new frame", Area.CAMERA, Reaction.HOLD,
        "No new picture from the camera", "wait a moment; if it stays, check the cable")
    IMAGE_BLACK = ("picture black", Area.CAMERA, Reaction.HOLD,
        "The picture is black", "take the lens cap off or switch the lamp on")
    IMAGE_WHITE = ("picture overexposed", Area.CAMERA, Reaction.HOLD,
        "The picture is overexposed", "dim the lamp or lower the exposure")
    FRAMES_LOST = ("too many frames lost", Area.CAMERA, Reaction.HOLD,
        "Many camera frames are lost", "check the USB port and cable")
    NOT_FINITE = ("result not finite", Area.PERCEPTION, Reaction.HOLD,
        "Perception gave a broken result", "wait for the next picture")
    COMMAND_REJECTED = ("command rejected", Area.PROGRAM, Reaction.HOLD,
        "The gate rejected a command", "wait a moment, or drive by hand")
    HEAD_LOST = ("head lost", Area.PERCEPTION, Reaction.HOLD,
        "The robot's head is out of sight", "bring the robot back into view by hand")
    HEAD_JUMP = ("pose jumped", Area.PERCEPTION, Reaction.HOLD,
        "The head jumped in the picture", "wait for the next pictures")
    BRANCH_UNCLEAR = ("two branches fit", Area.PERCEPTION, Reaction.HOLD,
        "Two branches fit", "click the target in the picture")
    POOR_VIEW = ("robot or vessel not clear", Area.PERCEPTION, Reaction.HOLD,
        "Robot or vessel not clearly seen", "improve light and focus, remove what covers them")
    CONFIDENCE_LOW = ("confidence too low", Area.PERCEPTION, Reaction.HOLD,
        "Perception is not sure enough", "improve light and focus, or drive by hand")
    UNKNOWN_KIND = ("picture of an unknown kind", Area.PERCEPTION, Reaction.HOLD,
        "The picture is of an unknown kind", "teach the model pictures of this rig, or drive by hand")
    POSE_STALE = ("pose stale", Area.PERCEPTION, Reaction.HOLD,
        "The pose is too old", "wait a moment; close other programs if it stays")
    NO_TARGET = ("no way to a destination", Area.OPERATOR, Reaction.HOLD,
        "No way to a target", "click a target ahead of the robot")
    DEADMAN = ("deadman released", Area.OPERATOR, Reaction.HOLD,
        "Deadman released", "press it again at once, or hand over again")
    FRAMES_DROPPED = ("frames dropped", Area.CAMERA, Reaction.WARN,
        "The camera drops frames", "check the USB port and cable")
    OUT_OF_ORDER = ("pictures out of order", Area.CAMERA, Reaction.WARN,
        "The camera's pictures come out of order", "nothing to do: late ones are left out; check the driver")
    WARM = ("servo getting hot", Area.SERVOS, Reaction.WARN,
        "A servo is getting hot", "pause soon and let it cool")
    VOLTAGE_SAGS = ("supply voltage sags", Area.SERVOS, Reaction.WARN,
        "The servos' supply voltage sags", "check the power supply")
    DISK_LOW = ("disk nearly full", Area.HOST, Reaction.WARN,
        "The disk is nearly full", "make room or end the recording")
    DISK_FULL = ("disk full", Area.HOST, Reaction.WARN,
        "Disk full: recording stopped", "make room and record again; driving goes on")
    RECORDING_STOPPED = ("recording stopped", Area.HOST, Reaction.WARN,
        "The recording stopped", "do what it says and record again; driving goes on")
    RECORDER_BEHIND = ("recorder drops frames", Area.HOST, Reaction.WARN,
        "The recorder drops frames", "close other programs or record at a lower rate")
    # fmt: on


CAUSES = tuple(Cause)


@dataclass(frozen=True, slots=True)
class Fault:
    """A cause that is active; ``detail`` adds the measured value and its threshold."""

    cause: Cause
    detail: str = ""

    @property
    def holds(self) -> bool:
        """Whether the reaction is more than a warning."""
        return self.cause.reaction >= Reaction.HOLD


def first_fault(faults: Iterable[Fault]) -> Fault | None:
    """The fault that comes first in the table; None without faults."""
    return min(faults, key=lambda fault: CAUSES.index(fault.cause), default=None)


def worst(faults: Iterable[Fault], reaction: Reaction) -> Fault | None:
    """The first fault with exactly this reaction; None when there is no such fault."""
    return first_fault(fault for fault in faults if fault.cause.reaction is reaction)


AT_ONCE: dict[Reason, Cause] = {
    Reason.UNREADABLE: Cause.WRONG_FORMAT,
    Reason.NO_MODEL: Cause.MODEL_UNFIT,
    Reason.SEVERAL_ROBOTS: Cause.SEVERAL_ROBOTS,
    Reason.OUTSIDE_VESSEL: Cause.OUTSIDE_VESSEL,
    Reason.AMBIGUOUS_BRANCH: Cause.BRANCH_UNCLEAR,
    Reason.HEAD_JUMP: Cause.HEAD_JUMP,
    Reason.BENCH_MOVED: Cause.CAMERA_MOVED,
    Reason.OTHER_BENCH: Cause.CAMERA_MOVED,
    Reason.LOW_CONFIDENCE: Cause.CONFIDENCE_LOW,
    Reason.UNLIKE_TRAINING: Cause.UNKNOWN_KIND,
    Reason.BLURRED: Cause.POOR_VIEW,
    Reason.NO_VESSEL: Cause.POOR_VIEW,
    Reason.TOO_SHORT: Cause.POOR_VIEW,
    Reason.GAP_TOO_LONG: Cause.POOR_VIEW,
    Reason.AMBIGUOUS_PATH: Cause.POOR_VIEW,
}
"""Refusals of perception that are a fault at the first frame."""

AFTER_SOME: dict[Reason, Cause] = {
    Reason.BLACK: Cause.IMAGE_BLACK,
    Reason.WHITE: Cause.IMAGE_WHITE,
    Reason.NO_ROBOT: Cause.HEAD_LOST,
}
"""Refusals that are a fault after some frames in a row."""
