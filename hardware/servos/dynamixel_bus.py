"""The DYNAMIXEL X servos of a robot through the real SDK: identity, set-up, arming, goals, state, and recovery."""

from __future__ import annotations

import contextlib
import logging
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from core.config.safety import JointConfig, JointName, ServosConfig
from core.config.servo_models import GOAL_CURRENT, GOAL_PWM, ServoModel, model_name
from core.control.kept_zero import KeptJoint, ZeroBasis, zero_offer
from hardware.servos import registers
from hardware.servos.dynamixel_port import (
    LineCounts,
    Miss,
    NoAnswer,
    NotReady,
    PortLost,
    ServoError,
    ServoLine,
    TorqueStillOn,
    WriteRefused,
    WrongServo,
)
from hardware.servos.eeprom import CHANGED, EEPROM_BYTES, keep_eeprom
from hardware.servos.registers import (
    ANSWERS_ALL,
    INDIRECT_ADDRESS,
    TAG_BYTES,
    HardwareError,
    MissingServo,
    ServoReading,
    ServoState,
    block_bytes,
    describe,
    indirect_addresses,
    indirect_data,
    state_of,
)

_log = logging.getLogger(__name__)

# Registers (Robotis e-Manual, X series)
_RETURN_DELAY, _DRIVE_MODE, _MODE, _HOMING_OFFSET, _VELOCITY_LIMIT, _STARTUP = 9, 10, 11, 20, 44, 60
TORQUE, _STATUS_RETURN, _HARDWARE_ERROR, _WATCHDOG, _PROFILE, _GOAL, _CURRENT, _POSITION = 64, 68, 70, 98, 108, 116, 126, 132
_FIRMWARE, _SECONDARY_ID, _TEMPERATURE_LIMIT, _SHUTDOWN = 6, 12, 31, 63
_NO_SECONDARY_ID = 253
"""From this value on Secondary ID(12) is off."""
_BY = "with DYNAMIXEL Wizard 2"
_SHUTDOWN_NEEDED = HardwareError.OVERLOAD | HardwareError.OVERHEATING
"""What a servo must switch itself off for; its Shutdown(63) comes as 52, which adds the electrical shock."""
_EXTENDED_POSITION, _CURRENT_POSITION = 4, 5
_LIMIT_OF = {GOAL_PWM: 36, GOAL_CURRENT: 38}
"""PWM Limit(36) and Current Limit(38): the servo takes no Goal PWM(100) or Goal Current(102) above."""
_COUNTING = frozenset({_DRIVE_MODE, _MODE, _HOMING_OFFSET})
"""Registers that decide what a position means."""
_SPEEDS = (57600, 1_000_000, 115_200, 2_000_000, 3_000_000, 4_000_000)
_REBOOT_S = 1.5
_SLACK_SHARE = 0.5
"""Of what its force limit allows: a tendon whose servo draws more is pulled."""
_ROUNDING_MM = 1e-9
_TORQUE_OFF_PACKETS = 3
"""A packet to several servos has no answer, and may get lost."""


@dataclass(frozen=True, slots=True)
class ServoIdentity:
    """Who answered. ``firmware`` is the servo's version number."""

    name: JointName
    id: int
    model: int
    firmware: int


def identify(line: ServoLine, config: ServosConfig, *, makes_answer: bool = False) -> tuple[ServoIdentity, ...]:
    """Ping all servos and compare them with the configuration.

    With `makes_answer` servos that are set not to answer reads or writes are told to, once the models of all are known.

    Raises NoAnswer, WrongServo: naming the servo. After a silence of all of them the line may have been closed.
    """
    models = {joint.id: line.ping(joint.id) for joint in config.joints}
    for _ in range(2):
        models |= {servo_id: line.ping(servo_id) for servo_id, model in models.items() if model is None}
    silent = [joint for joint in config.joints if models[joint.id] is None]
    if silent:
        raise _silence(line, config, silent)
    for joint in config.joints:
        _check_model(joint, models[joint.id] or 0, config)
    if makes_answer:
        for joint in config.joints:
            _make_answer(line, joint)
    return tuple(_identity(line, joint, config) for joint in config.joints)


