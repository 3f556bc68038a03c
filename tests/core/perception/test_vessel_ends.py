"""Ends of vessels: between their walls instead of into a corner, and on to the image's border."""

import numpy as np
import pytest

from core.perception.vessel_graph import led_on
from core.types import Mask, Points
from tests.core.drawing import SIZE, depth

LIMIT = np.array(SIZE) - 1.0


def vessel(line: Points, radius: float) -> Mask:
    return np.asarray(depth(line, radius) >= 0.0)


def bend(last_deg: float, radius: float) -> Points:
    """A circle around (320, 240), clockwise from the left, a point about every 2 px."""
    angle = np.radians(np.arange(-180.0, last_deg, np.degrees(2.0 / radius)))
    return np.column_stack([320.0 + radius * np.cos(angle), 240.0 + radius * np.sin(angle)])


def hooked(line: Points, count: int, by_px: float) -> Points:
    """The last points moved outwards, more and more."""
    moved = line.copy()
    outward = (line - [320.0, 240.0]) / np.hypot(*(line - [320.0, 240.0]).T)[:, None]
    moved[-count:] += (by_px * (np.arange(1, count + 1) / count) ** 2)[:, None] * outward[-count:]
    return moved


@pytest.mark.parametrize("around_px", [70.0, 100.0, 150.0])
@pytest.mark.parametrize("radius", [9.0, 14.0])
def test_a_vessel_that_ends_in_a_bend_bends_to_its_end(radius: float, around_px: float) -> None:
    line = bend(20.0, around_px)
    found = led_on(hooked(line, round(0.6 * radius), 0.7 * radius), radius, vessel(line, radius))
    aside = np.abs(np.hypot(*(found - [320.0, 240.0]).T) - around_px)
    assert aside.max() < 1.2
    assert np.hypot(*(found[-1] - line[-1])) < 0.6 * radius, "it ends where it ended"
    assert np.hypot(*np.diff(found, axis=0).T).max() < 3.0


def test_it_goes_on_to_the_border_that_cuts_it_off() -> None:
    line = np.column_stack([np.arange(200.0, 700.0, 2.0), np.linspace(200.0, 260.0, 250)])
    found = led_on(line[line[:, 0] < 625.0], 12.0, vessel(line, 12.0))
    assert found[-1, 0] == pytest.approx(LIMIT[0], abs=0.5)
    assert np.abs(found[:, 1] - np.interp(found[:, 0], line[:, 0], line[:, 1])).max() < 0.8


def test_a_short_stump_keeps_a_third_and_its_length() -> None:
    line = np.column_stack([np.arange(300.0, 320.0, 2.0), np.full(10, 240.0)])
    found = led_on(line, 20.0, vessel(np.array([[280.0, 240.0], [340.0, 240.0]]), 20.0))
    assert found[-1] == pytest.approx(line[-1], abs=1.0)
    assert found[0] == pytest.approx(line[0])


def test_where_no_wall_is_seen_it_goes_on_as_it_was() -> None:
    line = bend(0.0, 100.0)
    found = led_on(line, 14.0, np.ones((SIZE[1], SIZE[0]), np.bool_))
    assert np.abs(np.hypot(*(found - [320.0, 240.0]).T) - 100.0).max() < 2.0
