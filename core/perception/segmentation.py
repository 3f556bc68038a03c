"""Stage 1: frame -> vessel and robot probabilities at working resolution (METHOD section 1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception.familiarity import Signature
from core.types import Image

Probability = NDArray[np.float32]


class Segmenter(Protocol):
    """Gives vessel and robot probabilities, float32 (h, w) each, of an RGB uint8 image (h, w, 3) of any size.

    The network of the second look takes ``second_look.Planes`` in its place.
    """

    @property
    def engine(self) -> str: ...
    def __call__(self, image: Image) -> tuple[Probability, Probability]: ...


@runtime_checkable
class RobotAlone(Protocol):
    """A network that can leave its vessel's decoder out, which saves a third of its time."""

    def robots(self, images: Sequence[Image]) -> list[Probability]: ...


@runtime_checkable
class RobotBeside(Protocol):
    """A segmenter that looks for the robot in an image (h, w, 3) whose vessel (h, w) is known."""

    def robot_beside(self, vessel: Probability, image: Image) -> Probability: ...


@runtime_checkable
class Pairing(Protocol):
    """A segmenter that sees several images of one size in less time than one after the other."""

    def together(self, images: Sequence[Image]) -> list[tuple[Probability, Probability]]: ...


Recognised = tuple[Probability, Probability, Signature | None]
"""Probabilities of vessel and robot, and the picture's signature; None: the network's deepest level is not to be had."""
Seen = tuple[Probability, Probability] | Recognised


@runtime_checkable
class Recognising(Protocol):
    """A segmenter that also tells what kind of pictures it sees (``familiarity.py``)."""

    def recognise(self, images: Sequence[Image]) -> list[Recognised]: ...


def recognise(segmenter: Segmenter, images: Sequence[Image]) -> list[Recognised]:
    """What `segmenter` finds in each of the images (of one size), and their signatures where it is able to tell."""
    if isinstance(segmenter, Recognising):
        return segmenter.recognise(images)
    return [(*found, None) for found in see(segmenter, images)]


def see(segmenter: Segmenter, images: Sequence[Image]) -> list[tuple[Probability, Probability]]:
    """What `segmenter` finds in each of the images (of one size), at once where it is able to."""
    return segmenter.together(images) if isinstance(segmenter, Pairing) else [segmenter(image) for image in images]


def robots(segmenter: Segmenter, images: Sequence[Image]) -> list[Probability]:
    """The robot's probabilities in each of the images (of one size), and of nothing else where `segmenter` is able to."""
    if isinstance(segmenter, RobotAlone):
        return segmenter.robots(images)
    return [robot for _, robot in see(segmenter, images)]


def robot_beside(segmenter: Segmenter, vessel: Probability, image: Image) -> Probability:
    """The robot's probability in an image (h, w, 3) whose vessel's (h, w) is known already."""
    return segmenter.robot_beside(vessel, image) if isinstance(segmenter, RobotBeside) else robots(segmenter, [image])[0]


class Turned:
    """The mean over a picture and its mirror image, each in some quarter turns (test-time augmentation): surer than any alone.

    Parameters
    ----------
    segmenter : gives vessel and robot probabilities of an image (h, w, channels).
    turns : by how many quarters the picture is turned; it is asked twice for each. (0,): the picture and its mirror image.
    """

    def __init__(self, segmenter: Segmenter, turns: Sequence[int] = (0, 1, 2, 3)) -> None:
        self._segment, self._turns = segmenter, tuple(turns)

    @property
    def engine(self) -> str:
        return f"{self._segment.engine}, {2 * len(self._turns)} orientations"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._look(image, see)[:2]

    def recognise(self, images: Sequence[Image]) -> list[Recognised]:
        """The signature is that of the picture as it was first shown: one turned upside down is of another kind, a bit."""
        return [self._look(image, recognise) for image in images]

    def _look(self, image: Image, first: Callable[[Segmenter, Sequence[Image]], Sequence[Seen]]) -> Recognised:
        """The mean, and what else `first` told of the picture where it was asked first."""
        sums = np.zeros((2, *image.shape[:2]), np.float32)
        signature: Signature | None = None
        for turn in self._turns:
            turned = np.rot90(image, turn)
            pair = [np.ascontiguousarray(turned[:, ::step]) for step in (1, -1)]
            found: Sequence[Seen] = (first if turn == self._turns[0] else see)(self._segment, pair)
            if len(found[0]) == 3:
                signature = found[0][2]
            for step, (vessel, robot, *_) in zip((1, -1), found, strict=True):
                sums += np.rot90(np.stack([vessel, robot])[:, :, ::step], -turn, axes=(1, 2))
        sums /= np.float32(2 * len(self._turns))
        return sums[0], sums[1], signature


def to_working(image: Image, working_size_px: int) -> tuple[Image, tuple[float, float]]:
    """Scale an image so that its longer side is `working_size_px`; returns it and working pixels per source pixel in x and y.

    The two differ a little, because the shorter side is rounded to whole pixels.
    """
    height, width = image.shape[:2]
    scale = working_size_px / max(height, width)
    if scale == 1.0:
        return image, (1.0, 1.0)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    # Area averaging keeps thin structures when shrinking; it would show blocks when enlarging.
    resized = cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    return np.asarray(resized, np.uint8), (size[0] / width, size[1] / height)
