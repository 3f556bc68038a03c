"""What the operator can decide about driving: the next step, the deadman, why not, and STOP."""

from __future__ import annotations

import time
from collections.abc import Callable
from html import escape

from PySide6.QtCore import QRectF, QSize, Qt, Signal, Slot
from PySide6.QtGui import QAbstractTextDocumentLayout, QColor, QPainter, QPaintEvent, QPalette, QPen, QResizeEvent, QTextDocument
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app import palette, theme
from app.language import tr
from app.next_step import NOT_YET, NextStep, Step, Undriven, next_step, sentence
from app.widgets.deadman_field import DeadmanField
from app.widgets.mode_badge import MODE_LOOK
from app.widgets.step_button import StepButton
from app.widgets.stop_button import StopButton
from core.control.drive_view import DriveView
from core.control.modes import ARMED_MODES, Mode

HEIGHT = 66
REASON_DWELL_S = 1.0
_NARROW, _WIDE = 600, 1150
_LARGEST_PX, _SMALLEST_PX = 18, 11
# widths at a bar of 600 px and of 1150 px; what is left is the text's
_STEP_WIDTH, _DEADMAN_WIDTH, _STOP_WIDTH = (170, 270), (124, 200), (94, 180)


class ModeBar(QWidget):
    """One bar under the advice. Its places stay where they are whatever the mode: hands remember them.

    The signals are requests; nothing here decides. ``deadman_changed`` carries whether the mouse holds the deadman's field.
    """

    servos_on_asked = Signal()
    acknowledge_asked = Signal()
    arm_asked = Signal()
    hand_over_asked = Signal()
    take_back_asked = Signal()
    disarm_asked = Signal()
    stop_asked = Signal()
    deadman_changed = Signal(bool)

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._mode: Mode | None = None
        self._shown = NOT_YET
        self._shown_s = 0.0
        self.main = StepButton(filled=True, clock=clock)
        self.second = StepButton(filled=False, clock=clock)
        self.deadman = DeadmanField()
        self.stop = StopButton()
        self._text = _Line()
        self._steps = QWidget()
        self._lay_out()
        signals = {
            Step.SERVOS_ON: self.servos_on_asked,
            Step.ACKNOWLEDGE: self.acknowledge_asked,
            Step.ARM: self.arm_asked,
            Step.HAND_OVER: self.hand_over_asked,
            Step.TAKE_BACK: self.take_back_asked,
            Step.DISARM: self.disarm_asked,
        }
        self._signals = signals
        self.main.asked.connect(self._on_step)
        self.second.asked.connect(self._on_step)
        self.stop.asked.connect(self.stop_asked)
        self.deadman.held_changed.connect(self.deadman_changed)
        self.setAccessibleName(tr("Who drives"))
        self._set_usable(False)
        self._show_step(NOT_YET)

    @property
    def text(self) -> str:
        """The line as shown."""
        return self._shown.text

    @property
    def text_fits(self) -> bool:
        """Nothing of the line is cut."""
        return self._text.fits

    def sizeHint(self) -> QSize:
        return QSize(_NARROW, HEIGHT)

    def show_view(self, view: DriveView | None, why_not: Undriven = Undriven.NO_ROBOT) -> None:
        """The newest view; None: there is nothing to drive, and `why_not`."""
        usable, mode = view is not None, view.mode if view is not None else None
        if usable is not self.deadman.isEnabled():
            self._set_usable(usable)
        step = next_step(view) if view is not None else why_not.step
        matters = mode in ARMED_MODES
        self.deadman.show_deadman(view.deadman if view is not None else None, matters=matters)
        if (step, mode) == (self._shown, self._mode) or (view is not None and self._too_soon(step, view)):
            return
        self._mode, self._shown_s = mode, view.time_s if view is not None else 0.0
        self._show_step(step)
        self.update()

    def _too_soon(self, step: NextStep, view: DriveView) -> bool:
        """Reasons may alternate with every picture: one that is shown stays long enough to be read."""
        if view.mode is not self._mode:
            return False
        shown = self._shown
        same = (step.step, step.granted, step.other) == (shown.step, shown.granted, shown.other)
        return same and bool(step.reasons and shown.reasons) and 0.0 < view.time_s - self._shown_s < REASON_DWELL_S

    def _show_step(self, step: NextStep) -> None:
        self._shown = step
        why = step.all_reasons or step.text
        self.main.show_step(step.step, step.granted, why)
        if step.other is not None:
            self.second.show_step(step.other, True, tr(step.other.value.meaning))
        self.second.setVisible(step.other is not None)
        self._text.show_step(step)
        self.setAccessibleDescription(step.text)

    def _set_usable(self, usable: bool) -> None:
        for part in (self.main, self.second, self.deadman):
            part.setEnabled(usable)

    @Slot(object)
    def _on_step(self, step: Step) -> None:
        self._signals[step].emit()

    # ---- places

    def _lay_out(self) -> None:
        slot = QHBoxLayout(self._steps)
        slot.setContentsMargins(0, 0, 0, 0)
        slot.setSpacing(6)
        slot.addWidget(self.main, 3)
        slot.addWidget(self.second, 2)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 6, 6, 6)
        row.setSpacing(8)
        row.addWidget(self._steps)
        row.addWidget(self.deadman)
        row.addWidget(self._text, 1)
        row.addWidget(self.stop)
        self.setFixedHeight(HEIGHT)
        self.setMinimumWidth(_NARROW)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def resizeEvent(self, event: QResizeEvent) -> None:
        share = min(1.0, max(0.0, (self.width() - _NARROW) / (_WIDE - _NARROW)))
        for part, (least, most) in ((self._steps, _STEP_WIDTH), (self.deadman, _DEADMAN_WIDTH), (self.stop, _STOP_WIDTH)):
            part.setFixedWidth(round(least + share * (most - least)))
        super().resizeEvent(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        look = MODE_LOOK[self._mode] if self._mode is not None else None
        edge = look.colour if look is not None and look.filled else palette.LINE
        painter.setPen(QPen(QColor(edge), 2 if edge != palette.LINE else 1))
        painter.setBrush(QColor(palette.PANEL))
        painter.drawRoundedRect(frame, theme.RADIUS, theme.RADIUS)
        if look is not None:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(look.colour))
            painter.drawRoundedRect(QRectF(0, 0, 6, self.height()), 3, 3)
        painter.end()


