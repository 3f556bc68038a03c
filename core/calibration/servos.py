"""Calibration of the servos from what the camera sees: which servo does what, steering, taut wires, and feed. Pure.

Identification: a wire can only pull. Turned one way the servo bends the head, turned the other way it lets the wire go slack and
nothing happens, while a drum feeds both ways. So the direction with an effect is the one that tightens, and the direction of the
head's motion tells the tendon. A tendon that acts out of the image plane shortens the visible robot, up or down alike: one camera
cannot tell these two apart.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.calibration.camera import mm_per_px_at
from core.config.calibration import ScaleConfig, SteeringConfig, TendonConfig
from core.config.safety import TENDON_ANGLES_DEG, JointConfig, JointKind, JointName, ServosConfig
from core.devices import UserError
from core.messages import message
from core.perception.vectors import fit_robot_vector
from core.types import Image, Point, Points

_ANCHOR_PX = 90.0
"""Distance behind the head at which both paths are aligned; between 50 and 200 px it makes no difference."""
_LEAST_ANCHOR_PX = 30.0
_STEP_PX = 0.5
_LINE_PX = 40.0
"""Length of the robot's end that gives its heading."""
_TANGENT_PX = 8.0
"""Length of the end that is extended straight on."""
_TIP_PX = 16.0
"""Length of the end whose direction is the head's when the robot is driven (``PursuitConfig.heading_px``)."""
_LEAST_LOOKS = 3
"""Paths that must be found."""


class HeadNotSeen(UserError):
    """Perception does not find the robot, or too little of it."""


@dataclass(frozen=True, eq=False)
class Look:
    """Some frames of a robot that stands still: its paths (each (N, 2), source px, tail -> head) and their mean picture.

    ``scale`` is working pixels per source pixel: measurements are in working pixels, in which the network's noise does not depend
    on the camera's resolution.

    Raises HeadNotSeen: fewer than three paths were found, or they are too short to have a direction.
    """

    paths: tuple[Points, ...]
    image: Image
    scale: float = 1.0

    def __post_init__(self) -> None:
        if len(self.paths) < _LEAST_LOOKS:
            raise HeadNotSeen("the robot's head is not seen: move the robot until all of its last centimetres are in the picture")
        if min(float(geometry.arc_length(path)[-1]) for path in self.working_paths) < _LEAST_ANCHOR_PX + _TANGENT_PX:
            raise HeadNotSeen("too little of the robot is seen: feed it farther into the vessel")

    @cached_property
    def working_paths(self) -> tuple[Points, ...]:
        """The paths in working px (without the half-pixel offset)."""
        return tuple(path * self.scale for path in self.paths)

    @cached_property
    def head(self) -> Point:
        """Median over the frames, in source px."""
        x, y = np.median([path[-1] for path in self.paths], axis=0).tolist()
        return float(x), float(y)

    @cached_property
    def path(self) -> Points:
        """The path whose head is nearest to the median, in source px."""
        return min(self.paths, key=lambda path: float(np.hypot(*(path[-1] - np.array(self.head)))))

    @cached_property
    def heading(self) -> Points:
        """Unit vector in which the robot's end points."""
        return self._direction(_LINE_PX)

    @cached_property
    def tip_heading(self) -> Points:
        """The same of the short end that turns when a tendon is pulled."""
        return self._direction(_TIP_PX)

    def _direction(self, length_px: float) -> Points:
        found = [vector.direction for path in self.working_paths if (vector := fit_robot_vector(path, length_px)) is not None]
        if not found:
            raise HeadNotSeen("the robot's end has no direction: feed it farther into the vessel")
        mean = np.median(np.array(found), axis=0)
        return np.asarray(mean / np.hypot(*mean))


@dataclass(frozen=True, slots=True, eq=False)
class HeadMove:
    """Motion of the head, in working px.

    ``vector`` (2,) is its displacement at the same length of robot; ``lateral_px`` the part to the right of the heading;
    ``longer_px`` how much more of the robot is visible (fed forward), or less (drawn back, or bent out of the image plane).
    ``turned_deg`` is the turn of its tip, positive to the right.
    """

    vector: Points
    lateral_px: float
    longer_px: float
    turned_deg: float = 0.0

    @property
    def size_px(self) -> float:
        return float(np.hypot(*self.vector))


