"""Families of looks and looks of the robot: from which range each parameter of an ``Appearance`` is drawn.

Ranges are wide, so that a network trained on all of them meets nothing new on a real bench. The order of the entries of a table is
the order of the random draws: pictures of a seed stay the same only while it stays.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.random import Generator

Rgb = tuple[float, float, float]
Parameters = dict[str, Any]
Draw = Callable[[Generator, Parameters], Any]
"""Draws a value, given what was drawn before it."""
Table = Mapping[str, Any]
"""Parameter -> constant or ``Draw``. A draw that gives a dictionary adds all its entries; those with ``_`` only serve others."""


def _value(entry: Any, rng: Generator, drawn: Parameters) -> Any:
    return entry(rng, drawn) if callable(entry) else entry


def sample(table: Table, rng: Generator, given: Parameters | None = None) -> Parameters:
    """Draw all entries of a table, in order."""
    drawn = dict(given or {})
    for name, entry in table.items():
        value = _value(entry, rng, drawn)
        drawn.update(value if isinstance(value, dict) else {name: value})
    return drawn


def uniform(low: float, high: float) -> Draw:
    return lambda rng, _: float(rng.uniform(low, high))


def stops(low: float, high: float) -> Draw:
    """A power of two with an exponent between `low` and `high`."""
    return lambda rng, _: float(2.0 ** rng.uniform(low, high))


def normal(sigma: float) -> Draw:
    return lambda rng, _: float(rng.normal(0, sigma))


def integer(low: int, high: int) -> Draw:
    """At least `low`, less than `high`."""
    return lambda rng, _: int(rng.integers(low, high))


def chance(share: float) -> Draw:
    return lambda rng, _: bool(rng.random() < share)


def either(share: float, first: Any, second: Any) -> Draw:
    """The first entry in `share` of the cases, else the second; only the chosen one is drawn."""
    return lambda rng, drawn: _value(first if rng.random() < share else second, rng, drawn)


def when(name: str, value: Any, first: Any, second: Any) -> Draw:
    """The first entry where the parameter `name` was drawn as `value`, else the second."""
    return lambda rng, drawn: _value(first if drawn[name] == value else second, rng, drawn)


def same(name: str) -> Draw:
    return lambda _, drawn: drawn[name]


def pick(*choices: Any) -> Draw:
    return lambda rng, _: choices[int(rng.integers(len(choices)))]


def choice(options: Sequence[Any], p: Sequence[float] | None = None) -> Draw:
    """One of some numbers with probabilities `p`; all options are drawn before the choice."""
    return lambda rng, drawn: rng.choice([_value(option, rng, drawn) for option in options], p=p).item()


def each(*entries: Any) -> Draw:
    return lambda rng, drawn: tuple(_value(entry, rng, drawn) for entry in entries)


def group(table: Table) -> Draw:
    """All entries of another table."""
    return lambda rng, _: sample(table, rng)


def grey(low: float, high: float, cast: float = 0.03) -> Draw:
    """A grey with a slight colour cast."""

    def draw(rng: Generator, _: Parameters) -> Rgb:
        level = rng.uniform(low, high)
        r, g, b = (float(min(max(level + rng.uniform(-cast, cast), 0.0), 1.0)) for _ in range(3))
        return r, g, b

    return draw


def hue(
    base: float | Sequence[float] | None, spread: float, saturation: tuple[float, float], brightness: tuple[float, float]
) -> Draw:
    """A colour near a hue (0..1), near one of several, or (None) of any."""

    def draw(rng: Generator, _: Parameters) -> Rgb:
        middle = float(rng.random() if base is None else base if isinstance(base, float) else rng.choice(base))
        turned = (middle + rng.uniform(-spread, spread)) % 1.0
        return colorsys.hsv_to_rgb(turned, rng.uniform(*saturation), rng.uniform(*brightness))

    return draw


def any_hue(saturation: tuple[float, float], brightness: tuple[float, float]) -> Draw:
    return hue(None, 0.0, saturation, brightness)


def _channel_floor(_: Generator, drawn: Parameters) -> Rgb:
    """The plate's own colour, darker or lighter."""
    r, g, b = (value * drawn["_floor"] for value in drawn["board_rgb"])
    return r, g, b


