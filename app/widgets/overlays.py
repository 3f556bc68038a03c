"""What is drawn over the live picture: the switched-on layers of a scene, as marks of constant size."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter, QTransform

from app.language import mark
from app.palette import ON_PICTURE
from app.scene_shapes import SceneShapes
from app.widgets.loupe_corner import seen_places
from app.widgets.pencil import Pencil
from app.wording import signed_degrees
from core.types import Point, Points, Pose

_CLEAR_OFFSET_PX = 3.0


@dataclass(frozen=True, slots=True)
class LayerText:
    """Key, label and tool tip of a layer."""

    key: str
    label: str
    meaning: str


class Layer(Enum):
    """The overlays that can be switched, in the order of their keys."""

    MASKS = LayerText("1", mark("Masks"), mark("What the network took for vessel (blue) and robot (orange)"))
    VESSEL = LayerText("2", mark("Centerline"), mark("The vessel's centerline, from its skeleton"))
    ROBOT = LayerText("3", mark("Robot"), mark("The robot's path from tail to head; dotted where a gap was repaired"))
    HEAD = LayerText("4", mark("Head"), mark("The robot's head"))
    VECTORS = LayerText(
        "5", mark("Vectors"), mark("Fitted lines of robot (40 px, yellow) and vessel (light blue), and theta between them")
    )
    NEAREST = LayerText("6", mark("Nearest"), mark("The centerline point nearest to the head"))
    DISTANCES = LayerText("7", mark("Distances"), mark("d_head and d_tail: from the vessel line to both ends of the robot vector"))
    ROUTE = LayerText("8", mark("Route"), mark("The operator's target and the way to it"))
    LOUPE = LayerText("9", mark("Loupe"), mark("The surroundings of the head, magnified, in a corner of the picture"))
    GHOST = LayerText(
        "G", mark("Ghost"), mark("Where the head goes in the next two seconds if the advice is followed: the broken tube")
    )


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """All that is needed to draw. ``target`` is in source pixels; ``target_note`` is written beside it."""

    shapes: SceneShapes | None
    pose: Pose | None
    target: Point | None
    target_note: str = ""


class Marks:
    """Drawn in screen pixels: lines and texts keep their size at any zoom. A dark edge keeps them visible on any picture."""

    def __init__(self) -> None:
        self._overlay = Overlay(None, None, None)
        self._visible = set(Layer)
        self._head_side = self._tail_side = 1.0

    def set_overlay(self, overlay: Overlay) -> None:
        self._overlay = overlay
        if overlay.pose is not None:
            self._head_side = _steady_side(self._head_side, overlay.pose.c_head_px)
            self._tail_side = _steady_side(self._tail_side, overlay.pose.c_tail_px)

    def set_layer(self, layer: Layer, visible: bool) -> None:
        if visible:
            self._visible.add(layer)
        else:
            self._visible.discard(layer)

    def places(self) -> tuple[Points, NDArray[np.float64]]:
        """What there is to see, drawn or not, (N, 2) in source pixels, and how much each place matters (N,)."""
        return seen_places(self._overlay.shapes, self._overlay.target)

    def draw(self, painter: QPainter, to_screen: QTransform, room: QRectF, label_px: int, *, tags: bool = True) -> None:
        """Draw with `to_screen` (source pixels to the screen) within `room` on the screen; labels in that size, 0 for none.

        A magnified part is drawn without `tags`: the whole picture has them, and here they would lie on what is magnified.
        """
        pencil = Pencil(painter, to_screen, label_px, room)
        shapes, pose = self._overlay.shapes, self._overlay.pose
        if shapes is not None:
            if Layer.VESSEL in self._visible:
                pencil.polylines(shapes.vessel_lines, ON_PICTURE.VESSEL, 2.0)
            if Layer.ROUTE in self._visible and shapes.route is not None:
                pencil.polylines((shapes.route,), ON_PICTURE.ROUTE, 4.0, Qt.PenStyle.DashLine)
            if Layer.ROBOT in self._visible:
                _draw_robot(pencil, shapes)
            if Layer.GHOST in self._visible and shapes.ghost is not None:
                pencil.tube(shapes.ghost, ON_PICTURE.GHOST, shapes.robot_width)
            if Layer.VECTORS in self._visible:
                _draw_vectors(pencil, shapes, pose, -self._head_side)
            if Layer.DISTANCES in self._visible and pose is not None:
                _draw_distances(pencil, shapes, pose, (self._head_side, self._tail_side))
            if Layer.NEAREST in self._visible and shapes.nearest is not None:
                pencil.diamond(shapes.nearest, ON_PICTURE.NEAREST, 6.0)
            if Layer.HEAD in self._visible and shapes.head is not None:
                pencil.ring(shapes.head, ON_PICTURE.HEAD, 8.0)
        if Layer.ROUTE in self._visible and self._overlay.target is not None:
            pencil.crosshair(self._overlay.target, ON_PICTURE.TARGET, 13.0)
            if tags and self._overlay.target_note:
                pencil.tag(self._overlay.target, self._overlay.target_note, ON_PICTURE.TARGET)


def _draw_robot(pencil: Pencil, shapes: SceneShapes) -> None:
    if shapes.robot_line is not None:
        pencil.polylines((shapes.robot_line,), ON_PICTURE.ROBOT, 3.0)
    for first, second in shapes.bridges:
        pencil.polylines((np.array([first, second]),), ON_PICTURE.TEXT, 2.0, Qt.PenStyle.DotLine)


def _draw_vectors(pencil: Pencil, shapes: SceneShapes, pose: Pose | None, angle_side: float) -> None:
    if shapes.vessel_vector is not None:
        pencil.arrow(shapes.vessel_vector, ON_PICTURE.VESSEL_VECTOR, 3.0)
    if shapes.robot_vector is not None:
        pencil.arrow(shapes.robot_vector, ON_PICTURE.ROBOT_VECTOR, 3.0)
    if shapes.angle_arc is None or shapes.robot_vector is None or shapes.vessel_vector is None or pose is None:
        return
    pencil.angle(shapes.robot_vector.start, shapes.angle_arc, ON_PICTURE.THETA)
    # on the side of the vessel where the head is not: there is the least to cover
    vessel = shapes.vessel_vector
    pencil.label_beside(vessel.center, vessel, angle_side, f"θ {signed_degrees(pose.theta_signed_deg, 0)}", ON_PICTURE.THETA)


def _draw_distances(pencil: Pencil, shapes: SceneShapes, pose: Pose, sides: tuple[float, float]) -> None:
    robot, vessel = shapes.robot_vector, shapes.vessel_vector
    if robot is None or vessel is None or shapes.head_foot is None or shapes.tail_foot is None:
        return
    pencil.measure(shapes.head_foot, robot.end, ON_PICTURE.D_HEAD, Qt.PenStyle.SolidLine)
    pencil.measure(shapes.tail_foot, robot.start, ON_PICTURE.D_TAIL, Qt.PenStyle.DotLine)
    pencil.label_beside(robot.end, vessel, sides[0], f"d_head {pose.d_head_px:.0f}", ON_PICTURE.D_HEAD)
    pencil.label_beside(robot.start, vessel, sides[1], f"d_tail {pose.d_tail_px:.0f}", ON_PICTURE.D_TAIL)


def _steady_side(side: float, offset_px: float) -> float:
    """Side of the vessel line that a label is on; it changes only when the offset is clear, or labels would flicker at zero."""
    return side if abs(offset_px) < _CLEAR_OFFSET_PX else (1.0 if offset_px > 0 else -1.0)
