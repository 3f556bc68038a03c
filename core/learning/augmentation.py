"""Training crops: cut-outs of labelled frames, changed at random; geometry for image and masks alike, looks for the image alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from core.learning.dataset import WORKING_SIZE_PX, KeptFrames, Sample
from core.learning.training_plan import TrainingPlan
from core.perception import compiled
from core.perception.segmentation import Probability, Segmenter, window_around
from core.perception.skeleton import end_pixels, thin
from core.perception.tip_refinement import WINDOW_PX, find_tips, refine_tips
from core.types import Image, Mask, Point


def random_crop(image: Image, masks: Sequence[Mask], size: tuple[int, int], rng: Generator) -> tuple[Image, list[Mask]]:
    """A turned, scaled, perhaps mirrored cut-out of `size` (height, width), in one warp so that nothing is blurred twice.

    `masks` are vessel, robot, and others of the same image. Two of three cut-outs are centred on the robot, which is one or two
    percent of the pixels.
    """
    height, width = size
    robot = masks[1]
    rows, columns = np.nonzero(robot) if rng.random() < 0.65 else ((), ())
    if len(rows):
        pick = int(rng.integers(len(rows)))
        center = float(columns[pick]), float(rows[pick])
    else:
        center = float(rng.uniform(0.2, 0.8) * robot.shape[1]), float(rng.uniform(0.2, 0.8) * robot.shape[0])
    matrix = random_placement(center, size, rng)
    # Beyond the picture lies one colour without labels; mirrored, robots would meet their own reflection.
    fill = tuple(float(v) for v in image[int(rng.integers(image.shape[0])), int(rng.integers(image.shape[1]))])
    cut = cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_LINEAR, borderValue=fill)
    moved_masks = [cv2.warpAffine(m.astype(np.uint8) * 255, matrix, (width, height), flags=cv2.INTER_LINEAR) > 127 for m in masks]
    return np.asarray(cut, np.uint8), [np.asarray(mask) for mask in moved_masks]


def random_placement(
    center: Point, size: tuple[int, int], rng: Generator, scales: tuple[float, float] = (0.75, 1.35)
) -> NDArray[np.float64]:
    """A turn, a scale between `scales`, perhaps a mirror image, and a shift that brings `center` near a crop's middle: (2, 3)."""
    scale = float(np.exp(rng.uniform(*np.log(scales))))
    angle = rng.choice((0.0, 90.0, 180.0, 270.0)) + (rng.uniform(-45, 45) if rng.random() < 0.5 else 0.0)
    matrix = np.asarray(cv2.getRotationMatrix2D(center, angle, scale))
    if rng.random() < 0.5:
        matrix[0, :2] = -matrix[0, :2]  # the shift is set below
    target = np.array(size[::-1]) * (0.5 + rng.uniform(-0.25, 0.25, 2))
    matrix[:, 2] += target - matrix @ np.array([*center, 1.0])
    return np.asarray(matrix, np.float64)


def with_strips(image: Image, vessel: Mask, robot: Mask, rng: Generator) -> Image:
    """`image` with one or two clips across the lumen, most of them over the robot and more often near its ends than on its body.

    The labels stay: robot and lumen continue under the clips.
    """
    painted = image.copy()
    for _ in range(int(rng.integers(1, 3))):
        under = robot if rng.random() < 0.75 and robot.any() else vessel
        found = np.argwhere(under)[:, ::-1]
        if not len(found):
            break
        some = found[rng.integers(len(found), size=6)].astype(float)
        far = np.linalg.norm(some - found.mean(axis=0), axis=1)
        middle = some[int(np.argmax(far))] if rng.random() < 0.5 else some[0]
        _strip(painted, middle + rng.normal(0, 4, 2), _across(found, middle) + rng.normal(0, 0.3), rng)
    return painted


def _across(found: np.ndarray, middle: np.ndarray) -> float:
    """The angle in radians at a right angle to what lies near `middle`; `found` (N, 2) in px."""
    near = found[np.linalg.norm(found - middle, axis=1) < 25] - middle
    if len(near) < 3:
        return 0.0
    along = np.linalg.eigh(near.T @ near)[1][:, 1]
    return float(np.arctan2(along[0], -along[1]))


