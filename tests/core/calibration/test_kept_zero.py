"""A kept zero and the servos after a night: what is told, with turns counted by hand. A turn has 4096 ticks and is 40 mm of way."""

from __future__ import annotations

import pytest

from core.calibration.servos import kept_zero, zero_advice
from core.config.calibration import ZeroConfig
from core.config.safety import ServosConfig

SERVOS = ServosConfig()
ZERO = ZeroConfig(ticks=(5000, 2048, 100, -300, 9000, 0, 0), slack_mm=(0.0,) * 4, pretension_mm=0.3)


def test_a_joint_that_was_not_moved_is_where_it_was() -> None:
    found = kept_zero(SERVOS.joints[0], 5000, 5102)
    assert (found.lost_turns, found.is_inside) == (0, True)
    assert found.at_mm == pytest.approx(102 / 102.4)


@pytest.mark.parametrize(("now", "turns"), [(904, -1), (5000 + 3 * 4096, 3), (904 + 51, -1)])
def test_a_tendon_tells_that_whole_turns_are_lost(now: int, turns: int) -> None:
    """5000 ticks are one turn and 904; after power-off the register begins again within one turn."""
    found = kept_zero(SERVOS.joints[0], 5000, now)
    assert found.lost_turns == turns
    assert abs(found.at_mm) <= 0.5
    assert found.is_inside


def test_a_joint_that_turns_the_other_way_counts_the_same() -> None:
    joint = SERVOS.joints[0].model_copy(update={"sign": -1})
    assert kept_zero(joint, 5000, 5102).at_mm == pytest.approx(-102 / 102.4)
    assert kept_zero(joint, 5000, 904).lost_turns == -1


def test_a_feed_may_be_turns_away_from_its_zero() -> None:
    """Ten turns are its way: none of them counts as lost, so a lost one is not seen there."""
    assert kept_zero(SERVOS.joints[4], 9000, 9000 + 5 * 4096).lost_turns == 0
    assert kept_zero(SERVOS.joints[4], 9000, 9000 - 2 * 4096).lost_turns == -2


def test_what_was_turned_by_hand_is_told_in_millimetres() -> None:
    found = kept_zero(SERVOS.joints[1], 2048, 2048 + 1024)
    assert (found.lost_turns, found.is_inside, found.at_mm) == (0, False, 10.0)


@pytest.mark.parametrize(
    ("ticks", "said"),
    [
        ((904, 2048, 100, 3796, 9000, 0, 0), "without power and lost whole turns (right by -1, down by +1)"),
        ((5000, 2048, 100 + 1024, -300, 9000, 0, 0), "moved out of their envelope (up by +10.0 mm)"),
        (
            (5000, 2048, 100, -300, 9000, 0, 0),
            "no jump against the zero of the rig file is seen (mm from it: right +0.0, left +0.0",
        ),
    ],
)
def test_the_sentence_names_who_and_how_far(ticks: tuple[int, ...], said: str) -> None:
    assert said in zero_advice(SERVOS, ZERO, ticks)
