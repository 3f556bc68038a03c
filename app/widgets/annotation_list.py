"""The queue: every image with its status, as a list; and how far the rater is."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QAbstractListModel, QModelIndex, QPersistentModelIndex, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QListView, QSizePolicy, QStyle, QStyledItemDelegate, QStyleOptionViewItem, QVBoxLayout, QWidget

from app import palette, theme
from app.language import mark, tr
from core.study.annotations import Status

_ROW = 30
_MARK = {Status.NEW: "", Status.BEGUN: "\N{HORIZONTAL ELLIPSIS}", Status.DONE: "\N{CHECK MARK}", Status.CANNOT_TELL: "?"}
_WORD = {
    Status.NEW: mark("new"),
    Status.BEGUN: mark("begun"),
    Status.DONE: mark("done"),
    Status.CANNOT_TELL: mark("can't tell"),
}
_ROLE = {
    Status.NEW: "TEXT_FAINT",
    Status.BEGUN: "ORANGE",
    Status.DONE: "ALLOWED",
    Status.CANNOT_TELL: "SKY",
}
_STYLE = """
QListView { background: @PANEL; outline: none; }
QScrollBar:vertical { background: transparent; width: 8px; margin: 0; }
QScrollBar::handle:vertical { background: @LINE; border-radius: 4px; min-height: 24px; }
QScrollBar::add-line:vertical, QScrollBar::sub-line:vertical { height: 0; }
QScrollBar::add-page:vertical, QScrollBar::sub-page:vertical { background: transparent; }
"""
_Index = QModelIndex | QPersistentModelIndex


class QueueModel(QAbstractListModel):
    """Rows of name, status, and whether there are masks; the window tells when one changes."""

    def __init__(self, names: list[str], status: Callable[[int], Status], has_masks: Callable[[int], bool]) -> None:
        super().__init__()
        self._names, self._status, self._has_masks = names, status, has_masks

    def rowCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own signature
        return 0 if parent.isValid() else len(self._names)

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid():
            return None
        row = index.row()
        if role == Qt.ItemDataRole.DisplayRole:
            return self._names[row]
        if role == Qt.ItemDataRole.UserRole:
            return self._status(row)
        if role == Qt.ItemDataRole.UserRole + 1:
            return self._has_masks(row)
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            masks = tr(", with masks") if self._has_masks(row) else ""
            return f"{row + 1}: {self._names[row]}: {tr(_WORD[self._status(row)])}{masks}"
        return None

    def renew(self, row: int) -> None:
        index = self.index(row)
        self.dataChanged.emit(index, index)


class _QueueRow(QStyledItemDelegate):
    """Number, name, and the status as a sign in its colour."""

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return QSize(120, _ROW)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        status, has_masks = index.data(Qt.ItemDataRole.UserRole), index.data(Qt.ItemDataRole.UserRole + 1)
        box = QRectF(option.rect).adjusted(1, 1, -1, -1)  # type: ignore[attr-defined]
        is_current = bool(option.state & QStyle.StateFlag.State_Selected)  # type: ignore[attr-defined]
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if is_current:
            painter.setPen(QPen(QColor(palette.SKY), 1.2))
            painter.setBrush(QColor(palette.RAISED))
            painter.drawRoundedRect(box, 5, 5)
        painter.setFont(theme.font(12))
        painter.setPen(QColor(palette.TEXT_FAINT))
        painter.drawText(box.adjusted(6, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, str(index.row() + 1))
        text_font = theme.semi_bold(13) if is_current else theme.font(13)
        painter.setFont(text_font)
        painter.setPen(QColor(palette.TEXT if is_current or status is Status.NEW else palette.TEXT_DIM))
        room = box.width() - 44 - 52
        painter.drawText(box.adjusted(44, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, theme.elide(text_font, index.data(), int(room)))
        right = box.right() - 8
        if has_masks:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(theme.colour(palette.VESSEL, 0.8))
            painter.drawRoundedRect(QRectF(right - 36, box.center().y() - 5, 10, 10), 3, 3)
        painter.setFont(theme.bold(14))
        painter.setPen(QColor(palette.of(_ROLE[status])))
        painter.drawText(QRectF(right - 18, box.top(), 18, box.height()), Qt.AlignmentFlag.AlignCenter, _MARK[status])
        painter.restore()


class QueueList(QWidget):
    """``chosen`` carries the row that the user wants."""

    chosen = Signal(int)

    def __init__(self, model: QueueModel) -> None:
        super().__init__()
        self._model = model
        model.setParent(self)
        self._view = QListView()
        self._view.setModel(model)
        self._view.setItemDelegate(_QueueRow(self._view))
        self._view.setUniformItemSizes(True)
        self._view.setFrameShape(QListView.Shape.NoFrame)
        self._view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        theme.set_sheet(self._view, _STYLE)
        self._view.setAccessibleName(tr("Images"))
        self._view.activated.connect(lambda index: self.chosen.emit(index.row()))
        self._view.clicked.connect(lambda index: self.chosen.emit(index.row()))
        self._progress = _ProgressBar()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(6)
        column.addWidget(self._progress)
        column.addWidget(self._view, 1)

    @property
    def progress_text(self) -> str:
        return self._progress.text

    def renew(self, row: int) -> None:
        """The status of a row has changed."""
        self._model.renew(row)

    def show_current(self, row: int) -> None:
        index = self._model.index(row)
        self._view.setCurrentIndex(index)
        self._view.scrollTo(index)

    def show_progress(self, finished: int, count: int) -> None:
        self._progress.show_progress(finished, count)

    def take_focus(self) -> None:
        self._view.setFocus()


class _ProgressBar(QWidget):
    def __init__(self) -> None:
        super().__init__()
        self._finished, self._count = 0, 0
        self.setFixedHeight(34)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(tr("Progress"))

    @property
    def text(self) -> str:
        left = self._count - self._finished
        return tr("{finished} of {count} done", finished=self._finished, count=self._count) + (
            tr(", {left} left", left=left) if left else ""
        )

    def show_progress(self, finished: int, count: int) -> None:
        self._finished, self._count = finished, count
        self.setAccessibleDescription(self.text)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(theme.semi_bold(14))
        painter.setPen(QColor(palette.TEXT))
        painter.drawText(QRectF(0, 0, self.width(), 20), Qt.AlignmentFlag.AlignVCenter, self.text)
        painter.setPen(Qt.PenStyle.NoPen)
        for share, name in ((1.0, palette.LINE), (self._finished / max(self._count, 1), palette.ALLOWED)):
            painter.setBrush(QColor(name))
            if share > 0:
                painter.drawRoundedRect(QRectF(0, 25, self.width() * share, 6), 3, 3)
        painter.end()
