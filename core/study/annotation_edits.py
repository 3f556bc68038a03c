"""Edits of lines and outlines, as functions from one annotation to the next; and what a place on the screen touches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.study.annotations import Annotation, Line, MaskPolygon
from core.types import Point, Points

ROBOT, VESSEL = -2, -1


@dataclass(frozen=True, slots=True)
class Touch:
    """A point of a line, or (``is_edge``) the place on the way from point ``place - 1`` to ``place`` where one could be put in.

    ``line`` is ``ROBOT``, ``VESSEL``, or the index of a mask polygon.
    """

    line: int
    place: int
    is_edge: bool = False


def line_of(annotation: Annotation, line: int) -> Line:
    """The points of a line; () when it does not exist."""
    if line == ROBOT:
        return annotation.robot
    if line == VESSEL:
        return annotation.vessel
    return annotation.masks[line].points if 0 <= line < len(annotation.masks) else ()


def with_line(annotation: Annotation, line: int, points: Line) -> Annotation:
    """The annotation with other points on a line. A drawn line takes "can't tell" back; a polygon of fewer than three is gone, and
    with an outline the holes in it."""
    if line == ROBOT:
        return replace(annotation, robot=points, cannot_tell=False)
    if line == VESSEL:
        return replace(annotation, vessel=points, cannot_tell=False)
    masks: list[MaskPolygon] = list(annotation.masks)
    if len(points) >= 3:
        masks[line] = replace(masks[line], points=points)
    else:
        doomed = {line} if masks[line].is_hole else {line, *_holes_of(masks, line)}
        masks = [mask for place, mask in enumerate(masks) if place not in doomed]
    return replace(annotation, masks=tuple(masks))


def _holes_of(masks: Sequence[MaskPolygon], outline: int) -> Iterator[int]:
    """Places of the holes in an outline: those that follow it, before the next outline of the same mask."""
    for place in range(outline + 1, len(masks)):
        if masks[place].target is masks[outline].target:
            if not masks[place].is_hole:
                return
            yield place


def put(annotation: Annotation, line: int, place: int, point: Point) -> Annotation:
    """A new point before the one at `place`."""
    points = line_of(annotation, line)
    return with_line(annotation, line, (*points[:place], point, *points[place:]))


def move(annotation: Annotation, line: int, place: int, point: Point) -> Annotation:
    """The point at `place` lies elsewhere."""
    points = line_of(annotation, line)
    return with_line(annotation, line, (*points[:place], point, *points[place + 1 :]))


def remove(annotation: Annotation, line: int, place: int) -> Annotation:
    """Without the point at `place`."""
    points = line_of(annotation, line)
    return with_line(annotation, line, points[:place] + points[place + 1 :])


def touched(annotation: Annotation, lines: Iterable[int], point: Point, point_reach: float, edge_reach: float) -> Touch | None:
    """What lies at a place: a point within `point_reach`, else an edge within `edge_reach` (both in image pixels); the nearest."""
    best_point: tuple[float, Touch] | None = None
    best_edge: tuple[float, Touch] | None = None
    for line in lines:
        points = np.array(line_of(annotation, line), np.float64).reshape(-1, 2)
        if len(points) == 0:
            continue
        distance = np.hypot(*(points - point).T)
        place = int(np.argmin(distance))
        if distance[place] <= point_reach and (best_point is None or distance[place] < best_point[0]):
            best_point = float(distance[place]), Touch(line, place)
        closed = points if line < 0 else np.concatenate([points, points[:1]])
        if len(closed) > 1:
            gap = _distances_to_edges(closed, point)
            edge = int(np.argmin(gap))
            if gap[edge] <= edge_reach and (best_edge is None or gap[edge] < best_edge[0]):
                best_edge = float(gap[edge]), Touch(line, edge + 1, is_edge=True)
    chosen = best_point or best_edge
    return chosen[1] if chosen is not None else None


def _distances_to_edges(points: Points, point: Point) -> NDArray[np.float64]:
    """How far `point` is from each straight piece of a line (N, 2), shape (N - 1,)."""
    start, step = points[:-1], points[1:] - points[:-1]
    offset = np.array(point) - start
    share = np.clip((offset * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return np.asarray(np.hypot(*(offset - share[:, None] * step).T))
