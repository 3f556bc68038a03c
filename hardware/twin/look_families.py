"""Families of looks, from the pictures of real rigs: which knobs of an appearance are drawn from which range.

Ranges are wide on purpose: a network that has seen them all should not be surprised by a real bench.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from typing import Any

from numpy.random import Generator

Knobs = dict[str, Any]
Rgb = tuple[float, float, float]

ROBOT_LOOKS = ("ringed", "plain_dark", "white", "blue_gold", "metallic", "black_wire", "translucent", "banded", "coloured")

_LEAST_CONTRAST = 0.28


def _uniform(rng: Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _grey(rng: Generator, low: float, high: float, cast: float = 0.03) -> Rgb:
    level = rng.uniform(low, high)
    r, g, b = (float(min(max(level + rng.uniform(-cast, cast), 0.0), 1.0)) for _ in range(3))
    return r, g, b


def _hue(rng: Generator, hue: float, spread: float, saturation: tuple[float, float], value: tuple[float, float]) -> Rgb:
    return colorsys.hsv_to_rgb((hue + rng.uniform(-spread, spread)) % 1.0, rng.uniform(*saturation), rng.uniform(*value))


def _any_hue(rng: Generator, saturation: tuple[float, float], value: tuple[float, float]) -> Rgb:
    return _hue(rng, float(rng.random()), 0.0, saturation, value)


def _pick(rng: Generator, *choices: Any) -> Any:
    return choices[int(rng.integers(len(choices)))]


def _common(rng: Generator) -> Knobs:
    """Light, clutter and camera, alike in all families that are photographs."""
    turned = float(rng.choice([0.0, 180.0, 90.0, 270.0], p=[0.6, 0.3, 0.05, 0.05]))
    zoom = rng.uniform(2.4, 3.6) if rng.random() < 0.7 else rng.uniform(2.0, 4.5)
    return {
        "board_texture": _pick(rng, "plain", "speckle", "speckle", "grid", "brushed", "cloth"),
        "texture_strength": _uniform(rng, 0.05, 0.6),
        "table_rgb": _grey(rng, 0.05, 0.8, 0.1) if rng.random() < 0.6 else _hue(rng, 0.08, 0.03, (0.2, 0.6), (0.3, 0.75)),
        "light_gradient": _uniform(rng, 0.0, 0.4),
        "wall_mm": _uniform(rng, 0.6, 2.4),
        "wall_rgb": _grey(rng, 0.75, 1.0, 0.05),
        "wall_haze": _uniform(rng, 0.05, 0.4),
        "edge_bright": _uniform(rng, 0.15, 0.75),
        "edge_dark": _uniform(rng, 0.15, 0.7),
        "edge_mm": _uniform(rng, 0.25, 0.7),
        "refraction_mm": _uniform(rng, 0.0, 2.5),
        "lumen_shade": _uniform(rng, 0.05, 0.3),
        "light_deg": _uniform(rng, 0.0, 360.0),
        "highlight": _uniform(rng, 0.1, 0.95),
        "highlight_width": _uniform(rng, 0.07, 0.28),
        "lamps": int(rng.integers(0, 6)),
        "lamp_strength": _uniform(rng, 0.2, 0.95),
        "lamp_mm": _uniform(rng, 2.0, 12.0),
        "tube_shadow": _uniform(rng, 0.0, 0.45),
        "shadow_mm": _uniform(rng, 0.5, 5.0),
        "fittings": int(rng.choice([0, 1, 2, 3, 4], p=[0.35, 0.25, 0.2, 0.1, 0.1])),
        "fitting_rgb": _grey(rng, 0.1, 1.0, 0.05) if rng.random() < 0.6 else _any_hue(rng, (0.3, 0.9), (0.3, 0.95)),
        "fitting_opacity": _uniform(rng, 0.35, 0.92),
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
        "offset_mm": (_uniform(rng, -18, 18), _uniform(rng, -14, 14)),
        "distortion": float(rng.choice([0.0, rng.uniform(-0.08, 0.04)], p=[0.4, 0.6])),
        "blur_px": float(rng.choice([rng.uniform(0.2, 0.9), rng.uniform(0.9, 1.8)], p=[0.75, 0.25])),
        "motion_px": _uniform(rng, 1.0, 6.0) if rng.random() < 0.15 else 0.0,
        "motion_deg": _uniform(rng, 0.0, 180.0),
        "exposure": float(2.0 ** rng.uniform(-0.45, 0.3)),
        "white_balance": (_uniform(rng, 0.86, 1.12), 1.0, _uniform(rng, 0.82, 1.14)),
        "saturation": 0.0 if rng.random() < 0.1 else _uniform(rng, 0.6, 1.3),
        "gamma": _uniform(rng, 0.8, 1.25),
        "contrast": _uniform(rng, 0.75, 1.15),
        "vignette": _uniform(rng, 0.0, 0.5),
        "noise": float(rng.choice([rng.uniform(0.5, 5.0), rng.uniform(5.0, 13.0)], p=[0.75, 0.25])),
        "noise_grain_px": float(rng.choice([0.0, rng.uniform(0.4, 1.0)])),
        "jpeg_quality": int(rng.integers(35, 95)) if rng.random() < 0.35 else 0,
    }


def _clear_liquid(rng: Generator) -> Knobs:
    if rng.random() < 0.5:
        return {"liquid_rgb": _grey(rng, 0.8, 1.0, 0.06), "liquid_opacity": _uniform(rng, 0.03, 0.25)}
    hue = float(rng.choice([0.0, 0.08, 0.13, 0.55, 0.62]))
    return {"liquid_rgb": _hue(rng, hue, 0.03, (0.1, 0.5), (0.65, 1.0)), "liquid_opacity": _uniform(rng, 0.1, 0.5)}


def _silicone_white(rng: Generator) -> Knobs:
    return {"board_rgb": _grey(rng, 0.68, 0.95, 0.05), **_clear_liquid(rng)}


def _silicone_red(rng: Generator) -> Knobs:
    return {"board_rgb": _hue(rng, 0.98, 0.03, (0.65, 1.0), (0.4, 0.85)), **_clear_liquid(rng)}


def _silicone_dark(rng: Generator) -> Knobs:
    return {
        "board_rgb": _grey(rng, 0.03, 0.22, 0.03),
        "wall_haze": _uniform(rng, 0.12, 0.45),
        "wall_rgb": _grey(rng, 0.5, 0.9, 0.06),
        "edge_bright": _uniform(rng, 0.4, 0.9),
        **_clear_liquid(rng),
        "lumen_shade": _uniform(rng, 0.0, 0.1),
    }


def _silicone_colour(rng: Generator) -> Knobs:
    board = _hue(rng, float(rng.choice([0.08, 0.11, 0.33, 0.42, 0.55, 0.6, 0.65, 0.8])), 0.03, (0.25, 0.85), (0.25, 0.9))
    texture = _pick(rng, "plain", "speckle", "wood", "grid", "cloth", "wood")
    return {"board_rgb": board, "board_texture": texture, **_clear_liquid(rng)}


def _tinted_liquid(rng: Generator) -> Knobs:
    hue = float(rng.choice([0.98, 0.0, 0.03, 0.1, 0.15, 0.33, 0.5, 0.58, 0.62, 0.85]))
    return {
        "board_rgb": _grey(rng, 0.55, 0.95, 0.06) if rng.random() < 0.7 else _grey(rng, 0.05, 0.4, 0.06),
        "liquid_rgb": _hue(rng, hue, 0.03, (0.4, 1.0), (0.45, 0.95)),
        "liquid_opacity": _uniform(rng, 0.4, 0.9),
    }


def _opaque_channel(rng: Generator) -> Knobs:
    body = _grey(rng, 0.2, 0.95, 0.05) if rng.random() < 0.5 else _any_hue(rng, (0.15, 0.8), (0.35, 0.95))
    floor = rng.uniform(0.45, 1.02)
    liquid = (body[0] * floor, body[1] * floor, body[2] * floor)
    if rng.random() < 0.35:
        liquid = _grey(rng, 0.1, 0.95, 0.06) if rng.random() < 0.5 else _any_hue(rng, (0.2, 0.8), (0.3, 0.9))
    return {
        "material": "channel",
        "board_rgb": body,
        "board_texture": _pick(rng, "plain", "speckle", "brushed", "brushed", "cloth"),
        "liquid_rgb": liquid,
        "liquid_opacity": 1.0,
        "highlight": _uniform(rng, 0.0, 0.4),
        "tube_shadow": _uniform(rng, 0.15, 0.6),
        "lamp_strength": _uniform(rng, 0.1, 0.6),
        "robot_veil": 0.0,
    }


def _clear_block(rng: Generator) -> Knobs:
    knobs = _silicone_white(rng) if rng.random() < 0.6 else _silicone_colour(rng)
    return {**knobs, "material": "block", "lamp_mm": _uniform(rng, 4.0, 25.0), "wall_haze": _uniform(rng, 0.0, 0.25)}


def _backlit(rng: Generator) -> Knobs:
    return {
        "board_rgb": _grey(rng, 0.85, 1.0, 0.03),
        "board_texture": "plain",
        "texture_strength": _uniform(rng, 0.0, 0.15),
        "table_rgb": _grey(rng, 0.0, 0.3, 0.03),
        **_clear_liquid(rng),
        "edge_dark": _uniform(rng, 0.4, 0.9),
        "edge_bright": _uniform(rng, 0.0, 0.3),
        "highlight": _uniform(rng, 0.0, 0.25),
        "lamps": int(rng.integers(0, 2)),
        "tube_shadow": 0.0,
        "vignette": _uniform(rng, 0.1, 0.7),
        "robot_shadow": 0.0,
    }


def _xray(rng: Generator) -> Knobs:
    """What both X-ray families share: grey, noisy, no lamps, a device that absorbs."""
    return {
        "material": "xray",
        "board_texture": "plain",
        "light_gradient": _uniform(rng, 0.0, 0.5),
        "liquid_rgb": (0.0, 0.0, 0.0),
        "wall_haze": _uniform(rng, 0.0, 0.12),
        "lamps": 0,
        "highlight": 0.0,
        "objects": 0,
        "cables": int(rng.choice([0, 1, 2, 3], p=[0.4, 0.3, 0.2, 0.1])),
        "fittings": int(rng.choice([0, 1, 2], p=[0.6, 0.25, 0.15])),
        "fitting_opacity": _uniform(rng, 0.1, 0.5),
        "fitting_rgb": _grey(rng, 0.0, 0.3, 0.0),
        "bubbles": 0,
        "labels": int(rng.integers(0, 2)),
        "stains": int(rng.integers(0, 6)),
        "dust": int(rng.integers(0, 15)),
        "saturation": 0.0,
        "white_balance": (1.0, 1.0, 1.0),
        "blur_px": _uniform(rng, 0.6, 1.8),
        "noise": _uniform(rng, 4.0, 16.0),
        "noise_grain_px": _uniform(rng, 0.0, 1.3),
        "collimator": float(rng.choice([0.0, rng.uniform(0.85, 1.0)], p=[0.5, 0.5])),
        "robot_shadow": 0.0,
        "robot_gloss": 0.0,
    }


def _fluoroscopy(rng: Generator) -> Knobs:
    opacity = _uniform(rng, 0.16, 0.5)
    return {
        **_xray(rng),
        "board_rgb": _grey(rng, 0.45, 0.85, 0.0),
        "liquid_opacity": opacity,
        # Tissue may hide the lumen nearly, not wholly.
        "texture_strength": min(_uniform(rng, 0.15, 0.8), 2.0 * opacity),
    }


def _subtraction(rng: Generator) -> Knobs:
    bright = rng.random() < 0.4  # a road map shows the vessel brighter than its surroundings
    return {
        **_xray(rng),
        "board_rgb": _grey(rng, 0.35, 0.65, 0.0),
        "texture_strength": _uniform(rng, 0.0, 0.2),
        "liquid_rgb": (1.0, 1.0, 1.0) if bright else (0.0, 0.0, 0.0),
        "liquid_opacity": _uniform(rng, 0.18, 0.5),
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


def draw_robot_look(look: str, rng: Generator) -> Knobs:
    """The knobs of one of ``ROBOT_LOOKS``."""
    knobs: Knobs = {
        "robot_look": look,
        "robot_radius_mm": _uniform(rng, 0.6, 1.4),
        "robot_rgb": _grey(rng, 0.03, 0.22, 0.03),
        "robot_accent_rgb": _grey(rng, 0.45, 0.85, 0.04),
        "ring_pitch_mm": _uniform(rng, 1.8, 5.0),
        "ring_share": _uniform(rng, 0.15, 0.5),
        "tip_mm": _uniform(rng, 1.5, 9.0),
        "tip_rgb": _grey(rng, 0.05, 0.9, 0.05) if rng.random() < 0.6 else _hue(rng, 0.12, 0.03, (0.4, 0.8), (0.6, 0.95)),
        "tip_contrast": float(rng.choice([1.0, rng.uniform(0.45, 0.9), rng.uniform(0.22, 0.45)], p=[0.55, 0.3, 0.15])),
        "robot_opacity": _uniform(rng, 0.85, 1.0),
        "robot_gloss": _uniform(rng, 0.0, 0.7),
        "robot_veil": _uniform(rng, 0.0, 0.35),
        "robot_shadow": _uniform(rng, 0.0, 0.4),
        "sheath_extra_mm": _uniform(rng, 0.25, 0.8),
        "sheath_rgb": _grey(rng, 0.1, 0.95, 0.05) if rng.random() < 0.5 else _any_hue(rng, (0.2, 0.8), (0.4, 0.95)),
        "sheath_opacity": _uniform(rng, 0.25, 0.7),
    }
    special: dict[str, Knobs] = {
        "white": {"robot_rgb": _grey(rng, 0.82, 1.0, 0.03)},
        "blue_gold": {
            "robot_rgb": _hue(rng, 0.6, 0.05, (0.55, 0.95), (0.3, 0.75)),
            "tip_rgb": _hue(rng, 0.12, 0.02, (0.45, 0.8), (0.65, 0.95)),
        },
        "metallic": {"robot_rgb": _grey(rng, 0.4, 0.7, 0.03), "robot_gloss": _uniform(rng, 0.5, 1.0)},
        "black_wire": {"robot_rgb": _grey(rng, 0.0, 0.1, 0.01), "robot_radius_mm": _uniform(rng, 0.5, 0.8), "tip_contrast": 1.0},
        "translucent": {"robot_rgb": _grey(rng, 0.3, 0.85, 0.08), "robot_opacity": _uniform(rng, 0.4, 0.65)},
        "banded": {"robot_rgb": _grey(rng, 0.75, 0.95, 0.03), "robot_accent_rgb": _grey(rng, 0.02, 0.25, 0.02)},
        "coloured": {"robot_rgb": _any_hue(rng, (0.5, 1.0), (0.35, 0.95))},
    }
    knobs.update(special.get(look, {}))
    if look == "translucent":
        knobs["tip_contrast"] = max(0.6, knobs["tip_contrast"])
    return knobs


def draw_family(family: str, rng: Generator) -> Knobs:
    """All knobs of an appearance of `family`; only fields that differ from the defaults' meaning are drawn by the family itself."""
    look = ROBOT_LOOKS[int(rng.integers(len(ROBOT_LOOKS)))]
    robot, common = draw_robot_look(look, rng), _common(rng)
    own = _FAMILIES[family](rng)
    knobs = {"family": family, **common, **robot, **own}
    if knobs.get("material") == "xray":
        _absorbing(knobs, rng)
    else:
        _stand_out(knobs)
    # A device is 3 to 10 px wide in a picture of 640 px.
    zoom = float(knobs["pixels_per_mm"])
    knobs["robot_radius_mm"] = min(max(float(knobs["robot_radius_mm"]), 1.5 / zoom), 5.0 / zoom)
    return knobs


