"""Overlay pictures: any size, every kind of scene."""

from __future__ import annotations

import numpy as np
import pytest

from app.ui import theme
from app.widgets.overlay_image import draw_overlay
from core.types import PoseState, Reason, Refusal
from tests.app.fakes import FakeBench, advise, make_pose, make_scene


def count(picture: np.ndarray, name: str, tolerance: int = 6) -> int:
    """Pixels of a colour."""
    return int((np.abs(picture.astype(int) - theme.rgb(name)).max(axis=2) <= tolerance).sum())


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
