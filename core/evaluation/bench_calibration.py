"""Calibration of a model that was taught a bench: of its confidence and of the kind of pictures that it knows, on few frames.

The truth is what geometry gives for the frames' masks. Five held-out frames hold no wrong answer, from which a confidence could be
learnt, so they are shown in many looks, also in bad ones, and the weights of the model that the training began with are the prior
of the fit. The kind of pictures is that of the bench alone: another bench's are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.bench.registration import MAX_ROTATION_DEG, MAX_SHIFT_PX
from core.config.models import PerceptionConfig
from core.evaluation.accuracy import WRONG_DEG, FrameScore, TrueMasks, is_wrong, score_frame
from core.evaluation.confidence import (
    WRONG_THETA_DEG,
    KnownPicture,
    auroc,
    expected_calibration_error,
    fit_out_of_distribution,
    is_right,
    reliability,
)
from core.learning.augmentation import random_look, with_strips
from core.learning.dataset import Sample
from core.learning.model_writer import write_calibration
from core.perception.inference import open_segmenter
from core.perception.model_file import ModelInfo
from core.perception.out_of_distribution import OutOfDistributionReference
from core.perception.pipeline import Pipeline, open_calibrated, open_pipeline
from core.perception.quality import ConfidenceCalibration, ConfidenceFeatures
from core.perception.segmentation import Segmenter, to_working
from core.perception.tip_refinement import TipRefinement
from core.types import Frame, Image, Mask

PRIOR_WEIGHT, PRIOR_OFFSET = 20.0, 0.3
"""Precision of the prior of each weight, and of the offset: as many clear answers it takes to move them half-way."""
_EDGES = (0.0, 0.5, 0.8, 0.9, 0.95, 1.0)
"""Bins of the calibration error."""
_LOOKS = 5
"""Views of a frame from which the kind of pictures is learnt: as it is, and in usual changes of light, focus, noise and place."""
_WIDER = 0.3
"""The limit lies at this share of the way, in logarithms, from the known pictures to the nearest of another kind.

Of six of seven taught benches the own pictures, also moved and in other light, come to 0.87 of it (0.94 with 0.2), of the look
``picture``, with clips, more than half lie within it; other benches' pictures begin at 1.26 of it (1.34).
"""
_MOST_WIDER = 1.5
"""Nor is it wider than the known pictures' by more than this factor."""

_PLAIN_SHARE = 0.12
"""Time of a picture in one orientation against that in all of them, refined four times."""
_TIMED = 5
"""Pictures of which the median time counts."""

Progress = Callable[[int, int], None]
"""Is given what is done, and how much there is."""


@dataclass(frozen=True, slots=True)
class TeachingResult:
    """What a taught model shows on its held-out frames, as they are.

    Attributes
    ----------
    frames, answered : held-out frames whose masks have a pose, and those of them that are answered.
    right : of the answered, those right to 5 degrees and 15 px.
    vessel_dice, robot_dice : agreement with the masks, means; doubtful pixels do not count.
    head_px, theta_deg : medians of the differences, of answered frames; None without any.
    confidence : mean confidence of the answered.
    confidence_auroc, calibration_error : on the frames in many looks; AUROC None without right and wrong answers.
    refused : of pictures of other kinds, the share that is refused.
    doubtful_share : of the robot's area, mean.
    """

    frames: int
    answered: int
    right: int
    vessel_dice: float
    robot_dice: float
    head_px: float | None
    theta_deg: float | None
    confidence: float | None
    confidence_auroc: float | None
    calibration_error: float | None
    refused: float | None
    doubtful_share: float


def usual_look(image: Image, rng: Generator) -> Image:
    """The picture as the same camera gives it at another time: exposure, white balance, focus, noise, a shadow, glare."""
    gain = rng.uniform(0.8, 1.25) * rng.uniform(0.96, 1.04, 3)
    pixels = np.asarray(image * gain.astype(np.float32), np.float32)
    height, width = image.shape[:2]
    if rng.random() < 0.4:
        light = rng.uniform(0.75, 1.1, (3, 4)).astype(np.float32)
        pixels *= cv2.resize(light, (width, height), interpolation=cv2.INTER_CUBIC)[:, :, None]
    if rng.random() < 0.2:
        spot = np.zeros((height, width), np.float32)
        middle = int(rng.integers(width)), int(rng.integers(height))
        cv2.circle(spot, middle, int(rng.integers(6, 20)), 200.0, -1, cv2.LINE_AA)
        pixels += cv2.GaussianBlur(spot, (0, 0), 5.0)[:, :, None]
    if rng.random() < 0.3:
        pixels = np.asarray(cv2.GaussianBlur(pixels, (0, 0), float(rng.uniform(0.4, 1.1))), np.float32)
    pixels += rng.normal(0, rng.uniform(0.5, 3.0), pixels.shape).astype(np.float32)
    return np.asarray(np.clip(pixels, 0, 255), np.uint8)


