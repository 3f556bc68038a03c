"""The direction monitor: what a robot that is wired right, wrong, held or badly seen gives; all numbers follow from the drive."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.control.direction_monitor import FIRST_WRONG_FEED_MM, WRONG_TURN_DEG, DirectionMonitor, HeadSeen, MotionSent, head_seen
from core.control.faults import Cause
from tests.core.driving_scenes import STRAIGHT, scene_at

FRAME_S, TURN_S, LATE_S = 0.04, 0.02, 0.08
"""Of the camera, of the pilot, and how late a motion follows its command."""


@dataclass
class Robot:
    """Heading and way by what was commanded ``LATE_S`` ago: `turn` and `feed` of it."""

    turn: float = 1.0
    feed: float = 1.0
    noise_deg: float = 0.0


def _head(now_s: float, heading_deg: float = 0.0, theta_deg: float | None = None, way_mm: float = 0.0) -> HeadSeen:
    """Of a robot that comes in from the picture's left border; theta is the heading where the vessel has none of its own."""
    return HeadSeen(now_s, heading_deg, heading_deg if theta_deg is None else theta_deg, 80.0 + way_mm, (0.0, 0.0), (1.0, 0.0))


def _seen(
    bend_deg: Callable[[float], float],
    feed_mm_s: float | Callable[[float], float],
    head: Callable[[float], HeadSeen],
    seconds: float = 3.0,
    frame_s: float = FRAME_S,
) -> list[DirectionMonitor]:
    """The monitor after each frame, with a command at each."""
    found = [DirectionMonitor()]
    for now_s in (k * frame_s for k in range(round(seconds / frame_s))):
        feed = feed_mm_s if isinstance(feed_mm_s, float) else feed_mm_s(now_s)
        found.append(found[-1].drive(MotionSent(now_s, bend_deg(now_s), feed)).observe(head(now_s)))
    return found[1:]


def _course(
    robot: Robot, bend_deg: Callable[[float], float], feed_mm_s: Callable[[float], float] = lambda _: 0.0, seconds: float = 3.0
) -> list[DirectionMonitor]:
    """The monitor after each frame."""
    rng, monitor, found = np.random.default_rng(3), DirectionMonitor(), []
    way_mm = 0.0
    for step in range(round(seconds / TURN_S)):
        now_s = step * TURN_S
        monitor = monitor.drive(MotionSent(now_s, bend_deg(now_s), feed_mm_s(now_s)))
        way_mm += robot.feed * feed_mm_s(max(0.0, now_s - LATE_S)) * TURN_S
        if step % 2 == 0:
            heading = robot.turn * bend_deg(max(0.0, now_s - LATE_S)) + rng.normal(0.0, 1.0) * robot.noise_deg
            monitor = monitor.observe(_head(now_s, heading, way_mm=way_mm))
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
        course = _course(Robot(turn=-1.0), lambda now_s, most=most_deg: min(10.0 * max(0.0, now_s - 0.2), most))
        assert (max(one.wrong_turn_deg for one in course) >= WRONG_TURN_DEG) is fault


def test_a_fault_says_how_far_it_went_against_what() -> None:
    def texts(**state: object) -> list[str]:
        return [fault.detail for fault in DirectionMonitor(**state).faults()]

    assert texts(wrong_turn_deg=4.0, commanded=(-20.0, 3.0)) == ["4° against a bend of 20° to the left"]
    assert texts(wrong_feed_mm=0.7, commanded=(-20.0, 3.0)) == ["0.7 mm against a feed of +3.0 mm"]
    assert texts(wrong_feed_mm=1.4, feeds=True) == []
    assert texts(wrong_feed_mm=1.5, feeds=True, commanded=(0.0, -3.0)) == ["1.5 mm against a feed of -3.0 mm"]


def test_three_degrees_or_one_millimetre_show_that_it_follows() -> None:
    for share in (0.9, 1.1):
        most_s = 0.2 + share

        def fed(now_s: float, most_s: float = most_s) -> float:
            return 1.0 if 0.2 <= now_s < most_s else 0.0

        course = _course(Robot(), lambda now_s, most_s=most_s: 3.0 * max(0.0, min(now_s, most_s) - 0.2), fed)
        assert (course[-1].turns, course[-1].feeds) == (share > 1.0, share > 1.0)


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
    course = _seen(_ramp(-30.0), 8.0, lambda now_s: _head(now_s, 0.0, 30.0 * now_s, 8.0 * now_s), 1.2)
    assert not any(one.faults() for one in course)


