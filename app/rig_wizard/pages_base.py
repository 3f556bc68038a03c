"""What guided procedures share: the dialog, the page base, the camera picture with shapes over it, and small controls."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.widgets.basics import Card, Part, StillWheel, add_parts, button, column, line, takes_enter
from app.widgets.messages import QuestionStrip
from app.widgets.mode_bar import StopButton
from core.types import Image, Point

if TYPE_CHECKING:
    from app.rig_wizard.model import RigWizardModel
    from app.teaching.model import TeachingModel
    from hardware.calibration.rig_draft import RigDraft

_ARROW_HEAD_PX = 11.0


@dataclass(frozen=True, slots=True)
class Cross:
    """A place of the picture."""

    at: Point
    text: str = ""


@dataclass(frozen=True, slots=True)
class Arrow:
    """A direction in the picture."""

    start: Point
    end: Point
    text: str = ""


@dataclass(frozen=True, slots=True)
class MeasuredLine:
    """A length in the picture."""

    start: Point
    end: Point


Shape = Cross | Arrow | MeasuredLine


class WizardPicture(QWidget):
    """Shows one picture as large as there is room. ``clicked`` carries a place of the picture, in its own pixels."""

    clicked = Signal(float, float)

    def __init__(self) -> None:
        super().__init__()
        self._image: QImage | None = None
        self._shapes: tuple[Shape, ...] = ()
        self._text = ""
        self.setMinimumSize(360, 270)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Camera picture"))

    def sizeHint(self) -> QSize:
        return QSize(560, 420)

    @property
    def text(self) -> str:
        """Shown when there is no picture."""
        return self._text

    @property
    def shapes(self) -> tuple[Shape, ...]:
        return self._shapes

    def show_image(self, image: Image) -> None:
        height, width = image.shape[:2]
        self._image = QImage(image.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888)
        self.update()

    def show_shapes(self, shapes: Sequence[Shape]) -> None:
        self._shapes = tuple(shapes)
        texts = (shape.text for shape in shapes if not isinstance(shape, MeasuredLine) and shape.text)
        self.setAccessibleDescription(", ".join(texts))
        self.update()

    def show_text(self, text: str) -> None:
        self._image, self._text = None, text
        self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if self._image is None or event.button() is not Qt.MouseButton.LeftButton:
            return
        box, zoom = self._place(self._image)
        x, y = (event.position().x() - box.left()) / zoom - 0.5, (event.position().y() - box.top()) / zoom - 0.5
        if -0.5 <= x < self._image.width() - 0.5 and -0.5 <= y < self._image.height() - 0.5:
            self.clicked.emit(x, y)

    def on_screen(self, point: Point) -> Point:
        """A place of the picture in widget pixels."""
        if self._image is None:
            return 0.0, 0.0
        box, zoom = self._place(self._image)
        return box.left() + (point[0] + 0.5) * zoom, box.top() + (point[1] + 0.5) * zoom

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.fillRect(self.rect(), QColor(theme.ON_PICTURE.INK))
        if self._image is None:
            painter.setPen(QColor(theme.ON_PICTURE.TEXT_DIM))
            painter.setFont(theme.font(theme.Size.BODY))
            flags = int(Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap)
            painter.drawText(QRectF(self.rect()).adjusted(24, 24, -24, -24), flags, self._text)
        else:
            painter.drawImage(self._place(self._image)[0], self._image)
            for shape in self._shapes:
                self._paint_shape(painter, shape)
        painter.end()

    def _place(self, image: QImage) -> tuple[QRectF, float]:
        zoom = min(self.width() / image.width(), self.height() / image.height())
        width, height = image.width() * zoom, image.height() * zoom
        return QRectF((self.width() - width) / 2, (self.height() - height) / 2, width, height), zoom

    def _paint_shape(self, painter: QPainter, shape: Shape) -> None:
        colour = QColor(theme.ON_PICTURE.TARGET if isinstance(shape, Cross) else theme.ON_PICTURE.ROBOT_VECTOR)
        for pen in (QPen(QColor(0, 0, 0, 150), 4.0), QPen(colour, 2.0)):
            painter.setPen(pen)
            painter.setBrush(Qt.BrushStyle.NoBrush)
            if isinstance(shape, Cross):
                at = QPointF(*self.on_screen(shape.at))
                painter.drawLine(at - QPointF(4, 0), at + QPointF(4, 0))
                painter.drawLine(at - QPointF(0, 4), at + QPointF(0, 4))
                continue
            start, end = QPointF(*self.on_screen(shape.start)), QPointF(*self.on_screen(shape.end))
            painter.drawLine(start, end)
            if isinstance(shape, Arrow):
                angle = math.atan2(end.y() - start.y(), end.x() - start.x())
                sides = [QPointF(math.cos(angle + turn), math.sin(angle + turn)) * _ARROW_HEAD_PX for turn in (0.5, -0.5)]
                painter.drawPolyline(QPolygonF([end - sides[0], end, end - sides[1]]))
        if not isinstance(shape, MeasuredLine) and shape.text:
            self._paint_text(painter, shape, colour)

    def _paint_text(self, painter: QPainter, shape: Cross | Arrow, colour: QColor) -> None:
        painter.setFont(theme.semi_bold(theme.Size.BODY))
        at = QPointF(*self.on_screen(shape.at if isinstance(shape, Cross) else shape.end))
        away = QPointF(8.0, -6.0)
        if isinstance(shape, Arrow):
            way = at - QPointF(*self.on_screen(shape.start))
            away = QPointF(8.0 if way.x() >= -4.0 else -52.0, 16.0 if way.y() > 4.0 else -6.0)
        x, y = min(at.x() + away.x(), self.width() - 60.0), min(at.y() + away.y(), self.height() - 6.0)
        place = QPointF(max(4.0, x), max(16.0, y))
        painter.setPen(QColor(0, 0, 0, 200))
        painter.drawText(place + QPointF(1, 1), shape.text)
        painter.setPen(colour)
        painter.drawText(place, shape.text)


_TEXT_PX = 400
"""Narrower than the text of a page, so that the height for this width is enough."""
_HEAD_PX = 28


class StepPage(QWidget):
    """A step of a guided procedure. ``name`` stands in the list of steps; the page adds its controls."""

    name = ""
    hint = ""

    def __init__(self) -> None:
        super().__init__()
        self.main: QPushButton | None = None
        """The button of the step; it stands out until that is done."""
        self.column = QVBoxLayout(self)
        self.column.setContentsMargins(0, 0, 0, 0)
        self.column.setSpacing(theme.GAP)
        title = QLabel(tr(self.name))
        title.setFont(theme.semi_bold(18))
        self.add(title, note(tr(self.hint)))

    def add(self, *parts: Part) -> None:
        """Below what is there; see ``column`` of the widgets."""
        add_parts(self.column, *parts)

    @property
    def is_done(self) -> bool:
        """Whether the step has been done: it gets a tick, and the wizard's Next is not called Skip."""
        return False


