"""Ends of vessels: thinning turns the last radius or two of a skeleton towards a corner, and stops short of the image's border."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.perception.lumen import two_shapes, wall_distances
from core.types import Points

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


def led_on(points: Points, radius_px: float, level: NDArray[np.float32]) -> Points:
    """A centerline without the last part, which thinning has turned aside, and in its place one that runs between the walls there.

    It ends as far out as the skeleton did, or goes on to the image's border.

    Parameters
    ----------
    points : centerline (N, 2), the end in question last.
    radius_px : the lumen's radius at this end.
    level : the vessel's mask or probability (h, w).
    """
    limit = np.array([level.shape[1] - 1.0, level.shape[0] - 1.0])
    kept = points[: len(points) - min(_hook(points, radius_px, limit), 2 * len(points) // 3)]
    lost_px = math.dist(points[-1].tolist(), kept[-1].tolist())
    onward = polyline.continued(kept, max(REACH_RADII * radius_px, 1.5 * lost_px) + 1.0, max(radius_px, HEADING_PX))
    onward = _between_walls(onward, radius_px, level, lost_px)
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


def _between_walls(onward: Points, radius_px: float, level: NDArray[np.float32], length_px: float) -> Points:
    """A line of points, 1 px apart, turned and bent into the middle as far as both walls are seen, and straight on from there."""
    normal = polyline.normals(onward)
    every = np.s_[: int(length_px) + 1 : round(STEP_PX)]
    places, directions = onward[every], normal[every]
    both_ways = np.concatenate([directions, -directions])
    radius = np.full(len(both_ways), radius_px)
    right, left = wall_distances(level, np.concatenate([places, places]), both_ways, radius, WALL_SEARCH_PX).reshape(2, -1)
    as_wide = np.flatnonzero(np.abs(0.5 * (right + left) - radius_px) < WIDTH_SHARE * radius_px + 1.0)
    if len(as_wide) < LEAST_POINTS:
        return onward
    share = np.arange(len(onward)) / max(length_px, 1.0)
    seen = share[every][as_wide]
    turn, bend = two_shapes(np.stack([seen, seen**2]), 0.5 * (right - left)[as_wide], np.ones(len(seen)), STIFFNESS)
    last = seen[-1]
    shift = turn * share + bend * np.where(share <= last, share**2, last * (2.0 * share - last))
    return onward + shift[:, None] * normal


def _way_out(onward: Points, limit: NDArray[np.float64]) -> float | None:
    """How far a line of points, 1 px apart, runs up to the image's last row or column of pixels; None: it does not get there."""
    beyond = np.maximum(-onward, onward - limit).max(axis=1)
    first = int((beyond >= 0.0).argmax())
    if beyond[first] < 0.0:
        return None
    before = beyond[first - 1] if first else beyond[first] - 1.0
    return max(0.0, float(first - beyond[first] / (beyond[first] - before)))