_ROBOT: Table = {
    "robot_radius_mm": uniform(0.6, 1.4),
    "robot_rgb": grey(0.03, 0.22, 0.03),
    "robot_accent_rgb": grey(0.45, 0.85, 0.04),
    "ring_pitch_mm": uniform(1.8, 5.0),
    "ring_share": uniform(0.15, 0.5),
    "tip_mm": uniform(1.5, 9.0),
    "tip_rgb": either(0.6, grey(0.05, 0.9, 0.05), hue(0.12, 0.03, (0.4, 0.8), (0.6, 0.95))),
    "tip_contrast": choice([1.0, uniform(0.5, 0.9), uniform(0.25, 0.5)], p=[0.6, 0.3, 0.1]),
    "robot_opacity": uniform(0.85, 1.0),
    "robot_gloss": uniform(0.0, 0.7),
    "robot_veil": uniform(0.0, 0.35),
    "robot_shadow": uniform(0.0, 0.4),
    "sheath_extra_mm": uniform(0.25, 0.8),
    "sheath_rgb": either(0.5, grey(0.1, 0.95, 0.05), any_hue((0.2, 0.8), (0.4, 0.95))),
    "sheath_opacity": uniform(0.25, 0.7),
}
# All entries are drawn for every robot, whatever its look, so that the draws after them are the same.
_ROBOT_LOOKS: dict[str, Table] = {
    "ringed": {},
    "plain_dark": {},
    "white": {"robot_rgb": grey(0.82, 1.0, 0.03)},
    "blue_gold": {"robot_rgb": hue(0.6, 0.05, (0.55, 0.95), (0.3, 0.75)), "tip_rgb": hue(0.12, 0.02, (0.45, 0.8), (0.65, 0.95))},
    "metallic": {"robot_rgb": grey(0.4, 0.7, 0.03), "robot_gloss": uniform(0.5, 1.0)},
    "black_wire": {"robot_rgb": grey(0.0, 0.1, 0.01), "robot_radius_mm": uniform(0.5, 0.8), "tip_contrast": 1.0},
    "translucent": {"robot_rgb": grey(0.3, 0.85, 0.08), "robot_opacity": uniform(0.45, 0.75)},
    "banded": {"robot_rgb": grey(0.75, 0.95, 0.03), "robot_accent_rgb": grey(0.02, 0.25, 0.02)},
    "coloured": {"robot_rgb": any_hue((0.5, 1.0), (0.35, 0.95))},
}
ROBOT_LOOKS = tuple(_ROBOT_LOOKS)

_COMMON: Table = {
    "_turned_deg": choice([0.0, 180.0, 90.0, 270.0], p=[0.6, 0.3, 0.05, 0.05]),
    "pixels_per_mm": either(0.7, uniform(2.4, 3.6), uniform(2.0, 4.5)),
    "board_texture": pick("plain", "speckle", "speckle", "grid", "brushed", "cloth"),
    "texture_strength": uniform(0.05, 0.6),
    "table_rgb": either(0.6, grey(0.05, 0.8, 0.1), hue(0.08, 0.03, (0.2, 0.6), (0.3, 0.75))),
    "light_gradient": uniform(0.0, 0.4),
    "wall_mm": uniform(0.6, 2.4),
    "wall_rgb": grey(0.75, 1.0, 0.05),
    "wall_haze": uniform(0.05, 0.4),
    "edge_bright": uniform(0.15, 0.75),
    "edge_dark": uniform(0.15, 0.7),
    "edge_mm": uniform(0.25, 0.7),
    "refraction_mm": uniform(0.0, 2.5),
    "lumen_shade": uniform(0.05, 0.3),
    "light_deg": uniform(0.0, 360.0),
    "highlight": uniform(0.1, 0.95),
    "highlight_width": uniform(0.07, 0.28),
    "lamps": integer(0, 6),
    "lamp_strength": uniform(0.2, 0.95),
    "lamp_mm": uniform(2.0, 12.0),
    "tube_shadow": uniform(0.0, 0.45),
    "shadow_mm": uniform(0.5, 5.0),
    "fittings": choice([0, 1, 2, 3, 4], p=[0.35, 0.25, 0.2, 0.1, 0.1]),
    "fitting_rgb": either(0.6, grey(0.1, 1.0, 0.05), any_hue((0.3, 0.9), (0.3, 0.95))),
    "fitting_opacity": uniform(0.3, 0.85),
    "end_fittings": chance(0.6),
    "bubbles": either(0.3, integer(1, 12), 0),
    "cables": choice([0, 1, 2, 3, 4], p=[0.3, 0.25, 0.2, 0.15, 0.1]),
    "objects": choice([0, 1, 2, 3], p=[0.55, 0.25, 0.12, 0.08]),
    "ruler": chance(0.25),
    "labels": integer(0, 4),
    "stains": integer(0, 5),
    "dust": integer(0, 80),
    "clutter_seed": integer(0, 2**31),
    "rotation_deg": normal(5.0),
    "tilt": each(normal(0.05), normal(0.05)),
    "offset_mm": each(uniform(-18, 18), uniform(-14, 14)),
    "distortion": choice([0.0, uniform(-0.08, 0.04)], p=[0.4, 0.6]),
    "blur_px": choice([uniform(0.2, 0.9), uniform(0.9, 1.8)], p=[0.75, 0.25]),
    "motion_px": either(0.15, uniform(1.0, 6.0), 0.0),
    "motion_deg": uniform(0.0, 180.0),
    "exposure": stops(-0.45, 0.3),
    "white_balance": each(uniform(0.86, 1.12), 1.0, uniform(0.82, 1.14)),
    "saturation": either(0.1, 0.0, uniform(0.6, 1.3)),
    "gamma": uniform(0.8, 1.25),
    "contrast": uniform(0.75, 1.15),
    "vignette": uniform(0.0, 0.5),
    "noise": choice([uniform(0.5, 5.0), uniform(5.0, 11.0)], p=[0.75, 0.25]),
    "noise_grain_px": choice([0.0, uniform(0.4, 1.0)]),
    "jpeg_quality": either(0.35, integer(35, 95), 0),
}
"""Light, clutter and camera, alike in all families that are photographs."""

