"""Many polylines at once: the same numbers as line by line."""

import numpy as np
import pytest

from core import geometry
from core.geometry import Bundle
from core.types import Points
from tests.core.drawing import curve

LINES = [
    curve((0, 0), (40, 10), (90, 60)),
    np.array([[5.0, 5.0], [8.0, 9.0]]),
    np.array([[7.0, 7.0]]),
    curve((200, 10), (210, 14), (216, 22)),
    np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 40.0]]),
]
ALL = Bundle.of(LINES)


def test_lines_come_back_as_they_went_in() -> None:
    for line, again in zip(LINES, ALL.split(ALL.points), strict=True):
        assert again.tolist() == line.tolist()


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
