"""Where the head goes next if the advice is followed: the ghost that the live view shows. A picture, no command is made from it."""

from __future__ import annotations

import math

import numpy as np

from core.perception import polyline
from core.perception.vectors import fit_robot_vector
from core.types import Advice, Points, Scene

_END_PX = 16.0
"""End of the robot whose direction is the head's; the 40 px of the pose lag behind in a bend."""
_SHORTEST_PX = 16.0
"""So long is the ghost at least: which way a slow move goes must be seen, too."""
_STRAIGHT_DEG = 0.5
_STEP_PX = 2.0


def predict(scene: Scene, advice: Advice, horizon_s: float, pixels_per_mm: float) -> Points | None:
    """The head's way during the next move.

    Parameters
    ----------
    scene : with a pose.
    advice : forwards the head follows an arc that has turned by ``steer_deg`` at its end; backwards it comes back along the robot.
    horizon_s : for so long the advice is followed.
    pixels_per_mm : working px per mm.

    Returns
    -------
    Points
        (N, 2) in working px, N >= 2, from the head onwards; at least 16 px long where the robot lets it. None without a pose, and
        when the advice is to stay as it is.
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
        total_px = float(polyline.arc_length(path)[-1])
        return polyline.cut(path, total_px - length_px, total_px)[::-1]
    end = fit_robot_vector(path, _END_PX)
    return _arc(scene.path.head, end.direction, steer_deg, length_px) if end is not None else None


def _arc(start: tuple[float, float], direction: tuple[float, float], turn_deg: float, length_px: float) -> Points:
    """An arc of that length which leaves `start` in `direction` and has turned at its end (positive: to the right on screen)."""
    along = np.linspace(0.0, length_px, max(3, math.ceil(length_px / _STEP_PX) + 1))
    heading, turn = math.atan2(direction[1], direction[0]), math.radians(turn_deg)
    # a chord of an arc: its length is sinc(half the turn) of the arc's, its direction lies half the turn further
    half = turn * along / length_px / 2.0
    chord = along * np.sinc(half / math.pi)
    return np.column_stack([start[0] + chord * np.cos(heading + half), start[1] + chord * np.sin(heading + half)])
