"""The view: board millimetres <-> pixels, by hand-computed examples and there-and-back."""

from __future__ import annotations

import numpy as np
import pytest

from core.types import GraphEdge, VesselGraph
from hardware.twin.phantom import Phantom
from hardware.twin.rendering.appearance import Appearance, make_view, random_appearance
from hardware.twin.view import CameraView

PLAIN = CameraView(np.array([[3.0, 0, 20], [0, 3, 10], [0, 0, 1]]), (640, 480))
TILTED = CameraView(np.array([[3.0, 0.2, 20], [-0.1, 2.8, 10], [0.0004, -0.0003, 1]]), (640, 480), -0.08)


def test_three_pixels_per_millimetre() -> None:
    assert PLAIN.project(np.array([[0.0, 0.0], [100.0, 50.0]])).tolist() == [[20, 10], [320, 160]]
    assert PLAIN.unproject(np.array([[320.0, 160.0]]))[0] == pytest.approx([100, 50])
    assert PLAIN.pixels_per_mm((70.0, 30.0)) == pytest.approx(3.0)


def test_barrel_distortion_pulls_towards_the_middle() -> None:
    # Half the diagonal of 640x480 is 400 px; a point 200 px right of the middle (0.5) moves to 200 * (1 - 0.1 * 0.25) = 195 px.
    view = CameraView(PLAIN.homography, (640, 480), -0.1)
    point = PLAIN.unproject(np.array([[319.5 + 200.0, 239.5]]))
    assert view.project(point)[0] == pytest.approx([319.5 + 195.0, 239.5])


@pytest.mark.parametrize("view", [PLAIN, TILTED, CameraView(TILTED.homography, (641, 361), 0.2)])
def test_there_and_back(view: CameraView) -> None:
    corners = np.array([[0.0, 0], [view.size[0] - 1, 0], [view.size[0] - 1, view.size[1] - 1], [17, 300], [320, 240]])
    assert np.abs(view.project(view.unproject(corners)) - corners).max() < 1e-6


def test_zoom_belongs_to_640_px_and_grows_with_the_image() -> None:
    small, large = (make_view(Appearance(), size) for size in ((640, 480), (1280, 960)))
    assert large.pixels_per_mm((80.0, 40.0)) == pytest.approx(2 * small.pixels_per_mm((80.0, 40.0)))


def _wide_phantom() -> Phantom:
    """A lumen along the whole board, port at its left rim."""
    line = np.column_stack([np.linspace(-1, 195, 400), np.linspace(20, 130, 400)])
    return Phantom("test", "Test", VesselGraph(line[[0, -1]], (GraphEdge(0, 1, line, np.full(400, 4.0)),)), 0)


@pytest.mark.parametrize("size", [(640, 480), (640, 360), (480, 640), (1280, 720)])
def test_port_and_most_of_the_lumen_stay_in_the_picture(size: tuple[int, int]) -> None:
    phantom = _wide_phantom()
    for seed in range(60):
        view = make_view(random_appearance(seed), size, phantom)
        pixels = view.project(phantom.graph.edges[0].points)
        inside = np.all((pixels >= 0) & (pixels <= np.array(size) - 1), axis=1)
        assert inside[0], f"port out of the picture, seed {seed}"
        assert inside.mean() >= 0.75, f"most of the lumen out of the picture, seed {seed}"
