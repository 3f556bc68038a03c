"""Which servo does what, and in which direction, from what the camera saw while each was turned a little both ways. Pure.

A wire can only pull: turned one way the servo bends the head, turned the other way it lets the wire go slack and nothing happens. A
drum feeds both ways. So the direction that does something is the one that tightens, and which way the head goes tells the tendon.
What acts out of the image plane shortens what is seen of the robot, up or down alike: one camera cannot tell these two apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from core.calibration.look import Look, head_move
from core.calibration.sheath import sheath_growth
from core.errors import UserError
from core.servo_config import JOINT_NAMES, JointName
from core.types import Point

_CLEAR_LATERAL_PX, _CLEAR_FEED_PX, _CLEAR_PITCH_PX, _CLEAR_SHEATH_PX = 3.0, 1.5, 1.4, 3.0
_SHEATH_FROM_MM = 1.4
_ONE_SIDED = 2.0
"""So much more does a wire do when it is tightened than when it is let go."""
_STILL_PX = 0.6


class NotIdentified(UserError):
    """The servos' functions are not all clear; the message names what is missing."""


class Function(StrEnum):
    """What a servo does, as one camera can tell it."""

    RIGHT = "pulls the head to the right"
    LEFT = "pulls the head to the left"
    PITCH = "pulls the head out of the picture's plane"
    ADVANCE = "feeds the robot"
    DELIVERY = "feeds the catheter"


@dataclass(frozen=True, slots=True, eq=False)
class Wiggle:
    """The robot at rest, with the servo turned in its own positive direction, and in its negative one, by so many mm each."""

    amplitude_mm: float
    rest: Look
    plus: Look
    minus: Look


@dataclass(frozen=True, slots=True)
class FeedWay:
    """How far the robot went: source px for each mm that was sent, of ``amplitude_mm`` both ways.

    ``scale``: working px in a source px. ``head``: where it was seen, source px.
    """

    px_per_mm: float
    amplitude_mm: float
    head: Point
    scale: float


@dataclass(frozen=True, slots=True)
class Finding:
    """What a servo does. ``sign``: the servo's own direction that tightens the wire or feeds forward. ``seen`` for people."""

    function: Function
    sign: Literal[-1, 1]
    seen: str
    way: FeedWay | None = None


@dataclass(frozen=True, slots=True)
class Assignment:
    """Who a servo is. ``assumed``: one camera cannot tell, so the order of the ids decides."""

    name: JointName
    id: int
    sign: Literal[-1, 1]
    seen: str
    assumed: bool = False


def classify(wiggle: Wiggle) -> Finding | None:
    """What the servo does; None when nothing clear was seen: turn it farther."""
    plus, minus = head_move(wiggle.rest, wiggle.plus), head_move(wiggle.rest, wiggle.minus)
    sides = abs(plus.lateral_px), abs(minus.lateral_px)
    if max(sides) >= _CLEAR_LATERAL_PX:
        if max(sides) < _ONE_SIDED * min(sides):
            return None
        sign: Literal[-1, 1] = 1 if sides[0] > sides[1] else -1
        lateral_px = plus.lateral_px if sign > 0 else minus.lateral_px
        function = Function.RIGHT if lateral_px > 0 else Function.LEFT
        return Finding(function, sign, f"head {abs(lateral_px):.0f} px to the {'right' if lateral_px > 0 else 'left'}")
    longer = plus.longer_px, minus.longer_px
    if longer[0] * longer[1] < 0 and min(abs(longer[0]), abs(longer[1])) >= _CLEAR_FEED_PX:
        px_per_mm = abs(longer[0] - longer[1]) / wiggle.rest.scale / (2.0 * wiggle.amplitude_mm)
        way = FeedWay(px_per_mm, wiggle.amplitude_mm, wiggle.rest.head, wiggle.rest.scale)
        return Finding(Function.ADVANCE, 1 if longer[0] > 0 else -1, f"head {max(longer):.0f} px forward", way)
    shorter = -plus.longer_px, -minus.longer_px
    if max(shorter) >= _CLEAR_PITCH_PX and max(shorter) > _ONE_SIDED * abs(min(shorter)):
        sign = 1 if shorter[0] > shorter[1] else -1
        return Finding(Function.PITCH, sign, f"{max(shorter):.1f} px less of the robot seen")
    if max(abs(value) for value in (*longer, *sides)) > _STILL_PX or wiggle.amplitude_mm < _SHEATH_FROM_MM:
        return None  # a wire out of the picture's plane may just begin to show
    grown_px = wiggle.rest.scale * sheath_growth(wiggle.rest.path, wiggle.minus.image, wiggle.plus.image)
    if abs(grown_px) >= _CLEAR_SHEATH_PX:
        return Finding(Function.DELIVERY, 1 if grown_px > 0 else -1, f"sheath {abs(grown_px):.0f} px farther")
    return None


def assign(found: Mapping[int, Finding]) -> tuple[Assignment, ...]:
    """Names for seven servos by id, in the order of ``JOINT_NAMES``.

    Raises
    ------
    NotIdentified
        A function is missing, or several servos have the same one.
    """
    wanted: tuple[tuple[Function, tuple[JointName, ...]], ...] = (
        (Function.RIGHT, ("right",)),
        (Function.LEFT, ("left",)),
        (Function.PITCH, ("up", "down")),
        (Function.ADVANCE, ("advance",)),
        (Function.DELIVERY, ("delivery_1", "delivery_2")),
    )
    named: dict[JointName, Assignment] = {}
    wrong = []
    for function, names in wanted:
        ids = sorted(servo_id for servo_id, finding in found.items() if finding.function is function)
        if len(ids) != len(names):
            listed = ", ".join(map(str, ids)) or "none"
            wrong.append(f"{len(names)} that {function} (found: {listed})")
            continue
        for name, servo_id in zip(names, ids, strict=True):
            finding = found[servo_id]
            named[name] = Assignment(name, servo_id, finding.sign, finding.seen, assumed=function is Function.PITCH)
    if wrong:
        raise NotIdentified(f"not all servos are clear: there should be {'; '.join(wrong)}; wiggle them again, or set them by hand")
    return tuple(named[name] for name in JOINT_NAMES)
