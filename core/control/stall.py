"""Does the head move as it is fed, how hard does it press, how far is it to be taken back? Small memories of the pursuit policy."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from core.control.way import Way
from core.policy_config import PursuitConfig
from core.types import Point, RobotStatus

_FAR_MM = 60.0
"""Farther than this the robot is not taken back for a branch that it missed."""
_RAISE = 1.25
_FORGET_PX = 60.0
_STILL_MM_S = 0.3
"""Servos at rest measure a little motion, too."""
_STATUS_GAP_S = 0.5
"""What happened between two statuses farther apart is not known."""
_SHORTEST_S = 0.02
"""Frames and statuses come no faster than this: two that do are one moment, and a way divided by it would be a wild speed."""
_REST_S = 0.3
"""Who is not fed for so long rests; a shorter pause is one of the measurement."""
_FARTHER_PX = 6.0
_SAME_BRANCH_PX = 100.0
"""The way left jumps by the lumen's width where the head changes from one branch's centerline to the other's."""


class Lean:
    """Tells a head that meets the wall from a body that leans on it.

    The longer a body lies in a winding vessel, the harder it leans on the wall, at any speed: going slow because of that only makes
    it lean longer. What matters is a force that *rises* faster than the body's own, which the average over the way fed follows.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._lean_n: float | None = None

    def rises(self, contact_n: float | None, fed_mm: float) -> bool:
        """Take in one frame, `fed_mm` after the last; `contact_n` is None where the rig does not know it."""
        if contact_n is None:
            return False
        before_n = contact_n if self._lean_n is None else self._lean_n
        self._lean_n = contact_n + (before_n - contact_n) * math.exp(-abs(fed_mm) / self._config.lean_mm)
        return contact_n > self._lean_n + self._config.contact_slow_n


class ContactLimit:
    """The contact force above which the robot backs off, if it still rises.

    A long body in a winding vessel leans on the wall wherever its head is: backing off would not get it out of there. Where a force
    rises again and again at the same place, each back-off raises the limit a little, up to the hard one, which always counts, until
    the head has come well past that place.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._limit_n = config.contact_back_off_n
        self._raised_at_px: float | None = None

    def exceeded(self, contact_n: float | None, rises: bool, left_px: float | None) -> bool:
        """Whether to back off; `contact_n` is None where the rig does not know it, ``rises`` is what ``Lean`` says of it."""
        if self._raised_at_px is not None and left_px is not None and left_px < self._raised_at_px - _FORGET_PX:
            self._limit_n, self._raised_at_px = self._config.contact_back_off_n, None
        if contact_n is None or contact_n <= self._limit_n or not (rises or contact_n > self._config.contact_limit_n):
            return False
        self._limit_n = min(_RAISE * max(contact_n, self._limit_n), self._config.contact_limit_n)
        self._raised_at_px = left_px
        return True


class Feed:
    """How fast the robot is fed, and how far since the last frame: measured between two of its statuses, by their own times.

    Frames and statuses do not come in step. A frame that finds the status of the one before knows nothing new of the feed; taken
    for a rest, it would hide for ever that a robot is fed and does not move.
    """

    def __init__(self) -> None:
        self._known: tuple[float, float] | None = None
        self._speed_mm_s = 0.0
        self._silent_s = 0.0

    def update(self, status: RobotStatus | None, advised_mm_s: float, elapsed_s: float) -> tuple[float, float]:
        """Speed in mm/s and way in mm since the frame before, `elapsed_s` ago; as advised where nothing is measured."""
        if status is None:
            self._known = None
            return advised_mm_s, advised_mm_s * elapsed_s
        before, self._known = self._known, (status.time_s, status.insertion_mm)
        since_s, fed_mm = (0.0, 0.0) if before is None else (status.time_s - before[0], status.insertion_mm - before[1])
        if since_s == 0.0 and fed_mm:
            since_s = max(elapsed_s, _SHORTEST_S)  # of several servos one was late, and its time is that of all
        self._silent_s = self._silent_s + elapsed_s if since_s == 0.0 else 0.0
        if not 0.0 <= since_s <= _STATUS_GAP_S or self._silent_s > _STATUS_GAP_S:
            self._speed_mm_s = 0.0
            return 0.0, 0.0
        if since_s == 0.0:
            return self._speed_mm_s, 0.0
        self._speed_mm_s = fed_mm / since_s if abs(fed_mm) > _STILL_MM_S * since_s else 0.0
        return self._speed_mm_s, fed_mm if self._speed_mm_s else 0.0