def moved(image: Image, rng: Generator) -> Image:
    """The picture as the same camera gives it when it has moved by what the bench is realigned to."""
    height, width = image.shape[:2]
    matrix = cv2.getRotationMatrix2D((width / 2, height / 2), rng.uniform(-MAX_ROTATION_DEG, MAX_ROTATION_DEG), 1.0)
    matrix[:, 2] += rng.uniform(-MAX_SHIFT_PX, MAX_SHIFT_PX, 2) / np.sqrt(2.0)
    return np.asarray(cv2.warpAffine(image, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE), np.uint8)


def bad_look(image: Image, vessel: Mask, robot: Mask, rng: Generator) -> Image:
    """The picture as it should not be: strongly changed, out of focus, or with clips over the robot."""
    shown = random_look(image, rng)
    if rng.random() < 0.5:
        shown = with_strips(shown, vessel, robot, rng)
    if rng.random() < 0.5:
        shown = np.asarray(cv2.GaussianBlur(shown, (0, 0), float(rng.uniform(1.0, 2.5))), np.uint8)
    return shown


def poses_of_masks(samples: Sequence[Sample], config: PerceptionConfig) -> dict[str, dict[str, Any]]:
    """The pose that geometry gives for the masks of each frame, as a row of truth by its stem; state None: no pose."""
    masks = TrueMasks()
    pipeline = Pipeline(masks, config)
    rows: dict[str, dict[str, Any]] = {}
    for sample in samples:
        image, vessel, robot = sample.load(config.working_size_px)
        masks.show(vessel, robot)
        scene = pipeline.perceive_single(Frame(0, 0.0, image))
        row: dict[str, Any] = {"stem": sample.stem, "state": None, "theta_deg": None}
        if scene.pose is not None and scene.path is not None:
            row |= {
                "state": scene.pose.state.value,
                "theta_deg": scene.pose.theta_deg,
                "theta_signed_deg": scene.pose.theta_signed_deg,
                "head_xy": scene.path.head,
            }
        rows[sample.stem] = row
    return rows


def fit_to_prior(
    evidence: NDArray[np.float64], right: NDArray[np.float64], weight: NDArray[np.float64], prior: ConfidenceCalibration
) -> ConfidenceCalibration:
    """The calibration nearest to a `prior` that agrees with the answers: logistic regression with a Gaussian prior.

    Of N answers: features (N, F) of the prior's, how right each was (N,), 0 to 1, and how much it counts (N,). Without any
    answer it stays the prior.
    """
    if not len(right):
        return prior
    mean, scale = np.array(prior.mean), np.array(prior.scale)
    evidence = evidence.reshape(-1, len(mean))
    x = np.column_stack([np.clip((evidence - mean) / scale, -4.0, 4.0), np.ones(len(evidence))])
    begin = np.array([*prior.weights, prior.offset])
    precision = np.array([PRIOR_WEIGHT] * len(prior.weights) + [PRIOR_OFFSET])
    found = begin.copy()
    for _ in range(50):  # Newton's method; the sum is convex
        promised = 1.0 / (1.0 + np.exp(-np.clip(x @ found, -30.0, 30.0)))
        slope = x.T @ (weight * (promised - right)) + precision * (found - begin)
        curvature = (x.T * (weight * promised * (1.0 - promised))) @ x + np.diag(precision)
        step = np.linalg.solve(curvature, slope)
        found -= step / max(1.0, float(np.abs(step).max()))
        if float(np.abs(step).max()) < 1e-8:
            break
    fitted = {"answers": len(right), "right": int((right == 1.0).sum()), "prior": prior.fitted_on}
    return prior.model_copy(update={"weights": tuple(found[:-1].tolist()), "offset": float(found[-1]), "fitted_on": fitted})


@dataclass(frozen=True, slots=True)
class _Answers:
    """Scores of the held-out frames: as they are, in usual looks, and in bad ones."""

    plain: tuple[FrameScore, ...]
    usual: tuple[FrameScore, ...]
    bad: tuple[FrameScore, ...]


