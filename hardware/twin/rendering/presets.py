"""Families of looks, from the pictures of real rigs: which knobs of an appearance are drawn from which range.

Ranges are wide on purpose: a network that has seen them all should not be surprised by a real bench.

Looks of the robot, from the devices seen on real benches: which knobs are drawn from which range.

Looks that are drawn only where they are named: rigs of other kinds than the ten families, to test on and to learn from.

Each changes how the picture comes about, not only its colours: light that is spread in a gel, given by the liquid, bent by water,
or coloured; boards that are folded, printed with pictures, or built up in layers.

Random draws that all families of looks share: numbers, greys, hues, choices.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from typing import Any

from numpy.random import Generator

Knobs = dict[str, Any]
Rgb = tuple[float, float, float]


def uniform(rng: Generator, low: float, high: float) -> float:
    """A number between `low` and `high`."""
    return float(rng.uniform(low, high))


def grey(rng: Generator, low: float, high: float, cast: float = 0.03) -> Rgb:
    """A grey with a slight colour cast."""
    level = rng.uniform(low, high)
    r, g, b = (float(min(max(level + rng.uniform(-cast, cast), 0.0), 1.0)) for _ in range(3))
    return r, g, b


def hue(rng: Generator, hue: float, spread: float, saturation: tuple[float, float], value: tuple[float, float]) -> Rgb:
    """A colour near a hue (0..1)."""
    return colorsys.hsv_to_rgb((hue + rng.uniform(-spread, spread)) % 1.0, rng.uniform(*saturation), rng.uniform(*value))


def any_hue(rng: Generator, saturation: tuple[float, float], value: tuple[float, float]) -> Rgb:
    """A colour of any hue."""
    return hue(rng, float(rng.random()), 0.0, saturation, value)


def pick(rng: Generator, *choices: Any) -> Any:
    """One of the `choices`."""
    return choices[int(rng.integers(len(choices)))]


ROBOT_LOOKS = ("ringed", "plain_dark", "white", "blue_gold", "metallic", "black_wire", "translucent", "banded", "coloured")

_LEAST_BODY_CONTRAST = 0.17
_LEAST_TIP_CONTRAST = 0.11
_LUMA = (0.299, 0.587, 0.114)


def draw_robot_look(look: str, rng: Generator) -> Knobs:
    """The knobs of one of ``ROBOT_LOOKS``."""
    knobs: Knobs = {
        "robot_look": look,
        "robot_radius_mm": uniform(rng, 0.6, 1.4),
        "robot_rgb": grey(rng, 0.03, 0.22, 0.03),
        "robot_accent_rgb": grey(rng, 0.45, 0.85, 0.04),
        "ring_pitch_mm": uniform(rng, 1.8, 5.0),
        "ring_share": uniform(rng, 0.15, 0.5),
        "tip_mm": uniform(rng, 1.5, 9.0),
        "tip_rgb": grey(rng, 0.05, 0.9, 0.05) if rng.random() < 0.6 else hue(rng, 0.12, 0.03, (0.4, 0.8), (0.6, 0.95)),
        "tip_contrast": float(rng.choice([1.0, rng.uniform(0.5, 0.9), rng.uniform(0.25, 0.5)], p=[0.6, 0.3, 0.1])),
        "robot_opacity": uniform(rng, 0.85, 1.0),
        "robot_gloss": uniform(rng, 0.0, 0.7),
        "robot_veil": uniform(rng, 0.0, 0.35),
        "robot_shadow": uniform(rng, 0.0, 0.4),
        "sheath_extra_mm": uniform(rng, 0.25, 0.8),
        "sheath_rgb": grey(rng, 0.1, 0.95, 0.05) if rng.random() < 0.5 else any_hue(rng, (0.2, 0.8), (0.4, 0.95)),
        "sheath_opacity": uniform(rng, 0.25, 0.7),
    }
    special: dict[str, Knobs] = {
        "white": {"robot_rgb": grey(rng, 0.82, 1.0, 0.03)},
        "blue_gold": {
            "robot_rgb": hue(rng, 0.6, 0.05, (0.55, 0.95), (0.3, 0.75)),
            "tip_rgb": hue(rng, 0.12, 0.02, (0.45, 0.8), (0.65, 0.95)),
        },
        "metallic": {"robot_rgb": grey(rng, 0.4, 0.7, 0.03), "robot_gloss": uniform(rng, 0.5, 1.0)},
        "black_wire": {"robot_rgb": grey(rng, 0.0, 0.1, 0.01), "robot_radius_mm": uniform(rng, 0.5, 0.8), "tip_contrast": 1.0},
        "translucent": {"robot_rgb": grey(rng, 0.3, 0.85, 0.08), "robot_opacity": uniform(rng, 0.45, 0.75)},
        "banded": {"robot_rgb": grey(rng, 0.75, 0.95, 0.03), "robot_accent_rgb": grey(rng, 0.02, 0.25, 0.02)},
        "coloured": {"robot_rgb": any_hue(rng, (0.5, 1.0), (0.35, 0.95))},
    }
    knobs.update(special.get(look, {}))
    if look == "translucent":
        knobs["tip_contrast"] = max(0.6, knobs["tip_contrast"])
    return knobs


def stand_out(knobs: Knobs) -> None:
    """Change body and tip where they would vanish before the liquid: a label that nobody could see teaches nothing.

    A faint tip is drawn on purpose, by ``tip_contrast``.
    """
    behind = _behind(knobs)
    amount = float(knobs["robot_opacity"]) * (1 - float(knobs["robot_veil"]))
    knobs["robot_rgb"] = _apart(knobs["robot_rgb"], behind, _LEAST_BODY_CONTRAST / amount)
    knobs["tip_rgb"] = _apart(knobs["tip_rgb"], behind, _LEAST_TIP_CONTRAST / amount)


def _behind(knobs: Knobs) -> Rgb:
    """About the colour of the lumen's middle, as the vessel's look paints it."""
    if knobs.get("material") == "channel":
        return tuple(knobs["liquid_rgb"])
    colour = []
    amount, haze = float(knobs["liquid_opacity"]), float(knobs["wall_haze"])
    for board, wall, liquid in zip(knobs["board_rgb"], knobs["wall_rgb"], knobs["liquid_rgb"], strict=True):
        hazed = board + haze * (wall - board)
        scattered = 0.75 * amount
        colour.append(hazed * (1 - amount * (1 - liquid)) * (1 - scattered) + liquid * scattered)
    return colour[0], colour[1], colour[2]


def _apart(colour: Rgb, behind: Rgb, least: float) -> Rgb:
    """`colour`, or one that is `least` lighter or darker than `behind` if it is hard to tell from it."""
    step = [c - b for c, b in zip(colour, behind, strict=True)]
    luma = sum(weight * s for weight, s in zip(_LUMA, step, strict=True))
    if abs(luma) >= least or 0.6 * max(map(abs, step)) >= least:
        return colour
    level = sum(weight * b for weight, b in zip(_LUMA, behind, strict=True))
    lighter = luma > 0 if least < min(level, 1 - level) else level < 0.5
    shift = least if lighter else -least
    r, g, b = (min(max(value + shift, 0.0), 1.0) for value in behind)
    return r, g, b


def absorb(knobs: Knobs, rng: Generator) -> None:
    """Under X-rays every device is a dark, thin absorber; markers and tip absorb more or less than the shaft."""
    level = uniform(rng, 0.0, 0.25)
    knobs["robot_rgb"] = (level, level, level)
    knobs["robot_accent_rgb"] = (0.0, 0.0, 0.0)
    knobs["tip_rgb"] = (0.0, 0.0, 0.0)
    knobs["robot_opacity"] = uniform(rng, 0.5, 0.95)
    knobs["robot_veil"] = 0.0
    knobs["robot_radius_mm"] = uniform(rng, 0.5, 1.2)
    knobs["tip_contrast"] = max(0.5, float(knobs["tip_contrast"]))
    knobs["sheath_rgb"] = (0.1, 0.1, 0.1)
    knobs["sheath_opacity"] = uniform(rng, 0.1, 0.35)


def _gel(rng: Generator) -> Knobs:
    """A tissue phantom of turbid gel with a dyed or a paler lumen, no edge of which is sharp."""
    pale = rng.random() < 0.5
    base = hue(rng, float(rng.choice([0.05, 0.1, 0.6])), 0.03, (0.05, 0.4), (0.55, 0.95))
    return {
        "material": "gel",
        "board_rgb": base,
        "board_texture": pick(rng, "plain", "speckle"),
        "liquid_rgb": grey(rng, 0.75, 1.0, 0.05) if pale else any_hue(rng, (0.3, 0.9), (0.15, 0.7)),
        "liquid_opacity": uniform(rng, 0.4, 0.85),
        "scatter_mm": uniform(rng, 0.4, 1.3),
        "wall_rgb": base,
        "wall_haze": uniform(rng, 0.1, 0.4),
        "lamp_mm": uniform(rng, 5.0, 25.0),
        "robot_shadow": 0.0,
        "robot_veil": uniform(rng, 0.1, 0.35),
        "blur_px": uniform(rng, 0.8, 1.7),
    }


def _drape(rng: Generator) -> Knobs:
    """Tubes on a surgical drape that was not drawn tight."""
    liquid = grey(rng, 0.7, 1.0, 0.06) if rng.random() < 0.4 else any_hue(rng, (0.2, 0.9), (0.5, 0.95))
    return {
        "board_rgb": hue(rng, float(rng.choice([0.4, 0.47, 0.55, 0.6])), 0.03, (0.3, 0.8), (0.25, 0.75)),
        "board_texture": "folds",
        "texture_strength": uniform(rng, 0.6, 1.6),
        "liquid_rgb": liquid,
        "liquid_opacity": uniform(rng, 0.1, 0.6),
    }


def _stage_light(rng: Generator) -> Knobs:
    """Coloured lamps from two sides on tubes, a block or a channel."""
    material = pick(rng, "tube", "block", "channel")
    board = grey(rng, 0.25, 0.9, 0.05)
    floor = uniform(rng, 0.5, 0.85)
    liquid = (board[0] * floor, board[1] * floor, board[2] * floor) if material == "channel" else grey(rng, 0.6, 1.0, 0.1)
    return {
        "material": material,
        "board_rgb": board,
        "liquid_rgb": liquid,
        "liquid_opacity": 1.0 if material == "channel" else uniform(rng, 0.1, 0.5),
        "lamp_rgb": (any_hue(rng, (0.2, 0.7), (0.8, 1.0)), any_hue(rng, (0.2, 0.7), (0.45, 1.0))),
        "light_gradient": uniform(rng, 0.2, 0.6),
        "exposure": float(2.0 ** rng.uniform(0.0, 0.6)),
    }


def _glow(rng: Generator) -> Knobs:
    """A liquid that fluoresces in a dark room."""
    return {
        "material": pick(rng, "tube", "tube", "block"),
        "board_rgb": hue(rng, 0.68, 0.06, (0.0, 0.7), (0.02, 0.18)),
        "table_rgb": grey(rng, 0.0, 0.12, 0.02),
        "wall_rgb": hue(rng, 0.7, 0.05, (0.1, 0.5), (0.2, 0.6)),
        "wall_haze": uniform(rng, 0.03, 0.2),
        "liquid_rgb": hue(rng, float(rng.choice([0.08, 0.17, 0.3, 0.36, 0.45, 0.55, 0.9])), 0.03, (0.5, 1.0), (0.5, 0.85)),
        "liquid_opacity": uniform(rng, 0.45, 0.85),
        "glow": uniform(rng, 0.15, 0.5),
        "lamps": int(rng.integers(0, 2)),
        "highlight": uniform(rng, 0.0, 0.3),
        "tube_shadow": 0.0,
        "robot_shadow": 0.0,
    }


def _tank(rng: Generator) -> Knobs:
    """Tubes at the bottom of a tank of rippling water: weak edges, a net of light over everything."""
    return {
        "board_rgb": hue(rng, 0.52, 0.08, (0.05, 0.5), (0.4, 0.9)),
        "board_texture": pick(rng, "plain", "speckle", "grid"),
        "liquid_rgb": any_hue(rng, (0.1, 0.8), (0.4, 0.95)),
        "liquid_opacity": uniform(rng, 0.2, 0.7),
        "caustics": uniform(rng, 0.25, 0.7),
        "edge_bright": uniform(rng, 0.05, 0.35),
        "edge_dark": uniform(rng, 0.1, 0.4),
        "refraction_mm": uniform(rng, 0.0, 0.8),
        "highlight": uniform(rng, 0.0, 0.3),
        "lamps": int(rng.integers(2, 9)),
        "lamp_mm": uniform(rng, 3.0, 14.0),
        "lamp_strength": uniform(rng, 0.2, 0.6),
    }


def _picture(rng: Generator) -> Knobs:
    """Tubes on a printed picture, as of the organs that they are to lie in."""
    return {
        "board_rgb": any_hue(rng, (0.05, 0.6), (0.45, 0.95)),
        "board_texture": "patches",
        "liquid_rgb": grey(rng, 0.8, 1.0, 0.06) if rng.random() < 0.3 else any_hue(rng, (0.3, 0.9), (0.4, 0.95)),
        "liquid_opacity": uniform(rng, 0.15, 0.65),
    }


def _resin(rng: Generator) -> Knobs:
    """A block printed of clear resin, layer by layer, often yellow."""
    body = hue(rng, float(rng.choice([0.09, 0.12, 0.15, 0.55])), 0.03, (0.05, 0.6), (0.55, 0.95))
    return {
        "material": "block",
        "board_rgb": body,
        "board_texture": "layers",
        "texture_strength": uniform(rng, 0.1, 0.55),
        "liquid_rgb": grey(rng, 0.7, 1.0, 0.08) if rng.random() < 0.5 else any_hue(rng, (0.3, 0.9), (0.4, 0.9)),
        "liquid_opacity": uniform(rng, 0.2, 0.7),
        "wall_rgb": body,
        "wall_haze": uniform(rng, 0.1, 0.5),
        "lamp_mm": uniform(rng, 4.0, 20.0),
    }


RARE: dict[str, Callable[[Generator], Knobs]] = {
    "gel": _gel,
    "drape": _drape,
    "stage_light": _stage_light,
    "glow": _glow,
    "tank": _tank,
    "picture": _picture,
    "resin": _resin,
}


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
