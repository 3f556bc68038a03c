"""Crops of whole frames for the first look, a batch at a time, on the device where the frames are (``device_frames``).

Labelled frames in the memory of a GPU, from which it cuts and changes its own crops (``device_crops``, ``device_windows``).

A processor of two cores makes some 200 crops a second, and a GPU learns from thousands: it would wait nearly all of the time.

Random looks of a batch of pictures, on the device where they are: what ``augment`` does to one after the other.

Windows for the second look, a batch at a time, on the device where the frames are (``device_frames``).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional
from torch.utils.data import IterableDataset

from core.learning.augmentation import (
    BORDER_PX,
    EDGE_PX,
    END_REACH_PX,
    JITTER_PX,
    LAST_SHARE,
    MISSED_SHARE,
    WALL_PX,
    WALL_REACH_PX,
    WRONG_JITTER_PX,
    Crop,
    random_clutter,
    true_ends,
)
from core.learning.dataset import WORKING_SIZE_PX, Sample
from core.learning.training import computes_in_bf16
from core.learning.training_plan import TrainingPlan
from core.perception.inference import cores
from core.perception.segmentation import MARGIN_PX
from core.perception.tip_refinement import WINDOW_PX, Planes, places_to_look

MOST_ENDS = 6
"""Of a true robot, or of what was taken for one. Those of more are not told."""
VESSEL, ROBOT = 1, 2
"""Bits of the fourth plane of ``DeviceFrames.pixels``."""
_MOST_SHARE = 0.7
"""Of the device's free memory; the network needs some, too."""
_FRAME_BYTES = WORKING_SIZE_PX**2 * 6
"""The most that one frame takes: colours, masks, and what a first look saw."""
_DRAWN_BYTES = WORKING_SIZE_PX**2 * 36
"""What is made in passing of a frame of which a crop is drawn."""
_DECODED_AT_ONCE = 256


def fits(count: int, batch: int, device: torch.device) -> bool:
    """Whether so many frames, with what was seen of them, and the crops of a batch have room on a CUDA device."""
    if device.type != "cuda":
        return False
    # What torch keeps of what it has freed is not free for others, but for this.
    kept = torch.cuda.memory_reserved(device) - torch.cuda.memory_allocated(device)
    free = torch.cuda.mem_get_info(device)[0] + kept
    return count * _FRAME_BYTES + batch * _DRAWN_BYTES <= _MOST_SHARE * free


class DeviceFrames:
    """Frames of one size on a device.

    Attributes
    ----------
    pixels : uint8 (N, H, W, 4): red, green, blue, and the masks as bits.
    ends : float32 (N, MOST_ENDS, 2): places (x, y) of the true robot's ends; infinite where there are fewer.
    turns : int64 (M,): the numbers of the frames as they take turns; one that is to be shown more often has several.
    device : where they are.
    """

    def __init__(self, pixels: Tensor, ends: Tensor, turns: Tensor) -> None:
        self.pixels, self.ends, self.turns = pixels, ends, turns
        self.device = pixels.device

    def __len__(self) -> int:
        return len(self.pixels)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width."""
        return self.pixels.shape[1], self.pixels.shape[2]

    @classmethod
    def load(cls, samples: Sequence[Sample], device: torch.device, track: Iterable[int]) -> DeviceFrames | None:
        """Read frames at working size, each once; None when they are not all of one size.

        `track` gives numbers one after the other, one for each frame, and maybe moves a bar; where it ends sooner, the frames that
        were read until then are those that there are. Raises DatasetError for a frame that cannot be read.
        """
        once = list({sample.image: sample for sample in samples}.values())
        pixels, ends = None, torch.full((len(once), MOST_ENDS, 2), torch.inf)
        done = 0
        for _, (frame, places) in zip(track, _decoded(once), strict=False):
            if pixels is None:
                pixels = torch.empty((len(once), *frame.shape), dtype=torch.uint8, device=device)
            if frame.shape != pixels.shape[1:]:
                return None
            pixels[done] = torch.from_numpy(frame).to(device)
            ends[done] = padded_places(places)
            done += 1
        number = {sample.image: index for index, sample in enumerate(once[:done])}
        turns = torch.tensor([number[sample.image] for sample in samples if sample.image in number], dtype=torch.long)
        return None if pixels is None else cls(pixels[:done], ends[:done].to(device), turns.to(device))

    def whole(self, numbers: Tensor) -> tuple[Tensor, Tensor]:
        """Pictures float32 (n, 3, H, W), 0..255, and masks float32 (n, 2, H, W), 0 or 1, of the frames of these numbers."""
        return parted(self.pixels[numbers])


def parted(pixels: Tensor) -> tuple[Tensor, Tensor]:
    """Packed pixels (n, h, w, 4) as pictures float32 (n, 3, h, w), 0..255, and masks float32 (n, 2, h, w), 0 or 1."""
    bits = pixels[..., 3]
    masks = torch.stack([(bits & bit) > 0 for bit in (VESSEL, ROBOT)], dim=1)
    return pixels[..., :3].permute(0, 3, 1, 2).float(), masks.float()


def padded_places(places: Sequence[tuple[float, float]]) -> Tensor:
    """Up to ``MOST_ENDS`` places (x, y) as float32 (MOST_ENDS, 2), infinite where there are fewer."""
    padded = torch.full((MOST_ENDS, 2), torch.inf)
    if places:
        found = torch.tensor(places[:MOST_ENDS], dtype=torch.float32)
        padded[: len(found)] = found
    return padded


def _decoded(samples: Sequence[Sample]) -> Iterator[tuple[NDArray[np.uint8], list[tuple[float, float]]]]:
    """Packed frames and their robots' ends, read by several threads, some ahead of what is asked for."""
    with ThreadPoolExecutor(cores()) as pool:
        for first in range(0, len(samples), _DECODED_AT_ONCE):
            yield from pool.map(_packed, samples[first : first + _DECODED_AT_ONCE])


