"""The paper's method as it is written down, on pictures small enough to see the answer."""

import cv2
import numpy as np

from core.evaluation.paper_baseline import connect_gaps, end_points, trace_paper
from tests.core.drawing import art, picture


def test_end_points_have_exactly_one_neighbour() -> None:
    fork = art("""
.........
.#####...
......#..
.....#.#.
....#....
.........
""")
    assert end_points(fork) == [(1, 1), (3, 7), (4, 4)]
    assert end_points(art("#..\n...\n...")) == []  # alone: 10


def test_ends_closer_than_the_threshold_are_joined() -> None:
    broken = art("""
............
.####..####.
............
""")
    whole = art("""
............
.##########.
............
""")
    assert picture(connect_gaps(broken, 3.5)) == picture(whole)
    assert picture(connect_gaps(broken, 3.0)) == picture(broken)  # the ends are 3 px apart, and "closer" is strict


def test_taken_literally_the_two_ends_of_one_short_piece_are_joined_too() -> None:
    hook = art("""
.......
.#####.
.#.....
.#####.
.......
""")
    closed = art("""
.......
.#####.
.#...#.
.#####.
.......
""")
    assert picture(connect_gaps(hook, 3.0)) == picture(closed)


def test_a_robot_is_traced_from_end_to_end_across_its_gap() -> None:
    vessel, robot = np.zeros((256, 256), np.uint8), np.zeros((256, 256), np.uint8)
    cv2.line(vessel, (0, 128), (255, 128), 1, 41)
    cv2.line(robot, (30, 128), (100, 128), 1, 5)
    cv2.line(robot, (112, 128), (200, 128), 1, 5)
    cv2.circle(robot, (60, 30), 2, 1, cv2.FILLED)  # a speck
    path = np.array(trace_paper(vessel > 0, robot > 0))
    assert sorted((path[0, 1], path[-1, 1])) == [path[:, 1].min(), path[:, 1].max()]
    assert abs(path[:, 0] - 128).max() <= 2
    assert path[:, 1].min() <= 34
    assert path[:, 1].max() >= 196
    steps = np.abs(np.diff(path, axis=0))
    assert steps.max() == 1  # pixel by pixel
