"""Geometry of polylines and maps. Points are (N, 2), columns x, y, in pixels. The arithmetic is in ``core.perception.kernels``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from core.perception import compiled
from core.types import Mask, Point, Points

BEND_SHARE = 0.5
"""Share of a line's bend that is continued beyond its end: noise bends too."""


def arc_length(points: Points) -> NDArray[np.float64]:
    """Distance walked from the first point to each point, shape (N,)."""
    return compiled.arc_length(points)


def point_at(points: Points, along: NDArray[np.float64], position: NDArray[np.float64]) -> Points:
    """Points (M, 2) at arc-length `position` (M,), given the ``arc_length`` `along`; clamped to the polyline's ends."""
    return compiled.point_at(points, along, position)


def resample(points: Points, step_px: float) -> Points:
    """Points evenly spaced by about `step_px` along the polyline, both ends kept; a single point stays as it is."""
    return compiled.resample(points, step_px)


def cut(points: Points, start_px: float, end_px: float, along: NDArray[np.float64] | None = None) -> Points:
    """The part of the polyline between two arc-length positions, clamped to its ends; inner corners are kept.

    `along` is the polyline's ``arc_length``, where it is known already.
    """
    return compiled.cut(points, start_px, end_px, compiled.arc_length(points) if along is None else along)


def extrapolate(points: Points, length_px: float, over_px: float) -> Points:
    """A polyline's continuation from its last point, bending as it did before: a point every px, the last point first.

    Direction and bend are taken over the last `over_px`, or all of a shorter line; ``BEND_SHARE`` of the bend is continued.
    """
    return compiled.extrapolate(points, length_px, over_px, BEND_SHARE)


def nearest(points: Points, point: Point, along: NDArray[np.float64] | None = None) -> tuple[float, float, Point]:
    """The place on the polyline nearest to `point`: its distance, its arc-length position, and the place itself.

    `along` is the polyline's ``arc_length``, where it is known already.
    """
    along = compiled.arc_length(points) if along is None else along
    distance, position, x, y = compiled.nearest(points, point[0], point[1], along)
    return distance, position, (x, y)


def smooth(points: Points, sigma: float, *, keeps_bends: bool = False) -> Points:
    """Smooth a polyline along itself, `sigma` in points; both ends stay where they are.

    Gaussian means draw a bend inwards, by sigma^2 / 2R on a circle of radius R. With `keeps_bends` the weights have no second
    moment, so that parabolas stay as they are, for some more noise at the same sigma. Beyond its ends the line is mirrored through
    them.
    """
    return compiled.smooth(points, np.array((0, len(points))), sigma, keeps_bends)


def sample(values: NDArray[np.float32] | Mask, points: Points) -> NDArray[np.float64]:
    """A map (h, w) at sub-pixel places (N, 2), bilinear; places beyond its border get the border's value. Shape (N,)."""
    return compiled.sample(values, points[:, 0], points[:, 1])


def median(values: NDArray[np.float64]) -> float:
    """Median of some ten to hundred numbers: for so few a sorted list takes a tenth of what ``np.median`` does."""
    ordered: list[float] = sorted(values.tolist())
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])


def outlines(values: NDArray[np.float64], level: float) -> list[Points]:
    """The closed lines (N, 2) around what is above `level` in a map (H, W), whose border is not; the last point is the first again.

    What is above lies on the right as seen on screen, and lines begin at their lowest place. Two places that meet at a corner are
    connected where the mean of the four is above.
    """
    lines = []
    for found in cast("list[Points]", contour_generator(z=values, line_type="Separate").lines(level)):
        line = found[np.append(True, np.any(np.diff(found, axis=0) != 0.0, axis=1))]
        if len(line) < 2:
            continue  # a corner that is above by a rounding error
        across, down = np.floor((line[:-1] + line[1:]) / 2).T
        last = int(np.lexsort((across, down))[-1])
        lines.append(np.vstack([line[last + 1 :], line[1 : last + 2]]))
    return lines


def thinned(points: Points, tolerance: float) -> Points:
    """A polyline's points without those that are nearer than `tolerance` to the rest (Douglas and Peucker); both ends are kept.

    OpenCV's ``approxPolyDP`` rounds them to 32 bits.
    """
    kept, pieces = np.zeros(len(points), np.bool_), [(0, len(points) - 1)]
    kept[[0, -1]] = True
    while pieces:
        first, last = pieces.pop()
        start, along = points[first], points[last] - points[first]
        away = points[first + 1 : last] - start
        share = np.clip(away @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        distance = np.hypot(*(away - share[:, None] * along).T)
        if len(distance) and distance.max() > tolerance:
            middle = first + 1 + int(distance.argmax())
            kept[middle] = True
            pieces += [(middle, last), (first, middle)]
    return points[kept]


def normals(points: Points) -> Points:
    """Unit vectors across a polyline of at least two points, (N, 2), to its right as seen on screen."""
    return compiled.normals(points, np.array((0, len(points))))


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """Polylines in one array, so that each operation takes one call: line ``k`` is ``points[starts[k]:starts[k + 1]]``."""

    points: Points
    starts: NDArray[np.int64]

    @classmethod
    def of(cls, lines: Sequence[Points]) -> Bundle:
        """The lines (N_k, 2), of at least one point each."""
        starts = np.zeros(len(lines) + 1, np.int64)
        np.add.accumulate([len(line) for line in lines], out=starts[1:])
        return cls(np.concatenate(lines) if lines else np.empty((0, 2)), starts)

    def split(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Values of all points (N, ...), line by line."""
        marks = self.starts.tolist()
        return [values[first:last] for first, last in zip(marks[:-1], marks[1:], strict=True)]

    def resample(self, step_px: float) -> Bundle:
        """``resample`` of each line."""
        return Bundle(*compiled.resample_lines(self.points, self.starts, step_px))

    def smooth(self, sigma: float, *, keeps_bends: bool = False) -> Bundle:
        """``smooth`` of each line."""
        return Bundle(compiled.smooth(self.points, self.starts, sigma, keeps_bends), self.starts)

    def normals(self) -> Points:
        """``normals`` of each line, for all points (N, 2); meaningless for lines of a single point."""
        return compiled.normals(self.points, self.starts)