_CLEAR_LIQUID = either(
    0.5,
    group({"liquid_rgb": grey(0.8, 1.0, 0.06), "liquid_opacity": uniform(0.03, 0.25)}),
    group({"liquid_rgb": hue([0.0, 0.08, 0.13, 0.55, 0.62], 0.03, (0.1, 0.5), (0.65, 1.0)), "liquid_opacity": uniform(0.1, 0.5)}),
)
_SILICONE_WHITE: Table = {"board_rgb": grey(0.68, 0.95, 0.05), "_liquid": _CLEAR_LIQUID}
_SILICONE_COLOUR: Table = {
    "board_rgb": hue([0.08, 0.11, 0.33, 0.42, 0.55, 0.6, 0.65, 0.8], 0.03, (0.25, 0.85), (0.25, 0.9)),
    "board_texture": pick("plain", "speckle", "wood", "grid", "cloth", "wood"),
    "_liquid": _CLEAR_LIQUID,
}
_XRAY: Table = {
    "material": "xray",
    "board_texture": "plain",
    "light_gradient": uniform(0.0, 0.5),
    "liquid_rgb": (0.0, 0.0, 0.0),
    "wall_haze": uniform(0.0, 0.12),
    "lamps": 0,
    "highlight": 0.0,
    "objects": 0,
    "cables": choice([0, 1, 2, 3], p=[0.4, 0.3, 0.2, 0.1]),
    "fittings": choice([0, 1, 2], p=[0.6, 0.25, 0.15]),
    "fitting_opacity": uniform(0.1, 0.5),
    "fitting_rgb": grey(0.0, 0.3, 0.0),
    "bubbles": 0,
    "labels": integer(0, 2),
    "stains": integer(0, 6),
    "dust": integer(0, 15),
    "saturation": 0.0,
    "white_balance": (1.0, 1.0, 1.0),
    "blur_px": uniform(0.6, 1.8),
    "noise": uniform(4.0, 14.0),
    "noise_grain_px": uniform(0.0, 1.3),
    "collimator": choice([0.0, uniform(0.85, 1.0)], p=[0.5, 0.5]),
    "robot_shadow": 0.0,
    "robot_gloss": 0.0,
}
"""Both X-ray families: grey, noisy, no lamps, a device that absorbs."""

