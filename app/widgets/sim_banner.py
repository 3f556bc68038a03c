"""The permanent banner that tells a simulation, a real rig and a recording apart."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QRectF
from PySide6.QtGui import QFont, QPainter, QPainterPath

from app.ui import theme
from app.ui.i18n import mark, tr
from app.widgets.painting import CENTER, PaintedWidget, draw_text, polygon, set_colours, text_width
from hardware.rig import RigKind


@dataclass(frozen=True, slots=True)
class BannerText:
    """Word, colour (a role of the palette), a note that fits beside it, and the explanation."""

    word: str
    role: str
    note: str
    meaning: str


BANNERS = {
    RigKind.SIM: BannerText(
        mark("SIM"),
        "SIM",
        mark("bench twin"),
        mark("Everything here is simulated; no hardware moves. On a busy computer the simulation runs slower"),
    ),
    RigKind.LIVE: BannerText(
        mark("LIVE"), "LIVE", mark("real servos move"), mark("Commands move real servos. Keep the power cut in reach")
    ),
    RigKind.PLAYBACK: BannerText(mark("PLAYBACK"), "PLAYBACK", mark("recorded, not live"), mark("Nothing here is happening now")),
}
_LOOK_ONLY = BannerText(
    mark("LIVE"), "LIVE", mark("real camera, no servos"), mark("A real camera looks; no servos that could move")
)


class SimBanner(PaintedWidget):
    """A striped word that is always visible, and what it means."""

    def __init__(self, kind: RigKind, *, has_servos: bool = True) -> None:
        super().__init__(hint=(500, 34), height=34)
        self.show_kind(kind, has_servos=has_servos)

    def show_kind(self, kind: RigKind, *, has_servos: bool = True) -> None:
        """The kind of the rig that is being opened."""
        self._text = BANNERS[kind] if has_servos or kind is not RigKind.LIVE else _LOOK_ONLY
        self.kind, self.percent = kind, 100
        self.setMinimumWidth(int(self._plate_width()))  # the word stays visible, whatever else needs room
        self.update()
        self.setAccessibleName(f"{tr(self._text.word)}: {tr(self._text.meaning)}")
        self.setToolTip(tr(self._text.meaning))

    def show_speed(self, speed: float) -> None:
        """How fast the simulation runs, 0..1: said where the computer is too slow for it."""
        percent = max(5, min(100, 5 * round(20.0 * speed)))
        if percent != self.percent:
            self.percent = percent
            self.update()

    @property
    def note(self) -> str:
        """What stands beside the word."""
        return tr("{percent} % speed", percent=self.percent) if self.percent < 100 else tr(self._text.note)

    @property
    def word(self) -> str:
        return self._text.word

    def paint(self, painter: QPainter) -> None:
        plate = QRectF(0, 0, self._plate_width(), self.height())
        self._paint_plate(painter, plate)
        draw_text(painter, plate.adjusted(24, 0, -22, 0), tr(self._text.word), _word_font(), theme.INK, CENTER)
        left = plate.right() + 14
        room = QRectF(left, 0, self.width() - left, self.height())
        draw_text(painter, room, self.note, theme.font(theme.Size.BODY), theme.TEXT_DIM, elided=True)

    def _plate_width(self) -> float:
        return text_width(_word_font(), tr(self._text.word)) + 68.0

    def _paint_plate(self, painter: QPainter, plate: QRectF) -> None:
        """A plate with slanted stripes at both ends, as on a barrier: shape as well as colour."""
        clip = QPainterPath()
        clip.addRoundedRect(plate, 6, 6)
        painter.save()
        painter.setClipPath(clip)
        painter.fillRect(plate, theme.colour(theme.of(self._text.role)))
        set_colours(painter, theme.colour(theme.INK, 0.85))
        height = plate.height()
        for left in (plate.left() - 14, plate.left() + 2, plate.right() - 22, plate.right() - 6):
            painter.drawPolygon(polygon([(left + 14, 0.0), (left + 22, 0.0), (left + 8, height), (left, height)]))
        painter.restore()


def _word_font() -> QFont:
    font = QFont(theme.bold(18))
    font.setLetterSpacing(font.SpacingType.AbsoluteSpacing, 2.0)
    return font
