"""Modes, requests and results of the supervisor."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.health import Health, Report


class Mode(StrEnum):
    """Who drives."""

    ADVISORY = "ADVISORY"
    ARMED = "ARMED"
    AUTONOMOUS = "AUTONOMOUS"
    HOLD = "HOLD"
    STOPPED = "STOPPED"


class Act(StrEnum):
    """Acts of the operator. INPUT is a movement of the controls; TAKE_BACK ends autonomy without one, also at the target."""

    STOP = "stop"
    ACKNOWLEDGE = "acknowledge"
    ARM = "arm"
    HAND_OVER = "hand over"
    TAKE_BACK = "take back"
    DISARM = "disarm"
    INPUT = "input"


class Hindrance(StrEnum):
    """Why a request is refused, apart from active faults; the values stand in sessions of all versions."""

    IS_STOPPED = "stopped"
    UNACKNOWLEDGED = "fault not acknowledged"
    ALREADY_ARMED = "already armed"
    CAMERA_SETTLING = "camera not well for long enough"
    PERCEPTION_SETTLING = "perception not well for long enough"
    SERVOS_UNCHECKED = "servos not checked"
    SERVOS_BUSY = "servos busy"
    NOT_YET_ARMED = "arm first"
    ALREADY_AUTONOMOUS = "already handed over"
    NO_TARGET = "no destination chosen"
    TARGET_BEHIND = "destination behind the robot"
    DEADMAN_NOT_HELD = "deadman not held"
    DEADMAN_HELD_BEFORE = "deadman was down before arming"
    DEADMAN_ON_KEYBOARD = "deadman on the keyboard only"
    OPERATOR_DRIVING = "controls in use"
    # of a LIVE rig (``readiness``)
    FORCE_UNLIMITED = "drive cannot limit its force"
    DRUMS_UNKNOWN = "drums not measured"
    DIRECTIONS_UNKNOWN = "directions of the servos not learned"
    DIRECTIONS_ASSUMED = "up and down assumed"
    STEERING_UNKNOWN = "steering not learned"
    STEERING_WRONG = "right and left act the wrong way"
    MODEL_UNCALIBRATED = "model not calibrated"
    MODEL_UNTAUGHT = "model not taught on this bench"
    CHECKS_OFF = "checks of perception switched off"
    POLICY_BLIND = "policy does not look at the picture"
    NOT_ACCEPTED = "rig not accepted"
    ACCEPTANCE_OUTDATED = "rig changed since it was accepted"


OF_THE_RIG = frozenset(
    {
        Hindrance.FORCE_UNLIMITED,
        Hindrance.DRUMS_UNKNOWN,
        Hindrance.DIRECTIONS_UNKNOWN,
        Hindrance.DIRECTIONS_ASSUMED,
        Hindrance.STEERING_UNKNOWN,
        Hindrance.STEERING_WRONG,
        Hindrance.MODEL_UNCALIBRATED,
        Hindrance.MODEL_UNTAUGHT,
        Hindrance.CHECKS_OFF,
        Hindrance.POLICY_BLIND,
        Hindrance.NOT_ACCEPTED,
        Hindrance.ACCEPTANCE_OUTDATED,
    }
)
"""What a LIVE rig lacks (``readiness``): while it is open, only a change of the settings changes it."""


@dataclass(frozen=True, slots=True)
class AgainstProgram:
    """What stands against the program's driving under the settings that are in force from now on."""

    hindrances: tuple[Hindrance, ...] = ()


Event = Act | Report | AgainstProgram

DRIVING_MODES = frozenset({Mode.AUTONOMOUS, Mode.HOLD})
ARMED_MODES = DRIVING_MODES | {Mode.ARMED}


@dataclass(frozen=True, slots=True)
class RequestRefused:
    """A refused request, with all reasons."""

    act: Act
    reasons: tuple[Hindrance | Cause, ...]


@dataclass(frozen=True, slots=True)
class SupervisorState:
    """State of the supervisor; a fresh one is disarmed, with nothing known.

    Attributes
    ----------
    against_program : why the program may not drive this rig under the settings in force.
    latched : first cause, until it is acknowledged.
    """

    mode: Mode = Mode.ADVISORY
    against_program: tuple[Hindrance, ...] = ()
    health: Health = field(default_factory=Health)
    time_s: float | None = None
    latched: Fault | None = None
    active: tuple[Fault, ...] = ()
    hold_since_s: float = 0.0
    well_since_s: float | None = None
    resumed_s: float | None = None
    camera_unwell_s: float = 0.0
    perception_unwell_s: float = 0.0
    input_s: float | None = None


@dataclass(frozen=True, slots=True)
class Decision:
    """Result of a tick.

    ``permitted`` is the source whose commands the gate may let through. ``blanked`` is why no advice may be shown.
    ``raised`` are the faults that were not active before.
    """

    mode: Mode
    permitted: Source | None
    blanked: Fault | None
    hold_expired: bool
    latched: Fault | None
    active: tuple[Fault, ...]
    raised: tuple[Fault, ...]
    refused: tuple[RequestRefused, ...]
