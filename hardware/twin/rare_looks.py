"""Looks that are drawn only where they are named: rigs of other kinds than the ten families, to test on and to learn from.

Each changes how the picture comes about, not only its colours: light that is spread in a gel, given by the liquid, bent by water,
or coloured; boards that are folded, printed with pictures, or built up in layers.
"""

from __future__ import annotations

from collections.abc import Callable

from numpy.random import Generator

from hardware.twin.draws import Knobs, any_hue, grey, hue, pick, uniform


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
