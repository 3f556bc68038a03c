"""The servo bus in its own process, with the gate inside: it survives whatever happens to the application, and stops the servos.

The application starts it (``bus_ipc.start_bus``) as ``python -m hardware.servos.bus_process MEMORY PIPE SOCKET PARENT``:

- 50 times a second it reads all servos, takes the newest order through the gate, and writes (``BusLoop``, ``bus_guard``).
- An order is good for 100 ms and for one bounded step. Heartbeats that stop for ``heartbeat_timeout_s`` disarm; then the process
  falls silent, so that the servos' own watchdogs trip as a second layer. When the application wakes up, it finds the cause latched.
- STOP has a pipe of its own, which is also read between any two transactions of opening, zeroing, arming and restarting.
- When the application is gone, that pipe ends, and the servos hold. Servos that pull are not left alone: once their watchdogs have
  tripped they are read every second; when ``unattended_s`` is over, or one is too hot, they are let go slowly, then switched off,
  and the process ends. The next one gets the port from it. The same is done for an application that is silent for so long.
- The process itself stopped or killed: each servo ends at its last goal, within one step; then its watchdog trips.
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
from pathlib import Path

from pydantic import ValidationError

from core.config.calibration import ZeroConfig
from core.config.safety import DRIVES, JointName, SafetyConfig, ServosConfig
from core.control.faults import Cause, Fault, Reaction
from core.control.kept_zero import ZeroBasis, ZeroRequest, request_problem, unknown_joint
from core.devices import UserError
from hardware.servos.bus_guard import (
    LINGER_S,
    RELAX_MM_S,
    RELEASE_MM_S,
    RELEASED,
    Attention,
    BusGuard,
    ReleaseRamp,
    UnattendedWatch,
)
from hardware.servos.bus_ipc import BusPhase, BusServer, BusStatus, CycleTimes, PortSuccession, Request, ask_for_port, wall_clock_s
from hardware.servos.drive import DriveBus
from hardware.servos.dynamixel_bus import ServoBus
from hardware.servos.dynamixel_port import (
    LATE_S,
    NotReady,
    PortError,
    PortLost,
    PortTaken,
    ServoError,
    StoppedMeanwhile,
    TorqueStillOn,
)
from hardware.servos.registers import MissingServo, ServoReading, ServoState
from hardware.servos.stepper_board import StepperBoard
from hardware.servos.zero_keeper import ZeroKeeper

_log = logging.getLogger(__name__)

_PRIORITY = -10
_NOT_PROVEN = "the torque is not proven to be off: cut the servos' power"


Bus = ServoBus | DriveBus


def make_bus(servos: ServosConfig, backups: Path | None, now_s: Callable[[], float] = wall_clock_s) -> Bus:
    """The bus of the configured drive. Raises NotReady, PluginError."""
    if servos.driver == "dynamixel":
        return ServoBus(servos, backups=backups, now_s=now_s)
    if servos.port is None:
        raise NotReady("no servo port is configured: set servos.port")
    if servos.driver == "stepper board":
        return DriveBus(servos, StepperBoard(servos.port, servos.baud))
    return DriveBus(servos, DRIVES.make(servos.driver, servos.port, servos.baud))


class BusTorqueRelease:
    """A torque-off that was requested, until every servo has confirmed it, or arming cancels it.

    ``problem`` says why it is not confirmed yet; ``confirmed`` counts how often all servos have confirmed.
    """

    def __init__(self, bus: Bus, guard: BusGuard, port: str | None) -> None:
        self._bus, self._guard, self._port = bus, guard, port
        self.is_requested = False
        self.problem = ""
        self.confirmed = 0

    def request(self) -> None:
        self.is_requested = True
        if not self._bus.is_open:
            self._report(_NOT_PROVEN)

    def cancel(self) -> None:
        """The servos were armed, which has switched all torque off and on again."""
        self.is_requested, self.problem = False, ""

    def release(self, tries: int = 1) -> None:
        """Switch off and read back, at most so often: a burst of noise takes three packets in a row. Raises PortLost."""
        for left in reversed(range(tries)):
            if self.is_requested and self._bus.is_open:
                self._try(self._bus.torque_off)
            if self.is_requested and self._bus.is_open and left:
                time.sleep(LATE_S)  # a late answer would be taken for the next one
        if self.is_requested and not self._bus.is_open:
            self._report(self.problem or _NOT_PROVEN)

    def release_unopened(self) -> None:
        """On a port whose bus cannot be opened: one missing servo is no reason for six to go on pulling."""
        if self.is_requested:
            with contextlib.suppress(PortError, PortLost):
                _with_port(self._port, lambda: self._try(self._bus.let_go))

    def _try(self, switch_off: Callable[[], None]) -> None:
        try:
            switch_off()
        except (PortError, PortLost):
            raise
        except ServoError as error:
            self._report(str(error))
        else:
            self.is_requested = False
            self.confirmed += 1
            self._report("")

    def _report(self, problem: str) -> None:
        """In the status, and in the line of the first cause, which stays; no longer, once it is over."""
        first = self._guard.latched
        if first is not None and problem != self.problem:
            detail = first.detail.removesuffix(self.problem).strip()
            self._guard.latched = replace(first, detail=f"{detail} {problem}".strip())
        self.problem = problem


def _with_port(port: str | None, action: Callable[[], None]) -> None:
    """Do it; a bus process that only watches, without an application, gives the port away for it."""
    try:
        action()
    except PortTaken:
        if port is None or not ask_for_port(port):
            raise
        action()


class CycleTimer:
    """Percentiles over the last `cycles`, renewed every 25 cycles."""

    def __init__(self, cycles: int) -> None:
        self._periods: deque[float] = deque(maxlen=cycles)
        self._works: deque[float] = deque(maxlen=cycles)
        self._last_s: float | None = None
        self._count = 0
        self.summary = CycleTimes()

    def add(self, started_s: float, ended_s: float) -> None:
        """One cycle, by the monotonic clock."""
        if self._last_s is not None:
            self._periods.append(1000.0 * (started_s - self._last_s))
        self._last_s = started_s
        self._works.append(1000.0 * (ended_s - started_s))
        self._count += 1
        if self._count % 25 == 0:
            self.summary = CycleTimes(*_percentiles(self._periods), *_percentiles(self._works))


def _percentiles(values: Sequence[float]) -> tuple[float, float]:
    """The median and the 99th percentile."""
    ordered = sorted(values)
    return ordered[len(ordered) // 2], ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))]


_REOPEN_S = 1.0
"""Between two tries to open a lost port."""
_SAME_STOP_S = 0.5
"""STOPs that come closer are one press."""
_READS_BEFORE_ARMING = 3
_SETTLE_CYCLES, _SETTLED_MM = 5, 0.2
"""After a hold it is checked, and repeated, for so many cycles; so far a goal may be from the position."""
_WINDOW_S = 10.0
_WAITS_FOR_RAMP = frozenset({"zero", "arm", "reboot"})
"""Requests that are refused while tendons are let go slowly."""
_INTERRUPTED_BY_STOP = frozenset({"open", "zero", "arm", "reboot"})
"""Requests that end at a STOP; the others hold the servos or release them, and are finished first."""
_TRIES_ON_REQUEST, _TRIES_AT_END = 4, 15
_LOST_ALONE_S = 10.0
"""Without an application a lost port is waited for so long."""
_OFF_ALONE_S = 30.0
"""And so long it is tried to prove that the torque is off."""


class BusLoop:
    """Owns bus and guard. ``run`` returns when the application ends it, or is gone; the servos hold by then."""

    def __init__(
        self,
        server: BusServer,
        bus: Bus,
        servos: ServosConfig,
        safety: SafetyConfig,
        keeper: ZeroKeeper | None = None,
        now_s: Callable[[], float] = wall_clock_s,
    ) -> None:
        self._server, self._bus, self._servos = server, bus, servos
        self._now_s = now_s
        self._keeper = keeper or ZeroKeeper(servos, None)
        self._guard = BusGuard(servos, safety, self._now_s())
        self._release = BusTorqueRelease(bus, self._guard, servos.port)
        self._period_s = 1.0 / servos.bus_hz
        self._timer = CycleTimer(round(_WINDOW_S * servos.bus_hz))
        self._cycle = 0
        self._readings: tuple[ServoReading, ...] = ()
        self._corrupt = self._bad_packets = 0
        self._settle = 0
        self._ramp: ReleaseRamp | None = None
        self._is_off_after_ramp = False
        self._releases, self._still_tight = 0, tuple[JointName, ...]()
        self._ended = self._quiet = self._lost = self._is_signalled = self._is_hurried = False
        self._watch = UnattendedWatch()
        self._is_let_go = False
        self._succession: PortSuccession | None = None
        self._give_up_s = math.inf
        self._reopen_at_s = 0.0
        self._open_problem = ""
        self._stop_s = -math.inf
        self._must_hold = False
        self._actions: dict[str, Callable[[Request], None]] = {
            "open": lambda _: self._open(),
            "zero": self._zero,
            "arm": lambda _: self._arm(),
            "disarm": lambda _: self._disarm(),
            "acknowledge": lambda _: self._guard.acknowledge(),
            "reboot": self._reboot,
            "torque off": lambda _: self._torque_off(),
            "relax": lambda _: self._relax(),
        }

    def end(self) -> None:
        """Let ``run`` return soon, after what is watched was relaxed; for a signal handler."""
        self._ended = self._is_signalled = True

    def run(self) -> None:
        """Cycle until the end. Afterwards the servos hold, a requested torque-off is done, and the port is free."""
        due_s = self._now_s()
        try:
            while not self._ended:
                self._listen_until(due_s)
                if not self._ended:
                    self._run_cycle()
                    due_s = max(due_s + self._period_s, self._now_s())
        finally:
            try:
                self._release_at_end()
            finally:
                self._bus.close()
                self._keeper.close(self._now_s())  # before the next process gets the port, and reads the file
                if self._succession is not None:
                    self._succession.close()

    def _release_at_end(self) -> None:
        """A STOP that was not read yet, and a torque-off that is not confirmed: after this process they are lost."""
        if self._server.read_stop():
            self._handle_stop()
        if self._is_off_after_ramp:
            self._end_ramp()
        if self._release.is_requested and not self._bus.is_open:
            self._reopen(self._now_s())
        if self._release.is_requested:
            self._guard_port(lambda: self._release.release(_TRIES_AT_END))
        self._publish(self._now_s())
        if self._release.is_requested:
            text = f"the servo bus process ends, and {self._release.problem}"
            _log.error(text)
            self._server.send_fatal(text)

    def _listen_until(self, due_s: float) -> None:
        """Handle STOP and requests at once, until the next cycle is due."""
        while not self._ended:
            left_s = due_s - self._now_s()
            if self._succession is not None:
                is_asked = self._succession.wait(left_s)
                if is_asked and self._succession.must_relax and not self._is_let_go:
                    self._is_hurried, is_asked = True, False
                if self._is_signalled and not is_asked and not self._is_let_go:  # no process would watch from now on
                    self._ended, self._is_signalled, self._is_hurried = False, False, True
                else:
                    self._ended = self._is_signalled or is_asked
                return
            in_pipe, requests = self._server.wait(left_s)
            stop = in_pipe and self._server.read_stop()
            if stop:
                self._handle_stop()
            if requests and (request := self._server.read_request()) is not None:
                self._handle_request(request, after_stop=stop)
            if self._server.is_alone and not self._ended:
                self._go_on_alone()
            if left_s <= 0.0:
                return

    def _go_on_alone(self) -> None:
        """The application is gone: hold. Servos that pull are watched; without any there is nothing left to do."""
        if self._bus.is_open and self._guard.armed:
            self._guard_port(lambda: self._end_motion(Fault(Cause.HEARTBEAT_LOST, "the application ended")))
        if self._servos.unattended_s <= 0.0 or self._release.is_requested or not self._bus.is_open:
            self._ended = True
            return
        self._guard_port(self._look)
        self._keeper.write(self._now_s())
        self._ended = not self._bus.is_open or self._is_slack()
        if not self._ended and self._servos.port is not None:
            self._succession = PortSuccession(self._servos.port)
            self._server.send_stay()
            _log.warning(
                "the servos hold and are watched for %.0f s, then relaxed and switched off; the program started again takes over",
                self._servos.unattended_s,
            )

    def _look(self) -> None:
        self._read()
        self._watch = self._watch.update(self._readings, self._now_s(), self._servos)

    def _is_slack(self) -> bool:
        """Whether all servos tell that their torque is off."""
        return all(isinstance(reading, ServoState) and not reading.torque for reading in self._readings)

    def _attend(self, silent_s: float) -> None:
        """One cycle of a bus whose application is silent or gone."""
        now_s = self._now_s()
        if not self._is_let_go and self._servos.unattended_s > 0.0 and self._bus.is_open:
            attention = Attention.RELAX if self._is_hurried else self._watch.next(silent_s, now_s, self._servos)
            if attention is not Attention.REST:
                self._guard_port(self._look)
                if self._bus.is_open and self._is_slack():
                    self._is_let_go = True
                elif self._bus.is_open and attention is Attention.RELAX:
                    self._is_let_go, self._give_up_s = True, now_s + _OFF_ALONE_S
                    why = self._watch.problem or f"no program for {silent_s:.0f} s"
                    _log.warning("the servos are relaxed and switched off: %s", why)
                    self._let_go_slowly(RELAX_MM_S, then_off=True)
        is_busy = self._ramp is not None or self._release.is_requested
        if self._succession is not None and self._is_let_go and not is_busy:
            self._ended = True

    def _handle_stop(self) -> None:
        if self._latch_stop():
            self._finish_stop()

    def _latch_stop(self) -> bool:
        """No more goals, and the status says so at once; ``_finish_stop`` holds. False for a STOP that goes on.

        A key that stays down and a broken wire send it fifty times a second; held as often, a tendon under load would creep.
        """
        now_s = self._now_s()
        is_same = self._guard.stopped and now_s - self._stop_s < _SAME_STOP_S
        self._stop_s = now_s
        if not is_same:
            self._must_hold = True
            self._guard.end_motion(Fault(Cause.STOP_PRESSED))
            self._publish(now_s)
        return not is_same

    def _finish_stop(self) -> None:
        """Hold after a STOP."""
        if self._must_hold:
            self._must_hold = False
            self._guard_port(lambda: self._hold_after(Fault(Cause.STOP_PRESSED)))

    def _check_stop(self) -> None:
        """Between two transactions: raise StoppedMeanwhile when STOP has come."""
        if self._server.read_stop() and self._latch_stop():
            raise StoppedMeanwhile("stopped meanwhile: acknowledge, then switch the servos on again")

    def _check_request(self) -> None:
        """Between two transactions of a request: nothing is switched on for an application that has gone, either."""
        self._check_stop()
        if self._ended or self._server.is_alone:
            raise StoppedMeanwhile("the application ended meanwhile: nothing was switched on")

    def _run_cycle(self) -> None:
        started_s = self._now_s()
        self._cycle += 1
        silence_s = self._guard.silence_s(self._server.heartbeat(), started_s)
        is_settled = not self._guard.armed and not self._release.is_requested and self._ramp is None
        self._quiet = is_settled and silence_s > self._servos.heartbeat_timeout_s + LINGER_S
        self._readings = ()
        if self._bus.is_open and not self._quiet:
            with contextlib.suppress(StoppedMeanwhile), self._bus.interruptible(self._check_stop):
                self._guard_port(self._read_decide_write)
            self._finish_stop()
        elif self._lost and started_s >= self._reopen_at_s:
            self._reopen(started_s)
        if self._quiet:
            self._attend(silence_s)
        elif silence_s <= self._servos.heartbeat_timeout_s:
            self._watch, self._is_let_go = UnattendedWatch(), False
        if self._succession is not None and started_s > self._give_up_s:
            self._ended = True
        self._publish(self._now_s())
        self._timer.add(started_s, self._now_s())

    def _read(self) -> Fault | None:
        """Read all servos; the fault that ends the motion, when one is going on and must end."""
        self._readings = self._bus.read()
        errors = self._bus.counts.corrupt - self._corrupt  # damaged answers since the last cycle
        self._corrupt += errors
        self._bad_packets += errors
        now_s = self._now_s()
        self._keeper.update(self._readings, now_s)
        return self._guard.update(self._readings, errors, self._server.heartbeat(), now_s)

    def _read_decide_write(self) -> None:
        fault = self._read()
        if fault is not None:
            self._end_motion(fault)
        elif self._guard.armed:
            self._drive()
        elif self._release.is_requested:
            self._release.release()
        elif self._ramp is not None:
            self._follow_ramp(self._ramp)
        elif self._guard.must_relax:
            self._let_go_slowly(RELEASE_MM_S, then_off=False)
        else:
            self._hold_again()

    def _let_go_slowly(self, speed_mm_s: float, *, then_off: bool) -> None:
        """Begin a ramp from where the servos are; where that is not known, the torque goes off at once if it is to."""
        self._ramp = self._guard.release_ramp(self._now_s(), speed_mm_s)
        self._is_off_after_ramp = then_off
        if self._ramp is None:
            self._end_ramp()

    def _follow_ramp(self, ramp: ReleaseRamp) -> None:
        """Let the tendons go a little further; in the end all servos hold where they are, or the torque goes off."""
        at_mm = [reading.position_mm if isinstance(reading, ServoState) else None for reading in self._readings]
        goals_mm = ramp.goals(at_mm, self._now_s())
        if goals_mm is None:
            self._settle = _SETTLE_CYCLES
            self._bus.hold()
            self._end_ramp()
            return
        self._hold_again()
        try:
            self._bus.slacken(goals_mm, self._readings)
        except PortLost:
            raise
        except (ServoError, ValueError) as error:  # again in the next cycle; the ramp's time ends it
            _log.warning("a tendon was not let go further: %s", error)

    def _end_ramp(self) -> None:
        self._releases += 1
        self._still_tight = self._ramp.tight if self._ramp is not None else tuple(one.name for one in self._servos.tendons)
        self._ramp = None
        if self._is_off_after_ramp:
            self._is_off_after_ramp = False
            self._release.request()

    def _drive(self) -> None:
        order, beat = self._server.order(), self._server.heartbeat()
        now_s = self._now_s()  # after both: nothing in them is from the future
        step = self._guard.step(order, beat, now_s)
        if step.goals_mm is None:
            return
        try:
            self._guard.record_sent(self._bus.write(step.goals_mm), self._guard.followed, now_s)
        except (NotReady, ValueError) as error:  # the driver saw what the guard did not, or the zeros leave no room for the goals
            self._end_motion(Fault(Cause.SERVOS_WRONG, str(error)))

    def _end_motion(self, fault: Fault) -> None:
        """No more goals; goal = measured. A fault that stops may switch the torque off, too."""
        self._guard.end_motion(fault)
        self._hold_after(fault)

    def _hold_after(self, fault: Fault) -> None:
        """Goal = measured. What the tension has caused lets the tendons go slowly; the torque goes off where that is requested."""
        self._keeper.write(self._now_s())
        self._ramp, self._is_off_after_ramp = None, False
        is_off = fault.cause.reaction is Reaction.STOP and self._servos.torque_off_on_stop
        is_ramp = self._bus.is_open and fault.cause in RELEASED
        if is_off and not is_ramp:
            self._release.request()
        if not self._bus.is_open:
            return
        self._settle = _SETTLE_CYCLES
        self._bus.disarm()
        if self._release.is_requested:
            self._release.release()
        elif is_ramp:
            self._let_go_slowly(RELEASE_MM_S, then_off=is_off)

    def _hold_again(self) -> None:
        """For some cycles after a hold: a hold has no answer, and may have got lost."""
        if self._settle > 0:
            self._settle -= 1
            if not self._holds():
                self._bus.hold()

    def _holds(self) -> bool:
        """Whether all servos that tell have a goal where they are, but for tendons that are let go."""
        return all(
            abs(reading.goal_ticks - reading.ticks) <= _SETTLED_MM * abs(joint.ticks_per_mm)
            for joint, reading in zip(self._servos.joints, self._readings, strict=True)
            if isinstance(reading, ServoState) and reading.torque and (self._ramp is None or not joint.is_tendon)
        )

    def _guard_port(self, action: Callable[[], None]) -> None:
        """Do it; a port that vanishes meanwhile stops everything, and is opened again when it comes back. Never armed again."""
        try:
            action()
        except PortLost:
            self._lose_port()

    def _lose_port(self) -> None:
        self._guard.end_motion(self._guard.lose_port())
        is_owed = self._is_off_after_ramp or self._servos.torque_off_on_stop
        self._ramp, self._is_off_after_ramp = None, False
        if self._release.is_requested or is_owed:
            self._release.request()
        self._readings = ()
        self._lost, self._open_problem = True, ""
        if self._succession is not None:
            self._give_up_s = min(self._give_up_s, self._now_s() + _LOST_ALONE_S)
        self._reopen_at_s = self._now_s() + _REOPEN_S

    def _reopen(self, now_s: float) -> None:
        self._reopen_at_s = now_s + _REOPEN_S
        if os.path.exists(self._servos.port or ""):
            try:
                self._open()
            except ServoError as error:
                self._open_problem = str(error)
                self._release.release_unopened()

    def _open_after_watch(self) -> None:
        """Open the port that a process gives away which only watches. Where that fails, no process would watch: torque off."""
        if self._servos.port is None or not ask_for_port(self._servos.port):
            self._bus.open()  # says who has it
            return
        try:
            self._bus.open()
        except ServoError:
            self._release.request()
            self._release.release_unopened()
            raise

    def _open(self) -> None:
        if not self._bus.is_open:
            try:
                self._bus.open()
            except PortTaken:
                self._open_after_watch()
            self._keeper.load()
            self._give_up_s = math.inf
            self._corrupt = self._bus.counts.corrupt
            self._lost = False
            self._open_problem = ""

    def _arm(self) -> None:
        if not self._bus.is_open:
            raise NotReady("not armed: {why}", why=self._open_problem or "the servo port is not open")
        if not self._guard.armed:
            self._check_answers()
        self._guard.check_arming()
        try:
            self._bus.arm()
        except TorqueStillOn:  # some pull, some do not: it is tried until all have let go
            self._release.request()
            raise
        self._settle = 0
        self._release.cancel()
        self._guard.set_armed(self._now_s())

    def _read_all(self) -> list[MissingServo]:
        """Where all joints are: a quiet bus was not read for long, and after a zero the last positions mean nothing.

        The guard takes whole sets only, so one late answer is no reason to use the old positions. Returns the servos that do not
        tell.
        """
        for left in reversed(range(_READS_BEFORE_ARMING)):
            self._read()
            missing = [reading for reading in self._readings if isinstance(reading, MissingServo)]
            if missing and left:
                self._bus.pause(LATE_S)
            elif not missing:
                break
        return missing

    def _check_answers(self) -> None:
        """Raise NotReady when a servo does not tell where it is."""
        missing = self._read_all()
        if len(missing) == len(self._servos.joints):
            raise NotReady("not armed: no servo answers: release the E-stop or switch their supply on, check the cable")
        if missing:
            raise NotReady("not armed: {why}; check its supply and cable", why=_silence_of(missing))

    def _zero(self, request: Request) -> None:
        """Set zeros; those of an operator may not contradict what is kept."""
        try:
            wanted = ZeroRequest.model_validate(request.details)
        except ValidationError as error:
            raise NotReady(f"no zeros that can be set: {error.errors()[0]['msg']}") from None
        if problem := unknown_joint(wanted, self._servos):
            raise NotReady(problem)
        if wanted.basis is not ZeroBasis.SLACK:
            if self._keeper.has_file:
                raise NotReady("the zeros of a rig are confirmed or measured by its operator")
            self._bus.set_zero(wanted.positions_mm, basis=wanted.basis)
            return
        if self._guard.armed:
            raise NotReady("the servos are armed: disarm before zeroing")
        if missing := self._read_all():
            raise NotReady("not zeroed: {why}; check its supply and cable", why=_silence_of(missing))
        if problem := request_problem(wanted, self._keeper.offers(self._readings), self._servos):
            raise NotReady(problem)
        kept = {name: found for name in wanted.kept if (found := self._keeper.kept(name)) is not None}
        self._bus.set_zero(wanted.positions_mm, kept)
        self._keeper.forget(wanted.forgotten)
        self._read()
        self._keeper.write(self._now_s())

    def _disarm(self) -> None:
        self._guard.disarm()
        self._keeper.write(self._now_s())
        if self._bus.is_open and self._ramp is None:
            self._settle = _SETTLE_CYCLES
            self._bus.disarm()

    def _reboot(self, request: Request) -> None:
        if self._guard.armed:
            raise NotReady("the servos are armed: disarm before a reboot")
        self._bus.reboot(int(request.details.get("servo_id", -1)))

    def _relax(self) -> None:
        """Begin to let the tension off slowly; the torque goes off at the end. The status tells of both. Raises NotReady."""
        if not self._bus.is_open:
            raise NotReady("the servo port is not open: switch the torque off")
        self._disarm()
        self._read()
        self._let_go_slowly(RELAX_MM_S, then_off=True)

    def _torque_off(self) -> None:
        """Requested from now on, whatever becomes of the first tries: each cycle tries again."""
        self._guard.disarm()
        self._ramp, self._is_off_after_ramp = None, False
        self._settle = 0
        self._release.request()
        if self._bus.is_open:
            self._release.release(_TRIES_ON_REQUEST)
        else:
            self._release.release_unopened()
        if self._release.is_requested:
            raise TorqueStillOn(self._release.problem)

    def _handle_request(self, request: Request, *, after_stop: bool) -> None:
        """Do it and answer. `after_stop`: STOP came while the request waited, so it was made without knowing of it."""
        error: ServoError | None = None
        try:
            if (action := self._actions.get(request.what)) is None:
                raise NotReady(f"the servo bus process does not know how to {request.what}")
            if after_stop and request.what == "acknowledge":
                raise NotReady("STOP was pressed meanwhile: acknowledge again")
            if request.what in _WAITS_FOR_RAMP and self._ramp is not None:
                raise NotReady("the tension is being let off: wait a moment, then try again")
            if request.what in _INTERRUPTED_BY_STOP:
                with self._bus.interruptible(self._check_request):
                    action(request)
            else:
                action(request)
        except PortLost as lost:
            error = lost
            self._lose_port()
        except ServoError as refused:
            error = refused
        self._finish_stop()
        self._guard.note_request(self._now_s())
        self._publish(self._now_s())
        self._server.answer(request, error)

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
        zeroed = tuple(zero is not None for zero in self._bus.zero_ticks)
        offers = () if all(zeroed) else self._keeper.offers(self._readings)
        known = {joint.name for joint, is_zeroed in zip(self._servos.joints, zeroed, strict=True) if is_zeroed}
        self._server.publish(
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
                releasing=self._ramp is not None,
                releases=self._releases,
                still_tight=self._still_tight,
                torque_offs=self._release.confirmed,
                torque_problem=self._release.problem,
                times=self._timer.summary,
                zeroed=zeroed,
                offers=tuple(offer for offer in offers if offer.name not in known),
                firmware=tuple(servo.firmware for servo in self._bus.identities),
            )
        )


def _silence_of(missing: Sequence[MissingServo]) -> str:
    return ", ".join(f"{one.name} (id {one.id}): {one.reason}" for one in missing)


def main(arguments: list[str]) -> int:
    """Run until the application ends or is gone; 0 unless something broke. Arguments: those of ``ParentLink``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the application decides what Ctrl-C means
    server = BusServer(arguments)
    try:
        return _serve(server)
    except Exception as error:  # noqa: BLE001 - top of the process: the loop has closed the bus, and the application is told
        _log.exception("the servo bus process stopped")
        server.send_fatal(f"{type(error).__name__}: {error}")
        return 1
    finally:
        server.close()


def _serve(server: BusServer) -> int:
    message = server.first_message()
    if message is None:
        return 0
    servos, safety = ServosConfig.model_validate(message["servos"]), SafetyConfig.model_validate(message["safety"])
    backups = message.get("backups")
    try:
        bus = make_bus(servos, None if backups is None else Path(backups), server.now_s)
    except UserError as error:
        server.send_fatal(str(error))
        return 1
    with contextlib.suppress(PermissionError):  # the servos come before the pictures, where the system allows it
        os.setpriority(os.PRIO_PROCESS, 0, _PRIORITY)
    keep, searched = message.get("keep"), message.get("searched")
    keeper = ZeroKeeper(
        servos, None if keep is None else Path(keep), None if searched is None else ZeroConfig.model_validate(searched)
    )
    loop = BusLoop(server, bus, servos, safety, keeper, server.now_s)
    signal.signal(signal.SIGTERM, lambda *_: loop.end())
    gc.collect()
    gc.freeze()  # what is loaded stays: later collections are short
    loop.run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
