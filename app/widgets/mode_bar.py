"""Who drives, and what the operator can decide about driving: mode badge, next step and why not, deadman field, STOP."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from html import escape

from PySide6.QtCore import QEvent, QObject, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QAbstractTextDocumentLayout,
    QColor,
    QFont,
    QHideEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPalette,
    QPen,
    QResizeEvent,
    QTextDocument,
)
from PySide6.QtWidgets import QAbstractButton, QApplication, QSizePolicy

from app.ui import theme
from app.ui.i18n import mark, tr
from app.ui.texts import DEADMAN_KEY, STOP_KEY, NextStep, OperatorStep, Undriven, next_step, sentence, tip, who_drives
from app.widgets.basics import holder, line
from app.widgets.painting import (
    CENTER,
    FieldLook,
    Painted,
    PaintedWidget,
    Sign,
    draw_box,
    draw_text,
    key_cap_width,
    octagon,
    paint_key_cap,
    paint_sign,
    polygon,
    set_colours,
    text_width,
)
from core.control.drive_view import DriveView
from core.control.modes import ARMED_MODES, Mode

# a button has the colour of the mode that it leads to
_ROLE = {
    OperatorStep.SERVOS_ON: "SKY",
    OperatorStep.ACKNOWLEDGE: "TEXT",
    OperatorStep.ARM: "ORANGE",
    OperatorStep.HAND_OVER: "GREEN",
    OperatorStep.TAKE_BACK: "SKY",
    OperatorStep.DISARM: "TEXT_DIM",
}
DOUBLE_PRESS_S = 0.4


class _BarButton(Painted, QAbstractButton):
    def __init__(self, hint: tuple[int, int], least: tuple[int, int], horizontal: QSizePolicy.Policy) -> None:
        super().__init__()
        self._hint = QSize(*hint)
        self.setMinimumSize(*least)
        self.setSizePolicy(horizontal, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def sizeHint(self) -> QSize:
        return self._hint


class StepButton(_BarButton):
    """A button for a step of the operator, with its key: subdued when the step would be refused, but still usable.

    ``asked`` carries the step that was on the button when it was pressed. A second press within ``DOUBLE_PRESS_S`` does not count
    when the button has become another one meanwhile: a double click on "Take back" must not hand over again.
    """

    asked = Signal(object)

    def __init__(self, *, filled: bool, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__((120, 54), (60, 44), QSizePolicy.Policy.Expanding)
        self._filled = filled
        self._clock = clock
        self.step: OperatorStep | None = None
        self.is_granted = False
        self._pressed: tuple[OperatorStep | None, float] = (None, -float("inf"))
        self._counts = False
        self.pressed.connect(self._on_pressed)
        self.clicked.connect(self._on_clicked)

    def show_step(self, step: OperatorStep, granted: bool, why: str) -> None:
        """The step, whether it would be granted, and the reasons or what happens."""
        if step is not self.step:
            self.step = step
            self.setText(tr(step.value.name))
            self.setAccessibleName(f"{tr(step.value.name)} ({step.value.key})")
        self.is_granted = granted
        self.setAccessibleDescription(why)
        self.setToolTip(f"{tr(step.value.meaning)}  ({step.value.key})" + ("" if granted else f"\n\n{why}"))
        self.update()

    def _on_pressed(self) -> None:
        now, (before, at_s) = self._clock(), self._pressed
        self._counts = self.step is before or now - at_s >= DOUBLE_PRESS_S
        if self._counts:
            self._pressed = (self.step, now)

    def _on_clicked(self) -> None:
        step = self._pressed[0]
        if self._counts and step is not None:
            self.asked.emit(step)

    def paint(self, painter: QPainter) -> None:
        if self.step is None:
            return
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        colour = QColor(theme.of(_ROLE[self.step]))
        is_hovered = self.underMouse() and self.isEnabled()
        if not self.isEnabled():
            back, ink = QColor(theme.WINDOW), QColor(theme.TEXT_FAINT)
        elif self._filled and self.is_granted:
            back, ink = colour, QColor(theme.INK)
        else:
            back, ink = QColor(theme.RAISED), QColor(theme.TEXT if self.is_granted else theme.TEXT_DIM)
        edge = QColor(theme.TEXT if self.hasFocus() or is_hovered else theme.LINE)
        if self._filled and self.isEnabled() and not self.is_granted and not is_hovered:
            edge = theme.colour(theme.of(_ROLE[self.step]), 0.6)
        pen = QPen(edge, 1.5, Qt.PenStyle.SolidLine if self.is_granted else Qt.PenStyle.DashLine)
        draw_box(painter, frame, 6, back.darker(125) if self.isDown() else back, pen)
        font = theme.fitted(theme.bold(18) if self._filled else theme.semi_bold(14), self.text(), int(frame.width() - 12))
        draw_text(painter, frame.adjusted(0, 4, 0, -22), self.text(), font, ink, CENTER)
        paint_key_cap(painter, QPointF(frame.center().x(), frame.bottom() - 14), self.step.value.key, ink)


_DOWN = (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick)
_UP = (QEvent.Type.MouseButtonRelease, QEvent.Type.Hide, QEvent.Type.UngrabMouse)


class StopButton(_BarButton):
    """STOP. ``asked`` comes when any mouse button goes down, again at each press, and even when it is disabled.

    It is disabled, and pale, while another window has the servos: that one has a STOP of its own.
    """

    asked = Signal()

    def __init__(self) -> None:
        super().__init__((112, 54), (88, 44), QSizePolicy.Policy.Fixed)
        self.setText(tr("STOP"))
        self.setAccessibleName(tr("STOP"))
        self.setAccessibleDescription(tr("Stops the robot at once. Key {key}.", key=STOP_KEY))
        self.setToolTip(
            tr(
                "Stops the robot at once, in every mode  ({key})\n"
                "{key} types a space in a text field only while nothing can move; Ctrl+{key} and Pause stop there, too\n"
                "It is no emergency stop: that is the power cut, by hand, beside the robot",
                key=STOP_KEY,
            )
        )
        self.clicked.connect(self.asked)  # by keyboard or screen reader: a mouse never gets so far

    def event(self, event: QEvent) -> bool:
        # before QWidget looks whether it is enabled, and before QAbstractButton waits for the release
        if event.type() in _DOWN:
            self.setDown(True)
            self.asked.emit()
            event.accept()
            return True
        if event.type() in _UP:
            self.setDown(False)
        return super().event(event)

    def paint(self, painter: QPainter) -> None:
        plate = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        back, ink = QColor(theme.VERMILLION), QColor(Qt.GlobalColor.white)
        if not self.isEnabled():
            back, ink = QColor(theme.LINE), QColor(theme.TEXT_DIM)
        is_marked = self.hasFocus() or self.underMouse()
        set_colours(painter, back.darker(150) if self.isDown() else back, theme.TEXT if is_marked else None, 2)
        painter.drawPolygon(octagon(plate, 12.0))
        draw_text(painter, plate.adjusted(0, 1, 0, -20), self.text(), theme.bold(25), ink, CENTER)
        paint_key_cap(painter, QPointF(plate.center().x(), plate.bottom() - 12), STOP_KEY, ink)


_WINDOW_LOST = (QEvent.Type.WindowDeactivate, QEvent.Type.WindowBlocked, QEvent.Type.Hide, QEvent.Type.Close)


class MouseHeld(PaintedWidget):
    """A field that is held with the left mouse button; calls ``on_held`` when it is taken and when it is let go.

    Everything that might swallow the release counts as one: the field is hidden or disabled, the pointer leaves the window, the
    window loses the focus or is blocked by a dialog, the grab is lost, or another widget gets the release.
    """

    is_held = False

    def on_held(self, held: bool) -> None:
        """It was taken, or let go."""
        raise NotImplementedError

    def let_go(self) -> None:
        """No longer held with the mouse."""
        if self.is_held:
            self.is_held = False
            application = QApplication.instance()
            if application is not None:
                application.removeEventFilter(self)
            self.on_held(False)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and not self.is_held:
            self.is_held = True
            application = QApplication.instance()
            if application is not None:
                application.installEventFilter(self)
            self.on_held(True)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        window = self.window()
        if not window.rect().contains(self.mapTo(window, event.position().toPoint())):
            self.let_go()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.let_go()

    def hideEvent(self, event: QHideEvent) -> None:
        self.let_go()
        super().hideEvent(event)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.EnabledChange and not self.isEnabled():
            self.let_go()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Of the whole application, while held: a menu that opens meanwhile gets the release instead."""
        kind = event.type()
        is_left = isinstance(event, QMouseEvent) and event.button() == Qt.MouseButton.LeftButton
        if (
            (kind == QEvent.Type.MouseButtonRelease and is_left)
            or (kind in _WINDOW_LOST and watched is self.window())
            or (kind == QEvent.Type.UngrabMouse and watched is self)
            or kind == QEvent.Type.ApplicationDeactivate
        ):
            self.let_go()
        return False


