"""The direction monitor: what a robot that is wired right, wrong, held or badly seen gives; all numbers follow from the drive."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.control.direction_monitor import (
    FIRST_WRONG_FEED_MM,
    WRONG_TURN_DEG,
    DirectionMonitor,
    HeadSeen,
    MotionSent,
    head_seen,
)
from core.control.faults import Cause
from tests.core.driving_scenes import STRAIGHT, scene_at

FRAME_S, TURN_S, LATE_S = 0.04, 0.02, 0.08
"""Of the camera, of the pilot, and how late a motion follows its command."""


@dataclass
class Robot:
    """Heading and place by what was commanded ``LATE_S`` ago: `turn` and `feed` of it, and `more` deg/s of turn of the picture."""

    turn: float = 1.0
    feed: float = 1.0
    of_theta: float = 1.0
    noise_deg: float = 0.0


def _course(
    robot: Robot,
    bend_deg: Callable[[float], float],
    feed_mm_s: Callable[[float], float] = lambda _: 0.0,
    seconds: float = 3.0,
    vessel_deg: Callable[[float], float] = lambda _: 0.0,
) -> list[DirectionMonitor]:
    """The monitor after each frame."""
    rng, monitor, found = np.random.default_rng(3), DirectionMonitor(), []
    steps = round(seconds / TURN_S)
    way_mm = 0.0
    for step in range(steps):
        now_s = step * TURN_S
        monitor = monitor.drive(MotionSent(now_s, bend_deg(now_s), feed_mm_s(now_s)))
        way_mm += robot.feed * feed_mm_s(max(0.0, now_s - LATE_S)) * TURN_S
        if step % 2 == 0:
            heading = robot.turn * bend_deg(max(0.0, now_s - LATE_S)) + vessel_deg(now_s) + rng.normal(0.0, 1.0) * robot.noise_deg
            along = math.radians(robot.turn * bend_deg(0.0))
            place = way_mm * math.cos(along), way_mm * math.sin(along)
            monitor = monitor.observe(HeadSeen(now_s, heading, robot.of_theta * (heading - vessel_deg(now_s)), place))
            found.append(monitor)
    return found


def _ramp(deg_s: float) -> Callable[[float], float]:
    return lambda now_s: deg_s * now_s


def _first_s(course: list[DirectionMonitor], cause: Cause) -> float:
    """Time of the first fault; infinite without one."""
    return next((k * FRAME_S for k, one in enumerate(course) if any(f.cause is cause for f in one.faults())), math.inf)


@pytest.mark.parametrize("deg_s", [15.0, -15.0, 60.0, -140.0])
def test_a_head_that_follows_is_no_fault_and_soon_known_to_turn(deg_s: float) -> None:
    course = _course(Robot(), _ramp(deg_s), seconds=1.0)
    assert _first_s(course, Cause.WRONG_TURN) == math.inf
    assert max(one.wrong_turn_deg for one in course) == 0.0
    assert course[-1].turns
    assert not course[0].turns


@pytest.mark.parametrize(("deg_s", "within_deg"), [(10.0, 7.0), (-15.0, 8.5), (60.0, 22.0), (-140.0, 46.0)])
def test_a_head_that_turns_the_other_way_is_noticed(deg_s: float, within_deg: float) -> None:
    """At the slow start's 10 degrees a second within 7 degrees; later as fast as lags and frames allow."""
    course = _course(Robot(turn=-1.0), _ramp(deg_s), seconds=1.0)
    at_s = _first_s(course, Cause.WRONG_TURN)
    assert abs(deg_s) * at_s <= within_deg
    fault = course[round(at_s / FRAME_S)].faults()[0]
    assert ("to the right" if deg_s > 0 else "to the left") in fault.detail
    assert not course[round(at_s / FRAME_S)].turns


def test_the_limit_is_four_degrees() -> None:
    for most_deg, fault in ((4.4, True), (3.6, False)):
        course = _course(Robot(turn=-1.0), lambda now_s, most=most_deg: min(10.0 * now_s, most), seconds=2.0)
        assert (max(one.wrong_turn_deg for one in course) >= WRONG_TURN_DEG) is fault


