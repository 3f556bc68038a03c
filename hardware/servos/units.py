"""Between millimetres, degrees Celsius and seconds on our side and the registers of a DYNAMIXEL X servo. Pure."""

from __future__ import annotations

import math

from core.servo_config import TICKS_PER_TURN, JointConfig

MAX_TICKS = 256 * TICKS_PER_TURN - 1
"""Extended position mode counts so far from zero in both directions."""
VELOCITY_RPM = 0.229
"""One unit of velocity, limit or profile."""
ACCELERATION_RPM2 = 214.577
"""One unit of acceleration in revolutions per minute squared."""
WATCHDOG_S = 0.02
VOLTAGE_V = 0.1
_MAX_VELOCITY, _MAX_ACCELERATION = 1023, 32767
_DEFAULT_CURRENT_MA = 2.69
# Robotis e-Manual, Present Current(126). XL430 servos report a load in 0.1 % there, and are not listed.
_CURRENT_MA = {
    **dict.fromkeys((1040, 1050), 1.34),  # XH430-V, of 24 V; the XH430-W, of 12 V, count like the others
    **dict.fromkeys((1190, 1200, 1210, 1220, 1230, 1240), 1.0),  # XL330, XC330
}
_LOAD_MODELS = frozenset({1060, 1070, 1080, 1090})
_TORQUE_NM_PER_A = 4.1 / 2.3
"""Stall torque over stall current of an XM430-W350 at 12 V (Robotis e-Manual)."""


def to_ticks(joint: JointConfig, position_mm: float, zero_ticks: int) -> int:
    """Goal register of a joint's position.

    Raises
    ------
    ValueError
        When the number is not finite or beyond what extended position mode can count.
    """
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
    return max(1, min(_MAX_VELOCITY, math.floor(joint.max_speed_mm_s / joint.mm_per_turn * 60.0 / VELOCITY_RPM)))


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


def current_ma(model: int, units: int) -> float | None:
    """Motor current, or None for models that report a load instead."""
    return None if model in _LOAD_MODELS else units * _CURRENT_MA.get(model, _DEFAULT_CURRENT_MA)


def wire_force_mn(joint: JointConfig, current_ma: float) -> float:
    """Pull of a wire as the motor's current tells it, friction included; positive tightens."""
    radius_m = joint.mm_per_turn / (2.0 * math.pi) / 1000.0
    return joint.sign * current_ma / 1000.0 * _TORQUE_NM_PER_A / radius_m * 1000.0


def signed(data: bytes) -> int:
    """A little-endian register as a signed number."""
    return int.from_bytes(data, "little", signed=True)
