"""Pure pursuit along the route, slow before bends and bifurcations.

Everything is taken from the picture: the head and its direction from the robot's path, the way from the operator's route or,
without one, from the centerline's piece. It backs off when the way to the target leads backwards, a missed branch, and when the
robot is fed but its head does not move; after a few of either it stops and says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from core.config.models import AdviceConfig, PursuitConfig
from core.control.joints import limited
from core.control.look_ahead import SHARP_MM, LookAhead, look_ahead, sharp_branches
from core.messages import message
from core.types import Advice, Point, RobotStatus, Scene, Speed

_LONGEST_S = 0.15
"""A frame counts for no longer than this, so that after a pause no single one decides."""
_PAUSE_S = 0.5
"""A longer pause between frames resets the stall monitor."""
_UNFOLLOWED_S = 1.0
"""An operator who does not take the robot back for so long has other plans; if the reason is gone, the advice is, too."""


class Pursuit:
    """Pure pursuit with smoothed steering, which backs off from missed branches and where the head does not move."""

    def __init__(self, config: PursuitConfig, advice: AdviceConfig, bend_deg: float = 94.0) -> None:
        self._config = config
        self._words = advice
        self._bend_deg = bend_deg
        self.reset()

    def reset(self) -> None:
        """Forget the frames before."""
        self._speed_mm_s = 0.0
        self._steer_deg = self._error_deg = 0.0
        self._last_s: float | None = None
        self._behind_s = self._by_hand_s = 0.0
        self._feed = FeedMonitor()
        self._stall = StallMonitor(self._config)
        self._misses, self._stalls = TryCounter(), TryCounter()
        self._back_off: BackOff | None = None
        self._is_miss_counted = False

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        """Advice for a scene; `status` adds the measured feed. None when there is no pose.

        Only a robot that is `followed`, driven by this advice, is concluded to be stranded.
        """
        config = self._config
        ahead_px = config.look_ahead_px + config.look_ahead_s * max(0.0, self._speed_mm_s) * config.pixels_per_mm
        # a missed branch was turned into too late: each new try begins to turn earlier
        way = look_ahead(scene, ahead_px, config, self._misses.count * config.rounding_px)
        if way is None:
            return None
        since_s = 0.0 if self._last_s is None else max(0.0, scene.captured_s - self._last_s)
        self._last_s = scene.captured_s
        elapsed_s = min(since_s, _LONGEST_S)
        if since_s > _PAUSE_S:
            self._stall.reset()
            self._behind_s = 0.0
        # counted down, not reset: where head and branch lie in a wide bifurcation, single frames still see the way ahead
        self._behind_s = max(0.0, self._behind_s + (elapsed_s if way.behind else -elapsed_s))
        self._is_miss_counted = self._is_miss_counted and self._behind_s > 0.0
        keep = math.exp(-since_s / config.smoothing_s) if config.smoothing_s > 0.0 and since_s > 0.0 else 0.0
        self._error_deg = keep * self._error_deg + (1.0 - keep) * way.error_deg
        self._steer_deg = limited(config.gain * self._error_deg, self._words.max_steer_deg)
        fed_mm_s, fed_mm = self._feed.update(status, self._speed_mm_s, elapsed_s)
        stuck = self._stall.update(way.left_px, way.head, fed_mm_s, elapsed_s)
        if self._back_off is not None:
            self._back_off.update(way.behind, fed_mm_s, fed_mm, elapsed_s, followed)
        return (
            self._backing_advice(way, stuck)
            or self._give_up_advice(way, elapsed_s if fed_mm_s else 0.0)
            or self._forward_advice(way, scene)
        )

    def _backing_advice(self, way: LookAhead, stuck: bool) -> Advice | None:
        """Backwards while there is a reason to, which one picture alone never is; None to go on."""
        config, back_off = self._config, self._back_off
        if back_off is not None and (back_off.is_done or (back_off.unfollowed_s > _UNFOLLOWED_S and not way.behind)):
            self._back_off = None
            self._is_miss_counted = self._is_miss_counted and not back_off.is_done
            return None
        if back_off is not None and way.left_px is not None and way.target != back_off.target:
            back_off = None
        if back_off is None and way.behind:
            if self._behind_s < config.behind_s:
                return self._advise(0.0, 0.0, "the way seems to lie behind the head: looking again")
            if not self._is_miss_counted:  # the same miss, whichever source has driven meanwhile
                self._misses.add(way)
            self._is_miss_counted = True
            back_off = BackOff("the way to the target branches off behind the head", config.retry_mm, way.target)
        elif back_off is None and stuck:
            self._stalls.add(way)
            # all that was fed without effect lies bent behind the head
            back_mm = max(config.back_off_mm, self._stall.lost_mm)
            back_off = BackOff("the robot is fed but its head does not move", back_mm, way.target)
        self._back_off = back_off
        if back_off is None:
            return None
        if back_off.is_stranded:
            return self._advise(0.0, 0.0, "the robot cannot go back any farther: take over, or choose another target")
        # the way back is free, since the head follows its own body: going slow would only let the body lean longer
        return self._advise(
            -self._words.fast_mm_s, 0.0 if way.behind else self._steer_deg, message("backing off: {why}", why=back_off.why)
        )

    def _give_up_advice(self, way: LookAhead, moved_s: float) -> Advice | None:
        """Stop after too many misses or tries, until the operator has gone on by hand; `moved_s`: of this frame's time."""
        if (count := self._misses.count_at(way)) >= self._config.most_misses:
            why = message("missed the branch {a} times: take over, or choose another target", a=count)
        elif (count := self._stalls.count_at(way)) >= self._config.most_tries:
            why = message("came no farther in {a} tries: take over, or choose another target", a=count)
        else:
            return None
        self._by_hand_s = self._by_hand_s + moved_s if moved_s else 0.0
        if self._by_hand_s <= _UNFOLLOWED_S:
            return self._advise(0.0, 0.0, why)
        self._misses.count, self._stalls.count, self._by_hand_s = 0, 0, 0.0
        return None

    def _forward_advice(self, way: LookAhead, scene: Scene) -> Advice:
        config, words = self._config, self._words
        limits = [(words.fast_mm_s, "along the route")]
        if way.turn_deg > config.gentle_turn_deg:
            limits.append((words.fast_mm_s * config.gentle_turn_deg / way.turn_deg, "a bend ahead"))
        if way.junction_px is not None:
            limits.append((words.moderate_mm_s, "a bifurcation ahead"))
        if (error_deg := abs(self._error_deg)) > config.slow_steer_deg:
            # no step where it begins: an error that trembles about the limit must not make the feed stutter
            share = (config.slow_steer_deg / error_deg) ** 2
            limits.append((max(words.slowest_mm_s, words.fast_mm_s * share), "the head must turn first"))
        if way.left_px is not None and way.left_px < config.brake_px:
            limits.append((max(words.slowest_mm_s, words.fast_mm_s * way.left_px / config.brake_px), "the target is near"))
        speed_mm_s, why = min(limits)
        graph, path, px = scene.vessel_graph, scene.path, config.pixels_per_mm
        if way.left_px and graph and path and sharp_branches(graph, way.points, path.radius_px, self._bend_deg, SHARP_MM, px):
            why = message("{why}; a branch ahead may turn more sharply than the head bends", why=why)
        return self._advise(speed_mm_s, self._steer_deg, why)

    def _advise(self, speed_mm_s: float, steer_deg: float, why: str) -> Advice:
        self._speed_mm_s = speed_mm_s
        return Advice(speed_word(abs(speed_mm_s), self._words), speed_mm_s, steer_deg, why)