@pytest.mark.parametrize("feed_mm_s", [1.0, 3.0, 8.0, -3.0])
def test_a_feed_that_goes_the_other_way_is_noticed(feed_mm_s: float) -> None:
    course = _course(Robot(feed=-1.0), _ramp(0.0), lambda _: feed_mm_s)
    at_s = _first_s(course, Cause.WRONG_FEED)
    assert abs(feed_mm_s) * at_s <= FIRST_WRONG_FEED_MM + 0.38 * abs(feed_mm_s)
    assert f"{math.copysign(1.0, feed_mm_s):+.0f}"[0] in course[round(at_s / FRAME_S)].faults()[0].detail
    right = _course(Robot(), _ramp(0.0), lambda _: feed_mm_s)
    assert _first_s(right, Cause.WRONG_FEED) == math.inf
    assert right[-1].feeds


def test_a_head_that_is_held_is_no_wrong_way_and_does_not_stay_careful_for_ever() -> None:
    course = _course(Robot(turn=0.0, feed=0.0), _ramp(20.0), lambda _: 5.0)
    assert all(not one.faults() for one in course)
    assert course[-1].turns
    assert course[-1].feeds


def test_a_vessel_that_turns_away_is_no_turn_of_the_head() -> None:
    """Bent to the left at rest, while the vessel beside the head turns: theta goes right, the head does not."""
    course = _course(Robot(turn=0.0), _ramp(-30.0), lambda _: 8.0, vessel_deg=lambda now_s: 0.0)
    assert _first_s(course, Cause.WRONG_TURN) == math.inf
    bent = [
        DirectionMonitor().drive(MotionSent(0.0, 0.0, 8.0)),
    ]
    for k in range(1, 30):
        now_s = k * FRAME_S
        bent.append(
            bent[-1].drive(MotionSent(now_s, -30.0 * now_s, 8.0)).observe(HeadSeen(now_s, 0.0, 30.0 * now_s, (8.0 * now_s, 0.0)))
        )
    assert all(not one.faults() for one in bent)


def test_a_head_that_follows_a_bend_of_the_vessel_against_a_large_command_goes_the_wrong_way() -> None:
    """Swapped, in a vessel that turns to the right: steered to the left, the head lies along the vessel and theta stays."""
    monitor, found_s = DirectionMonitor(), math.inf
    for k in range(60):
        now_s = k * FRAME_S
        monitor = monitor.drive(MotionSent(now_s, -10.0 * now_s, 5.0)).observe(HeadSeen(now_s, 6.0 * now_s, 0.0, (0.0, 0.0)))
        found_s = min(found_s, now_s) if monitor.faults() else found_s
    assert 1.0 < found_s < 1.4


def test_a_wall_that_turns_the_head_with_the_vessel_is_no_turn_against_it() -> None:
    monitor = DirectionMonitor().drive(MotionSent(0.0, 0.0, 8.0))
    for k in range(1, 40):
        now_s = k * FRAME_S
        monitor = monitor.drive(MotionSent(now_s, -20.0 * now_s, 8.0))
        monitor = monitor.observe(
            HeadSeen(now_s, 40.0 * now_s, -5.0 * now_s, (0.0, 0.0))
        )  # guided right, while it turns to the left
        assert not any(fault.cause is Cause.WRONG_TURN for fault in monitor.faults())


@pytest.mark.parametrize("noise_deg", [1.0, 3.0, 6.0])
def test_noise_of_the_pose_is_no_turn(noise_deg: float) -> None:
    for deg_s in (0.0, 8.0, -20.0):
        course = _course(Robot(noise_deg=noise_deg), lambda now_s, rate=deg_s: rate * math.sin(2.0 * now_s), seconds=20.0)
        assert _first_s(course, Cause.WRONG_TURN) == math.inf


