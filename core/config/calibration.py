"""The calibration section of a rig file: lens, scale, steering, zero of the joints, insertion port."""

from __future__ import annotations

import math
from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from core.config.safety import MAX_JOINTS, MIN_JOINTS, JointConfig, JointKind, JointName, ServosConfig
from core.config.section import ConfigSection

SizePx = Annotated[tuple[int, int], Field(description="width and height of the pictures")]


class LensConfig(ConfigSection):
    """Radial distortion: a point at radius r of the undistorted picture is seen at r (1 + k1 r^2 + k2 r^4).

    Radii count from ``center_px``, in halves of the picture's diagonal, so a lens holds for every size of the same picture.
    """

    k1: float = Field(ge=-0.5, le=0.5, description="negative: barrel")
    k2: float = Field(0.0, ge=-0.5, le=0.5)
    center_px: tuple[float, float] = Field(description="of the distortion, in pictures of size_px")
    size_px: SizePx
    residual_px: float = Field(ge=0.0, description="root mean square of what the model leaves over")
    pictures: int = Field(ge=1)

    @model_validator(mode="after")
    def _check_folds_nothing(self) -> Self:
        """The radius seen must grow with the radius in the straight picture, or its corners would show mirrored content."""
        squares = [place / 20 for place in range(21)]
        if min(1 + 3 * self.k1 * square + 5 * self.k2 * square * square for square in squares) <= 0.0:
            raise ValueError("k1 and k2 fold the picture's corners inwards; calibrate the lens again")
        return self


class ScaleConfig(ConfigSection):
    """Millimetres per pixel of the undistorted picture, in the plane in which the robot moves.

    ``plane`` maps pixels to millimetres of that plane (3x3, row by row), for a camera that sees it at an angle; None: the scale is
    the same everywhere.
    """

    mm_per_px: float = Field(gt=0.0, le=100.0, description="in the middle of the picture")
    size_px: SizePx
    method: Literal["board", "two clicks"]
    uncertainty_share: float = Field(ge=0.0, description="standard error of the scale, as a share of it")
    plane: tuple[float, float, float, float, float, float, float, float, float] | None = None

    def working_px_per_mm(self, working_size_px: int) -> float:
        """Working pixels per millimetre in the middle of the picture, whose longer side is `working_size_px` then."""
        return working_size_px / (self.mm_per_px * max(self.size_px))

    def fits(self, size_px: tuple[int, int]) -> bool:
        """Whether it holds for pictures of this size: those of another aspect show another part of the bench, of unknown size."""
        return abs(self.size_px[0] * size_px[1] / (self.size_px[1] * size_px[0]) - 1.0) <= 0.01


class TendonConfig(ConfigSection):
    """Where the head goes when a tendon is pulled. Angles in the image: 0 to the right, 90 down."""

    name: JointName
    direction_deg: float | None = Field(None, ge=-360.0, le=360.0, description="None: out of the image plane")
    moved_px: float = Field(ge=0.0, description="way of the head when it was learnt, in working pixels")
    px_per_mm: float = Field(ge=0.0, description="way of the head per millimetre of pull, in working pixels")


class SteeringConfig(ConfigSection):
    """The steering as the camera saw it."""

    heading_deg: float = Field(ge=-360.0, le=360.0, description="direction of the robot's end when it was learnt")
    roll_deg: float = Field(
        ge=-180.0, le=180.0, description="turn of the robot about its axis; 0: right and left act in the picture"
    )
    disagreement_deg: float = Field(ge=0.0, description="between the way of the head and the normal of its heading")
    turn_deg_per_mm: float | None = Field(
        None, gt=0.0, le=720.0, description="turn of the head per millimetre of pull to the right or left; empty: not measured"
    )
    tendons: tuple[TendonConfig, ...] = Field(min_length=2, max_length=4, description="in the order of the joints")


class ZeroConfig(ConfigSection):
    """Where the joints were zeroed. Of a tendon, which never goes a whole turn, it holds modulo one turn of the servo."""

    ticks: tuple[int, ...] = Field(min_length=MIN_JOINTS, max_length=MAX_JOINTS, description="position registers, by joint")
    slack_mm: tuple[float, ...] = Field(min_length=2, max_length=4, description="how far each tendon was from taut before")
    pretension_mm: float = Field(ge=0.0, le=5.0)
    found_utc: datetime | None = Field(None, description="when the wires were searched; None: by an earlier version")


