"""The quality gate: when perception refuses to answer, and how confident it is when it answers.

Each check gives a ``Refusal`` that names the measured value and its limit, or None. The limits are settings. A calibrated model's
confidence is a probability: logistic regression (J. Platt, "Probabilistic outputs for support vector machines", 1999) over
``ConfidenceFeatures``, fitted once per model on labelled frames that it was not trained on and kept in ``model.json``. Without
calibration the confidence is a product of shares.

Threshold sensitivity is the strongest feature (docs/method.md): how much theta and head change when the masks' edges are drawn at
another probability than one half.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from core import geometry
from core.config.models import PerceptionConfig, QualityConfig, VectorConfig
from core.messages import message
from core.perception.vessel_graph import MAX_CHAINS
from core.types import Centerline, Image, Mask, Masks, Point, Points, Reason, Refusal, RobotPath, Vector, VesselGraph

_BEYOND_PX = (4.0, 24.0)
"""Distances beyond the head at which a robot that continues there would be seen."""
_AROUND_PX = 60
"""Half side of the window around the head in which the network's uncertainty is summed."""


@dataclass(frozen=True, slots=True)
class ConfidenceFeatures:
    """Features of one answer: shares or ratios without unit, but for ``log_length`` (natural logarithm of px) and the swings.

    The swings (``threshold_sensitivity``) None where they were not computed: they take several times as long as all the rest.
    """

    robot_seen: float
    """Mean robot probability along the last 40 px."""
    robot_seen_all: float
    """The same along the whole path."""
    vessel_seen: float
    """Mean vessel probability along the centerline's piece."""
    inside: float
    """Share of the last 40 px that lies in the vessel."""
    bridged: float
    """Share of the path that was bridged."""
    lead: float
    """How far the runner-up's score is behind, at most 1."""
    ambiguity: float
    off_path: float
    """Share of the robot's mask that the path does not explain."""
    beyond: float
    """Highest robot probability straight beyond the head."""
    bend: float
    """Root mean square distance of the last 40 px from their line, in radii."""
    offset: float
    """Distance of the head from the centerline, in lumen radii."""
    off_border: float
    """1 when the tail is neither at the image border nor at the port."""
    log_length: float
    robot_doubt: float
    """Mean p(1 - p) of the robot around the head, against the robot's share there."""
    vessel_doubt: float
    """Mean p(1 - p) of the vessel around the head."""
    theta_swing: float | None = None
    """How much theta changes when the masks are drawn a little wider or narrower: mean of log(1 + degrees)."""
    head_swing: float | None = None
    """The same of the head: mean of log(1 + px)."""

    @classmethod
    def names(cls) -> tuple[str, ...]:
        return tuple(field.name for field in fields(cls))

    def values(self) -> tuple[float, ...]:
        """The features that are known, in the order of their ``names``."""
        return tuple(value for value in (getattr(self, name) for name in self.__slots__) if value is not None)


SENSITIVITY_FEATURES = ("theta_swing", "head_swing")
BASIC_FEATURES = tuple(name for name in ConfidenceFeatures.names() if name not in SENSITIVITY_FEATURES)


