"""Families of looks, from the pictures of real rigs: which knobs of an appearance are drawn from which range.

Ranges are wide on purpose: a network that has seen them all should not be surprised by a real bench.
"""

from __future__ import annotations

from collections.abc import Callable

from numpy.random import Generator

from hardware.twin.draws import Knobs, any_hue, grey, hue, pick, uniform
from hardware.twin.rare_looks import RARE
from hardware.twin.robot_families import ROBOT_LOOKS, absorb, draw_robot_look, stand_out


def _common(rng: Generator) -> Knobs:
    """Light, clutter and camera, alike in all families that are photographs."""
    turned = float(rng.choice([0.0, 180.0, 90.0, 270.0], p=[0.6, 0.3, 0.05, 0.05]))
    zoom = rng.uniform(2.4, 3.6) if rng.random() < 0.7 else rng.uniform(2.0, 4.5)
    return {
        "board_texture": pick(rng, "plain", "speckle", "speckle", "grid", "brushed", "cloth"),
        "texture_strength": uniform(rng, 0.05, 0.6),
        "table_rgb": grey(rng, 0.05, 0.8, 0.1) if rng.random() < 0.6 else hue(rng, 0.08, 0.03, (0.2, 0.6), (0.3, 0.75)),
        "light_gradient": uniform(rng, 0.0, 0.4),
        "wall_mm": uniform(rng, 0.6, 2.4),
        "wall_rgb": grey(rng, 0.75, 1.0, 0.05),
        "wall_haze": uniform(rng, 0.05, 0.4),
        "edge_bright": uniform(rng, 0.15, 0.75),
        "edge_dark": uniform(rng, 0.15, 0.7),
        "edge_mm": uniform(rng, 0.25, 0.7),
        "refraction_mm": uniform(rng, 0.0, 2.5),
        "lumen_shade": uniform(rng, 0.05, 0.3),
        "light_deg": uniform(rng, 0.0, 360.0),
        "highlight": uniform(rng, 0.1, 0.95),
        "highlight_width": uniform(rng, 0.07, 0.28),
        "lamps": int(rng.integers(0, 6)),
        "lamp_strength": uniform(rng, 0.2, 0.95),
        "lamp_mm": uniform(rng, 2.0, 12.0),
        "tube_shadow": uniform(rng, 0.0, 0.45),
        "shadow_mm": uniform(rng, 0.5, 5.0),
        "fittings": int(rng.choice([0, 1, 2, 3, 4], p=[0.35, 0.25, 0.2, 0.1, 0.1])),
        "fitting_rgb": grey(rng, 0.1, 1.0, 0.05) if rng.random() < 0.6 else any_hue(rng, (0.3, 0.9), (0.3, 0.95)),
        "fitting_opacity": uniform(rng, 0.3, 0.85),
        "end_fittings": bool(rng.random() < 0.6),
        "bubbles": int(rng.integers(1, 12)) if rng.random() < 0.3 else 0,
        "cables": int(rng.choice([0, 1, 2, 3, 4], p=[0.3, 0.25, 0.2, 0.15, 0.1])),
        "objects": int(rng.choice([0, 1, 2, 3], p=[0.55, 0.25, 0.12, 0.08])),
        "ruler": bool(rng.random() < 0.25),
        "labels": int(rng.integers(0, 4)),
        "stains": int(rng.integers(0, 5)),
        "dust": int(rng.integers(0, 80)),
        "clutter_seed": int(rng.integers(2**31)),
        "pixels_per_mm": float(zoom),
        "rotation_deg": turned + float(rng.normal(0, 5.0)),
        "tilt": (float(rng.normal(0, 0.05)), float(rng.normal(0, 0.05))),
        "offset_mm": (uniform(rng, -18, 18), uniform(rng, -14, 14)),
        "distortion": float(rng.choice([0.0, rng.uniform(-0.08, 0.04)], p=[0.4, 0.6])),
        "blur_px": float(rng.choice([rng.uniform(0.2, 0.9), rng.uniform(0.9, 1.8)], p=[0.75, 0.25])),
        "motion_px": uniform(rng, 1.0, 6.0) if rng.random() < 0.15 else 0.0,
        "motion_deg": uniform(rng, 0.0, 180.0),
        "exposure": float(2.0 ** rng.uniform(-0.45, 0.3)),
        "white_balance": (uniform(rng, 0.86, 1.12), 1.0, uniform(rng, 0.82, 1.14)),
        "saturation": 0.0 if rng.random() < 0.1 else uniform(rng, 0.6, 1.3),
        "gamma": uniform(rng, 0.8, 1.25),
        "contrast": uniform(rng, 0.75, 1.15),
        "vignette": uniform(rng, 0.0, 0.5),
        "noise": float(rng.choice([rng.uniform(0.5, 5.0), rng.uniform(5.0, 11.0)], p=[0.75, 0.25])),
        "noise_grain_px": float(rng.choice([0.0, rng.uniform(0.4, 1.0)])),
        "jpeg_quality": int(rng.integers(35, 95)) if rng.random() < 0.35 else 0,
    }