def _identity(line: ServoLine, joint: JointConfig, config: ServosConfig) -> ServoIdentity:
    """What a joint's servo says of itself. Raises NoAnswer, WrongServo."""
    table = line.read(joint.id, 0, EEPROM_BYTES)
    model = int.from_bytes(table[:2], "little")
    _check_model(joint, model, config)
    if table[7] != joint.id:
        raise WrongServo(f"{_title(joint)} says that its id is {table[7]}: give every servo an id of its own")
    if problem := _unprotected(table, config.model_of(joint)):
        raise WrongServo(f"{_title(joint)} {problem}")
    return ServoIdentity(joint.name, joint.id, model, table[_FIRMWARE])


def _make_answer(line: ServoLine, joint: JointConfig) -> None:
    """Let a servo answer reads and writes. Raises NoAnswer."""
    with contextlib.suppress(NoAnswer):
        if line.read(joint.id, _STATUS_RETURN, 1) == bytes([ANSWERS_ALL]):
            return
    line.write_unanswered(joint.id, _STATUS_RETURN, bytes([ANSWERS_ALL]))
    line.read(joint.id, _STATUS_RETURN, 1)


def _unprotected(table: bytes, model: ServoModel) -> str:
    """What keeps a servo of this EEPROM from protecting itself, or from being stopped, and how to mend it; "" for nothing.

    These registers are left to the operator: they were changed for a reason that may still hold.
    """
    firmware, second_id, limit_c = table[_FIRMWARE], table[_SECONDARY_ID], table[_TEMPERATURE_LIMIT]
    if firmware < model.watchdog_firmware:
        return f"has firmware {firmware}, which has no bus watchdog: update it with DYNAMIXEL Wizard 2"
    if second_id < _NO_SECONDARY_ID:
        return f"also obeys what is sent to id {second_id}: set its Secondary ID (register 12) to 255, {_BY}"
    if limit_c > model.max_temperature_c:
        most_c = f"{model.max_temperature_c:g}"
        return f"gets {limit_c} °C hot before it switches itself off: set its Temperature Limit (register 31) to {most_c}, {_BY}"
    if missing := _SHUTDOWN_NEEDED & ~HardwareError(table[_SHUTDOWN]):
        return f"does not switch itself off at {describe(missing)}: set its Shutdown (register 63) to 52, {_BY}"
    return ""


def _check_model(joint: JointConfig, model: int, config: ServosConfig) -> None:
    """Raise WrongServo when the servo is not of the joint's model."""
    expected = config.model_of(joint).number
    if model != expected:
        raise WrongServo(
            f"{_title(joint)} is {model_name(model)}, not {model_name(expected)}: swap the servo, or set the joint's model or id"
        )


def _silence(line: ServoLine, config: ServosConfig, silent: list[JointConfig]) -> NoAnswer:
    """The error for servos that do not answer, after looking where they might be."""
    if len(silent) < len(config.joints):
        others = ", ".join(map(str, line.others())) or "none"
        names = ", ".join(_title(joint) for joint in silent)
        return NoAnswer(f"{names}: no answer; ids on the line: {others}. Check the cable, or set the joint's id")
    line.close()
    for baud in _SPEEDS:
        if baud != config.baud:
            line.check()
            other = ServoLine(line.port, baud)
            other.open()
            try:
                if other.ping(config.joints[0].id) is not None:
                    return NoAnswer(f"the servos talk at {baud} baud: set servos.baud = {baud}")
            finally:
                other.close()
    return NoAnswer(
        f"no servo answers on {line.port} at {config.baud} baud: release the E-stop, check the servos' power and the cable"
    )


def _title(joint: JointConfig) -> str:
    return f"servo {joint.name} (id {joint.id})"


def _blocks(config: ServosConfig) -> tuple[tuple[int, int, tuple[int, ...]], ...]:
    """The group reads of a cycle: address and length of the status block, and the ids of the servos that have it there."""
    members: dict[tuple[int, int], tuple[int, ...]] = {}
    for joint in config.joints:
        model = config.model_of(joint)
        key = indirect_data(model), block_bytes(model)
        members[key] = (*members.get(key, ()), joint.id)
    return tuple((address, length, ids) for (address, length), ids in members.items())


