"""The torque-off that a stop owes (``servos.torque_off_on_stop``), where the bus process that pays it is gone or hangs."""

from __future__ import annotations

import math

from core.control.faults import Cause, Fault

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
