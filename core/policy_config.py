"""Settings of the policies that advise and drive, and of the loop from advice to command. Pixels are working pixels."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

PolicyName = Literal["pursuit", "table", "push", "random"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class PursuitConfig(_Section):
    """Look-ahead along the route."""

    pixels_per_mm: float = Field(3.0, gt=0.1, le=50.0, description="of the view, roughly; a calibrated rig has its own scale")
    look_ahead_px: float = Field(10.0, ge=4.0, le=200.0, description="distance of the look-ahead point from a resting head")
    look_ahead_s: float = Field(0.15, ge=0.0, le=5.0, description="so much way at the present speed is added to it")
    rounding_px: float = Field(
        8.0, ge=0.0, le=100.0, description="after each miss of a branch its corner is rounded over so much more"
    )
    heading_px: float = Field(16.0, ge=4.0, le=100.0, description="end of the robot whose direction is the head's")
    follow_arc: float = Field(0.9, ge=0.0, le=1.0, description="0 = point at the look-ahead point, 1 = lie along the route")
    gain: float = Field(1.0, gt=0.0, le=5.0, description="degrees of steering per degree of error")
    min_bend_radius_px: float = Field(30.0, ge=5.0, le=500.0, description="tightest arc that is steered for")
    smoothing_s: float = Field(0.08, ge=0.0, le=1.0, description="time constant of the steering's low-pass")
    preview_px: float = Field(50.0, ge=5.0, le=400.0, description="bends and bifurcations so far ahead slow the robot down")
    brake_px: float = Field(16.0, ge=5.0, le=400.0, description="way left at which it begins to slow down for the target")
    gentle_turn_deg: float = Field(25.0, gt=0.0, le=180.0, description="turn within the preview that still allows full speed")
    slow_steer_deg: float = Field(10.0, gt=0.0, le=180.0, description="steering error above which the robot goes slow")
    wall_share: float = Field(0.85, gt=0.1, le=1.5, description="head's distance over the room it has: above, near the wall")
    contact_slow_n: float = Field(0.06, gt=0.0, le=5.0, description="rise of the contact force that slows the robot down")
    lean_mm: float = Field(5.0, gt=0.1, le=100.0, description="way over which a contact force becomes the body's own lean")
    contact_back_off_n: float = Field(0.22, gt=0.0, le=5.0, description="contact force above which it backs off")
    contact_limit_n: float = Field(0.40, gt=0.0, le=5.0, description="never leans harder, however often it backed off")
    stuck_s: float = Field(1.5, ge=0.2, le=20.0, description="no progress for so long: back off")
    stuck_share: float = Field(0.2, ge=0.0, le=1.0, description="progress below this share of what was advised is none")
    back_off_mm: float = Field(4.0, gt=0.0, le=50.0, description="way back when stuck; half of it from a wall")
    behind_s: float = Field(0.3, ge=0.0, le=5.0, description="the way must have lain behind the head for so long to back off")
    retry_mm: float = Field(9.0, gt=0.0, le=50.0, description="way back from where a missed branch lies beside the head")
    arrive_px: float = Field(8.0, ge=1.0, le=100.0, description="way left at which the target counts as reached")
    most_misses: int = Field(2, ge=1, le=100, description="after missing a branch so often it gives up and stops")
    most_tries: int = Field(4, ge=1, le=100, description="backed off so often without coming farther: it gives up and stops")

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        if not self.contact_slow_n < self.contact_back_off_n <= self.contact_limit_n:
            raise ValueError("contact_slow_n must be below contact_back_off_n, and that not above contact_limit_n")
        if self.brake_px <= self.arrive_px:
            raise ValueError("brake_px must be above arrive_px, or it would never brake")
        return self


class DriveConfig(_Section):
    """From advice to the tendons' bend and the feed."""

    turn_deg: float = Field(94.0, gt=1.0, le=720.0, description="by how much the head turns at a bend of 1")
    proportional: float = Field(0.3, ge=0.0, le=5.0, description="share of the advised turn that is made at once")
    integral_s: float = Field(0.3, ge=0.02, le=60.0, description="time in which the advised turn is made, if advice stays the same")
    max_bend_rate_per_s: float = Field(1.5, gt=0.0, le=20.0, description="share of the tendons' full pull per second, at most")
    max_acceleration_mm_s2: float = Field(30.0, gt=0.0, le=1000.0, description="of the feed")
    max_gap_s: float = Field(0.1, gt=0.0, le=0.5, description="a longer pause between two commands counts as so much")


class HandConfig(_Section):
    """Driving by hand: speeds at full deflection of a key or a stick."""

    bend_rate_per_s: float = Field(1.2, gt=0.0, le=5.0, description="share of the tendons' full pull per second")
    advance_mm_s: float = Field(10.0, gt=0.0, le=20.0, description="of the robot module")
    delivery_mm_s: float = Field(10.0, gt=0.0, le=20.0, description="of the catheter")


class PolicyConfig(_Section):
    """Who advises, and drives when handed over to."""

    name: PolicyName = Field("pursuit", description="table = the paper's; push and random are baselines of trial")
    pursuit: PursuitConfig = PursuitConfig()
    drive: DriveConfig = DriveConfig()
