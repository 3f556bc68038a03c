"""A button for a step of the operator, with its key: subdued when the step would be refused, but never out of use for that."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal, Slot
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QAbstractButton, QSizePolicy

from app import palette, theme
from app.language import tr
from app.next_step import Step
from app.widgets.signs import paint_key_cap

# a button has the colour of the mode that it leads to
_ROLE = {
    Step.SERVOS_ON: "SKY",
    Step.ACKNOWLEDGE: "TEXT",
    Step.ARM: "ORANGE",
    Step.HAND_OVER: "GREEN",
    Step.TAKE_BACK: "SKY",
    Step.DISARM: "TEXT_DIM",
}
DOUBLE_PRESS_S = 0.4


class StepButton(QAbstractButton):
    """``asked`` carries the step that was on the button when it was pressed.

    A second press within ``DOUBLE_PRESS_S`` does not count when the button has become another one meanwhile: whoever double-clicks
    on "Take back" must not hand over again.
    """

    asked = Signal(object)

    def __init__(self, *, filled: bool, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._filled = filled
        self._clock = clock
        self._step: Step | None = None
        self._granted = False
        self._pressed: tuple[Step | None, float] = (None, -float("inf"))
        self._counts = False
        self.setMinimumSize(60, 44)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.pressed.connect(self._on_pressed)
        self.clicked.connect(self._on_clicked)

    @property
    def step(self) -> Step | None:
        return self._step

    @property
    def is_granted(self) -> bool:
        return self._granted

    def sizeHint(self) -> QSize:
        return QSize(120, 54)

    def show_step(self, step: Step, granted: bool, why: str) -> None:
        """The step, whether it would be granted, and the reasons or what happens."""
        if step is not self._step:
            self._step = step
            self.setText(tr(step.value.name))
            self.setAccessibleName(f"{tr(step.value.name)} ({step.value.key})")
        self._granted = granted
        self.setAccessibleDescription(why)
        self.setToolTip(f"{tr(step.value.meaning)}  ({step.value.key})" + ("" if granted else f"\n\n{why}"))
        self.update()

    @Slot()
    def _on_pressed(self) -> None:
        now, (before, at_s) = self._clock(), self._pressed
        self._counts = self._step is before or now - at_s >= DOUBLE_PRESS_S
        if self._counts:
            self._pressed = (self._step, now)

    @Slot()
    def _on_clicked(self) -> None:
        step = self._pressed[0]
        if self._counts and step is not None:
            self.asked.emit(step)

    def paintEvent(self, event: QPaintEvent) -> None:
        if self._step is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        colour = QColor(palette.of(_ROLE[self._step]))
        inviting = self._filled and self._granted and self.isEnabled()
        back = colour if inviting else QColor(palette.RAISED)
        ink = QColor(palette.INK if inviting else palette.TEXT if self.isEnabled() and self._granted else palette.TEXT_DIM)
        if not self.isEnabled():
            back, ink = QColor(palette.WINDOW), QColor(palette.TEXT_FAINT)
        edge = QColor(palette.TEXT) if self.hasFocus() or (self.underMouse() and self.isEnabled()) else QColor(palette.LINE)
        if self._filled and self.isEnabled() and not inviting and not self.underMouse():
            edge = theme.colour(palette.of(_ROLE[self._step]), 0.6)
        painter.setPen(QPen(edge, 1.5, Qt.PenStyle.SolidLine if self._granted else Qt.PenStyle.DashLine))
        painter.setBrush(back.darker(125) if self.isDown() else back)
        painter.drawRoundedRect(frame, 6, 6)
        name_font = theme.bold(18) if self._filled else theme.semi_bold(14)
        painter.setPen(ink)
        painter.setFont(theme.fitted(name_font, self.text(), int(frame.width() - 12)))
        painter.drawText(frame.adjusted(0, 4, 0, -22), Qt.AlignmentFlag.AlignCenter, self.text())
        paint_key_cap(painter, QPointF(frame.center().x(), frame.bottom() - 14), self._step.value.key, ink)
        painter.end()
