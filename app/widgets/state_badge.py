"""The pose state as a large letter in a shape of its own, with its name, how sure it is, and the reason in plain words."""

from __future__ import annotations

import math
from collections.abc import Callable

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import REASON_TEXT, STATE_TITLE, refusal_line, tip, why_line
from app.widgets.scene_overlay import LETTER_DROP, LETTER_HEIGHT, state_outline
from core.config.models import PoseConfig
from core.types import PoseState, Scene

_HEIGHT = 104
_WRAPPED = int(Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft | Qt.TextFlag.TextWordWrap)


class StateBadge(QWidget):
    """Shape, letter and colour tell the state: A circle, B square, C triangle, D diamond; a dashed ring with "-" means no pose.

    A shape that is not filled means that the program is not sure of it.

    Parameters
    ----------
    limits : of the pose states.
    confident_from : the confidence from which on an answer is sure, 0 to 1.
    """

    def __init__(self, limits: PoseConfig, confident_from: float) -> None:
        super().__init__()
        self._limits, self._confident_from = limits, confident_from
        self._state: PoseState | None = None
        self._is_unsure = False
        self._sureness = ""
        self._title = tr("Waiting")
        self._why = ""
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setFixedHeight(_HEIGHT)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(tr("Pose state"))
        self._meanings = tip("state", "confidence")
        self.setToolTip(self._meanings)

    def set_limits(self, limits: PoseConfig, confident_from: float) -> None:
        self._limits, self._confident_from = limits, confident_from

    @property
    def letter(self) -> str:
        return self._state.value if self._state is not None else "-"

    @property
    def title(self) -> str:
        return self._title

    @property
    def why(self) -> str:
        return self._why

    @property
    def sureness(self) -> str:
        """How sure the state is; empty without one."""
        return self._sureness

    @property
    def is_unsure(self) -> bool:
        return self._is_unsure

    def sizeHint(self) -> QSize:
        return QSize(440, _HEIGHT)

    def show_scene(self, scene: Scene, *, renew_text: bool = True) -> None:
        """The state of `scene`, or the reason why it has none. A new letter or title always renews the sentence too."""
        pose = scene.pose
        if pose is not None:
            self._set(pose.state, tr(STATE_TITLE[pose.state]), lambda: why_line(pose, self._limits), renew_text, pose.confidence)
        elif scene.refusal is not None:
            refusal = scene.refusal
            self._set(None, tr(REASON_TEXT[refusal.reason].title), lambda: refusal_line(refusal), renew_text)
        else:
            self.show_nothing(tr("No pose"), "")

    def show_nothing(self, title: str, why: str) -> None:
        """No state, for a cause outside perception: starting, no new picture, fault."""
        self._set(None, title, lambda: tr_text(why), True)

    def _set(
        self, state: PoseState | None, title: str, why: Callable[[], str], renew_text: bool, confidence: float | None = None
    ) -> None:
        changed = state is not self._state or title != self._title
        if not changed and not renew_text:
            return
        text = why()
        is_unsure, sureness = self._judge(confidence)
        if not changed and text == self._why and sureness == self._sureness:
            return
        self._state, self._title, self._why = state, title, text
        self._is_unsure, self._sureness = is_unsure, sureness
        self.setAccessibleDescription(f"{self.letter}: {title}{f' ({sureness})' if sureness else ''}. {text}")
        # a long reason may not fit; the tool tip has all of it
        self.setToolTip(text if state is None and text else self._meanings)
        self.update()

    def _judge(self, confidence: float | None) -> tuple[bool, str]:
        """Whether an answer is unsure, and how sure it is in words."""
        if confidence is None:
            return False, ""
        is_unsure = confidence < self._confident_from
        # Rounded down, so that it says what was decided; and never 100 %: nothing is as sure as that.
        percent = min(math.floor(100.0 * confidence + 1e-9), 99)
        return is_unsure, tr("unsure: {percent} %", percent=percent) if is_unsure else tr("{percent} % sure", percent=percent)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme.PANEL))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        side = self.height() - 4.0
        box = QRectF(2.0, 2.0, side, side)
        paint_state(painter, box, self._state, filled=not self._is_unsure)
        left = box.right() + 18
        width = self.width() - left - 2
        room = width - self._paint_sureness(painter, QRectF(left, 2, width, 36))
        painter.setPen(QColor(theme.TEXT))
        painter.setFont(theme.fitted(theme.bold(theme.Size.TITLE), self._title, int(room)))
        painter.drawText(QRectF(left, 2, room, 36), Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, self._title)
        painter.setPen(QColor(theme.TEXT_DIM))
        place = QRectF(left, 42, width, self.height() - 42)
        painter.setFont(_wrapped_font(self._why, place))
        painter.drawText(place, _WRAPPED, self._why)
        painter.end()

    def _paint_sureness(self, painter: QPainter, place: QRectF) -> float:
        """At the right of `place`; returns the width that it takes, with a gap."""
        if not self._sureness:
            return 0.0
        font = theme.bold() if self._is_unsure else theme.font()
        painter.setFont(font)
        painter.setPen(QColor(theme.FAULT if self._is_unsure else theme.TEXT_DIM))
        painter.drawText(place, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignRight, self._sureness)
        return QFontMetricsF(font).horizontalAdvance(self._sureness) + theme.GAP


def _wrapped_font(text: str, place: QRectF) -> QFont:
    """The largest of a few sizes at which `text` fits into `place` when wrapped."""
    for size in (17, 15, 13, 12):
        result = theme.font(size)
        if QFontMetricsF(result).boundingRect(place, _WRAPPED, text).height() <= place.height():
            break
    return result


def paint_state(painter: QPainter, box: QRectF, state: PoseState | None, *, filled: bool = True) -> None:
    """The state's shape and letter inside `box`; not `filled`, only its outline, as of a state that is not sure."""
    name = theme.STATE_COLOUR[state]
    side, middle = box.height(), box.center()
    outline = QPolygonF([middle + QPointF(x, y) * (side / 2) for x, y in state_outline(state).tolist()])
    if state is None:
        painter.setPen(QPen(QColor(name), max(2.0, side / 28), Qt.PenStyle.DashLine))
        painter.setBrush(Qt.BrushStyle.NoBrush)
    elif not filled:
        painter.setPen(theme.outline_of(name, max(2.0, side / 20)))
        painter.setBrush(Qt.BrushStyle.NoBrush)
    else:
        painter.setPen(theme.edge_of(name))
        painter.setBrush(QColor(name))
    painter.drawPolygon(outline)
    painter.setPen(QColor(theme.TEXT_DIM if state is None else theme.STATE_INK if filled else theme.TEXT))
    painter.setFont(theme.bold(max(9, round(side * LETTER_HEIGHT[state]))))
    letter = state.value if state is not None else "\N{EN DASH}"
    painter.drawText(box.translated(0, side * LETTER_DROP.get(state, 0.0)), Qt.AlignmentFlag.AlignCenter, letter)
