"""From scored frames to a calibrated confidence, and from known pictures to the limit of out-of-distribution ones."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from core.config.models import PerceptionConfig
from core.devices import UserError
from core.evaluation.accuracy import FrameScore, summarise
from core.files import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS, DatasetError, read_truth
from core.perception import quality, segmentation
from core.perception.out_of_distribution import OutOfDistributionReference, Signature, packed
from core.perception.quality import ConfidenceCalibration, ConfidenceFeatures
from core.perception.segmentation import Segmenter, to_working
from core.types import Reason

WRONG_THETA_DEG, WRONG_HEAD_PX = 5.0, 15.0  # an answer is wrong when theta or head is off by more, or when there is no robot
_LEAST = 20  # right and wrong answers that a fit needs


class CalibrationError(UserError):
    """The frames do not allow a calibration; the message is one line and says what to do."""


def is_right(score: FrameScore) -> bool:
    """Whether an answered frame was answered rightly."""
    if not score.expected or score.theta_error_deg is None or score.head_error_px is None:
        return False
    return abs(score.theta_error_deg) <= WRONG_THETA_DEG and score.head_error_px <= WRONG_HEAD_PX


def check_frames(number: int) -> None:
    """Raise CalibrationError, before frames are perceived, where so few could not be enough whatever is answered."""
    if number < 2 * _LEAST:
        needed = f"a calibration needs {_LEAST} right and {_LEAST} wrong answers"
        raise CalibrationError(f"{number} frames: {needed}; give it more frames (synth --count)")


def fit(evidence: Sequence[Sequence[float]], right: Sequence[bool], fitted_on: dict[str, Any]) -> ConfidenceCalibration:
    """Fit a calibration on the evidence of answered frames (N, F) and whether each answer was right.

    `evidence` is with or without the threshold sensitivity, but the same in all rows.

    Raises CalibrationError: too few right or wrong answers to learn from.
    """
    if min(sum(right), len(right) - sum(right)) < _LEAST:
        found = f"{sum(right)} right and {len(right) - sum(right)} wrong answers"
        raise CalibrationError(f"{found}: a calibration needs {_LEAST} of each; give it more frames (synth --count)")
    x = np.array(evidence, np.float64)
    mean, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-3)
    standard = np.clip((x - mean) / scale, -4.0, 4.0)
    weights = _logistic(standard, np.array(right, np.float64))
    return ConfidenceCalibration(
        features=ConfidenceFeatures.names()[: x.shape[1]],
        mean=tuple(mean.tolist()),
        scale=tuple(scale.tolist()),
        weights=tuple(weights[:-1].tolist()),
        offset=float(weights[-1]),
        fitted_on=fitted_on | {"answers": len(right), "right": int(sum(right))},
    )


def _logistic(x: NDArray[np.float64], right: NDArray[np.float64], penalty: float = 1 / 0.3) -> NDArray[np.float64]:
    """Weights of a logistic regression with a quadratic `penalty`, and its offset, which has none: (F + 1,), by Newton's steps.

    ``LogisticRegression(C=1 / penalty)`` of scikit-learn gives the same, for 50 MB more to install.
    """
    x = np.column_stack([x, np.ones(len(x))])
    ridge, weights = np.diag([penalty] * (x.shape[1] - 1) + [0.0]), np.zeros(x.shape[1])
    for _ in range(100):
        found = 1 / (1 + np.exp(-x @ weights))
        step = np.linalg.solve((x.T * (found * (1 - found))) @ x + ridge, x.T @ (right - found) - ridge @ weights)
        weights += step
        if np.abs(step).max() < 1e-9:
            break
    return weights


@dataclass(frozen=True, slots=True)
class ConfidenceBin:
    """Answers whose confidence lies in ``low``..``high``: how many, what they promised on average, and what share was right."""

    low: float
    high: float
    count: int
    mean_confidence: float
    right_share: float


def reliability(confidence: NDArray[np.float64], right: NDArray[np.bool_], edges: Sequence[float]) -> list[ConfidenceBin]:
    """The reliability table over the bins between `edges` (ascending, 0..1); empty bins are left out."""
    place = np.clip(np.digitize(confidence, edges) - 1, 0, len(edges) - 2)
    bins = []
    for index in range(len(edges) - 1):
        inside = place == index
        if inside.any():
            promised, kept = float(confidence[inside].mean()), float(right[inside].mean())
            bins.append(ConfidenceBin(edges[index], edges[index + 1], int(inside.sum()), promised, kept))
    return bins


def expected_calibration_error(bins: Sequence[ConfidenceBin]) -> float | None:
    """Mean distance of promise and truth over the bins, weighted by their counts; None without answers."""
    total = sum(b.count for b in bins)
    return sum(b.count * abs(b.mean_confidence - b.right_share) for b in bins) / total if total else None


def auroc(confidence: NDArray[np.float64], right: NDArray[np.bool_]) -> float | None:
    """Probability that a right answer is more confident than a wrong one; None when there are not both kinds."""
    good, bad = int(right.sum()), int((~right).sum())
    return (float(rankdata(confidence)[right].sum()) - good * (good + 1) / 2) / (good * bad) if good and bad else None


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


LEAST = 40
"""Pictures that a fit needs."""
_AXES, _PICTURES_PER_AXIS = 16, 8  # most principal directions, and pictures needed for each
_LIMIT_SHARE = 0.995  # of known pictures lie below the limit
_LEAST_SCALE = 1e-2  # added to the scale of a signature's value
_LEAST_HALF = 10  # pictures in each half of a split
_NEIGHBOURS = 16  # pictures in a row that are taken to show the same phantom where no seed says so


class OutOfDistributionError(UserError):
    """The pictures do not allow a fit; the message is one line and says what to do."""


@dataclass(frozen=True, slots=True)
class KnownPicture:
    """A picture of a folder, and the ``group`` of those there that show the same phantom: they say little about each other."""

    file: Path
    folder: Path
    group: Hashable


def find_known(folder: Path) -> list[KnownPicture]:
    """The pictures of a labelled set (``dataset.py``), or of a plain folder.

    Pictures of one group have the same ``seed`` in the set's truth; without a truth they are neighbours.

    Raises DatasetError for a folder without pictures or with a damaged truth.
    """
    place = folder / "images" if (folder / "images").is_dir() else folder
    files = sorted(file for file in place.glob("*") if file.suffix.lower() in IMAGE_ENDINGS)
    if not files:
        raise DatasetError(f"{folder}: no pictures ({', '.join(ending[1:] for ending in IMAGE_ENDINGS)}); give a folder with some")
    truth = read_truth(folder) if (folder / "truth.jsonl").is_file() else {}
    seeds = [truth.get(file.stem, {}).get("seed") for file in files]
    return [
        KnownPicture(file, folder, index // _NEIGHBOURS if seed is None else f"seed {seed}")
        for index, (file, seed) in enumerate(zip(files, seeds, strict=True))
    ]


def signatures_in(
    pictures: Sequence[KnownPicture], segment: Segmenter, config: PerceptionConfig, on_unreadable: Callable[[UserError], None]
) -> Iterator[tuple[KnownPicture, Signature] | None]:
    """Each picture with its signature; None where it cannot be read, is refused before the network sees it, or shows no vessel.

    Raises OutOfDistributionError: the segmenter tells no signatures.
    """
    for picture in pictures:
        try:
            image = to_working(read_image(picture.file), config.working_size_px)[0]
        except ImageError as error:
            on_unreadable(error)
            yield None
            continue
        if quality.check_image(image, config.quality) is not None:
            yield None
            continue
        vessel, robot, signature = segment.segment_signed([image])[0]
        if signature is None:
            raise OutOfDistributionError(
                "the network's deepest level is not to be had: it cannot tell kinds of pictures; train it again"
            )
        usable = segmentation.clean(vessel, robot, config).vessel.any() and bool(np.isfinite(signature).all())
        yield (picture, signature) if usable else None


def check_known(pictures: Sequence[KnownPicture]) -> None:
    """Raise OutOfDistributionError, before pictures are read, where so few could not be enough whatever they show."""
    _check_number(len(pictures), "pictures")


def _check_number(number: int, of: str) -> None:
    if number < LEAST:
        raise OutOfDistributionError(f"{number} {of}; {LEAST} are needed; give it more (synth --count)")


def fit_out_of_distribution(
    pictures: Sequence[KnownPicture], signatures: NDArray[np.float32], working_size_px: int, fitted_on: dict[str, Any]
) -> OutOfDistributionReference:
    """Fit where the signatures (N, F) of N known pictures lie.

    The limit is what 995 of 1000 pictures keep to (of few, the one at the largest distance) when each half of the groups is judged
    by a fit to the other half: pictures that were fitted to would make it too narrow.

    Raises OutOfDistributionError: there are less than ``LEAST``, or all are the same.
    """
    _check_number(len(signatures), "pictures show a vessel")
    first = _first_half(pictures)
    apart = [_Fit(signatures[~half]).distance(signatures[half]) for half in (first, ~first)]
    limit = float(np.quantile(np.concatenate(apart), _LIMIT_SHARE))
    if limit <= 0.0:
        raise OutOfDistributionError("all pictures are the same; give it pictures that differ as those of the rig do")
    return _Fit(signatures).reference(limit, working_size_px, fitted_on | {"pictures": len(signatures)})


def _first_half(pictures: Sequence[KnownPicture]) -> NDArray[np.bool_]:
    """Every other group of each folder; of a folder with one group its first pictures.

    Each folder's kind must be in both halves: judged without any of its kind, it would set the limit for all.
    """
    first = np.zeros(len(pictures), np.bool_)
    for folder in dict.fromkeys(picture.folder for picture in pictures):
        places = [place for place, picture in enumerate(pictures) if picture.folder == folder]
        order = list(dict.fromkeys(pictures[place].group for place in places))
        if len(order) < 2:
            first[places[: (len(places) + 1) // 2]] = True
            continue
        chosen = set(order[::2])
        first[[place for place in places if pictures[place].group in chosen]] = True
    if min(first.sum(), (~first).sum()) < _LEAST_HALF:  # one group holds nearly all of them
        first = np.arange(len(pictures)) % 2 == 0
    return first


class _Fit:
    """Mean, scale and principal directions of some signatures."""

    def __init__(self, signatures: NDArray[np.float32]) -> None:
        count = len(signatures)
        self._mean, self._scale = signatures.mean(axis=0), signatures.std(axis=0) + _LEAST_SCALE
        _, size, directions = np.linalg.svd(((signatures - self._mean) / self._scale).astype(np.float64), full_matrices=False)
        share = size**2 / count
        axes = max(1, min(_AXES, count // _PICTURES_PER_AXIS))
        smallest = max(1e-6 * float(share.sum()), 1e-12)
        self._directions, self._spread = directions[:axes], np.sqrt(np.maximum(share[:axes], smallest))
        self._across = np.array([max(float(share[axes:].sum()), smallest)])

    def distance(self, signatures: NDArray[np.float32]) -> NDArray[np.float64]:
        return self.reference(1.0, 1, {}).distance(signatures)

    def reference(self, limit: float, working_size_px: int, fitted_on: dict[str, Any]) -> OutOfDistributionReference:
        numbers = packed(self._mean, self._scale, self._directions, self._spread, self._across)
        return OutOfDistributionReference(
            size=len(self._mean),
            axes=len(self._directions),
            limit=limit,
            working_size_px=working_size_px,
            packed=numbers,
            fitted_on=fitted_on,
        )
