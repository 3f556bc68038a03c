"""The paper's own figures, and a study built like its test from a labelled set (METHOD section 7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from core.evaluation.metrics import LIMITS_SD, RANGE_DEG

PAPER_IMAGES = 48
"""Images in the paper's test; all its shares and its confusion matrix need n = 44, so four of them are not in its figures."""
PAPER_LABELS = ("B", "C", "D")
PAPER_CONFUSION = ((12, 1, 0), (2, 23, 1), (0, 1, 4))
"""Rows manual, columns algorithm: the only table that gives all of the paper's figures of states."""

PAPER: dict[str, Any] = {
    "angle": {
        "mean_error_deg": 2.25,
        "sd_deg": 5.68,
        "median_deg": 2.14,
        "pearson": 0.869,
        "spearman": 0.870,
        "share_0_4": 0.75,
        "share_4_8": 0.227,
        "share_0_8": 0.977,
        # not printed in the paper; from its mean and standard deviation
        "loa_low_deg": 2.25 - LIMITS_SD * 5.68,
        "loa_high_deg": 2.25 + LIMITS_SD * 5.68,
    },
    "state": {
        "accuracy": 0.886,
        "kappa": 0.796,
        "fowlkes_mallows_pairs": 0.801,
        "per_class": {
            "B": {"precision": 0.86, "recall": 0.92, "f1": 0.89},
            "C": {"precision": 0.92, "recall": 0.88, "f1": 0.90},
            "D": {"precision": 0.80, "recall": 0.80, "f1": 0.80},
        },
        "macro": {"precision": 0.86, "recall": 0.87, "f1": 0.86},
        "weighted": {"precision": 0.89, "recall": 0.89, "f1": 0.89},
    },
}


class Better(StrEnum):
    """Which way a figure gets better."""

    LARGER = "larger"
    NEARER_ZERO = "nearer zero"
    NEITHER = "neither"


class FigureFormat(StrEnum):
    """How a figure is written; the digits are the paper's."""

    DEGREES = "degrees"
    COEFFICIENT = "coefficient"
    PERCENT = "percent"
    RATIO = "ratio"

    def write(self, value: float | None, *, unit: bool = True) -> str:
        """The figure as text, an en dash for None."""
        if value is None:
            return "–"
        if self is FigureFormat.PERCENT:
            return f"{100 * value:.1f}" + (" %" if unit else "")
        digits = 3 if self is FigureFormat.COEFFICIENT else 2
        return f"{round(value, digits) + 0.0:.{digits}f}" + ("°" if self is FigureFormat.DEGREES and unit else "")

    def rounded(self, value: float) -> float:
        return round(value, 2 if self in {FigureFormat.DEGREES, FigureFormat.RATIO} else 3)


