"""The printed board as the twin's camera sees it."""

from __future__ import annotations

import numpy as np
import pytest

from core.calibration.camera import BoardSpec, BoardView, find_board, fit_lens, scale_of_board, undistort
from core.config.models import TwinConfig
from hardware.twin.rendering.calibration_board import BoardPictures


@pytest.mark.parametrize("twin", [{}, {"lens_distortion": -0.12}, {"appearance_seed": 3}])
def test_the_board_in_the_twin_gives_lens_and_scale(twin: dict[str, object]) -> None:
    config = TwinConfig.model_validate({"phantom": "tree", **twin})
    spec = BoardSpec()
    pictures = BoardPictures(config, spec)
    views = [find_board(pictures.picture(k, k), spec) for k in range(3)]
    lens = fit_lens(views, (640, 480))
    scale = scale_of_board([BoardView(undistort(view.pixels, lens), view.board_mm) for view in views], (640, 480))
    middle = pictures.view.unproject(np.array([[319.5, 239.5]]))[0]
    true = 1.0 / pictures.view.pixels_per_mm((float(middle[0]), float(middle[1])))
    assert scale.mm_per_px == pytest.approx(true, rel=0.003)
    assert lens.k1 == pytest.approx(pictures.view.distortion, abs=0.01)
    seen = {tuple(place) for place in np.round(views[0].board_mm / spec.square_mm - 1).astype(int).tolist()}
    index = [row * (spec.columns - 1) + column for column, row in seen]
    assert len(index) >= 12
