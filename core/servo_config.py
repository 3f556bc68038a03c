"""The seven servos as configuration: who they are on the bus, how their turns become millimetres, and what each may do.

Joint coordinates are millimetres: of tendon pull (positive tightens), of robot advance, of catheter delivery. Zero is where the
joint was zeroed; there, a tendon has no tension.
"""

from __future__ import annotations

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

TICKS_PER_TURN = 4096
"""Position units of a DYNAMIXEL X servo per turn of its horn."""

JointName = Literal["right", "left", "up", "down", "advance", "delivery_1", "delivery_2"]
JOINT_NAMES: tuple[JointName, ...] = ("right", "left", "up", "down", "advance", "delivery_1", "delivery_2")
TENDONS = JOINT_NAMES[:4]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class JointConfig(_Section):
    """One servo and the joint that it drives."""

    name: JointName
    id: int = Field(ge=0, le=252, description="on the bus")
    sign: Literal[-1, 1] = Field(1, description="direction of the servo that increases the joint's millimetres")
    mm_per_turn: float = Field(40.0, gt=0.0, le=500.0, description="way of the joint at one turn of the servo's horn")
    low_mm: float = Field(ge=-2000.0, le=2000.0, description="end of the envelope: nothing is sent beyond it")
    high_mm: float = Field(ge=-2000.0, le=2000.0, description="its other end")
    warn_margin_mm: float = Field(0.3, ge=0.0, le=200.0, description="so near to the envelope's end the joint is slowed down")
    max_speed_mm_s: float = Field(gt=0.0, le=200.0, description="the joint is never sent faster")
    max_acceleration_mm_s2: float = Field(gt=0.0, le=10_000.0, description="nor sped up or slowed down harder")
    max_step_mm: float = Field(gt=0.0, le=50.0, description="farthest goal from the measured position")

    @model_validator(mode="after")
    def _check_envelope(self) -> Self:
        if self.low_mm + 2 * self.warn_margin_mm >= self.high_mm:
            raise ValueError(f"joint {self.name}: low_mm + 2 warn_margin_mm must be below high_mm")
        return self

    @property
    def ticks_per_mm(self) -> float:
        """Signed position units per millimetre."""
        return self.sign * TICKS_PER_TURN / self.mm_per_turn


def _tendon(name: JointName, number: int) -> JointConfig:
    return JointConfig(
        name=name, id=number, low_mm=-2.4, high_mm=2.8, max_speed_mm_s=10.0, max_acceleration_mm_s2=200.0, max_step_mm=0.6
    )


def _feed(name: JointName, number: int, low_mm: float, high_mm: float) -> JointConfig:
    return JointConfig(
        name=name,
        id=number,
        low_mm=low_mm,
        high_mm=high_mm,
        warn_margin_mm=2.0,
        max_speed_mm_s=20.0,
        max_acceleration_mm_s2=200.0,
        max_step_mm=1.0,
    )


_MAX_HEARTBEAT_S = _MAX_WATCHDOG_S = 0.5
_MIN_BUS_HZ = 20.0


class ServosConfig(_Section):
    """The bus and its seven joints."""

    driver: Literal["dynamixel", "direct"] = Field("dynamixel", description="direct: the twin without servos, a lighter load")
    port: str | None = Field(None, min_length=1, description="serial device; empty: the twin's own pseudo-terminal")
    baud: int = Field(1_000_000, ge=9600, le=4_500_000, description="speed of the bus")
    model: int = Field(1020, ge=0, le=65535, description="model number that every servo must report (1020: XM430-W350)")
    pretension_mm: float = Field(0.3, ge=0.0, le=5.0, description="pull of every tendon at zero bend")
    max_pull_mm: float = Field(2.0, gt=0.0, le=20.0, description="pull at a bend or pitch of 1")
    bus_hz: float = Field(50.0, ge=5.0, le=200.0, description="how often the servos are asked and told")
    heartbeat_timeout_s: float = Field(0.5, ge=0.05, le=5.0, description="silence of the application after which the bus holds")
    watchdog_s: float = Field(0.2, ge=0.02, le=2.54, description="the servos' own bus watchdog")
    max_temperature_c: float = Field(70.0, ge=30.0, le=80.0, description="a hotter servo ends the driving")
    min_voltage_v: float = Field(10.5, ge=5.0, le=24.0, description="a lower supply ends the driving")
    max_current_ma: float = Field(
        600.0,
        ge=50.0,
        le=5000.0,
        description="a servo that draws more for half a second is stopped; small ones (XL330, XC330) stall at 1500 to 1800",
    )
    tracking_error_mm: float = Field(1.5, gt=0.0, le=50.0, description="distance of goal and measured position that counts as jam")
    torque_off_on_stop: bool = Field(False, description="also switch the torque off at STOP; it releases the tension of the wires")
    joints: tuple[JointConfig, ...] = Field(
        (
            *(_tendon(name, number) for number, name in enumerate(TENDONS, start=1)),
            _feed("advance", 5, -5.0, 400.0),
            _feed("delivery_1", 6, -5.0, 400.0),
            _feed("delivery_2", 7, -5.0, 400.0),
        ),
        min_length=7,
        max_length=7,
    )

    @model_validator(mode="after")
    def _check_joints(self) -> Self:
        if tuple(joint.name for joint in self.joints) != JOINT_NAMES:
            raise ValueError(f"joints must be these seven in this order: {', '.join(JOINT_NAMES)}")
        if len({joint.id for joint in self.joints}) != len(self.joints):
            raise ValueError("joints: two servos have the same id")
        for joint in self.joints:
            rest_mm, what = (self.pretension_mm, "pretension_mm") if joint.name in TENDONS else (0.0, "zero")
            if not joint.low_mm <= rest_mm <= joint.high_mm:
                raise ValueError(f"joint {joint.name}: {what} must lie between low_mm and high_mm, or it would be driven at rest")
        return self

    @property
    def too_loose(self) -> str:
        """What real servos may not be driven with, in one line; "" for nothing. The wizard is more patient, and moves one servo.

        The safety rules want a hold within 100 ms and an end after 500 ms of silence.
        """
        for name, limit in (("heartbeat_timeout_s", _MAX_HEARTBEAT_S), ("watchdog_s", _MAX_WATCHDOG_S)):
            if getattr(self, name) > limit:
                return f"{name} must be {limit:g} at most with real servos"
        return "" if self.bus_hz >= _MIN_BUS_HZ else f"bus_hz must be {_MIN_BUS_HZ:g} at least with real servos"

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        if self.watchdog_s < 2.0 / self.bus_hz:
            raise ValueError("watchdog_s must be two cycles of the bus (2 / bus_hz) at least, or it trips by itself")
        return self