def _clear_liquid(rng: Generator) -> Knobs:
    if rng.random() < 0.5:
        return {"liquid_rgb": grey(rng, 0.8, 1.0, 0.06), "liquid_opacity": uniform(rng, 0.03, 0.25)}
    base = float(rng.choice([0.0, 0.08, 0.13, 0.55, 0.62]))
    return {"liquid_rgb": hue(rng, base, 0.03, (0.1, 0.5), (0.65, 1.0)), "liquid_opacity": uniform(rng, 0.1, 0.5)}


def _silicone_white(rng: Generator) -> Knobs:
    return {"board_rgb": grey(rng, 0.68, 0.95, 0.05), **_clear_liquid(rng)}


def _silicone_red(rng: Generator) -> Knobs:
    return {"board_rgb": hue(rng, 0.98, 0.03, (0.65, 1.0), (0.4, 0.85)), **_clear_liquid(rng)}


def _silicone_dark(rng: Generator) -> Knobs:
    return {
        "board_rgb": grey(rng, 0.03, 0.22, 0.03),
        "wall_haze": uniform(rng, 0.12, 0.45),
        "wall_rgb": grey(rng, 0.5, 0.9, 0.06),
        "edge_bright": uniform(rng, 0.4, 0.9),
        **_clear_liquid(rng),
        "lumen_shade": uniform(rng, 0.0, 0.1),
    }


def _silicone_colour(rng: Generator) -> Knobs:
    board = hue(rng, float(rng.choice([0.08, 0.11, 0.33, 0.42, 0.55, 0.6, 0.65, 0.8])), 0.03, (0.25, 0.85), (0.25, 0.9))
    texture = pick(rng, "plain", "speckle", "wood", "grid", "cloth", "wood")
    return {"board_rgb": board, "board_texture": texture, **_clear_liquid(rng)}


def _tinted_liquid(rng: Generator) -> Knobs:
    base = float(rng.choice([0.98, 0.0, 0.03, 0.1, 0.15, 0.33, 0.5, 0.58, 0.62, 0.85]))
    return {
        "board_rgb": grey(rng, 0.55, 0.95, 0.06) if rng.random() < 0.7 else grey(rng, 0.05, 0.4, 0.06),
        "liquid_rgb": hue(rng, base, 0.03, (0.4, 1.0), (0.45, 0.95)),
        "liquid_opacity": uniform(rng, 0.4, 0.9),
    }


def _opaque_channel(rng: Generator) -> Knobs:
    body = grey(rng, 0.2, 0.95, 0.05) if rng.random() < 0.5 else any_hue(rng, (0.15, 0.8), (0.35, 0.95))
    floor = rng.uniform(0.45, 1.02)
    liquid = (body[0] * floor, body[1] * floor, body[2] * floor)
    if rng.random() < 0.35:
        liquid = grey(rng, 0.1, 0.95, 0.06) if rng.random() < 0.5 else any_hue(rng, (0.2, 0.8), (0.3, 0.9))
    return {
        "material": "channel",
        "board_rgb": body,
        "board_texture": pick(rng, "plain", "speckle", "brushed", "brushed", "cloth"),
        "liquid_rgb": liquid,
        "liquid_opacity": 1.0,
        "highlight": uniform(rng, 0.0, 0.4),
        "tube_shadow": uniform(rng, 0.15, 0.6),
        "lamp_strength": uniform(rng, 0.1, 0.6),
        "robot_veil": 0.0,
    }


def _clear_block(rng: Generator) -> Knobs:
    knobs = _silicone_white(rng) if rng.random() < 0.6 else _silicone_colour(rng)
    return {**knobs, "material": "block", "lamp_mm": uniform(rng, 4.0, 25.0), "wall_haze": uniform(rng, 0.0, 0.25)}


