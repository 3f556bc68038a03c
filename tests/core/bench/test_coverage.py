"""Where the robot has been: cells along a drawn tree, branches by their place, and what is asked for next."""

import cv2
import numpy as np
import pytest

from core.bench.coverage import ASKED, COVERED, OPEN, OUTSIDE, Side, VesselCoverage, missing
from core.types import Mask

TRUNK, FORK = ((0, 120), (160, 120)), (160, 120)
ENDS = {"upper": (300, 40), "lower": (300, 200)}


def line(*points: tuple[int, int], width: int = 24) -> Mask:
    drawn = np.zeros((240, 320), np.uint8)
    cv2.polylines(drawn, [np.array(points, np.int32)], False, 1, width)
    return drawn > 0


def tree() -> Mask:
    """A trunk from the left border that forks to the upper and to the lower right."""
    return line(*TRUNK, ENDS["upper"]) | line(*TRUNK, ENDS["lower"])


def test_a_fork_has_three_branches_named_by_where_they_end() -> None:
    branches = VesselCoverage(tree()).branches()
    assert {branch.side for branch in branches} == {Side.LEFT, Side.UPPER_RIGHT, Side.LOWER_RIGHT}
    assert all(branch.is_end and branch.is_wanted and not branch.is_done for branch in branches)


def test_the_robot_covers_what_it_lies_in() -> None:
    coverage = VesselCoverage(tree())
    robot = line(*TRUNK, ENDS["upper"], width=5)
    new = coverage.new_cells(robot)
    assert coverage.share == 0.0
    assert coverage.add(robot) == new
    assert coverage.new_cells(robot) == 0
    assert [branch.side for branch in missing(coverage.branches())] == [Side.LOWER_RIGHT]
    coverage.add(line(*TRUNK, ENDS["lower"], width=5))
    assert missing(coverage.branches()) == ()
    assert coverage.share == pytest.approx(1.0, abs=0.05)


def test_a_robot_that_only_looks_into_a_branch_has_not_been_there() -> None:
    coverage = VesselCoverage(tree())
    coverage.add(line(*TRUNK, (200, 137), width=5))
    sides = {branch.side for branch in missing(coverage.branches())}
    assert sides == {Side.UPPER_RIGHT, Side.LOWER_RIGHT}


def test_the_map_shows_what_is_covered_and_what_is_asked_for() -> None:
    vessel = tree()
    coverage = VesselCoverage(vessel)
    coverage.add(line(*TRUNK, ENDS["upper"], width=5))
    tree_map = coverage.tree()
    assert tree_map[10, 10] == OUTSIDE
    assert tree_map[120, 60] == COVERED
    assert tree_map[60, 265] == COVERED
    assert tree_map[180, 265] == ASKED
    assert not ((tree_map > 0) ^ vessel).any()


def test_of_two_missing_branches_one_is_asked_for_first() -> None:
    coverage = VesselCoverage(tree())
    coverage.add(line(*TRUNK, width=5))
    kinds = {coverage.tree()[60, 265], coverage.tree()[180, 265]}
    assert kinds == {OPEN, ASKED}


def test_where_the_empty_bench_is_not_known_nothing_is_asked_for() -> None:
    known = np.ones((240, 320), bool)
    known[:, :150] = False
    sides = {branch.side for branch in missing(VesselCoverage(tree(), known).branches())}
    assert sides == {Side.UPPER_RIGHT, Side.LOWER_RIGHT}


def test_a_mask_without_a_centerline_is_covered() -> None:
    coverage = VesselCoverage(np.zeros((240, 320), bool))
    assert coverage.share == 1.0
    assert missing(coverage.branches()) == ()
