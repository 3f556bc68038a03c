"""Segmentation: frame -> vessel and robot probabilities at working resolution -> clean masks (METHOD sections 1 and 2)."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import PerceptionConfig
from core.perception.out_of_distribution import Signature
from core.perception.skeleton import thin_half_size
from core.types import Image, Mask, Masks, Point, Window

Probability = NDArray[np.float32]
Segmentation = tuple[Probability, Probability, Signature | None]
"""Probabilities of vessel and robot, and the picture's signature; None where the network's deepest level cannot be read."""


class Segmenter:
    """Gives vessel and robot probabilities, float32 (h, w) each, of RGB uint8 images (h, w, 3) of any size.

    Only ``__call__`` must be implemented. The other methods have slower defaults. The network of the tip refinement takes
    ``tip_refinement.Planes`` instead of images.
    """

    @property
    def engine(self) -> str:
        """Where the network runs, in words."""
        return type(self).__name__

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        raise NotImplementedError

    def segment_batch(self, images: Sequence[Image]) -> list[tuple[Probability, Probability]]:
        """Segment images of one size; a network may take less time for all of them than for one after the other."""
        return [self(image) for image in images]

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        """Segment images of one size, and give their signatures (``out_of_distribution``) where the network can."""
        return [(*found, None) for found in self.segment_batch(images)]

    def segment_robots(self, images: Sequence[Image]) -> list[Probability]:
        """The robot's probability in images of one size. Without the vessel's decoder a network saves a third of its time."""
        return [robot for _, robot in self.segment_batch(images)]

    def segment_robot_beside(self, vessel: Probability, image: Image) -> Probability:
        """The robot's probability in an image (h, w, 3) whose vessel (h, w) is known."""
        return self.segment_robots([image])[0]


class OrientationAverage(Segmenter):
    """The mean over a picture (h, w, channels) and its mirror image, each in some quarter turns (test-time augmentation).

    Each of the `turns` asks `segmenter` twice; (0,) is the picture and its mirror image.
    """

    def __init__(self, segmenter: Segmenter, turns: Sequence[int] = (0, 1, 2, 3)) -> None:
        self._segment, self._turns = segmenter, tuple(turns)

    @property
    def engine(self) -> str:
        return f"{self._segment.engine}, {2 * len(self._turns)} orientations"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._average(image, signed=False)[:2]

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        """The signature is that of the picture in its first orientation: one upside down is of a slightly different kind."""
        return [self._average(image, signed=True) for image in images]

    def _average(self, image: Image, *, signed: bool) -> Segmentation:
        sums = np.zeros((2, *image.shape[:2]), np.float32)
        signature: Signature | None = None
        for turn in self._turns:
            turned = np.rot90(image, turn)
            pair = [np.ascontiguousarray(turned[:, ::step]) for step in (1, -1)]
            if signed and turn == self._turns[0]:
                found = self._segment.segment_signed(pair)
                signature = found[0][2]
                answers = [(vessel, robot) for vessel, robot, _ in found]
            else:
                answers = self._segment.segment_batch(pair)
            for step, (vessel, robot) in zip((1, -1), answers, strict=True):
                sums += np.rot90(np.stack([vessel, robot])[:, :, ::step], -turn, axes=(1, 2))
        sums /= np.float32(2 * len(self._turns))
        return sums[0], sums[1], signature


USUAL_RADIUS_PX = 12.5
"""A lumen's radius that the network sees best: two thirds of the training's lie between 10 and 16 px."""
SIZES = (0.5, 0.65, 0.8, 1.0, 1.25, 1.5)
"""Sizes of the picture that is seen again; few, because the engine compiles a network for each."""
_MIN_AREA_PX, _MAX_HOLE_PX = 400, 150


class LumenSizeAverage(Segmenter):
    """The mean over a picture and the same picture at the size at which its lumens have the usual radius.

    A network knows the widths it was trained on. In a wide lumen it takes a reflection for the wall and loses the far side; in a
    narrow one it joins robot and wall. At the usual width neither happens as often (docs/experiments.md). In a smaller picture
    the robot is seen less sharply: there only the vessel's probability is averaged.
    """

    def __init__(self, segmenter: Segmenter) -> None:
        self._segment = segmenter

    @property
    def engine(self) -> str:
        return f"{self._segment.engine}, at the lumen's size"

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._with_other_size(image, self._segment(image))

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        """The signatures are those of the pictures as they are."""
        seen = self._segment.segment_signed(images)
        return [(*self._with_other_size(image, (v, r)), signature) for image, (v, r, signature) in zip(images, seen, strict=True)]

    def segment_robots(self, images: Sequence[Image]) -> list[Probability]:
        """Of parts of pictures, as they are."""
        return self._segment.segment_robots(images)

    def _with_other_size(self, image: Image, seen: tuple[Probability, Probability]) -> tuple[Probability, Probability]:
        size = size_to_see(seen[0])
        if size == 1.0:
            return seen
        height, width = image.shape[:2]
        smaller = size < 1.0
        there, back = (cv2.INTER_AREA, cv2.INTER_LINEAR) if smaller else (cv2.INTER_CUBIC, cv2.INTER_AREA)
        other = cv2.resize(image, (round(width * size), round(height * size)), interpolation=there)
        found = [
            cv2.resize(probability, (width, height), interpolation=back)
            for probability in self._segment(np.asarray(other, np.uint8))
        ]
        vessel, robot = ((np.asarray(one) + whole) / np.float32(2) for one, whole in zip(found, seen, strict=True))
        return vessel, seen[1] if smaller else robot


