"""The session that is played: its rows, events and problems, which become known while it is read; notes and snapshots."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QTimer, Signal

from app.player.course import Course, course_of
from app.player.replayed import Replayed
from app.ui.i18n import tr, tr_text
from app.ui.snapshot import Origin, SnapshotWriter
from app.ui.workers import Worker
from core.files import name_of
from core.session.files import add_event, is_being_written
from core.session.manifest import Description, Event, SessionError, write_description
from core.session.reader import SessionReader, losses
from core.types import Tick

_POLL_MS = 200
_GROWN = 1.2
"""While the session is read, the course is renewed when it has grown by this factor: each renewal costs more the longer it is."""
_STOP_WITHIN_MS = 10_000

_log = logging.getLogger(__name__)


class PlayedSession(QObject):
    """Polls the reader, which reads in a thread of its own; all other files are read and written by workers.

    ``changed``: course or events; ``polled``: the reader was asked; ``emptied``: why there is nothing to play;
    ``problems_found``: all problems; ``is_written``: whether the session is still being recorded; ``compared``: the results of a
    replay have been read; ``described``: what the session is about, once that is kept; ``note_refused``: a note that could not be
    written; ``message``: a line for people and whether it is a fault.

    Parameters
    ----------
    reader : not closed here.
    folder : of snapshots.
    """

    changed = Signal()
    polled = Signal()
    emptied = Signal(str)
    problems_found = Signal(object)
    is_written = Signal(bool)
    compared = Signal()
    described = Signal(object)
    note_refused = Signal(object)
    message = Signal(str, bool)

    def __init__(self, reader: SessionReader, folder: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._reader, self._folder = reader, folder
        manifest = reader.manifest
        self._kind = manifest.kind if manifest is not None else "UNKNOWN"
        self._model_name = manifest.model.get("name") if manifest is not None else None
        self.course: Course = course_of(reader.timeline())
        """The rows known so far."""
        self.is_whole = False
        """Whether all rows are known."""
        self.events: tuple[Event, ...] = ()
        """In the order of their times."""
        self.replayed: Replayed | None = None
        self._by_hand: NDArray[np.float64] | None = None
        self._is_written: bool | None = None
        self._losses: list[str] | None = None
        self._problems: list[str] | None = None
        self._is_empty = False
        self.poll_timer = QTimer(self, interval=_POLL_MS)
        self.poll_timer.timeout.connect(self._poll)
        self._files = Worker("player work", self)
        self._measured = Worker("angles by hand", self, behind=True)
        self._measured.done.connect(self._on_done)
        self._measured.failed.connect(
            lambda _key, line: self.message.emit(tr("No angles by hand: {why}", why=tr_text(line)), False)
        )
        self._files.done.connect(self._on_done)
        self._files.failed.connect(self._on_failed)
        self._snapshots = SnapshotWriter(folder, self)
        self._snapshots.saved.connect(lambda line: self.message.emit(line, False))
        self._snapshots.failed.connect(lambda line: self.message.emit(line, True))

    def start(self, replay: Path | None = None) -> None:
        """Begin to poll, and read the events and the results of a replay."""
        reader = self._reader
        self._files.submit("events", lambda: (reader.events, is_being_written(reader.folder)))
        self._measured.submit("by hand", partial(angles_by_hand, reader.folder))
        if replay is not None:
            self._files.submit("replay", lambda: Replayed(replay, name_of(reader.folder)))
        self.poll_timer.start()
        self._poll()

    # ---- what is known

    def _poll(self) -> None:
        is_all = self._reader.wait(0.0)
        known, shown = len(self._reader), len(self.course)
        if known != shown and (is_all or known > _GROWN * shown):
            self.course = self._with_replay(course_of(self._reader.timeline()))
            self.changed.emit()
        self.is_whole = is_all
        if is_all and not len(self.course) and not self._is_empty:
            self._is_empty = True
            loose = tr("there are pictures, but no rows: repair it with: session recover")
            self.emptied.emit(loose if self._reader.videos else tr("it is empty"))
        self.polled.emit()
        self._report_problems(is_all=is_all)

    def _with_replay(self, course: Course) -> Course:
        course = replace(course, by_hand=self._by_hand)
        if self.replayed is None:
            return course
        differs = self.replayed.changed(course.rows, course.theta_deg, course.states)
        return replace(course, other_theta_deg=self.replayed.theta_deg(course.rows), differs=differs)

    def _report_problems(self, *, is_all: bool) -> None:
        problems = list(self._reader.problems)
        if is_all and self._is_written is not None and self._losses is None:
            self._losses = losses(self._reader, self.events)  # once: it asks the disk, and a closed session loses no more
        problems += self._losses or []
        missing, manifest = self._reader.missing_rows, self._reader.manifest
        if missing:
            problems.append(tr("{count} rows are missing between those that are there", count=missing))
        if manifest is not None and manifest.counts.dropped:
            problems.append(tr("{count} frames could not be recorded: the recorder was behind", count=manifest.counts.dropped))
        if manifest is not None and not manifest.closed and self._is_written is False:
            problems.append(tr("the session did not end properly; session recover makes a repaired copy"))
        if problems != self._problems:
            self._problems = problems
            self.problems_found.emit(problems)

    def _on_done(self, key: object, result: object) -> None:
        if isinstance(result, Replayed):
            self.replayed = result
            if result.skipped:
                self.message.emit(tr("{count} results of the replay cannot be read", count=result.skipped), True)
            self.course = self._with_replay(self.course)
            self.compared.emit()
        elif key == "by hand":
            if not isinstance(result, np.ndarray):
                return
            self._by_hand = result
            self.course = self._with_replay(self.course)
        elif isinstance(result, Description):
            self.described.emit(result)
            self.message.emit(tr("Kept beside the session"), False)
            return
        elif isinstance(result, Event):
            self.events = tuple(sorted((*self.events, result), key=lambda one: one.time_s))
            self.message.emit(tr("Note kept"), False)
        elif isinstance(result, tuple):
            self.events, self._is_written = result
            if self._is_written:
                self.message.emit(tr("This session is still being recorded: what came later is not shown"), False)
            self.is_written.emit(self._is_written)
        self.changed.emit()

    def _on_failed(self, key: object, line: str) -> None:
        self.message.emit(line, True)
        if isinstance(key, Event):
            self.note_refused.emit(key)

    # ---- what is written

    def add_note(self, event: Event) -> None:
        self._files.submit(event, partial(_add_note, self._reader.folder, event))

    def describe(self, description: Description) -> None:
        self._files.submit("description", partial(_describe, self._reader.folder, description))

    def save_snapshot(self, tick: Tick) -> None:
        """The picture plain, with overlays, and its values."""
        self._snapshots.write(tick, Origin(f"{self._kind} PLAYBACK", None, self._model_name))

    def shut_down(self) -> bool:
        """Finish notes and snapshots; False when the disk does not answer."""
        self._measured.stop(finish=False)
        self._files.stop(finish=True)
        return self._snapshots.finish() & self._files.wait(_STOP_WITHIN_MS)


def angles_by_hand(session: Path) -> NDArray[np.float64] | None:
    """Times from the first row (s) and signed angles (degrees) of the annotated frames of a session, (N, 2); None: no angle."""
    from app.annotator.comparison import angles_over_time  # loads statistics
    from app.annotator.sources import default_store, extracted_pictures, known_images
    from core.annotation.store import AnnotationStore

    path, pictures = default_store([session]), extracted_pictures(session)
    if not pictures or not path.is_file():
        return None
    with AnnotationStore(path, read_only=True) as store:
        rows = angles_over_time(store.annotations(), known_images(pictures, store)[0])
    found = [(row["time_s"], row["theta_signed_deg"]) for row in rows if None not in (row["time_s"], row["theta_signed_deg"])]
    return np.array(found, np.float64) if found else None


def _add_note(folder: Path, event: Event) -> Event:
    try:
        return add_event(folder, event)
    except SessionError:
        _log.warning("a note was not kept: %s", event.text)  # the user may have closed the window by now
        raise


def _describe(folder: Path, description: Description) -> Description:
    write_description(folder, description)
    return description
