"""A picture with everything that was understood drawn in, as a person would put it on a slide. OpenCV only, no window needed."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from app import palette
from app.scene_shapes import SceneShapes, scene_shapes
from app.state_shapes import LETTER_DROP, LETTER_HEIGHT, state_outline
from app.wording import REASON_TEXT, STATE_TITLE, advice_headline
from core.config import RESOURCES
from core.types import Advice, Image, Mask, Point, Points, PoseState, Scene, Vector

_SHIFT = 4  # OpenCV draws at 1/16 px
_MASK_OPACITY = {"vessel": 0.20, "robot": 0.38}


def draw_overlay(image: Image, scene: Scene, advice: Advice | None = None, *, longer_side_px: int = 1280, stamp: str = "") -> Image:
    """The picture with masks, skeletons, vectors, theta and distances, and a caption strip below it.

    Parameters
    ----------
    image : RGB uint8 (H, W, 3), the frame that `scene` was made of.
    scene : what was understood; what is missing is not drawn.
    advice : adds speed and steering to the caption.
    longer_side_px : small pictures are enlarged to this, so that lines and texts are fine; larger ones keep their size.
    stamp : a word in the upper left corner, such as "SIM".

    Returns
    -------
    RGB uint8; the picture, enlarged by the same factor in x and y, with the caption below.
    """
    height, width = image.shape[:2]
    zoom = max(1.0, longer_side_px / max(height, width))
    size = (round(width * zoom), round(height * zoom))
    # area averaging would do nothing when enlarging; Lanczos would ring beside the highlights
    canvas = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC) if zoom > 1.0 else image.copy()
    if scene.masks is not None:
        canvas = _tint(canvas, scene.masks.vessel, palette.VESSEL, _MASK_OPACITY["vessel"])
        canvas = _tint(canvas, scene.masks.robot, palette.ROBOT, _MASK_OPACITY["robot"])
    brush = _Brush(canvas, zoom, max(1.0, max(size) / 1280))
    _draw_shapes(brush, scene, scene_shapes(scene))
    if stamp:
        brush.stamp(stamp)
    return np.concatenate([canvas, _caption(scene, advice, size[0])])


def _tint(canvas: Image, mask: Mask, name: str, opacity: float) -> Image:
    """Blend a colour into the mask's pixels; its edge gets a thin line."""
    size = (canvas.shape[1], canvas.shape[0])
    soft = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    edge = cv2.morphologyEx((soft > 0.5).astype(np.uint8), cv2.MORPH_GRADIENT, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3)))
    share = np.maximum(soft * opacity, edge * 0.8)[:, :, None]
    tinted = canvas * (1.0 - share) + np.array(palette.rgb(name), np.float32) * share
    return np.ascontiguousarray(tinted.round().astype(np.uint8))


def _draw_shapes(brush: _Brush, scene: Scene, shapes: SceneShapes) -> None:
    pose = scene.pose
    brush.polylines(shapes.vessel_lines, palette.VESSEL, 2.5)
    if shapes.route is not None:
        brush.polylines((shapes.route,), palette.ROUTE, 4.0)
    if shapes.robot_line is not None:
        brush.polylines((shapes.robot_line,), palette.ROBOT, 3.5)
    for first, second in shapes.bridges:
        brush.dashes(first, second, palette.TEXT, 2.5)
    if shapes.vessel_vector is not None:
        brush.arrow(shapes.vessel_vector, palette.VESSEL_VECTOR, 3.5)
    if shapes.robot_vector is not None:
        brush.arrow(shapes.robot_vector, palette.ROBOT_VECTOR, 3.5)
    if shapes.nearest is not None:
        brush.diamond(shapes.nearest, palette.NEAREST, 8.0)
    if shapes.head is not None:
        brush.ring(shapes.head, palette.HEAD, 11.0)
    robot = shapes.robot_vector
    if pose is not None and robot is not None and shapes.head_foot is not None and shapes.tail_foot is not None:
        brush.measure(shapes.head_foot, robot.end, palette.D_HEAD, f"d_head {pose.d_head_px:.1f} px")
        brush.measure(shapes.tail_foot, robot.start, palette.D_TAIL, f"d_tail {pose.d_tail_px:.1f} px")
        if shapes.angle_arc is not None:
            brush.angle(robot.start, shapes.angle_arc, palette.THETA, f"θ {pose.theta_signed_deg:+.1f}°")
    if scene.route is not None:
        brush.ring(scene.to_source(scene.route.target), palette.TARGET, 14.0)


