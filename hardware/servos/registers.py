"""Registers of a DYNAMIXEL X servo in millimetres, degrees Celsius and seconds, and the status block that one read gives. Pure.

The block is twenty bytes, gathered through the servo's indirect addresses. Why indirect: the registers of interest lie
between 64 and 146. Read as they lie, seven servos take 6.6 ms at 1 Mbps and 115 ms at the factory's 57600; gathered they take 2
and 33 ms. Why not more: the smallest servos (330 size) have 20 indirect addresses. Their block is two bytes shorter.

The addresses are forgotten in a reboot, and the block then reads as zeros. So the block begins with a mark that the driver has
written, goes on with a register that it keeps at 2, and holds the supply voltage: zeros cannot pass for a servo at position 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntFlag

from core.config.safety import TICKS_PER_TURN, JointConfig, JointName
from core.config.servo_models import GOAL_CURRENT, GOAL_PWM, ServoModel, drum_radius_mm

MAX_TICKS = 256 * TICKS_PER_TURN - 1
"""Extended position mode counts so far from zero in both directions."""
VELOCITY_RPM = 0.229
"""One unit of velocity, limit or profile."""
ACCELERATION_RPM2 = 214.577
"""One unit of acceleration in revolutions per minute squared."""
WATCHDOG_S = 0.02
VOLTAGE_V = 0.1
MAX_VELOCITY, _MAX_ACCELERATION = 1023, 32767


def to_ticks(joint: JointConfig, position_mm: float, zero_ticks: int) -> int:
    """Goal register of a joint's position; raises ValueError when it is not finite, or beyond what the servo can count."""
    if not math.isfinite(position_mm):
        raise ValueError(f"joint {joint.name}: goal is not finite: {position_mm}")
    ticks = zero_ticks + round(position_mm * joint.ticks_per_mm)
    if abs(ticks) > MAX_TICKS:
        raise ValueError(f"joint {joint.name}: goal {position_mm:g} mm is beyond the servo's 256 turns")
    return ticks


def to_mm(joint: JointConfig, ticks: int, zero_ticks: int) -> float:
    """Joint position in mm of a position register."""
    return (ticks - zero_ticks) / joint.ticks_per_mm


def profile_velocity(joint: JointConfig) -> int:
    """Register 112 of the joint's greatest speed; at least 1, because 0 means no limit at all."""
    return max(1, min(MAX_VELOCITY, math.floor(joint.max_speed_mm_s / joint.mm_per_turn * 60.0 / VELOCITY_RPM)))


def profile_acceleration(joint: JointConfig) -> int:
    """Register 108 of the joint's greatest acceleration; at least 1, because 0 means no limit at all."""
    units = math.floor(joint.max_acceleration_mm_s2 / joint.mm_per_turn * 3600.0 / ACCELERATION_RPM2)
    return max(1, min(_MAX_ACCELERATION, units))


def velocity_mm_s(joint: JointConfig, units: int) -> float:
    """Joint speed of a velocity register."""
    return joint.sign * units * VELOCITY_RPM / 60.0 * joint.mm_per_turn


def watchdog_units(watchdog_s: float) -> int:
    """Register 98, in steps of 20 ms, never 0 (which would switch it off)."""
    return max(1, min(127, math.ceil(watchdog_s / WATCHDOG_S - 1e-9)))


def wire_force_mn(joint: JointConfig, model: ServoModel, current_ma: float) -> float:
    """Pull of a wire as the motor's current tells it, friction included; positive tightens."""
    return joint.sign * model.torque_nm(current_ma) / drum_radius_mm(joint.drum_mm_per_turn) * 1e6


def signed(data: bytes) -> int:
    """A little-endian register as a signed number."""
    return int.from_bytes(data, "little", signed=True)


# (first register, bytes). Positions fit in three bytes (2048 turns), velocity in two.
_PARTS = {
    "status_return": (68, 1),
    "torque": (64, 1),
    "hardware_error": (70, 1),
    "watchdog": (98, 1),
    "goal": (116, 3),
    "current": (126, 2),
    "velocity": (128, 2),
    "position": (132, 3),
    "temperature": (146, 1),
    "voltage": (144, 2),
}
TAG_BYTES = 2
"""Padding: requests in turn ask for 0, 1 or 2 bytes more, so that a late answer to an earlier one is known by its length."""
_MARK_BYTES = 1
"""The block's first byte: an indirect datum whose indirect address is its own, so that it keeps what the driver writes there. It is
0 after a restart, also where Startup Configuration(60) restores the indirect addresses: no backup holds it."""
_PADDING = (120, 121)
"""Registers behind the block, for the padding: the realtime tick."""
INDIRECT_ADDRESS = 168
WATCHDOG_TRIPPED = 0xFF
ANSWERS_ALL = 2
"""Status return level: reads and writes are answered."""


