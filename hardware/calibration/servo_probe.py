"""Servos moved for a calibration, one by itself or all together, through the same process, gate and driver as every other motion.

A servo under test plays the part of the robot's feed, whose envelope is what it may do at most; the others hold where they stand.
So its bounds are enforced where all bounds are, in a process of its own that holds when this program falls silent. The millimetres
of a rotation are its degrees.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from core.config.safety import JointConfig, JointKind, SafetyConfig, ServosConfig
from core.control.kept_zero import ZeroBasis, all_at_zero
from core.types import Command
from hardware.servos.bus_ipc import BusStatus
from hardware.servos.dynamixel_port import NoAnswer, ServoError
from hardware.servos.registers import ServoState
from hardware.servos.servo_robot import ServoRobot
from hardware.simulated_clock import SimulatedClock

_PERIOD_S = 0.02
_ARRIVED_MM, _SETTLED_MM = 0.02, 0.25
_EXTRA_S = 3.0
_SILENCE_S = 1.0
_GAIN_PER_S = 10.0
_MARGIN_MM = 0.3
_TRIES, _RETRY_PAUSE_S = 3, 0.5
"""How often a line without an answer is opened before anything is armed, and the pause between."""
_CALM_HZ, _CALM_WATCHDOG_S, _CALM_HEARTBEAT_S = 20.0, 0.4, 1.5
_STRAINED_CYCLES = 4
"""Starting a motor takes more current than moving it: strain lasts."""
_BEND_S = 0.6


class ProcedureStopped(ServoError):
    """STOP was pressed."""


class Strained(ServoError):
    """The servo drew more current than it may, and its torque was switched off: something holds the wire."""


class ProbeFailed(ServoError):
    """The servo did not do what it was told."""


class StopSwitch:
    """STOP for a procedure that moves servos: reaches whatever is moving now, and everything that would move next.

    ``press`` may come from any thread, never waits and never fails.
    """

    def __init__(self) -> None:
        self._pressed = threading.Event()
        self._lock = threading.Lock()
        self._robot: ServoRobot | None = None

    @property
    def is_pressed(self) -> bool:
        return self._pressed.is_set()

    def press(self) -> None:
        self._pressed.set()
        with self._lock:
            robot = self._robot
        if robot is not None:
            robot.stop()

    def release(self) -> None:
        """The operator has seen it, and wants to go on."""
        self._pressed.clear()

    def check(self) -> None:
        """Raise ProcedureStopped after a STOP that was not released."""
        if self._pressed.is_set():
            raise ProcedureStopped("stopped: nothing moves before you go on")

    def sleep(self, seconds: float) -> None:
        """Wait; raise ProcedureStopped as soon as STOP comes."""
        self._pressed.wait(seconds)
        self.check()

    @contextmanager
    def guarding(self, robot: ServoRobot) -> Iterator[None]:
        """While inside, STOP reaches `robot`."""
        with self._lock:
            self._robot = robot
        try:
            self.check()
            yield
        finally:
            with self._lock:
                self._robot = None


@dataclass(frozen=True, slots=True)
class ProbeLimits:
    """What a servo may do while it is unknown what hangs on it."""

    low_mm: float = -3.0
    high_mm: float = 3.0
    speed_mm_s: float = 4.0


def feed_of(servos: ServosConfig) -> JointConfig:
    """The joint whose place a servo under test takes. Raises ProbeFailed for a robot without feed."""
    if not (feed := servos.joints[servos.places(JointKind.ADVANCE)]):
        raise ProbeFailed("a servo is tested in the place of the robot's feed, and this robot has no joint of kind advance")
    return feed[0]


def probe_config(
    servos: ServosConfig, servo_id: int, limits: ProbeLimits, sign: Literal[-1, 1] = 1, found: Mapping[int, int] | None = None
) -> ServosConfig:
    """The bus with `servo_id` in the place of the joint under test, of which it takes nothing but the place.

    Parameters
    ----------
    servos : port, speed, model, millimetres per turn.
    sign : the servo's direction that counts as positive.
    found : ids and models of all on the line while it is unknown which is which; default: `servos` says which is which.

    Notes
    -----
    A known servo turns its own joint's millimetres per turn, with its own torque. An unknown one may drive any of them: with
    the largest of their ways its wire or screw never moves further, nor faster, than it is asked to, and with the smallest of
    their torques it never pulls harder than it may.

    Raises ProbeFailed when the robot has no feed, or another number of servos, or `servo_id` is not among them.
    """
    models = found if found is not None else {joint.id: servos.model_of(joint).number for joint in servos.joints}
    every, place = list(models), servos.joints.index(feed_of(servos))
    if len(every) != len(servos.joints) or servo_id not in every:
        listed = ", ".join(map(str, every))
        raise ProbeFailed(f"servo {servo_id} cannot be moved: {len(servos.joints)} servos are needed, there are {listed}")
    every.remove(servo_id)
    every.insert(place, servo_id)
    largest = max(joint.mm_per_turn for joint in servos.joints if joint.kind is not JointKind.ROTATION)
    unknown = largest, min(joint.max_turn_nmm for joint in servos.joints)
    known = {} if found is not None else {joint.id: (joint.mm_per_turn, joint.max_turn_nmm) for joint in servos.joints}
    bounds = {
        "low_mm": limits.low_mm - _MARGIN_MM,
        "high_mm": limits.high_mm + _MARGIN_MM,
        "warn_margin_mm": _MARGIN_MM / 2,
        "max_speed_mm_s": limits.speed_mm_s,
        "max_acceleration_mm_s2": 25.0 * limits.speed_mm_s,
        "max_step_mm": 0.6,
    }
    joints = []
    for joint, one in zip(servos.joints, every, strict=True):
        mm_per_turn, turn_nmm = known.get(one, unknown)
        turned = {"id": one, "model": models[one], "sign": sign if one == servo_id else 1, "mm_per_turn": mm_per_turn}
        # in place of a rotation, whose values are degrees, one more joint that only holds
        kind = JointKind.DELIVERY if joint.kind is JointKind.ROTATION else joint.kind
        joints.append(joint.model_copy(update=turned | bounds | {"kind": kind, "max_force_n": turn_nmm / mm_per_turn}))
    return patient(servos).model_copy(update={"joints": tuple(joints), "pretension_mm": 0.0})


def patient(servos: ServosConfig) -> ServosConfig:
    """The bus as a slow procedure needs it, beside a network and a window: fewer cycles, and a pause of the program is no fault.

    A goal is at most one step away all the same, so a longer watchdog lets nothing run further.
    """
    calm = {
        "bus_hz": min(_CALM_HZ, servos.bus_hz),
        "watchdog_s": max(_CALM_WATCHDOG_S, servos.watchdog_s),
        "heartbeat_timeout_s": max(_CALM_HEARTBEAT_S, servos.heartbeat_timeout_s),
    }
    return servos.model_copy(update=calm)


@contextmanager
def armed(robot: ServoRobot, servos: ServosConfig, stop: StopSwitch, basis: ZeroBasis) -> Iterator[None]:
    """Connect, zero where the servos stand, arm; in the end hold and close. The zeros of the tendons rest on `basis`.

    A line without an answer is opened again; once it was armed, nothing is. Raises ServoError when port or servos are not in
    order, or STOP came.
    """
    with stop.guarding(robot):
        for attempt in range(_TRIES):
            try:
                robot.connect()
                robot.zero(all_at_zero(servos).model_copy(update={"basis": basis}))
                break
            except NoAnswer:
                robot.close()
                if attempt + 1 == _TRIES:
                    raise
                stop.sleep(_RETRY_PAUSE_S)
            except ServoError:
                robot.close()
                raise
        try:
            stop.check()
            robot.arm()
            yield
        finally:
            robot.close()


def _by_id(text: str, config: ServosConfig) -> str:
    """A message about servos by their ids: what the bus calls them here is not what they are."""
    for joint in config.joints:
        text = text.replace(f"{joint.name} (id {joint.id})", str(joint.id))
        text = re.sub(rf"\b{joint.name}\b", f"servo {joint.id}", text)
    return text


def check_armed(status: BusStatus, title: str) -> None:
    """Raise ProbeFailed when the bus process has ended the motion of `title`: only the operator begins another one."""
    if (fault := status.latched) is not None:
        why = f"{fault.cause}: {fault.detail}".rstrip(": ")
        raise ProbeFailed(f"{title} was stopped ({why}): find the cause, then try again")
    if not status.armed:
        raise ProbeFailed(f"{title}: the servos are no longer armed, try again")


class ServoProbe:
    """A servo that can be moved; ``opened`` makes one. One thread uses it; STOP may come from anywhere."""

    def __init__(self, robot: ServoRobot, servos: ServosConfig, limits: ProbeLimits, stop: StopSwitch) -> None:
        self._robot, self._limits, self._stop = robot, limits, stop
        joint = feed_of(servos)
        self.servo_id, self._place = joint.id, servos.joints.index(joint)
        self._strain_ma = servos.force_limit(joint).strain_ma
        self._arrived_mm = max(_ARRIVED_MM, abs(1.0 / joint.ticks_per_mm))
        self._strained = 0
        self._strain_seen_s = 0.0
        self._last: ServoState | None = None

    @classmethod
    @contextmanager
    def opened(
        cls,
        config: ServosConfig,
        safety: SafetyConfig,
        limits: ProbeLimits,
        stop: StopSwitch,
        backups: Path | None = None,
        clock: SimulatedClock | None = None,
    ) -> Iterator[ServoProbe]:
        """Connect and arm, with ``probe_config``'s bus; where the servo stands now is 0. At the end it holds, disarmed.

        `clock`: of a simulated bench.
        """
        robot = ServoRobot(config, safety, name=f"servo {feed_of(config).id}", backups=backups, clock=clock)
        try:
            with armed(robot, config, stop, ZeroBasis.HERE):
                yield cls(robot, config, limits, stop)
        except ServoError as error:
            raise type(error)(_by_id(str(error), config)) from None

    @property
    def position_mm(self) -> float:
        """Where the servo is, from where it was when the probe was opened."""
        return self._checked().position_mm or 0.0

    def alive(self) -> None:
        """A sign of life while nothing is to move; raises what is wrong."""
        self._checked()
        self._robot.hold()

    def move_to(self, target_mm: float) -> None:
        """Go there at the probe's speed, and wait until it is there.

        Raises ProcedureStopped (STOP came; the servos hold), Strained (too much current; the torque is off), ProbeFailed.
        """
        target_mm = max(self._limits.low_mm, min(self._limits.high_mm, target_mm))
        until_s = self._robot.now_s() + abs(target_mm - self.position_mm) / self._limits.speed_mm_s + _EXTRA_S
        while self._robot.now_s() < until_s:
            state = self._checked()
            at_mm = state.position_mm or 0.0
            status, goal_mm = self._robot.bus_status(), at_mm
            if status is not None and status.sent is not None and status.rejection is None:
                goal_mm = status.sent.goals_mm[self._place]  # where it was sent last
            left_mm = target_mm - goal_mm
            if abs(left_mm) <= self._arrived_mm and abs(at_mm - goal_mm) <= _SETTLED_MM:
                self._robot.hold()
                return
            speed = max(-self._limits.speed_mm_s, min(self._limits.speed_mm_s, _GAIN_PER_S * left_mm))
            self._robot.send(Command(advance_mm_s=speed))
            self._stop.sleep(_PERIOD_S)
        raise ProbeFailed(f"servo {self.servo_id} does not get to {target_mm:.2f} mm: is it held, is its supply strong enough?")

    def pause(self, seconds: float) -> None:
        """Stand still for a while."""
        until_s = self._robot.now_s() + seconds
        while self._robot.now_s() < until_s:
            self.alive()
            self._stop.sleep(_PERIOD_S)

    def _checked(self) -> ServoState:
        """The servo's newest state; raises when anything forbids to go on."""
        self._stop.check()
        status = self._robot.bus_status()
        if (failure := self._robot.failure) is not None:
            raise ProbeFailed(failure)
        if status is None or self._robot.now_s() - status.time_s > _SILENCE_S:
            raise ProbeFailed("the servo bus is silent: check port and supply")
        check_armed(status, f"servo {self.servo_id}")
        state = self._newest(status)
        self._watch_current(state)
        return state

    def _newest(self, status: BusStatus) -> ServoState:
        """What the servo told last; before it has told anything it is waited for."""
        until_s = self._robot.now_s() + _SILENCE_S
        newest: BusStatus | None = status
        while True:
            readings = () if newest is None else newest.servos
            reading = readings[self._place] if len(readings) > self._place else None
            if isinstance(reading, ServoState):
                self._last = reading
            if self._last is not None:
                return self._last
            if self._robot.now_s() > until_s:
                raise ProbeFailed(f"servo {self.servo_id} does not tell where it is: check its cable")
            self._robot.hold()
            self._stop.sleep(_PERIOD_S)
            newest = self._robot.bus_status()

    def _watch_current(self, state: ServoState) -> None:
        if state.time_s == self._strain_seen_s:
            return  # the same reading once more
        self._strain_seen_s = state.time_s
        most_ma = self._strain_ma
        is_over = state.current_ma is not None and most_ma is not None and abs(state.current_ma) > most_ma
        self._strained = self._strained + 1 if is_over else 0
        if self._strained >= _STRAINED_CYCLES:
            self._robot.hold()
            self._robot.torque_off()
            drawn_ma = abs(state.current_ma or 0.0)
            raise Strained(
                f"servo {self.servo_id} drew {drawn_ma:.0f} mA, all that its force limit allows, and was let go: "
                "something holds its wire"
            )