class JointLine(Protocol):
    """The line behind a ``JointBus``."""

    @property
    def is_open(self) -> bool: ...
    @property
    def counts(self) -> LineCounts: ...
    def interruptible(self, check: Callable[[], None]) -> contextlib.AbstractContextManager[None]: ...
    def pause(self, seconds: float) -> None: ...


Line = TypeVar("Line", bound=JointLine)


class JointBus(Generic[Line]):
    """What the buses of all drives have in common: joints in the order of the configuration, zeros, and whether goals are taken."""

    def __init__(self, config: ServosConfig, line: Line) -> None:
        self.config, self._joints, self._line = config, config.joints, line
        self.identities: tuple[ServoIdentity, ...] = ()
        self._armed = False
        self._zeros: dict[int, int] = {}

    @property
    def is_open(self) -> bool:
        return self._line.is_open

    @property
    def is_armed(self) -> bool:
        """Whether goals are taken. Only ``arm`` makes it true; a restart, a lost torque or a lost port make it false."""
        return self._armed and self._line.is_open

    @property
    def zero_ticks(self) -> tuple[int | None, ...]:
        """Position register at zero, by joint; None where the joint has not been zeroed since it was switched on."""
        return tuple(self._zeros.get(joint.id) for joint in self._joints)

    @property
    def counts(self) -> LineCounts:
        """Silent, damaged, late answers and retries since ``open``."""
        return self._line.counts

    def interruptible(self, check: Callable[[], None]) -> contextlib.AbstractContextManager[None]:
        """While inside, `check` is called between all transactions, and may raise.

        ``arm`` then switches off what it had switched on; what held before holds.
        """
        return self._line.interruptible(check)

    def pause(self, seconds: float) -> None:
        """Sleep; inside ``interruptible`` with checks."""
        self._line.pause(seconds)

    def _check_zeroed(self) -> None:
        if names := ", ".join(joint.name for joint in self._joints if joint.id not in self._zeros):
            raise NotReady(f"not zeroed: {names} (or restarted since then): page Servos, Zero")

    def _goal_ticks(self, goals_mm: Sequence[float]) -> dict[int, int]:
        """Goal registers by id. Raises NotReady, and ValueError for a goal that is not finite or beyond what a servo counts."""
        if not self.is_armed:
            raise NotReady("the servos are not armed: zero and arm them first")
        return {
            joint.id: registers.to_ticks(joint, goal_mm, self._zeros[joint.id])
            for joint, goal_mm in zip(self._joints, goals_mm, strict=True)
        }

    def _as_counted(self, goals: Mapping[int, int]) -> tuple[float, ...]:
        """The goals in mm."""
        return tuple(registers.to_mm(joint, goals[joint.id], self._zeros[joint.id]) for joint in self._joints)

    def _slack_ticks(self, goals_mm: Sequence[float | None], readings: Sequence[ServoReading]) -> dict[int, int]:
        """Goal registers by id of tendons let go by a step. Raises ValueError: one would tighten, is no tendon, or goes too far."""
        goals: dict[int, int] = {}
        for joint, goal_mm, reading in zip(self._joints, goals_mm, readings, strict=True):
            if goal_mm is None or not isinstance(reading, ServoState) or reading.position_mm is None or not reading.torque:
                continue
            lowest_mm = reading.position_mm - joint.max_step_mm - _ROUNDING_MM
            if not joint.is_tendon or not lowest_mm <= goal_mm <= reading.position_mm:
                raise ValueError(f"joint {joint.name}: from {reading.position_mm:g} mm it cannot be slackened to {goal_mm:g} mm")
            goals[joint.id] = registers.to_ticks(joint, goal_mm, self._zeros[joint.id])
        return goals


