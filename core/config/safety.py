"""Thresholds of gate and supervisor, and the robot's joints with their servos as configuration.

The safety rules' own numbers are the upper ends: they may be tightened only, and not below what it takes to repeat an input, or a
held control or deadman would be released again and again.

Joints are data: ``JointKind`` has their kinds in the order in which they stand everywhere, and all else (gate, bus, recording,
windows, twin) follows from ``ServosConfig.joints``. Joint coordinates are millimetres: of tendon pull (positive tightens), of robot
advance, of catheter delivery; of the shaft's rotation they are degrees, whatever the name of a value says (``JointConfig.unit``).
Zero is where the joint was zeroed; there, a tendon has no tension.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, SerializerFunctionWrapHandler, StringConstraints, model_serializer, model_validator

from core.config.section import ConfigSection
from core.config.servo_models import SERVO_MODELS, ForceLimit, ServoModel, force_limit, unsupported
from core.plugins import PluginKind

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
    min_confidence: float = Field(0.5, ge=0.5, le=1.0, description="on less confidence the program rests, then holds")
    confidence_hysteresis: float = Field(0.05, ge=0.0, le=0.5, description="how much more confidence is needed to go on")
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


class JointKind(StrEnum):
    """What a joint moves. The joints of a robot stand in this order."""

    TENDON = "tendon"
    ADVANCE = "advance"
    DELIVERY = "delivery"
    ROTATION = "rotation"


JointName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,23}$")]
"""Name of a joint in files, unique in its robot."""
TENDON_ANGLES_DEG: dict[str, float] = {"right": 0.0, "left": 180.0, "up": 90.0, "down": 270.0}
"""Tendons whose name says their direction around the shaft: 0 to the robot's right on the screen, 90 towards the camera."""
TENDONS: tuple[JointName, ...] = tuple(TENDON_ANGLES_DEG)
"""Tendons of the default robot."""
JOINT_NAMES: tuple[JointName, ...] = (*TENDONS, "advance", "delivery_1", "delivery_2")
"""Joints of the default robot."""
MIN_JOINTS, MAX_JOINTS = 2, 12
_TENDON_COUNTS = (2, 3, 4)
_EVENLY_DEG = 1e-6
"""Rounding of directions that are evenly spaced."""
_TENDON_FORCE_N = 20.0
"""Below what a steel or nitinol wire of 0.15 mm bears (25 to 35 N, by its cross-section); five times what bends the twin's head."""
_ROTATION_TORQUE_NMM = 60.0
"""Of the shaft: 40 N at the surface of one of 3 mm. The gear of a strong servo takes more (``weak_joints``): use a small one."""
_DEG_PER_MM = 10.0
"""A distance of the shaft's rotation from its goal counts as that of a tendon or feed at so many degrees for each millimetre."""
_FEED_FORCE_N = 30.0
"""Of the feed and of each servo of the catheter's delivery: what their own friction leaves of it reaches the catheter."""


_FIELDS_OF_ROTATION = {
    "mm_per_turn": "deg_per_turn",
    "low_mm": "low_deg",
    "high_mm": "high_deg",
    "warn_margin_mm": "warn_margin_deg",
    "max_speed_mm_s": "max_speed_deg_s",
    "max_acceleration_mm_s2": "max_acceleration_deg_s2",
    "max_step_mm": "max_step_deg",
    "max_force_n": "max_torque_nmm",
}
"""Names in files of the values of a rotation, by those of ``JointConfig``."""
_KEYS_OF_ROTATION = {key: field for field, key in _FIELDS_OF_ROTATION.items()}


