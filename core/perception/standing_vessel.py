"""Streams: a phantom stands still, so its vessel is the mean of several looks at it, each at another mirror image of the picture.

What a network takes for the vessel's wall is off by a bit, in each orientation of the picture by another one. A single picture is
looked at in eight of them at once (``segmentation.Turned``), for which a stream has no time. But its whole looks come one after the
other anyway, and of what does not move the last ones tell together what each of them would tell alone, only better.

Where the picture has changed since, an older look says nothing any more: there the newest one counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.perception.glance import changed_level, differences
from core.types import Image, Mask

ORIENTATIONS = 4
"""As it is, mirrored, upside down, and both: those that keep the picture's shape, for which the network is compiled."""
GATHERING_S = 0.5
"""Whole looks come so soon after each other until all orientations have been seen."""
CHANGED_LEVELS = 5.0
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


class StandingVessel:
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
    level = changed_level(CHANGED_LEVELS, noise)
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
