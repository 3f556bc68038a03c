"""What the pilot tells the operator: which of the lines of a turn, and each only as often as it is worth."""

from __future__ import annotations

import threading

from core.control.alerts import ALERTS, Alert, AlertKey, AlertQueue, Note, raise_alerts
from core.control.faults import AREA, REACTION, Area, Cause, Fault, Reaction
from core.control.gate_checks import Rejection, RejectReason, Source
from core.control.guarded_robot import SentMotion
from core.control.hand import Jog
from core.control.modes import ARMED_MODES, DRIVING_MODES, Decision, Hindrance, Mode, SupervisorState

_MOST_ALERTS = 200
_NOT_WORTH_A_WORD = frozenset(
    {RejectReason.NOT_ARMED, RejectReason.WRONG_SOURCE, RejectReason.NO_COMMAND, RejectReason.OUT_OF_ORDER}
)


class Teller:
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
