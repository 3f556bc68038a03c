"""The operator window: wires the panels, the menus and the keys to the engine's thread."""

from __future__ import annotations

import contextlib
import logging
import os
import time
from collections.abc import Callable, Sequence
from functools import partial

from PySide6.QtCore import QEvent, Qt, QTimer, QUrl, Signal, Slot
from PySide6.QtGui import QAction, QCloseEvent, QDesktopServices, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QAbstractItemView, QAbstractSpinBox, QComboBox, QLabel, QLineEdit, QMainWindow

from app import theme
from app.drive_desk import DriveDesk
from app.engine_thread import EngineLike, EngineStatus, EngineThread, Phase
from app.heartbeat import Heartbeat
from app.language import tr, tr_text
from app.menus import MenuEntry, add_help_menu, add_menu, turn_page
from app.next_step import Step
from app.operator_panels import OperatorPanels
from app.recorder import Recorder
from app.snapshot import Origin, SnapshotWriter, pictures_folder
from app.tour_stops import operator_stops
from app.widgets.event_log import EventKind
from app.widgets.notice import NoticeKind
from app.widgets.overlays import Layer
from app.widgets.tour_overlay import TourOverlay
from core.config import Config, PerceptionConfig
from core.control.hand import Jog
from core.control.pilot import Pilot
from core.devices import DeviceError
from core.rig_file import RigFileError, as_calibrated
from core.types import Point, Scene, Tick
from hardware.rig import RigKind, kind_of

OpenEngineFor = Callable[[Config], EngineLike]

SHOW_EVERY_S = 1.0 / 30.0
STALE_AFTER_S = 0.5
PLAYBACK_STALE_AFTER_S = 3.0
_CHECK_EVERY_MS = 100
_STOP_WITHIN_MS = 20_000

_log = logging.getLogger(__name__)


