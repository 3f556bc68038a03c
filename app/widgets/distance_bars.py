"""Distances of head and tail from the centerline, to their side."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme
from app.language import tr
from app.tool_tips import tip
from app.wording import side
from core.types import Pose

_RANGE_IN_LIMITS = 5.0
_NAME_PX = 56
_SMALLEST_PX = 13


class DistanceBars(QWidget):
    """Two bars that grow from the centerline to the side on which head and tail lie; the green band is what is allowed.

    Bars on opposite sides mean that the robot has crossed. A bar that leaves the range ends in an arrow.
    """

    def __init__(self, d_allow_px: float) -> None:
        super().__init__()
        self._allow_px = d_allow_px
        self._mm_per_px: float | None = None
        self._offsets: tuple[float, float] | None = None
        self._numbers: tuple[float, float] | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumSize(200, 100)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Distances from the centerline"))
        self.setToolTip(tip("d_head", "d_tail", "crossed"))

    def set_allowed(self, d_allow_px: float) -> None:
        self._allow_px = d_allow_px
        self.update()

    @property
    def texts(self) -> tuple[str, str]:
        """The numbers of d_head and d_tail."""
        if self._numbers is None:
            return "\N{EN DASH}", "\N{EN DASH}"
        return self._text(self._numbers[0]), self._text(self._numbers[1])

    def set_scale(self, mm_per_px: float | None) -> None:
        """Millimetres per working pixel beside the head; None: not calibrated, and only pixels are shown."""
        self._mm_per_px = mm_per_px

    def _text(self, offset_px: float) -> str:
        text = f"{abs(offset_px):.1f} px"
        return text if self._mm_per_px is None else f"{text} = {abs(offset_px) * self._mm_per_px:.2f} mm"

    def sizeHint(self) -> QSize:
        return QSize(240, 160)

    def show_pose(self, pose: Pose | None, *, renew_text: bool = True) -> None:
        """The bars follow at once, the numbers when it is time to renew texts."""
        if pose is None and self._offsets is None:
            return
        changed = (pose is None) is not (self._offsets is None)
        self._offsets = (pose.c_head_px, pose.c_tail_px) if pose is not None else None
        if renew_text or changed:
            self._numbers = self._offsets
            self.setAccessibleDescription("d_head {}, d_tail {}".format(*self.texts))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(palette.PANEL))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        row = (self.height() - 20) / 2
        for k, (name, colour_name) in enumerate((("d_head", palette.D_HEAD), ("d_tail", palette.D_TAIL))):
            box = QRectF(0, k * row, self.width(), row)
            self._paint_row(painter, box, k, name, colour_name)
        self._paint_axis(painter, QRectF(0, 2 * row, self.width(), 20))
        painter.end()

    def _paint_row(self, painter: QPainter, box: QRectF, index: int, name: str, colour_name: str) -> None:
        text_box = QRectF(box.left(), box.top(), box.width(), box.height() - 26)
        painter.setPen(QColor(colour_name))
        painter.setFont(theme.semi_bold(theme.Size.BODY))
        painter.drawText(text_box, Qt.AlignmentFlag.AlignBottom | Qt.AlignmentFlag.AlignLeft, name)
        painter.setPen(QColor(palette.TEXT if self._numbers is not None else palette.TEXT_FAINT))
        largest = theme.bold(max(_SMALLEST_PX, min(24, int(text_box.height() + 4))))  # in a low window the row is low, too
        painter.setFont(theme.fitted(largest, self.texts[index], int(box.width() - _NAME_PX)))
        right = Qt.AlignmentFlag.AlignBottom | Qt.AlignmentFlag.AlignRight
        painter.drawText(text_box.adjusted(0, 0, 0, 4), right, self.texts[index])
        track = QRectF(box.left(), box.bottom() - 20, box.width(), 14)
        self._paint_track(painter, track)
        if self._offsets is not None:
            self._paint_bar(painter, track, self._offsets[index], colour_name)

    def _paint_track(self, painter: QPainter, track: QRectF) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(palette.RAISED))
        painter.drawRoundedRect(track, 3, 3)
        half = track.width() / 2 / _RANGE_IN_LIMITS
        middle = track.center().x()
        painter.setBrush(theme.colour(palette.ALLOWED, 0.30))
        painter.drawRect(QRectF(middle - half, track.top(), 2 * half, track.height()))
        painter.setPen(QPen(QColor(palette.ALLOWED), 2))
        for x in (middle - half, middle + half):
            painter.drawLine(QPointF(x, track.top() - 3), QPointF(x, track.bottom() + 3))

    def _paint_bar(self, painter: QPainter, track: QRectF, offset_px: float, colour_name: str) -> None:
        span = _RANGE_IN_LIMITS * self._allow_px
        middle, half = track.center().x(), track.width() / 2
        end = middle + half * max(-1.0, min(1.0, offset_px / span))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colour_name))
        painter.drawRect(QRectF(min(middle, end), track.top() + 3, max(2.0, abs(end - middle)), track.height() - 6))
        if abs(offset_px) > span:
            inward = -8 if offset_px > 0 else 8
            tip = QPointF(end, track.center().y())
            painter.setBrush(QColor(palette.TEXT))
            painter.drawPolygon(QPolygonF([tip, tip + QPointF(inward, -7), tip + QPointF(inward, 7)]))
        painter.setPen(QPen(QColor(palette.TEXT), 2))
        painter.drawLine(QPointF(middle, track.top() - 3), QPointF(middle, track.bottom() + 3))

    def _paint_axis(self, painter: QPainter, box: QRectF) -> None:
        painter.setPen(QColor(palette.TEXT_FAINT))
        painter.setFont(theme.font(theme.Size.LABEL))
        painter.drawText(box, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, side(-1.0))
        painter.drawText(box, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, side(1.0))
        half = box.width() / 2 / _RANGE_IN_LIMITS
        for x, text in ((-half, f"{self._allow_px:g}"), (0.0, "0"), (half, f"{self._allow_px:g}")):
            label = QRectF(box.center().x() + x - 20, box.top(), 40, box.height())
            painter.drawText(label, Qt.AlignmentFlag.AlignCenter, text)