def test_a_single_wrong_pose_is_no_motion() -> None:
    monitor = DirectionMonitor()
    for k in range(60):
        now_s = k * FRAME_S
        wrong = 180.0 if k in {20, 40, 41} else 0.0
        monitor = monitor.drive(MotionSent(now_s, -20.0 * now_s, -3.0)).observe(HeadSeen(now_s, wrong, wrong, (wrong, 0.0)))
        assert not monitor.faults(), now_s


def test_a_pause_of_commands_or_poses_begins_again() -> None:
    monitor = _course(Robot(turn=-1.0), _ramp(15.0), seconds=0.4)[-1]
    assert 0.0 < monitor.wrong_turn_deg < WRONG_TURN_DEG
    resumed = monitor.drive(MotionSent(2.0, 6.0, 0.0))
    assert resumed.seen == ()
    assert resumed.observe(HeadSeen(2.04, -90.0, -90.0, (0.0, 0.0))).wrong_turn_deg == 0.0
    late = monitor.observe(HeadSeen(0.9, -40.0, -40.0, (0.0, 0.0)))
    assert (late.wrong_turn_deg, len(late.seen)) == (0.0, 1)


def test_poses_without_commands_and_commands_without_poses_say_nothing() -> None:
    alone = DirectionMonitor()
    for k in range(40):
        alone = alone.observe(HeadSeen(k * FRAME_S, 9.0 * k, 9.0 * k, (0.0, 0.0)))
    assert alone == DirectionMonitor()
    blind = DirectionMonitor()
    for k in range(400):
        blind = blind.drive(MotionSent(k * TURN_S, 1.0 * k, 8.0))
    assert not blind.faults()
    assert len(blind.sent) < 250, "old commands are dropped"


def test_the_head_of_a_scene() -> None:
    found = head_seen(scene_at(STRAIGHT, (200.0, 100.0), None, heading_deg=12.0), 4.0)
    assert (found.heading_deg, found.theta_deg) == (pytest.approx(12.0, abs=0.1), pytest.approx(12.0, abs=0.1))
    assert found.place_mm == (50.0, 25.0)
    assert found.length_mm == pytest.approx(15.0)
    inside = scene_at(STRAIGHT, (200.0, 100.0), None, heading_deg=12.0)
    assert inside.path is not None
    slant = replace(inside.vessel_vector, start=(0.0, 0.0), end=(math.cos(0.35), math.sin(0.35)))
    assert head_seen(replace(inside, vessel_vector=slant), 4.0).theta_deg == pytest.approx(12.0 - math.degrees(0.35), abs=0.1)
    assert [head_seen(replace(inside, **{part: None}), 4.0) for part in ("pose", "path", "vessel_vector")] == [None] * 3
    assert head_seen(replace(inside, path=replace(inside.path, points=inside.path.points[-1:])), 4.0) is None
    assert head_seen(replace(inside, path=replace(inside.path, entry_on_border=False)), 4.0).length_mm is None


def _fed(feed_mm_s: float, seen: Callable[[float], HeadSeen], seconds: float = 3.0) -> list[DirectionMonitor]:
    course = [DirectionMonitor()]
    for k in range(round(seconds / FRAME_S)):
        course.append(course[-1].drive(MotionSent(k * FRAME_S, 0.0, feed_mm_s)).observe(seen(k * FRAME_S)))
    return course


def test_a_head_that_straightens_while_it_is_fed_has_not_gone_back() -> None:
    def seen(now_s: float) -> HeadSeen:
        return HeadSeen(now_s, 0.0, 0.0, (1.0 * now_s - 2.0 * min(now_s, 1.5), 0.0), 80.0 + 1.0 * now_s)

    assert max(one.wrong_feed_mm for one in _fed(1.0, seen)) == 0.0
    blind = _fed(1.0, lambda now_s: replace(seen(now_s), length_mm=None))
    assert any(one.faults() for one in blind), "without the length it looks as if it did"


