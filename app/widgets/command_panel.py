"""What was advised, asked for, commanded and sent, side by side as texts. No Qt here.

What the gate limited and rejected, newest first, repeats counted. No Qt here.

Where every command comes from, and what the gate did to it.

Who asked for what and what was sent, and below it how quick and how welcome the program is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QLabel, QSizePolicy, QTableView, QVBoxLayout, QWidget

from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import SPEED_WORD, side, tip
from app.ui.workers import Pace
from app.widgets.basics import ScrolledTable
from app.widgets.servo_table import NONE, TONE_ROLE, Cell, Tone, number
from core.control.gate import RejectReason, Source
from core.control.pilot import DriveView
from core.types import Advice, Command

if TYPE_CHECKING:
    from hardware.servos.bus_ipc import BusStatus


HEADINGS = (mark("bend"), mark("pitch"), mark("advance mm/s"), mark("sheath mm/s"))
LABELS = (mark("Advised"), mark("You asked"), mark("Program"), mark("Sent"))
_SAME_BEND, _SAME_MM_S = 0.03, 0.5
_LASTING = 3
"""Renewals in a row: the speed of a single cycle of the bus swings with its period."""


@dataclass(frozen=True, slots=True)
class ProvenanceRow:
    """``cells`` under the headings; or a ``note`` instead. ``drives``: what was sent comes from here."""

    label: str
    cells: tuple[Cell, ...] = ()
    note: str = ""
    drives: bool = False


class Provenance:
    """Makes the rows; remembers for how long what was sent has differed from what was asked."""

    def __init__(self) -> None:
        self._differing = [0, 0, 0, 0]

    def rows(self, view: DriveView | None) -> tuple[ProvenanceRow, ...]:
        """Four rows in the order of ``LABELS``."""
        if view is None:
            self._differing = [0, 0, 0, 0]
            return tuple(ProvenanceRow(label, note=NONE) for label in LABELS)
        by_operator, by_program = view.sent_by is Source.OPERATOR, view.sent_by is Source.PROGRAM
        wanted = view.asked if by_operator else view.commanded if by_program else None
        return (
            _advised(view),
            ProvenanceRow(LABELS[1], _motion(view.asked, _tone(by_operator)), drives=by_operator),
            ProvenanceRow(LABELS[2], _motion(view.commanded, _tone(by_program)), drives=by_program)
            if view.commanded is not None
            else ProvenanceRow(LABELS[2], note=tr("does not drive")),
            self._sent(view.sent, wanted),
        )

    def _sent(self, sent: Command | None, wanted: Command | None) -> ProvenanceRow:
        if sent is None:
            self._differing = [0, 0, 0, 0]
            return ProvenanceRow(LABELS[3], note=tr("no motion: holding"))
        differs = _differs(sent, wanted) if wanted is not None else (False,) * 4
        self._differing = [count + 1 if now else 0 for count, now in zip(self._differing, differs, strict=True)]
        cells = tuple(
            Cell(f"\N{NOT EQUAL TO} {cell.text}", Tone.WARN, tr("limited by the gate")) if count >= _LASTING else cell
            for cell, count in zip(_motion(sent, Tone.PLAIN), self._differing, strict=True)
        )
        return ProvenanceRow(LABELS[3], cells)


def _tone(drives: bool) -> Tone:
    return Tone.PLAIN if drives else Tone.FAINT


def _advised(view: DriveView) -> ProvenanceRow:
    if view.advice is None:
        return ProvenanceRow(
            LABELS[0], note=tr("no advice: {why}", why=tr_text(str(view.blanked))) if view.blanked else tr("no advice")
        )
    none = Cell(NONE, Tone.FAINT)
    return ProvenanceRow(LABELS[0], (Cell(_turn(view.advice)), none, Cell(_speed(view.advice)), none))


def _turn(advice: Advice) -> str:
    if abs(advice.steer_deg) < 0.5:
        return tr("straight")
    return tr("{angle:.0f}° {side}", angle=abs(advice.steer_deg), side=side(advice.steer_deg))


def _speed(advice: Advice) -> str:
    return f"{number(advice.advance_mm_s, 1)} {tr(SPEED_WORD[advice.speed]).lower()}"


def _motion(command: Command | None, tone: Tone) -> tuple[Cell, ...]:
    if command is None:
        return ()
    return (
        Cell(_share(command.bend, tr("right"), tr("left")), tone),
        Cell(_share(command.pitch, tr("up"), tr("down")), tone),
        Cell(number(command.advance_mm_s, 1), tone),
        Cell(number(command.delivery_mm_s, 1), tone),
    )


def _share(value: float, positive: str, negative: str) -> str:
    if abs(value) < 0.005:
        return "0"
    return f"{abs(value):.2f} {positive if value > 0.0 else negative}"


def _differs(sent: Command, wanted: Command) -> tuple[bool, bool, bool, bool]:
    return (
        abs(sent.bend - wanted.bend) > _SAME_BEND,
        abs(sent.pitch - wanted.pitch) > _SAME_BEND,
        abs(sent.advance_mm_s - wanted.advance_mm_s) > _SAME_MM_S,
        abs(sent.delivery_mm_s - wanted.delivery_mm_s) > _SAME_MM_S,
    )


MAX_ENTRIES = 500
_LOOK_BACK = 30
_BURST_S = 1.0
"""The same thing again within so long is counted, not told again."""
_IDLE = frozenset({RejectReason.NO_COMMAND, RejectReason.NOT_ARMED})
"""Nobody moves the robot, and so it holds: nothing was refused."""


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One burst: ``text`` is its newest event's, ``clock`` the time of day of its first; ``joint`` is empty for rejections."""

    clock: str
    joint: str
    text: str
    count: int
    last_s: float
    key: Hashable
    serial: int

    @property
    def is_rejection(self) -> bool:
        return not self.joint


