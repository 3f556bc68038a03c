"""The foot pedal as configuration. Times that safety depends on may be tightened only."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

_SILENCE_S = 0.06
"""Longest pause between two reports, sent every 20 ms, that is no interruption yet: the foot need not be lifted after it either."""


class PedalConfig(BaseModel):
    """Foot pedal: deadman and STOP over a serial line. Its protocol and wiring: docs/bench.md."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    port: str | None = Field(None, min_length=1, description="stable path in /dev/serial/by-id; empty: no pedal")
    baud: int = Field(115_200, ge=9600, le=1_000_000, description="speed of the line")
    silence_s: float = Field(0.06, ge=0.03, le=_SILENCE_S, description="no report for so long: the deadman counts as released")
    press_reports: int = Field(
        2, ge=2, le=10, description="whole reports in a row that make a press; one makes a release, or a STOP"
    )
    resume_s: float = Field(
        0.5, ge=_SILENCE_S, le=0.5, description="after a longer interruption the foot must be lifted before a press counts again"
    )
    reconnect_s: float = Field(0.5, ge=0.05, le=10.0, description="pause between two attempts to open the port")
