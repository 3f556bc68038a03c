"""Draws an annotation over its picture: lines, the 40 px that count, angle, masks, and the algorithm's proposal."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF, QTransform
from PySide6.QtGui import QPainterPath as Path

from app import theme
from app.annotation_hand import Drawing, handle_lines
from app.language import tr
from app.palette import ON_PICTURE
from app.scene_shapes import foot
from app.widgets.pencil import Pencil
from core.study.annotation_edits import ROBOT, VESSEL, Touch, line_of
from core.study.annotations import Annotation, Line, MaskTarget, Readout
from core.types import Point, Points, Vector

_MASK_COLOUR = {MaskTarget.VESSEL: ON_PICTURE.VESSEL, MaskTarget.ROBOT: ON_PICTURE.ROBOT}
_MARKER = 11.0
_LINE_COLOUR = {ROBOT: ON_PICTURE.ROBOT, VESSEL: ON_PICTURE.VESSEL}


def draw(painter: QPainter, to_screen: QTransform, drawing: Drawing, label_px: int, *, is_loupe: bool = False) -> None:
    """Paint through `to_screen` (picture to widget); labels in that size, 0 for none. In a loupe masks are outlines only."""
    annotation, readout = drawing.annotation, drawing.readout
    if drawing.masks_shown:
        for target in MaskTarget:
            _fill_masks(painter, to_screen, annotation, target, is_active=drawing.tool.value.target is target, is_loupe=is_loupe)
    for piece, name in ((readout.vessel_piece, ON_PICTURE.VESSEL_VECTOR), (readout.robot_piece, ON_PICTURE.ROBOT_VECTOR)):
        if piece is not None:
            _highlight(painter, to_screen, piece, name)
    pencil = Pencil(painter, to_screen, label_px)
    if drawing.proposal is not None:
        _draw_proposal(pencil, drawing.proposal, drawing.proposal_readout)
    for line, name in _LINE_COLOUR.items():
        points = line_of(annotation, line)
        if len(points) > 1:
            pencil.polylines((np.array(points),), name, 1.5)
    if drawing.rubber:
        name = drawing.tool.value.colour
        pencil.polylines((np.array(drawing.rubber),), name, 1.5, Qt.PenStyle.DashLine)
    if len(drawing.draft) > 1:
        pencil.polylines((np.array(drawing.draft),), drawing.tool.value.colour, 2.0)
    _draw_readout(pencil, readout)
    if drawing.handles_shown:
        _draw_handles(painter, to_screen, drawing)


def _highlight(painter: QPainter, to_screen: QTransform, piece: Points, name: str) -> None:
    """The part of a line that counts, as with a marker pen: what lies below stays visible."""
    path = Path(_at(to_screen, tuple(piece[0])))
    for point in piece[1:]:
        path.lineTo(_at(to_screen, tuple(point)))
    pen = QPen(theme.colour(name, 0.42), _MARKER)
    pen.setCapStyle(Qt.PenCapStyle.FlatCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.save()
    painter.resetTransform()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(pen)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPath(path)
    painter.restore()


def _draw_readout(pencil: Pencil, readout: Readout) -> None:
    robot, vessel, pose = readout.robot_vector, readout.vessel_vector, readout.pose
    if vessel is not None:
        pencil.arrow(vessel, ON_PICTURE.VESSEL_VECTOR, 1.5)
    if robot is not None:
        pencil.arrow(robot, ON_PICTURE.ROBOT_VECTOR, 1.5)
    if robot is None or vessel is None or pose is None:
        return
    pencil.measure(foot(vessel, robot.end), robot.end, ON_PICTURE.D_HEAD, Qt.PenStyle.SolidLine)
    pencil.measure(foot(vessel, robot.start), robot.start, ON_PICTURE.D_TAIL, Qt.PenStyle.DotLine)
    pencil.angle(robot.start, _arc(vessel, robot), ON_PICTURE.THETA)
    side = 1.0 if pose.c_head_px < 0 else -1.0
    pencil.label_beside(vessel.center, vessel, side, f"\N{GREEK SMALL LETTER THETA} {pose.theta_deg:.1f}°", ON_PICTURE.THETA)


def _arc(vessel: Vector, robot: Vector) -> np.ndarray:
    """Unit arc from the vessel's direction to the robot's."""
    start = np.arctan2(vessel.direction[1], vessel.direction[0])
    turn = (np.arctan2(robot.direction[1], robot.direction[0]) - start + np.pi) % (2 * np.pi) - np.pi
    angles = start + np.linspace(0.0, turn, 24)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _draw_proposal(pencil: Pencil, proposal: Annotation, readout: Readout | None) -> None:
    """The algorithm's lines, dotted and white: nobody takes them for his own."""
    for line in (proposal.robot, proposal.vessel):
        if len(line) > 1:
            pencil.polylines((np.array(line),), ON_PICTURE.TEXT, 2.0, Qt.PenStyle.DotLine)
    for mask in proposal.masks:
        outline = np.array((*mask.points, mask.points[0]))
        pencil.polylines((outline,), _MASK_COLOUR[mask.target], 1.2, Qt.PenStyle.DotLine)
    if readout is not None and readout.vessel_vector is not None and readout.pose is not None and proposal.robot:
        pencil.tag(proposal.robot[-1], tr("algorithm: θ {theta:.1f}°", theta=readout.pose.theta_deg), ON_PICTURE.TEXT)


