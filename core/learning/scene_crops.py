"""Training crops painted from scenes, with the labels of vessel, robot and the robot's ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from torch.utils.data import Dataset

from core.learning.augmentation import BORDER_PX, Crop, CropDataset, FrameCrops, nearness_to, random_placement
from core.learning.boards import F32
from core.learning.painting import Levels, PaintedBench, exposed
from core.learning.scenes import MOST_RATIO, REACH_PX, BenchScene, read_scene
from core.learning.training_plan import TrainingPlan
from core.types import Mask, Points

CROPS_PER_BENCH = 4
"""Crops that share a painted bench, which costs four times as much as a robot in it and its exposure."""
TWIN_SHARE = 0.3
"""Share of the benches that are the twin's own pictures, where the scene has some."""
EMPTY_SHARE = 0.07
"""Share of the crops without robot."""
_PAINTED_SCALES = 0.6, 1.7
"""Scales of painted crops: a painted tube is as sharp at any."""
_ON_ROBOT_SHARE, _NEAR_TIP_SHARE = 0.7, 0.6
"""Share of the painted crops that are centred on a robot, and of these in the third with its tip; others lie anywhere."""
_RADIUS_SPREAD, _RADII_PX = 0.45, (1.0, 9.0)
"""Spread of the painted robots' radius as a natural logarithm, and its limits."""


@dataclass(frozen=True, slots=True, eq=False)
class _PaintedView:
    """A painted bench: its crop's placement in the scene, and the robots (N, 2) in the crop's pixels in random order."""

    bench: PaintedBench
    lines: list[Points]
    radius_px: float


class SceneCrops(CropDataset):
    """Crops from scenes' files; ``CROPS_PER_BENCH`` in a row share a bench.

    Most are painted at random; some are cut from the twin's pictures. The last bench is kept, so that it is painted once for crops
    that are asked for in their order.
    """

    def __init__(self, files: Sequence[Path], plan: TrainingPlan, *, has_doubt: bool = False) -> None:
        super().__init__([], plan)
        self._files, self._count, self.has_doubt = files, len(files), has_doubt
        self._last: tuple[int, BenchScene | _PaintedView] | None = None

    def __getitem__(self, index: int) -> Crop:
        group, member = divmod(index, CROPS_PER_BENCH)
        if self._last is None or self._last[0] != group:
            self._last = group, self._view(group)
        view, rng = self._last[1], np.random.default_rng((self._plan.seed, index))
        if isinstance(view, _PaintedView):
            picture, vessel, robot, line = _painted_crop(rng, view, member)
        else:
            picture, vessel, robot, line = _twin_crop(rng, view, member, self._plan.crop)
        labels = [vessel.astype(np.uint8), robot.astype(np.uint8)]
        if self._plan.end_weight > 0:
            labels.append(nearness_to(_ends(line, robot), robot.shape))
        if self.has_doubt:
            labels += [np.zeros_like(labels[0])] * (4 - len(labels))
        return torch.from_numpy(picture), torch.from_numpy(np.stack(labels))

    def _view(self, group: int) -> BenchScene | _PaintedView:
        """The scene whose pictures are shown, or a bench painted from it; depends on the seed and `group` alone."""
        rng = np.random.default_rng((self._plan.seed, 104_729, group))
        path, is_twin = self._files[self.place_of(group)], rng.random() < TWIN_SHARE
        scene = read_scene(path, pictures=is_twin)
        if scene.pictures:
            return scene
        size, (height, width) = self._plan.crop, scene.ratio.shape
        order = rng.permutation(len(scene.lines))
        placement = random_placement(_center(rng, scene.lines[order[0]], (height, width)), size, rng, _PAINTED_SCALES)
        scale = float(np.sqrt(abs(np.linalg.det(placement[:, :2]))))
        distance = _placed(scene.distance_px, placement, size, REACH_PX) * np.float32(scale)
        if rng.random() < self._plan.clutter_share:
            distance[:] = REACH_PX
        ratio = _placed(scene.ratio, placement, size, MOST_RATIO)
        bench = PaintedBench(rng, distance, ratio)
        lines = [_moved(scene.lines[place], placement) for place in order]
        return _PaintedView(bench, lines, scene.radius_px * scale)


