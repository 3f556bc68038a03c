"""The situations of METHOD section 4, each with a robot drawn where its path is known."""

import math

import cv2
import numpy as np
import pytest

from core import geometry
from core.config.models import PathConfig, PerceptionConfig, QualityConfig, load_config
from core.perception import robot_path, segmentation, skeleton
from core.perception.head_tail import PreviousPath
from core.perception.robot_path import consistency, explore, score, smoothness
from core.perception.skeleton import trace
from core.perception.vectors import fit_robot_vector
from core.perception.vessel_graph import build_graph
from core.types import Mask, Masks, Point, Points, Reason, Refusal, RobotPath, VesselGraph
from tests.core.drawing import SIZE, curve, depth, everywhere, probability

CONFIG = PerceptionConfig()
S_CURVE = curve((-20, 240), (120, 200), (260, 260), (400, 210))
HEAD = (400.0, 210.0)


def perceive(
    robot: np.ndarray,
    vessel: np.ndarray | None = None,
    config: PerceptionConfig = CONFIG,
    port: Point | None = None,
    before: PreviousPath = PreviousPath(),  # noqa: B008
) -> RobotPath | Refusal:
    """The stages before and the path, as the pipeline calls them."""
    found: Masks = segmentation.clean(everywhere() if vessel is None else vessel, robot, config)
    skeletons = skeleton.repair(skeleton.thin_masks(found, config), config.gaps)
    graph: VesselGraph | None = None
    if vessel is not None:
        graph = build_graph(skeletons.vessel, found.vessel, config.cleaning)
    return robot_path.find(skeletons, found, config, vessel=graph, port=port, before=before)


def path_of(robot: np.ndarray, **more: object) -> RobotPath:
    path = perceive(robot, **more)
    assert isinstance(path, RobotPath), str(path)
    return path


def reason_of(robot: np.ndarray, **more: object) -> Reason:
    refusal = perceive(robot, **more)
    assert refusal.detail
    return refusal.reason


def without(robot: np.ndarray, *discs: tuple[float, float, float]) -> np.ndarray:
    torn = robot.copy()
    for x, y, radius in discs:
        cv2.circle(torn, (round(x), round(y)), round(radius), 0.0, -1)
    return torn


def off(path: RobotPath, line: Points) -> float:
    """Largest distance of the found path to the true one."""
    return max(geometry.nearest(line, (float(x), float(y)))[0] for x, y in path.points)


def turned(angle_deg: float, line: Points) -> Points:
    angle = np.radians(angle_deg)
    middle = np.array(SIZE) / 2
    return (line - middle) @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) + middle


def test_a_whole_robot_to_a_fraction_of_a_pixel() -> None:
    path = path_of(probability(depth(S_CURVE, 4.0)))
    assert path.head == pytest.approx(HEAD, abs=0.5)
    assert path.tail[0] < 3.0
    assert off(path, S_CURVE) < 0.8
    assert path.entry_on_border
    assert path.bridged_px == 0.0
    assert path.radius_px == pytest.approx(4.0, abs=0.5)
    assert path.runner_up is None


@pytest.mark.parametrize("radius", [2.0, 3.0, 5.0, 7.0])
@pytest.mark.parametrize("angle_deg", [0, 75, 160, 310])
def test_head_and_direction_of_any_robot_in_any_direction(radius: float, angle_deg: float) -> None:
    line = turned(angle_deg, curve((120, 240), (240, 225), (330, 250), (400, 300)))
    previous = RobotPath(line, 1.0, None, False, 0.0, radius)  # tells head from tail: neither is at the border
    path = path_of(probability(depth(line, radius)), before=PreviousPath(previous))
    assert path.head == pytest.approx(tuple(line[-1]), abs=0.8)
    found, true = fit_robot_vector(path.points, 40.0), fit_robot_vector(line, 40.0)
    cosine = float(np.dot(found.direction, true.direction))
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 1.0


def test_several_breaks_are_bridged() -> None:
    robot = without(probability(depth(S_CURVE, 4.0)), (80, 209, 10), (200, 235, 12), (330, 250, 9))
    path = path_of(robot)
    assert path.head == pytest.approx(HEAD, abs=0.8)
    assert path.tail[0] < 3.0


