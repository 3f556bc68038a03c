import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter, label
from skimage.morphology import skeletonize

from core.config.models import CleaningConfig, GapConfig, PerceptionConfig
from core.perception.skeleton import (
    BranchWalker,
    end_pixels,
    extend_ends,
    repair,
    thin,
    thin_half_size,
    thin_masks,
    trace,
    without_spurs,
)
from core.types import Mask, Skeletons
from tests.core.drawing import art, curve, depth, everywhere, masks_of, picture, probability

EIGHT = np.ones((3, 3))


def topology(mask: Mask) -> tuple[int, int]:
    """Components, and holes (background that does not reach the border)."""
    framed = np.pad(mask, 1)
    return label(framed, EIGHT)[1], label(~framed)[1] - 1


@pytest.mark.parametrize("shape", [(481, 641), (480, 640), (360, 640), (200, 131)])
def test_half_size_thinning_keeps_loops_and_narrow_walls(shape: tuple[int, int]) -> None:
    mask = np.zeros(shape, bool)
    mask[20:120, 10:110] = True
    mask[40:100, 30:90] = False  # a loop of 20 px wide vessel
    mask[120, 10:110] = False
    mask[121:160, 10:110] = True  # one pixel of wall between two vessels
    skeleton = thin_half_size(mask)
    assert skeleton.shape == mask.shape
    assert topology(skeleton) == topology(mask) == (2, 1)
    assert not (skeleton & ~mask).any()


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), sigma=st.floats(0.0, 5.0), share=st.floats(0.05, 0.95), height=st.integers(1, 60))
def test_thinning_is_scikit_images_pixel_for_pixel(seed: int, sigma: float, share: float, height: int) -> None:
    noise = gaussian_filter(np.random.default_rng(seed).random((height, 47)), sigma)
    mask = noise >= np.quantile(noise, share)
    assert np.array_equal(thin(mask), skeletonize(mask))


@pytest.mark.parametrize("shift_px", [0.0, 0.5])
def test_a_narrow_branch_of_a_wide_vessel_is_not_lost_at_half_size(shift_px: float) -> None:
    trunk = depth(np.array([[-20.0, 240.0], [660.0, 240.0]]), 22.0)
    branch = depth(curve((300, 240), (400, 180 + shift_px), (520, 120), (690, 60)), 1.5)
    mask = probability(trunk, branch) >= 0.5
    skeleton = thin_half_size(mask)
    assert topology(skeleton) == (1, 0)
    assert skeleton[:200, 400:].sum() > 200  # some 240 px of it
    assert picture(thin_half_size(trunk > 0.0)) != picture(thin(trunk > 0.0)), "where nothing is lost half the size is enough"


def test_ends_are_where_the_papers_convolution_gives_eleven() -> None:
    skeleton = art("""
.........
.#.....#.
..#...#..
...###...
....#....
....#....
.........
""")
    assert sorted(end_pixels(skeleton)) == [(1, 1), (4, 5), (7, 1)]


def test_a_branch_leaves_through_its_end() -> None:
    row = np.zeros((9, 30), bool)
    row[4, 5:25] = True
    assert BranchWalker(row).direction((24, 4)) == pytest.approx((1.0, 0.0))
    assert BranchWalker(row).direction((5, 4)) == pytest.approx((-1.0, 0.0))
    dot = np.zeros((9, 30), bool)
    dot[4, 5:7] = True
    assert BranchWalker(dot).direction((5, 4)) is None


def test_ends_are_extended_to_the_masks_edge() -> None:
    mask = np.zeros((40, 120), bool)
    mask[15:26, 20:100] = True
    skeleton = thin(mask)
    assert np.argwhere(skeleton)[:, 1].max() < 98  # thinning stops short of a blunt end
    extended = extend_ends(skeleton, mask)
    columns = np.argwhere(extended)[:, 1]
    assert (columns.min(), columns.max()) == (20, 99)
    assert len(end_pixels(extended)) == 2
    assert not (extended & ~mask).any()