def _strip(image: Image, middle: np.ndarray, angle: float, rng: Generator) -> None:
    """Paint a half see-through rectangle with a rim, a raised middle and a bit of shadow into `image`."""
    tone = rng.uniform(0.1, 1.0) * np.ones(3) if rng.random() < 0.7 else rng.uniform(0.1, 0.95, 3)
    opacity, shade = rng.uniform(0.35, 0.92), rng.uniform(0.6, 1.0)
    half = np.array([rng.uniform(14, 40), rng.uniform(4, 12)])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

    def corners(share: tuple[float, float], shift: float = 0.0) -> np.ndarray:
        box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half * share @ turn + middle + shift
        return np.asarray(np.rint(box * 16).astype(np.int32))

    shadow = np.ones(image.shape[:2], np.float32)
    cv2.fillPoly(shadow, [corners((1, 1), rng.uniform(-3, 3))], float(shade), cv2.LINE_AA, 4)
    paint: np.ndarray = image * shadow[:, :, None]
    cover = np.zeros(image.shape[:2], np.float32)
    color = np.zeros(image.shape, np.float32)
    for share, lightness in (((1.0, 1.0), 1.0), ((0.96, 0.45), rng.uniform(0.9, 1.2))):
        level = tuple(float(v) for v in np.clip(255 * tone * lightness, 0, 255))
        cv2.fillPoly(cover, [corners(share)], opacity, cv2.LINE_AA, 4)
        cv2.fillPoly(color, [corners(share)], level, cv2.LINE_AA, 4)
    cv2.polylines(color, [corners((1, 1))], True, tuple(float(v) for v in 150 * tone), 1, cv2.LINE_AA, 4)
    paint += (color - paint) * cover[:, :, None]
    image[:] = np.clip(paint, 0, 255).astype(np.uint8)


def random_look(image: Image, rng: Generator) -> Image:
    """Exposure, contrast, gamma, white balance, uneven light, blur, noise and compression, each now and then."""
    pixels: np.ndarray = image.astype(np.float32) / 255.0
    if rng.random() < 0.7:
        mean = float(pixels.mean())
        pixels = (pixels - mean) * rng.uniform(0.65, 1.4) + mean + rng.uniform(-0.15, 0.15)
    if rng.random() < 0.5:
        pixels = pixels * rng.uniform(0.85, 1.15, 3).astype(np.float32)
    if rng.random() < 0.12:
        pixels = np.repeat(pixels.mean(axis=2, keepdims=True), 3, axis=2)
    elif rng.random() < 0.12:
        pixels = pixels[:, :, rng.permutation(3)]
    if rng.random() < 0.4:
        pixels = np.clip(pixels, 0, 1) ** np.float32(np.exp(rng.uniform(-0.5, 0.5)))
    if rng.random() < 0.3:
        light = rng.uniform(0.6, 1.3, (4, 4)).astype(np.float32)
        pixels = pixels * cv2.resize(light, pixels.shape[1::-1], interpolation=cv2.INTER_CUBIC)[:, :, None]
    if rng.random() < 0.25:
        pixels = cv2.GaussianBlur(pixels, (0, 0), float(rng.uniform(0.4, 1.3)))
    if rng.random() < 0.35:
        pixels = pixels + rng.normal(0, rng.uniform(0.005, 0.04), pixels.shape).astype(np.float32)
    result = np.asarray((np.clip(pixels, 0, 1) * 255).astype(np.uint8))
    if rng.random() < 0.15:
        data = cv2.imencode(".jpg", result, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 90))])[1]
        result = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))
    return result


def random_clutter(size: tuple[int, int], rng: Generator) -> Image:
    """A picture with neither vessel nor robot: plain, noisy or striped boards, blobs, cables, boxes. Its masks are empty."""
    height, width = size
    image = np.full((height, width, 3), rng.integers(0, 256, 3), np.float32)
    if rng.random() < 0.6:
        image += cv2.resize(
            rng.normal(0, rng.uniform(5, 60), (6, 6, 3)).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC
        )
    for _ in range(int(rng.integers(0, 9))):
        color = tuple(float(c) for c in rng.integers(0, 256, 3))
        points = np.cumsum(rng.normal(0, 60, (8, 2)), axis=0) + rng.uniform(0, (width, height))
        kind = rng.random()
        if kind < 0.5:
            curve = cv2.resize(points.astype(np.float32).reshape(8, 1, 2), (1, 160), interpolation=cv2.INTER_CUBIC).reshape(
                -1, 1, 2
            )
            cv2.polylines(image, [curve.astype(np.int32)], False, color, int(rng.integers(1, 14)), cv2.LINE_AA)
        elif kind < 0.75:
            cv2.fillPoly(image, [points.astype(np.int32)], color, cv2.LINE_AA)
        else:
            cv2.circle(
                image,
                (int(points[0, 0]), int(points[0, 1])),
                int(rng.integers(3, 90)),
                color,
                int(rng.choice([-1, 2, 5])),
                cv2.LINE_AA,
            )
    image += rng.normal(0, rng.uniform(0, 12), image.shape)
    return np.asarray(np.clip(image, 0, 255).astype(np.uint8))


