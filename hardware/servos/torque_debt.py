"""A torque-off that was asked for, owed until every servo has said that it is done."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import replace

from hardware.servos.bus_guard import BusGuard
from hardware.servos.dynamixel import ServoBus
from hardware.servos.errors import PortError, PortLost, ServoError
from hardware.servos.line import LATE_S

_NOT_PROVEN = "the torque is not proven to be off: cut the servos' power"


class TorqueDebt:
    """``problem`` says why what is ``owed`` is not proven yet; ``paid`` counts how often all servos have said so."""

    def __init__(self, bus: ServoBus, guard: BusGuard) -> None:
        self._bus, self._guard = bus, guard
        self.owed = False
        self.problem = ""
        self.paid = 0

    def owe(self) -> None:
        """From now on, until it is paid or the operator switches the servos on."""
        self.owed = True
        if not self._bus.is_open:
            self._tell(_NOT_PROVEN)

    def forgive(self) -> None:
        """The servos were armed, which has switched all torque off and on again."""
        self.owed, self.problem = False, ""

    def pay(self, tries: int = 1) -> None:
        """Switch off and read back, so often at most: a burst of noise takes three packets in a row. Raises PortLost."""
        for left in reversed(range(tries)):
            if self.owed and self._bus.is_open:
                self._pay_once()
            if self.owed and self._bus.is_open and left:
                time.sleep(LATE_S)  # whoever was silent is not asked before
        if self.owed and not self._bus.is_open:
            self._tell(self.problem or _NOT_PROVEN)

    def pay_unopened(self) -> None:
        """On a port that is there, of a bus that cannot be opened: one missing servo is no reason for six to go on pulling."""
        if self.owed:
            with contextlib.suppress(PortError, PortLost):  # nobody has heard it
                self._try(self._bus.let_go)

    def _pay_once(self) -> None:
        self._try(self._bus.torque_off)

    def _try(self, switch_off: Callable[[], None]) -> None:
        try:
            switch_off()
        except (PortError, PortLost):
            raise
        except ServoError as error:
            self._tell(str(error))
        else:
            self.owed = False
            self.paid += 1
            self._tell("")

    def _tell(self, problem: str) -> None:
        """In the status, and in the line of the first cause, which stays; no longer, once it is over."""
        first = self._guard.latched
        if first is not None and problem != self.problem:
            detail = first.detail.removesuffix(self.problem).strip()
            self._guard.latched = replace(first, detail=f"{detail} {problem}".strip())
        self.problem = problem
