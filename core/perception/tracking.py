"""Streams: all that perception remembers of the frames before.

What the last frames say about this one (METHOD section 4): a memory that fades, a head that cannot jump, or has left.

In a stream, the way that was seen to a destination is not undone by a gap in the vessel that comes later.

In a stream, what looks like a piece of robot but is none: printed text, a reflection, a scratch.

Such a piece stays where it is while the robot's end moves on. A part of the robot that a fitting hides from the rest does not: it
moves with the robot, while the end that is seen stays at the fitting. What is known to be none must not become robot when the robot
comes near and the gap to it can be bridged, or when it touches it; it is robot where the picture has changed since.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.config.models import PerceptionConfig, TrackingConfig
from core.perception.head_tail import ALONG_STEP_PX, STILL_HEAD_PX, goes_along_px, may_go_on_outside
from core.perception.roi import GATHERING_S, RoiSelector, VesselAverage, cells_of, has_changed
from core.perception.segmentation import inner_area
from core.perception.vectors import foot
from core.types import Image, Mask, Point, Points, Reason, Refusal, RobotPath, Route, Window

SLACK_PX = 12.0
"""A still head may be found this far off from frame to frame: noise of the mask's tip."""
TURN_S = 10.0
"""In less nobody takes a robot out of a vessel and brings it in from the other side: so long its head is not its tail."""
HEAD_AT_BORDER_S = 0.3
"""A head that has just arrived at the image border is there. One that stays so long may have gone on beyond it for all one sees."""
HEAD_BACK_S = 0.08
"""The end of a mask that runs out of the picture comes and goes with the noise: a head that was there is back once it has been
clear of the border for so long, and not in a single frame."""
WITHIN_PX = 40.0
"""An end so far from the image border is not one that the border has just not been seen to reach."""


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The last path that was believed, and when its frame was captured.

    ``border_s``: since when the robot's mask has met the image border at its head, but for moments; None where it does not.
    ``clear_s``: the first frame of such a moment, while it lasts. ``came_from_within``: the same head was seen well within the
    picture before; one that never was may be an entry at which the robot was not seen to meet the border.
    """

    path: RobotPath
    captured_s: float
    border_s: float | None = None
    clear_s: float | None = None
    came_from_within: bool = False


def recall(memory: Memory | None, captured_s: float, config: TrackingConfig) -> RobotPath | None:
    """The remembered path, if tracking is on and the memory is not too old (or from the future: a stream that was wound back)."""
    if memory is None or not config.enabled:
        return None
    return memory.path if 0.0 <= captured_s - memory.captured_s <= config.memory_s else None


def recall_ends(memory: Memory | None, captured_s: float, config: TrackingConfig) -> RobotPath | None:
    """The remembered path, where it is too old to tell anything but which way the robot lies; None where it tells more, or nothing.

    Frames without an answer, however they come about, must not make the tail the head.
    """
    if memory is None or not config.enabled or not config.memory_s or recall(memory, captured_s, config) is not None:
        return None
    return memory.path if 0.0 <= captured_s - memory.captured_s <= TURN_S else None


def check_jump(path: RobotPath, memory: Memory | None, captured_s: float, config: TrackingConfig) -> Refusal | None:
    """HEAD_JUMP, when the head is farther from its last place than the robot can have moved.

    The refused path must not become the memory: then a wrong one is forgotten with the next frame, and a right one is accepted as
    soon as the old memory has faded.
    """
    before = recall(memory, captured_s, config)
    if before is None or memory is None:
        return None
    jump_px = float(np.hypot(path.head[0] - before.head[0], path.head[1] - before.head[1]))
    limit_px = config.max_head_speed_px_s * (captured_s - memory.captured_s) + SLACK_PX
    if jump_px <= limit_px:
        return None
    return Refusal(Reason.HEAD_JUMP, f"{jump_px:.0f} px since the last frame (at most {limit_px:.0f} px)")


def remember(path: RobotPath, mask: Mask, memory: Memory | None, captured_s: float, config: PerceptionConfig) -> Memory:
    """A path that was believed, found in the robot's mask (h, w), beside what is remembered of the frames before."""
    goes_on = _goes_on(path, memory, captured_s, config.tracking)
    border_s, clear_s = (memory.border_s, memory.clear_s) if memory is not None and goes_on else (None, None)
    came = _is_within(path.points[-1], mask.shape) or _came_before(path, memory, captured_s, config.tracking)
    if may_go_on_outside(path.points[-1], mask, config.path):
        return Memory(path, captured_s, captured_s if border_s is None else border_s, came_from_within=came)
    clear_s = captured_s if clear_s is None else clear_s
    if border_s is None or captured_s - clear_s >= HEAD_BACK_S:
        return Memory(path, captured_s, came_from_within=came)
    return Memory(path, captured_s, border_s, clear_s, came)


