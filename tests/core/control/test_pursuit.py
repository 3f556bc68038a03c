"""Pursuit: advice on the route, and its progress monitors."""

import math
from dataclasses import replace

import numpy as np
import pytest

from core.config.models import POLICIES, AdviceConfig, Config, PursuitConfig
from core.control.camera_monitor import RouteState
from core.control.frame_reports import FrameReports
from core.control.policies import RandomOperator, make_policy
from core.control.pursuit import FeedMonitor, Pursuit, speed_word
from core.types import Advice, Frame, Point, Reason, Refusal, RobotStatus, Scene, Speed
from tests.core.driving_scenes import BEND, FORK, STRAIGHT, edge, line, scene_at, status

CONFIG, WORDS = PursuitConfig(smoothing_s=0.0), AdviceConfig()


def test_in_the_middle_and_along_it_goes_fast_and_straight() -> None:
    advice = Pursuit(CONFIG, WORDS)(scene_at(STRAIGHT, (100, 100), (380, 100)))
    assert (advice.speed, advice.advance_mm_s) == (Speed.FAST, WORDS.fast_mm_s)
    assert advice.steer_deg == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize(("y", "heading", "sign"), [(94, 0, 1), (106, 0, -1), (100, 20, -1), (100, -20, 1)])
def test_it_turns_towards_the_route(y: float, heading: float, sign: int) -> None:
    advice = Pursuit(CONFIG, WORDS)(scene_at(STRAIGHT, (100, y), (380, 100), heading))
    assert math.copysign(1, advice.steer_deg) == sign


def test_a_bend_ahead_slows_it_down() -> None:
    advice = Pursuit(CONFIG, WORDS)(scene_at(BEND, (190, 100), (260, 290)))
    assert 0 < advice.advance_mm_s < WORDS.fast_mm_s
    assert advice.why == "a bend ahead"


def test_a_bifurcation_ahead_slows_it_down_even_straight_on() -> None:
    advice = Pursuit(CONFIG, WORDS)(scene_at(FORK, (165, 100), (390, 100)))
    assert (advice.speed, advice.why) == (Speed.MODERATE, "a bifurcation ahead")
    far = Pursuit(CONFIG, WORDS)(scene_at(FORK, (100, 100), (390, 100)))
    assert far.speed is Speed.FAST


def test_a_branch_that_is_too_sharp_is_told_before_the_head_is_there() -> None:
    sharp = replace(FORK, edges=(*FORK.edges[:2], edge(1, 3, line((200, 100), (220, 213)))))
    sharp = replace(sharp, nodes=np.vstack([FORK.nodes[:3], [(220.0, 213.0)]]))
    told = "a branch ahead may turn more sharply than the head bends"
    assert [told in Pursuit(CONFIG, WORDS)(scene_at(sharp, (x, 100), (218, 203))).why for x in (40, 110, 185)] == [
        False,
        True,
        False,
    ]
    assert told not in Pursuit(CONFIG, WORDS)(scene_at(sharp, (110, 100), (390, 100))).why, "straight on"
    assert told not in Pursuit(CONFIG, WORDS, 130.0)(scene_at(sharp, (110, 100), (218, 203))).why, "a head that bends further"


def test_the_more_the_head_must_turn_the_slower_and_never_by_a_jump() -> None:
    errors_deg, speeds = [], []
    for heading in np.arange(0.0, 40.0, 0.25):
        advice = Pursuit(CONFIG, WORDS)(scene_at(STRAIGHT, (100, 100), (380, 100), float(heading)))
        errors_deg.append(abs(advice.steer_deg))
        speeds.append(advice.advance_mm_s)
    small = np.array(errors_deg) < CONFIG.slow_steer_deg
    assert small.any()
    assert np.array(speeds)[small] == pytest.approx(WORDS.fast_mm_s)
    assert (np.diff(speeds) <= 1e-9).all()
    assert np.diff(speeds).min() > -0.1 * WORDS.fast_mm_s
    assert speeds[-1] < WORDS.slow_mm_s


def test_a_head_that_must_turn_far_turns_almost_in_place() -> None:
    advice = Pursuit(CONFIG, WORDS)(scene_at(STRAIGHT, (100, 112), (380, 100), 80.0))
    assert (advice.advance_mm_s, advice.why) == (WORDS.slowest_mm_s, "the head must turn first")


