"""Thinning of a mask to lines of one pixel (METHOD section 2), by Zhang and Suen's algorithm."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from core.types import Mask

MIN_HALF_SIZE_SHARE = 0.35
"""Half-size thinning needs a lumen some 10 px wide. In a narrower one the step to half size leaves less than this share of it."""
MOST_LOST_PX = 40
"""Where the half-size step leaves nothing near more pixels than these, a vessel is lost: some 20 px of one that is 3 px wide. Tips,
corners and ragged walls of wide ones are less (in all but 1 % of the masks that the network found on 480 frames)."""
LARGE_BOX_PX = 20_000
"""In a bounding box of so many pixels it pays to look for separate parts."""
_THREE, _FIVE = (np.ones((side, side), np.uint8) for side in (3, 5))
MAX_PARTS = 8
"""More parts than these are specks all over the box: thinned together."""


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


def thin_parts(mask: Mask) -> Mask:
    """``thin``, parts whose bounding boxes lie apart one by one: a robot and a speck in the other corner have much nothing between
    them, and thinning looks at all of it some twenty times.
    """
    if mask.size < LARGE_BOX_PX:
        return np.asarray(skeletonize(mask))
    outlines, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    boxes = [cv2.boundingRect(outline) for outline in outlines]
    size = sum(width * height for _, _, width, height in boxes)
    if len(boxes) > MAX_PARTS or 2 * size > mask.size or any(_touch(a, b) for a, b in combinations(boxes, 2)):
        return np.asarray(skeletonize(mask))
    skeleton = np.zeros(mask.shape, np.bool_)
    for x, y, width, height in boxes:
        window = np.s_[y : y + height, x : x + width]
        skeleton[window] = skeletonize(np.ascontiguousarray(mask[window]))
    return skeleton


def _touch(a: Sequence[int], b: Sequence[int]) -> bool:
    """Whether two boxes (x, y, width, height) share a pixel."""
    return a[0] < b[0] + b[2] and b[0] < a[0] + a[2] and a[1] < b[1] + b[3] and b[1] < a[1] + a[3]


def thin_half_size(mask: Mask) -> Mask:
    """A wide mask thinned on every second pixel and drawn back at full size: seven times faster, the same topology.

    A pixel of the half-size mask stands for 3x3 pixels that must all be set: so walls and loops of one pixel survive, and parts
    that do not touch never merge. What is narrower than about 6 px breaks; a mask that loses too much that way, or a narrow vessel
    beside wide ones, is thinned at full size.
    """
    full = mask.view(np.uint8)
    half = np.ascontiguousarray(cv2.erode(full, _THREE, borderType=cv2.BORDER_REPLICATE)[::2, ::2]).view(np.uint8)
    if 4 * cv2.countNonZero(half) < MIN_HALF_SIZE_SHARE * cv2.countNonZero(full) or 4 * _count_lost(full, half) > MOST_LOST_PX:
        return thin(mask)
    return _double(thin(half.view(np.bool_)), mask.shape)


def _count_lost(full: NDArray[np.uint8], half: NDArray[np.uint8]) -> int:
    """How many of a mask's pixels (h, w), of every second one, are 5 px or more from what is left of it at half size."""
    near = cv2.dilate(half, _FIVE)
    return cv2.countNonZero(cv2.subtract(np.ascontiguousarray(full[::2, ::2]), near))


def _double(skeleton: Mask, shape: tuple[int, ...]) -> Mask:
    """A skeleton drawn at twice its size: pixel (x, y) goes to (2x, 2y), and each link between neighbours to the pixel between."""
    height, width = skeleton.shape
    framed = np.zeros((height + 2, width + 2), np.bool_)
    framed[1:-1, 1:-1] = skeleton
    # Only some hundred pixels are set, so each one looks at its neighbours ahead instead of all at theirs.
    flat, places = framed.ravel(), np.flatnonzero(framed)
    right, down, left = flat[places + 1], flat[places + width + 2], flat[places - 1]
    falling = flat[places + width + 3] & ~(right | down)
    rising = flat[places + width + 1] & ~(left | down)
    drawn_width = 2 * width + 2
    rows, columns = np.divmod(places, width + 2)
    drawn = 2 * (rows - 1) * drawn_width + 2 * columns - 1  # a column is left free for what rises from the first one
    grid = np.zeros((2 * height + 1) * drawn_width, np.bool_)
    for linked, step in ((right, 1), (down, drawn_width), (falling, drawn_width + 1), (rising, drawn_width - 1)):
        grid[drawn[linked] + step] = True
    grid[drawn] = True
    return np.ascontiguousarray(grid.reshape(-1, drawn_width)[: shape[0], 1 : shape[1] + 1])