@pytest.mark.parametrize(("cut_px", "ends_at"), [(2, HEAD[0]), (6, 393.5)])
def test_a_tip_that_a_narrow_cut_parts_from_the_robot_is_its_tip(cut_px: int, ends_at: float) -> None:
    robot = probability(depth(S_CURVE, 2.5))
    robot[:, 394 : 394 + cut_px] = 0.1  # what is beyond is as small as specks, which cleaning takes away
    assert path_of(robot).head[0] == pytest.approx(ends_at, abs=1.0)


@pytest.mark.parametrize(
    ("pieces", "length_px"),
    [
        ([], 9.5),
        ([(13, 22, 0.9)], 21.5),
        ([(13, 22, 0.55)], 9.5),  # not sure enough
        ([(17, 22, 0.9)], 9.5),  # too far
        ([(14, 29, 0.65)], 9.5),  # too long to be missing in the mask
        ([(14, 16, 0.7), (20, 22, 0.7), (26, 28, 0.7)], 9.5),
        ([(8, 10, 0.4), (30, 34, 0.9)], 9.0),  # the mask is larger than what is likely
    ],
)
def test_only_a_small_near_sure_piece_beyond_the_mask_belongs_to_the_end(
    pieces: list[tuple[int, int, float]], length_px: float
) -> None:
    probability, mask = np.full((20, 60), 0.02, np.float32), np.zeros((20, 60), bool)
    probability[8:12, :10], mask[8:12, :10] = 0.95, True
    for first, end, value in pieces:
        probability[8:12, first:end] = value
    places = np.array([[x, 9.5] for x in range(40)], float)
    assert robot_path.edge_distance(places, mask, probability) == pytest.approx(length_px, abs=0.1)


def test_a_gap_too_long_to_bridge_is_no_reason_to_put_the_head_there() -> None:
    robot = without(probability(depth(S_CURVE, 4.0)), (270, 261, 35))
    assert reason_of(robot) is Reason.GAP_TOO_LONG


@pytest.mark.parametrize("side", [(230, 200), (160, 260), (330, 210), (380, 250)])
def test_side_branches_are_left_aside(side: tuple[float, float]) -> None:
    foot = geometry.nearest(S_CURVE, side)[2]
    branch = geometry.resample(np.array([foot, side]), 1.0)
    path = path_of(probability(depth(S_CURVE, 4.0), depth(branch, 3.0)))
    assert path.head == pytest.approx(HEAD, abs=1.0)
    assert path.tail[0] < 3.0


def test_outlier_segments_are_left_aside() -> None:
    lines = ([[500.0, 60.0], [540.0, 90.0]], [[60.0, 400.0], [95.0, 400.0]], [[300.0, 30.0], [300.0, 70.0]])
    outliers = [depth(np.array(line), 3.0) for line in lines]
    path = path_of(probability(depth(S_CURVE, 4.0), *outliers))
    assert path.head == pytest.approx(HEAD, abs=0.5)


def test_an_outlier_at_the_border_does_not_win_by_being_short_and_straight() -> None:
    outlier = depth(np.array([[560.0, 100.0], [645.0, 100.0]]), 3.0)
    path = path_of(probability(depth(S_CURVE, 4.0), outlier))
    assert path.head == pytest.approx(HEAD, abs=0.5)


def test_a_cable_outside_the_vessel_is_no_robot() -> None:
    vessel = probability(depth(S_CURVE, 30.0))
    cable = depth(np.array([[-5.0, 440.0], [645.0, 400.0]]), 4.0)
    path = path_of(probability(depth(S_CURVE, 4.0), cable), vessel=vessel)
    assert path.head == pytest.approx(HEAD, abs=0.5)


def test_a_loop_in_the_mask_is_passed_on_one_side() -> None:
    robot = without(probability(np.maximum(depth(S_CURVE, 4.0), depth(S_CURVE[150:220], 14.0))), (198, 234, 9))
    assert not segmentation.clean(everywhere(), robot, CONFIG).robot[234, 198]  # larger than the holes that cleaning fills
    path = path_of(robot)
    assert path.head == pytest.approx(HEAD, abs=0.5)
    assert geometry.arc_length(path.points)[-1] == pytest.approx(geometry.arc_length(S_CURVE)[-1] - 20, rel=0.05)


