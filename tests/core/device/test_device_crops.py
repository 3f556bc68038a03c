"""Crops that a GPU makes itself show what those of a processor show; the same code runs on any device."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch
from torch import Tensor

from core.learning.augmentation import _nearness, true_ends
from core.learning.gpu_batches import (
    MOST_ENDS,
    ROBOT,
    VESSEL,
    DeviceCrops,
    DeviceFrames,
    _with_strip,
    compressed,
    nearness,
    padded_places,
    random_crops,
    random_looks,
    some_pixel,
    with_strips,
)
from core.learning.training import Progress, train
from core.learning.training_plan import TrainingPlan
from core.perception.unet import DualUNet, UNetShape
from tests.core.device.device_set import TIP, generator, masks_of, picture_of, told_by_colour


@pytest.mark.parametrize("size", [(192, 256), (384, 384)])
def test_crops_keep_picture_labels_and_ends_together(frames: DeviceFrames, size: tuple[int, int]) -> None:
    numbers = torch.arange(4).repeat(6)
    images, masks, ends = random_crops(frames, numbers, size, generator())
    assert images.shape == (24, 3, *size)
    assert masks.shape == (24, 2, *size)
    assert torch.equal(images, images.round())
    vessel, robot, unsure = told_by_colour(images)
    plain = images[:, 2] == 120  # what lies beyond the frame is one colour of it, without labels
    outside = ~(masks[:, 0] > 0) & ~(masks[:, 1] > 0) & (vessel | robot)
    assert ((masks[:, 0] > 0) == vessel)[~unsure & ~outside].all()
    assert ((masks[:, 1] > 0) == robot)[~unsure & ~outside].all()
    assert plain.all(), "the third colour is the same all over"
    seen = 0
    for mask, places in zip(masks[:, 1], ends, strict=True):
        x, y = places[0].tolist()
        if 12 <= x < size[1] - 12 and 12 <= y < size[0] - 12:
            seen += 1
            rows, columns = torch.meshgrid(torch.arange(size[0]), torch.arange(size[1]), indexing="ij")
            near = (rows - y) ** 2 + (columns - x) ** 2 < 10**2
            assert 0.2 < float(mask[near].mean()) < 0.6, "half a robot of 8 px in a disc of 20"
            assert mask[round(y), round(x)] == 1
    assert seen > 5


def test_crops_are_turned_and_scaled(frames: DeviceFrames) -> None:
    _, masks, _ = random_crops(frames, torch.zeros(60, dtype=torch.long), (384, 384), generator())
    widths, turns = [], set()
    for vessel, robot in masks.numpy() > 0:
        points = np.argwhere(robot).astype(np.float32)
        if vessel.sum() > 4000 and len(points) > 1500:
            widths.append(2 * float(cv2.distanceTransform(np.pad(vessel, 1).astype(np.uint8), cv2.DIST_L2, 5).max()))
            down, across = cv2.PCACompute(points, np.empty(0))[1][0]
            turns.add(round(np.degrees(np.arctan2(down, across)) / 15) % 12)
    assert 40 * 0.75 - 3 < min(widths) < 34
    assert 46 < max(widths) < 40 * 1.35 + 3
    assert len(turns) > 7, "of twelve directions"


def test_crops_are_the_same_for_the_same_seed(frames: DeviceFrames) -> None:
    plan = TrainingPlan(batch=6, crop=(128, 128), focus_share=0.5, strip_share=0.5, end_weight=2, seed=5)
    batches = [next(iter(DeviceCrops(frames, plan))) for _ in range(2)]
    for one, other in zip(*batches, strict=True):
        assert torch.equal(one, other)
    other = next(iter(DeviceCrops(frames, TrainingPlan(batch=6, crop=(128, 128), seed=6))))
    assert not torch.equal(batches[0][0], other[0])
    assert other[1].shape[1] == 2, "ends that do not count are not told"


def test_clutter_shows_nothing_of_ours(frames: DeviceFrames) -> None:
    plan = TrainingPlan(batch=8, crop=(64, 64), clutter_share=1.0, end_weight=2, look_share=0.0)
    images, labels = next(iter(DeviceCrops(frames, plan)))
    assert not labels.any()
    assert len({float(image.sum()) for image in images}) > 4


def test_clutter_tells_nothing_of_the_frame_that_it_stands_for(frames: DeviceFrames) -> None:
    plan = TrainingPlan(batch=8, crop=(64, 64), clutter_share=1.0, look_share=0.0)
    crops = DeviceCrops(frames, plan)
    next(iter(crops))
    crops.note(torch.ones(8))
    assert crops._shown._lost.tolist() == pytest.approx([0.3] * 4)


def test_a_crop_beside_the_robot_tells_nothing_but_that_of_an_empty_frame_does() -> None:
    vessel, robot = masks_of()
    full = torch.from_numpy(np.dstack([picture_of(vessel, robot), vessel * VESSEL | robot * ROBOT]).astype(np.uint8))
    empty = full.clone()
    empty[..., 3] &= VESSEL
    frames = DeviceFrames(torch.stack([full, empty]), torch.full((2, MOST_ENDS, 2), torch.inf), torch.arange(2))
    crops = DeviceCrops(frames, TrainingPlan(batch=16, crop=(32, 32), clutter_share=0.0, look_share=0.0))
    _, labels = next(iter(crops))
    shows_robot = labels[:, 1].flatten(1).any(dim=1)
    is_empty = crops._shown._drawn == 1
    assert crops._tells.tolist() == (shows_robot | is_empty).tolist()
    assert (~crops._tells).any()
    assert (crops._tells & ~shows_robot).any()


def test_the_robots_end_is_as_near_as_a_processor_finds_it() -> None:
    _, robot = masks_of()
    ends = torch.stack([padded_places([(float(x), float(y)) for x, y in true_ends(robot)])])
    masks = torch.from_numpy(np.stack(masks_of())[None]).float()
    found = (255 * nearness(masks, ends)[0, 0]).round().numpy()
    assert np.abs(found - _nearness(robot)).max() <= 1
    assert found[round(TIP[1]), round(TIP[0])] > 250
    cut_off = torch.tensor([[[3.0, 200.0], [float("inf")] * 2]])
    assert not nearness(masks, cut_off).any(), "the border cuts it off there"


def test_a_random_pixel_lies_in_the_mask() -> None:
    weights = torch.zeros((3, 20, 30), dtype=torch.bool)
    weights[0, 5, 7] = weights[2, 10:12, 3:9] = True
    for seed in range(10):
        place, is_there = some_pixel(weights, generator(seed))
        assert is_there.tolist() == [True, False, True]
        assert place[0].tolist() == [7.0, 5.0]
        assert 3 <= place[2, 0] < 9
        assert 10 <= place[2, 1] < 12


def test_looks_are_pictures_and_leave_the_originals(frames: DeviceFrames) -> None:
    images, _ = frames.whole(torch.arange(4))
    before = images.clone()
    changed = random_looks(images, generator())
    assert torch.equal(images, before)
    assert changed.min() >= 0
    assert changed.max() <= 255
    assert torch.equal(changed, changed.round())
    unlike = (changed - images).abs().mean(dim=(1, 2, 3))
    assert (unlike > 1).sum() > 2
    assert torch.equal(changed, random_looks(images, generator()))


def test_what_compression_leaves_is_what_jpeg_leaves() -> None:
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.uniform(0, 255, (90, 116)).astype(np.float32), (0, 0), 1.5)
    grey = np.clip((grey - grey.mean()) * 4 + 128, 0, 255).round().astype(np.uint8)
    picture = torch.from_numpy(np.stack([grey] * 3)[None]).float()
    lost = []
    for quality in (35, 60, 90):
        ok, data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, quality])
        assert ok
        wanted = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE).astype(float)
        left = compressed(picture, torch.tensor([float(quality)]))[0]
        assert left.shape == picture.shape[1:]
        other = float(np.abs(left[0, :88, :112].numpy() - wanted[:88, :112]).mean())
        lost.append(float((left - picture[0]).abs().mean()))
        assert other < 0.2 * lost[-1], "what is rounded on the way"
    assert lost[0] > lost[1] > lost[2] > 0


def test_strips_lie_across_the_robot_and_leave_the_rest(frames: DeviceFrames) -> None:
    numbers = torch.arange(4).repeat(4)
    images, masks = frames.whole(numbers)
    masks[:, 0] = masks[:, 1]
    changed = (_with_strip(images, masks, frames.ends[numbers], generator()) != images).any(dim=1)
    assert (changed & (masks[:, 1] > 0)).flatten(1).any(dim=1).all()
    assert changed.float().mean(dim=(1, 2)).max() < 0.02
    extents = [np.ptp(np.argwhere(change.numpy()), axis=0) for change in changed]
    assert np.mean([tall > wide for tall, wide in extents]) > 0.8, "the robot lies along the picture"
    at_end = [bool(change[:, 300:].any()) for change in changed]
    assert 0.25 < np.mean(at_end) < 0.9, "half of them at an end, where there is one"
    twice = (with_strips(images, masks, frames.ends[numbers], generator()) != images).any(dim=1)
    assert twice.float().mean() > changed.float().mean()


def test_strips_need_something_to_lie_on() -> None:
    images = torch.full((2, 3, 60, 80), 90.0)
    nowhere = torch.full((2, MOST_ENDS, 2), torch.inf)
    assert torch.equal(with_strips(images, torch.zeros((2, 2, 60, 80)), nowhere, generator()), images)


def test_training_on_a_device_learns_and_tells_its_crops_what_was_lost(frames: DeviceFrames) -> None:
    told: list[Tensor] = []

    class Noting(DeviceCrops):
        def note(self, lost: Tensor) -> None:
            told.append(lost)
            super().note(lost)

    plan = TrainingPlan(steps=60, batch=4, crop=(64, 64), look_share=0.0, clutter_share=0.0, focus_share=0.5, warmup_steps=4)
    reports: list[Progress] = []
    torch.manual_seed(0)
    network = DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2))
    _, steps = train(network, Noting(frames, plan), plan, on_progress=reports.append, report_every=10)
    assert steps == len(told) == 60
    assert all(lost.shape == (4,) for lost in told)
    assert reports[-1].loss < 0.9 * reports[0].loss
