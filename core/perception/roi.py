"""Streams: between two looks at the whole picture only the window around the robot's head is looked at anew.

A phantom stands still under a camera that stands still. Vessel mask, skeleton and graph of the last whole look therefore stay
true, and so does what it saw of the robot's body outside the window; in the window the robot alone is looked for, beside that
vessel. Four things end that: time (``tracking.refresh_s``), a pause in which the head may have left the window, a picture that has
changed elsewhere (a moved phantom, another light, a hand), and a frame without an answer. Then the next look is a whole one.

Streams: a phantom stands still, so its vessel is the mean of several looks at it, each at another mirror image of the picture.

What a network takes for the vessel's wall is off by a bit, in each orientation of the picture by another one. A single picture is
looked at in eight of them at once (``segmentation.Turned``), for which a stream has no time. But its whole looks come one after the
other anyway, and of what does not move the last ones tell together what each of them would tell alone, only better.

Where the picture has changed since, an older look says nothing any more: there the newest one counts.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import TrackingConfig
from core.perception.segmentation import MARGIN_PX, Segmenter, inner_area, robot_beside, window_around
from core.types import Image, Mask, Point, Scene, VesselGraph, Window

CELL_PX = 8
"""Pictures are compared by the means of cells of this size: noise averages out, an edge that moves by 3 px does not."""
CHANGED_LEVELS, MOST_LEVELS = 8.0, 24.0
"""Grey levels of 255. White noise of 20 levels moves a cell's mean by less than 3, but the grain of an X-ray by 7: there it takes
more, up to the second."""
NOISE = 4.0
"""Noise alone hardly makes a cell differ by so many times what they differ by on average."""
NOISE_FRAMES = 64
"""Noise is what two frames in succession have differed by, of so many the lower quartile: what moves for a while does not count."""
CHANGED_SHARE = 0.03
"""Of the cells outside the window. The robot's body, which slides along itself, is less."""


@dataclass(frozen=True, slots=True, eq=False)
class Background:
    """What the last whole look at (h, w) working pixels saw. ``robot_probability`` also holds what the windows since then saw.

    ``captured_s`` is when it was seen, ``head_s`` when the head was seen at ``head``: in the last frame, ``step_s`` after the one
    before, since when it had moved by ``step_px``.
    """

    captured_s: float
    head_s: float
    step_s: float
    step_px: float
    cells: NDArray[np.float32]
    head: Point
    vessel: Mask
    vessel_probability: NDArray[np.float32]
    vessel_skeleton: Mask
    graph: VesselGraph
    robot_probability: NDArray[np.float32]


