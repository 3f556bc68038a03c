"""A message over the live picture: starting, no new picture, recording over, fault."""

from __future__ import annotations

from enum import Enum
from math import ceil

from PySide6.QtCore import QEvent, QObject, QRectF, QSize, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget

from app import palette, theme
from app.language import tr, tr_text


class NoticeKind(Enum):
    """How serious it is: the colour of the edge, as a role of the palette."""

    PROGRESS = "SKY"
    WARNING = "SIM"
    FAULT = "FAULT"


_WIDEST_PX, _EDGE_PX, _TITLE_PX, _DETAIL_PX, _FOOT_PX, _BUTTON_PX = 560, 20, 54, 62, 16, 46
_SIZES_PX = (14, 13, 12, 11)
_WRAPPED = int(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop | Qt.TextFlag.TextWordWrap)


class Notice(QWidget):
    """A card in the middle of its parent. PROGRESS has a moving bar; a fault or an ended recording has a button to start again.

    It is as high as its text needs: what to do stands at the end of it.
    """

    restart = Signal()

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._parent = parent
        self._kind = NoticeKind.PROGRESS
        self._title = ""
        self._detail = ""
        self._phase = 0.0
        self._timer = QTimer(self)
        self._timer.setInterval(50)
        self._timer.timeout.connect(self._move_bar)
        self._button = QPushButton(tr("Start again  (F5)"))
        self._button.setFocusPolicy(Qt.FocusPolicy.TabFocus)  # a click must not take the keys from the robot
        self._button.clicked.connect(self.restart)
        column = QVBoxLayout(self)
        column.setContentsMargins(24, 24, 24, 20)
        column.addStretch(1)
        column.addWidget(self._button, 0, Qt.AlignmentFlag.AlignHCenter)
        parent.installEventFilter(self)
        self.hide()

    @property
    def text(self) -> str:
        return f"{self._title}. {self._detail}" if self._detail else self._title

    def sizeHint(self) -> QSize:
        return QSize(520, 170)

    def show_notice(self, kind: NoticeKind, title: str, detail: str = "", *, restartable: bool = False) -> None:
        self._kind, self._title, self._detail = kind, tr_text(title), tr_text(detail)
        self._button.setVisible(restartable)
        self.setAccessibleName(self.text)
        self.setToolTip(self.text)
        if kind is NoticeKind.PROGRESS:
            self._timer.start()
        else:
            self._timer.stop()
        self._place()
        self.show()
        self.raise_()
        self.update()

    def clear(self) -> None:
        self._timer.stop()
        self.hide()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self._place()
        return False

    def _place(self) -> None:
        room = self._parent.rect()
        width = min(_WIDEST_PX, room.width() - 2 * _EDGE_PX)
        self.resize(width, self.height())
        needed = max(_DETAIL_PX, self._detail_height(_SIZES_PX[0]))
        height = self._around + min(needed, max(_DETAIL_PX, room.height() - _EDGE_PX - self._around))
        self.setGeometry((room.width() - width) // 2, (room.height() - height) // 2, width, height)

    @property
    def _around(self) -> int:
        """What is not the detail's, of the height."""
        return _TITLE_PX + _FOOT_PX + (_BUTTON_PX if self._button.isVisibleTo(self) else 0)

    def _detail_height(self, size_px: int) -> int:
        room = QRectF(0, 0, self.width() - 2 - 2 * _EDGE_PX, 0)
        return ceil(QFontMetricsF(theme.font(size_px)).boundingRect(room, _WRAPPED, self._detail).height())

    @Slot()
    def _move_bar(self) -> None:
        self._phase = (self._phase + 0.02) % 1.0
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        painter.setPen(QPen(QColor(palette.of(self._kind.value)), 2))
        painter.setBrush(theme.colour(palette.PANEL, 0.96))
        painter.drawRoundedRect(frame, 10, 10)
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.fitted(theme.bold(22), self._title, int(frame.width() - 40)))
        painter.drawText(QRectF(20, 16, frame.width() - 40, 32), Qt.AlignmentFlag.AlignCenter, self._title)
        painter.setPen(QColor(palette.TEXT_DIM))
        room = QRectF(_EDGE_PX, _TITLE_PX, frame.width() - 2 * _EDGE_PX, self.height() - self._around)
        size_px = next((size for size in _SIZES_PX if self._detail_height(size) <= room.height()), _SIZES_PX[-1])
        painter.setFont(theme.font(size_px))
        painter.drawText(room, _WRAPPED, self._detail)
        if self._kind is NoticeKind.PROGRESS:
            self._paint_bar(painter, QRectF(60, frame.bottom() - 26, frame.width() - 120, 6))
        painter.end()

    def _paint_bar(self, painter: QPainter, track: QRectF) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(palette.RAISED))
        painter.drawRoundedRect(track, 3, 3)
        width = track.width() * 0.28
        left = track.left() - width + (track.width() + width) * self._phase
        bar = QRectF(max(left, track.left()), track.top(), 0, track.height())
        bar.setRight(min(left + width, track.right()))
        painter.setBrush(QColor(palette.of(self._kind.value)))
        painter.drawRoundedRect(bar, 3, 3)
