"""Ends of vessels: thinning turns the last radius or two of a skeleton towards a corner, and stops short of the image's border."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.perception import bundle, polyline
from core.perception.bundle import Bundle
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


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """What of a centerline is ``kept`` (N, 2), how it would go on from there, 1 px apart (M, 2), and what was cut off."""

    kept: Points
    onward: Points
    radius_px: float
    lost_px: float

    @property
    def seen(self) -> slice:
        """Where walls are looked for: every ``STEP_PX`` as far as the mask is known to reach."""
        return np.s_[: int(self.lost_px) + 1 : round(STEP_PX)]


def led_on(ends: Sequence[tuple[Points, float]], level: NDArray[np.float32]) -> list[Points]:
    """Centerlines without the last part, which thinning has turned aside, and in its place one that runs between the walls there.

    Each ends as far out as the skeleton did, or goes on to the image's border. All walls are looked for at once, which takes
    hardly longer than for one end.

    Parameters
    ----------
    ends : centerlines (N, 2), the end in question last, each with the lumen's radius in px at this end.
    level : the vessel's mask or probability (h, w).
    """
    if not ends:
        return []
    limit = np.array([level.shape[1] - 1.0, level.shape[0] - 1.0])
    cut = [_cut_off(points, radius_px, limit) for points, radius_px in ends]
    lines = Bundle.of([end.onward for end in cut])
    normals = lines.split(bundle.normals(lines))
    places = Bundle.of([end.onward[end.seen] for end in cut])
    directions = np.concatenate([normal[end.seen] for end, normal in zip(cut, normals, strict=True)])
    radius = np.repeat([end.radius_px for end in cut], np.diff(places.starts))
    right, left = wall_distances(level, places.points, directions, radius, WALL_SEARCH_PX)
    walls = zip(places.split(right), places.split(left), strict=True)
    return [_joined(end, _between(end, normal, *both), limit) for end, normal, both in zip(cut, normals, walls, strict=True)]


def _cut_off(points: Points, radius_px: float, limit: NDArray[np.float64]) -> _End:
    kept = points[: len(points) - min(_hook(points, radius_px, limit), 2 * len(points) // 3)]
    lost_px = math.dist(points[-1].tolist(), kept[-1].tolist())
    onward = polyline.continued(kept, max(REACH_RADII * radius_px, 1.5 * lost_px) + 1.0, max(radius_px, HEADING_PX))
    return _End(kept, onward, radius_px, lost_px)


def _joined(end: _End, onward: Points, limit: NDArray[np.float64]) -> Points:
    """The centerline with its new last part, as far as that goes."""
    way_out = _way_out(onward, limit)
    reach = end.lost_px if way_out is None or way_out > max(REACH_RADII * end.radius_px, end.lost_px) else way_out
    if reach < 0.5:
        return end.kept
    return np.concatenate([end.kept[:-1], polyline.resample(polyline.cut(onward, 0.0, reach), STEP_PX)])


def _hook(points: Points, radius_px: float, limit: NDArray[np.float64]) -> int:
    """How many of the last points thinning may have turned aside."""
    count = round(TRIM_RADII * radius_px / STEP_PX)
    if float(np.minimum(points[-1], limit - points[-1]).min()) < 1.5 * radius_px:
        to_side = np.minimum(points, limit - points)
        clear = np.minimum(to_side[::-1, 0], to_side[::-1, 1]) >= BORDER_RADII * radius_px
        count = max(count, int(clear.argmax()))
    return count


def _between(end: _End, normal: Points, right: NDArray[np.float64], left: NDArray[np.float64]) -> Points:
    """How an end goes on, turned and bent into the middle as far as both walls are seen, and straight on from there.

    `normal` (M, 2) is across it; `right` and `left` are how far its walls are, where they were looked for.
    """
    as_wide = np.flatnonzero(np.abs(0.5 * (right + left) - end.radius_px) < WIDTH_SHARE * end.radius_px + 1.0)
    if len(as_wide) < LEAST_POINTS:
        return end.onward
    share = np.arange(len(end.onward)) / max(end.lost_px, 1.0)
    seen = share[end.seen][as_wide]
    turn, bend = two_shapes(np.stack([seen, seen**2]), 0.5 * (right - left)[as_wide], np.ones(len(seen)), STIFFNESS)
    last = seen[-1]
    shift = turn * share + bend * np.where(share <= last, share**2, last * (2.0 * share - last))
    return end.onward + shift[:, None] * normal


def _way_out(onward: Points, limit: NDArray[np.float64]) -> float | None:
    """How far a line of points, 1 px apart, runs up to the image's last row or column of pixels; None: it does not get there."""
    beyond = np.maximum(-onward, onward - limit).max(axis=1)
    first = int((beyond >= 0.0).argmax())
    if beyond[first] < 0.0:
        return None
    before = beyond[first - 1] if first else beyond[first] - 1.0
    return max(0.0, float(first - beyond[first] / (beyond[first] - before)))
