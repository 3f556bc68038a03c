"""How well raters agree with themselves and with each other; and their common answer, which the algorithm is judged by."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.annotation.merge import raters_alike
from core.annotation.model import ANSWERED, AnnotationError, Status, measure_lines, status_of
from core.annotation.store import MEASURED, ImageRecord, StoredAnnotation
from core.config.models import PerceptionConfig
from core.evaluation.evaluation import Measurement
from core.evaluation.metrics import (
    LIMITS_SD,
    are_too_few,
    icc_absolute,
    kappa,
    members,
    repeat_metrics,
    too_few_words,
    within_subject,
)
from core.types import PoseState

_Table = Mapping[tuple[str, str, int], StoredAnnotation]
"""Finished annotations by rater, image, repeat."""


def finished(annotations: Iterable[StoredAnnotation]) -> list[StoredAnnotation]:
    """Those with both lines and a state, and the answers without a pose."""
    return [one for one in annotations if status_of(one.content, measured=one.theta_deg is not None) in ANSWERED]


def studies_of(annotations: Iterable[StoredAnnotation]) -> list[str]:
    """The studies that they are of, as a message names them."""
    return [repr(name) if name else "'' (outside studies)" for name in sorted({one.key.study for one in annotations})]


def choose_study(annotations: Sequence[StoredAnnotation], study: str | None, where: str) -> list[StoredAnnotation]:
    """The finished annotations of one study; without a name, of the only one there is. Raises AnnotationError."""
    done = finished(annotations)
    names = studies_of(done)
    if study is None and len(names) > 1:
        raise AnnotationError(f"{where}: holds several studies ({', '.join(names)}); choose one with --study NAME")
    chosen = [one for one in done if study is None or one.key.study == study]
    if not chosen:
        of_study = f" of study {study!r}" if study else ""
        raise AnnotationError(f"{where}: no finished annotation{of_study} (both lines and a state, can't tell, or no robot)")
    return chosen


def agreement_report(
    annotations: Iterable[StoredAnnotation], names: Mapping[str, str], seed: int = 0, groups: Mapping[str, str | None] | None = None
) -> dict[str, Any]:
    """Agreement within and between raters.

    Returns a dictionary. ``raters``: each rater's first against second measure (``angle`` with limits of agreement and ICC,
    ``state`` with kappa), and the SD of one measure, over all repeats. ``within``: that SD over all raters. ``pairs``: two raters'
    first measures of the same images, likewise. ``between``: over all raters that measured the same images, SD of a rater's measure
    about the image's mean, and ICC(2,1). Undefined figures: None.

    Parameters
    ----------
    annotations : finished ones of one study.
    names : image names by SHA-256, for the list of measures.
    seed : of the bootstrap intervals.
    groups : session or phantom of each image by SHA-256, None: not known; images of one are alike, and drawn together.
    """
    draw = _Draw(seed, groups or {})
    table = {(one.key.rater, one.key.sha256, one.key.repeat): one for one in annotations}
    raters = sorted({rater for rater, _, _ in table})
    return {
        "images": len({image for _, image, _ in table}),
        "annotations": len(table),
        "raters": {rater: _within(table, rater, draw) for rater in raters},
        "within": _all_within(table, draw),
        "pairs": [_pair(table, first, second, draw) for first, second in combinations(raters, 2)],
        "between": _between(table, raters),
        "measures": [_measure_row(one, names) for one in table.values()],
    }


@dataclass(frozen=True, slots=True)
class _Draw:
    """Of the bootstrap: its seed, and the group of each image by SHA-256."""

    seed: int
    groups: Mapping[str, str | None]

    def members(self, images: Sequence[str]) -> NDArray[np.int64] | None:
        return members([self.groups.get(image) for image in images])


def _within(table: _Table, rater: str, draw: _Draw) -> dict[str, Any]:
    own = {(image, repeat): one for (who, image, repeat), one in table.items() if who == rater}
    both = [(one, own[image, 2]) for (image, repeat), one in own.items() if repeat == 1 and (image, 2) in own]
    times = [one.time_spent_s for one in own.values()]
    return {
        "annotations": len(own),
        "cannot_tell": sum(one.content.cannot_tell for one in own.values()),
        "no_robot": sum(one.content.no_robot for one in own.values()),
        "short_lines": sum(one.is_short for one in own.values()),
        "provenance": dict(Counter(one.provenance.value for one in own.values() if not one.content.without_pose)),
        "median_time_s": median(times) if times else None,
        "sd_deg": _pooled_sd(list(_angles_by_image(table, rater).values())),
    } | _compare(both, draw)


def _angles_by_image(table: _Table, rater: str) -> dict[str, list[float]]:
    angles: dict[str, list[float]] = {}
    for (who, image, _), one in table.items():
        if who == rater and one.theta_deg is not None and not one.content.without_pose:
            angles.setdefault(image, []).append(one.theta_deg)
    return angles


def _all_within(table: _Table, draw: _Draw) -> dict[str, Any]:
    """Over all raters: what one measure of one of them is uncertain by."""
    measures: dict[str, dict[str, list[float]]] = {}
    for (who, image, _), one in table.items():
        if one.theta_deg is not None and not one.content.without_pose:
            measures.setdefault(image, {}).setdefault(who, []).append(one.theta_deg)
    return within_subject([list(raters.values()) for raters in measures.values()], draw.seed, draw.members(list(measures)))


def _pooled_sd(groups: Iterable[Sequence[float]]) -> float | None:
    """Standard deviation of one measure about its group's mean, over all groups of two or more; None without any."""
    spread = [(float(np.var(group)) * len(group), len(group) - 1) for group in groups if len(group) > 1]
    freedom = sum(degrees for _, degrees in spread)
    return float(np.sqrt(sum(squares for squares, _ in spread) / freedom)) if freedom else None