class WizardPage(StepPage):
    """One step of the rig wizard."""

    def __init__(self, model: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__()
        self.model, self.picture = model, picture
        self.still: Image | None = None
        """Shown instead of the live picture."""

    @property
    def draft(self) -> RigDraft | None:
        """The rig as far as it is known; None before a camera is open."""
        return self.model.draft

    @property
    def has_servos(self) -> bool:
        """Whether servos were found, and no job is running."""
        return self.draft is not None and self.draft.found is not None and not self.model.is_busy

    @property
    def may_leave(self) -> bool:
        """Whether there is a next step."""
        return True

    def enter(self) -> None:
        """The page comes to the front."""
        self.refresh()

    def leave(self) -> None:
        """Another page comes to the front."""

    def refresh(self) -> None:
        """Show what is known now; called whenever a job begins or ends."""

    def shapes(self) -> Sequence[Shape]:
        """What is drawn over the picture."""
        return ()

    def click(self, x: float, y: float) -> None:
        """A place of the picture was clicked."""

    def add_row(self, *parts: QWidget, stretched: QWidget | None = None, fill: bool = False) -> None:
        """Widgets side by side; without `fill` they stand at the left."""
        row = QHBoxLayout()
        add_parts(row, *((part, 1) if part is stretched else part for part in parts), *([] if fill else [None]))
        self.column.addLayout(row)

    def run_step(self, what: str, step: Callable[[RigDraft], object]) -> None:
        """Do a step of the draft beside the window."""
        draft = self.draft
        if draft is not None:
            self.model.run(what, lambda: step(draft))


def note(text: str) -> QLabel:
    label = QLabel(text, wordWrap=True)
    theme.set_sheet(label, "color: @TEXT_DIM;")
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label


def set_note(label: QLabel, text: str) -> None:
    """Another text for a note, with the height that it needs: a table beside it would take that otherwise."""
    label.setText(tr_text(text))
    label.setMinimumHeight(label.heightForWidth(_TEXT_PX) if text else 0)


class JobFocus:
    """Gives the keyboard back after a job, unless it was moved meanwhile: Qt moved it, mostly to STOP, when the buttons went off.

    Made before they do; ``has_begun`` when they are off.
    """

    def __init__(self, dialog: QWidget, page: StepPage) -> None:
        self._dialog, self._page, self._began = dialog, page, dialog.focusWidget()
        self._goes_on = self._began is page.main and not page.is_done
        self._moved_to: QWidget | None = None

    def has_begun(self, stop: QWidget) -> None:
        self._moved_to = self._dialog.focusWidget() or stop

    def end(self, page: StepPage, onward: QWidget, *, is_failed: bool = False) -> None:
        """On, where the main button's job made its page done, or else back to what began it.

        After a job that failed or was stopped to no button: a second Enter, meant for STOP, moves nothing.
        """
        if self._dialog.focusWidget() is not self._moved_to or self._moved_to is self._began:
            return
        is_news = self._goes_on and page is self._page and page.is_done
        for one in () if is_failed else (onward, self._began) if is_news else (self._began,):
            if one is not None and one.isEnabled() and one.isVisible():
                one.setFocus()
                return
        self._dialog.setFocus()


_FRAME = QSize(16, 56)
"""Room that the desktop needs for title bar and borders."""
_STEP_LINE_PX = 30


class StepDialog(QDialog):
    """A list of steps, the page of one of them with what stands at its right, and a line or a question at the foot."""

    model: RigWizardModel | TeachingModel
    page: StepPage

    def __init__(self, title: str, size: QSize, parent: QWidget | None) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        theme.set_sheet(self, theme.FORM_SHEET)
        self.resize(size.boundedTo(self.screen().availableGeometry().size() - _FRAME))
        self.steps, self.stack, self.stop_button = QListWidget(), QStackedWidget(), StopButton()
        self.back_button, self.next_button = button(tr("&Back"), self.back), button(tr("&Next"), self.next)
        self.line = note("")
        self.question = QuestionStrip(self.line)
        self.question.closed.connect(self.setFocus)
        self._job: JobFocus | None = None

    def lay_out(self, pages: Sequence[StepPage], right: QWidget, steps_px: int, controls_px: int, *buttons: QPushButton) -> None:
        """`buttons` stand before those that lead back and on."""
        self.steps.setFixedWidth(steps_px)
        self.steps.setAccessibleName(tr("Steps"))
        self.steps.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.steps.setSelectionMode(QListWidget.SelectionMode.NoSelection)
        for page in pages:
            item = QListWidgetItem(tr(page.name))
            item.setSizeHint(QSize(steps_px - 8, _STEP_LINE_PX))
            self.steps.addItem(item)
            self.stack.addWidget(page)
        self.stack.setFixedWidth(controls_px)
        foot = line(self.stop_button, (self.line, 1), (self.question, 1))
        for part in (*buttons, self.back_button, self.next_button):
            foot.addWidget(part, 0, Qt.AlignmentFlag.AlignBottom)
        for message in (self.line, self.question):
            message.setMinimumHeight(44)
        self.setLayout(column((line(self.steps, Card("", self.stack), (right, 1)), 1), foot, margins=(14, 12, 14, 12)))
        StillWheel(self)

    @property
    def message(self) -> str:
        return self.line.text()

    def next(self) -> None:
        raise NotImplementedError

    def back(self) -> None:
        raise NotImplementedError

    def _show_page(self) -> None:
        """Show on page, steps and buttons what is known now."""
        raise NotImplementedError

    def _has_failed(self) -> bool:
        """Whether the job that has ended failed or was stopped."""
        return False

    def follow_theme(self) -> None:
        self._refresh()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not takes_enter(self, event):
            super().keyPressEvent(event)

    def say(self, text: str, is_fault: bool = False) -> None:
        if is_fault:
            self.question.cancel()  # the fault must be seen
        theme.set_sheet(self.line, "color: @FAULT;" if is_fault else "color: @TEXT;")
        self.line.setText(tr_text(text))
        self.line.setAccessibleName(text)

    def _refresh(self) -> None:
        busy = self.model.busy
        begun = JobFocus(self, self.page) if busy and self._job is None else None
        self._show_page()
        if begun is not None:
            self._job = begun
            begun.has_begun(self.stop_button)
        elif not busy and self._job is not None:
            self._job.end(self.page, self.next_button, is_failed=self._has_failed())
            self._job = None
        if busy:
            work = tr_text(busy)
            self.say(f"{work[0].upper()}{work[1:]} ...")
        elif self.message.endswith(" ..."):
            self.say("")


def table(headings: Sequence[str], first_column: Sequence[str], name: str, *, fitted: bool = True, row_px: int = 0) -> QTableWidget:
    """A table of texts with a row for each of `first_column`, by default as high as its rows; the last column is stretched."""
    made = QTableWidget(len(first_column), len(headings))
    made.setHorizontalHeaderLabels(list(headings))
    made.verticalHeader().hide()
    made.setAccessibleName(name)
    made.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    made.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    made.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    made.setTabKeyNavigation(False)
    header = made.horizontalHeader()
    header.setFixedHeight(_HEAD_PX)
    header.setHighlightSections(False)
    header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    header.setStretchLastSection(True)
    if row_px:
        made.verticalHeader().setDefaultSectionSize(row_px)
    if fitted:
        made.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        set_rows(made, first_column)
    return made


def set_rows(where: QTableWidget, first_column: Sequence[str]) -> None:
    """A row for each text, the others empty, and a table as high as its rows."""
    where.setRowCount(0)
    where.setRowCount(len(first_column))
    for row, text in enumerate(first_column):
        set_cell(where, row, 0, text)
    rows = len(first_column) * where.verticalHeader().defaultSectionSize()
    where.setFixedHeight(_HEAD_PX + rows + 2 * max(1, where.frameWidth()))


def set_cell(where: QTableWidget, row: int, column: int, text: str) -> None:
    """A text, which also is the tool tip of its cell."""
    item = QTableWidgetItem(text)
    item.setToolTip(text)
    where.setItem(row, column, item)
