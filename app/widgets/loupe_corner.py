"""In which corner of the view the loupe hides least."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF

from app.scene_shapes import SceneShapes
from core.types import Point, Points

_NEAR_PX, _CLEAR_PX = 20, 60
_SETTLE_S = 1.0
_MUCH, _SHARE = 30.0, 0.5
_VESSEL, _ROBOT, _ROUTE, _TARGET = 1.0, 2.0, 3.0, 200.0
_COVERED = 150.0


class LoupeCorner:
    """Leaves a corner at once when the head comes near, and for a much better one only after a second: it must not jump about."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._corner: int | None = None
        self._better_since_s: float | None = None

    def choose(
        self,
        corners: Sequence[QRectF],
        head: QPointF,
        places: Points,
        weights: NDArray[np.float64],
        covers: Sequence[QRectF] = (),
    ) -> int:
        """Which of `corners`.

        Parameters
        ----------
        corners : where the loupe would lie, on the view.
        head : where the robot's head is.
        places : (N, 2) what there is to see, also beyond the view.
        weights : (N,) how much each place matters.
        covers : what lies over the loupe.
        """
        hidden = [
            float(weights[_within(corner, places)].sum()) + _COVERED * any(corner.intersects(cover) for cover in covers)
            for corner in corners
        ]
        free = [k for k, corner in enumerate(corners) if not _grown(corner, _CLEAR_PX).contains(head)]
        best = min(free or range(len(corners)), key=lambda k: hidden[k])
        now = self._corner
        if now is None or now >= len(corners) or (free and _grown(corners[now], _NEAR_PX).contains(head)):
            self._move(best)
        elif hidden[now] - hidden[best] > max(_MUCH, _SHARE * hidden[now]):
            self._better_since_s = self._clock() if self._better_since_s is None else self._better_since_s
            if self._clock() - self._better_since_s >= _SETTLE_S:
                self._move(best)
        else:
            self._better_since_s = None
        assert self._corner is not None
        return self._corner

    def _move(self, corner: int) -> None:
        self._corner, self._better_since_s = corner, None


def seen_places(shapes: SceneShapes | None, target: Point | None) -> tuple[Points, NDArray[np.float64]]:
    """What there is to see in a picture: places (N, 2) in source pixels, and how much each matters (N,)."""
    parts: list[tuple[Points, float]] = []
    if shapes is not None:
        parts += [(line, _VESSEL) for line in shapes.vessel_lines]
        parts += [(line, _ROBOT) for line in (shapes.robot_line,) if line is not None]
        parts += [(line, _ROUTE) for line in (shapes.route, shapes.ghost) if line is not None]
    if target is not None:
        parts.append((np.array([target], np.float64), _TARGET))
    if not parts:
        return np.empty((0, 2)), np.empty(0)
    return np.concatenate([line for line, _ in parts]), np.concatenate([np.full(len(line), weight) for line, weight in parts])


def _within(rect: QRectF, places: Points) -> NDArray[np.bool_]:
    x, y = places[:, 0], places[:, 1]
    return np.asarray((x > rect.left()) & (x < rect.right()) & (y > rect.top()) & (y < rect.bottom()))


def _grown(rect: QRectF, by_px: float) -> QRectF:
    return rect.adjusted(-by_px, -by_px, by_px, by_px)
