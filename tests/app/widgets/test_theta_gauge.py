"""The angle on its dial."""

from __future__ import annotations

import numpy as np
import pytest

from app.ui import theme
from app.widgets.theta_gauge import ThetaGauge
from tests.app.fakes import make_pose
from tests.app.widgets.conftest import Own


def test_gauge_shows_sign_number_and_side(own: Own) -> None:
    gauge = own(ThetaGauge(10.0))
    assert (gauge.text, gauge.direction) == ("–", "")
    gauge.show_pose(make_pose(theta=18.44))
    assert (gauge.text, gauge.direction) == ("+18.4°", "right")
    gauge.show_pose(make_pose(theta=-132.0))
    assert (gauge.text, gauge.direction) == ("−132.0°", "left")
    gauge.show_pose(None)
    assert gauge.text == "–"


@pytest.mark.parametrize(("theta", "side"), [(60.0, 1), (-60.0, -1), (170.0, 1), (-170.0, -1)])
def test_needle_points_to_the_side_of_the_sign(own: Own, theta: float, side: int) -> None:
    gauge = own(ThetaGauge(10.0), 300, 200)
    gauge.show_pose(make_pose(theta=theta))
    image = gauge.grab().toImage()
    needle = [
        x for x in range(image.width()) for y in range(image.height()) if image.pixelColor(x, y).name().upper() == theme.THETA
    ]
    assert needle
    assert (np.mean(needle) - image.width() / 2) * side > 5
