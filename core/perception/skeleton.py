"""One-pixel skeletons of vessel and robot, the repair of gaps, and skeletons as graphs (METHOD sections 2 and 3).

Thinning is Zhang and Suen's algorithm; the repair of gaps is the paper's Algorithm 1. The paper follows the skeleton recursively,
pixel by pixel. Here each chain of pixels is walked once, in a loop, and later stages walk some ten chains instead of a thousand
pixels: no recursion limit, no endless loops.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import GapConfig, PerceptionConfig
from core.geometry import arc_length
from core.perception import compiled
from core.types import Mask, Masks, Point, Points, Skeletons

MIN_HALF_SIZE_SHARE = 0.35
"""Half-size thinning needs a lumen some 10 px wide. In a narrower one the step to half size leaves less than this share of it."""
MAX_LOST_PX = 40
"""Pixels that the half-size step may leave far from the rest: more are a lost vessel, some 20 px of one that is 3 px wide. Tips,
corners and ragged walls of wide ones are fewer (in all but 1 % of the masks that the network found on 480 frames)."""
_THREE, _FIVE = (np.ones((side, side), np.uint8) for side in (3, 5))
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


def _removal(bits: int) -> int:
    """Sub-iterations (1, 2, 3: both) in which a pixel with these neighbours is removed: bit 0 is the upper left one, then
    clockwise."""
    north, east, south, west = (bool(bits >> n & 1) for n in (1, 3, 5, 7))
    around = [bits >> n & 1 for n in range(8)]
    edges = sum(not here and there for here, there in zip(around, around[1:] + around[:1], strict=True))
    if not 2 <= sum(around) <= 6 or edges != 1:
        return 0
    return int(not (east and south and (north or west))) + 2 * int(not (north and west and (east or south)))


_EXCEPTIONS = (
    {3: 1, 6: 1, 12: 1, 24: 2, 48: 0, 96: 2, 129: 0, 192: 2}  # where a diagonal two pixels wide ends, not both at once
    | {14: 1, 56: 2, 131: 1, 224: 2}
    | {10: 3, 40: 3, 130: 3, 160: 3}  # corners of a staircase go
    | {11: 1, 26: 2, 104: 2, 108: 2, 134: 1, 161: 1, 176: 2, 194: 1, 198: 1}
)
"""Neighbourhoods that differ from the paper's algorithm, which wears diagonals away and leaves staircases."""
_REMOVAL_TABLE = np.array([_EXCEPTIONS.get(bits, _removal(bits)) for bits in range(256)], np.uint8)


def thin(mask: Mask) -> Mask:
    """The mask thinned to one pixel, with its topology: as many components and loops as before.

    Zhang and Suen's algorithm [1]_ with scikit-image's corrections: the same pixels as its ``skeletonize`` in a third of the time,
    because only pixels whose neighbourhood has changed are examined again.

    References
    ----------
    .. [1] T. Y. Zhang and C. Y. Suen, "A fast parallel algorithm for thinning digital patterns", CACM 27(3), 1984.
    """
    skeleton = np.zeros(mask.shape, np.bool_)
    x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
    if width:
        window = np.s_[y : y + height, x : x + width]
        framed = np.zeros((height + 2, width + 2), np.uint8)
        framed[1:-1, 1:-1] = mask[window]
        outer = np.flatnonzero(framed > cv2.erode(framed, _CROSS))
        compiled.thin(framed.reshape(-1), width + 2, outer, _REMOVAL_TABLE)
        skeleton[window] = framed[1:-1, 1:-1]
    return skeleton


def thin_half_size(mask: Mask) -> Mask:
    """A wide mask thinned on every second pixel and drawn back at full size: seven times faster, the same topology.

    A pixel of the half-size mask stands for 3x3 pixels that must all be set: so walls and loops of one pixel survive, and parts
    that do not touch never merge. What is narrower than about 6 px breaks; a mask that loses too much that way, or a narrow vessel
    beside wide ones, is thinned at full size.
    """
    full = mask.view(np.uint8)
    half = np.ascontiguousarray(cv2.erode(full, _THREE, borderType=cv2.BORDER_REPLICATE)[::2, ::2]).view(np.uint8)
    # Every second pixel of the mask that is 5 px or more from what is left of it at half size.
    lost = cv2.countNonZero(cv2.subtract(np.ascontiguousarray(full[::2, ::2]), cv2.dilate(half, _FIVE)))
    if 4 * cv2.countNonZero(half) < MIN_HALF_SIZE_SHARE * cv2.countNonZero(full) or 4 * lost > MAX_LOST_PX:
        return thin(mask)
    return _double(thin(half.view(np.bool_)), mask.shape)


