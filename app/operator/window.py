"""The operator window: wires the panels, the menus and the keys to the engine's thread.

The menus of the operator window: everything that it can do, with its key.

When a tick is shown: thirty times a second at most; and how old the one is that is on the screen.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Sequence
from functools import partial

from PySide6.QtCore import QObject, Qt, QTimer, QUrl, Signal, Slot
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QAbstractItemView, QAbstractSpinBox, QComboBox, QLineEdit

from app.operator.engine_thread import EngineLike, EnginePhase, EngineStatus, EngineThread
from app.operator.manual_drive import DriveController
from app.operator.panels import OperatorPanels
from app.operator.recording import Recorder
from app.operator.tour import operator_stops
from app.operator.twin_menu import TwinMenuController
from app.ui.actions import MenuEntry, add_help_menu, add_menu
from app.ui.i18n import tr
from app.ui.snapshot import Origin, SnapshotWriter, pictures_folder
from app.ui.texts import OperatorStep, Undriven
from app.ui.window_base import WindowFrame
from app.widgets.event_log import LogKind
from app.widgets.scene_panels import add_scene_view_menu
from app.widgets.tour_overlay import TourOverlay
from core.config.models import Config, PerceptionConfig
from core.config.rig_file import RigFileError, as_calibrated
from core.control.modes import ARMED_MODES
from core.control.motion import Jog
from core.control.pilot import Pilot
from core.devices import DeviceError
from core.types import Point, Scene, Tick
from hardware.rig import RigKind, kind_of


def add_operator_menus(window: OperatorWindow) -> None:
    """Fill the window's menu bar."""
    panels, recorder = window.panels, window.recorder
    window.add_file_menu(
        [
            MenuEntry(tr("&Snapshot"), window.take_snapshot, ("P", "Ctrl+S", "Shift+P")),
            MenuEntry(tr("&Open pictures folder"), window.open_pictures),
            None,
            MenuEntry(tr("&Record, or end the recording"), recorder.toggle, ("F9", "Shift+F9")),
            MenuEntry(tr("Save the &last seconds"), recorder.save_last, ("F10", "Shift+F10")),
            MenuEntry(tr("&Mark this moment"), recorder.mark, ("M", "Shift+M")),
        ]
    )
    add_scene_view_menu(window, panels)
    add_menu(
        window,
        tr("&Robot"),
        [
            MenuEntry(tr("S&TOP"), window.desk.stop, hint="Space, Pause"),
            None,
            *(MenuEntry(tr(step.value.name), partial(window.take, step), _keys_of(step)) for step in OperatorStep),
            None,
            MenuEntry(tr("&Clear destination"), window.clear_target, hint="Esc"),
            None,
            MenuEntry(tr("Start the &rig again"), window.ask_restart, ("F5",)),
        ],
    )
    add_help_menu(window, panels.help.toggle, [MenuEntry(tr("&Tour"), window.show_tour)])


def _keys_of(step: OperatorStep) -> tuple[str, ...]:
    """The step's key, which must also be heard while Shift is held as the deadman."""
    key = step.value.key
    return (key,) if "+" in key or step is OperatorStep.ARM else (key, f"Shift+{key}")


SHOW_EVERY_S = 1.0 / 30.0
_CHECK_EVERY_MS = 100


class TickPace(QObject):
    """``due`` says to show the newest tick now; ``checked`` carries, ten times a second, the seconds since the last was shown."""

    due = Signal()
    checked = Signal(float)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._due_s = 0.0
        self._shown_s = 0.0
        self._later = QTimer(self)
        self._later.setSingleShot(True)
        self._later.setTimerType(Qt.TimerType.PreciseTimer)
        self._later.timeout.connect(self.due)
        self._check = QTimer(self)
        self._check.setInterval(_CHECK_EVERY_MS)
        self._check.timeout.connect(self._on_check)

    def start(self) -> None:
        """Tell the age from now on."""
        self._check.start()

    def stop(self) -> None:
        self._check.stop()
        self._later.stop()

    @Slot()
    def tick_came(self) -> None:
        """It is due now, or when a thirtieth of a second has passed since the last one was."""
        wait_s = self._due_s - time.monotonic()
        if wait_s <= 0.0:
            self.due.emit()
        elif not self._later.isActive():
            self._later.start(int(wait_s * 1000) + 1)

    def tick_shown(self) -> None:
        """A tick is on the screen from now on."""
        self._shown_s = time.monotonic()
        # on average, not at least, a thirtieth apart: a tick that comes early by a hair must not be shown a whole period later
        self._due_s = max(self._due_s, self._shown_s - SHOW_EVERY_S) + SHOW_EVERY_S

    @Slot()
    def _on_check(self) -> None:
        self.checked.emit(time.monotonic() - self._shown_s)