def _is_within(place: Points, shape: tuple[int, ...]) -> bool:
    """Whether a place (2,) is well within a picture of `shape` (h, w)."""
    x, y = float(place[0]), float(place[1])
    return min(x, y, shape[1] - 1 - x, shape[0] - 1 - y) >= WITHIN_PX


def _came_before(path: RobotPath, memory: Memory | None, captured_s: float, config: TrackingConfig) -> bool:
    """Whether the head of a path is the remembered one, wherever it has gone in a gap, and this one came from within."""
    if memory is None or not memory.came_from_within:
        return False
    before = recall_ends(memory, captured_s, config)
    along = before is not None and goes_along_px(path.points, before.points) > ALONG_STEP_PX
    return along or _goes_on(path, memory, captured_s, config)


def _goes_on(path: RobotPath, memory: Memory | None, captured_s: float, config: TrackingConfig) -> bool:
    """Whether what is remembered of the head is true of this path's: it was seen a moment ago, or lies there still after a gap."""
    if recall(memory, captured_s, config) is not None:
        return True
    before = recall_ends(memory, captured_s, config)
    return before is not None and float(np.hypot(*(path.points[-1] - before.points[-1]))) <= STILL_HEAD_PX


def check_in_view(memory: Memory, config: PerceptionConfig) -> Refusal | None:
    """AMBIGUOUS_PATH, when the robot has met the image border at its head for longer than ``HEAD_AT_BORDER_S``.

    Where it does, or did a moment ago, the border is all that is found of the head, however far outside it is. The refused path
    stays the memory: so its head remains the head, and not the tail of a robot that comes in there, and is known again when it
    comes back into view.
    """
    if not config.quality.enabled or memory.border_s is None or memory.captured_s - memory.border_s <= HEAD_AT_BORDER_S:
        return None
    return Refusal(Reason.AMBIGUOUS_PATH, "it reaches the image border at its head, which may be out of view")