class ConfidenceCalibration(BaseModel):
    """Logistic regression over ``ConfidenceFeatures``: confidence = 1 / (1 + exp(-(offset + weights . (x - mean) / scale)))."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    features: tuple[str, ...]
    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    offset: float
    fitted_on: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.features not in (ConfidenceFeatures.names(), BASIC_FEATURES):
            raise ValueError("the calibration is of another version; run calibrate again")
        if {len(self.mean), len(self.scale), len(self.weights)} != {len(self.features)} or min(self.scale) <= 0.0:
            raise ValueError("the calibration is damaged; run calibrate again")
        return self

    @property
    def needs_sensitivity(self) -> bool:
        """Whether it was fitted on features with the threshold sensitivity, and needs it."""
        return SENSITIVITY_FEATURES[0] in self.features

    def confidence(self, features: ConfidenceFeatures) -> float:
        """Probability 0..1 that the answer is right."""
        values = np.array([getattr(features, name) for name in self.features], np.float64)
        standard = (values - np.array(self.mean)) / np.array(self.scale)
        # Values far beyond those of the fit must not give certainty.
        logit = self.offset + float(np.clip(standard, -4.0, 4.0) @ np.array(self.weights))
        return float(1.0 / (1.0 + np.exp(-np.clip(logit, -30.0, 30.0))))


def confidence_features(
    path: RobotPath, robot: Vector, centerline: Centerline, masks: Masks, config: PerceptionConfig
) -> ConfidenceFeatures:
    """The features of an answer, without the threshold sensitivity; coordinates in working pixels."""
    along = geometry.arc_length(path.points)
    total = float(along[-1])
    tip = geometry.resample(geometry.cut(path.points, total - config.vectors.robot_length_px, total, along), 1.0)
    whole = geometry.resample(path.points, 2.0)
    direction = np.array(robot.direction)
    ahead = np.array(path.head) + np.arange(*_BEYOND_PX)[:, None] * direction
    across = (tip - np.array(robot.center)) @ np.array([-direction[1], direction[0]])
    across -= _mean(across)
    radius = max(path.radius_px, 1.0)
    robot_near, vessel_near = (_around(p, path.head) for p in (masks.robot_probability, masks.vessel_probability))
    area = float(cv2.countNonZero(masks.robot.view(np.uint8)))
    off_centre = math.dist(path.head, centerline.nearest)
    return ConfidenceFeatures(
        robot_seen=_mean(at(masks.robot_probability, tip)),
        robot_seen_all=_mean(at(masks.robot_probability, whole)),
        vessel_seen=_mean(at(masks.vessel_probability, centerline.piece)),
        inside=_mean(at(masks.vessel, tip)),
        bridged=min(1.0, path.bridged_px / max(total, 1.0)),
        lead=1.0 if path.runner_up is None else min(1.0, max(0.0, path.score - path.runner_up)),
        ambiguity=centerline.ambiguity,
        off_path=max(0.0, 1.0 - 2.0 * radius * total / max(area, 1.0)),
        beyond=float(at(masks.robot_probability, ahead).max()),
        bend=math.sqrt(_mean(across * across)) / radius,
        offset=off_centre / max(centerline.radius_px, 1.0),
        off_border=0.0 if path.entry_on_border else 1.0,
        log_length=math.log(max(total, 1.0)),
        robot_doubt=float((robot_near * (1 - robot_near)).sum() / max(float(robot_near.sum()), 1.0)),
        vessel_doubt=_mean(vessel_near * (1 - vessel_near)),
    )


def wall_blur_px(masks: Masks, head: Point) -> float:
    """Mean blur of the vessel's walls beside the head, px: 4 p(1 - p) summed over them.

    For a wall whose probability is a logistic function of the distance it is the width from 0.1 to 0.9. A lumen is certain but for
    its rim; a vessel that is wrongly segmented around a robot is uncertain all over.
    """
    near, inside = _around(masks.vessel_probability, head), np.ascontiguousarray(_around(masks.vessel, head)).view(np.uint8)
    rim = cv2.countNonZero(inside) - cv2.countNonZero(cv2.erode(inside, np.ones((3, 3), np.uint8), borderValue=1))
    # One wall across the window at least: where the lumen fills all of it, the rim is empty.
    return 4.0 * float((near * (1 - near)).sum()) / max(rim, 2 * _AROUND_PX)


def _mean(values: NDArray[Any]) -> float:
    return float(values.sum()) / values.size


def _around(values: NDArray[Any], place: Point) -> NDArray[Any]:
    x, y = (round(coordinate) for coordinate in place)
    return values[max(0, y - _AROUND_PX) : y + _AROUND_PX + 1, max(0, x - _AROUND_PX) : x + _AROUND_PX + 1]


def at(values: NDArray[Any], points: Points) -> NDArray[Any]:
    """A map (h, w) at the pixels nearest to `points`; places beyond the image count as its border."""
    columns, rows = np.rint(points).T.astype(np.intp)
    # take clips in one go what two fancy indices would need clipped first.
    inner = np.minimum(np.maximum(rows, 0), values.shape[0] - 1) * values.shape[1]
    return np.asarray(np.take(values, inner + np.minimum(np.maximum(columns, 0), values.shape[1] - 1)))


SAMPLE_STEP = 4
"""Brightness is judged on every fourth pixel."""
MAX_OFF_RADII, MAX_OFF_PX = 2.5, 4.0
"""Greatest distance of a head from the centerline of its own vessel, also in a junction's opening or where it bulges the wall: in
919 right answers with true masks the distance was at most 1.4 radii. Further off, the head lies in a vessel that was not found."""
_LEAST_CONTRAST = 4.0
_KNOWN_AGAIN_SHARE = 0.9
"""Of the limit: hysteresis. The kind of pictures belongs to the rig, and a rig at the limit must not stop and go with every
frame."""
MAX_ROBOT_SHARE = 0.3
"""Of the image. A robot 60 px wide across all of it is half of that; thinning a larger mask takes long, and finds no robot."""


def check_image(image: Image, config: QualityConfig) -> Refusal | None:
    """BLACK, WHITE or BLURRED, from the RGB image (h, w, 3) alone."""
    if image.shape[0] == 0 or image.shape[1] == 0:
        return Refusal(Reason.UNREADABLE, "it has no pixels")
    if not config.enabled:
        return None
    red, green, blue = (image[::SAMPLE_STEP, ::SAMPLE_STEP, channel] for channel in range(3))
    brightest = _level(np.maximum(np.maximum(red, green), blue), 0.99)
    if brightest < config.black_level:
        return Refusal(
            Reason.BLACK,
            message("99 % of it is darker than {a:.0f} (black below {b:.0f} of 255)", a=brightest, b=config.black_level),
        )
    dimmest = _level(np.minimum(np.minimum(red, green), blue), 0.01)
    if dimmest > config.white_level:
        detail = message("99 % of it is brighter than {a:.0f} (overexposed above {b:.0f} of 255)", a=dimmest, b=config.white_level)
        return Refusal(Reason.WHITE, detail)
    if config.min_sharpness > 0.0:
        found = sharpness(image)
        if found < config.min_sharpness:
            return Refusal(Reason.BLURRED, message("sharpness {a:.3f} (at least {b:.3f})", a=found, b=config.min_sharpness))
    return None


def _level(values: NDArray[np.uint8], share: float) -> float:
    """The value that this share of all values does not exceed; counted, because sorting costs 2 ms in every frame."""
    counts = np.bincount(values.ravel(), minlength=256)
    return float(np.searchsorted(counts.cumsum(), int(share * (values.size - 1)), side="right"))


def sharpness(image: Image) -> float:
    """Steepest brightness step against the image's whole contrast, per px: some 0.15 for a sharp edge, 1/width for a blurred one.

    It does not depend on exposure, and it is measured at half size, lightly smoothed, so that noise does not count as sharpness. An
    image of one colour has no edge and counts as sharp.
    """
    half = cv2.resize(image, (max(1, image.shape[1] // 2), max(1, image.shape[0] // 2)), interpolation=cv2.INTER_AREA)
    grey = cv2.GaussianBlur(cv2.cvtColor(half, cv2.COLOR_RGB2GRAY), (3, 3), 0.75)
    across, down = cv2.spatialGradient(grey, ksize=3)
    squares = (np.multiply(across, across, dtype=np.int32) + np.multiply(down, down, dtype=np.int32)).ravel()
    steepest = math.sqrt(_nth_largest(squares, len(squares) - int(0.995 * (len(squares) - 1)))) / 16.0
    samples = np.asarray(grey[::2, ::2], np.uint8)
    contrast = _level(samples, 0.99) - _level(samples, 0.01)
    return steepest / contrast if contrast >= _LEAST_CONTRAST else 1.0


def _nth_largest(values: NDArray[np.int32], rank: int) -> float:
    """The value that `rank` of all values reach. A sample of every 16th one leaves a hundredth of them to be sorted."""
    sample = values[::16]
    place = max(0, len(sample) - 1 - rank // 8)  # twice as far down as it has to be on average
    likely = values[values >= np.partition(sample, place)[place]]
    kept = likely if len(likely) >= rank else values
    place = len(kept) - rank
    return float(np.partition(kept, place)[place])


def check_finite(*probabilities: NDArray[np.float32]) -> Refusal | None:
    """LOW_CONFIDENCE, when the network's output is not finite."""
    # The product with itself is the quickest operation that one such value spoils.
    if all(math.isfinite(float(np.vdot(probability, probability))) for probability in probabilities):
        return None
    return Refusal(Reason.LOW_CONFIDENCE, "the network's output is not finite")


