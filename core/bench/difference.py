"""The robot as what differs from the empty bench, within the vessel and where the robot enters it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.bench.bench import Bench, BenchError
from core.bench.registration import BenchView, register
from core.perception.segmentation import Probability
from core.types import Image, Mask

_SMOOTH_PX = 0.8
"""Deviation of the Gaussian that takes noise out of both pictures."""
_SLACK_PX = 0.4
"""An edge of the bench that lies this far off is no difference."""
_COLOR = 1.5
"""Weight of the colour channels of Lab: shadows and light change colour less than brightness."""
_LIGHT_PX = 4
"""Light is compared at 1 / this of the size."""
_LIGHT_WINDOW = 13
"""Side of the median window, at that size, that follows shadows with their edges: wider than twice the widest robot."""
_LEAST_HIGH, _LEAST_LOW = 14.0, 6.0
"""Least difference (grey levels of Lab, 0 to 255) of a robot's clearest parts, and of its faintest."""
_HIGH_SIGMAS, _LOW_SIGMAS = 9.0, 4.0
"""The same in deviations of what the rest of the vessel differs by."""
_EDGE_SHARE = 0.42
"""The robot's edge lies at this share of its contrast there."""
_CONTRAST_PX = 13
"""Diameter of the surroundings whose clearest place is the contrast."""
_LEAST_AREA_PX = 40
"""A smaller part is noise or a bubble."""
_LEAST_ELONGATION = 2.0
"""A robot's area, in squares of its width; a blob, such as a reflection, has less."""
_GAP_PX, _CLEAR_SHARE = 20, 0.6
"""A short part so near to a long one is robot, too, when it is as clear as this share of that."""
_RIM_PX = 7
"""Diameter of the disc by which the robot's blurred rim is wider than the robot; it is background."""
_CLOSE_PX = 7
"""Gaps across the robot that are closed: its middle may look like the bench."""


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """What differs from the empty bench.

    ``probability``: of the robot, float32 (h, w). ``doubtful``: bool (h, w), places that count neither as robot nor as background
    when a network is trained.
    """

    probability: NDArray[np.float32]
    doubtful: Mask


