"""One-pixel skeletons of vessel and robot (METHOD section 2)."""

from __future__ import annotations

import cv2
import numpy as np
from skimage.morphology import skeletonize

from core.config import PerceptionConfig
from core.types import Mask, Masks, Point, Skeletons

MIN_HALF_SIZE_SHARE = 0.35
"""Half-size thinning needs a lumen some 10 px wide. In a narrower one the step to half size leaves less than this share of it."""
TANGENT_PX = 10
"""Skeleton pixels behind an end that give its direction."""


def thin_masks(masks: Masks, config: PerceptionConfig) -> Skeletons:
    """Skeletons of both masks; the robot's ends reach the edge of its mask if ``cleaning.extend_ends`` says so."""
    robot = thin(masks.robot)
    if config.cleaning.extend_ends:
        robot = extend_ends(robot, masks.robot)
    vessel = thin_half_size(masks.vessel) if config.cleaning.half_size_thinning else thin(masks.vessel)
    return Skeletons(vessel=vessel, robot=robot)


def thin(mask: Mask) -> Mask:
    """The mask thinned to one pixel, with its topology: as many components and loops as before.

    Zhang and Suen's algorithm [1]_, on the mask's bounding box only.

    References
    ----------
    .. [1] T. Y. Zhang and C. Y. Suen, "A fast parallel algorithm for thinning digital patterns", CACM 27(3), 1984.
    """
    skeleton = np.zeros(mask.shape, np.bool_)
    x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
    if width:
        window = np.s_[y : y + height, x : x + width]
        skeleton[window] = skeletonize(np.ascontiguousarray(mask[window]))
    return skeleton


def thin_half_size(mask: Mask) -> Mask:
    """A wide mask thinned on every second pixel and drawn back at full size: seven times faster, the same topology.

    A pixel of the half-size mask stands for 3x3 pixels that must all be set: so walls and loops of one pixel survive, and parts
    that do not touch never merge. What is narrower than about 6 px breaks; a mask that loses too much that way is thinned at full
    size.
    """
    half = cv2.erode(mask.view(np.uint8), np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)[::2, ::2]
    if 4 * cv2.countNonZero(half) < MIN_HALF_SIZE_SHARE * cv2.countNonZero(mask.view(np.uint8)):
        return thin(mask)
    return _double(thin(np.ascontiguousarray(half).view(np.bool_)), mask.shape)


def _double(skeleton: Mask, shape: tuple[int, ...]) -> Mask:
    """A skeleton drawn at twice its size: pixel (x, y) goes to (2x, 2y), and each link between neighbours to the pixel between."""
    height, width = skeleton.shape
    grid = np.zeros((2 * height, 2 * width), np.bool_)
    right, down = skeleton[:, :-1] & skeleton[:, 1:], skeleton[:-1] & skeleton[1:]
    falling = skeleton[:-1, :-1] & skeleton[1:, 1:] & ~(skeleton[:-1, 1:] | skeleton[1:, :-1])
    rising = skeleton[1:, :-1] & skeleton[:-1, 1:] & ~(skeleton[:-1, :-1] | skeleton[1:, 1:])
    grid[::2, ::2] = skeleton
    grid[::2, 1:-1:2] = right
    grid[1:-1:2, ::2] = down
    grid[1:-1:2, 1:-1:2] = falling | rising
    return np.ascontiguousarray(grid[: shape[0], : shape[1]])


def end_pixels(skeleton: Mask) -> list[tuple[int, int]]:
    """End points (x, y): skeleton pixels with exactly one neighbour.

    The paper's convolution with [[1, 1, 1], [1, 10, 1], [1, 1, 1]] gives 11 just there.
    """
    pixels = skeleton.view(np.uint8)
    x, y, width, height = cv2.boundingRect(pixels)
    if width == 0:
        return []
    kernel = np.array([[1, 1, 1], [1, 10, 1], [1, 1, 1]], np.float32)
    response = cv2.filter2D(pixels[y : y + height, x : x + width], -1, kernel, borderType=cv2.BORDER_CONSTANT | cv2.BORDER_ISOLATED)
    rows, columns = np.nonzero(response == 11)
    return [(int(column) + x, int(row) + y) for row, column in zip(rows, columns, strict=True)]


def walk_back(skeleton: Mask, end: tuple[int, int], steps: int) -> list[tuple[int, int]]:
    """Pixels (x, y) from an end point back along its branch: at most `steps` of them, and not beyond a junction."""
    height, width = skeleton.shape
    walked = [end]
    while len(walked) <= steps:
        x, y = walked[-1]
        ahead = [
            (u, v)
            for u in range(max(x - 1, 0), min(x + 2, width))
            for v in range(max(y - 1, 0), min(y + 2, height))
            if skeleton[v, u] and (u, v) not in walked[-3:]
        ]
        straight = [place for place in ahead if place[0] == x or place[1] == y]
        if len(ahead) == 2 and len(straight) == 1:  # a corner: the diagonal neighbour comes after the straight one
            ahead = straight
        if len(ahead) != 1:
            break
        walked.append(ahead[0])
    return walked


def end_direction(skeleton: Mask, end: tuple[int, int]) -> Point | None:
    """Unit vector in which the branch leaves through its end, or None for a branch of less than 4 pixels."""
    walked = np.array(walk_back(skeleton, end, TANGENT_PX), np.float64)
    if len(walked) < 4:
        return None
    # Thinning bends the last pixels of a blunt end towards a corner; the ones behind them keep the direction.
    trusted = walked[min(3, len(walked) - 4) :]
    chord = trusted[0] - trusted[-1]
    length = float(np.hypot(chord[0], chord[1]))
    return (float(chord[0]) / length, float(chord[1]) / length) if length > 0 else None


def extend_ends(skeleton: Mask, mask: Mask) -> Mask:
    """Each end of the skeleton continued along its tangent to the edge of the mask.

    Thinning stops about one radius short of a blunt end, which would put the robot's head one radius too far back.
    """
    extended = skeleton.view(np.uint8).copy()
    height, width = mask.shape
    for end in end_pixels(skeleton):
        direction = end_direction(skeleton, end)
        if direction is None:
            continue
        reach = end
        for step in range(1, height + width):
            x, y = round(end[0] + step * direction[0]), round(end[1] + step * direction[1])
            if not (0 <= x < width and 0 <= y < height and mask[y, x]):
                break
            reach = (x, y)
        cv2.line(extended, end, reach, 1)
    return extended.view(np.bool_)
