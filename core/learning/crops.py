"""What a network is shown in training: cut-outs of labelled frames, changed at random."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from core.learning.augment import random_clutter, random_crop, random_look, with_strips
from core.learning.dataset import WORKING_SIZE_PX, Sample
from core.learning.kept_frames import KeptFrames
from core.learning.training_plan import TrainingPlan
from core.perception.compiled import loops
from core.perception.second_look import WINDOW_PX, look_again, places_to_look
from core.perception.segmentation import Probability, Segmenter
from core.perception.skeleton import end_pixels
from core.perception.thinning import thin
from core.perception.windows import window_around
from core.types import Mask, Point

MISSED_SHARE = 0.35
"""Of the second look's windows: as many show a pixel that the first look got wrong. The others show what it would look at."""
LAST_SHARE = 0.5
JITTER_PX = 10.0
EDGE_PX = 4
"""What is wrong farther than this from the robot's outline is no blur of it: a piece was missed or invented."""
WALL_PX = 3
"""Nor is what of a vessel is wrong farther than this from its wall: the line between the walls may lie more than a pixel aside."""
WALL_REACH_PX = 60.0
"""So near to the robot's ends: the vessel's vector is fitted to 20 px to each side of the head."""
_WRONG_PLACES = 32
WRONG_JITTER_PX = 30.0
END_REACH_PX = 20.0
"""Standard deviation of what counts as near to a robot's end: half of the 40 px that its vector and the vessel's are fitted to."""
BORDER_PX = 8.0

Crop = tuple[Tensor, Tensor]
"""uint8 (planes, h, w) and its labels uint8 (2 or 3, h, w): vessel, robot (0, 1), and where the plan weighs the robot's ends, how
near they are (0..255)."""


class _Order:
    """Epochs without repetition: a place in a permutation that is drawn anew for every pass."""

    def __init__(self, seed: int, count: int) -> None:
        self._seed, self._count = seed, count
        self._drawn: tuple[int, NDArray[np.int64]] | None = None

    def __getitem__(self, index: int) -> int:
        epoch, place = divmod(index, self._count)
        if self._drawn is None or self._drawn[0] != epoch:
            rng = np.random.default_rng((self._seed, 7919, epoch))
            self._drawn = (epoch, rng.permutation(self._count))
        return int(self._drawn[1][place])


class FrameCrops(Dataset[Crop]):
    """For the first look: cut-outs of ``plan.crop``, turned, scaled and mirrored, most of them near the robot.

    Crop `i` depends on the seed and `i` alone, so that a run can be repeated with any number of workers. `difficulty` (one weight
    > 0 per sample, ``difficulty.py``) says where ``plan.focus_share`` of the crops come from.
    """

    def __init__(self, samples: list[Sample], plan: TrainingPlan, difficulty: NDArray[np.float64] | None = None) -> None:
        self._plan = plan
        self._chances = None if difficulty is None else np.cumsum(difficulty) / np.sum(difficulty)
        self._samples, self._kept = samples, KeptFrames(len(samples))
        self._order = _Order(plan.seed, len(samples))
        _load_for_workers(plan)

    def __len__(self) -> int:
        return self._plan.steps * self._plan.batch

    def __getitem__(self, index: int) -> Crop:
        rng = np.random.default_rng((self._plan.seed, index))
        size = self._plan.crop
        if rng.random() < self._plan.clutter_share:
            image, vessel, robot = random_clutter(size, rng), np.zeros(size, bool), np.zeros(size, bool)
        else:
            place = self._order[index]
            if self._chances is not None and rng.random() < self._plan.focus_share:
                place = int(np.searchsorted(self._chances, rng.random(), side="right"))
            image, vessel, robot = random_crop(*self._kept.frame(self._samples[place]), size, rng)
            if self._plan.strip_share > 0 and rng.random() < self._plan.strip_share:
                image = with_strips(image, vessel, robot, rng)
        if rng.random() < self._plan.look_share:
            image = random_look(image, rng)
        return _tensors(image, vessel, robot, self._plan)