@dataclass(frozen=True, slots=True)
class LogChanges:
    """Since the last look: entries that were put before the others, rows that were renewed (after that), entries that were cut."""

    added: int
    renewed: tuple[int, ...]
    cut: int


def rejected_commands(status: BusStatus) -> int:
    """How often something that was asked for was refused as a whole."""
    return sum(count for reason, count in status.rejections.items() if reason not in _IDLE)


class ClampLog:
    """Fed with every status that the window sees.

    It sees fewer than there are cycles of the bus, so clamps are samples; ``BusStatus.clamp_count`` counts all of them. Rejections
    are taken from the status' own counts, and none is missed.
    """

    def __init__(self) -> None:
        self.entries: list[LogEntry] = []
        self._cycle: int | None = None
        self._rejections: dict[RejectReason, int] = {}
        self._serial = self._added = self._cut = 0
        self._renewed: set[int] = set()

    def see(self, status: BusStatus, clock: str) -> None:
        """Take in a status; `clock` is the time of day for people."""
        if self._cycle is None or status.cycle < self._cycle:  # the first of a bus process: what it counted before is no news
            self._rejections = dict(status.rejections)
        elif status.cycle == self._cycle:
            return
        self._cycle = status.cycle
        for clamp in status.clamps:
            text = (
                f"{number(clamp.asked_mm, 2)} \N{RIGHTWARDS ARROW} {number(clamp.allowed_mm, 2)} mm, {tr_text(clamp.limit.value)}"
            )
            self._tell((clamp.joint, clamp.limit), clamp.joint, text, 1, status.time_s, clock)
        for joint in status.at_end:
            self._tell((joint, "end"), joint, tr("stopped at the end of its envelope"), 1, status.time_s, clock)
        for reason, count in status.rejections.items():
            more = count - self._rejections.get(reason, 0)
            if more > 0 and reason not in _IDLE:
                known = status.rejection is not None and status.rejection.reason is reason and status.rejection.detail
                self._tell(reason, "", f"{reason.value}: {known}" if known else reason.value, more, status.time_s, clock)
        self._rejections = dict(status.rejections)

    def take_changes(self) -> LogChanges:
        """What a view has to do to be up to date."""
        newest = self._serial
        rows = sorted(newest - serial for serial in self._renewed if newest - serial < len(self.entries))
        changes = LogChanges(self._added, tuple(rows), self._cut)
        self._added = self._cut = 0
        self._renewed.clear()
        return changes

    def _tell(self, key: Hashable, joint: str, text: str, count: int, now_s: float, clock: str) -> None:
        for row, entry in enumerate(self.entries[:_LOOK_BACK]):
            if entry.key == key and 0.0 <= now_s - entry.last_s <= _BURST_S:
                # a detail that was seen once is worth more than a newer count without one
                kept = entry.text if entry.is_rejection and ":" not in text else text
                self.entries[row] = replace(entry, text=kept, count=entry.count + count, last_s=now_s)
                self._renewed.add(entry.serial)
                return
        self._serial += 1
        self.entries.insert(0, LogEntry(clock, joint.replace("_", " "), text, count, now_s, key, self._serial))
        self._added += 1
        if len(self.entries) > MAX_ENTRIES:
            del self.entries[MAX_ENTRIES:]
            self._cut += 1


LATENCY_LIMIT_MS = 100.0
_LABEL_WIDTH = 100.0
_ROWS = 6  # headings, four rows, measures
_LEFT = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft


class ProvenanceTable(QWidget):
    """A mark stands before the row that drives; what the gate sent differently is marked with an unequal sign."""

    def __init__(self) -> None:
        super().__init__()
        self._rows: tuple[ProvenanceRow, ...] = tuple(ProvenanceRow(label, note=NONE) for label in LABELS)
        self._latency_ms: float | None = None
        self._follow: float | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumSize(300, _ROWS * 17)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Advice, commands and what was sent"))
        self.setToolTip(tip("commands", "capture_to_servo", "following"))

    @property
    def text(self) -> str:
        """All that is shown, as lines."""
        lines = [
            f"{tr('drives: ') if row.drives else ''}{tr(row.label)}: "
            + (row.note or ", ".join(f"{tr(head)} {cell.text}" for head, cell in zip(HEADINGS, row.cells, strict=True)))
            for row in self._rows
        ]
        return "\n".join([*lines, self.latency_text, self.follow_text])

    @property
    def latency_text(self) -> str:
        if self._latency_ms is None:
            return tr("capture \N{RIGHTWARDS ARROW} servo {time}", time=NONE)
        late = "! " if self._latency_ms > LATENCY_LIMIT_MS else ""
        return tr("capture \N{RIGHTWARDS ARROW} servo {time}", time=f"{late}{self._latency_ms:.0f} ms")

    @property
    def follow_text(self) -> str:
        share = NONE if self._follow is None else f"{100 * self._follow:.0f} %"
        return tr("following the advice {share}", share=share)

    def sizeHint(self) -> QSize:
        return QSize(440, _ROWS * 20)

    def show_rows(self, rows: tuple[ProvenanceRow, ...], latency_ms: float | None, follow: float | None) -> None:
        """Repaints when something changed that can be read."""
        latency_ms = None if latency_ms is None else float(round(latency_ms))
        follow = None if follow is None else round(follow, 2)
        if (rows, latency_ms, follow) != (self._rows, self._latency_ms, self._follow):
            self._rows, self._latency_ms, self._follow = rows, latency_ms, follow
            self.setAccessibleDescription(self.text)
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme.PANEL))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        height = self.height() / _ROWS
        width = (self.width() - _LABEL_WIDTH) / len(HEADINGS)
        painter.setFont(theme.font(11))
        painter.setPen(QColor(theme.TEXT_FAINT))
        for k, heading in enumerate(HEADINGS):
            painter.drawText(QRectF(_LABEL_WIDTH + k * width, 0, width, height), _LEFT, tr(heading))
        for k, row in enumerate(self._rows):
            _paint_row(painter, QRectF(0, (k + 1) * height, self.width(), height), row, width, is_sent=k == len(self._rows) - 1)
        self._paint_measures(painter, QRectF(0, 5 * height, self.width(), height))
        painter.end()

    def _paint_measures(self, painter: QPainter, box: QRectF) -> None:
        late = self._latency_ms is not None and self._latency_ms > LATENCY_LIMIT_MS
        painter.setFont(theme.semi_bold(12))
        painter.setPen(QColor(theme.FAULT if late else theme.TEXT_DIM))
        painter.drawText(box.adjusted(4, 0, 0, 0), _LEFT, self.latency_text)
        left = box.left() + max(170.0, box.width() * 0.42)
        painter.setPen(QColor(theme.TEXT_DIM))
        painter.drawText(QRectF(left, box.top(), 166, box.height()), _LEFT, self.follow_text)
        track = QRectF(left + 170, box.center().y() - 4, box.right() - left - 170, 8)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.RAISED))
        painter.drawRoundedRect(track, 3, 3)
        if self._follow is not None:
            painter.setBrush(QColor(theme.SKY))
            painter.drawRoundedRect(QRectF(track.left(), track.top(), max(3.0, self._follow * track.width()), track.height()), 3, 3)


def _paint_row(painter: QPainter, box: QRectF, row: ProvenanceRow, width: float, *, is_sent: bool) -> None:
    if is_sent:
        painter.fillRect(box, theme.colour(theme.RAISED, 0.8))
    size = 14 if box.height() >= 22 else 13
    if row.drives:
        middle = QPointF(box.left() + 7, box.center().y())
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.SKY))
        painter.drawPolygon(QPolygonF([middle + QPointF(x, y) for x, y in ((-4.0, -5.0), (5.0, 0.0), (-4.0, 5.0))]))
    strong = row.drives or is_sent
    painter.setFont(theme.semi_bold(size) if strong else theme.font(size))
    painter.setPen(QColor(theme.SKY if row.drives else theme.TEXT if is_sent else theme.TEXT_DIM))
    painter.drawText(box.adjusted(16, 0, 0, 0), _LEFT, tr(row.label))
    if not row.cells:
        note_font = theme.font(size)
        painter.setFont(note_font)
        painter.setPen(QColor(theme.TEXT_FAINT))
        room = box.adjusted(_LABEL_WIDTH, 0, 0, 0)
        painter.drawText(room, _LEFT, theme.elide(note_font, row.note, int(room.width())))
    for k, cell in enumerate(row.cells):
        place = QRectF(_LABEL_WIDTH + k * width, box.top(), width - 4, box.height())
        text_font = theme.semi_bold(size) if strong or cell.tone >= Tone.WARN else theme.font(size)
        painter.setFont(theme.fitted(text_font, cell.text, int(place.width())))
        painter.setPen(QPen(QColor(theme.of(TONE_ROLE[cell.tone]))))
        painter.drawText(place, _LEFT, cell.text)


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
            plain = theme.TEXT_FAINT if column in (0, 3) else theme.TEXT_DIM if column == 2 else theme.TEXT
            return QColor(theme.FAULT if entry.is_rejection and column else plain)
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
