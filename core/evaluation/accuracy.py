"""How well perception agrees with the twin's truth, frame by frame and in sum. Errors in working pixels and degrees."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import PoseConfig, QualityConfig, VectorConfig
from core.evaluation.metrics import kappa
from core.learning.dataset import UNMEASURED, DatasetError, Sample
from core.perception.pipeline import Pipeline
from core.perception.pose import room_px
from core.perception.segmentation import Segmenter
from core.types import Frame, Image, Mask, Point, Pose, Reason, Scene

WRONG_DEG, WRONG_PX = 10.0, 15.0  # an answer whose theta or head is off by more is wrong
TOSS_UP_PX = 0.25  # a pose that is so near to another state is a toss-up
_CONFIDENT_FROM = QualityConfig().confident_from
_STATES, _LENGTH_PX = PoseConfig(), VectorConfig().robot_length_px  # that the truth's states are made with


@dataclass(frozen=True, slots=True)
class FrameScore:
    """One frame against its truth. Errors: None where perception or truth has no pose; Dice of an absent robot: None."""

    stem: str
    vessel_dice: float
    robot_dice: float | None
    expected: bool
    answered: bool
    reason: Reason | None
    head_error_px: float | None
    theta_error_deg: float | None
    theta_deg: float | None
    true_theta_deg: float | None
    state: str | None
    true_state: str | None
    confidence: float
    evidence: tuple[float, ...] | None = None
    is_measured: bool = True
    """False: the truth does not say whether there is a pose, so that no answer is right or wrong."""
    true_room_px: float | None = None
    """How far the true pose is from another state (``room_px``); None where the truth has no distances."""


class TrueMasks(Segmenter):
    """A segmenter that gives the true masks of the current frame: what remains is the error of the geometry."""

    engine = "true masks"

    def __init__(self) -> None:
        self._masks: tuple[Mask, Mask] | None = None

    def show(self, vessel: Mask, robot: Mask) -> None:
        """The masks (H, W) of the next image."""
        self._masks = vessel, robot

    def __call__(self, image: Image) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Probabilities of 0.01 and 0.99 at the image's size."""
        assert self._masks is not None
        size = image.shape[1], image.shape[0]
        vessel, robot = (cv2.resize(m.astype(np.float32), size, interpolation=cv2.INTER_AREA) for m in self._masks)
        return np.asarray(0.01 + 0.98 * vessel, np.float32), np.asarray(0.01 + 0.98 * robot, np.float32)


def dice(found: Mask, true: Mask) -> float:
    """Dice coefficient; 1 when both are empty."""
    total = int(found.sum()) + int(true.sum())
    return 1.0 if total == 0 else 2.0 * int((found & true).sum()) / total


def score_frame(stem: str, scene: Scene, vessel: Mask, robot: Mask, truth: dict[str, Any]) -> FrameScore:
    """Compare a scene with the true masks (at working size) and a truth row as ``synth`` writes it (source pixels)."""
    blank = np.zeros_like(vessel)
    found_vessel = scene.masks.vessel if scene.masks is not None else blank
    found_robot = scene.masks.robot if scene.masks is not None else blank
    pose = scene.pose
    state, theta = truth.get("state"), truth.get("theta_deg")
    head_error = theta_error = None
    if pose is not None and scene.path is not None and state is not None and theta is not None:
        head_xy, theta_signed = truth.get("head_xy"), truth.get("theta_signed_deg")
        if head_xy is None or theta_signed is None:
            raise DatasetError(f"frame {stem}: truth.jsonl has theta_deg of it, but not head_xy and theta_signed_deg; add them")
        line = _nearest_line(pose, truth)
        theta_signed, state, theta = line["theta_signed_deg"], line["state"], line["theta_deg"]
        true_head: Point = scene.to_working((float(head_xy[0]), float(head_xy[1])))
        head_error = float(np.hypot(scene.path.head[0] - true_head[0], scene.path.head[1] - true_head[1]))
        # Signed and wrapped: a robot that points left by as much as it should point right is wrong, and would be steered wrongly.
        theta_error = _turn(pose.theta_signed_deg, float(theta_signed))
    c_head, c_tail, room = truth.get("c_head_px"), truth.get("c_tail_px"), None
    if theta is not None and c_head is not None and c_tail is not None:
        room = room_px(float(c_head), float(c_tail), float(theta), _STATES, _LENGTH_PX)
    return FrameScore(
        stem=stem,
        vessel_dice=dice(found_vessel, vessel),
        robot_dice=dice(found_robot, robot) if robot.any() else None,
        expected=state is not None,
        answered=pose is not None,
        reason=scene.refusal.reason if scene.refusal is not None else None,
        head_error_px=head_error,
        theta_error_deg=theta_error,
        theta_deg=pose.theta_deg if pose is not None else None,
        true_theta_deg=theta,
        state=pose.state.value if pose is not None else None,
        true_state=state,
        confidence=pose.confidence if pose is not None else 0.0,
        evidence=scene.evidence,
        is_measured=truth.get("reason") != UNMEASURED,
        true_room_px=room,
    )


