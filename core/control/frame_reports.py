"""What the supervisor wants to know of each turn of perception, made from frame and scene."""

from __future__ import annotations

import math

import numpy as np

from core.control.frame_watch import FrameReport, RouteState
from core.control.pursuit import look_ahead
from core.policy_config import PursuitConfig
from core.types import Advice, Frame, Image, Scene

_SAMPLE = 16


class FrameReports:
    """Compares each frame with the one before it, which it keeps."""

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._before: Frame | None = None
        self._shape: tuple[int, ...] | None = None

    def report(self, frame: Frame, scene: Scene, advice: Advice | None, *, has_target: bool) -> FrameReport:
        """The report of a frame, what was understood of it and what was advised."""
        before, self._before = self._before, frame
        image = frame.image
        well_formed = image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3
        if well_formed and self._shape is None:
            self._shape = image.shape
        return FrameReport(
            index=frame.index,
            captured_s=frame.captured_s,
            refusal=scene.refusal.reason if scene.refusal is not None else None,
            confidence=scene.pose.confidence if scene.pose is not None else 0.0,
            route=self._route(scene, has_target),
            finite=_is_finite(scene) and is_finite(advice),
            format_ok=well_formed and image.shape == self._shape,
            same_picture=before is not None and _same(before.image, image),
            delivered=1 if before is None else max(1, frame.index - before.index),
            lost=0 if before is None else max(0, frame.lost - before.lost),
        )

    def _route(self, scene: Scene, has_target: bool) -> RouteState:
        if not has_target or scene.route is None:
            return RouteState.NONE
        way = look_ahead(scene, self._config.look_ahead_px, self._config)
        return RouteState.BEHIND if way is not None and way.behind else RouteState.READY


def is_finite(advice: Advice | None) -> bool:
    """Whether both numbers of an advice are."""
    return advice is None or math.isfinite(advice.steer_deg + advice.advance_mm_s)


def _same(before: Image, image: Image) -> bool:
    """A look at some pixels first: noise makes even a still scene's pictures differ nearly everywhere."""
    if before.shape != image.shape or not np.array_equal(before[::_SAMPLE, ::_SAMPLE], image[::_SAMPLE, ::_SAMPLE]):
        return False
    return bool(np.array_equal(before, image))


def _is_finite(scene: Scene) -> bool:
    if scene.pose is None:
        return True
    pose = scene.pose
    numbers = [pose.theta_deg, pose.theta_signed_deg, pose.c_head_px, pose.c_tail_px, pose.confidence]
    numbers += list(scene.path.head) if scene.path is not None else []
    return all(math.isfinite(number) for number in numbers)
