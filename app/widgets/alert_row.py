"""One alert over the live picture: how urgent it is, what is the matter and what to do."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontMetrics, QMouseEvent, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app import palette, theme
from app.language import tr, tr_text
from app.next_step import sentence
from app.widgets.signs import Sign, paint_sign
from core.control.alerts import Alert, Priority

FULL, COMPACT = 44, 26
"""Heights of a row with two lines and with one, px."""
_PLATE, _GAP, _CROSS = 44, 12, 9


@dataclass(frozen=True, slots=True)
class PriorityLook:
    """How urgent, by colour and sign; ``filled`` colours all of the row."""

    role: str
    sign: Sign
    filled: bool = False

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return palette.of(self.role)


LOOK = {
    Priority.HINT: PriorityLook("SKY", Sign.INFO),
    Priority.WARNING: PriorityLook("ORANGE", Sign.WARNING),
    Priority.HOLD: PriorityLook("YELLOW", Sign.PAUSE),
    Priority.DISARM: PriorityLook("VERMILLION", Sign.BARRED),
    Priority.STOP: PriorityLook("VERMILLION", Sign.STOP, filled=True),
}


@dataclass(frozen=True, slots=True)
class ShownAlert:
    """An alert with how often it came, its turn and when it last mattered."""

    alert: Alert
    times: int
    turn: int
    last_s: float

    @property
    def text(self) -> str:
        detail = f" ({tr_text(self.alert.detail)})" if self.alert.detail else ""
        times = f" \N{MULTIPLICATION SIGN}{self.times}" if self.times > 1 else ""
        return f"{sentence(f'{tr(self.alert.spec.text)}{detail}{times}')} {sentence(self.alert.spec.what_to_do)}"


class AlertRow(QWidget):
    """One alert; two lines where it is high enough. ``dismissed`` carries its key."""

    dismissed = Signal(object)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.entry: ShownAlert | None = None
        self._hidden = 0
        self._is_pressed = False
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def show_entry(self, entry: ShownAlert | None, hidden: int) -> None:
        """`hidden` is how many more there are without a row."""
        if (entry, hidden) != (self.entry, self._hidden):
            self.entry, self._hidden = entry, hidden
            if entry is not None:
                self.setAccessibleName(entry.text)
                self.setToolTip(f"{entry.text}\n{tr('Click to dismiss')}")
            self.update()
        self.setVisible(entry is not None)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Taken here, so that no destination is set behind it."""
        self._is_pressed = True
        event.accept()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Its second half is not for the alert that has taken the place of the dismissed one: nobody has read that yet."""
        event.accept()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        was_pressed, self._is_pressed = self._is_pressed, False
        if was_pressed and self.entry is not None and self.rect().contains(event.position().toPoint()):
            self.dismissed.emit(self.entry.alert.key)

    def needed_width(self, entry: ShownAlert, *, full: bool) -> int:
        """Of a row that shows all of `entry`, with room for its counts."""
        words = max(sum(QFontMetrics(f).horizontalAdvance(t) + _GAP for t, f in line) for line in _lines(entry, full=full))
        notes = QFontMetrics(theme.semi_bold(14)).horizontalAdvance("\N{MULTIPLICATION SIGN}99")
        return _PLATE + _GAP + words + notes + 14 + _CROSS + _GAP + 4

    # ---- the look

    def paintEvent(self, event: QPaintEvent) -> None:
        entry = self.entry
        if entry is None:
            return
        look = LOOK[entry.alert.spec.priority]
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        colour = QColor(look.colour)
        outline = QPainterPath()
        outline.addRoundedRect(frame, 7, 7)
        painter.fillPath(outline, colour if look.filled else QColor(palette.PANEL))
        plate = QRectF(frame.left(), frame.top(), _PLATE, frame.height())
        painter.save()
        painter.setClipPath(outline)
        painter.fillRect(plate, colour)
        painter.restore()
        painter.setPen(QPen(colour, 1.5))
        painter.drawPath(outline)
        ink = QColor(palette.INK)
        side = 24.0 if self.height() >= FULL else 18.0
        middle = plate.center()
        paint_sign(painter, QRectF(middle.x() - side / 2, middle.y() - side / 2, side, side), look.sign, ink)
        room = frame.adjusted(_PLATE + _GAP, 0, -_GAP, 0)
        room.setRight(self._paint_right(painter, room, QColor(ink if look.filled else palette.TEXT_DIM)))
        self._paint_words(painter, room, entry, *((ink, ink) if look.filled else (QColor(palette.TEXT), QColor(palette.TEXT_DIM))))
        painter.end()

    def _paint_right(self, painter: QPainter, room: QRectF, ink: QColor) -> float:
        """A cross and the counts; returns where the room for words ends."""
        arm = _CROSS / 2
        middle = QPointF(room.right() - arm, room.center().y())
        painter.setPen(QPen(ink, 1.6))
        for corner in (QPointF(arm, arm), QPointF(arm, -arm)):
            painter.drawLine(middle - corner, middle + corner)
        text, note_font = self._note(), theme.semi_bold(14)
        painter.setFont(note_font)
        width = QFontMetrics(note_font).horizontalAdvance(text)
        left = room.right() - _CROSS - 14 - width
        painter.drawText(QRectF(left, room.top(), width + 2, room.height()), Qt.AlignmentFlag.AlignVCenter, text)
        return left - _GAP

    def _note(self) -> str:
        """How often it came, and how many more there are."""
        notes = []
        if self.entry is not None and self.entry.times > 1:
            notes.append(f"\N{MULTIPLICATION SIGN}{self.entry.times}")
        if self._hidden:
            notes.append(tr("+{count} more", count=self._hidden))
        return "   ".join(notes)

    def _paint_words(self, painter: QPainter, room: QRectF, entry: ShownAlert, ink: QColor, dim: QColor) -> None:
        lines = _lines(entry, full=self.height() >= FULL)
        height = (room.height() - 4) / len(lines)
        for k, parts in enumerate(lines):
            line = QRectF(room.left(), room.top() + 2 + k * height, room.width(), height)
            inks = (ink, dim) if k == 0 else (dim,)
            self._paint_line(
                painter, line, *((text, text_font, tint) for (text, text_font), tint in zip(parts, inks, strict=False))
            )

    @staticmethod
    def _paint_line(painter: QPainter, room: QRectF, *parts: tuple[str, QFont, QColor]) -> None:
        """Texts after each other, each with its font and ink; the last one is cut where there is no more room."""
        left = room.left()
        for text, text_font, ink in parts:
            width = room.right() - left
            if width < 24 or not text:
                break
            smaller = theme.fitted(text_font, text, int(width), text_font.pixelSize() - 2)
            painter.setFont(smaller)
            painter.setPen(ink)
            shown = theme.elide(smaller, text, int(width))
            painter.drawText(QRectF(left, room.top(), width, room.height()), Qt.AlignmentFlag.AlignVCenter, shown)
            left += QFontMetrics(smaller).horizontalAdvance(shown) + _GAP


def _lines(entry: ShownAlert, *, full: bool) -> tuple[tuple[tuple[str, QFont], ...], ...]:
    """The texts of each line with their fonts; the first one is the alert's name."""
    spec, what_to_do = entry.alert.spec, sentence(entry.alert.spec.what_to_do)
    if not full:
        return (((tr(spec.text), theme.bold(15)), (what_to_do, theme.font(13))),)
    return ((tr(spec.text), theme.bold(16)), (tr_text(entry.alert.detail), theme.font(13))), ((what_to_do, theme.font(14)),)