OpenEngineFor = Callable[[Config], EngineLike]

STALE_AFTER_S = 0.5
PLAYBACK_STALE_AFTER_S = 3.0
_STOP_WITHIN_MS = 20_000
_PAINTED_AFTER_MS = 60
"""By then the window has painted itself, on a screen of this machine. Opening a rig imports for seconds, and whoever imports holds
up who paints: where painting begins later, it takes longer."""

_log = logging.getLogger(__name__)


class OperatorWindow(WindowFrame):
    """Shows the newest tick at 30 Hz at most, and hands the operator's wishes to the engine; it never waits for anything.

    Parameters
    ----------
    config : what is opened first; choosing a phantom or look changes ``config.twin``.
    open_engine : opens rig and engine for a configuration; called in the engine's thread, may take seconds, may raise.
    kind : what the permanent banner says.
    phantoms : (name, title) of the phantoms to choose from; only the bench twin has any.
    """

    phase_changed = Signal(object)

    def __init__(self, config: Config, open_engine: OpenEngineFor, kind: RigKind, phantoms: Sequence[tuple[str, str]] = ()) -> None:
        super().__init__()
        self._config = config
        self._open_engine = open_engine
        self._kind = kind
        self._phase = EnginePhase.IDLE
        self._phase_message = ""
        self._orders = 0
        self.may_take: Callable[[OperatorStep], bool] = lambda _step: True
        """Asked before a step of the operator goes to the pilot; whoever says no tells why."""
        self.amend_config: Callable[[Config], Config] = lambda config: config
        """Asked before a rig is opened: settings that waited for it."""
        self.read_rig_again: Callable[[Config], Config] = lambda config: config
        """Asked, too, and before it is calibrated: what somebody has edited in its file meanwhile."""
        self.stop_lent: Callable[[], bool] = lambda: False
        """STOP for whoever the rig is lent to; False: nothing of it moves. From any thread."""
        self._last_tick: Tick | None = None
        self._waits_for: str | None = None
        self._tick: Tick | None = None
        self._is_stale = False
        self._target: Point | None = None
        self._place_asked: Callable[[Point], object] | None = None
        self._thread = EngineThread(self)
        self._first_rig = QTimer(self, singleShot=True, interval=_PAINTED_AFTER_MS)
        self._snapshots = SnapshotWriter(pictures_folder(config.window.pictures_folder), self)
        self._pace = TickPace(self)
        self._panels = OperatorPanels(config, kind, phantoms)
        self.setCentralWidget(self._panels)  # before somebody listens to all events: this makes hundreds
        self._recorder = Recorder(config, kind, self._thread, self)
        self._desk = DriveController(self, self._thread, self._panels, self._recorder)
        self._tour = TourOverlay(self._panels, kept_clear=(self._panels.mode_bar.stop, self._panels.alerts))
        self._tour.ended.connect(self._panels.live.setFocus)
        add_operator_menus(self)
        self._twin = TwinMenuController(self, self._panels.picker) if self._panels.picker is not None else None
        self._wire()
        self._show_kind()

    @property
    def panels(self) -> OperatorPanels:
        """What is on the screen."""
        return self._panels

    @property
    def shown_tick(self) -> Tick | None:
        """The tick that is on the screen, None before the first and after the last."""
        return self._tick

    @property
    def desk(self) -> DriveController:
        """The operator's side of driving."""
        return self._desk

    @property
    def recorder(self) -> Recorder:
        """Records what is in the window."""
        return self._recorder

    @property
    def config(self) -> Config:
        """The configuration in force."""
        return self._config

    @property
    def pilot(self) -> Pilot | None:
        """The running rig's pilot; from any thread."""
        return self._thread.pilot

    def stop_opening(self) -> bool:
        """STOP while a rig is being opened: it starts stopped. False when none is. From any thread."""
        return self._thread.stop_opening()

    @Slot(str, bool)
    def say(self, message: str, is_fault: bool = False) -> None:
        """A line for the operator, also kept in the log."""
        self._panels.toast.show_message(message, is_fault=is_fault)
        self._panels.log(LogKind.NOTE, message)

    @property
    def tour(self) -> TourOverlay:
        """Leads through this window."""
        return self._tour

    @Slot()
    def show_tour(self) -> None:
        """From its first stop."""
        self._tour.begin(operator_stops(self._panels, has_robot=self._config.rig.robot != "none"))

    def drive(self, jog: Jog) -> None:
        """Move the robot as the operator's keys do."""
        self._desk.drive(jog)

    # ---- composition

    def _wire(self) -> None:
        panels = self._panels
        self._thread.tick_ready.connect(self._pace.tick_came)
        self._thread.status_changed.connect(self._on_status)
        self._pace.due.connect(self._show_newest)
        self._pace.checked.connect(self._check_age)
        panels.live.clicked.connect(self.choose_target)
        panels.live.cleared.connect(self.clear_target)
        panels.notice.restart.connect(self.restart)
        desk = self._desk
        desk.jog.held_changed.connect(panels.jog.show_held)
        panels.jog.pressed.connect(desk.press)
        panels.jog.released.connect(desk.release)
        panels.jog.speed_changed.connect(desk.set_speed)
        bar = panels.mode_bar
        bar.stop_asked.connect(desk.stop)
        bar.deadman_changed.connect(desk.hold_deadman)
        for asked, step in (
            (bar.servos_on_asked, OperatorStep.SERVOS_ON),
            (bar.acknowledge_asked, OperatorStep.ACKNOWLEDGE),
            (bar.arm_asked, OperatorStep.ARM),
            (bar.hand_over_asked, OperatorStep.HAND_OVER),
            (bar.take_back_asked, OperatorStep.TAKE_BACK),
            (bar.disarm_asked, OperatorStep.DISARM),
        ):
            asked.connect(partial(self.take, step))
        panels.servos.reboot_asked.connect(desk.reboot)
        panels.servos.zero_asked.connect(desk.zero)
        panels.servos.torque_off_asked.connect(desk.torque_off)
        self._recorder.changed.connect(panels.record_bar.show_status)
        self._recorder.said.connect(self.say)
        panels.record_bar.clicked.connect(self._recorder.toggle)
        self._snapshots.saved.connect(panels.toast.show_message)
        self._snapshots.failed.connect(self._on_snapshot_failed)

    def take(self, step: OperatorStep) -> None:
        """A step that the operator asks for, by key, button or menu."""
        if self.may_take(step):
            self._desk.take(step)

    # ---- the rig

    def use_config(self, config: Config) -> None:
        """Open the rig anew with another configuration; it may be a rig of another kind."""
        if kind_of(config.rig) is not kind_of(self._config.rig):
            self._kind = kind_of(config.rig)
        self._thread.announce_engine()
        self._desk.look()  # the last changes of the old rig belong to its session
        self._thread.end_engine()  # before the banner changes: nothing of the old rig is shown or recorded under it
        self._config = config
        self._show_kind()
        self.restart()

    def _show_kind(self) -> None:
        self._stale_after_s = PLAYBACK_STALE_AFTER_S if self._kind is RigKind.PLAYBACK else STALE_AFTER_S
        self._panels.show_kind(self._kind, has_servos=self._config.rig.robot != "none")
        self.setWindowTitle(f"LumenPilot \N{EM DASH} {tr(self._kind.value)}")
        if self._twin is not None:
            self._twin.renew()

    @property
    def phase(self) -> EnginePhase:
        """Where the rig is, as the window shows it."""
        return self._phase

    @property
    def phase_message(self) -> str:
        """The line that says why the rig has ended, or stands in FAULT."""
        return self._phase_message

    def lend(self, why: str) -> None:
        """Close the rig, so that somebody else can have camera and servos; it stands as FAULT with `why` until ``use_config``."""
        self._desk.reset()
        self._start_engine(partial(_lent, why))

    def take_settings(self, config: Config) -> None:
        """What acts without opening the rig anew: thresholds of perception, folders. What is recorded from here on says so."""
        self._snapshots.folder = pictures_folder(config.window.pictures_folder)
        if config.perception != self._config.perception:
            self.preview(config.perception)
        self._config = config

    def preview(self, perception: PerceptionConfig) -> bool:
        """Perceive under these thresholds from the next frame on, show their limits, and say so in what is recorded.

        False when nothing is perceived now.
        """
        self._panels.set_limits(perception)
        config = self._as_calibrated(self._config.model_copy(update={"perception": perception}))
        is_running = self._thread.set_perception(config.perception)
        if is_running:  # not before: a session that ends because of it would be one of nothing
            self._recorder.open_rig(config, self._kind)
        return is_running

    def _as_calibrated(self, config: Config) -> Config:
        """With what the rig file knows better; whoever opens the rig tells what is wrong with that file."""
        with contextlib.suppress(RigFileError):
            return as_calibrated(config)
        return config

    @property
    def last_tick(self) -> Tick | None:
        """The newest one of this rig, also when it is over; None before its first picture."""
        return self._last_tick

    def show_still(self, scene: Scene | None) -> None:
        """The last frame of a rig that is over, understood anew; None: as before."""
        if self._phase not in (EnginePhase.ENDED, EnginePhase.FAULT) or self._last_tick is None:
            return
        if scene is None:
            self._tell_phase(self._phase, self._phase_message)
        else:
            self._panels.show_still(self._last_tick.frame, scene)

    def start(self) -> None:
        """Open the rig; the window shows progress until the first picture comes."""
        super().start()
        self._panels.live.setFocus()
        self._pace.start()
        self._desk.start()
        self._prepare_rig()
        self._thread.announce_engine()
        self._first_rig.timeout.connect(self._open_rig)
        self._first_rig.start()

    def _start_rig(self) -> None:
        self._thread.announce_engine()
        self._desk.look()  # the last changes of the old rig belong to its session
        self._thread.end_engine()  # before the recorder hears of the new rig: no picture of the old one is kept as one of it
        self._prepare_rig()
        self._open_rig()

    def _prepare_rig(self) -> None:
        config, before = self.read_rig_again(self.amend_config(self._config)), self._config
        self._config = config
        if config.rig != before.rig:
            self._kind = kind_of(config.rig)
            self._show_kind()
        self._panels.set_config(self._config)
        self._desk.reset()
        self.clear_target()
        self._recorder.open_rig(self._as_calibrated(self._config), self._kind)
        self._show_phase(EnginePhase.STARTING)

    @Slot()
    def _open_rig(self) -> None:
        self._start_engine(partial(self._open_engine, self._config))

    @property
    def orders(self) -> int:
        """How often a rig was to be opened or lent: tells whether somebody has asked for another one since."""
        return self._orders

    def _start_engine(self, open_engine: Callable[[], EngineLike]) -> None:
        self._orders += 1
        self._first_rig.stop()
        self._thread.start_engine(open_engine)

    @Slot()
    def restart(self) -> None:
        """Open the rig anew."""
        if not self._is_shut:
            self._start_rig()

    @Slot()
    def ask_restart(self) -> None:
        """Open the rig anew, unless that would break something off; a rig that shows no new picture has nothing to lose."""
        why = self.at_work() if self._phase is EnginePhase.RUNNING and not self._is_stale else ""
        if why:
            self.say(tr("The rig stays as it is: {why}", why=why), is_fault=True)
        else:
            self.restart()

    def at_work(self) -> str:
        """What opening the rig anew would break off; empty: nothing."""
        view = self._desk.view
        if view is not None and view.mode in ARMED_MODES:
            return tr("the robot is armed: disarm it first")
        return tr("a session is being recorded: end it first") if self._recorder.status.recording else ""

    @Slot(object)
    def _on_status(self, status: EngineStatus) -> None:
        if status.phase is EnginePhase.ENDED:
            self._show_newest()  # the last picture of a recording may still be waiting for its turn
        if not self._is_shut and status.phase is not EnginePhase.IDLE:
            self._show_phase(status.phase, status.message)

    def _show_phase(self, phase: EnginePhase, message: str = "") -> None:
        panels = self._panels
        self._phase, self._phase_message = phase, message
        self._tick = self._waits_for = None
        self._is_stale = False
        if phase in (EnginePhase.ENDED, EnginePhase.FAULT):
            self._desk.reset()
        if phase is not EnginePhase.RUNNING:
            panels.jog.show_status(None)
        panels.forget()
        panels.alerts.clear()
        # A recording that is over has been seen to have no robot, and F5 plays no other one.
        is_seen = phase is EnginePhase.RUNNING or (phase is EnginePhase.ENDED and self._kind is RigKind.PLAYBACK)
        is_over = phase in (EnginePhase.ENDED, EnginePhase.FAULT)
        self._desk.why_not = Undriven.NO_ROBOT if is_seen else Undriven.CLOSED if is_over else Undriven.NOT_YET
        self.phase_changed.emit(phase)
        if phase is EnginePhase.STARTING:
            self._last_tick = None
            panels.live.clear()
        elif phase is EnginePhase.FAULT:
            self._recorder.rig_stopped(message)
        self._tell_phase(phase, message)

    def _tell_phase(self, phase: EnginePhase, message: str) -> None:
        rig, picker = self._config.rig, self._panels.picker
        what = picker.title if picker is not None and self._kind is RigKind.SIM else rig.source or rig.name
        self._panels.show_phase(phase, what, message)

    # ---- ticks

    @Slot()
    def _show_newest(self) -> None:
        tick = self._thread.ticks.take()
        if tick is None or self._phase is not EnginePhase.RUNNING or self._is_shut:
            return
        self._pace.tick_shown()
        self._is_stale = False
        self._tick = self._last_tick = tick
        self._panels.notice.clear()
        self._panels.show_tick(tick, self._heartbeat.max_block_ms)

    @Slot(float)
    def _check_age(self, age_s: float) -> None:
        """A picture that does not change is not live: after half a second nothing of it is shown as true."""
        if self._phase is EnginePhase.RUNNING and self._tick is None:
            self._tell_waiting(self._thread.problem)
        elif self._phase is EnginePhase.RUNNING and age_s > self._stale_after_s:
            self._is_stale = True
            self._panels.show_stale(age_s, self._thread.problem)

    def _tell_waiting(self, problem: str | None) -> None:
        """No picture has come yet, and why, where the camera tells it."""
        if problem == self._waits_for:
            return
        self._waits_for = problem
        if problem is None:
            self._tell_phase(self._phase, self._phase_message)
        else:
            self._panels.show_no_picture(problem)

    # ---- the operator

    @Slot(float, float)
    def choose_target(self, x: float, y: float) -> None:
        """The operator's destination, in source pixels; or what a click was asked for with ``ask_for_place``."""
        self._panels.live.setFocus()
        if self._place_asked is not None:
            asked, self._place_asked = self._place_asked, None
            asked((x, y))
            return
        if self._thread.set_target((x, y)):
            self._target = (x, y)
            self._desk.log_target(self._target)
            self._panels.live.show_target(self._target)

    def ask_for_place(self, then: Callable[[Point], object] | None) -> None:
        """The next click into the picture is for `then`, in source pixels, and no destination; None: it is one again."""
        self._place_asked = then

    @Slot()
    def clear_target(self) -> None:
        """No destination; and a click into the picture is for one again."""
        self._place_asked = None
        if self._target is not None:
            self._target = None
            self._desk.log_target(None)
            self._thread.set_target(None)
            self._panels.live.show_target(None)

    def take_snapshot(self) -> None:
        """The picture that is shown, plain, with overlays, and its values."""
        if self._tick is None or self._is_stale:
            has_old = self._is_stale or self._phase in (EnginePhase.ENDED, EnginePhase.FAULT)
            why = tr("the picture is not live") if has_old else tr("there is no picture yet")
            self._panels.toast.show_message(tr("No snapshot: {why}", why=why), is_fault=True)
            return
        phantom = self._config.twin.phantom if self._kind is RigKind.SIM else None
        self._snapshots.write(self._tick, Origin(self._kind.value, phantom, self._config.perception.segmentation.model))

    @Slot(str)
    def _on_snapshot_failed(self, message: str) -> None:
        self._panels.toast.show_message(message, is_fault=True)

    def open_pictures(self) -> None:
        """Where snapshots go."""
        folder = self._snapshots.folder
        if not folder.is_dir() or not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
            self._panels.toast.show_message(tr("Snapshots go to {folder}", folder=folder))

    @Slot()
    def _on_escape(self) -> None:
        field = self.focusWidget()
        if isinstance(field, QAbstractSpinBox | QLineEdit | QComboBox | QAbstractItemView):
            if self._panels.picker is not None:
                self._panels.picker.abandon()
            field.clearFocus()
            self._panels.live.setFocus()
        elif self._panels.help.isVisible():
            self._panels.help.hide()
        elif self._tour.is_running:
            self._tour.end()
        elif self.isFullScreen():
            self.toggle_full_screen()
        else:
            self.clear_target()

    # ---- the end

    def _let_go(self) -> None:
        """Stop the robot."""
        self._desk.halt()
        self._desk.detach()
        self._pace.stop()
        self._first_rig.stop()
        self._panels.notice.clear()

    def _finish(self) -> Sequence[str]:
        """End the thread, finish writing; a rig that is being opened is waited for."""
        self._thread.stop()
        has_ended = self._thread.wait(_STOP_WITHIN_MS)
        stuck = [] if self._snapshots.finish() else ["the disk did not take a snapshot in time; leaving without it"]
        if not self._recorder.close():
            _log.error("the disk did not take the recording in time; what was written is safe, and is found at the next start")
        if not has_ended:
            stuck.append(f"the rig's driver did not return within {_STOP_WITHIN_MS / 1000:g} s; leaving without it")
        return stuck


def _lent(why: str) -> EngineLike:
    """Instead of an engine: the one before it is closed by the time that this is called."""
    raise DeviceError(why)
