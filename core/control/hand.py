"""The operator's hands: held keys and sticks are rates, and become the motion that is asked of the robot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from core.policy_config import HandConfig
from core.servo_config import JointConfig, ServosConfig
from core.types import Command

_LONGEST_STEP_S = 0.1
_AHEAD = 0.25


@dataclass(frozen=True, slots=True)
class Jog:
    """How the controls are held, each -1..1 of full speed; ``straighten`` brings bend and pitch back to the middle."""

    bend: float = 0.0
    pitch: float = 0.0
    advance: float = 0.0
    delivery: float = 0.0
    straighten: bool = False

    @property
    def is_rest(self) -> bool:
        return self == AT_REST


AT_REST = Jog()


@dataclass(frozen=True, slots=True)
class HandSpeeds:
    """What a held key makes of the joints, mm/s: robot and catheter are fed, tendons pulled by ``bend_mm_s`` and ``pitch_mm_s``."""

    advance_mm_s: float
    delivery_mm_s: float
    bend_mm_s: float
    pitch_mm_s: float


def hand_speeds(hand: HandConfig, servos: ServosConfig, share: float = 1.0) -> HandSpeeds:
    """As fast as `hand` asks for at `share` (0..1) of full speed, and not faster than the slowest joint that takes part may go."""
    right, left, up, down, advance, *delivery = servos.joints
    pull_mm_s = share * hand.bend_rate_per_s * servos.max_pull_mm
    return HandSpeeds(
        _as_they_may(share * hand.advance_mm_s, advance),
        _as_they_may(share * hand.delivery_mm_s, *delivery),
        _as_they_may(pull_mm_s, right, left),
        _as_they_may(pull_mm_s, up, down),
    )


def combined(jogs: Iterable[Jog]) -> Jog:
    """Several controls held at once: their sum, limited. A number that is not finite counts as rest."""
    jogs = list(jogs)

    def total(values: Iterable[float]) -> float:
        return _limited(sum(value for value in values if math.isfinite(value)), 1.0)

    return Jog(
        total(jog.bend for jog in jogs),
        total(jog.pitch for jog in jogs),
        total(jog.advance for jog in jogs),
        total(jog.delivery for jog in jogs),
        any(jog.straighten for jog in jogs),
    )


class Hand:
    """Bend and pitch move while they are held and stay when let go; advance and delivery are speeds, zero when nothing is held.

    What is asked for runs ahead of the robot by ``_AHEAD`` at most, so that letting go of a robot that does not follow ends it.
    """

    def __init__(self, config: HandConfig) -> None:
        self._config = config
        self.take_over(0.0, 0.0)

    def take_over(self, bend: float, pitch: float) -> None:
        """Start from where the robot is now (-1..1 of full pull): the first command moves nothing."""
        self._bend, self._pitch = _limited(bend, 1.0), _limited(pitch, 1.0)
        self._last_s: float | None = None

    def command(self, jog: Jog, now_s: float, at: Command | None = None, speed: float = 1.0) -> Command:
        """The motion for this moment; `now_s` is monotonic, `at` where the robot was told to be last (None: not known).

        `speed` is the share of full speed, 0..1, of whatever is held.
        """
        config = self._config
        elapsed_s = 0.0 if self._last_s is None else min(max(0.0, now_s - self._last_s), _LONGEST_STEP_S)
        self._last_s = now_s
        step = speed * config.bend_rate_per_s * elapsed_s
        if jog.straighten:
            self._bend -= _limited(self._bend, step)
            self._pitch -= _limited(self._pitch, step)
        else:
            self._bend = _limited(self._bend + step * _limited(jog.bend, 1.0), 1.0)
            self._pitch = _limited(self._pitch + step * _limited(jog.pitch, 1.0), 1.0)
        if at is not None:
            self._bend = at.bend + _limited(self._bend - at.bend, _AHEAD)
            self._pitch = at.pitch + _limited(self._pitch - at.pitch, _AHEAD)
        return Command(
            bend=self._bend,
            pitch=self._pitch,
            advance_mm_s=speed * config.advance_mm_s * _limited(jog.advance, 1.0),
            delivery_mm_s=speed * config.delivery_mm_s * _limited(jog.delivery, 1.0),
        )


def _as_they_may(speed_mm_s: float, *joints: JointConfig) -> float:
    return min(speed_mm_s, *(joint.max_speed_mm_s for joint in joints))


def _limited(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
