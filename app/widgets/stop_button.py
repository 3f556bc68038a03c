"""STOP: always there, always enabled, at the first touch."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QAbstractButton, QSizePolicy

from app import palette, theme
from app.language import tr
from app.next_step import STOP_KEY
from app.widgets.signs import octagon, paint_key_cap

_DOWN = (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick)
_UP = (QEvent.Type.MouseButtonRelease, QEvent.Type.Hide, QEvent.Type.UngrabMouse)


class StopButton(QAbstractButton):
    """``asked`` comes when a mouse button, whichever, goes down, again at each press, and even when it was disabled."""

    asked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setText(tr("STOP"))
        self.setMinimumSize(88, 44)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setAccessibleName(tr("STOP"))
        self.setAccessibleDescription(tr("Stops the robot at once. Key {key}.", key=STOP_KEY))
        self.setToolTip(
            tr(
                "Stops the robot at once, in every mode  ({key})\n"
                "{key} types a space in a text field only while nothing can move; Ctrl+{key} and Pause stop there, too\n"
                "It is no emergency stop: that is the power cut, by hand, beside the robot",
                key=STOP_KEY,
            )
        )
        self.clicked.connect(self.asked)  # by keyboard or screen reader: a mouse never gets so far

    def sizeHint(self) -> QSize:
        return QSize(112, 54)

    def event(self, event: QEvent) -> bool:
        # before QWidget looks whether it is enabled, and before QAbstractButton waits for the release
        if event.type() in _DOWN:
            self.setDown(True)
            self.asked.emit()
            event.accept()
            return True
        if event.type() in _UP:
            self.setDown(False)
        return super().event(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        plate = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        back = QColor(palette.VERMILLION)
        painter.setPen(QPen(QColor(palette.TEXT), 2) if self.hasFocus() or self.underMouse() else Qt.PenStyle.NoPen)
        painter.setBrush(back.darker(150) if self.isDown() else back)
        painter.drawPolygon(octagon(plate, 12.0))
        ink = QColor(Qt.GlobalColor.white)
        painter.setPen(ink)
        painter.setFont(theme.bold(25))
        painter.drawText(plate.adjusted(0, 1, 0, -20), Qt.AlignmentFlag.AlignCenter, self.text())
        paint_key_cap(painter, QPointF(plate.center().x(), plate.bottom() - 12), STOP_KEY, ink)
        painter.end()