_FAMILIES: dict[str, Table] = {
    "silicone_white": _SILICONE_WHITE,
    "silicone_red": {"board_rgb": hue(0.98, 0.03, (0.65, 1.0), (0.4, 0.85)), "_liquid": _CLEAR_LIQUID},
    "silicone_dark": {
        "board_rgb": grey(0.03, 0.22, 0.03),
        "wall_haze": uniform(0.12, 0.45),
        "wall_rgb": grey(0.5, 0.9, 0.06),
        "edge_bright": uniform(0.4, 0.9),
        "_liquid": _CLEAR_LIQUID,
        "lumen_shade": uniform(0.0, 0.1),
    },
    "silicone_colour": _SILICONE_COLOUR,
    "tinted_liquid": {
        "_hue": choice([0.98, 0.0, 0.03, 0.1, 0.15, 0.33, 0.5, 0.58, 0.62, 0.85]),
        "board_rgb": either(0.7, grey(0.55, 0.95, 0.06), grey(0.05, 0.4, 0.06)),
        "liquid_rgb": lambda rng, drawn: hue(drawn["_hue"], 0.03, (0.4, 1.0), (0.45, 0.95))(rng, drawn),
        "liquid_opacity": uniform(0.4, 0.9),
    },
    "opaque_channel": {
        "board_rgb": either(0.5, grey(0.2, 0.95, 0.05), any_hue((0.15, 0.8), (0.35, 0.95))),
        "_floor": uniform(0.45, 1.02),
        "liquid_rgb": either(0.35, either(0.5, grey(0.1, 0.95, 0.06), any_hue((0.2, 0.8), (0.3, 0.9))), _channel_floor),
        "material": "channel",
        "board_texture": pick("plain", "speckle", "brushed", "brushed", "cloth"),
        "liquid_opacity": 1.0,
        "highlight": uniform(0.0, 0.4),
        "tube_shadow": uniform(0.15, 0.6),
        "lamp_strength": uniform(0.1, 0.6),
        "robot_veil": 0.0,
    },
    "clear_block": {
        "_silicone": either(0.6, group(_SILICONE_WHITE), group(_SILICONE_COLOUR)),
        "material": "block",
        "lamp_mm": uniform(4.0, 25.0),
        "wall_haze": uniform(0.0, 0.25),
    },
    "backlit": {
        "board_rgb": grey(0.85, 1.0, 0.03),
        "board_texture": "plain",
        "texture_strength": uniform(0.0, 0.15),
        "table_rgb": grey(0.0, 0.3, 0.03),
        "_liquid": _CLEAR_LIQUID,
        "edge_dark": uniform(0.4, 0.9),
        "edge_bright": uniform(0.0, 0.3),
        "highlight": uniform(0.0, 0.25),
        "lamps": integer(0, 2),
        "tube_shadow": 0.0,
        "vignette": uniform(0.1, 0.7),
        "robot_shadow": 0.0,
    },
    "fluoroscopy": {
        "liquid_opacity": uniform(0.16, 0.5),
        "_xray": group(_XRAY),
        "board_rgb": grey(0.45, 0.85, 0.0),
        # Tissue may hide the lumen nearly, not wholly.
        "texture_strength": lambda rng, drawn: min(float(rng.uniform(0.15, 0.8)), 2.0 * drawn["liquid_opacity"]),
    },
    "subtraction": {
        "_road_map": chance(0.4),  # shows the vessel brighter than its surroundings
        "_xray": group(_XRAY),
        "board_rgb": grey(0.35, 0.65, 0.0),
        "texture_strength": uniform(0.0, 0.2),
        "liquid_rgb": when("_road_map", True, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)),
        "liquid_opacity": uniform(0.18, 0.5),
    },
}

