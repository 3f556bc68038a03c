"""STOP at random moments of opening, zeroing, switching on and restarting, on a simulated line and clock."""

from __future__ import annotations

import random

import pytest

from tools.stop_campaign import BOUND_MS, PROCEDURES, campaign, run_procedure


def test_stop_comes_before_everything() -> None:
    """It was noticed after up to 0.8 s, when the torque had come on; and switching on let go of all wires."""
    for outcome in campaign(30, seed=51):
        assert outcome.late_ms <= BOUND_MS, outcome
        assert outcome.came_on == [], outcome
        assert outcome.dropped == [], outcome


@pytest.mark.slow
def test_stop_comes_before_everything_a_thousand_times() -> None:
    outcomes = list(campaign(1000, seed=1))
    assert max(outcome.late_ms for outcome in outcomes) <= BOUND_MS
    assert not any(outcome.came_on or outcome.dropped for outcome in outcomes)


@pytest.mark.parametrize("name", PROCEDURES)
def test_without_a_stop_the_procedures_go_through(name: str) -> None:
    line, end, _ = run_procedure(name, random.Random(3), None)
    refused = "zeroed: up" if "restart" in name else ""
    assert end.errors[-1].find(refused) >= 0
    assert any(end.errors) == bool(refused)
    held = all(servo.table["torque"] for servo in line.servos.values())
    assert held is not bool(refused)
