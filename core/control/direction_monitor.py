"""Whether the robot goes where the program steers it: turn and feed that were sent against those that the camera sees. Pure.

In a vessel the head does not simply turn as it is bent: a wall holds or turns it, a bend that is fed forward turns it on, and
where the vessel turns away, theta grows without a turn of the head. So a turn counts as wrong where the head turned against the
command in the picture and also against the vessel's direction, or did not follow a large command there, beyond what feeding a
bent head and the poses' noise explain. A head that springs free turns by what was commanded before and had no effect: that is no
wrong turn either. The same holds for the way of the robot against the feed: its length in the picture where it comes in from the
border, which a head that straightens does not change; else the way of the head along itself. Robots wired right stay far below the
limits, swapped tendons and a reversed feed reach them within a second.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from core.control.faults import Cause, Fault
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
_LAGS_S = (0.0, 0.12, 0.25)
"""Times from a command to its motion, shortest to longest: the command must have had one direction at all of them."""
_BENDING_MM = 15.0
"""Fed by so much, a bent head turns on by as much as it is bent: the length of its bending part, at least."""
_FOLLOWED, _FOLLOWED_LEAST = 1.5, (0.5, 0.5, 0.1)
"""Heading (deg), theta (deg) and way (mm) are followed from frame to frame by so many times the commanded motion and so much more:
a pose that flickers hardly moves them."""
_CUT_MM = 2.0
"""A length that changes by so much more than that from one frame to the next is no way: the robot was covered or cut."""
_RIGHT_TURN_DEG, _RIGHT_FEED_MM = 3.0, 1.0
"""Motion with the command that shows its direction to be right."""
_ENOUGH_DEG, _ENOUGH_MM, _LITTLE = 10.0, 3.0, 0.25
"""A command of so much without more than this share of a wrong motion: the head is held, and not driven the wrong way."""
_NOISES = 2.5
"""So many standard deviations of the poses' noise count as no motion."""
_NOISE_OF_CHANGE = 1.0 / (math.sqrt(6.0) * math.sqrt(2.0 / math.pi))
"""Standard deviation of normal noise per mean amount of its second difference; a steady motion has none of it."""
_GAP_S = 0.3
"""A longer pause of commands or poses begins another comparison."""


@dataclass(frozen=True, slots=True)
class HeadSeen:
    """The head in one frame; angles positive to the right, as on screen.

    Attributes
    ----------
    heading_deg, theta_deg : direction in the picture, and against the vessel's.
    place_mm : in the picture.
    length_mm : of the robot in the picture; None where its tail is not where it comes in.
    """

    captured_s: float
    heading_deg: float
    theta_deg: float
    place_mm: Point
    length_mm: float | None = None


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
    line = fit_robot_vector(scene.path.points, _LINE_PX)
    if line is None:
        return None
    heading_deg, vessel_deg = (math.degrees(math.atan2(y, x)) for x, y in (line.direction, scene.vessel_vector.direction))
    place = scene.path.head[0] / pixels_per_mm, scene.path.head[1] / pixels_per_mm
    length_px = float(np.linalg.norm(np.diff(scene.path.points, axis=0), axis=1).sum())
    length_mm = length_px / pixels_per_mm if scene.path.entry_on_border else None
    return HeadSeen(scene.captured_s, heading_deg, _wrapped(heading_deg - vessel_deg), place, length_mm)


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


