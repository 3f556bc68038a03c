"""The bus process's loop: read all servos, decide, write; and listen to STOP and requests in between."""

from __future__ import annotations

import logging
import math
import os
import time
from collections.abc import Callable
from dataclasses import replace

from core.control.faults import REACTION, Cause, Fault, Reaction
from core.safety_config import SafetyConfig
from core.servo_config import ServosConfig
from hardware.servos.bus_guard import BusGuard
from hardware.servos.bus_messages import BusPhase, BusStatus
from hardware.servos.dynamixel import ServoBus
from hardware.servos.errors import NotReady, PortLost, ServoError, TorqueStillOn
from hardware.servos.guard_end import GuardEnd, Request
from hardware.servos.line import LATE_S
from hardware.servos.status_block import MissingServo, ServoReading, ServoState
from hardware.servos.stopwatch import Stopwatch
from hardware.servos.torque_debt import TorqueDebt

_LINGER_S = 0.2
"""So long after disarming for silence the servos are still polled, to see that they hold."""
_REOPEN_S = 1.0
_SAME_STOP_S = 0.5
_LOOKS_BEFORE_ARMING = 3
_SETTLE_CYCLES = 5
_SETTLED_MM = 0.2
_WINDOW_S = 10.0
_TRIES_ON_REQUEST, _TRIES_AT_END = 4, 15
_log = logging.getLogger(__name__)