_STEP_PX = 1.0
_ALIKE_STEP_PX = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A route as it was found last, and since when it has been found."""

    route: Route
    since_s: float
    last_s: float


class RouteMemory:
    """The last route that was found, for as long as the destination stays the same.

    Of a frame that was not believed nothing stays (``settle``): its route began at a head that was somewhere else.

    The phantom stands still, but a fitting or a reflection can cut the mask of the vessel in two, in one frame and not in the next,
    or join two vessels. The route of before then still holds if it has lasted for ``memory_s``, the head is beside it, and the
    vessel is still where it leads, but for a short gap. Another way, longer or shorter, is taken once it has lasted as long.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self.forget()

    def forget(self) -> None:
        """Another stream, or no destination any more."""
        self._known: _Seen | None = None
        self._other: _Seen | None = None
        self._settled: tuple[_Seen | None, _Seen | None] = (None, None)

    def settle(self, *, is_believed: bool) -> None:
        """The end of a frame, whether or not ``follow`` was asked in it: keep what it found, or what was known before it."""
        if not is_believed:
            self._known, self._other = self._settled
        self._settled = self._known, self._other

    def follow(self, found: Route | str, head: Point, target: Point, vessel: Mask, captured_s: float) -> Route | str:
        """The route that was found, or what is left of the one remembered, or why there is none.

        `found` is what ``route_or_reason`` says of this frame, `vessel` the mask (h, w), all in working px.
        """
        left, known = self._left(head, target, vessel), self._known
        is_true = known is not None and self._has_lasted(known)
        if not isinstance(found, Route):
            return left if left is not None and is_true else found
        if known is None or left is None:
            self._known, self._other = _Seen(found, captured_s, captured_s), None
            return found
        if not is_true or self._are_alike(left, found):
            self._known, self._other = self._seen_again(known, left, found, captured_s), None
            return found
        # Round a loop there is another way when this one is cut, and a short one where two vessels seem to touch: for a moment.
        other = self._other
        self._other = (
            self._seen_again(other, other.route, found, captured_s) if other is not None else _Seen(found, captured_s, captured_s)
        )
        if not self._has_lasted(self._other):
            return left
        self._known, self._other = self._other, None
        return found

    def _has_lasted(self, seen: _Seen) -> bool:
        return seen.last_s - seen.since_s >= self._config.memory_s

    def _are_alike(self, one: Route, other: Route) -> bool:
        """Whether the other route is as long, and nowhere far from the one: round a loop both ways may be as long."""
        if abs(one.length_px - other.length_px) > self._config.route_gap_px:
            return False
        along = geometry.arc_length(one.points)
        places = geometry.resample(other.points, _ALIKE_STEP_PX).tolist()
        return all(geometry.nearest(one.points, (x, y), along)[0] <= self._config.route_reach_px for x, y in places)

    def _seen_again(self, seen: _Seen, left: Route, found: Route, captured_s: float) -> _Seen:
        """A route found after `seen`, of which `left` is left: if they are alike, it has been found for as long."""
        goes_on = self._has_lasted(seen) or 0.0 <= captured_s - seen.last_s <= self._config.memory_s
        is_same = goes_on and self._are_alike(left, found)
        return _Seen(found, seen.since_s if is_same else captured_s, captured_s)

    def _left(self, head: Point, target: Point, vessel: Mask) -> Route | None:
        """What is left of the route remembered, if it still holds."""
        if self._known is None or self._known.route.target != target:
            self.forget()
            return None
        known = self._known.route
        beside = foot(known.points, head, vessel)
        if beside is None:
            return None
        away_px, position, _ = beside
        rest = geometry.cut(known.points, position, math.inf)
        if away_px > self._config.route_reach_px or _outside_px(rest, vessel) > self._config.route_gap_px:
            return None
        distinct = np.concatenate([[True], np.any(np.diff(rest, axis=0) != 0.0, axis=1)])
        return Route(rest[distinct], float(geometry.arc_length(rest)[-1]), target)


def _outside_px(points: Points, vessel: Mask) -> float:
    """Length of a line that lies outside a mask."""
    line = np.rint(geometry.resample(points, _STEP_PX)).astype(int)
    height, width = vessel.shape
    within = (line[:, 0] >= 0) & (line[:, 0] < width) & (line[:, 1] >= 0) & (line[:, 1] < height)
    inside = vessel[line[within, 1], line[within, 0]]
    return _STEP_PX * float(len(line) - np.count_nonzero(inside))


_EDGE_PX = 2
"""So far the edge of a piece comes and goes with the noise."""
_ELLIPSE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _EDGE_PX + 1, 2 * _EDGE_PX + 1))
_MOST_SHARE = 0.3
"""Of the largest piece's pixels. What is larger is another robot or a part of this one, and the quality gate's to judge."""
_MOST_PIECES = 10
"""A mask of more pieces is noise."""
_HELD_S = 20.0
"""What was not seen apart for so long is forgotten, and so is that there was robot."""
_SAME_LEVELS = 14.0
"""Grey levels of 255, on the mean over a neighbourhood as wide as a robot: noise of 20 levels stays below, a robot does not."""
_AROUND_PX = 7
_RENEWED_S = 0.3
"""Time constant with which the remembered picture follows a light that changes slowly."""
_CHECK_S, _COMPARED_S = 0.1, 0.5
"""So often the picture as a whole is compared with one that is at most so old: it takes as long as everything else here."""


