"""Looks of the robot, from the devices seen on real benches: which knobs are drawn from which range."""

from __future__ import annotations

from numpy.random import Generator

from hardware.twin.draws import Knobs, Rgb, any_hue, grey, hue, uniform

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
