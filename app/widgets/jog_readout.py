"""How far the head is bent and the robot in, and what the keys make of that while they are held."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from app import palette, theme
from app.language import tr
from app.tool_tips import tip
from core.control.hand import HandSpeeds

_LINE_PX, _BETWEEN_PX, _SMALLEST_PX = 17, 6, 10
_UNKNOWN = "\N{EN DASH}"


class JogReadout(QWidget):
    """Bend and pitch as bars from the middle, how far the robot is in, and below them how fast a held key changes that.

    What is not known is a dash, and a bar without a mark: it must not pass for a straight head.
    """

    def __init__(self) -> None:
        super().__init__()
        self._bend: float | None = None
        self._pitch: float | None = None
        self._insertion_mm: float | None = None
        self._speeds = ""
        self.setFixedHeight(2 * _LINE_PX)
        self.setAccessibleName(tr("Bend, pitch and insertion"))
        self._say()
        self.setToolTip(tip("bend", "pitch", "insertion", "hand_speeds"))

    @property
    def text(self) -> str:
        return tr(
            "bend {bend}, pitch {pitch}, in {inserted} mm",
            bend=_number(self._bend),
            pitch=_number(self._pitch),
            inserted=self._inserted,
        )

    @property
    def speeds(self) -> str:
        return self._speeds

    @property
    def _inserted(self) -> str:
        return _UNKNOWN if self._insertion_mm is None else f"{self._insertion_mm:.0f}"

    def show_values(self, bend: float | None, pitch: float | None, insertion_mm: float | None) -> None:
        """Shares of full pull, -1..1, and millimetres; None: not known."""
        values = (_rounded(bend, 2), _rounded(pitch, 2), _rounded(insertion_mm, 0))
        if values != (self._bend, self._pitch, self._insertion_mm):
            self._bend, self._pitch, self._insertion_mm = values
            self._say()

    def show_speeds(self, speeds: str) -> None:
        self._speeds = speeds
        self._say()

    def _say(self) -> None:
        self.setAccessibleDescription(f"{self.text}; {self._speeds}" if self._speeds else self.text)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        label = theme.font(theme.Size.LABEL)
        painter.setFont(label)
        metrics = QFontMetrics(label)
        inserted = tr("in {inserted} mm", inserted=self._inserted)
        names = (tr("bend"), tr("pitch"))
        # room for three digits, so that the bars do not grow and shrink as the robot goes in
        last_px = max(metrics.horizontalAdvance(text) for text in (inserted, tr("in {inserted} mm", inserted="000")))
        spare_px = self.width() - last_px - sum(metrics.horizontalAdvance(name) for name in names) - 4 * _BETWEEN_PX
        left = 0.0
        for name, share in zip(names, (self._bend, self._pitch), strict=True):
            painter.setPen(QColor(palette.TEXT_DIM))
            name_px = metrics.horizontalAdvance(name)
            painter.drawText(QRectF(left, 0, name_px + 1, _LINE_PX), Qt.AlignmentFlag.AlignVCenter, name)
            left += name_px + _BETWEEN_PX
            _paint_bar(painter, QRectF(left, _LINE_PX / 2 - 4, max(8.0, spare_px / 2), 8), share)
            left += max(8.0, spare_px / 2) + _BETWEEN_PX
        painter.setPen(QColor(palette.TEXT_DIM))
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(QRectF(self.width() - last_px, 0, last_px, _LINE_PX), right, inserted)
        painter.setPen(QColor(palette.TEXT_DIM if self.isEnabled() else palette.TEXT_FAINT))
        painter.setFont(theme.fitted(label, self._speeds, self.width(), _SMALLEST_PX))
        room = QRectF(0, _LINE_PX, self.width(), _LINE_PX)
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, theme.elide(painter.font(), self._speeds, self.width()))
        painter.end()


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def _number(share: float | None) -> str:
    return _UNKNOWN if share is None else f"{share:.2f}"


def _paint_bar(painter: QPainter, track: QRectF, share: float | None) -> None:
    """From the middle of `track` to the left or right; `share` is -1..1, or None."""
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(palette.RAISED))
    painter.drawRoundedRect(track, 3, 3)
    if share is None:
        return
    center = track.center().x()
    end = center + max(-1.0, min(1.0, share)) * track.width() / 2
    painter.setBrush(QColor(palette.SKY))
    painter.drawRect(QRectF(min(center, end), track.top(), max(2.0, abs(end - center)), track.height()))


def speeds_in_words(speeds: HandSpeeds) -> str:
    bend, pitch = f"{speeds.bend_mm_s:.3g}", f"{speeds.pitch_mm_s:.3g}"
    return tr(
        "feed {feed:.3g}, sheath {sheath:.3g}, wires {wires} mm/s",
        feed=speeds.advance_mm_s,
        sheath=speeds.delivery_mm_s,
        wires=bend if bend == pitch else f"{bend}/{pitch}",
    )
