"""The live picture with its overlays; a click sets the target."""

from __future__ import annotations

import cv2
import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QImage, QPainter, QResizeEvent, QTransform
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from app import palette
from app.language import tr
from app.pace import Pace
from app.palette import ON_PICTURE
from app.scene_shapes import scene_shapes
from app.widgets.head_loupe import HeadLoupe
from app.widgets.marks_label import MarksLabel
from app.widgets.overlays import Layer, Marks, Overlay
from app.wording import target_note
from core.control.ghost import predict
from core.policy_config import PursuitConfig
from core.types import Advice, Frame, Image, Point, Points, Scene

_VESSEL, _ROBOT, _VESSEL_SKELETON, _ROBOT_SKELETON = 1, 2, 4, 8
_ZOOM_MAX = 12.0
_GHOST_S = 2.0
_LABEL_PX = 13
_LOUPE_EVERY_S = 0.09
_PIXELS_PER_MM = PursuitConfig().pixels_per_mm


class LiveView(QWidget):
    """Shows a frame and what was understood of it. Plot items are made once and updated in place.

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
        self._scene: Scene | None = None
        self._target: Point | None = None
        self._masks_on = self._vessel_on = self._robot_on = self._loupe_on = True
        self._image: Image | None = None
        self._ghost: Points | None = None
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
        self._box.left_clicked.connect(self._on_left_click)
        self._box.right_clicked.connect(self.cleared)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._view)
        self._marks = Marks()
        self._drawn = MarksLabel(self)
        self._box.sigTransformChanged.connect(self._draw_marks)
        self._loupe = HeadLoupe(self, self._marks)
        self._loupe.clicked.connect(self._on_place)
        self._loupe_pace = Pace(_LOUPE_EVERY_S)
        self._covers: tuple[QWidget, ...] = ()

    def set_covers(self, *widgets: QWidget) -> None:
        """What lies over the picture at times: the loupe goes out of its way."""
        self._covers = widgets

    @property
    def scene(self) -> Scene | None:
        return self._scene

    @property
    def ghost(self) -> Points | None:
        """Where the shown advice leads, in working px; None: nothing is advised."""
        return self._ghost

    def set_scale(self, pixels_per_mm: float) -> None:
        self._pixels_per_mm = pixels_per_mm

    def show_frame(self, frame: Frame, scene: Scene, advice: Advice | None = None) -> None:
        """Show a frame with its scene, and where `advice` leads; None: no ghost."""
        is_first = self._size is None
        self._show_picture(frame.image)
        self._scene = scene
        self._ghost = predict(scene, advice, _GHOST_S, self._pixels_per_mm) if advice is not None else None
        self._image = frame.image
        if is_first:  # nothing of an older picture is on the screen: what is drawn over it may come a moment later
            QTimer.singleShot(0, self, self._draw_over)
        else:
            self._draw_over()

    def _draw_over(self) -> None:
        self._show_labels()
        self._show_marks()
        if self._scene is None or self._scene.path is None or self._loupe_pace.due():
            self._show_loupe()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        QTimer.singleShot(0, self, self._show_loupe)  # a picture that stands still has no next frame to put it right

    def drop_ghost(self) -> None:
        """Where the last advice led is not advised any more."""
        if self._ghost is not None:
            self._ghost = None
            self._draw_over()

    def blank_overlays(self) -> None:
        """Take everything away that was understood: it is not true any more. The last picture and the target stay."""
        if self._scene is not None:
            self._scene = None
            self._show_labels()
            self._show_marks()
            self._show_loupe()

    def clear(self) -> None:
        """Show nothing at all: what comes next is another world."""
        self.blank_overlays()
        self._size = None
        self._image = None
        self._picture.setVisible(False)
        self._drawn.hide()

    def show_target(self, target: Point | None) -> None:
        self._target = target
        self._show_marks()
        self._show_loupe()

    def set_layer(self, layer: Layer, visible: bool) -> None:
        if layer is Layer.MASKS:
            self._masks_on = visible
        elif layer is Layer.VESSEL:
            self._vessel_on = visible
        elif layer is Layer.ROBOT:
            self._robot_on = visible
        elif layer is Layer.LOUPE:
            self._loupe_on = visible
        self._marks.set_layer(layer, visible)
        self._draw_marks()
        self._show_labels()
        self._show_loupe()

    def fit(self) -> None:
        """Show the whole picture."""
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
        """Masks, and skeletons as long as there is no graph or path to draw as lines, as one picture of label bits."""
        scene = self._scene
        if scene is None or scene.masks is None:
            self._labels.setVisible(False)
            return
        labels = np.zeros(scene.masks.vessel.shape, np.uint8)
        if self._masks_on:
            labels |= scene.masks.vessel.view(np.uint8) * np.uint8(_VESSEL)
            labels |= scene.masks.robot.view(np.uint8) * np.uint8(_ROBOT)
        if scene.skeletons is not None:
            if self._vessel_on and scene.vessel_graph is None:
                labels |= scene.skeletons.vessel.view(np.uint8) * np.uint8(_VESSEL_SKELETON)
            if self._robot_on and scene.path is None:
                labels |= scene.skeletons.robot.view(np.uint8) * np.uint8(_ROBOT_SKELETON)
        self._labels.setImage(labels, autoLevels=False, levels=None)
        across, down = scene.scale_xy or (scene.scale, scene.scale)
        self._labels.setTransform(QTransform.fromScale(1.0 / across, 1.0 / down))
        self._labels.setVisible(True)

    def _show_marks(self) -> None:
        scene = self._scene
        shapes = scene_shapes(scene, self._ghost) if scene is not None else None
        note = target_note(scene) if scene is not None and self._target is not None else ""
        self._marks.set_overlay(Overlay(shapes, scene.pose if scene is not None else None, self._target, note))
        self._draw_marks()

    def _draw_marks(self) -> None:
        if self._size is None:
            return
        self._drawn.setGeometry(self._view.geometry())
        self._drawn.record(
            self._marks, self._to_view(), 0 if self._loupe_on else _LABEL_PX
        )  # the loupe shows the same values larger

    def _to_view(self) -> QTransform:
        """From source pixels to the view's."""
        to_view: QTransform = self._box.childGroup.sceneTransform() * self._view.viewportTransform()
        return to_view

    def _show_loupe(self) -> None:
        scene, image = self._scene, self._image
        if not self._loupe_on or scene is None or image is None or scene.path is None:
            self._loupe.hide()
            return
        x, y = scene.to_source(scene.path.head)
        at = self._box.mapViewToScene(QPointF(x + 0.5, y + 0.5))
        covers = [QRectF(cover.geometry()) for cover in self._covers if cover.isVisible()]
        self._loupe.show_head(image, scene, QPointF(self._view.mapFromScene(at)), self._to_view(), covers)

    def _on_left_click(self, point: QPointF) -> None:
        self._on_place(point.x() - 0.5, point.y() - 0.5)

    def _on_place(self, x: float, y: float) -> None:
        """A place of the picture, source pixels, if it is one."""
        if self._size is not None and -0.5 <= x < self._size[0] - 0.5 and -0.5 <= y < self._size[1] - 0.5:
            self.clicked.emit(x, y)


class _SmoothImage(pg.ImageItem):  # type: ignore[misc]
    """Interpolated when enlarged: whole pixels would hide where a thin robot is.

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
            return  # its first half may have closed what lay over the picture, and never meant a place
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
    """Premultiplied ARGB (16,) for every combination of label bits; what is thinner wins."""
    table = np.zeros(16, np.uint32)
    for bits in range(16):
        for bit, name, alpha in (
            (_ROBOT_SKELETON, ON_PICTURE.ROBOT, 1.0),
            (_VESSEL_SKELETON, ON_PICTURE.VESSEL, 1.0),
            (_ROBOT, ON_PICTURE.ROBOT, 0.40),
            (_VESSEL, ON_PICTURE.VESSEL, 0.24),
        ):
            if bits & bit:
                red, green, blue = (round(part * alpha) for part in palette.rgb(name))
                table[bits] = round(255 * alpha) << 24 | red << 16 | green << 8 | blue
                break
    return table
