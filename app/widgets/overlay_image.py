"""A picture with everything that was understood drawn in, as a person would put it on a slide. OpenCV only, no window needed.

Draws marks and texts on a picture with OpenCV.
"""

from __future__ import annotations

import math
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from app.ui import theme
from app.ui.i18n import english_texts
from app.ui.texts import REASON_TEXT, STATE_TITLE, advice_headline, signed_degrees
from app.ui.theme import ON_PICTURE
from app.widgets.scene_overlay import LETTER_DROP, LETTER_HEIGHT, SceneShapes, scene_shapes, state_outline
from core.config.models import RESOURCES
from core.types import Advice, Image, Mask, Point, Points, Pose, PoseState, Scene, Vector

SHIFT = 4
"""Bits of sub-pixel places that OpenCV draws at: 1/16 px."""


def to_fixed(outline: Points) -> NDArray[np.int32]:
    """A polyline (N, 2) as OpenCV takes it for sub-pixel drawing."""
    return np.round(outline * (1 << SHIFT)).astype(np.int32).reshape(-1, 1, 2)


class ImagePainter:
    """Draws marks at source-pixel places on the enlarged picture; widths are pixels of a picture 1280 px wide."""

    def __init__(self, canvas: Image, zoom: float, origin: Point, unit: float) -> None:
        self._canvas = canvas
        self._zoom = zoom
        self._origin = np.array(origin)
        self._unit = unit
        self._labels: list[Points] = []

    @property
    def unit(self) -> float:
        return self._unit

    def _at(self, points: Points | list[Point]) -> Points:
        return np.asarray((np.asarray(points, np.float64) + 0.5 - self._origin) * self._zoom - 0.5)

    def _width(self, width: float) -> int:
        return max(1, round(width * self._unit))

    def _lines(self, lines: list[Points], name: str, width: float, *, closed: bool = False) -> None:
        """Polylines given in canvas pixels, first a dark edge, then the colour."""
        fixed = [to_fixed(line) for line in lines]
        for colour, extra in ((theme.rgb(ON_PICTURE.INK), 2.0), (theme.rgb(name), 0.0)):
            cv2.polylines(self._canvas, fixed, closed, colour, self._width(width + extra), cv2.LINE_AA, SHIFT)

    def _fill(self, outline: Points, name: str) -> None:
        fixed = to_fixed(outline)
        cv2.fillPoly(self._canvas, [fixed], theme.rgb(name), cv2.LINE_AA, SHIFT)
        cv2.polylines(self._canvas, [fixed], True, theme.rgb(ON_PICTURE.INK), self._width(1.0), cv2.LINE_AA, SHIFT)

    def polylines(self, lines: tuple[Points, ...], name: str, width: float) -> None:
        drawn = [self._at(line) for line in lines if len(line) > 1]
        if drawn:
            self._lines(drawn, name, width)

    def dashes(self, first: Point, second: Point, name: str, width: float) -> None:
        start, end = self._at([first, second])
        count = max(1, int(np.linalg.norm(end - start) / (8.0 * self._unit)))
        stops = np.linspace(start, end, 2 * count + 1)
        self._lines([stops[k : k + 2] for k in range(0, 2 * count, 2)], name, width)

    def arrow(self, vector: Vector, name: str, width: float) -> None:
        start, end = self._at([vector.start, vector.end])
        along = np.asarray(vector.direction) * self._unit
        across = np.array([-along[1], along[0]])
        self._lines([np.array([start, end])], name, width)
        self._fill(np.array([end + along * 14, end - along * 6 + across * 10, end - along * 6 - across * 10]), name)

    def ring(self, point: Point, name: str, radius: float) -> None:
        turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        (middle,) = self._at([point])
        circle = np.column_stack([np.cos(turn), np.sin(turn)])
        self._lines([middle + circle * radius * self._unit], name, 3.0, closed=True)
        self._fill(middle + circle * 2.5 * self._unit, name)

    def diamond(self, point: Point, name: str, radius: float) -> None:
        (middle,) = self._at([point])
        self._fill(middle + np.array([(0, -1), (1, 0), (0, 1), (-1, 0)]) * radius * self._unit, name)

    def line(self, first: Point, second: Point, name: str, width: float) -> None:
        self._lines([self._at([first, second])], name, width)

    def angle(self, corner: Point, unit_arc: Points, name: str) -> None:
        """The arc from the vessel's direction to the robot's, with the vessel's direction as a thin line through the corner."""
        (middle,) = self._at([corner])
        arc = middle + unit_arc * 70.0 * self._unit
        self._lines([np.array([middle, middle + (arc[0] - middle) * 1.3])], ON_PICTURE.VESSEL_VECTOR, 1.5)
        self._lines([arc], name, 2.5)

    def label_beside(self, point: Point, line: Vector, side: float, text: str, name: str) -> None:
        """A text beside `point`, on one side of `line` (+1: to the right of its direction)."""
        across = np.array([-line.direction[1], line.direction[0]]) * side
        width = text_width(text, "SemiBold", round(20 * self._unit)) + 20 * self._unit
        reach = 22.0 * self._unit + abs(across[0]) * width / 2 + abs(across[1]) * 15.0 * self._unit
        (middle,) = self._at([point])
        middle = middle + across * reach
        gap = np.array([width, 32.0 * self._unit])
        if any((np.abs(middle - other) < gap).all() for other in self._labels):
            middle = middle + across * 32.0 * self._unit
        self._labels.append(middle)
        self._label(middle, text, name)

    def frame(self, origin: Points, size: Point) -> None:
        """A thin rectangle from `origin`, source pixels."""
        corners = origin + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * np.array(size)
        self._lines([self._at(corners)], ON_PICTURE.TEXT, 1.5, closed=True)

    def paste(self, inset: Image, left: int, top: int) -> None:
        """Put a picture into a corner, with a frame."""
        height, width = inset.shape[:2]
        edge = self._width(3.0)
        cv2.rectangle(inset, (0, 0), (width - 1, height - 1), theme.rgb(ON_PICTURE.INK), edge + 2)
        cv2.rectangle(inset, (1, 1), (width - 2, height - 2), theme.rgb(ON_PICTURE.TEXT), edge - 1)
        self._canvas[top : top + height, left : left + width] = inset

    def stamp(self, text: str) -> None:
        self._label(np.array([44.0, self._canvas.shape[0] / self._unit - 30.0]) * self._unit, text, ON_PICTURE.SIM)

    def _label(self, middle: Points, text: str, name: str) -> None:
        """A text on a dark plate around `middle`, moved inside the picture."""
        size = round(20 * self._unit)
        width, height = text_width(text, "SemiBold", size) + size, round(1.5 * size)
        x = float(np.clip(middle[0] - width / 2, 2, max(2, self._canvas.shape[1] - width - 2)))
        y = float(np.clip(middle[1] - height / 2, 2, max(2, self._canvas.shape[0] - height - 2)))
        left, top = round(x), round(y)
        plate = self._canvas[top : top + height, left : left + width]
        plate[:] = (plate * 0.25 + np.array(theme.rgb(ON_PICTURE.INK)) * 0.75).astype(np.uint8)
        put_text(self._canvas, text, (left + size // 2, top + round(1.1 * size)), name, "SemiBold", size)


@cache
def _face(weight: str) -> cv2.FontFace:
    """The program's font, or OpenCV's own when the file is missing."""
    face = cv2.FontFace("sans")
    path = RESOURCES / "fonts" / f"Inter-{weight}.otf"
    if path.is_file():
        face.set(str(path))
    return face


def put_text(canvas: Image, text: str, left_baseline: tuple[int, int], name: str, weight: str, size: int) -> None:
    cv2.putText(canvas, text, left_baseline, theme.rgb(name), _face(weight), max(size, 6), 0)


def text_width(text: str, weight: str, size: int) -> int:
    _, _, width, _ = cv2.getTextSize((8192, 512), text, (0, 256), _face(weight), max(size, 6))
    return int(width)


def fitting_size(text: str, weight: str, size: int, width: int) -> int:
    """The largest size up to `size` at which `text` fits."""
    while size > 8 and text_width(text, weight, size) > width:
        size -= 1
    return size


_INSET_SPAN_PX = 112.0
_INSET_MAX_COVERED = 0.35
_BAND_ROWS = 256


def draw_overlay(image: Image, scene: Scene, advice: Advice | None = None, *, longer_side_px: int = 1280, stamp: str = "") -> Image:
    """The picture with masks, skeletons, vectors, theta and distances, and a caption strip below it.

    Parameters
    ----------
    image : RGB uint8 (H, W, 3), the frame that `scene` was made of.
    scene : what was understood; what is missing is not drawn.
    advice : adds speed and steering to the caption.
    longer_side_px : small pictures are enlarged to this, so that lines and texts are fine; larger ones keep their size.
    stamp : a word in the lower left corner, such as "SIM".

    Returns
    -------
    RGB uint8; the picture, enlarged by the same factor in x and y, with the caption below.
    """
    height, width = image.shape[:2]
    zoom = max(1.0, longer_side_px / max(height, width))
    canvas = _tinted(image, scene, zoom)
    unit = max(1.0, max(canvas.shape[:2]) / 1280)
    shapes = scene_shapes(scene)
    corner = _free_corner(canvas, scene, zoom)
    brush = ImagePainter(canvas, zoom, (0.0, 0.0), unit)
    _draw_shapes(brush, scene, shapes, labels=corner is None)
    if corner is not None:
        _draw_inset(brush, corner, image, scene, shapes)
    if stamp:
        brush.stamp(stamp)
    with english_texts():  # its letters are, and a picture is kept
        caption = _caption(scene, advice, canvas.shape[1])
    return np.concatenate([canvas, caption])


def _tinted(image: Image, scene: Scene, zoom: float) -> Image:
    """The picture, enlarged, with both masks in colour and their edges as thin lines."""
    size = (max(1, round(image.shape[1] * zoom)), max(1, round(image.shape[0] * zoom)))
    # Lanczos would ring beside the highlights
    canvas = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_CUBIC), np.uint8) if zoom > 1.0 else image.copy()
    if scene.masks is None:
        return canvas
    for mask, name, opacity in ((scene.masks.vessel, ON_PICTURE.VESSEL, 0.20), (scene.masks.robot, ON_PICTURE.ROBOT, 0.38)):
        canvas = _tint(canvas, mask, name, opacity)
    return canvas