def head_move(rest: Look, moved: Look) -> HeadMove:
    """The head's motion between two looks.

    The end of the mask shifts by some pixels when the tip bends, which would turn the direction of a motion of ten pixels by as
    many degrees. So it is not used: the robot keeps its length, and the head is where that length ends, measured along the path
    from where both paths still coincide.
    """
    before, after = rest.working_paths, moved.working_paths
    pairs = [(one, other) for one in before for other in after]
    anchor_px = min(_ANCHOR_PX, min(float(geometry.arc_length(path)[-1]) for path in (*before, *after)) - _TANGENT_PX)
    found = np.array([_one_move(one, other, anchor_px) for one, other in pairs])
    x, y, longer = np.median(found, axis=0).tolist()
    along, vector = rest.heading, np.array([x, y])
    turned_deg = turn_deg(angle_deg(rest.tip_heading), angle_deg(moved.tip_heading))
    return HeadMove(vector, float(along[0] * vector[1] - along[1] * vector[0]), longer, turned_deg)


def angle_deg(vector: Sequence[float] | Points) -> float:
    """Direction of a vector in the image, -180..180: 0 to the right, 90 down."""
    return float(np.degrees(np.arctan2(vector[1], vector[0])))


def turn_deg(first_deg: float, second_deg: float) -> float:
    """The smaller turn from the first direction to the second, -180..180."""
    return (second_deg - first_deg + 180.0) % 360.0 - 180.0


def _one_move(rest: Points, moved: Points, anchor_px: float) -> tuple[float, float, float]:
    length = float(geometry.arc_length(rest)[-1])
    anchor = _at(rest, length - anchor_px)
    fine = geometry.resample(moved, _STEP_PX)
    along = geometry.arc_length(fine)
    start = float(along[int(np.argmin(np.hypot(*(fine - anchor).T)))])
    end = _at(moved, start + anchor_px)
    longer = float(geometry.arc_length(moved)[-1]) - start - anchor_px
    return float(end[0] - rest[-1, 0]), float(end[1] - rest[-1, 1]), longer


def _at(path: Points, length: float) -> Points:
    """The point at an arc length; beyond the end straight on."""
    along = geometry.arc_length(path)
    end = float(along[-1])
    if length <= end:
        return np.array([np.interp(length, along, path[:, axis]) for axis in (0, 1)])
    back = np.array([np.interp(end - _TANGENT_PX, along, path[:, axis]) for axis in (0, 1)])
    tangent = path[-1] - back
    return np.asarray(path[-1] + tangent / np.hypot(*tangent) * (length - end))


F64 = NDArray[np.float64]
_HALF_WIDTH_PX = 8
_SHEATH_STEP_PX = 1.0
_HEAD_PX = 20.0
"""Length at the head that is left out: it may have moved a little."""
_BEYOND_PX = 20
"""Length of bare robot beyond the changed place that is compared."""
_LEAST_LENGTH = 3
_LEAST_CHANGE, _NOISE_FACTOR = 3.5, 3.5
"""A place has changed by more than this, in grey levels and against the median change."""
_GAP = 6
"""Longest gap in the changed places that is bridged: on a ringed robot the sheath changes mostly the dark parts."""


def sheath_growth(path: Points, first: Image, second: Image) -> float:
    """By how many px the catheter's sheath covers more of the robot in the second mean picture than in the first (H, W, 3).

    0 without a difference. `path` is the robot (N, 2), tail -> head, the same in both.
    """
    one, other = _band(path, first), _band(path, second)
    change = np.abs(one - other).mean(axis=(1, 2))
    usable = len(change) - int(_HEAD_PX / _SHEATH_STEP_PX)
    if usable < _BEYOND_PX + _LEAST_LENGTH:
        return 0.0
    change = change[:usable]
    start, end = _longest_run(change > max(_LEAST_CHANGE, _NOISE_FACTOR * float(np.median(change))))
    if end - start < _LEAST_LENGTH:
        return 0.0
    # beyond the changed place both pictures show the bare robot: the picture that looks like that in the place itself has less
    # sheath
    beyond = np.concatenate([band[end + 2 : min(end + 2 + _BEYOND_PX, usable)] for band in (one, other)])
    if len(beyond) < _BEYOND_PX:
        return 0.0
    bare = np.median(beyond, axis=0)
    strange = [float(np.abs(band[start:end].mean(axis=0) - bare).mean()) for band in (one, other)]
    length_px = (end - start) * _SHEATH_STEP_PX
    return length_px if strange[1] > strange[0] else -length_px