def _pair(table: _Table, first: str, second: str, draw: _Draw) -> dict[str, Any]:
    both = [(one, table[second, i, 1]) for (who, i, k), one in table.items() if who == first and k == 1 and (second, i, 1) in table]
    return {"first": first, "second": second} | _compare(both, draw)


def _compare(both: Sequence[tuple[StoredAnnotation, StoredAnnotation]], draw: _Draw) -> dict[str, Any]:
    """Two answers about the same images: angles and states where both have one, and how often one or both give none."""
    telling = [(a, b) for a, b in both if not a.content.without_pose and not b.content.without_pose]
    measured = [(a, b) for a, b in telling if a.theta_deg is not None and b.theta_deg is not None]
    known = np.array([(a.theta_deg, b.theta_deg) for a, b in measured], np.float64).reshape(-1, 2)
    angle = repeat_metrics(known[:, 0], known[:, 1], draw.seed, draw.members([a.key.sha256 for a, _ in measured]))
    # The SD of one measure is a rater's own, over all repeats, and stands in one place; between two raters it means nothing.
    del angle["repeatability_sd_deg"], angle["ci95"]["repeatability_sd_deg"]
    # Bland and Altman's limits of agreement of the second measure against the first.
    angle |= {"loa_low_deg": None, "loa_high_deg": None}
    if len(known) > 1:
        difference = known[:, 1] - known[:, 0]
        mean, reach = float(difference.mean()), LIMITS_SD * float(difference.std(ddof=1))
        angle |= {"loa_low_deg": mean - reach, "loa_high_deg": mean + reach}
    # An answer without a pose is no state: to give it for the same images is no agreement about a state.
    given = [(str(a.content.state), str(b.content.state)) for a, b in telling if a.content.state and b.content.state]
    first, second = [a for a, _ in given], [b for _, b in given]
    unclear = Counter(a.content.cannot_tell + b.content.cannot_tell for a, b in both)
    empty = Counter(a.content.no_robot + b.content.no_robot for a, b in both)
    state = {
        "n": len(given),
        "equal": sum(a == b for a, b in given) / len(given) if given else None,
        "kappa": kappa(first, second) if given else None,
        "one_cannot_tell": unclear[1],
        "neither_can_tell": unclear[2],
        "one_no_robot": empty[1],
        "both_no_robot": empty[2],
    }
    return {"angle": angle, "state": state}


def _between(table: _Table, raters: Sequence[str]) -> dict[str, Any]:
    first = {
        (who, image): one.theta_deg for (who, image, repeat), one in table.items() if repeat == 1 and not one.content.without_pose
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
        "no_robot": one.content.no_robot,
        "short_lines": one.is_short,
        "provenance": one.provenance.value if one.theta_deg is not None else None,
        "time_spent_s": round(one.time_spent_s, 1),
        "note": one.content.note,
    }


def write_measures(path: Path, measures: Sequence[Mapping[str, Any]]) -> None:
    """The list of measures as CSV, blank for None; raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(measures[0]), lineterminator="\n")
        table.writeheader()
        table.writerows({name: _rounded(value) for name, value in row.items()} for row in measures)


DECIMALS = 4
"""Of angles and distances in tables: finer than any of them is measured."""


def _rounded(value: object) -> object:
    return round(value, DECIMALS) if isinstance(value, float) else value


def manual_measurements(annotations: Iterable[StoredAnnotation], names: Mapping[str, str]) -> list[Measurement]:
    """One row per image for ``evaluate``; the algorithm's columns are still empty.

    ``angle_1`` is the mean of the raters' first measures, ``angle_2`` that of their later ones. Where no rater measured twice but
    several raters did, they are the first rater's and the mean of the others'. The state is the one given most often, of equals the
    first rater's. Answers without a pose count where there is no other: the one given most often is the row's ``answer``.
    """
    by_image: dict[str, list[StoredAnnotation]] = {}
    for one in sorted(annotations, key=lambda one: (one.key.rater, one.key.repeat)):
        by_image.setdefault(one.key.sha256, []).append(one)
    return [_common(names.get(image, image), group) for image, group in by_image.items()]


def rater_notes(annotations: Iterable[StoredAnnotation]) -> list[str]:
    """Names of raters that may be one person's."""
    raters = {one.key.rater for one in annotations}
    return [f"The {line}: figures between raters count them so." for line in raters_alike(raters)]


