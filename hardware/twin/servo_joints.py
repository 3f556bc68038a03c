"""From the seven servos' motion to the twin's mechanics: wires pull, drums feed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from core.config import TwinConfig
from core.servo_config import ServosConfig
from core.types import Command
from hardware.twin.servo_bus import SoftServoBus

if TYPE_CHECKING:
    from hardware.twin.world import TwinWorld


@dataclass(frozen=True, slots=True)
class Pair:
    """An antagonistic pair. ``bend_mm`` is what it does to the head, positive towards the first; slack: the pulls sum below 0."""

    bend_mm: float
    slack: bool


def pair_of(first_mm: float, second_mm: float) -> Pair:
    """The pair's effect at two pulls, in mm from where each wire is without tension.

    Two stiff wires on a soft head: taut, both hold it and it goes to half their difference. Slack, only a wire that is pulled
    counts, and nothing holds against it; with none pulled the head is straight. Both agree where the sum is zero.
    """
    if first_mm + second_mm >= 0.0:
        return Pair((first_mm - second_mm) / 2.0, slack=False)
    return Pair(max(first_mm, 0.0) - max(second_mm, 0.0), slack=True)


class JointsToTwin:
    """Turns measured joint positions over time into what the twin's physics takes.

    Feeds go by differences: the sum of what is fed equals the joint's way, however time is cut. With a roll the robot is turned
    about its axis: what its tendon "right" does is then partly up or down as the camera sees it.
    """

    def __init__(self, config: ServosConfig, start_mm: Sequence[float], roll_deg: float = 0.0) -> None:
        self._max_pull_mm = config.max_pull_mm
        self._turn = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
        self._last_mm = tuple(start_mm)
        self.slack = (False, False)
        """Of the bending and of the pitching pair."""

    def command(self, positions_mm: Sequence[float], duration_s: float) -> Command:
        """What moves the twin for `duration_s`, with the joints (in the order of ``JOINT_NAMES``) at `positions_mm` at its end."""
        right, left, up, down = positions_mm[:4]
        advance, first, second = (now - last for now, last in zip(positions_mm[4:], self._last_mm[4:], strict=True))
        self._last_mm = tuple(positions_mm)
        bend, pitch = pair_of(right, left), pair_of(up, down)
        self.slack = bend.slack, pitch.slack
        cos, sin = self._turn
        return Command(
            bend=_within_one((cos * bend.bend_mm + sin * pitch.bend_mm) / self._max_pull_mm),
            pitch=_within_one((cos * pitch.bend_mm - sin * bend.bend_mm) / self._max_pull_mm),
            advance_mm_s=advance / duration_s,
            # Two rollers on one sheath: it moves as their mean.
            delivery_mm_s=(first + second) / 2.0 / duration_s,
        )


def wired(twin: TwinConfig, servos: ServosConfig) -> ServosConfig:
    """The servos as they really are: as the twin's wiring says, whatever the program believes of them.

    Raises
    ------
    ValueError
        When two servos have the same id, or one has none.
    """
    if twin.wiring is None:
        return servos
    numbers = [int(number) for number in twin.wiring.split(",")]
    if len({abs(number) for number in numbers}) != len(numbers) or not all(0 < abs(number) <= 252 for number in numbers):
        raise ValueError(f"twin.wiring {twin.wiring}: seven different ids of 1 to 252")
    joints = tuple(
        joint.model_copy(update={"id": abs(number), "sign": -1 if number < 0 else 1})
        for joint, number in zip(servos.joints, numbers, strict=True)
    )
    return servos.model_copy(update={"joints": joints})


def drive_world(world: TwinWorld, bus: SoftServoBus, config: ServosConfig) -> JointsToTwin:
    """From now on the servos of `bus` move the robot of `world`, and feel its wires. Returns the link, which knows slack pairs."""
    joints = JointsToTwin(config, bus.positions_mm(), world.config.roll_deg)

    def drive(duration_s: float) -> Command:
        bus.set_loads_mn((*world.physics.status().tendon_force_mn, 0.0, 0.0, 0.0))
        return joints.command(bus.positions_mm(), duration_s)

    world.drive = drive
    return joints


def _within_one(value: float) -> float:
    return max(-1.0, min(1.0, value))
