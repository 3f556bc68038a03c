"""What the window shows of driving: one frozen picture of the pilot's newest turn."""

from __future__ import annotations

from dataclasses import dataclass

from core.control.alerts import Alert
from core.control.faults import Cause, Fault
from core.control.gate_checks import Source
from core.control.modes import Hindrance, Mode
from core.types import Advice, Command

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
