"""Tip refinement: a second network segments windows around the robot's ends again.

Most wrong answers are wrong at the robot's tip (docs/method.md), a few hundred of three hundred thousand pixels. The second network
is wider than the first one on its fine levels, and it is trained on windows around ends, and around pixels that the first network
got wrong. It sees the picture and the first network's probabilities, and replaces both probabilities in the windows. Where the
vessel is known already, as in a stream's region of interest, it is given that vessel and replaces only the robot's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception.segmentation import MARGIN_PX, Probability, Segmentation, Segmenter, clean_mask, window_around
from core.perception.skeleton import MAX_KNOTS, end_pixels, thin
from core.types import Image, Point

WINDOW_PX = 160
"""Four times the piece of the robot that its vector is fitted to."""
_SEEN_PX = 40.0
"""An end this near to the middle of a window has been refined."""
_MAX_WINDOWS = 5
_ROUNDS = 2
"""What the refinement adds may end further on: then that end is refined, too."""
_FAINT = 0.1
"""Least robot probability of the likeliest place, which is refined where nothing is taken for a robot."""
_MIN_AREA_PX = 20
_SHIFTS_PX: tuple[Point, ...] = ((0.0, 0.0), (14.0, 10.0), (-14.0, -10.0))
"""Offsets of the windows in later passes: a network's answer depends a bit on where its window begins, and the mean of several
windows is more accurate than any of them."""
MAX_PASSES = 1 + len(_SHIFTS_PX)
"""How often a single picture is refined: once on the first network's answer, and then on what that gave."""

Planes = NDArray[np.uint8]
"""Shape (h, w, 5): red, green, blue, and the first network's probabilities of vessel and robot as 0..255."""


def stack_planes(image: Image, vessel: Probability, robot: Probability) -> Planes:
    """The second network's input of an RGB image (h, w, 3) and the first network's probabilities (h, w)."""
    planes = np.empty((*image.shape[:2], 5), np.uint8)
    planes[:, :, :3] = image
    planes[:, :, 3] = np.rint(vessel * np.float32(255))
    planes[:, :, 4] = np.rint(robot * np.float32(255))
    return planes


def find_tips(robot: Probability) -> list[Point]:
    """Places (x, y) worth refining: the ends in the robot's probability, of the largest components first.

    Where nothing is taken for a robot, the likeliest place, if there is one.
    """
    mask = clean_mask(robot >= np.float32(0.5), _MIN_AREA_PX, 0)
    left, top, across, down = cv2.boundingRect(mask.view(np.uint8))
    if not across:
        likely = cv2.GaussianBlur(robot, (0, 0), 3.0)
        row, column = np.unravel_index(int(np.argmax(likely)), likely.shape)
        return [(float(column), float(row))] if likely[row, column] >= _FAINT else []
    box = np.ascontiguousarray(mask[top : top + down, left : left + across])
    _, labels, stats, _ = cv2.connectedComponentsWithStats(box.view(np.uint8), connectivity=8)
    ends = end_pixels(thin(box))
    if len(ends) > MAX_KNOTS:
        return []
    ends.sort(key=lambda end: (-int(stats[labels[end[1], end[0]], cv2.CC_STAT_AREA]), end))
    height, width = mask.shape
    places = [(float(x + left), float(y + top)) for x, y in ends]
    # Where the robot enters the picture nothing more of it can be seen.
    return [(x, y) for x, y in places if 8 <= x < width - 8 and 8 <= y < height - 8]


