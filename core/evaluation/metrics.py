"""Agreement of two measures of an angle and of two labellings, with seeded bootstrap intervals (percentile method). In degrees.

Statistics run along the last axis, so that one call computes all bootstrap resamples. What is undefined is NaN in arrays and None
in the dictionaries that leave this module. Images of one session or phantom are alike: drawn one by one they would make the
intervals too narrow. Whole groups are drawn where they are known; where there are too few, there is no interval.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ConstantInputWarning, NearConstantInputWarning, pearsonr, rankdata

Floats = NDArray[np.float64]

Group = NDArray[np.int64] | None
"""The number of each row's group, shape (n,); None: rows are drawn one by one."""

RESAMPLES = 2000
MIN_GROUPS = 10  # with fewer groups their own spread is not known well enough for an interval
_DEFINED = 0.9  # least share of the resamples in which a statistic with an interval is defined
_BLOCK = 500_000  # values drawn at once, to limit the memory
RANGE_DEG = 180.0
SHARE_EDGES_PERCENT = (0, 4, 8, 12, 16)
LIMITS_SD = 1.96  # Bland-Altman limits of agreement lie so many standard deviations from the mean error


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


def share_interval(share: float, n: int, group: Group, drawn: list[float] | None) -> list[float] | None:
    """The interval of a share of n rows: Wilson's where they are independent, else the one that was `drawn` from whole groups.

    Of none or all of the rows every draw gives the same, as if nothing were uncertain: then Wilson's, of the number of groups.
    """
    if n < 2 or are_too_few(group):
        return None
    if group is None:
        return wilson_95(share, n)
    return drawn if 0.0 < share < 1.0 else wilson_95(share, len(np.unique(group)))


def members(groups: Sequence[Hashable | None]) -> Group:
    """Groups as numbers; None where no group is known, or each of many rows is of another one.

    A row without a group (None) is a group of its own.
    """
    if all(group is None for group in groups):
        return None
    names = [("alone", place) if group is None else ("group", group) for place, group in enumerate(groups)]
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    if len(numbers) == len(names) >= MIN_GROUPS:
        return None
    return np.array([numbers[name] for name in names], np.int64)


def are_too_few(group: Group) -> bool:
    """Whether groups are known, but not enough of them for an interval."""
    return group is not None and len(np.unique(group)) < MIN_GROUPS


def too_few_words(what: str, groups: int) -> str:
    """One sentence that says why there are no intervals of `what`."""
    return (
        f"No {what}: the images are of {groups} group{'s' if groups != 1 else ''} (sessions or phantoms), "
        f"and images of one are alike; intervals need {MIN_GROUPS} groups."
    )


def bootstrap_rows(
    statistics: Callable[..., Mapping[str, Floats]], columns: tuple[Floats, ...], seed: int, group: Group = None
) -> dict[str, list[float] | None]:
    """95 % intervals of statistics of rows.

    Returns name -> [low, high], or None where n < 2, there are fewer groups than ``MIN_GROUPS``, or the statistic is undefined too
    often.

    Parameters
    ----------
    statistics : takes the columns, each of shape (R, n), and gives statistics of shape (R,) by name.
    columns : one array of shape (n,) per column; rows are drawn whole.
    seed : the same seed gives the same intervals.
    group : of each row, as ``members`` numbers them: whole groups are drawn. None: single rows.
    """
    n = len(columns[0])
    if n < 2 or are_too_few(group):
        return dict.fromkeys(statistics(*(column[None, :] for column in columns)))
    collected: dict[str, list[Floats]] = {}
    for rows in _draws(n, group, np.random.default_rng(seed)):
        for name, values in statistics(*(column[rows] for column in columns)).items():
            collected.setdefault(name, []).append(values)
    return {name: interval_95(np.concatenate(parts)) for name, parts in collected.items()}


def _draws(n: int, group: Group, rng: np.random.Generator) -> Iterator[NDArray[np.int64]]:
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