def size_to_see(vessel: Probability) -> float:
    """The one of ``SIZES`` that brings the median radius of the lumens in `vessel` (h, w) nearest to the usual one."""
    mask = clean_mask(vessel >= np.float32(0.5), _MIN_AREA_PX, _MAX_HOLE_PX)
    if not mask.any():
        return 1.0
    depth = cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, 5)
    radius = float(np.median(depth[thin_half_size(mask)]))
    return min(SIZES, key=lambda size: abs(np.log(size * radius / USUAL_RADIUS_PX)))


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


MAX_OUTLINES = 500
"""A mask of more components and holes is noise: those of real images have some tens before cleaning."""
MAX_EDGE_SHARE = 0.08
"""Changes along the rows of a mask, per pixel: a real mask has some ten in 640 px. 0.08 is a stripe pattern of 12 px."""


def clean(vessel_probability: Probability, robot_probability: Probability, config: PerceptionConfig) -> Masks:
    """Masks of vessel and robot without specks and pinholes, from their probabilities (h, w), 0..1, at working resolution."""
    vessel = vessel_probability >= config.segmentation.vessel_threshold
    return Masks(
        vessel=clean_mask(vessel, config.cleaning.min_vessel_area_px, config.cleaning.max_hole_area_px),
        robot=clean_robot(robot_probability, config),
        vessel_probability=vessel_probability,
        robot_probability=robot_probability,
    )


def clean_robot(robot_probability: Probability, config: PerceptionConfig) -> Mask:
    """The robot's mask alone."""
    robot = robot_probability >= config.segmentation.robot_threshold
    return clean_mask(robot, config.cleaning.min_robot_area_px, config.cleaning.max_hole_area_px)


def clean_mask(mask: Mask, min_area_px: int, max_hole_area_px: int) -> Mask:
    """A copy of `mask` without 8-connected components below `min_area_px`, and with holes up to `max_hole_area_px` filled.

    Larger holes stay: a real loop of the vessel encloses one. Background that reaches the image border is never a hole. A mask of
    more than ``MAX_OUTLINES`` components and holes becomes empty: it is noise, and cleaning it would cost most.
    """
    rows = mask[::8]  # every eighth row shows whether the mask is worth following its outlines
    if int(np.count_nonzero(rows[:, 1:] != rows[:, :-1])) > max(MAX_EDGE_SHARE * rows.size, MAX_OUTLINES):
        return np.zeros(mask.shape, np.bool_)
    whole = np.array(mask, np.uint8, order="C")
    x, y, width, height = cv2.boundingRect(whole)
    cleaned = whole[y : y + height, x : x + width]
    # Areas come from the contours, which cost 0.1 ms at 640x480 where labelling foreground and background costs 1.4 ms.
    contours, hierarchy = cv2.findContours(cleaned, cv2.RETR_TREE, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return whole.view(np.bool_)
    if len(contours) > MAX_OUTLINES:
        return np.zeros(mask.shape, np.bool_)
    parents: list[int] = hierarchy[0, :, 3].tolist()
    is_hole = [_depth(parents, index) % 2 == 1 for index in range(len(parents))]
    areas = [_enclosed_pixels(contour, hole) for contour, hole in zip(contours, is_hole, strict=True)]
    is_filled = [hole and area <= max_hole_area_px for hole, area in zip(is_hole, areas, strict=True)]
    cv2.drawContours(cleaned, [contours[index] for index in range(len(contours)) if is_filled[index]], -1, 1, cv2.FILLED)
    open_holes: dict[int, list[int]] = {}
    for index, parent in enumerate(parents):
        if is_hole[index] and not is_filled[index]:
            open_holes.setdefault(parent, []).append(index)
    for index, parent in enumerate(parents):
        if is_hole[index] or (parent >= 0 and is_filled[parent]):
            continue
        holes = open_holes.get(index, [])
        if areas[index] - sum(areas[hole] for hole in holes) < min_area_px:
            # Drawn together with its holes, a component goes and what lies in its holes stays.
            cv2.drawContours(cleaned, [contours[part] for part in (index, *holes)], -1, 0, cv2.FILLED)
    return whole.view(np.bool_)


def _depth(parents: list[int], index: int) -> int:
    """Number of contours around this one: even for a component's outline, odd for a hole's."""
    depth = 0
    while (index := parents[index]) >= 0:
        depth += 1
    return depth


def _enclosed_pixels(contour: cv2.typing.MatLike, is_hole: bool) -> float:
    """Pixels on and inside an outer contour, or strictly inside a hole's contour, by Pick's theorem on the pixel grid."""
    border = len(contour) if len(contour) > 1 else 0
    return cv2.contourArea(contour) + (-0.5 if is_hole else 0.5) * border + 1.0


MARGIN_PX = 16
"""At a window's inner edges a network lacks context: within this margin its answer counts less, or not at all."""


def window_around(place: Point, size: tuple[int, int], side: int) -> Window:
    """The window (x, y, width, height) of at most `side` px centred on `place`, or as near to it as the picture allows."""
    width, height = min(side, size[0]), min(side, size[1])
    x = min(max(round(place[0]) - width // 2, 0), size[0] - width)
    y = min(max(round(place[1]) - height // 2, 0), size[1] - height)
    return x, y, width, height


def inner_area(window: Window, size: tuple[int, int]) -> tuple[slice, slice]:
    """Rows and columns of a picture of `size` (width, height) that a window renews: without the margin at inner edges."""
    x, y, width, height = window
    left, top = (MARGIN_PX if x > 0 else 0), (MARGIN_PX if y > 0 else 0)
    right = width - (MARGIN_PX if x + width < size[0] else 0)
    bottom = height - (MARGIN_PX if y + height < size[1] else 0)
    return slice(y + top, y + bottom), slice(x + left, x + right)