def check_masks(masks: Masks) -> Refusal | None:
    """NO_VESSEL or NO_ROBOT, when nothing is left of a mask after cleaning, or what is left cannot be a robot."""
    for mask, probability, name, reason in (
        (masks.vessel, masks.vessel_probability, "vessel", Reason.NO_VESSEL),
        (masks.robot, masks.robot_probability, "robot", Reason.NO_ROBOT),
    ):
        if not mask.any():
            highest = float(probability.max(initial=0.0))
            scattered = ", but only in specks" if highest >= 0.5 else ""
            return Refusal(reason, f"highest {name} probability {highest:.2f}{scattered}")
    share = float(np.count_nonzero(masks.robot)) / masks.robot.size
    if share > MAX_ROBOT_SHARE:
        return Refusal(
            Reason.NO_ROBOT,
            message("what looks like it covers {a:.0f} % of the image (at most {b:.0f} %)", a=100 * share, b=100 * MAX_ROBOT_SHARE),
        )
    return None


def check_kind(novelty: float | None, config: QualityConfig, *, refused_before: bool = False) -> Refusal | None:
    """UNLIKE_TRAINING, where the picture is of a kind that the model does not know; None also where that is not known.

    `refused_before`: the last full frame of a stream was refused, which lowers the limit.
    """
    limit = config.max_novelty * (_KNOWN_AGAIN_SHARE if refused_before else 1.0)
    if not config.enabled or novelty is None or novelty <= limit:
        return None
    return Refusal(
        Reason.UNLIKE_TRAINING, message("distance {a:.2f} from the pictures that it knows (at most {b:.2f})", a=novelty, b=limit)
    )