class OperatorWindow(QMainWindow):
    """Shows the newest tick at 30 Hz at most, and hands the operator's wishes to the engine; it never waits for anything.

    Parameters
    ----------
    config : what is opened first; choosing a phantom changes ``config.twin.phantom``.
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
        self._phase = Phase.IDLE
        self._phase_message = ""
        self.may_take: Callable[[Step], bool] = lambda _step: True
        """Asked before a step of the operator goes to the pilot; whoever says no tells why."""
        self.amend_config: Callable[[Config], Config] = lambda config: config
        """Asked before a rig is opened: settings that waited for it."""
        self._last_tick: Tick | None = None
        self._tick: Tick | None = None
        self._is_stale = False
        self._target: Point | None = None
        self._place_asked: Callable[[Point], object] | None = None
        self._shown_s = 0.0
        self._due_s = 0.0
        self._is_shut = False
        self._thread = EngineThread(self)
        self._snapshots = SnapshotWriter(pictures_folder(config.window.pictures_folder), self)
        self._heartbeat = Heartbeat(parent=self)
        self._show_later = QTimer(self)
        self._show_later.setSingleShot(True)
        self._show_later.setTimerType(Qt.TimerType.PreciseTimer)
        self._check = QTimer(self)
        self._check.setInterval(_CHECK_EVERY_MS)
        self._panels = OperatorPanels(config, kind, phantoms)
        self._recorder = Recorder(config, kind, self._thread, self)
        self._desk = DriveDesk(self, self._thread, self._panels, self._recorder)
        self.setCentralWidget(self._panels)
        self._tour = TourOverlay(self._panels, kept_clear=(self._panels.mode_bar.stop, self._panels.alerts))
        self._tour.ended.connect(self._panels.live.setFocus)
        self._make_menus()
        self._wire()
        self._show_kind()
        self.setMinimumSize(*theme.MIN_WINDOW)
        self.resize(theme.start_size(self.screen()))

    @property
    def panels(self) -> OperatorPanels:
        """What is on the screen."""
        return self._panels

    @property
    def max_block_ms(self) -> float:
        """The longest time that the GUI thread was blocked in the last ten seconds."""
        return self._heartbeat.max_block_ms

    @property
    def shown_tick(self) -> Tick | None:
        """The tick that is on the screen, None before the first and after the last."""
        return self._tick

    @property
    def desk(self) -> DriveDesk:
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

    @Slot(str, bool)
    def say(self, message: str, is_fault: bool = False) -> None:
        """A line for the operator, also kept in the log."""
        self._panels.toast.show_message(message, is_fault=is_fault)
        self._panels.log(EventKind.NOTE, message)

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

    def _make_menus(self) -> None:
        panels = self._panels
        file_entries = [
            MenuEntry(tr("&Snapshot"), self._take_snapshot, ("P", "Ctrl+S")),
            MenuEntry(tr("&Open pictures folder"), self._open_pictures),
            None,
            MenuEntry(tr("&Record, or end the recording"), self._recorder.toggle, ("F9",)),
            MenuEntry(tr("Save the &last seconds"), self._recorder.save_last, ("F10",)),
            None,
            MenuEntry(tr("&Quit"), self.close, ("Ctrl+Q",)),
        ]
        toggle = panels.overlay_bar.toggle
        layers = [MenuEntry(tr(layer.value.label), partial(toggle, layer), (layer.value.key,), checked=True) for layer in Layer]
        view_entries = [
            MenuEntry(tr("&All overlays on or off"), self._toggle_all_layers, ("0",)),
            None,
            MenuEntry(tr("&Whole picture"), panels.live.fit, ("F",)),
            None,
            MenuEntry(tr("&Next page"), partial(turn_page, panels.pages, 1), ("Ctrl+Tab",)),
            MenuEntry(tr("&Previous page"), partial(turn_page, panels.pages, -1), ("Ctrl+Shift+Tab",)),
            None,
            MenuEntry(tr("&Full screen"), self._toggle_full_screen, ("F11",), checked=False),
        ]
        robot_entries = [
            MenuEntry(tr("S&TOP"), self._desk.stop, hint="Space"),
            None,
            *(MenuEntry(tr(step.value.name), partial(self.take, step), _keys_of(step)) for step in Step),
            None,
            MenuEntry(tr("&Clear target"), self._clear_target, hint="Esc"),
            None,
            *(panels.picker.menu_entries() if panels.picker is not None else ()),
            MenuEntry(tr("Start the &rig again"), self._restart, ("F5",)),
        ]
        add_menu(self, tr("&File"), file_entries)
        view_actions = add_menu(self, tr("&View"), [*layers, *view_entries])
        add_menu(self, tr("&Robot"), robot_entries)
        add_help_menu(self, panels.help.toggle, [MenuEntry(tr("&Tour"), self.show_tour)])
        self._layer_actions = dict(zip(Layer, view_actions[: len(Layer)], strict=True))
        self._full_screen = view_actions[-1]
        escape = QAction(self)
        escape.setShortcut(QKeySequence(Qt.Key.Key_Escape))
        escape.triggered.connect(self._on_escape)
        self.addAction(escape)
        hint = QLabel(tr("F1  keys"))
        hint.setObjectName("card_note")
        hint.setContentsMargins(0, 0, 14, 0)
        self.menuBar().setCornerWidget(hint)

    def _wire(self) -> None:
        panels = self._panels
        self._thread.tick_ready.connect(self._on_tick_ready)
        self._thread.status_changed.connect(self._on_status)
        self._show_later.timeout.connect(self._show_newest)
        self._check.timeout.connect(self._check_age)
        panels.live.clicked.connect(self.choose_target)
        panels.live.cleared.connect(self._clear_target)
        panels.overlay_bar.toggled.connect(self._on_layer)
        panels.notice.restart.connect(self._restart)
        desk = self._desk
        desk.jog.held_changed.connect(panels.jog.show_held)
        panels.jog.pressed.connect(desk.press)
        panels.jog.released.connect(desk.release)
        panels.jog.speed_changed.connect(desk.jog.set_speed)
        bar = panels.mode_bar
        bar.stop_asked.connect(desk.stop)
        bar.deadman_changed.connect(desk.hold_deadman)
        for asked, step in (
            (bar.servos_on_asked, Step.SERVOS_ON),
            (bar.acknowledge_asked, Step.ACKNOWLEDGE),
            (bar.arm_asked, Step.ARM),
            (bar.hand_over_asked, Step.HAND_OVER),
            (bar.take_back_asked, Step.TAKE_BACK),
            (bar.disarm_asked, Step.DISARM),
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
        if panels.picker is not None:
            panels.picker.chosen.connect(self._choose_phantom)

    def take(self, step: Step) -> None:
        """A step that the operator asks for, by key, button or menu."""
        if self.may_take(step):
            self._desk.take(step)

    # ---- the rig

    def use_config(self, config: Config) -> None:
        """Open the rig anew with another configuration; it may be a rig of another kind."""
        if kind_of(config.rig) is not kind_of(self._config.rig):
            self._kind = kind_of(config.rig)
        self._thread.end_engine()  # before the banner changes: nothing of the old rig is shown or recorded under it
        self._config = config
        self._show_kind()
        self._restart()

    def _show_kind(self) -> None:
        self._stale_after_s = PLAYBACK_STALE_AFTER_S if self._kind is RigKind.PLAYBACK else STALE_AFTER_S
        self._panels.show_kind(self._kind, has_servos=self._config.rig.robot != "none")
        self.setWindowTitle(f"LumenPilot \N{EM DASH} {tr(self._kind.value)}")

    def lend(self, why: str) -> None:
        """Close the rig, so that somebody else can have camera and servos; it stands as FAULT with `why` until ``use_config``."""
        self._desk.reset()
        self._thread.start_engine(partial(_lent, why))

    def take_settings(self, config: Config) -> None:
        """What acts without opening the rig anew: thresholds of perception, folders. What is recorded from here on says so."""
        self._snapshots.set_folder(pictures_folder(config.window.pictures_folder))
        if config.perception != self._config.perception:
            self.preview(config.perception)
        self._config = config

    def preview(self, perception: PerceptionConfig) -> bool:
        """Perceive under these thresholds from the next frame on, show their limits, and say so in what is recorded.

        False when nothing is perceived now.
        """
        self._panels.set_limits(perception.pose)
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
        if self._phase not in (Phase.ENDED, Phase.FAULT) or self._last_tick is None:
            return
        if scene is None:
            self._tell_phase(self._phase, self._phase_message)
        else:
            self._panels.show_still(self._last_tick.frame, scene)

    def start(self) -> None:
        """Open the rig; the window shows progress until the first picture comes."""
        self._panels.live.setFocus()
        self._heartbeat.start()
        self._check.start()
        self._desk.start()
        self._start_rig()

    def _start_rig(self) -> None:
        self._config = self.amend_config(self._config)
        self._panels.set_config(self._config)
        self._desk.reset()
        self._clear_target()
        self._recorder.open_rig(self._as_calibrated(self._config), self._kind)
        self._show_phase(Phase.STARTING)
        self._thread.start_engine(partial(self._open_engine, self._config))

    @Slot()
    def _restart(self) -> None:
        if not self._is_shut:
            self._start_rig()

    @Slot(str)
    def _choose_phantom(self, name: str) -> None:
        twin = self._config.twin.model_copy(update={"phantom": name})
        self._config = self._config.model_copy(update={"twin": twin})
        self._panels.live.setFocus()
        self._start_rig()

    @Slot(object)
    def _on_status(self, status: EngineStatus) -> None:
        if status.phase is Phase.ENDED:
            self._show_newest()  # the last picture of a recording may still be waiting for its turn
        if not self._is_shut and status.phase is not Phase.IDLE:
            self._show_phase(status.phase, status.message)

    def _show_phase(self, phase: Phase, message: str = "") -> None:
        panels = self._panels
        self._phase, self._phase_message = phase, message
        self._tick = None
        self._is_stale = False
        if phase in (Phase.ENDED, Phase.FAULT):
            self._desk.reset()
            panels.jog.show_status(None)
        panels.forget()
        panels.alerts.clear()
        self._desk.has_rig = phase is Phase.RUNNING
        self.phase_changed.emit(phase)
        if phase is Phase.STARTING:
            self._last_tick = None
            panels.live.clear()
        elif phase is Phase.FAULT:
            self._recorder.rig_stopped(message)
        self._tell_phase(phase, message)

    def _tell_phase(self, phase: Phase, message: str) -> None:
        panels = self._panels
        rig, picker = self._config.rig, panels.picker
        what = picker.title if picker is not None and self._kind is RigKind.SIM else rig.source or rig.name
        if phase is Phase.STARTING:
            self._blank(tr("Starting"), what)
            panels.notice.show_notice(
                NoticeKind.PROGRESS, tr("Starting: {what}", what=what), tr("Opening camera and robot, loading the network")
            )
        elif phase is Phase.RUNNING:
            self._blank(tr("Waiting for the first picture"), "")
            panels.notice.show_notice(NoticeKind.PROGRESS, tr("Waiting for the first picture"), what)
        elif phase is Phase.ENDED:
            self._blank(tr("Recording is over"), tr("F5 plays it again"))
            panels.notice.show_notice(NoticeKind.WARNING, tr("Recording is over"), message, restartable=True)
        elif phase is Phase.FAULT:
            self._blank(tr("Fault"), message)
            panels.notice.show_notice(NoticeKind.FAULT, tr("The rig stopped"), message, restartable=True)

    def _blank(self, title: str, why: str) -> None:
        self._panels.blank(title, why)
        self._panels.jog.set_enabled(False, title)

    # ---- ticks

    @Slot()
    def _on_tick_ready(self) -> None:
        """Show the newest tick now, or when a thirtieth of a second has passed since the last one was due."""
        wait_s = self._due_s - time.monotonic()
        if wait_s <= 0.0:
            self._show_newest()
        elif not self._show_later.isActive():
            self._show_later.start(int(wait_s * 1000) + 1)

    @Slot()
    def _show_newest(self) -> None:
        tick = self._thread.ticks.take()
        if tick is None or self._phase is not Phase.RUNNING or self._is_shut:
            return
        now = time.monotonic()
        # on average, not at least, a thirtieth apart: a tick that comes early by a hair must not be shown a whole period later
        self._due_s = max(self._due_s, now - SHOW_EVERY_S) + SHOW_EVERY_S
        self._shown_s = now
        self._is_stale = False
        if self._tick is None:
            self._panels.jog.set_enabled(tick.status is not None, "" if tick.status is not None else tr("This rig has no robot"))
        self._tick = self._last_tick = tick
        self._panels.notice.clear()
        self._panels.show_tick(tick, self._heartbeat.max_block_ms)

    @Slot()
    def _check_age(self) -> None:
        """A picture that does not change is not live: after half a second nothing of it is shown as true."""
        age_s = time.monotonic() - self._shown_s
        if self._phase is Phase.RUNNING and self._tick is not None and age_s > self._stale_after_s:
            self._is_stale = True
            problem = self._thread.problem
            self._panels.blank(tr("No new picture"), tr_text(problem) or tr("Check the camera; F5 starts the rig again"))
            notice = tr("No new picture for {seconds:.0f} s", seconds=age_s)
            detail = tr_text(problem) or tr("The camera or the program is behind")
            self._panels.notice.show_notice(NoticeKind.WARNING, notice, detail, restartable=problem is not None)

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
    def _clear_target(self) -> None:
        self._place_asked = None
        if self._target is not None:
            self._target = None
            self._desk.log_target(None)
            self._thread.set_target(None)
            self._panels.live.show_target(None)

    @Slot(object, bool)
    def _on_layer(self, layer: Layer, on: bool) -> None:
        self._panels.live.set_layer(layer, on)
        self._layer_actions[layer].setChecked(on)

    def _toggle_all_layers(self) -> None:
        bar = self._panels.overlay_bar
        bar.set_all(not any(bar.is_on(layer) for layer in Layer))

    def _take_snapshot(self) -> None:
        if self._tick is None or self._is_stale:
            has_old = self._is_stale or self._phase in (Phase.ENDED, Phase.FAULT)
            why = tr("the picture is not live") if has_old else tr("there is no picture yet")
            self._panels.toast.show_message(tr("No snapshot: {why}", why=why), is_fault=True)
            return
        picker = self._panels.picker
        phantom = picker.name if picker is not None and self._kind is RigKind.SIM else None
        self._snapshots.write(self._tick, Origin(self._kind.value, phantom, self._config.perception.segmentation.model))

    @Slot(str)
    def _on_snapshot_failed(self, message: str) -> None:
        self._panels.toast.show_message(message, is_fault=True)

    def _open_pictures(self) -> None:
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
            self._toggle_full_screen()
        else:
            self._clear_target()

    def _toggle_full_screen(self) -> None:
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.WindowStateChange:  # the desktop can end full screen too
            self.menuBar().setVisible(not self.isFullScreen())
            self._full_screen.setChecked(self.isFullScreen())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter presses the button that has the focus: Space, which does it elsewhere, stops the robot here."""
        button = self.focusWidget()
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and isinstance(button, QAbstractButton):
            if not event.isAutoRepeat():
                button.click()
            return
        super().keyPressEvent(event)

    # ---- the end

    def closeEvent(self, event: QCloseEvent) -> None:
        self.shut_down()
        event.accept()

    @Slot()
    def shut_down(self) -> None:
        """Stop the robot, end the thread, finish writing. The window is gone at once; a rig that is being opened is waited for."""
        if self._is_shut:
            return
        self._is_shut = True
        self._desk.halt()
        self._desk.detach()
        for timer in (self._check, self._show_later):
            timer.stop()
        self._heartbeat.stop()
        self._panels.notice.clear()
        # A repaint that is still queued would find a window without a surface.
        self.setUpdatesEnabled(False)
        self.hide()
        self._thread.stop()
        has_ended = self._thread.wait(_STOP_WITHIN_MS)
        has_saved = self._snapshots.finish()
        if not self._recorder.close():
            _log.error("the disk did not take the recording in time; what was written is safe, and is found at the next start")
        if not has_saved:
            _log.error("the disk did not take a snapshot in time; leaving without it")
        if not has_ended:
            _log.error("the rig's driver did not return within %g s; leaving without it", _STOP_WITHIN_MS / 1000)
        if not (has_ended and has_saved):
            # Qt would abort on a thread that still runs, or wait for it for ever; nobody drives any more
            os._exit(1)


def _lent(why: str) -> EngineLike:
    """Instead of an engine: the one before it is closed by the time that this is called."""
    raise DeviceError(why)


def _keys_of(step: Step) -> tuple[str, ...]:
    """The step's key, which must also be heard while Shift is held as the deadman."""
    key = step.value.key
    return (key,) if "+" in key or step is Step.ARM else (key, f"Shift+{key}")
