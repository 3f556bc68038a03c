"""Who drives, always in sight: the mode's name in a frame and a sign of its own."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter, QPainterPath, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme
from app.language import mark, tr
from app.next_step import Undriven, who_drives
from app.widgets.signs import Sign, octagon, paint_sign
from core.control.drive_view import DriveView
from core.control.modes import Mode

_SIZE = QSize(284, 34)


@dataclass(frozen=True, slots=True)
class ModeLook:
    """Colour and sign of a mode; ``filled`` where something other than the operator decides."""

    role: str
    filled: bool
    sign: Sign
    meaning: str

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return palette.of(self.role)


MODE_LOOK = {
    Mode.ADVISORY: ModeLook("SKY", False, Sign.WHEEL, mark("you steer, the program only advises")),
    Mode.ARMED: ModeLook("ORANGE", False, Sign.READY, mark("you steer; the program may be handed over to")),
    Mode.AUTONOMOUS: ModeLook("GREEN", True, Sign.DRIVES, mark("the program drives while the deadman is held")),
    Mode.HOLD: ModeLook("YELLOW", True, Sign.PAUSE, mark("the program's motion is interrupted; the robot holds")),
    Mode.STOPPED: ModeLook("VERMILLION", True, Sign.STOP, mark("nothing moves until the stop is acknowledged")),
}


class ModeBadge(QWidget):
    """Told by frame and sign as well as by colour: only ARMED has a heavy frame, AUTONOMOUS a point, STOPPED eight corners."""

    def __init__(self) -> None:
        super().__init__()
        self._mode = Mode.ADVISORY
        self._who = ""
        self.setFixedSize(_SIZE)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.show_view(None, Undriven.NOT_YET)

    @property
    def mode(self) -> Mode:
        return self._mode

    @property
    def who(self) -> str:
        """Who drives, as shown beside the mode's name."""
        return self._who

    def sizeHint(self) -> QSize:
        return _SIZE

    def show_view(self, view: DriveView | None, why_not: Undriven = Undriven.NO_ROBOT) -> None:
        """The newest view; None: there is nothing to drive, and `why_not`."""
        mode, who = view.mode if view is not None else Mode.ADVISORY, who_drives(view, why_not)
        if (mode, who) == (self._mode, self._who):
            return
        self._mode, self._who = mode, who
        self.setAccessibleName(tr("Mode: {mode}", mode=tr(mode.value)))
        self.setAccessibleDescription(who)
        self.setToolTip("\n".join(_meaning(each, each is mode) for each in Mode))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        look = MODE_LOOK[self._mode]
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1.5, 1.5, -1.5, -1.5)
        colour = QColor(look.colour)
        painter.setPen(QPen(colour, 3.0 if self._mode is Mode.ARMED else 1.5))
        painter.setBrush(colour if look.filled else QColor(palette.PANEL))
        painter.drawPath(_outline(frame, self._mode))
        ink = QColor(palette.INK) if look.filled else colour
        paint_sign(painter, QRectF(frame.left() + 9, frame.center().y() - 8.5, 17, 17), look.sign, ink)
        self._paint_words(painter, frame.adjusted(34, 0, -12, 0), ink, QColor(palette.INK if look.filled else palette.TEXT))
        painter.end()

    def _paint_words(self, painter: QPainter, room: QRectF, ink: QColor, who_ink: QColor) -> None:
        name, name_font = tr(self._mode.value), QFont(theme.bold(15))
        name_font.setLetterSpacing(QFont.SpacingType.AbsoluteSpacing, 0.4)
        painter.setFont(name_font)
        painter.setPen(ink)
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, name)
        left = QFontMetrics(name_font).horizontalAdvance(name) + 9
        painter.setFont(theme.fitted(theme.font(13), self._who, int(room.width() - left)))
        painter.setPen(who_ink)
        painter.drawText(room.adjusted(left, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, self._who)


def _meaning(mode: Mode, is_now: bool) -> str:
    arrow = "\N{RIGHTWARDS ARROW} " if is_now else ""
    return f"{arrow}{tr(mode.value)}: {tr(MODE_LOOK[mode].meaning)}"


def _outline(frame: QRectF, mode: Mode) -> QPainterPath:
    path = QPainterPath()
    if mode is Mode.STOPPED:
        path.addPolygon(octagon(frame, 9.0))
        path.closeSubpath()
    elif mode is Mode.AUTONOMOUS:
        tip, middle = frame.right() - 12, frame.center().y()
        corners = [(frame.left(), frame.top()), (tip, frame.top()), (frame.right(), middle), (tip, frame.bottom())]
        path.addPolygon(QPolygonF([QPointF(x, y) for x, y in (*corners, (frame.left(), frame.bottom()))]))
        path.closeSubpath()
    else:
        path.addRoundedRect(frame, 6, 6)
    return path
