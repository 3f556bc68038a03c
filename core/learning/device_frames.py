"""Labelled frames in the memory of a GPU, from which it cuts and changes its own crops (``device_crops``, ``device_windows``).

A processor of two cores makes some 200 crops a second, and a GPU learns from thousands: it would wait nearly all of the time.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from core.learning.crops import true_ends
from core.learning.dataset import WORKING_SIZE_PX, Sample

MOST_ENDS = 6
"""Of a true robot, or of what was taken for one. Those of more are not told."""
VESSEL, ROBOT = 1, 2
"""Bits of the fourth plane of ``DeviceFrames.pixels``."""
_MOST_SHARE = 0.7
"""Of the device's free memory; the network and its crops need some, too."""
_FRAME_BYTES = WORKING_SIZE_PX**2 * 6
"""The most that one frame takes: colours, masks, and what a first look saw."""
_DECODED_AT_ONCE = 256


def fits(count: int, device: torch.device) -> bool:
    """Whether as many frames, with what was seen of them, have room on a CUDA device."""
    return device.type == "cuda" and count * _FRAME_BYTES <= _MOST_SHARE * torch.cuda.mem_get_info(device)[0]


class DeviceFrames:
    """Frames of one size on a device.

    Attributes
    ----------
    pixels : uint8 (N, H, W, 4): red, green, blue, and the masks as bits.
    ends : float32 (N, MOST_ENDS, 2): places (x, y) of the true robot's ends; infinite where there are fewer.
    device : where they are.
    """

    def __init__(self, pixels: Tensor, ends: Tensor) -> None:
        self.pixels, self.ends = pixels, ends
        self.device = pixels.device

    def __len__(self) -> int:
        return len(self.pixels)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width."""
        return self.pixels.shape[1], self.pixels.shape[2]

    @classmethod
    def load(cls, samples: Sequence[Sample], device: torch.device, track: Iterable[int]) -> DeviceFrames | None:
        """Read frames at working size; None when they are not all of one size.

        `track` gives the numbers of the samples one after the other, and maybe moves a bar; where it ends sooner, the frames that
        were read until then are those that there are. Raises DatasetError for a frame that cannot be read.
        """
        pixels, ends = None, torch.full((len(samples), MOST_ENDS, 2), torch.inf)
        done = 0
        for index, (frame, places) in zip(track, _decoded(samples), strict=False):
            if pixels is None:
                pixels = torch.empty((len(samples), *frame.shape), dtype=torch.uint8, device=device)
            if frame.shape != pixels.shape[1:]:
                return None
            pixels[index] = torch.from_numpy(frame).to(device)
            ends[index] = padded_places(places)
            done = index + 1
        return None if pixels is None else cls(pixels[:done], ends[:done].to(device))

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
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for first in range(0, len(samples), _DECODED_AT_ONCE):
            yield from pool.map(_packed, samples[first : first + _DECODED_AT_ONCE])


def _packed(sample: Sample) -> tuple[NDArray[np.uint8], list[tuple[float, float]]]:
    image, vessel, robot = sample.load(WORKING_SIZE_PX)
    bits = vessel.astype(np.uint8) * VESSEL | robot.astype(np.uint8) * ROBOT
    return np.dstack([image, bits]), [(float(x), float(y)) for x, y in true_ends(robot)]


class Shown:
    """Which frames are shown: all of them in turn, and those more often of which much was lost when they were last shown.

    Parameters
    ----------
    count : how many frames there are.
    hard_share : how many of those drawn are drawn by what was lost.
    """

    def __init__(self, count: int, hard_share: float, generator: torch.Generator) -> None:
        device = generator.device
        self._lost = torch.full((count,), 0.3, device=device)
        self._hard_share, self._generator = hard_share, generator
        self._order = torch.empty(0, dtype=torch.long, device=device)
        self._drawn = self._order

    def draw(self, count: int) -> tuple[Tensor, int]:
        """`count` numbers of frames; the first ones, as many as is said with them, are drawn by what was lost."""
        hard = round(count * self._hard_share)
        while len(self._order) < count - hard:
            anew = torch.randperm(len(self._lost), generator=self._generator, device=self._lost.device)
            self._order = torch.cat([self._order, anew])
        plain, self._order = self._order[: count - hard], self._order[count - hard :]
        chances = self._lost.clamp(min=0.02)
        lost = torch.multinomial(chances, hard, replacement=True, generator=self._generator) if hard else plain[:0]
        self._drawn = torch.cat([lost, plain])
        return self._drawn, hard

    def note(self, lost: Tensor) -> None:
        """What was lost, float (n,), of the frames that were drawn last."""
        self._lost[self._drawn] = 0.5 * self._lost[self._drawn] + 0.5 * lost.to(self._lost.dtype)
