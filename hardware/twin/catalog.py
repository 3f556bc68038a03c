"""Names and titles of the looks, and the configured one. Without the rendering, which menus need not load."""

from __future__ import annotations

import numpy as np

from core.config.models import TwinConfig

BENCH_LOOK = "bench"
"""The fixed default look, in none of the families."""
BENCH_TITLE = "Clear bench"
OWN_LOOK = "own"
"""The empty picture of the bench whose phantom it is, with the robot in it; of another phantom as the default look."""
OWN_TITLE = "Your bench's own picture"

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
"""The ten families that looks are drawn from where none is named."""

RARE_TITLES = {
    "gel": "Turbid gel",
    "drape": "Creased drape",
    "stage_light": "Lamps of two colours",
    "glow": "Glowing liquid",
    "tank": "Tank of rippling water",
    "picture": "Printed photograph",
    "resin": "3D-printed resin",
}
"""Looks of other kinds of rigs, drawn only where they are named."""

LOOKS = (*LOOK_TITLES, *RARE_TITLES, BENCH_LOOK, OWN_LOOK)
"""The names of all looks."""
RANDOM_LOOK = "random"
"""For trials: each gets another look of the ten families."""
TRIAL_LOOKS = (RANDOM_LOOK, BENCH_LOOK, OWN_LOOK, *LOOK_TITLES, *RARE_TITLES)


def family_of(seed: int) -> str:
    """Name of the family that a look is drawn from where none is named; the same for the same `seed` (not negative)."""
    return tuple(LOOK_TITLES)[int(np.random.default_rng([seed, 7919]).integers(len(LOOK_TITLES)))]


def look_of(config: TwinConfig) -> str | None:
    """Name of the configured look; None: any of the ten families, by the seed."""
    return config.look if config.look is not None or config.appearance_seed else BENCH_LOOK
