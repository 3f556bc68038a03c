"""Time in a recorded session, without Qt: its rows as a course, marks of events, places to jump to, the clock that plays."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import refusal_text
from app.widgets.painting import number
from core.evaluation.rehearsal import RehearsalResult, place_beside
from core.evaluation.replay import event_target
from core.session.codec import RecordedRow
from core.session.manifest import Event, EventKind
from core.session.reader import Timeline
from core.session.values import tendon_names
from core.types import Point, Scene

_GAP_FACTOR, _LEAST_GAP_S = 4.0, 0.25
"""A gap is longer than so many usual steps, and than so many seconds."""
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_LONGEST_GAP_S = 2.0
"""Longer gaps are skipped while playing."""
_MOST_LINES = 200
"""Of recorded values."""


class Shape(Enum):
    """Of a mark: kinds differ by shape as well as by colour."""

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
        return theme.of(self.role)


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
"""Kinds that have a mark: arming and disarming show as modes, the file names of the video are not shown."""
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
    """The rows of a session over time: ``times_s`` (N,) from the first row, monotonic; ``first_s`` on the recorded clock.

    ``rows`` are the session's row numbers; ``states``, ``modes`` and ``theta_deg`` as in ``Timeline``; ``gaps`` are places before
    which frames are lost. Of a replay: its angles, and the places where it begins to differ. ``by_hand`` (M, 2) has the times and
    signed angles of annotated frames.
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
    by_hand: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def duration_s(self) -> float:
        return float(self.times_s[-1]) if len(self) else 0.0

    def place_at(self, time_s: float) -> int:
        """The row shown at a time from the first row."""
        return max(0, int(np.searchsorted(self.times_s, time_s, side="right")) - 1)


def course_of(line: Timeline) -> Course:
    """The course of a timeline; where its clock goes back, time stands still."""
    if not len(line.time_s):
        none = np.zeros(0, np.int64)
        return Course(0.0, none.astype(np.float64), none, line.state, line.mode, line.theta_deg, none)
    times_s = np.maximum.accumulate(line.time_s) - line.time_s[0]
    steps_s = np.diff(times_s)
    usual_s = float(np.median(steps_s)) if steps_s.size else 0.0
    is_gap = (steps_s > max(_LEAST_GAP_S, _GAP_FACTOR * usual_s)) | (np.diff(line.row) > 1)
    return Course(float(line.time_s[0]), times_s, line.row, line.state, line.mode, line.theta_deg, np.flatnonzero(is_gap) + 1)


def places_of(kind: JumpKind, course: Course, events: Sequence[Event]) -> NDArray[np.int64]:
    """The rows that N and P stop at, ascending."""
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
    """The next one after `place` (`step` 1) or before it (-1); None without one."""
    found = places[places > place] if step > 0 else places[places < place][::-1]
    return int(found[0]) if len(found) else None


def target_at(events: Sequence[Event], scene: Scene, time_s: float) -> Point | None:
    """The operator's target in source pixels: where the route ends, without one what was chosen last until then."""
    if scene.route is not None:
        return scene.to_source(scene.route.target)
    chosen = chosen_at(events, time_s)
    return event_target(chosen) if chosen is not None else None


def chosen_at(events: Sequence[Event], time_s: float) -> Event | None:
    """The newest choice of a target at a time on the recorded clock."""
    return next((event for event in reversed(events) if event.kind is EventKind.TARGET and event.time_s <= time_s), None)


def event_line(event: Event) -> str:
    """What happened, in words."""
    word = tr(MARK_LOOK[event.kind].word if event.kind in MARK_LOOK else event.kind.value)
    detail = event.data.get("detail")
    text = event.text if event.kind is EventKind.NOTE else tr_text(event.text)  # a note is the user's own
    text += f" ({tr_text(detail)})" if isinstance(detail, str) and detail else ""
    return f"{word}: {text}" if text else word


def clock_text(time_s: float) -> str:
    """For example "1:02.345", with hours where there are any."""
    ms = max(0, round(time_s * 1000))
    minutes, rest = divmod(ms, 60_000)
    hours, minutes = divmod(minutes, 60)
    front = f"{hours}:{minutes:02d}" if hours else f"{minutes}"
    return f"{front}:{rest // 1000:02d}.{rest % 1000:03d}"


