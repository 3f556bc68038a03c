"""Who asked for what and what was sent, and below it how quick and how welcome the program is."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme
from app.cells import NONE, TONE_ROLE, Tone
from app.language import tr
from app.provenance import HEADINGS, LABELS, ProvenanceRow
from app.tool_tips import tip

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
        painter.fillRect(self.rect(), QColor(palette.PANEL))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        height = self.height() / _ROWS
        width = (self.width() - _LABEL_WIDTH) / len(HEADINGS)
        painter.setFont(theme.font(11))
        painter.setPen(QColor(palette.TEXT_FAINT))
        for k, heading in enumerate(HEADINGS):
            painter.drawText(QRectF(_LABEL_WIDTH + k * width, 0, width, height), _LEFT, tr(heading))
        for k, row in enumerate(self._rows):
            _paint_row(painter, QRectF(0, (k + 1) * height, self.width(), height), row, width, is_sent=k == len(self._rows) - 1)
        self._paint_measures(painter, QRectF(0, 5 * height, self.width(), height))
        painter.end()

    def _paint_measures(self, painter: QPainter, box: QRectF) -> None:
        late = self._latency_ms is not None and self._latency_ms > LATENCY_LIMIT_MS
        painter.setFont(theme.semi_bold(12))
        painter.setPen(QColor(palette.FAULT if late else palette.TEXT_DIM))
        painter.drawText(box.adjusted(4, 0, 0, 0), _LEFT, self.latency_text)
        left = box.left() + max(170.0, box.width() * 0.42)
        painter.setPen(QColor(palette.TEXT_DIM))
        painter.drawText(QRectF(left, box.top(), 166, box.height()), _LEFT, self.follow_text)
        track = QRectF(left + 170, box.center().y() - 4, box.right() - left - 170, 8)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(palette.RAISED))
        painter.drawRoundedRect(track, 3, 3)
        if self._follow is not None:
            painter.setBrush(QColor(palette.SKY))
            painter.drawRoundedRect(QRectF(track.left(), track.top(), max(3.0, self._follow * track.width()), track.height()), 3, 3)


def _paint_row(painter: QPainter, box: QRectF, row: ProvenanceRow, width: float, *, is_sent: bool) -> None:
    if is_sent:
        painter.fillRect(box, theme.colour(palette.RAISED, 0.8))
    size = 14 if box.height() >= 22 else 13
    if row.drives:
        middle = QPointF(box.left() + 7, box.center().y())
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(palette.SKY))
        painter.drawPolygon(QPolygonF([middle + QPointF(x, y) for x, y in ((-4.0, -5.0), (5.0, 0.0), (-4.0, 5.0))]))
    strong = row.drives or is_sent
    painter.setFont(theme.semi_bold(size) if strong else theme.font(size))
    painter.setPen(QColor(palette.SKY if row.drives else palette.TEXT if is_sent else palette.TEXT_DIM))
    painter.drawText(box.adjusted(16, 0, 0, 0), _LEFT, tr(row.label))
    if not row.cells:
        note_font = theme.font(size)
        painter.setFont(note_font)
        painter.setPen(QColor(palette.TEXT_FAINT))
        room = box.adjusted(_LABEL_WIDTH, 0, 0, 0)
        painter.drawText(room, _LEFT, theme.elide(note_font, row.note, int(room.width())))
    for k, cell in enumerate(row.cells):
        place = QRectF(_LABEL_WIDTH + k * width, box.top(), width - 4, box.height())
        text_font = theme.semi_bold(size) if strong or cell.tone >= Tone.WARN else theme.font(size)
        painter.setFont(theme.fitted(text_font, cell.text, int(place.width())))
        painter.setPen(QPen(QColor(palette.of(TONE_ROLE[cell.tone]))))
        painter.drawText(place, _LEFT, cell.text)
