"""What is known of a session that is played: rows, events, problems, and what a replay saw. It grows while the session is read.

Where something happened in a recorded session: marks for the timeline, gaps, and places to jump to. No Qt here.

Where playing is: a position that runs with the clock at some speed. No Qt here.

The recorded values of a row that no dial shows, as lines to read and to copy. No Qt here.

What ``replay --jsonl`` wrote, found by the session's rows, so that the player can show it beside the recording. No Qt here.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QTimer, Signal, Slot

from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import refusal_text, signed_degrees
from app.widgets.painting import number
from core.devices import UserError
from core.evaluation.replay import Change, event_target, seen
from core.session.codec import InvalidRecord, PerceivedLine, RecordedRow, read_json, scene_from_json
from core.session.files import lines_of, read_line
from core.session.manifest import Event, EventKind
from core.session.reader import SessionReader, Timeline, losses
from core.types import Point, PoseState, Scene

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


_LARGE_DEG = 5.0
"""A larger change of theta is worth a stop."""


class Replayed:
    """Reads the file once, and single lines of it again when they are shown. ``skipped`` counts lines that cannot be used.

    Raises UserError: not such a file, or another session's.
    """

    def __init__(self, path: Path, session: str) -> None:
        self._path = path
        self._places: dict[int, tuple[int, int]] = {}
        self._values: dict[int, tuple[float, int]] = {}
        self.skipped = 0
        try:
            for line in lines_of(path):
                try:
                    record = read_line(partial(read_json, PerceivedLine), line)
                    row = self._row_of(record.image, session)
                    if record.state is not None and record.theta_signed_deg is None:
                        raise InvalidRecord("theta_signed_deg: missing")
                    state = list(PoseState).index(record.state) if record.state is not None else -1
                    self._values[row] = (math.nan if state < 0 else record.theta_signed_deg or 0.0), state
                    self._places[row] = line.offset, len(line.data or b"")
                except InvalidRecord:
                    self.skipped += 1
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror})") from None
        if not self._places:
            raise UserError(f"{path}: no results in it; write them with: replay SESSION --jsonl FILE")

    def _row_of(self, image: str, session: str) -> int:
        name, _, row = image.rpartition("#")
        if not name or not row.isdecimal():
            raise InvalidRecord("image: not a row of a session")
        if name != session:
            raise UserError(f"{self._path}: results of another session ({name})")
        return int(row)

    def theta_deg(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Signed angles of these rows, NaN where there is none."""
        return np.array([self._values.get(row, (math.nan, -1))[0] for row in rows.tolist()], np.float64)

    def changed(self, rows: NDArray[np.int64], theta_deg: NDArray[np.float64], states: NDArray[np.int8]) -> NDArray[np.int64]:
        """Places of `rows` where a difference begins: another state, a pose lost or gained, or an angle more than 5 degrees off."""
        others = np.array([self._values.get(row, (math.nan, -2))[1] for row in rows.tolist()], np.int64)
        turn = np.abs((self.theta_deg(rows) - theta_deg + 180.0) % 360.0 - 180.0)
        differs = (others != -2) & ((others != states) | (np.nan_to_num(turn) > _LARGE_DEG))
        return np.flatnonzero(differs & ~np.concatenate([[False], differs[:-1]]))

    def scene(self, row: int) -> Scene | None:
        """What was seen of a row, in source pixels; None: nothing, or it is damaged."""
        if row not in self._places:
            return None
        offset, size = self._places[row]
        try:
            with self._path.open("rb") as file:
                file.seek(offset)
                return scene_from_json(file.read(size))
        except (InvalidRecord, OSError):
            return None


def compared_line(before: Scene, after: Scene) -> str:
    """Both in one line, after against before."""
    change = Change(0, 0, 0.0, seen(before), seen(after))
    states = tr("state {before} \N{RIGHTWARDS ARROW} {after}", before=change.before.state or "-", after=change.after.state or "-")
    if after.pose is None:
        return tr("{states}: no pose, {why}", states=states, why=after.refusal)
    line = f"{states}, {tr('theta')} {signed_degrees(after.pose.theta_signed_deg, 1)}"
    if change.theta_deg is not None:
        line += f" ({signed_degrees(change.theta_deg, 1)})"
    return line + (tr(", head {distance:.1f} px away", distance=change.head_px) if change.head_px is not None else "")


_LOOK_MS = 200
_GROWN = 1.2


