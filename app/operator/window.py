"""The operator window: wires the panels, the menus and the keys to the rig, and shows its newest tick."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import QAbstractItemView, QAbstractSpinBox, QComboBox, QLineEdit

from app.operator.engine_thread import EnginePhase
from app.operator.leaving import LeavingQuestion
from app.operator.manual_drive import DriveController
from app.operator.panels import OperatorPanels
from app.operator.recording import Recorder
from app.operator.rig_session import OpenEngineFor, RigSession
from app.operator.tour import operator_stops
from app.operator.twin_menu import TwinMenuController
from app.ui.actions import MenuEntry, add_help_menu, add_menu, plain
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import open_file
from app.ui.snapshot import Origin, SnapshotWriter, pictures_folder
from app.ui.texts import OperatorStep, Undriven
from app.ui.window_base import WindowFrame
from app.widgets.event_log import LogKind
from app.widgets.scene_panels import add_scene_view_menu
from app.widgets.tour_overlay import TourOverlay
from core.config.models import Config, PerceptionConfig
from core.files import VIDEO_ENDINGS
from core.session.manifest import MANIFEST
from core.types import Frame, Point, Scene, Tick
from hardware.rig import RigKind

SHOW_EVERY_S = 1.0 / 30.0
"""A tick is shown thirty times a second at most."""
STALE_AFTER_S = 0.5
"""A picture that does not change for so long is not shown as live."""
PLAYBACK_STALE_AFTER_S = 3.0
_CHECK_EVERY_MS = 100
_STOP_WITHIN_MS = 20_000
"""A driver gets so long to return when the window closes."""

_log = logging.getLogger(__name__)


class TickPace(QObject):
    """``due`` says to show the newest tick now; ``checked`` carries, ten times a second, the seconds since the last was shown."""

    due = Signal()
    checked = Signal(float)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._due_s = self._shown_s = 0.0
        self._later = QTimer(self, singleShot=True, timerType=Qt.TimerType.PreciseTimer)
        self._later.timeout.connect(self.due)
        self._check = QTimer(self, interval=_CHECK_EVERY_MS)
        self._check.timeout.connect(lambda: self.checked.emit(time.monotonic() - self._shown_s))

    def start(self) -> None:
        self._check.start()

    def stop(self) -> None:
        self._check.stop()
        self._later.stop()

    def on_tick(self) -> None:
        """A tick is due now, or when a thirtieth of a second has passed since the last one was."""
        wait_s = self._due_s - time.monotonic()
        if wait_s <= 0.0:
            self.due.emit()
        elif not self._later.isActive():
            self._later.start(int(wait_s * 1000) + 1)

    def on_shown(self) -> None:
        """A tick is on the screen from now on."""
        self._shown_s = time.monotonic()
        # on average, not at least, a thirtieth apart: a tick that comes early by a hair must not be shown a whole period later
        self._due_s = max(self._due_s, self._shown_s - SHOW_EVERY_S) + SHOW_EVERY_S


class OperatorWindow(WindowFrame):
    """Shows the newest tick at 30 Hz at most, and hands the operator's requests to the rig; it never waits for anything.

    Parameters
    ----------
    config : what is opened first; choosing a phantom or look changes its section ``twin``.
    open_engine : opens rig and engine for a configuration; called in the engine's thread, may take seconds, may raise.
    kind : what the permanent banner says.
    phantoms : (name, title) of the phantoms to choose from; only the bench twin has any.
    """

    source_chosen = Signal(object)
    """The path of a picture, video or folder of pictures to look at instead of the rig's camera."""
    target_changed = Signal()

    def __init__(self, config: Config, open_engine: OpenEngineFor, kind: RigKind, phantoms: Sequence[tuple[str, str]] = ()) -> None:
        super().__init__()
        self.last_tick: Tick | None = None
        """The newest one of this rig, also when it is over; None before its first picture."""
        self.shown_tick: Tick | None = None
        """The one that is on the screen, None before the first and after the last."""
        self._problem: str | None = None
        self._is_stale = False
        self.target: Point | None = None
        """The operator's target, source pixels."""
        self._on_place: Callable[[Point], object] | None = None
        self.rig = RigSession(config, open_engine, kind, self)
        self._snapshots = SnapshotWriter(pictures_folder(config.window.pictures_folder), self)
        self._pace = TickPace(self)
        self.panels = OperatorPanels(config, kind, phantoms)
        self.setCentralWidget(self.panels)  # before event filters are installed: this makes hundreds of events
        self.recorder = Recorder(self.rig, self)
        self.controls = DriveController(self, self.rig, self.panels, self.recorder)
        self.leaving = LeavingQuestion(self, self.rig, self.say)
        self.leaving.done.connect(self.close)
        self.tour = TourOverlay(self.panels, kept_clear=(self.panels.mode_bar.stop, self.panels.alerts))
        self._add_menus()
        self._twin = TwinMenuController(self, self.rig, self.panels, self.say) if self.panels.picker is not None else None
        self._wire()
        self._show_kind()

    @property
    def live_frame(self) -> Frame | None:
        """What the camera shows now; None where the picture is not live."""
        is_live = self.rig.phase is EnginePhase.RUNNING and not self._is_stale
        return self.shown_tick.frame if is_live and self.shown_tick is not None else None

    def say(self, message: str, is_fault: bool = False) -> None:
        """Show a line to the operator, and keep it in the log."""
        self.panels.toast.show_message(message, is_fault=is_fault)
        self.panels.log(LogKind.NOTE, message)

    def open_path(self, path: Path) -> None:
        """Pictures and videos are looked at in this window; sessions and annotations open in their own."""
        from core.learning.dataset import IMAGE_ENDINGS

        is_session = any((at / MANIFEST).is_file() for at in (path, path.parent))
        if not is_session and (path.is_dir() or path.suffix.lower() in (*IMAGE_ENDINGS, *VIDEO_ENDINGS)):
            self.source_chosen.emit(path)
        else:
            super().open_path(path)

    def show_tour(self) -> None:
        self.tour.begin(operator_stops(self.panels, has_robot=self.rig.config.rig.robot != "none"))

    # ---- composition

    def _add_menus(self) -> None:
        recorder = self.recorder
        self.add_file_menu(
            [
                MenuEntry(tr("&Snapshot"), self.save_snapshot, ("P", "Ctrl+S", "Shift+P")),
                MenuEntry(tr("&Open pictures folder"), self.open_pictures),
                None,
                MenuEntry(tr("&Record, or end the recording"), recorder.toggle, ("F9", "Shift+F9")),
                MenuEntry(tr("Save the &last seconds"), recorder.save_last, ("F10", "Shift+F10")),
                MenuEntry(tr("&Mark this moment"), recorder.note, ("M", "Shift+M")),
            ]
        )
        performance = MenuEntry(tr("Performance fi&gures"), self.panels.toggle_performance, checked=False)
        actions = add_scene_view_menu(self, self.panels, [performance])
        self.performance_entry = next(one for one in actions if plain(one.text()) == plain(performance.text))
        self.panels.performance_shown.connect(self.performance_entry.setChecked)
        add_menu(
            self,
            tr("&Robot"),
            [
                MenuEntry(tr("S&TOP"), self.controls.stop, hint="Space, Pause"),
                None,
                *(MenuEntry(tr(step.value.name), partial(self.ask_step, step), _keys_of(step)) for step in OperatorStep),
                None,
                MenuEntry(tr("&Clear target"), self.clear_target, hint="Esc"),
                None,
                MenuEntry(tr("Start the &rig again"), self.ask_restart, ("F5",)),
            ],
        )
        add_help_menu(self, self.panels.help.toggle, [MenuEntry(tr("&Tour"), self.show_tour)])

    def _wire(self) -> None:
        panels, rig, controls = self.panels, self.rig, self.controls
        rig.engine.tick_ready.connect(self._pace.on_tick)
        rig.config_changed.connect(self._show_kind)
        rig.preparing.connect(self._on_preparing)
        rig.phase_changed.connect(self._on_phase)
        self._pace.due.connect(self._show_newest)
        self._pace.checked.connect(self._check_age)
        self.tour.ended.connect(panels.live.setFocus)
        panels.live.clicked.connect(self.choose_target)
        panels.live.cleared.connect(self.clear_target)
        panels.notice.restart.connect(rig.restart)
        controls.jog.held_changed.connect(panels.jog.show_held)
        panels.jog.pressed.connect(controls.press)
        panels.jog.released.connect(controls.release)
        panels.jog.speed_changed.connect(controls.set_speed)
        bar = panels.mode_bar
        bar.stop_asked.connect(controls.stop)
        bar.deadman_changed.connect(partial(controls.deadman.hold, "mouse"))
        bar.step_asked.connect(self.ask_step)
        panels.servos.reboot_asked.connect(controls.reboot)
        panels.servos.zero_asked.connect(controls.zero)
        panels.servos.torque_off_asked.connect(controls.torque_off)
        self.recorder.changed.connect(panels.record_bar.show_status)
        self.recorder.said.connect(self.say)
        panels.record_bar.clicked.connect(self.recorder.toggle)
        self._snapshots.saved.connect(panels.toast.show_message)
        self._snapshots.failed.connect(partial(panels.toast.show_message, is_fault=True))

    def ask_step(self, step: OperatorStep) -> None:
        """A step that the operator asks for, by key, button or menu."""
        if not self.rig.may_ask(step):
            return
        view = self.controls.view
        if step is OperatorStep.SERVOS_ON and self.panels.servos.lacks_zeros and view is not None and view.latched is None:
            self.panels.servos.open_zeros()
        else:
            self.controls.ask_step(step)

    # ---- the rig

    def start(self) -> None:
        """Open the rig; the window shows progress until the first picture comes."""
        super().start()
        self.panels.live.setFocus()
        self._pace.start()
        self.controls.start()
        self.rig.start()

    def ask_restart(self) -> None:
        """Open the rig again, unless that would break something off; a rig that shows no new picture has nothing to lose."""
        is_live = self.rig.phase is EnginePhase.RUNNING and not self._is_stale
        if is_live and (why := self.rig.work_in_progress()):
            self.say(tr("The rig stays as it is: {why}", why=why), is_fault=True)
        else:
            self.rig.restart()

    def apply_settings(self, config: Config) -> None:
        """What acts without opening the rig again: thresholds of perception, folders. What is recorded from here on says so."""
        self._snapshots.folder = pictures_folder(config.window.pictures_folder)
        if config.perception != self.rig.config.perception:
            self.preview(config.perception)
        self.rig.config = config

    def preview(self, perception: PerceptionConfig) -> bool:
        """Perceive under these thresholds from the next frame on, show their limits, and say so in what is recorded.

        False when nothing is perceived now.
        """
        rig = self.rig
        self.panels.set_limits(perception)
        config = rig.calibrated(rig.config.model_copy(update={"perception": perception}))
        is_running = rig.engine.set_perception(config.perception)
        if is_running:  # not before: a session that ends because of it would be one of nothing
            self.recorder.open_rig(config, rig.kind)
        return is_running

    def show_still(self, scene: Scene | None) -> None:
        """Another scene of the last frame of a rig that is over; None: as before."""
        if self.rig.is_over and self.last_tick is not None:
            if scene is None:
                self._show_phase()
            else:
                self.panels.show_still(self.last_tick.frame, scene)

    def _show_kind(self) -> None:
        config, kind = self.rig.config, self.rig.kind
        self._stale_after_s = PLAYBACK_STALE_AFTER_S if kind is RigKind.PLAYBACK else STALE_AFTER_S
        self.panels.show_kind(kind, has_servos=config.rig.robot != "none")
        self.setWindowTitle(f"LumenPilot \N{EM DASH} {tr(kind.value)}")
        if self._twin is not None:
            self._twin.update_entries()

    def _on_preparing(self) -> None:
        rig = self.rig
        self.panels.set_config(rig.config)
        self.clear_target()
        self.recorder.open_rig(rig.calibrated(rig.config), rig.kind)

    def _on_phase(self, phase: EnginePhase) -> None:
        panels, rig = self.panels, self.rig
        if phase is EnginePhase.ENDED:
            self._show_newest(is_last=True)  # the last picture of a recording may still be waiting for its turn
        self.shown_tick = self._problem = None
        self._is_stale = False
        if phase is not EnginePhase.RUNNING:
            panels.jog.show_status(None)
        panels.clear_history()
        panels.alerts.clear()
        # A recording that is over is known to have no robot, and F5 plays no other one.
        is_known = phase is EnginePhase.RUNNING or (phase is EnginePhase.ENDED and rig.kind is RigKind.PLAYBACK)
        self.controls.why_not = Undriven.NO_ROBOT if is_known else Undriven.CLOSED if rig.is_over else Undriven.NOT_YET
        if phase is EnginePhase.STARTING:
            self.last_tick = None
            panels.live.clear()
        elif phase is EnginePhase.FAULT:
            self.recorder.keep_rig_stop(rig.message)
        self._show_phase()

    def _show_phase(self) -> None:
        rig, picker = self.rig, self.panels.picker
        source = rig.config.rig.source or rig.config.rig.name
        what = picker.title if picker is not None and rig.kind is RigKind.SIM else source
        self.panels.show_phase(rig.phase, what, rig.message)

    # ---- ticks

    def _show_newest(self, *, is_last: bool = False) -> None:
        tick = self.rig.engine.ticks.take()
        if tick is None or self._is_shut or not (is_last or self.rig.phase is EnginePhase.RUNNING):
            return
        self._pace.on_shown()
        self._is_stale = False
        self.shown_tick = self.last_tick = tick
        self.panels.notice.hide()
        self.panels.show_tick(tick, self.max_block_ms)

    def _check_age(self, age_s: float) -> None:
        """A picture that does not change is not live: after half a second nothing of it is shown as true."""
        if self.rig.phase is not EnginePhase.RUNNING:
            return
        if (pilot := self.rig.pilot) is not None:
            self.panels.banner.show_speed(pilot.simulation_speed)
        problem = self.rig.engine.problem
        if self.shown_tick is not None:
            if age_s > self._stale_after_s:
                self._is_stale = True
                self.panels.show_stale(age_s, problem)
        elif problem != self._problem:  # no picture has come yet
            self._problem = problem
            if problem is None:
                self._show_phase()
            else:
                self.panels.show_no_picture(problem)

    # ---- the operator

    def choose_target(self, x: float, y: float) -> None:
        """The operator's target, in source pixels; or the place that ``ask_for_place`` waits for."""
        self.panels.live.setFocus()
        if self._on_place is not None:
            on_place, self._on_place = self._on_place, None
            on_place((x, y))
        else:
            self.set_target((x, y))

    @property
    def waits_for_place(self) -> bool:
        """Whether the next click into the picture is no target."""
        return self._on_place is not None

    def set_target(self, target: Point | None) -> bool:
        """Set or clear the target, source pixels; False when no rig is open."""
        is_set = self.rig.engine.set_target(target)
        if is_set or target is None:
            self.target = target
            self.controls.log_target(target)
            self.panels.live.show_target(target)
            self.target_changed.emit()
        return is_set

    def ask_for_place(self, on_place: Callable[[Point], object] | None) -> None:
        """The next click into the picture is for `on_place`, in source pixels, and no target; None: it is one again."""
        self._on_place = on_place

    def clear_target(self) -> None:
        """No target; and a click into the picture is for one again."""
        self._on_place = None
        if self.target is not None:
            self.set_target(None)

    def save_snapshot(self) -> str:
        """The picture that is shown, plain, with overlays, and its values. Returns why it cannot be, "" when it can."""
        rig = self.rig
        if self.shown_tick is None or self._is_stale:
            why = mark("the picture is not live") if self._is_stale or rig.is_over else mark("there is no picture yet")
            self.panels.toast.show_message(tr("No snapshot: {why}", why=tr_text(why)), is_fault=True)
            return why
        phantom = rig.config.twin.phantom if rig.kind is RigKind.SIM else None
        self._snapshots.write(self.shown_tick, Origin(rig.kind.value, phantom, rig.config.perception.segmentation.model))
        return ""

    def open_pictures(self) -> None:
        """Where snapshots go."""
        folder = self._snapshots.folder
        if not folder.is_dir() or not open_file(folder):
            self.panels.toast.show_message(tr("Snapshots go to {folder}", folder=folder))

    def _on_escape(self) -> None:
        field = self.focusWidget()
        if isinstance(field, QAbstractSpinBox | QLineEdit | QComboBox | QAbstractItemView):
            if self.panels.picker is not None:
                self.panels.picker.abandon()
            field.clearFocus()
            self.panels.live.setFocus()
        elif self.panels.help.isVisible():
            self.panels.help.hide()
        elif self.tour.is_running:
            self.tour.end()
        elif self.isFullScreen():
            self.toggle_full_screen()
        else:
            self.clear_target()

    # ---- the end

    def _may_close(self) -> bool:
        return self.leaving.may_close()

    def _let_go(self) -> None:
        self.rig.shut()
        self.rig.halt()
        self.controls.detach()
        self._pace.stop()
        self.panels.notice.hide()

    def _finish(self) -> Sequence[str]:
        """End the thread, finish writing; a rig that is being opened is waited for."""
        engine = self.rig.engine
        engine.stop()
        has_ended = engine.wait(_STOP_WITHIN_MS)
        stuck = [] if self._snapshots.finish() else ["the disk did not take a snapshot in time; leaving without it"]
        if not self.recorder.close():
            _log.error("the disk did not take the recording in time; what was written is safe, and is found at the next start")
        if not has_ended:
            stuck.append(f"the rig's driver did not return within {_STOP_WITHIN_MS / 1000:g} s; leaving without it")
        return stuck


def _keys_of(step: OperatorStep) -> tuple[str, ...]:
    """The step's key, which must also work while Shift is held as the deadman."""
    key = step.value.key
    return (key,) if "+" in key or step is OperatorStep.ARM else (key, f"Shift+{key}")