class BenchCalibration:
    """Calibrates the model in a folder on the frames of its bench.

    Parameters
    ----------
    model : folder of a model without calibration.
    prior : manifest of the model that its training began with.
    train, held_out : frames of the bench that were, and were not, trained on.
    others : pictures of other kinds: a wide limit must not let them in.
    config : of perception; its model is not read.
    looks : (usual, bad) looks in which each held-out frame is shown.
    """

    def __init__(
        self,
        model: Path,
        prior: ModelInfo,
        train: Sequence[Sample],
        held_out: Sequence[Sample],
        others: Sequence[Sample],
        config: PerceptionConfig,
        looks: tuple[int, int] = (2, 3),
    ) -> None:
        self._model, self._prior, self._train, self._held_out, self._others = model, prior, train, held_out, others
        self._config, self._looks = config, looks
        self._done = 0
        self._on_progress: Progress = lambda _done, _of: None

    @property
    def count(self) -> int:
        """Pictures that are perceived."""
        looked = len(self._train) + len(self._held_out)
        return 2 * len(self._held_out) * (1 + sum(self._looks)) + looked * _LOOKS + len(self._others)

    def count_s(self, model: str, more: float = 0.0) -> float:
        """How long it takes here, and as long as `more` pictures besides, measured with a `model` of this shape.

        The median of some pictures: other programs may hold up one of them for seconds.
        """
        image = self._held_out[0].load(self._config.working_size_px)[0]
        segmentation = self._config.segmentation.model_copy(update={"model": model, "mirrored": "always"})
        pipeline = open_pipeline(self._config.model_copy(update={"segmentation": segmentation}), recalibrating=True)
        pipeline.perceive_single(Frame(0, 0.0, image))  # compiles
        times_s = [perf_counter()]
        for _ in range(_TIMED):
            pipeline.perceive_single(Frame(0, 0.0, image))
            times_s.append(perf_counter())
        averaged_s = float(np.median(np.diff(times_s)))
        averaged = len(self._held_out) * (1 + sum(self._looks))
        return averaged_s * (averaged + _PLAIN_SHARE * (self.count - averaged) + more)

    def run(self, on_progress: Progress, should_stop: Callable[[], bool] = lambda: False) -> TeachingResult | None:
        """Calibrate, and write it to the model; None when stopped, and the model is unchanged then.

        Raises OutOfDistributionError, DatasetError, ModelError: the frames do not allow it, cannot be read, or the model cannot be
        written.
        """
        self._done, self._on_progress = 0, on_progress
        truth = poses_of_masks(self._held_out, self._tolerant("never"))
        answers: dict[str, _Answers] = {}
        for mirrored in ("never", "always"):
            found = self._perceived(open_pipeline(self._tolerant(mirrored), recalibrating=True), truth, should_stop)
            if found is None:
                return None
            answers[mirrored] = found
        fitted = {}
        for mirrored, prior in (("never", self._prior.calibration), ("always", self._prior.calibration_mirrored)):
            fitted[mirrored] = fit_to_prior(*_examples(answers[mirrored], len(prior.mean)), prior) if prior is not None else None
        config = self._tolerant("always")
        segment = open_segmenter(config.segmentation)
        known, others = self._signatures(segment, should_stop)
        if should_stop():
            return None
        reference = _kind_of(known, others, config.working_size_px)
        again = open_calibrated(config, recalibrating=True)[1].segment
        looks = again.passes if isinstance(again, TipRefinement) else 1
        plain, averaged = fitted["never"], fitted["always"]
        if plain is not None:
            write_calibration(self._model, plain, averaged, second_looks=looks, familiarity=reference)
        refused = float((reference.distance(others) > reference.limit).mean()) if len(others) else None
        return self._result(answers["always"], averaged or plain, refused)

    def _tolerant(self, mirrored: str) -> PerceptionConfig:
        """Answers that would be refused for low confidence are the ones to learn from."""
        segmentation = self._config.segmentation.model_copy(update={"model": str(self._model), "mirrored": mirrored})
        quality = self._config.quality.model_copy(update={"min_confidence": 0.0})
        return self._config.model_copy(update={"segmentation": segmentation, "quality": quality})

    def _advance(self) -> None:
        self._done += 1
        self._on_progress(self._done, self.count)

    def _perceived(self, pipeline: Pipeline, truth: dict[str, dict[str, Any]], should_stop: Callable[[], bool]) -> _Answers | None:
        found: tuple[list[FrameScore], list[FrameScore], list[FrameScore]] = ([], [], [])
        for index, sample in enumerate(self._held_out):
            image, vessel, robot = sample.load(self._config.working_size_px)
            sure = ~sample.load_doubtful(image.shape)
            rng = np.random.default_rng((7, index))
            views: list[tuple[int, Image]] = [(0, image)]
            views += [(1, usual_look(image, rng)) for _ in range(self._looks[0])]
            views += [(2, bad_look(image, vessel, robot, rng)) for _ in range(self._looks[1])]
            for kind, view in views:
                if should_stop():
                    return None
                scene = pipeline.perceive_single(Frame(0, 0.0, view))
                if scene.masks is not None:
                    scene = replace(scene, masks=replace(scene.masks, robot=scene.masks.robot & sure))
                found[kind].append(score_frame(sample.stem, scene, vessel, robot & sure, truth[sample.stem]))
                self._advance()
        return _Answers(*(tuple(scores) for scores in found))

    def _signatures(
        self, segment: Segmenter, should_stop: Callable[[], bool]
    ) -> tuple[list[tuple[KnownPicture, NDArray[np.float32]]], NDArray[np.float32]]:
        """Signatures of the bench's frames in usual looks, and (N, F) of pictures of other kinds."""
        known: list[tuple[KnownPicture, NDArray[np.float32]]] = []
        size = self._config.working_size_px
        for index, sample in enumerate((*self._train, *self._held_out)):
            image = sample.load(size)[0]
            rng = np.random.default_rng((11, index))
            for look in range(_LOOKS):
                if should_stop():
                    break
                signature = segment.segment_signed([usual_look(moved(image, rng), rng) if look else image])[0][2]
                if signature is not None:
                    known.append((KnownPicture(sample.image, sample.image.parent, sample.stem), signature))
                self._advance()
        others = []
        for sample in self._others:
            if should_stop():
                break
            signature = segment.segment_signed([to_working(sample.load(size)[0], size)[0]])[0][2]
            if signature is not None:
                others.append(signature)
            self._advance()
        return known, np.array(others, np.float32)

    def _result(self, answers: _Answers, calibration: ConfidenceCalibration | None, refused: float | None) -> TeachingResult:
        expected = [score for score in answers.plain if score.expected]
        answered = [score for score in expected if score.answered]
        everything = [score for score in (*answers.plain, *answers.usual, *answers.bad) if score.answered and score.expected]
        right = np.array([is_right(score) for score in everything], np.bool_)
        promised = np.array([_confidence(score, calibration) for score in everything])
        plain = [_confidence(score, calibration) for score in answered]
        heads = [score.head_error_px for score in answered if score.head_error_px is not None]
        thetas = [abs(score.theta_error_deg) for score in answered if score.theta_error_deg is not None]
        doubts = []
        for sample in self._held_out:
            image, _, robot = sample.load(self._config.working_size_px)
            doubts.append(float((sample.load_doubtful(image.shape) & robot).sum() / max(1, robot.sum())))
        robots = [score.robot_dice for score in answers.plain if score.robot_dice is not None]
        return TeachingResult(
            frames=len(expected),
            answered=len(answered),
            right=sum(map(is_right, answered)),
            vessel_dice=float(np.mean([score.vessel_dice for score in answers.plain])),
            robot_dice=float(np.mean(robots)) if robots else 0.0,
            head_px=float(np.median(heads)) if heads else None,
            theta_deg=float(np.median(thetas)) if thetas else None,
            confidence=float(np.mean(plain)) if plain else None,
            confidence_auroc=auroc(promised, right) if len(right) else None,
            calibration_error=expected_calibration_error(reliability(promised, right, _EDGES)) if len(right) else None,
            refused=refused,
            doubtful_share=float(np.mean(doubts)),
        )


