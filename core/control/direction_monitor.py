"""Whether the robot goes where the program steers it: turn and feed that were sent against those that the camera sees. Pure.

In a vessel the head does not simply turn as it is bent: a wall holds or turns it, a bend that is fed forward turns it on, and
where the vessel turns away, theta grows without a turn of the head. So a turn counts as wrong where the head turned against the
command in the picture and also against the vessel's direction, or did not follow a large command there, beyond what feeding a
bent head and the poses' noise explain. A head that springs free turns by what was commanded before and had no effect: that is no
wrong turn either. The same holds for the way of the robot against the feed: the way of its tail along itself and the change of its
length, so neither a head that straightens nor a tail that is covered is a way, and all of the robot may be in the picture. Robots
wired right stay far below the limits, swapped tendons and a reversed feed reach them within a second.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import add, sub
from statistics import fmean, median

from core.control.faults import Cause, Fault
from core.geometry import arc_length
from core.messages import message
from core.perception.vectors import fit_robot_vector
from core.types import Point, Scene

WRONG_TURN_DEG = 4.0
"""Turn against the command that disarms."""
WRONG_FEED_MM, FIRST_WRONG_FEED_MM = 1.5, 0.7
"""Way against the feed that disarms, and until the head was seen to follow; where it turns first it is fed by 1 mm/s alone then."""
_LINE_PX = 32.0
"""End of the robot whose direction is compared: the 40 px of theta turn by half of what the tip does, 16 px are not steady."""
_WINDOW_S, _DENSE_S, _APART_S = 4.0, 0.3, 0.12
"""Longest time over which a turn or a way is compared; the time in which every frame is kept, and the distance of those before."""
_KEPT_S = 5.0
"""Commands are kept for so long: longer than poses, which follow them late."""
_LAGS_S = (0.0, 0.12, 0.25)
"""Times from a command to its motion, shortest to longest: the command must have had one direction at all of them."""
_BENDING_MM = 15.0
"""Fed by so much, a bent head turns on by as much as it is bent: the length of its bending part, at least."""
_FOLLOWED, _FOLLOWED_LEAST = 1.5, (0.5, 0.5, 0.1)
"""Heading (deg), theta (deg) and way (mm) are followed from frame to frame by so many times the commanded motion and so much more:
a pose that flickers hardly moves them."""
_JUMP_MM, _JUMP_S = 1.0, 0.15
"""By so much further from one frame to the next than it is fed, robots do not go: it was covered, or tail and head mistaken. Such
a pose is left out, since a head that flickers comes back, perhaps in two steps; after so long it is kept, and ways begin again."""
_RIGHT_TURN_DEG, _RIGHT_FEED_MM = 3.0, 1.0
"""Motion with the command that shows its direction to be right."""
_ENOUGH_DEG, _ENOUGH_MM, _LITTLE_DEG, _LITTLE_MM = 10.0, 3.0, 1.0, 0.4
"""A command of so much without more than so little motion against it: the head is held, and not driven the wrong way."""
_NOISE_DEG, _NOISE_MM = 1.28, 1.51
"""Per mean, or median, amount of the poses' second difference so much counts as no motion: 2.5 standard deviations of normal noise,
of which that is sqrt(6) sqrt(2 / pi), or sqrt(6) 0.6745. A steady motion has none of it, a flicker now and then no median."""
_GAP_S = 0.3
"""A longer pause of commands or poses begins another comparison."""


@dataclass(frozen=True, slots=True)
class HeadSeen:
    """The head in one frame; angles positive to the right, as on screen.

    Attributes
    ----------
    heading_deg, theta_deg : direction in the picture, and against the vessel's.
    length_mm : of the robot in the picture.
    tail_mm, tail_along : of the robot's tail: place in the picture, and unit vector along the robot, to the head.
    """

    captured_s: float
    heading_deg: float
    theta_deg: float
    length_mm: float
    tail_mm: Point
    tail_along: Point


@dataclass(frozen=True, slots=True)
class MotionSent:
    """What left the gate for the program: the turn of the head that the bend means, and the feed."""

    time_s: float
    turn_deg: float
    advance_mm_s: float


def head_seen(scene: Scene, pixels_per_mm: float) -> HeadSeen | None:
    """The head of a scene; None without a pose."""
    if scene.pose is None or scene.path is None or scene.vessel_vector is None:
        return None
    points = scene.path.points
    head, tail = fit_robot_vector(points, _LINE_PX), fit_robot_vector(points[::-1], _LINE_PX)
    if head is None or tail is None:
        return None
    heading_deg, vessel_deg = (math.degrees(math.atan2(y, x)) for x, y in (head.direction, scene.vessel_vector.direction))
    length_mm = float(arc_length(points)[-1]) / pixels_per_mm
    tail_mm = float(points[0, 0]) / pixels_per_mm, float(points[0, 1]) / pixels_per_mm
    along = -tail.direction[0], -tail.direction[1]
    return HeadSeen(scene.captured_s, heading_deg, _wrapped(heading_deg - vessel_deg), length_mm, tail_mm, along)


@dataclass(frozen=True, slots=True)
class _Sent:
    """A command: turn, and since the beginning the way fed and the turn that feeding a bent head makes."""

    time_s: float
    advance_mm_s: float
    turn_deg: float
    fed_mm: float = 0.0
    drift_deg: float = 0.0


_Motion = tuple[float, float, float]
"""Heading (deg), theta (deg), and way (mm)."""
_STILL: _Motion = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class _Seen:
    """The head since the beginning, and what was commanded then, by each lag.

    Attributes
    ----------
    raw, moved : the motion as seen, and as followed.
    step, change : since the frame before, as seen, and the amount by which it differs from the step before.
    run : number of jumps before; ways are compared between two of them only.
    """

    head: HeadSeen
    sent: tuple[_Sent, ...]
    raw: _Motion = _STILL
    moved: _Motion = _STILL
    step: _Motion = _STILL
    change: _Motion = _STILL
    run: int = 0

    @property
    def ahead_deg(self) -> float:
        """By how much the commanded turn is ahead of the head's: this may spring free later."""
        return self.sent[0].turn_deg - self.moved[0]

    @property
    def ahead_mm(self) -> float:
        return self.sent[0].fed_mm - self.moved[2]


