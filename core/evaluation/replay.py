"""Two perceptions of the same frames, compared: what was recorded (before) and what is perceived now (after)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.session.codec import RecordedRow
from core.session.manifest import Event, EventKind
from core.types import Point, PoseState, Reason, Scene

_NO_POSE_DEG = 180.0  # size of a change by which a pose was lost or gained


@dataclass(frozen=True, slots=True)
class FrameResult:
    """The result of one perception of a frame. ``head`` is in source pixels; one of ``theta_signed_deg`` and ``reason`` is set."""

    theta_signed_deg: float | None = None
    head: Point | None = None
    state: PoseState | None = None
    confidence: float = 0.0
    reason: Reason | None = None
    detail: str = ""
    total_ms: float | None = None


@dataclass(frozen=True, slots=True)
class Change:
    """One frame before and after. ``row`` counts in the session, ``index`` is the camera's, ``time_s`` from the first row."""

    row: int
    index: int
    time_s: float
    before: FrameResult
    after: FrameResult

    @property
    def theta_deg(self) -> float | None:
        """After minus before, the short way round, in (-180, 180]; None unless both have a pose."""
        first, second = self.before.theta_signed_deg, self.after.theta_signed_deg
        if first is None or second is None:
            return None
        turn = (second - first) % 360.0
        return turn - 360.0 if turn > 180.0 else turn

    @property
    def head_px(self) -> float | None:
        """How far the head moved, in source pixels; None unless both have one."""
        first, second = self.before.head, self.after.head
        return math.dist(first, second) if first is not None and second is not None else None

    @property
    def kind(self) -> str:
        """In a word: what happened to the pose."""
        if self.before.state is None and self.after.state is None:
            return "same reason" if self.before.reason is self.after.reason else "other reason"
        if self.after.state is None:
            return "pose lost"
        if self.before.state is None:
            return "pose gained"
        return "same state" if self.before.state is self.after.state else "other state"

    @property
    def size_deg(self) -> float:
        """By which the frames that changed most are found: the change of theta; a pose lost or gained counts as half a turn."""
        if self.kind in ("pose lost", "pose gained"):
            return _NO_POSE_DEG
        return abs(self.theta_deg or 0.0)


def frame_result(scene: Scene) -> FrameResult:
    """The result of a scene."""
    pose, path = scene.pose, scene.path
    return FrameResult(
        pose.theta_signed_deg if pose else None,
        scene.to_source(path.head) if path else None,
        pose.state if pose else None,
        pose.confidence if pose else 0.0,
        scene.refusal.reason if scene.refusal else None,
        scene.refusal.detail if scene.refusal else "",
        scene.latency_ms.get("total"),
    )


class RecordedTargets:
    """The operator's target of each recorded frame, in source pixels.

    A route ends there; where a row has no route, the newest event says what was chosen. ``of`` takes the rows in their order.
    """

    def __init__(self, events: Iterable[Event]) -> None:
        self._chosen = [(event.time_s, event_target(event)) for event in events if event.kind is EventKind.TARGET]
        self._next = 0
        self._target: Point | None = None

    def of(self, row: RecordedRow) -> Point | None:
        scene = row.scene
        while self._next < len(self._chosen) and self._chosen[self._next][0] <= row.captured_s:
            self._target = self._chosen[self._next][1]
            self._next += 1
        if scene.route is not None:
            self._target = scene.to_source(scene.route.target)
        elif scene.path is not None and not scene.route_problem:
            return None
        return self._target


def event_target(event: Event) -> Point | None:
    """The target that a target event tells, in source pixels; None: it was cleared, or it is damaged."""
    place = event.data.get("xy")
    is_point = isinstance(place, list) and len(place) == 2 and all(type(value) in (int, float) for value in place)
    return (float(place[0]), float(place[1])) if is_point and place is not None else None


