"""How well two labellings agree: confusion, precision and recall, kappa, and both indices named after Fowlkes and Mallows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.study.bootstrap import RESAMPLES, Floats, are_too_few, interval_95, share_interval

_AVERAGED = ("precision", "recall", "f1")


def kappa(true: Sequence[str], found: Sequence[str]) -> float | None:
    """Cohen's kappa of two labellings; None when both know one label only, where chance alone agrees."""
    from sklearn.metrics import cohen_kappa_score  # a second, which whoever only trains or drives need not wait for

    return float(cohen_kappa_score(list(true), list(found))) if len({*true, *found}) > 1 else None


def fowlkes_mallows_pairs(true: Sequence[str], found: Sequence[str]) -> float | None:
    """The pair-counting index: of all pairs of images, how alike the two labellings put them together.

    It compares groupings, blind to the labels' names; None when one of the labellings puts no two images together.
    """
    if any(len(set(labels)) == len(labels) for labels in (true, found)):
        return None
    from sklearn.metrics import fowlkes_mallows_score

    return float(fowlkes_mallows_score(list(true), list(found)))


def table_statistics(tables: NDArray[np.int64]) -> dict[str, Floats]:
    """Statistics of many confusion tables at once, for the bootstrap (scikit-learn does one at a time, from labels).

    Parameters
    ----------
    tables : shape (R, k, k), rows manual, columns algorithm, each with at least one count.

    Returns
    -------
    dict
        Name -> shape (R,), NaN where undefined. Classes absent from a table are left out of its macro averages; one that occurs
        without a hit counts as 0.
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


def state_metrics(
    manual: Sequence[str], algorithm: Sequence[str], seed: int = 0, group: NDArray[np.int64] | None = None
) -> dict[str, Any]:
    """Statistics of the algorithm's states against the manual ones, with 95 % intervals under ``ci95``.

    They are of the bootstrap, that of the accuracy as ``share_interval`` says.

    Parameters
    ----------
    manual, algorithm : labels of the same n images.
    seed : of the bootstrap.
    group : of each image, as ``bootstrap.members`` numbers them: whole groups are drawn, and of too few there is no interval.
        None: single images.

    Returns
    -------
    dict
        As ``metrics.json`` has it. ``labels`` are those that occur on either side; ``confusion`` has manual rows and algorithm
        columns. Precision of a class that the algorithm never gave is None and counts as 0 in the averages, or never to find a
        class would be better than to find a part of it; recall of one that nobody saw is None and left out of them.
        ``fowlkes_mallows_pairs`` is the pair-counting index, ``fowlkes_mallows_macro`` the mean over the classes of
        ``sqrt(precision * recall)``, the formula of the paper's table, with 0 for a class without a hit.
    """
    n, labels = len(manual), sorted(set(manual) | set(algorithm))
    if n == 0:
        return _nothing()
    rows_columns = np.array([(labels.index(m), labels.index(a)) for m, a in zip(manual, algorithm, strict=True)]).T
    confusion = np.zeros((len(labels), len(labels)), np.int64)
    np.add.at(confusion, tuple(rows_columns), 1)
    classes = np.array(_scores(manual, algorithm, labels))
    rows = [{name: _defined(value) for name, value in zip(_AVERAGED, column, strict=True)} for column in classes.T]
    per_class_fm = np.sqrt(classes[0] * classes[1])
    point: dict[str, Any] = {
        "accuracy": float(np.trace(confusion) / n),
        "kappa": kappa(manual, algorithm),
        "fowlkes_mallows_pairs": fowlkes_mallows_pairs(manual, algorithm),
        "fowlkes_mallows_macro": float(np.nan_to_num(per_class_fm).mean()),
    }
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


def _drawn_tables(
    confusion: NDArray[np.int64], rows_columns: NDArray[np.int64], seed: int, group: NDArray[np.int64] | None
) -> NDArray[np.int64]:
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


_KINDS = ("macro", "weighted")


def _scores(manual: Sequence[str], algorithm: Sequence[str], labels: list[str]) -> Any:
    """Precision, recall and F1 of each class, NaN where undefined."""
    from sklearn.metrics import precision_recall_fscore_support

    return precision_recall_fscore_support(list(manual), list(algorithm), labels=labels, zero_division=np.nan)[:3]


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


def _nothing() -> dict[str, Any]:
    names = ("accuracy", "kappa", "fowlkes_mallows_pairs", "fowlkes_mallows_macro")
    averages = {kind: dict.fromkeys(_AVERAGED) for kind in _KINDS}
    empty: dict[str, Any] = {"n": 0, "labels": [], "confusion": []}
    ci95 = dict.fromkeys((*names, "macro_f1", "weighted_f1"))
    return empty | dict.fromkeys(names) | {"per_class": {}} | averages | {"ci95": ci95}
