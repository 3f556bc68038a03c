"""A policy that looks ahead along the route: curvature-limited steering, slow before bends and bifurcations, gentle to the wall.

Everything is taken from the picture: the head and its direction from the robot's path, the way from the operator's route or,
without one, from the centerline's piece. Contact force is used where the rig reports it (the twin does).
"""

from __future__ import annotations

import math

from core.config import AdviceConfig
from core.control.stall import BackOff, ContactLimit, Feed, Lean, Misses, Stall, Tries
from core.control.way import Way, limited, look_ahead
from core.policy_config import PursuitConfig
from core.types import Advice, Point, RobotStatus, Scene, Speed

_UNFOLLOWED_S = 1.0
"""Who does not take the robot back for so long meant something else; if the reason is gone, the advice is, too."""
_STRANDED_S = 3.0
"""Who is advised to go back for so long and does not move at all cannot: the feed is at the end of its travel, say."""
_LONGEST_S = 0.15
"""A frame counts for no longer than this, so that after a pause no single one decides."""
_PAUSE_S = 0.5
"""What was watched before such a pause says nothing of what comes after it."""


class Pursuit:
    """Look-ahead steering with a memory: smoothed steering, and backing off from walls and missed branches until there is room."""

    def __init__(self, config: PursuitConfig, advice: AdviceConfig) -> None:
        self._config = config
        self._words = advice
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self._speed_mm_s = 0.0
        self._steer_deg = 0.0
        self._last_s: float | None = None
        self._stall = Stall(self._config)
        self._contact = ContactLimit(self._config)
        self._lean = Lean(self._config)
        self._misses = Misses()
        self._tries = Tries()
        self._feed = Feed()
        self._back: BackOff | None = None
        self._behind_s = 0.0
        self._unfollowed_s = 0.0
        self._still_s = 0.0
        self._is_stranded = False
        self._stranded_for: Point | None = None
        self._is_miss_counted = False

    def __call__(self, scene: Scene, status: RobotStatus | None = None, *, followed: bool = True) -> Advice | None:
        """Advice for a scene; `status` adds the contact force and how fast the robot is really fed. None when there is no pose.

        Of a robot that does not do what is advised, although it is `followed`, more is concluded than of one that others drive.
        """
        config = self._config
        ahead_px = config.look_ahead_px + config.look_ahead_s * max(0.0, self._speed_mm_s) * config.pixels_per_mm
        # Who missed a branch has turned too late: each new try begins to turn earlier.
        way = look_ahead(scene, ahead_px, config, self._misses.count * config.rounding_px)
        if way is None:
            return None
        since_s = 0.0 if self._last_s is None else max(0.0, scene.captured_s - self._last_s)
        self._last_s = scene.captured_s
        elapsed_s = min(since_s, _LONGEST_S)
        if since_s > _PAUSE_S:
            self._stall.forget()
            self._behind_s = 0.0
        contact_n = status.wall_contact_n if status is not None else None
        # Counted down, not forgotten: where head and branch lie in a wide bifurcation, single frames still see the way ahead.
        self._behind_s = max(0.0, self._behind_s + (elapsed_s if way.behind else -elapsed_s))
        self._smooth(way.error_deg, since_s)
        fed_mm_s, fed_mm = self._feed.update(status, self._speed_mm_s, elapsed_s)
        stuck = self._stall.update(way.left_px, way.head, fed_mm_s, elapsed_s)
        self._tries.see(way)
        gave_up = self._back is None and (self._misses.count >= config.most_misses or self._tries.count >= config.most_tries)
        otherwise = fed_mm_s >= 0.0 if self._back is not None else gave_up and fed_mm_s != 0.0
        self._unfollowed_s = self._unfollowed_s + elapsed_s if otherwise else 0.0
        still = followed and self._back is not None and way.behind and fed_mm_s == 0.0
        self._still_s = self._still_s + elapsed_s if still else 0.0
        self._is_stranded = self._is_stranded and way.behind and fed_mm_s == 0.0 and way.target == self._stranded_for
        self._is_miss_counted = self._is_miss_counted and self._behind_s > 0.0
        rises = self._lean.rises(contact_n, fed_mm)
        return self._backing(way, contact_n, rises, stuck, fed_mm) or self._given_up(way) or self._forward(way, rises)

    def _backing(self, way: Way, contact_n: float | None, rises: bool, stuck: bool, fed_mm: float) -> Advice | None:
        """Backwards while there is a reason to, which one picture alone never is; None to go on. `fed_mm` since the last frame."""
        config = self._config
        if self._is_stranded:
            return self._advise(0.0, 0.0, "the robot cannot go back any farther: take over, or choose another destination")
        if self._back is None:
            if way.behind and self._behind_s < config.behind_s:
                return self._advise(0.0, 0.0, "the way seems to lie behind the head: looking again")
            if way.behind:
                if not self._is_miss_counted:  # the same one, whoever has driven meanwhile
                    self._misses.add(way)
                self._is_miss_counted = True
                self._back = BackOff("the way to the target branches off behind the head", config.retry_mm)
            elif self._contact.exceeded(contact_n, rises, way.left_px):
                self._tries.add(way)
                self._back = BackOff(f"the robot presses against the wall with {contact_n or 0.0:.2f} N", config.back_off_mm / 2)
            elif stuck:
                self._tries.add(way)
                # All that was fed in vain lies bent behind the head.
                self._back = BackOff("the robot is fed but its head does not move", max(config.back_off_mm, self._stall.lost_mm))
            else:
                return None
        if self._still_s > _STRANDED_S:
            self._back, self._still_s, self._is_stranded, self._stranded_for = None, 0.0, True, way.target
            return self._backing(way, contact_n, rises, stuck, fed_mm)
        is_unfollowed = self._unfollowed_s > _UNFOLLOWED_S and not way.behind
        is_done = self._back.done(way.behind, -fed_mm)
        if is_unfollowed or is_done:
            self._back, self._unfollowed_s = None, 0.0
            self._is_miss_counted = self._is_miss_counted and not is_done
            return None
        steer_deg = 0.0 if way.behind else self._steer_deg
        # The way back is free, the head follows its own body: only time is lost here, and the body leans meanwhile.
        return self._advise(-self._words.fast_mm_s, steer_deg, f"backing off: {self._back.why}")

    def _given_up(self, way: Way) -> Advice | None:
        if self._unfollowed_s > _UNFOLLOWED_S:
            self._misses.forget()  # the operator goes on by hand
            self._tries.forget()
        if (count := self._misses.at(way)) >= self._config.most_misses:
            return self._advise(0.0, 0.0, f"missed the branch {count} times: take over, or choose another destination")
        if (count := self._tries.count) >= self._config.most_tries:
            return self._advise(0.0, 0.0, f"came no farther in {count} tries: take over, or choose another destination")
        return None

    def _forward(self, way: Way, rises: bool) -> Advice:
        config, words = self._config, self._words
        limits = [(words.fast_mm_s, "along the route")]
        if way.turn_deg > config.gentle_turn_deg:
            limits.append((words.fast_mm_s * config.gentle_turn_deg / way.turn_deg, "a bend ahead"))
        if way.junction_px is not None:
            limits.append((words.moderate_mm_s, "a bifurcation ahead"))
        if abs(self._steer_deg) > config.slow_steer_deg:
            # No jump where it begins: an error that trembles about the limit must not make the feed stutter.
            share = (config.slow_steer_deg / abs(self._steer_deg)) ** 2
            limits.append((max(words.slowest_mm_s, words.fast_mm_s * share), "the head must turn first"))
        if way.wall > config.wall_share:
            limits.append((words.moderate_mm_s, "the head is near the wall"))
        if rises:
            limits.append((words.slow_mm_s, "the robot meets the wall"))
        if way.left_px is not None and way.left_px < config.brake_px:
            limits.append((max(words.slowest_mm_s, words.fast_mm_s * way.left_px / config.brake_px), "the target is near"))
        speed_mm_s, why = min(limits)
        return self._advise(speed_mm_s, self._steer_deg, why)

    def _smooth(self, error_deg: float, elapsed_s: float) -> None:
        wanted = limited(self._config.gain * error_deg, self._words.max_steer_deg)
        keep = math.exp(-elapsed_s / self._config.smoothing_s) if self._config.smoothing_s > 0.0 and elapsed_s > 0.0 else 0.0
        self._steer_deg = keep * self._steer_deg + (1.0 - keep) * wanted

    def _advise(self, speed_mm_s: float, steer_deg: float, why: str) -> Advice:
        self._speed_mm_s = speed_mm_s
        return Advice(speed_word(abs(speed_mm_s), self._words), speed_mm_s, steer_deg, why)


def speed_word(speed_mm_s: float, config: AdviceConfig) -> Speed:
    """The paper's word nearest to a speed; STOP for none."""
    if speed_mm_s == 0.0:
        return Speed.STOP
    words = {
        Speed.SLOWEST: config.slowest_mm_s,
        Speed.SLOW: config.slow_mm_s,
        Speed.MODERATE: config.moderate_mm_s,
        Speed.FAST: config.fast_mm_s,
    }
    return min(words, key=lambda word: abs(words[word] - speed_mm_s))
