"""Looks of the robot, from the devices seen on real benches: which knobs are drawn from which range."""

from __future__ import annotations

from numpy.random import Generator

from hardware.twin.draws import Knobs, any_hue, grey, hue, uniform

ROBOT_LOOKS = ("ringed", "plain_dark", "white", "blue_gold", "metallic", "black_wire", "translucent", "banded", "coloured")

_LEAST_CONTRAST = 0.28


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
        "tip_contrast": float(rng.choice([1.0, rng.uniform(0.45, 0.9), rng.uniform(0.22, 0.45)], p=[0.55, 0.3, 0.15])),
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
        "translucent": {"robot_rgb": grey(rng, 0.3, 0.85, 0.08), "robot_opacity": uniform(rng, 0.4, 0.65)},
        "banded": {"robot_rgb": grey(rng, 0.75, 0.95, 0.03), "robot_accent_rgb": grey(rng, 0.02, 0.25, 0.02)},
        "coloured": {"robot_rgb": any_hue(rng, (0.5, 1.0), (0.35, 0.95))},
    }
    knobs.update(special.get(look, {}))
    if look == "translucent":
        knobs["tip_contrast"] = max(0.6, knobs["tip_contrast"])
    return knobs


def stand_out(knobs: Knobs) -> None:
    """Make the robot lighter or darker where it would vanish against the liquid: a label that nobody could see teaches nothing."""
    opacity, board = float(knobs["liquid_opacity"]), knobs["board_rgb"]
    behind = [b + (c - b) * opacity for b, c in zip(board, knobs["liquid_rgb"], strict=True)]
    robot = knobs["robot_rgb"]
    contrast = max(abs(r - b) for r, b in zip(robot, behind, strict=True))
    if contrast >= _LEAST_CONTRAST:
        return
    shift = _LEAST_CONTRAST if sum(behind) < 1.5 else -_LEAST_CONTRAST
    knobs["robot_rgb"] = tuple(min(max(b + shift, 0.0), 1.0) for b in behind)


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
