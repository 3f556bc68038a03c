"""Streams: between full frames only the region of interest around the robot's head is segmented; the vessel is an average.

Phantom and camera stand still. Vessel mask, skeleton and graph of the last full frame therefore stay valid, and so does the robot's
body outside the region of interest (ROI); inside it only the robot is segmented, given that vessel. The next frame is a full one
after ``tracking.refresh_s``, after a pause in which the head may have left the window, when the picture has changed elsewhere
(moved phantom, other light, a hand), and after a frame without an answer.

A network misplaces the vessel's walls a bit, differently in each orientation of the picture. A single picture is averaged over
eight orientations at once (``segmentation.OrientationAverage``), which a stream has no time for. ``VesselAverage`` uses full frames
that come one after the other, each in another orientation. Where the picture has changed since, only the newest one counts.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import TrackingConfig
from core.perception.segmentation import MARGIN_PX, Probability, Segmenter, inner_area, window_around
from core.types import Image, Mask, Point, Scene, VesselGraph, Window

_Scalar = TypeVar("_Scalar", bound=np.generic)

CELL_PX = 8
"""Pictures are compared by the means of cells of this size: noise averages out, an edge that moves by 3 px does not."""
CHANGED_LEVELS, MAX_CHANGED_LEVELS = 8.0, 24.0
"""Grey levels of 255 by which a changed cell differs. White noise of 20 levels moves a cell's mean by less than 3, but the grain of
an X-ray by 7: there the limit is higher, up to the second value."""
NOISE_FACTOR = 4.0
"""Noise alone hardly makes a cell differ by this many times the mean difference."""
NOISE_FRAMES = 64
"""Noise is the lower quartile of the differences between this many pairs of successive frames: a moving object does not count."""
CHANGED_SHARE = 0.03
"""Of the cells outside the window. The robot's body, which slides along itself, is less."""


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """What the last full frame of (h, w) working pixels showed; ``robot_probability`` is updated by the windows since then.

    ``captured_s`` is the time of the full frame, ``head_s`` that of the last frame, with the head at ``head``; it came ``step_s``
    after the one before, and the head had moved by ``step_px``.
    """

    captured_s: float
    head_s: float
    step_s: float
    step_px: float
    cells: NDArray[np.float32]
    head: Point
    vessel: Mask
    vessel_probability: Probability
    vessel_skeleton: Mask
    graph: VesselGraph
    robot_probability: Probability


