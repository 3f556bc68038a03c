"""One-pixel skeletons of vessel and robot (METHOD section 2)."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import CleaningConfig, PerceptionConfig
from core.perception.pixel_graph import Chain, trace
from core.perception.polyline import arc_length
from core.perception.thinning import thin, thin_half_size
from core.types import Mask, Masks, Point, Points, Skeletons

MAX_KNOTS = 200
"""A robot's skeleton has some ten ends and junctions; one of so many is noise, that no mending makes a robot of."""
SPUR_RADII = 2.5
"""The arms of a fork at a broken end of the robot run to its corners: at most about one and a half radii, and a bit for noise."""
TANGENT_PX = 10
"""Skeleton pixels behind an end that give its direction."""


def thin_masks(masks: Masks, config: PerceptionConfig) -> Skeletons:
    """Skeletons of both masks; the robot's ends reach the edge of its mask if ``cleaning.extend_ends`` says so."""
    vessel = thin_half_size(masks.vessel) if config.cleaning.half_size_thinning else thin(masks.vessel)
    return Skeletons(vessel=vessel, robot=thin_robot(masks.robot, config))


def thin_robot(mask: Mask, config: PerceptionConfig) -> Mask:
    """The robot's skeleton alone."""
    robot = np.zeros(mask.shape, np.bool_)
    x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
    if width:
        window = np.s_[y : y + height, x : x + width]
        robot[window] = _robot_skeleton(np.ascontiguousarray(mask[window]), config.cleaning)
    return robot


def _robot_skeleton(mask: Mask, config: CleaningConfig) -> Mask:
    """The robot's skeleton in a mask that is cut to its bounding box."""
    skeleton = thin(mask)
    links = _count_links(skeleton)[1]
    if np.count_nonzero(links != 2) > MAX_KNOTS:
        return skeleton
    if config.prune_spurs and np.any(links >= 3):
        skeleton = without_spurs(skeleton, mask)
    return extend_ends(skeleton, mask) if config.extend_ends else skeleton


def end_pixels(skeleton: Mask) -> list[tuple[int, int]]:
    """End points (x, y) of a skeleton.

    The paper's convolution with [[1, 1, 1], [1, 10, 1], [1, 1, 1]] gives 11 at a pixel with exactly one neighbour. That misses an
    end whose last step is a corner (two neighbours that touch each other), so here all 256 neighbourhoods are told apart.
    """
    x, y, width, height = cv2.boundingRect(skeleton.view(np.uint8))
    window = np.ascontiguousarray(skeleton[y : y + height, x : x + width])
    places, links = _count_links(window)
    return [(place % width + x, place // width + y) for place in places[links == 1].tolist()]


def _count_links(skeleton: Mask) -> tuple[NDArray[np.intp], NDArray[np.uint8]]:
    """The skeleton's pixels, as flat indices, and how many links each has."""
    if skeleton.size == 0:
        return np.empty(0, np.intp), np.empty(0, np.uint8)
    height, width = skeleton.shape
    framed = np.zeros((height + 2, width + 2), np.bool_)
    framed[1:-1, 1:-1] = skeleton
    places = np.flatnonzero(framed)
    around = framed.ravel()[places + np.array([[dy * (width + 2) + dx] for dx, dy in _AROUND])]
    links = _LINKS[np.packbits(around, axis=0, bitorder="little")[0]] if len(places) else np.empty(0, np.uint8)
    rows, columns = np.divmod(places, width + 2)
    return (rows - 1) * width + columns - 1, links


def _links(bits: int) -> int:
    """How many links a pixel with these neighbours has; a diagonal neighbour counts only if no straight one makes the link."""
    here = {step for bit, step in enumerate(_AROUND) if bits >> bit & 1}
    straight = {(dx, dy) for dx, dy in here if dx == 0 or dy == 0}
    diagonal = {(dx, dy) for dx, dy in here - straight if (dx, 0) not in here and (0, dy) not in here}
    return len(straight) + len(diagonal)


_AROUND = ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1))
_LINKS = np.array([_links(bits) for bits in range(256)], np.uint8)


class Walker:
    """Walks along a skeleton's branches from their ends."""

    def __init__(self, skeleton: Mask) -> None:
        height, width = skeleton.shape
        self._stride = width + 2
        framed = np.zeros((height + 2, self._stride), np.bool_)
        framed[1:-1, 1:-1] = skeleton
        self._pixels = framed.tobytes()  # single pixels are read many times faster from bytes than from an array

    def back(self, end: tuple[int, int], steps: int) -> list[tuple[int, int]]:
        """Pixels (x, y) from an end point back along its branch: at most `steps` of them, and not beyond a junction."""
        stride, pixels = self._stride, self._pixels
        straight_steps = (-1, 1, -stride, stride)
        diagonal_steps = (-stride - 1, -stride + 1, stride - 1, stride + 1)
        walked = [(end[1] + 1) * stride + end[0] + 1]
        while len(walked) <= steps:
            here, behind = walked[-1], walked[-3:]
            straight = [here + step for step in straight_steps if pixels[here + step] and here + step not in behind]
            diagonal = [here + step for step in diagonal_steps if pixels[here + step] and here + step not in behind]
            # At a corner the diagonal neighbour comes after the straight one.
            if len(straight) > 1 or len(diagonal) > 1 or not (straight or diagonal):
                break
            walked.append((straight or diagonal)[0])
        return [(place % stride - 1, place // stride - 1) for place in walked]

    def direction(self, end: tuple[int, int]) -> Point | None:
        """Unit vector in which the branch leaves through its end, or None for a branch of less than 4 pixels."""
        walked = self.back(end, TANGENT_PX)
        return None if len(walked) < 4 else _direction(walked)


def walk_back(skeleton: Mask, end: tuple[int, int], steps: int) -> list[tuple[int, int]]:
    """Pixels (x, y) from an end point back along its branch: at most `steps` of them, and not beyond a junction."""
    return Walker(skeleton).back(end, steps)


def end_direction(skeleton: Mask, end: tuple[int, int]) -> Point | None:
    """Unit vector in which the branch leaves through its end, or None for a branch of less than 4 pixels."""
    return Walker(skeleton).direction(end)


def _direction(walked: list[tuple[int, int]]) -> Point | None:
    across, down = walked[0][0] - walked[-1][0], walked[0][1] - walked[-1][1]
    length = math.hypot(across, down)
    return (across / length, down / length) if length > 0 else None


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
    walker = Walker(skeleton)
    ends = end_pixels(skeleton)
    for end in ends:
        walked = walker.back(end, 2 * trim + TANGENT_PX)
        if len(walked) < 4:
            continue
        # A short branch is taken off at both of its ends. A third of it stays between them, which has its direction.
        is_whole = walked[-1] in ends
        hook = min(trim, len(walked) // 3 if is_whole else len(walked) - 4)
        direction = _direction(walked[hook : min(len(walked) - hook if is_whole else len(walked), hook + TANGENT_PX + 1)])
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
