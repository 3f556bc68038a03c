"""The operator window: live picture with overlays, pose state, angle, distances, advice, and the keys that move the robot."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from functools import partial

from PySide6.QtCore import Qt, QTimer, QUrl, Slot
from PySide6.QtGui import QAction, QCloseEvent, QDesktopServices, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QLabel, QMainWindow, QMenu, QVBoxLayout, QWidget

from app import palette, theme
from app.engine_thread import EngineLike, EngineStatus, EngineThread, Phase
from app.heartbeat import Heartbeat
from app.jog_keys import JogKeys, Motion
from app.pace import Pace
from app.snapshot import SnapshotWriter, pictures_folder
from app.widgets.advice_line import AdviceLine
from app.widgets.card import Card
from app.widgets.distance_bars import DistanceBars
from app.widgets.help_overlay import HelpOverlay
from app.widgets.jog_panel import JogPanel
from app.widgets.live_view import LiveView
from app.widgets.mode_badge import ModeBadge
from app.widgets.notice import Notice, NoticeKind
from app.widgets.overlay_bar import OverlayBar
from app.widgets.overlays import Layer
from app.widgets.performance_panel import PerformancePanel
from app.widgets.phantom_picker import PhantomPicker
from app.widgets.sim_banner import SimBanner
from app.widgets.state_badge import StateBadge
from app.widgets.theta_gauge import ThetaGauge
from app.widgets.toast import Toast
from app.widgets.trend_plot import TrendPlot
from app.wording import REASON_TEXT
from core.config import Config
from core.types import Command, Point, PoseState, Tick
from hardware.rig import RigKind

OpenEngineFor = Callable[[Config], EngineLike]

SHOW_EVERY_S = 1.0 / 30.0
TEXT_EVERY_S = 0.2
STALE_AFTER_S = 0.5
_CHECK_EVERY_MS = 100
_STOP_WITHIN_MS = 20_000

_log = logging.getLogger(__name__)


class OperatorWindow(QMainWindow):
    """Composes the widgets and wires them to the engine's thread.

    Parameters
    ----------
    config : what is opened first; choosing a phantom changes ``config.twin.phantom``.
    open_engine : opens rig and engine for a configuration; called in the engine's thread, may take seconds, may raise.
    kind : what the permanent banner says.
    phantoms : (name, title) of the phantoms to choose from; only the bench twin has any.
    """

    def __init__(self, config: Config, open_engine: OpenEngineFor, kind: RigKind, phantoms: Sequence[tuple[str, str]] = ()) -> None:
        super().__init__()
        self._config = config
        self._open_engine = open_engine
        self._kind = kind
        self._phase = Phase.IDLE
        self._tick: Tick | None = None
        self._target: Point | None = None
        self._shown_s = 0.0
        self._due_s = 0.0
        self._is_shut = False
        self._text_pace = Pace(TEXT_EVERY_S)
        self._shown_state: PoseState | None = None
        self._thread = EngineThread(self)
        self._snapshots = SnapshotWriter(pictures_folder(config.window.pictures_folder), self)
        self._heartbeat = Heartbeat(parent=self)
        speed = config.twin.jog_advance_mm_s
        self._jog = JogKeys(self, advance_mm_s=speed, delivery_mm_s=speed)
        self._show_later = QTimer(self)
        self._show_later.setSingleShot(True)
        self._show_later.setTimerType(Qt.TimerType.PreciseTimer)
        self._check = QTimer(self)
        self._check.setInterval(_CHECK_EVERY_MS)
        self._make_widgets(phantoms)
        self._lay_out()
        self._make_menus()
        self._wire()
        self.setWindowTitle(f"LumenPilot \N{EM DASH} {kind.value}")
        self.setMinimumSize(*theme.MIN_WINDOW)
        self.resize(*theme.START_WINDOW)

    # ---- composition

    def _make_widgets(self, phantoms: Sequence[tuple[str, str]]) -> None:
        limits = self._config.perception.pose
        self._live = LiveView()
        self._notice = Notice(self._live)
        self._toast = Toast(self._live)
        self._overlay_bar = OverlayBar()
        self._advice = AdviceLine()
        self._badge = StateBadge(limits)
        self._gauge = ThetaGauge(limits.theta_allow_deg)
        self._bars = DistanceBars(limits.d_allow_px)
        self._trends = TrendPlot(limits)
        self._performance = PerformancePanel()
        self._jog_panel = JogPanel()
        self._banner = SimBanner(self._kind)
        self._mode = ModeBadge()
        self._picker = PhantomPicker(phantoms, self._config.twin.phantom) if phantoms else None

    def _lay_out(self) -> None:
        central = QWidget()
        self.setCentralWidget(central)
        rows = QVBoxLayout(central)
        rows.setContentsMargins(theme.GAP, 4, theme.GAP, theme.GAP)
        rows.setSpacing(theme.GAP)
        header = QHBoxLayout()
        header.setSpacing(16)
        header.addWidget(self._banner, 1)
        if self._picker is not None:
            header.addWidget(self._picker)
        header.addWidget(self._mode)
        rows.addLayout(header)
        stage = QWidget()
        columns = QHBoxLayout(stage)
        columns.setContentsMargins(0, 0, 0, 0)
        columns.setSpacing(theme.GAP)
        columns.addLayout(self._left_column(), 62)
        right = QWidget()
        right.setLayout(self._right_column())
        right.setMinimumWidth(470)
        right.setMaximumWidth(660)
        columns.addWidget(right, 38)
        rows.addWidget(stage, 1)
        self._help = HelpOverlay(stage)  # the banner stays in sight

    def _left_column(self) -> QVBoxLayout:
        column = QVBoxLayout()
        column.setSpacing(theme.GAP)
        column.addWidget(self._live, 1)
        column.addWidget(self._overlay_bar)
        column.addWidget(self._advice)
        return column

    def _right_column(self) -> QVBoxLayout:
        limits = self._config.perception.pose
        measures = QHBoxLayout()
        measures.setSpacing(theme.GAP)
        measures.addWidget(Card("Angle to the vessel", self._gauge, f"allowed {limits.theta_allow_deg:g}°"), 1)
        measures.addWidget(Card("Distances", self._bars, f"allowed {limits.d_allow_px:g} px"), 1)
        hands = QHBoxLayout()
        hands.setSpacing(theme.GAP)
        hands.addWidget(Card("Move the robot", self._jog_panel, "hold"), 1)
        hands.addWidget(Card("Performance", self._performance), 1)
        column = QVBoxLayout()
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(theme.GAP)
        column.addWidget(Card("", self._badge))
        column.addLayout(measures, 3)
        column.addWidget(Card("Last 30 seconds", self._trends, _trend_legend()), 3)
        column.addLayout(hands, 3)
        return column

    def _make_menus(self) -> None:
        bar = self.menuBar()
        file_menu, view_menu, robot_menu, help_menu = (bar.addMenu(name) for name in ("&File", "&View", "&Robot", "&Help"))
        self._action(file_menu, "&Snapshot", self._take_snapshot, "P", "Ctrl+S")
        self._action(file_menu, "&Open pictures folder", self._open_pictures)
        file_menu.addSeparator()
        self._action(file_menu, "&Quit", self.close, "Ctrl+Q")
        self._layer_actions = {layer: self._layer_action(view_menu, layer) for layer in Layer}
        self._action(view_menu, "&All overlays on or off", self._toggle_all_layers, "0")
        view_menu.addSeparator()
        self._action(view_menu, "&Whole picture", self._live.fit, "F")
        self._full_screen = self._action(view_menu, "&Full screen", self._toggle_full_screen, "F11")
        self._full_screen.setCheckable(True)
        self._action(robot_menu, "S&top and straighten\tSpace", self._jog.stop)
        self._action(robot_menu, "&Clear target\tEsc", self._clear_target)
        robot_menu.addSeparator()
        if self._picker is not None:
            self._action(robot_menu, "&Another random phantom", self._picker.roll, "R")
        self._action(robot_menu, "Start the &rig again", self._restart, "F5")
        self._action(help_menu, "&Keys", self._help.toggle, "F1")
        hint = QLabel("F1  keys")
        hint.setObjectName("card_note")
        hint.setContentsMargins(0, 0, 14, 0)
        bar.setCornerWidget(hint)
        escape = QAction(self)
        escape.setShortcut(QKeySequence(Qt.Key.Key_Escape))
        escape.triggered.connect(self._on_escape)
        self.addAction(escape)

    def _action(self, menu: QMenu, text: str, slot: Callable[[], object], *keys: str) -> QAction:
        action = QAction(text, self)
        action.setShortcuts([QKeySequence(key) for key in keys])
        action.setAutoRepeat(False)
        action.triggered.connect(lambda _checked=False: slot())
        menu.addAction(action)
        self.addAction(action)  # keeps the shortcut alive while the menu bar is hidden
        return action

    def _layer_action(self, menu: QMenu, layer: Layer) -> QAction:
        action = self._action(menu, layer.value.label, partial(self._overlay_bar.toggle, layer), layer.value.key)
        action.setCheckable(True)
        action.setChecked(True)
        return action

    def _wire(self) -> None:
        self._thread.tick_ready.connect(self._on_tick_ready)
        self._thread.status_changed.connect(self._on_status)
        self._show_later.timeout.connect(self._show_newest)
        self._check.timeout.connect(self._check_age)
        self._live.clicked.connect(self._set_target)
        self._live.cleared.connect(self._clear_target)
        self._overlay_bar.toggled.connect(self._on_layer)
        self._notice.restart.connect(self._restart)
        self._jog.changed.connect(self._on_jog)
        self._jog.held_changed.connect(self._jog_panel.show_held)
        self._jog_panel.pressed.connect(self._on_cap_pressed)
        self._jog_panel.released.connect(self._on_cap_released)
        self._jog_panel.stopped.connect(self._jog.stop)
        self._snapshots.saved.connect(self._toast.show_message)
        self._snapshots.failed.connect(self._on_snapshot_failed)
        if self._picker is not None:
            self._picker.chosen.connect(self._choose_phantom)

    @property
    def max_block_ms(self) -> float:
        """The longest time that the GUI thread was blocked in the last ten seconds."""
        return self._heartbeat.max_block_ms

    @property
    def shown_tick(self) -> Tick | None:
        """The tick that is on the screen, None before the first and after the last."""
        return self._tick

    def drive(self, command: Command) -> None:
        """Command the robot as the operator's keys do."""
        self._on_jog(command)

    # ---- the rig

    def start(self) -> None:
        """Open the rig; the window shows progress until the first picture comes."""
        self._live.setFocus()
        self._heartbeat.start()
        self._check.start()
        self._start_rig()

    def _start_rig(self) -> None:
        self._jog.reset()
        self._clear_target()
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
        self._live.setFocus()
        self._start_rig()

    @Slot(object)
    def _on_status(self, status: EngineStatus) -> None:
        if not self._is_shut and status.phase is not Phase.IDLE:
            self._show_phase(status.phase, status.message)

    def _show_phase(self, phase: Phase, message: str = "") -> None:
        self._phase = phase
        self._tick = None
        self._performance.clear()
        self._trends.clear()
        what = self._picker.title if self._picker is not None else self._config.rig.source or self._config.rig.name
        if phase is Phase.STARTING:
            self._live.clear()
            self._blank("Starting", what)
            self._notice.show_notice(NoticeKind.PROGRESS, f"Starting: {what}", "Opening camera and robot, loading the network")
        elif phase is Phase.RUNNING:
            self._blank("Waiting for the first picture", "")
            self._notice.show_notice(NoticeKind.PROGRESS, "Waiting for the first picture", what)
        elif phase is Phase.ENDED:
            self._blank("Recording is over", "F5 plays it again")
            self._notice.show_notice(NoticeKind.WARNING, "Recording is over", message, restartable=True)
        elif phase is Phase.FAULT:
            self._blank("Fault", message)
            self._notice.show_notice(NoticeKind.FAULT, "The rig stopped", message, restartable=True)

    def _blank(self, title: str, why: str) -> None:
        """Show nothing that was understood of an older picture, and say why."""
        self._live.blank_overlays()
        self._badge.show_nothing(title, why)
        self._gauge.show_pose(None)
        self._bars.show_pose(None)
        self._advice.show_advice(None, None, title[0].lower() + title[1:])
        self._jog_panel.set_enabled(False, title)

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
        self._notice.clear()
        self._show_tick(tick)

    def _show_tick(self, tick: Tick) -> None:
        first = self._tick is None
        self._tick = tick
        scene, pose = tick.scene, tick.scene.pose
        state = pose.state if pose is not None else None
        # a new state renews all texts together: numbers beside it must be the ones that made it
        renew_text = self._text_pace.due() or state is not self._shown_state
        self._shown_state = state
        self._live.show_frame(tick.frame, scene)
        self._badge.show_scene(scene, renew_text=renew_text)
        self._gauge.show_pose(pose, renew_text=renew_text)
        self._bars.show_pose(pose, renew_text=renew_text)
        why_none = REASON_TEXT[scene.refusal.reason].title.lower() if scene.refusal is not None else "no pose"
        self._advice.show_advice(tick.advice, state, why_none, renew_text=renew_text)
        self._trends.add(scene)
        self._performance.add(tick, self._heartbeat.max_block_ms)
        self._jog_panel.show_command(self._jog.command, tick.status)
        if first:
            self._jog_panel.set_enabled(tick.status is not None, "" if tick.status is not None else "This rig has no robot")

    @Slot()
    def _check_age(self) -> None:
        """A picture that does not change is not live: after half a second nothing of it is shown as true."""
        age_s = time.monotonic() - self._shown_s
        if self._phase is Phase.RUNNING and self._tick is not None and age_s > STALE_AFTER_S:
            self._blank("No new picture", "Check the camera; F5 starts the rig again")
            self._notice.show_notice(NoticeKind.WARNING, f"No new picture for {age_s:.0f} s", "The camera or the program is behind")
            self._jog_panel.set_enabled(self._tick.status is not None)

    # ---- the operator

    @Slot(object)
    def _on_jog(self, command: Command) -> None:
        self._thread.jog(command)
        self._jog_panel.show_command(command, self._tick.status if self._tick is not None else None)

    @Slot(object)
    def _on_cap_pressed(self, motion: Motion) -> None:
        self._jog.press(("cap", motion), motion)

    @Slot(object)
    def _on_cap_released(self, motion: Motion) -> None:
        self._jog.release(("cap", motion))

    @Slot(float, float)
    def _set_target(self, x: float, y: float) -> None:
        self._live.setFocus()
        if self._thread.set_target((x, y)):
            self._target = (x, y)
            self._live.show_target(self._target)

    @Slot()
    def _clear_target(self) -> None:
        if self._target is not None:
            self._target = None
            self._thread.set_target(None)
            self._live.show_target(None)

    @Slot(object, bool)
    def _on_layer(self, layer: Layer, on: bool) -> None:
        self._live.set_layer(layer, on)
        self._layer_actions[layer].setChecked(on)

    def _toggle_all_layers(self) -> None:
        self._overlay_bar.set_all(not any(self._overlay_bar.is_on(layer) for layer in Layer))

    def _take_snapshot(self) -> None:
        if self._tick is None:
            self._toast.show_message("No snapshot: there is no picture yet", is_fault=True)
            return
        self._snapshots.write(self._tick, self._kind.value)

    @Slot(str)
    def _on_snapshot_failed(self, message: str) -> None:
        self._toast.show_message(message, is_fault=True)

    def _open_pictures(self) -> None:
        folder = self._snapshots.folder
        if not folder.is_dir() or not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
            self._toast.show_message(f"Snapshots go to {folder}")

    @Slot()
    def _on_escape(self) -> None:
        if self._help.isVisible():
            self._help.hide()
        elif self.isFullScreen():
            self._toggle_full_screen()
        else:
            self._clear_target()

    def _toggle_full_screen(self) -> None:
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)
        self.menuBar().setVisible(not self.isFullScreen())
        self._full_screen.setChecked(self.isFullScreen())

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
        self._jog.detach()
        for timer in (self._check, self._show_later):
            timer.stop()
        self._heartbeat.stop()
        self._notice.clear()
        self.hide()
        self._thread.stop()
        if not self._thread.wait(_STOP_WITHIN_MS):
            _log.error("the rig does not answer: its driver has been waited for %d s", _STOP_WITHIN_MS // 1000)
        self._snapshots.finish()


def _trend_legend() -> QLabel:
    label = QLabel(
        f'<span style="color:{palette.THETA}">\N{HORIZONTAL BAR} \N{GREEK SMALL LETTER THETA} °</span>&nbsp;&nbsp;&nbsp;'
        f'<span style="color:{palette.D_HEAD}">\N{HORIZONTAL BAR} d_head px</span>&nbsp;&nbsp;&nbsp;'
        f'<span style="color:{palette.D_TAIL}">\N{MIDDLE DOT}\N{MIDDLE DOT}\N{MIDDLE DOT} d_tail px</span>'
    )
    label.setObjectName("card_note")
    return label
