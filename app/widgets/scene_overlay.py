"""What is drawn over a picture: a scene as shapes in source pixels, and the switchable layers of marks that show them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QPainter, QResizeEvent, QTransform
from PySide6.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import mark, tr
from app.ui.texts import signed_degrees
from app.ui.theme import ON_PICTURE
from app.widgets.painting import CENTER, Painted, draw_box, draw_text, text_width
from app.widgets.scene_painter import ScenePainter
from core.evaluation.rehearsal import RehearsalResult
from core.types import Point, Points, Pose, Scene, Vector

_MIN_STEP_PX = 5.0  # of polylines, working pixels
_CLEAR_OFFSET_PX = 3.0  # from which on a label changes its side of the vessel line


@dataclass(frozen=True, slots=True, eq=False)
class SceneShapes:
    """Shapes in source pixels (pixel centres at integers). What the scene lacks: None or empty.

    ``head_foot`` and ``tail_foot`` are the projections of the robot vector's end and start on the vessel line, so that
    robot_vector.end -> head_foot and robot_vector.start -> tail_foot are d_head and d_tail. ``angle_arc`` (N, 2) turns from the
    vessel's direction to the robot's around ``robot_vector.start``, with radius 1: painters scale it. ``ghost`` (N, 2) is the
    predicted path of the head, ``robot_width`` the robot's thickness.
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
    head_foot = tail_foot = angle_arc = None
    if robot is not None and vessel is not None and scene.pose is not None:
        head_foot, tail_foot, angle_arc = foot(vessel, robot.end), foot(vessel, robot.start), _arc(vessel, robot)
    return SceneShapes(
        vessel_lines=tuple(_line(scene, edge.points) for edge in scene.vessel_graph.edges) if scene.vessel_graph else (),
        robot_line=_line(scene, scene.path.points) if scene.path else None,
        bridges=tuple((scene.to_source(a), scene.to_source(b)) for a, b in scene.skeletons.bridges) if scene.skeletons else (),
        head=scene.to_source(scene.path.head) if scene.path else None,
        nearest=scene.to_source(scene.centerline.nearest) if scene.centerline else None,
        robot_vector=robot,
        vessel_vector=vessel,
        head_foot=head_foot,
        tail_foot=tail_foot,
        angle_arc=angle_arc,
        route=_line(scene, scene.route.points) if scene.route else None,
        ghost=scene.points_to_source(ghost) if ghost is not None else None,
        robot_width=2.0 * scene.path.radius_px / scene.scale if scene.path else 0.0,
    )


HEAT = ((0.5, ON_PICTURE.VERMILLION), (0.15, ON_PICTURE.ORANGE), (0.05, ON_PICTURE.YELLOW))
"""Colours of wall forces from so many newtons on; the limits are those of a recommended speed."""


_ONE_PLACE = 0.06
"""Of the picture's longer side: signs that are nearer to each other are one."""


@dataclass(frozen=True, slots=True, eq=False)
class RehearsalShapes:
    """What a rehearsal found along the way, in source pixels.

    ``low`` and ``high`` (N, 2) have 90 % of the heads' paths between them. ``heat`` has the pieces where the wall is touched, by
    colour, hardest last. ``notes`` are places with a text: the weakest one, and branches that are too sharp.
    """

    low: Points
    high: Points
    heat: tuple[tuple[str, tuple[Points, ...]], ...]
    notes: tuple[tuple[Point, str], ...]


def rehearsal_shapes(result: RehearsalResult) -> RehearsalShapes:
    way = result.way
    low, middle, high = (np.array(line, np.float64).reshape(-1, 2) for line in (way.low_xy, way.xy, way.high_xy))
    levels = [sum(force >= limit for limit, _ in HEAT) for force in way.wall_force_n]
    heat = tuple(
        (colour, tuple(middle[max(0, k - 1) : k + 2] for k, found in enumerate(levels) if found == len(HEAT) - number))
        for number, (_, colour) in enumerate(HEAT)
    )
    notes = [
        (turn.xy, tr("turns by {turn:.0f}°, the head by {limit:.0f}°", turn=turn.turn_deg, limit=turn.limit_deg))
        for turn in result.sharp
    ]
    if (weakest := result.weakest) is not None and (weakest.ended_here or weakest.wall_force_p95_n >= HEAT[-1][0]):
        what = tr("weakest bend: {force:.2f} N", force=weakest.wall_force_p95_n)
        what = tr("{count} runs ended here", count=weakest.ended_here) if weakest.ended_here else what
        near = [math.dist(place, weakest.xy) < _ONE_PLACE * max(result.size_px) for place, _ in notes]
        if True in near:
            place, text = notes[near.index(True)]
            notes[near.index(True)] = place, f"{text}; {what}"
        else:
            notes.append((weakest.xy, what))
    return RehearsalShapes(low, high, heat[::-1], tuple(notes))


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
    REHEARSAL = LayerText(
        "B",
        mark("Band"),
        mark("The rehearsal: 90 % of the heads' paths lie in the band; yellow, orange, red: wall force from 0.05, 0.15, 0.5 N on"),
    )


