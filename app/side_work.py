"""What the operator window does beside driving: cut sessions, the steps after a session, checks before arming, models, crashes."""

from __future__ import annotations

from enum import Enum
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import QFileDialog, QMessageBox

from app.after_session import AfterSession, open_file
from app.annotate_sources import default_store
from app.crash_report import Crash, CrashWatch, crash_of_last_run
from app.engine_thread import Phase
from app.language import mark, tr
from app.menus import MenuEntry, add_menu
from app.model_menu import ModelMenu
from app.next_step import Step
from app.operator_window import OperatorWindow
from app.preflight_desk import PreflightDesk
from app.recovery_desk import Declined, RecoveryDesk
from app.training_dialog import TrainingDialog
from app.training_source import collect_from_file
from app.widgets.offer_strip import Answer, Offer
from app.widgets.preflight_list import PreflightList
from core.control.modes import ARMED_MODES, Act, Mode
from core.record_config import sessions_folder
from core.session.record_status import RecordStatus

_LOOK_AFTER_MS = 1500
"""The window is open and its rig is being started; a search must not delay that."""
_CRASH = "crash"


class Stopped(Enum):
    """What the STOP after an unforeseen error has reached, in the words of its box."""

    SERVOS = mark("The servos were stopped")
    OPENING = mark("The rig that is being opened starts stopped")
    NOTHING = mark("No servos were in use, so there was nothing to stop")
    UNKNOWN = mark("It is not certain that the servos were stopped: press Space")