class DeadmanField(MouseHeld):
    """The deadman on the screen, lit while any deadman is held. ``held_changed``: whether the left mouse button holds this one."""

    held_changed = Signal(bool)

    def __init__(self) -> None:
        super().__init__(tr("Deadman: hold to drive ({key})", key=DEADMAN_KEY), tip("deadman"), hint=(136, 54), least=(96, 44))
        self._deadman: bool | None = None
        self._matters = False
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setAccessibleDescription(self.word)

    @property
    def is_lit(self) -> bool:
        return self._deadman is True

    @property
    def word(self) -> str:
        """The state of all deadmen in a word."""
        return {None: tr("none"), False: tr("not held"), True: tr("held")}[self._deadman]

    def show_deadman(self, deadman: bool | None, *, matters: bool) -> None:
        """The state of all deadmen, and whether anything depends on it now."""
        if (deadman, matters) != (self._deadman, self._matters):
            self._deadman, self._matters = deadman, matters
            self.setAccessibleDescription(self.word)
            self.update()

    def on_held(self, held: bool) -> None:
        self.update()
        self.held_changed.emit(held)

    def paint(self, painter: QPainter) -> None:
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        back, ink, edge = theme.RAISED, theme.TEXT, theme.TEXT_FAINT
        if not self.isEnabled():
            back, ink, edge = theme.WINDOW, theme.TEXT_FAINT, theme.LINE
        elif self.is_lit:
            back, ink, edge = theme.SKY, theme.INK, theme.SKY
        elif self.is_held:
            edge = theme.SKY
        elif not self._matters:
            ink, edge = theme.TEXT_DIM, theme.LINE
        draw_box(painter, frame, frame.height() / 2.6, back, edge, 3.0 if self.is_held and not self.is_lit else 1.5)
        font = theme.fitted(theme.bold(16), tr("Hold to drive"), int(frame.width() - 20))
        draw_text(painter, frame.adjusted(0, 4, 0, -22), tr("Hold to drive"), font, ink, CENTER)
        # the key cap, and beside it a dot, full when held, and the word
        label, y = theme.semi_bold(theme.Size.LABEL), frame.bottom() - 14
        cap, word = key_cap_width(DEADMAN_KEY), text_width(label, self.word)
        left = frame.center().x() - (cap + 8 + 12 + word) / 2
        paint_key_cap(painter, QPointF(left + cap / 2, y), DEADMAN_KEY, QColor(ink))
        set_colours(painter, ink if self.is_lit else None, ink, 1.5)
        painter.drawEllipse(QPointF(left + cap + 12, y), 3.6, 3.6)
        draw_text(painter, QRectF(left + cap + 20, y - 9, word + 4, 18), self.word, label, ink)


