"""The session that is played: its rows, events and problems, which become known while it is read; notes, snapshots and clips."""

from __future__ import annotations

import logging
import threading
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QTimer, Signal, Slot

from app.player.course import Course, course_of
from app.player.replayed import Replayed
from app.ui.i18n import tr, tr_text
from app.ui.snapshot import Origin, SnapshotWriter
from app.ui.workers import QueuedCallback, Worker
from app.widgets.overlay_image import draw_overlay
from core.devices import UserError
from core.files import name_of
from core.session.export import export_mp4
from core.session.files import add_event, is_being_written
from core.session.manifest import Description, Event, SessionError, write_description
from core.session.reader import SessionReader, losses
from core.types import Image, Tick

_POLL_MS = 200
_GROWN = 1.2
"""While the session is read, the course is renewed when it has grown by this factor: each renewal costs more the longer it is."""
_CLIP_REPORTS = 100
_CLIP_POLL_S = 0.05
_STOP_WITHIN_MS = 10_000

_log = logging.getLogger(__name__)


class _ClipCancelled(UserError):
    """Raised in the clip's thread."""


class PlayedSession(QObject):
    """Polls the reader, which reads in a thread of its own; all other files are read and written by workers.

    ``changed``: course or events; ``polled``: the reader was asked; ``emptied``: why there is nothing to play;
    ``problems_found``: all problems; ``is_written``: whether the session is still being recorded; ``compared``: the results of a
    replay have been read; ``described``: what the session is about, once that is kept; ``note_refused``: a note that could not be
    written; ``clip_progressed``: the share of the clip that is written, None when none is; ``clip_saved``: its path and a line;
    ``message``: a line for people and whether it is a fault.

    Parameters
    ----------
    reader : not closed here.
    folder : of snapshots and clips.
    """

    changed = Signal()
    polled = Signal()
    emptied = Signal(str)
    problems_found = Signal(object)
    is_written = Signal(bool)
    compared = Signal()
    described = Signal(object)
    note_refused = Signal(object)
    clip_progressed = Signal(object)
    clip_saved = Signal(object, str)
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
        self._clip_cancelled: threading.Event | None = None
        self._poll_timer = QTimer(self, interval=_POLL_MS)
        self._poll_timer.timeout.connect(self._poll)
        self._files, self._clips = Worker("player work", self), Worker("clip", self)
        self._measured = Worker("angles by hand", self, behind=True)
        self._measured.done.connect(self._on_done)
        self._measured.failed.connect(
            lambda _key, line: self.message.emit(tr("No angles by hand: {why}", why=tr_text(line)), False)
        )
        self._files.done.connect(self._on_done)
        self._files.failed.connect(self._on_failed)
        self._clips.done.connect(self._on_clip_ended)
        self._clips.failed.connect(lambda _clip, why: self._on_clip_ended(_clip, (tr("Clip not saved: {why}", why=why), True)))
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
        self._poll_timer.start()
        self._poll()

    def stop_polling(self) -> None:
        self._poll_timer.stop()

    # ---- what is known

    @Slot()
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

    @property
    def has_clip(self) -> bool:
        return self._clip_cancelled is not None

    def write_clip(self, places: tuple[int, int], times_s: tuple[float, float]) -> None:
        """A video of the rows from the first to the last of `places` (included), named by their times."""
        if self.has_clip:
            self.message.emit(tr("A clip is being written already; Esc cancels it"), False)
            return
        cancelled = self._clip_cancelled = threading.Event()
        session, stamp = self._reader.folder, f"{self._kind} PLAYBACK"
        out, report, (first, last) = _free_path(self._folder, session, times_s), QueuedCallback(self), places
        count, written = last + 1 - first, 0

        def check() -> None:
            if cancelled.is_set():
                raise _ClipCancelled("cancelled")

        def draw(tick: Tick) -> Image:
            return draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=stamp)

        def on_row() -> None:
            nonlocal written
            check()
            written += 1
            share = written / count
            if written % max(1, count // _CLIP_REPORTS) == 0 or written == count:
                report.send(lambda it: it.clip_progressed.emit(share) if it.has_clip else None)

        def write() -> tuple[str, bool]:
            try:
                with SessionReader(session) as reader:  # of its own, so that playing goes on beside it
                    while not reader.wait(_CLIP_POLL_S):
                        check()
                    pictures = export_mp4(reader, out, draw, first=first, last=last + 1, on_row=on_row)
            except _ClipCancelled:
                return tr("Clip cancelled; nothing was kept"), False
            note = tr(", {count} pictures are lost", count=count - pictures) if pictures < count else ""
            return tr("Clip saved: {file} ({count} pictures{note})", file=out, count=pictures, note=note), False

        self.clip_progressed.emit(0.0)
        self._clips.submit(out, write)

    def cancel_clip(self) -> None:
        """Stop soon; nothing is left of the file."""
        if self._clip_cancelled is not None:
            self._clip_cancelled.set()

    def _on_clip_ended(self, clip: object, outcome: tuple[str, bool]) -> None:
        self._clip_cancelled = None
        self.clip_progressed.emit(None)
        if isinstance(clip, Path) and clip.is_file():
            self.clip_saved.emit(clip, outcome[0])
        else:
            self.message.emit(*outcome)

    def shut_down(self) -> bool:
        """Finish notes and snapshots, cancel the clip; False when the disk does not answer."""
        self.cancel_clip()
        self._measured.stop(finish=False)
        for worker in (self._files, self._clips):
            worker.stop(finish=True)
        return self._snapshots.finish() & self._files.wait(_STOP_WITHIN_MS) & self._clips.wait(_STOP_WITHIN_MS)


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


def _free_path(folder: Path, session: Path, times_s: tuple[float, float]) -> Path:
    """A file name that tells what is in the clip, and that does not exist yet."""
    name = f"{name_of(session)}_{round(times_s[0] * 1000)}-{round(times_s[1] * 1000)}ms"
    path, k = folder / f"{name}.mp4", 1
    while path.exists():
        k += 1
        path = folder / f"{name}_{k}.mp4"
    return path
