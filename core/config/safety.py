"""Thresholds of gate and supervisor, and the seven servos as configuration.

The safety rules' own numbers are the upper ends: they may be tightened only, and not below what it takes to repeat an input, or a
held control or deadman would be released again and again.

Joint coordinates are millimetres: of tendon pull (positive tightens), of robot advance, of catheter delivery. Zero is where the
joint was zeroed; there, a tendon has no tension.
"""

from __future__ import annotations

import math
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from core.config.section import ConfigSection
from core.config.servo_models import SERVO_MODELS, ForceLimit, ServoModel, force_limit, unsupported

_REPEATED_S = 0.05
"""1.5 times the repeat period of a held key (33 ms), twice that of a held deadman (25 ms)."""


class SafetyConfig(ConfigSection):
    """When the program holds, disarms or stops. Ages count from the capture of the frame, not from its arrival."""

    command_max_age_s: float = Field(0.1, ge=_REPEATED_S, le=0.1, description="an older command is dropped")
    measurement_max_age_s: float = Field(0.1, ge=0.02, le=0.1, description="older positions of the servos are not believed")
    margin_speed_share: float = Field(0.25, gt=0.0, lt=1.0, description="of max_speed_mm_s, inside the envelope's warn margin")
    pose_hold_s: float = Field(0.15, ge=0.05, le=0.15, description="no pose for so long holds")
    pose_disarm_s: float = Field(0.5, ge=0.1, le=0.5, description="and for so long disarms")
    frame_hold_s: float = Field(0.15, ge=0.05, le=0.15, description="no frame for so long holds")
    frame_disarm_s: float = Field(0.5, ge=0.1, le=0.5, description="and for so long disarms")
    bus_hold_s: float = Field(0.15, ge=0.05, le=0.15, description="silence of the servo bus that holds")
    bus_disarm_s: float = Field(0.5, ge=0.1, le=0.5, description="and that disarms")
    clock_gap_s: float = Field(1.0, ge=0.5, le=1.0, description="a longer pause between two ticks means suspend: disarm")
    healthy_s: float = Field(
        1.0, ge=1.0, le=10.0, description="camera and perception must have been well for so long before arming"
    )
    hold_clear_s: float = Field(0.5, ge=0.0, le=0.5, description="after that a hold no longer clears itself")
    hold_dwell_s: float = Field(0.1, ge=0.0, le=0.5, description="all must be well for so long before a hold clears itself")
    hold_repeat_s: float = Field(1.0, ge=1.0, le=10.0, description="a hold so soon after the last one is the same hold")
    deadman_timeout_s: float = Field(
        0.08, ge=_REPEATED_S, le=0.08, description="silence that counts as released; with a tick < 100 ms"
    )
    operator_quiet_s: float = Field(0.3, ge=0.05, le=2.0, description="no hand-over so shortly after the operator's last input")
    equal_frames: int = Field(5, ge=2, le=5, description="identical pictures in a row that mean a frozen camera")
    dark_frames: int = Field(3, ge=1, le=3, description="black or overexposed pictures in a row that hold")
    head_lost_frames: int = Field(3, ge=1, le=3, description="frames in a row without a head that hold")
    head_lost_disarm_s: float = Field(0.5, ge=0.1, le=0.5, description="no head for so long disarms")
    broken_results: int = Field(3, ge=1, le=3, description="non-finite results or rejected commands in a row that disarm")
    frame_loss_window_s: float = Field(3.0, ge=1.0, le=10.0, description="over which lost frames are counted")
    frame_loss_min_frames: int = Field(30, ge=10, le=300, description="fewer frames in the window say nothing about loss")
    frame_loss_warn_share: float = Field(0.1, gt=0.0, le=0.1, description="share of frames lost that warns")
    frame_loss_hold_share: float = Field(0.2, gt=0.0, le=0.2, description="share of frames lost that holds")
    frame_loss_disarm_s: float = Field(0.5, ge=0.0, le=0.5, description="loss above the hold share for so long disarms")
    min_confidence: float = Field(0.5, ge=0.5, le=1.0, description="below, autonomy holds")
    confidence_hysteresis: float = Field(0.05, ge=0.0, le=0.5, description="so much more is needed to go on")
    max_drift_px: float = Field(6.0, gt=0.0, le=10.0, description="movement of the landmarks that means a moved camera")
    missed_answers: int = Field(3, ge=1, le=3, description="in a row, of one servo")
    bus_errors: int = Field(5, ge=0, le=5, description="more bad packets in bus_errors_window_s disarm")
    bus_errors_window_s: float = Field(1.0, ge=1.0, le=10.0, description="over which bad packets are counted")
    tracking_time_s: float = Field(0.2, ge=0.02, le=0.2, description="tracking_error_mm exceeded for so long means a jam")
    temperature_warn_margin_c: float = Field(5.0, ge=0.0, le=30.0, description="so near to servos.max_temperature_c warns")
    voltage_warn_margin_v: float = Field(0.5, ge=0.0, le=5.0, description="so near to servos.min_voltage_v warns")

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        for hold, disarm in (("pose_hold_s", "pose_disarm_s"), ("frame_hold_s", "frame_disarm_s"), ("bus_hold_s", "bus_disarm_s")):
            if getattr(self, hold) >= getattr(self, disarm):
                raise ValueError(f"{hold} must be below {disarm}")
        if self.frame_loss_warn_share >= self.frame_loss_hold_share:
            raise ValueError("frame_loss_warn_share must be below frame_loss_hold_share")
        if self.frame_loss_min_frames > 10 * self.frame_loss_window_s:
            raise ValueError("frame_loss_min_frames must not exceed 10 a second of frame_loss_window_s, or loss is never seen")
        if self.min_confidence + self.confidence_hysteresis > 1.0:
            raise ValueError("min_confidence + confidence_hysteresis must not exceed 1")
        return self


