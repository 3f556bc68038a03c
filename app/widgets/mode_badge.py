"""Who drives: in this program the operator does, and the badge says so."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme


class ModeBadge(QWidget):
    """The mode's name in a frame. ADVISORY is the only mode there is: the program advises and never moves the robot by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.setFixedSize(214, 34)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Mode: ADVISORY")
        self.setToolTip("ADVISORY: you steer, the program only advises. It is the only mode of this version.")

    def sizeHint(self) -> QSize:
        return QSize(214, 34)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        painter.setPen(QPen(QColor(palette.SKY), 1.5))
        painter.setBrush(QColor(palette.PANEL))
        painter.drawRoundedRect(frame, 6, 6)
        name_font = QFont(theme.bold(15))
        name_font.setLetterSpacing(name_font.SpacingType.AbsoluteSpacing, 1.0)
        painter.setFont(name_font)
        width = painter.fontMetrics().horizontalAdvance("ADVISORY")
        painter.setPen(QColor(palette.SKY))
        painter.drawText(frame.adjusted(14, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, "ADVISORY")
        painter.setFont(theme.font(13))
        painter.setPen(QColor(palette.TEXT_DIM))
        painter.drawText(frame.adjusted(14 + width + 12, 0, -8, 0), Qt.AlignmentFlag.AlignVCenter, "you steer")
        painter.end()