def test_a_head_that_follows_a_bend_of_the_vessel_against_a_large_command_goes_the_wrong_way() -> None:
    """Swapped, in a vessel that turns to the right: steered to the left, the head lies along the vessel and theta stays."""
    course = _seen(_ramp(-10.0), 5.0, lambda now_s: _head(now_s, 6.0 * now_s, 0.0))
    assert 1.0 < _first_s(course, Cause.WRONG_TURN) < 1.4


def test_a_wall_that_turns_the_head_with_the_vessel_is_no_turn_against_it() -> None:
    """Guided right, while it turns to the left in the vessel."""
    course = _seen(_ramp(-20.0), 8.0, lambda now_s: _head(now_s, 40.0 * now_s, -5.0 * now_s), 1.6)
    assert _first_s(course, Cause.WRONG_TURN) == math.inf


@pytest.mark.parametrize("noise_deg", [1.0, 3.0, 6.0])
def test_noise_of_the_pose_is_no_turn(noise_deg: float) -> None:
    for deg_s in (0.0, 8.0, -20.0):
        course = _course(Robot(noise_deg=noise_deg), lambda now_s, rate=deg_s: rate * math.sin(2.0 * now_s), seconds=20.0)
        assert _first_s(course, Cause.WRONG_TURN) == math.inf


def test_a_single_wrong_pose_is_no_motion() -> None:
    def head(now_s: float) -> HeadSeen:
        wrong = 180.0 if round(now_s / FRAME_S) in {20, 40, 41} else 0.0
        return _head(now_s, wrong, way_mm=wrong)

    assert not any(one.faults() for one in _seen(_ramp(-20.0), -3.0, head))


def test_a_pause_of_commands_or_poses_begins_again() -> None:
    monitor = _course(Robot(turn=-1.0), _ramp(15.0), seconds=0.5)[-1]
    assert 0.0 < monitor.wrong_turn_deg < WRONG_TURN_DEG
    resumed = monitor.drive(MotionSent(2.0, 6.0, 0.0))
    assert resumed.seen == ()
    again = monitor.drive(MotionSent(monitor.sent[-1].time_s, 7.0, 0.0))
    assert again.seen == monitor.seen, "one that is reported twice is no pause"
    assert len(monitor.observe(monitor.seen[-1].head).seen) == len(monitor.seen) + 1, "nor is such a pose"
    assert resumed.observe(_head(2.3, -90.0)).wrong_turn_deg == 0.0
    late = monitor.observe(_head(0.9, -40.0))
    assert (late.wrong_turn_deg, len(late.seen)) == (0.0, 1)


def test_poses_without_commands_and_commands_without_poses_say_nothing() -> None:
    alone = DirectionMonitor()
    for k in range(40):
        alone = alone.observe(_head(k * FRAME_S, 9.0 * k))
    assert alone == DirectionMonitor()
    blind = DirectionMonitor()
    for k in range(400):
        blind = blind.drive(MotionSent(k * TURN_S, 1.0 * k, 8.0))
    assert not blind.faults()
    assert len(blind.sent) <= 251, "old commands are dropped"


def test_the_head_of_a_scene() -> None:
    found = head_seen(scene_at(STRAIGHT, (200.0, 100.0), None, heading_deg=12.0), 4.0)
    assert (found.heading_deg, found.theta_deg) == (pytest.approx(12.0, abs=0.1), pytest.approx(12.0, abs=0.1))
    assert found.length_mm == pytest.approx(15.0)
    assert (*found.tail_mm, *found.tail_along) == pytest.approx(
        (50.0 - 15.0 * math.cos(0.2094), 25.0 - 15.0 * math.sin(0.2094), math.cos(0.2094), math.sin(0.2094)), abs=1e-3
    )
    inside = scene_at(STRAIGHT, (200.0, 100.0), None, heading_deg=12.0)
    assert inside.path is not None
    slant = replace(inside.vessel_vector, start=(0.0, 0.0), end=(math.cos(0.35), math.sin(0.35)))
    assert head_seen(replace(inside, vessel_vector=slant), 4.0).theta_deg == pytest.approx(12.0 - math.degrees(0.35), abs=0.1)
    assert [head_seen(replace(inside, **{part: None}), 4.0) for part in ("pose", "path", "vessel_vector")] == [None] * 3
    points = inside.path.points
    there_and_back = np.concatenate([points, points[-2:-10:-1], points[-8:]])  # an end without a direction
    for unclear in (points[-1:], there_and_back, there_and_back[::-1]):
        assert head_seen(replace(inside, path=replace(inside.path, points=unclear)), 4.0) is None


