"""The gamepad as configuration."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class GamepadConfig(BaseModel):
    """Sticks and buttons that drive by hand. Which does what: docs/bench.md."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    enabled: bool = Field(True, description="false = gamepads are left alone")
    device: str | None = Field(None, min_length=1, description="path in /dev/input; empty: the first gamepad that is plugged in")
    dead_zone: float = Field(0.15, ge=0.02, le=0.5, description="share of a stick's or trigger's way that counts as rest")
    expo: float = Field(0.5, ge=0.0, le=1.0, description="0 = linear, 1 = cubic: finer near the middle")
    deadman: bool = Field(False, description="right shoulder button as deadman; for wired gamepads only")