class StaticArtefacts:
    """Which working pixels (h, w) look like robot and are none."""

    def __init__(self, config: TrackingConfig) -> None:
        self._travel_px, self._memory_s = config.lookalike_px, config.memory_s
        self.forget()

    def forget(self) -> None:
        """Another stream, or another place of the camera."""
        self._begin((0, 0))

    def _begin(self, shape: tuple[int, ...]) -> None:
        self._last_s = -math.inf
        self.none: Mask | None = None
        """What the last ``without`` took out of the mask (h, w); None for nothing."""
        self._end: tuple[Point, float] | None = None
        self._pieces: list[_Piece] = []
        self._checked_s = -math.inf
        self._cells: tuple[NDArray[np.float32], float] | None = None
        self._known: Mask = np.zeros(shape, np.bool_)
        self._seen_s: NDArray[np.float64] = np.full(shape, -np.inf)
        self._robots_s: NDArray[np.float64] = np.full(shape, -np.inf)
        self._ends: NDArray[np.float32] = np.zeros((*shape, 2), np.float32)  # the robot's, when the pixel was first seen
        self._picture: NDArray[np.float32] = np.zeros((*shape, 3), np.float32)

    def doubt(self) -> None:
        """The robot's end has jumped: what has stayed beside it until now shall be seen to stay anew.

        What is known already is none for as long as the picture there is as it was, and not one of a camera that was moved.
        """
        self._end = None
        self._seen_s[~self._known] = -math.inf

    def without(self, robot: Mask, image: Image, captured_s: float, window: Window | None = None) -> Mask:
        """The robot's mask (h, w) of the next frame without what is none; the same object where nothing is.

        Parameters
        ----------
        robot, image : mask (h, w) and RGB picture (h, w, 3).
        window : (x, y, width, height) of what was looked at anew; None for all of it.
        """
        self.none = None
        if self._travel_px == 0.0:
            return robot
        is_rewound = captured_s < self._last_s
        if self._known.shape != robot.shape or is_rewound or self._has_moved(image, captured_s):
            self._begin(robot.shape)
        self._last_s = captured_s
        pieces = _pieces_of(robot)
        self._pieces, left = self._cleaned(pieces, robot, image, captured_s)
        for piece in self._pieces:  # what was robot is robot for as long as it is seen there
            if self._was_robot(piece, captured_s):
                self._robots_s[piece.box][piece.mask] = captured_s
        self._sight(self._apart(pieces, captured_s, window), image, captured_s)
        if left is not robot:
            self.none = robot & ~left
        return left

    def learn(self, path: RobotPath, captured_s: float) -> None:
        """Take in that the path found in the mask of the last ``without`` was believed."""
        if self._travel_px == 0.0:
            return
        places = [(piece, _places_on(path.points, piece)) for piece in self._pieces]
        on_path = sorted(((at, piece) for piece, at in places if len(at)), key=lambda pair: int(pair[0][0]))
        for _, piece in on_path:
            self._robots_s[piece.box][piece.mask] = captured_s
        if on_path:  # the end of what hangs together: beyond a gap may lie the tip, or none of it
            x, y = path.points[on_path[0][0][-1]].tolist()
            self._end = (x, y), captured_s

    def _has_moved(self, image: Image, captured_s: float) -> bool:
        """Whether the picture as a whole is another one than a moment ago: then nothing lies where it lay."""
        if captured_s - self._checked_s < _CHECK_S:
            return False
        self._checked_s = captured_s
        cells, before = cells_of(image), self._cells
        if before is None or captured_s - before[1] >= _COMPARED_S:
            self._cells = cells, captured_s
        return before is not None and has_changed(before[0], cells, (0, 0, 0, 0))

    def _was_robot(self, piece: _Piece, captured_s: float) -> bool:
        return bool(np.any(captured_s - self._robots_s[piece.box][piece.mask] < _HELD_S))

    def _apart(self, pieces: list[_Piece], captured_s: float, window: Window | None) -> list[_Piece]:
        """Small pieces that were looked at and hang together neither with the robot nor with the border that it comes in by."""
        if len(pieces) > _MOST_PIECES:
            return []
        most = _MOST_SHARE * max((piece.area for piece in pieces), default=0)
        height, width = self._known.shape
        seen = inner_area(window, (width, height)) if window is not None else (slice(0, height), slice(0, width))
        return [
            piece
            for piece in pieces
            if piece.area <= most
            and not piece.touches_border(width, height)
            and all(part.start >= all_.start and part.stop <= all_.stop for part, all_ in zip(piece.box, seen, strict=True))
            and not self._was_robot(piece, captured_s)
        ]

    def _sight(self, pieces: list[_Piece], image: Image, captured_s: float) -> None:
        """Remember where pieces lie and what they look like, and know those beside which the robot's end has moved on."""
        if self._end is None or captured_s - self._end[1] > self._memory_s:
            return
        end = np.array(self._end[0], np.float32)
        for piece in pieces:
            box, mask = piece.widened(self._known.shape)
            seen_s, ends, known = self._seen_s[box], self._ends[box], self._known[box]
            now, picture = image[box], self._picture[box]
            passed_s = captured_s - seen_s
            held = mask & (passed_s < _HELD_S)
            is_old = held & _looks_alike(now, picture, held)
            is_new = mask & ~is_old  # also where something else lies now
            ends[is_new] = end
            known[is_new] = False
            renewed = np.where(is_old, 1.0 - np.exp(-np.minimum(passed_s, _HELD_S) / _RENEWED_S), 1.0)[mask]
            picture[mask] += renewed[:, None] * (now[mask] - picture[mask])
            seen_s[mask] = captured_s
            known |= mask & (np.hypot(ends[..., 0] - end[0], ends[..., 1] - end[1]) >= self._travel_px)

    def _cleaned(self, pieces: list[_Piece], robot: Mask, image: Image, captured_s: float) -> tuple[list[_Piece], Mask]:
        """The pieces without what is known and looks as before, and the mask of them."""
        left, kept = robot, list[_Piece]()
        for piece in pieces:
            none = self._none(piece, image, captured_s)
            if none is None:
                kept.append(piece)
                continue
            if left is robot:
                left = robot.copy()
            left[piece.box] &= ~none
            kept += _pieces_of(piece.mask & ~none, piece.x, piece.y)
        return kept, left

    def _none(self, piece: _Piece, image: Image, captured_s: float) -> Mask | None:
        """Which of a piece's pixels, within its box, are known, with their edge; None for none.

        Of a robot that has reached something of its own colour nobody can tell: there all is robot.
        """
        box = piece.box
        known = self._known[box] & (captured_s - self._seen_s[box] < _HELD_S)
        found = known & piece.mask
        if not found.any():
            return None
        now, picture = image[box], self._picture[box]
        found &= _looks_alike(now, picture, known)
        others = piece.mask & ~known
        if np.count_nonzero(others) > np.count_nonzero(piece.mask & known):
            colour = now[others].mean(axis=0)
            found &= ~_looks_alike(np.broadcast_to(colour, picture.shape), picture, known, 2.0 * _SAME_LEVELS)
        if not found.any():
            return None
        return (cv2.dilate(found.view(np.uint8), _ELLIPSE, iterations=2) > 0) & piece.mask