def _robot(now_s: float, way_mm: float, shown_mm: float) -> HeadSeen:
    """A straight robot, obliquely in the picture, of which so much is to be seen."""
    tail_mm = way_mm - shown_mm
    return HeadSeen(now_s, 53.1, 0.0, shown_mm, (0.6 * tail_mm, 0.8 * tail_mm), (0.6, 0.8))


@pytest.mark.parametrize("feed", [3.0, -3.0])
@pytest.mark.parametrize(
    "shown_mm",
    [
        pytest.param(lambda way_mm, _: 80.0 + way_mm, id="comes in from the border"),
        pytest.param(lambda way_mm, _: 80.0, id="all of it is in the picture"),
        pytest.param(lambda way_mm, now_s: 80.0 + way_mm - 8.0 * now_s, id="is covered slowly"),
        pytest.param(lambda way_mm, now_s: 80.0 + way_mm - (25.0 if 0.8 <= now_s < 2.0 else 0.0), id="is covered for a while"),
    ],
)
def test_the_way_is_that_of_the_robot_whatever_is_seen_of_it(feed: float, shown_mm: Callable[[float, float], float]) -> None:
    """Fed forward it goes as it is fed, or the other way."""
    course = _seen(_ramp(0.0), 3.0, lambda now_s: _robot(now_s, feed * now_s, shown_mm(feed * now_s, now_s)))
    assert course[-1].feeds is (feed > 0.0)
    assert _first_s(course, Cause.WRONG_FEED) == pytest.approx(math.inf if feed > 0.0 else 0.5, abs=0.05)
    assert max(one.wrong_feed_mm for one in course) < (0.1 if feed > 0.0 else math.inf)


_BAD_POSES = [
    pytest.param(1.0, {0: 8.0, 1: 4.0}, 8, id="a head flickers by 8 mm, and comes back in two steps"),
    pytest.param(1.0, {0: -1.5}, 6, id="it flickers by little"),
    pytest.param(1.0, {0: -4.0}, 6, id="it flickers by more"),
    pytest.param(8.0, {0: -4.0}, 6, id="it flickers while it is fed fast"),
    pytest.param(1.0, {0: -25.0, 1: -25.0, 2: -25.0}, 6, id="tail and head are mistaken half of the time"),
]


@pytest.mark.parametrize(("feed", "off_mm", "frames"), _BAD_POSES)
def test_poses_that_flicker_are_no_way_back_and_hide_none(feed: float, off_mm: dict[int, float], frames: int) -> None:
    for sign in (1.0, -1.0):

        def head(now_s: float, sign: float = sign) -> HeadSeen:
            way_mm = sign * feed * max(0.0, now_s - LATE_S)
            return _head(now_s, way_mm=way_mm + off_mm.get(round(now_s / FRAME_S) % frames, 0.0))

        course = _seen(_ramp(0.0), feed, head)
        assert (_first_s(course, Cause.WRONG_FEED) < 1.2) is (sign < 0.0)
        assert course[-1].feeds is (sign > 0.0)


@pytest.mark.parametrize("cut_mm", [1.5, 3.0, 4.6, 25.0])
@pytest.mark.parametrize(("feed", "at_s"), [(1.0, 0.4), (1.0, 0.8), (1.0, 2.0), (8.0, 2.0)])
def test_a_robot_that_is_covered_at_once_has_not_gone_back(feed: float, at_s: float, cut_mm: float) -> None:
    """As at the edge of a clip, or around a bend, where what is covered is longer than the way of its end."""

    def head(now_s: float) -> HeadSeen:
        return _head(now_s, way_mm=feed * max(0.0, now_s - LATE_S) - (cut_mm if now_s > at_s else 0.0))

    course = _seen(_ramp(0.0), feed, head)
    assert not any(one.faults() for one in course)


