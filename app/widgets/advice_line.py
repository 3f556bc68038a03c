"""What to do next, large enough to be read from two metres."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import advice_headline, override_line, tip
from app.widgets.painting import PaintedWidget, draw_box, draw_text, polygon, set_colours
from core.types import Advice, PoseState, Speed

_CHEVRONS = {Speed.STOP: 0, Speed.SLOWEST: 1, Speed.SLOW: 2, Speed.MODERATE: 3, Speed.FAST: 4}


class AdviceLine(PaintedWidget):
    """An arrow turned by the steering angle, the speed as word and as one to four chevrons, the degrees and the reason.

    Arrow and chevrons point up to advance, and down to back off, as the keys do; Stop is a square. Where the way decides, not the
    state, it says so, as the badge does. Without advice it is blank and says why. Where the pose is unsure it says so.
    """

    def __init__(self) -> None:
        super().__init__(tr("Advice"), tip("advice"), hint=(600, 68), height=68)
        self._advice: Advice | None = None
        self._state: PoseState | None = None
        self._why_none = tr("waiting for the first picture")
        self._is_unsure = False

    @property
    def text(self) -> str:
        """Headline and reason as shown."""
        if self._advice is None:
            return tr("No advice: {why}", why=tr_text(self._why_none))
        return f"{advice_headline(self._advice)}: {self._why(self._advice)}"

    def show_advice(
        self,
        advice: Advice | None,
        state: PoseState | None,
        why_none: str,
        *,
        is_unsure: bool = False,
        renew_text: bool = True,
    ) -> None:
        """The advice for `state`, whose pose may be unsure, or the reason why there is no advice."""
        changed = (advice is None) is not (self._advice is None) or state is not self._state or why_none != self._why_none
        if not changed and not renew_text:
            return
        self._advice, self._state, self._why_none, self._is_unsure = advice, state, why_none, is_unsure
        self.setAccessibleDescription(self.text)
        self.update()

    def _why(self, advice: Advice) -> str:
        why = "; ".join(part for part in (tr_text(advice.why), override_line(advice, self._state)) if part)
        return tr("the pose is unsure; {why}", why=why) if self._is_unsure else why

    def paint(self, painter: QPainter) -> None:
        frame, advice = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), self._advice
        draw_box(painter, frame, theme.RADIUS, theme.PANEL, theme.LINE)
        if advice is None:
            draw_text(painter, frame.adjusted(20, 0, -20, 0), self.text, theme.semi_bold(20), theme.TEXT_FAINT)
            return
        accent = theme.STATE_COLOUR[self._state]
        draw_box(painter, QRectF(frame.left(), frame.top(), 6, frame.height()), 3, accent)
        is_back = advice.advance_mm_s < 0.0
        if advice.speed is not Speed.STOP:
            _paint_arrow(painter, QPointF(frame.left() + 48, frame.center().y()), 24.0, advice.steer_deg, accent, is_back=is_back)
        _paint_chevrons(painter, QPointF(frame.left() + 92, frame.center().y()), _CHEVRONS[advice.speed], is_back=is_back)
        left = frame.left() + 168
        headline = QRectF(left, frame.top() + 6, frame.right() - left - 16, 34)
        draw_text(painter, headline, advice_headline(advice), theme.bold(theme.Size.TITLE), theme.TEXT, smallest_px=11)
        why = QRectF(left, frame.top() + 40, headline.width(), 22)
        colour = theme.FAULT if self._is_unsure else theme.TEXT_DIM
        draw_text(painter, why, self._why(advice), theme.font(15), colour, smallest_px=11, elided=True)


def _paint_arrow(painter: QPainter, middle: QPointF, size: float, turn_deg: float, colour: str, *, is_back: bool) -> None:
    """An arrow upwards (straight on), turned clockwise by the advised steering (to the robot's right).

    Backing off, it points down, and its upper end, where the head is, leans to the side to which the head turns.
    """
    painter.save()
    painter.translate(middle)
    painter.rotate(max(-90.0, min(90.0, turn_deg)))
    if is_back:
        painter.scale(1.0, -1.0)
    head, shaft = size * 0.62, size * 0.24
    right = [(0, -size), (head, -size * 0.28), (shaft, -size * 0.28), (shaft, size * 0.9)]
    set_colours(painter, colour, theme.edge_of(colour))
    painter.drawPolygon(polygon([*right, *((-x, y) for x, y in reversed(right[1:]))]))
    painter.restore()


def _paint_chevrons(painter: QPainter, left_middle: QPointF, count: int, *, is_back: bool) -> None:
    """Four chevrons, `count` of them lit, that point up, or down where the advice is to back off; a square where it is to stop."""
    if count == 0:
        set_colours(painter, theme.TEXT)
        painter.drawRect(QRectF(left_middle.x() + 20, left_middle.y() - 11, 22, 22))
        return
    across, along = 5.5, 4.5
    tip_y = along if is_back else -along
    for k in range(max(_CHEVRONS.values())):
        pen = QPen(QColor(theme.TEXT if k < count else theme.LINE), 3.5)
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
        set_colours(painter, None, pen)
        middle = left_middle + QPointF(across + 16 * k, 0)
        painter.drawPolyline(polygon([(-across, -tip_y), (0.0, tip_y), (across, -tip_y)], middle))