def test_a_robot_that_crosses_itself_is_followed_straight_through() -> None:
    line = curve((-20, 300), (150, 280), (320, 200), (330, 90), (220, 70), (190, 180), (260, 320), (340, 400))
    path = path_of(probability(depth(line, 4.0)))
    assert path.head == pytest.approx((340, 400), abs=1.0)
    assert off(path, line) < 2.0
    assert geometry.arc_length(path.points)[-1] == pytest.approx(geometry.arc_length(line)[-1] - 20, rel=0.03)


def test_a_robot_that_enters_at_the_port_inside_the_image() -> None:
    line = curve((120, 240), (240, 225), (330, 250), (400, 300))
    robot = probability(depth(line, 4.0))
    path = path_of(robot, port=(122.0, 236.0))
    assert path.head == pytest.approx((400, 300), abs=0.8)
    assert path.entry_on_border
    assert path_of(robot, port=(400.0, 300.0)).head == pytest.approx((120, 240), abs=0.8)


def test_without_port_the_end_at_the_end_of_the_vessel_is_the_tail() -> None:
    vessel = curve((100, 240), (240, 230), (400, 250), (560, 300))
    robot = probability(depth(vessel[20:250], 4.0))
    assert path_of(robot, vessel=probability(depth(vessel, 20.0))).head == pytest.approx(tuple(vessel[249]), abs=1.0)
    backwards = probability(depth(vessel[-260:-20], 4.0))
    assert path_of(backwards, vessel=probability(depth(vessel, 20.0))).head == pytest.approx(tuple(vessel[-260]), abs=1.0)


def test_a_head_that_stops_short_of_the_border_is_the_head_of_a_robot_from_outside_the_vessel() -> None:
    vessel = probability(depth(curve((180, 240), (300, 240), (700, 240)), 22.0))
    for head_x in (610.0, 634.0):  # far from the border, and 5 px from it
        path = path_of(probability(depth(curve((60, 240), (300, 243), (head_x, 240)), 4.0)), vessel=vessel)
        assert path.head[0] == pytest.approx(head_x, abs=2.0)
        assert not path.entry_on_border
    # A robot that meets the border comes from there, even if the vessel was not seen around its other end.
    robot = probability(depth(curve((60, 240), (300, 243), (660, 240)), 4.0))
    assert path_of(robot, vessel=vessel).tail[0] > 630.0


def test_the_end_outside_the_vessel_is_the_tail() -> None:
    vessel = curve((200, 240), (300, 230), (400, 250), (560, 300))
    robot = probability(depth(np.concatenate([[[120.0, 300.0]], vessel[:180]]), 4.0))
    assert path_of(robot, vessel=probability(depth(vessel, 20.0))).head == pytest.approx(tuple(vessel[179]), abs=1.0)


def test_the_end_nearer_along_the_vessel_to_its_only_opening_is_the_tail() -> None:
    """An arch that begins at the left border: the head lies nearer to the opening than the tail, but not along the vessel."""
    angles = np.linspace(0.5 * np.pi, -1.2 * np.pi, 160)[:, None]
    arch = np.concatenate([[[-10.0, 400.0]], np.hstack([330 + 130 * np.cos(angles), 270 + 130 * np.sin(angles)])])
    vessel, part = probability(depth(arch, 18.0)), arch[55:130]
    robot = probability(depth(part, 4.0), depth(part[-25:], 6.0))  # its head's end is the thicker one
    assert path_of(robot, vessel=vessel).head == pytest.approx(tuple(part[-1]), abs=4.0)


def test_the_thicker_end_is_the_tail_where_nothing_else_tells() -> None:
    line = np.array([[150.0, 240.0], [450.0, 240.0]])
    robot = probability(depth(line, 4.0), depth(line[:1] + [[0.0, 0.0], [120.0, 0.0]], 7.0))
    assert path_of(robot).head == pytest.approx((450, 240), abs=1.0)
    assert path_of(np.ascontiguousarray(robot[:, ::-1])).head == pytest.approx((189, 240), abs=1.0)


def test_two_robots_are_refused() -> None:
    second = curve((660, 380), (520, 400), (380, 360), (300, 400))
    assert reason_of(probability(depth(S_CURVE, 4.0), depth(second, 4.0))) is Reason.SEVERAL_ROBOTS