class BusLoop:
    """Owns bus and guard. ``run`` returns when the application ends it, or is gone; the servos hold by then."""

    def __init__(self, end: GuardEnd, bus: ServoBus, servos: ServosConfig, safety: SafetyConfig) -> None:
        self._end, self._bus, self._servos = end, bus, servos
        self._guard = BusGuard(servos, safety, time.monotonic())
        self._period_s = 1.0 / servos.bus_hz
        self._times = Stopwatch(round(_WINDOW_S * servos.bus_hz))
        self._cycle = 0
        self._readings: tuple[ServoReading, ...] = ()
        self._corrupt = self._bad_packets = 0
        self._settle = 0
        self._ended = self._quiet = self._lost = False
        self._reopen_at_s = 0.0
        self._not_open = ""
        self._stop_s = -math.inf
        self._debt = TorqueDebt(bus, self._guard)
        self._does: dict[str, Callable[[Request], None]] = {
            "open": lambda _: self._open(),
            "zero": lambda request: bus.set_zero(request.details.get("names")),
            "arm": lambda _: self._arm(),
            "disarm": lambda _: self._disarm(),
            "acknowledge": lambda _: self._guard.acknowledge(),
            "reboot": self._reboot,
            "torque off": lambda _: self._torque_off(),
        }

    def end(self) -> None:
        """Let ``run`` return soon; for a signal handler."""
        self._ended = True

    def run(self) -> None:
        """Turn until the end. Afterwards the servos hold, a torque-off that was owed is paid, and the port is free."""
        due_s = time.monotonic()
        try:
            while not self._ended:
                self._listen_until(due_s)
                if not self._ended:
                    self._turn()
                    due_s = max(due_s + self._period_s, time.monotonic())
        finally:
            try:
                self._pay_at_end()
            finally:
                self._bus.close()

    def _pay_at_end(self) -> None:
        """STOP that nobody has heard yet, and a torque-off that is still owed: after this process nobody pays it."""
        if self._end.take_stop():
            self._hear_stop()
        if self._debt.owed and not self._bus.is_open:
            self._reopen(time.monotonic())
        if self._debt.owed:
            self._guard_port(lambda: self._debt.pay(_TRIES_AT_END))
        self._publish(time.monotonic())
        if self._debt.owed:
            text = f"the servo bus process ends, and {self._debt.problem}"
            _log.error(text)
            self._end.last_words(text)

    def _listen_until(self, due_s: float) -> None:
        """Serve STOP and requests at once, until the next cycle is due."""
        while not self._ended:
            left_s = due_s - time.monotonic()
            line, requests = self._end.wait(left_s)
            stop = line and self._end.take_stop()
            if stop:
                self._hear_stop()
            if requests and (request := self._end.take_request()) is not None:
                self._serve(request, after_stop=stop)
            self._ended = self._ended or self._end.is_alone
            if left_s <= 0.0:
                return

    def _hear_stop(self) -> None:
        """A key that stays down and a broken wire say it fifty times a second; held as often, a tendon under load would creep."""
        now_s = time.monotonic()
        is_same = self._guard.stopped and now_s - self._stop_s < _SAME_STOP_S
        self._stop_s = now_s
        if not is_same:
            self._guard_port(lambda: self._end_motion(Fault(Cause.STOP_PRESSED)))

    def _turn(self) -> None:
        """One cycle."""
        started_s = time.monotonic()
        self._cycle += 1
        silence_s = self._guard.silence_s(self._end.heartbeat(), started_s)
        is_settled = not self._guard.armed and not self._debt.owed
        self._quiet = is_settled and silence_s > self._servos.heartbeat_timeout_s + _LINGER_S
        self._readings = ()
        if self._bus.is_open and not self._quiet:
            self._guard_port(self._talk)
        elif self._lost and started_s >= self._reopen_at_s:
            self._reopen(started_s)
        self._publish(time.monotonic())
        self._times.note(started_s, time.monotonic())

    def _look(self) -> Fault | None:
        """Read all servos; the fault that ends the motion, when one is going on and must end."""
        self._readings = self._bus.read()
        errors = self._new_errors()
        now_s = time.monotonic()
        return self._guard.see(self._readings, errors, self._end.heartbeat(), now_s)

    def _talk(self) -> None:
        """Read, decide, write."""
        fault = self._look()
        if fault is not None:
            self._end_motion(fault)
        elif self._guard.armed:
            self._drive()
        elif self._debt.owed:
            self._debt.pay()
        elif self._settle > 0:
            self._settle -= 1
            if not self._holds():
                self._bus.hold()

    def _drive(self) -> None:
        order, beat = self._end.order(), self._end.heartbeat()
        now_s = time.monotonic()  # after both: nothing in them is from the future
        step = self._guard.step(order, beat, now_s)
        if step.goals_mm is None:
            return
        try:
            self._guard.wrote(self._bus.write(step.goals_mm), self._guard.followed, now_s)
        except (NotReady, ValueError) as error:  # the driver saw what the guard did not, or the zeros leave no room for the goals
            self._end_motion(Fault(Cause.SERVOS_WRONG, str(error)))

    def _end_motion(self, fault: Fault) -> None:
        """Goal = measured; no more goals. What stops may switch the torque off, too."""
        self._guard.end_motion(fault)
        if REACTION[fault.cause] is Reaction.STOP and self._servos.torque_off_on_stop:
            self._debt.owe()
        if not self._bus.is_open:
            return
        self._settle = _SETTLE_CYCLES
        self._bus.disarm()
        if self._debt.owed:
            self._debt.pay()

    def _holds(self) -> bool:
        """Whether all servos that tell have a goal where they are; a hold has no answer, and may have got lost."""
        return all(
            abs(reading.goal_ticks - reading.ticks) <= _SETTLED_MM * abs(joint.ticks_per_mm)
            for joint, reading in zip(self._servos.joints, self._readings, strict=True)
            if isinstance(reading, ServoState) and reading.torque
        )

    def _guard_port(self, action: Callable[[], None]) -> None:
        """Do it; a port that vanishes meanwhile stops everything, and is opened again when it comes back. Never armed again."""
        try:
            action()
        except PortLost:
            self._lose_port()

    def _lose_port(self) -> None:
        self._guard.end_motion(self._guard.lost_port())
        if self._debt.owed or self._servos.torque_off_on_stop:
            self._debt.owe()
        self._readings = ()
        self._lost, self._not_open = True, ""
        self._reopen_at_s = time.monotonic() + _REOPEN_S

    def _reopen(self, now_s: float) -> None:
        self._reopen_at_s = now_s + _REOPEN_S
        if os.path.exists(self._servos.port or ""):
            try:
                self._open()
            except ServoError as error:
                self._not_open = str(error)
                self._debt.pay_unopened()

    def _open(self) -> None:
        if not self._bus.is_open:
            self._bus.open()
            self._corrupt = self._bus.counts.corrupt
            self._lost = False
            self._not_open = ""

    def _arm(self) -> None:
        if not self._bus.is_open:
            raise NotReady(f"not armed: {self._not_open or 'the servo port is not open'}")
        if not self._guard.armed:
            self._look_before_arming()
        self._guard.check_arming()
        try:
            self._bus.arm()
        except TorqueStillOn:  # some pull, some do not, and nobody drives: it is tried until they have all let go
            self._debt.owe()
            raise
        self._settle = 0
        self._debt.forgive()
        self._guard.set_armed(time.monotonic())

    def _look_before_arming(self) -> None:
        """Where all joints are. A quiet bus was not read for long, and after a zero the last positions mean nothing.

        The guard takes in whole sets only, so one servo's late answer is no reason to go by the old ones. Raises NotReady.
        """
        for left in reversed(range(_LOOKS_BEFORE_ARMING)):
            self._look()
            missing = [reading for reading in self._readings if isinstance(reading, MissingServo)]
            if not missing:
                return
            if left:
                time.sleep(LATE_S)  # whoever was silent is not asked before
        silent = ", ".join(f"{one.name} (id {one.id}): {one.reason}" for one in missing)
        raise NotReady(f"not armed: {silent}; check its supply and cable")

    def _disarm(self) -> None:
        self._guard.disarm()
        if self._bus.is_open:
            self._settle = _SETTLE_CYCLES
            self._bus.disarm()

    def _reboot(self, request: Request) -> None:
        if self._guard.armed:
            raise NotReady("the servos are armed: disarm before a reboot")
        self._bus.reboot(int(request.details.get("servo_id", -1)))

    def _torque_off(self) -> None:
        """Owed from now on, whatever becomes of the first tries: who asked for it is told, and it is tried with each turn."""
        self._guard.disarm()
        self._settle = 0
        self._debt.owe()
        if self._bus.is_open:
            self._debt.pay(_TRIES_ON_REQUEST)
        else:
            self._debt.pay_unopened()
        if self._debt.owed:
            raise TorqueStillOn(self._debt.problem)

    def _serve(self, request: Request, *, after_stop: bool) -> None:
        """Do it and answer. `after_stop`: STOP came while the request waited, and nobody can have seen that who asked before."""
        if request.what == "end":
            self._ended = True
            return
        error: ServoError | None = None
        try:
            if (action := self._does.get(request.what)) is None:
                raise NotReady(f"the servo bus process does not know how to {request.what}")
            if after_stop and request.what == "acknowledge":
                raise NotReady("STOP was pressed meanwhile: acknowledge again")
            action(request)
        except PortLost as lost:
            error = lost
            self._lose_port()
        except ServoError as refused:
            error = refused
        self._guard.heard(time.monotonic())
        self._publish(time.monotonic())
        self._end.answer(request, error)

    def _new_errors(self) -> int:
        """Damaged answers since the last cycle."""
        errors = self._bus.counts.corrupt - self._corrupt
        self._corrupt += errors
        self._bad_packets += errors
        return errors

    def _phase(self) -> BusPhase:
        guard = self._guard
        if not self._bus.is_open:
            return BusPhase.CLOSED
        if guard.armed:
            return BusPhase.ARMED
        if guard.stopped:
            return BusPhase.STOPPED
        return BusPhase.QUIET if self._quiet else BusPhase.DISARMED

    def _publish(self, now_s: float) -> None:
        guard = self._guard
        self._end.publish(
            BusStatus(
                cycle=self._cycle,
                time_s=now_s,
                phase=self._phase(),
                servos=self._readings,
                active=guard.active,
                latched=guard.latched,
                fault_counts=dict(guard.fault_counts),
                sent=guard.sent,
                rejection=guard.rejection,
                clamps=guard.clamps,
                at_end=guard.at_end,
                rejections=dict(guard.rejections),
                clamp_count=guard.clamp_count,
                line=replace(self._bus.counts),
                bad_packets=self._bad_packets,
                restarts=guard.restarts,
                torque_offs=self._debt.paid,
                torque_problem=self._debt.problem,
                times=self._times.summary,
                zeroed=tuple(zero is not None for zero in self._bus.zero_ticks),
            )
        )