@dataclass(frozen=True, slots=True)
class DirectionMonitor:
    """Commands and poses of the last moments.

    Attributes
    ----------
    wrong_turn_deg, wrong_feed_mm : the largest motion against the command as of the newest frame; positive.
    commanded : the turn (deg) and the way (mm) of that command, with sign.
    turns, feeds : the head was seen to follow, or was held: until then the program goes slowly.
    """

    sent: tuple[_Sent, ...] = ()
    seen: tuple[_Seen, ...] = ()
    wrong_turn_deg: float = 0.0
    wrong_feed_mm: float = 0.0
    commanded: tuple[float, float] = (0.0, 0.0)
    turns: bool = False
    feeds: bool = False

    def drive(self, motion: MotionSent) -> DirectionMonitor:
        """The state after a command was sent."""
        before = self.sent[-1] if self.sent else None
        if before is None or not 0.0 <= motion.time_s - before.time_s <= _GAP_S:
            return replace(self, sent=(_Sent(motion.time_s, motion.advance_mm_s, motion.turn_deg),), seen=())
        way_mm = before.advance_mm_s * (motion.time_s - before.time_s)
        now = _Sent(
            motion.time_s,
            motion.advance_mm_s,
            motion.turn_deg,
            before.fed_mm + way_mm,
            before.drift_deg + before.turn_deg * way_mm / _BENDING_MM,
        )
        return replace(self, sent=(*(one for one in self.sent if one.time_s >= motion.time_s - _KEPT_S), now))

    def observe(self, head: HeadSeen) -> DirectionMonitor:
        """The state after a frame with a pose; poses before the first command say nothing."""
        if not self.sent or head.captured_s < self.sent[0].time_s:
            return self
        last = self.seen[-1].head if self.seen else head
        is_next = 0.0 <= head.captured_s - last.captured_s <= _GAP_S
        kept = _kept(self.seen, head.captured_s) if is_next else ()
        # until the longest lag has passed, what was commanded before the first command may act: that motion does not count
        is_early = head.captured_s < self.sent[0].time_s + _LAGS_S[-1]
        now = _next(() if is_early else kept, head, tuple(_at(self.sent, head.captured_s - lag_s) for lag_s in _LAGS_S))
        return self if now is None else replace(self, seen=(*kept, now))._compared(kept, now)

    def _compared(self, earlier: tuple[_Seen, ...], now: _Seen) -> DirectionMonitor:
        noise_deg, noise_mm = _NOISE_DEG * fmean(one.change[0] for one in (*earlier, now)), _noise_mm((*earlier, now))
        wrong_deg = wrong_mm = turn_deg = fed_mm = 0.0
        turns, feeds = self.turns, self.feeds
        for then in earlier:
            heading_deg, theta_deg, way_mm = _each(sub, now.moved, then.moved)
            asked = _common([a.turn_deg - b.turn_deg for a, b in zip(now.sent, then.sent, strict=True)])
            sign = math.copysign(1.0, asked)
            turned = sign * heading_deg, sign * theta_deg
            drifts = [sign * (a.drift_deg - b.drift_deg) for a, b in zip(now.sent, then.sent, strict=True)]
            # bent by so much, a robot that is wired right is turned on by a wall only where theta follows the bend
            is_deaf = abs(asked) >= _ENOUGH_DEG and turned[1] <= _LITTLE_DEG
            back = -turned[0] if is_deaf else -max(turned)
            springs = max(0.0, sign * (earlier[0].ahead_deg - then.ahead_deg))
            against = min(back - max(0.0, -min(drifts)) - springs - noise_deg, abs(asked))
            followed = min(min(turned) - max(0.0, *drifts) - noise_deg, abs(asked))
            is_held = abs(asked) >= _ENOUGH_DEG and -min(turned) <= _LITTLE_DEG
            turns = turns or is_held or followed >= _RIGHT_TURN_DEG
            if against > wrong_deg:
                wrong_deg, turn_deg = against, asked
            if then.run != now.run:
                continue
            asked = _common([a.fed_mm - b.fed_mm for a, b in zip(now.sent, then.sent, strict=True)])
            sign = math.copysign(1.0, asked)
            gone = sign * way_mm
            springs = max(0.0, sign * (earlier[0].ahead_mm - then.ahead_mm))
            against = min(-gone - springs - noise_mm, abs(asked))
            is_held = abs(asked) >= _ENOUGH_MM and noise_mm - gone <= _LITTLE_MM
            feeds = feeds or is_held or min(gone - noise_mm, abs(asked)) >= _RIGHT_FEED_MM
            if against > wrong_mm:
                wrong_mm, fed_mm = against, asked
        return replace(
            self, wrong_turn_deg=wrong_deg, wrong_feed_mm=wrong_mm, commanded=(turn_deg, fed_mm), turns=turns, feeds=feeds
        )

    def faults(self) -> list[Fault]:
        """The active faults."""
        found = []
        if self.wrong_turn_deg >= WRONG_TURN_DEG:
            side = "right" if self.commanded[0] > 0.0 else "left"
            detail = message(
                "{a:.0f}° against a bend of {b:.0f}° to the {side}", a=self.wrong_turn_deg, b=abs(self.commanded[0]), side=side
            )
            found.append(Fault(Cause.WRONG_TURN, detail))
        if self.wrong_feed_mm >= (WRONG_FEED_MM if self.feeds else FIRST_WRONG_FEED_MM):
            detail = message("{a:.1f} mm against a feed of {b:+.1f} mm", a=self.wrong_feed_mm, b=self.commanded[1])
            found.append(Fault(Cause.WRONG_FEED, detail))
        return found