class ServoBus(JointBus[ServoLine]):
    """The servos on one line, in the order of the configuration's joints. One thread opens, uses and closes it.

    Parameters
    ----------
    config : identities, conversion and speeds. Envelope and step limits are the gate's business, not the driver's.
    port : serial device; default is the configuration's.
    backups : folder that keeps what the EEPROM of a servo was before it is changed; None: it is not kept.
    now_s : the clock of the answers.

    Notes
    -----
    Positions are joint millimetres from the zeros of ``set_zero``. Every method but ``close`` may raise ``PortLost``; then the bus
    is closed, and ``open`` starts again: disarmed, without zeros.
    """

    def __init__(
        self,
        config: ServosConfig,
        port: str | None = None,
        backups: Path | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s
        chosen = port or config.port
        if chosen is None:
            raise NotReady("no servo port is configured: set servos.port")
        super().__init__(config, ServoLine(chosen, config.baud, now_s))
        self._backups = backups
        self._blocks = _blocks(config)
        self._reset()

    def _reset(self) -> None:
        self._armed, self.identities, self._zeros = False, (), {}
        self._put_off: set[int] = set()
        self._marks: dict[int, int] = {}
        self._limits: dict[int, int] = {}
        self._misses = dict.fromkeys((joint.id for joint in self._joints), 0)
        self._silences = dict(self._misses)
        self._turns = dict.fromkeys((address for address, _, _ in self._blocks), 0)

    def open(self) -> None:
        """Open and lock the port, and make sure that the servos are those of the configuration. Nothing moves, none lets go.

        A servo whose torque is on is not set up, which needs the torque off: it may hold a wire.

        Raises PortError, PortTaken: the port cannot be opened; NoAnswer, WrongServo: a servo is missing, or not the one that the
        configuration names. The port is closed again.
        """
        self._line.open()
        self._reset()
        try:
            self.identities = identify(self._line, self.config, makes_answer=True)
            for joint in self._joints:
                self._set_up(joint)
                self._map_block(joint)
        except ServoError:
            self.close()
            raise

    def close(self) -> None:
        """Hold if armed, and give the port back. Never fails. The torque stays on: releasing the wires is a decision of its own."""
        if self.is_armed:
            with contextlib.suppress(ServoError):
                self.hold()
                self.read()  # a servo that answers has heard the hold: it is not lost with the port
        self._armed = False
        self._line.close()

    def set_zero(
        self,
        positions_mm: Mapping[JointName, float] | None = None,
        kept: Mapping[JointName, KeptJoint] | None = None,
        basis: ZeroBasis = ZeroBasis.SLACK,
    ) -> None:
        """Set where joints are now; all or none of them.

        Positions are in millimetres from zero, 0 of a tendon where its wire is slack; None: all are at 0. Those of tendons
        rest on `basis`. The kept zeros of the joints in `kept` hold.

        Raises NoAnswer, and NotReady: when armed, as goals would jump; when a servo holds in a mode of another program;
        when a tendon may be pulled; when a kept zero does not fit.
        """
        if self.is_armed:
            raise NotReady("the servos are armed: disarm before zeroing")
        if positions_mm is None and kept is None:
            positions_mm = dict.fromkeys((joint.name for joint in self._joints), 0.0)
        zeros: dict[int, int] = {}
        for joint in self._joints:
            if joint.name in (kept or {}):
                self._make_countable(joint)
                zeros[joint.id] = self._kept_zero(joint, (kept or {})[joint.name])
            elif joint.name in (positions_mm or {}):
                self._make_countable(joint)
                if joint.is_tendon and basis is not ZeroBasis.HERE:
                    self._check_slack(joint, basis)
                at_ticks = round((positions_mm or {})[joint.name] * joint.ticks_per_mm)
                zeros[joint.id] = self._read_signed(joint, _POSITION) - at_ticks
        self._zeros.update(zeros)

    def _make_countable(self, joint: JointConfig) -> None:
        """Set a servo up that was left as it was because it holds. Raises NotReady when it holds in a mode of another program."""
        if joint.id in self._put_off:
            wrong = self._differences(joint)
            self._check_not_held(joint, {address: data for address, data in wrong.items() if address in _COUNTING})
            self._set_up(joint)

    def _kept_zero(self, joint: JointConfig, kept: KeptJoint) -> int:
        """Position register at the kept zero, as the servo counts now. Raises NotReady."""
        offer = zero_offer(joint, self.config.model_of(joint).number, kept, self._read_signed(joint, _POSITION))
        if offer is None:
            raise NotReady(f"{_title(joint)}: its kept zero does not fit any more: give its position, or search for it")
        return offer.zero_ticks

    def _check_slack(self, joint: JointConfig, basis: ZeroBasis) -> None:
        """Raise NotReady when the tendon may be pulled: a zero there would add its pull to every later one."""
        if basis is ZeroBasis.SLACK and self._holds(joint):
            raise NotReady(
                "{joint} holds its wire: let the wizard search where it is taut (menu Rig, Calibrate), or switch the torque "
                "off and see that it is slack",
                joint=_title(joint),
            )
        model, limit_ma = self.config.model_of(joint), self.config.force_limit(joint).current_ma
        friction_ma = min(model.friction_ma, _SLACK_SHARE * (limit_ma or model.friction_ma))
        drawn_ma = model.current_ma(registers.signed(self._line.read(joint.id, _CURRENT, 2)))
        if drawn_ma is not None and abs(drawn_ma) > friction_ma:
            raise NotReady(
                "{joint} pulls with {a:.0f} mA (friction takes {b:.0f} mA at most): slacken its wire, then zero it",
                joint=_title(joint),
                a=abs(drawn_ma),
                b=friction_ma,
            )

    def arm(self) -> None:
        """Torque on, each servo holding where it stands. A servo that holds already goes on holding.

        The order: watchdog off; EEPROM where it differs; force limit; profile; position read, goal = position; torque on where it
        is off; watchdog on.

        Raises
        ------
        NotReady : a joint has no zero, has lost it by a restart, or holds though its EEPROM differs; a servo reports an error.
        WrongServo, NoAnswer, WriteRefused, StoppedMeanwhile : the torque that was switched on is off again; the rest holds.
        TorqueStillOn : that is not proven.
        """
        self._armed = False
        self._check_ready()
        switched_on: list[int] = []
        try:
            for joint in self._joints:
                self._line.write(joint.id, _WATCHDOG, b"\0")
            for joint in self._joints:
                if self._map_block(joint):  # the only sign that it has restarted: it counts from another turn now
                    self._zeros.pop(joint.id, None)
                self._configure(joint)
                self._limit_force(joint)
                self._set_profile(joint)
            self._check_zeroed()
            self._send_position_as_goal(self._joints)
            for joint in self._joints:
                if not self._holds(joint):
                    switched_on.append(joint.id)
                    self._line.write(joint.id, TORQUE, b"\1")
            for joint in self._joints:  # from now on a servo that hears nothing for so long holds
                self._line.write(joint.id, _WATCHDOG, bytes([registers.watchdog_units(self.config.watchdog_s)]))
        except PortLost:
            raise
        except ServoError as error:
            try:
                self._undo_arming(switched_on)
            except PortLost:
                raise
            except ServoError as still_on:
                raise TorqueStillOn(f"{error}; {still_on}") from error
            raise
        self._armed = True

    def _undo_arming(self, switched_on: Sequence[int]) -> None:
        """Torque off of the servos that this arming has switched on; the others hold, with their watchdogs on again."""
        units = bytes([registers.watchdog_units(self.config.watchdog_s)])
        self._line.group_write(_WATCHDOG, {joint.id: units for joint in self._joints})
        if switched_on:
            for _ in range(_TORQUE_OFF_PACKETS):
                self._line.group_write(TORQUE, dict.fromkeys(switched_on, b"\0"))
            self._prove_torque_off(switched_on)

    def disarm(self) -> None:
        """Hold, and take no more goals. The torque stays on; the servos' watchdogs trip when the line falls silent."""
        self._armed = False
        self.hold()

    def read(self) -> tuple[ServoReading, ...]:
        """State of all servos, in the order of the joints; a servo without a usable answer is a ``MissingServo``.

        Takes 3 ms at 1 Mbps, and at most 80 ms when servos are silent. Small servos (330 size) beside others take a second request.
        """
        data: dict[int, bytes] = {}
        missed: dict[int, Miss] = {}
        for address, length, members in self._blocks:
            # Those that were silent come last, where they cannot silence others.
            ids = sorted(members, key=lambda servo_id: self._silences[servo_id])
            answer = self._line.group_read(ids, address, length + self._turns[address] % (TAG_BYTES + 1))
            if answer.data or any(miss is not Miss.WAITING for miss in answer.missed.values()):
                self._turns[address] += 1  # of what was really asked: else the next request would look like the one before
            data |= answer.data
            missed |= answer.missed
        now = self._now_s()
        readings: list[ServoReading] = []
        for joint in self._joints:
            if joint.id in data:
                readings.append(self._reading(joint, data[joint.id], now))
            else:
                miss = missed[joint.id]
                self._misses[joint.id] += miss is not Miss.WAITING
                self._silences[joint.id] += miss is Miss.SILENT
                readings.append(MissingServo(joint.name, joint.id, now, self._misses[joint.id], miss.value))
        return tuple(readings)

    def write(self, goals_mm: Sequence[float]) -> tuple[float, ...]:
        """Send the goals of all joints in one packet; returns the goals in mm as the servos count them.

        No servo answers: ``ServoState.goal_mm`` of the next read tells what was taken.

        Raises NotReady: when not armed; ValueError: when a goal is not finite or beyond what a servo counts; nothing is sent.
        """
        goals = self._goal_ticks(goals_mm)
        self._send_goals(goals)
        return self._as_counted(goals)

    def hold(self) -> tuple[ServoReading, ...]:
        """Goal = present position, of every servo that tells its own; returns the readings. Needs no arming."""
        readings = self.read()
        goals = {reading.id: reading.ticks for reading in readings if isinstance(reading, ServoState)}
        if goals:
            self._send_goals(goals)
        return readings

    def slacken(self, goals_mm: Sequence[float | None], readings: Sequence[ServoReading]) -> None:
        """Let tendons go by a step, also while no goals are taken; None leaves a joint alone, and so does a servo that is missing.

        A watchdog that has tripped is cleared first, and speed and acceleration set again: until then the servo takes no goals.

        Raises ValueError, and sends nothing: a goal that would tighten, is more than a step away, or is that of no tendon. Raises
        NoAnswer, WriteRefused: of one servo; the others were sent their goals.
        """
        goals = self._slack_ticks(goals_mm, readings)
        tripped = [r.id for r in readings if isinstance(r, ServoState) and r.watchdog_tripped]
        failed: NoAnswer | WriteRefused | None = None
        for joint in self._joints:
            if joint.id in goals and joint.id in tripped:
                try:
                    for units in (0, registers.watchdog_units(self.config.watchdog_s)):
                        self._line.write(joint.id, _WATCHDOG, bytes([units]))
                    self._set_profile(joint)
                except (NoAnswer, WriteRefused) as error:
                    failed = error
                    del goals[joint.id]
        if goals:
            self._send_goals(goals)
        if failed is not None:
            raise failed

    def torque_off(self) -> None:
        """Switch all torque off: one packet to all, three times, read back. It releases the tension of the wires.

        Raises TorqueStillOn when a servo still has torque, or does not tell.
        """
        self._armed = False
        for _ in range(_TORQUE_OFF_PACKETS):
            self._line.broadcast(TORQUE, b"\0")
        self._prove_torque_off([joint.id for joint in self._joints])

    def _prove_torque_off(self, ids: Sequence[int]) -> None:
        """Raises TorqueStillOn for those that still have torque, or do not tell."""
        answer = self._line.group_read(list(ids), TORQUE, 1)
        doubtful = [joint.name for joint in self._joints if joint.id in ids and answer.data.get(joint.id) != b"\0"]
        if doubtful:
            raise TorqueStillOn("torque of {names} is not proven to be off: cut the servos' power", names=", ".join(doubtful))

    def let_go(self) -> None:
        """``torque_off`` on a closed bus that cannot be opened because not all servos answer: those that hear it obey.

        Raises PortError, PortTaken: the port cannot be opened; TorqueStillOn: when a servo still has torque, or does not tell.
        """
        self._line.open()
        try:
            self.torque_off()
        finally:
            self._line.close()

    def reboot(self, servo_id: int) -> None:
        """Restart one servo, which clears its hardware error. Afterwards the bus is disarmed, and the joint must be zeroed.

        Raises NoAnswer when it does not come back within 1.5 s.
        """
        joint = next((joint for joint in self._joints if joint.id == servo_id), None)
        if joint is None:
            raise WrongServo(f"there is no servo with id {servo_id} in the configuration")
        self._armed = False
        self._zeros.pop(servo_id, None)
        self._limits.pop(servo_id, None)
        self._line.reboot(servo_id)
        until = time.monotonic() + _REBOOT_S
        self._line.pause(0.1)  # it answers for a moment before it goes down
        while (model := self._line.ping(servo_id)) is None:
            if time.monotonic() > until:
                raise NoAnswer(f"{_title(joint)} did not come back after its reboot: switch the servos' power off and on")
        _check_model(joint, model, self.config)
        self._set_up(joint)
        self._map_block(joint)

    def _check_ready(self) -> None:
        if not self.is_open:
            raise NotReady("the servo port is not open: open it first")
        # again, since a servo may have been changed meanwhile
        self.identities = tuple(_identity(self._line, joint, self.config) for joint in self._joints)
        self._check_zeroed()
        for joint in self._joints:
            error = HardwareError(self._line.read(joint.id, _HARDWARE_ERROR, 1)[0])
            if error:
                raise NotReady(f"{_title(joint)} reports {describe(error)}: find the cause, then reboot the servo")
            self._check_not_held(joint, self._differences(joint))

    def _check_not_held(self, joint: JointConfig, differences: Mapping[int, bytes]) -> None:
        """Raise NotReady for a servo that holds though its EEPROM differs: writing it would let its wire go."""
        if differences and self._holds(joint):
            if not _COUNTING.isdisjoint(differences):
                raise NotReady(
                    f"{_title(joint)} holds in a mode of another program: switch the torque off (the wires go slack), then zero"
                )
            raise NotReady(
                "{joint} holds with another {what}: close the program with Relax slowly, or switch the torque off (the wires "
                "go slack), then arm",
                joint=_title(joint),
                what=", ".join(CHANGED[address][0] for address in differences),
            )

    def _holds(self, joint: JointConfig) -> bool:
        """Whether its torque is on: then it may hold a wire under tension, which only the operator lets go."""
        return self._line.read(joint.id, TORQUE, 1) != b"\0"

    def _differences(self, joint: JointConfig) -> dict[int, bytes]:
        """Registers of the EEPROM that are not as we need them, with what they must be."""
        wanted = {
            _RETURN_DELAY: b"\0",
            _DRIVE_MODE: b"\0",  # not reversed, and the profile in velocities
            # the force of a servo in extended position mode is limited by its duty only
            _MODE: bytes([_CURRENT_POSITION if self.config.model_of(joint).has_current_mode else _EXTENDED_POSITION]),
            _HOMING_OFFSET: bytes(4),  # with one, a tripped watchdog can move the motor
            _STARTUP: b"\0",  # no torque at power-up, and no RAM brought back, which would hide a restart; firmware 44 has 0 there
        }
        table = self._line.read(joint.id, 0, EEPROM_BYTES)
        found = {address: data for address, data in wanted.items() if table[address : address + len(data)] != data}
        # the profile's speed may be anything up to the limit: so another speed in the settings needs nothing of the EEPROM
        needed = registers.profile_velocity(joint)
        if int.from_bytes(table[_VELOCITY_LIMIT : _VELOCITY_LIMIT + 4], "little") < needed:
            no_load = int(self.config.model_of(joint).no_load_rpm / registers.VELOCITY_RPM)
            found[_VELOCITY_LIMIT] = max(needed, min(no_load, registers.MAX_VELOCITY)).to_bytes(4, "little")
        return found

    def _set_up(self, joint: JointConfig) -> None:
        """``_configure``, but not of a servo that holds: that may be done when it was let go."""
        if not self._holds(joint):
            self._configure(joint)
        elif self._differences(joint):
            self._put_off.add(joint.id)
            _log.warning("%s holds, so it is not set up before it was let go", _title(joint))

    def _configure(self, joint: JointConfig) -> None:
        """EEPROM as we need it, written only where it differs, because it wears, and while the torque is off.

        A joint whose positions mean something else afterwards loses its zero. Raises NotReady: it holds; WrongServo: a register
        keeps its value.
        """
        wrong = self._differences(joint)
        self._check_not_held(joint, wrong)
        self._put_off.discard(joint.id)
        if wrong and self._backups is not None:
            keep_eeprom(self._backups, self._line.port, self._line.read(joint.id, 0, EEPROM_BYTES))
        if _STARTUP in wrong:
            was = self._line.read(joint.id, _STARTUP, 1)[0]
            _log.warning(
                "%s had Startup Configuration (register 60) %d: set to 0, else a restart may pass unseen", _title(joint), was
            )
        for address, data in wrong.items():
            self._line.write(joint.id, address, data)
            if self._line.read(joint.id, address, len(data)) != data:
                raise WrongServo(f"{_title(joint)} keeps register {address} as it is: it is no servo that this program can use")
        if not _COUNTING.isdisjoint(wrong):
            self._zeros.pop(joint.id, None)

    def _map_block(self, joint: JointConfig) -> bool:
        """Gather the status block; not written when it is in place already. True: it was not, so that the servo has restarted."""
        model = self.config.model_of(joint)
        wanted, data = indirect_addresses(model), indirect_data(model)
        *found, mark = self._line.read(joint.id, INDIRECT_ADDRESS, data + 1 - INDIRECT_ADDRESS)
        is_mapped, known = bytes(found[: len(wanted)]) == wanted, self._marks.get(joint.id)
        if is_mapped and (mark == known or (known is None and mark)):
            self._marks[joint.id] = mark
            return False
        if not is_mapped:
            self._line.write(joint.id, INDIRECT_ADDRESS, wanted)
        with contextlib.suppress(WriteRefused):  # a servo that keeps no mark is told by its addresses alone
            self._line.write(joint.id, data, bytes([1 + secrets.randbelow(255)]))
        self._marks[joint.id] = self._line.read(joint.id, data, 1)[0]
        return True

    def _limit_force(self, joint: JointConfig) -> None:
        """Let the servo itself give no more than the joint's force, or less where its own EEPROM allows less; read back.

        Raises WriteRefused: then no torque may come on.
        """
        limit = self.config.force_limit(joint)
        most = int.from_bytes(self._line.read(joint.id, _LIMIT_OF[limit.register], 2), "little")
        units = min(limit.units, most)
        data = units.to_bytes(2, "little")
        self._line.write(joint.id, limit.register, data)
        if units < 1 or self._line.read(joint.id, limit.register, 2) != data:
            raise WriteRefused(
                f"{_title(joint)} did not take its force limit (register {limit.register} = {limit.units}): "
                f"set its register {_LIMIT_OF[limit.register]} to what it came with, or reboot it"
            )
        self._limits[joint.id] = units

    def _set_profile(self, joint: JointConfig) -> None:
        """Greatest acceleration and speed on the way to a goal, read back. Raises WriteRefused."""
        values = (registers.profile_acceleration(joint), registers.profile_velocity(joint))
        profile = b"".join(value.to_bytes(4, "little") for value in values)
        self._line.write(joint.id, _PROFILE, profile)
        if self._line.read(joint.id, _PROFILE, len(profile)) != profile:
            raise WriteRefused(f"{_title(joint)} did not take its greatest speed and acceleration: reboot it")

    def _read_signed(self, joint: JointConfig, address: int) -> int:
        return registers.signed(self._line.read(joint.id, address, 4))

    def _send_goals(self, goals: dict[int, int]) -> None:
        """Goal ticks by id, in one packet."""
        self._line.group_write(_GOAL, {servo_id: ticks.to_bytes(4, "little", signed=True) for servo_id, ticks in goals.items()})

    def _send_position_as_goal(self, joints: Sequence[JointConfig]) -> None:
        """Goal = present position, proven by reading it back."""
        goals = {joint.id: self._read_signed(joint, _POSITION) for joint in joints}
        self._send_goals(goals)
        for joint in joints:
            if self._read_signed(joint, _GOAL) != goals[joint.id]:
                raise WriteRefused(f"{_title(joint)} did not take its own position as goal: reboot it")

    def _reading(self, joint: JointConfig, block: bytes, time_s: float) -> ServoReading:
        self._misses[joint.id] = self._silences[joint.id] = 0
        model, zero, mark = self.config.model_of(joint), self._zeros.get(joint.id), self._marks.get(joint.id, 0)
        state = state_of(joint, model, zero, block, time_s, mark, self._limits.get(joint.id))
        if state is None:
            self._armed = False
            self._zeros.pop(joint.id, None)
            self._limits.pop(joint.id, None)
            with contextlib.suppress(NoAnswer, WriteRefused):
                self._map_block(joint)
            return MissingServo(joint.name, joint.id, time_s, 0, "restarted: zero and arm again", restarted=True)
        if not state.torque:
            self._armed = False
        return state
