"""What is drawn over the live picture: one item that paints the switched-on layers of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPainterPath, QPen, QPolygonF, QTransform
from PySide6.QtWidgets import QStyleOptionGraphicsItem, QWidget

from app import palette, theme
from app.scene_shapes import SceneShapes
from app.wording import signed_degrees
from core.types import Point, Points, Pose, Vector

_ARC_RADIUS = 44.0
_LABEL_GAP = 16.0
_CLEAR_OFFSET_PX = 3.0
_MARGIN = 60.0


@dataclass(frozen=True, slots=True)
class LayerText:
    """Key, label and tool tip of a layer."""

    key: str
    label: str
    meaning: str


class Layer(Enum):
    """The overlays that can be switched, in the order of their keys."""

    MASKS = LayerText("1", "Masks", "What the network took for vessel (blue) and robot (orange)")
    VESSEL = LayerText("2", "Centerline", "The vessel's centerline, from its skeleton")
    ROBOT = LayerText("3", "Robot", "The robot's path from tail to head; dotted where a gap was repaired")
    HEAD = LayerText("4", "Head", "The robot's head")
    VECTORS = LayerText("5", "Vectors", "Fitted lines of robot (40 px, yellow) and vessel (light blue), and theta between them")
    NEAREST = LayerText("6", "Nearest", "The centerline point nearest to the head")
    DISTANCES = LayerText("7", "Distances", "d_head and d_tail: from the vessel line to both ends of the robot vector")
    ROUTE = LayerText("8", "Route", "The operator's target and the way to it")
    LOUPE = LayerText("9", "Loupe", "The surroundings of the head, magnified, in a corner of the picture")


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """All that the item needs to paint. ``target`` is in source pixels."""

    shapes: SceneShapes | None
    pose: Pose | None
    target: Point | None


class OverlayItem(pg.GraphicsObject):
    """Paints in screen pixels: lines and texts keep their size at any zoom. A dark edge keeps them visible on any picture."""

    def __init__(self) -> None:
        super().__init__()
        self._overlay = Overlay(None, None, None)
        self._bounds = QRectF(0, 0, 1, 1)
        self._visible = set(Layer)
        self._head_side = self._tail_side = 1.0

    def show_overlay(self, overlay: Overlay) -> None:
        self._overlay = overlay
        if overlay.pose is not None:
            self._head_side = _steady_side(self._head_side, overlay.pose.c_head_px)
            self._tail_side = _steady_side(self._tail_side, overlay.pose.c_tail_px)
        self.update()

    def set_layer(self, layer: Layer, visible: bool) -> None:
        if visible:
            self._visible.add(layer)
        else:
            self._visible.discard(layer)
        self.update()

    def set_size(self, width: int, height: int) -> None:
        """Size of the source picture."""
        self.prepareGeometryChange()
        self._bounds = QRectF(0, 0, width, height)

    def boundingRect(self) -> QRectF:
        return self._bounds

    def paint(self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None = None) -> None:
        # the loupe shows the same values larger
        self.draw(painter, 0 if Layer.LOUPE in self._visible else 13)

    def draw(self, painter: QPainter, label_px: int) -> None:
        """Paint through the painter's transform, which maps source pixels to the screen; labels in that size, 0 for none."""
        pencil = _Pencil(painter, painter.worldTransform(), label_px)
        shapes, pose = self._overlay.shapes, self._overlay.pose
        if shapes is not None:
            if Layer.VESSEL in self._visible:
                pencil.polylines(shapes.vessel_lines, palette.VESSEL, 2.0)
            if Layer.ROUTE in self._visible and shapes.route is not None:
                pencil.polylines((shapes.route,), palette.ROUTE, 4.0, Qt.PenStyle.DashLine)
            if Layer.ROBOT in self._visible:
                _draw_robot(pencil, shapes)
            if Layer.VECTORS in self._visible:
                _draw_vectors(pencil, shapes, pose, -self._head_side)
            if Layer.DISTANCES in self._visible and pose is not None:
                _draw_distances(pencil, shapes, pose, (self._head_side, self._tail_side))
            if Layer.NEAREST in self._visible and shapes.nearest is not None:
                pencil.diamond(shapes.nearest, palette.NEAREST, 6.0)
            if Layer.HEAD in self._visible and shapes.head is not None:
                pencil.ring(shapes.head, palette.HEAD, 8.0)
        if Layer.ROUTE in self._visible and self._overlay.target is not None:
            pencil.crosshair(self._overlay.target, palette.TARGET, 13.0)


