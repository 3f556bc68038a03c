"""Draws marks of constant screen size at places of the source picture, on a widget or a QImage."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QLineF, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen, QPolygonF, QTransform

from app.ui import theme
from app.ui.theme import ON_PICTURE
from app.widgets.painting import CENTER, Sign, draw_box, draw_text, paint_sign, polygon, set_colours
from core import geometry
from core.types import Point, Points, Vector

_ARC_RADIUS = 44.0
_LABEL_GAP = 16.0  # from a point to its label
_LABEL_PLACES = ((0, 0), (1, 0), (0, -1), (0, 1), (2, 0), (1, -1), (1, 1))
"""Rows outward and places along the line, in order of preference: beside its point first."""
_MARGIN = 60.0  # around the visible part, in which lines are still drawn
_TAG_PX = 15
_TUBE_MIN, _TUBE_DASH = 14.0, 6.0  # least width, and length of a dash
_DIAMOND = ((0, -1), (1, 0), (0, 1), (-1, 0))
_EDGE = theme.colour(ON_PICTURE.INK, 0.55)


class ScenePainter:
    """Lines have a dark edge that keeps them visible on any picture; labels keep out of each other's way.

    Parameters
    ----------
    painter : of a widget, a QPicture or a QImage; its transformation is reset.
    to_screen : from source pixels (pixel (0, 0) covers 0..1) to the painter's pixels.
    label_px : text size of labels, 0 for none.
    room : the visible part, by default all that is painted on.
    smooth : the dark edges are antialiased, too, which takes four times as long.
    """

    def __init__(
        self, painter: QPainter, to_screen: QTransform, label_px: int, room: QRectF | None = None, *, smooth: bool = False
    ) -> None:
        self._smooth = smooth
        self._painter = painter
        self._to_screen = to_screen
        self._label_px = label_px
        self._room = QRectF(painter.window()) if room is None else room
        self._labels: list[QRectF] = []
        painter.resetTransform()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)

    def _at(self, point: Point) -> QPointF:
        # pixel centres are at integers, the picture's pixel (0, 0) covers 0..1 in the scene
        return self._to_screen.map(QPointF(point[0] + 0.5, point[1] + 0.5))

    def _path(self, lines: tuple[Points, ...]) -> QPainterPath:
        """All polylines as one path on the screen; what lies outside is left out, because stroking it costs as much."""
        points = np.concatenate(lines) + 0.5
        connect = np.ones(len(points), np.int32)
        connect[np.cumsum([len(line) for line in lines]) - 1] = 0
        t, room = self._to_screen, self._room
        x = points[:, 0] * t.m11() + points[:, 1] * t.m21() + t.dx()
        y = points[:, 0] * t.m12() + points[:, 1] * t.m22() + t.dy()
        inside = (x > room.left() - _MARGIN) & (x < room.right() + _MARGIN)
        inside &= (y > room.top() - _MARGIN) & (y < room.bottom() + _MARGIN)
        connect[:-1] &= inside[:-1] | inside[1:]
        path: QPainterPath = pg.arrayToQPath(x, y, connect=connect, finiteCheck=False)
        return path

    def _stroke(self, path: QPainterPath, name: str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> None:
        bevel, flat = Qt.PenJoinStyle.BevelJoin, Qt.PenCapStyle.FlatCap
        cap = flat if style == Qt.PenStyle.DashLine else Qt.PenCapStyle.RoundCap
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        # the dark edge costs a quarter without antialiasing, and the line covers its inner border
        self._painter.setRenderHint(QPainter.RenderHint.Antialiasing, self._smooth)
        self._painter.setPen(QPen(_EDGE, width + 2.0, Qt.PenStyle.SolidLine, flat, bevel))
        self._painter.drawPath(path)
        self._painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._painter.setPen(QPen(QColor(name), width, style, cap, bevel))
        self._painter.drawPath(path)

    def polylines(self, lines: tuple[Points, ...], name: str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> None:
        lines = tuple(line for line in lines if len(line) > 1)
        if lines:
            self._stroke(self._path(lines), name, width, style)

    def _segment(self, first: QPointF, second: QPointF, name: str, width: float, style: Qt.PenStyle) -> None:
        path = QPainterPath(first)
        path.lineTo(second)
        self._stroke(path, name, width, style)

    def arrow(self, vector: Vector, name: str, width: float) -> None:
        start, end = self._at(vector.start), self._at(vector.end)
        direction = _unit(end - start)
        across = QPointF(-direction.y(), direction.x())
        self._segment(start, end, name, width, Qt.PenStyle.SolidLine)
        tip = end + direction * 9.0
        set_colours(self._painter, name, _EDGE, 1.2)
        self._painter.drawPolygon([tip, end - direction * 5.0 + across * 7.0, end - direction * 5.0 - across * 7.0])

    def angle(self, corner: Point, unit_arc: Points, name: str) -> None:
        """The arc from the vessel's direction to the robot's, the vessel's direction as a thin line through the corner."""
        middle = self._at(corner)
        arc = [middle + QPointF(x, y) * _ARC_RADIUS for x, y in unit_arc.tolist()]
        self._segment(middle, middle + (arc[0] - middle) * 1.35, ON_PICTURE.VESSEL_VECTOR, 1.2, Qt.PenStyle.DashLine)
        path = QPainterPath()
        path.addPolygon(arc)
        self._stroke(path, name, 2.0)

    def tube(self, line: Points, name: str, width_px: float) -> None:
        """A see-through tube along `line` (N, 2), `width_px` wide in the picture, with broken edges and an arrow at its end."""
        t = self._to_screen
        half = max(_TUBE_MIN, width_px * float(np.hypot(t.m11(), t.m12()))) / 2
        way = geometry.resample(on_screen(line, t), _TUBE_DASH)
        if len(way) < 2:
            return
        across = half * geometry.normals(way)
        edges = [[QPointF(*at) for at in edge.tolist()] for edge in (way - across, way + across)]
        # dashes as pieces of their own: Qt's dashed pens cost three times as much
        dashes = [QLineF(edge[k], edge[k + 1]) for edge in edges for k in range(0, len(way) - 1, 2)]
        end, ahead = QPointF(*way[-1].tolist()), _unit(QPointF(*(way[-1] - way[-2]).tolist())) * (half + 8.0)
        aside = QPointF(-ahead.y(), ahead.x())
        self._painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)  # the dashes cover the border
        set_colours(self._painter, theme.colour(name, 0.45))
        self._painter.drawPolygon(QPolygonF(edges[0] + edges[1][::-1]))
        self._painter.setPen(QPen(theme.colour(ON_PICTURE.INK, 0.65), 4.0, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
        self._painter.drawLines(dashes)
        self._painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._painter.setPen(QPen(QColor(ON_PICTURE.TEXT), 2.2, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
        self._painter.drawLines(dashes)
        self._painter.setBrush(QColor(name))
        self._painter.drawPolygon(QPolygonF([end + ahead * 1.35, end + aside, end - aside]))

    def band(self, low: Points, high: Points, name: str) -> None:
        """A see-through area between two lines (N, 2)."""
        if len(low) < 2:
            return
        edges = [[QPointF(*at) for at in on_screen(line, self._to_screen).tolist()] for line in (low, high)]
        set_colours(self._painter, theme.colour(name, 0.6))
        self._painter.drawPolygon(QPolygonF(edges[0] + edges[1][::-1]))
        self._painter.setPen(QPen(_EDGE, 1.2))
        for edge in edges:
            self._painter.drawPolyline(edge)

    def warning(self, point: Point, text: str, name: str) -> None:
        """A warning sign at a place, and a text beside it."""
        at = self._at(point)
        sign = QRectF(at.x() - 11.0, at.y() - 11.0, 22.0, 22.0)
        paint_sign(self._painter, sign.adjusted(-2.0, -2.0, 2.0, 2.0), Sign.WARNING, QColor(ON_PICTURE.INK))
        paint_sign(self._painter, sign, Sign.WARNING, QColor(name))
        if text:
            text_font = theme.semi_bold(_TAG_PX)
            width, height = QFontMetricsF(text_font).horizontalAdvance(text) + 14.0, _TAG_PX + 9.0
            lefts = (at.x() + 20.0, at.x() - 20.0 - width)
            boxes = [self._inside(QRectF(left, at.y() - height / 2, width, height)) for left in lefts]
            box = min(boxes, key=lambda one: self._covered(one) + (1e6 if one.intersects(sign) else 0.0))
            self._labels += [sign, box]
            self._text_box(box, text, text_font, name)

    def measure(self, foot: Point, point: Point, name: str, style: Qt.PenStyle) -> None:
        """A distance from `foot` on the line to `point`."""
        self._segment(self._at(foot), self._at(point), name, 2.5, style)

    def label_beside(self, point: Point, line: Vector, side: float, text: str, name: str) -> None:
        """A text beside `point`, on one side of `line` (+1: to the right of its direction)."""
        if self._label_px == 0:
            return
        text_font = theme.semi_bold(self._label_px)
        width, height = QFontMetricsF(text_font).horizontalAdvance(text) + 12.0, self._label_px + 7.0
        along = QPointF(*line.direction)
        across = QPointF(-along.y(), along.x()) * side
        reach = _LABEL_GAP + (abs(across.x()) * width + abs(across.y()) * height) / 2
        step = abs(along.x()) * width + abs(along.y()) * height
        boxes = []
        for out in (across, -across):
            for row, place in _LABEL_PLACES:
                middle = self._at(point) + out * (reach + row * (height + 2.0)) + along * (place * step)
                boxes.append(self._inside(QRectF(middle.x() - width / 2, middle.y() - height / 2, width, height)))
        box = min(boxes, key=self._covered)
        self._labels.append(box)
        self._text_box(box, text, text_font, name)

    def _covered(self, box: QRectF) -> float:
        """How much of other labels it would cover."""
        both = (box.intersected(other) for other in self._labels)
        return sum(part.width() * part.height() for part in both)

    def _inside(self, box: QRectF) -> QRectF:
        """Moved into the room, as far as it has room."""
        left = max(self._room.left() + 4, min(box.left(), self._room.right() - box.width() - 4))
        top = max(self._room.top() + 4, min(box.top(), self._room.bottom() - box.height() - 4))
        return QRectF(left, top, box.width(), box.height())

    def tag(self, point: Point, text: str, name: str) -> None:
        """A text of fixed size below `point`, or above it or lower where another label is; kept inside the window."""
        text_font = theme.semi_bold(_TAG_PX)
        width, height = QFontMetricsF(text_font).horizontalAdvance(text) + 14.0, _TAG_PX + 9.0
        at = self._at(point)
        below = QRectF(at.x() - width / 2, at.y() + 20.0, width, height)
        below.moveLeft(max(self._room.left() + 4, min(below.left(), self._room.right() - width - 4)))
        above = below.translated(0.0, -40.0 - height)
        next_row = below.translated(0.0, height + 2.0)
        top, bottom = self._room.top() + 4, self._room.bottom() - 4
        places = [box for box in (below, above, next_row) if top <= box.top() and box.bottom() <= bottom]
        free = [box for box in places if not any(box.intersects(other) for other in self._labels)]
        self._text_box((free or places or [above])[0], text, text_font, name)

    def _text_box(self, box: QRectF, text: str, font: QFont, name: str) -> None:
        draw_box(self._painter, box, 4.0, theme.colour(ON_PICTURE.INK, 0.72))
        draw_text(self._painter, box, text, font, name, CENTER)

    def ring(self, point: Point, name: str, radius: float) -> None:
        path = QPainterPath()
        path.addEllipse(self._at(point), radius, radius)
        self._stroke(path, name, 2.5)
        set_colours(self._painter, name)
        self._painter.drawEllipse(self._at(point), 2.0, 2.0)

    def diamond(self, point: Point, name: str, radius: float) -> None:
        set_colours(self._painter, name, theme.colour(ON_PICTURE.INK, 0.8), 1.5)
        self._painter.drawPolygon(polygon([(x * radius, y * radius) for x, y in _DIAMOND], self._at(point)))

    def crosshair(self, point: Point, name: str, radius: float) -> None:
        at = self._at(point)
        self._labels.append(QRectF(at.x() - radius, at.y() - radius, 2 * radius, 2 * radius))
        path = QPainterPath()
        path.addEllipse(at, radius * 0.7, radius * 0.7)
        for x, y in _DIAMOND:
            path.moveTo(at + QPointF(x, y) * radius * 0.4)
            path.lineTo(at + QPointF(x, y) * radius * 1.3)
        self._stroke(path, name, 2.5)


def on_screen(places: Points, to_screen: QTransform) -> Points:
    """Places (N, 2) of the source picture on the screen."""
    x, y = places[:, 0] + 0.5, places[:, 1] + 0.5  # as ScenePainter._at
    t = to_screen
    return np.column_stack([x * t.m11() + y * t.m21() + t.dx(), x * t.m12() + y * t.m22() + t.dy()])


def _unit(vector: QPointF) -> QPointF:
    length = float(np.hypot(vector.x(), vector.y()))
    return vector * (1.0 / length) if length > 1e-9 else QPointF(0.0, -1.0)
