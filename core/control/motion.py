"""Controls -> command for driving by hand, and advice -> command for autonomous driving. Time is injected."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from core.config.models import DriveConfig, JogConfig
from core.config.safety import JointConfig, JointKind, ServosConfig
from core.control.joints import direction, limited
from core.types import Advice, Command

_LONGEST_STEP_S = 0.1
"""A longer pause between two commands counts as this."""
_MOST_AHEAD = 0.25
"""Largest lead of the commanded bend over the one sent, of full bend."""
_CAREFUL_DEG_S, _CAREFUL_MM_S = 10.0, 3.0
"""Fastest turn and feed until the robot was seen to follow: in the time that it takes to notice a wrong direction and to stop, the
head turns by less than 10 degrees."""


@dataclass(frozen=True, slots=True)
class Jog:
    """Deflection of the controls, each -1..1 of full speed; ``straighten`` brings bend and pitch back to the middle.

    ``rotation`` is positive to the left as seen from behind: from the robot's right towards the camera.
    """

    bend: float = 0.0
    pitch: float = 0.0
    advance: float = 0.0
    delivery: float = 0.0
    straighten: bool = False
    rotation: float = 0.0

    @property
    def is_rest(self) -> bool:
        return self == AT_REST


AT_REST = Jog()


def can_pitch(servos: ServosConfig) -> bool:
    """Whether the robot bends out of the picture's plane: two tendons need a rotation for that."""
    return len(servos.tendons) > 2 or any(joint.kind is JointKind.ROTATION for joint in servos.joints)


def can_turn(servos: ServosConfig) -> bool:
    """Whether the shaft is turned by hand; that of two tendons follows the bend."""
    return len(servos.tendons) > 2 and any(joint.kind is JointKind.ROTATION for joint in servos.joints)


def within_robot(jog: Jog, servos: ServosConfig) -> Jog:
    """The controls without those of motions that the robot does not have: they are no input."""
    kinds = {joint.kind for joint in servos.joints}
    return replace(
        jog,
        pitch=jog.pitch if can_pitch(servos) else 0.0,
        advance=jog.advance if JointKind.ADVANCE in kinds else 0.0,
        delivery=jog.delivery if JointKind.DELIVERY in kinds else 0.0,
        rotation=jog.rotation if can_turn(servos) else 0.0,
    )


class Retraction(Enum):
    """How a control that pulls a feed back is held."""

    REST = "not held"
    WITHIN = "begun within the envelope"
    BEYOND = "begun at its low end"
    """It may go on beyond the end, slowly: the operator has let go there and has pulled again."""


def next_retraction(state: Retraction, *, pulls: bool, at_low: bool) -> Retraction:
    """The transition table: whether the control pulls back now, and the feed is at the low end of its envelope or below."""
    if not pulls:
        return Retraction.REST
    if state is Retraction.REST:
        return Retraction.BEYOND if at_low else Retraction.WITHIN
    return state


@dataclass(frozen=True, slots=True)
class JogSpeeds:
    """Speeds of the joints by a held key: feed of robot and catheter, pull of the tendons, turn of the shaft."""

    advance_mm_s: float
    delivery_mm_s: float
    bend_mm_s: float
    pitch_mm_s: float
    rotation_deg_s: float = 0.0


def hand_speeds(hand: JogConfig, servos: ServosConfig, share: float = 1.0) -> JogSpeeds:
    """The speeds of `hand` at `share` (0..1) of full speed, limited to the slowest joint that takes part."""
    pull_mm_s = share * hand.bend_rate_per_s * servos.max_pull_mm
    ways = [direction(joint) for joint in servos.tendons]
    across, up = ([joint for joint, way in zip(servos.tendons, ways, strict=True) if way[axis] != 0.0] for axis in (0, 1))
    return JogSpeeds(
        _speed_limited(share * hand.advance_mm_s, servos.joints[servos.places(JointKind.ADVANCE)]),
        _speed_limited(share * hand.delivery_mm_s, servos.joints[servos.places(JointKind.DELIVERY)]),
        _speed_limited(pull_mm_s, across or servos.tendons),
        _speed_limited(pull_mm_s, up or servos.tendons),
        _speed_limited(share * hand.rotation_deg_s, servos.joints[servos.places(JointKind.ROTATION)]),
    )


def combined(jogs: Iterable[Jog]) -> Jog:
    """Several controls held at once: their sum, limited. A number that is not finite counts as rest."""
    jogs = list(jogs)

    def total(values: Iterable[float]) -> float:
        return limited(sum(value for value in values if math.isfinite(value)), 1.0)

    return Jog(
        total(jog.bend for jog in jogs),
        total(jog.pitch for jog in jogs),
        total(jog.advance for jog in jogs),
        total(jog.delivery for jog in jogs),
        any(jog.straighten for jog in jogs),
        total(jog.rotation for jog in jogs),
    )


