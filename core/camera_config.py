"""The camera as configuration: which one, and how it takes its pictures. Files and the bench twin have none of this."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class CameraConfig(BaseModel):
    """A real camera. Where it has no such setting, what is asked for is left out, and ``doctor`` says so."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    serial: str | None = Field(None, min_length=1, description="RealSense: its serial number; empty: the only one there is")
    device: str | None = Field(
        None, min_length=1, description="webcam: its stable path in /dev/v4l/by-id, or its number; empty: the first one"
    )
    width_px: int = Field(640, ge=160, le=4096, description="of the pictures")
    height_px: int = Field(480, ge=120, le=4096, description="of the pictures")
    frames_per_second: int = Field(30, ge=5, le=240, description="that the camera is asked for")
    pixel_format: str = Field("MJPG", pattern="^[A-Z0-9]{4}$", description="webcam: FOURCC; MJPG is what USB 2 has the room for")
    exposure_ms: float | None = Field(None, gt=0.0, le=1000.0, description="empty: automatic, but never at the cost of frames")
    gain: float | None = Field(None, ge=0.0, le=65535.0, description="in the camera's own steps; empty: as it is")
    white_balance_k: int | None = Field(None, ge=2000, le=10_000, description="colour temperature; empty: automatic")
    lost_after_s: float = Field(0.4, ge=0.1, le=0.5, description="no frame for so long: the camera counts as lost")
    reconnect_s: float = Field(0.5, ge=0.1, le=30.0, description="pause between two attempts to open a lost camera")