@dataclass(frozen=True, slots=True)
class Seen:
    """What a frame was taken for: both probabilities as PNG, 0..255, and the places that a second look would go to then."""

    vessel_png: bytes
    robot_png: bytes
    places: tuple[Point, ...]

    @classmethod
    def of(cls, vessel: Probability, robot: Probability) -> Seen:
        packed = [cv2.imencode(".png", np.rint(seen * 255).astype(np.uint8))[1].tobytes() for seen in (vessel, robot)]
        return cls(packed[0], packed[1], tuple(places_to_look(robot)))

    def probabilities(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Vessel and robot (h, w), 0..255."""
        packed = (np.frombuffer(data, np.uint8) for data in (self.vessel_png, self.robot_png))
        vessel, robot = (np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8) for data in packed)
        return vessel, robot


@dataclass(frozen=True, slots=True)
class Looks:
    """What a model saw in a frame at its first look, and in the end, where it has a second one.

    ``wrong`` are places on pieces of robot, and of vessel beside the robot's ends, that it missed or invented in the end.
    """

    first: Seen
    last: Seen
    wrong: tuple[Point, ...] = ()

    @classmethod
    def at(cls, sample: Sample, segment: Segmenter, near: Segmenter | None = None) -> Looks:
        """Look at a frame, with a second look by `near`; raises DatasetError."""
        image, vessel, robot = sample.load(WORKING_SIZE_PX)
        probabilities = segment(image)
        first = last = Seen.of(*probabilities)
        if near is not None:
            probabilities = look_again(image, probabilities, near)
            last = Seen.of(*probabilities)
        found_vessel, found_robot = (probability >= np.float32(0.5) for probability in probabilities)
        shifted = _wrong(found_vessel, vessel, WALL_PX) & (_end_distances(robot) <= WALL_REACH_PX)
        return cls(first, last, tuple(_some_of(_wrong(found_robot, robot, EDGE_PX)) + _some_of(shifted)))


class NearCrops(Dataset[Crop]):
    """For the second look: windows as it is shown them, with what the first look (`looks`, one per sample) says there.

    Half of them come with what was seen in the end instead: a second look may be followed by another one (``SecondLook``).
    ``plan.focus_share`` of them show a piece that was missed or invented, of any frame with one.
    """

    def __init__(self, samples: list[Sample], looks: list[Looks], plan: TrainingPlan) -> None:
        self._plan, self._looks = plan, looks
        self._failed = [place for place, look in enumerate(looks) if look.wrong]
        self._samples, self._kept = samples, KeptFrames(len(samples))
        self._order = _Order(plan.seed, len(samples))
        _load_for_workers(plan)

    def __len__(self) -> int:
        return self._plan.steps * self._plan.batch

    def __getitem__(self, index: int) -> Crop:
        rng = np.random.default_rng((self._plan.seed, index))
        focused = self._plan.focus_share > 0 and bool(self._failed) and rng.random() < self._plan.focus_share
        place = self._failed[int(rng.integers(len(self._failed)))] if focused else self._order[index]
        sample, looks = self._samples[place], self._looks[place]
        image, vessel, robot = self._kept.frame(sample)
        seen = looks.last if rng.random() < LAST_SHARE else looks.first
        seen_vessel, seen_robot = self._kept.get((sample.image, seen is not looks.first), seen.probabilities)
        center = _beside(looks.wrong, WRONG_JITTER_PX, robot, rng) if focused else _place(seen_robot, robot, seen.places, rng)
        x, y, width, height = window_around(center, (image.shape[1], image.shape[0]), WINDOW_PX)
        part = np.s_[y : y + height, x : x + width]
        cut = _filled(np.dstack([image[part], seen_vessel[part], seen_robot[part], vessel[part], robot[part]]))
        # Quarter turns and mirror images cost no sharpness; the first look has seen all other angles and sizes.
        cut = np.rot90(cut, int(rng.integers(4)))
        cut = cut[:, ::-1] if rng.random() < 0.5 else cut
        cut = np.ascontiguousarray(cut)
        if rng.random() < self._plan.look_share:
            cut[:, :, :3] = random_look(cut[:, :, :3], rng)
        return _tensors(cut[:, :, :5], cut[:, :, 5] > 0, cut[:, :, 6] > 0, self._plan)


def _load_for_workers(plan: TrainingPlan) -> None:
    """The robot's ends are found with the compiled loops, which workers that are forked from here need not load each."""
    if plan.end_weight > 0:
        loops.load()


def _place(seen_robot: NDArray[np.uint8], robot: Mask, places: tuple[Point, ...], rng: Generator) -> Point:
    """Where the first look went wrong, or where the second one would look, a bit beside it."""
    if rng.random() < MISSED_SHARE:
        rows, columns = np.nonzero((seen_robot > 127) != robot)
        if len(rows):
            pick = int(rng.integers(len(rows)))
            return float(columns[pick]), float(rows[pick])
    return _beside(places, JITTER_PX, robot, rng)


def _beside(places: tuple[Point, ...], jitter_px: float, robot: Mask, rng: Generator) -> Point:
    """Near one of the places, or anywhere in the picture where there is none."""
    height, width = robot.shape
    x, y = places[int(rng.integers(len(places)))] if places else (rng.uniform(0, width), rng.uniform(0, height))
    across, down = rng.normal(0, jitter_px, 2)
    return min(max(x + across, 0.0), width - 1.0), min(max(y + down, 0.0), height - 1.0)


def _wrong(found: Mask, true: Mask, edge_px: int) -> Mask:
    """What was missed farther than `edge_px` from all that was found, or invented farther than that from all that is true."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * edge_px + 1, 2 * edge_px + 1))
    near_found, near_true = (cv2.dilate(mask.view(np.uint8), disc) > 0 for mask in (found, true))
    return np.asarray((true & ~near_found) | (found & ~near_true))


def _some_of(mask: Mask) -> list[Point]:
    """Places (x, y) evenly over a mask, ``_WRONG_PLACES`` or some more."""
    rows, columns = np.nonzero(mask)
    step = max(1, len(rows) // _WRONG_PLACES)
    return list(zip(columns[::step].astype(float).tolist(), rows[::step].astype(float).tolist(), strict=True))


def _filled(cut: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A window of a small picture brought to full size, its edge going on."""
    down, right = WINDOW_PX - cut.shape[0], WINDOW_PX - cut.shape[1]
    return np.pad(cut, ((0, down), (0, right), (0, 0)), mode="edge") if down or right else cut


def _tensors(image: NDArray[np.uint8], vessel: Mask, robot: Mask, plan: TrainingPlan) -> Crop:
    labels = [vessel.astype(np.uint8), robot.astype(np.uint8)]
    if plan.end_weight > 0:
        labels.append(_nearness(robot))
    return torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1))), torch.from_numpy(np.stack(labels))