class SteeredRobot:
    """The robot with all its servos, zeroed where they stood: bends and holds it, and stops when a servo strains."""

    def __init__(self, robot: ServoRobot, servos: ServosConfig, stop: StopSwitch) -> None:
        self._robot, self._joints, self._stop = robot, servos.joints, stop
        self._most_ma = {joint.name: servos.force_limit(joint).strain_ma for joint in servos.joints}
        self._strained = 0
        self._cycle = -1
        self._command = Command()

    @classmethod
    @contextmanager
    def opened(
        cls,
        servos: ServosConfig,
        safety: SafetyConfig,
        stop: StopSwitch,
        backups: Path | None = None,
        clock: SimulatedClock | None = None,
    ) -> Iterator[SteeredRobot]:
        """Connect, zero where a search has left the wires, and arm; at the end they hold, disarmed. `clock`: of a simulated bench.

        Raises NotReady, too, when a servo pulls with more current than friction takes.
        """
        config = patient(servos)
        robot = ServoRobot(config, safety, name="robot", backups=backups, clock=clock)
        with armed(robot, config, stop, ZeroBasis.SEARCHED):
            yield cls(robot, config, stop)

    def bend_to(self, command: Command) -> None:
        """Bend at the gate's own pace, and wait until it has stopped."""
        self._command = command
        self.pause(_BEND_S)

    def pause(self, seconds: float) -> None:
        """Keep the bend for a while."""
        until_s = self._robot.now_s() + seconds
        while self._robot.now_s() < until_s:
            self.alive()
            self._stop.sleep(_PERIOD_S)

    def alive(self) -> None:
        """Keep the bend; raises what is wrong."""
        self._stop.check()
        status = self._robot.bus_status()
        if (failure := self._robot.failure) is not None:
            raise ProbeFailed(failure)
        if status is not None:
            check_armed(status, "the robot")
        if status is not None and status.cycle != self._cycle:
            self._cycle = status.cycle
            self._watch_current([reading for reading in status.servos if isinstance(reading, ServoState)])
        self._robot.send(self._command)

    @property
    def rotation_deg(self) -> float:
        """Where the shaft is turned to, from where it was zeroed; 0 without a rotation."""
        states = zip(self._joints, self._states(), strict=True)
        return sum(state.position_mm or 0.0 for joint, state in states if joint.kind is JointKind.ROTATION)

    def ticks(self) -> tuple[int, ...]:
        """Position registers of all joints, as they told last."""
        return tuple(state.ticks for state in self._states())

    def _states(self) -> list[ServoState]:
        until_s = self._robot.now_s() + 1.0
        while self._robot.now_s() < until_s:
            status = self._robot.bus_status()
            readings = () if status is None else status.servos
            states = [reading for reading in readings if isinstance(reading, ServoState)]
            if len(states) == len(self._joints):
                return states
            self.alive()
            self._stop.sleep(_PERIOD_S)
        raise ServoError("not all servos tell where they are: check cables and supply")

    def _watch_current(self, states: list[ServoState]) -> None:
        pairs = [(state, self._most_ma[state.name]) for state in states]
        strained = [s for s, most_ma in pairs if s.current_ma is not None and most_ma is not None and abs(s.current_ma) > most_ma]
        self._strained = self._strained + 1 if strained else 0
        if self._strained >= _STRAINED_CYCLES:
            self._robot.hold()
            self._robot.torque_off()
            names = ", ".join(f"{state.name} ({abs(state.current_ma or 0.0):.0f} mA)" for state in strained)
            raise Strained("too much current: {names}; the servos were let go: something holds the wires", names=names)
