"""Arc length on polylines: what several stages of the method need. Points are (N, 2), columns x, y, in pixels.

Many polylines handled at once, one after the other in one array: what is done to each of them takes one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.perception import compiled
from core.types import Mask, Point, Points

BEND_SHARE = 0.5
"""So much of a line's bend is continued beyond its end: noise bends too."""


def arc_length(points: Points) -> NDArray[np.float64]:
    """Distance walked from the first point to each point, shape (N,)."""
    return compiled.arc_length(points)


def point_at(points: Points, along: NDArray[np.float64], position: NDArray[np.float64]) -> Points:
    """Points at arc-length `position` (M,), given the polyline's ``arc_length`` `along`; clamped to its ends. Shape (M, 2)."""
    return compiled.point_at(points, along, position)


def resample(points: Points, step_px: float) -> Points:
    """Points evenly spaced by about `step_px` along the polyline, both ends kept; a single point stays as it is."""
    return compiled.resample(points, step_px)


def cut(points: Points, start_px: float, end_px: float, along: NDArray[np.float64] | None = None) -> Points:
    """The part of the polyline between two arc-length positions, clamped to its ends; inner corners are kept.

    `along` is the polyline's ``arc_length``, where it is known already.
    """
    return compiled.cut(points, start_px, end_px, compiled.arc_length(points) if along is None else along)


def continued(points: Points, length_px: float, over_px: float) -> Points:
    """How a polyline would go on from its last point, bending as it did before: a point every px, the last point first.

    Its direction and its bend are taken over the last `over_px`, or all of a shorter line, and ``BEND_SHARE`` of the bend goes on.
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
    """Smoothing along a polyline, `sigma` in points; both ends stay where they are.

    Gaussian means draw a bend inwards, by sigma^2 / 2R on a circle of radius R. With `keeps_bends` the weights have no second
    moment, so that parabolas stay as they are, for some more noise at the same sigma. Beyond its ends the line is mirrored through
    them: it goes on straight there, does not shrink, and the ends themselves are kept.
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


def normals(points: Points) -> Points:
    """Unit vectors across a polyline of at least two points, (N, 2), to its right as seen on screen."""
    return compiled.normals(points, np.array((0, len(points))))


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """``points`` (N, 2) of all lines one after the other; line ``k`` is ``points[starts[k]:starts[k + 1]]``."""

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


def resample_bundle(bundle: Bundle, step_px: float) -> Bundle:
    """``polyline.resample`` of each line."""
    return Bundle(*compiled.resample_lines(bundle.points, bundle.starts, step_px))


def smooth_bundle(bundle: Bundle, sigma: float, *, keeps_bends: bool = False) -> Bundle:
    """``polyline.smooth`` of each line."""
    return Bundle(compiled.smooth(bundle.points, bundle.starts, sigma, keeps_bends), bundle.starts)


def bundle_normals(bundle: Bundle) -> Points:
    """``polyline.normals`` of each line, for all points (N, 2); lines of a single point have none that means anything."""
    return compiled.normals(bundle.points, bundle.starts)
