"""What widgets that paint themselves share: the paint event, texts, boxes, bars, signs and key caps."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import ClassVar, cast

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QFont,
    QFontMetrics,
    QPainter,
    QPainterPath,
    QPainterPathStroker,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme

LEFT = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft
RIGHT = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignRight
CENTER = Qt.AlignmentFlag.AlignCenter
NONE = "\N{EN DASH}"
"""Stands where a value is not known."""


def number(value: float, digits: int) -> str:
    """No minus before a zero, and a real minus sign."""
    value = round(value, digits) + 0.0
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")


class Painted:
    """Mixin of a widget that paints itself in ``paint``, with antialiasing.

    ``ground`` is the role of the palette that fills the rectangle first; empty where the widget leaves its parent visible.
    """

    ground: ClassVar[str] = ""

    def paintEvent(self, event: QPaintEvent) -> None:
        widget = cast(QWidget, self)
        painter = QPainter(widget)
        if self.ground:
            painter.fillRect(widget.rect(), QColor(theme.of(self.ground)))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self.paint(painter)
        painter.end()

    def paint(self, painter: QPainter) -> None:
        raise NotImplementedError


class PaintedWidget(Painted, QWidget):
    """A widget that paints itself.

    Parameters
    ----------
    name, tool_tip : accessible name, and what the pointer shows.
    hint, least : preferred and minimum size, px.
    height : a fixed height, px; without it the widget grows in both directions.
    """

    def __init__(
        self,
        name: str = "",
        tool_tip: str = "",
        *,
        hint: tuple[int, int] = (-1, -1),
        least: tuple[int, int] = (0, 0),
        height: int | None = None,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._hint = QSize(*hint)
        self.setMinimumSize(*least)
        if height is not None:
            self.setFixedHeight(height)
        vertical = QSizePolicy.Policy.Expanding if height is None else QSizePolicy.Policy.Fixed
        self.setSizePolicy(QSizePolicy.Policy.Expanding, vertical)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent, bool(self.ground))
        self.setAccessibleName(name)
        self.setToolTip(tool_tip)

    def sizeHint(self) -> QSize:
        return self._hint


@dataclass(frozen=True, slots=True)
class FieldLook:
    """How a mode or a priority is shown: colour (a role of the palette) and sign; ``filled`` colours all of its field."""

    role: str
    sign: Sign
    filled: bool = False
    meaning: str = ""

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return theme.of(self.role)


def text_width(font: QFont, text: str) -> int:
    return QFontMetrics(font).horizontalAdvance(text)


def draw_fitted(painter: QPainter, box: QRectF, picture: QPixmap) -> None:
    """Draw a picture as large as fits, in the middle; nothing of an empty one."""
    if not picture.isNull():
        size = picture.size().scaled(box.size().toSize(), Qt.AspectRatioMode.KeepAspectRatio)
        target = QRectF(0, 0, size.width(), size.height())
        target.moveCenter(box.center())
        painter.drawPixmap(target, picture, QRectF(picture.rect()))


def draw_text(
    painter: QPainter,
    box: QRectF,
    text: str,
    font: QFont,
    colour: str | QColor,
    align: Qt.AlignmentFlag = LEFT,
    *,
    smallest_px: int = 0,
    elided: bool = False,
) -> None:
    """Write `text` in `box`: with `smallest_px` in a smaller font where it does not fit, `elided` with an ellipsis then."""
    if smallest_px:
        font = theme.fitted(font, text, int(box.width()) - elided, smallest_px)
    painter.setFont(font)
    painter.setPen(QColor(colour))
    painter.drawText(box, align, theme.elide(font, text, int(box.width())) if elided else text)


def set_colours(
    painter: QPainter, fill: str | QColor | None = None, edge: str | QColor | QPen | None = None, width: float = 1.0
) -> None:
    """Fill and outline of the next shapes; None: without."""
    painter.setBrush(Qt.BrushStyle.NoBrush if fill is None else QColor(fill))
    if edge is None:
        painter.setPen(Qt.PenStyle.NoPen)
    else:
        painter.setPen(edge if isinstance(edge, QPen) else QPen(QColor(edge), width))


def draw_box(
    painter: QPainter,
    box: QRectF,
    radius: float,
    fill: str | QColor | None = None,
    edge: str | QColor | QPen | None = None,
    width: float = 1.0,
) -> None:
    set_colours(painter, fill, edge, width)
    painter.drawRoundedRect(box, radius, radius)


def polygon(corners: Iterable[tuple[float, float]], middle: QPointF | None = None) -> QPolygonF:
    """`corners` (x, y), around `middle` where it is given."""
    middle = middle or QPointF()
    return QPolygonF([middle + QPointF(x, y) for x, y in corners])


def draw_track(painter: QPainter, track: QRectF) -> None:
    """The ground of a bar."""
    draw_box(painter, track, 3, theme.RAISED)


def draw_bar(painter: QPainter, track: QRectF, share: float, colour: str) -> None:
    """A bar from the left of `track`, over a `share` (0..1) of it."""
    draw_box(painter, QRectF(track.left(), track.top(), max(3.0, share * track.width()), track.height()), 3, colour)


def draw_middle_bar(
    painter: QPainter, track: QRectF, share: float, colour: str, *, inset: float = 0.0, least: float = 2.0, arrow: float = 0.0
) -> None:
    """A bar from the middle of `track` to a `share` (-1..1) of its half; with `arrow` (px) a tip marks a larger share."""
    middle = track.center().x()
    end = middle + track.width() / 2 * max(-1.0, min(1.0, share))
    set_colours(painter, colour)
    painter.drawRect(QRectF(min(middle, end), track.top() + inset, max(least, abs(end - middle)), track.height() - 2 * inset))
    if arrow and abs(share) > 1.0:
        inward = math.copysign(arrow, -share)
        painter.setBrush(QColor(theme.TEXT))
        half = 5 if arrow < 8 else 7
        painter.drawPolygon(polygon([(0, 0), (inward, -half), (inward, half)], QPointF(end, track.center().y())))


def draw_tick(painter: QPainter, track: QRectF, x: float, colour: str, width: float, over: float) -> None:
    """A line across `track` that ends `over` px above and below it."""
    painter.setPen(QPen(QColor(colour), width))
    painter.drawLine(QPointF(x, track.top() - over), QPointF(x, track.bottom() + over))


# ---- signs and key caps


class Sign(Enum):
    """Small signs that tell modes and priorities apart without colour."""

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
    painter.fillPath(_sign_path(sign), ink)
    painter.restore()


def key_cap_width(key: str) -> float:
    return text_width(theme.semi_bold(theme.Size.LABEL), key) + 12.0


def paint_key_cap(painter: QPainter, middle: QPointF, key: str, ink: QColor) -> None:
    """The name of a key in a small outlined cap."""
    cap = QRectF(0, 0, key_cap_width(key), 18)
    cap.moveCenter(middle)
    edge = QColor(ink)
    edge.setAlphaF(0.55)
    draw_box(painter, cap, 4, None, edge)
    draw_text(painter, cap, key, theme.semi_bold(theme.Size.LABEL), ink, CENTER)


def octagon(box: QRectF, cut: float) -> QPolygonF:
    """`box` with its corners cut off by `cut` each way."""
    left, top, right, bottom = box.left(), box.top(), box.right(), box.bottom()
    return polygon([
        (left + cut, top), (right - cut, top), (right, top + cut), (right, bottom - cut),
        (right - cut, bottom), (left + cut, bottom), (left, bottom - cut), (left, top + cut),
    ])  # fmt: skip


@cache
def _sign_path(sign: Sign) -> QPainterPath:
    """The sign in a box of -1..1, y down."""
    match sign:
        case Sign.WHEEL:
            spokes = [[(0.0, 0.0), (0.84 * math.cos(a), 0.84 * math.sin(a))] for a in (math.radians(d) for d in (90, 210, 330))]
            return _ring(0.84, 0.26).united(_lines(0.26, *spokes)).united(_disc(0, 0, 0.28))
        case Sign.READY:
            return _ring(0.86, 0.22).united(_filled(polygon([(-0.26, -0.46), (0.54, 0.0), (-0.26, 0.46)])))
        case Sign.DRIVES:
            return _lines(0.34, *([(x, -0.66), (x + 0.66, 0.0), (x, 0.66)] for x in (-0.72, 0.06)))
        case Sign.PAUSE:
            path = QPainterPath()
            for left in (-0.68, 0.20):
                path.addRoundedRect(QRectF(left, -0.82, 0.48, 1.64), 0.1, 0.1)
            return path
        case Sign.STOP:
            bar = QPainterPath()
            bar.addRect(QRectF(-0.54, -0.18, 1.08, 0.36))
            return _filled(octagon(QRectF(-0.96, -0.96, 1.92, 1.92), 0.56)).subtracted(bar)
        case Sign.BARRED:
            return _ring(0.84, 0.28).united(_lines(0.28, [(-0.56, 0.56), (0.56, -0.56)]))
        case Sign.WARNING:
            corners = [(0.0, -0.78), (0.86, 0.72), (-0.86, 0.72)]
            plate = _lines(0.24, corners, closed=True).united(_filled(polygon(corners)))
            return plate.subtracted(_lines(0.22, [(0.0, -0.28), (0.0, 0.22)])).subtracted(_disc(0.0, 0.53, 0.13))
        case Sign.INFO:
            path = _disc(0, 0, 0.96)  # what is added inside becomes a hole
            path.addPath(_disc(0, -0.5, 0.16))
            path.addPath(_lines(0.26, [(0.0, -0.06), (0.0, 0.54)]))
            return path


def _stroker(width: float) -> QPainterPathStroker:
    stroker = QPainterPathStroker()
    stroker.setWidth(width)
    stroker.setCurveThreshold(0.005)  # the usual one is for pixels, and makes octagons of circles this small
    return stroker


def _lines(width: float, *lines: list[tuple[float, float]], closed: bool = False) -> QPainterPath:
    """Lines of some width, with round ends and corners."""
    path = QPainterPath()
    for points in lines:
        path.addPolygon(polygon(points))
        if closed:
            path.closeSubpath()
    stroker = _stroker(width)
    stroker.setCapStyle(Qt.PenCapStyle.RoundCap)
    stroker.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    return stroker.createStroke(path)


def _disc(x: float, y: float, radius: float) -> QPainterPath:
    path = QPainterPath()
    path.addEllipse(QPointF(x, y), radius, radius)
    return path


def _ring(radius: float, width: float) -> QPainterPath:
    return _stroker(width).createStroke(_disc(0, 0, radius))


def _filled(points: QPolygonF) -> QPainterPath:
    path = QPainterPath()
    path.addPolygon(points)
    path.closeSubpath()
    return path
