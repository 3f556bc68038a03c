"""The picture that is annotated: turns mouse and keys into what the hand does, and paints it."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QEvent, QPointF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
)
from PySide6.QtWidgets import QSizePolicy

from app import theme
from app.annotation_hand import AnnotationHand, Edit, Ending, Measure, Reach
from app.annotation_tool import Tool
from app.language import mark, tr
from app.palette import ON_PICTURE
from app.widgets.annotation_loupe import AnnotationLoupe, paint_cross
from app.widgets.annotation_paint import draw
from app.widgets.picture_canvas import PictureCanvas
from core.study.annotation_edits import Touch, line_of
from core.study.annotations import Annotation, Readout
from core.types import Image, Point

_POINT_REACH = 10.0
_EDGE_REACH = 6.0
_CLICK_SLACK = 4.0
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
    ("Esc", mark("let go of the line or the point")),
)
"""The keys that the picture hears itself: all others are in the menus."""


class AnnotationCanvas(PictureCanvas):
    """Shows an image with its annotation; all places are pixels of the image as it is shown.

    ``edited`` carries what was done, in words, and the new annotation. ``previewed`` carries the annotation and its readout while a
    point moves or a line grows under the cursor. ``line_ended`` carries the tool whose line was ended; ``ended`` comes when Enter
    has nothing to end; ``tool_changed`` when a line of the other tool was taken hold of.
    """

    edited = Signal(str, object)
    previewed = Signal(object, object)
    line_ended = Signal(object)
    tool_changed = Signal(object)
    ended = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(480, 320)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setAccessibleName(tr("Picture to annotate"))
        self.setAccessibleDescription(tr("Click sets points; arrow keys move the selected point or the cross, Insert sets a point"))
        self._hand = AnnotationHand()
        self._loupe = AnnotationLoupe()
        self._loupe_on = True
        self._brush_on = False
        self._brush_px = 6.0
        self._cursor: Point | None = None
        self._cross_by_key = False
        self._pressed_at = QPointF()

    # ---- what is shown

    @property
    def tool(self) -> Tool:
        return self._hand.tool

    @property
    def annotation(self) -> Annotation:
        """What is drawn now, a point that is being dragged included."""
        return self._hand.annotation

    @property
    def selected(self) -> Touch | None:
        return self._hand.drawing.selected

    @property
    def proposal(self) -> Annotation | None:
        return self._hand.drawing.proposal

    @property
    def is_moving(self) -> bool:
        """Whether a point moves or a line reaches to the cursor: the readout is not final."""
        return self._hand.held is not None or bool(self._hand.drawing.rubber)

    @property
    def brush_on(self) -> bool:
        return self._brush_on and self.tool.is_mask

    @property
    def brush_px(self) -> float:
        return self._brush_px

    def show_image(self, levels: tuple[Image, ...], annotation: Annotation, measure: Measure) -> None:
        """Another image, the whole of it."""
        size = levels[0].shape[1], levels[0].shape[0]
        self._hand.take_image(size, annotation, measure)
        self._brush_on = self._cross_by_key = False
        self.show_levels(levels)

    def blank(self) -> None:
        """Nothing is shown."""
        self._hand.take_image(self.view.size, Annotation(), lambda _annotation: Readout())
        self.show_levels(())

    def show_annotation(self, annotation: Annotation) -> None:
        """What is true now, after an edit, undo or redo."""
        self._hand.take_annotation(annotation)
        self.update()

    def show_proposal(self, proposal: Annotation | None) -> None:
        """The algorithm's lines and masks beside the rater's, or None."""
        self._hand.show_proposal(proposal)
        self.update()

    def set_tool(self, tool: Tool) -> None:
        """Take a tool; taking the same line tool again opens its line for more points."""
        self._hand.take_tool(tool)
        self.update()

    def close_line(self) -> None:
        """No more points on the line: the next click takes hold of points instead of setting some."""
        self._hand.close_line()
        self.update()

    def set_brush(self, on: bool) -> None:
        self._brush_on = on
        self.update()

    def resize_brush(self, factor: float) -> None:
        self._brush_px = min(max(self._brush_px * factor, 0.5), 200.0)
        self.update()

    def set_loupe(self, on: bool) -> None:
        self._loupe_on = on
        self.update()

    def set_masks_shown(self, on: bool) -> None:
        self._hand.drawing = replace(self._hand.drawing, masks_shown=on)
        self.update()

    def zoom(self, factor: float) -> None:
        """Zoom at the cursor, or in the middle when there is none."""
        at = self.view.to_screen(self._cursor) if self._cursor is not None and self.view.shows(self._cursor, 0.0) else None
        self.zoom_at(factor, at or (self.width() / 2, self.height() / 2))

    def close_up(self) -> None:
        """The robot's head, or without one what is under the cursor, several times as large; once more: the whole image."""
        robot, (width, height) = self.annotation.robot, self.view.size
        self.close_up_at(robot[-1] if robot else self._cursor or ((width - 1) / 2, (height - 1) / 2))

    def complete(self) -> None:
        """Before something else happens to the picture: nothing that was drawn by hand is lost."""
        edit = self._hand.complete(self._brush_px)
        if edit is not None:
            self._tell(edit)
        self.update()

    def take_back_draft_point(self) -> bool:
        """Undo while an outline is drawn: its last point goes; False when none is drawn."""
        if not self._hand.drawing.draft:
            return False
        self._hand.drop_draft_point()
        self.update()
        return True

    def simplify_masks(self, tolerance_px: float = 1.0) -> None:
        """Fewer points on the outlines of the tool's masks."""
        self._tell(self._hand.simplify(tolerance_px))

    # ---- mouse

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if not self.levels:
            return
        if (self._hand.stroke or self._hand.held is not None) and event.buttons() != event.button():
            return  # another button, by mistake, while one draws
        self._pressed_at = event.position()
        point, button = self._under(event.position()), event.button()
        self._cursor, self._cross_by_key = point, False
        if button == Qt.MouseButton.MiddleButton or (button == Qt.MouseButton.LeftButton and self.is_pannable):
            self.begin_pan(event.position())
        elif self.brush_on and button in (Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton):
            shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            self._hand.begin_stroke(point, erase=shift or button == Qt.MouseButton.RightButton)
        elif button == Qt.MouseButton.LeftButton:
            tool = self.tool
            if not self._hand.press(point, self._reach()):
                self.begin_pan(event.position())
            if self.tool is not tool:
                self.tool_changed.emit(self.tool)
            self._tell_preview()
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
        elif self._hand.stroke:
            self._hand.stroke.append(point)
        elif self._hand.held is not None:
            self._hand.drag_to(point)
            self._tell_preview()
        elif self._hand.stretch(point, self._reach()):
            self._tell_preview()
        self.update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        moved = event.position() - self._pressed_at
        is_click = abs(moved.x()) + abs(moved.y()) <= _CLICK_SLACK
        if self._hand.stroke:
            self._tell(self._hand.end_stroke(self._brush_px))
        elif self._hand.held is not None and event.button() == Qt.MouseButton.LeftButton:
            self._tell(self._hand.release())
        elif self.is_panning:
            self.end_pan()
            if event.button() == Qt.MouseButton.RightButton and is_click:
                self._tell_ending(self._hand.take_out(self._under(event.position()), self._reach()) or self._hand.end())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """The first of its clicks has set the last point."""
        if not self.levels:
            return
        ends = event.button() == Qt.MouseButton.LeftButton and not self.brush_on and not self.is_pannable
        # Where nothing is being drawn it is a second quick grab; Enter alone takes a state, or goes on.
        if not (ends and self._tell_ending(self._hand.end())):
            self.mousePressEvent(event)
        self.update()

    def leaveEvent(self, event: QEvent) -> None:
        if not self._cross_by_key:
            self._cursor = None
            if self._hand.unstretch():
                self._tell_preview()
        self.update()

    def end_line(self) -> None:
        """Enter: the outline or line that is being drawn is complete."""
        if not self._tell_ending(self._hand.end()):
            self.ended.emit()
        self.update()

    def _tell_ending(self, ending: Ending | Edit) -> bool:
        """What a key or click has ended; False when there was nothing to end."""
        edit = ending.edit if isinstance(ending, Ending) else ending
        if edit is not None:
            self._tell(edit)
        elif isinstance(ending, Ending) and ending.tool is not None:
            self.line_ended.emit(ending.tool)
        else:
            return False
        return True

    def let_go(self) -> bool:
        """Escape: drop what is being drawn or selected; False when there was nothing."""
        was_held = self._hand.held is not None
        had = self._hand.let_go() or self._brush_on
        self._brush_on = False
        if was_held:
            self.edited.emit("", None)
        self.update()
        return had

    # ---- keys

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key, modifiers = Qt.Key(event.key()), event.modifiers()
        if not self.levels:
            super().keyPressEvent(event)
        elif key in _ARROWS:
            step = 0.1 if modifiers & Qt.KeyboardModifier.ControlModifier else 1.0
            step *= 10.0 if modifiers & Qt.KeyboardModifier.ShiftModifier else 1.0
            self._go(_ARROWS[key][0] * step, _ARROWS[key][1] * step)
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            if not event.isAutoRepeat():  # one that is held a little too long would take a state and go on, unseen
                self.end_line()
        elif key in (Qt.Key.Key_Insert, Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            if key == Qt.Key.Key_Delete and modifiers & Qt.KeyboardModifier.ShiftModifier:
                self._tell(self._hand.clear())
            else:
                self._by_key(puts=key == Qt.Key.Key_Insert)
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
                place = self._hand.select_next(-1 if event.key() == Qt.Key.Key_Backtab else 1)
                if place is not None:
                    self.see(place)
                    self._cursor = None
                    self._tell_preview()
                    self.update()
                    return True
        return super().event(event)

    def _go(self, dx: float, dy: float) -> None:
        """The selected point, or without one the cross, a little farther."""
        selected = self.selected
        edit = self._hand.nudge(dx, dy)
        if edit is not None and selected is not None:
            self._cursor = None  # the loupe shows the point
            self.see(line_of(edit[1], selected.line)[selected.place])
            self._tell(edit)
            return
        (x, y), (width, height) = self._cursor or self.view.center, self.view.size
        self._cursor = min(max(x + dx, 0.0), width - 1.0), min(max(y + dy, 0.0), height - 1.0)
        self._cross_by_key = True
        self.see(self._cursor)
        if self._hand.stretch(self._cursor, Reach(0.0, 0.0)):
            self._tell_preview()
        self.update()

    def _by_key(self, *, puts: bool) -> None:
        """Insert and Delete: points, or the brush at the cross."""
        if self.brush_on and self._cursor is not None:
            self._hand.begin_stroke(self._cursor, erase=not puts)
            self._tell(self._hand.end_stroke(self._brush_px))
        elif not puts:
            self._tell(self._hand.delete())
        elif self._cursor is not None:
            self._tell(self._hand.insert(self._cursor))
        self.update()

    # ---- behind it

    def _tell(self, edit: Edit | None) -> None:
        if edit is not None:
            self._tell_preview()
            self.edited.emit(*edit)
        self.update()

    def _tell_preview(self) -> None:
        """With a line that reaches to the cursor the readout is of that line, and the annotation still without it."""
        self.previewed.emit(self.annotation, self._hand.drawing.readout)

    def _reach(self) -> Reach:
        return Reach(_POINT_REACH / self.view.zoom, _EDGE_REACH / self.view.zoom)

    def _under(self, position: QPointF) -> Point:
        return self.view.to_image(position.x(), position.y())

    # ---- painting

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        if not self.paint_picture(painter):
            painter.end()
            return
        painter.save()
        draw(painter, self.view.transform, replace(self._hand.drawing, handles_shown=not self.brush_on), _LABEL_PX)
        painter.restore()
        if self.brush_on:
            self._paint_brush(painter)
        if self._cross_by_key and self._cursor is not None:
            paint_cross(painter, QPointF(*self.view.to_screen(self._cursor)), 16.0)
        focus = self._loupe_point()
        if focus is not None:
            self._loupe.paint(painter, self.levels, self.view, self._hand.drawing, focus, self.light)
        painter.end()

    def _paint_brush(self, painter: QPainter) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        radius = self._brush_px * self.view.zoom
        if self._hand.stroke:
            path = QPainterPath(QPointF(*self.view.to_screen(self._hand.stroke[0])))
            for point in self._hand.stroke:
                path.lineTo(QPointF(*self.view.to_screen(point)))
            path.lineTo(path.currentPosition() + QPointF(0.01, 0.0))
            ink = ON_PICTURE.INK if self._hand.stroke_erases else self.tool.value.colour
            pen = QPen(theme.colour(ink, 0.6), 2 * radius)
            pen.setCapStyle(Qt.PenCapStyle.RoundCap)
            pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
            painter.setPen(pen)
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawPath(path)
        if self._cursor is not None:
            painter.setBrush(Qt.BrushStyle.NoBrush)
            for name, width in ((ON_PICTURE.INK, 3.0), (ON_PICTURE.TEXT, 1.2)):
                painter.setPen(QPen(QColor(name), width))
                painter.drawEllipse(QPointF(*self.view.to_screen(self._cursor)), radius, radius)

    def _loupe_point(self) -> Point | None:
        """What the loupe magnifies: the point in the hand, what lies under the cursor, or the selected point."""
        if not self._loupe_on:
            return None
        held = self._hand.held or (self.selected if self._cursor is None else None)
        if held is not None:
            points = line_of(self.annotation, held.line)
            return points[held.place] if held.place < len(points) else None
        return self._cursor
