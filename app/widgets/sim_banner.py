"""The permanent banner that tells a simulation, a real rig and a recording apart."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter, QPainterPath, QPaintEvent, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import mark, tr
from hardware.rig import RigKind


@dataclass(frozen=True, slots=True)
class BannerText:
    """Word, colour, a note that fits beside it, and the explanation."""

    word: str
    role: str
    note: str
    meaning: str

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return theme.of(self.role)


BANNERS = {
    RigKind.SIM: BannerText(
        mark("SIM"), "SIM", mark("simulated bench twin"), mark("Everything here is simulated; no hardware moves")
    ),
    RigKind.LIVE: BannerText(
        mark("LIVE"), "LIVE", mark("real servos move"), mark("Commands move real servos. Keep the power cut in reach")
    ),
    RigKind.PLAYBACK: BannerText(mark("PLAYBACK"), "PLAYBACK", mark("recorded, not live"), mark("Nothing here is happening now")),
}
_LOOK_ONLY = BannerText(
    mark("LIVE"), "LIVE", mark("real camera, no servos"), mark("A real camera looks; no servos that could move")
)


class SimBanner(QWidget):
    """A striped word that is always visible, and what it means."""

    def __init__(self, kind: RigKind, *, has_servos: bool = True) -> None:
        super().__init__()
        self.setFixedHeight(34)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.show_kind(kind, has_servos=has_servos)

    def show_kind(self, kind: RigKind, *, has_servos: bool = True) -> None:
        """Another rig is being opened."""
        self._text = BANNERS[kind] if has_servos or kind is not RigKind.LIVE else _LOOK_ONLY
        self.setMinimumWidth(int(self._plate_width()))  # whatever else needs room: the word is always there
        self.update()
        self.setAccessibleName(f"{tr(self._text.word)}: {tr(self._text.meaning)}")
        self.setToolTip(tr(self._text.meaning))

    @property
    def word(self) -> str:
        return self._text.word

    def sizeHint(self) -> QSize:
        return QSize(500, 34)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(_word_font())
        plate = QRectF(0, 0, self._plate_width(), self.height())
        self._paint_plate(painter, plate)
        painter.setPen(QColor(theme.INK))
        painter.drawText(plate.adjusted(24, 0, -22, 0), Qt.AlignmentFlag.AlignCenter, tr(self._text.word))
        note_font = theme.font(theme.Size.BODY)
        painter.setFont(note_font)
        painter.setPen(QColor(theme.TEXT_DIM))
        left = plate.right() + 14
        note = theme.elide(note_font, tr(self._text.note), int(self.width() - left))
        painter.drawText(QRectF(left, 0, self.width() - left, self.height()), Qt.AlignmentFlag.AlignVCenter, note)
        painter.end()

    def _plate_width(self) -> float:
        return QFontMetrics(_word_font()).horizontalAdvance(tr(self._text.word)) + 68.0

    def _paint_plate(self, painter: QPainter, plate: QRectF) -> None:
        """A plate with slanted stripes at both ends, as on a barrier: told by shape, not by colour alone."""
        clip = QPainterPath()
        clip.addRoundedRect(plate, 6, 6)
        painter.save()
        painter.setClipPath(clip)
        painter.fillRect(plate, QColor(self._text.colour))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(theme.colour(theme.INK, 0.85))
        height = plate.height()
        for left in (plate.left() - 14, plate.left() + 2, plate.right() - 22, plate.right() - 6):
            corners = [(left + 14, 0.0), (left + 22, 0.0), (left + 8, height), (left, height)]
            painter.drawPolygon(QPolygonF([QPointF(x, plate.top() + y) for x, y in corners]))
        painter.restore()


def _word_font() -> QFont:
    font = QFont(theme.bold(18))
    font.setLetterSpacing(font.SpacingType.AbsoluteSpacing, 2.0)
    return font
