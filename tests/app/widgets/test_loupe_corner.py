"""The loupe lies where it hides least, and does not jump about."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPointF, QRectF

from app.widgets.live_view import LoupeCorner
from app.widgets.scene_overlay import seen_places
from core.types import Points
from tests.app.hand_clock import Clock

CORNERS = [QRectF(300, 0, 100, 80), QRectF(0, 0, 100, 80), QRectF(300, 220, 100, 80), QRectF(0, 220, 100, 80)]
MIDDLE = QPointF(200, 150)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def corner(clock: Clock) -> LoupeCorner:
    return LoupeCorner(clock)


def crowd(**counts: int) -> Points:
    """So many places in each corner."""
    order = ("right_top", "left_top", "right_bottom", "left_bottom")
    return np.array(
        [CORNERS[order.index(name)].center().toTuple() for name, count in counts.items() for _ in range(count)]
    ).reshape(-1, 2)


def choose(corner: LoupeCorner, places: Points, head: QPointF = MIDDLE) -> int:
    return corner.choose(CORNERS, head, places, np.ones(len(places)))


def test_it_begins_where_least_is_hidden(corner: LoupeCorner) -> None:
    assert choose(corner, crowd(right_top=50, left_top=20, right_bottom=1, left_bottom=40)) == 2


def test_with_nothing_to_hide_it_lies_at_the_upper_right(corner: LoupeCorner) -> None:
    assert choose(corner, crowd()) == 0


def test_a_corner_that_is_a_little_better_is_no_reason_to_move(corner: LoupeCorner, clock: Clock) -> None:
    assert choose(corner, crowd(left_top=50, right_bottom=60, left_bottom=70)) == 0
    for clock.now_s in range(100, 110):
        assert choose(corner, crowd(right_top=50, left_top=30, right_bottom=60, left_bottom=70)) == 0


def test_it_moves_for_a_much_better_one_once_that_has_lasted(corner: LoupeCorner, clock: Clock) -> None:
    better_elsewhere = crowd(right_top=100, right_bottom=60, left_bottom=70)
    assert choose(corner, crowd(left_top=9, right_bottom=9, left_bottom=9)) == 0
    clock.now_s = 105.0
    assert choose(corner, better_elsewhere) == 0
    clock.now_s = 105.9
    assert choose(corner, crowd(left_top=9, right_bottom=9, left_bottom=9)) == 0
    clock.now_s = 106.1
    assert choose(corner, better_elsewhere) == 0  # it counts anew
    clock.now_s = 107.1
    assert choose(corner, better_elsewhere) == 1


def test_it_leaves_at_once_when_the_head_comes(corner: LoupeCorner) -> None:
    crowded = crowd(left_top=50, right_bottom=20, left_bottom=10)
    assert choose(corner, crowded) == 0
    assert choose(corner, crowded, QPointF(290, 70)) == 3
    assert choose(corner, crowded, QPointF(290, 70)) == 3


def test_a_head_that_is_near_all_corners_moves_nothing(corner: LoupeCorner) -> None:
    """In a tiny view."""
    everywhere = [QRectF(0, 0, 100, 80)] * 4
    assert corner.choose(everywhere, QPointF(50, 40), np.empty((0, 2)), np.empty(0)) == 0
    assert corner.choose(everywhere, QPointF(55, 40), np.empty((0, 2)), np.empty(0)) == 0


def test_a_destination_counts_more_than_a_vessel() -> None:
    places, weights = seen_places(None, (10.0, 20.0))
    assert places.tolist() == [[10.0, 20.0]]
    assert weights[0] > 100
    assert len(seen_places(None, None)[0]) == 0


def test_it_goes_out_of_the_way_of_what_lies_over_it(corner: LoupeCorner, clock: Clock) -> None:
    alerts = [QRectF(12, 12, 360, 60)]
    nothing, ones = crowd(), np.ones(0)
    assert corner.choose(CORNERS, MIDDLE, nothing, ones) == 0
    assert corner.choose(CORNERS, MIDDLE, nothing, ones, alerts) == 0
    clock.now_s += 1.1
    assert corner.choose(CORNERS, MIDDLE, nothing, ones, alerts) == 2
    clock.now_s += 5.0
    assert corner.choose(CORNERS, MIDDLE, nothing, ones) == 2, "they are gone, and it need not come back"