def icc_absolute(ratings: Floats) -> Floats:
    """Intraclass correlation ICC(2,1): two-way random effects, absolute agreement, single measure.

    Of n subjects, each measured by k raters (..., n, k), an array (...); NaN where all ratings are equal, or there is one
    subject.

    References
    ----------
    Shrout and Fleiss, "Intraclass correlations: uses in assessing rater reliability", Psychological Bulletin 86 (1979), case 2.
    """
    n, k = ratings.shape[-2:]
    if n < 2 or k < 2:
        return np.full(ratings.shape[:-2], np.nan)
    centred = ratings - ratings.mean((-2, -1), keepdims=True)
    subjects, raters = centred.mean(-1, keepdims=True), centred.mean(-2, keepdims=True)
    between_subjects = k * (subjects**2).sum((-2, -1)) / (n - 1)
    between_raters = n * (raters**2).sum((-2, -1)) / (k - 1)
    residual = ((centred - subjects - raters) ** 2).sum((-2, -1)) / ((n - 1) * (k - 1))
    total = between_subjects + (k - 1) * residual + k * (between_raters - residual) / n
    varied = np.ptp(ratings, axis=(-2, -1)) > 0
    undefined = np.full(total.shape, np.nan)
    return np.asarray(np.divide(between_subjects - residual, total, out=undefined, where=varied & (total > 0)))


def correlation(first: Floats, second: Floats) -> Floats:
    """Pearson's correlation along the last axis; NaN where one of the two is constant or has fewer than two values."""
    if first.shape[-1] < 2:
        return np.full(first.shape[:-1], np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConstantInputWarning)
        warnings.simplefilter("ignore", NearConstantInputWarning)
        found = np.asarray(pearsonr(first, second, axis=-1).statistic, np.float64)
    # Rounding of the mean leaves a constant column some 1e-16 of spread, which would correlate with anything.
    varied = (np.ptp(first, axis=-1) > 0) & (np.ptp(second, axis=-1) > 0)
    return np.where(varied, found, np.nan)


def shares(error_deg: Floats) -> dict[str, Floats]:
    """Fractions of ``|error|`` per bin of percent of 180 degrees; an error on an edge belongs to the bin below it."""
    # 1e-9: the difference of two angles given in tenths must not miss an edge by rounding.
    percent = np.abs(error_deg) / RANGE_DEG * 100.0 - 1e-9
    found = {}
    for low, high in zip(SHARE_EDGES_PERCENT, SHARE_EDGES_PERCENT[1:], strict=False):
        inside = (percent <= high) & ((percent > low) | (low == 0))
        found[f"share_{low}_{high}"] = inside.mean(-1)
    found[f"share_over_{SHARE_EDGES_PERCENT[-1]}"] = (percent > SHARE_EDGES_PERCENT[-1]).mean(-1)
    return found | {"share_0_8": (percent <= 8).mean(-1)}


def angle_statistics(manual_deg: Floats, algorithm_deg: Floats) -> dict[str, Floats]:
    """All statistics of algorithm against manual along the last axis (n values, n >= 1), each of shape (...).

    Error = algorithm - manual; the standard deviation is the sample's (n - 1). Names are those of ``metrics.json``.
    """
    error = algorithm_deg - manual_deg
    mean = error.mean(-1)
    sd = error.std(-1, ddof=1) if error.shape[-1] > 1 else np.full(mean.shape, np.nan)
    size = np.abs(error)
    return {
        "mean_error_deg": mean,
        "sd_deg": sd,
        "median_deg": np.median(error, axis=-1),
        "mean_abs_error_deg": size.mean(-1),
        "median_abs_error_deg": np.median(size, axis=-1),
        "pearson": correlation(manual_deg, algorithm_deg),
        "spearman": correlation(rankdata(manual_deg, axis=-1), rankdata(algorithm_deg, axis=-1)),
        "icc": icc_absolute(np.stack([manual_deg, algorithm_deg], -1)),
        "loa_low_deg": mean - LIMITS_SD * sd,
        "loa_high_deg": mean + LIMITS_SD * sd,
    } | shares(error)


