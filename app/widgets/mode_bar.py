"""What the operator can decide about driving: the next step, the deadman, why not, and STOP.

A button for a step of the operator, with its key: subdued when the step would be refused, but never out of use for that.

STOP: always there, always enabled, at the first touch.

The deadman as a field on the screen: held with the mouse, lit while any deadman is held.

Who drives, always in sight: the mode's name in a frame and a sign of its own.

A field on the screen that is held with the mouse, like a key.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from html import escape

from PySide6.QtCore import QEvent, QObject, QPointF, QRectF, QSize, Qt, Signal, Slot
from PySide6.QtGui import (
    QAbstractTextDocumentLayout,
    QColor,
    QFont,
    QFontMetrics,
    QHideEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPalette,
    QPen,
    QPolygonF,
    QResizeEvent,
    QTextDocument,
)
from PySide6.QtWidgets import QAbstractButton, QApplication, QHBoxLayout, QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import mark, tr
from app.ui.texts import DEADMAN_KEY, NOT_YET, STOP_KEY, NextStep, OperatorStep, Undriven, next_step, sentence, tip, who_drives
from app.widgets.basics import Sign, key_cap_width, octagon, paint_key_cap, paint_sign
from core.control.modes import ARMED_MODES, Mode
from core.control.pilot import DriveView

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
        self._step: OperatorStep | None = None
        self._granted = False
        self._pressed: tuple[OperatorStep | None, float] = (None, -float("inf"))
        self._counts = False
        self.setMinimumSize(60, 44)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.pressed.connect(self._on_pressed)
        self.clicked.connect(self._on_clicked)

    @property
    def step(self) -> OperatorStep | None:
        return self._step

    @property
    def is_granted(self) -> bool:
        return self._granted

    def sizeHint(self) -> QSize:
        return QSize(120, 54)

    def show_step(self, step: OperatorStep, granted: bool, why: str) -> None:
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
        colour = QColor(theme.of(_ROLE[self._step]))
        inviting = self._filled and self._granted and self.isEnabled()
        back = colour if inviting else QColor(theme.RAISED)
        ink = QColor(theme.INK if inviting else theme.TEXT if self.isEnabled() and self._granted else theme.TEXT_DIM)
        if not self.isEnabled():
            back, ink = QColor(theme.WINDOW), QColor(theme.TEXT_FAINT)
        edge = QColor(theme.TEXT) if self.hasFocus() or (self.underMouse() and self.isEnabled()) else QColor(theme.LINE)
        if self._filled and self.isEnabled() and not inviting and not self.underMouse():
            edge = theme.colour(theme.of(_ROLE[self._step]), 0.6)
        painter.setPen(QPen(edge, 1.5, Qt.PenStyle.SolidLine if self._granted else Qt.PenStyle.DashLine))
        painter.setBrush(back.darker(125) if self.isDown() else back)
        painter.drawRoundedRect(frame, 6, 6)
        name_font = theme.bold(18) if self._filled else theme.semi_bold(14)
        painter.setPen(ink)
        painter.setFont(theme.fitted(name_font, self.text(), int(frame.width() - 12)))
        painter.drawText(frame.adjusted(0, 4, 0, -22), Qt.AlignmentFlag.AlignCenter, self.text())
        paint_key_cap(painter, QPointF(frame.center().x(), frame.bottom() - 14), self._step.value.key, ink)
        painter.end()


_DOWN = (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick)
_UP = (QEvent.Type.MouseButtonRelease, QEvent.Type.Hide, QEvent.Type.UngrabMouse)


class StopButton(QAbstractButton):
    """``asked`` comes when a mouse button, whichever, goes down, again at each press, and even when it was disabled."""

    asked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setText(tr("STOP"))
        self.setMinimumSize(88, 44)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
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

    def sizeHint(self) -> QSize:
        return QSize(112, 54)

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

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        plate = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        back = QColor(theme.VERMILLION)
        painter.setPen(QPen(QColor(theme.TEXT), 2) if self.hasFocus() or self.underMouse() else Qt.PenStyle.NoPen)
        painter.setBrush(back.darker(150) if self.isDown() else back)
        painter.drawPolygon(octagon(plate, 12.0))
        ink = QColor(Qt.GlobalColor.white)
        painter.setPen(ink)
        painter.setFont(theme.bold(25))
        painter.drawText(plate.adjusted(0, 1, 0, -20), Qt.AlignmentFlag.AlignCenter, self.text())
        paint_key_cap(painter, QPointF(plate.center().x(), plate.bottom() - 12), STOP_KEY, ink)
        painter.end()


_WINDOW_LOST = (QEvent.Type.WindowDeactivate, QEvent.Type.WindowBlocked, QEvent.Type.Hide, QEvent.Type.Close)


class MouseHeld(QWidget):
    """Calls ``on_held`` when the left mouse button takes it and when it lets go.

    Whatever might have swallowed the release counts as one: the field is hidden or disabled, the window is left by the pointer,
    loses the focus or is blocked by a dialog, the grab is lost, or the release went to somebody else.
    """

    def __init__(self) -> None:
        super().__init__()
        self._held = False

    @property
    def is_held(self) -> bool:
        """Held with the mouse here."""
        return self._held

    def on_held(self, held: bool) -> None:
        """It was taken, or let go."""
        raise NotImplementedError

    def let_go(self) -> None:
        """No longer held with the mouse."""
        if self._held:
            self._held = False
            application = QApplication.instance()
            if application is not None:
                application.removeEventFilter(self)
            self.on_held(False)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and not self._held:
            self._held = True
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
        """Of the whole application, while held: a menu that opens meanwhile gets the release instead of us."""
        kind = event.type()
        lost = (
            (kind == QEvent.Type.MouseButtonRelease and isinstance(event, QMouseEvent) and _is_left(event))
            or (kind in _WINDOW_LOST and watched is self.window())
            or (kind == QEvent.Type.UngrabMouse and watched is self)
            or kind == QEvent.Type.ApplicationDeactivate
        )
        if lost:
            self.let_go()
        return False


def _is_left(event: QMouseEvent) -> bool:
    return event.button() == Qt.MouseButton.LeftButton


class DeadmanField(MouseHeld):
    """``held_changed`` carries whether the left mouse button holds it."""

    held_changed = Signal(bool)

    def __init__(self) -> None:
        super().__init__()
        self._deadman: bool | None = None
        self._matters = False
        self.setMinimumSize(96, 44)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setAccessibleName(tr("Deadman: hold to drive ({key})", key=DEADMAN_KEY))
        self.setToolTip(tip("deadman"))
        self._describe()

    @property
    def is_lit(self) -> bool:
        return self._deadman is True

    @property
    def word(self) -> str:
        """What the program sees of the deadman."""
        return {None: tr("none"), False: tr("not held"), True: tr("held")}[self._deadman]

    def sizeHint(self) -> QSize:
        return QSize(136, 54)

    def show_deadman(self, deadman: bool | None, *, matters: bool) -> None:
        """What the program sees of all deadmen, and whether anything depends on it now."""
        if (deadman, matters) != (self._deadman, self._matters):
            self._deadman, self._matters = deadman, matters
            self._describe()
            self.update()

    def _describe(self) -> None:
        self.setAccessibleDescription(self.word)

    def on_held(self, held: bool) -> None:
        self.update()
        self.held_changed.emit(held)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        back, ink, edge = QColor(theme.RAISED), QColor(theme.TEXT), QColor(theme.TEXT_FAINT)
        if not self.isEnabled():
            back, ink, edge = QColor(theme.WINDOW), QColor(theme.TEXT_FAINT), QColor(theme.LINE)
        elif self.is_lit:
            back, ink, edge = QColor(theme.SKY), QColor(theme.INK), QColor(theme.SKY)
        elif self._held:
            edge = QColor(theme.SKY)
        elif not self._matters:
            ink, edge = QColor(theme.TEXT_DIM), QColor(theme.LINE)
        painter.setPen(QPen(edge, 3.0 if self._held and not self.is_lit else 1.5))
        painter.setBrush(back)
        painter.drawRoundedRect(frame, frame.height() / 2.6, frame.height() / 2.6)
        painter.setPen(ink)
        painter.setFont(theme.fitted(theme.bold(16), tr("Hold to drive"), int(frame.width() - 20)))
        painter.drawText(frame.adjusted(0, 4, 0, -22), Qt.AlignmentFlag.AlignCenter, tr("Hold to drive"))
        self._paint_state(painter, QPointF(frame.center().x(), frame.bottom() - 14), ink)
        painter.end()

    def _paint_state(self, painter: QPainter, middle: QPointF, ink: QColor) -> None:
        """Key cap, and beside it a dot, full when held, and the word."""
        word_font = theme.semi_bold(theme.Size.LABEL)
        cap, word = key_cap_width(DEADMAN_KEY), QFontMetrics(word_font).horizontalAdvance(self.word)
        left = middle.x() - (cap + 8 + 12 + word) / 2
        paint_key_cap(painter, QPointF(left + cap / 2, middle.y()), DEADMAN_KEY, ink)
        painter.setPen(QPen(ink, 1.5))
        painter.setBrush(ink if self.is_lit else Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QPointF(left + cap + 12, middle.y()), 3.6, 3.6)
        painter.setPen(ink)
        painter.setFont(word_font)
        painter.drawText(QRectF(left + cap + 20, middle.y() - 9, word + 4, 18), Qt.AlignmentFlag.AlignVCenter, self.word)


_SIZE = QSize(284, 34)


@dataclass(frozen=True, slots=True)
class ModeLook:
    """Colour and sign of a mode; ``filled`` where something other than the operator decides."""

    role: str
    filled: bool
    sign: Sign
    meaning: str

    @property
    def colour(self) -> str:
        """In the scheme in use."""
        return theme.of(self.role)


MODE_LOOK = {
    Mode.ADVISORY: ModeLook("SKY", False, Sign.WHEEL, mark("you steer, the program only advises")),
    Mode.ARMED: ModeLook("ORANGE", False, Sign.READY, mark("you steer; the program may be handed over to")),
    Mode.AUTONOMOUS: ModeLook("GREEN", True, Sign.DRIVES, mark("the program drives while the deadman is held")),
    Mode.HOLD: ModeLook("YELLOW", True, Sign.PAUSE, mark("the program's motion is interrupted; the robot holds")),
    Mode.STOPPED: ModeLook("VERMILLION", True, Sign.STOP, mark("nothing moves until the stop is acknowledged")),
}


class ModeBadge(QWidget):
    """Told by frame and sign as well as by colour: only ARMED has a heavy frame, AUTONOMOUS a point, STOPPED eight corners."""

    def __init__(self) -> None:
        super().__init__()
        self._mode = Mode.ADVISORY
        self._who = ""
        self.setFixedSize(_SIZE)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.show_view(None, Undriven.NOT_YET)

    @property
    def mode(self) -> Mode:
        return self._mode

    @property
    def who(self) -> str:
        """Who drives, as shown beside the mode's name."""
        return self._who

    def sizeHint(self) -> QSize:
        return _SIZE

    def show_view(self, view: DriveView | None, why_not: Undriven = Undriven.NO_ROBOT) -> None:
        """The newest view; None: there is nothing to drive, and `why_not`."""
        mode, who = view.mode if view is not None else Mode.ADVISORY, who_drives(view, why_not)
        if (mode, who) == (self._mode, self._who):
            return
        self._mode, self._who = mode, who
        self.setAccessibleName(tr("Mode: {mode}", mode=tr(mode.value)))
        self.setAccessibleDescription(who)
        self.setToolTip("\n".join(_meaning(each, each is mode) for each in Mode))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        look = MODE_LOOK[self._mode]
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(1.5, 1.5, -1.5, -1.5)
        colour = QColor(look.colour)
        painter.setPen(QPen(colour, 3.0 if self._mode is Mode.ARMED else 1.5))
        painter.setBrush(colour if look.filled else QColor(theme.PANEL))
        painter.drawPath(_outline(frame, self._mode))
        ink = QColor(theme.INK) if look.filled else colour
        paint_sign(painter, QRectF(frame.left() + 9, frame.center().y() - 8.5, 17, 17), look.sign, ink)
        self._paint_words(painter, frame.adjusted(34, 0, -12, 0), ink, QColor(theme.INK if look.filled else theme.TEXT))
        painter.end()

    def _paint_words(self, painter: QPainter, room: QRectF, ink: QColor, who_ink: QColor) -> None:
        name, name_font = tr(self._mode.value), QFont(theme.bold(15))
        name_font.setLetterSpacing(QFont.SpacingType.AbsoluteSpacing, 0.4)
        painter.setFont(name_font)
        painter.setPen(ink)
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, name)
        left = QFontMetrics(name_font).horizontalAdvance(name) + 9
        painter.setFont(theme.fitted(theme.font(13), self._who, int(room.width() - left)))
        painter.setPen(who_ink)
        painter.drawText(room.adjusted(left, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, self._who)


def _meaning(mode: Mode, is_now: bool) -> str:
    arrow = "\N{RIGHTWARDS ARROW} " if is_now else ""
    return f"{arrow}{tr(mode.value)}: {tr(MODE_LOOK[mode].meaning)}"


def _outline(frame: QRectF, mode: Mode) -> QPainterPath:
    path = QPainterPath()
    if mode is Mode.STOPPED:
        path.addPolygon(octagon(frame, 9.0))
        path.closeSubpath()
    elif mode is Mode.AUTONOMOUS:
        tip, middle = frame.right() - 12, frame.center().y()
        corners = [(frame.left(), frame.top()), (tip, frame.top()), (frame.right(), middle), (tip, frame.bottom())]
        path.addPolygon(QPolygonF([QPointF(x, y) for x, y in (*corners, (frame.left(), frame.bottom()))]))
        path.closeSubpath()
    else:
        path.addRoundedRect(frame, 6, 6)
    return path


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
            OperatorStep.SERVOS_ON: self.servos_on_asked,
            OperatorStep.ACKNOWLEDGE: self.acknowledge_asked,
            OperatorStep.ARM: self.arm_asked,
            OperatorStep.HAND_OVER: self.hand_over_asked,
            OperatorStep.TAKE_BACK: self.take_back_asked,
            OperatorStep.DISARM: self.disarm_asked,
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
    def _on_step(self, step: OperatorStep) -> None:
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
        edge = look.colour if look is not None and look.filled else theme.LINE
        painter.setPen(QPen(QColor(edge), 2 if edge != theme.LINE else 1))
        painter.setBrush(QColor(theme.PANEL))
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
        context.palette.setColor(QPalette.ColorRole.Text, QColor(theme.TEXT_DIM))  # type: ignore[attr-defined]
        self._document.documentLayout().draw(painter, context)
        painter.end()


def _headline_colour(step: NextStep) -> str:
    if step.step is OperatorStep.ACKNOWLEDGE:
        return theme.FAULT
    return theme.YELLOW if step.reasons else theme.TEXT