class PlayClock:
    """A position that runs with the clock at some speed. ``position_s`` counts from the first row; ``advance`` is called often.

    ``skipped_s`` tells how much of a gap the last call skipped.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._last_s: float | None = None
        self.position_s = 0.0
        self.speed = 1.0
        self.skipped_s = 0.0

    @property
    def is_playing(self) -> bool:
        return self._last_s is not None

    def play(self) -> None:
        self._last_s = self._clock()

    def pause(self) -> None:
        self._last_s = None

    def seek(self, position_s: float) -> None:
        """Go on from here, playing or not."""
        self.position_s = max(0.0, position_s)
        if self._last_s is not None:
            self._last_s = self._clock()

    def change_speed(self, step: int) -> float:
        """One speed up or down; returns it."""
        nearest = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - self.speed))
        self.speed = SPEEDS[max(0, min(len(SPEEDS) - 1, nearest + step))]
        return self.speed

    def advance(self, course: Course, end_s: float) -> bool:
        """Move on; False when `end_s` is reached, where it pauses."""
        if self._last_s is None:
            return False
        now_s = self._clock()
        place = course.place_at(self.position_s)
        self.position_s += (now_s - self._last_s) * self.speed
        self._last_s = now_s
        self.skipped_s = 0.0
        if place + 1 < len(course):
            here_s, next_s = float(course.times_s[place]), float(course.times_s[place + 1])
            if next_s - here_s > _LONGEST_GAP_S and here_s + 0.5 < self.position_s < next_s:
                self.skipped_s = next_s - self.position_s
                self.position_s = next_s
        if self.position_s >= end_s:
            self.position_s = end_s
            self.pause()
            return False
        return True


def value_lines(row: RecordedRow, rehearsal: RehearsalResult | None = None) -> list[str]:
    """The recorded values of a row that no dial shows: rehearsal, frame, latency by stage, robot, drive, servo bus."""
    scene, status, drive = row.scene, row.status, row.drive
    camera = tr("{skipped} skipped for newer ones, {lost} lost by the camera", skipped=row.dropped_frames, lost=row.camera_lost)
    dropped = tr("{camera}, {count} by the recorder", camera=camera, count=row.dropped_rows)
    size = f"{row.size[0]} \N{MULTIPLICATION SIGN} {row.size[1]}"
    lines = [
        tr("frame {index} of the camera, captured at {time:.3f} s, {size} px", index=row.index, time=row.captured_s, size=size),
        tr("{rate:.1f} frames per second, {dropped}", rate=row.frames_per_second, dropped=dropped),
    ]
    if rehearsal is not None and scene.path is not None:
        lines.insert(0, beside_line(rehearsal, scene.to_source(scene.path.head)))
    stages = dict(scene.latency_ms)
    total_ms = stages.pop("total", None)
    if total_ms is not None:
        named = ", ".join(f"{tr_text(name)} {ms:.1f}" for name, ms in stages.items())
        lines.append(tr("perception {total:.1f} ms: ", total=total_ms) + named)
    if scene.pose is not None:
        crossed = tr("yes") if scene.pose.crossed else tr("no")
        lines.append(tr("confidence {confidence:.2f}, crossed {crossed}", confidence=scene.pose.confidence, crossed=crossed))
    elif scene.refusal is not None:
        lines.append(tr("no pose: {why}", why=refusal_text(scene.refusal)))
    if scene.route_problem:
        lines.append(tr("no way to the target: {why}", why=tr_text(scene.route_problem)))
    if status is not None:
        inserted, sheath = status.insertion_mm, status.delivery_mm
        lines.append(tr("insertion {insertion:.1f} mm, sheath {sheath:.1f} mm", insertion=inserted, sheath=sheath))
        pulls = zip(tendon_names(len(status.tendon_pull_mm)), status.tendon_pull_mm, status.tendon_force_mn, strict=True)
        told = [f"{tr_text(name)} {number(pull, 2)} mm {number(force, 0)} mN" for name, pull, force in pulls]
        lines.append(tr("tendons: ") + ", ".join(told))
    if drive is not None:
        for fault in drive.active:
            lines.append(tr("fault: {cause}: {detail}", cause=tr_text(str(fault.cause)), detail=tr_text(fault.detail)))
        lines += [tr("against arming: {reason}", reason=tr_text(str(reason))) for reason in drive.against_arming]
    if scene.novelty is not None:
        lines.append(tr("distance from the kinds of pictures that the model knows {novelty:.2f}", novelty=scene.novelty))
    if row.bus is not None:
        lines += ["", tr("servo bus"), *_flattened(row.bus)]
    return lines[:_MOST_LINES]


def beside_line(rehearsal: RehearsalResult, head: Point) -> str:
    """The head beside what was rehearsed."""
    beside = place_beside(rehearsal, head)
    if beside is None:
        return tr("rehearsal: the head is not on the way yet")
    if beside.outside_px > 0.0:
        where = tr("{px:.0f} px outside the band", px=beside.outside_px)
    else:
        where = tr("within the band")
    return tr(
        "rehearsal: {where}, {along:.0f} mm in; the runs were there after {time:.1f} s, with up to {force:.2f} N at the wall",
        where=where,
        along=beside.along_mm,
        time=beside.time_s[1],
        force=beside.wall_force_n,
    )


def _flattened(values: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Plain values of nested ones, each with its path as name."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flattened(value, f"{prefix}{name}.")
        elif isinstance(value, list) and value and all(isinstance(inner, dict) for inner in value):
            for k, inner in enumerate(value, 1):
                yield from _flattened(inner, f"{prefix}{name} {k}.")
        else:
            yield f"{prefix}{name} {value}"
