"""How well raters agree with themselves and with each other; and their common answer, which the algorithm is judged by."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np

from core.study.agreement import LIMITS_SD, icc_absolute, repeat_metrics
from core.study.annotation_records import StoredAnnotation
from core.study.annotations import AnnotationError, Status, status_of
from core.study.bootstrap import Floats
from core.study.classification import kappa
from core.study.evaluation import Measurement

_Table = Mapping[tuple[str, str, int], StoredAnnotation]
"""Finished annotations by rater, image, repeat."""


def choose_study(annotations: Sequence[StoredAnnotation], study: str | None, where: str) -> list[StoredAnnotation]:
    """The finished annotations of one study; without a name, of the only one there is. Raises AnnotationError."""
    done = [one for one in annotations if _status(one) in (Status.DONE, Status.CANNOT_TELL)]
    names = sorted({one.key.study for one in done})
    if study is None and len(names) > 1:
        listed = ", ".join(repr(name) if name else "'' (outside studies)" for name in names)
        raise AnnotationError(f"{where}: holds several studies ({listed}); choose one with --study NAME")
    chosen = [one for one in done if study is None or one.key.study == study]
    if not chosen:
        of_study = f" of study {study!r}" if study else ""
        raise AnnotationError(f"{where}: no finished annotation{of_study} (both lines and a state, or can't tell)")
    return chosen


def agreement_report(annotations: Iterable[StoredAnnotation], names: Mapping[str, str], seed: int = 0) -> dict[str, Any]:
    """Agreement within and between raters.

    Parameters
    ----------
    annotations : finished ones of one study.
    names : image names by SHA-256, for the list of measures.
    seed : of the bootstrap intervals.

    Returns
    -------
    dict
        ``raters``: each rater's first against his second measure (``angle`` with limits of agreement, ICC and SD of one measure;
        ``state`` with kappa). ``pairs``: two raters' first measures of the same images, likewise. ``between``: over all raters that
        measured the same images, SD of a rater's measure about the image's mean, and ICC(2,1). Undefined figures are None.
    """
    table = {(one.key.rater, one.key.sha256, one.key.repeat): one for one in annotations}
    raters = sorted({rater for rater, _, _ in table})
    return {
        "images": len({image for _, image, _ in table}),
        "annotations": len(table),
        "raters": {rater: _within(table, rater, seed) for rater in raters},
        "pairs": [_pair(table, first, second, seed) for first, second in combinations(raters, 2)],
        "between": _between(table, raters),
        "measures": [_measure_row(one, names) for one in table.values()],
    }


def _within(table: _Table, rater: str, seed: int) -> dict[str, Any]:
    own = {(image, repeat): one for (who, image, repeat), one in table.items() if who == rater}
    both = [(one, own[image, 2]) for (image, repeat), one in own.items() if repeat == 1 and (image, 2) in own]
    times = [one.time_spent_s for one in own.values()]
    return {
        "annotations": len(own),
        "cannot_tell": sum(one.content.cannot_tell for one in own.values()),
        "median_time_s": median(times) if times else None,
        "sd_deg": _pooled_sd(_grouped_by_image(own)),
    } | _compare(both, seed)


def _grouped_by_image(own: Mapping[tuple[str, int], StoredAnnotation]) -> list[list[float]]:
    groups: dict[str, list[float]] = {}
    for (image, _), one in own.items():
        if one.theta_deg is not None and not one.content.cannot_tell:
            groups.setdefault(image, []).append(one.theta_deg)
    return list(groups.values())


def _pooled_sd(groups: Iterable[Sequence[float]]) -> float | None:
    """Standard deviation of one measure about its group's mean, over all groups of two or more; None without any."""
    spread = [(float(np.var(group)) * len(group), len(group) - 1) for group in groups if len(group) > 1]
    freedom = sum(degrees for _, degrees in spread)
    return float(np.sqrt(sum(squares for squares, _ in spread) / freedom)) if freedom else None


def _pair(table: _Table, first: str, second: str, seed: int) -> dict[str, Any]:
    both = [(one, table[second, i, 1]) for (who, i, k), one in table.items() if who == first and k == 1 and (second, i, 1) in table]
    return {"first": first, "second": second} | _compare(both, seed)


