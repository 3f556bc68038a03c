"""The live picture with its overlays and a loupe over the robot's head; a click sets the target."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, QPointF, QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QImage, QMouseEvent, QPainter, QPainterPath, QPicture, QResizeEvent, QTransform
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.ui.texts import target_note
from app.ui.theme import ON_PICTURE
from app.ui.workers import Pace
from app.widgets.basics import column
from app.widgets.painting import PaintedWidget, set_colours
from app.widgets.scene_overlay import Layer, Marks, RehearsalShapes, scene_shapes
from app.widgets.scene_painter import on_screen
from core.config.models import PursuitConfig
from core.control.clearance import predict
from core.types import Advice, Frame, Image, Point, Points, Scene


class MarksLabel(QLabel):
    """Records marks as drawing commands, and lets Qt paint them.

    Painting takes milliseconds, recording a fraction of that. While Python paints, the interpreter is locked for the threads of
    perception and control; while Qt paints, it is free.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, alignment=Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def record(self, marks: Marks, to_label: QTransform, label_px: int, glass: QPainterPath | None = None) -> None:
        """Show `marks` drawn with `to_label` (source pixels to the label's), cut to `glass` when there is one."""
        commands = QPicture()
        painter = QPainter(commands)
        if glass is not None:
            painter.setClipPath(glass)
        marks.draw(painter, to_label, QRectF(self.rect()), label_px, tags=glass is None)
        painter.end()
        commands.setBoundingRect(self.rect())  # else the label would put its first mark into its corner
        self.setPicture(commands)


_NEAR_PX, _CLEAR_PX = 20, 60  # distances of the head at which the loupe leaves a corner, and from which a corner is free


class LoupeCorner:
    """Chooses the corner of the loupe: the one that hides least.

    It leaves it for a better one when it would hide the head or the target, or would be covered; the head matters most.
    """

    def __init__(self) -> None:
        self._corner: int | None = None

    def choose(
        self, corners: Sequence[QRectF], head: QPointF, target: QPointF | None, places: Points, covers: Sequence[QRectF] = ()
    ) -> int:
        """Which of `corners`.

        Parameters
        ----------
        corners : where the loupe would lie, on the view.
        head, target : must not be hidden, the head least of all.
        places : (N, 2) what else there is to see, also beyond the view.
        covers : what lies over the loupe.
        """

        def faults(corner: QRectF, margin_px: float) -> tuple[bool, bool, bool]:
            """The worst first, so that they compare: over the head, over the target, covered."""
            grown = corner.adjusted(-margin_px, -margin_px, margin_px, margin_px)
            is_target = target is not None and corner.contains(target)
            return grown.contains(head), is_target, any(corner.intersects(cover) for cover in covers)

        def hidden(corner: QRectF) -> int:
            x, y = places[:, 0], places[:, 1]
            inside = (x > corner.left()) & (x < corner.right()) & (y > corner.top()) & (y < corner.bottom())
            return int(np.count_nonzero(inside))

        if self._corner is None or any(faults(corners[self._corner], _NEAR_PX)):
            best = min(range(len(corners)), key=lambda k: (faults(corners[k], _CLEAR_PX), hidden(corners[k])))
            if self._corner is None or faults(corners[best], _CLEAR_PX) < faults(corners[self._corner], _NEAR_PX):
                self._corner = best
        return self._corner


_SPAN_PX = 110.0  # what the loupe shows, working pixels
_SHARE_OF_VIEW = 0.36
_ASPECT = 0.75
_LOUPE_LABEL_PX = (11, 16)
_WIDTH_PER_LABEL_PX = 13  # two labels have room beside each other
_CORNERS = ((1, 0), (0, 0), (1, 1), (0, 1))  # right, bottom


