"""A picture with everything that was understood drawn in, as a person would put it on a slide. OpenCV only, no window needed."""

from __future__ import annotations

import math

import cv2
import numpy as np

from app import palette
from app.brush import SHIFT, Brush, fitting_size, put_text, text_width, to_fixed
from app.language import english_texts
from app.palette import ON_PICTURE
from app.scene_shapes import SceneShapes, scene_shapes
from app.state_shapes import LETTER_DROP, LETTER_HEIGHT, state_outline
from app.wording import REASON_TEXT, STATE_TITLE, advice_headline, signed_degrees
from core.types import Advice, Image, Mask, Point, Pose, PoseState, Scene

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
    brush = Brush(canvas, zoom, (0.0, 0.0), unit)
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
        colour[:] = palette.rgb(name)
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


def _draw_inset(brush: Brush, corner: tuple[int, int, int, int], image: Image, scene: Scene, shapes: SceneShapes) -> None:
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
    _draw_shapes(Brush(inset, zoom, (float(origin[0]), float(origin[1])), brush.unit), scene, shapes, labels=True)
    brush.frame(origin, (span, height / zoom))
    brush.paste(inset, left, top)


def _draw_shapes(brush: Brush, scene: Scene, shapes: SceneShapes, *, labels: bool) -> None:
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


def _draw_measures(brush: Brush, pose: Pose, shapes: SceneShapes, labels: bool) -> None:
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
    strip = np.full((max(36, round(104 * unit)), width, 3), palette.rgb(ON_PICTURE.PANEL), np.uint8)
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
    colour = palette.rgb(palette.STATE_COLOUR[state])
    if state is None:
        cv2.polylines(strip, [fixed], True, colour, max(1, round(side / 24)), cv2.LINE_AA, SHIFT)
    else:
        cv2.fillPoly(strip, [fixed], colour, cv2.LINE_AA, SHIFT)
    size = round(side * LETTER_HEIGHT[state])
    letter, name = (state.value, ON_PICTURE.INK) if state is not None else ("\N{EN DASH}", ON_PICTURE.TEXT_DIM)
    x = round(middle[0] - text_width(letter, "Bold", size) / 2)
    y = round(middle[1] + 0.36 * size + side * LETTER_DROP.get(state, 0.0))
    put_text(strip, letter, (x, y), name, "Bold", size)