# Looks of other kinds of rigs, drawn only where they are named: light that is spread in a gel, emitted by the liquid, bent by
# water, or coloured; boards that are folded, printed with pictures, or built up in layers.
_RARE: dict[str, Table] = {
    # A tissue phantom of turbid gel with a dyed or a paler lumen, without any sharp edge.
    "gel": {
        "_pale": chance(0.5),
        "board_rgb": hue([0.05, 0.1, 0.6], 0.03, (0.05, 0.4), (0.55, 0.95)),
        "material": "gel",
        "board_texture": pick("plain", "speckle"),
        "liquid_rgb": when("_pale", True, grey(0.75, 1.0, 0.05), any_hue((0.3, 0.9), (0.15, 0.7))),
        "liquid_opacity": uniform(0.4, 0.85),
        "scatter_mm": uniform(0.4, 1.3),
        "wall_rgb": same("board_rgb"),
        "wall_haze": uniform(0.1, 0.4),
        "lamp_mm": uniform(5.0, 25.0),
        "robot_shadow": 0.0,
        "robot_veil": uniform(0.1, 0.35),
        "blur_px": uniform(0.8, 1.7),
    },
    # Tubes on a creased surgical drape.
    "drape": {
        "liquid_rgb": either(0.4, grey(0.7, 1.0, 0.06), any_hue((0.2, 0.9), (0.5, 0.95))),
        "board_rgb": hue([0.4, 0.47, 0.55, 0.6], 0.03, (0.3, 0.8), (0.25, 0.75)),
        "board_texture": "folds",
        "texture_strength": uniform(0.6, 1.6),
        "liquid_opacity": uniform(0.1, 0.6),
    },
    # Coloured lamps from two sides on tubes, a block or a channel.
    "stage_light": {
        "material": pick("tube", "block", "channel"),
        "board_rgb": grey(0.25, 0.9, 0.05),
        "_floor": uniform(0.5, 0.85),
        "liquid_rgb": when("material", "channel", _channel_floor, grey(0.6, 1.0, 0.1)),
        "liquid_opacity": when("material", "channel", 1.0, uniform(0.1, 0.5)),
        "lamp_rgb": each(any_hue((0.2, 0.7), (0.8, 1.0)), any_hue((0.2, 0.7), (0.45, 1.0))),
        "light_gradient": uniform(0.2, 0.6),
        "exposure": stops(0.0, 0.6),
    },
    # A liquid that fluoresces in a dark room.
    "glow": {
        "material": pick("tube", "tube", "block"),
        "board_rgb": hue(0.68, 0.06, (0.0, 0.7), (0.02, 0.18)),
        "table_rgb": grey(0.0, 0.12, 0.02),
        "wall_rgb": hue(0.7, 0.05, (0.1, 0.5), (0.2, 0.6)),
        "wall_haze": uniform(0.03, 0.2),
        "liquid_rgb": hue([0.08, 0.17, 0.3, 0.36, 0.45, 0.55, 0.9], 0.03, (0.5, 1.0), (0.5, 0.85)),
        "liquid_opacity": uniform(0.45, 0.85),
        "glow": uniform(0.15, 0.5),
        "lamps": integer(0, 2),
        "highlight": uniform(0.0, 0.3),
        "tube_shadow": 0.0,
        "robot_shadow": 0.0,
    },
    # Tubes at the bottom of a tank of rippling water: weak edges, a net of light over everything.
    "tank": {
        "board_rgb": hue(0.52, 0.08, (0.05, 0.5), (0.4, 0.9)),
        "board_texture": pick("plain", "speckle", "grid"),
        "liquid_rgb": any_hue((0.1, 0.8), (0.4, 0.95)),
        "liquid_opacity": uniform(0.2, 0.7),
        "caustics": uniform(0.25, 0.7),
        "edge_bright": uniform(0.05, 0.35),
        "edge_dark": uniform(0.1, 0.4),
        "refraction_mm": uniform(0.0, 0.8),
        "highlight": uniform(0.0, 0.3),
        "lamps": integer(2, 9),
        "lamp_mm": uniform(3.0, 14.0),
        "lamp_strength": uniform(0.2, 0.6),
    },
    # Tubes on a printed picture, for example of the organs that they stand for.
    "picture": {
        "board_rgb": any_hue((0.05, 0.6), (0.45, 0.95)),
        "board_texture": "patches",
        "liquid_rgb": either(0.3, grey(0.8, 1.0, 0.06), any_hue((0.3, 0.9), (0.4, 0.95))),
        "liquid_opacity": uniform(0.15, 0.65),
    },
    # A block printed of clear resin, layer by layer, often yellow.
    "resin": {
        "board_rgb": hue([0.09, 0.12, 0.15, 0.55], 0.03, (0.05, 0.6), (0.55, 0.95)),
        "material": "block",
        "board_texture": "layers",
        "texture_strength": uniform(0.1, 0.55),
        "liquid_rgb": either(0.5, grey(0.7, 1.0, 0.08), any_hue((0.3, 0.9), (0.4, 0.9))),
        "liquid_opacity": uniform(0.2, 0.7),
        "wall_rgb": same("board_rgb"),
        "wall_haze": uniform(0.1, 0.5),
        "lamp_mm": uniform(4.0, 20.0),
    },
}
LOOK_FAMILIES = tuple(_FAMILIES)
RARE_FAMILIES = tuple(_RARE)

