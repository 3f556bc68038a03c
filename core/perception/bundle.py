"""Many polylines handled at once, one after the other in one array: what is done to each of them takes one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.perception.compiled import loops
from core.types import Points


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


def resample(bundle: Bundle, step_px: float) -> Bundle:
    """``polyline.resample`` of each line."""
    return Bundle(*loops.lines.resample_all(bundle.points, bundle.starts, step_px))


def smooth(bundle: Bundle, sigma: float, *, keeps_bends: bool = False) -> Bundle:
    """``polyline.smooth`` of each line."""
    return Bundle(loops.lines.smooth(bundle.points, bundle.starts, sigma, keeps_bends), bundle.starts)


def normals(bundle: Bundle) -> Points:
    """``polyline.normals`` of each line, for all points (N, 2); lines of a single point have none that means anything."""
    return loops.lines.normals(bundle.points, bundle.starts)
