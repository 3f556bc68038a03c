"""Masks as other programs write them: polygons around areas, in whose coordinates a pixel is the square from (0, 0) to (1, 1).

Ours run through the centres of the border pixels (``mask_polygons``): taken for an area, such an outline lacks half a pixel all
around, a quarter of a thin robot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skimage.measure import approximate_polygon, find_contours

from core.study.annotations import MaskPolygon, MaskTarget
from core.study.mask_polygons import polygons_of
from core.types import Mask, Points

_TOLERANCE_PX = 0.25
"""Where an outline cuts off a pixel's corner it still passes its centre at 0.35 px: which pixels lie inside does not change."""


def area_of(points: Points, size: tuple[int, int]) -> Mask:
    """The mask (H, W) of the pixels whose centre lies in a polygon (N, 2); `size` is (width, height).

    Where it crosses itself, what is enclosed twice lies outside.
    """
    width, height = size
    (x0, y0), (x1, y1) = points.T, np.roll(points, -1, axis=0).T
    low, high = (np.clip(np.ceil(ends(y0, y1) - 0.5), 0, height).astype(int) for ends in (np.minimum, np.maximum))
    rows_each = np.maximum(high - low, 0)
    edge = np.repeat(np.arange(len(points)), rows_each)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(rows_each) - rows_each, rows_each) + low[edge]
    x = x0[edge] + (row + 0.5 - y0[edge]) * (x1 - x0)[edge] / (y1 - y0)[edge]
    column = np.clip(np.ceil(x - 0.5), 0, width).astype(int)
    # Where a row's line of centres meets the outline, inside and outside change places.
    changes = np.zeros((height, width + 1), np.uint8)
    np.add.at(changes, (row, column), 1)
    return np.asarray(np.bitwise_and(np.add.accumulate(changes[:, :width], axis=1, dtype=np.uint8), 1).astype(bool))


def polygons_of_area(points: Points, target: MaskTarget, size: tuple[int, int]) -> tuple[MaskPolygon, ...]:
    """Our polygons of another program's one (N, 2); none where it lies beside the picture or between the pixels' centres."""
    return polygons_of(area_of(points, size), target, 0.0)


def area_polygon(mask: Mask) -> NDArray[np.float64] | None:
    """The polygon (N, 2) around a mask (H, W), whose ``area_of`` it is; None where one cannot tell: several pieces, or holes."""
    outlines = find_contours(np.pad(mask, 1).astype(np.float64), 0.5, fully_connected="high")
    if len(outlines) != 1:
        return None
    # From the padded picture's pixel centres (row, column) to corners (x, y); the last point is the first one again.
    return np.asarray(approximate_polygon(outlines[0], _TOLERANCE_PX)[:-1, ::-1] - 0.5)