def _fill_masks(
    painter: QPainter, to_screen: QTransform, annotation: Annotation, target: MaskTarget, *, is_active: bool, is_loupe: bool
) -> None:
    area = Path()
    area.setFillRule(Qt.FillRule.WindingFill)
    for mask in annotation.masks:
        if mask.target is target and not (mask.is_hole and area.isEmpty()):  # a hole in nothing, as older files may have it
            # Outlines run one way round and holes the other, so that pieces join and holes stay open without costly unions.
            points = mask.points if (_area(mask.points) > 0) is not mask.is_hole else mask.points[::-1]
            area.addPolygon(QPolygonF([_at(to_screen, point) for point in points]))
            area.closeSubpath()
    if area.isEmpty():
        return
    painter.save()
    painter.resetTransform()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setBrush(theme.colour(_MASK_COLOUR[target], 0.0 if is_loupe else 0.34 if is_active else 0.20))
    painter.setPen(QPen(theme.colour(_MASK_COLOUR[target], 0.9 if is_active else 0.5), 1.2))
    painter.drawPath(area)
    painter.restore()


def _area(points: Line) -> float:
    """Twice the area that an outline encloses, positive when it runs clockwise on a screen."""
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(points, (*points[1:], points[0]), strict=True))


def _draw_handles(painter: QPainter, to_screen: QTransform, drawing: Drawing) -> None:
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    room = painter.window().adjusted(-12, -12, 12, 12)
    for line in handle_lines(drawing.annotation, drawing.tool):
        name = _LINE_COLOUR.get(line, drawing.tool.value.colour)
        radius = 5.0 if line < 0 else 3.0
        points = line_of(drawing.annotation, line)
        for place, point in enumerate(points):
            at = _at(to_screen, point)
            if not room.contains(at.toPoint()):
                continue
            is_selected = drawing.selected == Touch(line, place)
            is_head = line == ROBOT and place == len(points) - 1
            grown = radius + (2.0 if is_selected else 0.0) + (1.5 if is_head else 0.0)
            painter.setBrush(Qt.BrushStyle.NoBrush)  # the place itself stays visible
            thin = 0.0 if line < 0 else 0.8
            for ink, width in ((ON_PICTURE.INK, 4.0 - 1.5 * thin), (ON_PICTURE.HEAD if is_selected else name, 2.2 - thin)):
                painter.setPen(QPen(QColor(ink), width))
                painter.drawEllipse(at, grown, grown)
    for point in drawing.draft:
        painter.setPen(QPen(QColor(ON_PICTURE.INK), 1.2))
        painter.setBrush(QColor(drawing.tool.value.colour))
        painter.drawEllipse(_at(to_screen, point), 4.0, 4.0)


def _at(to_screen: QTransform, point: Point) -> QPointF:
    return to_screen.map(QPointF(point[0] + 0.5, point[1] + 0.5))