TICKS_PER_TURN = 4096
"""Position units of a DYNAMIXEL X servo per turn of its horn."""

JointName = Literal["right", "left", "up", "down", "advance", "delivery_1", "delivery_2"]
JOINT_NAMES: tuple[JointName, ...] = ("right", "left", "up", "down", "advance", "delivery_1", "delivery_2")
TENDONS = JOINT_NAMES[:4]
_TENDON_FORCE_N = 20.0
"""Below what a steel or nitinol wire of 0.15 mm bears (25 to 35 N, by its cross-section); five times what bends the twin's head."""
_FEED_FORCE_N = 30.0
"""Of the feed and of each servo of the catheter's delivery: what their own friction leaves of it reaches the catheter."""


class JointConfig(ConfigSection):
    """One servo and the joint that it drives."""

    name: JointName
    id: int = Field(ge=0, le=252, description="on the bus")
    model: int | None = Field(None, ge=0, le=65535, description="model number of its servo; empty: servos.model")
    sign: Literal[-1, 1] = Field(1, description="direction of the servo that increases the joint's millimetres")
    max_force_n: float = Field(
        _TENDON_FORCE_N,
        gt=0.0,
        le=150.0,
        description="the servo itself gives no more, its gear's friction included; tendons 20 (a wire of 0.15 mm bears 25 to 35), "
        "feed and delivery 30; raise it where a joint does not follow though nothing is jammed",
    )
    mm_per_turn: float = Field(40.0, gt=0.0, le=500.0, description="way of the joint at one turn of the servo's horn")
    low_mm: float = Field(ge=-2000.0, le=2000.0, description="end of the envelope: nothing is sent beyond it")
    high_mm: float = Field(ge=-2000.0, le=2000.0, description="its other end")
    warn_margin_mm: float = Field(0.3, ge=0.0, le=200.0, description="so near to the envelope's end the joint is slowed down")
    max_speed_mm_s: float = Field(gt=0.0, le=200.0, description="the joint is never sent faster")
    max_acceleration_mm_s2: float = Field(gt=0.0, le=10_000.0, description="nor sped up or slowed down harder")
    max_step_mm: float = Field(gt=0.0, le=50.0, description="farthest goal from the measured position")

    @model_validator(mode="before")
    @classmethod
    def _fill_force(cls, data: Any) -> Any:
        """The default depends on what the joint moves; older files have none."""
        if isinstance(data, dict) and "max_force_n" not in data:
            return {**data, "max_force_n": _TENDON_FORCE_N if data.get("name") in TENDONS else _FEED_FORCE_N}
        return data

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
    limits: Any = {"low_mm": -2.4, "high_mm": 2.8, "max_speed_mm_s": 10.0, "max_step_mm": 0.6}
    return JointConfig(name=name, id=number, max_acceleration_mm_s2=200.0, **limits)


