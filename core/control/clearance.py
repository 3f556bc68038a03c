"""Clearance between the robot's head and the vessel's wall, with warnings that do not flicker, and the prediction of the head's
path.

The lumen is taken as round about the centerline: its radius beside the head, less the distance of the head's centre from the
centerline, less the robot's own radius. The head is a round end, so its centre lies one radius behind the tip.

Against the twin's truth (36 frames of 5 phantoms, whole perception) the room is 0.4 px too small in the median and 2.8 px too
small in one of ten, mostly where the head was found too far ahead. So a head that touches the wall, as it often does, is told
from a breach, which begins where the picture's own error ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core import geometry
from core.perception.vectors import fit_robot_vector
from core.types import Advice, Points, Scene

_BREACH_PX = 3.0
"""Depth in the wall that is more than an error of the picture."""
_BREACH_BAND_PX = 1.5
"""Hysteresis of a breach."""
_BREACH_DWELL_S = 0.2
"""A breach is reported when it has lasted so long."""
_LEAST_FREE_PX = 1.0
"""Least room of which a share is taken: a robot as thick as the lumen has none."""


@dataclass(frozen=True, slots=True)
class Clearance:
    """``room_px`` from the surface of the head to the wall, in working px; negative: the head seems to reach into the wall.

    ``share`` of the room at this place: 1 on the centerline, 0 at the wall. ``room_mm``: None without a scale.
    """

    room_px: float
    share: float
    room_mm: float | None = None


def clearance_of(scene: Scene, pixels_per_mm: float | None = None) -> Clearance | None:
    """The head's room in a scene; None without a pose. `pixels_per_mm`: working px per mm in the vessel's plane, if known."""
    if scene.pose is None or scene.path is None or scene.centerline is None:
        return None
    robot_px = scene.path.radius_px
    path = scene.path.points
    total_px = float(geometry.arc_length(path)[-1])
    x, y = geometry.cut(path, total_px - robot_px, total_px)[0].tolist()
    offset_px, _, _ = geometry.nearest(scene.centerline.piece, (x, y))
    free_px = scene.centerline.radius_px - robot_px
    room_px = free_px - offset_px
    return Clearance(room_px, room_px / max(free_px, _LEAST_FREE_PX), room_px / pixels_per_mm if pixels_per_mm else None)


class BreachWatch:
    """Reports a breach that has lasted for 0.2 s, until the head is clearly out of the wall again."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._is_reported = False

    def update(self, clearance: Clearance | None, time_s: float) -> bool:
        """Update with every scene, at its capture; None (not known) resets."""
        if clearance is None or clearance.room_px > -_BREACH_PX + (_BREACH_BAND_PX if self._is_reported else 0.0):
            self._since_s, self._is_reported = None, False
            return False
        if self._since_s is None or time_s < self._since_s:
            self._since_s = time_s
        self._is_reported = self._is_reported or time_s - self._since_s >= _BREACH_DWELL_S
        return self._is_reported


class Ladder:
    """The number of rising `limits` that a value exceeds, with hysteresis: up at once, down only `band` below the limit."""

    def __init__(self, limits: Sequence[float], band: float) -> None:
        self._limits = tuple(limits)
        self._band = band
        self._level = 0

    def update(self, value: float | None) -> int:
        """The number of limits exceeded; None (not known) resets to 0."""
        if value is None:
            self._level = 0
            return 0
        exceeded = sum(value > limit for limit in self._limits)
        kept = sum(value > limit - self._band for limit in self._limits)
        self._level = max(exceeded, min(self._level, kept))
        return self._level


_END_PX = 16.0
"""Length of the robot's end that gives the head's direction; the 40 px of the pose lag behind in a bend."""
_SHORTEST_PX = 16.0
"""Least length of a prediction, so that the direction of a slow move is seen, too."""
_STRAIGHT_DEG = 0.5
"""A smaller turn does not count."""
_STEP_PX = 2.0
"""Spacing of the points of a prediction."""


def predict(scene: Scene, advice: Advice, horizon_s: float, pixels_per_mm: float) -> Points | None:
    """The head's path if the advice is followed for `horizon_s`. For display only: no command is made from it.

    Forwards the head follows an arc that has turned by ``steer_deg`` at its end; backwards it comes back along the robot.

    Returns points (N, 2) in working px, N >= 2, from the head onwards; 16 px long at least. None without a pose, and when the
    advice is to stay.
    """
    if scene.pose is None or scene.path is None:
        return None
    advance_mm, steer_deg = advice.advance_mm_s * horizon_s, advice.steer_deg
    if not math.isfinite(advance_mm) or not math.isfinite(steer_deg):
        return None
    if advance_mm == 0.0 and abs(steer_deg) < _STRAIGHT_DEG:
        return None
    length_px = max(abs(advance_mm) * pixels_per_mm, _SHORTEST_PX)
    path = scene.path.points
    if advance_mm < 0.0:
        total_px = float(geometry.arc_length(path)[-1])
        return geometry.cut(path, total_px - length_px, total_px)[::-1]
    end = fit_robot_vector(path, _END_PX)
    return _arc(scene.path.head, end.direction, steer_deg, length_px) if end is not None else None


def _arc(start: tuple[float, float], direction: tuple[float, float], turn_deg: float, length_px: float) -> Points:
    """An arc of that length which leaves `start` in `direction` and has turned at its end (positive: to the right on screen)."""
    along = np.linspace(0.0, length_px, max(3, math.ceil(length_px / _STEP_PX) + 1))
    heading, turn = math.atan2(direction[1], direction[0]), math.radians(turn_deg)
    # the chord of an arc: its length is sinc(half the turn) of the arc's, its direction is half the turn further
    half = turn * along / length_px / 2.0
    chord = along * np.sinc(half / math.pi)
    return np.column_stack([start[0] + chord * np.cos(heading + half), start[1] + chord * np.sin(heading + half)])