class Marks:
    """The marks of a scene, in screen pixels: lines and texts keep their size at any zoom.

    `digits` of the distances, and of the angle, on their labels.
    """

    def __init__(self, digits: int = 0) -> None:
        self._digits = digits
        self._shapes: SceneShapes | None = None
        self.rehearsal: RehearsalShapes | None = None
        self._pose: Pose | None = None
        self.target: Point | None = None
        self._note = ""
        self._visible = set(Layer)
        self._head_side = self._tail_side = 1.0

    def set_scene(self, shapes: SceneShapes | None, pose: Pose | None, target: Point | None, target_note: str = "") -> None:
        """What to draw. `target` is in source pixels; `target_note` is written beside it."""
        self._shapes, self._pose, self.target, self._note = shapes, pose, target, target_note
        if pose is not None:
            self._head_side = _steady_side(self._head_side, pose.c_head_px)
            self._tail_side = _steady_side(self._tail_side, pose.c_tail_px)

    def set_layer(self, layer: Layer, visible: bool) -> None:
        (self._visible.add if visible else self._visible.discard)(layer)

    def is_on(self, layer: Layer) -> bool:
        return layer in self._visible

    def places(self) -> Points:
        """The lines that there are to see, drawn or not, (N, 2) in source pixels."""
        shapes = self._shapes
        lines = () if shapes is None else (*shapes.vessel_lines, shapes.robot_line, shapes.route, shapes.ghost)
        return np.concatenate([np.empty((0, 2)), *(line for line in lines if line is not None)])

    def draw(
        self, painter: QPainter, to_screen: QTransform, room: QRectF, label_px: int, *, tags: bool = True, smooth: bool = False
    ) -> None:
        """Draw with `to_screen` (source pixels to the screen) within `room` on the screen; labels in that size, 0 for none.

        A magnified part is drawn without `tags`: the whole picture has them, and here they would cover what is magnified.
        A picture that is kept is drawn `smooth`.
        """
        marks = ScenePainter(painter, to_screen, label_px, room, smooth=smooth)
        shapes, visible = self._shapes, self._visible
        rehearsal = self.rehearsal if Layer.REHEARSAL in visible else None
        if rehearsal is not None:
            marks.band(rehearsal.low, rehearsal.high, ON_PICTURE.TEXT)
            for colour, pieces in rehearsal.heat:
                marks.polylines(pieces, colour, 7.0)
        if shapes is not None:
            if Layer.VESSEL in visible:
                marks.polylines(shapes.vessel_lines, ON_PICTURE.VESSEL, 2.0)
            if Layer.ROUTE in visible and shapes.route is not None:
                width = 4.0 if rehearsal is None else 2.0
                marks.polylines((shapes.route,), ON_PICTURE.ROUTE, width, Qt.PenStyle.DashLine)
            if Layer.ROBOT in visible:
                if shapes.robot_line is not None:
                    marks.polylines((shapes.robot_line,), ON_PICTURE.ROBOT, 3.0)
                for first, second in shapes.bridges:
                    marks.polylines((np.array([first, second]),), ON_PICTURE.TEXT, 2.0, Qt.PenStyle.DotLine)
            if Layer.GHOST in visible and shapes.ghost is not None:
                marks.tube(shapes.ghost, ON_PICTURE.GHOST, shapes.robot_width)
            if Layer.VECTORS in visible:
                self._draw_vectors(marks, shapes)
            if Layer.DISTANCES in visible:
                self._draw_distances(marks, shapes)
            if Layer.NEAREST in visible and shapes.nearest is not None:
                marks.diamond(shapes.nearest, ON_PICTURE.NEAREST, 6.0)
            if Layer.HEAD in visible and shapes.head is not None:
                marks.ring(shapes.head, ON_PICTURE.HEAD, 8.0)
        if Layer.ROUTE in visible and self.target is not None:
            marks.crosshair(self.target, ON_PICTURE.TARGET, 13.0)
            if tags and self._note:
                marks.tag(self.target, self._note, ON_PICTURE.TARGET)
        for place, text in rehearsal.notes if rehearsal is not None else ():
            marks.warning(place, text if tags else "", ON_PICTURE.ORANGE)

    def _draw_vectors(self, marks: ScenePainter, shapes: SceneShapes) -> None:
        robot, vessel = shapes.robot_vector, shapes.vessel_vector
        if vessel is not None:
            marks.arrow(vessel, ON_PICTURE.VESSEL_VECTOR, 3.0)
        if robot is not None:
            marks.arrow(robot, ON_PICTURE.ROBOT_VECTOR, 3.0)
        if robot is not None and vessel is not None and shapes.angle_arc is not None and self._pose is not None:
            marks.angle(robot.start, shapes.angle_arc, ON_PICTURE.THETA)
            # on the side of the vessel where the head is not: there is the least to cover
            text = f"θ {signed_degrees(self._pose.theta_signed_deg, self._digits)}"
            marks.label_beside(vessel.center, vessel, -self._head_side, text, ON_PICTURE.THETA)

    def _draw_distances(self, marks: ScenePainter, shapes: SceneShapes) -> None:
        robot, vessel, pose = shapes.robot_vector, shapes.vessel_vector, self._pose
        if robot is None or vessel is None or pose is None or shapes.head_foot is None or shapes.tail_foot is None:
            return
        marks.measure(shapes.head_foot, robot.end, ON_PICTURE.D_HEAD, Qt.PenStyle.SolidLine)
        marks.measure(shapes.tail_foot, robot.start, ON_PICTURE.D_TAIL, Qt.PenStyle.DotLine)
        unit = " px" if self._digits else ""
        for name, point, value, side, colour in (
            ("d_head", robot.end, pose.d_head_px, self._head_side, ON_PICTURE.D_HEAD),
            ("d_tail", robot.start, pose.d_tail_px, self._tail_side, ON_PICTURE.D_TAIL),
        ):
            marks.label_beside(point, vessel, side, f"{name} {value:.{self._digits}f}{unit}", colour)


