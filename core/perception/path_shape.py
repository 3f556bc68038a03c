"""The robot's path to sub-pixel precision: centred in its mask, smooth, and as long as the robot is (METHOD sections 2 and 4)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.perception.compiled import loops
from core.types import Mask, Masks, Points

STEP_PX = 2.0
TRIM_RADII = 1.2
"""Thinning bends the skeleton's last radius towards a corner of a blunt end."""
END_HEADING_PX = 16.0
"""The end's direction and bend are taken over this length."""


def refine(points: Points, masks: Masks, radius_px: float, smoothing_px: float, extend: bool) -> tuple[Points, float]:
    """The path through the middle of the robot, and the robot's median radius in px.

    Parameters
    ----------
    points : pixel path (N, 2), tail -> head.
    masks : the robot's clean mask and probability.
    radius_px : rough radius of the robot, which limits how far to the sides is looked.
    smoothing_px : standard deviation of the smoothing along the path; 0 leaves the pixels as they are.
    extend : whether both ends are continued along their tangent to the mask's edge.
    """
    if smoothing_px == 0.0:
        return points, radius_px
    step = min(STEP_PX, smoothing_px)
    line = polyline.smooth(polyline.resample(points, step), smoothing_px / step)
    line, radius_px = _centred(line, masks.robot_probability, radius_px)
    line = polyline.smooth(line, smoothing_px / step)
    if extend and len(line) > 3:
        line = _to_edge(line, masks, radius_px)
        line = _to_edge(line[::-1], masks, radius_px)[::-1]
    return line, radius_px


def _centred(line: Points, probability: NDArray[np.float32], radius_px: float) -> tuple[Points, float]:
    """Each point moved across the path to the middle of the robot's probability there, and the median of the half widths."""
    if len(line) < 3:
        return line, radius_px
    across = polyline.normals(line)
    shift, total = loops.maps.middles(probability, line, across, int(np.ceil(1.5 * radius_px + 2.0)), radius_px)
    seen = total[total > 1.0]
    thickness = polyline.median(seen) if len(seen) else 2.0 * radius_px
    return line + shift[:, None] * across, 0.5 * thickness


def _to_edge(line: Points, masks: Masks, radius_px: float) -> Points:
    """The last point replaced by where the path's own direction leaves the mask."""
    along = polyline.arc_length(line)
    total = float(along[-1])
    trimmed = polyline.cut(line, 0.0, total - min(TRIM_RADII * radius_px, 0.3 * total), along)
    onward = polyline.continued(trimmed, 6.0 * radius_px + 10.0, END_HEADING_PX)
    reach = edge_distance(onward, masks.robot, masks.robot_probability)
    if reach <= 0.0:
        return line
    return np.concatenate([trimmed[:-1], polyline.resample(polyline.cut(onward, 0.0, reach), STEP_PX)])


def edge_distance(places: Points, mask: Mask, probability: NDArray[np.float32]) -> float:
    """How far a line of points, 1 px apart, runs in a mask: to a fraction of a pixel, where the probability falls through 0.5."""
    height, width = mask.shape
    inside = 0
    for x, y in places.tolist():
        column, row = round(x), round(y)
        if not (0 <= column < width and 0 <= row < height and mask[row, column]):
            break
        inside += 1
    if inside in (0, len(places)):  # it never was in the mask, or never leaves it
        return 0.0
    first = max(inside - 2, 0)
    level = polyline.sample(probability, places[first : inside + 2]).tolist()
    for k, (here, there) in enumerate(pairwise(level)):
        if here >= 0.5 > there:
            return float(first + k + (here - 0.5) / (here - there))
    return float(inside - 1)
