"""The robot's path to sub-pixel precision: centred in its mask, smooth, and as long as the robot is (METHOD sections 2 and 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Mask, Masks, Points

STEP_PX = 2.0
TRIM_RADII = 1.2
"""Thinning bends the skeleton's last radius towards a corner of a blunt end."""
END_HEADING_PX = 16.0
"""The end's direction and bend are taken over this length."""
BEND_SHARE = 0.5
"""So much of the bend is continued beyond it: noise bends too."""


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
    side = int(np.ceil(1.5 * radius_px + 2.0))
    offsets = np.arange(-side, side + 1, dtype=np.float64)
    across = polyline.normals(line)
    places = line[:, None, :] + offsets[None, :, None] * across[:, None, :]
    weight = polyline.sample(probability, places)
    # Looking outwards the weight may only fall: another stretch of robot close by does not pull.
    weight[:, side:] = np.minimum.accumulate(weight[:, side:], axis=1)
    weight[:, side::-1] = np.minimum.accumulate(weight[:, side::-1], axis=1)
    total = weight.sum(axis=1)
    shift = np.where(total > 1.0, (weight @ offsets) / np.maximum(total, 1e-6), 0.0)
    shift = np.clip(shift, -radius_px, radius_px)
    width = float(np.median(total[total > 1.0])) if np.any(total > 1.0) else 2.0 * radius_px
    return line + shift[:, None] * across, 0.5 * width


def _to_edge(line: Points, masks: Masks, radius_px: float) -> Points:
    """The last point replaced by where the path's own direction leaves the mask."""
    along = polyline.arc_length(line)
    trimmed = polyline.cut(line, 0.0, along[-1] - min(TRIM_RADII * radius_px, 0.3 * along[-1]))
    onward = _continued(trimmed, 6.0 * radius_px + 10.0)
    reach = edge_distance(onward, masks.robot, masks.robot_probability)
    if reach <= 0.0:
        return line
    return np.concatenate([trimmed[:-1], polyline.resample(polyline.cut(onward, 0.0, reach), STEP_PX)])


def _continued(line: Points, length_px: float) -> Points:
    """How the path would go on from its last point, bending as it did before: a point every px, the last point first."""
    along = polyline.arc_length(line)
    marks = along[-1] - np.array([0.0, 0.5, 1.0]) * min(END_HEADING_PX, along[-1])
    last, middle, first = polyline.point_at(line, along, marks)
    before, after = np.arctan2(*(middle - first)[::-1]), np.arctan2(*(last - middle)[::-1])
    turn = float((after - before + np.pi) % (2.0 * np.pi) - np.pi)
    per_px = BEND_SHARE * turn / max(0.5 * END_HEADING_PX, 1.0)
    # From the middle of the last half, where its chord has the path's direction, to each further step.
    headings = after + per_px * (0.25 * END_HEADING_PX + 0.5 + np.arange(int(length_px)))
    steps = np.column_stack([np.cos(headings), np.sin(headings)])
    return np.concatenate([last[None], last + np.cumsum(steps, axis=0)])


def edge_distance(places: Points, mask: Mask, probability: NDArray[np.float32]) -> float:
    """How far a line of points, 1 px apart, runs in a mask: to a fraction of a pixel, where the probability falls through 0.5."""
    height, width = mask.shape
    columns, rows = np.rint(places[:, 0]).astype(int), np.rint(places[:, 1]).astype(int)
    on_image = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    inside = on_image & mask[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    outside = np.flatnonzero(~inside)
    if len(outside) == 0 or outside[0] == 0:
        return 0.0
    last = int(outside[0]) - 1
    level = polyline.sample(probability, places[max(last - 1, 0) : last + 3])
    falls = np.flatnonzero((level[:-1] >= 0.5) & (level[1:] < 0.5))
    if len(falls) == 0:
        return float(last)
    k = int(falls[0])
    return float(max(last - 1, 0) + k + (level[k] - 0.5) / (level[k] - level[k + 1]))
