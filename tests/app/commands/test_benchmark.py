"""What is timed is what a stream costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.commands import benchmark
from app.commands.benchmark import measure_speed, stream_config
from core.config.models import load_config
from core.devices import UserError


@pytest.mark.parametrize(("configured", "timed"), [("pictures", "never"), ("always", "always"), ("never", "never")])
def test_frames_are_timed_as_often_seen_as_in_a_stream(configured: str, timed: str) -> None:
    config = load_config(None, None, {"perception": {"segmentation": {"mirrored": configured, "threads": 1}}})
    segmentation = stream_config(config).perception.segmentation
    assert (segmentation.mirrored, segmentation.threads) == (timed, 1)


def test_pictures_that_are_all_refused_cannot_be_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark, "_pictures", lambda count: iter([np.full((480, 640, 3), 90, np.uint8)] * count))
    (tmp_path / "dark.toml").write_text("[perception.quality]\nblack_level = 255.0\n")
    with pytest.raises(
        UserError, match=r"refused before there are masks to compare \(image black\); change \[perception.quality\]"
    ):
        measure_speed(load_config(tmp_path / "dark.toml"), 2)
