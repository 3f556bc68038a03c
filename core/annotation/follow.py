"""Lines drawn on single pictures of a clip, followed through the others by optical flow (OpenCV's DIS).

Camera and phantom do not move: the vessel's line stays, the robot's moves with the flow. Each picture is followed from the nearest
one with lines of its own, forwards or backwards, so that a correction begins the following again.

On six clips of the twin, 60 pictures after the drawn one, the robot's direction was off by 1.5 to 10 degrees (median 3.8), and the
head by 3 to 7 px in four and 24 and 37 px in two clips: on a plain body the flow sees little of the motion along it, so that long
clips need corrections. Comparing each picture with the one before gave 9.3 degrees, variational refinement 6.2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import cv2
import numpy as np
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


def followed_lines(
    read: Callable[[int], Image], keys: Mapping[int, Annotation], count: int, go_on: Callable[[], bool] = lambda: True
) -> Iterator[tuple[int, Line, Line]]:
    """The lines of robot and vessel of all pictures without lines of their own.

    Parameters
    ----------
    read : the n-th of the `count` pictures of a clip, RGB (H, W, 3), all of one size. Raises ImageError, which goes through.
    keys : by place, pictures with lines of their own, at least one.
    go_on : asked before each picture; when it is False, no more come.
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
    for number, place in enumerate(way, 1):
        image = read(place)
        moved = base + _flow_at(anchor, image, base)
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
    smooth = cv2.GaussianBlur(at[:, None], (1, 0), sigmaX=1.0, sigmaY=_SMOOTH_POINTS, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(smooth[:, 0], np.float64)