def _band(path: Points, image: Image) -> F64:
    """Colours across the robot at every step along it: (steps, places across, 3)."""
    line = geometry.resample(path, _SHEATH_STEP_PX)
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, None]
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    across = np.arange(-_HALF_WIDTH_PX, _HALF_WIDTH_PX + 1)
    places = (line[:, None, :] + across[None, :, None] * normal[:, None, :]).astype(np.float32)
    seen = cv2.remap(image, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen, np.float64)


def _longest_run(changed: NDArray[np.bool_]) -> tuple[int, int]:
    """Start and end of the longest run, small gaps bridged."""
    best, start, last = (0, 0), -1, -_GAP - 1
    for place in np.flatnonzero(changed).tolist():
        if place - last > _GAP:
            start = place
        last = place
        if last + 1 - start > best[1] - best[0]:
            best = start, last + 1
    return best


_CLEAR_LATERAL_PX, _CLEAR_FEED_PX, _CLEAR_PITCH_PX, _CLEAR_SHEATH_PX = 3.0, 1.5, 1.4, 3.0
"""Least motions that identify a function."""
_SHEATH_FROM_MM = 1.4
"""Least amplitude at which the sheath is looked for."""
_ONE_SIDED = 2.0
"""A tightened wire moves the head by this factor more than a released one."""
_STILL_PX = 0.6
"""Largest motion of a head that stands still."""


class NotIdentified(UserError):
    """Not all functions of the servos are identified; the message names what is missing."""


class Function(StrEnum):
    """What a servo does, as far as one camera can tell."""

    RIGHT = "pulls the head to the right"
    LEFT = "pulls the head to the left"
    PITCH = "pulls the head out of the picture's plane"
    ADVANCE = "feeds the robot"
    DELIVERY = "feeds the catheter"


@dataclass(frozen=True, slots=True, eq=False)
class Wiggle:
    """The robot at rest, and with the servo turned in its positive and in its negative direction, by ``amplitude_mm`` each."""

    amplitude_mm: float
    rest: Look
    plus: Look
    minus: Look


@dataclass(frozen=True, slots=True)
class FeedWay:
    """Motion of the robot in source px per mm that was sent, of ``amplitude_mm`` both ways. ``scale``: working px per source px."""

    px_per_mm: float
    amplitude_mm: float
    head: Point
    scale: float


@dataclass(frozen=True, slots=True)
class ServoFinding:
    """What a servo does. ``sign``: the direction of the servo that tightens the wire or feeds forward. ``seen``: in plain words."""

    function: Function
    sign: Literal[-1, 1]
    seen: str
    way: FeedWay | None = None


@dataclass(frozen=True, slots=True)
class Assignment:
    """The joint of a servo. ``assumed``: one camera cannot tell, so the order of the ids decides."""

    name: JointName
    id: int
    sign: Literal[-1, 1]
    seen: str
    assumed: bool = False


def classify(wiggle: Wiggle) -> ServoFinding | None:
    """What the servo does; None when the motion was not clear: turn it further."""
    plus, minus = head_move(wiggle.rest, wiggle.plus), head_move(wiggle.rest, wiggle.minus)
    sides = abs(plus.lateral_px), abs(minus.lateral_px)
    if max(sides) >= _CLEAR_LATERAL_PX:
        if max(sides) < _ONE_SIDED * min(sides):
            return None
        sign: Literal[-1, 1] = 1 if sides[0] > sides[1] else -1
        lateral_px = plus.lateral_px if sign > 0 else minus.lateral_px
        function = Function.RIGHT if lateral_px > 0 else Function.LEFT
        return ServoFinding(
            function, sign, message("head {a:.0f} px to the {side}", a=abs(lateral_px), side="right" if lateral_px > 0 else "left")
        )
    longer = plus.longer_px, minus.longer_px
    if longer[0] * longer[1] < 0 and min(abs(longer[0]), abs(longer[1])) >= _CLEAR_FEED_PX:
        px_per_mm = abs(longer[0] - longer[1]) / wiggle.rest.scale / (2.0 * wiggle.amplitude_mm)
        way = FeedWay(px_per_mm, wiggle.amplitude_mm, wiggle.rest.head, wiggle.rest.scale)
        return ServoFinding(Function.ADVANCE, 1 if longer[0] > 0 else -1, message("head {a:.0f} px forward", a=max(longer)), way)
    shorter = -plus.longer_px, -minus.longer_px
    if max(shorter) >= _CLEAR_PITCH_PX and max(shorter) > _ONE_SIDED * abs(min(shorter)):
        sign = 1 if shorter[0] > shorter[1] else -1
        return ServoFinding(Function.PITCH, sign, message("{a:.1f} px less of the robot seen", a=max(shorter)))
    if max(abs(value) for value in (*longer, *sides)) > _STILL_PX or wiggle.amplitude_mm < _SHEATH_FROM_MM:
        return None  # a wire that acts out of the image plane may just begin to show
    grown_px = wiggle.rest.scale * sheath_growth(wiggle.rest.path, wiggle.minus.image, wiggle.plus.image)
    if abs(grown_px) >= _CLEAR_SHEATH_PX:
        return ServoFinding(Function.DELIVERY, 1 if grown_px > 0 else -1, message("sheath {a:.0f} px farther", a=abs(grown_px)))
    return None