def test_the_nearer_the_target_the_slower_and_there_it_stops() -> None:
    speeds = []
    for x in (340.0, 368.0, 375.0):
        advice = make_policy("pursuit", Config())(scene_at(STRAIGHT, (x, 100), (380, 100)))
        speeds.append(advice.advance_mm_s)
    assert speeds[0] > speeds[1] > speeds[2] == 0.0


def _missing(pursuit: Pursuit, times: int, target: Point = (20, 100), x: float = 200.0) -> list[str]:
    """What is advised while a robot, followed as advised, is past a way that leads back and finds it again `times` times."""
    said, time_s, insertion_mm = [], 0.0, 50.0
    for _ in range(times):
        for turned in (False, True):  # past the branch, then taken back to where the way lies ahead
            for _ in range(60):
                time_s += 0.1
                graph_heading = 180.0 if turned else 0.0
                advice = pursuit(scene_at(STRAIGHT, (x, 100), target, graph_heading, time_s), status(0.0, insertion_mm))
                insertion_mm += 0.1 * advice.advance_mm_s
                said.append(advice.why)
                if turned and not advice.why.startswith("backing off"):
                    break
                if not turned and advice.why.startswith("backing off"):
                    break
    return said


def test_a_branch_that_is_missed_again_and_again_is_given_up_with_a_word() -> None:
    pursuit = Pursuit(CONFIG, WORDS)
    assert "take over" not in " ".join(_missing(pursuit, CONFIG.most_misses - 1))
    last = _missing(pursuit, 1)[-1]
    assert last == f"missed the branch {CONFIG.most_misses} times: take over, or choose another target"
    assert "take over" not in " ".join(_missing(pursuit, 1, target=(30, 100))), "another target is another way"
    pursuit.reset()
    assert "take over" not in " ".join(_missing(pursuit, 1)), "taken over, it may try again"


def test_who_drives_on_by_hand_after_it_gave_up_is_advised_again() -> None:
    pursuit = Pursuit(CONFIG, WORDS)
    assert "take over" in _missing(pursuit, CONFIG.most_misses)[-1]
    said = []
    for k in range(25):
        advice = pursuit(scene_at(STRAIGHT, (200 - k, 100), (20, 100), 180.0, 100.0 + 0.1 * k), status(0.0, 20.0 + 0.3 * k))
        said.append(advice.why)
    assert "take over" in said[5]
    assert "take over" not in said[-1]


def test_after_a_miss_it_turns_into_the_branch_earlier() -> None:
    def asked(pursuit: Pursuit, x: float, time_s: float, insertion_mm: float) -> Advice:
        return pursuit(scene_at(FORK, (x, 100), (300, 200), time_s=time_s), status(0.0, insertion_mm))

    pursuit = Pursuit(CONFIG, WORDS)
    x, time_s, insertion_mm, said = 250.0, 0.0, 50.0, ""
    while not (x < 200.0 and not said.startswith("backing off")):
        advice = asked(pursuit, x, time_s, insertion_mm)
        time_s, said = time_s + 0.1, advice.why
        insertion_mm, x = insertion_mm + 0.1 * advice.advance_mm_s, x + 0.3 * advice.advance_mm_s
        assert time_s < 30.0
    assert asked(pursuit, 186.0, time_s, insertion_mm).steer_deg > 3.0
    assert asked(Pursuit(CONFIG, WORDS), 186.0, time_s, insertion_mm).steer_deg == pytest.approx(0.0, abs=0.5)


def test_a_head_that_is_fed_and_does_not_move_is_taken_back() -> None:
    pursuit = Pursuit(CONFIG, WORDS)
    advised = [pursuit(scene_at(STRAIGHT, (100, 100), (380, 100), time_s=0.1 * k)) for k in range(20)]
    assert [a for a in advised if a is not None and a.advance_mm_s < 0 and "does not move" in a.why]


def _blocked(pursuit: Pursuit, seconds: float, fps: float = 30.0) -> tuple[list[str], list[float]]:
    """What is advised while the head does not move, and how far the robot was fed: by servos that tell of it 50 times a second."""
    said, fed_mm, told, insertion_mm = [], [], status(None, 50.0), 50.0
    for k in range(round(seconds * fps)):
        time_s = 10.0 + k / fps
        if math.floor(time_s / 0.02) * 0.02 > told.time_s:
            told = replace(status(None, insertion_mm), time_s=math.floor(time_s / 0.02) * 0.02)
        advice = pursuit(scene_at(STRAIGHT, (100, 100), (380, 100), time_s=time_s), told)
        insertion_mm += advice.advance_mm_s / fps
        said.append(advice.why)
        fed_mm.append(insertion_mm - 50.0)
    return said, fed_mm


