"""Crops that a GPU makes itself show what those of a processor show; the same code runs on any device."""

from __future__ import annotations

import itertools
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from torch import Tensor, nn

from core.learning.crops import EDGE_PX, _nearness, _wrong, true_ends
from core.learning.dataset import DatasetError, Sample, find_samples, write_mask, write_png
from core.learning.device_crops import DeviceCrops, _with_strip, nearness, random_crops, some_pixel, with_strips
from core.learning.device_frames import MOST_ENDS, ROBOT, VESSEL, DeviceFrames, Share, Shown, fits, padded_places
from core.learning.device_looks import compressed, random_looks
from core.learning.device_windows import DeviceWindows, _far, _turned, first_looks
from core.learning.training import Progress, TrainingPlan, train
from core.perception.second_look import WINDOW_PX, places_to_look
from core.perception.unet import DualUNet, UNetShape

_CPU = torch.device("cpu")
_TIP = (330.0, 199.5)
"""Of the robot in ``_frame``."""


def _masks(shift: int = 0) -> tuple[np.ndarray, np.ndarray]:
    vessel, robot = np.zeros((480, 640), bool), np.zeros((480, 640), bool)
    vessel[180 + shift : 220 + shift, :520] = True
    robot[196 + shift : 204 + shift, :332] = True
    return vessel, robot


def _picture(vessel: np.ndarray, robot: np.ndarray) -> np.ndarray:
    """Colours tell the labels."""
    picture = np.full((*vessel.shape, 3), (20, 20, 120), np.uint8)
    picture[vessel, 0] = 220
    picture[robot, 1] = 220
    return picture


