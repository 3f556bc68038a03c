"""The Rig menu: choose a rig or a camera, make a new rig, calibrate the present one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from PySide6.QtCore import QObject, QTimer, Slot
from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu

from app.engine_thread import Phase
from app.menus import MenuEntry, add_menu
from app.operator_window import OperatorWindow
from app.rig_command import describe, quick_sight
from app.rig_wizard import RigWizard
from app.wizard_desk import MakeSight, OpenBench, WizardDesk
from core.calibration_config import CalibrationConfig
from core.config import Config
from core.control.modes import ARMED_MODES, Mode
from core.rig_file import ListedRig, RigFileError, calibration_of, find_rig, list_rigs, with_rig
from hardware.rig import RigKind, kind_of
from hardware.rig_search import FoundCamera, search, with_camera

_LENT = "the rig wizard has camera and servos; the rig is opened again when it is closed"


@dataclass(frozen=True, slots=True)
class _Wish:
    """What the wizard is to begin with, once the rig is free."""

    name: str
    config: Config
    known: CalibrationConfig | None


def _open_bench(config: Config, see: Callable) -> object:  # type: ignore[type-arg]
    from hardware.calibration_bench import open_bench

    return open_bench(config, see)


class RigDesk(QObject):
    """Lives as long as the window.

    Parameters
    ----------
    window : gets the menu; a rig of its kind (twin, live) is opened in it.
    switch : opens a rig of another kind by its name, in a window of its own; this one is closed by it.
    open_bench, make_sight : what the wizard works with.
    """

    def __init__(
        self,
        window: OperatorWindow,
        switch: Callable[[str], None],
        open_bench: OpenBench = _open_bench,  # type: ignore[assignment]
        make_sight: MakeSight = quick_sight,
    ) -> None:
        super().__init__(window)
        self._window, self._switch = window, switch
        self._open_bench, self._make_sight = open_bench, make_sight
        self._wish: _Wish | None = None
        self._saved = ""
        self.wizard: RigWizard | None = None
        new, _ = add_menu(window, "Ri&g", [MenuEntry("&New rig...", self.new), MenuEntry("&Calibrate...", self.calibrate)])
        self._menu = next(one for one in new.associatedObjects() if isinstance(one, QMenu))
        self._menu.setToolTipsVisible(True)
        self._group = QActionGroup(self)
        self._rigs: list[QAction] = []
        self._cameras = QMenu("C&amera", self._menu)
        self._menu.addMenu(self._cameras)
        self._menu.addSeparator()
        self._menu.aboutToShow.connect(self.renew)
        self._cameras.aboutToShow.connect(self._renew_cameras)
        window.phase_changed.connect(self._on_phase)
        self.renew()

    @property
    def entries(self) -> list[str]:
        """The rigs as they are listed."""
        return [action.text() for action in self._rigs]

    @Slot()
    def stop(self) -> None:
        """STOP while the wizard has the servos; from any thread."""
        wizard = self.wizard
        if wizard is not None:
            wizard.desk.stop()

    @Slot()
    def close(self) -> None:
        """The program ends: the wizard gives back what it has, and opens no rig again."""
        wizard, self.wizard = self.wizard, None
        if wizard is not None:
            wizard.finished.disconnect(self._on_finished)
            wizard.reject()

    # ---- the menu

    @Slot()
    def renew(self) -> None:
        """List the rigs anew: the wizard, or somebody with an editor, may have made one."""
        for action in self._rigs:
            self._menu.removeAction(action)
            action.deleteLater()
        self._rigs = [self._rig_action(rig) for rig in list_rigs()]

    def _rig_action(self, rig: ListedRig) -> QAction:
        action = QAction(rig.name.replace("&", "&&"), self._menu)
        action.setCheckable(True)
        action.setChecked(self._window.config.rig.file == str(rig.path))
        action.setEnabled(rig.rig is not None)
        action.setToolTip(describe(rig.rig) if rig.rig is not None else rig.problem)
        action.triggered.connect(partial(self.choose, rig.name))
        self._group.addAction(action)
        self._menu.addAction(action)
        return action

    @Slot()
    def _renew_cameras(self) -> None:
        self._cameras.clear()
        for camera in search().cameras:
            self._cameras.addAction(camera.title.replace("&", "&&"), partial(self.choose_camera, camera))

    # ---- choosing

    def choose(self, name: str, _checked: bool = False) -> None:
        """Open a rig by its name."""
        if why := self.hindrance():
            self._refuse(why)
            return
        try:
            path, rig = find_rig(name)
        except RigFileError as error:
            self._refuse(str(error))
            return
        config = with_rig(self._window.config, rig, path)
        if kind_of(config.rig) is kind_of(self._window.config.rig):
            self._window.use_config(config)
            self.renew()
        else:
            self._switch(rig.name)

    def choose_camera(self, camera: FoundCamera) -> None:
        """Another camera in the present rig; what was calibrated with the old one does not hold good for it."""
        if why := self.hindrance():
            self._refuse(why)
            return
        config = with_camera(self._window.config, camera)
        if kind_of(config.rig) is kind_of(self._window.config.rig):
            self._window.use_config(config)
        else:
            self._switch(camera.kind)

    def hindrance(self) -> str:
        """Why neither rig nor camera may be taken away now; "" when they may."""
        view = self._window.desk.view
        if view is not None and view.mode in ARMED_MODES:
            return "the robot is armed: disarm it first"
        if view is not None and (view.mode is Mode.STOPPED or view.latched is not None):
            return "a stop or fault is not acknowledged: acknowledge it first"
        if view is not None and view.busy:
            return f"wait: {view.busy}"
        if self._window.recorder.status.recording:
            return "a session is being recorded: end it first"
        return ""

    def _refuse(self, why: str) -> None:
        self._window.say(f"The rig stays as it is: {why}", is_fault=True)
        self.renew()

    # ---- the wizard

    @Slot()
    def new(self) -> None:
        """Make a rig, beginning with what is configured."""
        config = self._window.config
        self._begin("", config.model_copy(update={"rig": config.rig.model_copy(update={"file": None})}), None)

    @Slot()
    def calibrate(self) -> None:
        """Calibrate the present rig once more, or make one of it."""
        config = self._window.config
        try:
            known = calibration_of(config)
        except RigFileError as error:
            self._refuse(str(error))
            return
        self._begin(config.rig.name if config.rig.file is not None else "", config, known)

    def _begin(self, name: str, config: Config, known: CalibrationConfig | None) -> None:
        if self.wizard is not None or self._wish is not None:
            return
        why = self.hindrance()
        if kind_of(config.rig) is RigKind.PLAYBACK:
            why = "a recording is played: start with a camera or the twin"
        if why:
            self._refuse(why)
            return
        self._wish = _Wish(name, config, known)
        self._window.lend(_LENT)

    @Slot(object)
    def _on_phase(self, phase: Phase) -> None:
        if phase is Phase.FAULT and self._wish is not None and self.wizard is None:
            wish, self._wish = self._wish, None
            QTimer.singleShot(0, partial(self._show, wish))

    def _show(self, wish: _Wish) -> None:
        desk = WizardDesk(wish.config, wish.known, self._open_bench, self._make_sight)
        wizard = RigWizard(desk, wish.name, self._window)
        wizard.saved.connect(self._on_saved)
        wizard.finished.connect(self._on_finished)
        self.wizard = wizard
        wizard.show()

    @Slot(str)
    def _on_saved(self, name: str) -> None:
        self._saved = name

    @Slot(int)
    def _on_finished(self, _result: int) -> None:
        wizard, self.wizard = self.wizard, None
        if wizard is not None:
            wizard.deleteLater()
        saved, self._saved = self._saved, ""
        if saved:
            self._window.say(f"Rig {saved} saved")
            self.choose(saved)
        else:
            self._window.use_config(self._window.config)
        self.renew()
