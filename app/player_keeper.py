"""What the player writes: notes into the session, snapshots and clips beside it. Nothing here waits for a disk."""

from __future__ import annotations

import logging
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot

from app.clip_export import Clip, ClipExporter, clip_path
from app.language import tr
from app.replayed import Replayed
from app.snapshot import Origin, SnapshotWriter
from app.work_thread import WorkThread
from core.names import name_of
from core.session.events import Event
from core.session.files import add_event, is_being_written
from core.session.manifest import SessionError
from core.session.reader import SessionReader
from core.types import Tick

_STOP_WITHIN_MS = 10_000

_log = logging.getLogger(__name__)


class PlayerKeeper(QObject):
    """Also reads the events, which are a file of their own.

    ``said`` carries a line to show and whether it is a fault; ``events_read`` the events and whether the session is still being
    recorded; ``replayed_read`` a replay's results; ``noted`` a note that is kept, ``note_refused`` one that the disk did not take;
    ``progressed`` the share of the clip that is written, None when none is.
    """

    said = Signal(str, bool)
    events_read = Signal(object, bool)
    noted = Signal(object)
    note_refused = Signal(object)
    replayed_read = Signal(object)
    progressed = Signal(object)

    def __init__(self, reader: SessionReader, folder: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._reader = reader
        self._folder = folder
        manifest = reader.manifest
        self._kind = manifest.kind if manifest is not None else "UNKNOWN"
        self._model = manifest.model.get("name") if manifest is not None else None
        self._clip: ClipExporter | None = None
        self._work = WorkThread("player work", self)
        self._work.done.connect(self._on_done)
        self._work.failed.connect(self._on_failed)
        self._snapshots = SnapshotWriter(folder, self)
        self._snapshots.saved.connect(lambda line: self.said.emit(line, False))
        self._snapshots.failed.connect(lambda line: self.said.emit(line, True))

    @property
    def has_clip(self) -> bool:
        """Is a clip being written?"""
        return self._clip is not None

    def read_events(self) -> None:
        self._work.submit("events", lambda: (self._reader.events, is_being_written(self._reader.folder)))

    def read_replayed(self, path: Path) -> None:
        """Results of a replay of this session."""
        self._work.submit("replayed", lambda: Replayed(path, name_of(self._reader.folder)))

    def add_note(self, event: Event) -> None:
        """Into the session's own file."""
        self._work.submit(event, partial(_add, self._reader.folder, event))

    def take_snapshot(self, tick: Tick) -> None:
        """Plain, with overlays, and its values."""
        self._snapshots.write(tick, Origin(f"{self._kind} PLAYBACK", None, self._model))

    def write_clip(self, places: tuple[int, int], times_s: tuple[float, float]) -> None:
        """Rows from the first to the last of `places` (included), named by their times."""
        if self._clip is not None:
            self.said.emit(tr("A clip is being written already; Esc cancels it"), False)
            return
        out = clip_path(self._folder, self._reader.folder, *times_s)
        self._clip = ClipExporter(Clip(self._reader.folder, out, places[0], places[1] + 1, self._kind), self)
        self._clip.progressed.connect(self.progressed)
        self._clip.ended.connect(self._on_clip_ended)
        self.progressed.emit(0.0)
        self._clip.start()

    @Slot()
    def cancel_clip(self) -> None:
        if self._clip is not None:
            self._clip.cancel()

    @Slot(str, bool)
    def _on_clip_ended(self, line: str, is_fault: bool) -> None:
        if self._clip is not None:
            self._clip.wait(_STOP_WITHIN_MS)
            self._clip.deleteLater()
            self._clip = None
        self.progressed.emit(None)
        self.said.emit(line, is_fault)

    @Slot(object, object)
    def _on_done(self, key: object, result: object) -> None:
        if key == "events":
            assert isinstance(result, tuple)
            self.events_read.emit(*result)
        elif key == "replayed":
            self.replayed_read.emit(result)
        else:
            self.noted.emit(result)

    @Slot(object, str)
    def _on_failed(self, key: object, line: str) -> None:
        self.said.emit(line, True)
        if isinstance(key, Event):
            self.note_refused.emit(key)

    def shut_down(self) -> bool:
        """Finish notes and snapshots, give a clip up; False when the disk does not answer."""
        self._work.stop(finish=True)
        if self._clip is not None:
            self._clip.cancel()
        has_ended = self._work.wait(_STOP_WITHIN_MS)
        has_ended = has_ended and (self._clip is None or self._clip.wait(_STOP_WITHIN_MS))
        return self._snapshots.finish() and has_ended


def _add(folder: Path, event: Event) -> Event:
    try:
        return add_event(folder, event)
    except SessionError:
        _log.warning("a note was not kept: %s", event.text)  # whoever wrote it may have left by now
        raise
