"""The events of a recorded session as a list; choosing one goes there."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from PySide6.QtCore import QAbstractListModel, QModelIndex, QPersistentModelIndex, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter
from PySide6.QtWidgets import QAbstractItemView, QListView, QStyle, QStyledItemDelegate, QStyleOptionViewItem

from app import palette, theme
from app.language import tr
from app.session_marks import LISTED, MARK_LOOK, clock_text, event_line
from app.widgets.timeline_paint import paint_mark
from core.session.events import Event

_ROW_HEIGHT = 24
_TIME_WIDTH = 86

_Index = QModelIndex | QPersistentModelIndex


class SessionEvents(QListView):
    """By time. Click or Enter goes to an event: ``chosen`` carries it."""

    chosen = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._model = _Model()
        self.setModel(self._model)
        self.setItemDelegate(_Painter(self))
        self.setUniformItemSizes(True)
        self.setFrameShape(QListView.Shape.NoFrame)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setMinimumHeight(2 * _ROW_HEIGHT)
        self.setAccessibleName(tr("Events of the session"))
        self.clicked.connect(self._choose)
        self.activated.connect(self._choose)

    @property
    def lines(self) -> list[str]:
        """What is listed."""
        return [self._model.line(event) for event in self._model.events]

    def show_events(self, events: Sequence[Event], first_s: float) -> None:
        """All events; times are told from the first row."""
        self._model.show(tuple(event for event in events if event.kind in LISTED), first_s)

    def show_time(self, time_s: float) -> None:
        """Mark the last one that had happened at a time of the recorded clock."""
        row = bisect_right(self._model.events, time_s + 1e-6, key=lambda event: event.time_s) - 1
        if row != self.currentIndex().row() and not self.hasFocus():
            self.setCurrentIndex(self._model.index(row) if row >= 0 else QModelIndex())

    def _choose(self, index: QModelIndex) -> None:
        self.chosen.emit(self._model.events[index.row()])


class _Model(QAbstractListModel):
    def __init__(self) -> None:
        super().__init__()
        self.events: tuple[Event, ...] = ()
        self._first_s = 0.0

    def show(self, events: tuple[Event, ...], first_s: float) -> None:
        self.beginResetModel()
        self.events, self._first_s = events, first_s
        self.endResetModel()

    def time_text(self, event: Event) -> str:
        return clock_text(event.time_s - self._first_s)

    def line(self, event: Event) -> str:
        return f"{self.time_text(event)}  {event_line(event)}"

    def rowCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default, never changed
        return 0 if parent.isValid() else len(self.events)

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        event = self.events[index.row()]
        if role == Qt.ItemDataRole.UserRole:
            return event
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole):
            return self.line(event)
        return event_line(event) if role == Qt.ItemDataRole.ToolTipRole else None


class _Painter(QStyledItemDelegate):
    """Time, mark, text."""

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return QSize(100, _ROW_HEIGHT)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        model, event = index.model(), index.data(Qt.ItemDataRole.UserRole)
        assert isinstance(model, _Model)
        room = QRectF(option.rect)  # type: ignore[attr-defined]
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if option.state & QStyle.StateFlag.State_Selected:  # type: ignore[attr-defined]
            painter.fillRect(room, QColor(palette.RAISED))
        painter.setFont(theme.font(12))
        painter.setPen(QColor(palette.TEXT_FAINT))
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(QRectF(room.left(), room.top(), _TIME_WIDTH - 14, room.height()), right, model.time_text(event))
        look = MARK_LOOK.get(event.kind)
        if look is not None:
            middle = room.topLeft()
            middle.setX(middle.x() + _TIME_WIDTH + 2)
            middle.setY(room.center().y())
            paint_mark(painter, middle, look.shape, look.colour)
        text_font = theme.font(13)
        painter.setFont(text_font)
        painter.setPen(QColor(palette.TEXT))
        left = room.left() + _TIME_WIDTH + 16
        width = room.right() - left - 4
        text = theme.elide(text_font, event_line(event), int(width))
        painter.drawText(QRectF(left, room.top(), width, room.height()), Qt.AlignmentFlag.AlignVCenter, text)
        painter.restore()
