"""In a stream, what looks like a piece of robot but is none: printed text, a reflection, a scratch.

Such a piece stays where it is while the robot's end moves on. A part of the robot that a fitting hides from the rest does not: it
moves with the robot, while the end that is seen stays at the fitting. What is known to be none must not become robot when the robot
comes near and the gap to it can be bridged, or when it touches it; it is robot where the picture has changed since.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import TrackingConfig
from core.types import Image, Mask, Point, Points, RobotPath

_KNOWN_SHARE = 0.7
"""Of a piece's pixels."""
_EDGE_PX = 2
"""So far the edge of a piece comes and goes with the noise."""
_MOST_SHARE = 0.3
"""Of the largest piece's pixels. What is larger is another robot or a part of this one, and the quality gate's to judge."""
_HELD_S = 20.0
"""What was not seen apart for so long is forgotten; and nothing is learnt where the robot was within that time."""
_SAME_LEVELS = 14.0
"""Grey levels of 255, on the mean over a neighbourhood as wide as a robot: noise of 20 levels stays below, a robot does not."""
_AROUND_PX = 7
_RENEWED = 0.1
"""Share of a new look in the remembered picture: the light changes slowly."""


class Lookalikes:
    """Which working pixels (h, w) look like robot and are none."""

    def __init__(self, config: TrackingConfig) -> None:
        self._travel_px, self._memory_s = config.lookalike_px, config.memory_s
        self.forget()

    def forget(self) -> None:
        """Another stream."""
        self._pieces: list[_Piece] = []
        self._begin((0, 0))

    def _begin(self, shape: tuple[int, ...]) -> None:
        self._last_s = -math.inf
        self._end: tuple[Point, float] | None = None
        self._known: Mask = np.zeros(shape, np.bool_)
        self._seen_s: NDArray[np.float64] = np.full(shape, -np.inf)
        self._robots_s: NDArray[np.float64] = np.full(shape, -np.inf)
        self._ends: NDArray[np.float32] = np.zeros((*shape, 2), np.float32)  # the robot's, when the pixel was first seen
        self._picture: NDArray[np.float32] = np.zeros((*shape, 3), np.float32)

    def without(self, robot: Mask, image: Image, captured_s: float) -> Mask:
        """The robot's mask (h, w) of the next frame, RGB (h, w, 3), without what is none; the same object where nothing is."""
        if self._travel_px == 0.0:
            return robot
        if self._known.shape != robot.shape or captured_s < self._last_s:  # a stream that was wound back
            self._begin(robot.shape)
        self._last_s = captured_s
        self._pieces = _pieces_of(robot)
        self._sight(self._apart(captured_s), image, captured_s)
        none = self._none(robot, image, captured_s)
        if none is None:
            return robot
        left = robot & ~none
        for piece in self._pieces:  # with its edge, which comes and goes
            within = left[piece.box]
            if np.count_nonzero(within & piece.mask) <= (1.0 - _KNOWN_SHARE) * piece.area:
                within &= ~piece.mask
        self._pieces = _pieces_of(left)
        return left

    def learn(self, path: RobotPath, captured_s: float) -> None:
        """Take in that the path found in the mask of the last ``without`` was believed."""
        if self._travel_px == 0.0:
            return
        self._end = path.head, captured_s
        pieces = _pieces_under(path.points, self._pieces)
        for body in pieces[:1]:
            self._robots_s[body.box][body.mask] = captured_s
        for bridged in pieces[1:]:  # perhaps the robot's tip, perhaps none of it: at least not seen apart
            box, mask = bridged.widened(_EDGE_PX, self._known.shape)
            self._seen_s[box][mask] = -math.inf

    def _apart(self, captured_s: float) -> list[_Piece]:
        """Small pieces that hang together neither with where the robot was, nor with the border that it comes in by."""
        most = _MOST_SHARE * max((piece.area for piece in self._pieces), default=0)
        height, width = self._known.shape
        return [
            piece
            for piece in self._pieces
            if piece.area <= most
            and not piece.touches_border(width, height)
            and not np.any(captured_s - self._robots_s[piece.box][piece.mask] < _HELD_S)
        ]

    def _sight(self, pieces: list[_Piece], image: Image, captured_s: float) -> None:
        """Remember where pieces lie and what they look like, and know those beside which the robot's end has moved on."""
        if self._end is None or not 0.0 <= captured_s - self._end[1] <= self._memory_s:
            return
        end = np.array(self._end[0], np.float32)
        for piece in pieces:
            box, mask = piece.widened(_EDGE_PX, self._known.shape)
            seen_s, ends, known, picture, now = (of[box] for of in (self._seen_s, self._ends, self._known, self._picture, image))
            is_new = mask & (captured_s - seen_s > _HELD_S)
            ends[is_new] = end
            known[is_new] = False
            picture[mask] += np.where(is_new[mask], 1.0, _RENEWED)[:, None] * (now[mask] - picture[mask])
            seen_s[mask] = captured_s
            known |= mask & (np.hypot(ends[..., 0] - end[0], ends[..., 1] - end[1]) >= self._travel_px)

    def _none(self, robot: Mask, image: Image, captured_s: float) -> Mask | None:
        """Where what is known lies and looks as before, in any piece; None where there is nothing."""
        known = robot & self._known
        x, y, width, height = cv2.boundingRect(known.view(np.uint8))
        if not width:
            return None
        box = slice(y, y + height), slice(x, x + width)
        weight = self._known[box].astype(np.float32)
        difference = np.abs(image[box] - self._picture[box]).mean(axis=2) * weight
        around = (_AROUND_PX, _AROUND_PX)
        looks_the_same = cv2.blur(difference, around) < _SAME_LEVELS * cv2.blur(weight, around)
        known[box] &= looks_the_same & (captured_s - self._seen_s[box] < _HELD_S)
        return known


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

    def widened(self, by_px: int, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Mask]:
        """The piece with what lies around it, cut off at the borders of a picture of `shape` (h, w)."""
        ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * by_px + 1, 2 * by_px + 1))
        mask = cv2.dilate(np.pad(self.mask, by_px).view(np.uint8), ellipse).view(np.bool_)
        height, width = mask.shape
        x, y = self.x - by_px, self.y - by_px
        left, top = max(0, -x), max(0, -y)
        right, bottom = min(width, shape[1] - x), min(height, shape[0] - y)
        return (slice(y + top, y + bottom), slice(x + left, x + right)), mask[top:bottom, left:right]


