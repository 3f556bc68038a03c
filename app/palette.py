"""The colours of every window and overlay picture, as names. No Qt here, so that pictures can be drawn without a window.

State and overlay colours come from the palette of Okabe and Ito (2008), which stays distinct under every common colour blindness;
states are told by letter and shape as well. Text colours keep a contrast of at least 4.5 : 1 on the panels (tested).

There are two schemes, dark and light. A colour keeps its hue and its meaning in both; in the light one it is dark enough to be read
on white, and what is written on it (``INK``) is white. The names of this module (``palette.TEXT``) are those of the scheme in use:
look them up when you paint, or keep a role's name and ask ``of``. What lies over a camera picture does not depend on the windows:
its colours are ``ON_PICTURE``.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, fields

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

    @property
    def is_dark(self) -> bool:
        return contrast(self.WINDOW, "#FFFFFF") > contrast(self.WINDOW, "#000000")


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

# The scheme in use; ``use`` changes them all.
WINDOW = DARK.WINDOW
PANEL = DARK.PANEL
RAISED = DARK.RAISED
LINE = DARK.LINE
TEXT = DARK.TEXT
TEXT_DIM = DARK.TEXT_DIM
TEXT_FAINT = DARK.TEXT_FAINT
INK = DARK.INK
FAULT = DARK.FAULT
ORANGE = DARK.ORANGE
SKY = DARK.SKY
GREEN = DARK.GREEN
YELLOW = DARK.YELLOW
VERMILLION = DARK.VERMILLION
PURPLE = DARK.PURPLE
VESSEL = DARK.VESSEL
ROBOT = DARK.ROBOT
ROBOT_VECTOR = DARK.ROBOT_VECTOR
VESSEL_VECTOR = DARK.VESSEL_VECTOR
HEAD = DARK.HEAD
NEAREST = DARK.NEAREST
THETA = DARK.THETA
D_HEAD = DARK.D_HEAD
D_TAIL = DARK.D_TAIL
ROUTE = DARK.ROUTE
GHOST = DARK.GHOST
TARGET = DARK.TARGET
ALLOWED = DARK.ALLOWED
SIM = DARK.SIM
LIVE = DARK.LIVE
PLAYBACK = DARK.PLAYBACK

_ROLES = frozenset(field.name for field in fields(Scheme))
_current = DARK


def use(scheme: Scheme) -> None:
    """Take another scheme for all windows. ``theme.apply_theme`` does it, and has everything painted anew."""
    global _current  # noqa: PLW0603 - there is one screen, and one scheme for it
    _current = scheme
    globals().update(asdict(scheme))
    STATE_COLOUR[None] = scheme.TEXT_FAINT


def current() -> Scheme:
    """The scheme in use."""
    return _current


def of(role: str) -> str:
    """The colour of a role (``"SKY"``) in the scheme in use; a colour that is none ("#12AB00") is itself."""
    return str(getattr(_current, role)) if role in _ROLES else role


def sheet(text: str) -> str:
    """A style sheet in which ``@TEXT`` stands for the colour of that role."""
    return re.sub(r"@([A-Z_]+)", lambda found: of(found[1]), text)


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