class TipRefinement(Segmenter):
    """A segmenter that refines the robot's ends in the answer of a `first` one, by the network `near`, which takes ``Planes``.

    All but the first of up to ``MAX_PASSES`` `passes` refine its answer, in windows a bit beside each other, and the mean of
    all counts.
    """

    def __init__(self, first: Segmenter, near: Segmenter, *, passes: int = 1) -> None:
        if not 1 <= passes <= MAX_PASSES:
            raise ValueError(f"a picture is looked at closely 1 to {MAX_PASSES} times, not {passes}")
        self._first, self._near, self.passes = first, near, passes

    @property
    def engine(self) -> str:
        return f"{self._first.engine}, second look{f' {self.passes} times' if self.passes > 1 else ''}"

    def warm_up(self, *, beside: bool = False) -> None:
        """Compile the second network; a picture without a robot would not run it. `beside`: for ``segment_robot_beside``."""
        window = np.zeros((WINDOW_PX, WINDOW_PX, 5), np.uint8)
        if beside:
            self._near.segment_robots([window])
        else:
            for count in (1, 2):
                self._near.segment_batch([window] * count)

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._refine(image, self._first(image))

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        """The signatures are the first network's, which sees the whole pictures."""
        seen = self._first.segment_signed(images)
        return [(*self._refine(image, (v, r)), signature) for image, (v, r, signature) in zip(images, seen, strict=True)]

    def segment_robot_beside(self, vessel: Probability, image: Image) -> Probability:
        return self._refine(image, (vessel, self._first.segment_robots([image])[0]), robot_alone=True)[1]

    def _refine(
        self, image: Image, seen: tuple[Probability, Probability], *, robot_alone: bool = False
    ) -> tuple[Probability, Probability]:
        found = refine_tips(image, seen, self._near, robot_alone=robot_alone)
        if self.passes == 1:
            return found
        vessel, robot = (probability.copy() for probability in found)
        for shift in _SHIFTS_PX[: self.passes - 1]:
            again = refine_tips(image, found, self._near, shift, robot_alone=robot_alone)
            vessel += again[0]
            robot += again[1]
        vessel /= self.passes
        robot /= self.passes
        return vessel, robot


def refine_tips(
    image: Image, seen: tuple[Probability, Probability], near: Segmenter, shift_px: Point = (0.0, 0.0), *, robot_alone: bool = False
) -> tuple[Probability, Probability]:
    """Probabilities of vessel and robot, refined at the robot's ends in the probabilities `seen`.

    `shift_px`: offset (x, y) of the windows' middles from the ends. `robot_alone`: the vessel stays as it is.
    """
    vessel, robot = (probability.copy() for probability in seen)
    refined: list[Point] = []
    for _ in range(_ROUNDS):
        before = len(refined)
        for place in find_tips(robot):
            if len(refined) < _MAX_WINDOWS and all(math.dist(place, other) > _SEEN_PX for other in refined):
                refined.append(place)
        middles = [(x + shift_px[0], y + shift_px[1]) for x, y in refined[before:]]
        _refine_windows(middles, image, seen, near, (vessel, robot), robot_alone=robot_alone)
        if len(refined) == before:
            break
    return vessel, robot


def _refine_windows(
    middles: Sequence[Point],
    image: Image,
    seen: tuple[Probability, Probability],
    near: Segmenter,
    probabilities: tuple[Probability, Probability],
    *,
    robot_alone: bool,
) -> None:
    """Replace both probabilities, or the robot's, in the windows around `middles`; the network is given those of `seen`."""
    height, width = image.shape[:2]
    windows = [window_around(place, (width, height), WINDOW_PX) for place in middles]
    parts = [np.s_[y : y + down, x : x + across] for x, y, across, down in windows]
    planes = [stack_planes(image[part], seen[0][part], seen[1][part]) for part in parts]
    found = [(robot,) for robot in near.segment_robots(planes)] if robot_alone else near.segment_batch(planes)
    renewed = probabilities[1:] if robot_alone else probabilities
    for (x, y, across, down), part, near_it in zip(windows, parts, found, strict=True):
        columns = _fade(across, x > 0, x + across < width)
        rows = _fade(down, y > 0, y + down < height)
        weight = rows[:, None] * columns[None, :]
        for whole, new in zip(renewed, near_it, strict=True):
            whole[part] += weight * (new - whole[part])


def _fade(length: int, at_start: bool, at_end: bool) -> NDArray[np.float32]:
    """1, falling to 0 over the margin at those ends that lie inside the picture."""
    distance = np.arange(length, dtype=np.float32)
    ramp = np.ones(length, np.float32)
    if at_start:
        ramp = np.minimum(ramp, distance / MARGIN_PX)
    if at_end:
        ramp = np.minimum(ramp, distance[::-1] / MARGIN_PX)
    return ramp
