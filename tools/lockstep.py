"""Seven ideal servos behind the real ``BusGuard`` and its gate, on the caller's clock: no port, no process, no waiting.

A servo is where the previous cycle sent it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from core.config.safety import SafetyConfig, ServosConfig
from core.control.bus_monitor import BusReport
from core.control.faults import Cause, Fault
from core.control.gate import Rejection, Source
from core.control.joints import Retracted
from core.control.kept_zero import ZeroRequest
from core.control.robot import SentMotion
from core.types import Command, RobotStatus
from hardware.servos.bus_guard import BusGuard, report_of
from hardware.servos.bus_ipc import BusOrder, Heartbeat
from hardware.servos.registers import HardwareError, ServoState


class LockStepServos:
    """A guarded robot for one thread. ``cycle`` does what the bus process does fifty times a second."""

    name = "lock-step servos"
    failure: str | None = None

    def __init__(self, servos: ServosConfig, safety: SafetyConfig, clock: Callable[[], float]) -> None:
        self._servos, self._clock = servos, clock
        self._guard = BusGuard(servos, safety, clock())
        self._at_mm: tuple[float, ...] = (0.0,) * len(servos.joints)
        self._order: BusOrder | None = None
        self._beat: Heartbeat | None = None
        self._torque = self._torque_off_done = False
        self._cycle = self._reported = 0
        self.sent: list[tuple[float, tuple[float, ...]]] = []
        """Time and goals (mm) of every cycle that sent some, oldest first."""

    @property
    def armed(self) -> bool:
        return self._guard.armed

    def positions_mm(self) -> tuple[float, ...]:
        """Positions of the joints."""
        return self._at_mm

    def cycle(self) -> None:
        """Read, decide, move."""
        now_s = self._clock()
        self._cycle += 1
        fault = self._guard.update(self._readings(now_s), 0, self._beat, now_s)
        if fault is not None:
            self._guard.end_motion(fault)
        elif self._guard.armed:
            step = self._guard.step(self._order, self._beat, now_s)
            if step.goals_mm is not None:
                self._at_mm = step.goals_mm
                self._guard.record_sent(step.goals_mm, self._guard.followed, now_s)
                self.sent.append((now_s, step.goals_mm))

    def _readings(self, now_s: float) -> tuple[ServoState, ...]:
        return tuple(
            ServoState(
                joint.name, joint.id, now_s, 0, 0, at_mm, at_mm, 0.0, None, voltage_v=12.0, temperature_c=30.0,
                error=HardwareError(0), torque=self._torque, watchdog_tripped=False,
            )
            for joint, at_mm in zip(self._servos.joints, self._at_mm, strict=True)
        )  # fmt: skip

    def connect(self) -> None:
        """Nothing to do."""

    def close(self) -> None:
        self._guard.disarm()

    def beat(self, permitted: Source | None) -> None:
        self._beat = Heartbeat(self._clock(), permitted)

    def send(
        self,
        command: Command,
        *,
        source: Source = Source.OPERATOR,
        captured_s: float | None = None,
        retracts: Retracted = Retracted.NONE,
    ) -> Command:
        self._order = BusOrder(command, source, self._clock(), captured_s, retracts)
        return self._guard.sent.motion if self._guard.armed and self._guard.sent is not None else Command()

    def hold(self) -> None:
        self._order = BusOrder(None, Source.OPERATOR, self._clock())

    def stop(self) -> None:
        self._guard.end_motion(Fault(Cause.STOP_PRESSED))

    def arm(self) -> None:
        """Raises NotReady."""
        if not self._guard.armed:
            now_s = self._clock()
            self._guard.update(self._readings(now_s), 0, self._beat, now_s)
        self._guard.check_arming()
        self._torque = True
        self._guard.set_armed(self._clock())

    def disarm(self) -> None:
        self._guard.disarm()

    def acknowledge(self) -> None:
        self._guard.acknowledge()

    def zero(self, request: ZeroRequest | None = None) -> None:
        positions_mm = request.positions_mm if request is not None else dict.fromkeys(self._servos.names, 0.0)
        self._at_mm = tuple(positions_mm.get(name, at) for name, at in zip(self._servos.names, self._at_mm, strict=True))

    def reboot(self, servo_id: int) -> None:
        """Nothing to do."""

    def relax(self, is_overtaken: Callable[[], bool] = lambda: False) -> None:
        """At once."""
        self.torque_off()

    def torque_off(self) -> None:
        self._guard.disarm()
        self._torque, self._torque_off_done = False, True

    def report(self) -> BusReport | None:
        if self._cycle == self._reported:
            return None
        self._reported = self._cycle
        report = report_of(self._readings(self._clock()), armed=self._guard.armed, errors=0)
        let_go, self._torque_off_done = self._torque_off_done, False
        return replace(report, armed=self._guard.armed, ended=self._guard.latched, torque_off=let_go)

    def sent_motion(self) -> SentMotion | None:
        sent = self._guard.sent
        if sent is None or not self._guard.armed:
            return None
        return sent.sent_motion(self._cycle, self._guard.rejection, self._guard.at_end, self._servos.joints)

    def kept_back(self) -> Rejection | None:
        return self._guard.rejection if self._guard.armed and self._guard.sent is None else None

    def status(self) -> RobotStatus:
        at = self._at_mm
        return RobotStatus(self._clock(), at[4], (at[5] + at[6]) / 2.0, (at[0], at[1], at[2], at[3]), (0.0,) * 4)