# The robot keeps at least this contrast to the liquid behind it, in the luma of colours 0..1.
_LEAST_BODY_CONTRAST = 0.17
_LEAST_TIP_CONTRAST = 0.11
_LUMA = (0.299, 0.587, 0.114)
# Radius of the device in px of a picture of 640 px.
_LEAST_RADIUS_PX, _MOST_RADIUS_PX = 1.5, 5.0


def draw_family(family: str, rng: Generator) -> Parameters:
    """All parameters of an appearance of `family`: what its table does not draw is that of the robot's look, or common to all."""
    look = ROBOT_LOOKS[int(rng.integers(len(ROBOT_LOOKS)))]
    robot = sample(_ROBOT, rng, {"robot_look": look})
    robot |= {name: sample(table, rng) for name, table in _ROBOT_LOOKS.items()}[look]
    if look == "translucent":
        robot["tip_contrast"] = max(0.6, robot["tip_contrast"])
    parameters = {"family": family, **sample(_COMMON, rng), **robot, **sample((_FAMILIES | _RARE)[family], rng)}
    parameters["rotation_deg"] = parameters["_turned_deg"] + parameters["rotation_deg"]
    if parameters.get("material") == "xray":
        _set_xray_robot(parameters, rng)
    else:
        _ensure_contrast(parameters)
    zoom = parameters["pixels_per_mm"]
    parameters["robot_radius_mm"] = min(max(parameters["robot_radius_mm"], _LEAST_RADIUS_PX / zoom), _MOST_RADIUS_PX / zoom)
    return {name: value for name, value in parameters.items() if not name.startswith("_")}


def _ensure_contrast(parameters: Parameters) -> None:
    """Change the colours of body and tip where the liquid would hide them. A faint tip is drawn on purpose, by ``tip_contrast``."""
    background = _background_rgb(parameters)
    amount = parameters["robot_opacity"] * (1 - parameters["robot_veil"])
    for name, least in (("robot_rgb", _LEAST_BODY_CONTRAST), ("tip_rgb", _LEAST_TIP_CONTRAST)):
        parameters[name] = _with_contrast(parameters[name], background, least / amount)


def _background_rgb(parameters: Parameters) -> Rgb:
    """About the colour of the lumen's middle, as the vessel's look paints it."""
    if parameters.get("material") == "channel":
        return tuple(parameters["liquid_rgb"])
    colour = []
    amount, haze = parameters["liquid_opacity"], parameters["wall_haze"]
    for board, wall, liquid in zip(parameters["board_rgb"], parameters["wall_rgb"], parameters["liquid_rgb"], strict=True):
        hazed = board + haze * (wall - board)
        scattered = 0.75 * amount
        colour.append(hazed * (1 - amount * (1 - liquid)) * (1 - scattered) + liquid * scattered)
    return colour[0], colour[1], colour[2]


def _with_contrast(colour: Rgb, background: Rgb, least: float) -> Rgb:
    """`colour`, or one that is `least` lighter or darker than `background` if it is hard to tell from it."""
    step = [c - b for c, b in zip(colour, background, strict=True)]
    luma = sum(weight * s for weight, s in zip(_LUMA, step, strict=True))
    if abs(luma) >= least or 0.6 * max(map(abs, step)) >= least:
        return colour
    level = sum(weight * b for weight, b in zip(_LUMA, background, strict=True))
    lighter = luma > 0 if least < min(level, 1 - level) else level < 0.5
    shift = least if lighter else -least
    r, g, b = (min(max(value + shift, 0.0), 1.0) for value in background)
    return r, g, b


def _set_xray_robot(parameters: Parameters, rng: Generator) -> None:
    """Under X-rays every device is a dark, thin absorber; markers and tip absorb more or less than the shaft."""
    level = float(rng.uniform(0.0, 0.25))
    parameters |= {
        "robot_rgb": (level, level, level),
        "robot_accent_rgb": (0.0, 0.0, 0.0),
        "tip_rgb": (0.0, 0.0, 0.0),
        "robot_opacity": float(rng.uniform(0.5, 0.95)),
        "robot_veil": 0.0,
        "robot_radius_mm": float(rng.uniform(0.5, 1.2)),
        "tip_contrast": max(0.5, parameters["tip_contrast"]),
        "sheath_rgb": (0.1, 0.1, 0.1),
        "sheath_opacity": float(rng.uniform(0.1, 0.35)),
    }