VESSELS = probability(
    depth(S_CURVE, 30.0), depth(curve((-60, 390), (330, 420), (700, 380)), 15.0), depth(curve((200, 60), (480, 60)), 30.0)
)
"""Three tubes: two that come in from the border, the robot in one of them, and one that begins and ends in the picture."""
GLINT = curve((80, 402), (330, 420), (400, 420))


def with_line(line: Points, sureness: float) -> np.ndarray:
    """The robot, and a line that the network is less sure of."""
    return np.maximum(probability(depth(S_CURVE, 4.0)), sureness * probability(depth(line, 3.0)))


@pytest.mark.parametrize(
    "line",
    [curve((72, 400), (330, 420), (566, 400)), curve((205, 60), (475, 62))],
    ids=["longer than the robot", "at the ends of its tube"],
)
def test_a_doubtful_line_that_comes_in_from_nowhere_is_no_robot_however_long(line: Points) -> None:
    path = path_of(with_line(line, 0.9), vessel=VESSELS)
    assert path.head == pytest.approx(HEAD, abs=0.8)
    assert path.entry_on_border


@pytest.mark.parametrize(
    ("line", "sureness"),
    [
        (GLINT, 0.99),  # as sure as of the robot: a part of it that comes out again from behind something
        (curve((-20, 393), (330, 420), (400, 420)), 0.9),  # comes in at the border
        (curve((30, 320), (120, 400), (330, 420), (400, 420)), 0.9),  # comes in from outside the tubes
    ],
    ids=["sure", "border", "outside"],
)
def test_what_may_be_a_robot_too_is_still_several(line: Points, sureness: float) -> None:
    assert reason_of(with_line(line, sureness), vessel=VESSELS) is Reason.SEVERAL_ROBOTS


def test_a_bit_at_the_border_does_not_depose_a_robot_whose_entry_is_hidden() -> None:
    """The end of a cable, or a reflection, of which the network is surer than of a robot in a milky tube."""
    line = curve((150, 410), (330, 420), (560, 395))
    vessel = probability(depth(curve((40, 400), (330, 420), (700, 380)), 30.0), depth(curve((-60, 100), (300, 100)), 20.0))
    bit = probability(depth(np.array([[-20.0, 100.0], [30.0, 100.0]]), 3.0))
    robot = np.maximum(0.93 * probability(depth(line, 4.0)), bit)
    path = path_of(robot, vessel=vessel)
    assert {round(path.head[0], -1), round(path.tail[0], -1)} == {150.0, 560.0}


def test_what_was_the_robot_in_the_last_frame_is_no_reflection() -> None:
    line = GLINT
    before = RobotPath(line, 1.0, None, False, 0.0, 3.0)
    assert isinstance(perceive(with_line(line, 0.9), vessel=VESSELS), RobotPath)
    refusal = perceive(with_line(line, 0.9), vessel=VESSELS, before=PreviousPath(before))
    assert refusal.reason is Reason.SEVERAL_ROBOTS


def test_a_doubtful_line_ahead_of_the_head_may_be_its_end() -> None:
    ahead = curve((480, 172), (560, 130))
    vessel = probability(depth(np.vstack([S_CURVE, ahead]), 30.0))
    assert reason_of(with_line(ahead, 0.9), vessel=vessel) is Reason.GAP_TOO_LONG


def test_of_lines_that_all_come_in_from_nowhere_none_is_known_to_be_no_robot() -> None:
    """An opaque fitting hides where the robot comes in: one of them is it."""
    line, other = curve((160, 240), (300, 250), (420, 215)), curve((150, 410), (330, 420), (560, 395))
    robot = np.maximum(probability(depth(line, 4.0)), 0.9 * probability(depth(other, 3.0)))
    vessel = probability(
        depth(curve((60, 240), (300, 250), (560, 180)), 30.0), depth(curve((60, 400), (330, 420), (630, 390)), 30.0)
    )
    assert reason_of(robot, vessel=vessel) is Reason.SEVERAL_ROBOTS


def test_a_robot_from_border_to_border_shows_no_head() -> None:
    through = curve((-20, 240), (200, 200), (420, 260), (660, 220))
    robot = probability(depth(through, 4.0))
    assert reason_of(robot) is Reason.AMBIGUOUS_PATH
    before = RobotPath(through[20:-40], 1.0, None, True, 0.0, 4.0)
    assert path_of(robot, before=PreviousPath(before)).head[0] > 600  # the last frame knows which end is the head


