"""The signed angle between robot and vessel on a dial."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPixmap

from app.ui import theme
from app.ui.texts import side, signed_degrees, tip
from app.widgets.painting import CENTER, NONE, PaintedWidget, draw_text, set_colours
from core.types import Pose

_OVERFLOW_DEG = 22.0  # how far the dial goes on below 90 degrees, for all angles up to 180
_SMALL_PX = 66.0  # below this radius the number needs the room of the outermost labels


class ThetaGauge(PaintedWidget):
    """A half circle from -90 (left) over 0 (along the vessel) to +90 degrees (right); 90..180 is squeezed into the ends below it.

    The green arc is what counts as "along the vessel". Without a pose the needle is gone and the number is a dash.
    """

    ground = "PANEL"

    def __init__(self, theta_allow_deg: float) -> None:
        super().__init__("theta", tip("theta"), hint=(240, 160), least=(200, 100))
        self._allow_deg = theta_allow_deg
        self._theta_deg: float | None = None
        self._number: float | None = None
        self._scale: QPixmap | None = None

    @property
    def text(self) -> str:
        return NONE if self._number is None else signed_degrees(self._number, 1)

    @property
    def direction(self) -> str:
        return "" if self._number is None or abs(self._number) < 0.05 else side(self._number)

    def show_pose(self, pose: Pose | None, *, renew_text: bool = True) -> None:
        """The needle follows at once, the number when it is time to renew texts."""
        if pose is None and self._theta_deg is None:
            return
        changed = (pose is None) is not (self._theta_deg is None)
        self._theta_deg = pose.theta_signed_deg if pose is not None else None
        if renew_text or changed:
            self._number = self._theta_deg
            self.setAccessibleDescription(f"theta {self.text} {self.direction}")
        self.update()

    def follow_theme(self) -> None:
        self._scale = None

    def set_allowed(self, theta_allow_deg: float) -> None:
        self._allow_deg, self._scale = theta_allow_deg, None
        self.update()

    def paint(self, painter: QPainter) -> None:
        # room: tick labels outside the arc, the number under the hub
        radius = min(self.width() / 2 - 30.0, self.height() - 72.0)
        hub = QPointF(self.width() / 2, 22.0 + radius)
        painter.drawPixmap(0, 0, self._dial(hub, radius))
        if self._theta_deg is not None:
            _paint_needle(painter, hub, radius, self._theta_deg)
        self._paint_number(painter, hub, radius)

    def _dial(self, hub: QPointF, radius: float) -> QPixmap:
        """The scale, painted once per size: it costs more than the needle and never changes."""
        size = self.size() * self.devicePixelRatioF()
        if self._scale is None or self._scale.size() != size:
            self._scale = QPixmap(size)
            self._scale.setDevicePixelRatio(self.devicePixelRatioF())
            self._scale.fill(QColor(theme.PANEL))
            painter = QPainter(self._scale)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            self._paint_scale(painter, hub, radius)
            painter.end()
        return self._scale

    def _paint_scale(self, painter: QPainter, hub: QPointF, radius: float) -> None:
        rim = QRectF(hub.x() - radius, hub.y() - radius, 2 * radius, 2 * radius)
        beyond = theme.colour(theme.LINE, 0.55)
        _paint_arc(painter, rim, -90, 90, QColor(theme.LINE))
        for low in (-180, 90):
            _paint_arc(painter, rim, low, low + 90, beyond)
        _paint_arc(painter, rim, -self._allow_deg, self._allow_deg, QColor(theme.ALLOWED))
        for degrees in range(-90, 91, 15):
            major = degrees % 45 == 0
            painter.setPen(QPen(QColor(theme.TEXT_DIM if major else theme.TEXT_FAINT), 1.6 if major else 1.0))
            painter.drawLine(_on_dial(hub, radius - (12 if major else 8), degrees), _on_dial(hub, radius - 4, degrees))
            if major:
                _paint_label(painter, _on_dial(hub, radius + 15, degrees), f"{abs(degrees)}")
        for degrees in (-180, 180) if radius >= _SMALL_PX else ():
            _paint_label(painter, _on_dial(hub, radius + 17, degrees), "180")

    def _paint_number(self, painter: QPainter, hub: QPointF, radius: float) -> None:
        is_small = radius < _SMALL_PX
        number = QRectF(hub.x() - 90, hub.y() + 10, 180, 34)
        font = theme.bold(26 if is_small else theme.Size.NUMBER)
        draw_text(painter, number, self.text, font, theme.TEXT if self._number is not None else theme.TEXT_FAINT, CENTER)
        for sign in (-1.0, 1.0):
            box = QRectF(hub.x() + sign * radius * 0.56 - 30, hub.y() - 20, 60, 20)
            if is_small:  # on so small a dial they would lie on ticks and needle: beside the number
                box = QRectF(hub.x() + sign * 84 - 30, hub.y() + 17, 60, 20)
            colour = theme.TEXT if side(sign) == self.direction else theme.TEXT_FAINT
            draw_text(painter, box, side(sign), theme.semi_bold(13), colour, CENTER)


def _paint_arc(painter: QPainter, rim: QRectF, low: float, high: float, colour: QColor) -> None:
    set_colours(painter, None, QPen(colour, 8, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
    first, last = _dial_angle(high), _dial_angle(low)
    painter.drawArc(rim, round((90 - first) * 16), round((first - last) * 16))


def _paint_label(painter: QPainter, middle: QPointF, text: str) -> None:
    box = QRectF(middle.x() - 20, middle.y() - 10, 40, 20)
    draw_text(painter, box, text, theme.font(theme.Size.LABEL), theme.TEXT_DIM, CENTER)


def _paint_needle(painter: QPainter, hub: QPointF, radius: float, theta_deg: float) -> None:
    tip_at = _on_dial(hub, radius - 2, theta_deg)
    direction = (tip_at - hub) * (1.0 / max(radius - 2, 1.0))
    across = QPointF(-direction.y(), direction.x())
    set_colours(painter, theme.THETA, theme.PANEL, 1.5)
    painter.drawPolygon([tip_at, hub + across * 6, hub - direction * 12, hub - across * 6])
    painter.setBrush(QColor(theme.TEXT))
    painter.drawEllipse(hub, 4.0, 4.0)


def _dial_angle(theta_deg: float) -> float:
    """Where an angle of -180..180 lies on the dial: true up to 90 degrees, squeezed beyond."""
    beyond = max(0.0, abs(theta_deg) - 90.0)
    return math.copysign(min(abs(theta_deg), 90.0) + beyond / 90.0 * _OVERFLOW_DEG, theta_deg)


def _on_dial(hub: QPointF, radius: float, theta_deg: float) -> QPointF:
    turn = math.radians(_dial_angle(theta_deg))
    return QPointF(hub.x() + radius * math.sin(turn), hub.y() - radius * math.cos(turn))
