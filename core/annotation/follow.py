"""Lines drawn on single pictures of a clip, followed through the others by optical flow (OpenCV's DIS) and matching.

Camera and phantom do not move: the vessel's line stays, the robot's moves with the flow, and is then shifted to where the picture
looks across it, and around the head, as the drawn one does. So errors hardly add up, but on a plain body the motion along it is
seen at the head alone: long clips need corrections. Each picture is followed from the nearest one with lines of its own, forwards
or backwards, so that a correction begins the following again.

By ``python -m tools.benchmarks follow``, 60 pictures after the drawn one, the robot's direction is off by 1.1 degrees (median; 95th
percentile 10.6) and the head by 2.5 px; by flow alone 5.2 (17.9) degrees and 10.2 px. Tried, and worse: sparse flow with a check
backwards (Lucas and Kanade), flow from one picture to the next, variational refinement.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from core import geometry
from core.annotation.model import Annotation, Line
from core.types import Image, Points

_STEP_PX = 5.0
"""The robot's line gets a point every so many px, so that it can bend."""
_ANCHOR_EVERY = 10
"""So many pictures are compared with one and the same picture before: errors add up only from one such picture to the next."""
_MARGIN_PX = 48
"""The flow is computed so far around the line."""
_INSET_PX = 3.0
"""The ends move as the line does so far inside: beyond them lies background."""
_PATCH_PX, _STRIDE_PX = 8, 3
"""Of DIS: size of the patches that are searched for, and their distance."""
_BLUR_PX, _SMOOTH_POINTS = 1.5, 2.0
"""The flow is averaged over so many px, and over so many points along the line (standard deviations)."""
_ACROSS_PX = np.arange(-4.0, 4.1, 0.5)
"""Where a picture is compared across the line: the robot and its edges."""
_REACH_PX = 4.0
"""By which a match corrects the flow across the line at most."""
_SLIDES_PX = np.arange(-3.0, 3.1, 0.5)
"""Corrections along the line that are tried."""
_BEYOND_PX, _END_POINTS = (4.0, 8.0), 6
"""Places beyond the head that are compared, too, and how many points of the line's end with them tell the motion along it."""
_ROUNDS = 2
"""Corrections across and along that follow each other."""
_TIE = 0.1
"""Added to the mean squared difference (grey values) per square px of a correction: where all look alike, nothing is corrected."""


def followed_lines(
    read: Callable[[int], Image], keys: Mapping[int, Annotation], count: int, go_on: Callable[[], bool] = lambda: True
) -> Iterator[tuple[int, Line, Line]]:
    """The lines of robot and vessel of all pictures without lines of their own.

    `read` gives the n-th of the `count` pictures of a clip, RGB (H, W, 3), all of one size; its ImageError goes through. `keys`
    are the pictures with lines, by place, one at least. `go_on` is asked before each picture; when it is False, no more come.
    """
    places = sorted(keys)
    for number, key in enumerate(places):
        # up to half-way to the neighbours, of two that are equally near the earlier one
        first = 0 if number == 0 else (places[number - 1] + key) // 2 + 1
        last = count - 1 if number + 1 == len(places) else (key + places[number + 1]) // 2
        for way in (range(key + 1, last + 1), range(key - 1, first - 1, -1)):
            for place, robot in _along(read, key, keys[key].robot, way):
                if not go_on():
                    return
                yield place, robot, keys[key].vessel


def _along(read: Callable[[int], Image], key: int, line: Line, way: range) -> Iterator[tuple[int, Line]]:
    """The robot's line in the pictures of a way that begins beside `key`."""
    if len(line) < 2 or not way:
        return
    anchor, base = read(key), geometry.resample(np.array(line, np.float64), _STEP_PX)
    look = _Look(anchor, base)
    for number, place in enumerate(way, 1):
        image = read(place)
        moved = look.matched(image, base + _flow_at(anchor, image, base))
        yield place, tuple((float(x), float(y)) for x, y in np.round(moved, 3).tolist())
        if number % _ANCHOR_EVERY == 0:
            anchor, base = image, moved


