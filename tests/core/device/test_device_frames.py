"""Frames on a device are those on disk, and are shown in turn and by what was lost; the same code runs on any device."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from core.learning.augmentation import true_ends
from core.learning.dataset import DatasetError, Sample, find_samples
from core.learning.gpu_batches import MOST_ENDS, ROBOT, VESSEL, DeviceFrames, Share, Shown, fits, padded_places
from tests.core.device.device_set import CPU, generator, masks_of, picture_of, write_frame


def test_frames_are_what_is_on_disk(samples: list[Sample], frames: DeviceFrames) -> None:
    assert frames.size == (480, 640)
    for number, sample in enumerate(samples):
        image, vessel, robot = sample.load()
        packed = frames.pixels[number].numpy()
        assert np.array_equal(packed[..., :3], image)
        assert np.array_equal(packed[..., 3] & VESSEL > 0, vessel)
        assert np.array_equal(packed[..., 3] & ROBOT > 0, robot)
        told = [tuple(end) for end in frames.ends[number].tolist() if np.isfinite(end[0])]
        assert told == [(float(x), float(y)) for x, y in true_ends(robot)]
        assert len(told) == 1, "it comes in from the left"


def test_frames_of_several_sizes_stay_with_the_processor(samples: list[Sample], tmp_path: Path) -> None:
    write_frame(tmp_path, "wide", np.zeros((360, 640, 3), np.uint8), np.zeros((360, 640), bool), np.zeros((360, 640), bool))
    mixed = [*samples, *find_samples([tmp_path])]
    assert DeviceFrames.load(mixed, CPU, range(len(mixed))) is None


def test_a_frame_that_cannot_be_read_is_named(samples: list[Sample], tmp_path: Path) -> None:
    vessel, robot = masks_of()
    write_frame(tmp_path, "cut", picture_of(vessel, robot), vessel, robot)
    path = tmp_path / "images" / "cut.png"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(DatasetError, match=r"cut\.png"):
        DeviceFrames.load(find_samples([tmp_path]), CPU, range(1))


def test_reading_ends_where_it_is_told_to(samples: list[Sample]) -> None:
    two = DeviceFrames.load(samples, CPU, range(2))
    assert two is not None
    assert len(two) == len(two.ends) == 2
    assert DeviceFrames.load(samples, CPU, range(0)) is None


def test_no_processor_is_taken_for_a_gpu() -> None:
    assert not fits(1, 1, CPU)


def test_more_ends_than_are_told_are_left_out() -> None:
    assert padded_places([]).isinf().all()
    assert padded_places([(1.0, 2.0)] * (MOST_ENDS + 2)).tolist() == [[1.0, 2.0]] * MOST_ENDS


def test_a_frame_that_is_given_twice_is_read_once_and_shown_twice(samples: list[Sample]) -> None:
    frames = DeviceFrames.load([samples[0], samples[1], samples[0]], CPU, range(2))
    assert frames is not None
    assert (len(frames), frames.turns.tolist()) == (2, [0, 1, 0])
    drawn, _ = Shown(frames.turns, 0.0, generator()).draw(6)
    assert torch.bincount(drawn).tolist() == [4, 2]
    hard, count = Shown(frames.turns, 0.9, generator()).draw(1000)
    assert count == 900
    assert float((hard[:count] == 0).float().mean()) == pytest.approx(2 / 3, abs=0.06)


def test_all_frames_are_shown_in_turn() -> None:
    shown = Shown(torch.arange(10), 0.0, generator())
    drawn = torch.cat([shown.draw(4)[0] for _ in range(5)])
    assert sorted(drawn[:10].tolist()) == sorted(drawn[10:].tolist()) == list(range(10))
    assert drawn[:10].tolist() != drawn[10:].tolist()


def test_what_was_lost_is_shown_more_often() -> None:
    shown = Shown(torch.arange(20), 0.5, generator())
    for _ in range(30):
        numbers, hard = shown.draw(8)
        assert hard == 4
        shown.note((numbers == 7).float())
    drawn = torch.cat([shown.draw(40)[0][:20] for _ in range(10)])
    counts = torch.bincount(drawn, minlength=20)
    assert counts[7] > 5 * counts[:7].max()
    assert (counts > 0).sum() > 10, "what is known may be drawn, too"


def test_a_frame_that_is_shown_twice_at_once_counts_by_the_mean_and_nothing_that_is_no_number_counts() -> None:
    shown = Shown(torch.tensor([0, 0, 1]), 0.0, generator())
    numbers, _ = shown.draw(3)
    first, second = (int(place) for place in (numbers == 0).nonzero())
    lost = torch.zeros(3)
    lost[first], lost[second] = 1.0, 0.5
    lost[3 - first - second] = torch.nan
    shown.note(lost)
    assert shown._lost.tolist() == pytest.approx([0.15 + 0.375, 0.15])
    shown.note(torch.ones(3), torch.zeros(3, dtype=torch.bool))
    assert shown._lost.tolist() == pytest.approx([0.525, 0.15]), "what shows nothing of a frame tells nothing of it"


@pytest.mark.parametrize("batch", [1, 2, 12])
def test_shares_come_true_over_small_batches(batch: int) -> None:
    share = Share(0.35)
    assert sum(share.of(batch) for _ in range(600 // batch)) == 210
    assert Share(1.0).of(batch) == batch
    assert Share(0.0).of(batch) == 0