MODE_LOOK = {
    Mode.ADVISORY: FieldLook("SKY", Sign.WHEEL, False, mark("you steer, the program only advises")),
    Mode.ARMED: FieldLook("ORANGE", Sign.READY, False, mark("you steer; the program may be handed over to")),
    Mode.AUTONOMOUS: FieldLook("GREEN", Sign.DRIVES, True, mark("the program drives while the deadman is held")),
    Mode.HOLD: FieldLook("YELLOW", Sign.PAUSE, True, mark("the program's motion is interrupted; the robot holds")),
    Mode.STOPPED: FieldLook("VERMILLION", Sign.STOP, True, mark("nothing moves until the stop is acknowledged")),
}
"""Filled: something other than the operator decides."""


class ModeBadge(PaintedWidget):
    """Who drives. Frame and sign tell the mode as well: only ARMED has a heavy frame, AUTONOMOUS a point, STOPPED eight corners."""

    def __init__(self) -> None:
        super().__init__(hint=(284, 34))
        self.mode = Mode.ADVISORY
        self.who = ""
        self.setFixedSize(284, 34)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.show_view(None, Undriven.NOT_YET)

    def show_view(self, view: DriveView | None, why_not: Undriven = Undriven.NO_ROBOT) -> None:
        """The newest view; None: there is nothing to drive, and `why_not`."""
        mode, who = view.mode if view is not None else Mode.ADVISORY, who_drives(view, why_not)
        if (mode, who) == (self.mode, self.who):
            return
        self.mode, self.who = mode, who
        self.setAccessibleName(tr("Mode: {mode}", mode=tr(mode.value)))
        self.setAccessibleDescription(who)
        arrow = "\N{RIGHTWARDS ARROW} "
        lines = (f"{arrow if each is mode else ''}{tr(each.value)}: {tr(MODE_LOOK[each].meaning)}" for each in Mode)
        self.setToolTip("\n".join(lines))
        self.update()

    def paint(self, painter: QPainter) -> None:
        look = MODE_LOOK[self.mode]
        frame = QRectF(self.rect()).adjusted(1.5, 1.5, -1.5, -1.5)
        set_colours(painter, look.colour if look.filled else theme.PANEL, look.colour, 3.0 if self.mode is Mode.ARMED else 1.5)
        painter.drawPath(_outline(frame, self.mode))
        ink = QColor(theme.INK if look.filled else look.colour)
        paint_sign(painter, QRectF(frame.left() + 9, frame.center().y() - 8.5, 17, 17), look.sign, ink)
        room, name = frame.adjusted(34, 0, -12, 0), tr(self.mode.value)
        font = QFont(theme.bold(15))
        font.setLetterSpacing(QFont.SpacingType.AbsoluteSpacing, 0.4)
        draw_text(painter, room, name, font, ink)
        room.adjust(text_width(font, name) + 9, 0, 0, 0)
        draw_text(painter, room, self.who, theme.font(13), theme.INK if look.filled else theme.TEXT, smallest_px=11)