class MixedCrops(Dataset[Crop]):
    """Crops of scenes, for ``plan.scene_share``, and of labelled frames."""

    def __init__(self, files: Sequence[Path], frames: FrameCrops, plan: TrainingPlan) -> None:
        self._scenes, self._frames, self._plan = SceneCrops(files, plan, has_doubt=frames.has_doubt), frames, plan

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Crop:
        drawn = np.random.default_rng((self._plan.seed, 15_485_863, index // CROPS_PER_BENCH)).random()
        return self._scenes[index] if drawn < self._plan.scene_share else self._frames[index]


def _center(rng: Generator, line: Points, size: tuple[int, int]) -> tuple[float, float]:
    """Where a crop is centred: on a robot, often near its tip, or anywhere."""
    height, width = size
    seen = line[np.all((line > 0) & (line < (width, height)), axis=1)]
    if len(seen) and rng.random() < _ON_ROBOT_SHARE:
        first = len(seen) - max(1, len(seen) // 3) if rng.random() < _NEAR_TIP_SHARE else 0
        x, y = seen[int(rng.integers(first, len(seen)))]
        return float(x), float(y)
    return float(rng.uniform(0.2, 0.8) * width), float(rng.uniform(0.2, 0.8) * height)


def _placed(plane: F32, placement: NDArray[np.float64], size: tuple[int, int], beyond: float) -> F32:
    """A map in a crop; `beyond` is its value outside the scene."""
    return np.asarray(cv2.warpAffine(plane, placement, size[::-1], flags=cv2.INTER_LINEAR, borderValue=beyond), np.float32)


def _moved(line: Points, placement: NDArray[np.float64]) -> Points:
    return np.asarray(line @ placement[:, :2].T + placement[:, 2])


_Parts = tuple[Levels, Mask, Mask, Points]
"""Picture, vessel, robot, and the robot's line (N, 2)."""


def _painted_crop(rng: Generator, view: _PaintedView, member: int) -> _Parts:
    bench, line = view.bench, view.lines[member % len(view.lines)]
    if rng.random() < EMPTY_SHARE or not bench.vessel.any():
        picture, robot = bench.empty(), np.zeros(bench.vessel.shape, bool)
    else:
        radius_px = float(np.clip(view.radius_px * np.exp(rng.normal(0, _RADIUS_SPREAD)), *_RADII_PX))
        picture, robot = bench.with_robot(rng, line, radius_px)
    return exposed(rng, picture, bench.vessel, bench.blur_px), bench.vessel, robot, line


def _twin_crop(rng: Generator, scene: BenchScene, member: int, size: tuple[int, int]) -> _Parts:
    assert scene.empty is not None
    place = member % len(scene.pictures)
    image, robot = scene.pictures[place]
    if rng.random() < EMPTY_SHARE:
        image, robot = scene.empty, np.zeros_like(robot)
    rows, columns = np.nonzero(robot) if rng.random() < _ON_ROBOT_SHARE else ((), ())
    height, width = robot.shape
    center = float(rng.uniform(0.2, 0.8) * width), float(rng.uniform(0.2, 0.8) * height)
    if len(rows):
        pick = int(rng.integers(len(rows)))
        center = float(columns[pick]), float(rows[pick])
    placement = random_placement(center, size, rng)
    # Beyond the picture lies one colour without labels, as in crops of frames.
    fill = tuple(float(level) for level in image[int(rng.integers(height)), int(rng.integers(width))])
    cut = cv2.warpAffine(image, placement, size[::-1], flags=cv2.INTER_LINEAR, borderValue=fill)
    picture = np.ascontiguousarray(cut.transpose(2, 0, 1), np.float32) * np.float32(1 / 255)
    vessel, seen = (
        cv2.warpAffine(mask.astype(np.uint8) * 255, placement, size[::-1], flags=cv2.INTER_LINEAR) > 127
        for mask in (scene.vessel, robot)
    )
    line = _moved(scene.lines[place], placement)
    return exposed(rng, picture, vessel, 0.0), vessel, seen, line


def _ends(line: Points, robot: Mask) -> list[tuple[float, float]]:
    """The ends (x, y) of a line at which its robot ends in a crop, too."""
    height, width = robot.shape
    ends = []
    for x, y in (line[0], line[-1]):
        if min(x, y, width - 1 - x, height - 1 - y) >= BORDER_PX and robot[round(y), round(x)]:
            ends.append((float(x), float(y)))
    return ends
