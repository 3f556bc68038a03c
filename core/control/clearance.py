"""Room between the robot's head and the wall of the vessel, from the picture, and warnings that do not flicker.

The lumen is taken as round about the centerline: its radius beside the head, less the distance of the head's centre from the
centerline, less the robot's own radius. The head is a round end, so its centre lies one radius behind the tip: taken at the tip,
the room of a head that points at the wall comes out up to a radius too small.

In the twin a robot lies against the wall much of the time, with 0.5 px of true room. Against the truth (36 frames of 5 phantoms,
whole perception) the room is 0.4 px too small in the median and 2.8 px too small in one of ten, mostly where the head was found too
far ahead. So touching is told from a breach, which begins where the picture's own error ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from core.perception import polyline
from core.types import Point, Points, Scene

BREACH_PX = 3.0
"""So far the head must reach into the wall to be more than an error of the picture."""
_BREACH_BAND_PX = 1.5
_BREACH_DWELL_S = 0.2
_LEAST_FREE_PX = 1.0
"""A robot as thick as the lumen has no room at all; below this the share would leap with every pixel."""


@dataclass(frozen=True, slots=True)
class Clearance:
    """``room_px`` from the surface of the head to the wall, in working px; negative: the head seems to reach into the wall.

    ``share`` is what is left of the room that there is at this place: 1 on the centerline, 0 at the wall. ``room_mm`` is None when
    the scale is not known.
    """

    room_px: float
    share: float
    room_mm: float | None = None

    @property
    def breach(self) -> bool:
        """More than an error of the picture; ``BreachWatch`` waits until that lasts."""
        return self.room_px < -BREACH_PX


def clearance_of(scene: Scene, pixels_per_mm: float | None = None) -> Clearance | None:
    """The head's room in a scene.

    Parameters
    ----------
    pixels_per_mm : working px per mm in the plane of the vessel; None: no millimetres.

    Returns
    -------
    Clearance
        None without a pose: where the head is, or in which vessel, is then not known.
    """
    if scene.pose is None or scene.path is None or scene.centerline is None:
        return None
    robot_px = scene.path.radius_px
    offset_px, _, _ = polyline.nearest(scene.centerline.piece, _head_centre(scene.path.points, robot_px))
    free_px = scene.centerline.radius_px - robot_px
    room_px = free_px - offset_px
    return Clearance(room_px, room_px / max(free_px, _LEAST_FREE_PX), room_px / pixels_per_mm if pixels_per_mm else None)


def _head_centre(path: Points, radius_px: float) -> Point:
    total_px = float(polyline.arc_length(path)[-1])
    x, y = polyline.cut(path, total_px - radius_px, total_px)[0].tolist()
    return x, y


class BreachWatch:
    """Says that there is a breach once it has lasted for 0.2 s, and until the head is clearly out of the wall again."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._told = False

    def update(self, clearance: Clearance | None, time_s: float) -> bool:
        """With every scene, at its capture; None (not known) starts anew."""
        if clearance is None or clearance.room_px > -BREACH_PX + (_BREACH_BAND_PX if self._told else 0.0):
            self._since_s, self._told = None, False
            return False
        if self._since_s is None or time_s < self._since_s:
            self._since_s = time_s
        self._told = self._told or time_s - self._since_s >= _BREACH_DWELL_S
        return self._told


class Ladder:
    """Which of some rising limits a value exceeds: it climbs at once, and comes down only when the value is `band` below the limit.

    Parameters
    ----------
    limits : rising.
    band : what keeps a value that swings about a limit from making a warning flicker.
    """

    def __init__(self, limits: Sequence[float], band: float) -> None:
        self._limits = tuple(limits)
        self._band = band
        self._level = 0

    def update(self, value: float | None) -> int:
        """The number of limits exceeded; None (not known) starts anew at 0."""
        if value is None:
            self._level = 0
            return 0
        exceeded = sum(value > limit for limit in self._limits)
        kept = sum(value > limit - self._band for limit in self._limits)
        self._level = max(exceeded, min(self._level, kept))
        return self._level
