"""In which corner of the view the loupe hides least.

What is drawn over the live picture: the switched-on layers of a scene, as marks of constant size.

A scene as shapes in source pixels, which both the live view and the overlay pictures draw.

The shape that stands for each pose state, as an outline that Qt and OpenCV both draw.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QTransform

from app.ui.i18n import mark
from app.ui.texts import signed_degrees
from app.ui.theme import ON_PICTURE
from app.widgets.scene_painter import ScenePainter
from core.types import Point, Points, Pose, PoseState, Scene, Vector

_MIN_STEP_PX = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class SceneShapes:
    """Shapes in source pixels (pixel centres at integers). What the scene does not have is None or empty.

    ``head_foot`` and ``tail_foot`` are the feet of the robot vector's end and start on the vessel line, so that the pieces
    robot_vector.end -> head_foot and robot_vector.start -> tail_foot are d_head and d_tail. ``angle_arc`` (N, 2) turns from the
    vessel's direction to the robot's around ``robot_vector.start``, with radius 1: painters scale it. ``ghost`` (N, 2) is where the
    head goes next, ``robot_width`` the robot's thickness.
    """

    vessel_lines: tuple[Points, ...]
    robot_line: Points | None
    bridges: tuple[tuple[Point, Point], ...]
    head: Point | None
    nearest: Point | None
    robot_vector: Vector | None
    vessel_vector: Vector | None
    head_foot: Point | None
    tail_foot: Point | None
    angle_arc: Points | None
    route: Points | None
    ghost: Points | None = None
    robot_width: float = 0.0


def scene_shapes(scene: Scene, ghost: Points | None = None) -> SceneShapes:
    """The shapes of `scene`, mapped to source pixels; polylines are thinned to steps of about 5 working pixels.

    `ghost` is the head's predicted path in working pixels.
    """
    robot, vessel = _vector(scene, scene.robot_vector), _vector(scene, scene.vessel_vector)
    both = robot is not None and vessel is not None and scene.pose is not None
    return SceneShapes(
        vessel_lines=tuple(_line(scene, edge.points) for edge in scene.vessel_graph.edges) if scene.vessel_graph else (),
        robot_line=_line(scene, scene.path.points) if scene.path else None,
        bridges=tuple((scene.to_source(a), scene.to_source(b)) for a, b in scene.skeletons.bridges) if scene.skeletons else (),
        head=scene.to_source(scene.path.head) if scene.path else None,
        nearest=scene.to_source(scene.centerline.nearest) if scene.centerline else None,
        robot_vector=robot,
        vessel_vector=vessel,
        head_foot=foot(vessel, robot.end) if both and robot and vessel else None,
        tail_foot=foot(vessel, robot.start) if both and robot and vessel else None,
        angle_arc=_arc(vessel, robot) if both and robot and vessel else None,
        route=_line(scene, scene.route.points) if scene.route else None,
        ghost=scene.points_to_source(ghost) if ghost is not None else None,
        robot_width=2.0 * scene.path.radius_px / scene.scale if scene.path else 0.0,
    )


def foot(line: Vector, point: Point) -> Point:
    """The point of the straight line through `line` that is nearest to `point` (METHOD section 5: point - c * normal)."""
    vx, vy = line.direction
    offset = vx * (point[1] - line.center[1]) - vy * (point[0] - line.center[0])
    return point[0] + offset * vy, point[1] - offset * vx


def _vector(scene: Scene, vector: Vector | None) -> Vector | None:
    if vector is None:
        return None
    return Vector(scene.to_source(vector.start), scene.to_source(vector.center), scene.to_source(vector.end))


def _line(scene: Scene, points: Points) -> Points:
    """Every n-th point in source pixels, ends kept: a pixel chain needs no point per pixel to look the same."""
    if len(points) > 2:
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        stride = max(1, int(_MIN_STEP_PX * (len(points) - 1) / max(length, 1e-9)))
        keep = np.unique(np.append(np.arange(0, len(points), stride), len(points) - 1))
        points = points[keep]
    return scene.points_to_source(points)


def _arc(vessel: Vector, robot: Vector) -> Points:
    start = np.arctan2(vessel.direction[1], vessel.direction[0])
    turn = np.arctan2(robot.direction[1], robot.direction[0]) - start
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    angles = start + np.linspace(0.0, turn, 24)
    return np.column_stack([np.cos(angles), np.sin(angles)])


_NEAR_PX, _CLEAR_PX = 20, 60
_SETTLE_S = 1.0
_MUCH, _SHARE = 30.0, 0.5
_VESSEL, _ROBOT, _ROUTE, _TARGET = 1.0, 2.0, 3.0, 200.0
_COVERED = 150.0


class LoupeCorner:
    """Leaves a corner at once when the head comes near, and for a much better one only after a second: it must not jump about."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._corner: int | None = None
        self._better_since_s: float | None = None

    def choose(
        self,
        corners: Sequence[QRectF],
        head: QPointF,
        places: Points,
        weights: NDArray[np.float64],
        covers: Sequence[QRectF] = (),
    ) -> int:
        """Which of `corners`.

        Parameters
        ----------
        corners : where the loupe would lie, on the view.
        head : where the robot's head is.
        places : (N, 2) what there is to see, also beyond the view.
        weights : (N,) how much each place matters.
        covers : what lies over the loupe.
        """
        hidden = [
            float(weights[_within(corner, places)].sum()) + _COVERED * any(corner.intersects(cover) for cover in covers)
            for corner in corners
        ]
        free = [k for k, corner in enumerate(corners) if not _grown(corner, _CLEAR_PX).contains(head)]
        best = min(free or range(len(corners)), key=lambda k: hidden[k])
        now = self._corner
        if now is None or now >= len(corners) or (free and _grown(corners[now], _NEAR_PX).contains(head)):
            self._move(best)
        elif hidden[now] - hidden[best] > max(_MUCH, _SHARE * hidden[now]):
            self._better_since_s = self._clock() if self._better_since_s is None else self._better_since_s
            if self._clock() - self._better_since_s >= _SETTLE_S:
                self._move(best)
        else:
            self._better_since_s = None
        assert self._corner is not None
        return self._corner

    def _move(self, corner: int) -> None:
        self._corner, self._better_since_s = corner, None