class HardwareError(IntFlag):
    """Register 70. Any of these, but for the voltage by default, has switched the torque off."""

    INPUT_VOLTAGE = 1
    OVERHEATING = 4
    ENCODER = 8
    ELECTRICAL_SHOCK = 16
    OVERLOAD = 32


def describe(error: HardwareError) -> str:
    """Hardware error bits in words."""
    known = {flag: (flag.name or "").lower().replace("_", " ") for flag in HardwareError}
    return ", ".join(text for flag, text in known.items() if error & flag) or f"error {int(error)}"


@dataclass(frozen=True, slots=True)
class ServoState:
    """What one servo reported. ``time_s`` is monotonic, at the arrival of the answer.

    ``position_mm`` and ``goal_mm``: None until the joint has been zeroed; ``ticks`` always tells the position register.
    ``goal_ticks`` is the goal that the servo has really taken: a group write has no answer that would tell. ``is_limited``: its
    force limit is still the one that it was given.
    """

    name: JointName
    id: int
    time_s: float
    ticks: int
    goal_ticks: int
    position_mm: float | None
    goal_mm: float | None
    velocity_mm_s: float
    current_ma: float | None
    voltage_v: float
    temperature_c: float
    error: HardwareError
    torque: bool
    watchdog_tripped: bool
    is_limited: bool = True


@dataclass(frozen=True, slots=True)
class MissingServo:
    """A servo without a usable answer. ``misses`` counts the requests in a row that it left without one.

    ``restarted``: it answers, but has lost its settings since the driver gave them; it must be zeroed and armed again.
    """

    name: JointName
    id: int
    time_s: float
    misses: int
    reason: str
    restarted: bool = False


ServoReading = ServoState | MissingServo


def _parts(model: ServoModel) -> dict[str, tuple[int, int]]:
    """The parts of a model's block. In the 330 size a supply of 14 V or less fits in one byte, and one is left for the limit."""
    limit = GOAL_CURRENT if model.has_current_mode else GOAL_PWM
    if model.is_small:
        return _PARTS | {"voltage": (144, 1), "limit": (limit, 1)}
    return _PARTS | {"limit": (limit, 2)}


def block_bytes(model: ServoModel) -> int:
    """Length of a model's status block, without padding."""
    return _MARK_BYTES + sum(size for _, size in _parts(model).values())


def indirect_data(model: ServoModel) -> int:
    """Where a model keeps its indirect data: behind 20 addresses in the 330 size, behind 28 else. The mark is the first byte."""
    return 208 if model.is_small else 224


def indirect_addresses(model: ServoModel) -> bytes:
    """What to write at ``INDIRECT_ADDRESS``: the mark, the block's registers, then the padding."""
    registers = [first + offset for first, size in _parts(model).values() for offset in range(size)]
    return b"".join(register.to_bytes(2, "little") for register in (indirect_data(model), *registers, *_PADDING))


def split_block(model: ServoModel, block: bytes) -> dict[str, bytes]:
    """The block's parts by name; `block` may carry padding. Raises ValueError when it is too short."""
    if len(block) < block_bytes(model):
        raise ValueError(f"status block of {len(block)} bytes")
    parts, at = {"mark": block[:_MARK_BYTES]}, _MARK_BYTES
    for name, (_, size) in _parts(model).items():
        parts[name] = block[at : at + size]
        at += size
    return parts


def state_of(
    joint: JointConfig,
    model: ServoModel,
    zero_ticks: int | None,
    block: bytes,
    time_s: float,
    mark: int,
    limit_units: int | None = None,
) -> ServoState | None:
    """A servo's state from its block; None when it has lost its indirect addresses or its `mark`: it has restarted.

    `limit_units` is the force limit that was given to it, None for none. Raises ValueError for a short block.
    """
    parts = split_block(model, block)
    voltage = int.from_bytes(parts["voltage"], "little")
    if parts["status_return"][0] != ANSWERS_ALL or voltage == 0 or parts["mark"][0] != mark:
        return None
    ticks, goal = signed(parts["position"]), signed(parts["goal"])
    return ServoState(
        name=joint.name,
        id=joint.id,
        time_s=time_s,
        ticks=ticks,
        goal_ticks=goal,
        position_mm=None if zero_ticks is None else to_mm(joint, ticks, zero_ticks),
        goal_mm=None if zero_ticks is None else to_mm(joint, goal, zero_ticks),
        velocity_mm_s=velocity_mm_s(joint, signed(parts["velocity"])),
        current_ma=model.current_ma(signed(parts["current"])),
        voltage_v=voltage * VOLTAGE_V,
        temperature_c=float(parts["temperature"][0]),
        error=HardwareError(parts["hardware_error"][0]),
        torque=parts["torque"][0] == 1,
        watchdog_tripped=parts["watchdog"][0] == WATCHDOG_TRIPPED,
        is_limited=limit_units is None or parts["limit"] == limit_units.to_bytes(2, "little")[: len(parts["limit"])],
    )