def _repeat_statistics(first_deg: Floats, second_deg: Floats, spread: Floats) -> dict[str, Floats]:
    """Of the two manual measures: ICC, and the within-subject standard deviation of one measure.

    That is the root of the mean variance within an image: half the squared difference of two measures, or that over ``spread**2``
    where they are means. A second measure that differs on the whole counts as spread, too: the mean difference tells it apart.
    """
    difference = second_deg - first_deg
    mean = difference.mean(-1)
    sd = np.sqrt(((difference / spread) ** 2).mean(-1)) if difference.shape[-1] > 1 else np.full(mean.shape, np.nan)
    return {"mean_difference_deg": mean, "repeatability_sd_deg": sd, "icc": icc_absolute(np.stack([first_deg, second_deg], -1))}


def within_subject(measures: Sequence[Sequence[Sequence[float]]], seed: int = 0, group: Group = None) -> dict[str, Any]:
    """The within-subject standard deviation of one measure: the root of the mean variance of a rater's repeats of an image.

    `measures` are in degrees by image, by rater; a single one says nothing. Returns ``n`` images with repeats, ``sd_deg`` (None
    where n is 0) and ``ci95``, its interval, which draws whole images, or whole groups of them (as in ``bootstrap_rows``).
    """
    squares = np.array([sum(float(np.var(own)) * len(own) for own in image if len(own) > 1) for image in measures], np.float64)
    freedom = np.array([sum(len(own) - 1 for own in image if len(own) > 1) for image in measures], np.float64)
    repeated = freedom > 0
    columns = squares[repeated], freedom[repeated]
    if not repeated.any():
        return {"n": 0, "sd_deg": None, "ci95": None}

    def statistics(squares: Floats, freedom: Floats) -> dict[str, Floats]:
        return {"sd_deg": np.sqrt(squares.sum(-1) / freedom.sum(-1))}

    found = bootstrap_rows(statistics, columns, seed, group[repeated] if group is not None else None)
    return {"n": int(repeated.sum()), "sd_deg": float(statistics(*columns)["sd_deg"]), "ci95": found["sd_deg"]}


def angle_metrics(manual_deg: Floats, algorithm_deg: Floats, seed: int = 0, group: Group = None) -> dict[str, Any]:
    """Statistics of algorithm against manual angles, both of shape (n,), with 95 % intervals under ``ci95``.

    They are of the bootstrap, those of shares as ``share_interval`` says. `group` as in ``bootstrap_rows``.
    """
    found = _with_intervals(angle_statistics, (manual_deg, algorithm_deg), seed, group)
    for name, drawn in found["ci95"].items():
        if name.startswith("share_") and found["n"]:
            found["ci95"][name] = share_interval(found[name], found["n"], group, drawn)
    return found


def repeat_metrics(
    first_deg: Floats, second_deg: Floats, seed: int = 0, group: Group = None, counts: Floats | None = None
) -> dict[str, Any]:
    """Agreement of two manual measures of the same images, both of shape (n,), with 95 % bootstrap intervals under ``ci95``.

    `group` as in ``bootstrap_rows``. `counts` (n, 2): of how many single measures each one is the mean (None: of one). A difference
    of such means has the standard deviation of one measure, times the root of 1/n1 + 1/n2; the ICC is that of the means.
    """
    counts = np.ones((len(first_deg), 2)) if counts is None else counts
    spread = np.sqrt((1.0 / counts).sum(axis=1))
    return _with_intervals(_repeat_statistics, (first_deg, second_deg, spread), seed, group)