MISSED_SHARE = 0.35
"""Share of the tip windows that show a pixel that the first pass got wrong; the others show what the refinement would look at."""
LAST_SHARE = 0.5
"""Share of the tip windows that come with the masks after refinement: a refinement may be followed by another one."""
JITTER_PX = 10.0
"""Standard deviation of a window's centre around the place that it shows."""
END_REACH_PX = 20.0
"""Standard deviation of what counts as near to a robot's end: half of the 40 px that its vector and the vessel's are fitted to."""
BORDER_PX = 8.0
"""Distance from a crop's border within which thinning may have drawn back an end, at least."""

Crop = tuple[Tensor, Tensor]
"""uint8 (planes, h, w) and its labels uint8 (2 to 4, h, w): vessel, robot (0, 1); where the plan weighs the robot's ends, how near
they are (0..255); where labels of some frames are unsure, the pixels that are not trained on (0, 1)."""


class CropDataset(Dataset[Crop]):
    """Crops of labelled frames in epochs without repetition.

    Crop `i` depends on the seed and `i` alone, so that a run can be repeated with any number of workers.
    """

    def __init__(self, samples: list[Sample], plan: TrainingPlan) -> None:
        self._plan, self._samples, self._kept = plan, samples, KeptFrames(len(samples))
        self._count = len(samples)
        self._permutation: tuple[int, NDArray[np.int64]] = (-1, np.zeros(0, np.int64))
        self.has_doubt = any(sample.doubtful is not None for sample in samples)
        """Whether the labels have a plane of what is not trained on."""
        if plan.end_weight > 0 and samples:
            compiled.load()  # the robot's ends are found with the compiled loops: forked workers inherit them

    def __len__(self) -> int:
        return self._plan.steps * self._plan.batch

    def tensors(self, image: NDArray[np.uint8], vessel: Mask, robot: Mask, doubtful: Mask) -> Crop:
        """A crop (h, w, planes) and its masks (h, w) as tensors; all crops of a data set have the same planes of labels."""
        labels = [vessel.astype(np.uint8), robot.astype(np.uint8)]
        if self._plan.end_weight > 0:
            labels.append(end_nearness(robot))
        if self.has_doubt:
            labels += [np.zeros_like(labels[0])] * (3 - len(labels)) + [doubtful.astype(np.uint8)]
        return torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1))), torch.from_numpy(np.stack(labels))

    def place_of(self, index: int) -> int:
        """The number of the sample that crop `index` shows, in a permutation that is drawn for every epoch."""
        count = self._count
        epoch, place = divmod(index, count)
        if self._permutation[0] != epoch:
            self._permutation = epoch, np.random.default_rng((self._plan.seed, 7919, epoch)).permutation(count)
        return int(self._permutation[1][place])


class FrameCrops(CropDataset):
    """Crops for the network of whole pictures: of ``plan.crop``, turned, scaled and mirrored, most of them near the robot."""

    def __getitem__(self, index: int) -> Crop:
        rng = np.random.default_rng((self._plan.seed, index))
        size = self._plan.crop
        if rng.random() < self._plan.clutter_share:
            image, (vessel, robot, doubtful) = random_clutter(size, rng), np.zeros((3, *size), bool)
        else:
            place = self.place_of(index)
            whole, *masks = self._kept.frame(self._samples[place])
            masks.append(self._kept.doubtful(self._samples[place], whole.shape))
            image, (vessel, robot, doubtful) = random_crop(whole, masks, size, rng)
        if rng.random() < self._plan.look_share:
            image = random_look(image, rng)
        return self.tensors(image, vessel, robot, doubtful)


