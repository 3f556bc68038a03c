import numpy as np
import pytest

from core import geometry
from core.geometry import Bundle
from core.types import Points
from tests.core.drawing import curve

CORNER = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 40.0]])


def test_a_cut_keeps_inner_corners_and_is_clamped_to_the_ends() -> None:
    assert geometry.cut(CORNER, 20.0, 35.0).tolist() == [[20, 0], [30, 0], [30, 5]]
    assert geometry.cut(CORNER, -5.0, 500.0).tolist() == CORNER.tolist()


def test_smoothing_that_keeps_bends_leaves_a_circle_where_it_is() -> None:
    """By hand: a Gaussian of 8 px draws a circle of radius 40 inwards by 8^2 / 80 = 0.8 px."""
    angle = np.arange(0, 2.0, 0.05)
    circle = 40.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    inner = slice(13, -13)
    drawn = 40.0 - np.hypot(*geometry.smooth(circle, 4.0)[inner].T)
    kept = 40.0 - np.hypot(*geometry.smooth(circle, 4.0, keeps_bends=True)[inner].T)
    assert drawn == pytest.approx(0.8, abs=0.05)
    assert np.abs(kept).max() < 0.02
    rough = np.random.default_rng(4).normal(0, 0.5, circle.shape)
    smoothed = geometry.smooth(circle + rough, 5.0, keeps_bends=True)[16:-16]
    assert np.hypot(*smoothed.T).std() < 0.25


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 9, 13, 20])
def test_the_ends_of_a_bend_and_short_bends_are_kept_better_than_by_a_gaussian(count: int) -> None:
    angle = 0.05 * np.arange(count)
    arc = 40.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    kept, drawn = (np.abs(40.0 - np.hypot(*geometry.smooth(arc, 4.5, keeps_bends=keeps).T)).max() for keeps in (True, False))
    assert kept < 0.25
    assert kept <= drawn + 1e-9


@pytest.mark.parametrize("over_px", [20.0, 30.0, 60.0])
def test_a_short_line_goes_on_with_half_the_bend_that_it_has(over_px: float) -> None:
    """A circle of 40 px radius, of which 20 px are known."""
    angle = np.linspace(0.0, 0.5, 41)
    line = 40.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    onward = geometry.extrapolate(line, 20.0, over_px)
    heading = np.unwrap(np.arctan2(*np.diff(onward, axis=0).T[::-1]))
    assert heading[0] == pytest.approx(0.44, abs=0.01)  # its last half has 0.375
    assert np.diff(heading) == pytest.approx(0.5 / 40.0, rel=0.05)


LINES = [
    curve((0, 0), (40, 10), (90, 60)),
    np.array([[5.0, 5.0], [8.0, 9.0]]),
    np.array([[7.0, 7.0]]),
    curve((200, 10), (210, 14), (216, 22)),
    np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 40.0]]),
]
ALL = Bundle.of(LINES)


@pytest.mark.parametrize("step_px", [1.0, 2.0, 7.5])
def test_resampling_is_that_of_each_line(step_px: float) -> None:
    found = ALL.resample(step_px)
    for line, again in zip(LINES, found.split(found.points), strict=True):
        np.testing.assert_allclose(again, geometry.resample(line, step_px), atol=1e-9)


@pytest.mark.parametrize("keeps_bends", [False, True])
@pytest.mark.parametrize("sigma", [1.0, 4.0])
def test_smoothing_and_normals_are_those_of_each_line(sigma: float, keeps_bends: bool) -> None:
    even = ALL.resample(2.0)
    smooth = even.smooth(sigma, keeps_bends=keeps_bends)
    normals = Bundle(smooth.normals(), smooth.starts)
    for line, again, across in zip(
        even.split(even.points), smooth.split(smooth.points), normals.split(normals.points), strict=True
    ):
        np.testing.assert_allclose(again, geometry.smooth(line, sigma, keeps_bends=keeps_bends), atol=1e-9)
        if len(line) > 1:
            np.testing.assert_allclose(across, geometry.normals(again), atol=1e-9)


@pytest.mark.parametrize("lines", [[], [np.array([[3.0, 4.0]])], [np.array([[3.0, 4.0], [3.0, 4.0]])]])
def test_no_line_and_lines_of_no_length(lines: list[Points]) -> None:
    few = Bundle.of(lines)
    even = few.resample(2.0).smooth(4.0)
    assert [line.tolist() for line in even.split(even.points)] == [[[3.0, 4.0]]] * len(lines)


def test_outlines_go_around_what_is_above_with_it_on_their_right_and_begin_at_the_lowest_place() -> None:
    values = np.zeros((7, 7))
    values[1:6, 1:6], values[3, 3] = 1.0, 0.0
    outer, hole = geometry.outlines(values, 0.5)
    assert np.array_equal(outer[0], outer[-1])
    assert outer[:, 1].max() == outer[0, 1] == 5.5
    area = [np.sum(line[:-1, 0] * line[1:, 1] - line[1:, 0] * line[:-1, 1]) / 2 for line in (outer, hole)]
    assert area == pytest.approx([24.5, -0.5]), "corners cut off"
    values = np.zeros((4, 4))
    values[1, 1] = values[2, 2] = 1.0
    assert len(geometry.outlines(values, 0.5 - 1e-9)) == 1, "neighbours by a corner"


def test_a_thinned_line_keeps_its_corners_and_comes_near_every_point() -> None:
    line = np.array([(0.0, 0.0), (1.0, 0.05), (2.0, 0.0), (2.0, 1.0), (2.0, 2.0)])
    assert geometry.thinned(line, 0.1).tolist() == [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]
    around = np.column_stack([np.cos(angles := np.linspace(0.0, 2 * np.pi, 200)), np.sin(angles)])
    few = geometry.thinned(around, 0.02)
    assert len(few) < 30
    assert max(geometry.nearest(few, (x, y))[0] for x, y in around.tolist()) <= 0.02
    assert np.array_equal(geometry.thinned(line[:1], 0.1), line[:1])
