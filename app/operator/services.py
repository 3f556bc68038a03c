"""What the operator window does beside driving: sessions, checks, models, training, crashes, tour."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import platformdirs
from PySide6.QtCore import QObject, QSettings, Qt, QTimer, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QFileDialog, QMessageBox

from app.annotator.sources import REFUSED, default_store
from app.operator.awake import AwakeInhibitor, must_stay_awake
from app.operator.engine_thread import EnginePhase
from app.operator.models import ModelMenu
from app.operator.preflight import PreflightModel
from app.operator.preflight_list import PreflightList
from app.operator.recording import AfterSession, DescriptionController, RecoveryController
from app.operator.rig_engine import leaving_a_core
from app.operator.rig_session import StopOutcome
from app.operator.window import OperatorWindow
from app.ui.actions import MenuEntry, add_menu
from app.ui.crash_report import Crash, CrashWatch, crash_of_last_run
from app.ui.i18n import mark, tr
from app.ui.opening import ask_path, open_file
from app.ui.texts import OperatorStep
from app.widgets.messages import Offer, OfferButton
from core.annotation.store import DEFAULT_NAME
from core.config.models import sessions_folder
from core.config.rig_file import RigFileError, calibration_of, set_bench
from core.control.modes import ARMED_MODES, Mode
from core.perception.model_file import BENCH, own_models
from core.perception.quality import UNKNOWN_KIND
from core.session.writer import RecordStatus
from core.types import Frame, Reason, Refusal
from hardware.rig import RigKind, kind_of
from hardware.twin.catalog import look_of

if TYPE_CHECKING:
    from app.teaching.window import TeachingWindow
    from app.training.dialog import TrainingDialog
    from core.config.models import Config, PerceptionConfig
    from core.learning.teaching import Segment

_SEARCH_AFTER_MS = 1500
"""The rig is opened first; a search must not delay that."""
_CRASH = "crash"
_TAUGHT = "taught"
_FAMILIARITY_EVERY_MS = 1000
_CHECKS_EVERY_MS = 1000
"""How often the bar is told what the checks say: the state of the open rig, and their age, change without a signal."""
_UNFAMILIAR_S = 5
"""Pictures that are refused for so long as unlike the training data are not a hand that passes."""


class WindowServices(QObject):
    """What the operator window does beside driving; all work is done in threads and processes of their own.

    Parameters
    ----------
    window : not started yet.
    state : folder of what the program keeps between runs.
    watch : calls ``make_safe`` at an unforeseen error; installed and removed by its owner.
    """

    _crashed = Signal(object)
    _stopped_again = Signal()

    def __init__(self, window: OperatorWindow, state: Path, watch: CrashWatch | None = None) -> None:
        super().__init__(window)
        self._window, self._state = window, state
        offers = self._offers = window.panels.offers
        self.after = AfterSession(offers, window.others, parent=self)
        self.descriptions = DescriptionController(window, window.recorder)
        self.recovery = RecoveryController(
            sessions_folder(window.rig.config.record.folder), offers, state / "not_to_recover.json", self
        )
        self.preflight = PreflightModel(lambda: window.rig.config, lambda: window.controls.view, self)
        self.awake = AwakeInhibitor(self)
        self.checks = PreflightList(self.preflight, window, window.panels.mode_bar.stop)
        self.models = ModelMenu(
            window, offers, self._model, self._against_another_model, self._cost_of_another_model, self.teach, self.train
        )
        self.training: TrainingDialog | None = None
        self.teaching: TeachingWindow | None = None
        self._still_writing: list[Callable[[], bool]] = []
        """Each waits until a teaching that was left has written all."""
        self._taught = ""
        self._unfamiliar_s = 0
        self._was_offered: set[str] = set()
        self._familiarity = QTimer(self, interval=_FAMILIARITY_EVERY_MS)
        self._familiarity.timeout.connect(self._look_for_unfamiliar)
        self._check_state = QTimer(self, interval=_CHECKS_EVERY_MS)
        self._check_state.timeout.connect(self._show_checks)
        self.preflight.changed.connect(self._show_checks)
        self._saved: Path | None = None
        self._is_recording = False
        self._stopped = StopOutcome.UNKNOWN
        self._wire()
        self._add_menus()
        if watch is not None:
            watch.on_error, watch.on_report = self.make_safe, self._crashed.emit
            # also from the window's own thread not before the slot that failed has returned
            self._crashed.connect(self._show_crash, Qt.ConnectionType.QueuedConnection)
            self._stopped_again.connect(self._report_stopped_again, Qt.ConnectionType.QueuedConnection)

    def _wire(self) -> None:
        window = self._window
        for part in (window.others, self.after, self.descriptions, self.recovery, self.models):
            part.said.connect(window.say)
        self.after.describe_asked.connect(self.descriptions.ask)
        self.recovery.recovered.connect(self.after.offer)
        window.recorder.changed.connect(self._on_recording)
        window.rig.phase_changed.connect(self._on_phase)
        window.rig.add_guard(self.preflight.may_ask)
        window.rig.add_config_source(self._without_other_bench)
        self.preflight.asked.connect(self._on_not_armed)
        self.awake.failed.connect(window.say)
        self.checks.arm_asked.connect(partial(window.ask_step, OperatorStep.ARM))
        self.models.chosen.connect(self._use_model)

    def _add_menus(self) -> None:
        window = self._window
        annotate = window.others.annotate
        session = [
            MenuEntry(tr("Session &library"), self._open_library, ("Ctrl+L",)),
            MenuEntry(tr("Describe the &next recordings..."), self.descriptions.ask_for_next),
            MenuEntry(tr("&Describe the newest session..."), partial(self._with_newest, self.descriptions.ask)),
            None,
            MenuEntry(tr("&Annotate the newest session"), partial(self._with_newest, annotate)),
            MenuEntry(tr("Annotate its &refused frames"), partial(self._with_newest, partial(annotate, rows=REFUSED))),
            MenuEntry(tr("&Evaluate the newest session"), partial(self._with_newest, self.after.evaluate)),
            MenuEntry(tr("&Play the newest session"), partial(self._with_newest, window.others.play)),
            MenuEntry(tr("&Open another session..."), self._choose_session),
            None,
            MenuEntry(tr("Look for &cut sessions"), partial(self.recovery.search, again=True)),
        ]
        add_menu(window, tr("&Session"), session)
        add_menu(window, tr("&Robot"), [MenuEntry(tr("Chec&ks before driving..."), self.checks.open_list, ("F2",))])

    def start(self) -> None:
        """Offer what the last run left: cut sessions, a crash report."""
        QTimer.singleShot(_SEARCH_AFTER_MS, self, self.recovery.search)
        self._familiarity.start()
        self._check_state.start()
        crash = crash_of_last_run(self._state / "crashes")
        if crash is not None and crash.report is not None:
            self._offer_report(tr("The last run of the program crashed"), crash)

    def close(self) -> None:
        for part in (self.recovery, self.preflight, self.after, self.descriptions):
            part.close()
        self.checks.close()
        self.awake.close()
        self._familiarity.stop()
        self._check_state.stop()
        if self.training is not None:
            self.training.end()
        if self.teaching is not None:
            self.teaching.end()
            self._still_writing.append(self.teaching.model.wait)
        for wait in self._still_writing:
            wait()

    # ---- sessions

    def _on_recording(self, status: RecordStatus) -> None:
        if status.recording and not self._is_recording:
            self.after.withdraw()
        self._is_recording = status.recording
        if status.saved is not None and status.saved != self._saved:
            self._saved = status.saved
            if not status.recording:
                asks_who = not self._window.recorder.description.operator
                text = mark("Session saved. Who recorded it?") if asks_who else mark("Session saved")
                self.after.offer(status.saved, text, asks_who=asks_who)

    def _with_newest(self, step: object) -> None:
        session = self.after.session
        if session is None:
            self._window.say(tr("No session yet: F9 records one"), False)
        elif callable(step):
            step(session)

    def _open_library(self) -> None:
        self._window.others.open_library(sessions_folder(self._window.rig.config.record.folder))

    def _choose_session(self) -> None:
        folder = sessions_folder(self._window.rig.config.record.folder)
        offer = partial(self.after.offer, text=tr("Session"))
        ask_path(self._window, tr("A recorded session"), folder, offer, QFileDialog.FileMode.Directory)

    # ---- before driving

    def _on_phase(self, phase: EnginePhase) -> None:
        if phase is EnginePhase.RUNNING:
            self.preflight.begin_soon()

    def _show_checks(self) -> None:
        """The bar and the list of checks say the same; the computer stays awake while real servos follow."""
        self.awake.hold(must_stay_awake(self._window.rig.kind, self._window.controls.view))
        self._window.panels.mode_bar.set_against(OperatorStep.ARM, self.preflight.preflight.step)

    def _on_not_armed(self, line: str) -> None:
        self._window.say(line, True)
        self.checks.open_list()

    # ---- models

    def _model(self) -> str:
        return self._window.rig.config.perception.segmentation.model

    def _against_another_model(self) -> str:
        view = self._window.controls.view
        if view is not None and view.mode in ARMED_MODES:
            return tr("the program is armed; disarm first (Shift+F6)")
        return ""

    def _cost_of_another_model(self) -> str:
        ends = tr(" The recording ends.") if self._is_recording else ""
        return tr(
            "The rig is opened again: no picture for some seconds, and the servos must be switched on again.{ends}", ends=ends
        )

    def _use_model(self, name: str) -> None:
        self._window.say(tr("Model {name} from now on, until the program ends", name=name), False)
        self._window.rig.use_config(_with_model(self._window.rig.config, name))

    def train(self) -> None:
        """The training that is there already, or a new one on a chosen annotation file."""
        if self.training is not None and self.training.is_busy:
            self.training.show()
            self.training.raise_()
            return
        session = self.after.session
        folder = sessions_folder(self._window.rig.config.record.folder)
        store = default_store([session]) if session is not None else folder / DEFAULT_NAME
        start = next(place for place in (store, *store.parents) if place.exists())
        filters = [tr("Annotations (*.sqlite)")]
        ask_path(self._window, tr("Annotations to train on"), start, self.open_training, filters=filters)

    def open_training(self, store: Path) -> None:
        """The dialog for an annotation file."""
        from app.training.dialog import TrainingDialog
        from app.training.model import collect_from_file

        if self.training is not None:
            self.training.end()
            self.training.deleteLater()
        self.training = TrainingDialog(partial(collect_from_file, store), str(store), self._window)
        self.training.job.installed.connect(self._on_installed)
        self.training.show()

    # ---- teaching

    def teach(self) -> None:
        """The window that teaches the bench that the camera sees, at the step where it was left."""
        from app.teaching.model import TeachingModel, teaching_folder  # loads OpenCV and statistics
        from app.teaching.window import TeachingDriver, TeachingWindow

        window = self._window
        if window.rig.kind is RigKind.PLAYBACK:
            window.say(tr("A recording is played: start with a camera or the twin, or use the command teach"), True)
            return
        bench = self._bench_name(window.rig.config)
        if self.teaching is not None and self.teaching.model.rig != bench:
            if self.teaching.model.is_training:
                self.teaching.open()
                self.teaching.say(tr("Another bench is in use; this one is being trained: wait for it, or stop it"), is_fault=True)
                return
            self.teaching.end()
            self._still_writing.append(self.teaching.model.wait)
            self.teaching.deleteLater()
            self.teaching = None
        if self.teaching is None:
            controls = window.controls
            newest = partial(self._frame_of, bench)
            config = window.rig.config
            known = partial(calibration_of, config) if window.rig.kind is RigKind.LIVE else None  # the twin has its phantom
            model = TeachingModel(teaching_folder(bench), bench, newest, partial(_open_proposals, config.perception), known=known)
            model.trained.connect(self._on_taught)
            driver = TeachingDriver(controls.drive, controls.stop, window.ask_step, lambda: controls.can_move)
            self.teaching = TeachingWindow(model, newest, driver, self._use_taught, self._is_used, window)
            controls.reported.connect(self.teaching.show_news)
            model.setParent(self.teaching)
        self.teaching.open()

    def _frame_of(self, bench: str) -> Frame | None:
        """What the camera shows now; None where it is not live, or shows another bench than that."""
        rig = self._window.rig
        if rig.kind is RigKind.PLAYBACK or self._bench_name(rig.config) != bench:
            return None
        return self._window.live_frame

    def _bench_name(self, config: Config) -> str:
        """What the camera sees: a rig, and of the twin a phantom in a look."""
        if kind_of(config.rig) is not RigKind.SIM:
            return config.rig.name
        return f"{config.rig.name}_{config.twin.phantom}_{look_of(config.twin) or config.twin.appearance_seed}"

    def _use_taught(self, name: str) -> str:
        """Use a taught model with its bench; why that cannot be done now, or ""."""
        rig = self._window.rig
        if why := self._against_another_model() or rig.work_in_progress():
            return why
        if self.teaching is not None and self.teaching.model.rig != self._bench_name(rig.config):
            return tr("another bench is in use: choose the one that was taught in the menu Rig or Twin first")
        bench, config = own_models() / name / BENCH, rig.config
        if config.rig.file is not None:
            try:
                set_bench(Path(config.rig.file), bench, name)
            except RigFileError as error:
                return str(error)
        self._taught = self._bench_name(config)
        self._window.say(tr("Model {name} and its bench from now on; the menu Model has the one before", name=name), False)
        rig.use_config(_with_model(config, name, bench=str(bench)))
        return ""

    def _is_used(self, name: str) -> bool:
        """Whether a taught model is in force, with its bench."""
        perception = self._window.rig.config.perception
        return (perception.segmentation.model, perception.bench) == (name, str(own_models() / name / BENCH))

    def _without_other_bench(self, config: Config) -> Config:
        """A taught bench is that of one rig, or of one phantom and look of the twin: another one is opened without it."""
        if not self._taught or config.perception.bench is None or self._bench_name(config) == self._taught:
            return config
        self._taught = ""
        return config.model_copy(update={"perception": config.perception.model_copy(update={"bench": None})})

    def _on_taught(self, name: str) -> None:
        """A training has ended: said where its window is hidden."""
        teaching = self.teaching
        if teaching is None or teaching.isVisible():
            return
        use = OfferButton(tr("Look at it"), teaching.open)
        self._offers.offer(Offer(_TAUGHT, tr("This bench is taught: model {name}", name=name), "", (use,)))

    def _look_for_unfamiliar(self) -> None:
        """Offer once for each bench to teach it, when its pictures are refused for long because the model does not know them."""
        window, tick = self._window, self._window.shown_tick
        refusal = tick.scene.refusal if tick is not None and window.live_frame is not None else None
        view = window.controls.view
        is_calm = view is None or view.mode not in ARMED_MODES
        is_shown = self.teaching is not None and self.teaching.isVisible()
        if refusal is None or not is_teachable(refusal) or not is_calm or is_shown or window.rig.kind is RigKind.PLAYBACK:
            self._unfamiliar_s = 0
            return
        self._unfamiliar_s += _FAMILIARITY_EVERY_MS // 1000
        bench = self._bench_name(window.rig.config)
        if self._unfamiliar_s < _UNFAMILIAR_S or bench in self._was_offered:
            return
        self._was_offered.add(bench)
        answers = (OfferButton(tr("Teach this bench"), self.teach), OfferButton(tr("Not now"), lambda: None))
        detail = tr("An empty picture, the vessel's outline and a minute of moving the robot; then five minutes of waiting.")
        self._offers.offer(Offer(_TAUGHT, tr("The model does not know such pictures"), detail, answers))

    def _on_installed(self, name: str) -> None:
        self._window.say(tr("Model {name} is installed; choose it in the Model menu", name=name), False)

    # ---- crashes

    def make_safe(self, is_first: bool = True) -> None:
        """After an unforeseen error, from any thread: the servos stop; at the first one the recording ends as a whole session.

        At later ones the operator was told and went on: only what moves is stopped.
        """
        rig = self._window.rig
        if is_first:
            self._stopped = rig.stop()
            self._window.recorder.stop("the program met an unforeseen error")
            return
        pilot = rig.pilot
        is_at_rest = pilot is not None and (not pilot.can_move or pilot.view.mode is Mode.STOPPED)
        # an error may come with every repaint, and each STOP is shown
        if not is_at_rest and rig.stop() is StopOutcome.SERVOS:
            self._stopped_again.emit()

    def _report_stopped_again(self) -> None:
        self._window.say(tr("Another unforeseen error: the servos were stopped again"), True)

    def _show_crash(self, crash: Crash) -> None:
        report = tr("The report is {report}", report=crash.report)
        where = report if crash.report is not None else tr("The report could not be written")
        text = tr("The program met an error: {what}", what=crash.what)
        box = QMessageBox(QMessageBox.Icon.Critical, tr("Unforeseen error"), text, parent=self._window)
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
        show = OfferButton(tr("Show the report"), partial(open_file, report), str(report))
        detail = tr("{what}. The report: {report}", what=crash.what, report=report)
        self._offers.offer(Offer(_CRASH, text, detail, (show,), is_fault=True))


def _with_model(config: Config, name: str, **perception: Any) -> Config:
    segmentation = config.perception.segmentation.model_copy(update={"model": name})
    perceived = config.perception.model_copy(update={"segmentation": segmentation, **perception})
    return config.model_copy(update={"perception": perceived})


_TEACHABLE = frozenset({Reason.UNLIKE_TRAINING, Reason.BENCH_MOVED, Reason.OTHER_BENCH})


def is_teachable(refusal: Refusal) -> bool:
    """Whether the picture was refused because model or bench do not fit it; also by the hint of a robot that was not found."""
    return refusal.reason in _TEACHABLE or UNKNOWN_KIND in refusal.detail


def _open_proposals(config: PerceptionConfig) -> Segment:
    """The present network in all orientations, with a core left for the rig."""
    from core.perception.inference import open_segmenter
    from core.perception.segmentation import OrientationAverage

    return OrientationAverage(open_segmenter(leaving_a_core(config).segmentation))


_SEEN = "tour/seen"
_NO_SCREEN = ("offscreen", "minimal", "vnc")
_LOOK_EVERY_MS = 300


def _settings() -> QSettings:
    folder = Path(platformdirs.user_config_dir("LumenPilot", appauthor=False))
    return QSettings(str(folder / "seen.ini"), QSettings.Format.IniFormat)


def was_seen() -> bool:
    """Whether the tour was shown to this user, skipped or not."""
    return str(_settings().value(_SEEN, "")).lower() == "true"


def mark_seen() -> None:
    """Do not show it again by itself. A folder that cannot be written is ignored."""
    settings = _settings()
    settings.setValue(_SEEN, True)
    settings.sync()


def tour_at_start(window: OperatorWindow, *, asked: bool) -> None:
    """Begin it when the first picture is there: if it was `asked` for, or at the first start on a real screen."""
    if not asked and (QGuiApplication.platformName() in _NO_SCREEN or was_seen()):
        return
    timer = QTimer(window)

    def look() -> None:
        if window.shown_tick is not None:
            timer.stop()
            mark_seen()
            window.show_tour()

    timer.timeout.connect(look)
    timer.start(_LOOK_EVERY_MS)
