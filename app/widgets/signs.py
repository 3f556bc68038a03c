"""Small signs that tell modes and priorities apart without colour, and key caps."""

from __future__ import annotations

import math
from enum import Enum
from functools import cache

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPainterPath, QPainterPathStroker, QPen, QPolygonF

from app import theme


class Sign(Enum):
    """What a sign stands for."""

    WHEEL = "steering wheel"
    READY = "ready"
    DRIVES = "drives"
    PAUSE = "pause"
    STOP = "stop"
    BARRED = "barred"
    WARNING = "warning"
    INFO = "information"


def paint_sign(painter: QPainter, box: QRectF, sign: Sign, ink: QColor) -> None:
    """The sign in one colour, as large as fits into `box`."""
    painter.save()
    painter.translate(box.center())
    side = min(box.width(), box.height()) / 2
    painter.scale(side, side)
    painter.fillPath(_path(sign), ink)
    painter.restore()


def key_cap_width(key: str) -> float:
    return QFontMetrics(theme.semi_bold(theme.Size.LABEL)).horizontalAdvance(key) + 12.0


def paint_key_cap(painter: QPainter, middle: QPointF, key: str, ink: QColor) -> None:
    """The name of a key in a small outlined cap."""
    cap = QRectF(0, 0, key_cap_width(key), 18)
    cap.moveCenter(middle)
    edge = QColor(ink)
    edge.setAlphaF(0.55)
    painter.setPen(QPen(edge, 1))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawRoundedRect(cap, 4, 4)
    painter.setPen(ink)
    painter.setFont(theme.semi_bold(theme.Size.LABEL))
    painter.drawText(cap, Qt.AlignmentFlag.AlignCenter, key)


def octagon(box: QRectF, cut: float) -> QPolygonF:
    """`box` with its corners cut off by `cut` each way."""
    left, top, right, bottom = box.left(), box.top(), box.right(), box.bottom()
    corners = [
        (left + cut, top), (right - cut, top), (right, top + cut), (right, bottom - cut),
        (right - cut, bottom), (left + cut, bottom), (left, bottom - cut), (left, top + cut),
    ]  # fmt: skip
    return QPolygonF([QPointF(x, y) for x, y in corners])


@cache
def _path(sign: Sign) -> QPainterPath:
    """The sign in a box of -1..1, y down."""
    return {
        Sign.WHEEL: _wheel,
        Sign.READY: _ready,
        Sign.DRIVES: _drives,
        Sign.PAUSE: _pause,
        Sign.STOP: _stop,
        Sign.BARRED: _barred,
        Sign.WARNING: _warning,
        Sign.INFO: _info,
    }[sign]()


def _stroker(width: float) -> QPainterPathStroker:
    stroker = QPainterPathStroker()
    stroker.setWidth(width)
    stroker.setCurveThreshold(0.005)  # the usual one is for pixels, and makes octagons of circles this small
    return stroker


def _lines(width: float, *lines: list[tuple[float, float]], joined: bool = False) -> QPainterPath:
    """Open lines of some width, with round ends and corners; `joined` closes them."""
    path = QPainterPath()
    for points in lines:
        path.addPolygon(QPolygonF([QPointF(x, y) for x, y in points]))
        if joined:
            path.closeSubpath()
    stroker = _stroker(width)
    stroker.setCapStyle(Qt.PenCapStyle.RoundCap)
    stroker.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    return stroker.createStroke(path)


def _ring(radius: float, width: float) -> QPainterPath:
    path = QPainterPath()
    path.addEllipse(QPointF(0, 0), radius, radius)
    return _stroker(width).createStroke(path)


def _disc(x: float, y: float, radius: float) -> QPainterPath:
    path = QPainterPath()
    path.addEllipse(QPointF(x, y), radius, radius)
    return path


def _filled(points: QPolygonF) -> QPainterPath:
    path = QPainterPath()
    path.addPolygon(points)
    path.closeSubpath()
    return path


def _wheel() -> QPainterPath:
    spokes = [[(0.0, 0.0), (0.84 * math.cos(a), 0.84 * math.sin(a))] for a in (math.radians(d) for d in (90, 210, 330))]
    return _ring(0.84, 0.26).united(_lines(0.26, *spokes)).united(_disc(0, 0, 0.28))


def _ready() -> QPainterPath:
    return _ring(0.86, 0.22).united(_filled(QPolygonF([QPointF(-0.26, -0.46), QPointF(0.54, 0.0), QPointF(-0.26, 0.46)])))


def _drives() -> QPainterPath:
    chevrons = [[(x, -0.66), (x + 0.66, 0.0), (x, 0.66)] for x in (-0.72, 0.06)]
    return _lines(0.34, *chevrons)


def _pause() -> QPainterPath:
    path = QPainterPath()
    path.addRoundedRect(QRectF(-0.68, -0.82, 0.48, 1.64), 0.1, 0.1)
    path.addRoundedRect(QRectF(0.20, -0.82, 0.48, 1.64), 0.1, 0.1)
    return path


def _stop() -> QPainterPath:
    bar = QPainterPath()
    bar.addRect(QRectF(-0.54, -0.18, 1.08, 0.36))
    return _filled(octagon(QRectF(-0.96, -0.96, 1.92, 1.92), 0.56)).subtracted(bar)


def _barred() -> QPainterPath:
    return _ring(0.84, 0.28).united(_lines(0.28, [(-0.56, 0.56), (0.56, -0.56)]))


def _warning() -> QPainterPath:
    plate = _lines(0.24, [(0.0, -0.78), (0.86, 0.72), (-0.86, 0.72)], joined=True)
    plate = plate.united(_filled(QPolygonF([QPointF(0.0, -0.78), QPointF(0.86, 0.72), QPointF(-0.86, 0.72)])))
    return plate.subtracted(_lines(0.22, [(0.0, -0.28), (0.0, 0.22)])).subtracted(_disc(0.0, 0.53, 0.13))


def _info() -> QPainterPath:
    path = _disc(0, 0, 0.96)  # what is added inside becomes a hole
    path.addPath(_disc(0, -0.5, 0.16))
    path.addPath(_lines(0.26, [(0.0, -0.06), (0.0, 0.54)]))
    return path