_MOST_BACK_MM = 60.0
"""Longest way back from a missed branch."""
_STRANDED_S = 3.0
"""A robot that is advised to go back for so long and does not move cannot: the feed is at the end of its travel, say."""


@dataclass(slots=True)
class BackOff:
    """A way back of ``distance_mm``, counted from where the ``target`` does not lie behind the head any more."""

    why: str
    distance_mm: float
    target: Point | None
    unfollowed_s: float = field(default=0.0, init=False)
    _cleared_mm: float = field(default=0.0, init=False)
    _moved_mm: float = field(default=0.0, init=False)
    _still_s: float = field(default=0.0, init=False)

    def update(self, behind: bool, fed_mm_s: float, fed_mm: float, elapsed_s: float, followed: bool) -> None:
        """Update with a frame."""
        back_mm = max(0.0, -fed_mm)
        self._moved_mm += back_mm
        self._cleared_mm = 0.0 if behind else self._cleared_mm + back_mm
        self.unfollowed_s = self.unfollowed_s + elapsed_s if fed_mm_s >= 0.0 else 0.0
        if fed_mm_s or not behind:
            self._still_s = 0.0
        elif followed:
            self._still_s += elapsed_s

    @property
    def is_done(self) -> bool:
        """Whether it has gone far enough."""
        return self._cleared_mm >= self.distance_mm or self._moved_mm >= _MOST_BACK_MM

    @property
    def is_stranded(self) -> bool:
        """Whether the robot does not go back, though it is driven."""
        return self._still_s > _STRANDED_S


