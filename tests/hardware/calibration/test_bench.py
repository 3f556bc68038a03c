"""What the wizard believes of what its eyes see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from core.calibration.servos import HeadNotSeen, Look
from core.types import Frame, Reason, Refusal, Scene
from hardware.calibration.bench import observe_robot
from hardware.cameras.live import CameraFeed
from tests.core.session_data import full_scene


class _Feed:
    """Hands out as many frames as it is asked for."""

    def next_frames(self, count: int, _within_s: float, alive: Callable[[], None]) -> list[Frame]:
        alive()
        return [Frame(index, 0.0, np.zeros((64, 96, 3), np.uint8)) for index in range(count)]


def _observe(reason: Reason | None) -> Look:
    def see(frame: Frame) -> Scene:
        seen = full_scene(frame.index, 0.0)
        return seen if reason is None else replace(seen, pose=None, refusal=Refusal(reason, "1.30, at most 1.00"))

    return observe_robot(cast(CameraFeed, _Feed()), see, lambda: None)


@pytest.mark.parametrize("reason", [None, Reason.LOW_CONFIDENCE])
def test_a_path_that_was_found_counts(reason: Reason | None) -> None:
    """A robot at rest that several frames show alike is where it is, whatever its theta."""
    assert _observe(reason).head == pytest.approx((49.0, 32.0), abs=1.0)


def test_what_is_measured_is_told_in_working_pixels() -> None:
    def fine(frame: Frame) -> Scene:
        return replace(full_scene(frame.index, 0.0), source_size=(192, 128), scale=0.5, scale_xy=(0.5, 0.5))

    look = observe_robot(cast(CameraFeed, _Feed()), fine, lambda: None)
    assert look.scale == 0.5
    assert look.head == pytest.approx((98.5, 64.5), abs=2.0)


def test_a_picture_of_an_unknown_kind_calibrates_nothing_and_says_why() -> None:
    with pytest.raises(HeadNotSeen, match=r"head is not seen.*\(unlike the training data: 1.30"):
        _observe(Reason.UNLIKE_TRAINING)