@pytest.mark.parametrize(("radius", "length_px", "angle_deg"), [(10, 26, 53), (12, 41, 39), (16, 44, 37), (12, 30, 6), (16, 60, 6)])
def test_a_short_thick_robot_stays_in_one_piece_from_end_to_end(radius: float, length_px: float, angle_deg: float) -> None:
    along = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    middle = np.array([200.0, 200.0])
    x, y = np.meshgrid(np.arange(400.0), np.arange(400.0))
    places = np.stack([x, y], axis=-1) - middle
    reach = np.clip(places @ along, -0.5 * length_px, 0.5 * length_px)
    mask = np.hypot(*np.moveaxis(places - reach[..., None] * along, -1, 0)) < radius  # with round ends
    masks = masks_of(everywhere((400, 400)), mask.astype(np.float32))
    skeleton = thin_masks(masks, PerceptionConfig()).robot
    assert label(skeleton, EIGHT)[1] == 1
    ends = np.array(sorted(end_pixels(skeleton)), float)
    assert len(ends) == 2
    chord = ends[1] - ends[0]
    assert np.hypot(*chord) == pytest.approx(length_px + 2 * radius, abs=3.0)
    assert np.degrees(np.arctan2(chord[1], chord[0])) == pytest.approx(angle_deg, abs=4.0)


def test_the_fork_at_a_broken_end_is_pruned() -> None:
    mask = np.zeros((60, 160), bool)
    mask[25:36, 20:140] = True
    mask[28:33, 135:140] = False  # the end is torn: two horns
    forked = thin(mask)
    assert len(end_pixels(forked)) == 3
    pruned = without_spurs(forked, mask)
    assert len(end_pixels(pruned)) == 2
    assert topology(pruned) == (1, 0)


def test_a_real_side_branch_is_not_pruned() -> None:
    mask = np.zeros((120, 160), bool)
    mask[55:62, 10:150] = True
    mask[10:60, 80:86] = True
    assert len(end_pixels(without_spurs(thin(mask), mask))) == 3


def test_the_papers_form_leaves_the_ends_as_thinning_made_them() -> None:
    robot = probability(depth(np.array([[50.0, 100.0], [300.0, 180.0]]), 6.0))
    masks = masks_of(everywhere(), robot)
    plain = CleaningConfig(prune_spurs=False, extend_ends=False, half_size_thinning=False)
    literal = thin_masks(masks, PerceptionConfig(cleaning=plain)).robot
    assert picture(literal) == picture(thin(masks.robot))
    ours = thin_masks(masks, PerceptionConfig()).robot
    assert np.argwhere(ours)[:, 1].max() > np.argwhere(literal)[:, 1].max()


LITERAL = GapConfig(rule="every_pair", gap_threshold_px=8.0)


def repaired(robot: Mask, config: GapConfig) -> Skeletons:
    return repair(Skeletons(np.zeros_like(robot), robot), config)


def rows(*pieces: tuple[int, int, int], shape: tuple[int, int] = (60, 160)) -> Mask:
    """Horizontal skeleton pieces as (row, first column, last column)."""
    skeleton = np.zeros(shape, bool)
    for row, first, last in pieces:
        skeleton[row, first : last + 1] = True
    return skeleton


def test_the_gap_in_a_line_is_closed() -> None:
    broken = art("""
..............
.#####..#####.
..............
""")
    skeletons = repaired(broken, GapConfig(gap_threshold_px=5.0))
    assert picture(skeletons.robot).splitlines()[1] == ".############."
    assert skeletons.bridges == (((5.0, 1.0), (8.0, 1.0)),)


def test_a_gap_of_the_threshold_stays_open() -> None:
    broken = rows((30, 10, 50), (30, 70, 120))
    assert repaired(broken, GapConfig(gap_threshold_px=20.0)).bridges == ()
    assert len(repaired(broken, GapConfig(gap_threshold_px=20.5)).bridges) == 1


def test_nearest_first_and_each_end_once() -> None:
    three = rows((30, 10, 40), (30, 48, 60), (30, 66, 120))
    bridges = repaired(three, GapConfig(gap_threshold_px=40.0)).bridges
    assert bridges == (((60.0, 30.0), (66.0, 30.0)), ((40.0, 30.0), (48.0, 30.0)))


def test_the_ends_of_one_piece_are_not_joined_unless_the_paper_is_taken_literally() -> None:
    horseshoe = art("""
............
.#........#.
.#........#.
.#........#.
..########..
............
""")
    assert repaired(horseshoe, GapConfig(gap_threshold_px=30.0, max_turn_deg=180.0)).bridges == ()
    assert len(repaired(horseshoe, GapConfig(rule="every_pair", gap_threshold_px=30.0)).bridges) == 1


