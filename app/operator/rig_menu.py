"""The Rig menu: choose a rig or a camera, make a new rig, calibrate the present one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QFileDialog, QMenu

from app.operator.engine_thread import EnginePhase
from app.operator.rig_engine import quick_sight
from app.operator.window import OperatorWindow
from app.ui.actions import MenuEntry, add_menu
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import ask_path
from app.ui.texts import rig_line
from core.config.calibration import CalibrationConfig, PortConfig
from core.config.models import Config
from core.config.rig_file import ListedRig, RigFileError, calibration_of, find_rig, list_rigs, set_port, with_rig
from core.control.modes import ARMED_MODES, Mode
from core.devices import UserError
from core.types import Frame, Point, Scene
from hardware.cameras.registry import FoundCamera
from hardware.rig import RigKind, find_devices, kind_of, with_camera, with_source

if TYPE_CHECKING:
    from app.rig_wizard.model import MakeSight, OpenBench
    from app.rig_wizard.wizard import RigWizard
    from hardware.calibration.bench import CalibrationBench

_CLOSING = mark("Waiting for the wizard to give camera and servos back; where a driver hangs, start the program again")
_SLOW_MS = 3000
_LENT = mark("the rig wizard has camera and servos; the rig is opened again when it is closed")


@dataclass(frozen=True, slots=True)
class _WizardRequest:
    """What the wizard begins with, once the rig is free."""

    name: str
    config: Config
    known: CalibrationConfig | None
    order: int = 0


def _open_bench(config: Config, perceive: Callable[[Frame], Scene]) -> CalibrationBench:
    from hardware.calibration.bench import open_bench  # loads what only a wizard needs

    return open_bench(config, perceive)


class RigMenuController(QObject):
    """Lives as long as the window.

    Parameters
    ----------
    window : gets the menu; the chosen rig is opened in it.
    open_bench, make_sight : what the wizard works with.
    """

    def __init__(self, window: OperatorWindow, open_bench: OpenBench | None = None, make_sight: MakeSight = quick_sight) -> None:
        super().__init__(window)
        self._window, self._rig = window, window.rig
        self._open_bench, self._make_sight = open_bench or _open_bench, make_sight
        self._request: _WizardRequest | None = None
        self._saved = ""
        self.wizard: RigWizard | None = None
        self._closing: RigWizard | None = None
        new = add_menu(
            window,
            tr("Ri&g"),
            [
                MenuEntry(tr("&New rig..."), self.new),
                MenuEntry(tr("&Calibrate..."), self.calibrate),
                MenuEntry(tr("Set the insertion &port..."), self.ask_port),
                MenuEntry(tr("&Forget the insertion port"), self.forget_port),
            ],
        )[0]
        add_menu(
            window,
            tr("&File"),
            [
                MenuEntry(
                    tr("Open a picture or &video..."), partial(self.ask_source, QFileDialog.FileMode.ExistingFile), ("Ctrl+O",)
                ),
                MenuEntry(tr("Open a &folder of pictures..."), partial(self.ask_source, QFileDialog.FileMode.Directory)),
            ],
        )
        window.source_chosen.connect(self.choose_source)
        self._menu = next(one for one in new.associatedObjects() if isinstance(one, QMenu))
        self._menu.setToolTipsVisible(True)
        self._group = QActionGroup(self)
        self._rigs: list[QAction] = []
        self._cameras = QMenu(tr("C&amera"), self._menu)
        self._menu.addMenu(self._cameras)
        self._menu.addSeparator()
        self._menu.aboutToShow.connect(self.update_entries)
        self._cameras.aboutToShow.connect(self._update_cameras)
        self._rig.phase_changed.connect(self._on_phase)
        window.panels.servos.search_asked.connect(self.calibrate)
        self._rig.add_borrower(self.stop)
        self.update_entries()

    @property
    def entries(self) -> list[str]:
        """The rigs as they are listed."""
        return [action.text() for action in self._rigs]

    def stop(self) -> bool:
        """STOP while the wizard has the servos; False: it moves none. From any thread."""
        wizard = self.wizard or self._closing
        return wizard is not None and wizard.model.stop()

    def close(self) -> None:
        """The program ends: the wizard gives back what it has, and opens no rig again."""
        wizard, self.wizard, self._closing = self.wizard or self._closing, None, None
        if wizard is not None:
            wizard.finished.disconnect(self._on_finished)
            wizard.model.closed.disconnect(self._on_closed)
            wizard.reject()
            wizard.model.wait_closed()

    # ---- the menu

    def update_entries(self) -> None:
        """List the rigs: the wizard or an editor may have made one meanwhile."""
        for action in self._rigs:
            self._menu.removeAction(action)
            action.deleteLater()
        self._rigs = [self._rig_action(rig) for rig in list_rigs()]

    def _rig_action(self, rig: ListedRig) -> QAction:
        action = QAction(rig.name.replace("&", "&&"), self._menu, checkable=True)
        action.setChecked(self._rig.config.rig.file == str(rig.path))
        action.setEnabled(rig.rig is not None)
        action.setToolTip(rig_line(rig.rig) if rig.rig is not None else rig.problem)
        action.triggered.connect(partial(self.choose, rig.name))
        self._group.addAction(action)
        self._menu.addAction(action)
        return action

    def _update_cameras(self) -> None:
        """List the cameras, unless none may be chosen: a search may block the window so long that the robot is disarmed."""
        self._cameras.clear()
        if why := self.hindrance():
            self._cameras.addAction(tr("The rig stays as it is: {why}", why=why)).setEnabled(False)
            return
        for camera in find_devices().cameras:
            self._cameras.addAction(tr_text(camera.title).replace("&", "&&"), partial(self.choose_camera, camera))

    # ---- choosing

    def choose(self, name: str, _checked: bool = False) -> None:
        def chosen(config: Config) -> Config:
            path, rig = find_rig(name)
            return with_rig(config, rig, path)

        self._use(chosen)
        self.update_entries()

    def choose_camera(self, camera: FoundCamera) -> None:
        """Another camera in the present rig; what was calibrated with the old one does not hold good for it."""
        self._use(lambda config: with_camera(config, camera))

    def ask_source(self, mode: QFileDialog.FileMode) -> None:
        """Ask for a picture, video or folder of pictures to look at instead of the rig's camera."""
        ask_path(self._window, tr("Look at pictures instead of the camera's"), Path(), self.choose_source, mode)

    def choose_source(self, path: Path) -> None:
        """Look at a picture, video or folder of pictures; the menu Rig leads back to a rig."""
        self._use(lambda config: with_source(config, path))

    def _use(self, changed: Callable[[Config], Config]) -> None:
        """Open the rig of the changed configuration, or say why not."""
        if why := self.hindrance():
            self._refuse(why)
            return
        try:
            config = changed(self._rig.config)
        except UserError as error:
            self._refuse(str(error))
        else:
            self._rig.use_config(config)

    def hindrance(self) -> str:
        """Why neither rig nor camera may be taken away now; "" when they may."""
        view = self._window.controls.view
        if view is not None and view.mode in ARMED_MODES:
            return tr("the robot is armed: disarm it first")
        if view is not None and (view.mode is Mode.STOPPED or view.latched is not None):
            return tr("a stop or fault is not acknowledged: acknowledge it first")
        if view is not None and view.busy:
            return tr("wait: {what}", what=tr_text(view.busy))
        if self._window.recorder.status.recording:
            return tr("a session is being recorded: end it first")
        if self._closing is not None:
            return tr(_CLOSING)
        return ""

    def _refuse(self, why: str) -> None:
        self._window.say(tr("The rig stays as it is: {why}", why=why), is_fault=True)
        self.update_entries()

    # ---- the insertion port

    def ask_port(self) -> None:
        """The next click into the picture is where the robot is inserted: that end of it is its tail."""
        if self._rig_path() is not None:
            self._window.ask_for_place(self._set_port)
            self._window.say(tr("Click where the robot is inserted; Esc leaves it as it is"))

    def forget_port(self) -> None:
        self._keep_port(None, tr("The insertion port is forgotten"))

    def _set_port(self, place: Point) -> None:
        tick = self._window.last_tick
        if tick is None:
            return
        width, height = tick.scene.source_size
        x, y = (min(1.0, max(0.0, value / (size - 1))) for value, size in zip(place, (width, height), strict=True))
        said = tr("The insertion port is at {x:.0f}, {y:.0f} px from now on", x=place[0], y=place[1])
        self._keep_port(PortConfig(x_share=x, y_share=y), said)

    def _keep_port(self, port: PortConfig | None, said: str) -> None:
        path = self._rig_path()
        if path is None:
            return
        try:
            set_port(path, port)
        except RigFileError as error:
            self._refuse(str(error))
            return
        self._window.preview(self._rig.config.perception)
        self._window.say(said)

    def _rig_path(self) -> Path | None:
        """The rig file that keeps the port; None, said, without one or the robot is in use."""
        file = self._rig.config.rig.file
        why = self.hindrance() if file is not None else tr("it has no file: save one first (menu Rig, New rig)")
        if why:
            self._refuse(why)
        return Path(file) if file is not None and not why else None

    # ---- the wizard

    def new(self) -> None:
        """Make a rig, beginning with what is configured."""
        config = self._rig.config
        self._begin("", config.model_copy(update={"rig": config.rig.model_copy(update={"file": None})}), None)

    def calibrate(self) -> None:
        """Calibrate the present rig again, or make one of it."""
        config = self._rig.reread_config()  # or the wizard would save the file's old servos
        try:
            known = calibration_of(config)
        except RigFileError as error:
            self._refuse(str(error))
            return
        self._begin(config.rig.name if config.rig.file is not None else "", config, known)

    def _begin(self, name: str, config: Config, known: CalibrationConfig | None) -> None:
        if self.wizard is not None or self._request is not None:
            return
        why = self.hindrance()
        if kind_of(config.rig) is RigKind.PLAYBACK:
            why = tr("a recording is played: start with a camera or the twin")
        elif config.servos.driver != "dynamixel" and config.rig.robot != "none":
            why = tr("the wizard knows DYNAMIXEL servos only: write the ids and signs of the joints into the rig file")
        if why:
            self._refuse(why)
            return
        self._rig.lend(_LENT)
        self._request = _WizardRequest(name, config, known, self._rig.orders)

    def _on_phase(self, phase: EnginePhase) -> None:
        request = self._request
        if request is None or phase is EnginePhase.STARTING:
            return
        if self._rig.orders != request.order:  # another order came in between: F5, a phantom, a model
            self._request = None
            self._window.say(tr("The rig was opened again meanwhile; ask for the wizard again"), is_fault=True)
        elif self._is_lent(phase):  # and not what became of the rig before
            self._request = None
            QTimer.singleShot(0, partial(self._show, request))

    def _is_lent(self, phase: EnginePhase) -> bool:
        return phase is EnginePhase.FAULT and self._rig.message == _LENT

    def _show(self, request: _WizardRequest) -> None:
        from app.rig_wizard.model import RigWizardModel  # few starts of the window need it
        from app.rig_wizard.wizard import RigWizard

        desk = RigWizardModel(request.config, request.known, self._open_bench, self._make_sight)
        wizard = RigWizard(desk, request.name, self._window)
        wizard.saved.connect(self._on_saved)
        wizard.finished.connect(self._on_finished)
        desk.closed.connect(self._on_closed)
        self.wizard = wizard
        self._window.panels.mode_bar.stop.setEnabled(False)
        wizard.show()

    def _on_saved(self, name: str) -> None:
        self._saved = name

    def _on_finished(self, _result: int) -> None:
        self._closing, self.wizard = self.wizard, None
        self._window.panels.mode_bar.stop.setEnabled(True)
        QTimer.singleShot(_SLOW_MS, self._report_slow)

    def _report_slow(self) -> None:
        if self._closing is not None:
            self._window.say(tr(_CLOSING), is_fault=True)

    def _on_closed(self) -> None:
        """Camera and servos are free: the rig is opened again."""
        wizard, self._closing = self._closing, None
        if wizard is not None:
            wizard.deleteLater()
        saved, self._saved = self._saved, ""
        if saved:
            self._window.say(tr("Rig {name} saved", name=saved))
        if self._is_lent(self._rig.phase):  # or another rig was opened meanwhile, and may be recording or driving
            if saved:
                self.choose(saved)
            else:
                self._rig.use_config(self._rig.config)
        self.update_entries()
