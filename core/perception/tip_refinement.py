"""A second look at the robot's ends: a small network that sees the picture and what the first look took it for, close by.

Most answers that are lost are lost at the robot's tip (docs/method.md), a few hundred of three hundred thousand pixels. The second
network is wider than the first one on its fine levels, and in training it is shown nothing but windows around ends, and around
pixels that the first look got wrong. What it says replaces the first look's probabilities there, of robot and vessel; where the
vessel is known already, as in a stream's windows, the robot's alone, and it is shown the vessel that is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception.segmentation import (
    MARGIN_PX,
    Probability,
    Recognised,
    Segmenter,
    clean_mask,
    recognise,
    robots,
    see,
    window_around,
)
from core.perception.skeleton import MAX_KNOTS, end_pixels, thin
from core.types import Image, Point

WINDOW_PX = 160
"""Four times the piece of the robot that its vector is fitted to."""
_SEEN_PX = 40.0
"""An end as near as this to the middle of a window has been looked at."""
_MAX_LOOKS = 5
_ROUNDS = 2
"""What the second look adds may end farther on: then that end is looked at, too."""
_FAINT = 0.1
"""Where nothing is taken for a robot, the likeliest place is looked at, if it is as likely as this."""
_MIN_AREA_PX = 20
_SHIFTS_PX: tuple[Point, ...] = ((0.0, 0.0), (14.0, 10.0), (-14.0, -10.0))
"""By how much the windows of the later looks lie beside the ends: what a network says of a pixel depends a bit on where its window
begins, and where a pixel decides, the mean of several is surer than any of them."""
MOST_LOOKS = 1 + len(_SHIFTS_PX)
"""How often a single picture is looked at closely: once at what the first look saw, and then at what that gave."""

Planes = NDArray[np.uint8]
"""Shape (h, w, 5): red, green, blue, and the first look's probabilities of vessel and robot as 0..255."""


def planes_of(image: Image, vessel: Probability, robot: Probability) -> Planes:
    """The second network's input of an RGB image (h, w, 3) and the probabilities (h, w) that the first look found in it."""
    planes = np.empty((*image.shape[:2], 5), np.uint8)
    planes[:, :, :3] = image
    planes[:, :, 3] = np.rint(vessel * np.float32(255))
    planes[:, :, 4] = np.rint(robot * np.float32(255))
    return planes


def places_to_look(robot: Probability) -> list[Point]:
    """Where a second look is worth it: the ends (x, y) of what the first look took for robot, of the largest pieces first.

    Where it took nothing for one, the likeliest place, if there is any.
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
    # Where the robot enters the picture there is no more to see of it.
    return [(x, y) for x, y in places if 8 <= x < width - 8 and 8 <= y < height - 8]


class TipRefinement:
    """A segmenter that looks again, closely, at the ends of what its first look takes for the robot.

    Parameters
    ----------
    first : the first look, at all of the picture.
    near : the second network, which is asked about ``Planes``.
    looks : how often, up to ``MOST_LOOKS``; all but the first one look at what that one saw, through windows that lie a bit beside
        each other, and the mean of all counts.
    """

    def __init__(self, first: Segmenter, near: Segmenter, *, looks: int = 1) -> None:
        if not 1 <= looks <= MOST_LOOKS:
            raise ValueError(f"a picture is looked at closely 1 to {MOST_LOOKS} times, not {looks}")
        self._first, self._near, self._looks = first, near, looks

    @property
    def looks(self) -> int:
        """How often a picture is looked at closely."""
        return self._looks

    @property
    def engine(self) -> str:
        return f"{self._first.engine}, second look{f' {self._looks} times' if self._looks > 1 else ''}"

    def warm_up(self) -> None:
        """Let the second network be compiled for one window and for several; a picture without a robot would not ask it."""
        window = np.zeros((WINDOW_PX, WINDOW_PX, 5), np.uint8)
        for count in (1, 2):
            see(self._near, [window] * count)

    def warm_up_beside(self) -> None:
        """The same for ``robot_beside``."""
        robots(self._near, [np.zeros((WINDOW_PX, WINDOW_PX, 5), np.uint8)])

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._look(image, self._first(image))

    def recognise(self, images: Sequence[Image]) -> list[Recognised]:
        """The signatures are the first look's, which sees the whole pictures."""
        seen = recognise(self._first, images)
        return [(*self._look(image, (v, r)), signature) for image, (v, r, signature) in zip(images, seen, strict=True)]

    def robot_beside(self, vessel: Probability, image: Image) -> Probability:
        """The robot, looked at as often; the close looks are shown the `vessel` that is known."""
        return self._look(image, (vessel, robots(self._first, [image])[0]), robot_alone=True)[1]

    def _look(
        self, image: Image, seen: tuple[Probability, Probability], *, robot_alone: bool = False
    ) -> tuple[Probability, Probability]:
        found = look_again(image, seen, self._near, robot_alone=robot_alone)
        if self._looks == 1:
            return found
        vessel, robot = (probability.copy() for probability in found)
        for shift in _SHIFTS_PX[: self._looks - 1]:
            anew = look_again(image, found, self._near, shift, robot_alone=robot_alone)
            vessel += anew[0]
            robot += anew[1]
        vessel /= self._looks
        robot /= self._looks
        return vessel, robot


