"""Thresholds of the gate and of the supervisor. The safety rules' own numbers are the upper ends: they may be tightened only.

Nor may they be tightened below what it takes to repeat a thing: a control or deadman that is held would be let go again and again.
"""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

_REPEATED_S = 0.05
"""Half as long again as a held key takes to be repeated (33 ms), and twice as long as a held deadman (25 ms)."""


class SafetyConfig(BaseModel):
    """When the program holds, disarms or stops. Ages count from the capture of the frame, not from its arrival."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

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
    min_confidence: float = Field(0.5, ge=0.0, le=1.0, description="below, autonomy holds")
    confidence_hysteresis: float = Field(0.05, ge=0.0, le=0.5, description="so much more is needed to go on")
    max_drift_px: float = Field(6.0, gt=0.0, le=100.0, description="movement of the landmarks that means a moved camera")
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