def _with_intervals(statistics: Any, columns: tuple[Floats, ...], seed: int, group: Group) -> dict[str, Any]:
    n = len(columns[0])
    if n == 0:
        names = statistics(*(np.ones(1) for _ in columns))
        return {"n": 0} | dict.fromkeys(names) | {"ci95": dict.fromkeys(names)}
    values: Mapping[str, Floats] = statistics(*columns)
    point = {name: float(value) if np.isfinite(value) else None for name, value in values.items()}
    intervals = bootstrap_rows(statistics, columns, seed, group)
    return {"n": n} | point | {"ci95": {name: intervals[name] if point[name] is not None else None for name in point}}


_AVERAGED, _KINDS = ("precision", "recall", "f1"), ("macro", "weighted")
_OVERALL = ("accuracy", "kappa", "fowlkes_mallows_pairs", "fowlkes_mallows_macro")


def kappa(true: Sequence[str], found: Sequence[str]) -> float | None:
    """Cohen's kappa of two labellings; None when both know one label only, where chance alone agrees."""
    labels = sorted({*true, *found})
    return _defined(table_statistics(_table(_places(true, found, labels), len(labels))[None])["kappa"][0]) if labels else None


def _places(true: Sequence[str], found: Sequence[str], labels: Sequence[str]) -> NDArray[np.int64]:
    """Row and column of each image's pair in the confusion table, shape (2, n)."""
    return np.array([[labels.index(label) for label in side] for side in (true, found)], np.int64)


