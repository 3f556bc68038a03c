"""The way ahead of the head: what turn is missing, what lies behind, and what is in sight."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from core.config.models import PursuitConfig
from core.control.look_ahead import look_ahead
from core.types import Masks, Scene
from tests.core.driving_scenes import FORK, STRAIGHT, scene_at

CONFIG = PursuitConfig(smoothing_s=0.0)


def test_the_error_is_the_angle_to_the_look_ahead_point() -> None:
    way = look_ahead(scene_at(STRAIGHT, (100, 94), (380, 100)), 12.0, CONFIG)
    # The route is walked in steps of 2 px: its first point at least 12 px away lies 12 px ahead and 6 px aside.
    assert way.error_deg == pytest.approx(math.degrees(math.atan2(6, 12)), abs=0.1)


@pytest.mark.parametrize("heading", [70.0, 95.0])
def test_a_branch_beside_the_head_is_turned_into_and_not_backed_away_from(heading: float) -> None:
    """At a T the head enters across the way, and is past its middle before it has turned: the way is not behind it."""
    way = look_ahead(scene_at(STRAIGHT, (100, 112), (380, 100), heading), 10.0, CONFIG)
    assert not way.behind
    assert way.error_deg < 0.0, "to the left, where the way goes on"


def test_a_head_far_beside_the_way_looks_at_a_place_ahead_and_not_across() -> None:
    way = look_ahead(scene_at(STRAIGHT, (100, 113), (380, 100), 0.0), 10.0, CONFIG)
    assert way.error_deg == pytest.approx(-45.0, abs=3.0)


def test_a_way_that_leads_back_is_behind_wherever_the_head_is_beside_it() -> None:
    for y in (90.0, 100.0, 112.0):
        way = look_ahead(scene_at(STRAIGHT, (300, y), (20, 100), 0.0), 10.0, CONFIG)
        assert way.behind


def _seen(scene: Scene, vessel: NDArray[np.bool_]) -> Scene:
    empty = np.zeros(vessel.shape, np.float32)
    return replace(scene, masks=Masks(vessel, np.zeros_like(vessel), empty, empty))


def test_a_head_that_looks_into_the_right_branch_goes_on_although_the_other_centerline_is_nearer() -> None:
    scene = scene_at(FORK, (230, 108), (300, 200), 60.0)
    alone = look_ahead(scene, 10.0, CONFIG)
    assert alone.behind, "along the graph the way leads back to the bifurcation"
    way = look_ahead(_seen(scene, np.ones((480, 640), np.bool_)), 10.0, CONFIG)
    assert not way.behind
    assert way.error_deg > 0.0, "the branch lies to the right of where it looks"
    assert math.dist((230, 108), (300, 200)) <= way.left_px < alone.left_px


def test_a_branch_behind_a_wall_is_not_in_sight() -> None:
    vessel = np.ones((480, 640), np.bool_)
    vessel[112:115] = False
    way = look_ahead(_seen(scene_at(FORK, (230, 108), (300, 200), 60.0), vessel), 10.0, CONFIG)
    assert way.behind


def test_a_branch_in_sight_but_far_to_the_side_is_backed_up_to() -> None:
    way = look_ahead(_seen(scene_at(FORK, (300, 100), (300, 200), 0.0), np.ones((480, 640), np.bool_)), 10.0, CONFIG)
    assert way.behind


def test_a_sharp_corner_of_the_way_is_steered_for_earlier_when_it_is_rounded() -> None:
    def missing_deg(x: float, rounding_px: float) -> float:
        way = look_ahead(scene_at(FORK, (x, 100), (300, 200)), 10.0, CONFIG, rounding_px)
        return way.error_deg

    assert missing_deg(186.0, 0.0) == pytest.approx(0.0, abs=0.5)
    assert missing_deg(186.0, 8.0) > 3.0
    assert missing_deg(120.0, 8.0) == pytest.approx(0.0, abs=0.5)
