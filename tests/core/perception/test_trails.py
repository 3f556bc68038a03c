import math

import numpy as np
import pytest

from core.config.models import PathConfig
from core.perception.robot_path import consistency, explore, score, smoothness
from core.perception.skeleton import trace
from core.types import Mask

STRAIGHT = np.column_stack([np.arange(101.0), np.zeros(101)])
CORNER = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
HAIRPIN = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [10.0, 0.0], [0.0, 0.0]])


def test_a_straight_line_gets_full_marks() -> None:
    assert smoothness(STRAIGHT, "signed") == consistency(STRAIGHT, "signed") == pytest.approx(1.0)


def test_a_right_angle_by_hand() -> None:
    assert smoothness(CORNER, "signed") == pytest.approx(0.0)
    assert consistency(CORNER, "signed") == pytest.approx(math.cos(math.radians(45)))


def test_the_papers_absolute_cosine_is_blind_to_a_hairpin_and_ours_is_not() -> None:
    assert smoothness(HAIRPIN, "absolute") == pytest.approx(1.0)
    assert smoothness(HAIRPIN, "signed") == pytest.approx((1 - 1 + 1) / 3)


def test_one_px_steps_only_know_multiples_of_45_degrees() -> None:
    slope = np.column_stack([np.arange(61), np.arange(61) // 3]).astype(float)  # 18 degrees, as pixels
    literal = PathConfig(weight_length=0, weight_smoothness=1, weight_consistency=0, step_px=1, cosine="absolute")
    assert score(slope, 1.0, literal) < 0.85
    assert score(slope, 1.0, literal.model_copy(update={"step_px": 8.0})) > 0.995


def test_the_score_is_the_papers_weighted_sum() -> None:
    config = PathConfig(weight_length=-0.2, weight_smoothness=2.0, weight_consistency=0.5, step_px=1.0, cosine="absolute")
    assert score(CORNER, 0.5, config) == pytest.approx(-0.2 * 0.5 + 2.0 * 0.0 + 0.5 * math.cos(math.radians(45)))


def test_a_closed_path_has_no_overall_direction() -> None:
    assert consistency(HAIRPIN, "signed") == 0.0


def skeleton(*lines: tuple[int, int, int, int]) -> Mask:
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
    tree = skeleton((10, 60, 200, 60), (80, 60, 80, 20), (140, 60, 140, 100))
    assert trails_from(tree, (10, 60), PathConfig(junction_turn_px=0)) == [(200, 60), (140, 100), (80, 20)]


def test_a_turn_at_a_junction_costs_length() -> None:
    t = skeleton((10, 60, 120, 60), (100, 60, 100, 25))  # 35 px to the side against 20 px straight on
    assert trails_from(t, (10, 60), PathConfig(junction_turn_px=0))[0] == (100, 25)
    assert trails_from(t, (10, 60), PathConfig(junction_turn_px=40))[0] == (120, 60)


def test_no_chain_is_used_twice_but_a_crossing_may_be_passed_twice() -> None:
    loop = skeleton((10, 60, 180, 60), (180, 60, 180, 20), (180, 20, 100, 20), (100, 20, 100, 110))
    graph = trace(loop)
    ends = np.flatnonzero(graph.degrees() == 1)
    start = ends[np.argmin(graph.nodes[ends][:, 0])]
    best = explore(graph, int(start), PathConfig())[0]
    assert best.points[-1].tolist() == [100, 110]
    assert best.length_px == pytest.approx(170 + 40 + 80 + 90, abs=6)


def test_the_number_of_candidates_is_limited() -> None:
    ladder = skeleton((5, 40, 235, 40), (5, 80, 235, 80), *((x, 40, x, 80) for x in range(20, 230, 10)))
    graph = trace(ladder)
    start = int(np.flatnonzero(graph.degrees() == 1)[0])
    assert 1 <= len(explore(graph, start, PathConfig(max_candidates=50))) <= 50


def test_without_another_end_the_way_around_the_loop_is_given() -> None:
    lasso = skeleton((10, 60, 100, 60), (100, 60, 140, 20), (140, 20, 180, 60), (180, 60, 140, 100), (140, 100, 100, 60))
    assert len(trails_from(lasso, (10, 60), PathConfig())) == 2


def test_the_number_of_chains_walked_is_limited() -> None:
    ladder = skeleton((5, 40, 235, 40), (5, 80, 235, 80), *((x, 40, x, 80) for x in range(20, 230, 10)))
    graph = trace(ladder)
    start = int(np.flatnonzero(graph.degrees() == 1)[0])
    assert explore(graph, start, PathConfig(), budget=3) == []
    assert len(explore(graph, start, PathConfig(), budget=60)) < 20
