"""Drives other than DYNAMIXEL: a small protocol, and the bus that the guarded process makes of one.

A drive opens, reads the state of its axes, writes goals, stops and closes; ``DriveBus`` adds zeros, arming, letting go and the
proof that the torque is off, so that the bus process treats it as it does ``ServoBus`` (``make_bus`` there). One that cannot limit
its force is not in ``LIMITS_FORCE`` (``core.config.safety``): the program drives no LIVE rig with it.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.config.safety import JointName, ServosConfig
from core.control.kept_zero import KeptJoint, ZeroBasis
from hardware.servos.dynamixel_bus import JointBus, JointLine
from hardware.servos.dynamixel_port import NoAnswer, NotReady, ServoError, TorqueStillOn, WriteRefused
from hardware.servos.registers import HardwareError, MissingServo, ServoReading, ServoState, to_mm


@dataclass(frozen=True, slots=True)
class AxisState:
    """What one axis reported; positions in 1/4096 turn of its shaft. ``boot`` changes whenever its counter began again."""

    position: int
    goal: int
    is_on: bool
    error: HardwareError
    volts: float
    celsius: float
    boot: int


class Drive(JointLine, Protocol):
    """One line with all axes, which are known by the ids of the joints. One thread uses it; every method may raise PortLost.

    ``read`` leaves out axes without a usable answer. ``stop`` holds all axes where they are, or takes their current off. ``write``
    and ``stop`` tell whether the drive has confirmed.
    """

    def open(self) -> None: ...
    def read(self) -> Mapping[int, AxisState]: ...
    def write(self, goals: Mapping[int, int]) -> bool: ...
    def hold(self) -> bool: ...
    def stop(self, *, release: bool) -> bool: ...
    def close(self) -> None: ...


_TRIES = 3
"""A torque-off is sent so often until it is proven."""


class DriveBus(JointBus[Drive]):
    """The axes of a drive; methods, errors and notes are those of ``ServoBus``."""

    def __init__(self, config: ServosConfig, drive: Drive) -> None:
        super().__init__(config, drive)
        self._reset()

    def _reset(self) -> None:
        self._armed, self._zeros = False, {}
        self._boots: dict[int, int] = {}
        self._misses = dict.fromkeys((joint.id for joint in self._joints), 0)

    def open(self) -> None:
        """Open the port, and make sure that all axes are there. Nothing moves, none lets go. Raises PortError, NoAnswer."""
        self._line.open()
        self._reset()
        try:
            self._states()
        except NoAnswer:
            self._line.close()
            raise

    def close(self) -> None:
        if self.is_armed:
            with contextlib.suppress(ServoError):  # the drive's own watchdog holds the axes
                self._line.stop(release=False)
        self._armed = False
        self._line.close()

    def set_zero(
        self,
        positions_mm: Mapping[JointName, float] | None = None,
        kept: Mapping[JointName, KeptJoint] | None = None,
        basis: ZeroBasis = ZeroBasis.SLACK,
    ) -> None:
        """Set where joints are now. Raises NotReady, NoAnswer. An axis that counts from its start keeps no zero."""
        if self.is_armed:
            raise NotReady("the servos are armed: disarm before zeroing")
        if kept:
            raise NotReady("this drive counts from its start: give the joints' positions instead of kept zeros")
        wanted = dict.fromkeys(self.config.names, 0.0) if positions_mm is None else positions_mm
        states = self._states()
        for joint in self._joints:
            if joint.name in wanted and joint.is_tendon and basis is ZeroBasis.SLACK and states[joint.id].is_on:
                raise NotReady("{joint} holds its wire: switch the torque off and see that it is slack", joint=joint.name)
        for joint in self._joints:
            if joint.name in wanted:
                self._zeros[joint.id] = states[joint.id].position - round(wanted[joint.name] * joint.ticks_per_mm)

    def arm(self) -> None:
        """Current on, each axis holding where it stands. Raises NotReady, NoAnswer, WriteRefused, TorqueStillOn."""
        self._armed = False
        states = self._states()
        self._note_boots(states)
        self._check_zeroed()
        if bad := ", ".join(joint.name for joint in self._joints if states[joint.id].error):
            raise NotReady(f"{bad} reports an error: find the cause, then switch the drive off and on")
        was_off = not any(state.is_on for state in states.values())
        if not was_off and not all(state.is_on for state in states.values()):
            raise NotReady("some axes hold and others do not: switch the torque off, see that the wires are slack, then arm")
        try:
            is_on = self._line.hold() and all(state.is_on and state.goal == state.position for state in self._states().values())
            if not is_on:
                raise WriteRefused("the drive did not switch on where it stands: switch it off and on")
        except ServoError:  # STOP, a lost port and a refusal alike
            if was_off and self.is_open:
                self.torque_off()
            raise
        self._armed = True

    def disarm(self) -> None:
        self._armed = False
        self.hold()

    def read(self) -> tuple[ServoReading, ...]:
        states, now_s = self._line.read(), time.monotonic()
        restarted = self._note_boots(states)
        readings: list[ServoReading] = []
        for joint in self._joints:
            state = states.get(joint.id)
            self._misses[joint.id] = 0 if state is not None else self._misses[joint.id] + 1
            if state is None:
                readings.append(MissingServo(joint.name, joint.id, now_s, self._misses[joint.id], "no answer"))
            elif joint.id in restarted:
                readings.append(MissingServo(joint.name, joint.id, now_s, 0, "restarted: zero and arm again", restarted=True))
            else:
                self._armed = self._armed and state.is_on
                readings.append(self._reading(joint.id, state, now_s))
        return tuple(readings)

    def _reading(self, axis: int, state: AxisState, now_s: float) -> ServoState:
        joint, zero = next(one for one in self._joints if one.id == axis), self._zeros.get(axis)
        return ServoState(
            name=joint.name,
            id=joint.id,
            time_s=now_s,
            ticks=state.position,
            goal_ticks=state.goal,
            position_mm=None if zero is None else to_mm(joint, state.position, zero),
            goal_mm=None if zero is None else to_mm(joint, state.goal, zero),
            velocity_mm_s=0.0,
            current_ma=None,
            voltage_v=state.volts,
            temperature_c=state.celsius,
            error=state.error,
            torque=state.is_on,
            watchdog_tripped=False,
        )

    def _note_boots(self, states: Mapping[int, AxisState]) -> frozenset[int]:
        """The axes that have lost their counter since they were seen last; their zeros are gone, and nothing is armed."""
        lost = frozenset(axis for axis, state in states.items() if self._boots.get(axis, state.boot) != state.boot)
        self._boots.update({axis: state.boot for axis, state in states.items()})
        for axis in lost:
            self._armed = False
            self._zeros.pop(axis, None)
        return lost

    def write(self, goals_mm: Sequence[float]) -> tuple[float, ...]:
        """Send the goals; one that was not taken shows in the next reading. Raises NotReady, ValueError."""
        goals = self._goal_ticks(goals_mm)
        self._line.write(goals)
        return self._as_counted(goals)

    def hold(self) -> tuple[ServoReading, ...]:
        self._line.stop(release=False)
        return self.read()

    def slacken(self, goals_mm: Sequence[float | None], readings: Sequence[ServoReading]) -> None:
        if goals := self._slack_ticks(goals_mm, readings):
            self._line.write(goals)

    def torque_off(self) -> None:
        """Take all current off, read back. Raises TorqueStillOn."""
        self._armed = False
        doubtful: list[str] = []
        for _ in range(_TRIES):
            self._line.stop(release=True)
            states = self._line.read()
            doubtful = [joint.name for joint in self._joints if joint.id not in states or states[joint.id].is_on]
            if not doubtful:
                return
        raise TorqueStillOn("torque of {names} is not proven to be off: cut the servos' power", names=", ".join(doubtful))

    def let_go(self) -> None:
        self._line.open()
        try:
            self.torque_off()
        finally:
            self._line.close()

    def reboot(self, servo_id: int) -> None:
        raise NotReady("this drive cannot be restarted from here: switch it off and on, then zero its joints")

    def _states(self) -> Mapping[int, AxisState]:
        """Of all axes. Raises NoAnswer."""
        states = self._line.read()
        if silent := ", ".join(f"{joint.name} (id {joint.id})" for joint in self._joints if joint.id not in states):
            raise NoAnswer("{names}: no answer; check the drive's power, its cable and servos.baud", names=silent)
        return states