@dataclass(frozen=True, slots=True)
class _Seen:
    """The head since the beginning, and what was commanded then, by each lag.

    Attributes
    ----------
    raw, moved : the motion as seen, and as followed.
    step, change : since the frame before, as seen, and the amount by which it differs from the step before.
    """

    head: HeadSeen
    turns_deg: tuple[float, ...]
    feds_mm: tuple[float, ...]
    drifts_deg: tuple[float, ...]
    raw: _Motion = (0.0, 0.0, 0.0)
    moved: _Motion = (0.0, 0.0, 0.0)
    step: _Motion = (0.0, 0.0, 0.0)
    change: _Motion = (0.0, 0.0, 0.0)


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
        elapsed_s = motion.time_s - before.time_s if before is not None else 0.0
        if before is None or not 0.0 <= elapsed_s <= _GAP_S:
            return replace(self, sent=(_Sent(motion.time_s, motion.advance_mm_s, motion.turn_deg),), seen=())
        way_mm = before.advance_mm_s * elapsed_s
        now = _Sent(
            motion.time_s,
            motion.advance_mm_s,
            motion.turn_deg,
            before.fed_mm + way_mm,
            before.drift_deg + before.turn_deg * way_mm / _BENDING_MM,
        )
        oldest_s = motion.time_s - _WINDOW_S - _LAGS_S[-1] - _GAP_S
        return replace(self, sent=(*(one for one in self.sent if one.time_s >= oldest_s), now))

    def observe(self, head: HeadSeen) -> DirectionMonitor:
        """The state after a frame with a pose; poses before the first command say nothing."""
        if not self.sent or head.captured_s < self.sent[0].time_s:
            return self
        is_next = bool(self.seen) and 0.0 < head.captured_s - self.seen[-1].head.captured_s <= _GAP_S
        kept = _kept(self.seen, head.captured_s) if is_next else ()
        # what was commanded before the first command may act until the longest lag has passed: that motion is not followed later
        is_early = head.captured_s < self.sent[0].time_s + _LAGS_S[-1]
        now = _next(kept, head, [_at(self.sent, head.captured_s - lag_s) for lag_s in _LAGS_S], is_early)
        return replace(self, seen=(*kept, now))._compared(kept, now)

    def _compared(self, earlier: tuple[_Seen, ...], now: _Seen) -> DirectionMonitor:
        noise_deg, _, noise_mm = (_noise([*earlier, now], which) for which in range(3))
        wrong_deg = wrong_mm = turn_deg = fed_mm = 0.0
        turns, feeds = self.turns, self.feeds
        for then in earlier:
            asked = _common([a - b for a, b in zip(now.turns_deg, then.turns_deg, strict=True)])
            if asked:
                sign = math.copysign(1.0, asked)
                turned = sign * (now.moved[0] - then.moved[0]), sign * (now.moved[1] - then.moved[1])
                drifts = [sign * (a - b) for a, b in zip(now.drifts_deg, then.drifts_deg, strict=True)]
                held = sign * ((then.turns_deg[0] - earlier[0].turns_deg[0]) - (then.moved[0] - earlier[0].moved[0]))
                # bent by so much, a robot that is wired right is turned on by a wall only where theta follows the bend
                is_deaf = abs(asked) >= _ENOUGH_DEG and turned[1] <= _LITTLE * WRONG_TURN_DEG
                back = -turned[0] if is_deaf else -max(turned)
                against = min(back - max(0.0, -min(drifts)) - max(0.0, -held) - noise_deg, abs(asked))
                followed = min(min(turned) - max(0.0, *drifts) - noise_deg, abs(asked))
                is_held = abs(asked) >= _ENOUGH_DEG and -min(turned) <= _LITTLE * WRONG_TURN_DEG
                turns = turns or is_held or followed >= _RIGHT_TURN_DEG
                if against > wrong_deg:
                    wrong_deg, turn_deg = against, asked
            asked = _common([a - b for a, b in zip(now.feds_mm, then.feds_mm, strict=True)])
            if asked:
                sign = math.copysign(1.0, asked)
                gone = sign * (now.moved[2] - then.moved[2])
                held = sign * ((then.feds_mm[0] - earlier[0].feds_mm[0]) - (then.moved[2] - earlier[0].moved[2]))
                against = min(-gone - max(0.0, -held) - noise_mm, abs(asked))
                is_held = abs(asked) >= _ENOUGH_MM and -gone <= _LITTLE * WRONG_FEED_MM
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


def _next(earlier: tuple[_Seen, ...], head: HeadSeen, commands: list[_Sent], is_early: bool) -> _Seen:
    turns_deg = tuple(command.turn_deg for command in commands)
    feds_mm = tuple(command.fed_mm for command in commands)
    now = _Seen(head, turns_deg, feds_mm, tuple(command.drift_deg for command in commands))
    if not earlier:
        return now
    before = earlier[-1]
    turned_deg = max(abs(a - b) for a, b in zip(turns_deg, before.turns_deg, strict=True))
    fed_mm = max(abs(a - b) for a, b in zip(feds_mm, before.feds_mm, strict=True))
    step = _step(before.head, head, _CUT_MM + _FOLLOWED * fed_mm)
    raw = _each(lambda a, b: a + b, before.raw, step)
    most = _each(lambda least, commanded: least + _FOLLOWED * commanded, _FOLLOWED_LEAST, (turned_deg, turned_deg, fed_mm))
    way = _each(lambda to, at: to - at, raw, before.moved)
    moved = _each(lambda at, by: at + by, before.moved, _each(lambda by, limit: max(-limit, min(limit, by)), way, most))
    raw = moved if is_early else raw
    return replace(now, raw=raw, moved=moved, step=step, change=_each(lambda a, b: abs(a - b), step, before.step))


def _each(function: Callable[[float, float], float], one: _Motion, other: _Motion) -> _Motion:
    """A function of each of three pairs of numbers."""
    return function(one[0], other[0]), function(one[1], other[1]), function(one[2], other[2])


def _step(before: HeadSeen, now: HeadSeen, most_mm: float) -> _Motion:
    """The motion from one frame to the next; a length that changes by more than `most_mm` is not used."""
    turned_deg = _wrapped(now.heading_deg - before.heading_deg)
    if before.length_mm is not None and now.length_mm is not None and abs(now.length_mm - before.length_mm) <= most_mm:
        way_mm = now.length_mm - before.length_mm
    else:
        x, y = (a - b for a, b in zip(now.place_mm, before.place_mm, strict=True))
        along = math.radians(before.heading_deg + turned_deg / 2.0)
        way_mm = x * math.cos(along) + y * math.sin(along)
    return turned_deg, _wrapped(now.theta_deg - before.theta_deg), way_mm


def _noise(seen: list[_Seen], which: int) -> float:
    """What the noise of the poses alone may make a motion seem to be."""
    return _NOISES * _NOISE_OF_CHANGE * sum(one.change[which] for one in seen) / len(seen)


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
    if all(change > 0.0 for change in changes):
        return min(changes)
    return max(changes) if all(change < 0.0 for change in changes) else 0.0


def _wrapped(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0
