"""The small memories of the look-ahead policy: stall, way back, contact limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from core.config.models import PursuitConfig
from core.control.look_ahead import LookAhead
from core.control.pursuit import BackOff, ContactLimit, FeedMonitor, MissCounter, RetryCounter, StallMonitor
from core.types import RobotStatus


def test_stall_tells_only_after_its_time_and_only_without_progress() -> None:
    stall = StallMonitor(PursuitConfig(stuck_s=1.0, stuck_share=0.2, pixels_per_mm=3.0))
    assert not stall.update(100.0, (0, 0), 5.0, 5.0), "what was before it began to watch does not count"
    assert not stall.update(100.0, (0, 0), 5.0, 0.5)
    assert stall.update(98.0, (2, 0), 5.0, 0.5)  # 2 px of the 15 px that were fed
    assert stall.lost_mm == pytest.approx(5.0)
    assert not stall.update(98.0, (2, 0), 5.0, 0.5)
    assert not stall.update(88.0, (2, 0), 5.0, 0.5)  # 10 of 15
    assert not stall.update(None, (2, 0), 5.0, 5.0)


@pytest.mark.parametrize(("rest_s", "is_told"), [(0.2, True), (0.4, False)])
def test_only_a_real_rest_lets_stall_watch_anew(rest_s: float, is_told: bool) -> None:
    stall = StallMonitor(PursuitConfig(stuck_s=1.0, stuck_share=0.2, pixels_per_mm=3.0))
    told = []
    for _ in range(4):
        told += [stall.update(100.0, (0, 0), 5.0, 0.1) for _ in range(5)]
        told += [stall.update(100.0, (0, 0), 0.0, 0.1) for _ in range(round(rest_s / 0.1))]
    assert any(told) is is_told


def fed(feed: FeedMonitor, frames_s: list[float], bus_s: float, speed_mm_s: float = 6.0) -> list[tuple[float, float]]:
    """What is known of a feed of `speed_mm_s` at each frame, of statuses that come every `bus_s`."""
    found, before_s = [], frames_s[0]
    for now_s in frames_s:
        stamp_s = bus_s * math.floor(now_s / bus_s)
        at = RobotStatus(stamp_s, speed_mm_s * stamp_s, 0.0, (0.0,) * 4, (0.0,) * 4)
        found.append(feed.update(at, 0.0, now_s - before_s))
        before_s = now_s
    return found


@pytest.mark.parametrize("fps", [15.0, 30.0, 60.0, 90.0])
@pytest.mark.parametrize("bus_s", [0.02, 0.04, 0.05])
def test_the_feed_is_known_though_frames_and_statuses_do_not_come_in_step(fps: float, bus_s: float) -> None:
    frames_s = [5.0 + 0.001 + k / fps for k in range(round(3 * fps))]
    found = fed(FeedMonitor(), frames_s, bus_s)
    known = found[round(0.2 * fps) :]
    assert [speed for speed, _ in known] == pytest.approx([6.0] * len(known))
    assert sum(way for _, way in found) == pytest.approx(6.0 * (frames_s[-1] - frames_s[0]), abs=6.0 * 2 * bus_s)


def test_a_robot_that_tells_nothing_any_more_is_not_taken_to_be_fed() -> None:
    feed = FeedMonitor()
    fed(feed, [1.0, 1.1, 1.2], 0.1)
    still = RobotStatus(1.2, 7.2, 0.0, (0.0,) * 4, (0.0,) * 4)
    assert [feed.update(still, 0.0, 0.1)[0] for _ in range(8)][-1] == 0.0
    late = RobotStatus(9.0, 70.0, 0.0, (0.0,) * 4, (0.0,) * 4)
    assert feed.update(late, 0.0, 0.1) == (0.0, 0.0)
    assert feed.update(None, 4.0, 0.1) == (4.0, 0.4)


def test_two_frames_of_one_moment_make_no_wild_speed() -> None:
    feed = FeedMonitor()
    feed.update(RobotStatus(1.0, 50.0, 0.0, (0.0,) * 4, (0.0,) * 4), 4.0, 0.03)
    speed, _ = feed.update(RobotStatus(1.0, 50.2, 0.0, (0.0,) * 4, (0.0,) * 4), 4.0, 0.001)
    assert speed == pytest.approx(10.0)


def way(left_px: float | None, target: tuple[float, float] | None = (380.0, 100.0)) -> LookAhead:
    """As it is where only the target and the way left to it matter."""
    return LookAhead((0.0, 0.0), np.zeros((2, 2)), left_px, target if left_px is not None else None, 0.0, False, 0.0, None, 0.0)


@pytest.mark.parametrize("blind_s", [0.1, 0.2])
def test_frames_without_a_way_hide_no_stall(blind_s: float) -> None:
    stall = StallMonitor(PursuitConfig(stuck_s=1.0, stuck_share=0.2, pixels_per_mm=3.0))
    told = []
    for k in range(60):
        told.append(stall.update(None if 0 < k % 9 <= round(blind_s / 0.1) else 100.0, (0, 0), 5.0, 0.1))
    assert sum(told) >= 4
    assert not any(stall.update(None, (0, 0), 5.0, 0.1) for _ in range(30)), "without a target it cannot tell"


def test_tries_count_where_the_head_stood_and_no_farther_place_that_one_frame_saw() -> None:
    tries = RetryCounter()
    counts = []
    for left_px in (200.0, 198.0, None, 197.0, 150.0, 149.0, 148.0):
        tries.update(way(left_px))
        tries.update(way(60.0))  # one frame beside a branch
        tries.add(way(left_px))
        counts.append(tries.count)
    assert counts == [1, 2, 2, 3, 1, 2, 3]
    tries.update(way(None))
    assert tries.count == 3
    tries.update(way(100.0, (5.0, 5.0)))
    assert tries.count == 0, "another target"


def test_misses_outlive_a_frame_without_a_way() -> None:
    misses = MissCounter()
    misses.add(way(150.0))
    assert [misses.count_at(way(None)), misses.count_at(way(140.0))] == [1, 1]
    assert misses.count_at(way(140.0, (5.0, 5.0))) == 0


def test_a_head_that_slides_sideways_is_not_stuck() -> None:
    stall = StallMonitor(PursuitConfig(stuck_s=1.0, stuck_share=0.2, pixels_per_mm=3.0))
    assert not stall.update(100.0, (50, 0), 5.0, 0.5)
    assert not stall.update(100.0, (50, 1), 5.0, 0.5)
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
