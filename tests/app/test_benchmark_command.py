"""What is timed is what a stream costs."""

from __future__ import annotations

import pytest

from app.benchmark_command import _as_in_a_stream
from core.config import load_config


@pytest.mark.parametrize(("configured", "timed"), [("pictures", "never"), ("always", "always"), ("never", "never")])
def test_frames_are_timed_as_often_seen_as_in_a_stream(configured: str, timed: str) -> None:
    config = load_config(None, None, {"perception": {"segmentation": {"mirrored": configured, "threads": 1}}})
    segmentation = _as_in_a_stream(config).perception.segmentation
    assert (segmentation.mirrored, segmentation.threads) == (timed, 1)
