"""What is known of each deadman from its reports, silences and interruptions: only a press that began while armed is a hold."""

from __future__ import annotations

import pytest

from core.config.safety import SafetyConfig
from core.control.health import FORGOTTEN_S, Deadman, DeadmanReport, Health

TIMEOUT_S = 0.078125
STEP_S = 0.0625


def _heard(script: str) -> Deadman:
    """After a report every 62.5 ms: ``-`` up, ``D`` down, ``?`` cannot tell, ``_`` none; armed from ``A`` to ``a``."""
    deadman, armed, now_s = Deadman(), False, 8.0
    for what in script:
        if what in "Aa":
            armed = what == "A"
            continue
        now_s += STEP_S
        if what != "_":
            deadman = deadman.update({"-": False, "D": True, "?": None}[what], now_s, armed=armed)
    return deadman


@pytest.mark.parametrize(
    ("script", "counts"),
    [
        ("A-D", True),
        ("-AD", True),  # the release may be from before
        ("-DAD", False),  # down since before arming
        ("AD", False),  # down at the first word: nobody knows since when
        ("A?D", False),  # what it could not tell is no release
        ("-DA?D", False),
        ("-DA???D", False),
        ("-DA_D", False),
        ("-DA-D", True),  # let go and pressed again
        ("-DA?-D", True),
        ("A-?D", True),  # the release was told, whatever came between
        ("A-D?D", True),  # held all the time, as far as anybody knows
        ("A-D??DDD", True),
        ("A-D_______D", True),  # 0.5 s
        ("A-D________D", False),  # and more: as at the start
        ("A-D????????D", False),
        ("A-________D", False),
        ("A-D________-D", True),
        ("A-D-", False),
        ("A-D-aD", False),  # pressed once more when it is armed no longer
    ],
)
def test_a_press_counts_when_it_began_while_armed_from_a_release_that_was_told(script: str, counts: bool) -> None:
    assert _heard(script).counts is counts


def test_a_deadman_is_forgotten_only_after_more_than_half_a_second() -> None:
    held = Deadman().update(False, 1.0, armed=True).update(True, 1.0, armed=True)
    assert held.update(True, 1.0 + FORGOTTEN_S, armed=True).counts
    assert not held.update(True, 1.0 + FORGOTTEN_S + 0.0078125, armed=True).counts


@pytest.mark.parametrize(
    ("script", "down"), [("-", False), ("D", True), ("-D", True), ("-D?", False), ("-D?D", True), ("?", False)]
)
def test_it_is_down_only_while_it_tells_so(script: str, down: bool) -> None:
    deadman = _heard(script)
    assert deadman.is_down(8.0 + STEP_S * len(script) + TIMEOUT_S, TIMEOUT_S) is down
    assert not deadman.is_down(8.0 + STEP_S * len(script) + TIMEOUT_S + 0.0078125, TIMEOUT_S)


def test_one_that_is_held_is_enough_and_one_that_is_only_down_is_none() -> None:
    held, stuck, up = _heard("A-D"), _heard("-DA"), _heard("A--")
    now_s = 8.0 + 2 * STEP_S
    safety = SafetyConfig(deadman_timeout_s=TIMEOUT_S)
    for deadmen, is_held in (({0: up, 1: stuck, 2: held}, True), ({0: up, 1: stuck}, False), ({}, False)):
        assert Health(deadmen=deadmen).deadman_held(now_s, safety) is is_held


def test_what_was_said_counts_from_then_and_never_from_the_future() -> None:
    assert [DeadmanReport(True, said_s).at_s(5.0) for said_s in (None, 4.75, 5.25)] == [5.0, 4.75, 5.0]
