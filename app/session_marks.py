"""Where something happened in a recorded session: marks for the timeline, gaps, and places to jump to. No Qt here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from app import palette
from app.language import mark, tr, tr_text
from core.session.events import Event, EventKind
from core.session.row_index import Timeline
from core.study.replay import event_target
from core.types import Point, Scene

_GAP_FACTOR, _LEAST_GAP_S = 4.0, 0.25


class Shape(Enum):
    """Told by shape as well as by colour."""

    FLAG = "flag"
    TRIANGLE = "triangle"
    HOLLOW_TRIANGLE = mark("hollow triangle")
    DIAMOND = "diamond"
    SQUARE = "square"
    RING = "ring"
    CROSS = "cross"


@dataclass(frozen=True, slots=True)
class MarkLook:
    """Word, colour (its role in the palette) and shape of a kind of event; what is drawn later lies above."""

    word: str
    role: str
    shape: Shape

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return palette.of(self.role)


MARK_LOOK: dict[EventKind, MarkLook] = {
    EventKind.DROPPED: MarkLook(mark("dropped"), "FAULT", Shape.CROSS),
    EventKind.LOST: MarkLook(mark("lost by the camera"), "FAULT", Shape.HOLLOW_TRIANGLE),
    EventKind.MODE: MarkLook(mark("mode"), "SKY", Shape.SQUARE),
    EventKind.ALERT: MarkLook(mark("alert"), "YELLOW", Shape.HOLLOW_TRIANGLE),
    EventKind.CLEARED: MarkLook(mark("cleared"), "TEXT_DIM", Shape.HOLLOW_TRIANGLE),
    EventKind.TARGET: MarkLook(mark("target"), "TARGET", Shape.RING),
    EventKind.OVERRIDE: MarkLook(mark("override"), "ORANGE", Shape.DIAMOND),
    EventKind.FAULT: MarkLook(mark("fault"), "FAULT", Shape.TRIANGLE),
    EventKind.NOTE: MarkLook(mark("note"), "TEXT", Shape.FLAG),
}
"""Kinds that have a mark; arming and disarming are told by their mode, the file names of the video by nobody."""
LISTED = tuple(kind for kind in EventKind if kind is not EventKind.VIDEO)


class JumpKind(Enum):
    """What N and P go to, in the order of the chooser."""

    STATE = mark("State change")
    FAULT = mark("Fault")
    OVERRIDE = mark("Override")
    NOTE = mark("Note")
    MODE = mark("Mode")
    TARGET = mark("Target")
    GAP = mark("Gap")
    REPLAY = mark("Difference")
    ANY = mark("Any event")


_EVENTS_OF = {
    JumpKind.FAULT: (EventKind.FAULT,),
    JumpKind.OVERRIDE: (EventKind.OVERRIDE,),
    JumpKind.NOTE: (EventKind.NOTE,),
    JumpKind.MODE: (EventKind.MODE,),
    JumpKind.TARGET: (EventKind.TARGET,),
    JumpKind.ANY: LISTED,
}


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The rows of a session over time. ``times_s`` (N,) from the first row, never going back; ``first_s`` on the recorded clock.

    ``rows`` are the session's row numbers; ``states``, ``modes`` and ``theta_deg`` as in ``Timeline``; ``gaps`` are places before
    which frames are lost. Of a replay: its angles, and the places where it begins to differ.
    """

    first_s: float
    times_s: NDArray[np.float64]
    rows: NDArray[np.int64]
    states: NDArray[np.int8]
    modes: NDArray[np.int8]
    theta_deg: NDArray[np.float64]
    gaps: NDArray[np.int64]
    other_theta_deg: NDArray[np.float64] | None = None
    differs: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def duration_s(self) -> float:
        return float(self.times_s[-1]) if len(self) else 0.0

    def place_at(self, time_s: float) -> int:
        """The row shown at a time from the first row."""
        return max(0, int(np.searchsorted(self.times_s, time_s, side="right")) - 1)


def course_of(line: Timeline) -> Course:
    """What the player needs of a timeline; a clock that went back stands still."""
    if not len(line.time_s):
        none = np.zeros(0, np.int64)
        return Course(0.0, none.astype(np.float64), none, line.state, line.mode, line.theta_deg, none)
    times_s = np.maximum.accumulate(line.time_s) - line.time_s[0]
    steps_s = np.diff(times_s)
    usual_s = float(np.median(steps_s)) if steps_s.size else 0.0
    is_gap = (steps_s > max(_LEAST_GAP_S, _GAP_FACTOR * usual_s)) | (np.diff(line.row) > 1)
    return Course(float(line.time_s[0]), times_s, line.row, line.state, line.mode, line.theta_deg, np.flatnonzero(is_gap) + 1)


def places_of(kind: JumpKind, course: Course, events: Sequence[Event]) -> NDArray[np.int64]:
    """The rows that N and P stop at, in their order."""
    if kind is JumpKind.STATE:
        return np.flatnonzero(np.diff(course.states)) + 1
    if kind is JumpKind.GAP:
        return course.gaps
    if kind is JumpKind.REPLAY:
        return course.differs if course.differs is not None else np.zeros(0, np.int64)
    times_s = np.array([event.time_s for event in events if event.kind in _EVENTS_OF[kind]]) - course.first_s
    if not len(course):
        return np.zeros(0, np.int64)
    # the first row that was captured when it had happened
    return np.unique(np.clip(np.searchsorted(course.times_s, times_s - 1e-6), 0, len(course) - 1))


def neighbour(places: NDArray[np.int64], place: int, step: int) -> int | None:
    """The next one after `place` (`step` 1) or before it (-1); None where there is none."""
    found = places[places > place] if step > 0 else places[places < place]
    if not len(found):
        return None
    return int(found[0] if step > 0 else found[-1])


def target_at(events: Sequence[Event], scene: Scene, time_s: float) -> Point | None:
    """The operator's destination in source pixels: where the route ends, without one what was chosen last until then."""
    if scene.route is not None:
        return scene.to_source(scene.route.target)
    chosen = [event for event in events if event.kind is EventKind.TARGET and event.time_s <= time_s]
    return event_target(chosen[-1]) if chosen else None


def event_line(event: Event) -> str:
    """What happened, in words."""
    word = tr(MARK_LOOK[event.kind].word if event.kind in MARK_LOOK else event.kind.value)
    detail = event.data.get("detail")
    said = event.text if event.kind is EventKind.NOTE else tr_text(event.text)  # a note is the user's own
    text = said + (f" ({tr_text(detail)})" if isinstance(detail, str) and detail else "")
    return f"{word}: {text}" if text else word


def clock_text(time_s: float) -> str:
    """For example "1:02.345", with hours where there are any."""
    ms = max(0, round(time_s * 1000))
    minutes, rest = divmod(ms, 60_000)
    hours, minutes = divmod(minutes, 60)
    front = f"{hours}:{minutes:02d}" if hours else f"{minutes}"
    return f"{front}:{rest // 1000:02d}.{rest % 1000:03d}"