def _draw_robot(pencil: _Pencil, shapes: SceneShapes) -> None:
    if shapes.robot_line is not None:
        pencil.polylines((shapes.robot_line,), palette.ROBOT, 3.0)
    for first, second in shapes.bridges:
        pencil.polylines((np.array([first, second]),), palette.TEXT, 2.0, Qt.PenStyle.DotLine)


def _draw_vectors(pencil: _Pencil, shapes: SceneShapes, pose: Pose | None, angle_side: float) -> None:
    if shapes.vessel_vector is not None:
        pencil.arrow(shapes.vessel_vector, palette.VESSEL_VECTOR, 3.0)
    if shapes.robot_vector is not None:
        pencil.arrow(shapes.robot_vector, palette.ROBOT_VECTOR, 3.0)
    if shapes.angle_arc is None or shapes.robot_vector is None or shapes.vessel_vector is None or pose is None:
        return
    pencil.angle(shapes.robot_vector.start, shapes.angle_arc, palette.THETA)
    # on the side of the vessel where the head is not: there is the least to cover
    vessel = shapes.vessel_vector
    pencil.label_beside(vessel.center, vessel, angle_side, f"θ {signed_degrees(pose.theta_signed_deg, 0)}", palette.THETA)


def _draw_distances(pencil: _Pencil, shapes: SceneShapes, pose: Pose, sides: tuple[float, float]) -> None:
    robot, vessel = shapes.robot_vector, shapes.vessel_vector
    if robot is None or vessel is None or shapes.head_foot is None or shapes.tail_foot is None:
        return
    pencil.measure(shapes.head_foot, robot.end, palette.D_HEAD, Qt.PenStyle.SolidLine)
    pencil.measure(shapes.tail_foot, robot.start, palette.D_TAIL, Qt.PenStyle.DotLine)
    pencil.label_beside(robot.end, vessel, sides[0], f"d_head {pose.d_head_px:.0f}", palette.D_HEAD)
    pencil.label_beside(robot.start, vessel, sides[1], f"d_tail {pose.d_tail_px:.0f}", palette.D_TAIL)


def _steady_side(side: float, offset_px: float) -> float:
    """Side of the vessel line that a label is on; it changes only when the offset is clear, or labels would flicker at zero."""
    return side if abs(offset_px) < _CLEAR_OFFSET_PX else (1.0 if offset_px > 0 else -1.0)


