"""How the configured twin looks."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core.config.models import TwinConfig
from hardware.twin.catalog import BENCH_TITLE, LOOK_TITLES, LOOKS, RARE_TITLES
from hardware.twin.rendering.appearance import Appearance, appearance_of, random_appearance
from hardware.twin.rendering.presets import LOOK_FAMILIES, RARE_FAMILIES


def test_all_looks_have_a_title() -> None:
    assert tuple(LOOK_TITLES) == LOOK_FAMILIES
    assert tuple(RARE_TITLES) == RARE_FAMILIES
    titles = [BENCH_TITLE, *LOOK_TITLES.values(), *RARE_TITLES.values()]
    assert len(set(titles)) == len(titles) == len(LOOKS)


def test_without_a_look_the_seed_says_which() -> None:
    assert appearance_of(TwinConfig()) == Appearance()
    assert appearance_of(TwinConfig(appearance_seed=7)) == random_appearance(7)


@pytest.mark.parametrize("look", ["fluoroscopy", "tank"])
@pytest.mark.parametrize("seed", [0, 7])
def test_a_family_is_drawn_by_the_seed(look: str, seed: int) -> None:
    found = appearance_of(TwinConfig(look=look, appearance_seed=seed))
    assert found == random_appearance(seed, look)
    assert found.family == look


def test_clear_bench_by_its_name_whatever_the_seed() -> None:
    assert appearance_of(TwinConfig(look="bench", appearance_seed=7)) == Appearance()


def test_lens_is_the_configured_one() -> None:
    config = TwinConfig(look="tank", appearance_seed=3, lens_distortion=-0.1)
    assert appearance_of(config) == replace(random_appearance(3, "tank"), distortion=-0.1)


def test_unknown_look_is_told_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"unknown look 'moon'; known: silicone_white, .*resin, bench"):
        appearance_of(TwinConfig(look="moon"))