def _table(rows_columns: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    return np.bincount(rows_columns[0] * size + rows_columns[1], minlength=size * size).reshape(size, size)


def table_statistics(tables: NDArray[np.int64]) -> dict[str, Floats]:
    """Statistics of many confusion tables (R, k, k) at once, for the bootstrap: rows manual, columns algorithm, none empty.

    Returns name -> shape (R,), NaN where undefined. Classes absent from a table are left out of its macro averages; one that
    occurs without a hit counts as 0.
    """
    n = tables.sum((1, 2)).astype(np.float64)
    hits = np.diagonal(tables, axis1=1, axis2=2).astype(np.float64)
    manual, algorithm = tables.sum(2).astype(np.float64), tables.sum(1).astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        chance = (manual * algorithm).sum(1) / n**2
        f1 = 2 * hits / (manual + algorithm)
        per_class = np.where(manual + algorithm > 0, hits / np.sqrt(np.maximum(manual * algorithm, 1.0)), np.nan)
        together = ((tables * (tables - 1)).sum((1, 2))) / np.sqrt(
            (manual * (manual - 1)).sum(1) * (algorithm * (algorithm - 1)).sum(1)
        )
        accuracy = hits.sum(1) / n
        return {
            "accuracy": accuracy,
            "kappa": (accuracy - chance) / (1 - chance),
            "fowlkes_mallows_pairs": together,
            "fowlkes_mallows_macro": _mean_of_defined(per_class),
            "macro_f1": _mean_of_defined(f1),
            "weighted_f1": np.where(manual > 0, f1 * manual, 0.0).sum(1) / n,
        }


def _mean_of_defined(values: Floats) -> Floats:
    defined = np.isfinite(values)
    count = defined.sum(1)
    return np.asarray(np.where(count > 0, np.where(defined, values, 0.0).sum(1) / np.maximum(count, 1), np.nan))


def state_metrics(manual: Sequence[str], algorithm: Sequence[str], seed: int = 0, group: Group = None) -> dict[str, Any]:
    """Statistics of the algorithm's states against the manual ones, with 95 % intervals under ``ci95``.

    They are of the bootstrap, that of the accuracy as ``share_interval`` says.

    Returns what ``metrics.json`` has. ``labels`` are those that occur on either side; ``confusion`` has manual rows and algorithm
    columns. Precision of a class that the algorithm never gave: None, which counts as 0 in the averages (else never to find a class
    would be better than to find a part of it); recall of a class without a manual label: None, left out of them.
    ``fowlkes_mallows_pairs`` is the pair-counting index, ``fowlkes_mallows_macro`` the mean over the classes of ``sqrt(precision *
    recall)``, the formula of the paper's table, with 0 for a class without a hit.

    Parameters
    ----------
    manual, algorithm : labels of the same n images.
    seed : of the bootstrap.
    group : of each image, as in ``bootstrap_rows``.
    """
    n, labels = len(manual), sorted(set(manual) | set(algorithm))
    if n == 0:
        averages = {kind: dict.fromkeys(_AVERAGED) for kind in _KINDS}
        empty: dict[str, Any] = {"n": 0, "labels": [], "confusion": []}
        ci95 = dict.fromkeys((*_OVERALL, "macro_f1", "weighted_f1"))
        return empty | dict.fromkeys(_OVERALL) | {"per_class": {}} | averages | {"ci95": ci95}
    rows_columns = _places(manual, algorithm, labels)
    confusion = _table(rows_columns, len(labels))
    given, told, hits = confusion.sum(1), confusion.sum(0), np.diagonal(confusion)
    with np.errstate(invalid="ignore"):
        classes = np.array([hits / told, hits / given, 2 * hits / (given + told)])  # precision, recall, F1; NaN where undefined
    rows = [{name: _defined(value) for name, value in zip(_AVERAGED, column, strict=True)} for column in classes.T]
    per_class_fm = np.sqrt(classes[0] * classes[1])
    statistics = table_statistics(confusion[None])
    point: dict[str, Any] = {name: _defined(statistics[name][0]) for name in _OVERALL}
    averages = {"macro": _averages(classes, np.ones(len(labels))), "weighted": _averages(classes, confusion.sum(1))}
    known = point | {f"{kind}_f1": averages[kind]["f1"] for kind in _KINDS}
    intervals: dict[str, list[float] | None] = {}
    if n > 1 and not are_too_few(group):
        cells = _drawn_tables(confusion, rows_columns, seed, group)
        intervals = {name: interval_95(values) for name, values in table_statistics(cells).items()}
    per_class = {
        label: row | {"fowlkes_mallows": _defined(index), "n": int(count)}
        for label, row, index, count in zip(labels, rows, per_class_fm, confusion.sum(1), strict=True)
    }
    intervals["accuracy"] = share_interval(point["accuracy"], n, group, intervals.get("accuracy"))
    ci95 = {name: intervals.get(name) if known[name] is not None else None for name in known}
    counts = {"n": n, "labels": labels, "confusion": confusion.tolist()}
    return counts | point | {"per_class": per_class} | averages | {"ci95": ci95}


def _drawn_tables(confusion: NDArray[np.int64], rows_columns: NDArray[np.int64], seed: int, group: Group) -> NDArray[np.int64]:
    """Confusion tables of the resamples, shape (R, k, k)."""
    rng = np.random.default_rng(seed)
    if group is None:
        n = int(confusion.sum())
        return np.asarray(rng.multinomial(n, confusion.ravel() / n, RESAMPLES).reshape(-1, *confusion.shape), np.int64)
    numbers = np.unique(group, return_inverse=True)[1]
    count = int(numbers.max()) + 1
    tables = np.zeros((count, *confusion.shape), np.int64)
    np.add.at(tables, (numbers, *rows_columns), 1)
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), RESAMPLES)
    return np.asarray(np.tensordot(drawn, tables, 1), np.int64)


def _averages(classes: Floats, weights: NDArray[Any]) -> dict[str, float | None]:
    """Weighted means of precision, recall and F1 (rows) over the classes."""
    precision, recall, f1 = classes
    seen = np.isfinite(recall)
    means = (
        np.average(np.nan_to_num(precision), weights=weights),
        np.average(recall[seen], weights=weights[seen]),
        np.average(f1, weights=weights),
    )
    return dict(zip(_AVERAGED, map(float, means), strict=True))


def _defined(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
