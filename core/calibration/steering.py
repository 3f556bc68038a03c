"""In which direction each tendon moves the head, as the camera sees it. Pure.

The ways of a pair are taken together: what the wall, the bend or the end of the mask add to both ways alike (all of them push the
head along its axis) falls out of their difference. A head that is bent starts at right angles to where it points, so the heading
says the same once more, and the mean of both is kept; how far they disagree is told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from core.calibration.look import HeadMove, angle_deg, turn_deg
from core.calibration_config import SteeringConfig, TendonConfig
from core.errors import UserError
from core.servo_config import TENDONS
from core.types import Points

_FREE_PX = 4.0
"""A head that moves less lies against a wall."""
_MOST_DISAGREEMENT_DEG = 15.0
_IN_PLANE_SHARE = 0.25
"""A pair that moves the head by a smaller share of the other one's way acts out of the picture's plane."""


class SteeringNotSeen(UserError):
    """The head did not move enough to tell a direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """A tendon's pull (mm beyond the other's) and what the head did."""

    pull_mm: float
    move: HeadMove


@dataclass(frozen=True, slots=True)
class _Pair:
    lateral_px_mm: float
    direction_deg: float
    disagreement_deg: float


def learn(pulls: Mapping[str, Pull], heading: Points) -> SteeringConfig:
    """The steering from a pull of each of the four tendons, each from rest.

    Raises
    ------
    SteeringNotSeen
        The head lies against a wall, or hardly moves, in both directions.
    """
    heading_deg = angle_deg(heading)
    bend, pitch = (_pair(pulls[one], pulls[other], heading_deg) for one, other in (("right", "left"), ("up", "down")))
    if bend is None and pitch is None:
        raise SteeringNotSeen(
            "the head hardly moves in the picture when the tendons pull, it lies against a wall: feed the robot to a place where "
            "it has room on both sides, then learn again"
        )
    gains = [0.0 if pair is None else pair.lateral_px_mm for pair in (bend, pitch)]
    seen = [pair for pair in (bend, pitch) if pair is not None]
    largest = max(abs(gain) for gain in gains)
    tendons = []
    for pair, names in ((bend, ("right", "left")), (pitch, ("up", "down"))):
        in_plane = pair is not None and abs(pair.lateral_px_mm) >= _IN_PLANE_SHARE * largest
        for k, name in enumerate(names):
            pull = pulls[name]
            direction = turn_deg(0.0, pair.direction_deg + 180.0 * k) if in_plane and pair is not None else None
            moved = pull.move.size_px if in_plane else abs(pull.move.lateral_px)
            tendons.append(_tendon(name, direction, moved, pull.pull_mm))
    return SteeringConfig(
        heading_deg=heading_deg,
        roll_deg=math.degrees(math.atan2(gains[1], gains[0])),
        disagreement_deg=max(pair.disagreement_deg for pair in seen),
        tendons=tuple(tendons),
    )


def _pair(one: Pull, other: Pull, heading_deg: float) -> _Pair | None:
    """Way per millimetre to the right of the heading and its direction; None when neither tendon moves the head sideways."""
    if max(abs(one.move.lateral_px), abs(other.move.lateral_px)) < _FREE_PX:
        return None
    way = one.move.vector - other.move.vector
    gain = (one.move.lateral_px - other.move.lateral_px) / (one.pull_mm + other.pull_mm)
    measured = angle_deg(way)
    normal = turn_deg(0.0, heading_deg + math.copysign(90.0, gain))
    apart = turn_deg(measured, normal)
    # Where only one side is free the difference is that side's way, bent as it is: the heading is the better witness then.
    is_free = min(abs(one.move.lateral_px), abs(other.move.lateral_px)) >= _FREE_PX
    believed = measured if abs(apart) > _MOST_DISAGREEMENT_DEG else measured + (0.5 if is_free else 1.0) * apart
    return _Pair(gain, turn_deg(0.0, believed), abs(apart))


def _tendon(name: str, direction_deg: float | None, moved_px: float, pull_mm: float) -> TendonConfig:
    assert name in TENDONS
    return TendonConfig.model_validate(
        {
            "name": name,
            "direction_deg": direction_deg,
            "moved_px": moved_px,
            "px_per_mm": moved_px / pull_mm,
        }
    )