def _outline(frame: QRectF, mode: Mode) -> QPainterPath:
    path = QPainterPath()
    if mode is Mode.STOPPED:
        path.addPolygon(octagon(frame, 9.0))
        path.closeSubpath()
    elif mode is Mode.AUTONOMOUS:
        left, right, top, bottom, tip_x = frame.left(), frame.right(), frame.top(), frame.bottom(), frame.right() - 12
        path.addPolygon(polygon([(left, top), (tip_x, top), (right, frame.center().y()), (tip_x, bottom), (left, bottom)]))
        path.closeSubpath()
    else:
        path.addRoundedRect(frame, 6, 6)
    return path


HEIGHT = 66
REASON_DWELL_S = 1.0
_NARROW, _WIDE = 600, 1150
_LARGEST_PX, _SMALLEST_PX = 18, 11
# widths at a bar of 600 px and of 1150 px; the text gets the rest
_STEP_WIDTH, _DEADMAN_WIDTH, _STOP_WIDTH = (170, 270), (124, 200), (94, 180)


class ModeBar(PaintedWidget):
    """One bar under the advice. Its places stay where they are in every mode: operators press them without looking.

    The signals are requests; nothing here decides. ``step_asked`` carries the OperatorStep, ``deadman_changed`` whether the mouse
    holds the deadman's field.
    """

    step_asked = Signal(object)
    stop_asked = Signal()
    deadman_changed = Signal(bool)

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(tr("Who drives"), hint=(_NARROW, HEIGHT), height=HEIGHT)
        self.setMinimumWidth(_NARROW)
        self._mode: Mode | None = None
        self._shown = Undriven.NOT_YET.step
        self._shown_s = 0.0
        self._against: dict[OperatorStep, tuple[str, str] | None] = {}
        self.main = StepButton(filled=True, clock=clock)
        self.second = StepButton(filled=False, clock=clock)
        self.deadman = DeadmanField()
        self.stop = StopButton()
        self._text = _Line()
        self._steps = holder(line((self.main, 3), (self.second, 2), spacing=6))
        self.setLayout(line(self._steps, self.deadman, (self._text, 1), self.stop, spacing=8, margins=(12, 6, 6, 6)))
        self.main.asked.connect(self.step_asked)
        self.second.asked.connect(self.step_asked)
        self.stop.asked.connect(self.stop_asked)
        self.deadman.held_changed.connect(self.deadman_changed)
        self._set_usable(False)
        self._show_step(self._shown)

    @property
    def text(self) -> str:
        return self._shown.text

    @property
    def text_fits(self) -> bool:
        return self._text.fits

    def show_view(self, view: DriveView | None, why_not: Undriven = Undriven.NO_ROBOT) -> None:
        """The newest view; None: there is nothing to drive, and `why_not`."""
        usable, mode = view is not None, view.mode if view is not None else None
        if usable is not self.deadman.isEnabled():
            self._set_usable(usable)
        step = self._checked(next_step(view)) if view is not None else why_not.step
        self.deadman.show_deadman(view.deadman if view is not None else None, matters=mode in ARMED_MODES)
        if (step, mode) == (self._shown, self._mode) or (view is not None and self._is_too_soon(step, view)):
            return
        self._mode, self._shown_s = mode, view.time_s if view is not None else 0.0
        self._show_step(step)
        self.update()

    def set_against(self, step: OperatorStep, what: tuple[str, str] | None) -> None:
        """What checks or a missing rehearsal say against a step, and what to do; None: nothing. It is shown with the next view."""
        self._against[step] = what

    def _checked(self, step: NextStep) -> NextStep:
        """A step that the checks would refuse says so, as their list does."""
        against = self._against.get(step.step)
        return replace(step, granted=False, headline=against[0], rest=against[1]) if against and step.granted else step

    def _is_too_soon(self, step: NextStep, view: DriveView) -> bool:
        """Reasons may alternate with every picture: one that is shown stays long enough to be read."""
        if view.mode is not self._mode:
            return False
        shown = self._shown
        same = (step.step, step.granted, step.other) == (shown.step, shown.granted, shown.other)
        return same and bool(step.reasons and shown.reasons) and 0.0 < view.time_s - self._shown_s < REASON_DWELL_S

    def _show_step(self, step: NextStep) -> None:
        self._shown = step
        self.main.show_step(step.step, step.granted, step.all_reasons or step.text)
        if step.other is not None:
            self.second.show_step(step.other, True, tr(step.other.value.meaning))
        self.second.setVisible(step.other is not None)
        self._text.show_step(step)
        self.setAccessibleDescription(step.text)

    def _set_usable(self, usable: bool) -> None:
        for part in (self.main, self.second, self.deadman):
            part.setEnabled(usable)

    def resizeEvent(self, event: QResizeEvent) -> None:
        share = min(1.0, max(0.0, (self.width() - _NARROW) / (_WIDE - _NARROW)))
        for part, (least, most) in ((self._steps, _STEP_WIDTH), (self.deadman, _DEADMAN_WIDTH), (self.stop, _STOP_WIDTH)):
            part.setFixedWidth(round(least + share * (most - least)))
        super().resizeEvent(event)

    def paint(self, painter: QPainter) -> None:
        look = MODE_LOOK[self._mode] if self._mode is not None else None
        edge = look.colour if look is not None and look.filled else theme.LINE
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        draw_box(painter, frame, theme.RADIUS, theme.PANEL, edge, 2 if edge != theme.LINE else 1)
        if look is not None:
            draw_box(painter, QRectF(0, 0, 6, self.height()), 3, look.colour)


