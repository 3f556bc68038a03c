"""What the algorithm would have drawn: shown and taken over on demand, never in a blind study."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from core.perception import polyline
from core.study.annotations import Annotation, Line, MaskPolygon, MaskTarget
from core.study.mask_polygons import polygons_of
from core.types import Mask, Points, Pose, Refusal, Scene

_LINE_PX = 60.0
"""Length of the proposed robot line: the 40 px that count, and some to see where it comes from. Working pixels."""
_TOLERANCE_PX = 0.4


@dataclass(frozen=True, slots=True)
class Proposal:
    """The algorithm's answer in the form of an annotation (source pixels), its pose, and why there is none if so."""

    annotation: Annotation
    pose: Pose | None
    confidence: float
    refusal: Refusal | None = None


def proposal_of(scene: Scene) -> Proposal:
    """The lines, the state and the masks of a perceived scene; parts that it does not have are empty."""
    robot: Line = ()
    vessel: Line = ()
    if scene.path is not None:
        total = float(polyline.arc_length(scene.path.points)[-1])
        robot = _line(scene, polyline.cut(scene.path.points, total - _LINE_PX, total))
    if scene.centerline is not None:
        vessel = _line(scene, scene.centerline.piece)
    masks: tuple[MaskPolygon, ...] = ()
    if scene.masks is not None:
        width, height = scene.source_size
        masks = tuple(
            polygon
            for target, mask in ((MaskTarget.VESSEL, scene.masks.vessel), (MaskTarget.ROBOT, scene.masks.robot))
            for polygon in polygons_of(_enlarged(mask, width, height), target)
        )
    state = scene.pose.state if scene.pose is not None else None
    confidence = scene.pose.confidence if scene.pose is not None else 0.0
    return Proposal(Annotation(robot, vessel, state, masks=masks), scene.pose, confidence, scene.refusal)


def _line(scene: Scene, points: Points) -> Line:
    """The points that are needed for the line's shape, in source pixels."""
    few = cv2.approxPolyDP(points.astype(np.float32).reshape(-1, 1, 2), _TOLERANCE_PX, False)[:, 0]
    # The ends decide angle and distances: they stay exact.
    exact = np.asarray(few, np.float64)
    exact[0], exact[-1] = points[0], points[-1]
    return tuple((float(x), float(y)) for x, y in np.round(scene.points_to_source(exact), 3).tolist())


def _enlarged(mask: Mask, width: int, height: int) -> Mask:
    """The mask at the image's own size."""
    if mask.shape == (height, width):
        return mask
    soft = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(soft > 0.5)
