"""The sessions of a folder as a Qt model: listed at once from the cache, then read in threads, those in sight first."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PySide6.QtCore import (
    QAbstractListModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
    Signal,
)
from PySide6.QtGui import QPixmap

from app.ui.i18n import mark, tr_text
from app.ui.palette import ON_PICTURE, rgb
from app.ui.workers import Worker
from core.session.library import (
    Cached,
    SessionSummary,
    SummaryCache,
    find_sessions,
    first_summary,
    signature_of,
    whole_summary,
)
from core.session.manifest import Description, SessionError, write_description
from core.session.reader import SessionReader

SUMMARY = Qt.ItemDataRole.UserRole
"""Role of the ``SessionSummary``."""
_PICTURE_PX = 256
"""Longer side of the pictures that are kept."""
_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 85]
_LINE_PX = 2
_POLL_S = 0.05
_END_WITHIN_MS = 5000
_UNREADABLE = "it is damaged and cannot be read; session info says more"

_Index = QModelIndex | QPersistentModelIndex
_ROOT = QModelIndex()


class SortOrder(Enum):
    """What comes first; the value is shown."""

    NEWEST = mark("Newest first")
    OLDEST = mark("Oldest first")
    LONGEST = mark("Longest first")
    FAULTS = mark("Most faults first")
    OPERATOR = mark("By operator")


def title_of(summary: SessionSummary) -> str:
    """When it began, by the clock of this computer."""
    return f"{summary.started_utc.astimezone():%Y-%m-%d  %H:%M:%S}"


@dataclass(slots=True)
class _Row:
    """``is_whole``: rows and events have been read, too."""

    cached: Cached
    is_whole: bool
    pixmap: QPixmap | None = None


class LibraryModel(QAbstractListModel):
    """``updated``: sessions have come, gone or changed; ``message``: a line for people and whether it is a fault.

    Parameters
    ----------
    folder : looked through when ``scan`` is called.
    cache : by default the user's.
    """

    updated = Signal()
    message = Signal(str, bool)

    def __init__(self, folder: Path, cache: SummaryCache | None = None, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.folder = folder
        self.is_scanned = False
        """Whether the folder has been looked through."""
        self._cache = cache or SummaryCache()
        self._rows: list[_Row] = []
        self._asked: set[Path] = set()
        self._stop = threading.Event()
        self._files, self._details = Worker("library", self), Worker("library details", self, behind=True)
        self._files.done.connect(self._on_done)
        self._files.failed.connect(self._on_failed)
        self._details.done.connect(self._on_read)
        self._details.failed.connect(self._on_unreadable)

    @property
    def summaries(self) -> list[SessionSummary]:
        return [row.cached.summary for row in self._rows]

    @property
    def pending(self) -> int:
        """Sessions whose rows have not been read yet."""
        return self._details.pending

    def scan(self) -> None:
        self._files.submit("scan", partial(_scan, self.folder, self._cache), once=True)

    def open_folder(self, folder: Path) -> None:
        self._details.cancel_waiting()
        self.folder, self.is_scanned = folder, False
        self._show([])
        self.scan()

    def describe(self, folder: Path, description: Description) -> None:
        """Keep what a session is about, in a thread."""
        self._files.submit(folder, partial(_describe, folder, description))

    def stop(self) -> bool:
        """Finish what is being kept; False when the disk does not answer."""
        self._stop.set()
        self._details.stop(finish=False)
        self._files.stop(finish=True)
        return self._files.wait(_END_WITHIN_MS) & self._details.wait(_END_WITHIN_MS)

    # ---- as Qt asks for it

    def rowCount(self, parent: _Index = _ROOT) -> int:
        return 0 if parent.isValid() else len(self._rows)

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        row = self._rows[index.row()]
        summary = row.cached.summary
        if role == SUMMARY:
            return summary
        if role == Qt.ItemDataRole.DecorationRole:
            if not row.is_whole and summary.folder not in self._asked:  # it is being painted, and so in sight
                self._asked.add(summary.folder)
                self._read(row, urgent=True)
            if row.pixmap is None:
                row.pixmap = QPixmap()
                row.pixmap.loadFromData(row.cached.picture)
            return row.pixmap
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole):
            about = summary.description
            return ", ".join(part for part in (title_of(summary), summary.kind, about.line, *about.tags, summary.problem) if part)
        if role == Qt.ItemDataRole.ToolTipRole:
            return "\n".join(part for part in (str(summary.folder), tr_text(summary.problem), summary.description.notes) if part)
        return None

    # ---- in the window's thread, when a thread has finished something

    def _on_done(self, _key: object, result: object) -> None:
        if isinstance(result, _Scanned) and result.folder == self.folder:
            self.is_scanned = True
            self._show(result.rows)
        elif isinstance(result, _Described) and (place := self._place(result.folder)) is not None:
            row = self._rows[place]
            summary = row.cached.summary.model_copy(update={"description": result.description})
            cached = replace(row.cached, signature=result.signature, summary=summary)
            self._put(cached, is_whole=row.is_whole)
            if row.is_whole:
                self._files.submit("keep", partial(self._cache.keep, cached))

    def _on_failed(self, _key: object, line: str) -> None:
        self.message.emit(tr_text(line), True)
        self.is_scanned = True
        self.updated.emit()  # fields show again what is kept

    def _show(self, rows: Sequence[_Row]) -> None:
        before = {row.cached.summary.folder: row for row in self._rows}
        for row in rows:
            old = before.get(row.cached.summary.folder)
            if old is not None and old.cached == row.cached:
                row.pixmap = old.pixmap
        self._asked.clear()
        if [row.cached.summary.folder for row in rows] == list(before):
            self._rows = list(rows)
            if rows:
                self.dataChanged.emit(self.index(0), self.index(len(rows) - 1))
        else:
            self.beginResetModel()
            self._rows = list(rows)
            self.endResetModel()
        for row in self._rows:
            if not row.is_whole:
                self._read(row)
        self.updated.emit()

    def _read(self, row: _Row, *, urgent: bool = False) -> None:
        folder = row.cached.summary.folder
        if not row.cached.summary.is_recording:
            self._details.submit(folder, partial(_read_session, folder, self._cache, self._stop), urgent=urgent, once=True)

    def _on_read(self, _folder: object, cached: object) -> None:
        if isinstance(cached, Cached):
            self._put(cached)

    def _on_unreadable(self, folder: object, _line: str) -> None:
        if (place := self._place(folder)) is not None:
            cached = self._rows[place].cached
            self._put(replace(cached, summary=cached.summary.model_copy(update={"problem": _UNREADABLE})))

    def _put(self, cached: Cached, *, is_whole: bool = True) -> None:
        if (place := self._place(cached.summary.folder)) is not None:
            self._rows[place] = _Row(cached, is_whole)
            self.dataChanged.emit(self.index(place), self.index(place))
            self.updated.emit()

    def _place(self, folder: object) -> int | None:
        return next((place for place, row in enumerate(self._rows) if row.cached.summary.folder == folder), None)


# ---- in threads


@dataclass(frozen=True, slots=True)
class _Scanned:
    folder: Path
    rows: list[_Row]


@dataclass(frozen=True, slots=True)
class _Described:
    folder: Path
    description: Description
    signature: str


def _scan(folder: Path, cache: SummaryCache) -> _Scanned:
    """All sessions by what is kept of them, or by their manifests. Raises SessionError."""
    kept, rows = cache.read(), []
    for session in sorted(find_sessions(folder), key=lambda path: path.name, reverse=True):
        signature, known = signature_of(session), kept.get(session)
        if known is not None and known.signature == signature:
            rows.append(_Row(known, is_whole=True))
        else:  # the old picture until there is a new one
            rows.append(
                _Row(Cached(signature, first_summary(session), known.picture if known is not None else b""), is_whole=False)
            )
    return _Scanned(folder, rows)


def _describe(folder: Path, description: Description) -> _Described:
    write_description(folder, description)
    return _Described(folder, description, signature_of(folder))


def _read_session(folder: Path, cache: SummaryCache, stop: threading.Event) -> Cached | None:
    """Rows, events and a picture of a session; None when it was stopped."""
    signature = signature_of(folder)  # before it is read: what comes meanwhile is read again
    try:
        with SessionReader(folder) as reader:
            while not reader.wait(_POLL_S):
                if stop.is_set():
                    return None
            cached = Cached(signature, whole_summary(reader), _picture_of(reader))
    except SessionError as error:
        summary = first_summary(folder)
        cached = Cached(signature, summary.model_copy(update={"problem": summary.problem or str(error)}))
    cache.keep(cached)
    return cached


def _picture_of(reader: SessionReader) -> bytes:
    """From the middle of the rows with a pose, with robot and centerline; empty where no picture can be read."""
    places = np.flatnonzero(reader.timeline().state >= 0)
    place = int(places[len(places) // 2]) if len(places) else len(reader) // 2
    tick = reader.tick(place) if len(reader) else None
    if tick is None:
        return b""
    image, scene = tick.frame.image, tick.scene
    scale = _PICTURE_PX / max(image.shape[:2])
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    small = cv2.cvtColor(cv2.resize(image, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2BGR)
    for points, name in (
        (scene.centerline.piece if scene.centerline is not None else None, ON_PICTURE.VESSEL),
        (scene.path.points if scene.path is not None else None, ON_PICTURE.ROBOT),
    ):
        if points is not None and len(points):
            line = np.round(scene.points_to_source(points) * scale).astype(np.int32)
            cv2.polylines(small, [line], False, rgb(name)[::-1], _LINE_PX, cv2.LINE_AA)
    done, data = cv2.imencode(".jpg", small, _JPEG)
    return data.tobytes() if done else b""


class LibraryFilter(QSortFilterProxyModel):
    """The sessions that match all words and the tag, in the chosen order."""

    def __init__(self, model: LibraryModel) -> None:
        super().__init__()
        self.words, self.tag, self.order = "", "", SortOrder.NEWEST
        self.setSourceModel(model)
        self.setDynamicSortFilter(True)
        self.sort(0)

    def show(self, words: str, tag: str, order: SortOrder) -> None:
        """Filter and sort again."""
        self.words, self.tag, self.order = words, tag, order
        self.invalidate()

    def filterAcceptsRow(self, row: int, parent: _Index) -> bool:
        summary = self._summary(self.sourceModel().index(row, 0))
        return (not self.tag or self.tag in summary.description.tags) and summary.matches(self.words)

    def lessThan(self, left: _Index, right: _Index) -> bool:
        return self._key(left) < self._key(right)

    def _summary(self, index: _Index) -> SessionSummary:
        summary = index.data(SUMMARY)
        assert isinstance(summary, SessionSummary)
        return summary

    def _key(self, index: _Index) -> tuple[Any, ...]:
        """What is smaller comes first; among equals the newer one."""
        one = self._summary(index)
        time_s = one.started_utc.timestamp()
        match self.order:
            case SortOrder.OLDEST:
                return (time_s,)
            case SortOrder.LONGEST:
                return -(one.seconds or 0.0), -time_s
            case SortOrder.FAULTS:
                return -sum(one.faults.values()), -time_s
            case SortOrder.OPERATOR:
                return not one.description.operator, one.description.operator.casefold(), -time_s
        return (-time_s,)