def _steady_side(side: float, offset_px: float) -> float:
    """Side of the vessel line that a label is on; it changes only when the offset is clear, or labels would flicker at zero."""
    return side if abs(offset_px) < _CLEAR_OFFSET_PX else (1.0 if offset_px > 0 else -1.0)


_SEEN = 3.0  # contrast from which on a swatch is seen
_CHIP_HEIGHT, _CHIP_NARROW, _CHIP_GAP = 30, 54, 5
_TIGHT = 0.9
"""Names in a font smaller by this share still fit."""
_SWATCH_PX = 13
"""Room of a chip's colour; without it the colour is a line below the name."""
_SWATCH = {
    Layer.MASKS: ON_PICTURE.VESSEL,
    Layer.VESSEL: ON_PICTURE.VESSEL,
    Layer.ROBOT: ON_PICTURE.ROBOT,
    Layer.HEAD: ON_PICTURE.HEAD,
    Layer.VECTORS: ON_PICTURE.ROBOT_VECTOR,
    Layer.NEAREST: ON_PICTURE.NEAREST,
    Layer.DISTANCES: ON_PICTURE.D_HEAD,
    Layer.ROUTE: ON_PICTURE.ROUTE,
    Layer.LOUPE: ON_PICTURE.TEXT,
    Layer.GHOST: ON_PICTURE.GHOST,
    Layer.REHEARSAL: ON_PICTURE.ORANGE,
}


