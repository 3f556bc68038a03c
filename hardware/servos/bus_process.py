"""The servo bus in its own process, with the gate inside: it survives whatever happens to the application, and stops the servos.

The application starts it (``bus_start``) as ``python -m hardware.servos.bus_process MEMORY LINE SOCKET PARENT``. Its life:

- 50 times a second it reads all servos, takes the newest order through the gate, and writes (``bus_loop``, ``bus_guard``).
- An order is good for 100 ms and for one bounded step. Heartbeats that stop for ``heartbeat_timeout_s`` disarm; then the process
  falls silent, so that the servos' own watchdogs trip as a second layer. When the application wakes up, it finds the cause latched.
- STOP has a pipe of its own. When the application is gone, that pipe ends: the servos hold, and the process ends.
- The process itself stopped or killed: each servo ends at its last goal, within one step; then its watchdog trips.

The bus process's loop: read all servos, decide, write; and listen to STOP and requests in between.

A torque-off that was asked for, owed until every servo has said that it is done.

How evenly the bus process turns.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import math
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

from core.config.safety import SafetyConfig, ServosConfig
from core.control.faults import REACTION, Cause, Fault, Reaction
from hardware.servos.bus_guard import BusGuard
from hardware.servos.bus_ipc import BusPhase, BusServer, BusStatus, CycleTimes, Request
from hardware.servos.dynamixel_bus import ServoBus
from hardware.servos.dynamixel_port import LATE_S, NotReady, PortError, PortLost, ServoError, TorqueStillOn
from hardware.servos.registers import MissingServo, ServoReading, ServoState

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


_RENEW_CYCLES = 25


class Stopwatch:
    """Percentiles over the last `cycles`, renewed every now and then."""

    def __init__(self, cycles: int) -> None:
        self._periods: deque[float] = deque(maxlen=cycles)
        self._works: deque[float] = deque(maxlen=cycles)
        self._last_s: float | None = None
        self._noted = 0
        self.summary = CycleTimes()

    def note(self, started_s: float, ended_s: float) -> None:
        """One cycle, by the monotonic clock."""
        if self._last_s is not None:
            self._periods.append(1000.0 * (started_s - self._last_s))
        self._last_s = started_s
        self._works.append(1000.0 * (ended_s - started_s))
        self._noted += 1
        if self._noted % _RENEW_CYCLES == 0:
            self.summary = CycleTimes(*_percentiles(self._periods), *_percentiles(self._works))


def _percentiles(values: Sequence[float]) -> tuple[float, float]:
    """The median and the 99th percentile."""
    ordered = sorted(values)
    return ordered[len(ordered) // 2], ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))]


_LINGER_S = 0.2
"""So long after disarming for silence the servos are still polled, to see that they hold."""
_REOPEN_S = 1.0
_SAME_STOP_S = 0.5
_LOOKS_BEFORE_ARMING = 3
_SETTLE_CYCLES = 5
_SETTLED_MM = 0.2
_WINDOW_S = 10.0
_TRIES_ON_REQUEST, _TRIES_AT_END = 4, 15


class BusLoop:
    """Owns bus and guard. ``run`` returns when the application ends it, or is gone; the servos hold by then."""

    def __init__(self, end: BusServer, bus: ServoBus, servos: ServosConfig, safety: SafetyConfig) -> None:
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


_log = logging.getLogger(__name__)

_PRIORITY = -10


def main(arguments: list[str]) -> int:
    """Run until the application ends or is gone; 0 unless something broke. Arguments: three file descriptors and the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the application decides what Ctrl-C means
    memory, line, requests, parent = map(int, arguments)
    end = BusServer(memory, line, requests, parent)
    try:
        return _guard(end)
    except Exception as error:  # noqa: BLE001 - top of the process: the loop has closed the bus, and the application is told
        _log.exception("the servo bus process stopped")
        end.last_words(f"{type(error).__name__}: {error}")
        return 1
    finally:
        end.close()


def _guard(end: BusServer) -> int:
    message = end.first_message()
    if message is None:
        return 0
    servos, safety = ServosConfig.model_validate(message["servos"]), SafetyConfig.model_validate(message["safety"])
    try:
        bus = ServoBus(servos)
    except ServoError as error:
        end.last_words(str(error))
        return 1
    with contextlib.suppress(PermissionError):  # the servos come before the pictures, where the system allows it
        os.setpriority(os.PRIO_PROCESS, 0, _PRIORITY)
    loop = BusLoop(end, bus, servos, safety)
    signal.signal(signal.SIGTERM, lambda *_: loop.end())
    gc.collect()
    gc.freeze()  # what is loaded stays: later collections are short
    loop.run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
