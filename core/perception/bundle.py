"""Many polylines handled at once: one array of all their points, for lines of which some are short and most calls cost alike.

A vessel tree has some ten lines of some fifty points. NumPy takes as long for fifty points as for five hundred, so what is done
to each line alone is done here to all of them together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.perception import polyline
from core.types import Point, Points


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


def lengths(bundle: Bundle) -> NDArray[np.float64]:
    """Arc length of each line."""
    return _lengths(bundle, _steps(bundle))


def _steps(bundle: Bundle) -> NDArray[np.float64]:
    """From each point to the next; 0 from the last point of a line, also the last line's."""
    steps = np.zeros(len(bundle.points))
    across = bundle.points[1:] - bundle.points[:-1]
    np.hypot(across[:, 0], across[:, 1], out=steps[:-1])
    steps[bundle.starts[1:] - 1] = 0.0
    return steps


def _lengths(bundle: Bundle, steps: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.add.reduceat(steps, bundle.starts[:-1]) if len(steps) else np.zeros(0)


def distances(bundle: Bundle, point: Point) -> NDArray[np.float64]:
    """How far `point` is from each line; a line of one point counts as that point."""
    if len(bundle.points) == 0:
        return np.zeros(0)
    following = bundle.points[1:].copy()
    last = bundle.starts[1:-1] - 1
    following[last] = bundle.points[last]
    gaps = np.append(polyline.distance_to_segments(bundle.points[:-1], following, point)[0], math.dist(bundle.points[-1], point))
    return np.minimum.reduceat(gaps, bundle.starts[:-1])


def resample(bundle: Bundle, step_px: float) -> Bundle:
    """``polyline.resample`` of each line."""
    if len(bundle.starts) < 2:
        return bundle
    steps = _steps(bundle)
    totals = _lengths(bundle, steps)
    counts = np.where(totals > 0.0, np.maximum(2, np.rint(totals / step_px).astype(np.int64) + 1), 1)
    # From line to line the way goes on by one px that nobody asks for, so that a line's end and the next one's start differ.
    steps[bundle.starts[1:-1] - 1] = 1.0
    along = np.zeros(len(bundle.points))
    np.add.accumulate(steps[:-1], out=along[1:])
    starts = np.zeros(len(counts) + 1, np.int64)
    np.add.accumulate(counts, out=starts[1:])
    line = np.repeat(np.arange(len(counts)), counts)
    begin, end = along[bundle.starts[:-1]], along[bundle.starts[1:] - 1]
    marks = begin[line] + (np.arange(starts[-1]) - starts[line]) * (totals / np.maximum(counts - 1, 1))[line]
    marks[starts[1:] - 1] = np.where(counts > 1, end, begin)
    return Bundle(polyline.point_at(bundle.points, along, marks), starts)


def smooth(bundle: Bundle, sigma: float, *, keeps_bends: bool = False) -> Bundle:
    """``polyline.smooth`` of each line."""
    pad = int(np.ceil(3.0 * sigma))
    lines = bundle.split(bundle.points)
    long = [line for line in lines if len(line) > pad]
    if not long:
        return Bundle.of([polyline.smooth(line, sigma, keeps_bends=keeps_bends) for line in lines]) if lines else bundle
    # The lines mirrored through their ends lie one behind the other; what the filter gives between two of them is left out.
    padded = np.concatenate([part for line in long for part in polyline.mirrored(line, pad)])
    filtered = polyline.filtered(padded, pad, sigma, keeps_bends=keeps_bends)
    smoothed, place = [], 0
    for line in lines:
        if len(line) > pad:
            smoothed.append(filtered[place : place + len(line)])
            place += len(line) + 2 * pad
        else:
            smoothed.append(polyline.smooth(line, sigma, keeps_bends=keeps_bends))
    return Bundle(np.concatenate(smoothed), bundle.starts)


def normals(bundle: Bundle) -> Points:
    """``polyline.normals`` of each line, for all points (N, 2); lines of a single point have none that means anything."""
    points, first, last = bundle.points, bundle.starts[:-1], bundle.starts[1:] - 1
    tangent = np.empty_like(points)
    tangent[1:-1] = points[2:] - points[:-2]
    tangent[first] = points[np.minimum(first + 1, last)] - points[first]
    tangent[last] = points[last] - points[np.maximum(last - 1, first)]
    return polyline.across(tangent)
