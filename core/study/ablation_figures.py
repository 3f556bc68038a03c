"""The numbers of the ablation's table: values over frames, and differences between variants with paired bootstrap intervals.

Each difference comes with a 95 % interval (percentile method); the same frames are drawn for both variants.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from core.study.ablation import Variant
from core.study.accuracy import WRONG_DEG, WRONG_PX, FrameScore

RESAMPLES = 1000
MIN_DEFINED = 0.9
"""A difference that is undefined in more resamples than the rest of these (a row that hardly answers) has no interval."""
MIN_GROUPS = 10
"""Frames of one phantom are alike, so whole phantoms are drawn; with fewer than this many of them there is no interval."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A column of the table: the mean or a quantile of one value per frame."""

    key: str
    title: str
    of: Literal["theta", "head", "agreed", "answered", "wrong"]
    quantile: float | None
    is_share: bool = False


MEASURES = (
    Measure("theta_median_deg", "theta median, deg", "theta", 0.5),
    Measure("theta_mean_deg", "theta mean", "theta", None),
    Measure("theta_p95_deg", "theta p95", "theta", 0.95),
    Measure("head_median_px", "head median, px", "head", 0.5),
    Measure("head_p95_px", "head p95", "head", 0.95),
    Measure("state_agreement", "state agrees", "agreed", None, is_share=True),
    Measure("answered_share", "answered", "answered", None, is_share=True),
    Measure("wrong_share", "answered and wrong", "wrong", None, is_share=True),
)


@dataclass(frozen=True, slots=True)
class Figure:
    """A value, its difference to the row it is compared with, and that difference's 95 % interval; None where not defined."""

    value: float | None
    difference: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def is_clear(self) -> bool:
        """Whether the interval leaves out zero."""
        return self.low is not None and self.high is not None and (self.low > 0.0 or self.high < 0.0)

    def to_json(self) -> dict[str, float | None]:
        return {"value": self.value, "difference": self.difference, "low": self.low, "high": self.high}


def figures(
    scores: Sequence[Sequence[FrameScore]], compared_with: Sequence[int | None], groups: Sequence[Hashable], seed: int = 0
) -> list[dict[str, Figure]]:
    """The table's numbers: for each variant and ``Measure.key`` a figure.

    Parameters
    ----------
    scores : for each variant the scores of the same frames in the same order.
    compared_with : for each variant the index of the one that its differences refer to.
    groups : for each frame what it belongs to (its phantom); whole groups are drawn, see ``MIN_GROUPS``.
    seed : of the bootstrap.
    """
    expected = [index for index, score in enumerate(scores[0]) if score.expected]
    drawn_from = [groups[index] for index in expected]
    weights = draw_weights(drawn_from, seed) if are_enough(drawn_from) else np.zeros((1, len(expected)), np.int64)
    once = np.ones((1, len(expected)), np.int64)
    columns = [{measure.of: _column([row[i] for i in expected], measure.of) for measure in MEASURES} for row in scores]
    table: list[dict[str, Figure]] = [{} for _ in scores]
    for measure in MEASURES:
        values = [column[measure.of] for column in columns]
        plain = [float(estimate(value, once, measure.quantile)[0]) for value in values]
        drawn = [estimate(value, weights, measure.quantile) for value in values]
        for index, other in enumerate(compared_with):
            table[index][measure.key] = _figure(plain, drawn, index, other)
    return table


def _figure(plain: list[float], drawn: list[NDArray[np.float64]], index: int, other: int | None) -> Figure:
    value = _number(plain[index])
    if other is None:
        return Figure(value)
    difference = _number(plain[index] - plain[other])
    differences = drawn[index] - drawn[other]
    defined = differences[np.isfinite(differences)]
    if difference is None or len(defined) < MIN_DEFINED * len(differences):
        return Figure(value, difference)
    low, high = np.percentile(defined, (2.5, 97.5))
    return Figure(value, difference, float(low), float(high))


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def are_enough(groups: Sequence[Hashable]) -> bool:
    """Whether there are groups enough for intervals."""
    return len(set(groups)) >= MIN_GROUPS


def draw_weights(groups: Sequence[Hashable], seed: int, resamples: int = RESAMPLES) -> NDArray[np.int64]:
    """How often each frame is in each bootstrap resample of whole groups, shape (resamples, frames)."""
    place = {name: index for index, name in enumerate(dict.fromkeys(groups))}
    member = np.array([place[group] for group in groups], np.int64)
    count = int(member.max(initial=-1)) + 1
    if count == 0:
        return np.zeros((resamples, 0), np.int64)
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), size=resamples)
    return np.asarray(drawn[:, member], np.int64)


def estimate(values: NDArray[np.float64], weights: NDArray[np.int64], quantile: float | None) -> NDArray[np.float64]:
    """Mean or quantile of `values` (N,) repeated as often as each row of `weights` (B, N) says; NaN values are left out.

    The quantile is the one of ``numpy.quantile`` on the repeated values. Shape (B,); NaN where a row holds no value.
    """
    known = np.isfinite(values)
    values, weights = values[known], weights[:, known]
    total = weights.sum(axis=1)
    result = np.full(len(weights), np.nan)
    some = total > 0
    if not some.any():
        return result
    if quantile is None:
        result[some] = (weights[some] @ values) / total[some]
        return result
    order = np.argsort(values, kind="stable")
    values, upto = values[order], np.cumsum(weights[some][:, order], axis=1)
    position = quantile * (total[some] - 1)
    below = np.floor(position).astype(np.int64)
    above = np.minimum(below + 1, total[some] - 1)
    first, second = (values[(upto <= rank[:, None]).sum(axis=1)] for rank in (below, above))
    result[some] = first + (position - below) * (second - first)
    return result


def _column(scores: Sequence[FrameScore], of: str) -> NDArray[np.float64]:
    """One value per frame; NaN where the frame says nothing about it."""
    return np.array([_value(score, of) for score in scores], np.float64)


def _value(score: FrameScore, of: str) -> float:
    if of == "answered":
        return float(score.answered)
    if score.theta_error_deg is None or score.head_error_px is None:
        return np.nan
    theta, head = abs(score.theta_error_deg), score.head_error_px
    wrong = theta > WRONG_DEG or head > WRONG_PX
    return float({"theta": theta, "head": head, "agreed": score.state == score.true_state, "wrong": wrong}[of])


def refusals(scores: Sequence[FrameScore]) -> dict[str, int]:
    """How often each reason was given for no answer, where the truth has a pose."""
    counted: dict[str, int] = {}
    for score in scores:
        if score.expected and score.reason is not None:
            counted[score.reason.value] = counted.get(score.reason.value, 0) + 1
    return dict(sorted(counted.items(), key=lambda item: (-item[1], item[0])))


def frame_rows(variants: Sequence[Variant], scores: Sequence[Sequence[FrameScore]]) -> list[dict[str, Any]]:
    """What each variant found in each frame, as plain rows for a CSV."""
    return [
        {
            "stem": score.stem,
            "variant": variant.name,
            "theta_error_deg": score.theta_error_deg,
            "head_error_px": score.head_error_px,
            "state": score.state,
            "true_state": score.true_state,
            "confidence": score.confidence if score.answered else None,
            "reason": score.reason.value if score.reason is not None else None,
        }
        for variant, row in zip(variants, scores, strict=True)
        for score in row
    ]
