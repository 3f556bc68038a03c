"""Getting seven servos ready: who they are, what they must be set to. Functions on an open line."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from core.servo_config import JointConfig, JointName, ServosConfig
from hardware.servos import units
from hardware.servos.errors import NoAnswer, Refused, WrongServo
from hardware.servos.line import ServoLine
from hardware.servos.status_block import INDIRECT_ADDRESS, indirect_addresses

EXTENDED_POSITION = 4
TORQUE, WATCHDOG, GOAL, POSITION = 64, 98, 116, 132
_RETURN_DELAY, _DRIVE_MODE, _MODE, _HOMING_OFFSET, _VELOCITY_LIMIT, _PROFILE = 9, 10, 11, 20, 44, 108
_EEPROM_BYTES = 48
_COUNTING = frozenset({_DRIVE_MODE, _MODE, _HOMING_OFFSET})
_SPEEDS = (57600, 1_000_000, 115_200, 2_000_000, 3_000_000, 4_000_000)


@dataclass(frozen=True, slots=True)
class ServoIdentity:
    """Who answered. ``firmware`` is the servo's version number."""

    name: JointName
    id: int
    model: int
    firmware: int


def identify(line: ServoLine, config: ServosConfig) -> tuple[ServoIdentity, ...]:
    """Ping all seven and compare them with the configuration.

    Raises
    ------
    NoAnswer, WrongServo
        Naming the servo. After a silence of all seven the line may have been closed.
    """
    models = {joint.id: line.ping(joint.id) for joint in config.joints}
    for _ in range(2):
        models |= {servo_id: line.ping(servo_id) for servo_id, model in models.items() if model is None}
    silent = [joint for joint in config.joints if models[joint.id] is None]
    if silent:
        raise _silence(line, config, silent)
    return tuple(identity_of(line, joint, config) for joint in config.joints)


def identity_of(line: ServoLine, joint: JointConfig, config: ServosConfig) -> ServoIdentity:
    """Who answers for a joint, by its own words.

    Raises
    ------
    NoAnswer, WrongServo
        Naming the servo.
    """
    table = line.read(joint.id, 0, 8)
    model = int.from_bytes(table[:2], "little")
    check_model(joint, model, config.model)
    if table[7] != joint.id:
        raise WrongServo(f"{call(joint)} says that its id is {table[7]}: give every servo an id of its own")
    return ServoIdentity(joint.name, joint.id, model, table[6])


def check_model(joint: JointConfig, model: int | None, expected: int) -> None:
    """Raise WrongServo when a servo is not of the configuration's model."""
    if model != expected:
        raise WrongServo(f"{call(joint)} is model {model}, not {expected}: swap the servo, or set servos.model or the joint's id")


def _silence(line: ServoLine, config: ServosConfig, silent: list[JointConfig]) -> NoAnswer:
    """The error for servos that do not answer, after looking where they might be."""
    if len(silent) < len(config.joints):
        others = ", ".join(map(str, line.others())) or "none"
        names = ", ".join(call(joint) for joint in silent)
        return NoAnswer(f"{names}: no answer; ids on the line: {others}. Check the cable, or set the joint's id")
    line.close()
    for baud in _SPEEDS:
        if baud != config.baud:
            other = ServoLine(line.port, baud)
            other.open()
            try:
                if other.ping(config.joints[0].id) is not None:
                    return NoAnswer(f"the servos talk at {baud} baud: set servos.baud = {baud}")
            finally:
                other.close()
    return NoAnswer(f"no servo answers on {line.port} at {config.baud} baud: check the servos' power and the cable")


def holds(line: ServoLine, joint: JointConfig) -> bool:
    """Whether its torque is on: then it may hold a wire under tension, which only the operator lets go."""
    return line.read(joint.id, TORQUE, 1) != b"\0"


def differences(line: ServoLine, joint: JointConfig) -> dict[int, bytes]:
    """Registers of the EEPROM that are not as we need them, with what they must be."""
    wanted = {
        _RETURN_DELAY: b"\0",
        _DRIVE_MODE: b"\0",  # not reversed, and the profile in velocities
        _MODE: bytes([EXTENDED_POSITION]),
        _HOMING_OFFSET: bytes(4),  # with one, a tripped watchdog can move the motor
        _VELOCITY_LIMIT: units.profile_velocity(joint).to_bytes(4, "little"),
    }
    table = line.read(joint.id, 0, _EEPROM_BYTES)
    return {address: data for address, data in wanted.items() if table[address : address + len(data)] != data}


def counts_anew(wrong: Collection[int]) -> bool:
    """Whether positions mean something else once these registers were set."""
    return not _COUNTING.isdisjoint(wrong)


def configure(line: ServoLine, joint: JointConfig) -> bool:
    """EEPROM as we need it, written only where it differs, because it wears; that takes the torque off. True: positions count anew.

    Raises
    ------
    WrongServo
        When a register keeps its value.
    """
    wrong = differences(line, joint)
    if wrong:
        line.write(joint.id, TORQUE, b"\0")
    for address, data in wrong.items():
        line.write(joint.id, address, data)
        if line.read(joint.id, address, len(data)) != data:
            raise WrongServo(f"{call(joint)} keeps register {address} as it is: it is no servo that this program can use")
    return counts_anew(wrong)


def map_block(line: ServoLine, joint: JointConfig) -> bool:
    """Gather the status block; not written when it is in place already. True: it was not, so that the servo has restarted."""
    wanted = indirect_addresses()
    if line.read(joint.id, INDIRECT_ADDRESS, len(wanted)) == wanted:
        return False
    line.write(joint.id, INDIRECT_ADDRESS, wanted)
    return True


def set_profile(line: ServoLine, joint: JointConfig) -> None:
    """Greatest acceleration and speed on the way to a goal, read back.

    Raises
    ------
    Refused
        When the servo goes by others.
    """
    profile = units.profile_acceleration(joint).to_bytes(4, "little") + units.profile_velocity(joint).to_bytes(4, "little")
    line.write(joint.id, _PROFILE, profile)
    if line.read(joint.id, _PROFILE, len(profile)) != profile:
        raise Refused(f"{call(joint)} did not take its greatest speed and acceleration: reboot it")


def start_watchdogs(line: ServoLine, config: ServosConfig) -> None:
    """From now on a servo that hears nothing for so long holds."""
    for joint in config.joints:
        line.write(joint.id, WATCHDOG, bytes([units.watchdog_units(config.watchdog_s)]))


def send_goals(line: ServoLine, goals: dict[int, int]) -> None:
    """Goal ticks by id, in one packet."""
    line.group_write(GOAL, {servo_id: ticks.to_bytes(4, "little", signed=True) for servo_id, ticks in goals.items()})


def goal_to_position(line: ServoLine, config: ServosConfig) -> None:
    """Goal = present position of all, proven by reading it back."""
    goals = {joint.id: units.signed(line.read(joint.id, POSITION, 4)) for joint in config.joints}
    send_goals(line, goals)
    for joint in config.joints:
        if units.signed(line.read(joint.id, GOAL, 4)) != goals[joint.id]:
            raise Refused(f"{call(joint)} did not take its own position as goal: reboot it")


def call(joint: JointConfig) -> str:
    """How messages name a servo."""
    return f"servo {joint.name} (id {joint.id})"
