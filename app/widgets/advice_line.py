"""What to do next, large enough to be read from two metres."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import advice_headline, tip
from core.types import Advice, PoseState, Speed

_CHEVRONS = {Speed.STOP: 0, Speed.SLOWEST: 1, Speed.SLOW: 2, Speed.MODERATE: 3, Speed.FAST: 4}


class AdviceLine(QWidget):
    """An arrow turned by the steering angle, the speed as word and as one to four chevrons, the degrees and the reason.

    Without advice it is blank and says why: an old advice is never left standing. Of a pose that is unsure it says so.
    """

    def __init__(self) -> None:
        super().__init__()
        self._advice: Advice | None = None
        self._state: PoseState | None = None
        self._why_none = tr("waiting for the first picture")
        self._is_unsure = False
        self.setFixedHeight(68)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(tr("Advice"))
        self.setToolTip(tip("advice"))

    @property
    def text(self) -> str:
        """Headline and reason as shown."""
        if self._advice is None:
            return tr("No advice: {why}", why=tr_text(self._why_none))
        return f"{advice_headline(self._advice)}: {self._why(self._advice)}"

    def sizeHint(self) -> QSize:
        return QSize(600, 68)

    def show_advice(
        self,
        advice: Advice | None,
        state: PoseState | None,
        why_none: str,
        *,
        is_unsure: bool = False,
        renew_text: bool = True,
    ) -> None:
        """The advice for `state`, whose pose may be unsure, or why there is none."""
        changed = (advice is None) is not (self._advice is None) or state is not self._state or why_none != self._why_none
        if not changed and not renew_text:
            return
        self._advice, self._state, self._why_none, self._is_unsure = advice, state, why_none, is_unsure
        self.setAccessibleDescription(self.text)
        self.update()

    def _why(self, advice: Advice) -> str:
        why = tr_text(advice.why)
        return tr("the pose is unsure; {why}", why=why) if self._is_unsure else why

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        painter.setPen(QPen(QColor(theme.LINE), 1))
        painter.setBrush(QColor(theme.PANEL))
        painter.drawRoundedRect(frame, theme.RADIUS, theme.RADIUS)
        if self._advice is None:
            self._paint_nothing(painter, frame)
        else:
            self._paint_advice(painter, frame, self._advice)
        painter.end()

    def _paint_nothing(self, painter: QPainter, frame: QRectF) -> None:
        painter.setPen(QColor(theme.TEXT_FAINT))
        painter.setFont(theme.semi_bold(20))
        painter.drawText(frame.adjusted(20, 0, -20, 0), Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, self.text)

    def _paint_advice(self, painter: QPainter, frame: QRectF, advice: Advice) -> None:
        accent = theme.STATE_COLOUR[self._state]
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(accent))
        painter.drawRoundedRect(QRectF(frame.left(), frame.top(), 6, frame.height()), 3, 3)
        _paint_arrow(painter, QPointF(frame.left() + 48, frame.center().y()), 24.0, advice.steer_deg, accent)
        _paint_chevrons(painter, QPointF(frame.left() + 92, frame.center().y()), _CHEVRONS[advice.speed], advice.advance_mm_s < 0.0)
        left = frame.left() + 168
        width = frame.right() - left - 16
        headline = advice_headline(advice)
        painter.setPen(QColor(theme.TEXT))
        painter.setFont(theme.fitted(theme.bold(theme.Size.TITLE), headline, int(width)))
        place = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft
        painter.drawText(QRectF(left, frame.top() + 6, width, 34), place, headline)
        painter.setPen(QColor(theme.FAULT if self._is_unsure else theme.TEXT_DIM))
        why_font = theme.font(15)
        painter.setFont(why_font)
        why = theme.elide(why_font, self._why(advice), int(width))
        painter.drawText(QRectF(left, frame.top() + 40, width, 22), place, why)


def _paint_arrow(painter: QPainter, middle: QPointF, size: float, turn_deg: float, colour_name: str) -> None:
    """An arrow upwards (straight on), turned clockwise by the advised steering (to the robot's right)."""
    painter.save()
    painter.translate(middle)
    painter.rotate(max(-90.0, min(90.0, turn_deg)))
    head, shaft = size * 0.62, size * 0.24
    outline = [(0, -size), (head, -size * 0.28), (shaft, -size * 0.28), (shaft, size * 0.9)]
    points = [QPointF(x, y) for x, y in outline] + [QPointF(-x, y) for x, y in reversed(outline[1:])]
    painter.setPen(theme.edge_of(colour_name))
    painter.setBrush(QColor(colour_name))
    painter.drawPolygon(QPolygonF(points))
    painter.restore()


def _paint_chevrons(painter: QPainter, left_middle: QPointF, count: int, backwards: bool) -> None:
    """Four chevrons, `count` of them lit, that point back where the advice is to retract; a square where it is to stop."""
    if count == 0:
        painter.setBrush(QColor(theme.TEXT))
        painter.drawRect(QRectF(left_middle.x() + 20, left_middle.y() - 11, 22, 22))
        return
    for k in range(max(_CHEVRONS.values())):
        pen = QPen(QColor(theme.TEXT if k < count else theme.LINE), 4.0)
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
        painter.setPen(pen)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        x = left_middle.x() + 14 * k
        dx, dy = 8 * math.cos(math.radians(30)), 10.0
        base, tip = (x + dx, x) if backwards else (x, x + dx)
        corners = [QPointF(base, left_middle.y() - dy), QPointF(tip, left_middle.y()), QPointF(base, left_middle.y() + dy)]
        painter.drawPolyline(corners)