@pytest.mark.parametrize("fps", [20.0, 90.0])
def test_a_head_that_is_blocked_is_not_fed_on_for_ever(fps: float) -> None:
    said, fed_mm = _blocked(Pursuit(CONFIG, WORDS), 60.0, fps=fps)
    assert said[-1] == f"came no farther in {CONFIG.most_tries} tries: take over, or choose another target"
    assert max(fed_mm) < 1.5 * WORDS.fast_mm_s * CONFIG.stuck_s
    assert abs(fed_mm[-1]) < 0.5 * WORDS.fast_mm_s * CONFIG.stuck_s, "what was fed in vain is taken back"


@pytest.mark.parametrize("every_s", [1.4, 5.0])
def test_a_route_that_is_missing_in_single_frames_hides_no_blocked_head(every_s: float) -> None:
    pursuit, fps, insertion_mm, said = Pursuit(CONFIG, WORDS), 30.0, 50.0, []
    for k in range(round(60.0 * fps)):
        scene = scene_at(STRAIGHT, (100, 100), (380, 100), time_s=10.0 + k / fps)
        if k % round(every_s * fps) == 7:
            scene = replace(scene, route=None)
        advice = pursuit(scene, replace(status(None, insertion_mm), time_s=10.0 + k / fps))
        insertion_mm += advice.advance_mm_s / fps
        said.append(advice.why)
    assert said[-1] == f"came no farther in {CONFIG.most_tries} tries: take over, or choose another target"


def test_a_robot_that_cannot_go_back_is_said_to_be_until_it_moves() -> None:
    """Its feed is at the end of its travel: the branch lies behind, and it would be advised to go there for ever."""
    pursuit, said = Pursuit(CONFIG, WORDS), []
    for k in range(200):
        told = replace(status(None, 50.0 if k < 150 else 50.0 - 0.4 * (k - 149)), time_s=0.1 * k)
        advice = pursuit(scene_at(STRAIGHT, (200, 100), (20, 100), time_s=0.1 * k), told)
        said.append((advice.advance_mm_s, advice.why))
    stranded = (0.0, "the robot cannot go back any farther: take over, or choose another target")
    assert stranded not in said[:25]
    assert said[60:150] == [stranded] * 90
    assert said[-1][0] < 0.0


@pytest.mark.parametrize("fed_mm_s", [0.0, 2.0])
def test_an_operator_who_does_not_go_back_is_neither_stranded_nor_misses_anything(fed_mm_s: float) -> None:
    pursuit, said = Pursuit(CONFIG, WORDS), []
    for k in range(300):
        told = replace(status(None, 50.0 + 0.1 * k * fed_mm_s), time_s=0.1 * k)
        advice = pursuit(scene_at(STRAIGHT, (200, 100), (20, 100), time_s=0.1 * k), told, followed=False)
        said.append(advice.why)
    assert set(said[20:]) == {"backing off: the way to the target branches off behind the head"}
    assert pursuit._misses.count == 1


def test_a_miss_counts_once_though_single_frames_see_the_way_ahead() -> None:
    pursuit, said = Pursuit(CONFIG, WORDS), []
    for k in range(300):  # held at rest: nothing goes back, and every 40th frame has the head turned round
        heading = 180.0 if k % 40 == 39 else 0.0
        told = replace(status(None, 50.0), time_s=k / 30)
        advice = pursuit(scene_at(STRAIGHT, (200, 100), (20, 100), heading, k / 30), told, followed=False)
        said.append(advice.why)
    assert pursuit._misses.count == 1
    assert "take over" not in " ".join(said)


def test_another_target_is_another_matter_to_a_robot_that_could_not_go_back() -> None:
    pursuit, said = Pursuit(CONFIG, WORDS), []
    for k in range(100):
        target = (20, 100) if k < 80 else (60, 100)
        advice = pursuit(scene_at(STRAIGHT, (200, 100), target, time_s=0.1 * k), replace(status(None, 50.0), time_s=0.1 * k))
        said.append(advice.why)
    assert "cannot go back" in said[79]
    assert "cannot go back" not in said[85]


def test_after_a_pause_no_single_frame_decides() -> None:
    pursuit = Pursuit(CONFIG, WORDS)
    for k, x in ((0, 100.0), (1, 103.0), (40, 200.0)):  # seen again after a while, far on
        at = replace(status(None, 50.0 + x / 3), time_s=0.1 * k)
        advice = pursuit(scene_at(STRAIGHT, (x, 100), (380, 100), time_s=0.1 * k), at)
        assert advice.advance_mm_s > 0
    behind = pursuit(scene_at(STRAIGHT, (200, 100), (20, 100), time_s=4.4))
    assert "looking again" in behind.why


