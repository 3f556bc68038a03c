"""In a stream, the way that was seen to a destination is not undone by a gap in the vessel that comes later."""

from __future__ import annotations

import math

import numpy as np

from core.config import TrackingConfig
from core.perception import polyline
from core.perception.lumen import foot
from core.types import Mask, Point, Points, Route

_STEP_PX = 1.0


class RouteMemory:
    """The last route that was found, for as long as the destination stays the same.

    The phantom stands still, but a fitting or a reflection can cut the mask of the vessel in two, in one frame and not in the next.
    The route of before then still holds if the head is beside it and, but for a short gap, the vessel is still where it leads.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._route: Route | None = None
        self._seen_s = -math.inf

    def forget(self) -> None:
        """Another stream, or no destination any more."""
        self._route = None

    def follow(self, found: Route | str, head: Point, target: Point, vessel: Mask, captured_s: float) -> Route | str:
        """The route that was found, or what is left of the one remembered, or why there is none.

        `found` is what ``route_or_reason`` says of this frame, `vessel` the mask (h, w), all in working px.
        """
        left = self._left(head, target, vessel)
        if not isinstance(found, Route):
            return left or found
        # Round a loop there is another way when this one is cut: a detour of a moment is not taken.
        is_detour = left is not None and found.length_px > left.length_px + self._config.route_gap_px
        if left is not None and is_detour and 0.0 <= captured_s - self._seen_s <= self._config.memory_s:
            return left
        self._route, self._seen_s = found, captured_s
        return found

    def _left(self, head: Point, target: Point, vessel: Mask) -> Route | None:
        """What is left of the route remembered, if it still holds."""
        known = self._route
        if known is None or known.target != target:
            self._route = None
            return None
        beside = foot(known.points, head, vessel)
        if beside is None:
            return None
        away_px, position, _ = beside
        rest = polyline.cut(known.points, position, math.inf)
        if away_px > self._config.route_reach_px or _outside_px(rest, vessel) > self._config.route_gap_px:
            return None
        distinct = np.concatenate([[True], np.any(np.diff(rest, axis=0) != 0.0, axis=1)])
        return Route(rest[distinct], float(polyline.arc_length(rest)[-1]), target)


def _outside_px(points: Points, vessel: Mask) -> float:
    """Length of a line that lies outside a mask."""
    line = np.rint(polyline.resample(points, _STEP_PX)).astype(int)
    height, width = vessel.shape
    within = (line[:, 0] >= 0) & (line[:, 0] < width) & (line[:, 1] >= 0) & (line[:, 1] < height)
    inside = vessel[line[within, 1], line[within, 0]]
    return _STEP_PX * float(len(line) - np.count_nonzero(inside))