def _double(skeleton: Mask, shape: tuple[int, ...]) -> Mask:
    """A skeleton drawn at twice its size: pixel (x, y) goes to (2x, 2y), and each link between neighbours to the pixel between."""
    height, width = skeleton.shape
    framed = np.zeros((height + 2, width + 2), np.bool_)
    framed[1:-1, 1:-1] = skeleton
    # Only some hundred pixels are set, so their neighbours are read instead of all pixels'.
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


@dataclass(frozen=True, slots=True, eq=False)
class PixelChain:
    """Pixels ``points`` (N, 2) from node ``start`` to node ``end``, both nodes included."""

    start: int
    end: int
    points: Points


@dataclass(frozen=True, slots=True, eq=False)
class PixelGraph:
    """``nodes`` (K, 2): one per cluster of junction pixels, per end pixel, and per closed ring (somewhere on it)."""

    nodes: Points
    chains: tuple[PixelChain, ...]

    def degrees(self) -> NDArray[np.int64]:
        """Chain ends at each node, shape (K,): 1 = end, 3 or more = junction; a ring counts twice at its node; 0 = lone pixel."""
        ends = [node for chain in self.chains for node in (chain.start, chain.end)]
        return np.bincount(np.array(ends, np.int64), minlength=len(self.nodes))


def trace(skeleton: Mask) -> PixelGraph:
    """The pixel graph of a one-pixel skeleton, in the skeleton's own pixel coordinates.

    Neighbouring pixels are linked; a diagonal link is left out where a straight neighbour already makes it, so that a staircase is
    a chain and not a row of junctions. Pixels with three or more links are junctions, and touching ones are one node at their
    mean.
    """
    nodes, starts, ends, points, marks = compiled.trace_graph(np.flatnonzero(skeleton), skeleton.shape[1])
    lines = zip(starts.tolist(), ends.tolist(), pairwise(marks.tolist()), strict=True)
    return PixelGraph(nodes, tuple(PixelChain(start, end, points[first:last]) for start, end, (first, last) in lines))


MAX_KNOTS = 200
"""A robot's skeleton has some ten ends and junctions; one of more than these is noise."""
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
        cut_out = np.ascontiguousarray(mask[window])
        skeleton = thin(cut_out)
        if np.count_nonzero(_count_links(skeleton)[1] != 2) <= MAX_KNOTS:
            if config.cleaning.prune_spurs:
                skeleton = without_spurs(skeleton, cut_out)
            if config.cleaning.extend_ends:
                skeleton = extend_ends(skeleton, cut_out)
        robot[window] = skeleton
    return robot


def end_pixels(skeleton: Mask) -> list[tuple[int, int]]:
    """End points (x, y) of a skeleton.

    The paper's convolution with [[1, 1, 1], [1, 10, 1], [1, 1, 1]] gives 11 at a pixel with exactly one neighbour. It misses an end
    whose last step is a corner (two neighbours that touch each other), so here a table holds all 256 neighbourhoods.
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


class BranchWalker:
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


def _direction(walked: list[tuple[int, int]]) -> Point | None:
    across, down = walked[0][0] - walked[-1][0], walked[0][1] - walked[-1][1]
    length = math.hypot(across, down)
    return (across / length, down / length) if length > 0 else None


def without_spurs(skeleton: Mask, mask: Mask) -> Mask:
    """The robot's skeleton without its shortest branches: a broken or blunt end is thinned to a fork, which has no direction.

    A branch shorter than ``SPUR_RADII`` of the robot's mean radius is removed. Where only one other branch is left at its junction,
    the junction is removed too, so that the skeleton ends in one pixel.
    """
    if not np.any(_count_links(skeleton)[1] >= 3):
        return skeleton
    graph = trace(skeleton)
    degrees = graph.degrees()
    lengths = [float(arc_length(chain.points)[-1]) for chain in graph.chains]
    ends = [(chain.start, chain.end) for chain in graph.chains]
    limit_px = SPUR_RADII * mean_radius(skeleton, mask) + 1.0
    pruned = skeleton.copy()
    chains_at: list[list[int]] = [[] for _ in graph.nodes]
    for index, chain in enumerate(graph.chains):
        for node in {chain.start, chain.end}:
            chains_at[node].append(index)
    for node in np.flatnonzero(degrees >= 3).tolist():
        touching = chains_at[node]
        spurs = [i for i in touching if lengths[i] < limit_px and degrees[sum(ends[i]) - node] == 1]
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


def _set(skeleton: Mask, points: Points, value: bool) -> None:
    places = np.rint(points).astype(int)
    skeleton[places[:, 1], places[:, 0]] = value


def extend_ends(skeleton: Mask, mask: Mask) -> Mask:
    """Each end of the robot's skeleton extended along its tangent to the edge of the mask.

    Thinning stops about one radius short of a blunt end, and bends the last radius towards a corner. So one radius is removed
    first, where the branch is long enough.
    """
    extended = skeleton.copy()
    trim = round(mean_radius(skeleton, mask))
    walker = BranchWalker(skeleton)
    ends = end_pixels(skeleton)
    for end in ends:
        walked = walker.back(end, 2 * trim + TANGENT_PX)
        if len(walked) < 4:
            continue
        # Of a short branch, which is trimmed at both ends, a third stays and gives the direction.
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
    """Mean radius of the mask in px: half its area over the skeleton's pixels."""
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


