"""The robot as the difference to the empty bench: light, shadows, and foreign objects are not taken for it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.bench.bench import Bench, BenchError, bench_from_pictures
from core.bench.difference import (
    Difference,
    beside_network,
    check_without_robot,
    combined,
    disagreement,
    robot_by_difference,
    without_rim,
)
from core.bench.registration import BenchView, register
from core.types import Image, Mask
from tests.core.bench.drawn_bench import SIZE, board, noisy, tube, with_line


@pytest.fixture(scope="module")
def bench() -> Bench:
    return bench_from_pictures([noisy(board(), 2.0, 1), noisy(board(), 2.0, 2)], tube(), "b", 320)


def found(image: Image, bench: Bench) -> Difference:
    view = register(image, bench)
    assert isinstance(view, BenchView), view
    return robot_by_difference(image, view)


def line(start: tuple[int, int], end: tuple[int, int], width: int = 7) -> Mask:
    return cv2.line(np.zeros((SIZE[1], SIZE[0]), np.uint8), start, end, 1, width) > 0


def dice(one: Mask, other: Mask) -> float:
    return 2.0 * float(np.sum(one & other)) / max(1.0, float(one.sum() + other.sum()))


ROBOT = ((0, 122), (200, 130))


@pytest.mark.parametrize("color", [(20, 20, 20), (250, 250, 250), (200, 40, 40), (40, 60, 200)])
def test_a_robot_of_any_color_is_found(bench: Bench, color: tuple[int, int, int]) -> None:
    image = noisy(with_line(board(), *ROBOT, color), 2.0, 3)
    assert dice(found(image, bench).probability >= 0.5, line(*ROBOT)) > 0.9


def test_an_empty_bench_has_no_robot(bench: Bench) -> None:
    for gain, sigma in ((1.0, 2.0), (0.8, 2.0), (1.15, 6.0)):
        assert not (found(noisy(board(), sigma, 4, gain), bench).probability >= 0.5).any()


def test_a_robot_is_found_in_the_noise_of_a_dark_room() -> None:
    dark = bench_from_pictures([noisy(board(), 14.0, seed) for seed in range(8)], tube(), "b", 320)
    image = noisy(with_line(board(), *ROBOT, (130, 130, 130)), 14.0, 9)
    difference, view = found(image, dark), register(image, dark)
    assert dice(difference.probability >= 0.5, line(*ROBOT)) > 0.9
    network = np.where(line(*ROBOT) | line((280, 20), (300, 20)), np.float32(0.9), np.float32(0.1))
    assert ((combined(network, difference, view) >= 0.5) == line(*ROBOT)).all(), "the network's outline, where the robot is"
    assert not (found(noisy(board(), 14.0, 10), dark).probability >= 0.5).any()


def test_a_shadow_across_the_vessel_is_no_robot(bench: Bench) -> None:
    shade = np.ones((SIZE[1], SIZE[0], 3), np.float32)
    shade[:, 150:] = 0.7
    shade = cv2.GaussianBlur(shade, (0, 0), 3.0)
    image = noisy(np.rint(with_line(board(), *ROBOT) * shade).astype(np.uint8), 2.0, 3)
    assert dice(found(image, bench).probability >= 0.5, line(*ROBOT)) > 0.85


@pytest.mark.parametrize("width", [5, 9])
def test_a_cable_across_the_vessel_is_left_to_the_network(bench: Bench, width: int) -> None:
    crossing = ((60, 0), (140, 239))
    image = noisy(with_line(board(), *crossing, width=width), 2.0, 3)
    difference = found(image, bench)
    assert not (difference.probability >= 0.5).any()
    within = tube() & line(*crossing, width=width)
    assert difference.unusable[within].all()
    assert difference.doubtful[within].all()
    view = register(image, bench)
    nothing = np.zeros(tube().shape, np.float32)
    assert not combined(nothing, difference, view).any()
    assert (combined(nothing + np.float32(0.9), difference, view)[within] == np.float32(0.9)).all()


def test_a_cable_beside_the_vessel_is_no_robot_and_no_background(bench: Bench) -> None:
    image = noisy(with_line(with_line(board(), *ROBOT), (20, 220), (300, 200)), 2.0, 3)
    difference = found(image, bench)
    assert dice(difference.probability >= 0.5, line(*ROBOT)) > 0.9
    assert difference.doubtful[line((40, 218), (280, 202), 3)].mean() > 0.9


def test_a_bubble_is_no_robot(bench: Bench) -> None:
    image = cv2.circle(with_line(board(), *ROBOT), (270, 128), 6, (255, 255, 255), cv2.FILLED)
    assert not (found(noisy(np.asarray(image, np.uint8), 2.0, 3), bench).probability[118:138, 255:285] >= 0.5).any()


def test_what_lay_on_the_empty_bench_and_is_gone_is_no_robot() -> None:
    with_fitting = cv2.rectangle(board(), (240, 100), (246, 150), (90, 90, 80), 2)
    bench = bench_from_pictures([noisy(np.asarray(with_fitting, np.uint8), 2.0, 1)], tube(), "b", 320)
    robot = found(noisy(with_line(board(), (0, 122), (243, 130)), 2.0, 3), bench).probability >= 0.5
    assert dice(robot, line((0, 122), (243, 130))) > 0.9
    assert not robot[100:116, 235:252].any()


def test_the_way_from_the_vessels_end_to_the_border_may_hold_the_robot() -> None:
    vessel = tube() & (np.arange(SIZE[0]) > 60)[None]
    bench = bench_from_pictures([noisy(board(), 2.0, 1)], vessel, "b", 320)
    image = noisy(with_line(board(), *ROBOT), 2.0, 3)
    assert dice(found(image, bench).probability >= 0.5, line(*ROBOT)) > 0.9


def test_a_robot_in_the_empty_picture_is_named(bench: Bench) -> None:
    robot = line(*ROBOT).astype(np.float32)
    frames = [noisy(with_line(board(), (0, 114), (x, 116)), 2.0, x) for x in (40, 90, 140)]
    with_robot = bench_from_pictures([noisy(with_line(board(), *ROBOT), 2.0, 1)], tube(), "b", 320)
    with pytest.raises(BenchError, match="robot lies in the empty picture"):
        check_without_robot(with_robot, robot, frames)
    check_without_robot(bench, robot, frames)  # what the network sees there has not moved: no robot
    with pytest.raises(BenchError, match="differ along the vessel"):
        bench_from_pictures([noisy(board(), 2.0, 1), noisy(with_line(board(), *ROBOT), 2.0, 2)], tube(), "b", 320)


def test_a_lamps_reflection_is_left_to_the_network(bench: Bench) -> None:
    image = cv2.circle(with_line(board(), *ROBOT), (260, 126), 14, (255, 255, 255), cv2.FILLED)
    image = noisy(np.asarray(image, np.uint8), 2.0, 3)
    view = register(image, bench)
    difference = robot_by_difference(image, view)
    assert not (difference.probability[100:150, 240:280] >= 0.5).any()
    assert difference.doubtful[126, 260]
    network = np.zeros(difference.probability.shape, np.float32)
    network[120:132, 250:270] = 0.9
    both = combined(network, difference, view)
    assert both[126, 260] == np.float32(0.9)
    assert (both[line((20, 123), (180, 129), 5)] >= 0.5).mean() > 0.9


def test_the_network_adds_what_differs_a_little_beside_the_difference(bench: Bench) -> None:
    faint = tuple(int(level) - 14 for level in board()[130, 100])  # one side of the robot nearly looks like the bench
    image = noisy(with_line(with_line(board(), (0, 127), (200, 135), faint), *ROBOT), 2.0, 3)
    view = register(image, bench)
    difference = robot_by_difference(image, view)
    side = line((20, 129), (180, 136), 1)
    assert (difference.probability[side] >= 0.5).mean() < 0.3
    robot = combined(np.full(difference.probability.shape, 0.97, np.float32), difference, view)
    assert (robot[side] >= 0.5).mean() > 0.7
    assert robot[60, 160] == 0.0
    unknown = replace(view, known=np.zeros_like(view.known))
    assert (combined(np.full(difference.probability.shape, 0.9, np.float32), difference, unknown) == np.float32(0.9)).all()


def test_a_blurred_rim_is_no_robot_even_where_the_network_sees_one(bench: Bench) -> None:
    image = noisy(with_line(board(), *ROBOT), 2.0, 3)
    view = register(image, bench)
    difference = robot_by_difference(image, view)
    robot = combined(np.full(difference.probability.shape, 0.7, np.float32), difference, view)
    assert dice(robot >= 0.5, line(*ROBOT)) > 0.9


@pytest.mark.parametrize("color", [(128, 174, 220), (137, 176, 215)])
def test_an_end_of_another_color_belongs_to_the_robot(bench: Bench, color: tuple[int, int, int]) -> None:
    image = with_line(with_line(board(), (194, 130), (204, 130), color), (0, 122), (192, 130))
    difference = found(noisy(np.asarray(cv2.GaussianBlur(image, (0, 0), 0.8), np.uint8), 2.0, 3), bench)
    columns = np.flatnonzero((difference.probability >= 0.5).any(axis=0))
    assert 205 <= columns[-1] <= 209  # the line's end is round


def test_a_mark_beside_the_robot_is_no_end_of_it(bench: Bench) -> None:
    image = with_line(with_line(board(), (100, 136), (108, 136), (170, 90, 60)), *ROBOT, (250, 250, 250))
    difference = found(noisy(image, 2.0, 3), bench)
    assert dice(difference.probability >= 0.5, line(*ROBOT)) > 0.9


@pytest.mark.parametrize(("band_px", "gap_px"), [(30, 14), (10, 14)])
def test_bands_that_look_like_the_bench_belong_to_the_robot(bench: Bench, band_px: int, gap_px: int) -> None:
    columns = np.arange(SIZE[0])
    is_seen = (columns < 40) | ((columns - 40) % (band_px + gap_px) >= gap_px)
    image = np.where(is_seen[None, :, None], with_line(board(), *ROBOT), board()).astype(np.uint8)
    robot = found(noisy(image, 2.0, 3), bench).probability >= 0.5
    seen = line(*ROBOT) & (columns < np.flatnonzero(line(*ROBOT).any(axis=0) & is_seen).max())
    assert dice(robot, seen) > 0.93


def test_two_robots_side_by_side_are_not_joined(bench: Bench) -> None:
    image = with_line(with_line(board(), (0, 114), (200, 114), width=5), (0, 132), (200, 132), width=5)
    view = register(noisy(board(), 2.0, 4), bench)
    assert isinstance(view, BenchView)
    robots = robot_by_difference(noisy(image, 2.0, 3), view).probability >= 0.5
    assert robots.sum() > 1500
    assert not robots[120:127, 20:190].any()


def test_bands_side_by_side_are_joined_along_the_robots_and_at_most_once_across() -> None:
    columns, strands = np.arange(SIZE[0]), [line((0, y), (SIZE[0], y), 8) for y in (112, 136)]
    is_seen = (columns < 60) | (columns % 20 < 8)
    picture, lumen = board(), np.zeros((SIZE[1], SIZE[0]), bool)
    lumen[90:160] = True
    picture[lumen] = (200, 190, 180)
    bench = bench_from_pictures([noisy(picture, 1.0, 1)], lumen, "b", 320)
    picture[np.logical_or(*strands) & is_seen] = 20
    view = register(noisy(picture, 1.0, 4), bench)
    assert isinstance(view, BenchView)
    robots = robot_by_difference(noisy(picture, 1.0, 3), view).probability >= 0.5
    assert all(robots[y, 70:300].mean() > 0.98 for y in (112, 136))
    assert robots[124].sum() < 30, "columns of one bridge; a ladder has 229"


def test_a_row_of_bubbles_ahead_is_robot_only_where_the_network_sees_a_little(bench: Bench) -> None:
    short = line((0, 122), (120, 126))
    image = with_line(board(), (0, 122), (120, 126))
    for x in range(138, 280, 24):
        cv2.circle(image, (x, 122 + x // 32), 4, (60, 60, 60), cv2.FILLED)
    view = register(image := noisy(image, 1.0, 3), bench)
    assert isinstance(view, BenchView)
    difference = robot_by_difference(image, view)
    row = (difference.probability >= 0.5) & (np.arange(SIZE[0]) > 150)
    assert row.sum() > 600
    assert (difference.chained == row)[:, 160:].all()
    alone, seen = seen_by_network(short), np.where(row, np.float32(0.4), seen_by_network(short))
    for is_taught in (False, True):
        assert not (combined(alone, difference, view, is_taught=is_taught) >= 0.5)[:, 160:].any()
    assert (combined(seen, difference, view) >= 0.5)[row].all()
    assert disagreement(alone, difference, short)[row & difference.chained].all()


def test_where_an_edge_of_the_bench_is_seen_there_is_no_robot() -> None:
    with_clip = cv2.rectangle(board(), (80, 90), (92, 160), (60, 60, 60), cv2.FILLED)
    bench = bench_from_pictures([noisy(np.asarray(with_clip, np.uint8), 2.0, 1)], tube(), "b", 320)
    image = cv2.rectangle(with_line(board(), *ROBOT), (80, 90), (92, 160), (60, 60, 60), cv2.FILLED)
    robot = found(noisy(np.asarray(image, np.uint8), 2.0, 3), bench).probability >= 0.5
    assert robot[:, 20:70].any(), "it is seen on both sides of the clip"
    assert robot[:, 110:190].any()
    assert not robot[:, 84:89].any()


def seen_by_network(robot: Mask) -> np.ndarray:
    return np.where(robot, np.float32(0.97), np.float32(0.02))


def test_a_shadow_beside_the_robot_is_unsure_and_the_robot_is_not(bench: Bench) -> None:
    shadow = tuple(int(0.75 * level) for level in board()[135, 100])
    image = noisy(with_line(with_line(board(), (0, 126), (200, 134), shadow), *ROBOT, (110, 110, 110)), 2.0, 3)
    difference, robot = found(image, bench), line(*ROBOT)
    mask = difference.probability >= 0.5
    assert (mask & ~robot).sum() > 0.3 * robot.sum(), "the shadow differs as the robot does"
    unsure = disagreement(seen_by_network(robot), difference, mask)
    assert (mask & ~robot & ~unsure).sum() < 0.01 * robot.sum()
    assert (mask & robot & ~unsure).sum() > 0.9 * robot.sum(), "there is a robot to learn from"


def test_a_rim_that_neither_sees_is_no_robot_and_a_body_that_the_network_overlooks_is(bench: Bench) -> None:
    difference = found(noisy(with_line(board(), *ROBOT), 2.0, 3), bench)
    wide = cv2.dilate((difference.probability >= 0.5).astype(np.uint8), np.ones((5, 5))) > 0
    for network in (seen_by_network(line(*ROBOT)), np.zeros(wide.shape, np.float32)):
        trimmed = without_rim(network, difference, wide)
        assert (trimmed & line(*ROBOT)).sum() > 0.98 * line(*ROBOT).sum()
    assert dice(without_rim(seen_by_network(line(*ROBOT)), difference, wide), line(*ROBOT)) > 0.93 > dice(wide, line(*ROBOT))


@pytest.mark.parametrize("gap_px", [5, 6])
def test_narrow_gaps_between_bands_are_no_rim(bench: Bench, gap_px: int) -> None:
    columns = np.arange(SIZE[0])
    is_seen = (columns < 40) | ((columns - 40) % (25 + gap_px) >= gap_px)
    image = np.where(is_seen[None, :, None], with_line(board(), *ROBOT), board()).astype(np.uint8)
    difference = found(noisy(image, 1.0, 3), bench)
    network = np.where(is_seen, seen_by_network(line(*ROBOT)), np.float32(0.2))
    mask = (difference.probability >= 0.5) & line(*ROBOT)
    gaps = mask & ~is_seen
    assert gaps[:, 40:190].sum() > 60
    assert (without_rim(network, difference, mask) & gaps).sum() > 0.95 * gaps.sum()


def test_what_the_network_overlooks_in_the_whole_width_is_sure(bench: Bench) -> None:
    image = noisy(with_line(board(), *ROBOT), 2.0, 3)
    difference = found(image, bench)
    mask = difference.probability >= 0.5
    unsure = disagreement(seen_by_network(line((0, 122), (100, 126))), difference, mask)
    assert not (unsure & mask)[:, 110:190].any()


def test_a_tip_as_bright_as_the_bench_is_not_taught_as_background(bench: Bench) -> None:
    faint = tuple(int(level) - 9 for level in board()[130, 206])
    image = noisy(with_line(with_line(board(), *ROBOT, faint), (0, 122), (190, 129)), 1.0, 3)
    difference, robot = found(image, bench), line(*ROBOT)
    mask = difference.probability >= 0.5
    missed = (robot & ~mask)[:, 195:]
    assert missed.sum() > 50
    for network, share in ((seen_by_network(mask), 0.5), (seen_by_network(robot), 0.99)):
        assert disagreement(network, difference, mask)[:, 195:][missed].mean() > share
    assert not disagreement(seen_by_network(robot), difference, np.zeros_like(mask)).any()


def with_shadow(image: Image, shadow: Mask) -> Image:
    """A shadow with soft edges."""
    shade = cv2.GaussianBlur(np.where(shadow, np.float32(0.65), np.float32(1.0)), (0, 0), 1.0)
    return np.asarray(image * shade[..., None], np.uint8)


def with_network(image: Image, bench: Bench, network: np.ndarray) -> Difference:
    view = register(image, bench)
    assert isinstance(view, BenchView), view
    return beside_network(robot_by_difference(image, view), network, image, view)


@pytest.mark.parametrize("color", [(30, 30, 30), (110, 110, 110), (250, 250, 250), (200, 40, 40)])
def test_the_shadow_that_a_robot_casts_beside_itself_is_no_robot(bench: Bench, color: tuple[int, int, int]) -> None:
    (x, y), (to_x, to_y) = ROBOT
    shadow = line((x, y + 7), (to_x, to_y + 7))
    image = noisy(with_line(with_shadow(board(), shadow), *ROBOT, color), 2.0, 3)
    difference = with_network(image, bench, seen_by_network(line(*ROBOT)))
    assert dice(difference.probability >= 0.5, line(*ROBOT)) > 0.9
    assert (difference.doubtful & shadow).sum() < 0.2 * shadow.sum(), "that it is background is learnt"


def test_beside_its_shadow_a_robot_is_seen_where_it_is_as_bright_as_the_bench(bench: Bench) -> None:
    (x, y), (to_x, to_y) = ROBOT
    robot = line(*ROBOT)
    bright = with_line(with_shadow(board(), line((x, y + 7), (to_x, to_y + 7))), *ROBOT, (250, 250, 250))
    like_bench = with_shadow(board(), line((x, y + 7), (to_x, to_y + 7))) * ~robot[..., None] + board() * robot[..., None]
    image = noisy(np.where((np.arange(SIZE[0]) < 70)[None, :, None], bright, like_bench).astype(np.uint8), 2.0, 3)
    assert dice(found(image, bench).probability >= 0.5, robot) < 0.6
    assert dice(with_network(image, bench, seen_by_network(robot)).probability >= 0.5, robot) > 0.9


@pytest.mark.parametrize("color", [(20, 20, 20), (250, 250, 250)])
@pytest.mark.parametrize("missed_px", [10, 30])
def test_a_tip_that_the_network_misses_stays_beside_its_shadow(bench: Bench, color: tuple[int, int, int], missed_px: int) -> None:
    (x, y), (to_x, to_y) = ROBOT
    image = noisy(with_line(with_shadow(board(), line((x, y + 7), (to_x, to_y + 7))), *ROBOT, color), 2.0, 3)
    network = seen_by_network(line(*ROBOT) & (np.arange(SIZE[0]) < 204 - missed_px))
    robot = with_network(image, bench, network).probability >= 0.5
    assert np.flatnonzero(robot[120:134].any(axis=0)).max() > 200
    assert dice(robot, line(*ROBOT)) > 0.9


@pytest.mark.parametrize(
    "seen",
    [
        line((0, 122), (200, 130), 3),
        line((0, 122), (200, 130)) & (np.arange(SIZE[0]) % 40 < 20),
        line((0, 119), (100, 123), 3) | line((100, 129), (200, 133), 3),
        line((280, 20), (300, 20)),
        line((0, 124), (200, 132), 3),
        line((0, 129), (200, 137), 3),
        line((0, 122), (100, 126)) | line((104, 133), (134, 134), 3),
    ],
    ids=[
        "its middle",
        "pieces",
        "one side and then the other",
        "something else",
        "one side",
        "a line beside it",
        "half, and a line",
    ],
)
def test_a_robot_as_dark_as_a_shadow_stays_whole_where_the_network_overlooks_some_of_it(bench: Bench, seen: Mask) -> None:
    image = noisy(with_shadow(board(), line(*ROBOT)), 2.0, 3)
    assert dice(with_network(image, bench, seen_by_network(seen)).probability >= 0.5, line(*ROBOT)) > 0.9


def test_a_stain_that_the_network_takes_for_a_robot_is_none_far_from_the_robot(bench: Bench) -> None:
    stain = tuple(int(level) + 8 for level in board()[130, 206])
    image = with_line(with_line(board(), (0, 122), (120, 126)), (170, 128), (300, 134), stain)
    cv2.circle(image, (180, 142), 4, (60, 60, 60), cv2.FILLED)
    short, wrong = line((0, 122), (120, 126)), line((170, 128), (300, 134)) | line((177, 142), (183, 142), 9)
    difference = with_network(noisy(image, 1.5, 3), bench, seen_by_network(short | wrong))
    assert dice(difference.probability >= 0.5, short) > 0.9


def test_a_clear_robot_stays_among_streaks_in_the_liquid(bench: Bench) -> None:
    streaks = cv2.GaussianBlur(
        np.random.default_rng(5).normal(0, 1, (SIZE[1], SIZE[0])).astype(np.float32), (0, 0), 2.0, sigmaY=1.0
    )
    drawn = with_line(board(), *ROBOT, (20, 20, 20)).astype(np.float32)
    image = np.clip(drawn + (tube() & ~line(*ROBOT))[..., None] * (5.0 * streaks / streaks.std())[..., None], 0, 255)
    view, blank = register(noisy(image.astype(np.uint8), 1.5, 3), bench), np.zeros((SIZE[1], SIZE[0]), np.float32)
    assert isinstance(view, BenchView)
    for network in (blank, seen_by_network(line((0, 122), (100, 126)))):
        difference = with_network(noisy(image.astype(np.uint8), 1.5, 3), bench, network)
        assert dice(combined(network, difference, view) >= 0.5, line(*ROBOT)) > 0.85


@pytest.mark.parametrize("where", [ROBOT, ((280, 20), (300, 20)), ((210, 131), (300, 135))], ids=["robot", "outside", "nothing"])
def test_what_the_network_sees_and_differs_a_little_is_robot(bench: Bench, where: tuple[tuple[int, int], tuple[int, int]]) -> None:
    faint, tip = tuple(int(level) - 9 for level in board()[130, 206]), line((160, 128), (200, 130))
    image = noisy(with_line(with_line(board(), *ROBOT, faint), (160, 128), (200, 130), (250, 250, 250)), 1.5, 3)
    assert dice(found(image, bench).probability >= 0.5, tip) > 0.8, "alone it is too faint beside so clear a tip"
    robot = with_network(image, bench, seen_by_network(line(*where))).probability >= 0.5
    assert dice(robot, line(*ROBOT) if where == ROBOT else tip) > 0.8


def smooth_noise(image: Image, sigma: float, seed: int) -> Image:
    """With the noise of a camera that smooths it, so that neighbours have the same."""
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, image.shape).astype(np.float32), (0, 0), 1.5)
    return np.asarray(np.clip(image + noise * (sigma / noise.std()), 0, 255), np.uint8)


@pytest.mark.parametrize("pictures", [1, 2, 4])
def test_in_smooth_noise_one_picture_of_the_empty_bench_is_enough(pictures: int) -> None:
    bench = bench_from_pictures([smooth_noise(board(), 5.0, seed) for seed in range(pictures)], tube(), "b", 320)
    assert bench.known.mean() > 0.98, "noise is no change"
    image = smooth_noise(with_line(board(), *ROBOT, (90, 90, 90)), 5.0, 9)
    view, difference = register(image, bench), with_network(image, bench, seen_by_network(line(*ROBOT)))
    assert isinstance(view, BenchView)
    assert dice(combined(seen_by_network(line(*ROBOT)), difference, view) >= 0.5, line(*ROBOT)) > 0.9


def test_a_taught_network_denies_a_shadow_and_not_a_robot_that_it_overlooks(bench: Bench) -> None:
    shadow = tuple(int(0.7 * level) for level in board()[135, 100])
    image = noisy(with_line(with_line(board(), (0, 126), (200, 134), shadow), *ROBOT, (60, 60, 60)), 2.0, 3)
    view = register(image, bench)
    difference, elsewhere = robot_by_difference(image, view), line((280, 120), (300, 120))
    seen = seen_by_network(line(*ROBOT) | elsewhere)
    assert dice(combined(seen, difference, view) >= 0.5, line(*ROBOT)) < 0.9
    for network in (seen, seen_by_network(elsewhere)):
        robot = combined(network, difference, view, is_taught=True) >= 0.5
        assert dice(robot, line(*ROBOT)) > 0.98
        assert not (robot & elsewhere).any()
