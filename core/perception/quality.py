"""When perception does not answer, and how sure it is when it does.

Each check gives a ``Refusal`` that names the measured value and its limit in plain words, or None. The limits are settings. A
model that was calibrated tells a probability (``evidence``); without calibration the confidence is a product of shares, each 1 when
nothing speaks against the answer.
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config import PerceptionConfig, QualityConfig, VectorConfig
from core.perception import polyline
from core.perception.evidence import at, wall_blur_px
from core.perception.vessel_graph import MAX_CHAINS
from core.types import Centerline, Image, Mask, Masks, Point, Reason, Refusal, RobotPath, VesselGraph

SAMPLE_STEP = 4
"""Brightness is judged on every fourth pixel."""
FARTHEST_RADII, FARTHEST_PX = 2.5, 4.0
"""A head is no farther from the centerline of its own vessel, also in a junction's opening or where it bulges the wall: of 919
right answers with true masks none was farther than 1.4 radii. Where it is, the vessel that it lies in was not found."""
_LEAST_CONTRAST = 4.0
_KNOWN_AGAIN_SHARE = 0.9
"""Of the limit. The kind belongs to the rig, not to one frame: a rig at the limit must not stop and go with every other one, and is
known again only where it was seen well below, however long that takes, or where the stream begins anew."""
MAX_ROBOT_SHARE = 0.3
"""Of the image. A robot of 60 px across all of it is half of that; thinning a larger one takes long, and finds none."""


def check_image(image: Image, config: QualityConfig) -> Refusal | None:
    """BLACK, WHITE or BLURRED, from the RGB image (h, w, 3) alone."""
    if image.shape[0] == 0 or image.shape[1] == 0:
        return Refusal(Reason.UNREADABLE, "it has no pixels")
    if not config.enabled:
        return None
    red, green, blue = (image[::SAMPLE_STEP, ::SAMPLE_STEP, channel] for channel in range(3))
    brightest = _level(np.maximum(np.maximum(red, green), blue), 0.99)
    if brightest < config.black_level:
        return Refusal(Reason.BLACK, f"99 % of it is darker than {brightest:.0f} (black below {config.black_level:.0f} of 255)")
    dimmest = _level(np.minimum(np.minimum(red, green), blue), 0.01)
    if dimmest > config.white_level:
        detail = f"99 % of it is brighter than {dimmest:.0f} (overexposed above {config.white_level:.0f} of 255)"
        return Refusal(Reason.WHITE, detail)
    if config.min_sharpness > 0.0:
        found = sharpness(image)
        if found < config.min_sharpness:
            return Refusal(Reason.BLURRED, f"sharpness {found:.3f} (at least {config.min_sharpness:.3f})")
    return None


def _level(values: NDArray[np.uint8], share: float) -> float:
    """The value that this share of all values does not exceed; counted, because sorting costs 2 ms in every frame."""
    counts = np.bincount(values.ravel(), minlength=256)
    return float(np.searchsorted(counts.cumsum(), int(share * (values.size - 1)), side="right"))


def sharpness(image: Image) -> float:
    """Steepest brightness step against the image's whole contrast, per px: some 0.15 for a sharp edge, 1/width for a blurred one.

    It does not depend on exposure, and it is taken at half size, lightly smoothed, so that noise does not pass for sharpness. An
    image of one colour has no edge to judge by and passes for sharp.
    """
    half = cv2.resize(image, (max(1, image.shape[1] // 2), max(1, image.shape[0] // 2)), interpolation=cv2.INTER_AREA)
    grey = cv2.GaussianBlur(cv2.cvtColor(half, cv2.COLOR_RGB2GRAY), (3, 3), 0.75)
    across, down = cv2.spatialGradient(grey, ksize=3)
    squares = (np.multiply(across, across, dtype=np.int32) + np.multiply(down, down, dtype=np.int32)).ravel()
    steepest = math.sqrt(_of_the_largest(squares, len(squares) - int(0.995 * (len(squares) - 1)))) / 16.0
    samples = np.asarray(grey[::2, ::2], np.uint8)
    contrast = _level(samples, 0.99) - _level(samples, 0.01)
    return steepest / contrast if contrast >= _LEAST_CONTRAST else 1.0


def _of_the_largest(values: NDArray[np.int32], rank: int) -> float:
    """The value that `rank` of all values reach. What every 16th one tells leaves a hundredth of them to be sorted."""
    sample = values[::16]
    place = max(0, len(sample) - 1 - rank // 8)  # twice as far down as it has to be on average
    likely = values[values >= np.partition(sample, place)[place]]
    kept = likely if len(likely) >= rank else values
    place = len(kept) - rank
    return float(np.partition(kept, place)[place])


def check_finite(*probabilities: NDArray[np.float32]) -> Refusal | None:
    """LOW_CONFIDENCE, when the network gave what is no number: no geometry can be trusted with it."""
    # One such value spoils the product with itself, the quickest thing that looks at each.
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
            Reason.NO_ROBOT, f"what looks like it covers {100 * share:.0f} % of the image (at most {100 * MAX_ROBOT_SHARE:.0f} %)"
        )
    return None


def check_kind(novelty: float | None, config: QualityConfig, *, refused_before: bool = False) -> Refusal | None:
    """UNLIKE_TRAINING, where the picture is of a kind that the model does not know; None also where nobody can tell.

    `refused_before`: the last picture of a stream was, and what lies about at the limit stays so.
    """
    limit = config.max_novelty * (_KNOWN_AGAIN_SHARE if refused_before else 1.0)
    if not config.enabled or novelty is None or novelty <= limit:
        return None
    return Refusal(Reason.UNLIKE_TRAINING, f"distance {novelty:.2f} from the pictures that it knows (at most {limit:.2f})")


def hinted(refusal: Refusal, unlike: Refusal | None) -> Refusal:
    """The refusal of a picture of an unknown kind: that there is no robot may come of that, and who sees one has to be told."""
    if unlike is None or refusal.reason is not Reason.NO_ROBOT:
        return refusal
    return replace(refusal, detail=f"{refusal.detail}; it does not know such pictures: {unlike.detail}")


def check_graph(graph: VesselGraph, config: VectorConfig) -> Refusal | None:
    """NO_VESSEL, when the mask gave no graph that the configured rule could look at: it is a dot, or branches all over."""
    if graph.edges or config.vessel_rule == "window":
        return None
    return Refusal(Reason.NO_VESSEL, f"its mask has no centerline, or more than {MAX_CHAINS} branches")


def check_path(path: RobotPath, masks: Masks, config: PerceptionConfig) -> Refusal | None:
    """TOO_SHORT, GAP_TOO_LONG or OUTSIDE_VESSEL."""
    limits = config.quality
    if not limits.enabled:
        return None
    length_px = float(polyline.arc_length(path.points)[-1])
    if length_px < limits.min_robot_length_px:
        return Refusal(Reason.TOO_SHORT, f"{length_px:.0f} px long (at least {limits.min_robot_length_px:.0f} px)")
    bridged = path.bridged_px / length_px
    if bridged > limits.max_bridged_share:
        detail = f"{100 * bridged:.0f} % of the robot is bridged (at most {100 * limits.max_bridged_share:.0f} %)"
        return Refusal(Reason.GAP_TOO_LONG, detail)
    inside = inside_share(path, masks.vessel, config.vectors.robot_length_px)
    if inside < limits.min_inside_vessel:
        detail = f"{100 * inside:.0f} % of its last {config.vectors.robot_length_px:.0f} px lie in the vessel"
        return Refusal(Reason.OUTSIDE_VESSEL, f"{detail} (at least {100 * limits.min_inside_vessel:.0f} %)")
    return None


def check_centerline(centerline: Centerline | None, head: Point, config: QualityConfig) -> Refusal | None:
    """NO_VESSEL when there is no centerline beside the head, OUTSIDE_VESSEL when it is another vessel's, AMBIGUOUS_BRANCH when two
    branches fit the head equally well."""
    if centerline is None:
        return Refusal(Reason.NO_VESSEL, "no centerline beside the robot's head")
    gap_px, limit_px = math.dist(head, centerline.nearest), FARTHEST_RADII * centerline.radius_px + FARTHEST_PX
    if config.enabled and gap_px > limit_px:
        detail = f"its head is {gap_px:.0f} px from the nearest centerline (at most {limit_px:.0f} px)"
        return Refusal(Reason.OUTSIDE_VESSEL, detail)
    if config.enabled and centerline.ambiguity > config.max_ambiguity:
        detail = f"a second branch fits {100 * centerline.ambiguity:.0f} % as well (at most {100 * config.max_ambiguity:.0f} %)"
        return Refusal(Reason.AMBIGUOUS_BRANCH, detail)
    return None


def check_walls(masks: Masks, head: Point, config: QualityConfig) -> Refusal | None:
    """NO_VESSEL, when the model is in doubt about the vessel's walls beside the head: theta and the distances come from them."""
    if not config.enabled:
        return None
    blur_px = wall_blur_px(masks, head)
    if blur_px <= config.max_wall_blur_px:
        return None
    detail = f"what looks like one has walls beside the head that are blurred over {blur_px:.1f} px"
    return Refusal(Reason.NO_VESSEL, f"{detail} (at most {config.max_wall_blur_px:.1f} px)")