class JogIntegrator:
    """Controls -> command: bend and pitch change while a control is held and stay when it is released; advance and delivery are
    speeds.

    The command runs ahead of the robot by ``_MOST_AHEAD`` at most, so that releasing the control of a robot that lags ends
    its motion.
    """

    def __init__(self, config: JogConfig) -> None:
        self._config = config
        self.take_over(0.0, 0.0)

    def take_over(self, bend: float, pitch: float) -> None:
        """Start from where the robot is now (-1..1 of full pull): the first command moves nothing."""
        self._bend, self._pitch = limited(bend, 1.0), limited(pitch, 1.0)
        self._last_s: float | None = None

    def command(self, jog: Jog, now_s: float, at: Command | None = None, speed: float = 1.0) -> Command:
        """The command now; `now_s` is monotonic, `at` the motion sent last (None: not known), `speed` the share of full speed."""
        config = self._config
        elapsed_s = 0.0 if self._last_s is None else min(max(0.0, now_s - self._last_s), _LONGEST_STEP_S)
        self._last_s = now_s
        step = speed * config.bend_rate_per_s * elapsed_s
        if jog.straighten:
            self._bend -= limited(self._bend, step)
            self._pitch -= limited(self._pitch, step)
        else:
            self._bend = limited(self._bend + step * limited(jog.bend, 1.0), 1.0)
            self._pitch = limited(self._pitch + step * limited(jog.pitch, 1.0), 1.0)
        if at is not None:
            self._bend = at.bend + limited(self._bend - at.bend, _MOST_AHEAD)
            self._pitch = at.pitch + limited(self._pitch - at.pitch, _MOST_AHEAD)
        return Command(
            bend=self._bend,
            pitch=self._pitch,
            advance_mm_s=speed * config.advance_mm_s * limited(jog.advance, 1.0),
            delivery_mm_s=speed * config.delivery_mm_s * limited(jog.delivery, 1.0),
            rotation_deg_s=speed * config.rotation_deg_s * limited(jog.rotation, 1.0),
        )


def _speed_limited(speed_mm_s: float, joints: Sequence[JointConfig]) -> float:
    """0 without joints."""
    return min((speed_mm_s, *(joint.max_speed_mm_s for joint in joints))) if joints else 0.0


class AdviceController:
    """Advice -> command with a rate-limited PI loop, which the camera closes.

    Advice is the turn of the head *from where it is now*; the bend that holds a vessel's curve is not part of it. So the bend is
    mainly the integral of the advice, which also takes up slack and set of the wires, with a small proportional part. Without
    advice the bend is kept and the feed stops at once.
    """

    def __init__(self, config: DriveConfig, bend: float = 0.0) -> None:
        self._config = config
        self.take_over(bend)

    def take_over(self, bend: float, pitch: float = 0.0) -> None:
        """Start from the bend (-1..1) that the robot has now, at rest; the first command moves nothing."""
        self._bend = self._integral = limited(bend, 1.0)
        self._pitch = limited(pitch, 1.0)
        self._advance_mm_s = 0.0
        self._last_s: float | None = None

    def command(self, advice: Advice | None, now_s: float, *, turns: bool = True, feeds: bool = True) -> Command:
        """The command now; `now_s` is on any monotonic clock, the same for all calls.

        `turns`, `feeds`: bend and feed are known to act in the right direction (``direction_monitor``); else they are slow.
        """
        config = self._config
        elapsed_s = 0.0 if self._last_s is None else min(max(0.0, now_s - self._last_s), config.max_gap_s)
        self._last_s = now_s
        if advice is None or not math.isfinite(advice.steer_deg + advice.advance_mm_s):
            self._advance_mm_s, self._integral = 0.0, self._bend
            return Command(bend=self._bend, pitch=self._pitch)
        turn = advice.steer_deg / config.turn_deg
        integral = self._integral + turn * elapsed_s / config.integral_s
        wanted = integral + config.proportional * turn
        rate_per_s = config.max_bend_rate_per_s
        reach = (rate_per_s if turns else min(rate_per_s, _CAREFUL_DEG_S / config.turn_deg)) * elapsed_s
        bend = limited(self._bend + limited(wanted - self._bend, reach), 1.0)
        # anti-windup: the integral waits while rate or range limit the bend
        held_back = (wanted - bend) * turn > 0.0
        self._integral = self._integral if held_back else limited(integral, 1.0)
        self._bend = bend
        self._advance_mm_s = self._feed(advice.advance_mm_s if feeds else limited(advice.advance_mm_s, _CAREFUL_MM_S), elapsed_s)
        return Command(bend=bend, pitch=self._pitch, advance_mm_s=self._advance_mm_s)

    def _feed(self, wanted_mm_s: float, elapsed_s: float) -> float:
        """Speeding up is gradual; slowing down, and stopping before a reversal, is not."""
        before = self._advance_mm_s
        if wanted_mm_s * before < 0.0:
            before = 0.0
        if abs(wanted_mm_s) <= abs(before):
            return wanted_mm_s
        return before + limited(wanted_mm_s - before, self._config.max_acceleration_mm_s2 * elapsed_s)