class RoiSelector:
    """Decides for each frame of a stream whether a window is enough, and which."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self._background: Background | None = None
        self._cells: NDArray[np.float32] | None = None
        self._steps: deque[float] = deque(maxlen=NOISE_FRAMES)
        self._windows = 0
        self._is_due = self._has_changed = False

    def forget(self) -> None:
        """The next look is a whole one."""
        self._background = self._cells = None
        self._steps.clear()

    @property
    def cells(self) -> NDArray[np.float32]:
        """Of the picture of the last ``choose``."""
        assert self._cells is not None
        return self._cells

    @property
    def noise(self) -> float:
        """By how many grey levels cells differ on average where nothing moves; 0 until that is known."""
        return sorted(self._steps)[len(self._steps) // 4] if self._steps else 0.0

    @property
    def is_due(self) -> bool:
        """Whether the last ``choose`` wanted all of it for no other reason than that it was time, after one window at least."""
        return self._is_due

    @property
    def has_changed(self) -> bool:
        """Whether the last ``choose`` saw another picture than the last whole look did."""
        return self._has_changed

    def choose(self, image: Image, captured_s: float, refresh_s: float) -> tuple[Background, Window] | None:
        """The window (x, y, width, height) to look at in a working image and what is known of the rest, or None: all of it.

        `refresh_s`: the last whole look is no older than that.
        """
        last, self._cells = self._cells, cells_of(image)
        if last is not None and last.shape == self._cells.shape:
            self._steps.append(float(differences(last[::2, ::2], self._cells[::2, ::2]).mean()))  # a quarter tells it, too
        self._is_due = self._has_changed = False
        before, side = self._background, self._config.window_px
        height, width = image.shape[:2]
        if before is None or before.vessel.shape != (height, width) or side >= max(height, width):
            return None
        window = window_around(before.head, (width, height), side)
        self._has_changed = has_changed(before.cells, self._cells, window, self.noise)
        age_s = captured_s - before.captured_s
        if age_s < 0.0 or self._has_changed or not self._is_in_sight(before, captured_s, side / 2 - MARGIN_PX):
            return None
        self._is_due = age_s > refresh_s and self._windows > 0
        return (before, window) if age_s <= refresh_s else None

    def _is_in_sight(self, before: Background, captured_s: float, reach_px: float) -> bool:
        """Whether the head must still be in its window.

        A frame that comes late may show it anywhere. On a slow machine every frame comes late after a whole look, but no later than
        the one before: there it counts how far the head moved in such a time.
        """
        passed_s = captured_s - before.head_s
        is_usual = passed_s <= 1.5 * before.step_s and 2.0 * before.step_px <= reach_px
        return is_usual or passed_s * self._config.max_head_speed_px_s <= reach_px

    def remember(self, scene: Scene) -> None:
        """Keep what the frame of the last ``choose`` showed; one without an answer leaves nothing that could be relied on."""
        before = self._background
        self._windows = self._windows + 1 if scene.window is not None else 0
        if scene.pose is None or scene.path is None or scene.masks is None or scene.skeletons is None or scene.vessel_graph is None:
            self._background = None
        elif scene.window is None:
            assert self._cells is not None
            masks, graph = scene.masks, scene.vessel_graph
            self._background = Background(
                scene.captured_s,
                scene.captured_s,
                scene.captured_s - before.head_s if before is not None else 0.0,
                math.dist(scene.path.head, before.head) if before is not None else math.inf,
                self._cells,
                scene.path.head,
                masks.vessel,
                masks.vessel_probability,
                scene.skeletons.vessel,
                graph,
                masks.robot_probability,
            )
        elif before is not None:
            self._background = replace(
                before,
                head_s=scene.captured_s,
                step_s=scene.captured_s - before.head_s,
                step_px=math.dist(scene.path.head, before.head),
                head=scene.path.head,
                robot_probability=scene.masks.robot_probability,
            )


def cells_of(image: Image) -> NDArray[np.float32]:
    """Means (h / 8, w / 8, 3) of the cells of an RGB image."""
    size = max(1, image.shape[1] // CELL_PX), max(1, image.shape[0] // CELL_PX)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def differences(before: NDArray[np.float32], now: NDArray[np.float32]) -> NDArray[np.float32]:
    """By how many grey levels each of the cells (m, n, 3) differs, shape (m, n), but for what all of them do alike."""
    return _sizes((now - before).reshape(-1, 3)).reshape(now.shape[:2])


def _sizes(differences: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of differences (N, 3), which it overwrites, the size of each (N,)."""
    differences -= np.median(differences, axis=0)
    red, green, blue = np.abs(differences).T
    return np.asarray(np.maximum(np.maximum(red, green), blue))  # along so short an axis ``max`` takes five times as long


