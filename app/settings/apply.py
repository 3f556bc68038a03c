"""Settings of the operator window: opens the dialog, tries thresholds on the picture, saves, and says when a setting acts.

Nothing changes while the robot is armed or a session is being recorded; the robot cannot be armed while settings are tried out.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QApplication

from app.operator.engine_thread import EnginePhase
from app.operator.window import OperatorWindow
from app.settings.dialog import SettingsDialog
from app.settings.draft import SettingsDraft, with_changes
from app.ui import theme
from app.ui.actions import LanguageMenu, MenuEntry, add_menu, next_start_text
from app.ui.i18n import font_problem, tr, tr_text, wanted
from app.ui.texts import OperatorStep
from app.ui.workers import Worker
from core.config.files import SettingsFile, write_settings
from core.config.models import Config, ConfigError, PerceptionConfig
from core.config.rig_file import RigFileError, read_again
from core.config.schema import Effect, with_value
from core.control.modes import ARMED_MODES
from core.types import Frame, Point, Scene

PerceiveAgain = Callable[[Frame, Point | None, PerceptionConfig], Scene | None]

_UPDATE_EVERY_MS = 100
_NOW = frozenset({Effect.NOW})
_AT_START = frozenset({Effect.NOW, Effect.RIG})


class SettingsController(QObject):
    """Lives as long as the window.

    Parameters
    ----------
    window : gets the menu entry, and what is changed.
    file : the settings that the window was opened with, and where they are saved.
    perceive_again : perceives the last frame of a rig that is over under other thresholds; slow.
    """

    def __init__(self, window: OperatorWindow, file: SettingsFile, perceive_again: PerceiveAgain) -> None:
        super().__init__(window)
        self._window, self._rig = window, window.rig
        self._file, self._perceive_again = file, perceive_again
        self._saved = self._at_rig_start = file.config
        self._saved_over: Config | None = None
        """What the window had when they were saved: a phantom or model that is chosen afterwards is the newer wish."""
        self._drafted: Config | None = None
        """The dialog's settings while some of them are tried out, else None."""
        self._wants_back = False
        self.dialog: SettingsDialog | None = None
        self._stills = Worker("preview", self, latest_only=True)
        self._stills.done.connect(self._on_still)
        self._stills.failed.connect(lambda _key, line: window.say(line, is_fault=True))
        self._timer = QTimer(self, interval=_UPDATE_EVERY_MS)
        self._timer.timeout.connect(self._update)
        add_menu(window, tr("&File"), [MenuEntry(tr("S&ettings..."), self.open, ("Ctrl+,",))])
        self._languages = LanguageMenu(window, file.config.window.language)
        self._languages.chosen.connect(self.choose_language)
        self._rig.add_config_source(self._amend)
        self._rig.add_config_source(self._read_rig_again, rereads=True)
        self._rig.add_guard(self._may_ask)
        self._rig.phase_changed.connect(self._on_phase)

    @property
    def is_trying(self) -> bool:
        """Whether the picture shows thresholds that are not saved."""
        return self._drafted is not None

    def start(self) -> None:
        """Say what was wrong with the settings file."""
        for problem in self._file.problems:
            self._window.say(tr_text(problem), is_fault=True)

    def open(self) -> None:
        if self.dialog is None:
            draft = SettingsDraft(self._saved)
            dialog = SettingsDialog(draft, self._file.path, self._file.problems, self._window)
            dialog.drafted.connect(self._on_drafted)
            dialog.save_asked.connect(self._save)
            dialog.finished.connect(self._on_finished)
            self.dialog = dialog
            self._timer.start()
            dialog.stand_beside(self._window, self._window.panels.mode_bar.stop)
            dialog.show()
        self._update()
        self.dialog.raise_()
        self.dialog.activateWindow()

    def close(self) -> None:
        """The window closes: nothing that was not saved is kept."""
        self._timer.stop()
        if self.dialog is not None:
            self.dialog.reject()
        self._stills.stop(finish=False)
        self._stills.wait()

    def choose_language(self, code: str) -> None:
        """Keep another language of the windows, for the next start of the program."""
        config = with_value(self._saved.model_dump(mode="json"), "window.language", code)
        if self.dialog is not None:
            self._window.say(tr("Save or cancel the settings first"), is_fault=True)
        elif (note := self._keep(Config.model_validate(config))) is not None:
            problem = font_problem(wanted(code))
            said = problem or next_start_text(code)
            self._window.say(f"{said}. {tr_text(note)}" if note else said, is_fault=bool(problem or note))
        self._languages.show_choice(self._saved.window.language)

    # ---- trying out

    def _on_drafted(self, config: Config) -> None:
        if not self._why_locked():
            self._try_out(config)

    def _try_out(self, config: Config) -> None:
        """Show the picture, and the windows' colours, as they would be."""
        shown = self._shown_config()
        self._drafted = config
        wanted = self._shown_config()
        if wanted == self._rig.config:
            self._drafted = None
        _use_theme(wanted)
        if wanted.perception != shown.perception:
            self._show(wanted.perception)

    def _shown_config(self) -> Config:
        """The window's configuration with what is tried out; a model or a rig may have been chosen meanwhile."""
        config = self._rig.config
        return config if self._drafted is None else with_changes(config, self._saved, self._drafted, _NOW)

    def _put_back(self) -> None:
        """As it was before something was tried out; not within a session, which is to have one set of thresholds."""
        if self._drafted is None:
            return
        if self._window.recorder.status.recording:
            self._wants_back = True
            self._window.say(tr("The session goes on with the thresholds that it was begun with"))
            return
        tried = self._shown_config()
        self._drafted, self._wants_back = None, False
        _use_theme(self._rig.config)
        if tried.perception != self._rig.config.perception:
            self._show(self._rig.config.perception)

    def _show(self, perception: PerceptionConfig) -> None:
        """On the running feed, else on the last frame."""
        tick = self._window.last_tick
        if not self._window.preview(perception) and tick is not None:
            target = tick.scene.to_source(tick.scene.route.target) if tick.scene.route is not None else None
            self._stills.submit("still", partial(self._perceive_again, tick.frame, target, perception))

    def _on_still(self, _key: object, scene: object) -> None:
        self._window.show_still(scene if isinstance(scene, Scene) and self.is_trying else None)

    def _on_phase(self, phase: EnginePhase) -> None:
        """What is being tried out applies to a rig that was opened again, too."""
        if phase is EnginePhase.RUNNING and self._drafted is not None:
            self._window.preview(self._shown_config().perception)

    def _may_ask(self, step: OperatorStep) -> bool:
        if self.is_trying and step in (OperatorStep.ARM, OperatorStep.HAND_OVER):
            self._window.say(tr("Not while settings are tried out: save or cancel them first"), is_fault=True)
            return False
        return True

    # ---- saving

    def _save(self, restart: bool) -> None:
        dialog = self.dialog
        config = dialog.draft.config if dialog is not None else None
        if dialog is None or config is None or self._why_locked():
            return
        before, note = self._saved, self._keep(config)
        if note is None:
            return
        self._drafted = None
        self._stills.cancel_waiting()
        self._window.apply_settings(with_changes(self._rig.config, before, config, _NOW))
        self._saved_over = self._rig.config
        self._window.show_still(None)  # of a rig that is over, what was tried out on its last picture must not stay: it looks alive
        _use_theme(self._rig.config)
        self._window.say(tr("Settings saved in {path}", path=self._file.path) + (f". {tr_text(note)}" if note else ""))
        dialog.draft.mark_saved()
        dialog.accept()
        if restart:
            self._rig.use_config(self._rig.config)

    def _keep(self, config: Config) -> str | None:
        """Write the file; a note about the old one, None when it could not be written."""
        try:
            # None would mean "not read": what another program wrote since then would be replaced without a copy.
            note = write_settings(self._file.path, config, self._file.text or "")
        except ConfigError as error:
            if self.dialog is not None:
                self.dialog.show_notice(tr_text(str(error)), is_fault=True)
            else:
                self._window.say(tr_text(str(error)), is_fault=True)
            return None
        self._saved = config
        self._file = SettingsFile(self._file.path, {}, _text_of(self._file))
        return note

    def _amend(self, config: Config) -> Config:
        """What waited for a rig to be opened."""
        amended = with_changes(config, self._at_rig_start, self._saved, _AT_START, since=self._saved_over)
        self._at_rig_start, self._saved_over = self._saved, None
        return amended

    def _read_rig_again(self, config: Config) -> Config:
        """With its rig file as it is now; what is wrong with that file is reported when the rig is opened."""
        with contextlib.suppress(RigFileError):
            return read_again(config, self._saved)
        return config

    def _on_finished(self, _result: int) -> None:
        self.dialog = None
        self._put_back()
        if not self._wants_back:
            self._timer.stop()

    # ---- what stands against it

    def _why_locked(self) -> str:
        view = self._window.controls.view
        if view is not None and view.mode in ARMED_MODES:
            return tr("The robot is armed: settings can be changed when it is disarmed")
        if self._window.recorder.status.recording:
            return tr("A session is being recorded: settings can be changed when it has ended")
        return ""

    def _update(self) -> None:
        why = self._why_locked()
        if self.dialog is not None:
            self.dialog.lock(why)
            self.dialog.show_rig(self._rig.config)
        elif self._wants_back and not why:
            self._put_back()
            self._timer.stop()


def _use_theme(config: Config) -> None:
    application = QApplication.instance()
    if isinstance(application, QApplication) and theme.chosen(application) != config.window.theme:
        theme.apply_theme(application, config.window.theme)


def _text_of(file: SettingsFile) -> str | None:
    """The text as it is on the disk now, None where it cannot be read."""
    try:
        return file.path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return None
