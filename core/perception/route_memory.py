"""In a stream, the way that was seen to a destination is not undone by a gap in the vessel that comes later."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from core.config import TrackingConfig
from core.perception import polyline
from core.perception.lumen import foot
from core.types import Mask, Point, Points, Route

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
        along = polyline.arc_length(one.points)
        places = polyline.resample(other.points, _ALIKE_STEP_PX).tolist()
        return all(polyline.nearest(one.points, (x, y), along)[0] <= self._config.route_reach_px for x, y in places)

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