class Stall:
    """Notices that the robot is fed but neither the way left shrinks nor the head moves.

    Both: where the way bends sharply a head slides sideways before it goes on, and one that shakes against a wall does not move on.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._start: tuple[float, Point] | None = None
        self._fed_mm = 0.0
        self._watched_s = 0.0
        self._rested_s = 0.0
        self._blind_s = 0.0
        self.lost_mm = 0.0
        """What was fed in vain when it was last told."""

    def update(self, left_px: float | None, head: Point, speed_mm_s: float, elapsed_s: float) -> bool:
        """Take in one frame; True when there was no progress for the configured time.

        Without a target, or a way to it, it cannot tell; a frame or two in which the way was not found change nothing.
        """
        self._rested_s = 0.0 if speed_mm_s else self._rested_s + elapsed_s
        self._blind_s = 0.0 if left_px is not None else self._blind_s + elapsed_s
        if speed_mm_s < 0.0 or max(self._rested_s, self._blind_s) >= _REST_S:
            self.forget()
            return False
        if self._start is None:
            if speed_mm_s and left_px is not None:
                self._start = left_px, head
            return False
        self._fed_mm += speed_mm_s * elapsed_s
        self._watched_s += elapsed_s
        if self._watched_s < self._config.stuck_s or left_px is None:
            return False
        before_px, before = self._start
        self.lost_mm = self._fed_mm
        fed_px = self._fed_mm * self._config.pixels_per_mm
        stuck = max(before_px - left_px, math.dist(before, head)) < self._config.stuck_share * fed_px
        self.forget()
        self._start = left_px, head
        return stuck

    def forget(self) -> None:
        """Watch anew, from the next frame on."""
        self._start, self._fed_mm, self._watched_s = None, 0.0, 0.0


class Tries:
    """How often the robot was taken back without its head having come farther since; feeding on would only press and buckle it.

    Where the head is counts only where it was taken back: there it stood still, and no single frame beside a branch, from where the
    way left seems shorter, hides what it comes farther later. A frame in which no way was found tells nothing.
    """

    def __init__(self) -> None:
        self.count = 0
        self._nearest_px: float | None = None
        self._target: Point | None = None

    def forget(self) -> None:
        """It may be tried again."""
        self.count, self._nearest_px = 0, None

    def see(self, way: Way) -> None:
        """Take in where the robot is to go: for another target it may be tried again."""
        if way.left_px is None:
            return
        if way.target != self._target:
            self.forget()
        self._target = way.target

    def add(self, way: Way) -> None:
        """Taken back once more. Without a way to a target nobody knows whether the head came farther, and nothing is counted."""
        if way.left_px is None:
            return
        if self._nearest_px is None or way.left_px < self._nearest_px - _FARTHER_PX:
            self.count, self._nearest_px = 1, way.left_px
        else:
            self.count += 1


class Misses:
    """How often the same branch was missed for the same target; a head that cannot bend that far would miss it for ever."""

    def __init__(self) -> None:
        self.count = 0
        self._left_px = 0.0
        self._target: Point | None = None

    def forget(self) -> None:
        """It may be tried again."""
        self.count = 0

    def add(self, way: Way) -> None:
        """Missed once more."""
        self._check(way)
        self.count += 1
        self._left_px, self._target = way.left_px or 0.0, way.target

    def at(self, way: Way) -> int:
        """How often the branch here was missed."""
        self._check(way)
        return self.count

    def _check(self, way: Way) -> None:
        if way.left_px is None:
            return  # a frame in which no way was found tells nothing
        if way.target != self._target or abs(way.left_px - self._left_px) > _SAME_BRANCH_PX:
            self.count = 0


@dataclass(slots=True)
class BackOff:
    """A way back of ``distance_mm``, counted from where the reason for it is gone."""

    why: str
    distance_mm: float
    _cleared_mm: float = field(default=0.0, init=False)
    _moved_mm: float = field(default=0.0, init=False)

    def done(self, still: bool, moved_mm: float) -> bool:
        """Whether it has gone far enough; `still`: the reason for it is still there; `moved_mm`: since the last call."""
        self._moved_mm += max(0.0, moved_mm)
        self._cleared_mm = 0.0 if still else self._cleared_mm + max(0.0, moved_mm)
        return self._cleared_mm >= self.distance_mm or self._moved_mm >= _FAR_MM
