"""Beside the PLAYBACK banner: what was recorded, SIM or LIVE, on which rig, when."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme
from app.language import tr, tr_text
from core.session.manifest import Manifest

_KNOWN = ("SIM", "LIVE", "PLAYBACK")
_HEIGHT = 34


class RecordedPlate(QWidget):
    """An outlined word, never filled as the banner of something that happens now."""

    def __init__(self, manifest: Manifest | None, name: str) -> None:
        super().__init__()
        self._kind = manifest.kind if manifest is not None else "UNKNOWN"
        self._manifest, self._name = manifest, name
        self._note = ""
        self.setFixedHeight(_HEIGHT)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.show_written(False)

    def show_written(self, is_written: bool) -> None:
        """Whether it is still being recorded: what has not ended yet was not cut off."""
        self._note = _note(self._manifest, self._name, is_written=is_written)
        self.setAccessibleName(self.text)
        self.setToolTip(self.text)
        self.update()

    @property
    def text(self) -> str:
        """All that is said."""
        return tr("recorded {kind}, {note}", kind=tr_text(self._kind), note=self._note)

    def sizeHint(self) -> QSize:
        return QSize(420, _HEIGHT)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        colour = QColor(palette.of(self._kind if self._kind in _KNOWN else "FAULT"))
        word, word_font = tr("recorded {kind}", kind=tr_text(self._kind)), theme.bold(14)
        plate = QRectF(1, 3, QFontMetrics(word_font).horizontalAdvance(word) + 24, _HEIGHT - 6)
        pen = QPen(colour, 2, Qt.PenStyle.DashLine)
        painter.setPen(pen)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRoundedRect(plate, 6, 6)
        painter.setFont(word_font)
        painter.setPen(colour)
        painter.drawText(plate, Qt.AlignmentFlag.AlignCenter, word)
        note_font = theme.font(theme.Size.BODY)
        painter.setFont(note_font)
        painter.setPen(QColor(palette.TEXT_DIM))
        left = plate.right() + 12
        room = QRectF(left, 0, max(0.0, self.width() - left), self.height())
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, theme.elide(note_font, self._note, int(room.width())))
        painter.end()


def _note(manifest: Manifest | None, name: str, *, is_written: bool) -> str:
    if manifest is None:
        return tr("{name}: its manifest is damaged", name=name)
    started = manifest.started_utc.astimezone()
    how = "" if manifest.closed else tr(", being recorded") if is_written else tr(", cut off")
    how += tr(", recovered") if manifest.recovered is not None else ""
    return tr("{started:%Y-%m-%d %H:%M:%S}, rig {name}{how}", started=started, name=manifest.rig or tr("unknown"), how=how)
