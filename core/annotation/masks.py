"""Masks as polygons: outlines through the centres of the border pixels, holes as polygons of their own.

Masks as other programs write them: polygons around areas, in whose coordinates a pixel is the square from (0, 0) to (1, 1).

Ours run through the centres of the border pixels (``mask_polygons``): taken for an area, such an outline lacks half a pixel all
around, a quarter of a thin robot.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.annotation.model import Line, MaskPolygon, MaskTarget
from core.types import Mask, Points

TOLERANCE_PX = 0.7
"""Outlines may miss the border pixels' centres by this much; it saves most of their points."""
_MIN_AREA_PX = 12.0
_CRUMB_PX = 5.0
_SHIFT = 6
_BRUSH_SIDE_PX = 2048
"""The brush paints in no finer raster than this on the longer side: at 8k a stroke would take half a second."""


def polygons_of(mask: Mask, target: MaskTarget, tolerance_px: float = TOLERANCE_PX) -> tuple[MaskPolygon, ...]:
    """The outlines of a mask (H, W), the largest first and each followed by its holes: what lies in a hole comes after that.

    An outline may be off by `tolerance_px`; 0 keeps the mask, but for pieces of one or two pixels.
    """
    contours, hierarchy = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    parents: list[int] = np.asarray(hierarchy).reshape(-1, 4)[:, 3].tolist() if len(contours) else []
    outlines = [_outline(contour, target, tolerance_px, parent >= 0) for contour, parent in zip(contours, parents, strict=True)]
    holes: dict[int, list[MaskPolygon]] = {}
    for outline, parent in zip(outlines, parents, strict=True):
        if parent >= 0:
            holes.setdefault(parent, []).extend(outline)
    outer = [place for place, outline in enumerate(outlines) if parents[place] < 0 and outline]
    outer.sort(key=lambda place: -cv2.contourArea(contours[place]))
    return tuple(polygon for place in outer for polygon in (*outlines[place], *holes.get(place, [])))


def _outline(contour: Any, target: MaskTarget, tolerance_px: float, is_hole: bool) -> list[MaskPolygon]:
    if len(contour) < 3 or (tolerance_px > 0 and cv2.contourArea(contour) < _MIN_AREA_PX):
        return []
    points = cv2.approxPolyDP(contour, tolerance_px, True)[:, 0]
    if tolerance_px == 0 and len(points) < 3:  # a line of pixels, there and back
        points = contour[:, 0]
    return [MaskPolygon(target, _line(points), is_hole)] if len(points) >= 3 else []


def fill(polygons: Iterable[MaskPolygon], target: MaskTarget, size: tuple[int, int]) -> Mask:
    """The mask (H, W) of all polygons of `target`; `size` is (width, height). Holes are cut in the order of the polygons."""
    mask = np.zeros((size[1], size[0]), np.uint8)
    for polygon in polygons:
        if polygon.target is not target or len(polygon.points) < 3:
            continue
        outline = _fixed(polygon.points)
        if not polygon.is_hole:
            cv2.fillPoly(mask, [outline], 255, cv2.LINE_8, _SHIFT)
            continue
        # The outline of a hole runs through mask pixels around it: what it encloses is cut, itself it stays.
        inside = np.zeros_like(mask)
        cv2.fillPoly(inside, [outline], 255, cv2.LINE_8, _SHIFT)
        cv2.polylines(inside, [outline], True, 0, 1, cv2.LINE_8, _SHIFT)
        mask[inside > 0] = 0
    return mask > 0


def paint(
    polygons: tuple[MaskPolygon, ...], target: MaskTarget, stroke: Points, radius_px: float, size: tuple[int, int], *, erase: bool
) -> tuple[MaskPolygon, ...]:
    """The polygons after a stroke of the brush: `stroke` (N, 2) is where its middle went, in image pixels of `size`."""
    touched = _touching([polygon for polygon in polygons if polygon.target is target], _reach(stroke, radius_px + 2.0))
    # What the brush did not come near stays as it was drawn; the rest keeps every pixel, however often it is painted on.
    others = tuple(polygon for polygon in polygons if polygon not in touched)
    polygons = tuple(touched)
    scale = min(1.0, _BRUSH_SIDE_PX / max(size))
    if scale < 1.0:
        polygons, stroke, radius_px = _scaled(polygons, scale), (stroke + 0.5) * scale - 0.5, radius_px * scale
        size = (round(size[0] * scale), round(size[1] * scale))
    mask = fill(polygons, target, size).astype(np.uint8)
    ink = 0 if erase else 1
    points = np.round(stroke * (1 << _SHIFT)).astype(np.int32)
    for point in points[[0, -1]]:
        cv2.circle(mask, point.tolist(), round(radius_px * (1 << _SHIFT)), ink, -1, cv2.LINE_8, _SHIFT)
    if len(points) > 1:
        cv2.polylines(mask, [points.reshape(-1, 1, 2)], False, ink, max(1, round(2 * radius_px)), cv2.LINE_8, _SHIFT)
    painted = polygons_of(mask > 0, target, 0.0)
    if erase:
        painted = tuple(polygon for polygon in painted if not _is_crumb(polygon, _reach(stroke, radius_px + _CRUMB_PX)))
    return others + (_scaled(painted, 1.0 / scale) if scale < 1.0 else painted)