def group_notes(annotations: Iterable[StoredAnnotation], groups: Mapping[str, str | None]) -> list[str]:
    """Why ``agreement_report`` has no intervals, where their images' `groups` (by SHA-256) are too few."""
    of_images = [groups.get(sha256) for sha256 in dict.fromkeys(one.key.sha256 for one in annotations)]
    known = {group for group in of_images if group is not None}
    return [too_few_words("intervals between measures", len(known))] if are_too_few(members(of_images)) else []


def second_measure_notes(annotations: Iterable[StoredAnnotation]) -> list[str]:
    """Where the second of ``manual_measurements`` is a rater's own on some images and another rater's on others."""
    by_image: dict[str, list[int]] = {}
    for one in annotations:
        if one.theta_deg is not None and not one.content.without_pose:
            by_image.setdefault(one.key.sha256, []).append(one.key.repeat)
    kinds: Counter[str] = Counter()
    for repeats in by_image.values():
        later = sum(repeat > 1 for repeat in repeats)
        if 0 < later < len(repeats):
            kinds["repeat"] += 1
        elif not later and len(repeats) > 1:
            kinds["rater"] += 1
    if len(kinds) < 2:
        return []
    return [
        f"The second manual measure is a rater's later one on {kinds['repeat']} images and another rater's on {kinds['rater']}; "
        "figures of two manual measures (ICC, repeatability) mix what one rater and what several are uncertain by."
    ]


def undecided(annotations: Iterable[StoredAnnotation]) -> int:
    """On how many images no state was given most often: two raters of different minds, for one."""
    states: dict[str, Counter[PoseState]] = {}
    for one in annotations:
        if one.content.state is not None and not one.content.without_pose:
            states.setdefault(one.key.sha256, Counter())[one.content.state] += 1
    return sum(len(most) > 1 and most[0][1] == most[1][1] for most in (found.most_common(2) for found in states.values()))


def _common(name: str, group: Sequence[StoredAnnotation]) -> Measurement:
    telling = [one for one in group if not one.content.without_pose]
    measured = [(one.key.repeat, one.theta_deg) for one in telling if one.theta_deg is not None]
    first, later = ([angle for k, angle in measured if (k == 1) is is_first] for is_first in (True, False))
    if not later:
        first, later = first[:1], first[1:]
    states = [one.content.state.value for one in telling if one.content.state is not None]
    state = Counter(states).most_common(1)[0][0] if states else None
    answers = [(Status.NO_ROBOT if one.content.no_robot else Status.CANNOT_TELL).value for one in group]
    return Measurement(
        name,
        round(fmean(first), DECIMALS) if first else None,
        round(fmean(later), DECIMALS) if later else None,
        state,
        None,
        None,
        counts=(max(len(first), 1), max(len(later), 1)),
        answer=None if telling else Counter(answers).most_common(1)[0][0],
        provenance="+".join(sorted({one.provenance.value for one in telling if one.theta_deg is not None})) or None,
        short_lines="yes" if any(one.is_short for one in telling) else None,
    )


_SAME_DEG = 0.005  # angles are shown no finer


def measured_alike(
    annotations: Sequence[StoredAnnotation], images: Mapping[str, ImageRecord], config: PerceptionConfig
) -> tuple[list[StoredAnnotation], list[str]]:
    """The annotations with angle, side and distances of their lines as `config` fits them; states stay as they were given.

    Also a note for the reader where some of the angles were others when they were drawn. Annotations of images that `images`
    (by SHA-256) does not have stay as they were kept.
    """
    alike = [_measured(one, images[one.key.sha256].size, config) if one.key.sha256 in images else one for one in annotations]
    others = sum(not _is_same(was.theta_deg, now.theta_deg) for was, now in zip(annotations, alike, strict=True))
    if not others:
        return alike, []
    gone = sum(was.theta_deg is not None and now.theta_deg is None for was, now in zip(annotations, alike, strict=True))
    lengths = f"robot {config.vectors.robot_length_px:g} px, vessel twice {config.vectors.vessel_half_length_px:g} px"
    return alike, [
        f"Of the manual angles {others} were fitted otherwise when they were drawn (with other lengths of the lines, say); here "
        f"all are fitted anew to what was drawn, as the algorithm's are ({lengths})."
        + (f" On {gone} of them too little was drawn for these lengths: they have a state, and no angle." if gone else "")
    ]


def _measured(one: StoredAnnotation, size: tuple[int, int], config: PerceptionConfig) -> StoredAnnotation:
    readout = measure_lines(one.content, size, config)
    measured: dict[str, Any] = {name: getattr(readout.pose, name, None) for name in MEASURED}
    return replace(one, is_short=readout.is_short if readout.pose is not None else one.is_short, **measured)


def _is_same(one_deg: float | None, other_deg: float | None) -> bool:
    if one_deg is None or other_deg is None:
        return one_deg is other_deg
    return abs(one_deg - other_deg) < _SAME_DEG
