"""The picture of the annotator: an annotation drawn over its image, a loupe, and the mouse and keys that edit it."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QPolygonF,
    QTransform,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy

from app.annotator.editing import (
    RADIUS_NOTCH,
    AnnotationEditor,
    Drawing,
    Edit,
    MaskGesture,
    MaskMode,
    Measure,
    Tool,
    handle_lines,
    short_words,
)
from app.ui import theme
from app.ui.i18n import mark, tr
from app.ui.theme import ON_PICTURE
from app.ui.workers import Worker
from app.widgets.image_canvas import ImageCanvas, Viewport, render
from app.widgets.painting import draw_text
from app.widgets.scene_overlay import foot
from app.widgets.scene_painter import ScenePainter
from core.annotation.model import ROBOT, VESSEL, Annotation, Line, MaskTarget, Readout, Touch, line_of
from core.annotation.outline import Polygons
from core.types import Image, Point, Points

_MASK_COLOUR = {MaskTarget.VESSEL: ON_PICTURE.VESSEL, MaskTarget.ROBOT: ON_PICTURE.ROBOT}
_MARKER_PX = 11.0
"""Width of the marker over the part of a line that the vectors are fitted to."""
_LINE_COLOUR = {ROBOT: ON_PICTURE.ROBOT, VESSEL: ON_PICTURE.VESSEL}


def draw(painter: QPainter, to_screen: QTransform, drawing: Drawing, label_px: int, *, is_loupe: bool = False) -> None:
    """Paint through `to_screen` (picture to widget); labels of `label_px`, 0 for none. In a loupe masks are outlines only."""
    annotation, readout = drawing.annotation, drawing.readout
    if drawing.masks_shown:
        for target in MaskTarget:
            _fill_masks(painter, to_screen, annotation, target, is_active=drawing.tool.value.target is target, is_loupe=is_loupe)
    for piece, name in ((readout.vessel_piece, ON_PICTURE.VESSEL_VECTOR), (readout.robot_piece, ON_PICTURE.ROBOT_VECTOR)):
        if piece is not None:
            _highlight(painter, to_screen, piece, name)
    pencil = ScenePainter(painter, to_screen, label_px)
    if drawing.proposal is not None:
        _draw_proposal(pencil, drawing.proposal, drawing.proposal_readout)
    for line, name in _LINE_COLOUR.items():
        points = line_of(annotation, line)
        if len(points) > 1:
            pencil.polylines((np.array(points),), name, 1.5)
    if drawing.rubber_band:
        pencil.polylines((np.array(drawing.rubber_band),), drawing.tool.value.colour, 1.5, Qt.PenStyle.DashLine)
    if len(drawing.draft) > 1:
        pencil.polylines((np.array(drawing.draft),), drawing.tool.value.colour, 2.0)
    _draw_readout(pencil, readout)
    if readout.is_short and not is_loupe:
        pencil.tag(annotation.robot[-1] if annotation.robot else (0.0, 0.0), short_words(readout), ON_PICTURE.ORANGE)
    if drawing.handles_shown:
        _draw_handles(painter, to_screen, drawing)


def _highlight(painter: QPainter, to_screen: QTransform, piece: Points, name: str) -> None:
    """The part of a line that the vector is fitted to, translucent as by a marker pen."""
    path = QPainterPath(_at(to_screen, tuple(piece[0])))
    for point in piece[1:]:
        path.lineTo(_at(to_screen, tuple(point)))
    pen = QPen(theme.colour(name, 0.42), _MARKER_PX)
    pen.setCapStyle(Qt.PenCapStyle.FlatCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.save()
    painter.resetTransform()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(pen)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPath(path)
    painter.restore()


def _draw_readout(pencil: ScenePainter, readout: Readout) -> None:
    robot, vessel, pose = readout.robot_vector, readout.vessel_vector, readout.pose
    if vessel is not None:
        pencil.arrow(vessel, ON_PICTURE.VESSEL_VECTOR, 1.5)
    if robot is not None:
        pencil.arrow(robot, ON_PICTURE.ROBOT_VECTOR, 1.5)
    if robot is None or vessel is None or pose is None:
        return
    pencil.measure(foot(vessel, robot.end), robot.end, ON_PICTURE.D_HEAD, Qt.PenStyle.SolidLine)
    pencil.measure(foot(vessel, robot.start), robot.start, ON_PICTURE.D_TAIL, Qt.PenStyle.DotLine)
    # a unit arc from the vessel's direction to the robot's
    start = np.arctan2(vessel.direction[1], vessel.direction[0])
    turn = (np.arctan2(robot.direction[1], robot.direction[0]) - start + np.pi) % (2 * np.pi) - np.pi
    angles = start + np.linspace(0.0, turn, 24)
    pencil.angle(robot.start, np.column_stack([np.cos(angles), np.sin(angles)]), ON_PICTURE.THETA)
    side = 1.0 if pose.c_head_px < 0 else -1.0
    pencil.label_beside(vessel.center, vessel, side, f"\N{GREEK SMALL LETTER THETA} {pose.theta_deg:.1f}°", ON_PICTURE.THETA)


def _draw_proposal(pencil: ScenePainter, proposal: Annotation, readout: Readout | None) -> None:
    """The algorithm's lines are dotted and white, so that no rater takes them for their own."""
    for line in (proposal.robot, proposal.vessel):
        if len(line) > 1:
            pencil.polylines((np.array(line),), ON_PICTURE.TEXT, 2.0, Qt.PenStyle.DotLine)
    for mask in proposal.masks:
        pencil.polylines((np.array((*mask.points, mask.points[0])),), _MASK_COLOUR[mask.target], 1.2, Qt.PenStyle.DotLine)
    if readout is not None and readout.vessel_vector is not None and readout.pose is not None and proposal.robot:
        pencil.tag(proposal.robot[-1], tr("algorithm: θ {theta:.1f}°", theta=readout.pose.theta_deg), ON_PICTURE.TEXT)


