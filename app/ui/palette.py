"""The colours of windows, overlays and figures in two schemes, dark and light. Without Qt, so that commands can draw with them.

State and overlay colours come from the palette of Okabe and Ito (2008), which stays distinct under every common colour blindness;
states have a letter and a shape as well. Text has a contrast of at least 4.5 : 1 on the panels (tested). A colour keeps its hue and
its meaning in both schemes; in the light one it is dark enough to be read on white, and what is written on it (``INK``) is white.
"""

from __future__ import annotations

from dataclasses import dataclass

from core.types import PoseState


@dataclass(frozen=True, slots=True)
class Scheme:
    """All colours of a window, by role."""

    # surfaces and text
    WINDOW: str = "#0E1116"
    PANEL: str = "#171B22"
    RAISED: str = "#222831"
    LINE: str = "#323A46"
    TEXT: str = "#EEF1F5"
    TEXT_DIM: str = "#A9B3C1"
    TEXT_FAINT: str = "#8490A0"
    INK: str = "#0B0D10"  # on a ground of any colour below
    FAULT: str = "#FF7B72"
    # Okabe and Ito
    ORANGE: str = "#E69F00"
    SKY: str = "#56B4E9"
    GREEN: str = "#009E73"
    YELLOW: str = "#F0E442"
    VERMILLION: str = "#D55E00"
    PURPLE: str = "#CC79A7"
    # what is drawn over the picture; gauge, bars and trends use the same hue for the same quantity
    VESSEL: str = "#56B4E9"
    ROBOT: str = "#E69F00"
    ROBOT_VECTOR: str = "#F0E442"
    VESSEL_VECTOR: str = "#BFE3F9"
    HEAD: str = "#FFFFFF"
    NEAREST: str = "#FFFFFF"
    THETA: str = "#F0E442"
    D_HEAD: str = "#CC79A7"
    D_TAIL: str = "#E9C3D8"
    ROUTE: str = "#35D0A5"
    GHOST: str = "#8F6BFF"
    TARGET: str = "#35D0A5"
    ALLOWED: str = "#1FB58A"
    SIM: str = "#E69F00"
    LIVE: str = "#D55E00"
    PLAYBACK: str = "#56B4E9"


DARK = Scheme()
LIGHT = Scheme(
    WINDOW="#E8ECF1",
    PANEL="#FFFFFF",
    RAISED="#E1E7EE",
    LINE="#BCC6D1",
    TEXT="#12161C",
    TEXT_DIM="#3A4554",
    TEXT_FAINT="#566172",
    INK="#FFFFFF",
    FAULT="#B3201A",
    ORANGE="#8F5A00",
    SKY="#0067A3",
    GREEN="#007052",
    YELLOW="#6F6400",
    VERMILLION="#A94700",
    PURPLE="#A03B74",
    VESSEL="#0067A3",
    ROBOT="#8F5A00",
    ROBOT_VECTOR="#6F6400",
    VESSEL_VECTOR="#4C6E86",
    HEAD="#12161C",
    NEAREST="#12161C",
    THETA="#6F6400",
    D_HEAD="#A03B74",
    D_TAIL="#6B3152",
    ROUTE="#007052",
    GHOST="#5B3FD6",
    TARGET="#007052",
    ALLOWED="#0A6A4E",
    SIM="#8F5A00",
    LIVE="#A94700",
    PLAYBACK="#0067A3",
)
ON_PICTURE = DARK
"""Over a camera picture, in both schemes."""

STATE_INK = "#0B0D10"
"""A state's letter on its colour, in both schemes: a state's ground never changes."""
STATE_COLOUR: dict[PoseState | None, str] = {
    PoseState.A: "#009E73",
    PoseState.B: "#56B4E9",
    PoseState.C: "#D55E00",
    PoseState.D: "#F0E442",
    None: DARK.TEXT_FAINT,
}


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