def _looks_alike(now: NDArray[Any], before: NDArray[np.float32], where: Mask, levels: float = _SAME_LEVELS) -> Mask:
    """Where two pictures (h, w, 3) are the same within `levels`, by the mean over those pixels around that `where` holds."""
    weight = where.astype(np.float32)
    difference = np.abs(now - before).mean(axis=2, dtype=np.float32) * weight
    around = (_AROUND_PX, _AROUND_PX)
    return np.asarray(cv2.blur(difference, around) < levels * cv2.blur(weight, around))


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """An 8-connected piece of a mask: its pixels within its box."""

    x: int
    y: int
    mask: Mask
    area: int

    @property
    def box(self) -> tuple[slice, slice]:
        height, width = self.mask.shape
        return slice(self.y, self.y + height), slice(self.x, self.x + width)

    def touches_border(self, width: int, height: int) -> bool:
        rows, columns = self.box
        return bool(rows.start == 0 or columns.start == 0 or rows.stop == height or columns.stop == width)

    def widened(self, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Mask]:
        """The piece with its edge, cut off at the borders of a picture of `shape` (h, w)."""
        mask = cv2.dilate(np.pad(self.mask, _EDGE_PX).view(np.uint8), _ELLIPSE).view(np.bool_)
        height, width = mask.shape
        x, y = self.x - _EDGE_PX, self.y - _EDGE_PX
        left, top = max(0, -x), max(0, -y)
        right, bottom = min(width, shape[1] - x), min(height, shape[0] - y)
        return (slice(y + top, y + bottom), slice(x + left, x + right)), mask[top:bottom, left:right]


