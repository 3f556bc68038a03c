"""What happened, newest first, as a list with a filter."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from enum import Enum

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QPoint, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPainter
from PySide6.QtWidgets import (
    QListWidget,
    QListWidgetItem,
    QMenu,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.widgets.basics import QuietCombo, ScrollKeys, card_title, column, line
from app.widgets.painting import RIGHT, draw_box, draw_text, text_width

MOST_ROWS = 2000  # events that are kept
SAME_WITHIN = timedelta(seconds=2.0)
_ROW_HEIGHT = 24
_STYLE = "QListView { border: 1px solid @PANEL; } QListView:focus { border: 1px solid @SKY; }"
_Index = QModelIndex | QPersistentModelIndex


@dataclass(frozen=True, slots=True)
class KindLook:
    """Word and colour (its role in the palette) of a kind of event, and how the filter calls all of them."""

    word: str
    role: str
    plural: str


class LogKind(Enum):
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
    kind: LogKind
    text: str
    times: int = 1

    @property
    def line(self) -> str:
        """As it is copied."""
        times = f" \N{MULTIPLICATION SIGN}{self.times}" if self.times > 1 else ""
        return f"{self.at:%H:%M:%S}  {tr(self.kind.value.word):<8}  {self.text}{times}"


class EventLog(QWidget):
    """A list of events with a filter by their kind."""

    def __init__(self, now: Callable[[], datetime] = datetime.now) -> None:
        super().__init__()
        self._now = now
        self._recent: dict[Hashable, tuple[LoggedEvent, QListWidgetItem]] = {}
        """What a repetition would be one of; the oldest first."""
        self._view = _EventList()
        self._view.customContextMenuRequested.connect(self._open_menu)
        self._filter = QuietCombo(tr("Kind of events shown"))
        self._filter.setToolTip(tr("Which events are listed"))
        self._filter.addItem(tr("Everything"), None)
        for kind in LogKind:
            self._filter.addItem(tr(kind.value.plural), kind)
        self._filter.activated.connect(self._on_filter)
        head = line(card_title(tr("Show")), (self._filter, 1), spacing=6)
        self.setLayout(column(head, (self._view, 1), spacing=4))
        self.setAccessibleName(tr("Event log"))

    @property
    def lines(self) -> list[str]:
        items = (self._view.item(row) for row in range(self._view.count()))
        return [item.text() for item in items if not item.isHidden()]

    def add(self, kind: LogKind, text: str, key: Hashable = None, times: int = 1) -> None:
        """Something happened now, `times` times; a repetition within two seconds raises its count instead.

        It is a repetition of what has the same `key`, without one the same text.
        """
        event = LoggedEvent(self._now(), kind, tr_text(" ".join(text.split())), times)
        same = kind, key if key is not None else event.text
        known = self._recent.pop(same, None)
        while self._recent and event.at - next(iter(self._recent.values()))[0].at > SAME_WITHIN:
            del self._recent[next(iter(self._recent))]
        if known is not None and abs(event.at - known[0].at) <= SAME_WITHIN:
            event = replace(event, times=known[0].times + times)
            self._recent[same] = event, self._view.put(event, known[1])
        else:
            self._recent[same] = event, self._view.put(event)

    def show_kind(self, kind: LogKind | None) -> None:
        """Show one kind only; None shows everything."""
        self._filter.setCurrentIndex(self._filter.findData(kind))
        self._on_filter()

    def _on_filter(self) -> None:
        self._view.show_kind(self._filter.currentData())

    def _open_menu(self, place: QPoint) -> None:
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction(tr("Copy all"), lambda: QGuiApplication.clipboard().setText("\n".join(self.lines)))
        menu.popup(self._view.viewport().mapToGlobal(place))


class _EventList(QListWidget):
    """Rows of equal height. A list that was scrolled down keeps its lines in place."""

    def __init__(self) -> None:
        super().__init__()
        ScrollKeys(self, _ROW_HEIGHT)
        self._kind: LogKind | None = None
        self.setItemDelegate(_EventPainter(self))
        self.setUniformItemSizes(True)
        theme.set_sheet(self, _STYLE)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.setMinimumHeight(2 * _ROW_HEIGHT)
        self.setAccessibleName(tr("Events, newest first"))

    def put(self, event: LoggedEvent, item: QListWidgetItem | None = None) -> QListWidgetItem:
        """Show `event` in front, or in the line `item` that it had while that is of this second; ``MOST_ROWS`` are kept.

        So lines that are repeated by turns do not change places all the time.
        """
        item, bar = item or QListWidgetItem(), self.verticalScrollBar()
        row = self.row(item)
        _show_event(item, event)
        if row == 0 or (row > 0 and _second(self.item(row - 1)) == _second(item)):
            return item
        was_above = row > 0 and self.visualItemRect(item).top() < 0
        if row > 0:
            self.takeItem(row)
        self.insertItem(0, item)
        item.setHidden(self._kind not in (None, event.kind))
        self.takeItem(MOST_ROWS)
        if bar.value() > 0 and not item.isHidden() and not was_above:
            self.executeDelayedItemsLayout()
            bar.setValue(bar.value() + _ROW_HEIGHT)
        return item

    def show_kind(self, kind: LogKind | None) -> None:
        self._kind = kind
        for row in range(self.count()):
            item = self.item(row)
            item.setHidden(kind not in (None, item.data(Qt.ItemDataRole.UserRole).kind))
        self.scrollToTop()


def _show_event(item: QListWidgetItem, event: LoggedEvent) -> None:
    item.setText(event.line)
    item.setToolTip(event.text)
    item.setData(Qt.ItemDataRole.UserRole, event)


def _second(item: QListWidgetItem) -> datetime:
    at: datetime = item.data(Qt.ItemDataRole.UserRole).at
    return at.replace(microsecond=0)


class _EventPainter(QStyledItemDelegate):
    """Time, kind as a mark and a word, text, and how often."""

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return QSize(200, _ROW_HEIGHT)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        event = index.data(Qt.ItemDataRole.UserRole)
        if not isinstance(event, LoggedEvent):
            return
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        room = QRectF(option.rect).adjusted(6, 0, -6, 0)  # type: ignore[attr-defined]
        if option.state & QStyle.StateFlag.State_MouseOver:  # type: ignore[attr-defined]
            painter.fillRect(option.rect, QColor(theme.RAISED))  # type: ignore[attr-defined]
        small, look = theme.font(theme.Size.LABEL), event.kind.value
        draw_text(painter, room, f"{event.at:%H:%M:%S}", small, theme.TEXT_FAINT)
        room.adjust(text_width(small, "00:00:00") + 10, 0, 0, 0)
        draw_box(painter, QRectF(room.left(), room.center().y() - 4, 8, 8), 2, theme.of(look.role))
        room.adjust(14, 0, 0, 0)
        draw_text(painter, room, tr(look.word), small, theme.TEXT_DIM)
        room.adjust(text_width(small, tr("operator")) + 10, 0, 0, 0)
        if event.times > 1:
            times = f"\N{MULTIPLICATION SIGN}{event.times}"
            draw_text(painter, room, times, small, theme.TEXT_DIM, RIGHT)
            room.adjust(0, 0, -text_width(small, times) - 8, 0)
        draw_text(painter, room, event.text, theme.font(13), theme.TEXT, elided=True)
        painter.restore()
