"""Streams: a phantom stands still, so its vessel is the mean of several looks at it, each at another mirror image of the picture.

What a network takes for the vessel's wall is off by a bit, in each orientation of the picture by another one. A single picture is
looked at in eight of them at once (``segmentation.Turned``), for which a stream has no time. But its whole looks come one after the
other anyway, and of what does not move the last ones tell together what each of them would tell alone, only better.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from core.perception.glance import has_changed
from core.types import Image, Window

ORIENTATIONS = 4
"""As it is, mirrored, upside down, and both: those that keep the picture's shape, for which the network is compiled."""
GATHERING_S = 0.5
"""Whole looks come so soon after each other until all orientations have been seen."""
MOVED_LEVELS, MOVED_SHARE = 5.0, 0.02
"""A vessel that was moved by 2 px must not be taken for one that stands still: on 48 streams of as many looks 94 % of such shifts
were seen, and all of 3 px, but no change where nothing moved but the robot."""
_NOWHERE: Window = (0, 0, 0, 0)

Map = NDArray[np.float32]


class StandingVessel:
    """The last whole looks at a picture that stands still, one in each orientation."""

    def __init__(self) -> None:
        self._looks: deque[Map] = deque(maxlen=ORIENTATIONS)
        self._count = 0
        self._cells: Map | None = None

    def forget(self) -> None:
        """Nothing is known of the vessel; the next look is at the picture as it is."""
        self._looks.clear()
        self._count, self._cells = 0, None

    @property
    def is_gathering(self) -> bool:
        """Whether there are looks that would tell more, in orientations not yet seen."""
        return 0 < len(self._looks) < ORIENTATIONS

    @property
    def is_upright(self) -> bool:
        """Whether the next look is at the picture as it is."""
        return self._count % ORIENTATIONS == 0

    def meet(self, cells: Map) -> None:
        """Before a whole look: `cells` (h / 8, w / 8, 3) of the picture, see ``glance.cells_of``.

        Another picture than that of the first look shows another vessel.
        """
        if self._cells is not None and has_changed(self._cells, cells, _NOWHERE, MOVED_LEVELS, MOVED_SHARE):
            self.forget()
        if self._cells is None:
            self._cells = cells

    def turned(self, image: Image) -> Image:
        """The picture (h, w, 3) in the orientation whose turn it is; of the same shape."""
        return np.ascontiguousarray(_turned(image, self._count))

    def upright(self, probability: Map) -> Map:
        """What was found in it (h, w), as the picture is."""
        return np.ascontiguousarray(_turned(probability, self._count))

    def add(self, vessel_probability: Map) -> Map:
        """Keep what the look found (h, w), upright, and return the mean of all that are kept; the next orientation is due."""
        self._looks.append(vessel_probability)
        self._count += 1
        return np.asarray(sum(self._looks) / np.float32(len(self._looks)), np.float32)


def _turned(values: NDArray[np.generic], orientation: int) -> NDArray[np.generic]:
    """Mirrored, upside down or both; what undoes it is the same."""
    rows, columns = (slice(None, None, -1) if orientation & bit else slice(None) for bit in (2, 1))
    return values[rows, columns]