_Box = tuple[float, float, float, float]


def _touching(polygons: list[MaskPolygon], box: _Box) -> list[MaskPolygon]:
    """Those polygons whose boxes overlap `box` (left, top, right, bottom), or that of another of these: holes go with their
    outlines."""
    boxes = [_box(polygon) for polygon in polygons]
    reached, found = [box], set[int]()
    while reached:
        left, top, right, bottom = reached.pop()
        for place, other in enumerate(boxes):
            if place not in found and other[0] <= right and other[2] >= left and other[1] <= bottom and other[3] >= top:
                found.add(place)
                reached.append(other)
    return [polygons[place] for place in sorted(found)]


def _box(polygon: MaskPolygon) -> _Box:
    across, down = zip(*polygon.points, strict=True)
    return min(across) - 1.0, min(down) - 1.0, max(across) + 1.0, max(down) + 1.0


def _reach(stroke: Points, around_px: float) -> _Box:
    (left, top), (right, bottom) = stroke.min(axis=0).tolist(), stroke.max(axis=0).tolist()
    return left - around_px, top - around_px, right + around_px, bottom + around_px


def _is_crumb(polygon: MaskPolygon, reach: _Box) -> bool:
    """Whether it is a small piece that the eraser left beside its way."""
    left, top, right, bottom = _box(polygon)
    beside = left >= reach[0] and top >= reach[1] and right <= reach[2] and bottom <= reach[3]
    return beside and not polygon.is_hole and cv2.contourArea(np.array(polygon.points, np.float32)) < _MIN_AREA_PX


def _scaled(polygons: tuple[MaskPolygon, ...], scale: float) -> tuple[MaskPolygon, ...]:
    """The polygons in an image of another size; pixel centres are at integers in both."""
    return tuple(
        replace(mask, points=tuple(((x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5) for x, y in mask.points)) for mask in polygons
    )


def simplify(polygons: tuple[MaskPolygon, ...], target: MaskTarget, tolerance_px: float) -> tuple[MaskPolygon, ...]:
    """Fewer points on the polygons of `target`: none moves the outline by more than `tolerance_px`."""
    return tuple(
        polygon if polygon.target is not target else MaskPolygon(target, _thinned(polygon.points, tolerance_px), polygon.is_hole)
        for polygon in polygons
    )


def _thinned(points: Line, tolerance_px: float) -> Line:
    outline = np.array(points, np.float32).reshape(-1, 1, 2)
    fewer = cv2.approxPolyDP(outline, tolerance_px, True)[:, 0]
    return _line(fewer) if len(fewer) >= 3 else points


def _fixed(points: Line) -> NDArray[np.int32]:
    return np.round(np.array(points) * (1 << _SHIFT)).astype(np.int32).reshape(-1, 1, 2)


def _line(points: NDArray[np.generic]) -> Line:
    return tuple((float(x), float(y)) for x, y in points.tolist())


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
    """The polygon (N, 2) around a mask (H, W), whose ``area_of`` it is; None for several components or holes."""
    rings = area_rings(mask)
    return rings[0] if len(rings) == 1 else None


def area_rings(mask: Mask) -> list[NDArray[np.float64]]:
    """The polygons (N, 2) around the components and holes of a mask (H, W): inside is what an odd number of them encloses."""
    # From the padded picture's pixel centres to corners; at half the height, neighbours by a corner would not be connected.
    outlines = geometry.outlines(np.pad(mask, 1).astype(np.float64), 0.5 - 1e-9)
    return [geometry.thinned(outline, _TOLERANCE_PX)[:-1] - 0.5 for outline in outlines]