def test_a_robot_that_is_covered_or_cut_in_the_picture_has_not_gone_back() -> None:
    def seen(now_s: float) -> HeadSeen:
        length_mm = 80.0 + 3.0 * now_s - (25.0 if 0.8 <= now_s < 2.0 else 0.0)
        return HeadSeen(now_s, 0.0, 0.0, (3.0 * now_s, 0.0), length_mm)

    assert max(one.wrong_feed_mm for one in _fed(3.0, seen)) < 0.1
    course = _fed(8.0, lambda now_s: HeadSeen(now_s, 0.0, 0.0, (8.0 * now_s, 0.0), 80.0 + 8.0 * now_s - 25.0 * (now_s > 2.0)))
    assert max(one.wrong_feed_mm for one in course) < 0.1, "nor after much feed"


@pytest.mark.parametrize("length_mm", [None, 80.0])
def test_a_reversed_feed_shows_by_the_length_or_else_by_the_head(length_mm: float | None) -> None:
    """None: all of the robot is in the picture, so that its length stays."""

    def seen(now_s: float) -> HeadSeen:
        return HeadSeen(now_s, 0.0, 0.0, (-3.0 * now_s, 0.0), None if length_mm is None else length_mm - 3.0 * now_s)

    course = _fed(3.0, seen, 1.0)
    assert any(fault.cause is Cause.WRONG_FEED for one in course for fault in one.faults())
    assert not course[-1].feeds


def test_what_was_commanded_before_the_program_is_no_motion_against_it() -> None:
    """By hand the head was sent to the left and the robot backwards, and gets there when the program has begun."""
    monitor = DirectionMonitor()
    for k in range(75):
        now_s = k * FRAME_S
        late = min(1.0, now_s / 0.24) - 1.0
        heading, length_mm = 15.0 * max(0.0, now_s - LATE_S) - 57.0 * late, 80.0 + max(0.0, now_s - LATE_S) - 1.5 * late
        monitor = monitor.drive(MotionSent(now_s, 15.0 * now_s, 1.0)).observe(
            HeadSeen(now_s, heading, heading, (0.0, 0.0), length_mm)
        )
        assert not monitor.faults(), now_s


def test_a_vessel_that_turned_before_hides_no_wrong_turn() -> None:
    """For two seconds it turns away to the right beside a head that is not steered; then that is steered left, and turns right."""
    monitor = DirectionMonitor()
    for k in range(80):
        now_s = k * FRAME_S
        turned = 10.0 * max(0.0, now_s - 2.0)
        theta = turned - 15.0 * min(now_s, 2.0)
        monitor = monitor.drive(MotionSent(now_s, -turned, 0.0)).observe(HeadSeen(now_s, turned, theta, (0.0, 0.0)))
    assert monitor.wrong_turn_deg >= WRONG_TURN_DEG
    assert not monitor.turns


@pytest.mark.parametrize(("share", "is_held"), [(0.05, True), (0.15, False)])
def test_a_head_that_gives_way_a_little_is_held_and_one_that_goes_the_wrong_way_is_not(share: float, is_held: bool) -> None:
    course = _course(Robot(turn=-share, feed=-share), _ramp(15.0), lambda _: 3.5, seconds=1.2)
    assert not any(one.faults() for one in course)
    assert (course[-1].turns, course[-1].feeds) == (is_held, is_held)


def test_a_steady_motion_has_no_noise() -> None:
    monitor = DirectionMonitor()
    assert (monitor.wrong_turn_deg, monitor.wrong_feed_mm, monitor.commanded) == (0.0, 0.0, (0.0, 0.0))
    for k in range(26):
        now_s = k * FRAME_S
        monitor = monitor.drive(MotionSent(now_s, 10.0 * now_s, 2.0))
        monitor = monitor.observe(HeadSeen(now_s, -5.0 * now_s, -5.0 * now_s, (0.0, 0.0), 80.0 - 1.0 * now_s))
    assert monitor.wrong_turn_deg == pytest.approx(5.0, abs=0.02)
    assert monitor.wrong_feed_mm == pytest.approx(1.0, abs=0.02)