def _tint(canvas: Image, mask: Mask, name: str, opacity: float) -> Image:
    """In bands: the numbers in between take ten times the memory of the picture, which may be of 8k."""
    size = (canvas.shape[1], canvas.shape[0])
    blur = max(0.6, 0.7 * size[0] / mask.shape[1])
    wide = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    margin = math.ceil(4.0 * blur) + 1  # farther than this the blur does not see
    tinted = np.empty_like(canvas)
    for top in range(0, size[1], _BAND_ROWS):
        bottom, above = min(top + _BAND_ROWS, size[1]), min(top, margin)
        soft = cv2.GaussianBlur(wide[top - above : bottom + margin], (0, 0), blur)[above : above + bottom - top]
        # across the edge `soft` climbs from 0 to 1 with a slope of about 1 / (2.5 blur), so this is a line about 2 px wide
        edge = np.clip(1.4 - np.abs(soft - 0.5) * (2.5 * blur), 0.0, 1.0)
        share = np.maximum(np.clip(1.5 * soft - 0.25, 0.0, 1.0) * opacity, edge * 0.8)
        colour = np.empty_like(canvas[top:bottom])
        colour[:] = theme.rgb(name)
        tinted[top:bottom] = cv2.blendLinear(colour, canvas[top:bottom], share, 1.0 - share)
    return tinted


