"""What happened, newest first."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta

from PySide6.QtCore import QPoint, QRectF, QSize, Qt, Slot
from PySide6.QtGui import QColor, QFontMetrics, QGuiApplication, QPainter, QPen, QShowEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QLabel,
    QMenu,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QVBoxLayout,
    QWidget,
)

from app import palette, theme
from app.event_model import MOST_ROWS, EventKind, EventModel, Index, LoggedEvent
from app.language import tr, tr_text
from app.widgets.quiet_combo import QuietCombo
from app.widgets.scroll_keys import ScrolledList

SAME_WITHIN = timedelta(seconds=2.0)
_ROW_HEIGHT = 24
_STYLE = "QListView { border: 1px solid @PANEL; } QListView:focus { border: 1px solid @SKY; }"


class EventLog(QWidget):
    """A list with a filter. While it is hidden an event costs no more than a place in a queue."""

    def __init__(self, now: Callable[[], datetime] = datetime.now) -> None:
        super().__init__()
        self._now = now
        self._waiting: deque[LoggedEvent] = deque(maxlen=MOST_ROWS)
        self._newest: LoggedEvent | None = None
        self._model = EventModel(self)
        self._view = _EventList(self._model)
        self._view.customContextMenuRequested.connect(self._open_menu)
        self._filter = QuietCombo(tr("Kind of events shown"))
        self._filter.setToolTip(tr("Which events are listed"))
        self._filter.addItem(tr("Everything"), None)
        for kind in EventKind:
            self._filter.addItem(tr(kind.value.plural), kind)
        self._filter.activated.connect(self._on_filter)
        label = QLabel(tr("Show"))
        label.setObjectName("card_title")
        head = QHBoxLayout()
        head.setSpacing(6)
        head.addWidget(label)
        head.addWidget(self._filter, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addLayout(head)
        column.addWidget(self._view, 1)
        self.setAccessibleName(tr("Event log"))

    @property
    def lines(self) -> list[str]:
        """What the filter lets through, newest first."""
        self._take_in()
        return [event.line for event in self._model.shown]

    def add(self, kind: EventKind, text: str) -> None:
        """Something happened now; a repetition of the newest event within two seconds raises its count instead."""
        now, newest = self._now(), self._newest
        event = LoggedEvent(now, kind, tr_text(" ".join(text.split())))
        is_same = newest is not None and (newest.kind, newest.text) == (kind, event.text) and abs(now - newest.at) <= SAME_WITHIN
        if newest is not None and is_same:
            event = replace(event, times=newest.times + 1)
        self._newest = event
        if not self.isVisible():
            if is_same and self._waiting:
                self._waiting[-1] = event
                return
            if not is_same:
                self._waiting.append(event)
                return
        self._take_in()
        self._put(event, is_same)

    def show_kind(self, kind: EventKind | None) -> None:
        """Show one kind only; None shows everything."""
        self._filter.setCurrentIndex(self._filter.findData(kind))
        self._on_filter()

    @Slot()
    def copy_all(self) -> None:
        """All lines that are shown, to the clipboard."""
        QGuiApplication.clipboard().setText("\n".join(self.lines))

    def _put(self, event: LoggedEvent, is_same: bool) -> None:
        if is_same:
            self._model.replace_newest(event)
        elif self._model.add(event):
            self._view.keep_place()

    def _take_in(self) -> None:
        if self._waiting:
            self._model.add_all(self._waiting)
            self._waiting.clear()

    def showEvent(self, event: QShowEvent) -> None:
        self._take_in()
        super().showEvent(event)

    @Slot()
    def _on_filter(self) -> None:
        self._take_in()
        self._model.show_kind(self._filter.currentData())
        self._view.scrollToTop()

    @Slot(QPoint)
    def _open_menu(self, place: QPoint) -> None:
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction(tr("Copy all"), self.copy_all)
        menu.popup(self._view.viewport().mapToGlobal(place))


class _EventList(ScrolledList):
    """Rows of equal height. Whoever has scrolled down keeps the lines that he reads."""

    def __init__(self, model: EventModel) -> None:
        super().__init__(_ROW_HEIGHT)
        self.setModel(model)
        self.setItemDelegate(_EventPainter(self))
        self.setUniformItemSizes(True)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        theme.set_sheet(self, _STYLE)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.setMinimumHeight(2 * _ROW_HEIGHT)
        self.setAccessibleName(tr("Events, newest first"))

    def keep_place(self) -> None:
        """A line was put in above."""
        bar = self.verticalScrollBar()
        if bar.value() > 0:
            self.executeDelayedItemsLayout()
            bar.setValue(bar.value() + _ROW_HEIGHT)


class _EventPainter(QStyledItemDelegate):
    """Time, kind as a mark and a word, text, and how often."""

    def sizeHint(self, option: QStyleOptionViewItem, index: Index) -> QSize:
        return QSize(200, _ROW_HEIGHT)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        event = index.data(Qt.ItemDataRole.UserRole)
        if not isinstance(event, LoggedEvent):
            return
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        room = QRectF(option.rect).adjusted(6, 0, -6, 0)  # type: ignore[attr-defined]
        if option.state & QStyle.StateFlag.State_MouseOver:  # type: ignore[attr-defined]
            painter.fillRect(option.rect, QColor(palette.RAISED))  # type: ignore[attr-defined]
        small, look = theme.font(theme.Size.LABEL), event.kind.value
        centre = Qt.AlignmentFlag.AlignVCenter
        painter.setFont(small)
        painter.setPen(QColor(palette.TEXT_FAINT))
        painter.drawText(room, centre, f"{event.at:%H:%M:%S}")
        room.adjust(QFontMetrics(small).horizontalAdvance("00:00:00") + 10, 0, 0, 0)
        painter.setPen(QPen(Qt.PenStyle.NoPen))
        painter.setBrush(QColor(look.colour))
        painter.drawRoundedRect(QRectF(room.left(), room.center().y() - 4, 8, 8), 2, 2)
        painter.setPen(QColor(palette.TEXT_DIM))
        painter.drawText(room.adjusted(14, 0, 0, 0), centre, tr(look.word))
        room.adjust(14 + QFontMetrics(small).horizontalAdvance(tr("operator")) + 10, 0, 0, 0)
        if event.times > 1:
            times = f"\N{MULTIPLICATION SIGN}{event.times}"
            painter.drawText(room, Qt.AlignmentFlag.AlignRight | centre, times)
            room.adjust(0, 0, -QFontMetrics(small).horizontalAdvance(times) - 8, 0)
        text_font = theme.font(13)
        painter.setFont(text_font)
        painter.setPen(QColor(palette.TEXT))
        painter.drawText(room, centre, theme.elide(text_font, event.text, int(room.width())))
        painter.restore()
