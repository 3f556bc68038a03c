"""Whether a session is being recorded, for how long, and whether frames are dropped."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPainter
from PySide6.QtWidgets import QSizePolicy

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.widgets.painting import PaintedWidget, draw_box, draw_text, set_colours
from core.session.writer import RecordStatus


class RecordBar(PaintedWidget):
    """A button that begins and ends a recording; while it records it is filled and counts. ``clicked`` asks for the other state."""

    clicked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._status = RecordStatus()
        self._lines = _lines_of(self._status)
        self.setFixedSize(196, 34)
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
        """Name, description and tool tip, which changes more often than the lines do."""
        status = self._status
        facts = (
            tr("F9 begins or ends a session"),
            tr("F10 saves the last seconds without having recorded"),
            tr("M marks this moment with a number"),
            str(status.folder or ""),
            tr("{value:.1f} GB free on the disk", value=status.disk_free / 1e9) if status.disk_free is not None else "",
            tr_text(status.warning),
            tr_text(status.problem),
        )
        tool_tip = "\n".join(line for line in facts if line)
        if tool_tip != self.toolTip():
            self.setToolTip(tool_tip)
        if self.text != self.accessibleDescription():
            self.setAccessibleName(tr("Recording") if status.recording else tr("Record"))
            self.setAccessibleDescription(self.text)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.clicked.emit()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """The second half of a double click does not end at once what the first has begun."""
        event.accept()

    def paint(self, painter: QPainter) -> None:
        status, (first, second) = self._status, self._lines
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        is_marked = status.recording or status.armed or bool(status.problem)
        edge = theme.VERMILLION if is_marked else theme.LINE
        draw_box(painter, frame, 6, theme.RAISED if status.recording else theme.PANEL, edge, 1.5)
        set_colours(painter, theme.VERMILLION if status.recording else None, theme.VERMILLION, 1.5)
        painter.drawEllipse(QRectF(frame.left() + 12, frame.center().y() - 6, 12, 12))
        draw_text(painter, frame.adjusted(34, 0, 34, 0), first, theme.semi_bold(13), theme.TEXT)
        left = frame.left() + 44 + painter.fontMetrics().horizontalAdvance(first)
        room = QRectF(left, frame.top(), frame.right() - left - 6, frame.height())
        colour = theme.VERMILLION if status.problem or status.dropped else theme.TEXT_DIM
        draw_text(painter, room, second, theme.font(12), colour, elided=True)


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