def distance_to_empty(image: Image, view: BenchView) -> NDArray[np.float32]:
    """How much each pixel differs from the empty bench, float32 (h, w), in grey levels of Lab."""
    seen, empty = (cv2.cvtColor(cv2.GaussianBlur(one, (0, 0), _SMOOTH_PX), cv2.COLOR_RGB2LAB) for one in (image, view.empty))
    apart = seen.astype(np.float32) - empty
    apart -= _light(apart)
    # what an edge that is a part of a pixel off explains does not count
    brightness = empty[..., 0]
    slack = np.hypot(cv2.Sobel(brightness, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(brightness, cv2.CV_32F, 0, 1, scale=1 / 8))
    apart[..., 1:] *= _COLOR
    distance = np.sqrt((apart**2).sum(axis=2))
    return np.asarray(np.maximum(distance - _SLACK_PX * slack, 0.0), np.float32)


def _light(apart: NDArray[np.float32]) -> NDArray[np.float32]:
    """The part (h, w, 3) of a difference that light and shadows make: smooth, or with one edge; a robot has two."""
    height, width = apart.shape[:2]
    size = max(1, width // _LIGHT_PX), max(1, height // _LIGHT_PX)
    steps = np.clip(cv2.resize(apart, size, interpolation=cv2.INTER_AREA) * 2.0 + 128.5, 0, 255).astype(np.uint8)
    rim = _LIGHT_WINDOW // 2
    framed = cv2.copyMakeBorder(steps, rim, rim, rim, rim, cv2.BORDER_REFLECT)
    # medianBlur of three channels takes each by itself
    middle = cv2.medianBlur(framed, _LIGHT_WINDOW)[rim:-rim, rim:-rim].astype(np.float32)
    return np.asarray(cv2.resize((middle - 128.0) / 2.0, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def robot_by_difference(image: Image, view: BenchView) -> Difference:
    """The robot in `image` (h, w, 3), a picture at working size that was registered as `view`."""
    allowed = view.reachable & view.known
    distance = distance_to_empty(image, view)
    inside = distance[allowed]
    noise = 1.4826 * float(np.median(inside)) if inside.size else 0.0
    high, low = max(_LEAST_HIGH, _HIGH_SIGMAS * noise), max(_LEAST_LOW, _LOW_SIGMAS * noise)
    strong = np.where(allowed, distance, np.float32(0.0))
    contrast = cv2.blur(cv2.dilate(strong, _disc(_CONTRAST_PX)), (5, 5))
    cut = np.maximum(_EDGE_SHARE * contrast, low)
    candidate = (strong > cut).view(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(candidate, connectivity=8)
    peaks = np.zeros(count, np.float32)
    np.maximum.at(peaks, labels[candidate > 0], strong[candidate > 0])
    sure = np.zeros(count, np.bool_)
    strong_enough = peaks >= high
    for label in np.flatnonzero(strong_enough & (stats[:, cv2.CC_STAT_AREA] >= _LEAST_AREA_PX)):
        if label == 0:
            continue
        x, y, w, h, area = stats[label].tolist()
        part = np.pad((labels[y : y + h, x : x + w] == label).view(np.uint8), 1)
        width = 2.0 * float(cv2.distanceTransform(part, cv2.DIST_L2, 3).max())
        sure[label] = area >= _LEAST_ELONGATION * width**2
    keep = sure.copy()
    if sure.any():
        # short parts of a robot that something covers lie near a long one, and are as clear
        near = cv2.dilate(sure[labels].view(np.uint8), _disc(2 * _GAP_PX + 1)) > 0
        clear = _CLEAR_SHARE * float(np.median(peaks[sure]))
        for label in np.unique(labels[near]).tolist():
            keep[label] |= label > 0 and peaks[label] >= max(high, clear) and stats[label, cv2.CC_STAT_AREA] >= _LEAST_AREA_PX // 2
    found = keep[labels]
    probability = np.clip(0.5 + (strong - cut) / (2.0 * cut), 0.0, 1.0)
    mask = cv2.morphologyEx(found.view(np.uint8), cv2.MORPH_CLOSE, _disc(_CLOSE_PX)) > 0
    around = cv2.dilate(mask.view(np.uint8), _disc(5)) > 0
    probability = np.where(mask, np.maximum(probability, 0.6), np.where(around, np.minimum(probability, 0.49), 0.0))
    rim = cv2.dilate(mask.view(np.uint8), _disc(_RIM_PX)) > 0
    doubtful = (distance > np.where(view.reachable, low, high)) & ~rim | ~view.known
    return Difference(probability.astype(np.float32), doubtful)


def check_without_robot(bench: Bench, robot: Probability, frames: Sequence[Image]) -> None:
    """Raise BenchError where a robot lay in the empty picture.

    Parameters
    ----------
    robot : the network's robot probability (h, w) of ``bench.empty``, which may be wrong.
    frames : RGB (h, w, 3) at working size. A robot that lay in the empty picture has moved since in most of them.
    """
    seen = (robot >= np.float32(0.5)) & bench.known
    if np.count_nonzero(seen) < _LEAST_ROBOT_PX:
        return
    moved = []
    for frame in frames:
        if isinstance(view := register(frame, bench), BenchView):
            differs = robot_by_difference(frame, view).probability >= np.float32(0.5)
            moved.append(float(np.mean(differs[seen])))
    if moved and float(np.median(moved)) > _MOVED_SHARE:
        raise BenchError("the robot lies in the empty picture: take another without it")


_LEAST_ROBOT_PX, _MOVED_SHARE = 400, 0.5
"""Least area of what the network takes for a robot, and the share of it that has changed when it was one."""


def combined(network: Probability, difference: Difference, view: BenchView) -> Probability:
    """The robot's probability (h, w): what differs from the empty bench, and what the `network` (h, w) sees beside that.

    Where the empty bench is not known, the network alone counts.
    """
    differs = difference.probability >= np.float32(0.5)
    beside = cv2.dilate(differs.view(np.uint8), _disc(_BESIDE_PX)) > 0
    robot = np.where(differs, np.maximum(network, difference.probability), np.where(beside, network, np.float32(0.0)))
    return np.asarray(np.where(view.known, robot, network), np.float32)


_BESIDE_PX = 9
"""Diameter of the disc around what differs within which the network adds to the robot: a part that looks like the bench."""


def _disc(side: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)
