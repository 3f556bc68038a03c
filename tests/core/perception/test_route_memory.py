"""A route that was seen holds over a gap in the vessel that comes later, and over nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from core.config.models import TrackingConfig
from core.perception.tracking import RouteMemory
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
    """It has been found for half a second."""
    memory = RouteMemory(CONFIG)
    for at_s in (-CONFIG.memory_s, 0.0):
        found = _route()
        assert memory.update(found, (20.0, 100.0), TARGET, _vessel(), at_s) is found
    return memory


DETOUR = Route(np.array([(120.0, 100.0), (120.0, 10.0), (380.0, 10.0), TARGET]), 440.0, TARGET)
"""Round a loop there is another way when a reflection cuts this one."""
SHORT_CUT = Route(np.array([(120.0, 100.0), (200.0, 130.0), TARGET]), 150.0, TARGET)
"""Where another turn of the vessel seems to touch this one."""


def test_a_short_gap_ahead_does_not_undo_it(memory: RouteMemory) -> None:
    left = memory.update(WHY, (120.0, 106.0), TARGET, _vessel((200, 235)), 0.0)
    assert isinstance(left, Route)
    assert left.length_px == pytest.approx(260.0, abs=2.0)
    assert left.points[0] == pytest.approx((120.0, 100.0), abs=1.0)
    assert left.points[-1] == pytest.approx(TARGET, abs=1e-6)
    assert left.target == TARGET


def test_a_long_gap_does(memory: RouteMemory) -> None:
    assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel((200, 250)), 0.0) == WHY
    assert isinstance(memory.update(WHY, (250.0, 100.0), TARGET, _vessel((200, 250)), 0.0), Route), "it lies behind the head now"


def test_a_head_that_is_elsewhere_has_no_way(memory: RouteMemory) -> None:
    assert memory.update(WHY, (120.0, 135.0), TARGET, _vessel((200, 230)), 0.0) == WHY


def test_another_destination_has_to_be_found_itself(memory: RouteMemory) -> None:
    assert memory.update(WHY, (120.0, 100.0), (300.0, 100.0), _vessel(), 0.0) == WHY
    assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel(), 0.0) == WHY, "and the old one is forgotten with it"


def test_what_is_found_anew_and_lasts_replaces_it(memory: RouteMemory) -> None:
    around = Route(np.linspace((120.0, 100.0), (120.0, 190.0), 50), 500.0, TARGET)
    assert memory.update(around, (120.0, 100.0), TARGET, _vessel(), 1.0) is not around
    assert memory.update(around, (120.0, 100.0), TARGET, _vessel(), 1.5) is around
    left = memory.update(WHY, (120.0, 120.0), TARGET, np.ones((200, 400), np.bool_), 1.6)
    assert isinstance(left, Route)
    assert left.points[-1] == pytest.approx((120.0, 190.0))


def test_a_way_that_was_found_for_a_moment_only_holds_over_nothing() -> None:
    """One frame in which two vessels seem to touch must not lead the robot for as long as nothing else is found."""
    memory = RouteMemory(CONFIG)
    head, cut = (120.0, 100.0), _vessel((200, 212))
    assert memory.update(SHORT_CUT, head, TARGET, _vessel(), 0.0) is SHORT_CUT
    assert memory.update(WHY, head, TARGET, cut, 0.03) == WHY
    found = _route(120.0)
    assert memory.update(found, head, TARGET, _vessel(), 0.06) is found, "and stands against nothing"
    for at_s in (0.1, 0.3, 0.5):
        assert memory.update(_route(120.0), head, TARGET, _vessel(), at_s)
        assert memory.update(WHY, head, TARGET, cut, at_s + 0.01) == WHY
    memory.update(_route(120.0), head, TARGET, _vessel(), 0.56)
    assert isinstance(memory.update(WHY, head, TARGET, cut, 0.6), Route), "found for half a second, but for moments"


def test_finds_long_apart_are_no_lasting(memory: RouteMemory) -> None:
    memory.reset()
    for at_s in (1.0, 3.0, 5.0):
        memory.update(_route(120.0), (120.0, 100.0), TARGET, _vessel(), at_s)
        assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel(), at_s + 0.1) == WHY


def test_parts_outside_the_picture_are_gaps(memory: RouteMemory) -> None:
    assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel()[:, :330], 0.0) == WHY
    assert isinstance(memory.update(WHY, (120.0, 100.0), TARGET, _vessel()[:, :360], 0.0), Route)


def test_at_its_end_the_destination_is_reached(memory: RouteMemory) -> None:
    left = memory.update(WHY, (390.0, 100.0), TARGET, _vessel(), 0.0)
    assert isinstance(left, Route)
    assert left.length_px == 0.0
    assert left.points == pytest.approx(np.array([TARGET]))


def test_what_a_frame_found_that_was_not_believed_is_not_kept(memory: RouteMemory) -> None:
    memory.settle(is_believed=True)
    elsewhere = Route(np.linspace((120.0, 190.0), TARGET, 50), 280.0, TARGET)
    assert memory.update(elsewhere, (120.0, 190.0), TARGET, _vessel(), 0.1) is elsewhere, "it is shown"
    memory.settle(is_believed=False)
    memory.settle(is_believed=False)  # a frame in which nobody asked for a way
    left = memory.update(WHY, (120.0, 100.0), TARGET, _vessel((200, 235)), 0.2)
    assert isinstance(left, Route)
    assert left.length_px == pytest.approx(260.0, abs=2.0)


def test_a_way_that_was_forgotten_does_not_come_back_with_a_frame_that_was_not_believed(memory: RouteMemory) -> None:
    memory.settle(is_believed=True)
    assert memory.update(WHY, (120.0, 100.0), (300.0, 100.0), _vessel(), 0.1) == WHY, "another destination"
    memory.settle(is_believed=False)
    assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel((200, 212)), 0.2) == WHY


def test_forgotten_is_forgotten(memory: RouteMemory) -> None:
    memory.reset()
    assert memory.update(WHY, (120.0, 100.0), TARGET, _vessel(), 0.0) == WHY


@pytest.mark.parametrize("other", [DETOUR, SHORT_CUT], ids=["detour", "short cut"])
def test_another_way_of_a_moment_is_not_taken(memory: RouteMemory, other: Route) -> None:
    head, cut = (120.0, 100.0), _vessel((200, 212))
    left = memory.update(other, head, TARGET, cut, 0.1)
    assert isinstance(left, Route)
    assert left.length_px == pytest.approx(260.0, abs=2.0)
    assert memory.update(other, head, TARGET, cut, CONFIG.memory_s + 0.1) is other, "what lasts is true: perhaps the way was none"
    assert memory.update(other, head, TARGET, cut, CONFIG.memory_s + 0.2) is other


@pytest.mark.parametrize("other", [DETOUR, SHORT_CUT], ids=["detour", "short cut"])
def test_nor_is_it_when_the_way_was_not_found_for_long(memory: RouteMemory, other: Route) -> None:
    head, cut = (120.0, 100.0), _vessel((200, 212))
    assert isinstance(memory.update(WHY, head, TARGET, cut, 5.0), Route)
    left = memory.update(other, head, TARGET, cut, 5.03)
    assert left is not other
    assert memory.update(_route(120.0), head, TARGET, _vessel(), 5.3) is not left
    assert memory.update(other, head, TARGET, cut, 5.6) is not other, "it has been seen to be none meanwhile"


_ARC = np.linspace(0.0, np.pi, 100)
ABOVE, BELOW = (
    Route(np.column_stack([250.0 - 130.0 * np.cos(_ARC), 100.0 + side * 60.0 * np.sin(_ARC)]), length_px, TARGET)
    for side, length_px in ((-1.0, 311.0), (1.0, 309.0))
)
"""Round a loop both ways are as long: which one is the shorter hangs on a pixel."""


def test_round_a_loop_the_way_does_not_change_from_frame_to_frame() -> None:
    memory, head = RouteMemory(CONFIG), (120.0, 100.0)
    vessel = np.ones((200, 400), np.bool_)
    for step in range(18):
        assert memory.update(ABOVE, head, TARGET, vessel, step / 30) is ABOVE
    for step in range(18, 60):
        told = memory.update((ABOVE, BELOW)[step % 2], head, TARGET, vessel, step / 30)
        assert isinstance(told, Route)
        assert told.points[50][1] == pytest.approx(40.0, abs=1.0), "above"
    for step in range(60, 80):
        told = memory.update(BELOW, head, TARGET, vessel, step / 30)
    assert told is BELOW, "what lasts is true"


def test_other_ways_that_contradict_each_other_are_not_taken(memory: RouteMemory) -> None:
    head, cut = (120.0, 100.0), _vessel((200, 212))
    for step in range(40):
        told = memory.update((DETOUR, SHORT_CUT)[step % 2], head, TARGET, cut, 0.1 + step / 30)
        assert isinstance(told, Route)
        assert told.length_px == pytest.approx(260.0, abs=2.0)