class _Line(QWidget):
    """What is the matter, in bold, and what to do; as large as fits."""

    def __init__(self) -> None:
        super().__init__()
        self._step = NOT_YET
        self._document = QTextDocument(self)
        self._document.setDocumentMargin(0)
        self.fits = True
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("What is next"))

    def follow_theme(self) -> None:
        self._fit()

    def show_step(self, step: NextStep) -> None:
        self._step = step
        self.setAccessibleDescription(step.text)
        self.setToolTip(step.all_reasons or step.text)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        words = sentence(self._step.rest).split()
        self.fits = any(self._try(words, size) for size in range(_LARGEST_PX, _SMALLEST_PX - 1, -1))
        while words and not self.fits:  # the tool tip has all of it
            words.pop()
            if self._try([*words, "\N{HORIZONTAL ELLIPSIS}"], _SMALLEST_PX):
                break
        self.update()

    def _try(self, rest: list[str], size_px: int) -> bool:
        """Set the line with `rest` in this size; whether it fits."""
        step = self._step
        more = (
            " <b>" + tr("+{count} more", count=len(step.reasons) - 1).replace(" ", "&nbsp;") + "</b>"
            if len(step.reasons) > 1
            else ""
        )
        headline = f'<b style="color:{_headline_colour(step)}">{escape(sentence(step.headline))}</b>'
        self._document.setDefaultFont(theme.font(size_px))
        self._document.setHtml(f"{headline} {escape(' '.join(rest))}{more}")
        self._document.setTextWidth(max(1, self.width() - 4))
        return self._document.size().height() <= self.height() and self._document.idealWidth() <= self.width()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        spare = self.height() - self._document.size().height()
        painter.translate(2, max(0.0, spare / 2))
        context = QAbstractTextDocumentLayout.PaintContext()
        context.palette.setColor(QPalette.ColorRole.Text, QColor(palette.TEXT_DIM))  # type: ignore[attr-defined]
        self._document.documentLayout().draw(painter, context)
        painter.end()


def _headline_colour(step: NextStep) -> str:
    if step.step is Step.ACKNOWLEDGE:
        return palette.FAULT
    return palette.YELLOW if step.reasons else palette.TEXT