def changed_most(changes: Sequence[Change], count: int) -> list[Change]:
    """The frames that changed most, largest first; equal ones in their order. Frames with equal results are left out."""
    differing = [c for c in changes if c.kind not in ("same state", "same reason") or c.size_deg > 0.0 or (c.head_px or 0.0) > 0.0]
    return sorted(differing, key=lambda c: (-c.size_deg, -(c.head_px or 0.0), c.row))[:count]


@dataclass(frozen=True, slots=True)
class Run:
    """Frames in a row, first to last row, whose pose was lost or gained for one reason."""

    kind: str
    reason: str
    first: int
    last: int

    @property
    def frames(self) -> int:
        return self.last - self.first + 1


def runs(changes: Sequence[Change]) -> list[Run]:
    """Where poses were lost and gained, as runs of frames in their order."""
    found: list[Run] = []
    for change in changes:
        if change.kind not in ("pose lost", "pose gained"):
            continue
        told_by = change.after if change.kind == "pose lost" else change.before
        reason = told_by.reason.value if told_by.reason is not None else ""
        last = found[-1] if found else None
        if last is not None and (last.kind, last.reason, last.last) == (change.kind, reason, change.row - 1):
            found[-1] = Run(last.kind, reason, last.first, change.row)
        else:
            found.append(Run(change.kind, reason, change.row, change.row))
    return found


STATES = (*(state.value for state in PoseState), "-")
"""Rows and columns of the table of states; "-": no pose."""
_SIDES = ("before", "after")
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ReplayTally:
    """Sums over many frames. Tallies may be added; medians are of all frames then, not of medians.

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
    confidence: tuple[Floats, ...]
    latency_ms: tuple[Floats, ...]

    @classmethod
    def of(cls, changes: Sequence[Change]) -> ReplayTally:
        """Of the frames of a session; none are allowed."""
        table = np.zeros((len(STATES), len(STATES)), np.int64)
        for change in changes:
            table[STATES.index(change.before.state or "-"), STATES.index(change.after.state or "-")] += 1
        before, after = [change.before for change in changes], [change.after for change in changes]
        return cls(
            len(changes),
            _values(abs(c.theta_deg) for c in changes if c.theta_deg is not None),
            _values(c.head_px for c in changes if c.head_px is not None),
            table,
            Counter(c.after.reason.value for c in changes if c.before.state is not None and c.after.reason is not None),
            Counter(c.before.reason.value for c in changes if c.after.state is not None and c.before.reason is not None),
            sum(c.kind == "other reason" for c in changes),
            tuple(_values(one.confidence for one in side if one.state is not None) for side in (before, after)),
            tuple(_values(one.total_ms for one in side if one.total_ms is not None) for side in (before, after)),
        )

    def __add__(self, other: ReplayTally) -> ReplayTally:
        return ReplayTally(
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

        Returns ``frames``; ``theta_change_deg`` and ``head_shift_px`` (n, mean, median, p95, max of the absolute change, source
        pixels); ``states`` with ``labels``, ``matrix`` (rows before, columns after, "-" is no pose) and ``changed``; ``refusals``
        gained and lost by reason; ``confidence`` and ``latency_ms`` before and after.
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


def _values(values: Iterable[float]) -> Floats:
    return np.fromiter(values, np.float64)


def _joined(first: tuple[Floats, ...], second: tuple[Floats, ...]) -> tuple[Floats, ...]:
    return tuple(np.concatenate(pair) for pair in zip(first, second, strict=True))


def _spread(values: Floats) -> dict[str, Any]:
    if not values.size:
        return {"n": 0, "mean": None, "median": None, "p95": None, "max": None}
    median, p95 = np.percentile(values, (50, 95))
    numbers = {"mean": values.mean(), "median": median, "p95": p95, "max": values.max()}
    return {"n": int(values.size)} | {name: round(float(value), 4) for name, value in numbers.items()}


def _median(values: Floats) -> float | None:
    return round(float(np.median(values)), 4) if values.size else None
