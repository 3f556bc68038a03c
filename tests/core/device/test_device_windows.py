"""Windows that a GPU makes itself show what those of a processor show; the same code runs on any device."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import pytest
import torch
from torch import Tensor, nn

from core.learning.augmentation import EDGE_PX, _wrong
from core.learning.gpu_batches import (
    MOST_ENDS,
    ROBOT,
    VESSEL,
    DeviceFrames,
    DeviceWindows,
    _far,
    _turned,
    first_looks,
    padded_places,
)
from core.learning.training import train
from core.learning.training_plan import TrainingPlan
from core.perception.tip_refinement import WINDOW_PX, places_to_look
from core.perception.unet import DualUNet, UNetShape
from tests.core.device.device_set import told_by_colour


class _Says(nn.Module):
    """A network that sees the same everywhere, and counts how many windows it was asked about."""

    def __init__(self, logit: float) -> None:
        super().__init__()
        self.logit, self.asked = logit, 0

    def forward(self, planes: Tensor) -> Tensor:
        self.asked += len(planes)
        return torch.full((len(planes), 2, *planes.shape[2:]), self.logit)


def _seen(frames: DeviceFrames) -> tuple[Tensor, Tensor]:
    """As if the first look had missed the robot's last 60 px, in the first frame only."""
    bits = frames.pixels[..., 3]
    seen = torch.stack([(bits & VESSEL) > 0, (bits & ROBOT) > 0], dim=-1).to(torch.uint8) * 255
    seen[0, :, 272:, 1] = 0
    places = [padded_places(places_to_look(robot.numpy().astype(np.float32) / 255)) for robot in seen[..., 1]]
    return seen, torch.stack(places)


