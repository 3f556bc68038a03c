"""From the robot's joints to the twin's physics: measured positions of its servos, or commands without servos."""

from __future__ import annotations

import math
from collections.abc import Sequence

from core.config.safety import JointConfig, JointKind, SafetyConfig, ServosConfig
from core.control.joints import SentGoals, bend_of, direction, joint_goals, limited
from core.types import Command


def pair_bend_mm(first_mm: float, second_mm: float) -> float:
    """The bend by two antagonistic wires, positive towards the first, from their pulls relative to where each is without tension.

    Two taut stiff wires hold the soft head at half their difference. In a slack pair (negative sum) only a pulled wire acts, and
    without one the head is straight. Both rules agree where the sum is zero.
    """
    if first_mm + second_mm >= 0.0:
        return (first_mm - second_mm) / 2.0
    return max(first_mm, 0.0) - max(second_mm, 0.0)


def wires_bend_mm(pulls_mm: Sequence[float], tendons: Sequence[JointConfig]) -> tuple[float, float]:
    """The bend by all wires, in the shaft's directions: of opposite pairs, or of three.

    Three slack wires (negative sum) only limit the head: it bends as little as they let it. Both rules agree where the sum is 0.
    """
    if len(tendons) == 3:
        return bend_of(pulls_mm, tendons) if sum(pulls_mm) >= 0.0 else _least_bend_mm(pulls_mm, [direction(one) for one in tendons])
    x = y = 0.0
    for first in range(0, len(tendons), 2):
        bend_mm, (across, up) = pair_bend_mm(pulls_mm[first], pulls_mm[first + 1]), direction(tendons[first])
        x, y = x + bend_mm * across, y + bend_mm * up
    return x, y


def _least_bend_mm(pulls_mm: Sequence[float], ways: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The least bend that takes no less from any wire's length than its pull: one or two of the three wires are taut then."""
    found = [(0.0, 0.0)]
    for one, (across, up) in enumerate(ways):
        found.append((pulls_mm[one] * across, pulls_mm[one] * up))
        second = (one + 1) % len(ways)
        other_across, other_up = ways[second]
        area = across * other_up - up * other_across
        found.append(
            (
                (pulls_mm[one] * other_up - pulls_mm[second] * up) / area,
                (pulls_mm[second] * across - pulls_mm[one] * other_across) / area,
            )
        )
    allowed = [
        bend
        for bend in found
        if all(bend[0] * way[0] + bend[1] * way[1] >= pull_mm - _ROUNDING_MM for pull_mm, way in zip(pulls_mm, ways, strict=True))
    ]
    return min(allowed, key=lambda bend: math.hypot(*bend))


_ROUNDING_MM = 1e-9


class JointsToTwin:
    """Converts measured joint positions into commands for the twin's physics, in the shaft's directions.

    Feeds and rotation are differences, so their sum equals the travel of the joint for any time step. With a roll the robot is
    turned about its axis: its tendon "right" then acts partly up or down as seen by the camera.
    """

    def __init__(self, config: ServosConfig, start_mm: Sequence[float], roll_deg: float = 0.0) -> None:
        self._servos = config
        self._turn = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
        self._last_mm = tuple(start_mm)

    def command(self, positions_mm: Sequence[float], duration_s: float) -> Command:
        """The command for `duration_s`, at whose end the joints are at `positions_mm`."""
        servos = self._servos
        speeds = [(now - last) / duration_s for now, last in zip(positions_mm, self._last_mm, strict=True)]
        self._last_mm = tuple(positions_mm)
        bend_mm, pitch_mm = wires_bend_mm(positions_mm[servos.places(JointKind.TENDON)], servos.tendons)
        cos, sin = self._turn
        delivery = speeds[servos.places(JointKind.DELIVERY)]
        return Command(
            bend=_within_one((cos * bend_mm + sin * pitch_mm) / servos.max_pull_mm),
            pitch=_within_one((cos * pitch_mm - sin * bend_mm) / servos.max_pull_mm),
            advance_mm_s=sum(speeds[servos.places(JointKind.ADVANCE)]),
            # Two rollers drive one sheath, which moves by their mean.
            delivery_mm_s=sum(delivery) / len(delivery) if delivery else 0.0,
            rotation_deg_s=sum(speeds[servos.places(JointKind.ROTATION)]),
        )


_AT_REST = 1e-6
"""mm or degrees."""


class DirectJoints:
    """The joints of a robot of another shape without servos: they go where commands send them, within speed and envelope."""

    def __init__(self, servos: ServosConfig, safety: SafetyConfig) -> None:
        self._servos, self._safety = servos, safety
        self._rest = tuple(servos.pretension_mm if joint.is_tendon else 0.0 for joint in servos.joints)
        self._last, self._to_twin = SentGoals(self._rest, 0.0), JointsToTwin(servos, self._rest)

    @property
    def is_at_rest(self) -> bool:
        """Whether tendons and rotation stand where they do at the start."""
        return all(
            abs(at_mm - rest_mm) < _AT_REST
            for at_mm, rest_mm, joint in zip(self._last.goals_mm, self._rest, self._servos.joints, strict=True)
            if not joint.is_feed
        )

    def command_to_rest(self, duration_s: float) -> Command:
        """What the physics does for `duration_s` while tendons and rotation go back there and the feeds stand."""
        goals = tuple(
            at_mm if joint.is_feed else at_mm + limited(rest_mm - at_mm, joint.max_speed_mm_s * duration_s)
            for at_mm, rest_mm, joint in zip(self._last.goals_mm, self._rest, self._servos.joints, strict=True)
        )
        self._last = SentGoals(goals, self._last.time_s + duration_s)
        return self._to_twin.command(goals, duration_s)

    def command(self, command: Command, duration_s: float) -> Command:
        """What the physics does with `command` for `duration_s`."""
        now_s = self._last.time_s + duration_s
        wanted = joint_goals(command, self._last, self._last.goals_mm, now_s, self._servos, self._safety)
        self._last = SentGoals(wanted.goals_mm, now_s)
        return self._to_twin.command(wanted.goals_mm, duration_s)


def _within_one(value: float) -> float:
    return max(-1.0, min(1.0, value))
