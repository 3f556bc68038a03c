"""Looks by their names, and how the configured twin looks."""

from __future__ import annotations

from dataclasses import replace

from core.config import TwinConfig
from hardware.twin.appearance import Appearance, default_appearance, random_appearance
from hardware.twin.look_titles import BENCH_LOOK, LOOKS, look_of


def named_appearance(look: str | None, seed: int) -> Appearance:
    """The clear bench, or a random one of the family `look`; None: of any of the ten.

    Raises ValueError when there is no look of that name; the message lists them.
    """
    if look is not None and look not in LOOKS:
        raise ValueError(f"unknown look {look!r}; known: {', '.join(LOOKS)}")
    return default_appearance() if look == BENCH_LOOK else random_appearance(seed, look)


def appearance_of(config: TwinConfig) -> Appearance:
    """The configured look, without one the clear bench or any of the ten families by the seed; with the configured lens.

    Raises ValueError as ``named_appearance`` does.
    """
    look = named_appearance(look_of(config), config.appearance_seed)
    return replace(look, distortion=config.lens_distortion) if config.lens_distortion else look