@pytest.mark.parametrize("batch", [1, 4, 12])
def test_windows_come_in_all_orientations_whatever_the_batch(
    frames: DeviceFrames, batch: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways: list[int] = []

    def watched(planes: Tensor, ends: Tensor, way: int) -> tuple[Tensor, Tensor]:
        ways.extend([way] * len(planes))
        return _turned(planes, ends, way)

    monkeypatch.setattr("core.learning.gpu_batches._turned", watched)
    batches = iter(DeviceWindows(frames, *_seen(frames), TrainingPlan(batch=batch, look_share=0.0)))
    for _ in range(24 // batch):
        next(batches)
    assert np.bincount(ways).tolist() == [3] * 8


def test_a_tip_and_a_wall_that_are_wrong_are_shown_as_often(frames: DeviceFrames) -> None:
    seen, places = _seen(frames)
    seen[0, :176, :, 0] = 0
    seen[0, 150:180, 250:360, 0] = 255  # a wall that was found 30 px aside, beside the end
    windows = DeviceWindows(frames, seen, places, TrainingPlan(batch=1))
    robot, vessel = windows._wrong(torch.zeros(2, dtype=torch.long), 1)
    assert vessel[0].sum() > 3 * robot[0].sum() > 300
    assert not vessel[1].any()
    centers = windows._centers(torch.zeros(24, dtype=torch.long), 24)
    beside = (centers[:, 1] < 182).float()
    assert 0.3 < float(beside.mean()) < 0.75, "the wall is much larger than the tip"


@pytest.mark.parametrize("focus", [0.0, 0.5])
def test_windows_keep_picture_labels_and_ends_together(frames: DeviceFrames, focus: float) -> None:
    plan = TrainingPlan(batch=24, look_share=0.0, end_weight=4, focus_share=focus)
    planes, labels = next(iter(DeviceWindows(frames, *_seen(frames), plan)))
    assert planes.shape == (24, 5, WINDOW_PX, WINDOW_PX)
    vessel, robot, unsure = told_by_colour(planes)
    assert not unsure.any(), "no window is scaled or slanted"
    assert torch.equal(labels[:, 0] > 0, vessel)
    assert torch.equal(labels[:, 1] > 0, robot)
    assert torch.equal(planes[:, 3] > 127, vessel)
    missed = (planes[:, 4] <= 127) & robot
    assert (missed.sum(dim=(1, 2)) > 0).any()
    assert not ((planes[:, 4] > 127) & ~robot).any()
    told = labels[:, 2].flatten(1).max(dim=1)
    for near, mask, at in zip(labels[:, 2], labels[:, 1], told.indices, strict=True):
        if near.max() > 250:
            row, column = divmod(int(at), WINDOW_PX)
            assert mask[row, column] == 1
            around = mask[max(0, row - 10) : row + 11, max(0, column - 10) : column + 11]
            assert 0 < float(around.mean()) < 0.5, "a robot ends here"
    assert (told.values > 250).sum() > 10


def test_half_of_the_windows_come_with_what_was_seen_in_the_end(frames: DeviceFrames) -> None:
    plan = TrainingPlan(batch=24, look_share=0.0)
    windows, network = DeviceWindows(frames, *_seen(frames), plan), _Says(0.0)
    windows.watch(network)
    planes, labels = next(iter(windows))
    assert network.asked == 12
    half = (planes[:, 3] > 125) & (planes[:, 3] < 130)
    looked = half.flatten(1).any(dim=1)
    assert looked.sum() == 12
    shares = half[looked].float().mean(dim=(1, 2))
    assert (shares > 0.5).all()
    assert (shares < 1).any(), "it was a window a bit beside"
    plain = ~looked
    assert torch.equal(planes[plain][:, 3] > 127, labels[plain][:, 0] > 0)


def test_of_single_windows_every_second_one_is_looked_at_again(frames: DeviceFrames) -> None:
    windows, network = DeviceWindows(frames, *_seen(frames), TrainingPlan(batch=1, look_share=0.0)), _Says(0.0)
    windows.watch(network)
    batches = iter(windows)
    asked = []
    for _ in range(6):
        next(batches)
        asked.append(network.asked)
    assert asked == [0, 1, 1, 2, 2, 3]


def test_examples_are_what_the_first_look_gives(frames: DeviceFrames) -> None:
    windows, network = DeviceWindows(frames, *_seen(frames), TrainingPlan(batch=4)), _Says(3.0)
    windows.watch(network)
    examples = windows.examples(5)
    assert [one.shape for one in examples] == [(WINDOW_PX, WINDOW_PX, 5)] * 5
    assert all(one.dtype == np.uint8 and one.flags.c_contiguous for one in examples)
    assert not network.asked, "when the training is over the network is somewhere else"


@pytest.mark.parametrize("way", range(8))
def test_windows_are_turned_with_their_ends(way: int) -> None:
    planes = torch.zeros((1, 1, 9, 9))
    planes[0, 0, 2, 7] = 1
    ends = torch.tensor([[[7.0, 2.0], [torch.inf, torch.inf]]])
    turned, there = _turned(planes, ends, way)
    x, y = (round(value) for value in there[0, 0].tolist())
    assert turned[0, 0, y, x] == 1
    assert there[0, 1].tolist() == [torch.inf, torch.inf]


def test_the_eight_ways_are_different() -> None:
    planes = torch.arange(9.0).view(1, 1, 3, 3)
    ends = torch.full((1, 1, 2), torch.inf)
    seen = {tuple(_turned(planes, ends, way)[0].flatten().tolist()) for way in range(8)}
    assert len(seen) == 8


def test_what_is_far_is_what_a_processor_calls_wrong() -> None:
    rng = np.random.default_rng(1)
    true, found = (cv2.GaussianBlur(rng.random((80, 120)).astype(np.float32), (0, 0), 6) > 0.5 for _ in range(2))
    wanted = _wrong(found, true, EDGE_PX)
    far = _far(torch.from_numpy(found)[None], torch.from_numpy(true)[None], EDGE_PX)[0].numpy()
    assert wanted.sum() > 200
    assert (far ^ wanted).sum() < 0.08 * wanted.sum(), "an octagon is nearly a disc"
    band = np.zeros((40, 60), bool)
    band[10:20] = True
    blurred = np.roll(band, EDGE_PX - 1, axis=0)
    assert not _far(torch.from_numpy(blurred)[None], torch.from_numpy(band)[None], EDGE_PX).any()


class _Colours(nn.Module):
    """A first look that goes by the colours of ``picture_of``, and takes a picture's left half for something else."""

    def forward(self, images: Tensor) -> Tensor:
        logits = torch.stack([images[:, 0] - 0.5, images[:, 1] - 0.5], dim=1) * 20
        logits[..., : images.shape[3] // 2] -= 20
        return logits


def test_every_second_first_look_is_the_mean_with_the_mirror_image(frames: DeviceFrames) -> None:
    told: list[int] = []

    def track() -> itertools.chain[int]:
        return itertools.chain((told.append(n) or n for n in range(len(frames))), iter(lambda: told.append(-1) or 0, 0))

    looks = first_looks(_Colours(), 64, frames, track())
    assert looks is not None
    seen, places = looks
    assert seen.shape == (4, 480, 640, 2)
    assert told == [0, 1, 2, 3, -1], "the bar is told of the end"
    # Plain: nothing is seen on the left. Mirrored: on neither side for sure.
    assert seen[0, 200, 100, 0] < 5
    assert seen[0, 200, 400, 0] > 250
    assert abs(int(seen[1, 240, 100, 0]) - 127) < 5
    assert abs(int(seen[1, 240, 400, 0]) - 127) < 5
    assert places.shape == (4, MOST_ENDS, 2)


def test_first_looks_end_where_they_are_told_to(frames: DeviceFrames) -> None:
    assert first_looks(_Colours(), 64, frames, range(2)) is None


def test_a_second_look_watches_itself(frames: DeviceFrames) -> None:
    plan = TrainingPlan(steps=3, batch=2, crop=(160, 160), warmup_steps=1)
    windows = DeviceWindows(frames, *_seen(frames), plan)
    network = DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2, inputs=5))
    average, steps = train(network, windows, plan)
    assert steps == 3
    assert windows._network is average
