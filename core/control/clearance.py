"""Room between the robot's head and the wall of the vessel, from the picture, and warnings that do not flicker.

The lumen is taken as round about the centerline: its radius there, less the head's distance from it, less the robot's own radius.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from core.types import Scene

_LEAST_FREE_PX = 1.0
"""A robot as thick as the lumen has no room at all; below this the share would leap with every pixel."""


@dataclass(frozen=True, slots=True)
class Clearance:
    """``room_px`` from the edge of the head to the wall, in working px; negative: the head reaches into the wall (a breach).

    ``share`` is what is left of the room that there is at this place: 1 on the centerline, 0 at the wall, below 0 a breach.
    ``room_mm`` is None when the scale is not known.
    """

    room_px: float
    share: float
    room_mm: float | None = None

    @property
    def breach(self) -> bool:
        return self.room_px < 0.0


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
    head, nearest = scene.path.head, scene.centerline.nearest
    free_px = scene.centerline.radius_px - scene.path.radius_px
    room_px = free_px - math.hypot(head[0] - nearest[0], head[1] - nearest[1])
    return Clearance(room_px, room_px / max(free_px, _LEAST_FREE_PX), room_px / pixels_per_mm if pixels_per_mm else None)


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
