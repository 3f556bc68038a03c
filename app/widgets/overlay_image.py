"""A picture with everything that was perceived drawn in and a caption below it: snapshots, ``perceive --overlay`` and clips."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF
from PySide6.QtGui import QColor, QFont, QImage, QPainter, QTransform
from PySide6.QtWidgets import QApplication

from app.ui import theme
from app.ui.i18n import english_texts
from app.ui.texts import REASON_TEXT, STATE_TITLE, advice_headline, signed_degrees
from app.ui.theme import ON_PICTURE
from app.widgets.painting import CENTER, draw_box, draw_text, set_colours, text_width
from app.widgets.scene_overlay import Marks, scene_shapes
from app.widgets.state_badge import paint_state
from core.types import Advice, Image, Mask, Scene

_WIDTH = 1280  # of a picture on which marks have their usual size
_MARK_SCALE = 1.5  # of that size over the live view's
_LABEL_PX = 13
_CAPTION_PX, _CAPTION_MIN_PX = 104, 36
_INSET_SPAN_PX = 112.0  # what the inset shows, working pixels
_INSET_MAX_COVERED = 0.35
_BAND_ROWS = 256


def draw_overlay(
    image: Image, scene: Scene, advice: Advice | None = None, *, longer_side_px: int = _WIDTH, stamp: str = ""
) -> Image:
    """The picture with masks, skeletons, vectors, theta and distances, and a caption strip below it.

    Parameters
    ----------
    image : RGB uint8 (H, W, 3), the frame that `scene` was made of.
    scene : what was perceived; missing parts are not drawn.
    advice : adds speed and steering to the caption.
    longer_side_px : small pictures are enlarged to this, so that lines and texts are fine; larger ones keep their size.
    stamp : a word in the lower left corner, such as "SIM".

    Returns
    -------
    RGB uint8; the picture, enlarged by the same factor in x and y, with the caption below.
    """
    _start_qt()
    zoom = max(1.0, longer_side_px / max(image.shape[:2]))
    canvas = _tinted(image, scene, zoom)
    height, width = canvas.shape[:2]
    unit = _MARK_SCALE * max(1.0, max(height, width) / _WIDTH)
    drawn = QImage(width, height + max(_CAPTION_MIN_PX, round(_CAPTION_PX * width / _WIDTH)), QImage.Format.Format_RGB888)
    pixels = np.ndarray((drawn.height(), width, 3), np.uint8, drawn.bits(), strides=(drawn.bytesPerLine(), 3, 1))
    pixels[:height] = canvas
    pixels[height:] = theme.rgb(ON_PICTURE.PANEL)

    marks = Marks(digits=1)
    marks.set_scene(scene_shapes(scene), scene.pose, scene.to_source(scene.route.target) if scene.route is not None else None)
    inset = _place_inset(canvas, scene, zoom)
    drawn.setDevicePixelRatio(unit)
    painter = QPainter(drawn)
    room = QRectF(0, 0, width / unit, height / unit)
    painter.setClipRect(room)
    to_canvas = QTransform.fromScale(zoom / unit, zoom / unit)
    marks.draw(painter, to_canvas, room, 0 if inset is not None else _LABEL_PX, smooth=True)
    if inset is not None:  # the surroundings of the head, magnified, with the labels; a frame shows where they are
        x, y, part = inset.source.left(), inset.source.top(), inset.box
        _draw_frame(painter, to_canvas.mapRect(inset.source))
        pixels[part.top() : part.top() + part.height(), part.left() : part.left() + part.width()] = inset.magnified(image)
        box = QRectF(part.left() / unit, part.top() / unit, part.width() / unit, part.height() / unit)
        scale = inset.zoom / unit
        to_inset = QTransform(scale, 0.0, 0.0, scale, box.left() - x * scale, box.top() - y * scale)
        painter.setClipRect(box)
        marks.draw(painter, to_inset, box, _LABEL_PX, tags=False, smooth=True)
        painter.setClipRect(room)
        _draw_frame(painter, box.adjusted(1, 1, -1, -1))
    if stamp:
        font = theme.semi_bold(_LABEL_PX)
        box = QRectF(12.0, room.height() - 30.0, text_width(font, stamp) + 14.0, 20.0)
        draw_box(painter, box, 4.0, theme.colour(ON_PICTURE.INK, 0.75))
        draw_text(painter, box, stamp, font, ON_PICTURE.SIM, CENTER)
    painter.end()

    drawn.setDevicePixelRatio(1.0)
    painter = QPainter(drawn)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.translate(0, height)
    painter.scale(width / _WIDTH, width / _WIDTH)
    with english_texts():  # a picture is kept, and its letters are English
        _draw_caption(painter, scene, advice)
    painter.end()
    return pixels.copy()


@cache
def _start_qt() -> QApplication | None:
    """Texts need Qt's fonts: a command without a window starts them without a screen."""
    if QApplication.instance() is not None:
        return None
    application = QApplication(["lumenpilot", "-platform", "offscreen"])
    theme.apply_theme(application)
    return application