class _Line(PaintedWidget):
    """The situation in bold, and what to do; as large as fits."""

    def __init__(self) -> None:
        super().__init__(tr("What is next"))
        self._step = Undriven.NOT_YET.step
        self._document = QTextDocument(self, documentMargin=0)
        self.fits = True

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
        step, more = self._step, ""
        if len(step.reasons) > 1:
            more = " <b>" + tr("+{count} more", count=len(step.reasons) - 1).replace(" ", "&nbsp;") + "</b>"
        is_fault = step.step is OperatorStep.ACKNOWLEDGE
        colour = theme.FAULT if is_fault else theme.YELLOW if step.reasons else theme.TEXT
        headline = f'<b style="color:{colour}">{escape(sentence(step.headline))}</b>'
        self._document.setDefaultFont(theme.font(size_px))
        self._document.setHtml(f"{headline} {escape(' '.join(rest))}{more}")
        self._document.setTextWidth(max(1, self.width() - 4))
        return self._document.size().height() <= self.height() and self._document.idealWidth() <= self.width()

    def paint(self, painter: QPainter) -> None:
        painter.translate(2, max(0.0, (self.height() - self._document.size().height()) / 2))
        context = QAbstractTextDocumentLayout.PaintContext()
        context.palette.setColor(QPalette.ColorRole.Text, QColor(theme.TEXT_DIM))  # type: ignore[attr-defined]
        self._document.documentLayout().draw(painter, context)