MAX_ENDS = 150
"""A broken robot with some specks has some tens of ends; more are noise, and every two ends are compared."""
TOUCHING_PX = 3.0
"""Two ends this near are joined whatever their directions."""
NEAR_PX = 10.0
"""The step between two ends this near is too short to have a direction: there only the ends' own directions must agree."""


@dataclass(frozen=True, slots=True)
class _End:
    place: tuple[int, int]
    direction: Point | None
    component: int


def repair(skeletons: Skeletons, config: GapConfig) -> Skeletons:
    """The same skeletons with the robot's gaps bridged, and the bridges listed.

    With ``rule = "components"`` ends of different components are joined, nearest first, where the robot would not have to turn by
    more than ``max_turn_deg``; each end is used once. With ``rule = "every_pair"`` every two ends nearer than the threshold are
    joined, as the paper's pseudocode says: also the two ends of one short piece. A skeleton of more than ``MAX_ENDS`` ends is left
    as it is.
    """
    places = end_pixels(skeletons.robot)
    if len(places) > MAX_ENDS:
        return skeletons
    if not any(math.dist(a, b) < config.gap_threshold_px for a, b in combinations(places, 2)):
        return skeletons
    x, y, width, height = cv2.boundingRect(skeletons.robot.view(np.uint8))
    window = np.ascontiguousarray(skeletons.robot[y : y + height, x : x + width])
    _, labels = cv2.connectedComponents(window.view(np.uint8), connectivity=8)
    walker = BranchWalker(window)
    ends = [_End((u, v), walker.direction((u - x, v - y)), int(labels[v - y, u - x])) for u, v in places]
    if config.rule == "every_pair":
        pairs = [(a, b) for a, b in combinations(ends, 2) if math.dist(a.place, b.place) < config.gap_threshold_px]
    else:
        pairs = _plausible_pairs(ends, config)
    if not pairs:
        return skeletons
    robot = skeletons.robot.view(np.uint8).copy()
    for a, b in pairs:
        cv2.line(robot, a.place, b.place, 1)
    bridges = tuple(((float(a.place[0]), float(a.place[1])), (float(b.place[0]), float(b.place[1]))) for a, b in pairs)
    return Skeletons(skeletons.vessel, robot.view(np.bool_), bridges)


def _plausible_pairs(ends: list[_End], config: GapConfig) -> list[tuple[_End, _End]]:
    """Pairs to join: of different components, nearest first, and only where neither end has to turn too far."""
    near = [
        (d, i, j)
        for (i, a), (j, b) in combinations(enumerate(ends), 2)
        if (d := math.dist(a.place, b.place)) < config.gap_threshold_px
    ]
    merged = {end.component: end.component for end in ends}
    used: set[int] = set()
    chosen = []
    for distance, i, j in sorted(near):
        a, b = ends[i], ends[j]
        if i in used or j in used or merged[a.component] == merged[b.component]:
            continue
        if distance > TOUCHING_PX and _turn_deg(a, b, distance) > config.max_turn_deg:
            continue
        old, new = merged[b.component], merged[a.component]
        merged = {component: new if group == old else group for component, group in merged.items()}
        used |= {i, j}
        chosen.append((a, b))
    return chosen


def _turn_deg(a: _End, b: _End, distance: float) -> float:
    if distance <= NEAR_PX and a.direction is not None and b.direction is not None:
        cosine = -a.direction[0] * b.direction[0] - a.direction[1] * b.direction[1]
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return max(turns_deg(a.place, a.direction, b.place, b.direction))


def turns_deg(
    a: Sequence[float] | Points, leaving: Point | Points | None, b: Sequence[float] | Points, arriving: Point | Points | None
) -> tuple[float, float]:
    """Turns of a path that leaves through end `a` towards end `b`, and enters there: degrees, 0 for an end without direction.

    Both directions are unit vectors that point out of their own component.
    """
    step = np.asarray(b, np.float64) - np.asarray(a, np.float64)
    step /= max(float(np.hypot(step[0], step[1])), 1e-9)
    first = 1.0 if leaving is None else float(step @ np.asarray(leaving))
    second = 1.0 if arriving is None else float(-step @ np.asarray(arriving))
    return float(np.degrees(np.arccos(np.clip(first, -1.0, 1.0)))), float(np.degrees(np.arccos(np.clip(second, -1.0, 1.0))))
