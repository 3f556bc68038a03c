"""What is kept of decoded frames is what was on disk, and memory that is short costs nothing but time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from core.learning import dataset
from core.learning.dataset import KeptFrames, Sample, write_mask, write_png


@pytest.fixture(params=[(480, 640), (427, 640)], ids=["whole bytes", "a width that leaves bits over"])
def sample(tmp_path: Path, request: pytest.FixtureRequest) -> Sample:
    height, width = request.param
    rng = np.random.default_rng(3)
    names = [tmp_path / f"{name}.png" for name in ("image", "vessel", "robot")]
    write_png(names[0], rng.integers(0, 256, (height, width, 3), np.uint8))
    for name in names[1:]:
        write_mask(name, rng.random((height, width)) < 0.5)
    return Sample("0", *names)


def test_a_kept_frame_is_the_one_on_disk(sample: Sample) -> None:
    kept = KeptFrames(1)
    first = kept.frame(sample)
    for path in (sample.image, sample.vessel, sample.robot):
        path.unlink()
    for one, again in zip(first, kept.frame(sample), strict=True):
        assert again.dtype == one.dtype
        assert np.array_equal(one, again)


def test_without_room_frames_are_read_again(sample: Sample, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dataset, "_free_memory", lambda: 0.0)
    kept = KeptFrames(1)
    kept.frame(sample)
    write_mask(sample.robot, np.zeros(kept.frame(sample)[1].shape, bool))
    assert not kept.frame(sample)[2].any()


def test_what_is_made_quicker_leaves_its_room_to_the_frames() -> None:
    made: list[int] = []

    def make() -> tuple[np.ndarray, ...]:
        made.append(1)
        return (np.zeros(10, np.uint8),)

    roomy, narrow = KeptFrames(1), KeptFrames(10**9)
    for kept in (roomy, narrow):
        for _ in range(3):
            kept.get("seen", make)
    assert len(made) == 1 + 3