def _fill_masks(
    painter: QPainter, to_screen: QTransform, annotation: Annotation, target: MaskTarget, *, is_active: bool, is_loupe: bool
) -> None:
    area = QPainterPath()
    area.setFillRule(Qt.FillRule.WindingFill)
    for mask in annotation.masks:
        if mask.target is target and not (mask.is_hole and area.isEmpty()):  # older files may hold a hole without an outline
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


_HANDLES_APART_PX = 9.0
"""Handles of an outline that would lie closer on the screen are left out."""


def _draw_handles(painter: QPainter, to_screen: QTransform, drawing: Drawing) -> None:
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    room = painter.window().adjusted(-12, -12, 12, 12)
    # Of an outline with many points those that can be told apart; closer ones appear when it is magnified.
    for line in handle_lines(drawing.annotation, drawing.tool):
        last = QPointF(-1e9, 0.0)
        name = _LINE_COLOUR.get(line, drawing.tool.value.colour)
        radius = 5.0 if line < 0 else 3.0
        points = line_of(drawing.annotation, line)
        for place, point in enumerate(points):
            at = _at(to_screen, point)
            if not room.contains(at.toPoint()):
                continue
            is_selected = drawing.selected == Touch(line, place)
            if line >= 0 and not is_selected and (at - last).manhattanLength() < _HANDLES_APART_PX:
                continue
            last = at
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


_LOUPE_SIDE_PX = 210
_LOUPE_ZOOM, _LOUPE_ZOOM_RANGE = 4.0, (4.0, 40.0)
"""Times the zoom of the picture, and the limits of the product."""
_LOUPE_NEAR_PX = 40.0
"""The loupe changes its corner when the cursor or a drawn line comes nearer than this."""