def test_advice_that_nobody_follows_is_no_stall() -> None:
    pursuit = Pursuit(CONFIG, WORDS)
    advised = [pursuit(scene_at(STRAIGHT, (100, 100), (380, 100), time_s=0.1 * k), status(0.0)) for k in range(60)]
    assert all(a is not None and a.advance_mm_s > 0 for a in advised)


def test_backing_off_that_nobody_follows_is_dropped_when_its_reason_is_gone() -> None:
    pursuit, speeds = Pursuit(CONFIG, WORDS), []
    for k in range(40):  # fed in vain for 1.8 s, then left alone
        told = replace(status(None, 50.0 + 0.6 * min(k, 18)), time_s=0.1 * k)
        advice = pursuit(scene_at(STRAIGHT, (100, 100), (380, 100), time_s=0.1 * k), told)
        speeds.append(advice.advance_mm_s)
    backwards = [speed < 0.0 for speed in speeds]
    assert sum(backwards) > 9
    assert backwards[-5:] == [False] * 5


def test_a_missed_branch_is_backed_out_of_until_it_lies_well_ahead() -> None:
    pursuit = Pursuit(CONFIG, WORDS)
    seen = []
    x = 230.0
    for frame in range(300):
        advice = pursuit(scene_at(FORK, (x, 100), (290, 190), time_s=0.1 * frame))
        seen.append((x, advice.advance_mm_s))
        if advice.advance_mm_s > 0:
            break
        x += 0.3 * advice.advance_mm_s  # 3 px/mm
    assert [speed for _, speed in seen[:3]] == [0.0, 0.0, 0.0]  # first it looks again
    assert seen[4][1] < 0
    assert seen[-1][1] > 0
    assert seen[-1][0] < 190.0


def test_no_pose_no_advice() -> None:
    assert Pursuit(CONFIG, WORDS)(Scene(0, 0.0, (640, 480), 1.0, refusal=Refusal(Reason.NO_ROBOT)), status(0.9)) is None


def test_the_steering_is_smoothed_in_time() -> None:
    pursuit = Pursuit(PursuitConfig(smoothing_s=0.1), WORDS)
    pursuit(scene_at(STRAIGHT, (100, 100), (380, 100)))
    first = pursuit(scene_at(STRAIGHT, (100, 94), (380, 100), time_s=0.1))
    alone = Pursuit(CONFIG, WORDS)(scene_at(STRAIGHT, (100, 94), (380, 100)))
    assert 0 < first.steer_deg < alone.steer_deg


def test_speeds_have_the_papers_words() -> None:
    assert [speed_word(v, WORDS) for v in (0.0, 0.5, 3.4, 4.6, 7.0)] == [
        Speed.STOP, Speed.SLOWEST, Speed.SLOW, Speed.MODERATE, Speed.FAST,
    ]  # fmt: skip


@pytest.mark.parametrize(("ahead_every", "backs_off"), [(3, True), (2, False)])
def test_single_frames_that_see_the_way_ahead_do_not_keep_the_robot_waiting(ahead_every: int, backs_off: bool) -> None:
    policy = Pursuit(PursuitConfig(behind_s=0.3), AdviceConfig())
    speeds = []
    for k in range(16):
        heading = 0.0 if k % ahead_every == ahead_every - 1 else 180.0
        advice = policy(scene_at(STRAIGHT, (200, 100), (380, 100), heading, 0.1 * k), status(0.0))
        speeds.append(advice.advance_mm_s)
    assert (min(speeds) < 0.0) is backs_off


@pytest.mark.parametrize("name", POLICIES.own)
def test_every_policy_stops_at_the_target(name: str) -> None:
    policy = make_policy(name, Config())
    advice = policy(scene_at(STRAIGHT, (375, 100), (380, 100)), status(0.0))
    assert (advice.speed, advice.advance_mm_s, advice.steer_deg) == (Speed.STOP, 0.0, 0.0)