_ACROSS = 0.3
"""A tendon whose direction is to the side by this share moves the head to the side; the others out of the picture's plane."""


def function_of(joint: JointConfig) -> Function | None:
    """What one camera sees of a joint's servo; None of a rotation: the head stands straight on."""
    if joint.is_tendon:
        across = math.cos(math.radians(joint.angle_deg or 0.0))
        return Function.PITCH if abs(across) < _ACROSS else Function.RIGHT if across > 0.0 else Function.LEFT
    return {JointKind.ADVANCE: Function.ADVANCE, JointKind.DELIVERY: Function.DELIVERY}.get(joint.kind)


def alike(servos: ServosConfig) -> tuple[JointName, ...]:
    """The tendons that one camera cannot tell apart, mostly two: one rises and one falls; empty without such ones."""
    functions = [function_of(joint) for joint in servos.tendons]
    return tuple(joint.name for joint, function in zip(servos.tendons, functions, strict=True) if functions.count(function) > 1)


def assign(found: Mapping[int, ServoFinding], servos: ServosConfig, ids_on_line: Sequence[int] = ()) -> tuple[Assignment, ...]:
    """Names for the servos by id, in the order of the joints.

    A rotation, of which nothing is seen, is the one of `ids_on_line` that is left, and its direction is that of `servos`.

    Raises NotIdentified: a function is missing, several servos have the same one, or more than two tendons look alike.
    """
    named: dict[JointName, Assignment] = {}
    wrong = []
    wanted: dict[Function, list[JointName]] = {}
    for joint in servos.joints:
        if (function := function_of(joint)) is not None:
            wanted.setdefault(function, []).append(joint.name)
        elif len(left := [servo_id for servo_id in ids_on_line if servo_id not in found]) == 1:
            named[joint.name] = Assignment(joint.name, left[0], joint.sign, "nothing was seen of it", assumed=True)
        else:
            wrong.append(f"1 of which nothing is seen, the rotation (found: {', '.join(map(str, left)) or 'none'})")
    indistinct = alike(servos)
    if len(indistinct) > 2:
        raise NotIdentified(f"one camera cannot tell {', '.join(indistinct)} apart: set ids and signs by hand")
    for function, names in wanted.items():
        ids = sorted(servo_id for servo_id, finding in found.items() if finding.function is function)
        if len(ids) != len(names):
            listed = ", ".join(map(str, ids)) or "none"
            wrong.append(f"{len(names)} that {function} (found: {listed})")
            continue
        for name, servo_id in zip(names, ids, strict=True):
            finding = found[servo_id]
            named[name] = Assignment(name, servo_id, finding.sign, finding.seen, assumed=name in indistinct)
    if wrong:
        raise NotIdentified(f"not all servos are clear: there should be {'; '.join(wrong)}; wiggle them again, or set them by hand")
    return tuple(named[name] for name in servos.names)


_FREE_PX = 4.0
"""A head that moves less lies against a wall."""
_MOST_DISAGREEMENT_DEG = 15.0
_IN_PLANE_SHARE = 0.25
"""A pair that moves the head by a smaller share of the other pair's motion acts out of the image plane."""