class JointConfig(ConfigSection):
    """One servo and the joint that it drives."""

    name: JointName
    kind: JointKind = Field(description="what it moves; names of the default robot and rotation say it")
    angle_deg: float | None = Field(
        None, ge=-360.0, lt=360.0, description="direction of a tendon around the shaft: 0 right, 90 towards the camera, 180 left"
    )
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
    def _fill(cls, data: Any) -> Any:
        """Kind and direction follow from a known name, as in older files, and the default force from the kind."""
        if not isinstance(data, dict):
            return data
        data = dict(data)
        name = str(data.get("name"))
        if data.get("kind") is None and (kind := kind_of_name(name)) is not None:
            data["kind"] = kind
        if data.get("angle_deg") is None and name in TENDON_ANGLES_DEG:
            data["angle_deg"] = TENDON_ANGLES_DEG[name]
        if data.get("kind") == JointKind.ROTATION:
            data = {_KEYS_OF_ROTATION.get(key, key): value for key, value in data.items()}
            return {"mm_per_turn": 360.0, "warn_margin_mm": 3.0, "max_force_n": _ROTATION_TORQUE_NMM} | data
        if "max_force_n" not in data:
            data["max_force_n"] = _TENDON_FORCE_N if data.get("kind") == JointKind.TENDON else _FEED_FORCE_N
        return data

    @model_serializer(mode="wrap")
    def _with_units(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The keys of a rotation say degrees and N mm."""
        data: dict[str, Any] = dump(self)
        if self.kind is not JointKind.ROTATION:
            return data
        return {_FIELDS_OF_ROTATION.get(key, key): value for key, value in data.items()}

    @model_validator(mode="after")
    def _check_envelope(self) -> Self:
        if self.is_tendon is not (self.angle_deg is not None):
            raise ValueError(
                f"joint {self.name}: a tendon needs angle_deg, its direction around the shaft, and no other joint has one"
            )
        if self.low_mm + 2 * self.warn_margin_mm >= self.high_mm:
            raise ValueError(f"joint {self.name}: low_mm + 2 warn_margin_mm must be below high_mm")
        return self

    @property
    def is_tendon(self) -> bool:
        return self.kind is JointKind.TENDON

    @property
    def is_feed(self) -> bool:
        """Whether it feeds robot or catheter."""
        return self.kind in (JointKind.ADVANCE, JointKind.DELIVERY)

    @property
    def unit(self) -> str:
        """Unit of its coordinate."""
        return "°" if self.kind is JointKind.ROTATION else "mm"

    @property
    def force_unit(self) -> str:
        """Unit of what its servo gives at most."""
        return "N mm" if self.kind is JointKind.ROTATION else "N"

    @property
    def drum_mm_per_turn(self) -> float:
        """The way (mm per turn) along which its force acts; of a rotation that at 1 mm from the axis, where N mm are N."""
        return math.radians(self.mm_per_turn) if self.kind is JointKind.ROTATION else self.mm_per_turn

    @property
    def braking_mm(self) -> float:
        """Its way from full speed to a stop."""
        return self.max_speed_mm_s**2 / (2.0 * self.max_acceleration_mm_s2)

    @property
    def max_turn_nmm(self) -> float:
        """Its servo's greatest torque (N mm) at the horn, times a whole turn (2 pi)."""
        return self.max_force_n * self.drum_mm_per_turn

    @property
    def ticks_per_mm(self) -> float:
        """Signed position units per millimetre."""
        return self.sign * TICKS_PER_TURN / self.mm_per_turn


def kind_of_name(name: str) -> JointKind | None:
    """What a joint of the default robot moves, by its name; None for other names."""
    if name in TENDON_ANGLES_DEG:
        return JointKind.TENDON
    stem = name.rstrip("_0123456789")
    return JointKind(stem) if stem in (JointKind.ADVANCE, JointKind.DELIVERY, JointKind.ROTATION) else None


def _tendon(name: JointName, number: int) -> JointConfig:
    limits: Any = {"low_mm": -2.4, "high_mm": 2.8, "max_speed_mm_s": 10.0, "max_step_mm": 0.6}
    return JointConfig.model_validate({"name": name, "id": number, "max_acceleration_mm_s2": 200.0, **limits})


def _feed(name: JointName, number: int) -> JointConfig:
    limits: Any = {"low_mm": -5.0, "high_mm": 400.0, "warn_margin_mm": 2.0, "max_speed_mm_s": 20.0, "max_step_mm": 1.0}
    return JointConfig.model_validate({"name": name, "id": number, "max_acceleration_mm_s2": 200.0, **limits})


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
_MOST_ROTATION_STEP_DEG, _MOST_ROTATION_TORQUE_NMM = 10.0, 100.0
"""The same of the shaft's rotation."""
_CEILINGS: dict[JointKind, tuple[float, float]] = {
    JointKind.TENDON: (_MOST_TENDON_STEP_MM, _MOST_TENDON_FORCE_N),
    JointKind.ADVANCE: (_MOST_FEED_STEP_MM, _MOST_FEED_FORCE_N),
    JointKind.DELIVERY: (_MOST_FEED_STEP_MM, _MOST_FEED_FORCE_N),
    JointKind.ROTATION: (_MOST_ROTATION_STEP_DEG, _MOST_ROTATION_TORQUE_NMM),
}
"""Ceilings of ``max_step_mm`` and ``max_force_n`` with real servos."""


AtClose = Literal["ask", "hold", "relax", "torque off"]
"""What becomes of servos that hold when the program is closed."""


_DRIVE_METHODS = ("open", "read", "write", "hold", "stop", "close", "interruptible", "pause")
DRIVES = PluginKind("drives", ("dynamixel", "stepper board"), _DRIVE_METHODS)
"""What drives the joints; a plugin's entry point is called with port and speed (``hardware/servos/drive.py``)."""
DriveName = Annotated[str, DRIVES, BeforeValidator(lambda name: "dynamixel" if name == "direct" else name)]
"""Files of earlier versions may have "direct", a twin without servos."""
LIMITS_FORCE = frozenset({"dynamixel"})
"""Drives that keep each joint's ``max_force_n`` themselves; with another one the program never drives a LIVE rig."""


class ServosConfig(ConfigSection):
    """The bus and the robot's joints."""

    driver: DriveName = Field("dynamixel", description="what is on the port")
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
        min_length=MIN_JOINTS,
        max_length=MAX_JOINTS,
    )

    @model_validator(mode="after")
    def _check_joints(self) -> Self:
        if problem := _shape_problem(self.joints):
            raise ValueError(f"joints: {problem}")
        if len({joint.id for joint in self.joints}) != len(self.joints):
            raise ValueError("joints: two servos have the same id")
        for joint in self.joints:
            if problem := unsupported(self.model if joint.model is None else joint.model):
                raise ValueError(f"joint {joint.name}: {problem}")
            rest_mm, what = (self.pretension_mm, "pretension_mm") if joint.is_tendon else (0.0, "zero")
            if not joint.low_mm <= rest_mm <= joint.high_mm:
                raise ValueError(f"joint {joint.name}: {what} must lie between low_mm and high_mm, or it would be driven at rest")
        return self

    @property
    def is_default(self) -> bool:
        """Whether these are the joints of the default robot."""
        return self.names == JOINT_NAMES

    @property
    def names(self) -> tuple[JointName, ...]:
        return tuple(joint.name for joint in self.joints)

    def places(self, *kinds: JointKind) -> slice:
        """Indices of the joints of these kinds, which stand one after another; empty for none."""
        found = [place for place, joint in enumerate(self.joints) if joint.kind in kinds]
        return slice(found[0], found[-1] + 1) if found else slice(0, 0)

    @property
    def tendons(self) -> tuple[JointConfig, ...]:
        """The tendons; they stand first."""
        return self.joints[self.places(JointKind.TENDON)]

    def model_of(self, joint: JointConfig) -> ServoModel:
        """The model of a joint's servo."""
        return SERVO_MODELS[self.model if joint.model is None else joint.model]

    def force_limit(self, joint: JointConfig) -> ForceLimit:
        """How the joint's servo limits its force."""
        limit = force_limit(self.model_of(joint), joint.drum_mm_per_turn, joint.max_force_n)
        return replace(limit, speed_mm_s=limit.speed_mm_s * joint.mm_per_turn / joint.drum_mm_per_turn)

    def astray_mm(self, joint: JointConfig) -> float:
        """A joint further away from its goal is jammed, in its own unit."""
        return self.tracking_error_mm * (_DEG_PER_MM if joint.kind is JointKind.ROTATION else 1.0)

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
            for name, limit in zip(("max_step_mm", "max_force_n"), _CEILINGS[joint.kind], strict=True):
                if getattr(joint, name) > limit:
                    key = _FIELDS_OF_ROTATION[name] if joint.kind is JointKind.ROTATION else name
                    return f"joint {joint.name}: {key} must be {limit:g} at most with real servos"
            # STOP must end every motion within the way that one order may take, and a joint that runs away is noticed beyond it
            if joint.braking_mm > (most := _CEILINGS[joint.kind][0]):
                way = f"brakes from full speed in {joint.braking_mm:.3g} {joint.unit}, at most {most:g} with real servos"
                return f"joint {joint.name}: it {way}: lower its greatest speed or raise its greatest acceleration"
        if self.unattended_s < _LEAST_UNATTENDED_S:
            return f"unattended_s must be {_LEAST_UNATTENDED_S:g} at least with real servos"
        return "" if self.bus_hz >= _MIN_BUS_HZ else f"bus_hz must be {_MIN_BUS_HZ:g} at least with real servos"

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        if self.watchdog_s < 2.0 / self.bus_hz:
            raise ValueError("watchdog_s must be two cycles of the bus (2 / bus_hz) at least, or it trips by itself")
        return self


