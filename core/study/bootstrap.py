"""Seeded bootstrap intervals (percentile method). Rows are drawn as independent of each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RESAMPLES = 2000
_DEFINED = 0.9
"""A statistic that is undefined in more resamples than the rest of these has no interval."""
_BLOCK = 500_000
"""Values drawn at once: keeps the memory of large sets small."""


def interval_95(values: Floats) -> list[float] | None:
    """The middle 95 % of a statistic's values over resamples, shape (R,); NaN = undefined there. None: undefined too often."""
    defined = values[np.isfinite(values)]
    if len(defined) < _DEFINED * len(values) or len(defined) == 0:
        return None
    low, high = np.percentile(defined, [2.5, 97.5])
    return [float(low), float(high)]


def bootstrap_rows(
    statistics: Callable[..., Mapping[str, Floats]], columns: tuple[Floats, ...], seed: int
) -> dict[str, list[float] | None]:
    """95 % intervals of statistics of rows.

    Parameters
    ----------
    statistics : takes the columns, each of shape (R, n), and gives statistics of shape (R,) by name.
    columns : one array of shape (n,) per column; rows are drawn whole.
    seed : the same seed gives the same intervals.

    Returns
    -------
    dict
        Name -> [low, high], or None where n < 2 or the statistic is undefined too often.
    """
    rng = np.random.default_rng(seed)
    n = len(columns[0])
    collected: dict[str, list[Floats]] = {}
    left = RESAMPLES if n > 1 else 1
    while left:
        count = min(left, max(1, _BLOCK // n))
        rows = rng.integers(0, n, (count, n))
        for name, values in statistics(*(column[rows] for column in columns)).items():
            collected.setdefault(name, []).append(values)
        left -= count
    return {name: interval_95(np.concatenate(parts)) if n > 1 else None for name, parts in collected.items()}
