"""The one table of quantities."""

from __future__ import annotations

import pytest

from app.ui.texts import QUANTITY, STATE_MEANING, tip

OF_THE_METHOD = {"theta", "d_head", "d_tail", "crossed", "state", "confidence", "latency", "clearance", "force"}


def test_the_quantities_of_the_method_are_explained() -> None:
    assert set(QUANTITY) >= OF_THE_METHOD


@pytest.mark.parametrize("name", QUANTITY)
def test_every_one_is_whole_sentences_that_fit_a_screen(name: str) -> None:
    quantity = QUANTITY[name]
    assert quantity.meaning.endswith((".", ")"))
    assert quantity.meaning[0].isupper()
    assert all(len(line) <= 110 for line in tip(name).splitlines())


def test_a_tip_names_quantity_and_unit() -> None:
    assert tip("theta").startswith("theta (degrees): Angle between")
    assert tip("d_head", "d_tail").count("(working px)") == 2


def test_the_states_are_the_four_of_the_method() -> None:
    assert tip("state").splitlines() == list(STATE_MEANING.values())


def test_an_unknown_quantity_is_a_mistake() -> None:
    with pytest.raises(KeyError):
        tip("speed of light")