class HeadLoupe(PaintedWidget):
    """Shows about 110 working pixels around the head with the same marks as the live view, in a corner of it.

    ``clicked`` carries the place that was clicked in it, in source pixels.
    """

    clicked = Signal(float, float)

    def __init__(self, parent: QWidget, marks: Marks) -> None:
        super().__init__(tr("Magnified head"), parent=parent)
        self._parent = parent
        self._marks = marks
        self._image: QImage | None = None
        self._pixels: Image | None = None
        self._to_widget = QTransform()
        self._corner = LoupeCorner()
        self._drawn = MarksLabel(self)
        self.hide()

    def show_head(
        self, image: Image, scene: Scene, head_in_view: QPointF, to_view: QTransform, covers: Sequence[QRectF] = ()
    ) -> None:
        """Magnify the surroundings of the head.

        `head_in_view` is where it is on the parent widget, `to_view` leads there; `covers` are what lies over the loupe.
        """
        middle = _middle(scene)
        if middle is None:
            self.hide()
            return
        self._place(head_in_view, to_view, covers)
        span = _SPAN_PX / scene.scale
        zoom = self.width() / span
        left, top = middle[0] + 0.5 - span / 2, middle[1] + 0.5 - self.height() / zoom / 2
        self._cut(image, left, top, span, self.height() / zoom)
        self._to_widget = QTransform(zoom, 0.0, 0.0, zoom, -left * zoom, -top * zoom)
        self._drawn.setGeometry(self.rect())
        least, most = _LOUPE_LABEL_PX
        label_px = max(least, min(self.width() // _WIDTH_PER_LABEL_PX, most))
        self._drawn.record(self._marks, self._to_widget, label_px, self._glass(3.0))
        self.show()
        self.update()

    def _cut(self, image: Image, left: float, top: float, width: float, height: float) -> None:
        """Keep a copy of the part that is visible, with its place in the source."""
        x0, y0 = max(0, int(left) - 1), max(0, int(top) - 1)
        x1, y1 = min(image.shape[1], int(left + width) + 2), min(image.shape[0], int(top + height) + 2)
        part = np.ascontiguousarray(image[y0 : max(y1, y0 + 1), x0 : max(x1, x0 + 1)])
        self._pixels = np.asarray(cv2.cvtColor(part, cv2.COLOR_RGB2BGRA), np.uint8)
        rows, columns = part.shape[:2]
        self._image = QImage(self._pixels.data, columns, rows, 4 * columns, QImage.Format.Format_RGB32)
        self._image.setOffset(QPointF(x0, y0).toPoint())

    def _place(self, head: QPointF, to_view: QTransform, covers: Sequence[QRectF]) -> None:
        room = self._parent.rect()
        width = int(_SHARE_OF_VIEW * min(room.width(), room.height() / _ASPECT))
        height = int(width * _ASPECT)
        corners = [
            QRectF(room.width() - width - 10 if right else 10, room.height() - height - 10 if bottom else 10, width, height)
            for right, bottom in _CORNERS
        ]
        target = self._marks.target
        target_at = None if target is None else to_view.map(QPointF(target[0] + 0.5, target[1] + 0.5))
        corner = self._corner.choose(corners, head, target_at, on_screen(self._marks.places(), to_view), covers)
        self.setGeometry(corners[corner].toRect())

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() is not Qt.MouseButton.LeftButton:
            super().mousePressEvent(event)
            return
        place = self._to_widget.inverted()[0].map(event.position())
        self.clicked.emit(place.x() - 0.5, place.y() - 0.5)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """The second half of a double click is no second place."""
        event.accept()

    def paint(self, painter: QPainter) -> None:
        if self._image is None:
            return
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        glass = self._glass(1.0)
        painter.fillPath(glass, QColor(ON_PICTURE.INK))
        painter.save()
        painter.setClipPath(glass)
        painter.setWorldTransform(self._to_widget)
        painter.drawImage(self._image.offset(), self._image)
        painter.restore()
        set_colours(painter, None, ON_PICTURE.TEXT, 2)
        painter.drawPath(glass)

    def _glass(self, inset: float) -> QPainterPath:
        glass = QPainterPath()
        glass.addRoundedRect(QRectF(self.rect()).adjusted(inset, inset, -inset, -inset), theme.RADIUS, theme.RADIUS)
        return glass


def _middle(scene: Scene) -> Point | None:
    """Between both vectors, or the head when there is no pose; source pixels."""
    if scene.robot_vector is not None and scene.vessel_vector is not None:
        (ax, ay), (bx, by) = scene.robot_vector.center, scene.vessel_vector.center
        return scene.to_source(((ax + bx) / 2, (ay + by) / 2))
    return scene.to_source(scene.path.head) if scene.path is not None else None


_VESSEL, _ROBOT, _VESSEL_SKELETON, _ROBOT_SKELETON = 1, 2, 4, 8  # bits of the label image
_ZOOM_MAX = 12.0
_GHOST_S = 2.0  # how far the predicted path goes
_LABEL_PX = 13
_LOUPE_EVERY_S = 0.09
_PIXELS_PER_MM = PursuitConfig().pixels_per_mm


class LiveView(QWidget):
    """Shows a frame and its scene. Plot items are made once and updated in place.

    ``clicked`` carries a place in source pixels; ``cleared`` comes on a right click. `pixels_per_mm` (working px) gives the ghost
    of the advised move its length.
    """

    clicked = Signal(float, float)
    cleared = Signal()

    def __init__(self, pixels_per_mm: float = _PIXELS_PER_MM) -> None:
        super().__init__()
        self._pixels_per_mm = pixels_per_mm
        self.setMinimumSize(480, 320)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Live picture"))
        self.setAccessibleDescription(tr("Click sets the target, right click clears it"))
        self._size: tuple[int, int] | None = None
        self.scene: Scene | None = None
        self._target: Point | None = None
        self._image: Image | None = None
        self.ghost: Points | None = None  # the head's predicted path if the shown advice is followed, working px
        self._view = pg.GraphicsView()
        self._view.setBackground(ON_PICTURE.INK)
        self._view.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._box = _PictureBox()
        self._view.setCentralItem(self._box)
        self._picture = _SmoothImage()
        self._labels = _SmoothImage(_label_colours())
        for item in (self._picture, self._labels):
            item.setVisible(False)
            self._box.addItem(item, ignoreBounds=True)
        self._box.left_clicked.connect(lambda point: self._on_place(point.x() - 0.5, point.y() - 0.5))
        self._box.right_clicked.connect(self.cleared)
        self.setLayout(column(self._view))
        self._marks = Marks()
        self._drawn = MarksLabel(self)
        self._box.sigTransformChanged.connect(self._draw_marks)
        self._loupe = HeadLoupe(self, self._marks)
        self._loupe.clicked.connect(self._on_place)
        self._loupe_pace = Pace(_LOUPE_EVERY_S)
        self.covers: tuple[QWidget, ...] = ()
        """Widgets that lie over the picture at times; the loupe keeps clear of them."""

    def set_scale(self, pixels_per_mm: float) -> None:
        self._pixels_per_mm = pixels_per_mm

    def show_frame(self, frame: Frame, scene: Scene, advice: Advice | None = None) -> None:
        """Show a frame with its scene, and where `advice` leads; None: no ghost."""
        is_first = self._size is None
        self._show_picture(frame.image)
        self.scene = scene
        self.ghost = predict(scene, advice, _GHOST_S, self._pixels_per_mm) if advice is not None else None
        self._image = frame.image
        if is_first:  # no older picture is on the screen, so what is drawn over it may come a moment later
            QTimer.singleShot(0, self, self._draw_over)
        else:
            self._draw_over()

    def _draw_over(self) -> None:
        self._show_labels()
        self._show_marks()
        if self.scene is None or self.scene.path is None or self._loupe_pace.due():
            self._show_loupe()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        QTimer.singleShot(0, self, self._show_loupe)  # a still picture has no next frame that would place it

    def drop_ghost(self) -> None:
        """Remove the predicted path: the advice has ended."""
        if self.ghost is not None:
            self.ghost = None
            self._draw_over()

    def blank_overlays(self) -> None:
        """Remove everything that was perceived. The last picture and the target stay."""
        if self.scene is not None:
            self.scene = None
            self._show_labels()
            self._show_marks()
            self._show_loupe()

    def clear(self) -> None:
        """Show nothing at all, before another rig is opened."""
        self.blank_overlays()
        self._size = None
        self._image = None
        self._picture.setVisible(False)
        self._drawn.hide()

    def show_target(self, target: Point | None) -> None:
        self._target = target
        self._show_marks()
        self._show_loupe()

    def show_rehearsal(self, shapes: RehearsalShapes | None) -> None:
        """What a rehearsal found on the way to the target; None: nothing."""
        self._marks.rehearsal = shapes
        self._draw_marks()

    def free_corner(self, size: QSize, covers: Sequence[QWidget] = ()) -> QPoint:
        """Where a widget of this size hides the least of what there is to see."""
        room, edge = self.rect(), 10
        corners = [
            QRectF(room.width() - size.width() - edge if right else edge, top, size.width(), size.height())
            for right, bottom in reversed(_CORNERS)
            for top in (room.height() - size.height() - edge if bottom else edge,)
        ]
        to_view, scene, target = self._to_view(), self.scene, self._target
        head = scene.to_source(scene.path.head) if scene is not None and scene.path is not None else (-1e6, -1e6)
        head_at, target_at = (None if at is None else to_view.map(QPointF(*at)) for at in (head, target))
        over = [QRectF(cover.geometry()) for cover in covers if cover.isVisible()]
        places = on_screen(self._marks.places(), to_view)
        assert head_at is not None
        return corners[LoupeCorner().choose(corners, head_at, target_at, places, over)].topLeft().toPoint()

    def set_layer(self, layer: Layer, visible: bool) -> None:
        self._marks.set_layer(layer, visible)
        self._draw_marks()
        self._show_labels()
        self._show_loupe()

    def fit(self) -> None:
        if self._size is not None:
            self._box.fit(*self._size)

    def _show_picture(self, image: Image) -> None:
        height, width = image.shape[:2]
        self._picture.setImage(image, autoLevels=False, levels=None)
        if self._size != (width, height):
            self._size = (width, height)
            self._picture.setVisible(True)
            self._drawn.show()
            self.fit()

    def _show_labels(self) -> None:
        """Masks, and skeletons where there is no graph or path to draw as lines, as one image of label bits."""
        scene = self.scene
        if scene is None or scene.masks is None:
            self._labels.setVisible(False)
            return
        labels = np.zeros(scene.masks.vessel.shape, np.uint8)
        if self._marks.is_on(Layer.MASKS):
            labels |= scene.masks.vessel.view(np.uint8) * np.uint8(_VESSEL)
            labels |= scene.masks.robot.view(np.uint8) * np.uint8(_ROBOT)
        if scene.skeletons is not None:
            if self._marks.is_on(Layer.VESSEL) and scene.vessel_graph is None:
                labels |= scene.skeletons.vessel.view(np.uint8) * np.uint8(_VESSEL_SKELETON)
            if self._marks.is_on(Layer.ROBOT) and scene.path is None:
                labels |= scene.skeletons.robot.view(np.uint8) * np.uint8(_ROBOT_SKELETON)
        self._labels.setImage(labels, autoLevels=False, levels=None)
        across, down = scene.scale_xy or (scene.scale, scene.scale)
        self._labels.setTransform(QTransform.fromScale(1.0 / across, 1.0 / down))
        self._labels.setVisible(True)

    def _show_marks(self) -> None:
        scene = self.scene
        shapes = scene_shapes(scene, self.ghost) if scene is not None else None
        note = target_note(scene) if scene is not None and self._target is not None else ""
        self._marks.set_scene(shapes, scene.pose if scene is not None else None, self._target, note)
        self._draw_marks()

    def _draw_marks(self) -> None:
        if self._size is None:
            return
        self._drawn.setGeometry(self._view.geometry())
        label_px = 0 if self._marks.is_on(Layer.LOUPE) else _LABEL_PX  # the loupe shows the same values larger
        self._drawn.record(self._marks, self._to_view(), label_px)

    def place_of(self, point: Point) -> QPoint:
        """Where a place of the picture, source pixels, is on this widget."""
        return self._to_view().map(QPointF(point[0] + 0.5, point[1] + 0.5)).toPoint()

    def _to_view(self) -> QTransform:
        """From source pixels to the view's."""
        to_view: QTransform = self._box.childGroup.sceneTransform() * self._view.viewportTransform()
        return to_view

    def _show_loupe(self) -> None:
        scene, image = self.scene, self._image
        if not self._marks.is_on(Layer.LOUPE) or scene is None or image is None or scene.path is None:
            self._loupe.hide()
            return
        x, y = scene.to_source(scene.path.head)
        at = self._box.mapViewToScene(QPointF(x + 0.5, y + 0.5))
        covers = [QRectF(cover.geometry()) for cover in self.covers if cover.isVisible()]
        self._loupe.show_head(image, scene, QPointF(self._view.mapFromScene(at)), self._to_view(), covers)

    def _on_place(self, x: float, y: float) -> None:
        """A click at a place of the picture, source pixels, if it is one."""
        if self._size is not None and -0.5 <= x < self._size[0] - 0.5 and -0.5 <= y < self._size[1] - 0.5:
            self.clicked.emit(x, y)


class _SmoothImage(pg.ImageItem):  # type: ignore[misc]
    """An image that is interpolated when enlarged: whole pixels would hide the course of a thin robot.

    It paints from the screen's own pixel formats. Qt would convert others in its thread pool and wait for it: measured with both
    cores busy, a picture with masks then took 5-9 ms instead of 3.
    """

    def __init__(self, table: NDArray[np.uint32] | None = None) -> None:
        super().__init__(axisOrder="row-major")
        self._table = table
        self._pixels: NDArray[np.uint8] | NDArray[np.uint32] = np.zeros((1, 1, 4), np.uint8)

    def render(self) -> None:
        height, width = self.image.shape[:2]
        if self._table is not None:
            self._pixels = np.asarray(np.take(self._table, self.image, mode="wrap"), np.uint32)
            pixel_format = QImage.Format.Format_ARGB32_Premultiplied
        else:
            self._pixels = np.asarray(cv2.cvtColor(self.image, cv2.COLOR_RGB2BGRA), np.uint8)
            pixel_format = QImage.Format.Format_RGB32
        self.qimage = QImage(self._pixels.data, width, height, 4 * width, pixel_format)
        self._renderRequired = self._unrenderable = False

    def paint(self, painter: QPainter, *args: object) -> None:
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        super().paint(painter, *args)


class _PictureBox(pg.ViewBox):  # type: ignore[misc]
    """A view box whose left click means a place and whose drag moves a zoomed picture."""

    left_clicked = Signal(QPointF)
    right_clicked = Signal()

    def __init__(self) -> None:
        super().__init__(lockAspect=True, invertY=True, enableMenu=False, defaultPadding=0.0)
        self._fitted = True
        self._picture_size = (1, 1)

    def fit(self, width: int, height: int) -> None:
        self._picture_size = (width, height)
        self._fitted = True
        self.setLimits(minXRange=width / _ZOOM_MAX, minYRange=height / _ZOOM_MAX)
        self.setRange(xRange=(0, width), yRange=(0, height), padding=0)

    def mouseClickEvent(self, event: pg.GraphicsScene.mouseEvents.MouseClickEvent) -> None:
        event.accept()
        if event.double():
            return  # its first half may have closed a message over the picture
        if event.button() == Qt.MouseButton.LeftButton:
            self.left_clicked.emit(self.mapSceneToView(event.scenePos()))
        elif event.button() == Qt.MouseButton.RightButton:
            self.right_clicked.emit()

    def mouseDragEvent(self, event: pg.GraphicsScene.mouseEvents.MouseDragEvent, axis: int | None = None) -> None:
        if self._fitted or event.button() == Qt.MouseButton.RightButton:
            event.ignore()
            return
        super().mouseDragEvent(event, axis)

    def wheelEvent(self, event: object, axis: int | None = None) -> None:
        self._fitted = False
        super().wheelEvent(event, axis)
        (left, right), (top, bottom) = self.viewRange()
        if right - left >= self._picture_size[0] and bottom - top >= self._picture_size[1]:
            self.fit(*self._picture_size)


def _label_colours() -> NDArray[np.uint32]:
    """Premultiplied ARGB (16,) for every combination of label bits; the thinner structure wins."""
    table = np.zeros(16, np.uint32)
    for bits in range(16):
        for bit, name, alpha in (
            (_ROBOT_SKELETON, ON_PICTURE.ROBOT, 1.0),
            (_VESSEL_SKELETON, ON_PICTURE.VESSEL, 1.0),
            (_ROBOT, ON_PICTURE.ROBOT, 0.40),
            (_VESSEL, ON_PICTURE.VESSEL, 0.24),
        ):
            if bits & bit:
                red, green, blue = (round(part * alpha) for part in theme.rgb(name))
                table[bits] = round(255 * alpha) << 24 | red << 16 | green << 8 | blue
                break
    return table