def _nearness(robot: Mask) -> NDArray[np.uint8]:
    """How near each pixel is to an end of the true robot, 255 there; where the cut-out's border cuts it off it does not end."""
    return np.asarray(np.rint(255 * np.exp(-0.5 * (_end_distances(robot) / np.float32(END_REACH_PX)) ** 2)), np.uint8)


def _end_distances(robot: Mask) -> NDArray[np.float32]:
    """How far each pixel is from the nearest end of the true robot; infinite where it has none."""
    rows, columns = np.ogrid[: robot.shape[0], : robot.shape[1]]
    nearest = np.full(robot.shape, np.inf, np.float32)
    for x, y in true_ends(robot):
        np.minimum(nearest, (rows - y) ** 2 + (columns - x) ** 2, out=nearest)
    return np.sqrt(nearest)


def true_ends(robot: Mask) -> list[tuple[int, int]]:
    """Ends (x, y) of a true mask's skeleton inside the cut-out: farther from its border than thinning draws back an end."""
    left, top, across, down = cv2.boundingRect(robot.view(np.uint8))
    if not across:
        return []
    box = np.ascontiguousarray(robot[top : top + down, left : left + across])
    half_width = float(cv2.distanceTransform(np.pad(box, 1).view(np.uint8), cv2.DIST_L2, 3).max())
    margin = max(BORDER_PX, half_width + 3.0)
    height, width = robot.shape
    ends = ((x + left, y + top) for x, y in end_pixels(thin(box)))
    return [(x, y) for x, y in ends if min(x, y, width - 1 - x, height - 1 - y) >= margin]