def _packed(sample: Sample) -> tuple[NDArray[np.uint8], list[tuple[float, float]]]:
    image, vessel, robot = sample.load(WORKING_SIZE_PX)
    bits = vessel.astype(np.uint8) * VESSEL | robot.astype(np.uint8) * ROBOT
    return np.dstack([image, bits]), [(float(x), float(y)) for x, y in true_ends(robot)]


class Share:
    """So much of each batch, in whole crops: what is left over is made up for in the next ones."""

    def __init__(self, share: float) -> None:
        self._share, self._left = share, 0.0

    def of(self, count: int) -> int:
        self._left += count * self._share
        whole = int(self._left + 1e-9)
        self._left -= whole
        return whole


class Shown:
    """Which frames are shown: all of them in turn, and those more often of which much was lost when they were last shown.

    Parameters
    ----------
    turns : numbers of frames, int64 (M,), as ``DeviceFrames`` has them.
    hard_share : how many of those drawn are drawn by what was lost.
    """

    def __init__(self, turns: Tensor, hard_share: float, generator: torch.Generator) -> None:
        self._turns, self._generator, self._hard = turns, generator, Share(hard_share)
        self._often = torch.bincount(turns).float()
        self._lost = torch.full_like(self._often, 0.3)
        self._order = turns[:0]
        self._drawn = turns[:0]

    def draw(self, count: int) -> tuple[Tensor, int]:
        """`count` numbers of frames; the first ones, as many as is said with them, are drawn by what was lost."""
        hard = self._hard.of(count)
        while len(self._order) < count - hard:
            anew = torch.randperm(len(self._turns), generator=self._generator, device=self._turns.device)
            self._order = torch.cat([self._order, self._turns[anew]])
        plain, self._order = self._order[: count - hard], self._order[count - hard :]
        chances = self._lost.clamp(min=0.02) * self._often
        lost = torch.multinomial(chances, hard, replacement=True, generator=self._generator) if hard else plain[:0]
        self._drawn = torch.cat([lost, plain])
        return self._drawn, hard

    def note(self, lost: Tensor, counts: Tensor | None = None) -> None:
        """What was lost, float (n,), of the frames that were drawn last; where `counts` is false it tells nothing of its frame."""
        seen = torch.ones_like(lost) if counts is None else counts.to(lost.dtype)
        sums, times = (torch.zeros_like(self._lost) for _ in range(2))
        sums.index_add_(0, self._drawn, torch.nan_to_num(lost, 0.0, 0.0, 0.0) * seen)
        times.index_add_(0, self._drawn, seen)
        self._lost = torch.where(times > 0, 0.5 * self._lost + 0.5 * sums / times.clamp(min=1), self._lost)


_BLUR_REACH_PX = 4
_QUANTA = (
    (16, 11, 10, 16, 24, 40, 51, 61),
    (12, 12, 14, 19, 26, 58, 60, 55),
    (14, 13, 16, 24, 40, 57, 69, 56),
    (14, 17, 22, 29, 51, 87, 80, 62),
    (18, 22, 37, 56, 68, 109, 103, 77),
    (24, 35, 55, 64, 81, 104, 113, 92),
    (49, 64, 78, 87, 103, 121, 120, 101),
    (72, 92, 95, 98, 112, 100, 103, 99),
)
"""Of JPEG's brightness (ITU-T T.81, table K.1)."""
_LUMA = ((0.299, 0.587, 0.114), (-0.168736, -0.331264, 0.5), (0.5, -0.418688, -0.081312))


def drawn(low: float, high: float, shape: tuple[int, ...], generator: torch.Generator) -> Tensor:
    """Even chances between `low` and `high`."""
    return torch.rand(shape, generator=generator, device=generator.device) * (high - low) + low


def happens(chance: float, count: int, generator: torch.Generator) -> Tensor:
    """For each of `count` pictures whether it is changed, (count, 1, 1, 1)."""
    return torch.rand((count, 1, 1, 1), generator=generator, device=generator.device) < chance


