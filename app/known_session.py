"""What is known of a session that is played: rows, events, problems, and what a replay saw. It grows while the session is read."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QObject, QTimer, Signal, Slot

from app.language import tr
from app.replayed import Replayed
from app.session_marks import Course, course_of
from core.session.completeness import losses
from core.session.events import Event
from core.session.reader import SessionReader

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
