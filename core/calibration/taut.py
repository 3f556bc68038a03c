"""Where a wire becomes taut: the head stays where it is while the wire is slack, and then goes with it. Pure.

Sideways the way of the head grows with the pull; out of the picture's plane what is seen is the shortening, which grows with its
square. The root makes a line of that, too, and where the line starts the wire is taut: no threshold for the first twitch to pass.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.calibration.look import HeadMove
from core.errors import UserError

_LEAST_SIDEWAYS_PX, _LEAST_SHORTENING_PX = 1.2, 0.25
_ENOUGH_SIDEWAYS_PX, _ENOUGH_SHORTENING_PX = 5.0, 1.4
_LEAST_POINTS = 2
_STARTS = 401


class NeverTaut(UserError):
    """The head did not follow the wire, or the wire was never slack: nobody can tell where it becomes taut."""


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """The servo at ``position_mm`` (positive tightens), and what the head has done since the wire was slack."""

    position_mm: float
    move: HeadMove


def is_enough(step: Step) -> bool:
    """Whether the head has gone so far that the start can be told; pulling on would only strain the wire."""
    return abs(step.move.lateral_px) >= _ENOUGH_SIDEWAYS_PX or -step.move.longer_px >= _ENOUGH_SHORTENING_PX


def is_begun(step: Step) -> bool:
    """Whether the head has begun to follow."""
    return abs(step.move.lateral_px) >= _LEAST_SIDEWAYS_PX or -step.move.longer_px >= _LEAST_SHORTENING_PX


def taut_at_mm(steps: Sequence[Step]) -> float:
    """The position at which the wire becomes taut.

    Parameters
    ----------
    steps : from slack to pulled, in that order.

    Raises
    ------
    NeverTaut
        Fewer than two steps moved the head, or all of them did: then it was taut somewhere before the first.
    """
    sideways = max(abs(step.move.lateral_px) for step in steps) >= _ENOUGH_SIDEWAYS_PX
    least = _LEAST_SIDEWAYS_PX if sideways else math.sqrt(_LEAST_SHORTENING_PX)
    ways = [abs(step.move.lateral_px) if sideways else math.sqrt(max(0.0, -step.move.longer_px)) for step in steps]
    # From the first step on after which the head always follows: one bad look before does not count.
    first = len(ways)
    while first > 0 and ways[first - 1] >= least:
        first -= 1
    if len(ways) - first < _LEAST_POINTS:
        raise NeverTaut("the head does not follow the wire: is it hung in, does the head lie free? Or zero it by eye")
    if first == 0:
        raise NeverTaut("the wire was taut before it was pulled: loosen it, then try again, or zero it by eye")
    at = np.array([step.position_mm for step in steps])
    if np.polyfit(at[first:], np.array(ways[first:]), 1)[0] <= 0.0:
        raise NeverTaut("the head does not follow the wire's pull: pull it by hand, or zero it by eye")
    # A root makes much of the little that noise does while the wire is slack; and the last step before may show some of its way.
    slack = first - 1
    told = np.array([0.0] * slack + ways[first:])
    return _start_of_line(np.concatenate([at[:slack], at[first:]]), told, float(at[first]))


def _start_of_line(at: NDArray[np.float64], ways: NDArray[np.float64], latest: float) -> float:
    """Where the line starts that is 0 up to there and then rises, by least squares over all steps; `latest` at the latest.

    The steps before tell as much as those after: seen in pixels the head goes by half a pixel at a time, and a line through the few
    steps after the first of these would start anywhere.
    """
    starts = np.linspace(min(at[0], latest), latest, _STARTS)
    beyond = np.maximum(0.0, at[None, :] - starts[:, None])
    slopes = beyond @ ways / np.maximum((beyond**2).sum(axis=1), 1e-12)
    left_over = ((ways[None, :] - slopes[:, None] * beyond) ** 2).sum(axis=1)
    return float(starts[np.argmin(left_over)])
