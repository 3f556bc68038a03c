"""The small memories of the look-ahead policy: stall, way back, contact limit."""

from __future__ import annotations

from core.control.stall import BackOff, ContactLimit, Stall
from core.policy_config import PursuitConfig


def test_stall_tells_only_after_its_time_and_only_without_progress() -> None:
    stall = Stall(PursuitConfig(stuck_s=1.0, stuck_share=0.2, pixels_per_mm=3.0))
    assert not stall.update(100.0, (0, 0), 5.0, 0.5)
    assert stall.update(98.0, (2, 0), 5.0, 0.5)  # 2 px of the 15 px that were fed
    assert not stall.update(98.0, (2, 0), 5.0, 0.5)
    assert not stall.update(88.0, (2, 0), 5.0, 0.5)  # 10 of 15
    assert not stall.update(None, (2, 0), 5.0, 5.0)


def test_a_head_that_slides_sideways_is_not_stuck() -> None:
    stall = Stall(PursuitConfig(stuck_s=1.0, stuck_share=0.2, pixels_per_mm=3.0))
    assert not stall.update(100.0, (50, 0), 5.0, 0.5)
    assert not stall.update(99.0, (50, 4), 5.0, 0.5)


def test_a_way_back_counts_from_where_its_reason_is_gone() -> None:
    back = BackOff("test", 2.0)
    assert not back.done(True, 5.0)
    assert not back.done(False, 1.0)
    assert not back.done(True, 1.0)
    assert not back.done(False, 1.9)
    assert back.done(False, 0.2)


def test_the_contact_limit_rises_where_the_head_presses_and_falls_back_farther_on() -> None:
    limit = ContactLimit(PursuitConfig(contact_back_off_n=0.2, contact_limit_n=0.4))
    assert not limit.exceeded(0.19, True, 300.0)
    assert not limit.exceeded(0.24, False, 300.0), "a body that leans is not backed off with"
    assert limit.exceeded(0.24, True, 300.0)  # now 0.3
    assert not limit.exceeded(0.29, True, 290.0)
    assert limit.exceeded(0.39, True, 290.0)  # now 0.4, and never more
    assert limit.exceeded(0.41, False, 290.0)
    assert limit.exceeded(0.21, True, 200.0)  # 90 px farther on
    assert not limit.exceeded(None, False, 100.0)