def _tinted(image: Image, scene: Scene, zoom: float) -> Image:
    """The picture, enlarged, with both masks in colour and their edges as thin lines."""
    size = (max(1, round(image.shape[1] * zoom)), max(1, round(image.shape[0] * zoom)))
    # Lanczos would ring beside the highlights
    canvas = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_CUBIC), np.uint8) if zoom > 1.0 else image
    if scene.masks is not None:
        for mask, name, opacity in ((scene.masks.vessel, ON_PICTURE.VESSEL, 0.20), (scene.masks.robot, ON_PICTURE.ROBOT, 0.38)):
            canvas = _tint(canvas, mask, name, opacity)
    return canvas


def _tint(canvas: Image, mask: Mask, name: str, opacity: float) -> Image:
    """In bands: the numbers in between take ten times the memory of the picture, which may be of 8k."""
    size = (canvas.shape[1], canvas.shape[0])
    blur = max(0.6, 0.7 * size[0] / mask.shape[1])
    wide = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    margin = math.ceil(4.0 * blur) + 1  # the reach of the blur
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


@dataclass(frozen=True, slots=True)
class _Inset:
    """Where the magnified head lies in the picture, px, and the part of the source that it shows."""

    box: QRect
    source: QRectF

    @property
    def zoom(self) -> float:
        return self.box.width() / self.source.width()

    def magnified(self, image: Image) -> Image:
        x, y, zoom, size = self.source.left(), self.source.top(), self.zoom, (self.box.width(), self.box.height())
        place = np.array([[zoom, 0.0, (0.5 - x) * zoom - 0.5], [0.0, zoom, (0.5 - y) * zoom - 0.5]])
        return np.asarray(cv2.warpAffine(image, place, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def _place_inset(canvas: Image, scene: Scene, zoom: float) -> _Inset | None:
    """The inset in the corner where it covers least; None when it would cover much, or there is no pose."""
    if scene.pose is None or scene.masks is None or scene.path is None or not (scene.robot_vector and scene.vessel_vector):
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
            if part.size and away.max() > 0.6 and float(part.mean()) < best_share:
                best, best_share = QRect(left, top, box_width, box_height), float(part.mean())
    if best is None:
        return None
    span_x = _INSET_SPAN_PX / scene.scale
    span_y = span_x * box_height / box_width
    centers = [scene.to_source(vector.center) for vector in (scene.robot_vector, scene.vessel_vector)]
    x, y = np.mean(centers, axis=0).tolist()
    return _Inset(best, QRectF(x - span_x / 2, y - span_y / 2, span_x, span_y))


def _draw_frame(painter: QPainter, box: QRectF) -> None:
    for colour, width in ((ON_PICTURE.INK, 3.0), (ON_PICTURE.TEXT, 1.5)):
        set_colours(painter, None, colour, width)
        painter.drawRect(box)


def _draw_caption(painter: QPainter, scene: Scene, advice: Advice | None) -> None:
    """State with its letter and shape, and the values, or the reason why there is no pose; in a strip of 1280 x 104."""
    pose = scene.pose
    paint_state(painter, QRectF(18, 14, 76, 76), pose.state if pose is not None else None, on_picture=True)
    if pose is not None:
        title = STATE_TITLE[pose.state]
        parts = [
            (f"θ {signed_degrees(pose.theta_signed_deg, 1)}", ON_PICTURE.THETA),
            (f"d_head {pose.d_head_px:.1f} px", ON_PICTURE.D_HEAD),
            (f"d_tail {pose.d_tail_px:.1f} px", ON_PICTURE.D_TAIL),
            (f"confidence {pose.confidence:.2f}", ON_PICTURE.TEXT_DIM),
        ]
    else:
        title = REASON_TEXT[scene.refusal.reason].title if scene.refusal else "No pose"
        parts = [(f"no pose: {scene.refusal}" if scene.refusal else "no pose", ON_PICTURE.TEXT_DIM)]
    _write(painter, 124, 46, title, theme.bold(34), ON_PICTURE.TEXT)
    x = 124
    for text, colour in parts:
        font = theme.fitted(theme.semi_bold(24), text, _WIDTH - x, 8)
        _write(painter, x, 84, text, font, colour)
        x += text_width(font, text) + 34
    if advice is not None:
        headline, font = advice_headline(advice), theme.bold(30)
        _write(painter, _WIDTH - text_width(font, headline) - 26, 46, headline, font, ON_PICTURE.TEXT)


def _write(painter: QPainter, x: float, baseline: float, text: str, font: QFont, colour: str) -> None:
    painter.setFont(font)
    painter.setPen(QColor(colour))
    painter.drawText(QPointF(x, baseline), text)