def _kept(seen: tuple[_Seen, ...], now_s: float) -> tuple[_Seen, ...]:
    """The frames of the window, the older ones thinned out."""
    kept: list[_Seen] = []
    for one in seen:
        age_s = now_s - one.head.captured_s
        is_apart = not kept or one.head.captured_s - kept[-1].head.captured_s >= _APART_S
        if age_s <= _WINDOW_S and (age_s <= _DENSE_S or is_apart):
            kept.append(one)
    return tuple(kept)


def _next(earlier: tuple[_Seen, ...], head: HeadSeen, sent: tuple[_Sent, ...]) -> _Seen | None:
    """The head after `earlier`; None: it seems to have jumped, and may come back."""
    if not earlier:
        return _Seen(head, sent)
    before = earlier[-1]
    turned_deg = max(abs(a.turn_deg - b.turn_deg) for a, b in zip(sent, before.sent, strict=True))
    fed_mm = max(abs(a.fed_mm - b.fed_mm) for a, b in zip(sent, before.sent, strict=True))
    most = _each(lambda least, commanded: least + _FOLLOWED * commanded, _FOLLOWED_LEAST, (turned_deg, turned_deg, fed_mm))
    step, run = _step(before.head, head), before.run
    if abs(step[2]) > _JUMP_MM + fed_mm + _noise_mm(earlier):
        if head.captured_s - before.head.captured_s < _JUMP_S:
            return None
        step = _each(lambda by, limit: by if abs(by) <= limit else 0.0, step, (*most[:2], -math.inf))
        run += 1
    raw = _each(add, before.raw, step)
    by = _each(lambda way, limit: max(-limit, min(limit, way)), _each(sub, raw, before.moved), most)
    return _Seen(head, sent, raw, _each(add, before.moved, by), step, _each(lambda a, b: abs(a - b), step, before.step), run)


