"""The cells of the servo table as a Qt model, and the view that paints them."""

from __future__ import annotations

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QStyledItemDelegate, QStyleOptionViewItem, QTableView

from app import palette, theme
from app.cells import TONE_ROLE, Cell, Row, Tone, Track
from app.language import tr
from app.servo_cells import Column

_COLUMNS = tuple(Column)
_LEFT = {Column.JOINT, Column.ERROR}
_WIDTHS = {
    Column.JOINT: (70, 0.10), Column.POSITION: (78, 0.25), Column.GOAL: (52, 0.07), Column.CURRENT: (42, 0.05),
    Column.TEMPERATURE: (34, 0.05), Column.VOLTAGE: (40, 0.05), Column.TORQUE: (42, 0.04), Column.ZERO: (32, 0.04),
    Column.ERROR: (56, 0.35),
}  # fmt: skip
"""Least width in px, and share of what is left."""
_HEADER, _ROW = 19, (15, 34)
_STYLE = """
QTableView { background: @PANEL; border: none; }
QHeaderView::section { background: @PANEL; color: @TEXT_FAINT; border: none;
    border-bottom: 1px solid @LINE; font-size: 11px; padding: 0 3px; }
"""
_PAD, _GAP = 3.0, 6.0
"""The words of the last column stand clear of those before, which end at its edge."""
_NUMBER_PX = 48.0

_Index = QModelIndex | QPersistentModelIndex


class ServoModel(QAbstractTableModel):
    """Seven rows of cells; only cells that changed are announced, so only they are painted again."""

    def __init__(self, rows: tuple[Row, ...], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._rows = rows

    def show_rows(self, rows: tuple[Row, ...]) -> None:
        """Replace the cells; the number of rows stays."""
        old, self._rows = self._rows, rows
        for row, (before, after) in enumerate(zip(old, rows, strict=True)):
            for column, (was, now) in enumerate(zip(before, after, strict=True)):
                if was != now:
                    index = self.index(row, column)
                    self.dataChanged.emit(index, index)

    def cell(self, row: int, column: Column) -> Cell:
        return self._rows[row][_COLUMNS.index(column)]

    def rowCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own signature
        return 0 if parent.isValid() else len(self._rows)

    def columnCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own signature
        return 0 if parent.isValid() else len(_COLUMNS)

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        cell = self._rows[index.row()][index.column()]
        if role == Qt.ItemDataRole.DisplayRole:
            return cell.text
        if role == Qt.ItemDataRole.ToolTipRole:
            return cell.tip or None
        if role == Qt.ItemDataRole.AccessibleTextRole:
            return f"{tr(_COLUMNS[index.column()].value[0])} {cell.text}"
        if role == Qt.ItemDataRole.UserRole:
            return cell
        return None

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if orientation == Qt.Orientation.Horizontal:
            heading, meaning = (tr(text) for text in _COLUMNS[section].value)
            if role == Qt.ItemDataRole.DisplayRole:
                return f"  {heading}" if _COLUMNS[section] is Column.ERROR else heading
            if role == Qt.ItemDataRole.ToolTipRole:
                return meaning
            if role == Qt.ItemDataRole.TextAlignmentRole:
                side = Qt.AlignmentFlag.AlignLeft if _COLUMNS[section] in _LEFT else Qt.AlignmentFlag.AlignRight
                return side | Qt.AlignmentFlag.AlignVCenter
        return None


class ServoView(QTableView):
    """All seven rows and all columns, whatever the size; no scroll bars, no keyboard focus."""

    def __init__(self, model: ServoModel) -> None:
        super().__init__()
        self.setModel(model)
        self.setItemDelegate(ServoDelegate(self))
        theme.set_sheet(self, _STYLE)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setShowGrid(False)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.verticalHeader().hide()
        self.verticalHeader().setMinimumSectionSize(_ROW[0])
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setSectionsClickable(False)
        header.setMinimumSectionSize(20)
        header.setFixedHeight(_HEADER)
        header.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.setMinimumHeight(_HEADER + 7 * _ROW[0])
        self.setAccessibleName(tr("Servos"))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        spare = max(0, self.width() - sum(least for least, _ in _WIDTHS.values()))
        widths = [least + int(share * spare) for least, share in _WIDTHS.values()]
        widths[-1] += max(0, self.width() - sum(widths))
        for place, width in enumerate(widths):
            self.setColumnWidth(place, width)
        self.verticalHeader().setDefaultSectionSize(max(_ROW[0], min(_ROW[1], (self.height() - _HEADER) // 7)))


class ServoDelegate(QStyledItemDelegate):
    """Numbers to the right, words to the left, the position with a bar of its envelope; what is wrong is tinted."""

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        cell = index.data(Qt.ItemDataRole.UserRole)
        if not isinstance(cell, Cell):
            return
        column = _COLUMNS[index.column()]
        box = QRectF(option.rect)  # type: ignore[attr-defined]
        painter.save()
        if index.row() % 2:
            painter.fillRect(box, theme.colour(palette.RAISED, 0.45))
        if cell.tone >= Tone.WARN:
            painter.fillRect(box.adjusted(1, 0, -1, 0), theme.colour(palette.of(TONE_ROLE[cell.tone]), 0.16))
        size = 14 if box.height() >= 26 else 13 if box.height() >= 21 else 12
        text_font = theme.semi_bold(size) if column is Column.JOINT or cell.tone >= Tone.WARN else theme.font(size)
        inside = box.adjusted(_PAD + (_GAP if column is Column.ERROR else 0), 0, -_PAD, 0)
        if cell.track is not None:
            _paint_track(painter, inside.adjusted(2, 0, -_NUMBER_PX, 0), cell.track, cell.tone)
        painter.setFont(theme.fitted(text_font, cell.text, int(inside.width()), 9))
        painter.setPen(QColor(palette.of(TONE_ROLE[cell.tone])))
        side = Qt.AlignmentFlag.AlignLeft if column in _LEFT else Qt.AlignmentFlag.AlignRight
        painter.drawText(inside, side | Qt.AlignmentFlag.AlignVCenter, theme.elide(painter.font(), cell.text, int(inside.width())))
        painter.restore()


def _paint_track(painter: QPainter, box: QRectF, track: Track, tone: Tone) -> None:
    """The envelope as a strip with darker ends; a line at the goal, a block at the joint."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    strip = QRectF(box.left(), box.center().y() - 3.5, box.width(), 7.0)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(theme.colour(palette.ORANGE, 0.40))
    painter.drawRect(strip)
    painter.setBrush(QColor(palette.LINE))
    low, high = (strip.left() + share * strip.width() for share in (track.low_warn, track.high_warn))
    painter.drawRect(QRectF(low, strip.top(), high - low, strip.height()))

    def x(share: float) -> float:
        return strip.left() + max(0.0, min(1.0, share)) * strip.width()

    if track.goal is not None:
        painter.setPen(QPen(QColor(palette.TEXT_DIM), 1.5))
        painter.drawLine(QPointF(x(track.goal), strip.top() - 3), QPointF(x(track.goal), strip.bottom() + 3))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(palette.of("SKY" if tone < Tone.WARN else TONE_ROLE[tone])))
    painter.drawRect(QRectF(x(track.at) - 2.5, strip.top() - 1, 5.0, strip.height() + 2))
