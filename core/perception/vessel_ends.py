"""Ends of vessels: thinning turns the last radius or two of a skeleton towards a corner, and stops short of the image's border."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.perception.compiled import loops
from core.types import Mask, Points

STEP_PX = 2.0
TRIM_RADII = 1.5
BORDER_RADII = 1.2
"""Where the image cuts a vessel off at a slant, the skeleton runs into the sharp corner this near to the border."""
HEADING_PX = 24.0
"""A vessel's direction and bend at its end are taken over this length, and at least a radius."""
REACH_RADII = 3.0
"""An end this near to the image's border goes on to it."""
WALL_SEARCH_PX = 8
WIDTH_SHARE = 0.15
"""What is narrower or wider than the vessel by more than this (and a pixel) is its end, or a branch's opening."""
LEAST_POINTS = 3
STIFFNESS = 0.15
"""How hard it is for walls to turn and to bend a line, in points of it."""


def led_on(points: Points, radius_px: float, vessel: Mask) -> Points:
    """A centerline without the last part, which thinning has turned aside, and in its place one that runs between the walls there.

    It ends as far out as the skeleton did, or goes on to the image's border.

    Parameters
    ----------
    points : the centerline (N, 2), the end in question last.
    radius_px : the lumen's radius at this end.
    vessel : the vessel's mask (h, w).
    """
    limit = np.array([vessel.shape[1] - 1.0, vessel.shape[0] - 1.0])
    kept = points[: len(points) - min(_hook(points, radius_px, limit), 2 * len(points) // 3)]
    lost_px = math.dist(points[-1].tolist(), kept[-1].tolist())
    onward = polyline.continued(kept, max(REACH_RADII * radius_px, 1.5 * lost_px) + 1.0, max(radius_px, HEADING_PX))
    # Walls are looked for as far as the mask is known to reach.
    onward = loops.openings.end_between_walls(
        onward, radius_px, lost_px, round(STEP_PX), vessel, WALL_SEARCH_PX, WIDTH_SHARE, LEAST_POINTS, STIFFNESS
    )
    way_out = _way_out(onward, limit)
    reach = lost_px if way_out is None or way_out > max(REACH_RADII * radius_px, lost_px) else way_out
    if reach < 0.5:
        return kept
    return np.concatenate([kept[:-1], polyline.resample(polyline.cut(onward, 0.0, reach), STEP_PX)])


def _hook(points: Points, radius_px: float, limit: NDArray[np.float64]) -> int:
    """How many of the last points thinning may have turned aside."""
    count = round(TRIM_RADII * radius_px / STEP_PX)
    if float(np.minimum(points[-1], limit - points[-1]).min()) < 1.5 * radius_px:
        to_side = np.minimum(points, limit - points)
        clear = np.minimum(to_side[::-1, 0], to_side[::-1, 1]) >= BORDER_RADII * radius_px
        count = max(count, int(clear.argmax()))
    return count


def _way_out(onward: Points, limit: NDArray[np.float64]) -> float | None:
    """How far a line of points, 1 px apart, runs up to the image's last row or column of pixels; None: it does not get there."""
    beyond = np.maximum(-onward, onward - limit).max(axis=1)
    first = int((beyond >= 0.0).argmax())
    if beyond[first] < 0.0:
        return None
    before = beyond[first - 1] if first else beyond[first] - 1.0
    return max(0.0, float(first - beyond[first] / (beyond[first] - before)))