class _Brush:
    """Draws marks at source-pixel places on the enlarged picture; widths are pixels of a picture 1280 px wide."""

    def __init__(self, canvas: Image, zoom: float, thickness: float) -> None:
        self._canvas = canvas
        self._zoom = zoom
        self._unit = thickness

    def _at(self, points: Points | list[Point]) -> Points:
        return (np.asarray(points, np.float64) + 0.5) * self._zoom - 0.5

    def _width(self, width: float) -> int:
        return max(1, round(width * self._unit))

    def _lines(self, lines: list[Points], name: str, width: float, *, closed: bool = False) -> None:
        """Polylines given in canvas pixels, first a dark edge, then the colour."""
        fixed = [np.round(line * (1 << _SHIFT)).astype(np.int32).reshape(-1, 1, 2) for line in lines]
        for colour, extra in ((palette.rgb(palette.INK), 2.0), (palette.rgb(name), 0.0)):
            cv2.polylines(self._canvas, fixed, closed, colour, self._width(width + extra), cv2.LINE_AA, _SHIFT)

    def _fill(self, outline: Points, name: str) -> None:
        fixed = np.round(outline * (1 << _SHIFT)).astype(np.int32).reshape(-1, 1, 2)
        cv2.fillPoly(self._canvas, [fixed], palette.rgb(name), cv2.LINE_AA, _SHIFT)
        cv2.polylines(self._canvas, [fixed], True, palette.rgb(palette.INK), self._width(1.0), cv2.LINE_AA, _SHIFT)

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

    def measure(self, foot: Point, point: Point, name: str, text: str) -> None:
        first, second = self._at([foot, point])
        self._lines([np.array([first, second])], name, 3.0)
        away = second - first
        length = float(np.linalg.norm(away))
        away = away / length if length > 1e-6 else np.array([0.0, -1.0])
        self._label(second + away * np.array([80.0, 34.0]) * self._unit, text, name)

    def angle(self, corner: Point, unit_arc: Points, name: str, text: str) -> None:
        (middle,) = self._at([corner])
        arc = middle + unit_arc * 62.0 * self._unit
        self._lines([np.array([middle, middle + (arc[0] - middle) * 1.3])], palette.VESSEL_VECTOR, 1.5)
        self._lines([arc], name, 2.5)
        outward = unit_arc[len(unit_arc) // 2]
        self._label(middle + outward * 112.0 * self._unit, text, name)

    def stamp(self, text: str) -> None:
        self._label(np.array([44.0, 30.0]) * self._unit, text, palette.SIM)

    def _label(self, middle: Points, text: str, name: str) -> None:
        """A text on a dark plate around `middle`, moved inside the picture."""
        size = round(20 * self._unit)
        width, height = _text_width(text, "SemiBold", size) + size, round(1.5 * size)
        x = float(np.clip(middle[0] - width / 2, 2, max(2, self._canvas.shape[1] - width - 2)))
        y = float(np.clip(middle[1] - height / 2, 2, max(2, self._canvas.shape[0] - height - 2)))
        left, top = round(x), round(y)
        plate = self._canvas[top : top + height, left : left + width]
        plate[:] = (plate * 0.25 + np.array(palette.rgb(palette.INK)) * 0.75).astype(np.uint8)
        _put_text(self._canvas, text, (left + size // 2, top + round(1.1 * size)), name, "SemiBold", size)


def _caption(scene: Scene, advice: Advice | None, width: int) -> Image:
    """The strip below the picture: state with its letter and shape, the values, or the reason why there is no pose."""
    unit = width / 1280
    strip = np.full((max(36, round(104 * unit)), width, 3), palette.rgb(palette.PANEL), np.uint8)
    side = round(76 * unit)
    _draw_state(strip, (round(18 * unit) + side / 2, strip.shape[0] / 2), side, scene.pose.state if scene.pose else None)
    left = round(124 * unit)
    if scene.pose is not None:
        pose = scene.pose
        title = STATE_TITLE[pose.state]
        parts = [(f"θ {pose.theta_signed_deg:+.1f}°", palette.THETA), (f"d_head {pose.d_head_px:.1f} px", palette.D_HEAD)]
        parts += [(f"d_tail {pose.d_tail_px:.1f} px", palette.D_TAIL), (f"confidence {pose.confidence:.2f}", palette.TEXT_DIM)]
    else:
        title = REASON_TEXT[scene.refusal.reason].title if scene.refusal else "No pose"
        parts = [(f"no pose: {scene.refusal}" if scene.refusal else "no pose", palette.TEXT_DIM)]
    _put_text(strip, title, (left, round(46 * unit)), palette.TEXT, "Bold", round(34 * unit))
    x = left
    for text, name in parts:
        size = _fitting(text, "SemiBold", round(24 * unit), width - x)
        _put_text(strip, text, (x, round(84 * unit)), name, "SemiBold", size)
        x += _text_width(text, "SemiBold", size) + round(34 * unit)
    if advice is not None:
        text = advice_headline(advice)
        size = round(30 * unit)
        x = width - _text_width(text, "Bold", size) - round(26 * unit)
        _put_text(strip, text, (x, round(46 * unit)), palette.TEXT, "Bold", size)
    return strip


def _draw_state(strip: Image, middle: Point, side: float, state: PoseState | None) -> None:
    outline = np.asarray(middle) + state_outline(state) * side / 2
    fixed = np.round(outline * (1 << _SHIFT)).astype(np.int32).reshape(-1, 1, 2)
    colour = palette.rgb(palette.STATE_COLOUR[state])
    if state is None:
        cv2.polylines(strip, [fixed], True, colour, max(1, round(side / 24)), cv2.LINE_AA, _SHIFT)
    else:
        cv2.fillPoly(strip, [fixed], colour, cv2.LINE_AA, _SHIFT)
    size = round(side * LETTER_HEIGHT[state])
    letter, name = (state.value, palette.INK) if state is not None else ("\N{EN DASH}", palette.TEXT_DIM)
    x = round(middle[0] - _text_width(letter, "Bold", size) / 2)
    y = round(middle[1] + 0.36 * size + side * LETTER_DROP.get(state, 0.0))
    _put_text(strip, letter, (x, y), name, "Bold", size)


@cache
def _face(weight: str) -> cv2.FontFace:
    """The program's font, or OpenCV's own when the file is missing."""
    face = cv2.FontFace("sans")
    path = RESOURCES / "fonts" / f"Inter-{weight}.otf"
    if path.is_file():
        face.set(str(path))
    return face


def _put_text(canvas: Image, text: str, left_baseline: tuple[int, int], name: str, weight: str, size: int) -> None:
    cv2.putText(canvas, text, left_baseline, palette.rgb(name), _face(weight), max(size, 6), 0)


def _text_width(text: str, weight: str, size: int) -> int:
    _, _, width, _ = cv2.getTextSize((8192, 512), text, (0, 256), _face(weight), max(size, 6))
    return int(width)


def _fitting(text: str, weight: str, size: int, width: int) -> int:
    """The largest size up to `size` at which `text` fits."""
    while size > 8 and _text_width(text, weight, size) > width:
        size -= 1
    return size
