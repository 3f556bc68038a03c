"""What happened, as a list for Qt's views, newest first."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from datetime import datetime
from enum import Enum

from PySide6.QtCore import QAbstractListModel, QModelIndex, QObject, QPersistentModelIndex, Qt

from app import palette
from app.language import mark, tr

MOST_ROWS = 2000
Index = QModelIndex | QPersistentModelIndex


@dataclass(frozen=True, slots=True)
class KindLook:
    """Word and colour (its role in the palette) of a kind of event, and how the filter calls all of them."""

    word: str
    role: str
    plural: str

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return palette.of(self.role)


class EventKind(Enum):
    """What an event is about. GATE: a command that was clamped or rejected."""

    MODE = KindLook(mark("mode"), "SKY", mark("Modes"))
    ALERT = KindLook(mark("alert"), "VERMILLION", mark("Alerts"))
    GATE = KindLook(mark("gate"), "YELLOW", mark("Gate: clamped and rejected"))
    OPERATOR = KindLook(mark("operator"), "TEXT", mark("Operator"))
    TARGET = KindLook(mark("target"), "TARGET", mark("Targets"))
    NOTE = KindLook(mark("note"), "TEXT_FAINT", mark("Notes"))


@dataclass(frozen=True, slots=True)
class LoggedEvent:
    """An event that came ``times`` times in a row, last at ``at``."""

    at: datetime
    kind: EventKind
    text: str
    times: int = 1

    @property
    def line(self) -> str:
        """As it is copied."""
        times = f" \N{MULTIPLICATION SIGN}{self.times}" if self.times > 1 else ""
        return f"{self.at:%H:%M:%S}  {tr(self.kind.value.word):<8}  {self.text}{times}"


class EventModel(QAbstractListModel):
    """All events, and those that the filter lets through, both newest first."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._all: deque[LoggedEvent] = deque()
        self._kind: EventKind | None = None
        self.shown: list[LoggedEvent] = []

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default, never changed
        return 0 if parent.isValid() else len(self.shown)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid() or index.row() >= len(self.shown):
            return None
        event = self.shown[index.row()]
        if role == Qt.ItemDataRole.UserRole:
            return event
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole):
            return event.line
        return event.text if role == Qt.ItemDataRole.ToolTipRole else None

    def add(self, event: LoggedEvent) -> bool:
        """Put `event` in front; the oldest one goes when there are too many. False when the filter keeps it back."""
        self._all.appendleft(event)
        passes = self._passes(event)
        if passes:
            self.beginInsertRows(QModelIndex(), 0, 0)
            self.shown.insert(0, event)
            self.endInsertRows()
        if len(self._all) > MOST_ROWS:
            oldest = self._all.pop()
            if self.shown and self.shown[-1] is oldest:
                last = len(self.shown) - 1
                self.beginRemoveRows(QModelIndex(), last, last)
                self.shown.pop()
                self.endRemoveRows()
        return passes

    def add_all(self, events: deque[LoggedEvent]) -> None:
        """Many at once, oldest first."""
        self.beginResetModel()
        self._all.extendleft(events)
        while len(self._all) > MOST_ROWS:
            self._all.pop()
        self._filter()
        self.endResetModel()

    def replace_newest(self, event: LoggedEvent) -> None:
        if not self._all:
            return
        self._all[0] = event
        if self.shown and self._passes(event):
            self.shown[0] = event
            first = self.index(0)
            self.dataChanged.emit(first, first)

    def show_kind(self, kind: EventKind | None) -> None:
        self.beginResetModel()
        self._kind = kind
        self._filter()
        self.endResetModel()

    def _filter(self) -> None:
        self.shown = [event for event in self._all if self._passes(event)]

    def _passes(self, event: LoggedEvent) -> bool:
        return self._kind is None or event.kind is self._kind