def random_looks(images: Tensor, generator: torch.Generator) -> Tensor:
    """Exposure, contrast, gamma, white balance, uneven light, blur, noise and compression, each now and then.

    `images` float32 (n, 3, h, w), 0..255; the result is the same, in whole steps.
    """
    n = len(images)
    each = (n, 1, 1, 1)
    pixels = images / 255
    mean = pixels.mean(dim=(1, 2, 3), keepdim=True)
    exposed = (pixels - mean) * drawn(0.65, 1.4, each, generator) + mean + drawn(-0.15, 0.15, each, generator)
    pixels = torch.where(happens(0.7, n, generator), exposed, pixels)
    pixels = torch.where(happens(0.5, n, generator), pixels * drawn(0.85, 1.15, (n, 3, 1, 1), generator), pixels)
    grey = happens(0.12, n, generator)
    pixels = torch.where(grey, pixels.mean(dim=1, keepdim=True), pixels)
    order = torch.rand((n, 3), generator=generator, device=generator.device).argsort(dim=1)[:, :, None, None]
    swapped = pixels.gather(1, order.expand_as(pixels))
    pixels = torch.where(happens(0.12, n, generator) & ~grey, swapped, pixels)
    power = drawn(-0.5, 0.5, each, generator).exp()
    pixels = torch.where(happens(0.4, n, generator), pixels.clamp(0, 1) ** power, pixels)
    light = functional.interpolate(drawn(0.6, 1.3, (n, 1, 4, 4), generator), images.shape[2:], mode="bicubic", align_corners=False)
    pixels = torch.where(happens(0.3, n, generator), pixels * light, pixels)
    pixels = torch.where(happens(0.25, n, generator), _blurred(pixels, drawn(0.4, 1.3, (n,), generator)), pixels)
    noise = torch.randn(pixels.shape, generator=generator, device=generator.device) * drawn(0.005, 0.04, each, generator)
    pixels = torch.where(happens(0.35, n, generator), pixels + noise, pixels)
    steps = (pixels.clamp(0, 1) * 255).floor()
    return torch.where(happens(0.15, n, generator), compressed(steps, drawn(35, 90, (n,), generator)), steps)


def _blurred(images: Tensor, sigma_px: Tensor) -> Tensor:
    """Each picture by a Gaussian of its own."""
    n, planes = images.shape[:2]
    place = torch.arange(-_BLUR_REACH_PX, _BLUR_REACH_PX + 1, device=images.device, dtype=images.dtype)
    kernel = torch.exp(-0.5 * (place / sigma_px[:, None]) ** 2)
    kernel = (kernel / kernel.sum(dim=1, keepdim=True)).repeat_interleave(planes, dim=0)[:, None]
    flat = images.reshape(1, n * planes, *images.shape[2:])
    flat = functional.pad(flat, (_BLUR_REACH_PX,) * 4, mode="reflect")
    flat = functional.conv2d(flat, kernel[:, :, None, :], groups=n * planes)
    return functional.conv2d(flat, kernel[:, :, :, None], groups=n * planes).view_as(images)