def _backlit(rng: Generator) -> Knobs:
    return {
        "board_rgb": grey(rng, 0.85, 1.0, 0.03),
        "board_texture": "plain",
        "texture_strength": uniform(rng, 0.0, 0.15),
        "table_rgb": grey(rng, 0.0, 0.3, 0.03),
        **_clear_liquid(rng),
        "edge_dark": uniform(rng, 0.4, 0.9),
        "edge_bright": uniform(rng, 0.0, 0.3),
        "highlight": uniform(rng, 0.0, 0.25),
        "lamps": int(rng.integers(0, 2)),
        "tube_shadow": 0.0,
        "vignette": uniform(rng, 0.1, 0.7),
        "robot_shadow": 0.0,
    }


def _xray(rng: Generator) -> Knobs:
    """What both X-ray families share: grey, noisy, no lamps, a device that absorbs."""
    return {
        "material": "xray",
        "board_texture": "plain",
        "light_gradient": uniform(rng, 0.0, 0.5),
        "liquid_rgb": (0.0, 0.0, 0.0),
        "wall_haze": uniform(rng, 0.0, 0.12),
        "lamps": 0,
        "highlight": 0.0,
        "objects": 0,
        "cables": int(rng.choice([0, 1, 2, 3], p=[0.4, 0.3, 0.2, 0.1])),
        "fittings": int(rng.choice([0, 1, 2], p=[0.6, 0.25, 0.15])),
        "fitting_opacity": uniform(rng, 0.1, 0.5),
        "fitting_rgb": grey(rng, 0.0, 0.3, 0.0),
        "bubbles": 0,
        "labels": int(rng.integers(0, 2)),
        "stains": int(rng.integers(0, 6)),
        "dust": int(rng.integers(0, 15)),
        "saturation": 0.0,
        "white_balance": (1.0, 1.0, 1.0),
        "blur_px": uniform(rng, 0.6, 1.8),
        "noise": uniform(rng, 4.0, 14.0),
        "noise_grain_px": uniform(rng, 0.0, 1.3),
        "collimator": float(rng.choice([0.0, rng.uniform(0.85, 1.0)], p=[0.5, 0.5])),
        "robot_shadow": 0.0,
        "robot_gloss": 0.0,
    }


def _fluoroscopy(rng: Generator) -> Knobs:
    opacity = uniform(rng, 0.16, 0.5)
    return {
        **_xray(rng),
        "board_rgb": grey(rng, 0.45, 0.85, 0.0),
        "liquid_opacity": opacity,
        # Tissue may hide the lumen nearly, not wholly.
        "texture_strength": min(uniform(rng, 0.15, 0.8), 2.0 * opacity),
    }


def _subtraction(rng: Generator) -> Knobs:
    bright = rng.random() < 0.4  # a road map shows the vessel brighter than its surroundings
    return {
        **_xray(rng),
        "board_rgb": grey(rng, 0.35, 0.65, 0.0),
        "texture_strength": uniform(rng, 0.0, 0.2),
        "liquid_rgb": (1.0, 1.0, 1.0) if bright else (0.0, 0.0, 0.0),
        "liquid_opacity": uniform(rng, 0.18, 0.5),
    }


_FAMILIES: dict[str, Callable[[Generator], Knobs]] = {
    "silicone_white": _silicone_white,
    "silicone_red": _silicone_red,
    "silicone_dark": _silicone_dark,
    "silicone_colour": _silicone_colour,
    "tinted_liquid": _tinted_liquid,
    "opaque_channel": _opaque_channel,
    "clear_block": _clear_block,
    "backlit": _backlit,
    "fluoroscopy": _fluoroscopy,
    "subtraction": _subtraction,
}
LOOK_FAMILIES = tuple(_FAMILIES)
RARE_FAMILIES = tuple(RARE)
"""Looks that are drawn only where they are named (``rare_looks.py``)."""


def draw_family(family: str, rng: Generator) -> Knobs:
    """All knobs of an appearance of `family`; only fields that differ from the defaults' meaning are drawn by the family itself."""
    look = ROBOT_LOOKS[int(rng.integers(len(ROBOT_LOOKS)))]
    robot, common = draw_robot_look(look, rng), _common(rng)
    own = (_FAMILIES | RARE)[family](rng)
    knobs = {"family": family, **common, **robot, **own}
    if knobs.get("material") == "xray":
        absorb(knobs, rng)
    else:
        stand_out(knobs)
    # A device is 3 to 10 px wide in a picture of 640 px.
    zoom = float(knobs["pixels_per_mm"])
    knobs["robot_radius_mm"] = min(max(float(knobs["robot_radius_mm"]), 1.5 / zoom), 5.0 / zoom)
    return knobs
