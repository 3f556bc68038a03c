"""How well two measures of an angle agree: bias, spread, correlation, limits of agreement, intraclass correlation. In degrees.

Statistics run along the last axis, so that one call computes all bootstrap resamples. What is undefined is NaN in arrays and
None in the dictionaries that leave this module.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ConstantInputWarning, NearConstantInputWarning, pearsonr, rankdata

from core.study.bootstrap import Floats, bootstrap_rows, share_interval

Group = NDArray[np.int64] | None

RANGE_DEG = 180.0
SHARE_EDGES_PERCENT = (0, 4, 8, 12, 16)
LIMITS_SD = 1.96
"""Bland-Altman limits of agreement lie so many standard deviations from the mean error."""


def icc_absolute(ratings: Floats) -> Floats:
    """Intraclass correlation ICC(2,1): two-way random effects, absolute agreement, single measure.

    Parameters
    ----------
    ratings : shape (..., n, k): n subjects, each measured by k raters.

    Returns
    -------
    array
        Shape (...); NaN where all ratings are equal, or there is only one subject.

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
    return {
        "mean_difference_deg": mean,
        "repeatability_sd_deg": sd,
        "icc": icc_absolute(np.stack([first_deg, second_deg], -1)),
    }


def within_subject(measures: Sequence[Sequence[Sequence[float]]], seed: int = 0, group: Group = None) -> dict[str, Any]:
    """The within-subject standard deviation of one measure: the root of the mean variance of a rater's repeats of an image.

    Parameters
    ----------
    measures : by image, by rater: his measures of it, in degrees. Who measured it once says nothing.
    seed : of the bootstrap interval; whole images are drawn, or whole groups of them.
    group : of each image, as in ``bootstrap_rows``.

    Returns
    -------
    dict
        ``n`` images with repeats, ``sd_deg`` (None where n is 0) and ``ci95``, its interval.
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
