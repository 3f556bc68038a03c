"""The window that teaches a bench: empty picture, vessel, moving the robot, frames, training; it can be left at any step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from PySide6.QtCore import QSize, QTimer
from PySide6.QtGui import QCloseEvent, QShortcut
from PySide6.QtWidgets import QStackedWidget, QWidget

from app.annotator.canvas import AnnotationCanvas
from app.annotator.outline_editor import VesselOutlineEditor
from app.operator.manual_drive import JogKeys
from app.rig_wizard.pages_base import StepDialog
from app.teaching.folder import TeachingStep
from app.teaching.model import NewestFrame, TeachingModel
from app.teaching.pages import (
    BenchPicture,
    EmptyPage,
    FramesPage,
    MovePage,
    TeachingPage,
    TrainPage,
    VesselPage,
    show_main,
)
from app.training.dialog import BeforeAfter
from app.ui.i18n import tr, tr_text
from app.ui.texts import OperatorStep, next_step, who_drives
from app.widgets.alerts import AlertStrip
from app.widgets.basics import button
from core.control.drive_view import DriveNews
from core.control.motion import Jog

_SIZE = QSize(1440, 800)
_STEPS_PX, _CONTROLS_PX = 156, 352
_PICTURE_EVERY_MS = 50
_ASKED = OperatorStep.SERVOS_ON, OperatorStep.ACKNOWLEDGE
"""What moving the robot may ask for."""


@dataclass(frozen=True, slots=True)
class TeachingDriver:
    """How the window moves the robot.

    ``drive`` does what held keys say, ``stop`` is STOP, ``ask`` a step of the operator, ``can_move``: whether anything can move.
    """

    drive: Callable[[Jog], object]
    stop: Callable[[], object]
    ask: Callable[[OperatorStep], object]
    can_move: Callable[[], bool]


class TeachingWindow(StepDialog):
    """Shows a teaching. It is not modal; closing it hides it, and everything goes on from there.

    Parameters
    ----------
    model : lives longer than the window is shown; a training goes on while it is hidden.
    newest : the live picture.
    driver : keys that move the robot while it is to be moved.
    use : puts a model of this name, with its bench, into force; returns why it cannot be done now, or "".
    in_use : whether a model of this name is in force, with its bench.
    """

    model: TeachingModel
    page: TeachingPage

    def __init__(
        self,
        model: TeachingModel,
        newest: NewestFrame,
        driver: TeachingDriver,
        use: Callable[[str], str],
        in_use: Callable[[str], bool],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(tr("Teach this bench: {name}", name=model.rig), _SIZE, parent)
        self.model, self._newest, self._driver, self._use = model, newest, driver, use
        self._keys: JogKeys | None = None
        self._shown_index = -1
        self.setModal(False)
        self.picture = BenchPicture()
        self.picture.show_text(tr("No live picture"))
        self.alerts = AlertStrip(self.picture)
        vessel_editor, robot_canvas, self.before_after = VesselOutlineEditor(), AnnotationCanvas(), BeforeAfter(is_drawn=False)
        vessel_editor.said.connect(self.say)
        self.empty_page = EmptyPage(model, self.picture)
        self.vessel_page = VesselPage(model, vessel_editor)
        self.move_page = MovePage(model, self.picture)
        self.frames_page = FramesPage(model, robot_canvas)
        self.train_page = TrainPage(model, self.before_after, in_use)
        self.pages: tuple[TeachingPage, ...] = (
            self.empty_page,
            self.vessel_page,
            self.move_page,
            self.frames_page,
            self.train_page,
        )
        self.right = QStackedWidget()
        for page in self.pages:
            page.edited.connect(self._refresh)
            if self.right.indexOf(page.right) < 0:
                self.right.addWidget(page.right)
        self.stop_button.asked.connect(driver.stop)
        for step in _ASKED:
            QShortcut(step.value.key, self, partial(driver.ask, step))
        self.over_button = button(tr("Start &over"), self._ask_to_start_over, tr("Forget what was taken of this bench"))
        self.close_button = button(tr("&Close"), self.close, tr("What was taken is kept; the menu Model opens it again"))
        self.lay_out(self.pages, self.right, _STEPS_PX, _CONTROLS_PX, self.over_button, self.close_button)
        self.page = self.empty_page
        model.changed.connect(self._refresh)
        model.said.connect(self.say)
        self._timer = QTimer(self, interval=_PICTURE_EVERY_MS)
        self._timer.timeout.connect(self._update_picture)

    # ---- opening and closing

    def open(self) -> None:
        """Show it at the step where it was left."""
        if not self.model.is_loaded and not self.model.is_busy:
            self.model.load()
        self.show()
        self.raise_()
        self.activateWindow()
        self._timer.start()
        self._enter(self.pages[self.model.view.step])

    def end(self) -> None:
        self._leave()
        self.model.close()
        self.close()

    def closeEvent(self, event: QCloseEvent) -> None:
        self._leave()
        event.accept()  # QDialog's own asks reject() first, and stays open

    def reject(self) -> None:
        """Escape leaves the question, drops what is being drawn, and else closes the window."""
        if self.question.text:
            self.question.cancel()
        elif not self.page.cancel():
            self.close()

    def _leave(self) -> None:
        self._timer.stop()
        self.page.leave()
        self._set_keys(False)

    # ---- steps

    def next(self) -> None:
        """Keep what was done, and go on; on the last page: use the model."""
        if not self._may_go_on:
            return
        if self.page is self.train_page:
            self.use_model()
        else:
            self.page.next(TeachingStep(self.page.step + 1))

    def use_model(self) -> None:
        """Put the model that was trained into force, with its bench."""
        if why := self._use(self.model.view.model):
            self.say(tr("Not used: {why}", why=tr_text(why)), is_fault=True)
        else:
            self._refresh()

    def back(self) -> None:
        """To the step before; nothing is lost."""
        if not self.model.is_busy and self.page.step > 0:
            self.model.go(TeachingStep(self.page.step - 1))

    def _enter(self, page: TeachingPage) -> None:
        self.page = page
        self.question.cancel()
        self.stack.setCurrentWidget(page)
        self.right.setCurrentWidget(page.right)
        self.say("")
        self._shown_index = -1
        page.enter()
        self._set_keys(page.is_live)
        self._refresh()

    def _set_keys(self, on: bool) -> None:
        """The arrows move the robot only where it is to be moved."""
        if on is (self._keys is not None):
            return
        if on:
            self._keys = JogKeys(self, self._driver.can_move)
            self._keys.changed.connect(self._driver.drive)
            self._keys.stop_pressed.connect(self._driver.stop)
        elif self._keys is not None:
            self._keys.detach()
            self._keys.deleteLater()
            self._keys = None

    def _ask_to_start_over(self) -> None:
        self.question.ask(tr("Forget pictures, vessel and frames of this bench?"), tr("Forget"), self.model.start_over)

    # ---- what is shown

    def _refresh(self) -> None:
        if not self.isVisible():
            return
        step = self.model.view.step
        if not self.model.is_busy and self.page.step is not step:
            self.page.leave()
            self._enter(self.pages[step])
        else:
            super()._refresh()

    def _show_page(self) -> None:
        model, view = self.model, self.model.view
        self.page.refresh()
        for row, page in enumerate(self.pages):
            item = self.steps.item(row)
            font = item.font()
            font.setBold(page is self.page)
            item.setFont(font)
            done = "\N{CHECK MARK}" if page.step < view.step or (page is self.page and page.is_done) else str(row + 1)
            item.setText(f"{done}  {tr(page.name)}")
        is_last = self.page is self.train_page
        self.next_button.setText(tr("&Use it") if is_last else tr("&Next"))
        self.next_button.setEnabled(self._may_go_on)
        self.back_button.setEnabled(self.page.step > 0 and not model.is_busy and not model.is_training)
        self.over_button.setEnabled(not model.is_busy and not model.is_training)
        self.close_button.setText(tr("&Close, go on training") if model.is_training else tr("&Close"))
        show_main(self.page, self.next_button)

    def show_news(self, news: DriveNews) -> None:
        """Show over the live picture who moves the robot, and why it does not move, or was stopped."""
        if self.isVisible():
            following, who = next_step(news.view), who_drives(news.view)
            key = f" ({following.step.value.key})" if following.granted and following.step in _ASKED else ""
            self.picture.show_caption(tr("Live: {who}{key}", who=who, key=key))
            self.alerts.show_view(news.view)
            self.alerts.show_alerts(news.alerts)

    @property
    def _may_go_on(self) -> bool:
        model = self.model
        return self.page.may_leave and not model.is_busy and not (self.page is self.train_page and model.is_training)

    def _update_picture(self) -> None:
        if self.page is self.train_page and self.next_button.isEnabled() is not self._may_go_on:
            self._refresh()  # another model was chosen in the operator window, or this one again
        if not self.page.is_live:
            return
        frame = self._newest()
        if frame is None:
            self.picture.show_text(
                tr("No live picture of this bench: choose it in the menu Rig or Twin, or start the rig (F5 in the operator window)")
            )
        elif frame.index != self._shown_index:
            self._shown_index = frame.index
            self.picture.show_image(frame.image)
