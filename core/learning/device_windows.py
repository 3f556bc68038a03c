"""Windows for the second look, a batch at a time, on the device where the frames are (``device_frames``)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional
from torch.utils.data import IterableDataset

from core.learning.crops import (
    EDGE_PX,
    JITTER_PX,
    LAST_SHARE,
    MISSED_SHARE,
    WALL_PX,
    WALL_REACH_PX,
    WRONG_JITTER_PX,
    Crop,
)
from core.learning.device_crops import labels_of, some_changed, some_pixel
from core.learning.device_frames import ROBOT, VESSEL, DeviceFrames, Share, Shown, padded_places, parted
from core.learning.device_looks import drawn
from core.learning.training import computes_in_bf16
from core.learning.training_plan import TrainingPlan
from core.perception.engines import cores
from core.perception.second_look import WINDOW_PX, Planes, places_to_look
from core.perception.windows import MARGIN_PX

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