def compressed(images: Tensor, quality: Tensor) -> Tensor:
    """What JPEG's blocks of 8 x 8 px leave of pictures (n, 3, h, w), 0..255, at a quality (n,) of 1..100; colours at full size.

    The same steps for colours as for brightness, and no entropy coding, which loses nothing.
    """
    height, width = images.shape[2:]
    whole = functional.pad(images, (0, -width % 8, 0, -height % 8), mode="replicate")
    turn = torch.tensor(_LUMA, device=images.device)
    levels = torch.einsum("cd,ndhw->nchw", turn, whole - 128)
    index = torch.arange(8, device=images.device, dtype=images.dtype)
    waves = torch.cos((2 * index[None, :] + 1) * index[:, None] * math.pi / 16) / 2
    waves[0] /= math.sqrt(2)
    n, planes, tall, wide = levels.shape
    blocks = levels.view(n, planes, tall // 8, 8, wide // 8, 8)
    found = torch.einsum("ua,ncravb,wb->ncruvw", waves, blocks, waves)
    scale = torch.where(quality < 50, 5000 / quality, 200 - 2 * quality)
    table = torch.tensor(_QUANTA, device=images.device, dtype=images.dtype)
    quanta = ((table * scale[:, None, None] + 50) / 100).floor().clamp(1, 255)[:, None, None, :, None, :]
    found = (found / quanta).round() * quanta
    blocks = torch.einsum("ua,ncruvw,wb->ncravb", waves, found, waves)
    levels = blocks.flatten(4, 5).flatten(2, 3)
    back = torch.einsum("cd,ndhw->nchw", torch.linalg.inv(turn), levels) + 128
    return back[:, :, :height, :width].round().clamp(0, 255)


_CLUTTER_PICTURES = 256
"""Made once: a processor makes them."""


class DeviceCrops(IterableDataset[Crop]):
    """Batches without end of ``plan.batch`` crops: what ``FrameCrops`` shows, cut and changed on the device.

    What is hard is what was lost lately: ``note`` is told.
    """

    def __init__(self, frames: DeviceFrames, plan: TrainingPlan) -> None:
        self._frames, self._plan = frames, plan
        self.device = frames.device
        self._generator = torch.Generator(frames.device).manual_seed(plan.seed)
        self._shown = Shown(frames.turns, plan.focus_share, self._generator)
        self._looks, self._strips = Share(plan.look_share), Share(plan.strip_share)
        self._tells = torch.ones(0, dtype=torch.bool, device=frames.device)
        rng = np.random.default_rng((plan.seed, 3))
        pictures = np.stack([random_clutter(plan.crop, rng) for _ in range(_CLUTTER_PICTURES)]) if plan.clutter_share else None
        self._clutter = None if pictures is None else torch.from_numpy(pictures).to(frames.device)

    def note(self, lost: Tensor) -> None:
        """What was lost, (n,), of the crops that were shown last."""
        self._shown.note(lost, self._tells)

    def __iter__(self) -> Iterator[Crop]:
        while True:
            yield self._batch()

    def _batch(self) -> Crop:
        plan, generator = self._plan, self._generator
        numbers, _ = self._shown.draw(plan.batch)
        images, masks, ends = random_crops(self._frames, numbers, plan.crop, generator)
        # A crop beside the robot is easy, whatever its frame is.
        has_robot = ((self._frames.pixels[numbers, :, :, 3] & ROBOT) > 0).flatten(1).any(dim=1)
        self._tells = masks[:, 1].flatten(1).any(dim=1) | ~has_robot
        if covered := self._strips.of(len(images)):
            some = torch.randperm(len(images), generator=generator, device=generator.device)[:covered]
            images[some] = with_strips(images[some], masks[some], ends[some], generator)
        if self._clutter is not None:
            is_clutter = happens(plan.clutter_share, len(images), generator)
            some = torch.randint(len(self._clutter), (len(images),), generator=generator, device=generator.device)
            images = torch.where(is_clutter, self._clutter[some].permute(0, 3, 1, 2).float(), images)
            masks = torch.where(is_clutter, 0.0, masks)
            ends = torch.where(is_clutter[:, 0], torch.inf, ends)
            self._tells &= ~is_clutter.view(-1)
        images = some_changed(images, self._looks.of(len(images)), generator)
        return images, labels_of(masks, ends, plan)


def some_changed(images: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """So many of the pictures (n, 3, h, w), drawn at random, in a random look."""
    if not count:
        return images
    some = torch.randperm(len(images), generator=generator, device=generator.device)[:count]
    changed = images.clone()
    changed[some] = random_looks(images[some], generator)
    return changed


def labels_of(masks: Tensor, ends: Tensor, plan: TrainingPlan) -> Tensor:
    """Masks float32 (n, 2, h, w), and where the plan weighs the robot's ends how near they are, 0..255, as a third plane."""
    return masks if plan.end_weight <= 0 else torch.cat([masks, 255 * nearness(masks, ends)], dim=1)


def nearness(masks: Tensor, ends: Tensor) -> Tensor:
    """How near each pixel is to one of the robot's `ends` (n, k, 2), 1 there: (n, 1, h, w).

    Where the border cuts the robot off it does not end: an end outside, or nearly, does not count.
    """
    height, width = masks.shape[2:]
    rows = torch.arange(height, device=masks.device, dtype=torch.float32)[None, :, None]
    columns = torch.arange(width, device=masks.device, dtype=torch.float32)[None, None, :]
    least = torch.full((len(masks), height, width), torch.inf, device=masks.device)
    for x, y in (end.unbind(1) for end in ends.unbind(1)):
        inside = torch.minimum(torch.minimum(x, y), torch.minimum(width - 1 - x, height - 1 - y)) >= BORDER_PX
        away = (rows - y[:, None, None]) ** 2 + (columns - x[:, None, None]) ** 2
        least = torch.minimum(least, torch.where(inside[:, None, None], away, torch.inf))
    return torch.exp(-0.5 * least / END_REACH_PX**2)[:, None]


def some_pixel(weights: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """A random pixel (x, y), float32 (n, 2), where `weights` bool (n, h, w) holds, and whether there is any, (n,)."""
    chance = torch.rand(weights.shape, generator=generator, device=generator.device).masked_fill_(~weights, -1.0)
    best, place = chance.flatten(1).max(dim=1)
    width = weights.shape[2]
    return torch.stack([place % width, torch.div(place, width, rounding_mode="floor")], dim=1).float(), best >= 0


def random_crops(
    frames: DeviceFrames, numbers: Tensor, size: tuple[int, int], generator: torch.Generator
) -> tuple[Tensor, Tensor, Tensor]:
    """Turned, scaled, perhaps mirrored cut-outs of `size` (height, width), most of them near the robot, as ``random_crop`` makes.

    Returns pictures float32 (n, 3, h, w), 0..255, in whole steps, masks (n, 2, h, w), 0 or 1, and the robot's ends in them.
    """
    n, (height, width) = len(numbers), size
    whole, masks = frames.whole(numbers)
    tall, wide = frames.size
    extent = torch.tensor([wide, tall], device=frames.device, dtype=torch.float32)
    on_robot, is_there = some_pixel(masks[:, 1] > 0, generator)
    takes_robot = (is_there & (torch.rand((n,), generator=generator, device=generator.device) < 0.65))[:, None]
    center = torch.where(takes_robot, on_robot, drawn(0.2, 0.8, (n, 2), generator) * extent)
    scale = drawn(math.log(0.75), math.log(1.35), (n,), generator).exp()
    quarter = torch.randint(4, (n,), generator=generator, device=generator.device) * (math.pi / 2)
    slant = drawn(-math.pi / 4, math.pi / 4, (n,), generator) * happens(0.5, n, generator).view(n)
    angle = quarter + slant
    mirror = 1.0 - 2.0 * happens(0.5, n, generator).view(n).float()
    target = (0.5 + drawn(-0.25, 0.25, (n, 2), generator)) * torch.tensor([width, height], device=frames.device)
    cos, sin = torch.cos(angle), torch.sin(angle)
    # In a crop: (mirror turn scale) (frame - center) + target. Written out: a GPU's products of matrices may be of few bits.
    columns, rows = torch.meshgrid(
        torch.arange(width, device=frames.device), torch.arange(height, device=frames.device), indexing="xy"
    )
    across = ((columns - target[:, 0, None, None]) * (mirror / scale)[:, None, None]).float()
    down = ((rows - target[:, 1, None, None]) / scale[:, None, None]).float()
    turn = cos[:, None, None], sin[:, None, None]
    source = torch.stack([turn[0] * across - turn[1] * down, turn[1] * across + turn[0] * down], dim=-1) + center[:, None, None]
    grid = 2 * source / (extent - 1) - 1
    cut = functional.grid_sample(torch.cat([whole, masks], dim=1), grid, mode="bilinear", align_corners=True)
    # What lies beyond the picture is one colour without labels; mirrored, robots would meet their own reflection.
    inside = ((source >= 0) & (source <= extent - 1)).all(dim=-1)[:, None]
    pick = torch.rand((2, n), generator=generator, device=generator.device)
    fill = whole[torch.arange(n, device=frames.device), :, (pick[0] * tall).long(), (pick[1] * wide).long()][:, :, None, None]
    images = torch.where(inside, cut[:, :3].round(), fill)
    x, y = (frames.ends[numbers] - center[:, None]).unbind(-1)
    along = (cos[:, None] * x + sin[:, None] * y) * (mirror * scale)[:, None]
    beside = (cos[:, None] * y - sin[:, None] * x) * scale[:, None]
    ends = torch.stack([along, beside], dim=-1) + target[:, None]
    ends = torch.where(frames.ends[numbers].isfinite(), ends, torch.inf)
    return images, (cut[:, 3:] > 0.5).float() * inside, ends


def with_strips(images: Tensor, masks: Tensor, ends: Tensor, generator: torch.Generator) -> Tensor:
    """Pictures (n, 3, h, w), 0..255, with one or two clips across the lumen, as ``augment.with_strips`` paints them.

    Most lie over the robot, half of these at one of its `ends` (n, k, 2). The labels stay: robot and lumen go on beneath.
    """
    painted = images
    for chance in (1.0, 0.5):
        painted = torch.where(happens(chance, len(images), generator), _with_strip(painted, masks, ends, generator), painted)
    return painted


def _with_strip(images: Tensor, masks: Tensor, ends: Tensor, generator: torch.Generator) -> Tensor:
    n, _, height, width = images.shape
    vessel, robot = masks[:, 0] > 0, masks[:, 1] > 0
    takes_robot = happens(0.75, n, generator)[:, 0] & robot.any(dim=2, keepdim=True).any(dim=1, keepdim=True)
    under = torch.where(takes_robot, robot, vessel)
    middle, is_there = some_pixel(under, generator)
    limits = torch.tensor([width, height], device=ends.device)
    chance = torch.rand(ends.shape[:2], generator=generator, device=generator.device)
    best, which = chance.masked_fill(~((ends >= 0) & (ends < limits)).all(dim=-1), -1.0).max(dim=1)
    at_end = takes_robot.view(n) & (best >= 0) & happens(0.5, n, generator).view(n)
    middle = torch.where(at_end[:, None], ends[torch.arange(n, device=ends.device), which], middle)
    across = _across(under, middle) + torch.randn((n,), generator=generator, device=generator.device) * 0.3
    middle = middle + torch.randn((n, 2), generator=generator, device=generator.device) * 4
    rows = torch.arange(height, device=images.device, dtype=torch.float32)[None, :, None] - middle[:, 1, None, None]
    columns = torch.arange(width, device=images.device, dtype=torch.float32)[None, None, :] - middle[:, 0, None, None]
    cos, sin = torch.cos(across)[:, None, None], torch.sin(across)[:, None, None]
    along, beside = columns * cos + rows * sin, rows * cos - columns * sin
    half_long, half_wide = drawn(14, 40, (n, 1, 1), generator), drawn(4, 12, (n, 1, 1), generator)

    def cover(share_wide: float, shift: Tensor | float = 0.0) -> Tensor:
        """How much of each pixel a box takes, (n, h, w)."""
        inner = torch.minimum(half_long - (along - shift).abs(), share_wide * half_wide - (beside - shift).abs())
        return (inner + 0.5).clamp(0, 1)

    def tones(low: float, high: float) -> Tensor:
        grey, colour = drawn(0.1, 1.0, (n, 1, 1, 1), generator).expand(n, 3, 1, 1), drawn(low, high, (n, 3, 1, 1), generator)
        return torch.where(happens(0.7, n, generator), grey, colour)

    tone = tones(0.1, 0.95)
    opacity = drawn(0.35, 0.92, (n, 1, 1, 1), generator)
    shade = drawn(0.6, 1.0, (n, 1, 1, 1), generator)
    whole, ridge = cover(1.0)[:, None], cover(0.45)[:, None]
    rim = whole * ((torch.minimum(half_long - along.abs(), half_wide - beside.abs()) < 1).float())[:, None]
    color = 255 * tone * (1 + ridge * (drawn(0.9, 1.2, (n, 1, 1, 1), generator) - 1))
    color = color + rim * (150 * tone - color)
    shadow = 1 - cover(1.0, drawn(-3, 3, (n, 1, 1), generator))[:, None] * (1 - shade)
    paint = images * shadow
    paint = paint + (color.clamp(0, 255) - paint) * whole * opacity
    return torch.where(is_there.view(n, 1, 1, 1), paint.clamp(0, 255).floor(), images)


def _across(found: Tensor, middle: Tensor) -> Tensor:
    """The angle (n,) in radians at a right angle to what lies within 25 px of each `middle`; `found` bool (n, h, w)."""
    _, height, width = found.shape
    rows = torch.arange(height, device=found.device, dtype=torch.float32)[None, :, None] - middle[:, 1, None, None]
    columns = torch.arange(width, device=found.device, dtype=torch.float32)[None, None, :] - middle[:, 0, None, None]
    near = (found & (rows**2 + columns**2 < 25**2)).float()
    xx, yy, xy = ((near * product).sum(dim=(1, 2)) for product in (columns**2, rows**2, columns * rows))
    return 0.5 * torch.atan2(2 * xy, xx - yy) + math.pi / 2


_LOOKED_AT_ONCE = 32
_WAYS = 8
"""Orientations of a window."""
_LOTS_AHEAD = 8
"""Of what was seen, while processors look for the ends in it."""
_LAST_SHIFT_PX = 16
"""How far beside a window that is looked at again the one lies through which it was looked at before, at most."""


class DeviceWindows(IterableDataset[Crop]):
    """Batches without end of ``plan.batch`` windows with what the first look saw there, as ``NearCrops`` shows them.

    What is hard is what was lost lately (``note``), and half of the windows come with what the network itself, as it is then, saw
    in a window a bit beside.

    Parameters
    ----------
    frames : the labelled frames.
    seen : what the first look saw in them, uint8 (N, H, W, 2), vessel and robot, 0..255.
    places : where a second look would go to then, float32 (N, k, 2), infinite where there are fewer.
    """

    def __init__(self, frames: DeviceFrames, seen: Tensor, places: Tensor, plan: TrainingPlan) -> None:
        self._frames, self._seen, self._places, self._plan = frames, seen, places, plan
        self._generator = torch.Generator(frames.device).manual_seed(plan.seed)
        self.device = frames.device
        self._shown = Shown(frames.turns, plan.focus_share, self._generator)
        self._looks, self._last, self._way = Share(plan.look_share), Share(LAST_SHARE), 0
        self._network: nn.Module | None = None

    def note(self, lost: Tensor) -> None:
        """What was lost, (n,), of the windows that were shown last."""
        self._shown.note(lost)

    def watch(self, network: nn.Module) -> None:
        """The network by which windows are looked at a first time where they are to be looked at again."""
        self._network = network

    def __iter__(self) -> Iterator[Crop]:
        while True:
            yield self._batch(self._plan.batch)

    def examples(self, count: int) -> list[Planes]:
        """Typical windows (160, 160, 5), uint8, as after the first look alone."""
        self._network = None  # it has left the device when the training is over
        planes = self._batch(count)[0].to(torch.uint8).permute(0, 2, 3, 1).cpu().numpy()
        return [np.ascontiguousarray(one) for one in planes]

    def _batch(self, count: int) -> Crop:
        generator = self._generator
        numbers, hard = self._shown.draw(count)
        planes, masks, ends = self._windows(numbers, hard)
        # Quarter turns and mirror images cost no sharpness; the first look has seen all other angles and sizes.
        order = torch.randperm(count, generator=generator, device=generator.device)
        pixels = torch.cat([planes, masks], dim=1)
        for first in range(min(_WAYS, count)):
            part = order[first::_WAYS]
            pixels[part], ends[part] = _turned(pixels[part], ends[part], (self._way + first) % _WAYS)
        self._way = (self._way + count) % _WAYS
        planes, masks = pixels[:, :5], pixels[:, 5:]
        images = some_changed(planes[:, :3], self._looks.of(count), generator)
        return torch.cat([images, planes[:, 3:]], dim=1), labels_of(masks, ends, self._plan)

    def _windows(self, numbers: Tensor, hard: int) -> tuple[Tensor, Tensor, Tensor]:
        """Planes (n, 5, 160, 160), 0..255, masks (n, 2, 160, 160), and the true ends in them."""
        center = self._centers(numbers, hard)
        corner = self._corner(center)
        image, masks = parted(_cut(self._frames.pixels, numbers, corner))
        seen = _cut(self._seen, numbers, corner).permute(0, 3, 1, 2).float()
        if self._network is not None:
            seen = self._looked_at(numbers, corner, seen)
        ends = self._frames.ends[numbers] - corner[:, None]
        return torch.cat([image, seen], dim=1), masks, ends

    def _corner(self, center: Tensor) -> Tensor:
        """Upper left pixels (x, y) of the windows around these places, as ``window_around`` puts them."""
        height, width = self._frames.size
        most = torch.tensor([width - WINDOW_PX, height - WINDOW_PX], device=center.device)
        return torch.minimum((center.round() - WINDOW_PX // 2).clamp(min=0), most).long()

    def _centers(self, numbers: Tensor, hard: int) -> Tensor:
        n, generator = len(numbers), self._generator
        height, width = self._frames.size
        is_hard = torch.arange(n, device=generator.device) < hard
        anywhere = drawn(0, 1, (n, 2), generator) * torch.tensor([width, height], device=generator.device)
        places = self._places[numbers]
        which = torch.rand(places.shape[:2], generator=generator, device=generator.device)
        which = which.masked_fill(places[..., 0].isinf(), -1.0)
        best, index = which.max(dim=1)
        place = places[torch.arange(n, device=index.device), index]
        place = torch.where((best >= 0)[:, None], place, anywhere)
        jitter = torch.where(is_hard, WRONG_JITTER_PX, JITTER_PX)[:, None]
        place = place + torch.randn((n, 2), generator=generator, device=generator.device) * jitter
        (wrong, is_wrong), (shifted, is_shifted) = (some_pixel(mask, generator) for mask in self._wrong(numbers, hard))
        takes_vessel = is_shifted & (~is_wrong | (torch.rand((n,), generator=generator, device=generator.device) < 0.5))
        wrong, is_wrong = torch.where(takes_vessel[:, None], shifted, wrong), is_wrong | is_shifted
        aside = torch.where(is_hard, WRONG_JITTER_PX, 0.0)[:, None]
        wrong = wrong + torch.randn((n, 2), generator=generator, device=generator.device) * aside
        takes_wrong = is_wrong & (is_hard | (torch.rand((n,), generator=generator, device=generator.device) < MISSED_SHARE))
        return torch.where(takes_wrong[:, None], wrong, place)

    def _wrong(self, numbers: Tensor, hard: int) -> tuple[Tensor, Tensor]:
        """Where the first look was wrong, bool (n, H, W), of the robot, and of the vessel beside its ends.

        The robot anywhere; in hard frames, where alone the vessel is asked for, only what is no blur of an edge.
        """
        bits, found = self._frames.pixels[numbers, :, :, 3], self._seen[numbers] > 127
        robot = found[..., 1] != ((bits & ROBOT) > 0)
        vessel = torch.zeros_like(robot)
        if hard:
            robot[:hard] = _far(found[:hard, ..., 1], (bits[:hard] & ROBOT) > 0, EDGE_PX)
            shifted = _far(found[:hard, ..., 0], (bits[:hard] & VESSEL) > 0, WALL_PX)
            vessel[:hard] = shifted & self._beside_ends(numbers[:hard])
        return robot, vessel

    def _beside_ends(self, numbers: Tensor) -> Tensor:
        height, width = self._frames.size
        rows = torch.arange(height, device=numbers.device)[None, :, None]
        columns = torch.arange(width, device=numbers.device)[None, None, :]
        near = torch.zeros((len(numbers), height, width), dtype=torch.bool, device=numbers.device)
        for x, y in (end.unbind(1) for end in self._frames.ends[numbers].unbind(1)):
            near |= (rows - y[:, None, None]) ** 2 + (columns - x[:, None, None]) ** 2 <= WALL_REACH_PX**2
        return near

    @torch.no_grad()
    def _looked_at(self, numbers: Tensor, corner: Tensor, seen: Tensor) -> Tensor:
        """What was seen, (n, 2, 160, 160), 0..255; of some windows with what the network says of one a bit beside."""
        assert self._network is not None
        generator = self._generator
        some = torch.randperm(len(numbers), generator=generator, device=generator.device)[: self._last.of(len(numbers))]
        if not len(some):
            return seen
        shift = torch.randint(-_LAST_SHIFT_PX, _LAST_SHIFT_PX + 1, (len(some), 2), generator=generator, device=generator.device)
        beside = self._corner((corner[some] + WINDOW_PX // 2 + shift).float())
        image, _ = parted(_cut(self._frames.pixels, numbers[some], beside))
        before = _cut(self._seen, numbers[some], beside).permute(0, 3, 1, 2).float()
        planes = (torch.cat([image, before], dim=1) / 255).contiguous(memory_format=torch.channels_last)
        device = planes.device
        with torch.autocast(device.type, torch.bfloat16, enabled=computes_in_bf16(device)):
            found = torch.sigmoid(self._network(planes).float()) * 255
        height, width = self._frames.size
        steps = torch.arange(WINDOW_PX, device=device)
        weights, places = [], []
        for axis, extent in ((1, height), (0, width)):
            at = steps[None] + (corner[some] - beside)[:, axis, None]
            start = torch.where((beside[:, axis] > 0)[:, None], at / MARGIN_PX, torch.inf)
            end = torch.where((beside[:, axis] + WINDOW_PX < extent)[:, None], (WINDOW_PX - 1 - at) / MARGIN_PX, torch.inf)
            inside = (at >= 0) & (at < WINDOW_PX)
            weights.append(torch.minimum(start, end).clamp(0, 1) * inside)
            places.append(at.clamp(0, WINDOW_PX - 1))
        weight = (weights[0][:, :, None] * weights[1][:, None, :])[:, None]
        which = torch.arange(len(some), device=device)[:, None, None]
        moved = found[which, :, places[0][:, :, None], places[1][:, None, :]].permute(0, 3, 1, 2)
        result = seen.clone()
        result[some] = (seen[some] + weight * (moved - seen[some])).round()
        return result


@torch.no_grad()
def looked_at(network: nn.Module, stride: int, frames: DeviceFrames, numbers: Iterable[int]) -> Iterator[tuple[slice, Tensor]]:
    """What a first look sees in some of the frames after each other, uint8 (n, H, W, 2), and which these are.

    Of every second frame it is the mean with its mirror image: streams look once, single pictures from all sides, and the second
    look has to get on with both. `numbers` are those of the first frames of each lot; height and width have to be multiples of
    `stride` for the network.
    """
    height, width = frames.size
    device = frames.device
    for first in numbers:
        lot = slice(first, min(first + _LOOKED_AT_ONCE, len(frames)))
        images, _ = parted(frames.pixels[lot])
        images = functional.pad(images / 255, (0, -width % stride, 0, -height % stride), mode="reflect")
        both = torch.cat([images, images[1::2].flip(3)]).contiguous(memory_format=torch.channels_last)
        with torch.autocast(device.type, torch.bfloat16, enabled=computes_in_bf16(device)):
            found = torch.sigmoid(network(both).float())
        plain, mirrored = found[: len(images)], found[len(images) :].flip(3)
        plain[1::2] = (plain[1::2] + mirrored) / 2
        yield lot, (plain[:, :, :height, :width] * 255).round().to(torch.uint8).permute(0, 2, 3, 1)


def first_looks(network: nn.Module, stride: int, frames: DeviceFrames, track: Iterable[int]) -> tuple[Tensor, Tensor] | None:
    """What a first look sees in all frames, uint8 (N, H, W, 2), and where a second one would go to then, float32 (N, k, 2).

    `track` gives the numbers of the frames after each other, and maybe moves a bar; None where it ends sooner.
    """
    network = network.to(frames.device, memory_format=torch.channels_last).eval()  # type: ignore[call-overload]
    seen = torch.empty((len(frames), *frames.size, 2), dtype=torch.uint8, device=frames.device)
    places: list[Tensor] = []
    counted = iter(track)
    asked: deque[Iterator[Tensor]] = deque()
    with ThreadPoolExecutor(cores()) as pool:
        for lot, found in looked_at(network, stride, frames, range(0, len(frames), _LOOKED_AT_ONCE)):
            seen[lot] = found
            asked.append(pool.map(_places_in, found[..., 1].cpu().numpy()))
            if len(asked) > _LOTS_AHEAD:
                places += asked.popleft()
            if len(list(islice(counted, len(found)))) < len(found):
                return None
        for lots in asked:
            places += lots
    next(counted, None)  # a bar that is told of the end is full
    return seen, torch.stack(places).to(frames.device)


def _places_in(robot: NDArray[np.uint8]) -> Tensor:
    return padded_places(places_to_look(robot.astype(np.float32) / np.float32(255)))


def _cut(store: Tensor, numbers: Tensor, corner: Tensor) -> Tensor:
    """Windows (n, 160, 160, planes) of a store (N, H, W, planes), whose upper left pixels are `corner` (n, 2)."""
    steps = torch.arange(WINDOW_PX, device=store.device)
    rows, columns = corner[:, 1, None] + steps, corner[:, 0, None] + steps
    return store[numbers[:, None, None], rows[:, :, None], columns[:, None, :]]


def _far(found: Tensor, true: Tensor, edge_px: int) -> Tensor:
    """What was missed farther than `edge_px` from all that was found, or invented farther than that from all that is true."""
    near_found, near_true = (_grown(mask.float(), edge_px) > 0 for mask in (found, true))
    return (true & ~near_found) | (found & ~near_true)


def _grown(mask: Tensor, by_px: int) -> Tensor:
    """Dilated by an octagon that is about a disc of this radius: a square after a cross."""
    square = max(0, math.floor(by_px * (2 - math.sqrt(2)) + 0.5))
    grown = functional.max_pool2d(mask[:, None], 2 * square + 1, 1, square)
    for _ in range(by_px - square):
        tall = functional.max_pool2d(grown, (3, 1), 1, (1, 0))
        grown = torch.maximum(tall, functional.max_pool2d(grown, (1, 3), 1, (0, 1)))
    return grown[:, 0]


def _turned(planes: Tensor, ends: Tensor, way: int) -> tuple[Tensor, Tensor]:
    """Square planes (n, c, h, h) and places (n, k, 2) in one of eight orientations."""
    last = planes.shape[2] - 1
    turns, mirrors = way % 4, way >= 4
    planes = torch.rot90(planes, turns, (2, 3))
    for _ in range(turns):
        ends = torch.stack([ends[..., 1], last - ends[..., 0]], dim=-1)
    if mirrors:
        planes, ends = planes.flip(3), torch.stack([last - ends[..., 0], ends[..., 1]], dim=-1)
    # An end that there is not stays nowhere, from whichever side.
    return planes, torch.where(ends.isfinite(), ends, torch.inf)