class AnnotationLoupe:
    """Paints the magnified surroundings of a point into a corner of the canvas."""

    def __init__(self) -> None:
        self._corner = 0

    def paint(
        self,
        painter: QPainter,
        levels: tuple[Image, ...],
        view: Viewport,
        drawing: Drawing,
        focus: Point,
        light: tuple[float, float],
    ) -> None:
        """Magnify the surroundings of `focus`, a place of the image."""
        width, height = view.room
        side = min(_LOUPE_SIDE_PX, width // 3, height // 2)
        keep_clear = [focus, *drawing.annotation.robot, *drawing.annotation.vessel]
        frame = self._place(side, view.room, [view.to_screen(point) for point in keep_clear])
        zoom = min(max(_LOUPE_ZOOM * view.zoom, _LOUPE_ZOOM_RANGE[0]), _LOUPE_ZOOM_RANGE[1])
        inner = Viewport(view.size, (side, side), zoom, focus)
        glass = QPainterPath()
        glass.addRoundedRect(frame, theme.RADIUS, theme.RADIUS)
        painter.save()
        painter.setClipPath(glass)
        painter.drawImage(frame.topLeft(), render(levels[:1], inner, painter.device().devicePixelRatioF(), *light))
        shift = inner.transform
        shift.setMatrix(shift.m11(), 0, 0, 0, shift.m22(), 0, shift.dx() + frame.left(), shift.dy() + frame.top(), 1)
        draw(painter, shift, drawing, 0, is_loupe=True)
        paint_cross(painter, frame.center(), 14.0)
        painter.restore()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(ON_PICTURE.TEXT), 2))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRoundedRect(frame, theme.RADIUS, theme.RADIUS)
        place = QRectF(frame.left() + 8, frame.bottom() - 22, 60, 18)
        draw_text(painter, place, f"{zoom:.0f}\N{MULTIPLICATION SIGN}", theme.semi_bold(12), ON_PICTURE.TEXT)

    def _place(self, side: int, room: tuple[int, int], keep_clear: list[Point]) -> QRectF:
        frames = [QRectF(x, y, side, side) for y in (10, room[1] - side - 10) for x in (room[0] - side - 10, 10)]
        gaps = [min(_gap(frame, point) for point in keep_clear) for frame in frames]
        if gaps[self._corner] < _LOUPE_NEAR_PX:
            # the cursor, which is the first point, counts for more than the lines: it is never covered
            scores = [min(_gap(frame, keep_clear[0]), 200.0) + gap for frame, gap in zip(frames, gaps, strict=True)]
            self._corner = int(np.argmax(scores))
        return frames[self._corner]


def _gap(frame: QRectF, point: Point) -> float:
    """Distance of a point to a rectangle, 0 inside."""
    dx = max(frame.left() - point[0], 0.0, point[0] - frame.right())
    dy = max(frame.top() - point[1], 0.0, point[1] - frame.bottom())
    return float(np.hypot(dx, dy))


