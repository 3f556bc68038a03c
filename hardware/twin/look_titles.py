"""What people call the families of looks; apart from their drawing, which a menu does not need."""

from __future__ import annotations

BENCH_LOOK = "bench"
"""The twin's own look, the default one."""

LOOK_TITLES = {
    BENCH_LOOK: "Clear bench",
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
"""The twin's own look and the ten families, in the order of menus."""

RARE_TITLES = {
    "gel": "Turbid gel",
    "drape": "Creased drape",
    "stage_light": "Lamps of two colours",
    "glow": "Glowing liquid",
    "tank": "Tank of rippling water",
    "picture": "Printed photograph",
    "resin": "Layers of printed resin",
}
"""The looks of rigs of other kinds (``rare_looks.py``)."""