@dataclass(frozen=True, slots=True)
class PriorView:
    """Probabilities of a frame as PNG, 0..255, and the places that a tip refinement would look at."""

    vessel_png: bytes
    robot_png: bytes
    places: tuple[Point, ...]

    @classmethod
    def of(cls, vessel: Probability, robot: Probability) -> PriorView:
        packed = [cv2.imencode(".png", np.rint(seen * 255).astype(np.uint8))[1].tobytes() for seen in (vessel, robot)]
        return cls(packed[0], packed[1], tuple(find_tips(robot)))

    def probabilities(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Vessel and robot (h, w), 0..255."""
        packed = (np.frombuffer(data, np.uint8) for data in (self.vessel_png, self.robot_png))
        vessel, robot = (np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8) for data in packed)
        return vessel, robot


@dataclass(frozen=True, slots=True)
class PriorViews:
    """Probabilities of a frame after the first pass, and the last ones: after tip refinement, where the model has one."""

    first: PriorView
    last: PriorView

    @classmethod
    def at(cls, sample: Sample, segment: Segmenter, near: Segmenter | None = None) -> PriorViews:
        """Segment a frame, and refine it with `near`; raises DatasetError."""
        image = sample.load(WORKING_SIZE_PX)[0]
        probabilities = segment(image)
        first = last = PriorView.of(*probabilities)
        if near is not None:
            last = PriorView.of(*refine_tips(image, probabilities, near))
        return cls(first, last)


class TipCrops(CropDataset):
    """Windows for the network of the tip refinement, with the probabilities there; `views` has one entry per sample."""

    def __init__(self, samples: list[Sample], views: list[PriorViews], plan: TrainingPlan) -> None:
        super().__init__(samples, plan)
        self._views = views

    def __getitem__(self, index: int) -> Crop:
        rng = np.random.default_rng((self._plan.seed, index))
        place = self.place_of(index)
        sample, views = self._samples[place], self._views[place]
        image, vessel, robot = self._kept.frame(sample)
        seen = views.last if rng.random() < LAST_SHARE else views.first
        seen_vessel, seen_robot = self._kept.get((sample.image, seen is not views.first), seen.probabilities)
        center = _place(seen_robot, robot, seen.places, rng)
        x, y, width, height = window_around(center, (image.shape[1], image.shape[0]), WINDOW_PX)
        part = np.s_[y : y + height, x : x + width]
        doubtful = self._kept.doubtful(sample, image.shape)
        cut = np.dstack([image[part], seen_vessel[part], seen_robot[part], vessel[part], robot[part], doubtful[part]])
        down, right = WINDOW_PX - height, WINDOW_PX - width
        if down or right:
            cut = np.pad(cut, ((0, down), (0, right), (0, 0)), mode="edge")
        # Quarter turns and mirror images cost no sharpness; the first pass was trained on all other angles and sizes.
        cut = np.rot90(cut, int(rng.integers(4)))
        cut = cut[:, ::-1] if rng.random() < 0.5 else cut
        cut = np.ascontiguousarray(cut)
        if rng.random() < self._plan.look_share:
            cut[:, :, :3] = random_look(cut[:, :, :3], rng)
        return self.tensors(cut[:, :, :5], cut[:, :, 5] > 0, cut[:, :, 6] > 0, cut[:, :, 7] > 0)


def _place(seen_robot: NDArray[np.uint8], robot: Mask, places: tuple[Point, ...], rng: Generator) -> Point:
    """A pixel that is wrong, or beside a place that the refinement would look at."""
    if rng.random() < MISSED_SHARE:
        rows, columns = np.nonzero((seen_robot > 127) != robot)
        if len(rows):
            pick = int(rng.integers(len(rows)))
            return float(columns[pick]), float(rows[pick])
    return _beside(places, JITTER_PX, robot, rng)


def _beside(places: tuple[Point, ...], jitter_px: float, robot: Mask, rng: Generator) -> Point:
    """Near one of the places, or anywhere in the picture without one."""
    height, width = robot.shape
    x, y = places[int(rng.integers(len(places)))] if places else (rng.uniform(0, width), rng.uniform(0, height))
    across, down = rng.normal(0, jitter_px, 2)
    return min(max(x + across, 0.0), width - 1.0), min(max(y + down, 0.0), height - 1.0)


def end_nearness(robot: Mask) -> NDArray[np.uint8]:
    """How near each pixel is to an end of the true robot, 255 there; where the crop's border cuts it off it does not end."""
    return nearness_to(_true_ends(robot), robot.shape)


def nearness_to(ends: Sequence[Point], shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """How near each pixel is to the nearest of the `ends` (x, y), 255 there."""
    return np.asarray(np.rint(255 * np.exp(-0.5 * (_distances(ends, shape) / np.float32(END_REACH_PX)) ** 2)), np.uint8)


def _distances(ends: Sequence[Point], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Distance of each pixel from the nearest of the `ends`; infinite without any."""
    rows, columns = (axis.astype(np.float32) for axis in np.ogrid[: shape[0], : shape[1]])
    nearest = np.full(shape[:2], np.inf, np.float32)
    for x, y in ends:
        np.minimum(nearest, (rows - np.float32(y)) ** 2 + (columns - np.float32(x)) ** 2, out=nearest)
    return np.sqrt(nearest)


def _true_ends(robot: Mask) -> list[tuple[int, int]]:
    """Ends (x, y) of a true mask's skeleton inside the crop: not nearer to its border than thinning draws back an end."""
    left, top, across, down = cv2.boundingRect(robot.view(np.uint8))
    if not across:
        return []
    box = np.ascontiguousarray(robot[top : top + down, left : left + across])
    half_width = float(cv2.distanceTransform(np.pad(box, 1).view(np.uint8), cv2.DIST_L2, 3).max())
    margin = max(BORDER_PX, half_width + 3.0)
    height, width = robot.shape
    ends = ((x + left, y + top) for x, y in end_pixels(thin(box)))
    return [(x, y) for x, y in ends if min(x, y, width - 1 - x, height - 1 - y) >= margin]