UNKNOWN_KIND = "it does not know such pictures"
"""Begins the hint that ``hinted`` adds to a refusal."""


def hinted(refusal: Refusal, unlike: Refusal | None) -> Refusal:
    """The refusal, with the hint that a robot may not have been found because the picture is of an unknown kind."""
    if unlike is None or refusal.reason is not Reason.NO_ROBOT:
        return refusal
    return replace(refusal, detail=f"{refusal.detail}; {UNKNOWN_KIND}: {unlike.detail}")


def check_graph(graph: VesselGraph, config: VectorConfig) -> Refusal | None:
    """NO_VESSEL, when the mask gave no graph that the configured rule could use: it is a dot, or branches all over."""
    if graph.edges or config.vessel_rule == "window":
        return None
    return Refusal(Reason.NO_VESSEL, message("its mask has no centerline, or more than {a} branches", a=MAX_CHAINS))


def check_path(path: RobotPath, masks: Masks, config: PerceptionConfig) -> Refusal | None:
    """TOO_SHORT, GAP_TOO_LONG or OUTSIDE_VESSEL."""
    limits = config.quality
    if not limits.enabled:
        return None
    length_px = float(geometry.arc_length(path.points)[-1])
    if length_px < limits.min_robot_length_px:
        return Refusal(
            Reason.TOO_SHORT, message("{a:.0f} px long (at least {b:.0f} px)", a=length_px, b=limits.min_robot_length_px)
        )
    bridged = path.bridged_px / length_px
    if bridged > limits.max_bridged_share:
        detail = message("{a:.0f} % of the robot is bridged (at most {b:.0f} %)", a=100 * bridged, b=100 * limits.max_bridged_share)
        return Refusal(Reason.GAP_TOO_LONG, detail)
    inside = inside_share(path, masks.vessel, config.vectors.robot_length_px)
    if inside < limits.min_inside_vessel:
        detail = message(
            "{a:.0f} % of its last {b:.0f} px lie in the vessel (at least {c:.0f} %)",
            a=100 * inside,
            b=config.vectors.robot_length_px,
            c=100 * limits.min_inside_vessel,
        )
        return Refusal(Reason.OUTSIDE_VESSEL, detail)
    return None


def check_centerline(centerline: Centerline | None, head: Point, config: QualityConfig) -> Refusal | None:
    """NO_VESSEL when there is no centerline beside the head, OUTSIDE_VESSEL when it is another vessel's, AMBIGUOUS_BRANCH when two
    branches fit the head equally well."""
    if centerline is None:
        return Refusal(Reason.NO_VESSEL, "no centerline beside the robot's head")
    gap_px, limit_px = math.dist(head, centerline.nearest), MAX_OFF_RADII * centerline.radius_px + MAX_OFF_PX
    if config.enabled and gap_px > limit_px:
        detail = message("its head is {a:.0f} px from the nearest centerline (at most {b:.0f} px)", a=gap_px, b=limit_px)
        return Refusal(Reason.OUTSIDE_VESSEL, detail)
    if config.enabled and centerline.ambiguity > config.max_ambiguity:
        detail = message(
            "a second branch fits {a:.0f} % as well (at most {b:.0f} %)", a=100 * centerline.ambiguity, b=100 * config.max_ambiguity
        )
        return Refusal(Reason.AMBIGUOUS_BRANCH, detail)
    return None