_STILL_MM_S = 0.3
"""Servos at rest measure a little motion, too."""
_STATUS_GAP_S = 0.5
"""What happened between two statuses further apart is not known."""
_SHORTEST_S = 0.02
"""Frames and statuses come no faster than this: two that do are one moment, and a way divided by it would be a wild speed."""


class FeedMonitor:
    """Measures the feed between two statuses of the robot, by their own times.

    Frames and statuses do not come in step. A frame that finds the status of the one before has no new information on the feed;
    taken for a rest, it would hide that a robot is fed and does not move.
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


_REST_S = 0.3
"""A robot that is not fed for so long rests; a shorter pause is one of the measurement."""


class StallMonitor:
    """Detects that the robot is fed but neither the way left shrinks nor the head moves.

    Both: where the way bends sharply a head slides sideways before it goes on, and one that shakes against a wall does not move on.
    ``lost_mm`` is what was fed without effect at the last stall.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._rested_s = 0.0
        self._blind_s = 0.0
        self.lost_mm = 0.0
        self.reset()

    def reset(self) -> None:
        """Begin with the next frame."""
        self._start: tuple[float, Point] | None = None
        self._fed_mm = self._watched_s = 0.0

    def update(self, left_px: float | None, head: Point, speed_mm_s: float, elapsed_s: float) -> bool:
        """Update with a frame; True when there was no progress for the configured time.

        Without a target, or a way to it, it cannot tell; a frame or two in which the way was not found change nothing.
        """
        self._rested_s = 0.0 if speed_mm_s else self._rested_s + elapsed_s
        self._blind_s = 0.0 if left_px is not None else self._blind_s + elapsed_s
        if speed_mm_s < 0.0 or max(self._rested_s, self._blind_s) >= _REST_S:
            self.reset()
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
        self.reset()
        self._start = left_px, head
        return stuck


_SAME_PLACE_PX = 100.0
"""Of the way left, which jumps by the lumen's width where the head changes from one branch's centerline to the other's."""


class TryCounter:
    """Counts what failed at the same place of the way to the same target: a head that cannot bend or go on so far never could."""

    def __init__(self) -> None:
        self.count = 0
        self._left_px = 0.0
        self._target: Point | None = None

    def add(self, way: LookAhead) -> None:
        """It failed once more."""
        self.count = self.count_at(way) + 1
        self._left_px, self._target = way.left_px or 0.0, way.target

    def count_at(self, way: LookAhead) -> int:
        """How often it failed here; another target or place resets the count, a frame without a way does not."""
        if way.left_px is not None and (way.target != self._target or abs(way.left_px - self._left_px) > _SAME_PLACE_PX):
            self.count = 0
        return self.count


def speed_word(speed_mm_s: float, config: AdviceConfig) -> Speed:
    """The paper's word nearest to a speed; STOP for zero."""
    if speed_mm_s == 0.0:
        return Speed.STOP
    words = {
        Speed.SLOWEST: config.slowest_mm_s,
        Speed.SLOW: config.slow_mm_s,
        Speed.MODERATE: config.moderate_mm_s,
        Speed.FAST: config.fast_mm_s,
    }
    return min(words, key=lambda word: abs(words[word] - speed_mm_s))