def _confidence(score: FrameScore, calibration: ConfidenceCalibration | None) -> float:
    if calibration is None or score.evidence is None:
        return score.confidence
    return calibration.confidence(ConfidenceFeatures(*score.evidence))


def _rightness(score: FrameScore) -> float:
    """1 of a right answer, 0 of a wrong one; in between by theta's error, since masks by difference are some degrees off, too."""
    if score.theta_error_deg is None or is_wrong(score):
        return 0.0
    return min(1.0, (WRONG_DEG - abs(score.theta_error_deg)) / (WRONG_DEG - WRONG_THETA_DEG))


def _examples(answers: _Answers, features: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Evidence (N, features), how right, and weight of all answers: a bad look counts less, it is rare at a bench."""
    rows = [
        (score.evidence, _rightness(score), weight)
        for scores, weight in ((answers.plain, 1.0), (answers.usual, 1.0), (answers.bad, 0.5))
        for score in scores
        if score.answered and score.expected and score.evidence is not None
    ]
    evidence, right, weight = zip(*rows, strict=True) if rows else ((), (), ())
    return np.array(evidence, np.float64).reshape(-1, features), np.array(right, np.float64), np.array(weight, np.float64)


def _kind_of(
    known: Sequence[tuple[KnownPicture, NDArray[np.float32]]], others: NDArray[np.float32], working_size_px: int
) -> OutOfDistributionReference:
    """Where the bench's pictures lie, with a limit between them and pictures of other kinds."""
    signatures = np.array([signature for _, signature in known], np.float32)
    reference = fit_out_of_distribution([picture for picture, _ in known], signatures, working_size_px, {"kind": "one bench"})
    if not len(others):
        return reference
    nearest = float(np.quantile(reference.distance(others), 0.02))
    wider = min(max(nearest / reference.limit, 1.0) ** _WIDER, _MOST_WIDER)
    return reference.model_copy(update={"limit": reference.limit * wider})
