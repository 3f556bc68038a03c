"""How looks are called, and which one is configured; apart from their drawing, which a menu does not need."""

from __future__ import annotations

from core.config.models import TwinConfig

BENCH_LOOK = "bench"
"""The twin's own fixed look, which is in none of the families."""
BENCH_TITLE = "Clear bench"

LOOK_TITLES = {
    "silicone_white": "Silicone on white",
    "silicone_red": "Silicone on red",
    "silicone_dark": "Silicone on dark",
    "silicone_colour": "Silicone on a coloured board",
    "tinted_liquid": "Tinted liquid",
    "opaque_channel": "Opaque channels",
    "clear_block": "Channels in a clear block",
    "backlit": "Lit from behind",
    "fluoroscopy": "Fluoroscopy",
    "subtraction": "Subtraction angiography",
}
"""The ten families, of which looks are drawn where none is named."""

RARE_TITLES = {
    "gel": "Turbid gel",
    "drape": "Creased drape",
    "stage_light": "Lamps of two colours",
    "glow": "Glowing liquid",
    "tank": "Tank of rippling water",
    "picture": "Printed photograph",
    "resin": "Layers of printed resin",
}
"""Looks of rigs of other kinds, drawn only where they are named (``rare_looks.py``)."""

LOOKS = (*LOOK_TITLES, *RARE_TITLES, BENCH_LOOK)
"""The names of all looks."""
RANDOM_LOOK = "random"
"""For trials: each gets another look of the ten families."""
TRIAL_LOOKS = (RANDOM_LOOK, BENCH_LOOK, *LOOK_TITLES, *RARE_TITLES)


def look_of(config: TwinConfig) -> str | None:
    """The name of the configured look; None: any of the ten families, by the seed."""
    return config.look if config.look is not None or config.appearance_seed else BENCH_LOOK