class OverlayBar(QWidget):
    """``toggled`` carries a layer and whether it is on. That of the rehearsal has a chip while there is one."""

    toggled = Signal(object, bool)

    def __init__(self) -> None:
        super().__init__()
        self._chips = {layer: _Chip(layer, self) for layer in Layer}
        for layer, chip in self._chips.items():
            chip.toggled.connect(lambda on, which=layer: self.toggled.emit(which, on))
        self._chips[Layer.REHEARSAL].hide()
        policy = QSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Minimum)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setAccessibleName(tr("Overlays"))

    def show_rehearsal(self, is_there: bool) -> None:
        if self._chips[Layer.REHEARSAL].isHidden() is is_there:
            self._chips[Layer.REHEARSAL].setVisible(is_there)
            self._place()
            self.updateGeometry()

    @property
    def _shown(self) -> list[_Chip]:
        return [chip for chip in self._chips.values() if not chip.isHidden()]

    def sizeHint(self) -> QSize:
        return QSize(_full_width(self._shown), _CHIP_HEIGHT)

    def minimumSizeHint(self) -> QSize:
        widest = (len(self._chips) + 1) // 2
        return QSize(widest * (_CHIP_NARROW + _CHIP_GAP) - _CHIP_GAP, _CHIP_HEIGHT)

    def heightForWidth(self, width: int) -> int:
        return len(self._rows(width)) * (_CHIP_HEIGHT + _CHIP_GAP) - _CHIP_GAP

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._place()

    def _place(self) -> None:
        top = 0
        for row in self._rows(self.width()):
            left = 0.0
            # each gets as much more, or less, as its name is long
            share = (self.width() + _CHIP_GAP) / (_full_width(row) + _CHIP_GAP)
            for chip in row:
                step = (chip.sizeHint().width() + _CHIP_GAP) * share
                chip.setGeometry(round(left), top, round(left + step) - _CHIP_GAP - round(left), _CHIP_HEIGHT)
                left += step
            top += _CHIP_HEIGHT + _CHIP_GAP

    def _rows(self, width: int) -> list[list[_Chip]]:
        chips = self._shown
        if width >= _TIGHT * (_full_width(chips) - _SWATCH_PX * len(chips)):  # names without colours: the picture needs the height
            return [chips]
        half = (len(chips) + 1) // 2
        return [chips[:half], chips[half:]]

    def is_on(self, layer: Layer) -> bool:
        return self._chips[layer].isChecked()

    def toggle(self, layer: Layer) -> None:
        self._chips[layer].toggle()

    def set_all(self, on: bool) -> None:
        for chip in self._chips.values():
            chip.setChecked(on)


def _full_width(row: list[_Chip]) -> int:
    """The width that shows all of their names and colours."""
    return sum(chip.sizeHint().width() + _CHIP_GAP for chip in row) - _CHIP_GAP


class _Chip(Painted, QAbstractButton):
    """Key cap, colour and name; filled when on, outlined when off."""

    def __init__(self, layer: Layer, bar: OverlayBar) -> None:
        super().__init__(bar)
        self._layer = layer
        self.setCheckable(True)
        self.setChecked(True)
        self.setText(tr(layer.value.label))
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setToolTip(tr("{meaning}  (key {key})", meaning=tr(layer.value.meaning), key=layer.value.key))
        self.setAccessibleName(tr("Overlay {label}", label=tr(layer.value.label)))

    def sizeHint(self) -> QSize:
        return QSize(40 + text_width(theme.font(12), self.text()), _CHIP_HEIGHT)

    def paint(self, painter: QPainter) -> None:
        on, height = self.isChecked(), self.height()
        edge = theme.SKY if self.hasFocus() else theme.TEXT_FAINT if self.underMouse() else theme.LINE
        draw_box(painter, QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), 6, theme.RAISED if on else theme.WINDOW, edge)
        key_colour = theme.TEXT_DIM if on else theme.TEXT_FAINT
        draw_text(painter, QRectF(8, 0, 10, height), self._layer.value.key, theme.semi_bold(11), key_colour, CENTER)
        left, swatch = 22.0, _SWATCH[self._layer]
        is_lost = theme.contrast(swatch, theme.RAISED) < _SEEN  # a pale colour on a light chip
        is_wide = self.width() >= self.sizeHint().width()
        box = QRectF(left, height / 2 - 4, 8, 8) if is_wide else QRectF(left, height - 6, self.width() - left - 8, 3)
        draw_box(painter, box, 2 if is_wide else 1, swatch if on else None, theme.TEXT_FAINT if is_lost else swatch, 1.5)
        left += _SWATCH_PX if is_wide else 0
        room = QRectF(left, 0, self.width() - left - 4, height)
        colour = theme.TEXT if on else theme.TEXT_FAINT
        draw_text(painter, room, self.text(), theme.font(12), colour, smallest_px=10, elided=True)
