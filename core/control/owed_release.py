"""The torque-off that a stop owes (``servos.torque_off_on_stop``), where the bus process that pays it is gone or hangs."""

from __future__ import annotations

import math

from core.control.faults import Cause, Fault
from core.control.modes import Mode

AGAIN_S = 10.0
"""A cable that is plugged in again is found after this long, at the latest."""
_LOST = Fault(Cause.TORQUE_ON, "the servo bus is lost")


class OwedRelease:
    """Owed from a stop on until all servos have let go, or were switched on again. A living bus process pays it by itself.

    Parameters
    ----------
    is_wanted : whether a stop switches the torque off at all.
    """

    def __init__(self, *, is_wanted: bool) -> None:
        self._is_wanted = is_wanted
        self._is_owed = self._is_left = False
        self._tried_s = -math.inf

    def stopped(self) -> None:
        """A stop, or another one; the next try need not wait."""
        self._is_owed, self._tried_s = self._is_wanted, -math.inf

    def paid(self) -> None:
        """The torque of all servos is off, or was switched on by the operator."""
        self._is_owed = self._is_left = False

    def fault(self, *, is_lost: bool) -> Fault | None:
        """What the operator must know from the moment on when nobody pays it, until it is paid; also while it is tried."""
        self._is_left = self._is_left or (self._is_owed and is_lost)
        return _LOST if self._is_left else None

    def is_due(self, mode: Mode, now_s: float, *, is_lost: bool, is_busy: bool) -> bool:
        """Whether it must be asked for now. Once the stop is acknowledged the servos are the operator's to ask."""
        if not (self._is_owed and is_lost) or mode is not Mode.STOPPED or is_busy or now_s - self._tried_s < AGAIN_S:
            return False
        self._tried_s = now_s
        return True