class RoiSelector:
    """Decides for each frame of a stream whether a region of interest is enough, and which.

    After ``choose``: ``cells`` are the frame's cells; ``is_due`` says that a full frame was chosen only because it was time, after
    one window at least; ``has_changed`` that the picture differs from the last full frame's.
    """

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._background: Background | None = None
        self.cells: NDArray[np.float32] = np.empty((0, 0, 3), np.float32)
        self._steps: deque[float] = deque(maxlen=NOISE_FRAMES)
        self._windows = 0
        self.is_due = self.has_changed = False

    @property
    def noise(self) -> float:
        """Mean difference of cells, in grey levels, where nothing moves; 0 until that is known."""
        return sorted(self._steps)[len(self._steps) // 4] if self._steps else 0.0

    def choose(self, image: Image, captured_s: float, refresh_s: float) -> tuple[Background, Window] | None:
        """The background and the window (x, y, width, height) to segment in a working image, or None: all of it.

        `refresh_s`: longest time since the last full frame.
        """
        last, self.cells = self.cells, cells_of(image)
        if last.shape == self.cells.shape:
            self._steps.append(float(differences(last[::2, ::2], self.cells[::2, ::2]).mean()))  # a quarter is enough
        self.is_due = self.has_changed = False
        before, side = self._background, self._config.window_px
        height, width = image.shape[:2]
        if before is None or before.vessel.shape != (height, width) or side >= max(height, width):
            return None
        window = window_around(before.head, (width, height), side)
        self.has_changed = has_changed(before.cells, self.cells, window, self.noise)
        age_s = captured_s - before.captured_s
        if age_s < 0.0 or self.has_changed or not self._contains_head(before, captured_s, side / 2 - MARGIN_PX):
            return None
        self.is_due = age_s > refresh_s and self._windows > 0
        return (before, window) if age_s <= refresh_s else None

    def _contains_head(self, before: Background, captured_s: float, reach_px: float) -> bool:
        """Whether the head must still be in its window.

        In a frame that comes late it may be anywhere. On a slow machine every frame comes late after a full frame, but no later
        than the one before: there the distance counts that the head moved in such a time."""
        passed_s = captured_s - before.head_s
        is_usual = passed_s <= 1.5 * before.step_s and 2.0 * before.step_px <= reach_px
        return is_usual or passed_s * self._config.max_head_speed_px_s <= reach_px

    def update(self, scene: Scene) -> None:
        """Keep what the frame of the last ``choose`` showed; a frame without an answer leaves no background."""
        before, masks = self._background, scene.masks
        self._windows = self._windows + 1 if scene.window is not None else 0
        if scene.pose is None or scene.path is None or masks is None or scene.skeletons is None or scene.vessel_graph is None:
            self._background = None
            return
        head = scene.path.head
        step_s = scene.captured_s - before.head_s if before is not None else 0.0
        step_px = math.dist(head, before.head) if before is not None else math.inf
        if scene.window is None:
            self._background = Background(
                captured_s=scene.captured_s,
                head_s=scene.captured_s,
                step_s=step_s,
                step_px=step_px,
                cells=self.cells,
                head=head,
                vessel=masks.vessel,
                vessel_probability=masks.vessel_probability,
                vessel_skeleton=scene.skeletons.vessel,
                graph=scene.vessel_graph,
                robot_probability=masks.robot_probability,
            )
        elif before is not None:
            self._background = replace(
                before,
                head_s=scene.captured_s,
                step_s=step_s,
                step_px=step_px,
                head=head,
                robot_probability=masks.robot_probability,
            )


def cells_of(image: Image) -> NDArray[np.float32]:
    """Means (h / 8, w / 8, 3) of the cells of an RGB image."""
    size = max(1, image.shape[1] // CELL_PX), max(1, image.shape[0] // CELL_PX)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def differences(before: NDArray[np.float32], now: NDArray[np.float32]) -> NDArray[np.float32]:
    """Difference of each of the cells (m, n, 3) in grey levels (m, n), without what all of them have in common."""
    return _sizes((now - before).reshape(-1, 3)).reshape(now.shape[:2])


def _sizes(differences: NDArray[np.float32]) -> NDArray[np.float32]:
    """The size (N,) of differences (N, 3), which it overwrites."""
    differences -= np.median(differences, axis=0)
    red, green, blue = np.abs(differences).T
    return np.asarray(np.maximum(np.maximum(red, green), blue))  # along so short an axis ``max`` takes five times as long


def has_changed(before: NDArray[np.float32], now: NDArray[np.float32], window: Window, noise: float = 0.0) -> bool:
    """Whether the picture outside the window has changed; a common change of brightness or colour does not count.

    `before` and `now` are cells (h / 8, w / 8, 3); `noise` is their mean difference, in grey levels, without any change.
    """
    if before.shape != now.shape:
        return True
    outside = np.ones(now.shape[:2], np.bool_)
    x, y, width, height = window
    outside[y // CELL_PX : -(-(y + height) // CELL_PX), x // CELL_PX : -(-(x + width) // CELL_PX)] = False
    if not outside.any():
        return True
    size = _sizes((now - before)[outside])
    return float(np.mean(size > _changed_level(CHANGED_LEVELS, noise))) > CHANGED_SHARE


def _changed_level(levels: float, noise: float) -> float:
    """Grey levels by which a changed cell differs: `levels`, or more in a noisy picture."""
    return min(max(levels, NOISE_FACTOR * noise), MAX_CHANGED_LEVELS)


def segment_roi(segmenter: Segmenter, image: Image, window: Window, background: Background) -> Probability:
    """The background's robot probability (h, w) with the window segmented again, but for the margin at its inner edges."""
    x, y, width, height = window
    part = np.s_[y : y + height, x : x + width]
    seen = segmenter.segment_robot_beside(background.vessel_probability[part], np.ascontiguousarray(image[part]))
    rows, columns = inner_area(window, (image.shape[1], image.shape[0]))
    renewed = background.robot_probability.copy()
    renewed[rows, columns] = seen[rows.start - y : rows.stop - y, columns.start - x : columns.stop - x]
    return renewed


ORIENTATIONS = 4
"""As it is, mirrored, upside down, and both: those that keep the picture's shape, for which the network is compiled."""
GATHERING_S = 0.5
"""Interval of full frames until all orientations have been segmented."""
AVERAGE_CHANGED_LEVELS = 5.0
"""Grey levels of 255 by which a changed cell differs here; in a noisy picture more (``NOISE_FACTOR``)."""
OTHER_PICTURE_SHARE = 0.5
"""Where more of the cells have changed, it is another picture."""
WOBBLE_PX = 5
"""A patch beside a change, wider than this, in which two segmentations differ, is more than a wall drawn differently."""
_AROUND = np.ones((3, 3), np.uint8)
_WOBBLE = np.ones((WOBBLE_PX, WOBBLE_PX), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _FullFrame:
    """The vessel's probability (h, w), upright; the picture's cells (h / 8, w / 8, 3), and those with the robot in or beside
    them."""

    vessel: Probability
    cells: NDArray[np.float32]
    robot: Mask


class VesselAverage:
    """The mean vessel over the newest full frame in each orientation."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin again, with the picture as it is."""
        self._frames: dict[int, _FullFrame] = {}
        self._orientation, self._next = 0, 0

    @property
    def is_gathering(self) -> bool:
        """Whether some, but not all orientations have been segmented."""
        return 0 < len(self._frames) < ORIENTATIONS

    def begin(self, *, is_turned: bool) -> None:
        """A full frame follows: `is_turned`, in the next orientation, otherwise as it is."""
        self._orientation = self._next if is_turned else 0
        if is_turned or self._next == 0:
            self._next = (self._orientation + 1) % ORIENTATIONS

    def orient(self, values: NDArray[_Scalar]) -> NDArray[_Scalar]:
        """A picture (h, w, 3) or map (h, w) in the current orientation. The same call turns it back."""
        rows, columns = (slice(None, None, -1) if self._orientation & bit else slice(None) for bit in (2, 1))
        return np.ascontiguousarray(values[rows, columns])

    def add(self, vessel: Probability, robot: Probability, cells: NDArray[np.float32], noise: float) -> Probability:
        """Add a full frame, and return the mean of all that are kept, each where the picture has not changed since: (h, w), new.

        Probabilities (h, w) are upright; `cells` (h / 8, w / 8, 3) and `noise` are as in ``has_changed``.
        """
        height, width = cells.shape[:2]
        share = cv2.resize(np.asarray(robot >= np.float32(0.5), np.float32), (width, height), interpolation=cv2.INTER_AREA)
        newest = _FullFrame(vessel, cells, cv2.dilate((share > 0.0).view(np.uint8), _AROUND) > 0)
        kept, total, count = {self._orientation: newest}, vessel.copy(), np.ones_like(vessel)
        for orientation, frame in self._frames.items():
            if orientation == self._orientation or (weight := _weight(frame, newest, noise)) is None:
                continue
            kept[orientation] = frame
            total += weight * frame.vessel
            count += weight
        self._frames = kept
        return np.asarray(total / count, np.float32)


def _weight(frame: _FullFrame, newest: _FullFrame, noise: float) -> NDArray[np.float32] | None:
    """Weight 0 to 1 of an older frame's pixels (h, w), or of all alike (1, 1); None where it shows another picture.

    The robot moves, which does not change the vessel. A common change of brightness or colour does not count.
    """
    if frame.vessel.shape != newest.vessel.shape or frame.cells.shape != newest.cells.shape:
        return None
    level = _changed_level(AVERAGE_CHANGED_LEVELS, noise)
    changed_cells = (differences(frame.cells, newest.cells) > level) & ~frame.robot & ~newest.robot
    if not changed_cells.any():
        return np.ones((1, 1), np.float32)
    if float(np.mean(changed_cells)) > OTHER_PICTURE_SHARE:
        return None
    changed = cv2.dilate(changed_cells.view(np.uint8), _AROUND)
    height, width = newest.vessel.shape
    around = cv2.resize(changed, (width, height), interpolation=cv2.INTER_NEAREST) > 0
    weight = 1.0 - cv2.resize(changed.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    # Patches that only one of both takes for vessel, where they meet a change: the clear lumen of a tube that was moved away looks
    # like the board.
    half = np.float32(0.5)
    differs = ((frame.vessel >= half) != (newest.vessel >= half)).view(np.uint8)
    thick = cv2.erode(differs, _WOBBLE)
    if thick.any():
        _, labels = cv2.connectedComponents(cv2.dilate(thick, _WOBBLE), connectivity=8)
        for label in np.unique(labels[around & (labels > 0)]).tolist():
            weight[cv2.dilate((labels == label).view(np.uint8), _WOBBLE) > 0] = 0.0
    return np.asarray(weight, np.float32)