class Verdict(StrEnum):
    """A figure against the paper's, at the paper's digits."""

    BETTER = "better"
    EQUAL = "equal"
    WORSE = "worse"


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A figure of the evaluation: where it stands in ``metrics.json``, what it is called, how it is written."""

    section: str
    name: str
    label: str
    kind: FigureFormat
    better: Better = Better.NEITHER


_D, _C, _P = FigureFormat.DEGREES, FigureFormat.COEFFICIENT, FigureFormat.PERCENT
ANGLE_FIGURES = (
    FigureKind("angle", "mean_error_deg", "Mean error", _D, Better.NEARER_ZERO),
    FigureKind("angle", "sd_deg", "Standard deviation of the error", _D, Better.NEARER_ZERO),
    FigureKind("angle", "median_deg", "Median error", _D, Better.NEARER_ZERO),
    FigureKind("angle", "mean_abs_error_deg", "Mean absolute error", _D),
    FigureKind("angle", "median_abs_error_deg", "Median absolute error", _D),
    FigureKind("angle", "pearson", "Pearson correlation r", _C, Better.LARGER),
    FigureKind("angle", "spearman", "Spearman correlation ρ", _C, Better.LARGER),
    FigureKind("angle", "icc", "ICC(2,1) with the manual mean", _C),
    FigureKind("manual", "icc", "ICC(2,1) of two manual measures", _C),
    FigureKind("manual", "repeatability_sd_deg", "SD of one manual measure", _D),
    FigureKind("angle", "loa_low_deg", "Lower limit of agreement", _D, Better.NEARER_ZERO),
    FigureKind("angle", "loa_high_deg", "Upper limit of agreement", _D, Better.NEARER_ZERO),
    FigureKind("angle", "share_0_4", "Errors within 0–4 % of 180°", _P, Better.LARGER),
    FigureKind("angle", "share_4_8", "Errors within 4–8 %", _P),
    FigureKind("angle", "share_0_8", "Errors within 0–8 %", _P, Better.LARGER),
    FigureKind("angle", "share_8_12", "Errors within 8–12 %", _P),
    FigureKind("angle", "share_12_16", "Errors within 12–16 %", _P),
    FigureKind("angle", "share_over_16", "Errors over 16 %", _P),
)
STATE_FIGURES = (
    FigureKind("state", "accuracy", "Accuracy", _P, Better.LARGER),
    FigureKind("state", "kappa", "Cohen’s kappa", _C, Better.LARGER),
    FigureKind("state", "fowlkes_mallows_pairs", "Fowlkes–Mallows, pair counting", _C, Better.LARGER),
    FigureKind("state", "fowlkes_mallows_macro", "Fowlkes–Mallows, mean over states", _C),
)
CLASS_SCORES = ("precision", "recall", "f1")


def verdict(kind: FigureFormat, better: Better, ours: float | None, paper: float | None) -> Verdict | None:
    """`ours` against `paper`, both rounded to the digits that the paper prints; None where they cannot be compared."""
    if ours is None or paper is None or better is Better.NEITHER:
        return None
    a, b = kind.rounded(ours), kind.rounded(paper)
    if better is Better.NEARER_ZERO:
        a, b = -abs(a), -abs(b)
    return Verdict.EQUAL if a == b else Verdict.BETTER if a > b else Verdict.WORSE


def against_paper(metrics: Mapping[str, Any]) -> dict[str, str | None]:
    """Verdict on each figure that the paper gives, by its place in ``metrics.json``; None: undefined here."""
    found: dict[str, str | None] = {}
    for figure in (*ANGLE_FIGURES, *STATE_FIGURES):
        paper = PAPER.get(figure.section, {}).get(figure.name)
        if paper is not None and figure.better is not Better.NEITHER:
            ours = metrics[figure.section][figure.name]
            found[f"{figure.section}.{figure.name}"] = verdict(figure.kind, figure.better, ours, paper)
    state, papers = metrics["state"], PAPER["state"]
    rows = {f"per_class.{label}": (state["per_class"].get(label), papers["per_class"][label]) for label in PAPER_LABELS}
    rows |= {average: (state[average], papers[average]) for average in ("macro", "weighted")}
    for name, (ours_row, paper_row) in rows.items():
        for score in CLASS_SCORES:
            ours = ours_row[score] if ours_row else None
            found[f"state.{name}.{score}"] = verdict(FigureFormat.RATIO, Better.LARGER, ours, paper_row[score])
    return found


def choose_images(states: Mapping[str, str], seed: int) -> list[str]:
    """As many images as the paper has, of states B, C and D in the paper's shares (13 : 26 : 5), drawn by `seed`, sorted by name.

    `states` are the true ones by image; one of which the set has too few gives all it has, and the others are not filled up.
    """
    rng = np.random.default_rng(seed)
    chosen: list[str] = []
    for label, wanted in wanted_images().items():
        having = sorted(image for image, state in states.items() if state == label)
        chosen += [having[place] for place in rng.permutation(len(having))[:wanted]]
    return sorted(chosen)


def wanted_images(count: int = PAPER_IMAGES) -> dict[str, int]:
    """`count` images in the paper's shares, whole by largest remainder: of 48, 14 B, 28 C and 6 D."""
    support = np.array(PAPER_CONFUSION).sum(1)
    exact = count * support / support.sum()
    whole = np.floor(exact).astype(int)
    whole[np.argsort(whole - exact, kind="stable")[: count - whole.sum()]] += 1
    return dict(zip(PAPER_LABELS, whole.tolist(), strict=True))


def measure_twice(theta_deg: Sequence[float], sd_deg: float, seed: int) -> list[tuple[float, float]]:
    """Two manual measures of each true angle, with independent normal errors; like theta itself, they stay in 0 to 180 degrees."""
    # The second stream of the seed: the first one draws the images.
    noise = np.random.default_rng([seed, 1]).normal(0.0, sd_deg, (len(theta_deg), 2))
    measured = np.abs(np.asarray(theta_deg, np.float64)[:, None] + noise)
    folded = RANGE_DEG - np.abs(RANGE_DEG - measured)
    return [(float(first), float(second)) for first, second in folded]
