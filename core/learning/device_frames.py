"""Labelled frames in the memory of a GPU, from which it cuts and changes its own crops (``device_crops``, ``device_windows``).

A processor of two cores makes some 200 crops a second, and a GPU learns from thousands: it would wait nearly all of the time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from core.learning.crops import true_ends
from core.learning.dataset import WORKING_SIZE_PX, Sample
from core.perception.engines import cores

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
