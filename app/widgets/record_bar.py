"""Whether a session is being recorded, for how long, and how it goes."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr, tr_text
from core.session.writer import RecordStatus

_SIZE = QSize(196, 34)


class RecordBar(QWidget):
    """A button that begins and ends a recording; while it records it is filled and counts. ``clicked`` asks for the other state."""

    clicked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._status = RecordStatus()
        self._lines = (tr("Record"), "F9")
        self.setFixedSize(_SIZE)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self._describe()

    @property
    def text(self) -> str:
        """Both lines as shown."""
        return " ".join(self._lines)

    def show_status(self, status: RecordStatus) -> None:
        """Show how it is going; repaints only when something that is shown has changed."""
        self._status = status
        lines = _lines_of(status)
        has_changed, self._lines = lines != self._lines, lines
        self._describe()
        if has_changed:
            self.update()

    def _describe(self) -> None:
        """Name, description and tool tip, which tells more than the lines do, and changes without them."""
        if self._tip() != self.toolTip():
            self.setToolTip(self._tip())
        if self.text != self.accessibleDescription():
            self.setAccessibleName(tr("Recording") if self._status.recording else tr("Record"))
            self.setAccessibleDescription(self.text)

    def _tip(self) -> str:
        free = (
            tr("{value:.1f} GB free on the disk", value=self._status.disk_free / 1000000000.0)
            if self._status.disk_free is not None
            else ""
        )
        where = str(self._status.folder) if self._status.folder is not None else ""
        keys = (
            tr("F9 begins or ends a session"),
            tr("F10 saves the last seconds without having recorded"),
            tr("M marks this moment with a number"),
        )
        lines = (*keys, where, free, tr_text(self._status.warning), tr_text(self._status.problem))
        return "\n".join(line for line in lines if line)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.clicked.emit()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """One click was meant: the second would end at once what the first has begun, or begin another session."""
        event.accept()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        is_bad = bool(self._status.problem)
        is_on = self._status.recording or self._status.armed
        edge = theme.VERMILLION if is_on or is_bad else theme.LINE
        painter.setPen(QPen(QColor(edge), 1.5))
        painter.setBrush(QColor(theme.RAISED if self._status.recording else theme.PANEL))
        painter.drawRoundedRect(frame, 6, 6)
        painter.setPen(QPen(QColor(theme.VERMILLION), 1.5))
        painter.setBrush(QColor(theme.VERMILLION) if self._status.recording else Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QRectF(frame.left() + 12, frame.center().y() - 6, 12, 12))
        first, second = self._lines
        left = frame.left() + 34
        painter.setFont(theme.semi_bold(13))
        painter.setPen(QColor(theme.TEXT))
        width = painter.fontMetrics().horizontalAdvance(first)
        painter.drawText(QRectF(left, frame.top(), frame.width(), frame.height()), Qt.AlignmentFlag.AlignVCenter, first)
        painter.setFont(theme.font(12))
        painter.setPen(QColor(theme.VERMILLION if is_bad or self._status.dropped else theme.TEXT_DIM))
        room = QRectF(left + width + 10, frame.top(), frame.right() - left - width - 16, frame.height())
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, theme.elide(painter.font(), second, int(room.width())))
        painter.end()


def _lines_of(status: RecordStatus) -> tuple[str, str]:
    """What is written, large and small."""
    if status.recording:
        minutes, seconds = divmod(int(status.elapsed_s), 60)
        size = f"{status.bytes / 1e6:.0f} MB" if status.bytes < 1e9 else f"{status.bytes / 1e9:.1f} GB"
        return f"{minutes}:{seconds:02d}", tr("{count} dropped", count=status.dropped) if status.dropped else size
    if status.problem:
        return tr("Record"), tr("stopped: disk full") if status.is_disk_full else tr("stopped")
    if status.armed:
        return tr("Record"), tr("no picture yet")
    return tr("Record"), tr("saving") if status.saving else "F9"
