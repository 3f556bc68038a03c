"""How the configured twin looks."""

from __future__ import annotations

from dataclasses import replace

from core.config import TwinConfig
from hardware.twin.appearance import Appearance, default_appearance, random_appearance
from hardware.twin.look_titles import BENCH_LOOK, LOOK_TITLES, RARE_TITLES


def appearance_of(config: TwinConfig) -> Appearance:
    """The clear bench, or a random one by its seed and perhaps of one family; with the configured lens.

    Raises ValueError when there is no look of that name; the message lists them.
    """
    family, seed = config.look, config.appearance_seed
    if family is not None and family not in LOOK_TITLES | RARE_TITLES:
        raise ValueError(f"twin.look: unknown look {family!r}; known: {', '.join((*LOOK_TITLES, *RARE_TITLES))}")
    is_bench = family == BENCH_LOOK or (family is None and not seed)
    look = default_appearance() if is_bench else random_appearance(seed, family)
    return replace(look, distortion=config.lens_distortion) if config.lens_distortion else look
