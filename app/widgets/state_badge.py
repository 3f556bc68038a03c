"""The pose state as a large letter in a shape of its own, with its name, how sure it is, and the reason in plain words."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import REASON_TEXT, STATE_TITLE, override_line, refusal_line, tip, why_line
from app.widgets.painting import CENTER, NONE, RIGHT, PaintedWidget, draw_text, polygon, set_colours
from core.config.models import PoseConfig
from core.types import Advice, Point, Points, PoseState, Scene

_HEIGHT = 104
_WRAPPED = int(Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft | Qt.TextFlag.TextWordWrap)
_LETTER_HEIGHT = {None: 0.60, PoseState.A: 0.60, PoseState.B: 0.64, PoseState.C: 0.50, PoseState.D: 0.54}
"""Font size over the box's side."""
_TRIANGLE_DROP = 0.13  # how far below the middle C's letter sits, over the box's side: a triangle's visual middle is lower


class StateBadge(PaintedWidget):
    """Shape, letter and colour tell the state: A circle, B square, C triangle, D diamond; a dashed ring with "-" means no pose.

    The shape of an unsure state is not filled.

    Parameters
    ----------
    limits : of the pose states.
    confident_from : the confidence from which on an answer is sure, 0 to 1.
    """

    ground = "PANEL"

    def __init__(self, limits: PoseConfig, confident_from: float) -> None:
        self._meanings = tip("state", "confidence")
        super().__init__(tr("Pose state"), self._meanings, hint=(440, _HEIGHT), height=_HEIGHT)
        self._limits, self._confident_from = limits, confident_from
        self._state: PoseState | None = None
        self.is_unsure = False
        self.sureness = ""
        self.title = tr("Waiting")
        self.why = ""

    def set_limits(self, limits: PoseConfig, confident_from: float) -> None:
        self._limits, self._confident_from = limits, confident_from

    @property
    def letter(self) -> str:
        return self._state.value if self._state is not None else "-"

    def show_scene(self, scene: Scene, advice: Advice | None = None, *, renew_text: bool = True) -> None:
        """The state of `scene`, or the reason why it has none. A new letter or title always renews the sentence too.

        Where `advice` is not what the state alone would ask for, it says so.
        """
        pose, refusal = scene.pose, scene.refusal
        if pose is not None:

            def why() -> str:
                lines = why_line(pose, self._limits), override_line(advice, pose.state, with_rule=True)
                return "; ".join(line for line in lines if line)

            self._set(pose.state, tr(STATE_TITLE[pose.state]), why, renew_text, pose.confidence)
        elif refusal is not None:
            self._set(None, tr(REASON_TEXT[refusal.reason].title), lambda: refusal_line(refusal), renew_text)
        else:
            self.show_nothing(tr("No pose"), "")

    def show_nothing(self, title: str, why: str) -> None:
        """No state, for a cause outside perception: starting, no new picture, fault."""
        self._set(None, title, lambda: tr_text(why), True)

    def _set(
        self, state: PoseState | None, title: str, why: Callable[[], str], renew_text: bool, confidence: float | None = None
    ) -> None:
        changed = state is not self._state or title != self.title
        if not changed and not renew_text:
            return
        text = why()
        is_unsure, sureness = self._judge(confidence)
        if not changed and text == self.why and sureness == self.sureness:
            return
        self._state, self.title, self.why = state, title, text
        self.is_unsure, self.sureness = is_unsure, sureness
        self.setAccessibleDescription(f"{self.letter}: {title}{f' ({sureness})' if sureness else ''}. {text}")
        # a long reason may not fit; the tool tip has all of it
        self.setToolTip(text if state is None and text else self._meanings)
        self.update()

    def _judge(self, confidence: float | None) -> tuple[bool, str]:
        """Whether an answer is unsure, and how sure it is in words."""
        if confidence is None:
            return False, ""
        is_unsure = confidence < self._confident_from
        # rounded down, so that it agrees with `is_unsure`; 100 % is never shown
        percent = min(math.floor(100.0 * confidence + 1e-9), 99)
        return is_unsure, tr("unsure: {percent} %", percent=percent) if is_unsure else tr("{percent} % sure", percent=percent)

    def paint(self, painter: QPainter) -> None:
        side = self.height() - 4.0
        paint_state(painter, QRectF(2.0, 2.0, side, side), self._state, filled=not self.is_unsure)
        left = side + 20.0
        head = QRectF(left, 2, self.width() - left - 2, 36)
        if self.sureness:
            font = theme.bold() if self.is_unsure else theme.font()
            draw_text(painter, head, self.sureness, font, theme.FAULT if self.is_unsure else theme.TEXT_DIM, RIGHT)
            head.adjust(0, 0, -QFontMetricsF(font).horizontalAdvance(self.sureness) - theme.GAP, 0)
        draw_text(painter, head, self.title, theme.bold(theme.Size.TITLE), theme.TEXT, smallest_px=11)
        place = QRectF(left, 42, self.width() - left - 2, self.height() - 42)
        painter.setPen(QColor(theme.TEXT_DIM))
        painter.setFont(_wrapped_font(self.why, place))
        painter.drawText(place, _WRAPPED, self.why)


def _wrapped_font(text: str, place: QRectF) -> QFont:
    """The largest of a few sizes at which `text` fits into `place` when wrapped."""
    for size in (17, 15, 13, 12):
        result = theme.font(size)
        if QFontMetricsF(result).boundingRect(place, _WRAPPED, text).height() <= place.height():
            break
    return result


def paint_state(painter: QPainter, box: QRectF, state: PoseState | None, *, filled: bool = True, on_picture: bool = False) -> None:
    """The state's shape and letter inside `box`; not `filled`, only its outline, as of a state that is not sure.

    `on_picture`: in the colours of what lies over a picture, instead of the window's.
    """
    scheme = theme.ON_PICTURE if on_picture else theme.current()
    colour, side = theme.STATE_COLOUR[state] if state is not None else scheme.TEXT_FAINT, box.height()
    if state is None:
        set_colours(painter, None, QPen(QColor(colour), max(2.0, side / 28), Qt.PenStyle.DashLine))
    elif not filled:
        set_colours(painter, None, theme.outline_of(colour, max(2.0, side / 20)))
    else:
        set_colours(painter, colour, None if on_picture else theme.edge_of(colour))
    painter.drawPolygon(polygon((state_outline(state) * (side / 2)).tolist(), box.center()))
    ink = scheme.TEXT_DIM if state is None else theme.STATE_INK if filled else scheme.TEXT
    place = box.translated(0, side * _TRIANGLE_DROP if state is PoseState.C else 0.0)
    font = theme.bold(max(9, round(side * _LETTER_HEIGHT[state])))
    draw_text(painter, place, state.value if state is not None else NONE, font, ink, CENTER)


def state_outline(state: PoseState | None) -> Points:
    """Closed outline (N, 2) in a box of -1..1: A circle, B square, C triangle, D diamond, None circle."""
    match state:
        case PoseState.B:
            return _rounded([(-0.86, -0.86), (0.86, -0.86), (0.86, 0.86), (-0.86, 0.86)], 0.2)
        case PoseState.C:
            return _rounded([(0.0, -1.0), (1.06, 0.84), (-1.06, 0.84)], 0.22)
        case PoseState.D:
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