def _stand_out(knobs: Knobs) -> None:
    """Make the robot lighter or darker where it would vanish against the liquid: a label that nobody could see teaches nothing."""
    opacity, board = float(knobs["liquid_opacity"]), knobs["board_rgb"]
    behind = [b + (c - b) * opacity for b, c in zip(board, knobs["liquid_rgb"], strict=True)]
    robot = knobs["robot_rgb"]
    contrast = max(abs(r - b) for r, b in zip(robot, behind, strict=True))
    if contrast >= _LEAST_CONTRAST:
        return
    shift = _LEAST_CONTRAST if sum(behind) < 1.5 else -_LEAST_CONTRAST
    knobs["robot_rgb"] = tuple(min(max(b + shift, 0.0), 1.0) for b in behind)


def _absorbing(knobs: Knobs, rng: Generator) -> None:
    """Under X-rays every device is a dark, thin absorber; markers and tip absorb more or less than the shaft."""
    level = _uniform(rng, 0.0, 0.25)
    knobs["robot_rgb"] = (level, level, level)
    knobs["robot_accent_rgb"] = (0.0, 0.0, 0.0)
    knobs["tip_rgb"] = (0.0, 0.0, 0.0)
    knobs["robot_opacity"] = _uniform(rng, 0.5, 0.95)
    knobs["robot_veil"] = 0.0
    knobs["robot_radius_mm"] = _uniform(rng, 0.5, 1.2)
    knobs["tip_contrast"] = max(0.5, float(knobs["tip_contrast"]))
    knobs["sheath_rgb"] = (0.1, 0.1, 0.1)
    knobs["sheath_opacity"] = _uniform(rng, 0.1, 0.35)