def seen_places(shapes: SceneShapes | None, target: Point | None) -> tuple[Points, NDArray[np.float64]]:
    """What there is to see in a picture: places (N, 2) in source pixels, and how much each matters (N,)."""
    parts: list[tuple[Points, float]] = []
    if shapes is not None:
        parts += [(line, _VESSEL) for line in shapes.vessel_lines]
        parts += [(line, _ROBOT) for line in (shapes.robot_line,) if line is not None]
        parts += [(line, _ROUTE) for line in (shapes.route, shapes.ghost) if line is not None]
    if target is not None:
        parts.append((np.array([target], np.float64), _TARGET))
    if not parts:
        return np.empty((0, 2)), np.empty(0)
    return np.concatenate([line for line, _ in parts]), np.concatenate([np.full(len(line), weight) for line, weight in parts])


def _within(rect: QRectF, places: Points) -> NDArray[np.bool_]:
    x, y = places[:, 0], places[:, 1]
    return np.asarray((x > rect.left()) & (x < rect.right()) & (y > rect.top()) & (y < rect.bottom()))


def _grown(rect: QRectF, by_px: float) -> QRectF:
    return rect.adjusted(-by_px, -by_px, by_px, by_px)


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
        pencil = ScenePainter(painter, to_screen, label_px, room)
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


def _draw_robot(pencil: ScenePainter, shapes: SceneShapes) -> None:
    if shapes.robot_line is not None:
        pencil.polylines((shapes.robot_line,), ON_PICTURE.ROBOT, 3.0)
    for first, second in shapes.bridges:
        pencil.polylines((np.array([first, second]),), ON_PICTURE.TEXT, 2.0, Qt.PenStyle.DotLine)


def _draw_vectors(pencil: ScenePainter, shapes: SceneShapes, pose: Pose | None, angle_side: float) -> None:
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


def _draw_distances(pencil: ScenePainter, shapes: SceneShapes, pose: Pose, sides: tuple[float, float]) -> None:
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


LETTER_HEIGHT: dict[PoseState | None, float] = {
    None: 0.60,
    PoseState.A: 0.60,
    PoseState.B: 0.64,
    PoseState.C: 0.50,
    PoseState.D: 0.54,
}
"""Font size over the box's side."""
LETTER_DROP: dict[PoseState | None, float] = {PoseState.C: 0.13}
"""How far below the middle of the box the letter sits, over the box's side: a triangle's visual middle is lower."""


def state_outline(state: PoseState | None) -> Points:
    """Closed outline (N, 2) in a box of -1..1: A circle, B square, C triangle, D diamond, None circle."""
    if state is PoseState.B:
        return _rounded([(-0.86, -0.86), (0.86, -0.86), (0.86, 0.86), (-0.86, 0.86)], 0.2)
    if state is PoseState.C:
        corners = [(0.0, -1.0), (1.06, 0.84), (-1.06, 0.84)]
        return _rounded(corners, 0.22)
    if state is PoseState.D:
        return _rounded([(0.0, -1.02), (1.02, 0.0), (0.0, 1.02), (-1.02, 0.0)], 0.16)
    turn = np.linspace(0.0, 2 * math.pi, 72, endpoint=False)
    return 0.95 * np.column_stack([np.cos(turn), np.sin(turn)])


def _rounded(corners: list[Point], rounding: float) -> Points:
    """The polygon with its corners replaced by quadratic curves that start `rounding` before them."""
    points = np.array(corners)
    along = np.linspace(0.0, 1.0, 8)[:, None]
    pieces = []
    for k, corner in enumerate(points):
        before, after = points[k - 1] - corner, points[(k + 1) % len(points)] - corner
        enter = corner + before / np.linalg.norm(before) * rounding
        leave = corner + after / np.linalg.norm(after) * rounding
        pieces.append((1 - along) ** 2 * enter + 2 * along * (1 - along) * corner + along**2 * leave)
    return np.concatenate(pieces)