class DrumsConfig(ConfigSection):
    """Diameters of what the servos turn, as measured: the drums of the wires, the wheels of feed and delivery.

    A lead screw counts as the drum of the same way per turn: its lead over pi.
    """

    tendons_mm: float = Field(gt=0.3, le=150.0, description="of all, with the wire on them")
    advance_mm: float = Field(gt=0.3, le=150.0)
    delivery_mm: float = Field(gt=0.3, le=150.0, description="of all")

    def mm_per_turn(self, joint: JointConfig) -> float:
        """The way of a joint at one turn of its drum; a rotation has a ratio of its own and no drum."""
        if joint.kind is JointKind.ROTATION:
            return joint.mm_per_turn
        diameters = {JointKind.TENDON: self.tendons_mm, JointKind.ADVANCE: self.advance_mm, JointKind.DELIVERY: self.delivery_mm}
        return round(math.pi * diameters[joint.kind], 4)

    def applied(self, servos: ServosConfig) -> ServosConfig:
        """The servos with the way per turn that these drums give."""
        joints = tuple(joint.model_copy(update={"mm_per_turn": self.mm_per_turn(joint)}) for joint in servos.joints)
        return servos.model_copy(update={"joints": joints})

    def fit(self, servos: ServosConfig) -> bool:
        """Whether the servos' ways per turn are still those of these drums."""
        return self.applied(servos).joints == servos.joints


class PortConfig(ConfigSection):
    """Where the robot is inserted, as shares of the undistorted picture's width and height."""

    x_share: float = Field(ge=0.0, le=1.0)
    y_share: float = Field(ge=0.0, le=1.0)


class Estimate(ConfigSection):
    """A value and its 95 % interval."""

    value: float
    low: float
    high: float

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if not self.low <= self.value <= self.high:
            raise ValueError("value must lie between low and high")
        return self


class BehaviourConfig(ConfigSection):
    """How the robot follows its servos, fitted to a recorded jog (``rig identify``)."""

    session: str = Field(max_length=200, description="that it was found in")
    bend_right_deg_per_mm: Estimate = Field(description="turn of the head per pull to the right beyond the slack")
    bend_left_deg_per_mm: Estimate
    slack_right_mm: Estimate = Field(description="pull to the right that bends nothing")
    slack_left_mm: Estimate
    play_mm: Estimate = Field(description="pull that is lost where its direction changes")
    shaft_to_head: Estimate = Field(description="bending stiffness of the shaft over that of the head")
    feed_share: Estimate = Field(description="way of the robot over that of the feed's joint, drawn back")
    feed_slip: Estimate = Field(description="share of it that is lost forward")
    delay_s: Estimate = Field(description="from a joint's motion to that in the picture")
    head_p50_mm: float = Field(ge=0.0, description="distance of the predicted and the seen head in the half that was not fitted")
    head_p95_mm: float = Field(ge=0.0)


class CalibrationConfig(ConfigSection):
    """All that was calibrated; None: not calibrated."""

    made_utc: datetime
    assumed: tuple[JointName, ...] | None = Field(
        None, description="joints whose servos one camera cannot tell apart, and nobody has confirmed: their ids decided"
    )
    wiring: tuple[tuple[int, int], ...] | None = Field(
        None,
        min_length=MIN_JOINTS,
        max_length=MAX_JOINTS,
        description="id and sign of each joint, found or confirmed: others in servos.joints are not known to be right",
    )
    drums: DrumsConfig | None = Field(None, description="None: nobody has measured them, and the ways per turn are assumed")
    lens: LensConfig | None = None
    scale: ScaleConfig | None = None
    steering: SteeringConfig | None = None
    zero: ZeroConfig | None = None
    port: PortConfig | None = None
    view: str | None = Field(
        None, max_length=100_000, description="small picture of the bench at its calibration (JPEG, base64): shows a moved camera"
    )

    def misfit(self, servos: ServosConfig) -> str:
        """What in it belongs to a robot of another shape than these servos drive, in one line; "" for nothing."""
        count, tendons = len(servos.joints), servos.names[servos.places(JointKind.TENDON)]
        if self.wiring is not None and len(self.wiring) != count:
            return f"calibration.wiring has {len(self.wiring)} joints, the robot has {count}"
        if self.zero is not None and (len(self.zero.ticks), len(self.zero.slack_mm)) != (count, len(tendons)):
            return f"calibration.zero must have {count} ticks and {len(tendons)} slack_mm"
        if self.steering is not None and tuple(one.name for one in self.steering.tendons) != tendons:
            return f"calibration.steering.tendons must be these in this order: {', '.join(tendons)}"
        return ""