class _Pencil:
    """Draws marks of constant screen size at source-pixel places."""

    def __init__(self, painter: QPainter, to_screen: QTransform, label_px: int) -> None:
        self._painter = painter
        self._to_screen = to_screen
        self._label_px = label_px
        self._room = QRectF(painter.window())
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
        halo = QPen(theme.colour(palette.INK, 0.55), width + 2.0)
        halo.setCapStyle(Qt.PenCapStyle.FlatCap)
        halo.setJoinStyle(Qt.PenJoinStyle.BevelJoin)
        pen = QPen(QColor(name), width, style)
        pen.setCapStyle(Qt.PenCapStyle.FlatCap if style == Qt.PenStyle.DashLine else Qt.PenCapStyle.RoundCap)
        pen.setJoinStyle(Qt.PenJoinStyle.BevelJoin)
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        # the dark edge costs a quarter without antialiasing, and the line covers its inner border
        self._painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        self._painter.setPen(halo)
        self._painter.drawPath(path)
        self._painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._painter.setPen(pen)
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
        head = QPolygonF([tip, end - direction * 5.0 + across * 7.0, end - direction * 5.0 - across * 7.0])
        self._painter.setPen(QPen(theme.colour(palette.INK, 0.55), 1.2))
        self._painter.setBrush(QColor(name))
        self._painter.drawPolygon(head)

    def angle(self, corner: Point, unit_arc: Points, name: str) -> None:
        """The arc from the vessel's direction to the robot's, the vessel's direction as a thin line through the corner."""
        middle = self._at(corner)
        arc = [middle + QPointF(x, y) * _ARC_RADIUS for x, y in unit_arc.tolist()]
        self._segment(middle, middle + (arc[0] - middle) * 1.35, palette.VESSEL_VECTOR, 1.2, Qt.PenStyle.DashLine)
        path = QPainterPath(arc[0])
        for point in arc[1:]:
            path.lineTo(point)
        self._stroke(path, name, 2.0)

    def measure(self, foot: Point, point: Point, name: str, style: Qt.PenStyle) -> None:
        """A distance from `foot` on the line to `point`."""
        self._segment(self._at(foot), self._at(point), name, 2.5, style)

    def label_beside(self, point: Point, line: Vector, side: float, text: str, name: str) -> None:
        """A text beside `point`, on one side of `line` (+1: to the right of its direction)."""
        if self._label_px == 0:
            return
        text_font = theme.semi_bold(self._label_px)
        width, height = QFontMetricsF(text_font).horizontalAdvance(text) + 12.0, self._label_px + 7.0
        across = QPointF(-line.direction[1], line.direction[0]) * side
        reach = _LABEL_GAP + (abs(across.x()) * width + abs(across.y()) * height) / 2
        middle = self._at(point) + across * reach
        box = QRectF(middle.x() - width / 2, middle.y() - height / 2, width, height)
        if any(box.intersects(other) for other in self._labels):
            box.translate(across * (height + 2.0))
        box.moveLeft(max(self._room.left() + 4, min(box.left(), self._room.right() - width - 4)))
        box.moveTop(max(self._room.top() + 4, min(box.top(), self._room.bottom() - height - 4)))
        self._labels.append(box)
        self._painter.setPen(Qt.PenStyle.NoPen)
        self._painter.setBrush(theme.colour(palette.INK, 0.72))
        self._painter.drawRoundedRect(box, 4.0, 4.0)
        self._painter.setPen(QColor(name))
        self._painter.setFont(text_font)
        self._painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)

    def ring(self, point: Point, name: str, radius: float) -> None:
        path = QPainterPath()
        path.addEllipse(self._at(point), radius, radius)
        self._stroke(path, name, 2.5)
        self._painter.setPen(Qt.PenStyle.NoPen)
        self._painter.setBrush(QColor(name))
        self._painter.drawEllipse(self._at(point), 2.0, 2.0)

    def diamond(self, point: Point, name: str, radius: float) -> None:
        at = self._at(point)
        corners = [at + QPointF(x, y) * radius for x, y in ((0, -1), (1, 0), (0, 1), (-1, 0))]
        self._painter.setPen(QPen(theme.colour(palette.INK, 0.8), 1.5))
        self._painter.setBrush(QColor(name))
        self._painter.drawPolygon(QPolygonF(corners))

    def crosshair(self, point: Point, name: str, radius: float) -> None:
        at = self._at(point)
        path = QPainterPath()
        path.addEllipse(at, radius * 0.7, radius * 0.7)
        for x, y in ((0, -1), (1, 0), (0, 1), (-1, 0)):
            path.moveTo(at + QPointF(x, y) * radius * 0.4)
            path.lineTo(at + QPointF(x, y) * radius * 1.3)
        self._stroke(path, name, 2.5)


def _unit(vector: QPointF) -> QPointF:
    length = float(np.hypot(vector.x(), vector.y()))
    return vector * (1.0 / length) if length > 1e-9 else QPointF(0.0, -1.0)