def look_again(
    image: Image,
    seen: tuple[Probability, Probability],
    near: Segmenter,
    shift_px: Point = (0.0, 0.0),
    *,
    robot_alone: bool = False,
) -> tuple[Probability, Probability]:
    """Probabilities of vessel and robot after a second look at the ends of what the first one has `seen` in the picture.

    `shift_px`: by how much (x, y) the windows' middles lie beside the ends. `robot_alone`: the vessel stays as it was seen, by whom
    ever.
    """
    vessel, robot = (probability.copy() for probability in seen)
    looked: list[Point] = []
    for _ in range(_ROUNDS):
        before = len(looked)
        for place in places_to_look(robot):
            if len(looked) < _MAX_LOOKS and all(math.dist(place, other) > _SEEN_PX for other in looked):
                looked.append(place)
        middles = [(x + shift_px[0], y + shift_px[1]) for x, y in looked[before:]]
        _look_at(middles, image, seen, near, (vessel, robot), robot_alone=robot_alone)
        if len(looked) == before:
            break
    return vessel, robot


def _look_at(
    middles: Sequence[Point],
    image: Image,
    seen: tuple[Probability, Probability],
    near: Segmenter,
    probabilities: tuple[Probability, Probability],
    *,
    robot_alone: bool,
) -> None:
    """Replace both probabilities, or the robot's, in the windows around `middles`; the network is shown what was `seen`."""
    height, width = image.shape[:2]
    windows = [window_around(place, (width, height), WINDOW_PX) for place in middles]
    parts = [np.s_[y : y + down, x : x + across] for x, y, across, down in windows]
    planes = [planes_of(image[part], seen[0][part], seen[1][part]) for part in parts]
    found = [(robot,) for robot in robots(near, planes)] if robot_alone else see(near, planes)
    renewed = probabilities[1:] if robot_alone else probabilities
    for (x, y, across, down), part, near_it in zip(windows, parts, found, strict=True):
        columns = _fade(across, x > 0, x + across < width)
        rows = _fade(down, y > 0, y + down < height)
        weight = rows[:, None] * columns[None, :]
        for whole, anew in zip(renewed, near_it, strict=True):
            whole[part] += weight * (anew - whole[part])


def _fade(length: int, at_start: bool, at_end: bool) -> NDArray[np.float32]:
    """1, falling to 0 over the margin at those ends that lie inside the picture."""
    distance = np.arange(length, dtype=np.float32)
    ramp = np.ones(length, np.float32)
    if at_start:
        ramp = np.minimum(ramp, distance / MARGIN_PX)
    if at_end:
        ramp = np.minimum(ramp, distance[::-1] / MARGIN_PX)
    return ramp
