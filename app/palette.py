"""The colours of every window and overlay picture, as names. No Qt here, so that pictures can be drawn without a window.

State and overlay colours come from the palette of Okabe and Ito (2008), which stays distinct under every common colour blindness;
states are told by letter and shape as well. Text colours keep a contrast of at least 4.5 : 1 on the panels (tested).
"""

from __future__ import annotations

from core.types import PoseState

# Okabe and Ito
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"

# surfaces and text, dark
WINDOW = "#0E1116"
PANEL = "#171B22"
RAISED = "#222831"
LINE = "#323A46"
TEXT = "#EEF1F5"
TEXT_DIM = "#A9B3C1"
TEXT_FAINT = "#8490A0"
INK = "#0B0D10"
FAULT = "#FF7B72"

STATE_COLOUR: dict[PoseState | None, str] = {
    PoseState.A: GREEN,
    PoseState.B: SKY,
    PoseState.C: VERMILLION,
    PoseState.D: YELLOW,
    None: TEXT_FAINT,
}

# what is drawn over the picture; gauge, bars and trends use the same colour for the same quantity
VESSEL = SKY
ROBOT = ORANGE
ROBOT_VECTOR = YELLOW
VESSEL_VECTOR = "#BFE3F9"
HEAD = "#FFFFFF"
NEAREST = "#FFFFFF"
THETA = YELLOW
D_HEAD = PURPLE
D_TAIL = "#E9C3D8"
ROUTE = "#35D0A5"
GHOST = "#8F6BFF"
TARGET = "#35D0A5"
ALLOWED = "#1FB58A"
SIM = "#E69F00"
LIVE = "#D55E00"
PLAYBACK = "#56B4E9"


def rgb(name: str) -> tuple[int, int, int]:
    """A colour "#RRGGBB" as three numbers 0..255."""
    return int(name[1:3], 16), int(name[3:5], 16), int(name[5:7], 16)


def contrast(first: str, second: str) -> float:
    """Contrast ratio of two colours after WCAG 2.1 (1..21)."""

    def luminance(name: str) -> float:
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (part / 255 for part in rgb(name))]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((luminance(first), luminance(second)), reverse=True)
    return (high + 0.05) / (low + 0.05)
