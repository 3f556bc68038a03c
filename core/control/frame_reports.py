"""Frame and scene -> the report that the supervisor gets, with the drift of a camera that was moved since the rig was opened.

Landmarks are corners of the first picture with structure. They are tracked by optical flow, there and back, so that a covered one
does not count. Robot, hand or reflection change some of them; a moved, turned or zoomed camera moves most, so the drift is their
median displacement. Grey levels are taken relative to their surroundings: a lamp that is dimmed is no move.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import PursuitConfig
from core.control.camera_monitor import FrameReport, RouteState
from core.control.direction_monitor import head_seen
from core.control.look_ahead import look_ahead
from core.types import Advice, Frame, Image, Point, Reason, Scene

_EVERY_S = 0.4
"""Period of the comparison, which takes some 6 ms."""
_WIDTH_PX = 320
"""Width of the pictures that are compared."""
_MOST, _LEAST = 48, 8
"""Number of landmarks."""
_APART_PX, _CORNER = 10, 0.08
"""Least distance between landmarks, and least quality against the best one."""
_WINDOW_PX, _PYRAMID = 21, 4
"""Of the optical flow."""
_BACK_PX = 1.0
"""Tracked there and back, a landmark must end where it began."""
_SMOOTH_PX, _AROUND_PX = 1.2, 12.0
"""Scales of smoothing and of the surroundings."""
_LEAST_CONTRAST = 6.0
"""Added to the contrast, so that noise is not amplified."""
_GONE_LOOKS = 3
"""Comparisons in a row that must show another scene: a hand that passes has structure, too."""

_Grey = NDArray[np.uint8]
_Corners = NDArray[np.float32]


class Landmarks:
    """Compares pictures with the first one that has structure, two or three times a second."""

    def __init__(self) -> None:
        self._size: tuple[int, int] | None = None
        self._first: _Grey | None = None
        self._corners: _Corners = np.zeros((0, 1, 2), np.float32)
        self._compared_s = -math.inf
        self._drift_px: float | None = None
        self._gone = 0

    def drift_px(self, image: Image, captured_s: float, scale: float) -> float | None:
        """Median displacement of the landmarks, in working px (`scale`: working px per source px).

        None while there are no landmarks, or the picture is covered or dark; infinite when it shows another scene. A picture of
        another size is of another camera, and becomes the first one.
        """
        size = image.shape[1], image.shape[0]
        if size != self._size:
            self._size, self._first, self._compared_s, self._drift_px = size, None, -math.inf, None
        # a time that is NaN compares nothing, one that went back does
        if 0.0 <= captured_s - self._compared_s < _EVERY_S or not math.isfinite(captured_s):
            return self._drift_px
        self._compared_s = captured_s
        grey = _structure(image)
        if self._first is None:
            found = _corners_of(grey)
            if len(found) >= _LEAST:
                self._first, self._corners = grey, found
            return None
        small_px = _displacement_px(self._first, grey, self._corners)
        self._gone = self._gone + 1 if small_px is None and 2 * len(_corners_of(grey)) >= len(self._corners) else 0
        if small_px is not None:
            self._drift_px = small_px * (size[0] / grey.shape[1]) * scale
        else:
            self._drift_px = math.inf if self._gone >= _GONE_LOOKS else None
        return self._drift_px


def _corners_of(grey: _Grey) -> _Corners:
    found = cv2.goodFeaturesToTrack(grey, _MOST, _CORNER, _APART_PX)
    return np.zeros((0, 1, 2), np.float32) if found is None else np.asarray(found, np.float32)


def _structure(image: Image) -> _Grey:
    """A small grey picture of local contrast, independent of the brightness of the surroundings."""
    height, width = image.shape[:2]
    small = cv2.resize(image, (_WIDTH_PX, max(1, round(height * _WIDTH_PX / width))), interpolation=cv2.INTER_AREA)
    grey = cv2.GaussianBlur(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).astype(np.float32), (0, 0), _SMOOTH_PX)
    against = grey - cv2.GaussianBlur(grey, (0, 0), _AROUND_PX)
    contrast = cv2.sqrt(cv2.GaussianBlur(against * against, (0, 0), _AROUND_PX))
    return np.asarray(np.clip(128.0 + 50.0 * against / (contrast + _LEAST_CONTRAST), 0, 255), np.uint8)


def _displacement_px(first: _Grey, now: _Grey, corners: _Corners) -> float | None:
    """Median displacement of the landmarks that are found, in px of these pictures; None when too few are."""
    window = (_WINDOW_PX, _WINDOW_PX)
    there, found, _ = cv2.calcOpticalFlowPyrLK(first, now, corners, np.empty_like(corners), winSize=window, maxLevel=_PYRAMID)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(now, first, there, np.empty_like(corners), winSize=window, maxLevel=_PYRAMID)
    astray_px = np.linalg.norm((back - corners)[:, 0], axis=1)
    good = (found[:, 0] == 1) & (returned[:, 0] == 1) & (astray_px <= _BACK_PX)
    if np.count_nonzero(good) < max(_LEAST, len(corners) // 3):
        return None
    return float(np.median(np.linalg.norm((there - corners)[good, 0], axis=1)))


_SAMPLE = 16
"""Every 16th pixel is compared first."""
_NOTHING_SEEN = frozenset({Reason.BLACK, Reason.WHITE, Reason.UNREADABLE})


class FrameReports:
    """Makes reports; it keeps the frame before for comparison."""

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._before: Frame | None = None
        self._shape: tuple[int, ...] | None = None
        self._landmarks = Landmarks()
        self._direction = _Direction(config.behind_s)

    def report(self, frame: Frame, scene: Scene, advice: Advice | None, *, has_target: bool, sound: bool = True) -> FrameReport:
        """The report of a frame, its scene and the advice. A scene that is not `sound` (``is_sound``) has no other meaning."""
        before, self._before = self._before, frame
        image, well_formed = frame.image, is_picture(frame.image)
        if well_formed and self._shape is None:
            self._shape = image.shape
        format_ok = well_formed and image.shape == self._shape
        is_blind = scene.refusal is not None and scene.refusal.reason in _NOTHING_SEEN
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
            drift_px=self._landmarks.drift_px(image, frame.captured_s, scene.scale) if format_ok and not is_blind else None,
            head=head_seen(scene, self._config.pixels_per_mm) if sound else None,
        )

    def _route(self, scene: Scene, has_target: bool) -> RouteState:
        if not has_target or scene.route is None or scene.pose is None:
            return RouteState.NONE
        way = look_ahead(scene, self._config.look_ahead_px, self._config)
        behind = way is not None and way.behind
        return RouteState.BEHIND if self._direction.is_behind(behind, scene.route.target, scene.captured_s) else RouteState.READY


class _Direction:
    """Whether the destination lies behind the robot, debounced: at a bifurcation single frames may see the way turn back.

    The first result for a destination counts at once; a different one after it has lasted for as long as a policy needs to back
    off.
    """

    def __init__(self, dwell_s: float) -> None:
        self._dwell_s = dwell_s
        self._target: Point | None = None
        self._behind = False
        self._agreed_s = -math.inf

    def is_behind(self, seen: bool, target: Point, captured_s: float) -> bool:
        backwards = captured_s < self._agreed_s  # the camera's clock was reset
        if target != self._target or seen == self._behind or backwards or captured_s - self._agreed_s >= self._dwell_s:
            self._target, self._behind, self._agreed_s = target, seen, captured_s
        return self._behind


def is_picture(image: Image) -> bool:
    """Whether an image is 8-bit RGB and not empty."""
    return image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3 and image.size > 0


def is_finite(advice: Advice | None) -> bool:
    """Whether both numbers of an advice are finite."""
    return advice is None or math.isfinite(advice.steer_deg + advice.advance_mm_s)


def _same(before: Image, image: Image) -> bool:
    """Compares some pixels first: noise makes even a still scene's pictures differ nearly everywhere."""
    if before.shape != image.shape or not np.array_equal(before[::_SAMPLE, ::_SAMPLE], image[::_SAMPLE, ::_SAMPLE]):
        return False
    return bool(np.array_equal(before, image))


def is_sound(scene: Scene) -> bool:
    """Whether every number of a scene that a decision depends on is finite."""
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
    # one NaN or infinity makes the sum not finite; ten times faster than testing each number
    return all(math.isfinite(number) for number in (*numbers, *(float(np.sum(array)) for array in arrays)))