_STATE_COSTS_DEG = 4.0
"""In the choice between several true vessel lines, another state than the answer's counts as so many degrees."""


def _nearest_line(pose: Pose, truth: dict[str, Any]) -> dict[str, Any]:
    """The truth, or of its ``alternatives`` (other vessel lines that a person accepts beside a branch) the nearest one."""

    def distance(line: dict[str, Any]) -> float:
        is_other = bool(pose.state.value != line["state"])
        return abs(_turn(pose.theta_signed_deg, float(line["theta_signed_deg"]))) + _STATE_COSTS_DEG * is_other

    return min([truth, *truth.get("alternatives", ())], key=distance)


def _turn(found_deg: float, true_deg: float) -> float:
    """The angle between two directions, -180 to 180."""
    return (found_deg - true_deg + 180.0) % 360.0 - 180.0


def score_set(
    samples: Sequence[Sample],
    truth: dict[str, dict[str, Any]],
    pipeline: Pipeline,
    masks: TrueMasks,
    on_unreadable: Callable[[DatasetError], None],
) -> Iterator[FrameScore]:
    """Perceive every frame by itself and score it; `masks` gets the true masks first, for a pipeline that runs on them.

    Frames that cannot be read go to `on_unreadable` and are left out.
    """
    for sample in samples:
        try:
            image, vessel, robot = sample.load()
        except DatasetError as error:
            on_unreadable(error)
            continue
        masks.show(vessel, robot)
        scene = pipeline.perceive_single(Frame(0, 0.0, image))
        size = round(scene.source_size[0] * scene.scale), round(scene.source_size[1] * scene.scale)
        if scene.masks is not None:
            size = scene.masks.vessel.shape[1], scene.masks.vessel.shape[0]
        yield score_frame(sample.stem, scene, _at_size(vessel, size), _at_size(robot, size), truth[sample.stem])


def _at_size(mask: Mask, size: tuple[int, int]) -> Mask:
    if (mask.shape[1], mask.shape[0]) == size:
        return mask
    return np.asarray(cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) > 127)


def is_wrong(score: FrameScore) -> bool:
    """Whether an answer is beyond ``WRONG_DEG`` or ``WRONG_PX``."""
    return score.theta_error_deg is not None and (abs(score.theta_error_deg) > WRONG_DEG or (score.head_error_px or 0) > WRONG_PX)


