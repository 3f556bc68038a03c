"""How the configured twin looks."""

from __future__ import annotations

from dataclasses import replace

from core.config import TwinConfig
from hardware.twin.appearance import Appearance, default_appearance, random_appearance


def appearance_of(config: TwinConfig) -> Appearance:
    """The clear bench, or a random one by its seed; with the configured lens."""
    look = random_appearance(config.appearance_seed) if config.appearance_seed else default_appearance()
    return replace(look, distortion=config.lens_distortion) if config.lens_distortion else look
