"""The deadman as a field on the screen: held with the mouse, lit while any deadman is held."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy

from app import palette, theme
from app.language import tr
from app.next_step import DEADMAN_KEY
from app.tool_tips import tip
from app.widgets.mouse_held import MouseHeld
from app.widgets.signs import key_cap_width, paint_key_cap


class DeadmanField(MouseHeld):
    """``held_changed`` carries whether the left mouse button holds it."""

    held_changed = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self._deadman: bool | None = None
        self._matters = False
        self.setMinimumSize(96, 44)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setAccessibleName(tr("Deadman: hold to drive ({key})", key=DEADMAN_KEY))
        self.setToolTip(tip("deadman"))
        self._describe()

    @property
    def is_lit(self) -> bool:
        return self._deadman is True

    @property
    def word(self) -> str:
        """What the program sees of the deadman."""
        return {None: tr("none"), False: tr("not held"), True: tr("held")}[self._deadman]

    def sizeHint(self) -> QSize:
        return QSize(136, 54)

    def show_deadman(self, deadman: bool | None, *, matters: bool) -> None:
        """What the program sees of all deadmen, and whether anything depends on it now."""
        if (deadman, matters) != (self._deadman, self._matters):
            self._deadman, self._matters = deadman, matters
            self._describe()
            self.update()

    def _describe(self) -> None:
        self.setAccessibleDescription(self.word)

    def on_held(self, held: bool) -> None:
        self.update()
        self.held_changed.emit(held)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        back, ink, edge = QColor(palette.RAISED), QColor(palette.TEXT), QColor(palette.TEXT_FAINT)
        if not self.isEnabled():
            back, ink, edge = QColor(palette.WINDOW), QColor(palette.TEXT_FAINT), QColor(palette.LINE)
        elif self.is_lit:
            back, ink, edge = QColor(palette.SKY), QColor(palette.INK), QColor(palette.SKY)
        elif self._held:
            edge = QColor(palette.SKY)
        elif not self._matters:
            ink, edge = QColor(palette.TEXT_DIM), QColor(palette.LINE)
        painter.setPen(QPen(edge, 3.0 if self._held and not self.is_lit else 1.5))
        painter.setBrush(back)
        painter.drawRoundedRect(frame, frame.height() / 2.6, frame.height() / 2.6)
        painter.setPen(ink)
        painter.setFont(theme.fitted(theme.bold(16), tr("Hold to drive"), int(frame.width() - 20)))
        painter.drawText(frame.adjusted(0, 4, 0, -22), Qt.AlignmentFlag.AlignCenter, tr("Hold to drive"))
        self._paint_state(painter, QPointF(frame.center().x(), frame.bottom() - 14), ink)
        painter.end()

    def _paint_state(self, painter: QPainter, middle: QPointF, ink: QColor) -> None:
        """Key cap, and beside it a dot, full when held, and the word."""
        word_font = theme.semi_bold(theme.Size.LABEL)
        cap, word = key_cap_width(DEADMAN_KEY), QFontMetrics(word_font).horizontalAdvance(self.word)
        left = middle.x() - (cap + 8 + 12 + word) / 2
        paint_key_cap(painter, QPointF(left + cap / 2, middle.y()), DEADMAN_KEY, ink)
        painter.setPen(QPen(ink, 1.5))
        painter.setBrush(ink if self.is_lit else Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QPointF(left + cap + 12, middle.y()), 3.6, 3.6)
        painter.setPen(ink)
        painter.setFont(word_font)
        painter.drawText(QRectF(left + cap + 20, middle.y() - 9, word + 4, 18), Qt.AlignmentFlag.AlignVCenter, self.word)