def _compare(both: Sequence[tuple[StoredAnnotation, StoredAnnotation]], seed: int) -> dict[str, Any]:
    """Two measures of the same images: angles where both have one, states and "can't tell" where both answered."""
    angles = [(a.theta_deg, b.theta_deg) for a, b in both if not a.content.cannot_tell and not b.content.cannot_tell]
    known = np.array([pair for pair in angles if None not in pair], np.float64).reshape(-1, 2)
    angle = repeat_metrics(known[:, 0], known[:, 1], seed) | _limits(known)
    labels = [(_label(a), _label(b)) for a, b in both]
    first, second = [a for a, _ in labels], [b for _, b in labels]
    equal = sum(a == b for a, b in labels) / len(labels) if labels else None
    return {"angle": angle, "state": {"n": len(labels), "equal": equal, "kappa": kappa(first, second) if labels else None}}


def _limits(known: Floats) -> dict[str, float | None]:
    """Bland and Altman's limits of agreement of the second measure against the first."""
    if len(known) < 2:
        return {"loa_low_deg": None, "loa_high_deg": None}
    difference = known[:, 1] - known[:, 0]
    mean, reach = float(difference.mean()), LIMITS_SD * float(difference.std(ddof=1))
    return {"loa_low_deg": mean - reach, "loa_high_deg": mean + reach}


def _between(table: _Table, raters: Sequence[str]) -> dict[str, Any]:
    first = {
        (who, image): one.theta_deg for (who, image, repeat), one in table.items() if repeat == 1 and not one.content.cannot_tell
    }
    images = sorted({image for _, image in first})
    groups = [[angle for who in raters if (angle := first.get((who, image))) is not None] for image in images]
    complete = [group for group in groups if len(group) == len(raters)] if len(raters) > 1 else []
    icc = float(icc_absolute(np.array(complete))) if len(complete) > 1 else float("nan")
    return {"raters": len(raters), "n": len(complete), "sd_deg": _pooled_sd(complete), "icc": icc if np.isfinite(icc) else None}


def _measure_row(one: StoredAnnotation, names: Mapping[str, str]) -> dict[str, Any]:
    return {
        "image": names.get(one.key.sha256, one.key.sha256),
        "rater": one.key.rater,
        "repeat": one.key.repeat,
        "view": one.view.value,
        "theta_deg": one.theta_deg,
        "d_head_px": one.d_head_px,
        "d_tail_px": one.d_tail_px,
        "crossed": one.crossed,
        "state": one.content.state.value if one.content.state else None,
        "cannot_tell": one.content.cannot_tell,
        "time_spent_s": round(one.time_spent_s, 1),
        "note": one.content.note,
    }


def write_measures(path: Path, measures: Sequence[Mapping[str, Any]]) -> None:
    """The list of measures as CSV, blank where there is none; raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(measures[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(measures)


def manual_measurements(annotations: Iterable[StoredAnnotation], names: Mapping[str, str]) -> list[Measurement]:
    """One row per image for ``evaluate``; the algorithm's columns are still empty.

    ``angle_1`` is the mean of the raters' first measures and ``angle_2`` that of their later ones. Where nobody measured twice but
    several raters did, they are the first rater's and the mean of the others'. The state is the one given most often, of equals the
    first rater's. Who could not tell says nothing here.
    """
    by_image: dict[str, list[StoredAnnotation]] = {}
    for one in sorted(annotations, key=lambda one: (one.key.rater, one.key.repeat)):
        by_image.setdefault(one.key.sha256, []).append(one)
    return [_common(names.get(image, image), group) for image, group in by_image.items()]


def _common(name: str, group: Sequence[StoredAnnotation]) -> Measurement:
    telling = [one for one in group if not one.content.cannot_tell]
    measured = [(one.key.repeat, one.theta_deg) for one in telling if one.theta_deg is not None]
    first, later = ([angle for k, angle in measured if (k == 1) is is_first] for is_first in (True, False))
    if not later:
        first, later = first[:1], first[1:]
    states = [one.content.state.value for one in telling if one.content.state is not None]
    state = Counter(states).most_common(1)[0][0] if states else None
    counts = max(len(first), 1), max(len(later), 1)
    return Measurement(name, fmean(first) if first else None, fmean(later) if later else None, state, None, None, counts=counts)


def _label(one: StoredAnnotation) -> str:
    return Status.CANNOT_TELL.value if one.content.cannot_tell else str(one.content.state)


def _status(one: StoredAnnotation) -> Status:
    return status_of(one.content, measured=one.theta_deg is not None)
