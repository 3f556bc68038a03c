"""From scored frames to a calibrated confidence, and how far it can be believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score

from core.errors import UserError
from core.perception.evidence import Calibration, Evidence
from core.study.accuracy import FrameScore, summarise
from core.types import Reason

WRONG_THETA_DEG, WRONG_HEAD_PX = 5.0, 15.0
"""An answer is wrong when theta or head is off by more than this, or when there is no robot at all."""
_LEAST = 20
"""Right and wrong answers that a fit needs."""


class CalibrationError(UserError):
    """The frames do not allow a calibration; the message is one line and says what to do."""


def is_right(score: FrameScore) -> bool:
    """Whether an answered frame was answered rightly."""
    if not score.expected or score.theta_error_deg is None or score.head_error_px is None:
        return False
    return abs(score.theta_error_deg) <= WRONG_THETA_DEG and score.head_error_px <= WRONG_HEAD_PX


def check_frames(number: int) -> None:
    """Raise CalibrationError where so few frames could not be enough, whatever is answered: said before they are looked at."""
    if number < 2 * _LEAST:
        needed = f"a calibration needs {_LEAST} right and {_LEAST} wrong answers"
        raise CalibrationError(f"{number} frames: {needed}; give it more frames (synth --count)")


def fit(evidence: Sequence[Sequence[float]], right: Sequence[bool], fitted_on: dict[str, Any]) -> Calibration:
    """Fit a calibration on the evidence of answered frames (N, F) and whether each answer was right.

    `evidence` is with or without the swings, but the same in all rows.

    Raises
    ------
    CalibrationError
        Too few right or wrong answers to learn from.
    """
    if min(sum(right), len(right) - sum(right)) < _LEAST:
        found = f"{sum(right)} right and {len(right) - sum(right)} wrong answers"
        raise CalibrationError(f"{found}: a calibration needs {_LEAST} of each; give it more frames (synth --count)")
    x = np.array(evidence, np.float64)
    mean, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-3)
    standard = np.clip((x - mean) / scale, -4.0, 4.0)
    regression = LogisticRegression(C=0.3, max_iter=1000).fit(standard, np.array(right))
    return Calibration(
        features=Evidence.names()[: x.shape[1]],
        mean=tuple(mean.tolist()),
        scale=tuple(scale.tolist()),
        weights=tuple(regression.coef_[0].tolist()),
        offset=float(regression.intercept_[0]),
        fitted_on=fitted_on | {"answers": len(right), "right": int(sum(right))},
    )


@dataclass(frozen=True, slots=True)
class Bin:
    """Answers whose confidence lies in ``low``..``high``: how many, what they promised on average, and what share was right."""

    low: float
    high: float
    count: int
    mean_confidence: float
    right_share: float


def reliability(confidence: NDArray[np.float64], right: NDArray[np.bool_], edges: Sequence[float]) -> list[Bin]:
    """The reliability table over the bins between `edges` (ascending, 0..1); empty bins are left out."""
    place = np.clip(np.digitize(confidence, edges) - 1, 0, len(edges) - 2)
    bins = []
    for index in range(len(edges) - 1):
        inside = place == index
        if inside.any():
            promised, kept = float(confidence[inside].mean()), float(right[inside].mean())
            bins.append(Bin(edges[index], edges[index + 1], int(inside.sum()), promised, kept))
    return bins


def expected_calibration_error(bins: Sequence[Bin]) -> float | None:
    """Mean distance of promise and truth over the bins, weighted by their counts; None without answers."""
    total = sum(b.count for b in bins)
    return sum(b.count * abs(b.mean_confidence - b.right_share) for b in bins) / total if total else None


def auroc(confidence: NDArray[np.float64], right: NDArray[np.bool_]) -> float | None:
    """Probability that a right answer is more confident than a wrong one; None when there are not both kinds."""
    return float(roc_auc_score(right, confidence)) if right.any() and not right.all() else None


_EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.0)


def describe_confidence(scores: Sequence[FrameScore]) -> dict[str, Any]:
    """How far the confidence of the answered frames can be believed: AUROC, calibration error, reliability table."""
    answered = [score for score in scores if score.answered and score.is_measured]
    confidence = np.array([score.confidence for score in answered])
    right = np.array([is_right(score) for score in answered], np.bool_)
    bins = reliability(confidence, right, _EDGES)
    return {
        "confidence_auroc": auroc(confidence, right),
        "calibration_error": expected_calibration_error(bins),
        "reliability": {
            f"{b.low:.2f}-{b.high:.2f}": {"n": b.count, "promised": b.mean_confidence, "right": b.right_share} for b in bins
        },
    }


_GATES = (0.5, 0.7, 0.8, 0.9, 0.95, 0.98)
_PER_GATE = ("answered_share", "state_agreement", "state_kappa", "theta_pearson", "answered_and_wrong_share")


def describe_gates(scores: Sequence[FrameScore]) -> dict[str, dict[str, float | None]]:
    """What is answered, and how well, where ``perception.quality.min_confidence`` is stricter: figures of ``summarise`` by limit.

    ``theta_mean_deg`` is the mean absolute error. Limits below which there is no answer are left out.
    """
    lowest = min((score.confidence for score in scores if score.answered and score.expected), default=1.0)
    gates = {}
    for limit in _GATES:
        if limit > lowest:
            sums = summarise([score if score.confidence >= limit else _refused(score) for score in scores])
            theta = sums["theta_error_deg"]
            gates[f"{limit:.2f}"] = {key: sums[key] for key in _PER_GATE} | {"theta_mean_deg": theta["mean"] if theta else None}
    return gates


def _refused(score: FrameScore) -> FrameScore:
    if not score.answered:
        return score
    refused = replace(score, answered=False, reason=Reason.LOW_CONFIDENCE, confidence=0.0)
    return replace(refused, head_error_px=None, theta_error_deg=None, theta_deg=None, state=None)