def _pieces_of(mask: Mask) -> list[_Piece]:
    left, top, across, down = cv2.boundingRect(mask.view(np.uint8))
    within = mask[top : top + down, left : left + across].view(np.uint8)
    if not within.size:
        return []
    # Short labels in the masks' own box: a quarter of the time.
    count, labels, stats, _ = cv2.connectedComponentsWithStats(within, connectivity=8, ltype=cv2.CV_16U)
    pieces = []
    for label in range(1, count):
        x, y, width, height, area = stats[label].tolist()
        pieces.append(_Piece(left + x, top + y, labels[y : y + height, x : x + width] == label, area))
    return pieces


def _pieces_under(points: Points, pieces: list[_Piece]) -> list[_Piece]:
    """The pieces that a path (N, 2) runs through, in its order."""
    columns, rows = np.rint(points).T.astype(np.intp)
    found = []
    for piece in pieces:
        height, width = piece.mask.shape
        x, y = columns - piece.x, rows - piece.y
        within = np.flatnonzero((x >= 0) & (x < width) & (y >= 0) & (y < height))
        on_it = within[piece.mask[y[within], x[within]]]
        if len(on_it):
            found.append((int(on_it[0]), piece))
    return [piece for _, piece in sorted(found, key=lambda pair: pair[0])]