def paint_cross(painter: QPainter, at: QPointF, reach: float) -> None:
    """A cross with an open middle."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    for name, width in ((ON_PICTURE.INK, 3.0), (ON_PICTURE.TEXT, 1.2)):
        painter.setPen(QPen(QColor(name), width))
        for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            painter.drawLine(at + QPointF(x, y) * 3.0, at + QPointF(x, y) * reach)


_CLICK_SLACK_PX = 4.0
"""A right click that moves less than this is no pan."""
_LABEL_PX = 15
_ARROWS = {
    Qt.Key.Key_Left: (-1.0, 0.0),
    Qt.Key.Key_Right: (1.0, 0.0),
    Qt.Key.Key_Up: (0.0, -1.0),
    Qt.Key.Key_Down: (0.0, 1.0),
}
CANVAS_KEYS = (
    ("Enter", mark("end the line, take the state, go on")),
    ("Tab", mark("select the next point")),
    ("\N{LEFTWARDS ARROW} \N{RIGHTWARDS ARROW} \N{UPWARDS ARROW} \N{DOWNWARDS ARROW}", mark("move it by 1 px; Ctrl 0.1, Shift 10")),
    ("Insert", mark("no point selected: set one at the cross")),
    ("Del", mark("take the point out")),
    ("Shift+Del", mark("the whole line")),
    (mark("Space+drag"), mark("move the picture")),
    ("Esc", mark("let go of the line or the point; a click goes on")),
)
"""The keys that the picture handles itself; all others are in the menus."""


class AnnotationCanvas(ImageCanvas):
    """Shows an image with its annotation; all places are pixels of the image as it is shown.

    ``edited`` carries what was done, in words, and the new annotation. ``previewed`` carries the annotation and its readout while a
    point moves or a line grows under the cursor. ``line_ended`` carries the tool whose line was ended; ``ended`` comes when Enter
    has nothing to end; ``tool_changed`` when a point of the other tool's line was grabbed; ``outline_failed`` carries one line when
    a tube or a region could not be computed. These are computed in a thread of their own, one after the other.
    """

    edited = Signal(str, object)
    previewed = Signal(object, object)
    line_ended = Signal(object)
    tool_changed = Signal(object)
    ended = Signal()
    outline_failed = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(480, 320)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setAccessibleName(tr("Picture to annotate"))
        self.setAccessibleDescription(tr("Click sets points; arrow keys move the selected point or the cross, Insert sets a point"))
        self.editor = AnnotationEditor()
        self.keeps_zoom = True
        """The next image of the same size is shown as this one is, not whole."""
        self._loupe = AnnotationLoupe()
        self._loupe_on = True
        self._mode = MaskMode.POINTS
        self._gestures: deque[MaskGesture] = deque()
        """Tubes and regions that are not drawn yet; the first one is being computed."""
        self._outlining = Worker("outlining", self)
        self._outlining.done.connect(self._on_outlined)
        self._outlining.failed.connect(self._on_outline_failed)
        self._cursor: Point | None = None
        self._cross_by_key = False
        self._pressed_at = QPointF()

    # ---- what is shown

    @property
    def tool(self) -> Tool:
        return self.editor.tool

    @property
    def is_moving(self) -> bool:
        """Whether a point moves or a line reaches to the cursor: the readout is not final."""
        return not self.tool.is_mask and (self.editor.held is not None or bool(self.editor.drawing.rubber_band))

    @property
    def mask_mode(self) -> MaskMode:
        """POINTS with a line tool."""
        return self._mode if self.tool.is_mask else MaskMode.POINTS

    def show_image(self, levels: tuple[Image, ...], annotation: Annotation, measure: Measure) -> None:
        """Another image, the whole of it."""
        size = levels[0].shape[1], levels[0].shape[0]
        self.editor.set_image(size, annotation, measure)
        self._mode, self._cross_by_key = MaskMode.POINTS, False
        self._gestures.clear()
        before = self.view
        self.show_levels(levels)
        if self.keeps_zoom and before.size == self.view.size and before.room == self.view.room and before.zoom > self.view.zoom:
            self._set_view(before)

    def blank(self) -> None:
        self._gestures.clear()
        self.editor.set_image(self.view.size, Annotation(), lambda _annotation: Readout())
        self.show_levels(())

    def show_annotation(self, annotation: Annotation) -> None:
        """The annotation after an edit, undo or redo."""
        self.editor.set_annotation(annotation)
        self.update()

    def show_proposal(self, proposal: Annotation | None) -> None:
        """The algorithm's lines and masks beside the rater's, or None."""
        self.editor.show_proposal(proposal)
        self.update()

    def set_tool(self, tool: Tool) -> None:
        """Choose a tool; choosing the same line tool again reopens its line for more points."""
        self.editor.set_tool(tool)
        self.update()

    def close_line(self) -> None:
        """No more points on the line: the next click grabs points instead of setting some."""
        self.editor.close_line()
        self.update()

    def set_mask_mode(self, mode: MaskMode) -> None:
        """What a press does with a mask tool."""
        self._mode = mode
        self.update()

    def resize_circle(self, factor: float) -> None:
        """The circle of brush, region and tube; the width of a brush stays as it is during a stroke."""
        if not (self.editor.stroke and self.mask_mode is MaskMode.BRUSH):
            self.editor.resize_circle(factor)
        self.update()

    def set_loupe(self, on: bool) -> None:
        self._loupe_on = on
        self.update()

    def set_masks_shown(self, on: bool) -> None:
        self.editor.drawing = replace(self.editor.drawing, masks_shown=on)
        self.update()

    def zoom(self, factor: float) -> None:
        """Zoom at the cursor, or in the middle without one."""
        at = self.view.to_screen(self._cursor) if self._cursor is not None and self.view.shows(self._cursor, 0.0) else None
        self.zoom_at(factor, at or (self.width() / 2, self.height() / 2))

    def close_up(self) -> None:
        """The robot's head, or without one what is under the cursor, several times as large; once more: the whole image."""
        robot, (width, height) = self.editor.annotation.robot, self.view.size
        self.close_up_at(robot[-1] if robot else self._cursor or ((width - 1) / 2, (height - 1) / 2))

    def complete(self) -> None:
        """Complete what is being drawn, before something else happens to the picture."""
        if self.editor.stroke and self.mask_mode is not MaskMode.BRUSH:
            self._end_gesture()
        while self._gestures:
            self._apply(self._gestures[0].change(self.editor.annotation.masks))
        self._emit_edit(self.editor.complete())

    def undo_draft_point(self) -> bool:
        """Undo while an outline is drawn: remove its last point; False when none is drawn."""
        had = self.editor.drop_draft_point()
        self.update()
        return had

    def simplify_masks(self, tolerance_px: float = 1.0) -> None:
        """Fewer points on the outlines of the tool's masks."""
        self._emit_edit(self.editor.simplify(tolerance_px))

    # ---- mouse

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if not self.levels:
            return
        if (self.editor.stroke or self.editor.held is not None) and event.buttons() != event.button():
            return  # another button, by mistake, while one draws
        self._pressed_at = event.position()
        point, button = self._under(event.position()), event.button()
        self._cursor, self._cross_by_key = point, False
        if button == Qt.MouseButton.MiddleButton or (button == Qt.MouseButton.LeftButton and self.is_pannable):
            self.begin_pan(event.position())
        elif self.mask_mode is not MaskMode.POINTS and button in (Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton):
            shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            self.editor.begin_stroke(point, erase=shift or button == Qt.MouseButton.RightButton)
        elif button == Qt.MouseButton.LeftButton:
            tool = self.tool
            if not self.editor.press(point, self._scale):
                self.begin_pan(event.position())
            if self.tool is not tool:
                self.tool_changed.emit(self.tool)
            self._emit_preview()
        elif button == Qt.MouseButton.RightButton:
            self.begin_pan(event.position())
        self.update()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if not self.levels:
            return
        point = self._under(event.position())
        self._cursor, self._cross_by_key = point, False
        if self.is_panning:
            self.pan_to(event.position())
        elif self.editor.stroke:
            self.editor.continue_stroke(point)
        elif self.editor.held is not None:
            self.editor.drag_to(point)
            self._emit_preview()
        elif self.editor.stretch(point, self._scale):
            self._emit_preview()
        self.update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        moved = event.position() - self._pressed_at
        if self.editor.stroke:
            self._end_stroke()
        elif self.editor.held is not None and event.button() == Qt.MouseButton.LeftButton:
            self._emit_edit(self.editor.release())
        elif self.is_panning:
            self.end_pan()
            if event.button() == Qt.MouseButton.RightButton and abs(moved.x()) + abs(moved.y()) <= _CLICK_SLACK_PX:
                removal = self.editor.remove_point_at(self._under(event.position()), self._scale)
                if removal is not None:
                    self._emit_edit(removal)
                else:
                    self._end()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """End the line; the first of the clicks has set its last point."""
        if not self.levels:
            return
        ends = event.button() == Qt.MouseButton.LeftButton and self.mask_mode is MaskMode.POINTS and not self.is_pannable
        # Where nothing is being drawn it is a second quick grab; only Enter takes a state, or goes on.
        if not (ends and self._end()):
            self.mousePressEvent(event)
        self.update()

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Size of the circle, where there is one; with Ctrl, or without a circle, zoom."""
        turns = event.angleDelta().y() / 120.0
        if self.mask_mode is MaskMode.POINTS or event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            super().wheelEvent(event)
            return
        if turns and self.levels:
            self.resize_circle(RADIUS_NOTCH**turns)
        event.accept()

    def leaveEvent(self, event: QEvent) -> None:
        if not self._cross_by_key:
            self._cursor = None
            if self.editor.unstretch():
                self._emit_preview()
        self.update()

    def end_line(self) -> None:
        """Enter: complete the outline or line that is being drawn, or emit ``ended``."""
        if not self._end():
            self.ended.emit()
        self.update()

    def _end(self) -> bool:
        """Complete what is being drawn; False when there was nothing."""
        ended = self.editor.end()
        if isinstance(ended, Tool):
            self.line_ended.emit(ended)
        else:
            self._emit_edit(ended)
        return ended is not None

    def cancel(self) -> bool:
        """Escape: drop what is being drawn or selected; False when there was nothing."""
        was_held = self.editor.held is not None
        had = self.editor.cancel() or self.mask_mode is not MaskMode.POINTS
        self._emit_preview()
        self._mode = MaskMode.POINTS
        if was_held:
            self.edited.emit("", None)
        self.update()
        return had

    # ---- tubes and regions

    def _end_stroke(self) -> None:
        if self.mask_mode is MaskMode.BRUSH:
            self._emit_edit(self.editor.end_stroke())
        else:
            self._end_gesture()
            self._compute_next()

    def _end_gesture(self) -> None:
        gesture = self.editor.end_gesture(self.mask_mode, self.levels[0])
        if gesture is not None:
            self._gestures.append(gesture)
        self.update()

    def _compute_next(self) -> None:
        """The first gesture that waits, on the masks as they are now."""
        if self._gestures:
            gesture, masks = self._gestures[0], self.editor.annotation.masks
            self._outlining.submit(gesture, lambda: (masks, gesture.change(masks)), once=True)

    def _on_outlined(self, gesture: MaskGesture, outlined: tuple[Polygons, Polygons]) -> None:
        if not self._gestures or self._gestures[0] is not gesture:
            return  # of another picture, or completed meanwhile
        before, after = outlined
        if before == self.editor.annotation.masks:
            self._apply(after)
        self._compute_next()

    def _apply(self, masks: Polygons) -> None:
        self._emit_edit(self.editor.apply_masks(self._gestures.popleft().action, masks))

    def _on_outline_failed(self, gesture: MaskGesture, line: str) -> None:
        if self._gestures and self._gestures[0] is gesture:
            self._gestures.popleft()
            self.outline_failed.emit(line)
            self._compute_next()
            self.update()

    # ---- keys

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key, modifiers = Qt.Key(event.key()), event.modifiers()
        if not self.levels:
            super().keyPressEvent(event)
        elif key in _ARROWS:
            step = 0.1 if modifiers & Qt.KeyboardModifier.ControlModifier else 1.0
            step *= 10.0 if modifiers & Qt.KeyboardModifier.ShiftModifier else 1.0
            self._nudge(_ARROWS[key][0] * step, _ARROWS[key][1] * step)
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            if not event.isAutoRepeat():  # an Enter that is held too long would take a state and go on, unseen
                self.end_line()
        elif key == Qt.Key.Key_Delete and modifiers & Qt.KeyboardModifier.ShiftModifier:
            self._emit_edit(self.editor.clear())
        elif key in (Qt.Key.Key_Insert, Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            inserts = key == Qt.Key.Key_Insert
            if self.mask_mode is not MaskMode.POINTS and self._cursor is not None:
                self.editor.begin_stroke(self._cursor, erase=not inserts)
                self._end_stroke()
            elif not inserts:
                self._emit_edit(self.editor.delete())
            elif self._cursor is not None:
                self._emit_edit(self.editor.insert(self._cursor))
        elif key == Qt.Key.Key_Space:
            self.set_pannable(True)
        else:
            super().keyPressEvent(event)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Space:
            if not event.isAutoRepeat():
                self.set_pannable(False)
        else:
            super().keyReleaseEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        self.set_pannable(False)
        super().focusOutEvent(event)

    def event(self, event: QEvent) -> bool:
        """Tab goes from point to point as long as there are any; else it goes to the next control."""
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            if event.key() in (Qt.Key.Key_Tab, Qt.Key.Key_Backtab):
                place = self.editor.select_next(-1 if event.key() == Qt.Key.Key_Backtab else 1)
                if place is not None:
                    self.scroll_to(place)
                    self._cursor = None
                    self._emit_preview()
                    self.update()
                    return True
        return super().event(event)

    def _nudge(self, dx: float, dy: float) -> None:
        """Move the selected point, or without one the cross."""
        selected = self.editor.drawing.selected
        edit = self.editor.nudge(dx, dy)
        if edit is not None and selected is not None:
            self._cursor = None  # the loupe shows the point
            self.scroll_to(line_of(edit[1], selected.line)[selected.place])
            self._emit_edit(edit)
            return
        (x, y), (width, height) = self._cursor or self.view.center, self.view.size
        self._cursor = min(max(x + dx, 0.0), width - 1.0), min(max(y + dy, 0.0), height - 1.0)
        self._cross_by_key = True
        self.scroll_to(self._cursor)
        if self.editor.stretch(self._cursor, 0.0):
            self._emit_preview()
        self.update()

    def _emit_edit(self, edit: Edit | None) -> None:
        if edit is not None:
            self._emit_preview()
            self.edited.emit(*edit)
        self.update()

    def _emit_preview(self) -> None:
        """With a line that reaches to the cursor the readout is of that line, and the annotation still without it."""
        self.previewed.emit(self.editor.annotation, self.editor.drawing.readout)

    @property
    def _scale(self) -> float:
        """Image pixels per screen pixel."""
        return 1.0 / self.view.zoom

    def _under(self, position: QPointF) -> Point:
        return self.view.to_image(position.x(), position.y())

    # ---- painting

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        if not self.paint_picture(painter):
            painter.end()
            return
        drawing = self.editor.drawing
        painter.save()
        draw(painter, self.view.transform, replace(drawing, handles_shown=self.mask_mode is MaskMode.POINTS), _LABEL_PX)
        painter.restore()
        if self.mask_mode is not MaskMode.POINTS:
            self._paint_circle(painter)
        if self._cross_by_key and self._cursor is not None:
            paint_cross(painter, QPointF(*self.view.to_screen(self._cursor)), 16.0)
        focus = self._loupe_point()
        if focus is not None:
            self._loupe.paint(painter, self.levels, self.view, drawing, focus, self.light)
        painter.end()

    def _paint_circle(self, painter: QPainter) -> None:
        """The circle at the cursor, what is being drawn with it, and what was drawn and is not computed yet."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        editor = self.editor
        for gesture in self._gestures:
            self._paint_stroke(painter, gesture.stroke, gesture.radii, erases=gesture.erases)
        if editor.stroke:
            self._paint_stroke(painter, tuple(editor.stroke), tuple(editor.stroke_radii), erases=editor.stroke_erases)
        if self._cursor is None:
            return
        at, radius = QPointF(*self.view.to_screen(self._cursor)), editor.radius_px * self.view.zoom
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for name, width in ((ON_PICTURE.INK, 3.0), (ON_PICTURE.TEXT, 1.2)):
            painter.setPen(QPen(QColor(name), width))
            painter.drawEllipse(at, radius, radius)

    def _paint_stroke(self, painter: QPainter, stroke: Line, radii: tuple[float, ...], *, erases: bool) -> None:
        """A band as wide as the circle was, equally translucent where it overlaps itself."""
        ratio = self.devicePixelRatioF()
        layer = QImage(self.size() * ratio, QImage.Format.Format_ARGB32_Premultiplied)
        layer.setDevicePixelRatio(ratio)
        layer.fill(Qt.GlobalColor.transparent)
        band = QPainter(layer)
        band.setRenderHint(QPainter.RenderHint.Antialiasing)
        pen = QPen(QColor(ON_PICTURE.INK if erases else self.tool.value.colour))
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        places = [QPointF(*self.view.to_screen(point)) for point in stroke]
        for place, (at, radius) in enumerate(zip(places, radii, strict=True)):
            pen.setWidthF(2.0 * radius * self.view.zoom)
            band.setPen(pen)
            band.drawLine(places[max(place - 1, 0)], at + QPointF(0.01, 0.0))
        band.end()
        painter.setOpacity(0.5)
        painter.drawImage(QPointF(0, 0), layer)
        painter.setOpacity(1.0)

    def _loupe_point(self) -> Point | None:
        """What the loupe magnifies: the held point, what lies under the cursor, or the selected point."""
        if not self._loupe_on:
            return None
        held = self.editor.held or (self.editor.drawing.selected if self._cursor is None else None)
        if held is not None:
            points = line_of(self.editor.annotation, held.line)
            return points[held.place] if held.place < len(points) else None
        return self._cursor