def has_changed(before: NDArray[np.float32], now: NDArray[np.float32], window: Window, noise: float = 0.0) -> bool:
    """Whether the picture outside the window is another one; a change of brightness or colour of all of it alike does not count.

    Parameters
    ----------
    before, now : cells (h / 8, w / 8, 3) of both pictures.
    window : where changes do not count.
    noise : by how many grey levels cells differ on average without any change.
    """
    if before.shape != now.shape:
        return True
    outside = np.ones(now.shape[:2], np.bool_)
    x, y, width, height = window
    outside[y // CELL_PX : -(-(y + height) // CELL_PX), x // CELL_PX : -(-(x + width) // CELL_PX)] = False
    if not outside.any():
        return True
    size = _sizes((now - before)[outside])
    return float(np.mean(size > changed_level(CHANGED_LEVELS, noise))) > CHANGED_SHARE


def changed_level(levels: float, noise: float) -> float:
    """By how many grey levels a cell must differ to have changed: `levels`, or what `noise` asks for."""
    return min(max(levels, NOISE * noise), MOST_LEVELS)


def look(segment: Segmenter, image: Image, window: Window, known: Background) -> NDArray[np.float32]:
    """The `known` robot's probability (h, w) with the window seen anew; at the window's inner edges the old values stay."""
    x, y, width, height = window
    part = np.s_[y : y + height, x : x + width]
    seen = robot_beside(segment, known.vessel_probability[part], np.ascontiguousarray(image[part]))
    rows, columns = inner_area(window, (image.shape[1], image.shape[0]))
    renewed = known.robot_probability.copy()
    renewed[rows, columns] = seen[rows.start - y : rows.stop - y, columns.start - x : columns.stop - x]
    return renewed


ORIENTATIONS = 4
"""As it is, mirrored, upside down, and both: those that keep the picture's shape, for which the network is compiled."""
GATHERING_S = 0.5
"""Whole looks come so soon after each other until all orientations have been seen."""
STANDING_VESSEL_CHANGED_LEVELS = 5.0
"""A cell has changed that differs by so many grey levels of 255; in a noisy picture it takes more (``glance.NOISE``)."""
ANOTHER_SHARE = 0.5
"""Where more of the cells have changed, the look was at another picture."""
WOBBLE_PX = 5
"""Where two looks at the same vessel differ in a patch wider than this beside what has changed, that is no wall drawn otherwise."""
_AROUND = np.ones((3, 3), np.uint8)
_WOBBLE = np.ones((WOBBLE_PX, WOBBLE_PX), np.uint8)

Map = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """The vessel's probability (h, w), upright, and of every cell of the picture (h / 8, w / 8) its mean (and 3) and whether the
    robot is in it or beside it."""

    vessel: Map
    cells: Map
    robot: Mask


class VesselAverage:
    """The newest whole look in each orientation."""

    def __init__(self) -> None:
        self._looks: dict[int, _Look] = {}
        self._orientation, self._next = 0, 0

    def forget(self) -> None:
        """Nothing is known of the vessel; the next look is at the picture as it is."""
        self._looks.clear()
        self._orientation, self._next = 0, 0

    @property
    def is_gathering(self) -> bool:
        """Whether looks are still to come that would tell more, in orientations not yet seen."""
        return 0 < len(self._looks) < ORIENTATIONS

    def begin(self, *, is_turned: bool) -> None:
        """A whole look: `is_turned`, in the orientation whose turn it is, else at the picture as it is."""
        self._orientation = self._next if is_turned else 0
        if is_turned or self._next == 0:
            self._next = (self._orientation + 1) % ORIENTATIONS

    def turned(self, image: Image) -> Image:
        """The picture (h, w, 3) in that orientation; of the same shape."""
        return np.ascontiguousarray(_turned(image, self._orientation))

    def upright(self, probability: Map) -> Map:
        """What was found in it (h, w), as the picture is."""
        return np.ascontiguousarray(_turned(probability, self._orientation))

    def add(self, vessel: Map, robot: Map, cells: Map, noise: float) -> Map:
        """Keep a look, and return the mean of all that are kept, each where the picture is still what it was.

        Parameters
        ----------
        vessel, robot : probabilities (h, w) that it found, upright.
        cells : of the picture (h / 8, w / 8, 3), see ``glance.cells_of``.
        noise : by how many grey levels cells differ on average without any change.

        Returns
        -------
        The vessel's probability (h, w), a new array.
        """
        newest = _Look(vessel, cells, _robot_cells(robot, cells))
        kept, total, count = {self._orientation: newest}, vessel.copy(), np.ones_like(vessel)
        for orientation, look in self._looks.items():
            if orientation == self._orientation or (weight := _weight(look, newest, noise)) is None:
                continue
            kept[orientation] = look
            total += weight * look.vessel
            count += weight
        self._looks = kept
        return np.asarray(total / count, np.float32)


def _turned(values: NDArray[np.generic], orientation: int) -> NDArray[np.generic]:
    """Mirrored, upside down or both; what undoes it is the same."""
    rows, columns = (slice(None, None, -1) if orientation & bit else slice(None) for bit in (2, 1))
    return values[rows, columns]


def _robot_cells(robot: Map, cells: Map) -> Mask:
    """The cells (h / 8, w / 8) with robot in them, and those around."""
    height, width = cells.shape[:2]
    share = cv2.resize(np.asarray(robot >= np.float32(0.5), np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return cv2.dilate((share > 0.0).view(np.uint8), _AROUND) > 0


def _weight(look: _Look, newest: _Look, noise: float) -> Map | None:
    """How much an older look counts, 0 to 1 at each pixel (h, w), or alike at all (1, 1); None where it was at another picture.

    The robot moves, which does not change the vessel. A change of brightness or colour of all of the picture alike is none.
    """
    if look.vessel.shape != newest.vessel.shape or look.cells.shape != newest.cells.shape:
        return None
    level = changed_level(STANDING_VESSEL_CHANGED_LEVELS, noise)
    has_changed = (differences(look.cells, newest.cells) > level) & ~look.robot & ~newest.robot
    if not has_changed.any():
        return np.ones((1, 1), np.float32)
    if float(np.mean(has_changed)) > ANOTHER_SHARE:
        return None
    changed = cv2.dilate(has_changed.view(np.uint8), _AROUND)
    height, width = newest.vessel.shape
    around = cv2.resize(changed, (width, height), interpolation=cv2.INTER_NEAREST) > 0
    weight = 1.0 - cv2.resize(changed.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    for patch in _differing(look, newest, around):
        weight[patch] = 0.0
    return np.asarray(weight, np.float32)


def _differing(look: _Look, newest: _Look, around: Mask) -> list[Mask]:
    """Patches (h, w) wider than a wall's wobble that one look takes for vessel and the other does not, where they meet `around`,
    what has changed: the clear lumen of a tube that was moved away looks as the board does."""
    half = np.float32(0.5)
    differs = ((look.vessel >= half) != (newest.vessel >= half)).view(np.uint8)
    thick = cv2.erode(differs, _WOBBLE)
    if not thick.any():
        return []
    _, labels = cv2.connectedComponents(cv2.dilate(thick, _WOBBLE), connectivity=8)
    touched = np.unique(labels[around & (labels > 0)]).tolist()
    return [cv2.dilate((labels == label).view(np.uint8), _WOBBLE) > 0 for label in touched]
