"""Recording as configuration: where sessions go, how the video is encoded, how much is kept in memory."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import platformdirs
from pydantic import BaseModel, ConfigDict, Field

GOP_FRAMES = 30
"""Longest run of pictures that need each other; it bounds what a damaged place costs and how long a seek takes."""


class RecordConfig(BaseModel):
    """How sessions are recorded."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    folder: str | None = Field(None, min_length=1, description="where sessions go; empty: LumenPilot in Videos")
    codec: Literal["lossy", "lossless"] = Field("lossy", description="lossless keeps every pixel, at a hundred times the size")
    quality_crf: int = Field(21, ge=0, le=40, description="of the lossy video; smaller is better and larger")
    max_mbit_s: float = Field(2.4, ge=0.2, le=100.0, description="upper end of the lossy video at 640x480; grows with the picture")
    masks: bool = Field(True, description="also keep the outlines of both masks and the vessel's centerlines, for the player")
    split_s: float = Field(3600.0, ge=1.0, le=86_400.0, description="a new video file after so long")
    sync_s: float = Field(2.0, ge=0.0, le=60.0, description="how often the files are forced to the disk; 0 = left to the system")
    max_queue: int = Field(60, ge=1, le=1000, description="frames waiting for the recorder; more are dropped and counted")
    ring_s: float = Field(30.0, ge=0.0, le=600.0, description="what 'save the last seconds' keeps in memory; 0 = off")
    ring_mb: float = Field(96.0, ge=1.0, le=4096.0, description="and its upper end")
    warn_free_mb: float = Field(500.0, ge=0.0, le=1e6, description="less free disk warns")
    warn_free_share: float = Field(0.07, ge=0.0, le=1.0, description="less free disk, as a share of it, warns")
    stop_free_mb: float = Field(40.0, ge=0.0, le=1e6, description="less free disk ends the recording while it can still be closed")


def sessions_folder(configured: str | None) -> Path:
    """Where sessions go: the configured folder, else LumenPilot in the user's videos."""
    return Path(configured).expanduser() if configured else Path(platformdirs.user_videos_dir()) / "LumenPilot"
