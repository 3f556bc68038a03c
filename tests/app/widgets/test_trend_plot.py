"""The last thirty seconds as curves."""

from __future__ import annotations

import numpy as np
import pytest

from app.widgets.trend_plot import SPAN_S, TrendPlot
from core.config.models import PoseConfig
from tests.app.fakes import make_pose, make_scene
from tests.app.widgets.conftest import Own

LIMITS = PoseConfig()


def test_frames_without_a_pose_are_gaps(own: Own) -> None:
    plot = own(TrendPlot(LIMITS))
    for k in range(5):
        plot.add(make_scene(None if k == 2 else make_pose(theta=float(k)), captured_s=k * 0.1))
    plot._draw()
    ago, theta = plot.curves[0].getData()
    np.testing.assert_allclose(ago, [-0.4, -0.3, -0.2, -0.1, 0.0], atol=1e-9)
    np.testing.assert_array_equal(theta, [0.0, 1.0, np.nan, 3.0, 4.0])


def test_trends_hold_thirty_seconds_and_restart_when_the_clock_jumps_back(own: Own) -> None:
    plot = own(TrendPlot(LIMITS))
    for k in range(1200):
        plot.add(make_scene(make_pose(), captured_s=k / 30))
    plot._draw()
    ago, _ = plot.curves[0].getData()
    assert ago[0] == pytest.approx(-SPAN_S, abs=0.04)
    plot.add(make_scene(make_pose(), captured_s=0.0))
    plot._draw()
    assert len(plot.curves[0].getData()[0]) == 1
