"""Whether the wires of each tendon pair are as tight as they should be."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme
from app.cells import NONE, TONE_ROLE, Tone, number
from app.language import tr, tr_text
from app.servo_cells import PairBalance
from app.tool_tips import tip

_HEIGHT = 33
_ROLE = {**TONE_ROLE, Tone.PLAIN: "ALLOWED"}
_RANGE = 1.25


class TendonBalance(QWidget):
    """Two bars that grow from the middle: to the left when a pair of wires hangs slack, to the right when it is too tight.

    Half a pair's pretension off is worth a warning; the marks show where that begins.
    """

    def __init__(self) -> None:
        super().__init__()
        self._pairs: tuple[PairBalance, ...] = ()
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setFixedHeight(_HEIGHT)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(tr("Balance of the tendon pairs"))
        self.setToolTip(tip("tendon_balance"))

    @property
    def texts(self) -> tuple[str, ...]:
        """What is said of each pair, in full."""
        return tuple(f"{_title(pair)}: {_sum(pair)}{_word(pair)}{_forces(pair)}" for pair in self._pairs)

    def sizeHint(self) -> QSize:
        return QSize(440, _HEIGHT)

    def show_pairs(self, pairs: tuple[PairBalance, ...]) -> None:
        if pairs != self._pairs:
            self._pairs = pairs
            self.setAccessibleDescription("; ".join(self.texts))
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(palette.PANEL))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        width = (self.width() - 16.0) / 2
        for k, pair in enumerate(self._pairs):
            _paint_pair(painter, QRectF(k * (width + 16.0), 0, width, self.height()), pair)
        painter.end()


def _title(pair: PairBalance) -> str:
    return f"{tr_text(pair.names[0])} + {tr_text(pair.names[1])}"


def _total(pair: PairBalance) -> str:
    return NONE if pair.sum_mm is None else number(pair.sum_mm, 2)


def _sum(pair: PairBalance) -> str:
    return tr("{total} of {wanted_mm:.2f} mm", total=_total(pair), wanted_mm=pair.wanted_mm)


def _word(pair: PairBalance) -> str:
    return f", {pair.word}" if pair.word else ""


def _forces(pair: PairBalance) -> str:
    if pair.forces_n is None:
        return ""
    one, other = (number(force, 1 if abs(force) < 100.0 else 0) for force in pair.forces_n)
    return f", {one} / {other} N"


def _paint_pair(painter: QPainter, box: QRectF, pair: PairBalance) -> None:
    text_box = QRectF(box.left(), box.top(), box.width(), 16)
    name = palette.of(_ROLE[pair.tone])
    warns = pair.tone >= Tone.WARN
    title = f"! {_title(pair)} {pair.word}:" if warns else f"{_title(pair)} "
    right = _forces(pair).removeprefix(", ")
    painter.setFont(theme.semi_bold(12) if warns else theme.font(12))
    painter.setPen(QColor(name if warns else palette.TEXT_DIM))
    advance = painter.fontMetrics().horizontalAdvance
    choices = (f"{title} {_sum(pair)}", f"{title} {_total(pair)} mm")
    left = next((text for text in choices if advance(text) + advance(right) + 8 <= text_box.width()), choices[-1])
    if advance(left) + advance(right) + 8 > text_box.width():
        right = ""
    painter.drawText(text_box, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, left)
    painter.setPen(QColor(palette.TEXT_DIM))
    painter.setFont(theme.font(12))
    painter.drawText(text_box, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignRight, right)
    track = QRectF(box.left(), box.top() + 20, box.width(), 8)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(palette.RAISED))
    painter.drawRoundedRect(track, 3, 3)
    _paint_bar(painter, track, pair.share, name)


def _paint_bar(painter: QPainter, track: QRectF, share: float | None, name: str) -> None:
    middle, half = track.center().x(), track.width() / 2 / _RANGE
    painter.setPen(QPen(QColor(palette.TEXT_FAINT), 1))
    for mark in (-0.5, 0.5):
        painter.drawLine(QPointF(middle + mark * half, track.top() - 1), QPointF(middle + mark * half, track.bottom() + 1))
    if share is not None:
        end = middle + half * max(-_RANGE, min(_RANGE, share))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(name))
        painter.drawRect(QRectF(min(middle, end), track.top() + 1, abs(end - middle), track.height() - 2))
        if abs(share) > _RANGE:
            inward = -7 if share > 0 else 7
            tip = QPointF(end, track.center().y())
            painter.setBrush(QColor(palette.TEXT))
            painter.drawPolygon(QPolygonF([tip, tip + QPointF(inward, -5), tip + QPointF(inward, 5)]))
    painter.setPen(QPen(QColor(palette.TEXT), 2))
    painter.drawLine(QPointF(middle, track.top() - 3), QPointF(middle, track.bottom() + 3))
