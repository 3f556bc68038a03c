"""The paper's method as it is written down, for a comparison of speed: base-64 dual-decoder U-Net in fp32 at 256x256, thinning,
Algorithm 1, recursive path tracing. ``benchmark`` compares with its time; its weights are random, which costs the same.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from time import perf_counter

import cv2
import numpy as np
import torch
from skimage.morphology import remove_small_holes, remove_small_objects, skeletonize

from core.perception.unet import DualUNet, UNetShape
from core.types import Image, Mask

_SIDE = 256
_NEIGHBOURS = tuple((dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx)
_MAX_DEPTH = 5000


@dataclass(frozen=True, slots=True)
class BaselineTiming:
    """Milliseconds of one frame."""

    network_ms: float
    after_network_ms: float

    @property
    def total_ms(self) -> float:
        return self.network_ms + self.after_network_ms


class PaperBaseline:
    """The baseline with its network loaded. ``threads``: CPU threads for torch, 0 = all cores."""

    def __init__(self, threads: int = 0) -> None:
        torch.set_num_threads(threads or os.cpu_count() or 1)
        torch.manual_seed(0)
        self._network = DualUNet(UNetShape.of_base(64)).eval()

    def time(self, image: Image, vessel: Mask, robot: Mask) -> BaselineTiming:
        """Time one frame: the network on `image`, what follows on the given masks (a random network gives none worth thinning)."""
        start = perf_counter()
        small = cv2.resize(image, (_SIDE, _SIDE), interpolation=cv2.INTER_AREA)
        with torch.inference_mode():
            batch = torch.from_numpy(small.transpose(2, 0, 1).astype(np.float32) / 255)[None]
            torch.sigmoid(self._network(batch)).numpy()
        middle = perf_counter()
        masks = [cv2.resize(m.astype(np.uint8), (_SIDE, _SIDE), interpolation=cv2.INTER_NEAREST) > 0 for m in (vessel, robot)]
        trace_paper(masks[0], masks[1])
        return BaselineTiming((middle - start) * 1e3, (perf_counter() - middle) * 1e3)


def trace_paper(vessel: Mask, robot: Mask) -> list[tuple[int, int]]:
    """Cleaning, thinning, Algorithm 1 and recursive tracing on both masks; the robot's path as (row, column) pixels."""
    skeletons = []
    for mask in (vessel, robot):
        clean = remove_small_holes(remove_small_objects(mask, max_size=63), max_size=63)
        skeletons.append(skeletonize(clean))
    robot_skeleton = connect_gaps(skeletons[1], 20.0)
    starts = end_points(robot_skeleton)
    pixels = {(int(y), int(x)) for y, x in np.argwhere(robot_skeleton)}
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, _MAX_DEPTH + 1000))
    try:
        paths = [_longest(start, pixels, set(), 0) for start in starts]
    finally:
        sys.setrecursionlimit(limit)
    return max(paths, key=_score, default=[])


def end_points(skeleton: Mask) -> list[tuple[int, int]]:
    """Pixels (row, column) where the convolution with [[1, 1, 1], [1, 10, 1], [1, 1, 1]] gives 11."""
    kernel = np.array([[1, 1, 1], [1, 10, 1], [1, 1, 1]], np.float32)
    count = cv2.filter2D(skeleton.astype(np.float32), -1, kernel, borderType=cv2.BORDER_CONSTANT)
    return [(int(y), int(x)) for y, x in np.argwhere((count == 11) & skeleton)]


def connect_gaps(skeleton: Mask, gap_threshold: float) -> Mask:
    """The paper's Algorithm 1, literally: every pair of end points closer than the threshold is joined."""
    joined = skeleton.astype(np.uint8)
    ends = end_points(skeleton)
    for i, first in enumerate(ends):
        for second in ends[i + 1 :]:
            if np.hypot(first[0] - second[0], first[1] - second[1]) < gap_threshold:
                cv2.line(joined, first[::-1], second[::-1], 1)
    return np.asarray(joined > 0)


def _longest(
    pixel: tuple[int, int], pixels: set[tuple[int, int]], visited: set[tuple[int, int]], depth: int
) -> list[tuple[int, int]]:
    visited.add(pixel)
    best: list[tuple[int, int]] = []
    if depth < _MAX_DEPTH:
        for dy, dx in _NEIGHBOURS:
            step = (pixel[0] + dy, pixel[1] + dx)
            if step in pixels and step not in visited:
                branch = _longest(step, pixels, visited, depth + 1)
                if len(branch) > len(best):
                    best = branch
    return [pixel, *best]


def _score(path: list[tuple[int, int]]) -> float:
    points = np.array(path, np.float64)
    if len(points) < 3:
        return 0.0
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    main = points[-1] - points[0]
    consistency = np.abs(steps @ main) / (lengths * max(float(np.linalg.norm(main)), 1e-9))
    smooth = np.abs(np.einsum("ij,ij->i", steps[1:], steps[:-1])) / (lengths[1:] * lengths[:-1])
    return float(len(points) / _SIDE + smooth.mean() + consistency.mean())
