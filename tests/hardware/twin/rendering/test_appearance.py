"""The configured look of the twin."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core.config.models import TwinConfig
from hardware.twin.catalog import BENCH_TITLE, LOOK_TITLES, LOOKS, OWN_TITLE, RARE_TITLES
from hardware.twin.rendering.appearance import Appearance, appearance_of, random_appearance
from hardware.twin.rendering.presets import LOOK_FAMILIES, RARE_FAMILIES


def test_all_looks_have_a_title() -> None:
    assert tuple(LOOK_TITLES) == LOOK_FAMILIES
    assert tuple(RARE_TITLES) == RARE_FAMILIES
    titles = [BENCH_TITLE, OWN_TITLE, *LOOK_TITLES.values(), *RARE_TITLES.values()]
    assert len(set(titles)) == len(titles) == len(LOOKS)


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        ({}, Appearance()),
        ({"appearance_seed": 7}, random_appearance(7)),
        ({"look": "bench", "appearance_seed": 7}, Appearance()),
        ({"look": "fluoroscopy"}, random_appearance(0, "fluoroscopy")),
        ({"look": "tank", "appearance_seed": 7}, random_appearance(7, "tank")),
        ({"look": "tank", "appearance_seed": 3, "lens_distortion": -0.1}, replace(random_appearance(3, "tank"), distortion=-0.1)),
    ],
)
def test_configured_look(config: dict[str, object], expected: Appearance) -> None:
    assert appearance_of(TwinConfig.model_validate(config)) == expected


def test_unknown_look_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"unknown look 'moon'; known: silicone_white, .*resin, bench"):
        appearance_of(TwinConfig(look="moon"))