def test_the_literal_form_joins_every_pair_of_near_ends() -> None:
    short = art("""
..............
.####.....###.
..............
.####.........
..............
""")
    joined = {frozenset(bridge) for bridge in repaired(short, LITERAL).bridges}
    ends = {(1.0, 1.0), (4.0, 1.0), (10.0, 1.0), (12.0, 1.0), (1.0, 3.0), (4.0, 3.0)}
    expected = {frozenset((a, b)) for a in ends for b in ends if a < b and np.hypot(a[0] - b[0], a[1] - b[1]) < 8.0}
    assert joined == expected
    assert len(joined) == 9


@pytest.mark.parametrize(
    ("offset", "joined"),
    [(0, True), (8, True), (15, False)],  # 20 px ahead and so many aside: turns of 0, 22, 37 degrees
)
def test_a_turn_that_the_robot_cannot_make_is_not_bridged(offset: int, joined: bool) -> None:
    pieces = rows((20, 10, 50), (20 + offset, 70, 120))
    assert bool(repaired(pieces, GapConfig(gap_threshold_px=40.0, max_turn_deg=30.0)).bridges) is joined


def test_two_pieces_side_by_side_are_two_strands_not_a_gap() -> None:
    strands = rows((20, 10, 80), (34, 10, 80))
    assert repaired(strands, GapConfig()).bridges == ()


def test_a_step_of_a_few_px_between_two_strands_of_one_direction_is_a_gap() -> None:
    torn = rows((20, 10, 60), (25, 64, 120))
    assert len(repaired(torn, GapConfig(max_turn_deg=30.0)).bridges) == 1


def test_a_line_is_one_chain_between_two_ends() -> None:
    graph = trace(
        art("""
......
.#....
..##..
....#.
......
""")
    )
    assert graph.degrees().tolist() == [1, 1]
    assert [chain.points.tolist() for chain in graph.chains] == [[[1, 1], [2, 2], [3, 2], [4, 3]]]


def test_a_fork_has_one_junction_and_three_ends() -> None:
    graph = trace(
        art("""
#.......#
.#.....#.
..#...#..
...#.#...
....#....
....#....
....#....
""")
    )
    assert sorted(graph.degrees().tolist()) == [1, 1, 1, 3]
    junction = int(np.argmax(graph.degrees()))
    assert graph.nodes[junction].tolist() == [4, 4]
    assert sorted(len(chain.points) for chain in graph.chains) == [3, 5, 5]


def test_a_staircase_is_no_row_of_junctions() -> None:
    graph = trace(
        art("""
##....
.##...
..##..
...##.
....##
""")
    )
    assert graph.degrees().tolist() == [1, 1]
    assert len(graph.chains[0].points) == 10


def test_touching_junction_pixels_are_one_node_at_their_mean() -> None:
    graph = trace(
        art("""
.#..#.
.#..#.
..##..
.#..#.
.#..#.
""")
    )
    assert sorted(graph.degrees().tolist()) == [1, 1, 1, 1, 4]
    assert graph.nodes[int(np.argmax(graph.degrees()))].tolist() == [2.5, 2]


def test_a_ring_and_a_ring_on_a_stick() -> None:
    ring = trace(
        art("""
..###..
.#...#.
.#...#.
..###..
""")
    )
    assert ring.degrees().tolist() == [2]
    assert ring.chains[0].points[0].tolist() == ring.chains[0].points[-1].tolist()
    assert len(ring.chains[0].points) == 11
    stick = trace(
        art("""
..###......
.#...#.....
.#....#####
.#...#.....
..###......
""")
    )
    assert sorted(stick.degrees().tolist()) == [1, 3]
    assert sorted(len(chain.points) for chain in stick.chains) == [5, 13]


def test_a_path_longer_than_any_recursion_limit() -> None:
    snake = np.zeros((200, 400), bool)
    snake[1::2, 1:-1] = True
    snake[2::4, -2] = snake[4::4, 1] = True
    snake[199] = False
    graph = trace(snake)
    assert graph.degrees().tolist() == [1, 1]
    assert len(graph.chains[0].points) == snake.sum() > 30_000