def test_the_last_frame_decides_between_nearly_equal_branches() -> None:
    up, down = curve((-20, 240), (200, 240), (300, 200), (380, 160)), curve((-20, 240), (200, 240), (300, 280), (380, 320))
    fork = probability(depth(up, 4.0), depth(down, 4.0))
    for line in (up, down):
        before = RobotPath(line[:-10], 1.0, None, True, 0.0, 4.0)
        assert path_of(fork, before=PreviousPath(before)).head == pytest.approx(tuple(line[-1]), abs=1.0)
    assert path_of(fork).runner_up is not None


def test_a_head_that_lies_against_the_body_is_still_found() -> None:
    lasso = curve((-20, 300), (150, 300), (320, 250), (340, 130), (240, 110), (190, 200), (215, 287))
    path = path_of(probability(depth(lasso, 4.0)))
    assert path.tail[0] < 3.0
    assert geometry.nearest(lasso, path.head)[0] < 10.0


def test_too_little_to_be_a_robot() -> None:
    assert reason_of(probability(depth(np.array([[300.0, 200.0], [309.0, 200.0]]), 4.0))) is Reason.TOO_SHORT
    blob = np.zeros((SIZE[1], SIZE[0]), np.float32)
    cv2.circle(blob, (300, 200), 5, 1.0, -1)
    assert reason_of(blob) is Reason.NO_ROBOT


def test_the_papers_form_is_reached_by_configuration() -> None:
    paper = load_config(preset="paper").perception
    assert paper.path.cosine == "absolute"
    path = path_of(probability(depth(S_CURVE, 4.0)), config=paper)
    steps = np.abs(np.diff(path.points, axis=0))
    assert steps.max() <= 1.0  # pixels, as they are
    assert 1.0 < np.hypot(path.head[0] - HEAD[0], path.head[1] - HEAD[1]) < 6.0  # thinning stops a radius short of the head


def test_the_papers_score_chooses_among_all_pieces() -> None:
    straight = depth(np.array([[560.0, 100.0], [645.0, 100.0]]), 3.0)
    robot = probability(depth(S_CURVE, 4.0), straight)
    literal = PerceptionConfig(path=PathConfig(outlier_share=0.0))
    assert path_of(robot, config=literal).head[0] > 550  # shorter and straighter: why outliers are put aside before scoring


@pytest.mark.parametrize(("row", "off_px"), [(6.0, 0.05), (4.0, 0.2), (3.0, 0.6)])
def test_a_robot_beside_the_border_is_not_drawn_out_of_the_picture(row: float, off_px: float) -> None:
    whatever_it_is = PerceptionConfig(quality=QualityConfig(enabled=False))
    line = np.array([[-20.0, 60.0], [60.0, 60.0], [120.0, row], [300.0, row]])
    path = path_of(probability(depth(line, 4.0)), config=whatever_it_is)
    assert path.head == pytest.approx((300.0, row), abs=0.5 + off_px)
    assert path.points[-20:, 1] == pytest.approx(row, abs=off_px)


def test_in_a_stream_a_head_that_reaches_the_border_stays_the_head() -> None:
    vessel = probability(depth(curve((100, 240), (300, 240), (660, 240)), 22.0))
    path: RobotPath | None = None
    for head_x in (610.0, 620.0, 630.0, 637.0):  # the tail lies in the picture, where an opaque fitting ends
        robot = probability(depth(curve((110, 240), (300, 243), (head_x, 240)), 4.0))
        path = path_of(robot, vessel=vessel, before=PreviousPath(path))
        assert path.head[0] == pytest.approx(head_x, abs=2.0)
        assert path.tail[0] == pytest.approx(110.0, abs=2.0)


def test_in_a_stream_a_tail_that_comes_into_view_at_the_border_is_the_tail() -> None:
    line = curve((-20, 240), (300, 243), (420, 240))
    whole, torn = probability(depth(line, 4.0)), probability(depth(curve((120, 241), (300, 243), (420, 240)), 4.0))
    swapped = path_of(torn)
    before = RobotPath(swapped.points if swapped.head[0] < 200 else swapped.points[::-1], 1.0, None, False, 0.0, 4.0)
    assert path_of(whole, before=PreviousPath(before)).head[0] > 400