def _feed(name: JointName, number: int) -> JointConfig:
    limits: Any = {"low_mm": -5.0, "high_mm": 400.0, "warn_margin_mm": 2.0, "max_speed_mm_s": 20.0, "max_step_mm": 1.0}
    return JointConfig(name=name, id=number, max_acceleration_mm_s2=200.0, **limits)


_MOST = {"heartbeat_timeout_s": 0.5, "watchdog_s": 0.5, "tracking_error_mm": 3.0}
"""Ceilings with real servos. The safety rules demand a hold within 100 ms and an end after 500 ms of silence. A joint that is 3 mm
from its goal has left it by more than any step that may be ordered."""
_MIN_BUS_HZ = 20.0
"""Floor with real servos: two cycles pass within the 100 ms of the rules."""
_LEAST_UNATTENDED_S = 10.0
"""Floor of ``unattended_s`` with real servos: the program can be started again before the wires are relaxed."""
_MOST_TENDON_STEP_MM, _MOST_FEED_STEP_MM = 1.0, 2.0
"""Ceilings of ``max_step_mm`` with real servos: so far a joint goes when the program dies."""
_MOST_TENDON_FORCE_N, _MOST_FEED_FORCE_N = 60.0, 100.0
"""Ceilings of ``max_force_n`` with real servos: beyond, it protects neither wire nor catheter."""


AtClose = Literal["ask", "hold", "relax", "torque off"]
"""What becomes of servos that hold when the program is closed."""


