import numpy as np
import pytest

from core.config.models import GapConfig
from core.perception.skeleton import repair
from core.types import Mask, Skeletons
from tests.core.drawing import art, picture

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


def test_nothing_to_repair_gives_the_same_skeletons() -> None:
    whole = Skeletons(np.zeros((60, 160), bool), rows((30, 10, 120)))
    assert repair(whole, GapConfig()) is whole
    empty = Skeletons(np.zeros((60, 160), bool), np.zeros((60, 160), bool))
    assert repair(empty, GapConfig()) is empty


def test_the_input_is_not_written_to() -> None:
    broken = rows((30, 10, 50), (30, 60, 120))
    before = broken.copy()
    assert len(repaired(broken, GapConfig()).bridges) == 1
    assert (broken == before).all()


def test_noise_with_hundreds_of_ends_is_left_as_it_is() -> None:
    many = rows(*((row, first, first + 9) for row in range(2, 60, 6) for first in range(0, 150, 15)))
    assert repaired(many, GapConfig()).bridges == ()
    assert repaired(many[:30], GapConfig()).bridges != ()