class KnownSession(QObject):
    """Looks at the reader now and then; the reader reads in a thread of its own.

    ``changed`` says that course or events are others, ``looked`` that it has looked, ``emptied`` why there is nothing to play;
    ``problems_found`` carries all problems, ``said`` a line for people and whether it is a fault.
    """

    changed = Signal()
    looked = Signal()
    emptied = Signal(str)
    problems_found = Signal(object)
    said = Signal(str, bool)

    def __init__(self, reader: SessionReader, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._reader = reader
        self._course = course_of(reader.timeline())
        self._events: tuple[Event, ...] = ()
        self._has_events = False
        self._is_written = False
        self._losses: list[str] | None = None
        self._replayed: Replayed | None = None
        self._problems: list[str] | None = None
        self._is_empty = False
        self._is_whole = False
        self._timer = QTimer(self)
        self._timer.setInterval(_LOOK_MS)
        self._timer.timeout.connect(self._look)

    @property
    def course(self) -> Course:
        """The rows known so far."""
        return self._course

    @property
    def is_whole(self) -> bool:
        """Whether all rows are known."""
        return self._is_whole

    @property
    def events(self) -> tuple[Event, ...]:
        """In the order of their times."""
        return self._events

    def start(self) -> None:
        """Look, and go on looking."""
        self._timer.start()
        self._look()

    def stop(self) -> None:
        self._timer.stop()

    @Slot(object, bool)
    def take_events(self, events: tuple[Event, ...], is_written: bool) -> None:
        """The session's events, and whether it is still being recorded."""
        self._events, self._has_events, self._is_written = events, True, is_written
        if is_written:
            self.said.emit(tr("This session is still being recorded: what came later is not shown"), False)
        self.changed.emit()

    @Slot(object)
    def take_note(self, event: Event) -> None:
        """A note that is kept now."""
        self._events = tuple(sorted((*self._events, event), key=lambda one: one.time_s))
        self.said.emit(tr("Note kept"), False)
        self.changed.emit()

    def compare_with(self, replayed: Replayed) -> None:
        """What a replay saw, beside what was recorded; the course has it from now on."""
        self._replayed = replayed
        if replayed.skipped:
            self.said.emit(tr("{count} results of the replay cannot be read", count=replayed.skipped), True)
        self._course = self._compared(self._course)

    def _compared(self, course: Course) -> Course:
        """With what a replay saw, as far as it is known."""
        replayed = self._replayed
        if replayed is None:
            return course
        differs = replayed.changed(course.rows, course.theta_deg, course.states)
        return replace(course, other_theta_deg=replayed.theta_deg(course.rows), differs=differs)

    @Slot()
    def _look(self) -> None:
        """Rows become known while an hour-long session is being read; problems as they are met."""
        is_all = self._reader.wait(0.0)
        known, shown = len(self._reader), len(self._course)
        # every look costs more the longer the session is: a few of them are enough while it is read
        if known != shown and (is_all or known > _GROWN * shown):
            self._course = self._compared(course_of(self._reader.timeline()))
            self.changed.emit()
        self._is_whole = is_all
        if is_all and not len(self._course) and not self._is_empty:
            self._is_empty = True
            loose = tr("there are pictures, but no rows: repair it with: session recover")
            self.emptied.emit(loose if self._reader.videos else tr("it is empty"))
        self.looked.emit()
        self._tell_problems(is_all=is_all)

    def _tell_problems(self, *, is_all: bool) -> None:
        problems = list(self._reader.problems)
        if is_all and self._has_events and self._losses is None:
            self._losses = losses(self._reader, self._events)  # once: it asks the disk, and a closed session loses no more
        problems += self._losses or []
        missing = self._reader.missing_rows
        if missing:
            problems.append(tr("{count} rows are missing between those that are there", count=missing))
        manifest = self._reader.manifest
        if manifest is not None and manifest.counts.dropped:
            problems.append(tr("{count} frames could not be recorded: the recorder was behind", count=manifest.counts.dropped))
        if manifest is not None and not manifest.closed and self._has_events and not self._is_written:
            problems.append(tr("the session did not end properly; session recover makes a repaired copy"))
        if problems != self._problems:
            self._problems = problems
            self.problems_found.emit(problems)


SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_LONGEST_GAP_S = 2.0
"""Nobody wants to look at a frozen picture for longer: what is lost beyond it is passed over, and said."""


class PlayClock:
    """``position_s`` counts from the first row. ``turn`` is called at any rate while it plays.

    ``passed_s`` tells how much of a gap was passed over in the last turn.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._last_s: float | None = None
        self.position_s = 0.0
        self.speed = 1.0
        self.passed_s = 0.0

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

    def faster(self, step: int) -> float:
        """One speed up or down; returns it."""
        nearest = min(range(len(SPEEDS)), key=lambda k: abs(SPEEDS[k] - self.speed))
        self.speed = SPEEDS[max(0, min(len(SPEEDS) - 1, nearest + step))]
        return self.speed

    def turn(self, course: Course, end_s: float) -> bool:
        """Move on; False when `end_s` is reached, where it pauses."""
        if self._last_s is None:
            return False
        now_s = self._clock()
        place = course.place_at(self.position_s)
        self.position_s += (now_s - self._last_s) * self.speed
        self._last_s = now_s
        self.passed_s = 0.0
        if place + 1 < len(course):
            here_s, next_s = float(course.times_s[place]), float(course.times_s[place + 1])
            if next_s - here_s > _LONGEST_GAP_S and here_s + 0.5 < self.position_s < next_s:
                self.passed_s = next_s - self.position_s
                self.position_s = next_s
        if self.position_s >= end_s:
            self.position_s = end_s
            self.pause()
            return False
        return True


_TENDONS = ("right", "left", "up", "down")
_MOST_LINES = 200


def value_lines(row: RecordedRow) -> list[str]:
    """Frame, latency by stage, robot, drive, and the servo bus as it was."""
    scene, status, drive = row.scene, row.status, row.drive
    camera = tr("{skipped} skipped for newer ones, {lost} lost by the camera", skipped=row.dropped_frames, lost=row.camera_lost)
    dropped = tr("{camera}, {count} by the recorder", camera=camera, count=row.dropped_rows)
    size = f"{row.size[0]} \N{MULTIPLICATION SIGN} {row.size[1]}"
    lines = [
        tr("frame {index} of the camera, captured at {time:.3f} s, {size} px", index=row.index, time=row.captured_s, size=size),
        tr("{rate:.1f} frames per second, {dropped}", rate=row.frames_per_second, dropped=dropped),
    ]
    stages = dict(scene.latency_ms)
    total_ms = stages.pop("total", None)
    if total_ms is not None:
        lines.append(
            tr("perception {total:.1f} ms: ", total=total_ms)
            + ", ".join(f"{tr_text(name)} {ms:.1f}" for name, ms in stages.items())
        )
    if scene.pose is not None:
        lines.append(
            tr(
                "confidence {confidence:.2f}, crossed {crossed}",
                confidence=scene.pose.confidence,
                crossed=tr("yes") if scene.pose.crossed else tr("no"),
            )
        )
    elif scene.refusal is not None:
        lines.append(tr("no pose: {why}", why=refusal_text(scene.refusal)))
    if scene.route_problem:
        lines.append(tr("no way to the target: {why}", why=tr_text(scene.route_problem)))
    if status is not None:
        lines.append(
            tr("insertion {insertion:.1f} mm, sheath {sheath:.1f} mm", insertion=status.insertion_mm, sheath=status.delivery_mm)
        )
        pulls = zip(_TENDONS, status.tendon_pull_mm, status.tendon_force_mn, strict=True)
        lines.append(
            tr("tendons: ")
            + ", ".join(f"{tr_text(name)} {number(pull, 2)} mm {number(force, 0)} mN" for name, pull, force in pulls)
        )
    if drive is not None:
        lines += [
            tr("fault: {cause}: {detail}", cause=tr_text(str(fault.cause)), detail=tr_text(fault.detail)) for fault in drive.active
        ]
        lines += [tr("against arming: {reason}", reason=tr_text(str(reason))) for reason in drive.against_arming]
    if scene.novelty is not None:
        lines.append(tr("distance from the kinds of pictures that the model knows {novelty:.2f}", novelty=scene.novelty))
    if row.bus is not None:
        lines += ["", tr("servo bus"), *_flat(row.bus)]
    return lines[:_MOST_LINES]


def _flat(values: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Plain values of nested ones, each named by its way."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        elif isinstance(value, list) and value and all(isinstance(inner, dict) for inner in value):
            for k, inner in enumerate(value, 1):
                yield from _flat(inner, f"{prefix}{name} {k}.")
        else:
            yield f"{prefix}{name} {value}"