@pytest.mark.parametrize("frames", [8, 10, 15])
def test_ways_before_and_after_a_jump_do_not_add_up(frames: int) -> None:
    """The head is 1.25 mm shorter half of the time: what it goes at once one way counts as a step the other way."""

    def head(now_s: float) -> HeadSeen:
        return _head(now_s, way_mm=max(0.0, now_s - LATE_S) + 1.25 * (round(now_s / FRAME_S) // frames % 2))

    assert not any(one.faults() for one in _seen(_ramp(0.0), 1.0, head, 8.0))


@pytest.mark.parametrize("frames", [8, 12, 25])
@pytest.mark.parametrize("once", [False, True])
def test_a_tail_that_jumps_hides_no_wrong_turn_and_makes_none(frames: int, once: bool) -> None:
    """By 25 mm, for as long as it stays or for one frame; where head and tail are mistaken, the heading is another, too."""
    for turn, is_wrong in ((-1.0, True), (1.0, False)):

        def head(now_s: float, turn: float = turn) -> HeadSeen:
            frame = round(now_s / FRAME_S)
            is_off = frame % frames == 0 if once else frame // frames % 2 == 1
            other_deg = 0.0 if turn < 0.0 or not is_off else -160.0
            return _head(now_s, turn * 10.0 * max(0.0, now_s - LATE_S) + other_deg, way_mm=now_s - (25.0 if is_off else 0.0))

        assert (_first_s(_seen(_ramp(10.0), 1.0, head), Cause.WRONG_TURN) <= 0.8) is is_wrong


@pytest.mark.parametrize(
    ("feed", "noise_mm", "within_s"), [(1.0, 0.1, 1.3), (1.0, 0.4, 2.4), (3.0, 0.4, 1.1), (3.0, 0.8, 1.0), (8.0, 0.4, 0.7)]
)
def test_noise_of_the_length_is_no_way_and_hides_none_for_long(feed: float, noise_mm: float, within_s: float) -> None:
    for sign in (1.0, -1.0):
        rng = np.random.default_rng(5)

        def head(now_s: float, sign: float = sign, rng: np.random.Generator = rng) -> HeadSeen:
            return _head(now_s, way_mm=sign * feed * max(0.0, now_s - LATE_S) + noise_mm * rng.normal())

        course = _seen(_ramp(0.0), feed, head, 4.0)
        assert (_first_s(course, Cause.WRONG_FEED) <= within_s) is (sign < 0.0)
        assert course[-1].feeds is (sign > 0.0)


def test_what_was_commanded_before_the_program_is_no_motion_against_it() -> None:
    """By hand the head was sent to the left and the robot backwards, and gets there when the program has begun."""

    def head(now_s: float) -> HeadSeen:
        late, since_s = min(1.0, now_s / 0.24) - 1.0, max(0.0, now_s - LATE_S)
        return _head(now_s, 15.0 * since_s - 57.0 * late, way_mm=since_s - 1.5 * late)

    assert not any(one.faults() for one in _seen(_ramp(15.0), 1.0, head))


def test_a_vessel_that_turned_before_hides_no_wrong_turn() -> None:
    """For two seconds it turns away to the right beside a head that is not steered; then that is steered left, and turns right."""

    def turned(now_s: float) -> float:
        return 10.0 * max(0.0, now_s - 2.0)

    course = _seen(
        lambda now_s: -turned(now_s), 0.0, lambda now_s: _head(now_s, turned(now_s), turned(now_s) - 15.0 * min(now_s, 2.0)), 3.2
    )
    assert course[-1].wrong_turn_deg >= WRONG_TURN_DEG
    assert not course[-1].turns


def test_a_bent_head_that_was_turned_by_its_feed_before_hides_no_wrong_turn() -> None:
    def head(now_s: float) -> HeadSeen:
        return _head(now_s, 16.0 * min(now_s, 5.0) + 10.0 * max(0.0, now_s - 5.0))

    course = _seen(lambda now_s: 30.0 - 10.0 * max(0.0, now_s - 5.0), lambda now_s: 8.0 if now_s < 5.0 else 0.0, head, 6.2)
    assert course[-1].wrong_turn_deg >= WRONG_TURN_DEG


@pytest.mark.parametrize(("share", "is_held"), [(0.05, True), (0.15, False)])
def test_a_head_that_gives_way_a_little_is_held_and_one_that_goes_the_wrong_way_is_not(share: float, is_held: bool) -> None:
    """After a command of 10 degrees or 3 mm."""
    course = _course(Robot(turn=-share, feed=-share), _ramp(15.0), lambda _: 4.6, seconds=1.0)
    assert not any(one.faults() or one.turns or one.feeds for one in course[:-2])
    assert (course[-1].turns, course[-1].feeds) == (is_held, is_held)


def test_a_steady_motion_has_no_noise() -> None:
    monitor = DirectionMonitor()
    assert (monitor.wrong_turn_deg, monitor.wrong_feed_mm, monitor.commanded) == (0.0, 0.0, (0.0, 0.0))
    monitor = _seen(_ramp(10.0), 2.0, lambda now_s: _head(now_s, -5.0 * now_s, way_mm=-1.0 * now_s), 1.28)[
        -1
    ]  # which counts from 0.24 s on
    assert monitor.wrong_turn_deg == pytest.approx(5.0, abs=0.02)
    assert monitor.wrong_feed_mm == pytest.approx(1.0, abs=0.02)


def test_noise_that_is_taken_off_is_two_and_a_half_deviations() -> None:
    """A pose that alternates by 0.2 degrees has second differences of 0.8, as noise with a deviation of 0.41 has."""

    def head(now_s: float) -> HeadSeen:
        return _head(now_s, -5.0 * now_s + (0.2 if round(now_s / FRAME_S) % 2 == 0 else -0.2), -10.0 * now_s)

    assert _seen(_ramp(10.0), 0.0, head, 1.32)[-1].wrong_turn_deg == pytest.approx(5.4 - 2.5 * 0.41, abs=0.1)


def test_between_two_commands_the_motion_is_in_proportion() -> None:
    """10 mm/s fed turn a head that is bent by 15 degrees by 10 degrees a second."""
    monitor = DirectionMonitor()
    for k in range(5):
        monitor = monitor.drive(MotionSent(k * 0.1, 15.0 + k, 10.0))
    assert monitor.observe(_head(0.45)).seen[-1].sent[0].turn_deg == 19.0
    seen = monitor.observe(_head(0.37)).seen[-1].sent
    assert [one.turn_deg for one in seen] == pytest.approx([18.7, 17.5, 16.2])
    assert [one.fed_mm for one in seen] == pytest.approx([3.7, 2.5, 1.2])
    assert [one.drift_deg for one in seen] == pytest.approx(
        [1.0 + 16 / 15 + 17 / 15 + 0.7 * 18 / 15, 1.0 + 16 / 15 + 0.5 * 17 / 15, 1.0 + 0.2 * 16 / 15]
    )


def test_a_pose_that_flickers_moves_the_head_by_little_more_than_what_was_commanded() -> None:
    """By one and a half times of the fastest that was commanded at one of the lags, and a little."""
    monitor = DirectionMonitor()
    for k in range(7):
        monitor = monitor.drive(MotionSent(k * 0.1, 1.0 * k**2, 1.0 * k))
    pose = monitor.observe(_head(0.5, 150.0)).observe(_head(0.6, -120.0, way_mm=1.4)).seen[-1]
    assert pose.step == pytest.approx((90.0, 90.0, 1.4))
    for way_mm, frames in ((1.4, 2), (1.6, 1), (-1.4, 2), (-1.6, 1)):
        assert len(monitor.observe(_head(0.5)).observe(_head(0.6, way_mm=way_mm)).seen) == frames, "too far to be a way"
    assert pose.moved == pytest.approx((0.5 + 1.5 * (36.0 - 25.0), 0.5 + 1.5 * (36.0 - 25.0), 0.1 + 1.5 * (1.5 - 1.0)))
    assert (pose.ahead_deg, pose.ahead_mm) == pytest.approx((36.0 - 17.0, 1.5 - 0.85))


@pytest.mark.parametrize("follows", [False, True])
def test_what_had_no_effect_may_spring_free_and_what_had_may_not(follows: bool) -> None:
    """Right and forward for a second, held or followed; then the command goes back, and head and robot go right and forward."""

    def head(now_s: float) -> HeadSeen:
        share = (min(now_s, 1.0) if follows else 0.0) + 0.9 * max(0.0, now_s - 1.0)
        return _head(now_s, 10.0 * share, way_mm=3.0 * share)

    course = _seen(lambda now_s: 10.0 - 10.0 * abs(now_s - 1.0), lambda now_s: 3.0 if now_s < 1.0 else -3.0, head, 2.0)
    assert {fault.cause for one in course for fault in one.faults()} == ({Cause.WRONG_TURN, Cause.WRONG_FEED} if follows else set())


def test_it_may_spring_free_long_after_it_has_followed() -> None:
    """It follows for a second, rests for five, is held while the command goes on, and springs free while that goes back."""

    def bend_deg(now_s: float) -> float:
        return 10.0 * (min(now_s, 1.0) + max(0.0, now_s - 6.0) - 2.0 * max(0.0, now_s - 7.0))

    def feed(now_s: float) -> float:
        return -3.0 if now_s >= 7.0 else 3.0 if now_s >= 6.0 or now_s < 1.0 else 0.0

    def head(now_s: float) -> HeadSeen:
        share = min(now_s, 1.0) + 0.8 * max(0.0, now_s - 7.0)
        return _head(now_s, 10.0 * share, way_mm=3.0 * share)

    course = _seen(bend_deg, feed, head, 8.0)
    assert not any(one.faults() for one in course)
    poses, commands = course[-1].seen, course[-1].sent
    assert 4.0 - 0.12 <= 7.96 - poses[0].head.captured_s <= 4.0 + FRAME_S
    assert 4.9 <= 7.96 - commands[0].time_s <= 5.0
    assert len(poses) < 50, "those of before are thinned out"


def test_what_does_not_follow_was_not_seen_to_turn() -> None:
    """Noise of a head that is held, and a vessel that turns away beside it."""
    assert not _course(Robot(turn=0.0, noise_deg=2.0), _ramp(5.0), seconds=1.6)[-1].turns
    shaking = _seen(_ramp(0.0), 1.0, lambda now_s: _head(now_s, way_mm=0.25 * math.cos(math.pi * now_s / FRAME_S)), 2.0)
    assert not any(one.feeds or one.faults() for one in shaking)
    monitor = DirectionMonitor().drive(MotionSent(1.0, 0.0, 0.0))
    assert monitor.observe(_head(0.9)) == monitor, "before the first command"
    assert not _seen(_ramp(10.0), 0.0, lambda now_s: _head(now_s, 0.0, -5.0 * now_s), 2.0)[-1].turns


def test_a_bent_head_that_is_turned_on_by_its_feed_was_not_seen_to_turn() -> None:
    def head(now_s: float) -> HeadSeen:
        late_s = max(0.0, now_s - LATE_S)
        return _head(now_s, 16.0 * late_s + 16.0 / 15.0 * late_s**2, way_mm=8.0 * late_s)

    monitor = _seen(lambda now_s: 30.0 + 4.0 * now_s, 8.0, head, 1.6)[-1]
    assert (monitor.turns, monitor.feeds) == (False, True)


def test_a_bent_head_that_is_turned_on_at_once_by_a_feed_that_begins_does_not_turn_the_wrong_way() -> None:
    def head(now_s: float) -> HeadSeen:
        fed_s = max(0.0, now_s - 1.0)
        return _head(now_s, (2.6 * fed_s - 24.0) * fed_s, way_mm=8.0 * fed_s)

    course = _seen(lambda now_s: 10.0 * now_s - 55.0, lambda now_s: 8.0 if now_s >= 1.0 else 0.0, head, 2.0)
    assert _first_s(course, Cause.WRONG_TURN) == math.inf


def test_with_few_pictures_a_reversed_feed_shows_by_long_steps() -> None:
    course = _seen(_ramp(0.0), 12.0, lambda now_s: _head(now_s, way_mm=-12.0 * now_s), 2.0, frame_s=0.2)
    assert [fault.cause for fault in course[-1].faults()] == [Cause.WRONG_FEED]


_moves = st.lists(st.tuples(st.floats(-140.0, 140.0), st.floats(-12.0, 12.0)), min_size=2, max_size=6)


@given(moves=_moves, share=st.floats(0.0, 1.0), late_s=st.floats(0.02, 0.24))
@settings(max_examples=60)
def test_a_robot_that_is_wired_right_never_seems_to_go_the_other_way(
    moves: list[tuple[float, float]], share: float, late_s: float
) -> None:
    """Whatever is commanded, however much of it the vessel lets through, and however late, within the lags that are known."""
    monitor, turn_deg, fed_mm = DirectionMonitor(), [0.0], [0.0]
    late = round(late_s / TURN_S)
    for step in range(25 * len(moves)):
        now_s = step * TURN_S
        rate, feed = moves[step // 25]
        turn_deg.append(max(-94.0, min(94.0, turn_deg[-1] + rate * TURN_S)))
        fed_mm.append(fed_mm[-1] + feed * TURN_S)
        monitor = monitor.drive(MotionSent(now_s, turn_deg[-1], feed))
        if step % 2:
            then_deg, then_mm = (known[max(0, len(known) - 1 - late)] for known in (turn_deg, fed_mm))
            monitor = monitor.observe(_head(now_s, share * then_deg, way_mm=share * then_mm))
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
            monitor = monitor.observe(_head(now_s, -sign * most_deg))
            if monitor.faults():
                break
    assert monitor.faults()
    assert most_deg <= WRONG_TURN_DEG + 2.0 + rate * 0.35