def check_confidence(confidence: float, config: QualityConfig) -> Refusal | None:
    """LOW_CONFIDENCE."""
    if config.enabled and not confidence >= config.min_confidence:  # nor what is no number
        return Refusal(Reason.LOW_CONFIDENCE, f"{100 * confidence:.0f} % (at least {100 * config.min_confidence:.0f} %)")
    return None


def inside_share(path: RobotPath, vessel: Mask, length_px: float) -> float:
    """Share of the robot's last `length_px` that lies in the vessel's mask."""
    total = float(polyline.arc_length(path.points)[-1])
    return float(at(vessel, polyline.resample(polyline.cut(path.points, total - length_px, total), 1.0)).mean())


def confidence(path: RobotPath, centerline: Centerline, masks: Masks, config: PerceptionConfig) -> float:
    """How far the answer of a model without calibration can be trusted, 0..1: the product of

    - how clearly the network saw the robot's last 40 px, and the vessel beside them,
    - how much of them lies in the vessel,
    - how much of the path was seen and not bridged,
    - how far the next best path is behind,
    - how far the next best branch is behind.
    """
    total = float(polyline.arc_length(path.points)[-1])
    tip = polyline.resample(polyline.cut(path.points, total - config.vectors.robot_length_px, total), 1.0)
    in_mask = tip[at(masks.robot, tip)]  # what is bridged there is counted below
    robot_seen = _clearness(float(at(masks.robot_probability, in_mask).mean())) if len(in_mask) else 0.0
    seen = robot_seen * _clearness(float(at(masks.vessel_probability, centerline.piece).mean()))
    inside = min(1.0, inside_share(path, masks.vessel, config.vectors.robot_length_px) / 0.9)
    unbridged = 1.0 - min(1.0, path.bridged_px / max(total, 1.0))
    lead = 1.0 if path.runner_up is None else float(np.clip(0.6 + (path.score - path.runner_up) / 0.5, 0.4, 1.0))
    return float(seen * inside * unbridged * lead * (1.0 - 0.5 * centerline.ambiguity))


def _clearness(probability: float) -> float:
    """0.5 says nothing, 0.9 is as clear as it gets."""
    return float(np.clip((probability - 0.5) / 0.4, 0.0, 1.0))
