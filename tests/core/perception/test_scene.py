"""A scene's way between working pixels and source pixels."""

import numpy as np
import pytest

from core.perception.segmentation import to_working
from core.types import Scene


def scene_of(width: int, height: int) -> Scene:
    # One channel is enough to see where a picture's pixels go.
    image, scale_xy = to_working(np.zeros((height, width, 1), np.uint8)[..., 0], 640)
    assert scale_xy == (image.shape[1] / width, image.shape[0] / height)
    return Scene(0, 0.0, (width, height), 640 / max(width, height), scale_xy=scale_xy)


@pytest.mark.parametrize(("width", "height"), [(3000, 1007), (7680, 4321), (5000, 7), (1007, 3000), (640, 480), (320, 200)])
def test_the_pictures_corners_map_onto_each_other(width: int, height: int) -> None:
    """Both sides are rounded to whole working pixels, each by itself: the corners of the picture stay its corners."""
    scene = scene_of(width, height)
    across, down = max(1, round(width * scene.scale)), max(1, round(height * scene.scale))
    corners = np.array([[-0.5, -0.5], [across - 0.5, down - 0.5], [across / 2 - 0.5, down / 2 - 0.5]])
    expected = [[-0.5, -0.5], [width - 0.5, height - 0.5], [width / 2 - 0.5, height / 2 - 0.5]]
    np.testing.assert_allclose(scene.points_to_source(corners), expected, atol=0.01)
    for corner, source in zip(corners.tolist(), expected, strict=True):
        assert scene.to_source(tuple(corner)) == pytest.approx(source, abs=0.01)
        assert scene.to_working(tuple(source)) == pytest.approx(corner, abs=0.01)


def test_one_scale_is_enough_where_both_are_the_same() -> None:
    scene = Scene(0, 0.0, (1280, 960), 0.5)
    assert scene.to_source((10.0, 20.0)) == (20.5, 40.5)
    assert scene.to_working((20.5, 40.5)) == (10.0, 20.0)
