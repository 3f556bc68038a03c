"""The rig wizard: camera, scale and lens, servos, zero, steering, one page each, with STOP always within reach."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QPointF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QColor, QIcon, QKeyEvent, QPainter, QPen, QPixmap, QPolygonF
from PySide6.QtWidgets import QAbstractSpinBox, QComboBox, QFrame, QLineEdit, QPlainTextEdit, QWidget

from app.operator.stop_keys import StopKeys
from app.rig_wizard.camera_pages import CameraPage, ScalePage
from app.rig_wizard.model import RigWizardModel
from app.rig_wizard.pages_base import StepDialog, WizardPage, WizardPicture
from app.rig_wizard.servo_pages import DrumsPage, IdentifyPage, PortPage, SteeringPage, ZeroPage
from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import calibration_lines, rig_line
from app.ui.window_base import is_asked_to_end
from app.widgets.basics import button, set_main_button
from core.config.rig_file import RigFile, RigFileError, write_rig


class SummaryPage(WizardPage):
    """Shows the rig as it will be saved: what was found, what was left out, what to remember."""

    name = mark("Save")
    hint = mark("This is what will be saved. A step that was left out can be done later: menu Rig, Calibrate.")

    def __init__(self, model: RigWizardModel, picture: WizardPicture, rig_name: Callable[[], str]) -> None:
        super().__init__(model, picture)
        self._rig_name = rig_name
        self.text = QPlainTextEdit(readOnly=True)
        self.text.setFrameShape(QFrame.Shape.NoFrame)
        self.text.setAccessibleName(tr("The rig as it will be saved"))
        self.text.setTabChangesFocus(True)
        self.add((self.text, 1))

    def rig(self) -> RigFile | None:
        """The rig; None before a camera is open. Raises RigFileError."""
        return self.draft.rig_file(self._rig_name()) if self.draft is not None else None

    def refresh(self) -> None:
        try:
            rig = self.rig()
        except RigFileError as error:
            self.text.setPlainText(str(error))
            return
        if rig is None or self.draft is None:
            return
        notes = dict.fromkeys(tr_text(line) for line in self.draft.notes)
        lines = [f"{rig.name}: {rig_line(rig)}", "", *(f"\N{BULLET} {line}" for line in (*calibration_lines(rig), *notes)), ""]
        if rig.robot != "none":
            lines.append(
                tr("The zeros are offered whenever the servos are switched on; say then how far robot and catheter are in.")
            )
        self.text.setPlainText("\n".join(lines))


_SIZE = QSize(1240, 660)
_STEPS_PX, _CONTROLS_PX, _SIGN_PX = 190, 450, 16
_TICK = QPolygonF([QPointF(2.5, 8.5), QPointF(6.5, 12.5), QPointF(13.5, 4.0)])
_PICTURE_EVERY_MS = 50
_FIELDS = (QAbstractSpinBox, QLineEdit, QComboBox)
"""Esc leaves one of these fields first, then the dialog."""


class RigWizard(StepDialog):
    """Makes or calibrates a rig. ``saved`` carries its name.

    Next leads through the pages in their order, and is called Skip on a page whose step was not done. Space is STOP, except in a
    text field while no job runs. Leaving with unsaved results asks first; ``reject`` does not ask.

    Parameters
    ----------
    model : closed when the dialog is.
    rig_name : empty for a new rig.
    """

    saved = Signal(str)
    model: RigWizardModel
    page: WizardPage

    def __init__(self, model: RigWizardModel, rig_name: str, parent: QWidget | None = None) -> None:
        super().__init__(tr("Calibrate {name}", name=rig_name) if rig_name else tr("New rig"), _SIZE, parent)
        self.model = model
        model.setParent(self)
        self.setModal(True)
        self.picture = WizardPicture()
        self.picture.show_text(tr("No camera yet"))
        self.camera_page = CameraPage(model, self.picture, rig_name)
        self.camera_page.ask = self.question.ask
        self.scale_page = ScalePage(model, self.picture)
        self.port_page = PortPage(model, self.picture)
        self.drums_page = DrumsPage(model, self.picture)
        self.identify_page = IdentifyPage(model, self.picture)
        self.zero_page = ZeroPage(model, self.picture)
        self.steering_page = SteeringPage(model, self.picture)
        self.summary_page = SummaryPage(model, self.picture, lambda: self.camera_page.rig_name)
        self.pages: tuple[WizardPage, ...] = (
            self.camera_page,
            self.scale_page,
            self.port_page,
            self.drums_page,
            self.identify_page,
            self.zero_page,
            self.steering_page,
            self.summary_page,
        )
        self.cancel_button = button(tr("Cancel"), self.ask_to_leave)
        self.question.instead_of = (self.line, self.cancel_button)  # the question has its own Cancel, which returns to the wizard
        self.steps.setIconSize(QSize(_SIGN_PX, _SIGN_PX))
        self.lay_out(self.pages, self.picture, _STEPS_PX, _CONTROLS_PX, self.cancel_button)
        self.stop_button.asked.connect(model.stop)
        self._stop_keys = StopKeys(self, lambda: model.is_busy, model.stop)  # servos are open only while a job runs
        model.message.connect(self.say)
        model.failed.connect(lambda line: self.say(line, is_fault=True))
        model.changed.connect(self._refresh)
        self.picture.clicked.connect(self._on_clicked)
        self._timer = QTimer(self, interval=_PICTURE_EVERY_MS)
        self._timer.timeout.connect(self._update_picture)
        self._timer.start()
        self._shown_frame: object = None
        self.page = self.camera_page
        self._go(0)

    def next(self) -> None:
        """The next page; on the last one: save."""
        if self.page is self.summary_page:
            self._save()
        elif self.page.may_leave and not self.model.is_busy:
            self._go(self.stack.currentIndex() + 1)

    def back(self) -> None:
        if self.stack.currentIndex() > 0 and not self.model.is_busy:
            self._go(self.stack.currentIndex() - 1)

    def ask_to_leave(self) -> None:
        """Close the dialog; with unsaved results only after a question in place of the line at the foot."""
        draft = self.model.draft
        if draft is None or not draft.has_news:
            self.reject()
        elif not self.question.text:
            self.question.ask(tr("Leave without saving what was found?"), tr("Leave"), self.reject)

    def done(self, result: int) -> None:
        """The dialog closes: nothing moves any more, camera and port become free."""
        self._timer.stop()
        self._stop_keys.detach()
        self.model.close()
        super().done(result)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            if not event.isAutoRepeat():
                self._on_escape()
        else:
            super().keyPressEvent(event)

    def closeEvent(self, event: QCloseEvent) -> None:
        if self.isVisible() and is_asked_to_end():
            self.reject()
        elif self.isVisible():
            self.ask_to_leave()
        event.setAccepted(not self.isVisible())

    def _on_escape(self) -> None:
        """Leave the question, the field, or the dialog."""
        if self.question.text:
            self.question.cancel()
        elif isinstance(self.focusWidget(), _FIELDS):
            self.setFocus()
        else:
            self.ask_to_leave()

    def _go(self, index: int) -> None:
        self.page.leave()
        self.question.cancel()
        self.say("")  # the message was about the page before
        self.stack.setCurrentIndex(index)
        self.page = self.pages[index]
        self.page.enter()
        self._refresh()

    def _on_clicked(self, x: float, y: float) -> None:
        self.page.click(x, y)

    def _has_failed(self) -> bool:
        return self.model.is_failed

    def _show_page(self) -> None:
        busy, page = self.model.is_busy, self.page
        page.refresh()
        for row, other in enumerate(self.pages):
            item = self.steps.item(row)
            item.setIcon(self._sign(other.is_done, is_here=other is page))
            words = [tr(other.name), *([tr("done")] if other.is_done else []), *([tr("this page")] if other is page else [])]
            item.setData(Qt.ItemDataRole.AccessibleTextRole, ", ".join(words))
            font = item.font()
            font.setBold(other is page)
            item.setFont(font)
        is_last = page is self.summary_page
        goes_on = page.is_done or page is self.camera_page
        self.next_button.setText(tr("&Save") if is_last else tr("&Next") if goes_on else tr("&Skip"))
        self.next_button.setEnabled(page.may_leave and not busy and (not is_last or self.model.draft is not None))
        self.back_button.setEnabled(self.stack.currentIndex() > 0 and not busy)
        set_main_button(self.next_button, is_last or page.is_done)
        if page.main is not None:
            set_main_button(page.main, not page.is_done)
        self._update_picture(is_forced=True)

    def _sign(self, is_done: bool, *, is_here: bool) -> QIcon:
        """A tick, or a point for the page in front."""
        ratio = self.devicePixelRatioF()
        pixmap = QPixmap(QSize(_SIGN_PX, _SIGN_PX) * ratio)
        pixmap.setDevicePixelRatio(ratio)
        pixmap.fill(Qt.GlobalColor.transparent)
        painter = QPainter(pixmap)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if is_done:
            round_ends = (Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
            painter.setPen(QPen(QColor(theme.ALLOWED), 2.2, *round_ends))
            painter.drawPolyline(_TICK)
        elif is_here:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(theme.SKY))
            painter.drawEllipse(QPointF(_SIGN_PX / 2, _SIGN_PX / 2), 4.0, 4.0)
        painter.end()
        return QIcon(pixmap)

    def _update_picture(self, is_forced: bool = False) -> None:
        """Show the newest picture, or that of the page."""
        bench, still = self.model.bench, self.page.still
        self.picture.show_shapes(self.page.shapes())
        if still is not None:
            if still is not self._shown_frame or is_forced:
                self._shown_frame = still
                self.picture.show_image(still)
            return
        if bench is None:
            return
        frame = bench.feed.newest
        if bench.feed.problem is not None:
            self.picture.show_text(bench.feed.problem)
        elif frame is not None and (frame is not self._shown_frame or is_forced):
            self._shown_frame = frame
            self.picture.show_image(frame.image)

    def _save(self) -> None:
        try:
            rig = self.summary_page.rig()
            if rig is None:
                return
            path = write_rig(rig)
        except RigFileError as error:
            self.say(str(error), is_fault=True)
            return
        self.say(tr("Saved: {path}", path=path))
        self.saved.emit(rig.name)
        self.accept()