def _pieces_of(mask: Mask, x0: int = 0, y0: int = 0) -> list[_Piece]:
    """The pieces of a mask whose first pixel lies at (`x0`, `y0`)."""
    left, top, across, down = cv2.boundingRect(mask.view(np.uint8))
    within = np.ascontiguousarray(mask[top : top + down, left : left + across]).view(np.uint8)
    if not within.size:
        return []
    # Short labels in the mask's own box: a quarter of the time.
    count, labels, stats, _ = cv2.connectedComponentsWithStats(within, connectivity=8, ltype=cv2.CV_16U)
    pieces = []
    for label in range(1, count):
        x, y, width, height, area = stats[label].tolist()
        pieces.append(_Piece(x0 + left + x, y0 + top + y, labels[y : y + height, x : x + width] == label, area))
    return pieces


def _places_on(points: Points, piece: _Piece) -> NDArray[np.intp]:
    """Which points of a path (N, 2) lie in a piece."""
    columns, rows = np.rint(points).T.astype(np.intp)
    height, width = piece.mask.shape
    x, y = columns - piece.x, rows - piece.y
    within = np.flatnonzero((x >= 0) & (x < width) & (y >= 0) & (y < height))
    return np.asarray(within[piece.mask[y[within], x[within]]], np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class PreviousFrame:
    """The path of the last frame, or, after a gap, the one that still tells which end is the head; whether that head came to where
    it is from within the picture; and which pixels (h, w) of this frame are known to be no robot."""

    path: RobotPath | None = None
    ends: RobotPath | None = None
    came_from_within: bool = False
    none: Mask | None = None


class StreamState:
    """What a stream remembers of its frames."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self.memory: Memory | None = None
        self.routes = RouteMemory(config)
        self.lookalikes = StaticArtefacts(config)
        self.glances = RoiSelector(config)
        self.standing = VesselAverage()
        self.unlike = False

    @property
    def refresh_s(self) -> float:
        """The longest time between two whole looks."""
        longest = self._config.refresh_s
        return min(longest, GATHERING_S) if self.standing.is_gathering else longest

    def next_look(self) -> VesselAverage:
        """What earlier whole looks have told of the vessel, ready for another one.

        Only looks that come between windows are turned: one orientation after the other would make the head tremble.
        """
        if self.glances.has_changed:
            self.standing.forget()
        self.standing.begin(is_turned=self.glances.is_due)
        return self.standing

    def recall(self, captured_s: float) -> PreviousFrame:
        memory, config = self.memory, self._config
        return PreviousFrame(
            recall(memory, captured_s, config),
            recall_ends(memory, captured_s, config),
            memory is not None and memory.came_from_within,
            self.lookalikes.none,
        )

    def forget(self) -> None:
        self.memory, self.unlike = None, False
        for part in (self.routes, self.lookalikes, self.glances, self.standing):
            part.forget()
