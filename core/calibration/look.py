"""What the camera saw of the robot at rest, and how its head moved between two such looks. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from core.errors import UserError
from core.perception import polyline
from core.perception.vectors import fit_robot_vector
from core.types import Image, Point, Points

_ANCHOR_PX = 90.0
"""So far behind the head both paths are laid over each other; within 50 and 200 px it makes no difference."""
_LEAST_ANCHOR_PX = 30.0
_STEP_PX = 0.5
_LINE_PX = 40.0
_TANGENT_PX = 8.0
_LEAST_LOOKS = 3


class HeadNotSeen(UserError):
    """Perception does not find the robot, or too little of it."""


@dataclass(frozen=True, eq=False)
class Look:
    """Some frames of a robot that stands still: its paths (each (N, 2), source px, tail -> head) and their mean picture.

    ``scale`` is working pixels per source pixel: what is measured is told in working pixels, in which the network's noise is always
    the same, however fine the camera's picture is.

    Raises
    ------
    HeadNotSeen
        Fewer than three paths were found, or they are too short to have a direction.
    """

    paths: tuple[Points, ...]
    image: Image
    scale: float = 1.0

    def __post_init__(self) -> None:
        if len(self.paths) < _LEAST_LOOKS:
            raise HeadNotSeen("the robot's head is not seen: move the robot until all of its last centimetres are in the picture")
        if min(float(polyline.arc_length(path)[-1]) for path in self.working_paths) < _LEAST_ANCHOR_PX + _TANGENT_PX:
            raise HeadNotSeen("too little of the robot is seen: feed it farther into the vessel")

    @cached_property
    def working_paths(self) -> tuple[Points, ...]:
        """The paths in working px, but for the half pixel that lies between the two."""
        return tuple(path * self.scale for path in self.paths)

    @cached_property
    def head(self) -> Point:
        """Median over the frames, in source px."""
        x, y = np.median([path[-1] for path in self.paths], axis=0).tolist()
        return float(x), float(y)

    @cached_property
    def path(self) -> Points:
        """The path whose head lies nearest to the median, in source px."""
        return min(self.paths, key=lambda path: float(np.hypot(*(path[-1] - np.array(self.head)))))

    @cached_property
    def heading(self) -> Points:
        """Unit vector in which the robot's end points."""
        found = [vector.direction for path in self.working_paths if (vector := fit_robot_vector(path, _LINE_PX)) is not None]
        if not found:
            raise HeadNotSeen("the robot's end has no direction: feed it farther into the vessel")
        mean = np.median(np.array(found), axis=0)
        return np.asarray(mean / np.hypot(*mean))


@dataclass(frozen=True, slots=True, eq=False)
class HeadMove:
    """How the head moved, in working px.

    ``vector`` (2,) is the way of the head at the length of robot that it had; ``lateral_px`` its part to the right of the heading;
    ``longer_px`` how much more of the robot is seen (fed forward), or less (drawn back, or bent out of the picture).
    """

    vector: Points
    lateral_px: float
    longer_px: float

    @property
    def size_px(self) -> float:
        return float(np.hypot(*self.vector))


def head_move(rest: Look, moved: Look) -> HeadMove:
    """The head's motion between two looks.

    Where the mask ends shifts by some pixels when the tip bends, and would turn the direction of a motion of ten pixels by as many
    degrees. So the end of the mask is not believed: the robot is as long as it was, and the head is where that length ends,
    measured along the path from where both paths still lie on each other.
    """
    before, after = rest.working_paths, moved.working_paths
    pairs = [(one, other) for one in before for other in after]
    anchor_px = min(_ANCHOR_PX, min(float(polyline.arc_length(path)[-1]) for path in (*before, *after)) - _TANGENT_PX)
    found = np.array([_one_move(one, other, anchor_px) for one, other in pairs])
    x, y, longer = np.median(found, axis=0).tolist()
    along, vector = rest.heading, np.array([x, y])
    return HeadMove(vector, float(along[0] * vector[1] - along[1] * vector[0]), longer)


def angle_deg(vector: Sequence[float] | Points) -> float:
    """Direction of a vector in the image, -180..180: 0 to the right, 90 down."""
    return float(np.degrees(np.arctan2(vector[1], vector[0])))


def turn_deg(first_deg: float, second_deg: float) -> float:
    """The smaller turn from the first direction to the second, -180..180."""
    return (second_deg - first_deg + 180.0) % 360.0 - 180.0


def _one_move(rest: Points, moved: Points, anchor_px: float) -> tuple[float, float, float]:
    length = float(polyline.arc_length(rest)[-1])
    anchor = _at(rest, length - anchor_px)
    fine = polyline.resample(moved, _STEP_PX)
    along = polyline.arc_length(fine)
    start = float(along[int(np.argmin(np.hypot(*(fine - anchor).T)))])
    end = _at(moved, start + anchor_px)
    longer = float(polyline.arc_length(moved)[-1]) - start - anchor_px
    return float(end[0] - rest[-1, 0]), float(end[1] - rest[-1, 1]), longer


def _at(path: Points, length: float) -> Points:
    """The point at an arc length; beyond the end straight on."""
    along = polyline.arc_length(path)
    end = float(along[-1])
    if length <= end:
        return np.array([np.interp(length, along, path[:, axis]) for axis in (0, 1)])
    back = np.array([np.interp(end - _TANGENT_PX, along, path[:, axis]) for axis in (0, 1)])
    tangent = path[-1] - back
    return np.asarray(path[-1] + tangent / np.hypot(*tangent) * (length - end))
