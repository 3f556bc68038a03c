"""One-pixel skeletons of vessel and robot (METHOD section 2)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from core.config import CleaningConfig, PerceptionConfig
from core.perception.pixel_graph import Chain, trace
from core.perception.polyline import arc_length
from core.types import Mask, Masks, Point, Points, Skeletons

MIN_HALF_SIZE_SHARE = 0.35
"""Half-size thinning needs a lumen some 10 px wide. In a narrower one the step to half size leaves less than this share of it."""
SPUR_RADII = 2.5
"""The arms of a fork at a broken end of the robot run to its corners: at most about one and a half radii, and a bit for noise."""
TANGENT_PX = 10
"""Skeleton pixels behind an end that give its direction."""


def thin_masks(masks: Masks, config: PerceptionConfig) -> Skeletons:
    """Skeletons of both masks; the robot's ends reach the edge of its mask if ``cleaning.extend_ends`` says so."""
    robot = np.zeros(masks.robot.shape, np.bool_)
    x, y, width, height = cv2.boundingRect(masks.robot.view(np.uint8))
    if width:
        window = np.s_[y : y + height, x : x + width]
        robot[window] = _thin_robot(np.ascontiguousarray(masks.robot[window]), config.cleaning)
    vessel = thin_half_size(masks.vessel) if config.cleaning.half_size_thinning else thin(masks.vessel)
    return Skeletons(vessel=vessel, robot=robot)


def _thin_robot(mask: Mask, config: CleaningConfig) -> Mask:
    skeleton = thin(mask)
    if config.prune_spurs:
        skeleton = without_spurs(skeleton, mask)
    return extend_ends(skeleton, mask) if config.extend_ends else skeleton


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
    """End points (x, y) of a skeleton.

    The paper's convolution with [[1, 1, 1], [1, 10, 1], [1, 1, 1]] gives 11 at a pixel with exactly one neighbour. That misses an
    end whose last step is a corner (two neighbours that touch each other), so this convolution tells all 256 neighbourhoods apart.
    """
    x, y, width, height = cv2.boundingRect(skeleton.view(np.uint8))
    window = np.ascontiguousarray(skeleton[y : y + height, x : x + width])
    places, links = _count_links(window)
    return [(place % width + x, place // width + y) for place in places[links == 1].tolist()]


def _count_links(skeleton: Mask) -> tuple[NDArray[np.intp], NDArray[np.uint8]]:
    """The skeleton's pixels, as flat indices, and how many links each has."""
    if skeleton.size == 0:
        return np.empty(0, np.intp), np.empty(0, np.uint8)
    bits = cv2.filter2D(skeleton.view(np.uint8), -1, _NEIGHBOUR_BITS, borderType=cv2.BORDER_CONSTANT | cv2.BORDER_ISOLATED)
    places = np.flatnonzero(skeleton)
    return places, _LINKS[np.asarray(bits).ravel()[places]]


def _links(bits: int) -> int:
    """How many links a pixel with these neighbours has; a diagonal neighbour counts only if no straight one makes the link."""
    here = {step for bit, step in enumerate(_AROUND) if bits >> bit & 1}
    straight = {(dx, dy) for dx, dy in here if dx == 0 or dy == 0}
    diagonal = {(dx, dy) for dx, dy in here - straight if (dx, 0) not in here and (0, dy) not in here}
    return len(straight) + len(diagonal)


_AROUND = ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1))
_NEIGHBOUR_BITS = np.array([[1, 2, 4], [8, 0, 16], [32, 64, 128]], np.float32)
_LINKS = np.array([_links(bits) for bits in range(256)], np.uint8)


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
    return None if len(walked) < 4 else _direction(walked)


def _direction(walked: Points) -> Point | None:
    chord = walked[0] - walked[-1]
    length = float(np.hypot(chord[0], chord[1]))
    return (float(chord[0]) / length, float(chord[1]) / length) if length > 0 else None


def without_spurs(skeleton: Mask, mask: Mask) -> Mask:
    """The robot's skeleton without its shortest branches: a broken or blunt end is thinned to a fork, which has no direction.

    A branch goes if it is shorter than ``SPUR_RADII`` of the robot's mean radius. Where only one other branch is left at its
    junction, the junction goes too, so that the skeleton ends in one clean pixel.
    """
    if not np.any(_count_links(skeleton)[1] >= 3):
        return skeleton
    graph = trace(skeleton)
    degrees = graph.degrees()
    lengths = [float(arc_length(chain.points)[-1]) for chain in graph.chains]
    limit_px = SPUR_RADII * mean_radius(skeleton, mask) + 1.0
    pruned = skeleton.copy()
    chains_at: list[list[int]] = [[] for _ in graph.nodes]
    for index, chain in enumerate(graph.chains):
        for node in {chain.start, chain.end}:
            chains_at[node].append(index)
    for node in np.flatnonzero(degrees >= 3).tolist():
        touching = chains_at[node]
        spurs = [i for i in touching if lengths[i] < limit_px and degrees[_other_end(graph.chains[i], node)] == 1]
        kept = [graph.chains[i] for i in touching if i not in spurs]
        if not spurs or not kept:
            continue
        for index in spurs:
            _set(pruned, graph.chains[index].points, False)
        if len(kept) == 1:
            x, y = np.rint(graph.nodes[node]).astype(int)
            pruned[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = False
        for chain in kept:
            inner = chain.points if len(kept) > 1 else chain.points[1:] if chain.start == node else chain.points[:-1]
            _set(pruned, inner, True)
    return pruned


def _other_end(chain: Chain, node: int) -> int:
    return chain.end if chain.start == node else chain.start


def _set(skeleton: Mask, points: Points, value: bool) -> None:
    places = np.rint(points).astype(int)
    skeleton[places[:, 1], places[:, 0]] = value


def extend_ends(skeleton: Mask, mask: Mask) -> Mask:
    """Each end of the robot's skeleton led along its tangent to the edge of the mask.

    Thinning stops about one radius short of a blunt end, which would put the robot's head one radius too far back, and bends the
    last radius towards a corner. So that much is taken off first, where the branch is long enough.
    """
    extended = skeleton.copy()
    trim = round(mean_radius(skeleton, mask))
    for end in end_pixels(skeleton):
        walked = walk_back(skeleton, end, trim + TANGENT_PX)
        if len(walked) < 4:
            continue
        hook = min(trim, len(walked) - 4)
        direction = _direction(np.array(walked[hook:], np.float64))
        if direction is None:
            continue
        for x, y in walked[:hook]:
            extended[y, x] = False
        cv2.line(extended.view(np.uint8), walked[hook], _last_inside(mask, walked[hook], direction), 1)
    return extended


def mean_radius(skeleton: Mask, mask: Mask) -> float:
    """Mean radius of what was thinned, in px: half its area over the skeleton's pixels."""
    return 0.5 * cv2.countNonZero(mask.view(np.uint8)) / max(cv2.countNonZero(skeleton.view(np.uint8)), 1)


def _last_inside(mask: Mask, start: tuple[int, int], direction: Point) -> tuple[int, int]:
    """The last pixel of the mask on the way from `start` in `direction`."""
    height, width = mask.shape
    reach = start
    for step in range(1, height + width):
        x, y = round(start[0] + step * direction[0]), round(start[1] + step * direction[1])
        if not (0 <= x < width and 0 <= y < height and mask[y, x]):
            break
        reach = (x, y)
    return reach