def test_noise_that_is_taken_off_is_two_and_a_half_deviations() -> None:
    """A pose that alternates by 0.2 degrees has second differences of 0.8, as noise with a deviation of 0.41 has."""
    monitor = DirectionMonitor()
    for k in range(26):
        now_s = k * FRAME_S
        heading = -5.0 * now_s + (0.2 if k % 2 == 0 else -0.2)
        monitor = monitor.drive(MotionSent(now_s, 10.0 * now_s, 0.0)).observe(HeadSeen(now_s, heading, heading, (0.0, 0.0)))
    assert monitor.wrong_turn_deg == pytest.approx(5.4 - 2.5 * 0.41, abs=0.1)


def test_between_two_commands_the_motion_is_in_proportion() -> None:
    """10 mm/s fed turn a head that is bent by 15 degrees by 10 degrees a second."""
    monitor = DirectionMonitor()
    for k in range(5):
        monitor = monitor.drive(MotionSent(k * 0.1, 15.0 + k, 10.0))
    seen = monitor.observe(HeadSeen(0.37, 0.0, 0.0, (0.0, 0.0))).seen[-1]
    assert monitor.observe(HeadSeen(0.45, 0.0, 0.0, (0.0, 0.0))).seen[-1].turns_deg[0] == 19.0
    assert seen.turns_deg == pytest.approx((18.7, 17.5, 16.2))
    assert seen.feds_mm == pytest.approx((3.7, 2.5, 1.2))
    assert seen.drifts_deg == pytest.approx(
        (1.0 + 16 / 15 + 17 / 15 + 0.7 * 18 / 15, 1.0 + 16 / 15 + 0.5 * 17 / 15, 1.0 + 0.2 * 16 / 15)
    )


@pytest.mark.parametrize("follows", [False, True])
def test_what_had_no_effect_may_spring_free_and_what_had_may_not(follows: bool) -> None:
    """Right and forward for a second, held or followed; then the command goes back, and head and robot go right and forward."""
    causes: set[Cause] = set()
    monitor = DirectionMonitor()
    for k in range(50):
        now_s = k * FRAME_S
        share = (min(now_s, 1.0) if follows else 0.0) + 0.9 * max(0.0, now_s - 1.0)
        command = 1.0 - abs(now_s - 1.0), 3.0 if now_s < 1.0 else -3.0
        monitor = monitor.drive(MotionSent(now_s, 10.0 * command[0], command[1]))
        monitor = monitor.observe(HeadSeen(now_s, 10.0 * share, 10.0 * share, (0.0, 0.0), 80.0 + 3.0 * share))
        causes |= {fault.cause for fault in monitor.faults()}
    assert causes == ({Cause.WRONG_TURN, Cause.WRONG_FEED} if follows else set())


def test_it_may_spring_free_long_after_it_has_followed() -> None:
    """It follows for a second, rests for five, is held while the command goes on, and springs free while that goes back."""
    monitor = DirectionMonitor()
    for k in range(200):
        now_s = k * FRAME_S
        on, back = max(0.0, now_s - 6.0), max(0.0, now_s - 7.0)
        command = min(now_s, 1.0) + on - 2.0 * back
        feed = -3.0 if now_s >= 7.0 else 3.0 if now_s >= 6.0 or now_s < 1.0 else 0.0
        share = min(now_s, 1.0) + 0.8 * back
        monitor = monitor.drive(MotionSent(now_s, 10.0 * command, feed))
        monitor = monitor.observe(HeadSeen(now_s, 10.0 * share, 10.0 * share, (0.0, 0.0), 80.0 + 3.0 * share))
        assert not monitor.faults(), now_s
    assert 4.0 <= now_s - monitor.seen[0].head.captured_s + 0.12
    assert now_s - monitor.seen[0].head.captured_s <= 4.0 + FRAME_S
    assert 4.25 <= now_s - monitor.sent[0].time_s <= 4.6


