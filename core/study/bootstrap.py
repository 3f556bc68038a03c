"""Seeded bootstrap intervals (percentile method). Rows are drawn one by one, or, where they come in groups, by whole groups.

Frames of one session or of one phantom are alike: drawn one by one they would make the intervals too narrow. So groups are drawn
wherever they are known; where they are too few to tell how groups differ, there is no interval.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RESAMPLES = 2000
MIN_GROUPS = 10
"""With fewer groups than this their own spread is not known well enough: no interval is given then."""
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


def wilson_95(share: float, n: int) -> list[float]:
    """Wilson's 95 % score interval of a share of n independent ones, n >= 1: wide for few, and for none or all of them, too.

    References
    ----------
    Wilson, "Probable inference, the law of succession, and statistical inference", J. Am. Stat. Assoc. 22 (1927).
    """
    z = 1.959963984540054
    middle, reach = share + z**2 / (2 * n), z * float(np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2)))
    low, high = ((middle + side * reach) / (1 + z**2 / n) for side in (-1, 1))
    return [max(0.0, low) if share > 0 else 0.0, min(1.0, high) if share < 1 else 1.0]


def share_interval(share: float, n: int, group: NDArray[np.int64] | None, drawn: list[float] | None) -> list[float] | None:
    """The interval of a share of n rows: Wilson's where they are independent, else the one that was `drawn` from whole groups.

    Of none or all of the rows every draw gives the same, as if nothing were uncertain: then Wilson's, of the number of groups.
    """
    if n < 2 or are_too_few(group):
        return None
    if group is None:
        return wilson_95(share, n)
    return drawn if 0.0 < share < 1.0 else wilson_95(share, len(np.unique(group)))


def members(groups: Sequence[Hashable | None]) -> NDArray[np.int64] | None:
    """The number of each row's group, shape (n,); None when the rows are to be drawn one by one, since no group is known,
    or each of many rows is of another one.

    A row without a group (None) is one of its own.
    """
    if all(group is None for group in groups):
        return None
    names = [("alone", place) if group is None else ("group", group) for place, group in enumerate(groups)]
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    if len(numbers) == len(names) >= MIN_GROUPS:
        return None
    return np.array([numbers[name] for name in names], np.int64)


def are_too_few(group: NDArray[np.int64] | None) -> bool:
    """Whether groups are known, but not enough of them for an interval."""
    return group is not None and len(np.unique(group)) < MIN_GROUPS


def too_few_words(what: str, groups: int) -> str:
    """Why there are none of these intervals, in one sentence: of so many groups that are known."""
    return (
        f"No {what}: the images are of {groups} group{'s' if groups != 1 else ''} (sessions or phantoms), "
        f"and images of one are alike; intervals need {MIN_GROUPS} groups."
    )


def bootstrap_rows(
    statistics: Callable[..., Mapping[str, Floats]],
    columns: tuple[Floats, ...],
    seed: int,
    group: NDArray[np.int64] | None = None,
) -> dict[str, list[float] | None]:
    """95 % intervals of statistics of rows.

    Parameters
    ----------
    statistics : takes the columns, each of shape (R, n), and gives statistics of shape (R,) by name.
    columns : one array of shape (n,) per column; rows are drawn whole.
    seed : the same seed gives the same intervals.
    group : of each row, as ``members`` numbers them: whole groups are drawn. None: single rows.

    Returns
    -------
    dict
        Name -> [low, high], or None where n < 2, there are fewer groups than ``MIN_GROUPS``, or the statistic is undefined too
        often.
    """
    n = len(columns[0])
    if n < 2 or are_too_few(group):
        return dict.fromkeys(statistics(*(column[None, :] for column in columns)))
    collected: dict[str, list[Floats]] = {}
    for rows in _draws(n, group, np.random.default_rng(seed)):
        for name, values in statistics(*(column[rows] for column in columns)).items():
            collected.setdefault(name, []).append(values)
    return {name: interval_95(np.concatenate(parts)) for name, parts in collected.items()}


def _draws(n: int, group: NDArray[np.int64] | None, rng: np.random.Generator) -> Iterator[NDArray[np.int64]]:
    """Row numbers of some resamples at a time, shape (R, rows). Groups of several sizes make resamples of several lengths."""
    if group is None:
        left = RESAMPLES
        while left:
            count = min(left, max(1, _BLOCK // n))
            yield rng.integers(0, n, (count, n))
            left -= count
        return
    rows_of = [np.flatnonzero(group == number) for number in np.unique(group)]
    sizes = np.array([len(rows) for rows in rows_of])
    drawn = rng.integers(0, len(rows_of), (RESAMPLES, len(rows_of)))
    lengths = sizes[drawn].sum(1)
    for length in np.unique(lengths):
        alike = drawn[lengths == length]
        step = max(1, _BLOCK // int(length))
        for first in range(0, len(alike), step):
            yield np.stack([np.concatenate([rows_of[number] for number in one]) for one in alike[first : first + step]])
