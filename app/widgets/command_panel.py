"""Where every command comes from, and what the gate did to it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QLabel, QTableView, QVBoxLayout, QWidget

from app import palette, theme
from app.clamp_log import ClampLog, LogEntry, rejected_commands
from app.language import mark, tr, tr_text
from app.pace import Pace
from app.provenance import Provenance
from app.widgets.provenance_table import ProvenanceTable
from app.widgets.scroll_keys import ScrolledTable
from core.control.drive_view import DriveView

if TYPE_CHECKING:
    from hardware.servos.bus_messages import BusStatus

_SHOW_EVERY_S = 0.2
_ROW = 17
_WIDTHS = {mark("When"): 66, mark("Joint"): 68, mark("What the gate did"): 0, "\N{MULTIPLICATION SIGN}": 46}
_LOG_STYLE = """
QTableView { background: @PANEL; border: 1px solid @PANEL; font-size: 12px; }
QTableView:focus { border: 1px solid @SKY; }
"""

_Index = QModelIndex | QPersistentModelIndex


class CommandPanel(QWidget):
    """Advised, asked, commanded and sent in one table; below it what the gate limited and rejected, newest first.

    ``show_view`` may be called at any rate: every status is counted, texts are renewed five times a second at most.

    Parameters
    ----------
    clock : monotonic.
    time_of_day : for the log, as text.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        time_of_day: Callable[[], str] = lambda: time.strftime("%H:%M:%S"),
    ) -> None:
        super().__init__()
        self._time_of_day = time_of_day
        self._pace = Pace(_SHOW_EVERY_S, clock)
        self._provenance = Provenance()
        self._log = ClampLog()
        self._known = False
        self._table = ProvenanceTable()
        self._heading = QLabel(_heading(None))
        self._heading.setObjectName("card_note")
        self._heading.setFixedHeight(16)
        self._model = ClampModel(self._log, self)
        self._view = self._make_view()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(3)
        column.addWidget(self._table, 3)
        column.addWidget(self._heading)
        column.addWidget(self._view, 2)
        self.setAccessibleName(tr("Commands"))

    @property
    def text(self) -> str:
        """The provenance table and the log's heading as lines."""
        return f"{self._table.text}\n{self._heading.text()}"

    @property
    def log(self) -> ClampModel:
        return self._model

    def show_view(self, view: DriveView | None, status: BusStatus | None) -> None:
        """The newest state of driving, and of the bus; None where there is none."""
        if status is not None:
            self._log.see(status, self._time_of_day())
        known = view is not None
        if not self._pace.due() and known is self._known:
            return
        self._known = known
        latency_ms = 1000.0 * view.latency_s if view is not None and view.latency_s is not None else None
        self._table.show_rows(self._provenance.rows(view), latency_ms, view.follow_share if view is not None else None)
        self._model.renew()
        heading = _heading(status)
        if heading != self._heading.text():
            self._heading.setText(heading)

    def _make_view(self) -> QTableView:
        view = ScrolledTable(_ROW)
        view.setModel(self._model)
        theme.set_sheet(view, _LOG_STYLE)
        view.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        view.setShowGrid(False)
        view.setWordWrap(False)
        view.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        view.verticalHeader().hide()
        view.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        view.verticalHeader().setMinimumSectionSize(_ROW)
        view.verticalHeader().setDefaultSectionSize(_ROW)
        header = view.horizontalHeader()
        header.hide()
        header.setMinimumSectionSize(20)
        for place, width in enumerate(_WIDTHS.values()):
            header.setSectionResizeMode(place, QHeaderView.ResizeMode.Fixed if width else QHeaderView.ResizeMode.Stretch)
            if width:
                view.setColumnWidth(place, width)
        view.setMinimumHeight(3 * _ROW)
        view.setAccessibleName(tr("What the gate limited and rejected"))
        return view


class ClampModel(QAbstractTableModel):
    """The log as a Qt model; ``renew`` announces what has changed since the last time."""

    def __init__(self, log: ClampLog, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._log = log
        self._shown: list[LogEntry] = []

    def renew(self) -> None:
        changes = self._log.take_changes()
        if not changes.added and not changes.renewed:
            return
        if changes.added:
            fresh = min(changes.added, len(self._log.entries))
            if changes.cut and self._shown:
                first = max(0, len(self._log.entries) - fresh)
                self.beginRemoveRows(QModelIndex(), first, len(self._shown) - 1)
                del self._shown[first:]
                self.endRemoveRows()
            self.beginInsertRows(QModelIndex(), 0, fresh - 1)
            self._shown[:0] = self._log.entries[:fresh]
            self.endInsertRows()
        for row in changes.renewed:
            self._shown[row] = self._log.entries[row]
            self.dataChanged.emit(self.index(row, 0), self.index(row, len(_WIDTHS) - 1))

    def rowCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own signature
        return 0 if parent.isValid() else len(self._shown)

    def columnCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own signature
        return 0 if parent.isValid() else len(_WIDTHS)

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        entry, column = self._shown[index.row()], index.column()
        texts = (
            entry.clock,
            tr("rejected") if entry.is_rejection else tr_text(entry.joint),
            entry.text,
            f"\N{MULTIPLICATION SIGN}{entry.count}" if entry.count > 1 else "",
        )
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole):
            return texts[column]
        if role == Qt.ItemDataRole.ToolTipRole:
            return " ".join(text for text in texts if text)
        if role == Qt.ItemDataRole.ForegroundRole:
            plain = palette.TEXT_FAINT if column in (0, 3) else palette.TEXT_DIM if column == 2 else palette.TEXT
            return QColor(palette.FAULT if entry.is_rejection and column else plain)
        if role == Qt.ItemDataRole.FontRole:
            return theme.semi_bold(12) if column == 1 else theme.font(12)
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return Qt.AlignmentFlag.AlignVCenter | (Qt.AlignmentFlag.AlignRight if column == 3 else Qt.AlignmentFlag.AlignLeft)
        return None

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return tr(tuple(_WIDTHS)[section])
        return None


def _heading(status: BusStatus | None) -> str:
    if status is None:
        return tr("Gate: no servo bus")
    rejected = rejected_commands(status)
    if not status.clamp_count and not rejected:
        return tr("Gate: nothing limited or rejected yet")
    return tr("Gate: {clamped} goals limited, {rejected} commands rejected", clamped=status.clamp_count, rejected=rejected)