def _free_corner(canvas: Image, scene: Scene, zoom: float) -> tuple[int, int, int, int] | None:
    """Left, top, width and height of the corner where a magnified head covers least; None when it would cover much."""
    if scene.pose is None or scene.masks is None or scene.path is None:
        return None
    height, width = canvas.shape[:2]
    box_width, box_height = round(0.34 * width), round(0.38 * height)
    busy = scene.masks.vessel.astype(np.float32) + 4.0 * scene.masks.robot
    down, across = busy.shape[0] / height, busy.shape[1] / width
    head = (np.array(scene.to_source(scene.path.head)) + 0.5) * zoom
    best, best_share = None, _INSET_MAX_COVERED
    for left in (0, width - box_width):
        for top in (0, height - box_height):
            rows = slice(round(top * down), round((top + box_height) * down))
            columns = slice(round(left * across), round((left + box_width) * across))
            part = busy[rows, columns]
            away = np.abs(head - (left + box_width / 2, top + box_height / 2)) / (box_width, box_height)
            is_beside = bool(away.max() > 0.6)
            if part.size and is_beside and float(part.mean()) < best_share:
                best, best_share = (left, top, box_width, box_height), float(part.mean())
    return best


def _draw_inset(brush: ImagePainter, corner: tuple[int, int, int, int], image: Image, scene: Scene, shapes: SceneShapes) -> None:
    """The surroundings of the head, magnified, with the labels; a frame shows where they are."""
    left, top, width, height = corner
    if shapes.robot_vector is None or shapes.vessel_vector is None:
        return
    span = _INSET_SPAN_PX / scene.scale
    zoom = width / span
    middle = (np.array(shapes.robot_vector.center) + np.array(shapes.vessel_vector.center)) / 2
    origin = middle - np.array([span, height / zoom]) / 2
    shift = (0.5 - origin) * zoom - 0.5
    place = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])
    warped = cv2.warpAffine(image, place, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    inset = np.asarray(warped, np.uint8)
    _draw_shapes(ImagePainter(inset, zoom, (float(origin[0]), float(origin[1])), brush.unit), scene, shapes, labels=True)
    brush.frame(origin, (span, height / zoom))
    brush.paste(inset, left, top)


def _draw_shapes(brush: ImagePainter, scene: Scene, shapes: SceneShapes, *, labels: bool) -> None:
    brush.polylines(shapes.vessel_lines, ON_PICTURE.VESSEL, 2.5)
    if shapes.route is not None:
        brush.polylines((shapes.route,), ON_PICTURE.ROUTE, 4.0)
    if shapes.robot_line is not None:
        brush.polylines((shapes.robot_line,), ON_PICTURE.ROBOT, 3.5)
    for first, second in shapes.bridges:
        brush.dashes(first, second, ON_PICTURE.TEXT, 2.5)
    if shapes.vessel_vector is not None:
        brush.arrow(shapes.vessel_vector, ON_PICTURE.VESSEL_VECTOR, 3.5)
    if shapes.robot_vector is not None:
        brush.arrow(shapes.robot_vector, ON_PICTURE.ROBOT_VECTOR, 3.5)
    if shapes.nearest is not None:
        brush.diamond(shapes.nearest, ON_PICTURE.NEAREST, 8.0)
    if shapes.head is not None:
        brush.ring(shapes.head, ON_PICTURE.HEAD, 11.0)
    if scene.route is not None:
        brush.ring(scene.to_source(scene.route.target), ON_PICTURE.TARGET, 14.0)
    if scene.pose is not None:
        _draw_measures(brush, scene.pose, shapes, labels)


def _draw_measures(brush: ImagePainter, pose: Pose, shapes: SceneShapes, labels: bool) -> None:
    robot, vessel = shapes.robot_vector, shapes.vessel_vector
    if robot is None or vessel is None or shapes.head_foot is None or shapes.tail_foot is None or shapes.angle_arc is None:
        return
    brush.line(shapes.head_foot, robot.end, ON_PICTURE.D_HEAD, 3.0)
    brush.line(shapes.tail_foot, robot.start, ON_PICTURE.D_TAIL, 3.0)
    if labels:
        brush.angle(robot.start, shapes.angle_arc, ON_PICTURE.THETA)
        head_side = 1.0 if pose.c_head_px > 0 else -1.0
        # on the side of the vessel where the head is not: there is the least to cover
        brush.label_beside(vessel.center, vessel, -head_side, f"θ {signed_degrees(pose.theta_signed_deg, 1)}", ON_PICTURE.THETA)
        brush.label_beside(robot.end, vessel, head_side, f"d_head {pose.d_head_px:.1f} px", ON_PICTURE.D_HEAD)
        tail_side = 1.0 if pose.c_tail_px > 0 else -1.0
        brush.label_beside(robot.start, vessel, tail_side, f"d_tail {pose.d_tail_px:.1f} px", ON_PICTURE.D_TAIL)


def _caption(scene: Scene, advice: Advice | None, width: int) -> Image:
    """The strip below the picture: state with its letter and shape, the values, or the reason why there is no pose."""
    unit = width / 1280
    strip = np.full((max(36, round(104 * unit)), width, 3), theme.rgb(ON_PICTURE.PANEL), np.uint8)
    side = round(76 * unit)
    _draw_state(strip, (round(18 * unit) + side / 2, strip.shape[0] / 2), side, scene.pose.state if scene.pose else None)
    left = round(124 * unit)
    if scene.pose is not None:
        pose = scene.pose
        title = STATE_TITLE[pose.state]
        parts = [
            (f"θ {signed_degrees(pose.theta_signed_deg, 1)}", ON_PICTURE.THETA),
            (f"d_head {pose.d_head_px:.1f} px", ON_PICTURE.D_HEAD),
        ]
        parts += [
            (f"d_tail {pose.d_tail_px:.1f} px", ON_PICTURE.D_TAIL),
            (f"confidence {pose.confidence:.2f}", ON_PICTURE.TEXT_DIM),
        ]
    else:
        title = REASON_TEXT[scene.refusal.reason].title if scene.refusal else "No pose"
        parts = [(f"no pose: {scene.refusal}" if scene.refusal else "no pose", ON_PICTURE.TEXT_DIM)]
    put_text(strip, title, (left, round(46 * unit)), ON_PICTURE.TEXT, "Bold", round(34 * unit))
    x = left
    for text, name in parts:
        size = fitting_size(text, "SemiBold", round(24 * unit), width - x)
        put_text(strip, text, (x, round(84 * unit)), name, "SemiBold", size)
        x += text_width(text, "SemiBold", size) + round(34 * unit)
    if advice is not None:
        text = advice_headline(advice)
        size = round(30 * unit)
        x = width - text_width(text, "Bold", size) - round(26 * unit)
        put_text(strip, text, (x, round(46 * unit)), ON_PICTURE.TEXT, "Bold", size)
    return strip


def _draw_state(strip: Image, middle: Point, side: float, state: PoseState | None) -> None:
    outline = np.asarray(middle) + state_outline(state) * side / 2
    fixed = to_fixed(outline)
    colour = theme.rgb(theme.STATE_COLOUR[state])
    if state is None:
        cv2.polylines(strip, [fixed], True, colour, max(1, round(side / 24)), cv2.LINE_AA, SHIFT)
    else:
        cv2.fillPoly(strip, [fixed], colour, cv2.LINE_AA, SHIFT)
    size = round(side * LETTER_HEIGHT[state])
    letter, name = (state.value, ON_PICTURE.INK) if state is not None else ("\N{EN DASH}", ON_PICTURE.TEXT_DIM)
    x = round(middle[0] - text_width(letter, "Bold", size) / 2)
    y = round(middle[1] + 0.36 * size + side * LETTER_DROP.get(state, 0.0))
    put_text(strip, letter, (x, y), name, "Bold", size)