def _each(function: Callable[[float, float], float], one: _Motion, other: _Motion) -> _Motion:
    """A function of each of three pairs of numbers."""
    return function(one[0], other[0]), function(one[1], other[1]), function(one[2], other[2])


def _step(before: HeadSeen, now: HeadSeen) -> _Motion:
    """The motion from one frame to the next."""
    x, y = (a - b for a, b in zip(now.tail_mm, before.tail_mm, strict=True))
    way_mm = now.length_mm - before.length_mm + x * now.tail_along[0] + y * now.tail_along[1]
    return _wrapped(now.heading_deg - before.heading_deg), _wrapped(now.theta_deg - before.theta_deg), way_mm


def _noise_mm(seen: Sequence[_Seen]) -> float:
    """What the noise of the poses alone may make a way seem to be."""
    return _NOISE_MM * median(one.change[2] for one in seen)


def _at(sent: tuple[_Sent, ...], time_s: float) -> _Sent:
    """What was commanded at a moment, between two commands in proportion."""
    place = bisect_right(sent, time_s, key=lambda one: one.time_s)
    if place == 0 or place == len(sent):
        return sent[min(place, len(sent) - 1)]
    one, other = sent[place - 1], sent[place]
    share = (time_s - one.time_s) / (other.time_s - one.time_s)
    return replace(
        one,
        turn_deg=one.turn_deg + share * (other.turn_deg - one.turn_deg),
        fed_mm=one.fed_mm + share * (other.fed_mm - one.fed_mm),
        drift_deg=one.drift_deg + share * (other.drift_deg - one.drift_deg),
    )


def _common(changes: list[float]) -> float:
    """The smallest of changes in one direction; 0 where they differ in it."""
    least = min(changes, key=abs)
    return least if all(change * least > 0.0 for change in changes) else 0.0


def _wrapped(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0
