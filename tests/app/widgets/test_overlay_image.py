"""Overlay pictures: any size, every kind of scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.ui import theme
from app.widgets import overlay_image
from app.widgets.overlay_image import draw_overlay
from core.types import PoseState, Reason, Refusal, Scene
from tests.app.fakes import FakeBench, advise, make_pose, make_scene


def count(picture: np.ndarray, name: str, tolerance: int = 6) -> int:
    """Pixels of a colour."""
    return int((np.abs(picture.astype(int) - theme.rgb(name)).max(axis=2) <= tolerance).sum())


def test_small_pictures_are_enlarged_large_ones_keep_their_size(bench: FakeBench) -> None:
    image, scene = bench.scene_at(0, 6.0)
    before = image.copy()
    picture = draw_overlay(image, scene)
    assert picture.dtype == np.uint8
    assert picture.shape[:2] == (960 + 104, 1280)
    assert draw_overlay(image, scene, longer_side_px=1).shape[1] == 640
    np.testing.assert_array_equal(image, before)


def test_the_bands_that_it_is_tinted_in_leave_no_trace(bench: FakeBench, monkeypatch: pytest.MonkeyPatch) -> None:
    image, scene = bench.scene_at(0, 6.0)
    in_bands = draw_overlay(image, scene)
    monkeypatch.setattr(overlay_image, "_BAND_ROWS", 100_000)
    np.testing.assert_array_equal(in_bands, draw_overlay(image, scene))


def test_everything_that_was_understood_is_there(bench: FakeBench) -> None:
    image, scene = bench.scene_at(0, 6.0)
    plain = draw_overlay(image, make_scene())
    drawn = draw_overlay(image, scene, advise(scene))
    for name in (theme.ROBOT_VECTOR, theme.VESSEL_VECTOR, theme.D_HEAD, theme.D_TAIL, theme.ROBOT, theme.VESSEL):
        assert count(drawn, name) > count(plain, name) + 30, name


@pytest.mark.parametrize("state", list(PoseState))
def test_caption_shows_the_state_in_its_colour(state: PoseState) -> None:
    image = np.full((480, 640, 3), 128, np.uint8)
    strip = draw_overlay(image, make_scene(make_pose(state)))[960:]
    assert count(strip, theme.STATE_COLOUR[state]) > 500


def test_a_refusal_is_named_instead_of_values() -> None:
    image = np.full((480, 640, 3), 128, np.uint8)
    without = draw_overlay(image, make_scene(refusal=Refusal(Reason.BLACK)))
    other = draw_overlay(image, make_scene(refusal=Refusal(Reason.NO_ROBOT)))
    assert count(without[960:], theme.THETA) == 0
    assert (without != other).any()
    stamped = draw_overlay(image, make_scene(refusal=Refusal(Reason.BLACK)), stamp="SIM")
    assert count(stamped, theme.SIM) > count(without, theme.SIM) + 50


def test_head_is_magnified_only_where_it_covers_little(bench: FakeBench) -> None:
    image, scene = bench.scene_at(0, 6.0)
    canvas = np.zeros((960, 1280, 3), np.uint8)
    inset = overlay_image._place_inset(canvas, scene, 2.0)
    assert inset is not None and scene.path is not None and scene.masks is not None
    assert not inset.box.contains(round(2 * scene.path.head[0]), round(2 * scene.path.head[1])), "never over the head itself"
    full = replace(scene, masks=replace(scene.masks, vessel=np.ones_like(scene.masks.vessel)))
    assert overlay_image._place_inset(canvas, full, 2.0) is None
    assert draw_overlay(image, full).shape == (1064, 1280, 3)


@pytest.mark.parametrize("shape", [(1, 1), (1, 900), (900, 1), (3, 5000), (2160, 3840)])
def test_any_shape(shape: tuple[int, int]) -> None:
    image = np.zeros((*shape, 3), np.uint8)
    scene = Scene(0, 0.0, (shape[1], shape[0]), 640 / max(shape), refusal=Refusal(Reason.BLACK, "brightest 0 of 255"))
    picture = draw_overlay(image, scene, stamp="SIM")
    assert picture.shape[1] >= shape[1]
    assert picture.shape[0] > shape[0]