def test_push_never_steers_and_the_random_operator_is_seeded() -> None:
    push = make_policy("push", Config())(scene_at(STRAIGHT, (100, 110), (380, 100), 30))
    assert (push.steer_deg, push.speed) == (0.0, Speed.MODERATE)
    scenes = [scene_at(STRAIGHT, (100, 100), (380, 100), time_s=0.5 * k) for k in range(12)]

    def played(operator: RandomOperator) -> list[object]:
        return [operator(scene) for scene in scenes]

    operator = RandomOperator(Config(), 3)
    first = played(operator)
    operator.reset()
    assert played(operator) == first == played(RandomOperator(Config(), 3))
    assert played(RandomOperator(Config(), 4)) != first
    assert len(set(first)) > 3


def _routes_reported(headings: list[tuple[float, float]], target: Point = (380, 100)) -> list[RouteState]:
    """What is reported of frames at given times whose robot points along given directions."""
    reports = FrameReports(PursuitConfig(behind_s=0.3))
    image = np.zeros((480, 640, 3), np.uint8)
    found = []
    for index, (time_s, heading_deg) in enumerate(headings):
        scene = scene_at(STRAIGHT, (100, 100), target, heading_deg, time_s)
        found.append(reports.report(Frame(index, time_s, image), scene, None, has_target=True).route)
    return found


def test_a_target_is_behind_or_ahead_at_the_first_look() -> None:
    assert _routes_reported([(0.0, 180)]) == [RouteState.BEHIND]
    assert _routes_reported([(0.0, 0)]) == [RouteState.READY]


@pytest.mark.parametrize("first", [0, 180])
def test_a_flicker_of_the_way_changes_nothing_and_a_lasting_change_does(first: int) -> None:
    turned = 180 - first
    headings = [(0.0, first), (0.1, turned), (0.2, turned), (0.25, first), (0.35, turned), (0.45, turned), (0.56, turned)]
    routes = _routes_reported(headings)
    before, after = (RouteState.READY, RouteState.BEHIND) if first == 0 else (RouteState.BEHIND, RouteState.READY)
    assert routes == [before] * 6 + [after]


def test_another_target_is_looked_at_anew() -> None:
    reports = FrameReports(PursuitConfig(behind_s=0.3))
    image = np.zeros((480, 640, 3), np.uint8)
    routes = [
        reports.report(Frame(k, 0.03 * k, image), scene_at(STRAIGHT, (200, 100), target, 0, 0.03 * k), None, has_target=True).route
        for k, target in enumerate([(380.0, 100.0), (20.0, 100.0), (380.0, 100.0)])
    ]
    assert routes == [RouteState.READY, RouteState.BEHIND, RouteState.READY]


def test_a_frame_that_is_refused_says_nothing_of_where_the_target_lies() -> None:
    """With a way, but without an answer: as the first look at it, or for as long as another one would need to count."""
    reports = FrameReports(PursuitConfig(behind_s=0.3))
    image = np.zeros((480, 640, 3), np.uint8)
    told = []
    for index, is_refused in enumerate([True, False, *[True] * 5, False, False]):
        scene = scene_at(STRAIGHT, (100, 100), (380, 100), 180, 0.1 * index)
        if is_refused:
            scene = replace(scene, pose=None, refusal=Refusal(Reason.LOW_CONFIDENCE))
        told.append(reports.report(Frame(index, 0.1 * index, image), scene, None, has_target=True).route)
    assert told == [RouteState.NONE, RouteState.BEHIND, *[RouteState.NONE] * 5, RouteState.BEHIND, RouteState.BEHIND]


def test_an_unsure_pose_changes_nothing_of_where_the_target_lies_and_is_no_first_look_at_another_one() -> None:
    reports = FrameReports(PursuitConfig(behind_s=0.25), min_confidence=0.5)
    image, ahead, back = np.zeros((480, 640, 3), np.uint8), (380.0, 100.0), (20.0, 100.0)
    told = []
    looks = [(ahead, 0, 0.9), *[(ahead, 180, 0.4)] * 5, *[(ahead, 180, 0.9)] * 3, (back, 0, 0.4), (back, 0, 0.9), (ahead, 180, 0.4)]
    for index, (target, heading_deg, confidence) in enumerate(looks):
        scene = scene_at(STRAIGHT, (200, 100), target, heading_deg, 0.1 * index)
        assert scene.pose is not None
        scene = replace(scene, pose=replace(scene.pose, confidence=confidence))
        told.append(reports.report(Frame(index, 0.1 * index, image), scene, None, has_target=True).route)
    assert told[:9] == [RouteState.READY] * 8 + [RouteState.BEHIND], "the time of unsure ones does not count"
    assert told[9:] == [RouteState.READY, RouteState.BEHIND, RouteState.READY]


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