def test_what_does_not_follow_was_not_seen_to_turn() -> None:
    """Noise of a head that is held, and a vessel that turns away beside it."""
    assert not _course(Robot(turn=0.0, noise_deg=2.0), _ramp(5.0), seconds=1.6)[-1].turns
    monitor = DirectionMonitor().drive(MotionSent(1.0, 0.0, 0.0))
    assert monitor.observe(HeadSeen(0.9, 0.0, 0.0, (0.0, 0.0))) == monitor, "before the first command"
    for k in range(25, 75):
        now_s = k * FRAME_S
        monitor = monitor.drive(MotionSent(now_s, 10.0 * (now_s - 1.0), 0.0))
        monitor = monitor.observe(HeadSeen(now_s, 0.0, -5.0 * (now_s - 1.0), (0.0, 0.0)))
    assert not monitor.turns


def test_a_bent_head_that_is_turned_on_by_its_feed_was_not_seen_to_turn() -> None:
    monitor = DirectionMonitor()
    for k in range(40):
        now_s = k * FRAME_S
        late_s = max(0.0, now_s - LATE_S)
        drift = 16.0 * late_s + 16.0 / 15.0 * late_s**2
        monitor = monitor.drive(MotionSent(now_s, 30.0 + 4.0 * now_s, 8.0))
        monitor = monitor.observe(HeadSeen(now_s, drift, drift, (0.0, 0.0), 80.0 + 8.0 * late_s))
    assert (monitor.turns, monitor.feeds) == (False, True)


def test_with_few_pictures_a_reversed_feed_shows_by_long_steps() -> None:
    monitor = DirectionMonitor()
    for k in range(10):
        now_s = k * 0.2
        monitor = monitor.drive(MotionSent(now_s, 0.0, 12.0)).observe(HeadSeen(now_s, 0.0, 0.0, (0.0, 0.0), 80.0 - 12.0 * now_s))
    assert [fault.cause for fault in monitor.faults()] == [Cause.WRONG_FEED]


_rates = st.lists(st.floats(-140.0, 140.0), min_size=2, max_size=6)


@given(rates=_rates, share=st.floats(0.0, 1.0), feed=st.floats(-8.0, 8.0), late_s=st.floats(0.02, 0.24))
@settings(max_examples=60)
def test_a_robot_that_is_wired_right_never_seems_to_go_the_other_way(
    rates: list[float], share: float, feed: float, late_s: float
) -> None:
    """Whatever is commanded, however much of it the vessel lets through, and however late, within the lags that are known."""
    monitor, turn_deg, fed_mm = DirectionMonitor(), [0.0], [0.0]
    late = round(late_s / TURN_S)
    for step in range(25 * len(rates)):
        now_s = step * TURN_S
        turn_deg.append(max(-94.0, min(94.0, turn_deg[-1] + rates[step // 25] * TURN_S)))
        fed_mm.append(fed_mm[-1] + feed * TURN_S)
        monitor = monitor.drive(MotionSent(now_s, turn_deg[-1], feed))
        if step % 2:
            then_deg, then_mm = (known[max(0, len(known) - 1 - late)] for known in (turn_deg, fed_mm))
            monitor = monitor.observe(HeadSeen(now_s, share * then_deg, share * then_deg, (share * then_mm, 0.0)))
            assert not monitor.faults(), now_s


@given(rate=st.floats(12.0, 140.0), share=st.floats(0.6, 1.0), sign=st.sampled_from([-1.0, 1.0]), late_s=st.floats(0.02, 0.14))
@settings(max_examples=40)
def test_a_robot_that_is_wired_the_other_way_is_always_noticed(rate: float, share: float, sign: float, late_s: float) -> None:
    monitor, most_deg = DirectionMonitor(), 0.0
    for step in range(round(1.5 / TURN_S)):
        now_s = step * TURN_S
        monitor = monitor.drive(MotionSent(now_s, sign * rate * now_s, 0.0))
        if step % 2:
            most_deg = share * rate * max(0.0, now_s - late_s)
            monitor = monitor.observe(HeadSeen(now_s, -sign * most_deg, -sign * most_deg, (0.0, 0.0)))
            if monitor.faults():
                break
    assert monitor.faults()
    assert most_deg <= WRONG_TURN_DEG + 2.0 + rate * 0.35
