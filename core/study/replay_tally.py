"""The frames of a replay in sum: of one session, or of many without their frames being kept. Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.study.replay import Change, Seen
from core.types import PoseState

STATES = (*(state.value for state in PoseState), "-")
"""Rows and columns of the table of states; "-": no pose."""
_SIDES = ("before", "after")
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Tally:
    """What is told of many frames. Tallies may be added; medians are of all frames then, not of medians.

    ``theta_deg`` and ``head_px`` are the absolute changes of the frames that have both; ``states`` the table of counts, rows
    before, columns after, in the order of ``STATES``; ``gained`` and ``lost`` refusals by reason; ``confidence`` and ``latency_ms``
    the values before and after.
    """

    frames: int
    theta_deg: Floats
    head_px: Floats
    states: NDArray[np.int64]
    gained: Counter[str]
    lost: Counter[str]
    other_reason: int
    confidence: tuple[Floats, Floats]
    latency_ms: tuple[Floats, Floats]

    @classmethod
    def of(cls, changes: Sequence[Change]) -> Tally:
        """Of the frames of a session; none are allowed."""
        table = np.zeros((len(STATES), len(STATES)), np.int64)
        for change in changes:
            table[STATES.index(change.before.state or "-"), STATES.index(change.after.state or "-")] += 1
        sides = tuple([change.before if name == "before" else change.after for change in changes] for name in _SIDES)
        return cls(
            len(changes),
            _values(abs(c.theta_deg) for c in changes if c.theta_deg is not None),
            _values(c.head_px for c in changes if c.head_px is not None),
            table,
            Counter(c.after.reason.value for c in changes if c.before.state is not None and c.after.reason is not None),
            Counter(c.before.reason.value for c in changes if c.after.state is not None and c.before.reason is not None),
            sum(c.kind == "other reason" for c in changes),
            (_confidence(sides[0]), _confidence(sides[1])),
            (_latency_ms(sides[0]), _latency_ms(sides[1])),
        )

    def __add__(self, other: Tally) -> Tally:
        return Tally(
            self.frames + other.frames,
            np.concatenate([self.theta_deg, other.theta_deg]),
            np.concatenate([self.head_px, other.head_px]),
            self.states + other.states,
            self.gained + other.gained,
            self.lost + other.lost,
            self.other_reason + other.other_reason,
            _joined(self.confidence, other.confidence),
            _joined(self.latency_ms, other.latency_ms),
        )

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values; None where there is nothing to count.

        Returns
        -------
        dict
            ``frames``; ``theta_change_deg`` and ``head_shift_px`` (n, mean, median, p95, max of the absolute change, source
            pixels); ``states`` with ``labels``, ``matrix`` (rows before, columns after, "-" is no pose) and ``changed``;
            ``refusals`` gained and lost by reason; ``confidence`` and ``latency_ms`` before and after.
        """
        return {
            "frames": self.frames,
            "theta_change_deg": _spread(self.theta_deg),
            "head_shift_px": _spread(self.head_px),
            "states": {
                "labels": list(STATES),
                "matrix": self.states.tolist(),
                "changed": int(self.states.sum() - np.trace(self.states)),
            },
            "refusals": {
                "gained": dict(self.gained.most_common()),
                "lost": dict(self.lost.most_common()),
                "other_reason": self.other_reason,
            },
            "confidence": {name: _median(values) for name, values in zip(_SIDES, self.confidence, strict=True)},
            "latency_ms": {name: _spread(values) for name, values in zip(_SIDES, self.latency_ms, strict=True)},
        }


def _confidence(side: Sequence[Seen]) -> Floats:
    return _values(seen.confidence for seen in side if seen.state is not None)


def _latency_ms(side: Sequence[Seen]) -> Floats:
    return _values(seen.total_ms for seen in side if seen.total_ms is not None)


def _values(values: Iterable[float]) -> Floats:
    return np.fromiter(values, np.float64)


def _joined(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])


def _spread(values: Floats) -> dict[str, Any]:
    if not values.size:
        return {"n": 0, "mean": None, "median": None, "p95": None, "max": None}
    median, p95 = np.percentile(values, (50, 95))
    numbers = {"mean": values.mean(), "median": median, "p95": p95, "max": values.max()}
    return {"n": int(values.size)} | {name: round(float(value), 4) for name, value in numbers.items()}


def _median(values: Floats) -> float | None:
    return round(float(np.median(values)), 4) if values.size else None