class ServosConfig(ConfigSection):
    """The bus and its seven joints."""

    driver: Literal["dynamixel", "direct"] = Field("dynamixel", description="direct: the twin without servos, a lighter load")
    port: str | None = Field(None, min_length=1, description="serial device; empty: the twin's own pseudo-terminal")
    baud: int = Field(1_000_000, ge=9600, le=4_500_000, description="speed of the bus")
    model: int = Field(1020, ge=0, le=65535, description="model number of the servos (1020: XM430-W350); a joint may have another")
    pretension_mm: float = Field(0.3, ge=0.0, le=5.0, description="pull of every tendon at zero bend")
    pretension_mm_s: float = Field(
        1.0, gt=0.0, le=5.0, description="speed at which wires are pulled to it after the servos were switched on"
    )
    max_pull_mm: float = Field(2.0, gt=0.0, le=20.0, description="pull at a bend or pitch of 1")
    bus_hz: float = Field(50.0, ge=5.0, le=200.0, description="how often the servos are asked and told")
    heartbeat_timeout_s: float = Field(0.5, ge=0.05, le=5.0, description="silence of the application after which the bus holds")
    watchdog_s: float = Field(0.2, ge=0.02, le=2.54, description="the servos' own bus watchdog")
    max_temperature_c: float = Field(
        70.0, ge=30.0, le=80.0, description="a hotter servo ends the driving; 5 °C below its own limit at most"
    )
    min_voltage_v: float | None = Field(
        None, ge=3.5, le=24.0, description="a lower supply ends the driving; empty: 7/8 of what each servo's model recommends"
    )
    max_current_ma: float | None = Field(None, exclude=True, description="of older files; each joint has its max_force_n instead")
    tracking_error_mm: float = Field(1.5, gt=0.0, le=50.0, description="distance of goal and measured position that counts as jam")
    unattended_s: float = Field(
        300.0,
        ge=0.0,
        le=86_400.0,
        description="servos that hold without the program are watched for so long, then relaxed and switched off; 0: they hold on",
    )
    at_close: AtClose = Field(
        "ask", description="servos that hold when the program is closed; without a window or terminal to ask in they hold"
    )
    torque_off_on_stop: bool = Field(False, description="also switch the torque off at STOP; it releases the tension of the wires")
    joints: tuple[JointConfig, ...] = Field(
        (
            *(_tendon(name, number) for number, name in enumerate(TENDONS, start=1)),
            *(_feed(name, number) for number, name in enumerate(JOINT_NAMES[4:], start=5)),
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
            if problem := unsupported(self.model if joint.model is None else joint.model):
                raise ValueError(f"joint {joint.name}: {problem}")
            rest_mm, what = (self.pretension_mm, "pretension_mm") if joint.name in TENDONS else (0.0, "zero")
            if not joint.low_mm <= rest_mm <= joint.high_mm:
                raise ValueError(f"joint {joint.name}: {what} must lie between low_mm and high_mm, or it would be driven at rest")
        return self

    def model_of(self, joint: JointConfig) -> ServoModel:
        """The model of a joint's servo."""
        return SERVO_MODELS[self.model if joint.model is None else joint.model]

    def force_limit(self, joint: JointConfig) -> ForceLimit:
        """How the joint's servo limits its force."""
        return force_limit(self.model_of(joint), joint.mm_per_turn, joint.max_force_n)

    @property
    def weak_joints(self) -> tuple[tuple[JointConfig, float], ...]:
        """Joints whose force the gear's friction may take, and the least ``max_force_n`` (N) that is more."""
        limits = [(joint, self.force_limit(joint)) for joint in self.joints]
        return tuple((joint, math.ceil(1.05 * limit.friction_n)) for joint, limit in limits if limit.is_weak)

    def lowest_v(self, joint: JointConfig) -> float:
        """A lower supply of the joint's servo ends the driving."""
        return self.model_of(joint).lowest_v if self.min_voltage_v is None else self.min_voltage_v

    def hottest_c(self, joint: JointConfig) -> float:
        """At this temperature of the joint's servo the driving ends."""
        return min(self.max_temperature_c, self.model_of(joint).hottest_c)

    @property
    def too_loose(self) -> str:
        """The setting that is too loose for driving real servos, in one line; "" for none. The wizard ignores it."""
        for name, limit in _MOST.items():
            if getattr(self, name) > limit:
                return f"{name} must be {limit:g} at most with real servos"
        for joint in self.joints:
            is_tendon = joint.name in TENDONS
            ceilings = {
                "max_step_mm": _MOST_TENDON_STEP_MM if is_tendon else _MOST_FEED_STEP_MM,
                "max_force_n": _MOST_TENDON_FORCE_N if is_tendon else _MOST_FEED_FORCE_N,
            }
            for name, limit in ceilings.items():
                if getattr(joint, name) > limit:
                    return f"joint {joint.name}: {name} must be {limit:g} at most with real servos"
        if self.unattended_s < _LEAST_UNATTENDED_S:
            return f"unattended_s must be {_LEAST_UNATTENDED_S:g} at least with real servos"
        return "" if self.bus_hz >= _MIN_BUS_HZ else f"bus_hz must be {_MIN_BUS_HZ:g} at least with real servos"

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        if self.watchdog_s < 2.0 / self.bus_hz:
            raise ValueError("watchdog_s must be two cycles of the bus (2 / bus_hz) at least, or it trips by itself")
        return self


def wiring_of(servos: ServosConfig) -> tuple[tuple[int, int], ...]:
    """Id and sign of each joint, in the order of the joints."""
    return tuple((joint.id, joint.sign) for joint in servos.joints)
