"""Two perceptions of the same frames, compared: what was recorded (before) and what is perceived now (after). Pure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from core.session.events import Event, EventKind
from core.session.recorded import RecordedRow
from core.types import Point, PoseState, Reason, Scene

_NO_POSE_DEG = 180.0


@dataclass(frozen=True, slots=True)
class Seen:
    """What one perception says of a frame. ``head`` is in source pixels; one of ``theta_signed_deg`` and ``reason`` is set."""

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
    before: Seen
    after: Seen

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


def seen(scene: Scene) -> Seen:
    """What a scene says."""
    pose, path = scene.pose, scene.path
    return Seen(
        pose.theta_signed_deg if pose else None,
        scene.to_source(path.head) if path else None,
        pose.state if pose else None,
        pose.confidence if pose else 0.0,
        scene.refusal.reason if scene.refusal else None,
        scene.refusal.detail if scene.refusal else "",
        scene.latency_ms.get("total"),
    )


class RecordedTargets:
    """The operator's destination of each recorded frame, in source pixels.

    A row that was perceived as far as its path tells it for sure: its route ends there. Where there is none, the events say what
    was chosen last. ``of`` takes the rows in their order.
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


_TEXT_OF_TARGET = re.compile(r"(-?\d+\.\d), (-?\d+\.\d)")


def event_target(event: Event) -> Point | None:
    """The destination that a target event tells, in source pixels; None: it was cleared, or it is damaged.

    Windows have written it as text alone, "x, y", up to November 2026.
    """
    place = event.data.get("xy")
    if place is None and (written := _TEXT_OF_TARGET.fullmatch(event.text)):
        place = [float(value) for value in written.groups()]
    is_point = isinstance(place, list) and len(place) == 2 and all(type(value) in (int, float) for value in place)
    return (float(place[0]), float(place[1])) if is_point and place is not None else None


def changed_most(changes: Sequence[Change], count: int) -> list[Change]:
    """The frames that changed most, largest first; equal ones in their order. Frames that say the same are left out."""
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