def _write(folder: Path, name: str, picture: np.ndarray, vessel: np.ndarray, robot: np.ndarray) -> None:
    for part in ("images", "masks"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    write_png(folder / "images" / f"{name}.png", picture)
    write_mask(folder / "masks" / f"{name}_vessel.png", vessel)
    write_mask(folder / "masks" / f"{name}_robot.png", robot)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> list[Sample]:
    folder = tmp_path_factory.mktemp("set")
    for number in range(4):
        vessel, robot = _masks(40 * number)
        _write(folder, f"{number}", _picture(vessel, robot), vessel, robot)
    return find_samples([folder])


@pytest.fixture(scope="module")
def frames(samples: list[Sample]) -> DeviceFrames:
    loaded = DeviceFrames.load(samples, _CPU, range(len(samples)))
    assert loaded is not None
    return loaded


def _generator(seed: int = 0) -> torch.Generator:
    return torch.Generator(_CPU).manual_seed(seed)


def _tells(picture: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Vessel and robot by colour, and where a colour is neither of one nor of the other (the edges)."""
    red, green = picture[:, 0], picture[:, 1]
    unsure = ((red > 40) & (red < 200)) | ((green > 40) & (green < 200))
    return red > 120, green > 120, unsure


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
    _write(tmp_path, "wide", np.zeros((360, 640, 3), np.uint8), np.zeros((360, 640), bool), np.zeros((360, 640), bool))
    mixed = [*samples, *find_samples([tmp_path])]
    assert DeviceFrames.load(mixed, _CPU, range(len(mixed))) is None


def test_a_frame_that_cannot_be_read_is_named(samples: list[Sample], tmp_path: Path) -> None:
    vessel, robot = _masks()
    _write(tmp_path, "cut", _picture(vessel, robot), vessel, robot)
    path = tmp_path / "images" / "cut.png"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(DatasetError, match=r"cut\.png"):
        DeviceFrames.load(find_samples([tmp_path]), _CPU, range(1))


def test_reading_ends_where_it_is_told_to(samples: list[Sample]) -> None:
    two = DeviceFrames.load(samples, _CPU, range(2))
    assert two is not None
    assert len(two) == len(two.ends) == 2
    assert DeviceFrames.load(samples, _CPU, range(0)) is None


def test_no_processor_is_taken_for_a_gpu() -> None:
    assert not fits(1, 1, _CPU)


def test_more_ends_than_are_told_are_left_out() -> None:
    assert padded_places([]).isinf().all()
    assert padded_places([(1.0, 2.0)] * (MOST_ENDS + 2)).tolist() == [[1.0, 2.0]] * MOST_ENDS


def test_a_frame_that_is_given_twice_is_read_once_and_shown_twice(samples: list[Sample]) -> None:
    frames = DeviceFrames.load([samples[0], samples[1], samples[0]], _CPU, range(2))
    assert frames is not None
    assert (len(frames), frames.turns.tolist()) == (2, [0, 1, 0])
    drawn, _ = Shown(frames.turns, 0.0, _generator()).draw(6)
    assert torch.bincount(drawn).tolist() == [4, 2]
    hard, count = Shown(frames.turns, 0.9, _generator()).draw(1000)
    assert count == 900
    assert float((hard[:count] == 0).float().mean()) == pytest.approx(2 / 3, abs=0.06)


def test_all_frames_are_shown_in_turn() -> None:
    shown = Shown(torch.arange(10), 0.0, _generator())
    drawn = torch.cat([shown.draw(4)[0] for _ in range(5)])
    assert sorted(drawn[:10].tolist()) == sorted(drawn[10:].tolist()) == list(range(10))
    assert drawn[:10].tolist() != drawn[10:].tolist()


def test_what_was_lost_is_shown_more_often() -> None:
    shown = Shown(torch.arange(20), 0.5, _generator())
    for _ in range(30):
        numbers, hard = shown.draw(8)
        assert hard == 4
        shown.note((numbers == 7).float())
    drawn = torch.cat([shown.draw(40)[0][:20] for _ in range(10)])
    counts = torch.bincount(drawn, minlength=20)
    assert counts[7] > 5 * counts[:7].max()
    assert (counts > 0).sum() > 10, "what is known may be drawn, too"


def test_a_frame_that_is_shown_twice_at_once_counts_by_the_mean_and_nothing_that_is_no_number_counts() -> None:
    shown = Shown(torch.tensor([0, 0, 1]), 0.0, _generator())
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


@pytest.mark.parametrize("size", [(192, 256), (384, 384)])
def test_crops_keep_picture_labels_and_ends_together(frames: DeviceFrames, size: tuple[int, int]) -> None:
    numbers = torch.arange(4).repeat(16)
    images, masks, ends = random_crops(frames, numbers, size, _generator())
    assert images.shape == (64, 3, *size)
    assert masks.shape == (64, 2, *size)
    assert torch.equal(images, images.round())
    vessel, robot, unsure = _tells(images)
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
    assert seen > 15


def test_crops_are_turned_and_scaled(frames: DeviceFrames) -> None:
    _, masks, _ = random_crops(frames, torch.zeros(60, dtype=torch.long), (384, 384), _generator())
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
    vessel, robot = _masks()
    full = torch.from_numpy(np.dstack([_picture(vessel, robot), vessel * VESSEL | robot * ROBOT]).astype(np.uint8))
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
    _, robot = _masks()
    ends = torch.stack([padded_places([(float(x), float(y)) for x, y in true_ends(robot)])])
    masks = torch.from_numpy(np.stack(_masks())[None]).float()
    found = (255 * nearness(masks, ends)[0, 0]).round().numpy()
    assert np.abs(found - _nearness(robot)).max() <= 1
    assert found[round(_TIP[1]), round(_TIP[0])] > 250
    cut_off = torch.tensor([[[3.0, 200.0], [float("inf")] * 2]])
    assert not nearness(masks, cut_off).any(), "the border cuts it off there"


def test_a_random_pixel_lies_in_the_mask() -> None:
    weights = torch.zeros((3, 20, 30), dtype=torch.bool)
    weights[0, 5, 7] = weights[2, 10:12, 3:9] = True
    for seed in range(10):
        place, is_there = some_pixel(weights, _generator(seed))
        assert is_there.tolist() == [True, False, True]
        assert place[0].tolist() == [7.0, 5.0]
        assert 3 <= place[2, 0] < 9
        assert 10 <= place[2, 1] < 12


def test_looks_are_pictures_and_leave_the_originals(frames: DeviceFrames) -> None:
    images, _ = frames.whole(torch.arange(4).repeat(3))
    before = images.clone()
    changed = random_looks(images, _generator())
    assert torch.equal(images, before)
    assert changed.min() >= 0
    assert changed.max() <= 255
    assert torch.equal(changed, changed.round())
    unlike = (changed - images).abs().mean(dim=(1, 2, 3))
    assert (unlike > 1).sum() > 7
    assert torch.equal(changed, random_looks(images, _generator()))


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
    changed = (_with_strip(images, masks, frames.ends[numbers], _generator()) != images).any(dim=1)
    assert (changed & (masks[:, 1] > 0)).flatten(1).any(dim=1).all()
    assert changed.float().mean(dim=(1, 2)).max() < 0.02
    extents = [np.ptp(np.argwhere(change.numpy()), axis=0) for change in changed]
    assert np.mean([tall > wide for tall, wide in extents]) > 0.8, "the robot lies along the picture"
    at_end = [bool(change[:, 300:].any()) for change in changed]
    assert 0.25 < np.mean(at_end) < 0.9, "half of them at an end, where there is one"
    twice = (with_strips(images, masks, frames.ends[numbers], _generator()) != images).any(dim=1)
    assert twice.float().mean() > changed.float().mean()


def test_strips_need_something_to_lie_on() -> None:
    images = torch.full((2, 3, 60, 80), 90.0)
    nowhere = torch.full((2, MOST_ENDS, 2), torch.inf)
    assert torch.equal(with_strips(images, torch.zeros((2, 2, 60, 80)), nowhere, _generator()), images)


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

    monkeypatch.setattr("core.learning.device_windows._turned", watched)
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
    centers = torch.cat([windows._centers(torch.zeros(24, dtype=torch.long), 24) for _ in range(2)])
    beside = (centers[:, 1] < 182).float()
    assert 0.3 < float(beside.mean()) < 0.75, "the wall is much larger than the tip"


@pytest.mark.parametrize("focus", [0.0, 0.5])
def test_windows_keep_picture_labels_and_ends_together(frames: DeviceFrames, focus: float) -> None:
    plan = TrainingPlan(batch=64, look_share=0.0, end_weight=4, focus_share=focus)
    planes, labels = next(iter(DeviceWindows(frames, *_seen(frames), plan)))
    assert planes.shape == (64, 5, WINDOW_PX, WINDOW_PX)
    vessel, robot, unsure = _tells(planes)
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
    assert (told.values > 250).sum() > 30


def test_half_of_the_windows_come_with_what_was_seen_in_the_end(frames: DeviceFrames) -> None:
    plan = TrainingPlan(batch=64, look_share=0.0)
    windows, network = DeviceWindows(frames, *_seen(frames), plan), _Says(0.0)
    windows.watch(network)
    planes, labels = next(iter(windows))
    assert network.asked == 32
    half = (planes[:, 3] > 125) & (planes[:, 3] < 130)
    looked = half.flatten(1).any(dim=1)
    assert looked.sum() == 32
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
    """A first look that goes by the colours of ``_picture``, and takes a picture's left half for something else."""

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


def test_training_on_a_device_learns_and_tells_its_crops_what_was_lost(frames: DeviceFrames) -> None:
    told: list[Tensor] = []

    class Noting(DeviceCrops):
        def note(self, lost: Tensor) -> None:
            told.append(lost)
            super().note(lost)

    plan = TrainingPlan(steps=60, batch=4, crop=(96, 96), look_share=0.0, clutter_share=0.0, focus_share=0.5, warmup_steps=4)
    reports: list[Progress] = []
    torch.manual_seed(0)
    network = DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2))
    _, steps = train(network, Noting(frames, plan), plan, on_progress=reports.append, report_every=10)
    assert steps == len(told) == 60
    assert all(lost.shape == (4,) for lost in told)
    assert reports[-1].loss < 0.9 * reports[0].loss


def test_a_second_look_watches_itself(frames: DeviceFrames) -> None:
    plan = TrainingPlan(steps=3, batch=2, crop=(160, 160), warmup_steps=1)
    windows = DeviceWindows(frames, *_seen(frames), plan)
    network = DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2, inputs=5))
    average, steps = train(network, windows, plan)
    assert steps == 3
    assert windows._network is average
