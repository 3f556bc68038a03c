"""What the supervisor wants to know of each turn of perception, made from frame and scene."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from core.control.frame_watch import FrameReport, RouteState
from core.control.landmarks import Landmarks
from core.control.way import look_ahead
from core.policy_config import PursuitConfig
from core.types import Advice, Frame, Image, Point, Reason, Scene

_SAMPLE = 16
_NOTHING_SEEN = frozenset({Reason.BLACK, Reason.WHITE, Reason.UNREADABLE})


class FrameReports:
    """Compares each frame with the one before it, which it keeps."""

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._before: Frame | None = None
        self._shape: tuple[int, ...] | None = None
        self._landmarks = Landmarks()
        self._direction = _Direction(config.behind_s)

    def report(self, frame: Frame, scene: Scene, advice: Advice | None, *, has_target: bool, sound: bool = True) -> FrameReport:
        """The report of a frame, what was understood of it and what was advised.

        Of a scene that is not `sound` (``is_sound``) nothing else is read: a comparison with NaN is always false.
        """
        before, self._before = self._before, frame
        image, well_formed = frame.image, is_picture(frame.image)
        if well_formed and self._shape is None:
            self._shape = image.shape
        format_ok = well_formed and image.shape == self._shape
        return FrameReport(
            index=frame.index,
            captured_s=frame.captured_s,
            refusal=scene.refusal.reason if scene.refusal is not None else None,
            confidence=scene.pose.confidence if scene.pose is not None else 0.0,
            route=self._route(scene, has_target) if sound else RouteState.READY if has_target else RouteState.NONE,
            finite=sound and is_finite(advice),
            format_ok=format_ok,
            same_picture=before is not None and _same(before.image, image),
            delivered=1 if before is None else max(1, frame.index - before.index),
            lost=0 if before is None else max(0, frame.lost - before.lost),
            drift_px=self._drift_px(frame, scene) if format_ok else None,
        )

    def _drift_px(self, frame: Frame, scene: Scene) -> float | None:
        """Of a picture in which nothing can be told, nothing is told of landmarks either."""
        if scene.refusal is not None and scene.refusal.reason in _NOTHING_SEEN:
            return None
        return self._landmarks.drift_px(frame.image, frame.captured_s, scene.scale)

    def _route(self, scene: Scene, has_target: bool) -> RouteState:
        if not has_target or scene.route is None or scene.pose is None:  # where a refused head lies, the way says nothing
            return RouteState.NONE
        way = look_ahead(scene, self._config.look_ahead_px, self._config)
        behind = way is not None and way.behind
        return RouteState.BEHIND if self._direction.is_behind(behind, scene.route.target, scene.captured_s) else RouteState.READY


class _Direction:
    """Whether the destination lies behind the robot, without flicker: at a bifurcation one frame alone may see the way turn back.

    The first word on a destination counts at once; another one when it has been said for as long as a policy needs to back off.
    """

    def __init__(self, dwell_s: float) -> None:
        self._dwell_s = dwell_s
        self._target: Point | None = None
        self._behind = False
        self._agreed_s = -math.inf

    def is_behind(self, seen: bool, target: Point, captured_s: float) -> bool:
        backwards = captured_s < self._agreed_s  # the camera's clock began anew
        if target != self._target or seen == self._behind or backwards or captured_s - self._agreed_s >= self._dwell_s:
            self._target, self._behind, self._agreed_s = target, seen, captured_s
        return self._behind


def is_picture(image: Image) -> bool:
    """Whether it is what everybody here takes for granted: 8 bits, RGB, with pixels."""
    return image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3 and image.size > 0


def is_finite(advice: Advice | None) -> bool:
    """Whether both numbers of an advice are."""
    return advice is None or math.isfinite(advice.steer_deg + advice.advance_mm_s)


def _same(before: Image, image: Image) -> bool:
    """A look at some pixels first: noise makes even a still scene's pictures differ nearly everywhere."""
    if before.shape != image.shape or not np.array_equal(before[::_SAMPLE, ::_SAMPLE], image[::_SAMPLE, ::_SAMPLE]):
        return False
    return bool(np.array_equal(before, image))


def is_sound(scene: Scene) -> bool:
    """Whether every number of a scene that anything is decided by is finite."""
    arrays: list[NDArray[np.floating]] = []
    numbers: list[float] = [] if scene.novelty is None else [scene.novelty]
    if scene.masks is not None:
        arrays += [scene.masks.vessel_probability, scene.masks.robot_probability]
    if (pose := scene.pose) is not None:
        numbers += [pose.theta_deg, pose.theta_signed_deg, pose.c_head_px, pose.c_tail_px, pose.confidence]
    if (path := scene.path) is not None:
        arrays.append(path.points)
        numbers += [path.bridged_px, path.radius_px]
    if (centerline := scene.centerline) is not None:
        arrays.append(centerline.piece)
        numbers += [*centerline.nearest, centerline.radius_px, centerline.ambiguity]
    if (route := scene.route) is not None:
        arrays.append(route.points)
        numbers += [route.length_px, *route.target]
    # one number that is none spoils the sum, which takes a tenth of the time of looking at each
    return all(math.isfinite(number) for number in (*numbers, *(float(np.sum(array)) for array in arrays)))
