"""A route that was seen holds over a gap in the vessel that comes later, and over nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from core.config import TrackingConfig
from core.perception.route_memory import RouteMemory
from core.types import Point, Route

CONFIG = TrackingConfig(route_gap_px=40.0, route_reach_px=30.0)
TARGET: Point = (380.0, 100.0)
WHY = "no vessel that was found leads there"


def _route(start_x: float = 20.0) -> Route:
    points = np.linspace((start_x, 100.0), TARGET, 200)
    return Route(points, TARGET[0] - start_x, TARGET)


def _vessel(gap: tuple[int, int] = (0, 0)) -> NDArray[np.bool_]:
    vessel = np.zeros((200, 400), np.bool_)
    vessel[85:116] = True
    vessel[:, gap[0] : gap[1]] = False
    return vessel


@pytest.fixture
def memory() -> RouteMemory:
    memory = RouteMemory(CONFIG)
    found = _route()
    assert memory.follow(found, (20.0, 100.0), TARGET, _vessel(), 0.0) is found
    return memory


def test_a_short_gap_ahead_does_not_undo_it(memory: RouteMemory) -> None:
    left = memory.follow(WHY, (120.0, 106.0), TARGET, _vessel((200, 235)), 0.0)
    assert isinstance(left, Route)
    assert left.length_px == pytest.approx(260.0, abs=2.0)
    assert left.points[0] == pytest.approx((120.0, 100.0), abs=1.0)
    assert left.points[-1] == pytest.approx(TARGET, abs=1e-6)
    assert left.target == TARGET


def test_a_long_gap_does(memory: RouteMemory) -> None:
    assert memory.follow(WHY, (120.0, 100.0), TARGET, _vessel((200, 250)), 0.0) == WHY
    assert isinstance(memory.follow(WHY, (250.0, 100.0), TARGET, _vessel((200, 250)), 0.0), Route), "it lies behind the head now"


def test_a_head_that_is_elsewhere_has_no_way(memory: RouteMemory) -> None:
    assert memory.follow(WHY, (120.0, 135.0), TARGET, _vessel((200, 230)), 0.0) == WHY


def test_another_destination_has_to_be_found_itself(memory: RouteMemory) -> None:
    assert memory.follow(WHY, (120.0, 100.0), (300.0, 100.0), _vessel(), 0.0) == WHY
    assert memory.follow(WHY, (120.0, 100.0), TARGET, _vessel(), 0.0) == WHY, "and the old one is forgotten with it"


def test_what_is_found_anew_replaces_it(memory: RouteMemory) -> None:
    around = Route(np.linspace((120.0, 100.0), (120.0, 190.0), 50), 500.0, TARGET)
    assert memory.follow(around, (120.0, 100.0), TARGET, _vessel(), 1.0) is around
    left = memory.follow(WHY, (120.0, 120.0), TARGET, np.ones((200, 400), np.bool_), 0.0)
    assert isinstance(left, Route)
    assert left.points[-1] == pytest.approx((120.0, 190.0))


def test_parts_outside_the_picture_are_gaps(memory: RouteMemory) -> None:
    assert memory.follow(WHY, (120.0, 100.0), TARGET, _vessel()[:, :330], 0.0) == WHY
    assert isinstance(memory.follow(WHY, (120.0, 100.0), TARGET, _vessel()[:, :360], 0.0), Route)


def test_at_its_end_the_destination_is_reached(memory: RouteMemory) -> None:
    left = memory.follow(WHY, (390.0, 100.0), TARGET, _vessel(), 0.0)
    assert isinstance(left, Route)
    assert left.length_px == 0.0
    assert left.points == pytest.approx(np.array([TARGET]))


def test_forgotten_is_forgotten(memory: RouteMemory) -> None:
    memory.forget()
    assert memory.follow(WHY, (120.0, 100.0), TARGET, _vessel(), 0.0) == WHY


def test_a_detour_of_a_moment_is_not_taken(memory: RouteMemory) -> None:
    """Round a loop there is another way when a reflection cuts this one."""
    points = np.array([(120.0, 100.0), (120.0, 10.0), (380.0, 10.0), TARGET])
    detour = Route(points, 440.0, TARGET)
    head, cut = (120.0, 100.0), _vessel((200, 212))
    left = memory.follow(detour, head, TARGET, cut, 0.1)
    assert isinstance(left, Route)
    assert left.length_px == pytest.approx(260.0, abs=2.0)
    assert memory.follow(detour, head, TARGET, cut, CONFIG.memory_s + 0.1) is detour, "what lasts is true: perhaps the way was none"
    assert memory.follow(detour, head, TARGET, cut, CONFIG.memory_s + 0.2) is detour
