"""In a stream, what looks like a piece of robot but is none: printed text, a reflection, a scratch.

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

from core.config import TrackingConfig
from core.perception.glance import cells_of, has_changed
from core.perception.windows import inner_area
from core.types import Image, Mask, Point, Points, RobotPath, Window

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


class Lookalikes:
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