class SideWork(QObject):
    """Composes and wires; all work is done in threads and processes of their own.

    Parameters
    ----------
    window : not started yet.
    state : folder of what the program remembers between runs.
    watch : is told what to do at an unforeseen error; installed and removed by its owner.
    """

    _crashed = Signal(object)
    _stopped_again = Signal()

    def __init__(self, window: OperatorWindow, state: Path, watch: CrashWatch | None = None) -> None:
        super().__init__(window)
        self._window, self._state = window, state
        offers = window.panels.offers
        self._offers = offers
        self.after = AfterSession(offers, parent=self)
        self.recovery = RecoveryDesk(
            sessions_folder(window.config.record.folder), offers, Declined(state / "not_to_recover.json"), self
        )
        self.preflight = PreflightDesk(lambda: window.config, lambda: window.desk.view, self)
        self.checks = PreflightList(self.preflight, window, window.panels.mode_bar.stop)
        self.models = ModelMenu(window, offers, self._model, self._against_another_model, self._cost_of_another_model, self.train)
        self.training: TrainingDialog | None = None
        self._saved: Path | None = None
        self._is_recording = False
        self._stopped = Stopped.UNKNOWN
        self._wire()
        self._add_menus()
        if watch is not None:
            watch.on_error, watch.on_report = self.make_safe, self._crashed.emit
            # also from the window's own thread not before the slot that failed has returned
            self._crashed.connect(self._show_crash, Qt.ConnectionType.QueuedConnection)
            self._stopped_again.connect(self._tell_stopped_again, Qt.ConnectionType.QueuedConnection)

    def _wire(self) -> None:
        window = self._window
        for part in (self.after, self.recovery, self.models):
            part.said.connect(window.say)
        self.recovery.recovered.connect(self.after.offer)
        window.recorder.changed.connect(self._on_recording)
        window.phase_changed.connect(self._on_phase)
        window.may_take = self.preflight.may_take
        self.preflight.asked.connect(self._on_not_armed)
        self.checks.arm_asked.connect(partial(window.take, Step.ARM))
        self.models.chosen.connect(self._use_model)

    def _add_menus(self) -> None:
        window = self._window
        session = [
            MenuEntry(tr("&Evaluate the newest session"), partial(self._with_newest, self.after.evaluate)),
            MenuEntry(tr("&Annotate the newest session"), partial(self._with_newest, self.after.annotate)),
            MenuEntry(tr("&Play the newest session"), partial(self._with_newest, self.after.play)),
            MenuEntry(tr("&Open another session..."), self._choose_session),
            None,
            MenuEntry(tr("Look for &cut sessions"), partial(self.recovery.look, again=True)),
        ]
        add_menu(window, tr("&Session"), session)
        add_menu(window, tr("&Robot"), [MenuEntry(tr("Chec&ks before driving..."), self.checks.open_list, ("F2",))])

    def start(self) -> None:
        """Look for what the last run left behind."""
        QTimer.singleShot(_LOOK_AFTER_MS, self, self.recovery.look)
        crash = crash_of_last_run(self._state / "crashes")
        if crash is not None and crash.report is not None:
            self._offer_report(tr("The last run of the program crashed"), crash)

    def close(self) -> None:
        """The window closes."""
        for part in (self.recovery, self.preflight, self.after):
            part.close()
        self.checks.close()
        if self.training is not None:
            self.training.end()

    # ---- sessions

    def _on_recording(self, status: RecordStatus) -> None:
        if status.recording and not self._is_recording:
            self.after.withdraw()
        self._is_recording = status.recording
        if status.saved is not None and status.saved != self._saved:
            self._saved = status.saved
            if not status.recording:
                self.after.offer(status.saved)

    def _with_newest(self, step: object) -> None:
        session = self.after.session
        if session is None:
            self._window.say(tr("No session yet: F9 records one"), False)
        elif callable(step):
            step(session)

    def _choose_session(self) -> None:
        folder = sessions_folder(self._window.config.record.folder)
        dialog = QFileDialog(self._window, tr("A recorded session"), str(folder))
        dialog.setFileMode(QFileDialog.FileMode.Directory)
        dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
        dialog.fileSelected.connect(lambda path: self.after.offer(Path(path), tr("Session")))
        dialog.finished.connect(dialog.deleteLater)
        dialog.show()  # not open(): the STOP button must stay within reach

    # ---- before driving

    def _on_phase(self, phase: Phase) -> None:
        if phase is Phase.RUNNING:
            self.preflight.begin_soon()

    def _on_not_armed(self, line: str) -> None:
        self._window.say(line, True)
        self.checks.open_list()

    # ---- models

    def _model(self) -> str:
        return self._window.config.perception.segmentation.model

    def _against_another_model(self) -> str:
        view = self._window.desk.view
        if view is not None and view.mode in ARMED_MODES:
            return tr("the program is armed; disarm first (Shift+F6)")
        return ""

    def _cost_of_another_model(self) -> str:
        ends = tr(" The recording ends.") if self._is_recording else ""
        return tr("The rig is opened anew: no picture for some seconds, and the servos must be switched on again.{ends}", ends=ends)

    def _use_model(self, name: str) -> None:
        config = self._window.config
        segmentation = config.perception.segmentation.model_copy(update={"model": name})
        perception = config.perception.model_copy(update={"segmentation": segmentation})
        self._window.say(tr("Model {name} from now on, until the program ends", name=name), False)
        self._window.use_config(config.model_copy(update={"perception": perception}))

    def train(self) -> None:
        """The training that is there already, or a new one on a chosen annotation file."""
        if self.training is not None and self.training.is_busy:
            self.training.show()
            self.training.raise_()
            return
        session = self.after.session
        start = default_store([session]).parent if session is not None else sessions_folder(self._window.config.record.folder)
        dialog = QFileDialog(self._window, tr("Annotations to train on"), str(start), tr("Annotations (*.sqlite)"))
        dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
        dialog.fileSelected.connect(lambda path: self.open_training(Path(path)))
        dialog.finished.connect(dialog.deleteLater)
        dialog.show()

    def open_training(self, store: Path) -> None:
        """The dialog for an annotation file."""
        if self.training is not None:
            self.training.end()
            self.training.deleteLater()
        self.training = TrainingDialog(partial(collect_from_file, store), str(store), self._window)
        self.training.job.installed.connect(self._on_installed)
        self.training.show()

    def _on_installed(self, name: str) -> None:
        self._window.say(tr("Model {name} is installed; choose it in the Model menu", name=name), False)

    # ---- crashes

    def make_safe(self, is_first: bool = True) -> None:
        """After an unforeseen error, from any thread: the servos stop, and at the first one the recording ends as a whole session.

        Later ones find an operator who was told and went on: they stop what he drives.
        """
        if is_first:
            self._stopped = self._stop_whoever_moves()
            self._window.recorder.stop("the program met an unforeseen error")
        elif not self._is_at_rest() and self._stop_whoever_moves() is Stopped.SERVOS:
            self._stopped_again.emit()

    def _is_at_rest(self) -> bool:
        """Whether the rig would not move anyway: an error may come with every repaint, and each STOP is told."""
        pilot = self._window.pilot
        return pilot is not None and (not pilot.can_move or pilot.view.mode is Mode.STOPPED)

    def _stop_whoever_moves(self) -> Stopped:
        """STOP to the rig's pilot, to a rig that is being opened, and to whoever the rig is lent to."""
        window = self._window
        before = window.pilot
        if before is not None:
            before.ask(Act.STOP)
        is_opening, is_lent = window.stop_opening(), window.stop_lent()
        pilot = window.pilot
        if pilot is not None and pilot is not before:  # opened between the questions
            pilot.ask(Act.STOP)
        if before is not None or pilot is not None or is_lent:
            return Stopped.SERVOS
        return Stopped.OPENING if is_opening else Stopped.NOTHING

    def _tell_stopped_again(self) -> None:
        self._window.say(tr("Another unforeseen error: the servos were stopped again"), True)

    def _show_crash(self, crash: Crash) -> None:
        where = (
            tr("The report is {report}", report=crash.report) if crash.report is not None else tr("The report could not be written")
        )
        box = QMessageBox(
            QMessageBox.Icon.Critical,
            tr("Unforeseen error"),
            tr("The program met an error: {what}", what=crash.what),
            parent=self._window,
        )
        box.setInformativeText(
            tr(
                "{stopped}. A recording that ran was ended and is whole.\n\n{where}.\n\nBest close the program "
                "and start it again. Space is still STOP.",
                stopped=tr(self._stopped.value),
                where=where,
            )
        )
        leave = box.addButton(tr("Close the program"), QMessageBox.ButtonRole.AcceptRole)
        if crash.report is not None:
            show = box.addButton(tr("Show the report"), QMessageBox.ButtonRole.ActionRole)
            show.clicked.disconnect()  # it answers nothing: the box stays
            show.clicked.connect(partial(open_file, crash.report))
        box.addButton(tr("Go on"), QMessageBox.ButtonRole.RejectRole)
        box.setDefaultButton(leave)
        box.setModal(False)
        box.buttonClicked.connect(lambda button: self._window.close() if button is leave else None)
        box.finished.connect(box.deleteLater)
        box.show()

    def _offer_report(self, text: str, crash: Crash) -> None:
        report = crash.report
        assert report is not None
        show = Answer(tr("Show the report"), partial(open_file, report), str(report))
        self._offers.offer(
            Offer(_CRASH, text, tr("{what}. The report: {report}", what=crash.what, report=report), (show,), is_fault=True)
        )