def _flow_at(before: Image, after: Image, points: Points) -> NDArray[np.float64]:
    """By how much points (N, 2) of a line have moved, (N, 2)."""
    size = np.array(before.shape[1::-1])
    low = np.clip(np.floor(points.min(axis=0)).astype(int) - _MARGIN_PX, 0, size - 1)
    high = np.clip(np.ceil(points.max(axis=0)).astype(int) + _MARGIN_PX + 1, low + 1, size)
    window = slice(low[1], high[1]), slice(low[0], high[0])
    grey = [np.ascontiguousarray(cv2.cvtColor(image[window], cv2.COLOR_RGB2GRAY)) for image in (before, after)]
    if min(grey[0].shape) < 2 * _PATCH_PX:  # the line lies beside the picture
        return np.zeros_like(points)
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    search.setFinestScale(0)  # thin robots vanish in smaller pictures
    search.setPatchSize(_PATCH_PX)
    search.setPatchStride(_STRIDE_PX)
    search.setVariationalRefinementIterations(0)  # it smears the robot's motion into the background
    flow = cv2.GaussianBlur(search.calc(grey[0], grey[1], None), (0, 0), _BLUR_PX)  # type: ignore[call-overload]
    along = geometry.arc_length(points)
    inset = min(_INSET_PX, along[-1] / 2.0)
    inside = geometry.point_at(points, along, np.clip(along, inset, along[-1] - inset))
    x, y = (inside - low).astype(np.float32).T.reshape(2, 1, -1)
    at = cv2.remap(flow, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
    return _smoothed(at, _SMOOTH_POINTS)


class _Look:
    """How a picture looks across a line, and along its end."""

    def __init__(self, image: Image, line: Points) -> None:
        grey = _grey(image)
        self._across = _centred(_profiles(grey, line, _ACROSS_PX), 1)
        self._end = _centred(_profiles(grey, _end(line), _ACROSS_PX), None)

    def matched(self, image: Image, line: Points) -> Points:
        """The line (N, 2), shifted to where another picture looks alike."""
        grey = _grey(image)
        wide = np.arange(_ACROSS_PX[0] - _REACH_PX, _ACROSS_PX[-1] + _REACH_PX + 0.1, _ACROSS_PX[1] - _ACROSS_PX[0])
        shifts = wide[: len(wide) - len(_ACROSS_PX) + 1] - _ACROSS_PX[0]
        for _ in range(_ROUNDS):
            found = _centred(sliding_window_view(_profiles(grey, line, wide), len(_ACROSS_PX), axis=1), 2)
            cost = _smoothed(((found - self._across[:, None]) ** 2).mean(axis=2), 1.5 * _SMOOTH_POINTS) + _TIE * shifts**2
            away = _smoothed(shifts[cost.argmin(axis=1), None], _SMOOTH_POINTS)
            line = line + geometry.normals(line) * away
            end = _end(line)
            ends = [_profiles(grey, end + slide * _tangents(end), _ACROSS_PX) for slide in _SLIDES_PX]
            costs = [((_centred(one, None) - self._end) ** 2).mean() for one in ends] + _TIE * _SLIDES_PX**2
            line = line + _SLIDES_PX[np.argmin(costs)] * _tangents(line)
        return line


def _grey(image: Image) -> NDArray[np.float32]:
    return cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), (0, 0), 1.0).astype(np.float32)


def _tangents(line: Points) -> Points:
    return geometry.normals(line)[:, ::-1] * (1.0, -1.0)


def _end(line: Points) -> Points:
    """The last points of a line, and those beyond it."""
    beyond = line[-1] + np.array(_BEYOND_PX)[:, None] * _tangents(line)[-1]
    return np.concatenate([line, beyond])[-_END_POINTS:]


def _profiles(grey: NDArray[np.float32], line: Points, offsets_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Grey values across a line (N, 2), (N, K)."""
    at = line[:, None] + geometry.normals(line)[:, None] * offsets_px[:, None]
    return geometry.sample(grey, at.reshape(-1, 2)).reshape(at.shape[:2])


def _centred(values: NDArray[np.float64], axis: int | None) -> NDArray[np.float64]:
    return np.asarray(values - values.mean(axis=axis, keepdims=True), np.float64)


def _smoothed(values: NDArray[np.generic], points: float) -> NDArray[np.float64]:
    """Averaged along the line, whose points are the rows."""
    rows = np.ascontiguousarray(values, np.float64)
    return np.asarray(cv2.GaussianBlur(rows, (1, 0), sigmaX=1.0, sigmaY=points, borderType=cv2.BORDER_REPLICATE), np.float64)