def test_in_a_stream_a_wrong_head_beside_the_border_is_mended_when_it_shows_to_be_the_entry() -> None:
    vessel = probability(depth(curve((-20, 240), (300, 240), (660, 240)), 22.0))
    line = curve((9, 240), (150, 243), (300, 240))
    before = RobotPath(line[::-1], 1.0, None, False, 0.0, 4.0)
    path = path_of(probability(depth(curve((-20, 240), (150, 243), (300, 240)), 4.0)), vessel=vessel, before=PreviousPath(before))
    assert path.head[0] == pytest.approx(300.0, abs=2.0)


CORNER = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
HAIRPIN = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [10.0, 0.0], [0.0, 0.0]])


def test_a_right_angle_by_hand() -> None:
    assert smoothness(CORNER, "signed") == pytest.approx(0.0)
    assert consistency(CORNER, "signed") == pytest.approx(math.cos(math.radians(45)))


def test_the_papers_absolute_cosine_is_blind_to_a_hairpin_and_ours_is_not() -> None:
    assert smoothness(HAIRPIN, "absolute") == pytest.approx(1.0)
    assert smoothness(HAIRPIN, "signed") == pytest.approx((1 - 1 + 1) / 3)


def test_the_score_is_the_papers_weighted_sum() -> None:
    config = PathConfig(weight_length=-0.2, weight_smoothness=2.0, weight_consistency=0.5, step_px=1.0, cosine="absolute")
    assert score(CORNER, 0.5, config) == pytest.approx(-0.2 * 0.5 + 2.0 * 0.0 + 0.5 * math.cos(math.radians(45)))


def drawn_skeleton(*lines: tuple[int, int, int, int]) -> Mask:
    import cv2

    drawn = np.zeros((120, 240), np.uint8)
    for x1, y1, x2, y2 in lines:
        cv2.line(drawn, (x1, y1), (x2, y2), 1)
    return drawn.view(bool)


def trails_from(mask: Mask, start: tuple[int, int], config: PathConfig) -> list[tuple[int, int]]:
    graph = trace(mask)
    node = int(np.argmin(np.hypot(*(graph.nodes - start).T)))
    return [tuple(int(v) for v in trail.points[-1]) for trail in explore(graph, node, config)]


def test_all_branches_are_explored_longest_first() -> None:
    tree = drawn_skeleton((10, 60, 200, 60), (80, 60, 80, 20), (140, 60, 140, 100))
    assert trails_from(tree, (10, 60), PathConfig(junction_turn_px=0)) == [(200, 60), (140, 100), (80, 20)]


def test_a_turn_at_a_junction_costs_length() -> None:
    t = drawn_skeleton((10, 60, 120, 60), (100, 60, 100, 25))  # 35 px to the side against 20 px straight on
    assert trails_from(t, (10, 60), PathConfig(junction_turn_px=0))[0] == (100, 25)
    assert trails_from(t, (10, 60), PathConfig(junction_turn_px=40))[0] == (120, 60)


def test_no_chain_is_used_twice_but_a_crossing_may_be_passed_twice() -> None:
    loop = drawn_skeleton((10, 60, 180, 60), (180, 60, 180, 20), (180, 20, 100, 20), (100, 20, 100, 110))
    graph = trace(loop)
    ends = np.flatnonzero(graph.degrees() == 1)
    start = ends[np.argmin(graph.nodes[ends][:, 0])]
    best = explore(graph, int(start), PathConfig())[0]
    assert best.points[-1].tolist() == [100, 110]
    assert best.length_px == pytest.approx(170 + 40 + 80 + 90, abs=6)


def test_without_another_end_the_way_around_the_loop_is_given() -> None:
    lasso = drawn_skeleton((10, 60, 100, 60), (100, 60, 140, 20), (140, 20, 180, 60), (180, 60, 140, 100), (140, 100, 100, 60))
    assert len(trails_from(lasso, (10, 60), PathConfig())) == 2


def test_the_number_of_chains_walked_is_limited() -> None:
    ladder = drawn_skeleton((5, 40, 235, 40), (5, 80, 235, 80), *((x, 40, x, 80) for x in range(20, 230, 10)))
    graph = trace(ladder)
    start = int(np.flatnonzero(graph.degrees() == 1)[0])
    assert explore(graph, start, PathConfig(), budget=3) == []
    assert len(explore(graph, start, PathConfig(), budget=60)) < 20
