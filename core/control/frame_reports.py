"""Frame and scene -> the report that the supervisor gets, with the drift of a camera that was moved since the rig was opened.

Landmarks are corners of the first picture with structure, and of a picture of the rig's calibration if its file has one: so a
camera is noticed that was moved while the program was closed. They are tracked by optical flow, there and back, so that a covered
one does not count. Robot, hand or reflection change some of them; a moved, turned or zoomed camera moves most, so the drift is
their median displacement. Grey levels are taken relative to their surroundings: a lamp that is dimmed is no move.
"""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from typing import Any

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
_TOGETHER_PX = 2.0
"""Landmarks that are off by less from one shift, turn and zoom move together."""
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


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """A small grey picture and its corners."""

    grey: _Grey
    corners: _Corners

    def displacement_px(self, now: _Grey) -> float | None:
        """Median displacement of the landmarks that are found, in px of these pictures; None when too few are."""
        return _displacement_px(self.grey, now, self.corners) if self.grey.shape == now.shape else None


class Landmarks:
    """Compares pictures with the first one that has structure, two or three times a second.

    `kept`: a picture of the same place that goes before it; where another scene is seen, as after a change of the phantom, the
    first one counts.
    """

    def __init__(self, kept: Image | None = None) -> None:
        self._kept = _view_of(_structure(kept)) if kept is not None else None
        self._size: tuple[int, int] | None = None
        self._first: _View | None = None
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
        small_px = self._kept.displacement_px(grey) if self._kept is not None else None
        if small_px is None and self._first is not None:
            small_px = self._first.displacement_px(grey)
        if self._first is None:
            self._first = _view_of(grey)
            if small_px is None:
                return None
        is_gone = small_px is None and self._first is not None and 2 * len(_corners_of(grey)) >= len(self._first.corners)
        self._gone = self._gone + 1 if is_gone else 0
        if small_px is not None:
            self._drift_px = small_px * (size[0] / grey.shape[1]) * scale
        else:
            self._drift_px = math.inf if self._gone >= _GONE_LOOKS else None
        return self._drift_px


def _view_of(grey: _Grey) -> _View | None:
    """A picture with its corners; None when it has too few."""
    corners = _corners_of(grey)
    return _View(grey, corners) if len(corners) >= _LEAST else None


_QUALITY = 90
"""Of the JPEG that is kept."""


def kept_view(image: Image) -> str:
    """A picture (h, w, 3) as a rig file keeps it: small, grey, JPEG, base64; some 15 kB."""
    height, width = image.shape[:2]
    small = cv2.resize(image, (_WIDTH_PX, max(1, round(height * _WIDTH_PX / width))), interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return base64.b64encode(data.tobytes()).decode("ascii")


def view_picture(kept: str) -> Image | None:
    """The picture of ``kept_view`` (h, w, 3); None for a damaged one."""
    try:
        data = base64.b64decode(kept, validate=True)
    except ValueError:
        return None
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) if data else None
    return np.asarray(picture, np.uint8) if picture is not None and picture.shape[1] == _WIDTH_PX else None


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
    """Median displacement of the landmarks that are found, in px of these pictures; None when too few are.

    Where optical flow does not reach, it begins at the shift of the whole picture (phase correlation).
    """
    found_px = _followed_px(first, now, corners, np.zeros(2, np.float32))
    if found_px is None:
        window = cv2.createHanningWindow((first.shape[1], first.shape[0]), cv2.CV_32F)
        shift, _ = cv2.phaseCorrelate(first.astype(np.float32), now.astype(np.float32), window)
        found_px = _followed_px(first, now, corners, np.array(shift, np.float32))
    return found_px


def _followed_px(first: _Grey, now: _Grey, corners: _Corners, shift: NDArray[np.float32]) -> float | None:
    """The same with optical flow that begins at a shift (2,); the landmarks must move together, as one picture does."""
    begin = corners + shift
    options: Any = {"winSize": (_WINDOW_PX, _WINDOW_PX), "maxLevel": _PYRAMID, "flags": cv2.OPTFLOW_USE_INITIAL_FLOW}
    there, found, _ = cv2.calcOpticalFlowPyrLK(first, now, corners, begin.copy(), **options)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(now, first, there, there - shift, **options)
    astray_px = np.linalg.norm((back - corners)[:, 0], axis=1)
    good = (found[:, 0] == 1) & (returned[:, 0] == 1) & (astray_px <= _BACK_PX)
    least = max(_LEAST, len(corners) // 3)
    if np.count_nonzero(good) < least:
        return None
    _, together = cv2.estimateAffinePartial2D(corners[good], there[good], ransacReprojThreshold=_TOGETHER_PX)
    if together is None or np.count_nonzero(together) < least:
        return None
    return float(np.median(np.linalg.norm((there - corners)[good, 0][together[:, 0] > 0], axis=1)))


_SAMPLE = 16
"""Every 16th pixel is compared first."""
_NOTHING_SEEN = frozenset({Reason.BLACK, Reason.WHITE, Reason.UNREADABLE})


class FrameReports:
    """Makes reports; it keeps the frame before for comparison.

    `view` is a picture of the rig's calibration; a pose with less than `min_confidence` says nothing of where the target lies.
    """

    def __init__(self, config: PursuitConfig, view: Image | None = None, min_confidence: float = 0.0) -> None:
        self._config, self._min_confidence = config, min_confidence
        self._before: Frame | None = None
        self._shape: tuple[int, ...] | None = None
        self._landmarks = Landmarks(view)
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
        behind = None
        if scene.pose.confidence >= self._min_confidence:
            way = look_ahead(scene, self._config.look_ahead_px, self._config)
            behind = way is not None and way.behind
        return RouteState.BEHIND if self._direction.is_behind(behind, scene.route.target, scene.captured_s) else RouteState.READY


class _Direction:
    """Whether the target lies behind the robot, debounced: at a bifurcation single frames may see the way turn back.

    The first result for a target counts at once; a different one after it has lasted for as long as a policy needs to back
    off.
    """

    def __init__(self, dwell_s: float) -> None:
        self._dwell_s = dwell_s
        self._target: Point | None = None
        self._behind = False
        self._agreed_s, self._before_s = -math.inf, 0.0

    def is_behind(self, seen: bool | None, target: Point, captured_s: float) -> bool:
        """`seen` None: not known, for a time that does not count."""
        elapsed_s, self._before_s = captured_s - self._before_s, captured_s
        if seen is None:
            self._agreed_s += elapsed_s
            return self._behind and target == self._target
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
