"""How steady an answer is: what becomes of theta and head when the masks are drawn a little wider or narrower.

A mask's edge is where a probability passes one half, and another number would do about as well. An answer that hangs on it is more
often wrong than one that does not: no sign that can be read off the masks themselves tells as much (docs/method.md).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from core.types import Masks, Point

_STEP = 0.7
"""Of the probabilities' logit: as if the edges were drawn at 0.33 or at 0.67."""
_WAYS = ((1, 1), (-1, -1), (1, -1), (-1, 1))
"""Vessel and robot wider and narrower, together and against each other."""
_MOST_DEG, _MOST_PX = 10.0, 20.0
"""What an answer that is lost counts for; one that is altogether different is no worse."""

Answer = tuple[Point, float]
"""Head (x, y) in working px and signed theta in degrees."""


def neighbours(masks: Masks) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Probabilities (h, w) of vessel and robot whose edges lie a little farther out or in, all four ways."""
    for vessel, robot in _WAYS:
        yield _shifted(masks.vessel_probability, vessel * _STEP), _shifted(masks.robot_probability, robot * _STEP)


def _shifted(probability: NDArray[np.float32], step: float) -> NDArray[np.float32]:
    """The probability whose logit is larger by `step`."""
    odds = np.float32(math.exp(step))
    return np.asarray(odds * probability / (1 + (odds - 1) * probability), np.float32)


def swings(answer: Answer, others: Sequence[Answer | None]) -> tuple[float, float]:
    """Means of log(1 + degrees) and log(1 + px) by which `others` differ from the answer in theta and head; None: no answer."""
    turns, ways = [], []
    for other in others:
        if other is None:
            turns.append(_MOST_DEG)
            ways.append(_MOST_PX)
            continue
        turns.append(min(abs((other[1] - answer[1] + 180.0) % 360.0 - 180.0), _MOST_DEG))
        ways.append(min(math.dist(answer[0], other[0]), _MOST_PX))
    return float(np.log1p(turns).mean()), float(np.log1p(ways).mean())
