"""What the pilot shows: one frozen view of its newest turn, and the figures in it (advice adherence, command latency)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from core.control.alerts import Alert
from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.modes import Hindrance, Mode
from core.control.motion import Jog
from core.control.robot import SentMotion
from core.types import Advice, Command

_REST = Command()


@dataclass(frozen=True, slots=True)
class DriveView:
    """Who drives, what hinders, and the policy's advice, both sources' commands and what was sent, each by itself.

    Attributes
    ----------
    time_s : monotonic.
    permitted : whose commands are sent; None: neither's, also while nothing can be sent to the robot yet.
    latched, active : first cause of the last disarming until it is acknowledged; all faults now.
    against_arming, against_hand_over : why either request would be refused now; empty: it would be granted. The reasons against a
        hand-over leave out the deadman, which the operator presses with it.
    keyboard_deadman : the keyboard alone may be the deadman on this rig.
    simulated : camera and servos are the twin's.
    deadman : held now, whether the press counts or not; None when no deadman has reported yet.
    servos_on : checked, torque on, following the permitted source.
    busy : what the servos are doing that takes time ("checking the servos"), else empty.
    operator_command, operator_moved_s : the operator's motion, and when it last was not rest (None: never).
    advice : the policy's; None without one, or when it is blanked.
    blanked : why there is no advice, in plain words, when a fault blanks it.
    program_command : what the program asks of the robot while it drives; None when it does not drive.
    sent, sent_by : the motion that left the gate last, and its source; None: a hold, or nothing yet.
    latency_s, latency_p95_s : from the capture of a frame to the first servo command made from it: the newest, and the p95
        of the last hundred.
    follow_share : share of the operator's motion in the last ten seconds that agreed with the advice, 0..1; None: too little.
    """

    time_s: float
    mode: Mode = Mode.ADVISORY
    permitted: Source | None = None
    latched: Fault | None = None
    active: tuple[Fault, ...] = ()
    against_arming: tuple[Hindrance | Cause, ...] = ()
    against_hand_over: tuple[Hindrance | Cause, ...] = ()
    keyboard_deadman: bool = True
    simulated: bool = False
    deadman: bool | None = None
    servos_on: bool = False
    busy: str = ""
    operator_command: Command = _REST
    operator_moved_s: float | None = None
    advice: Advice | None = None
    blanked: str = ""
    program_command: Command | None = None
    sent: Command | None = None
    sent_by: Source | None = None
    latency_s: float | None = None
    latency_p95_s: float | None = None
    follow_share: float | None = None

    def is_change_of(self, before: DriveView) -> bool:
        """Whether mode, latched cause or active causes differ from the view `before`."""
        if before.mode is not self.mode or before.latched != self.latched:
            return True
        return {fault.cause for fault in before.active} != {fault.cause for fault in self.active}


@dataclass(frozen=True, slots=True)
class DriveNews:
    """The newest view, and all alerts and changes since the window last asked, oldest first.

    ``changes`` are the views in which mode, faults or the latched cause changed: the record of driving does not depend on pictures.
    """

    view: DriveView
    alerts: tuple[Alert, ...] = ()
    changes: tuple[DriveView, ...] = ()


_STRAIGHT_DEG = 3.0
"""An advised turn below this is no turn: keeping the head still follows it."""
_LEAST_TICKS = 25
"""Half a second of motion, before which there is no share."""
_ADHERENCE_S = 10.0
"""Motion of so many seconds counts."""
_MOST_LATENCIES = 100


class AdviceAdherence:
    """Share of the operator's motion in the last seconds that agreed with the advice, tick by tick. For display and studies only.

    A tick counts half for a feed forward or backward as advised, and half for steering that is not against an advised turn.
    """

    def __init__(self) -> None:
        self._ticks: deque[tuple[float, float]] = deque()

    def update(self, jog: Jog, advice: Advice | None, now_s: float) -> float | None:
        """The share, 0..1; None as long as the operator moved too little."""
        while self._ticks and not 0.0 <= now_s - self._ticks[0][0] <= _ADHERENCE_S:
            self._ticks.popleft()
        if advice is not None and not (jog.bend == 0.0 and jog.advance == 0.0):
            if jog.advance == 0.0:
                feed_agrees = advice.advance_mm_s == 0.0 or jog.bend != 0.0  # steering first and feeding then follows the advice
            else:
                feed_agrees = jog.advance * advice.advance_mm_s > 0.0
            is_straight = abs(advice.steer_deg) < _STRAIGHT_DEG
            steering_agrees = jog.bend == 0.0 if is_straight else jog.bend * advice.steer_deg >= 0.0
            self._ticks.append((now_s, 0.5 * feed_agrees + 0.5 * steering_agrees))
        if len(self._ticks) < _LEAST_TICKS:
            return None
        return sum(agreed for _, agreed in self._ticks) / len(self._ticks)


class CommandLatency:
    """Time from the capture of a frame to the first command made from it; a frame counts once."""

    def __init__(self) -> None:
        self._captured_s: float | None = None
        self._latencies_s: deque[float] = deque(maxlen=_MOST_LATENCIES)

    @property
    def newest_s(self) -> float | None:
        return self._latencies_s[-1] if self._latencies_s else None

    @property
    def p95_s(self) -> float | None:
        """The 95th percentile of the last hundred."""
        return float(np.percentile(self._latencies_s, 95)) if self._latencies_s else None

    def update(self, sent: SentMotion | None) -> None:
        if sent is not None and sent.captured_s is not None and sent.captured_s != self._captured_s:
            self._captured_s = sent.captured_s
            self._latencies_s.append(sent.time_s - sent.captured_s)