def _shape_problem(joints: Sequence[JointConfig]) -> str:
    """Why joints make no robot that can be driven, in one line; "" when they do."""
    if len({joint.name for joint in joints}) != len(joints):
        return "two have the same name"
    kinds = [joint.kind for joint in joints]
    if kinds != sorted(kinds, key=list(JointKind).index):
        return f"their order must be {', '.join(JointKind)}"
    for kind in (JointKind.ADVANCE, JointKind.ROTATION):
        if kinds.count(kind) > 1:
            return f"there may be one {kind} only"
    angles = [joint.angle_deg or 0.0 for joint in joints if joint.is_tendon]
    if len(angles) not in _TENDON_COUNTS:
        return f"{len(angles)} tendons; a robot has 2, 3 or 4"
    # opposite tendons stand side by side: they are driven against each other
    wanted = {2: (0, 180), 3: (0, 120, 240), 4: (0, 180, 90, 270)}[len(angles)]
    turned = [(angle - angles[0]) % 360.0 for angle in angles]
    ways = [turned, [(-angle) % 360.0 for angle in turned]]
    if not any(all(_apart(one, other) <= _EVENLY_DEG for one, other in zip(way, wanted, strict=True)) for way in ways):
        return f"the tendons' angle_deg must be evenly spaced, in the order {', '.join(map(str, wanted))} from the first one"
    return ""


def _apart(one_deg: float, other_deg: float) -> float:
    return abs(math.remainder(one_deg - other_deg, 360.0))


def wiring_of(servos: ServosConfig) -> tuple[tuple[int, int], ...]:
    """Id and sign of each joint, in the order of the joints."""
    return tuple((joint.id, joint.sign) for joint in servos.joints)