def _statistics(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    array = np.abs(np.array(values))
    return {"median": float(np.median(array)), "mean": float(array.mean()), "p95": float(np.percentile(array, 95))}


def summarise(scores: Sequence[FrameScore], confident_from: float = _CONFIDENT_FROM) -> dict[str, Any]:
    """Sums over frames: "expected" are those whose truth has a pose, "empty" those without any robot, "poseless" the rest.

    Of frames that were not measured only the masks count. "Wrong" is an answer beyond ``WRONG_DEG`` or ``WRONG_PX``, "confident"
    one that is at least as sure as `confident_from`. A "toss-up" is a state to which another one is nearer than ``TOSS_UP_PX``.
    """
    expected = [s for s in scores if s.expected]
    pairs = [(s.true_state, s.state) for s in expected if s.true_state is not None and s.state is not None]
    told = [s for s in expected if s.state is not None and s.true_room_px is not None]
    clear = [s for s in told if (s.true_room_px or 0.0) >= TOSS_UP_PX]
    thetas = [(s.true_theta_deg, s.theta_deg) for s in expected if s.theta_deg is not None and s.true_theta_deg is not None]
    robots = [s.robot_dice for s in scores if s.robot_dice is not None]
    empty = [s for s in scores if s.robot_dice is None and s.is_measured]
    poseless = [s for s in scores if s.robot_dice is not None and not s.expected and s.is_measured]
    refused: dict[str, int] = {}
    for s in expected:
        if s.reason is not None:
            refused[s.reason.value] = refused.get(s.reason.value, 0) + 1
    confident = [s for s in expected if s.answered and s.confidence >= confident_from]
    return {
        "frames": len(scores),
        "expected": len(expected),
        "answered_share": len(pairs) / len(expected) if expected else None,
        "refused": dict(sorted(refused.items())),
        "vessel_dice": float(np.mean([s.vessel_dice for s in scores])) if scores else None,
        "robot_dice": float(np.mean(robots)) if robots else None,
        "head_error_px": _statistics([s.head_error_px for s in expected if s.head_error_px is not None]),
        "theta_error_deg": _statistics([s.theta_error_deg for s in expected if s.theta_error_deg is not None]),
        "theta_pearson": _pearson(thetas),
        "state_agreement": sum(a == b for a, b in pairs) / len(pairs) if pairs else None,
        "state_kappa": kappa([str(a) for a, _ in pairs], [str(b) for _, b in pairs]),
        "state_toss_up_share": 1.0 - len(clear) / len(told) if told else None,
        "state_agreement_but_toss_ups": sum(s.state == s.true_state for s in clear) / len(clear) if clear else None,
        "answered_and_wrong_share": sum(map(is_wrong, expected)) / len(pairs) if pairs else None,
        "confident_share": len(confident) / len(expected) if expected else None,
        "confident_and_wrong_share": sum(map(is_wrong, confident)) / len(confident) if confident else None,
        "empty_frames": len(empty),
        "answers_on_empty_frames": sum(s.answered for s in empty),
        # The robot is seen, but its head is outside the picture or has no vessel beside it: what is answered there is wrong.
        "poseless_frames": len(poseless),
        "answers_on_poseless_frames": sum(s.answered for s in poseless),
    }


_PER_LOOK = (
    "frames",
    "answered_share",
    "vessel_dice",
    "robot_dice",
    "head_error_px",
    "theta_error_deg",
    "state_agreement",
    "answered_and_wrong_share",
    "confident_share",
    "confident_and_wrong_share",
)


def summarise_looks(
    scores: Sequence[FrameScore], looks: Mapping[str, str], confident_from: float = _CONFIDENT_FROM
) -> dict[str, Any]:
    """The main figures of every family of looks, errors as medians, and their means over the looks.

    `looks` is the family of every frame, by its stem. Returns ``looks`` (figures by family) and ``mean_over_looks``.
    """
    rows: dict[str, dict[str, Any]] = {}
    for look in sorted({looks[score.stem] for score in scores}):
        sums = summarise([score for score in scores if looks[score.stem] == look], confident_from)
        rows[look] = {key: sums[key]["median"] if isinstance(sums[key], dict) else sums[key] for key in _PER_LOOK}
    return {"looks": rows, "mean_over_looks": _means(list(rows.values()))}


def _means(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    means: dict[str, Any] = {"looks": len(rows), "frames": sum(row["frames"] for row in rows)}
    for key in _PER_LOOK[1:]:
        told = [row[key] for row in rows if row[key] is not None]
        means[key] = float(np.mean(told)) if told else None
    return means


def _pearson(pairs: Sequence[tuple[float, float]]) -> float | None:
    """Correlation of the pairs; None for fewer than three, and where one side does not vary."""
    columns = np.array(pairs).T
    if len(pairs) < 3 or np.ptp(columns, axis=1).min() == 0.0:
        return None
    return float(np.corrcoef(columns)[0, 1])
