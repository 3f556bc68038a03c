"""Decoded frames, kept in memory as far as they fit: decoding one costs more than cutting a window out of it."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.learning.dataset import WORKING_SIZE_PX, Sample
from core.types import Image, Mask

_KEPT_SHARE = 0.65
"""Of the free memory: 14 GB hold 14000 frames of 640x480, or 8700 with one picture of what was seen of each."""
_FRAME_BYTES = WORKING_SIZE_PX**2 * 13 // 4
"""The most that one frame takes: three bytes of colour a pixel and two bits of masks."""


class KeptFrames:
    """Labelled frames at working size, and arrays that belong to them.

    Parameters
    ----------
    count : how many frames there will be. Arrays besides are kept only where the frames leave room for them: they are quicker to
        make anew.
    """

    def __init__(self, count: int) -> None:
        self._frames: dict[Hashable, tuple[Image, NDArray[np.uint8]]] = {}
        self._arrays: dict[Hashable, tuple[NDArray[Any], ...]] = {}
        self._room = _free_memory() * _KEPT_SHARE
        self._room_besides = self._room - count * _FRAME_BYTES

    def frame(self, sample: Sample) -> tuple[Image, Mask, Mask]:
        """Image (h, w, 3), vessel and robot (h, w); one that is shown more often is kept once. Raises DatasetError."""
        kept = self._frames.get(sample.image)
        if kept is None:
            image, vessel, robot = sample.load(WORKING_SIZE_PX)
            packed = np.packbits(np.stack([vessel, robot]).reshape(2, -1), axis=1)
            if self._room > 0:
                self._frames[sample.image] = image, packed
                self._room -= image.nbytes + packed.nbytes
            return image, vessel, robot
        image, packed = kept
        height, width = image.shape[:2]
        masks = np.unpackbits(packed, axis=1, count=height * width).view(bool).reshape(2, height, width)
        return image, masks[0], masks[1]

    def get(self, key: Hashable, make: Callable[[], tuple[NDArray[Any], ...]]) -> tuple[NDArray[Any], ...]:
        """What was kept under `key`, or what `make` gives."""
        arrays = self._arrays.get(key)
        if arrays is None:
            arrays = make()
            if self._room_besides > 0:
                self._arrays[key] = arrays
                self._room_besides -= sum(array.nbytes for array in arrays)
        return arrays


def _free_memory() -> float:
    """Bytes that are free, or a modest guess where the system does not tell."""
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return 4e9
