"""Crops of whole frames for the first look, a batch at a time, on the device where the frames are (``device_frames``)."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.utils.data import IterableDataset

from core.learning.augment import random_clutter
from core.learning.crops import BORDER_PX, END_REACH_PX, Crop
from core.learning.device_frames import ROBOT, DeviceFrames, Share, Shown
from core.learning.device_looks import drawn, happens, random_looks
from core.learning.training_plan import TrainingPlan

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