def check_walls(masks: Masks, head: Point, config: QualityConfig) -> Refusal | None:
    """NO_VESSEL, when the vessel's walls beside the head are uncertain: theta and the distances come from them."""
    if not config.enabled:
        return None
    blur_px = wall_blur_px(masks, head)
    if blur_px <= config.max_wall_blur_px:
        return None
    detail = f"what looks like one has walls beside the head that are blurred over {blur_px:.1f} px"
    return Refusal(Reason.NO_VESSEL, f"{detail} (at most {config.max_wall_blur_px:.1f} px)")


def check_confidence(confidence: float, config: QualityConfig) -> Refusal | None:
    """LOW_CONFIDENCE."""
    if config.enabled and not confidence >= config.min_confidence:  # also NaN
        return Refusal(
            Reason.LOW_CONFIDENCE, message("{a:.0f} % (at least {b:.0f} %)", a=100 * confidence, b=100 * config.min_confidence)
        )
    return None


def inside_share(path: RobotPath, vessel: Mask, length_px: float) -> float:
    """Share of the robot's last `length_px` that lies in the vessel's mask."""
    total = float(geometry.arc_length(path.points)[-1])
    return float(at(vessel, geometry.resample(geometry.cut(path.points, total - length_px, total), 1.0)).mean())


def uncalibrated_confidence(path: RobotPath, centerline: Centerline, masks: Masks, config: PerceptionConfig) -> float:
    """The confidence of an answer of a model without calibration, 0..1: the product of

    - how clearly the network saw the robot's last 40 px, and the vessel beside them,
    - how much of them lies in the vessel,
    - how much of the path was seen and not bridged,
    - how far the next best path is behind,
    - how far the next best branch is behind.
    """
    total = float(geometry.arc_length(path.points)[-1])
    tip = geometry.resample(geometry.cut(path.points, total - config.vectors.robot_length_px, total), 1.0)
    in_mask = tip[at(masks.robot, tip)]  # bridged parts are counted below
    robot_seen = _clearness(float(at(masks.robot_probability, in_mask).mean())) if len(in_mask) else 0.0
    seen = robot_seen * _clearness(float(at(masks.vessel_probability, centerline.piece).mean()))
    inside = min(1.0, inside_share(path, masks.vessel, config.vectors.robot_length_px) / 0.9)
    unbridged = 1.0 - min(1.0, path.bridged_px / max(total, 1.0))
    lead = 1.0 if path.runner_up is None else float(np.clip(0.6 + (path.score - path.runner_up) / 0.5, 0.4, 1.0))
    return float(seen * inside * unbridged * lead * (1.0 - 0.5 * centerline.ambiguity))


def _clearness(probability: float) -> float:
    """0.5 says nothing, 0.9 is as clear as it gets."""
    return float(np.clip((probability - 0.5) / 0.4, 0.0, 1.0))


_LOGIT_STEP = 0.7
"""Shift of the probabilities' logit: as if the edges were drawn at 0.33 or at 0.67."""
_SHIFTS = ((1, 1), (-1, -1), (1, -1), (-1, 1))
"""Vessel and robot wider and narrower, together and against each other."""
_MAX_DEG, _MAX_PX = 10.0, 20.0
"""Counted for a lost answer; one that is altogether different counts no more."""

Answer = tuple[Point, float]
"""Head (x, y) in working px and signed theta in degrees."""


def shifted_probabilities(masks: Masks) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Probabilities (h, w) of vessel and robot whose edges lie a little outside or inside, in all four combinations."""
    for vessel, robot in _SHIFTS:
        yield _shifted(masks.vessel_probability, vessel * _LOGIT_STEP), _shifted(masks.robot_probability, robot * _LOGIT_STEP)


def _shifted(probability: NDArray[np.float32], step: float) -> NDArray[np.float32]:
    """The probability whose logit is larger by `step`."""
    odds = np.float32(math.exp(step))
    return np.asarray(odds * probability / (1 + (odds - 1) * probability), np.float32)


def threshold_sensitivity(answer: Answer, others: Sequence[Answer | None]) -> tuple[float, float]:
    """Means of log(1 + degrees) and log(1 + px) by which `others` differ from the answer in theta and head; None: no answer."""
    turns_deg, steps_px = [], []
    for other in others:
        if other is None:
            turns_deg.append(_MAX_DEG)
            steps_px.append(_MAX_PX)
            continue
        turns_deg.append(min(abs((other[1] - answer[1] + 180.0) % 360.0 - 180.0), _MAX_DEG))
        steps_px.append(min(math.dist(answer[0], other[0]), _MAX_PX))
    return float(np.log1p(turns_deg).mean()), float(np.log1p(steps_px).mean())