class SteeringNotSeen(UserError):
    """The head did not move enough to measure a direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """A bend (mm of pull, beyond the opposite tendon's) and the head's motion."""

    pull_mm: float
    move: HeadMove


@dataclass(frozen=True, slots=True)
class _Pair:
    lateral_px_mm: float
    direction_deg: float
    disagreement_deg: float


def learn(pulls: Mapping[str, Pull], heading: Points, tendons: Sequence[JointConfig]) -> SteeringConfig:
    """The steering from bends to the right and left, up and down (``TENDON_ANGLES_DEG``), each from rest. Raises SteeringNotSeen.

    Pairs are evaluated together: what the wall, the bend or the end of the mask add to both motions alike falls out of their
    difference. A bent head starts at right angles to its heading, so the direction is the mean of the measured one and of the
    normal of the heading; how far they disagree is part of the result.
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
    least = _IN_PLANE_SHARE * max(abs(gain) for gain in gains)
    learnt = []
    for joint in tendons:
        angle = math.radians(joint.angle_deg or 0.0)
        shares = math.cos(angle) * gains[0], math.sin(angle) * gains[1]
        pair, gain = (bend, gains[0]) if abs(shares[0]) >= abs(shares[1]) else (pitch, gains[1])
        is_seen = pair is not None and abs(sum(shares)) >= max(least, _ROUNDING)
        direction = turn_deg(0.0, pair.direction_deg + (0.0 if sum(shares) * gain > 0.0 else 180.0)) if is_seen and pair else None
        apart = {name: abs(turn_deg(joint.angle_deg or 0.0, at_deg)) for name, at_deg in TENDON_ANGLES_DEG.items()}
        nearest = min(apart, key=lambda name: apart[name])
        pull = pulls[nearest]
        moved = math.cos(math.radians(apart[nearest])) * (pull.move.size_px if is_seen else abs(pull.move.lateral_px))
        learnt.append(TendonConfig(name=joint.name, direction_deg=direction, moved_px=moved, px_per_mm=moved / pull.pull_mm))
    return SteeringConfig(
        heading_deg=heading_deg,
        roll_deg=math.degrees(math.atan2(gains[1], gains[0])),
        disagreement_deg=max(pair.disagreement_deg for pair in seen),
        turn_deg_per_mm=_turn_deg_per_mm(pulls["right"], pulls["left"]) if abs(gains[0]) >= max(least, _ROUNDING) else None,
        tendons=tuple(learnt),
    )


_ROUNDING = 1e-9


def _turn_deg_per_mm(right: Pull, left: Pull) -> float | None:
    """Turn of the head per millimetre of pull; None when it did not turn with its motion.

    The larger one: a wall on one side holds the head back, and a turn that is taken for too small makes the steering too strong.
    """
    turns = [math.copysign(1.0, pull.move.lateral_px) * pull.move.turned_deg / pull.pull_mm for pull in (right, left)]
    return max(turns) if max(turns) > 0.0 else None


def _pair(one: Pull, other: Pull, heading_deg: float) -> _Pair | None:
    """Sideways motion per millimetre and its direction; None when neither tendon moves the head sideways."""
    if max(abs(one.move.lateral_px), abs(other.move.lateral_px)) < _FREE_PX:
        return None
    way = one.move.vector - other.move.vector
    gain = (one.move.lateral_px - other.move.lateral_px) / (one.pull_mm + other.pull_mm)
    measured = angle_deg(way)
    normal = turn_deg(0.0, heading_deg + math.copysign(90.0, gain))
    apart = turn_deg(measured, normal)
    # where only one side is free the difference is that side's curved motion: the heading is more reliable then
    is_free = min(abs(one.move.lateral_px), abs(other.move.lateral_px)) >= _FREE_PX
    believed = measured if abs(apart) > _MOST_DISAGREEMENT_DEG else measured + (0.5 if is_free else 1.0) * apart
    return _Pair(gain, turn_deg(0.0, believed), abs(apart))


_LEAST_SIDEWAYS_PX, _LEAST_SHORTENING_PX = 1.2, 0.25
"""From here on the head follows the wire."""
_ENOUGH_SIDEWAYS_PX, _ENOUGH_SHORTENING_PX = 5.0, 1.4
"""Enough motion to find where it began."""
_LEAST_POINTS = 2
_STARTS = 401
"""Candidates of the fit."""


class NeverTaut(UserError):
    """The head did not follow the wire, or the wire was never slack: where it becomes taut cannot be found."""


@dataclass(frozen=True, slots=True, eq=False)
class TautReading:
    """The servo at ``position_mm`` (positive tightens), and the head's motion since the wire was slack."""

    position_mm: float
    move: HeadMove


def is_enough(step: TautReading) -> bool:
    """Whether the head has moved enough to find the start; further pulling would only strain the wire."""
    return abs(step.move.lateral_px) >= _ENOUGH_SIDEWAYS_PX or -step.move.longer_px >= _ENOUGH_SHORTENING_PX


def is_begun(step: TautReading) -> bool:
    """Whether the head has begun to follow."""
    return abs(step.move.lateral_px) >= _LEAST_SIDEWAYS_PX or -step.move.longer_px >= _LEAST_SHORTENING_PX


def taut_at_mm(steps: Sequence[TautReading]) -> float:
    """The position at which the wire becomes taut, from `steps` from slack to pulled.

    The head stays while the wire is slack, and then follows it: sideways in proportion to the pull; out of the image plane by a
    shortening that grows with its square, whose root is linear, too. So the start of the line is fitted, without a threshold.

    Raises NeverTaut: fewer than two steps moved the head, or all of them did: then it was taut somewhere before the first.
    """
    sideways = max(abs(step.move.lateral_px) for step in steps) >= _ENOUGH_SIDEWAYS_PX
    least = _LEAST_SIDEWAYS_PX if sideways else math.sqrt(_LEAST_SHORTENING_PX)
    ways = [abs(step.move.lateral_px) if sideways else math.sqrt(max(0.0, -step.move.longer_px)) for step in steps]
    # from the first step on after which the head always follows: one bad look before does not count
    first = len(ways)
    while first > 0 and ways[first - 1] >= least:
        first -= 1
    if len(ways) - first < _LEAST_POINTS:
        raise NeverTaut("the head does not follow the wire: is it hung in, does the head lie free? Or zero it by eye")
    if first == 0:
        raise NeverTaut("the wire was taut before it was pulled: loosen it, then try again, or zero it by eye")
    at = np.array([step.position_mm for step in steps])
    if np.polyfit(at[first:], np.array(ways[first:]), 1)[0] <= 0.0:
        raise NeverTaut("the head does not follow the wire's pull: pull it by hand, or zero it by eye")
    # a root amplifies the noise while the wire is slack, and the last step before may show some motion
    slack = first - 1
    told = np.array([0.0] * slack + ways[first:])
    return _start_of_line(np.concatenate([at[:slack], at[first:]]), told, float(at[first]))


def _start_of_line(at: NDArray[np.float64], ways: NDArray[np.float64], latest: float) -> float:
    """The start of a line that is 0 before and then rises, by least squares over all steps; `latest` at the latest."""
    starts = np.linspace(min(at[0], latest), latest, _STARTS)
    beyond = np.maximum(0.0, at[None, :] - starts[:, None])
    slopes = beyond @ ways / np.maximum((beyond**2).sum(axis=1), 1e-12)
    left_over = ((ways[None, :] - slopes[:, None] * beyond) ** 2).sum(axis=1)
    return float(starts[np.argmin(left_over)])


_NOISE_PX = 1.0
"""Noise of a motion between two looks, in working pixels."""
_LEAST_SHARE = 0.2


def feed_disagreement(
    findings: Mapping[int, ServoFinding],
    assignments: Sequence[Assignment],
    servos: ServosConfig,
    scale: ScaleConfig,
    size: tuple[int, int],
) -> str:
    """A warning when the feed per turn that was seen differs from the configured one; "" where they agree.

    Before identification all servos are turned as if their drums were as large as the largest configured one.
    `findings` are by id, and `size` is (width, height) of the pictures that were looked at.
    """
    (feed,) = servos.joints[servos.places(JointKind.ADVANCE)]
    found = next((findings.get(one.id) for one in assignments if one.name == feed.name), None)
    if found is None or found.function is not Function.ADVANCE or found.way is None:
        return ""
    way = found.way
    turned_as = max(joint.mm_per_turn for joint in servos.joints if joint.kind is not JointKind.ROTATION)
    configured = feed.mm_per_turn
    mm_per_px = mm_per_px_at(scale, way.head, size)
    seen = way.px_per_mm * mm_per_px * turned_as
    noise = _NOISE_PX / way.scale * mm_per_px / way.amplitude_mm * turned_as
    if abs(seen - configured) <= max(_LEAST_SHARE * configured, noise):
        return ""
    return message(
        "the feed goes by about {a:.0f} mm at one turn of the servo's horn, as the camera saw it, and is "
        "configured with {b:g} mm: measure the diameter of its wheel (page Drums)",
        a=seen,
        b=configured,
    )
