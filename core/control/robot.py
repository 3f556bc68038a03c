"""The pilot's interface to a robot: every command passes the gate, and it stops by itself when the program falls silent."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from core.config.safety import JointName
from core.control.bus_monitor import BusReport
from core.control.gate import Rejection, RejectReason, Source
from core.control.joints import Retracted
from core.control.kept_zero import ZeroRequest
from core.types import Command, RobotStatus


@dataclass(frozen=True, slots=True)
class SentMotion:
    """What left the gate in the newest cycle.

    ``motion`` is the commanded one; ``source`` whose command it was (None: a hold) and ``captured_s`` the capture of the frame
    behind it; ``rejection`` why a command was not followed; ``at_end`` the joints at the end of their envelope; ``at_low`` the
    goals (mm) of feeds at the low end of theirs, or below it.
    """

    cycle: int
    time_s: float
    motion: Command
    source: Source | None = None
    captured_s: float | None = None
    rejection: RejectReason | None = None
    at_end: tuple[JointName, ...] = ()
    at_low: Mapping[JointName, float] = field(default_factory=dict)


class BenchClock(Protocol):
    """The clock of a simulated bench, which goes on only as far as it is granted, and `speed` simulated seconds a second."""

    def __call__(self) -> float: ...
    def grant(self, until_s: float) -> None: ...
    @property
    def speed(self) -> float: ...


class GuardedRobot(Protocol):
    """All methods may be called from any thread. ``stop`` never waits and never fails.

    ``connect``, ``arm``, ``disarm``, ``acknowledge``, ``zero``, ``reboot``, ``relax`` and ``torque_off`` may take seconds and raise
    ``DeviceError``; all the others are quick. ``kept_back`` is why nothing has left the gate since arming, not even a hold: while
    it is not None there is no ``sent_motion`` either, and neither source can drive. A command that ``retracts`` is the operator's,
    and may pull a feed beyond the low end of its envelope. ``relax`` waits no longer when a torque-off was asked for
    (``is_overtaken``). ``zero`` without a request: all joints stand at zero.
    """

    @property
    def name(self) -> str: ...
    @property
    def failure(self) -> str | None: ...
    def connect(self) -> None: ...
    def status(self) -> RobotStatus: ...
    def hold(self) -> None: ...
    def close(self) -> None: ...
    def beat(self, permitted: Source | None) -> None: ...
    def send(
        self,
        command: Command,
        *,
        source: Source = Source.OPERATOR,
        captured_s: float | None = None,
        retracts: Retracted = Retracted.NONE,
    ) -> Command: ...
    def stop(self) -> None: ...
    def arm(self) -> None: ...
    def disarm(self) -> None: ...
    def acknowledge(self) -> None: ...
    def zero(self, request: ZeroRequest | None = None) -> None: ...
    def reboot(self, servo_id: int) -> None: ...
    def relax(self, is_overtaken: Callable[[], bool] = ...) -> None: ...
    def torque_off(self) -> None: ...
    def report(self) -> BusReport | None: ...
    def sent_motion(self) -> SentMotion | None: ...
    def kept_back(self) -> Rejection | None: ...
