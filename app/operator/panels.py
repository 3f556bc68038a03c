"""The panels of the operator window and their places."""

from __future__ import annotations

import time
from collections.abc import Sequence

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout

from app.operator.engine_thread import EnginePhase
from app.operator.record_bar import RecordBar
from app.operator.rehearsal_card import RehearsalCard
from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import Undriven
from app.ui.workers import Pace
from app.widgets.alerts import AlertStrip
from app.widgets.basics import Card, card_note, column, holder, line, row
from app.widgets.command_panel import CommandPanel, GateEvents
from app.widgets.event_log import EventLog, LogKind
from app.widgets.jog_panel import JogPanel, advised_motions
from app.widgets.messages import Notice, NoticeKind, OfferStrip, Toast
from app.widgets.mode_bar import ModeBar
from app.widgets.performance_panel import PerformancePanel
from app.widgets.phantom_picker import PhantomPicker
from app.widgets.scene_panels import ScenePanels
from app.widgets.servo_table import ServoTable, known_joints, status_by_servos
from app.widgets.shortcut_page import operator_help
from app.widgets.sim_banner import SimBanner
from app.widgets.trend_plot import TrendPlot
from core.config.calibration import CalibrationConfig
from core.config.models import Config, PerceptionConfig
from core.config.rig_file import RigFileError, calibration_of, scaled
from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.types import Frame, Scene, Tick
from hardware.rig import RigKind
from hardware.servos.bus_ipc import BusStatus

TEXT_EVERY_S = 0.2
_NEEDLE_EVERY_S = 0.08
_TALL_PX = 780


class OperatorPanels(ScenePanels):
    """Makes the widgets and lays them out; shows a tick on all of them, or nothing and why.

    ``picker``: None when there is no phantom to choose.
    """

    performance_shown = Signal(bool)

    def __init__(self, config: Config, kind: RigKind, phantoms: Sequence[tuple[str, str]]) -> None:
        super().__init__(config.perception, config.policy.pursuit.pixels_per_mm, TEXT_EVERY_S)
        self._servo_config = config.servos
        self.banner = SimBanner(kind, has_servos=config.rig.robot != "none")
        self.record_bar = RecordBar()
        self.picker = PhantomPicker(phantoms, config.twin.phantom) if phantoms else None
        self.notice = Notice(self.live)
        self.alerts = AlertStrip(self.live)
        self.toast = Toast(self.live)
        self.offers = OfferStrip(self.live)
        self.offers.lifted.connect(self.toast.lift)
        self.rehearsal = RehearsalCard(self.live, (self.alerts, self.offers))
        self.offers.lifted.connect(self.rehearsal.place)
        self.live.covers = (self.alerts, self.offers, self.rehearsal)
        self.trends = TrendPlot(config.perception.pose)
        self.performance = PerformancePanel()
        self.jog = JogPanel(config.servos)
        self.jog.set_speeds(config.hand, config.servos)
        self.mode_bar = ModeBar()
        self.servos = ServoTable()
        self.commands = CommandPanel()
        self._gate = GateEvents()
        self.events = EventLog()
        self._needle_pace = Pace(_NEEDLE_EVERY_S)
        self._blanked = ""
        self._beside: tuple[Tick, float] | None = None
        self._blank_title = ""
        self._has_picture = False
        left = holder(column((self.live, 1), (self.overlay_bar, 0), (self.advice, 0), (self.mode_bar, 0)))
        self.help = operator_help(self._lay_out(self._header(), left, self._right_side()), self.mode_bar)

    def show_kind(self, kind: RigKind, *, has_servos: bool) -> None:
        """Another rig is being opened: what the banner says, and whether there are phantoms to choose."""
        self.banner.show_kind(kind, has_servos=has_servos)
        if self.picker is not None:
            self.picker.setVisible(kind is RigKind.SIM)
            self.picker.setEnabled(kind is RigKind.SIM)

    def set_limits(self, perception: PerceptionConfig) -> None:
        """Other limits of the pose states, on all dials."""
        limits = perception.pose
        self.badge.set_limits(limits, perception.quality.confident_from)
        self.gauge.set_allowed(limits.theta_allow_deg)
        self.bars.set_allowed(limits.d_allow_px)
        self.trends.set_limits(limits)
        self._show_allowed(limits)

    def set_config(self, config: Config) -> None:
        """What the panels take from the configuration of the rig that is being opened."""
        self.set_limits(config.perception)
        known = _calibration_of(config)
        self.live.set_scale(scaled(config, known).policy.pursuit.pixels_per_mm)  # for the head prediction, which may be rough
        self.servos.safety = config.safety
        self.jog.set_speeds(config.hand, config.servos)
        self._servo_config = config.servos
        self._scale = known.scale if known is not None else None
        if self.picker is not None:
            self.picker.show_name(config.twin.phantom)

    def show_still(self, frame: Frame, scene: Scene) -> None:
        """Another scene of the last frame of a closed rig; nothing of it is added to trends."""
        self.notice.hide()
        self.live.show_frame(frame, scene)
        self.badge.show_scene(scene)
        self.gauge.show_pose(scene.pose)
        self.bars.show_pose(scene.pose)

    def show_drive(self, view: DriveView | None, bus: BusStatus | None, why_not: Undriven = Undriven.NO_ROBOT) -> None:
        """Show who drives, and what the servos say; None: there is nothing to drive, and `why_not`."""
        before, self._blanked = self._blanked, view.blanked if view is not None else ""
        if self._blanked and not before:  # at once, and not with the next picture: it may be long in coming
            self.live.drop_ghost()
            self.advice.show_advice(None, None, self._blanked)
            self.jog.show_advised(frozenset())
        self.mode.show_view(view, why_not)
        self.mode_bar.show_view(view, why_not)
        if view is not None:
            self.alerts.show_view(view)
        why_still = tr("This rig has no robot") if why_not is Undriven.NO_ROBOT else self._blank_title
        self.jog.set_enabled(view is not None, "" if view is not None else why_still)
        now_s = view.time_s if view is not None else time.monotonic()
        self.jog.show_known(known_joints(bus, self._servo_config, now_s))
        if not self._has_picture:  # a robot in a vessel is brought back by hand, and the operator must see how far
            self.jog.show_status(status_by_servos(bus, self._servo_config))
        self.servos.show_status(bus, self._servo_config, now_s)
        self.commands.show_view(view, bus)
        for event in self._gate.since_last(bus, self._servo_config) if bus is not None else ():
            self.events.add(LogKind.GATE, event.text, event.key, event.times)

    def show_alerts(self, alerts: tuple[Alert, ...]) -> None:
        """Show new alerts over the picture."""
        self.alerts.show_alerts(alerts)

    def log(self, kind: LogKind, text: str) -> None:
        """Keep a line in the log."""
        self.events.add(kind, text)

    def show_tick(self, tick: Tick, max_block_ms: float) -> None:
        """Show one turn of the engine on all panels: the picture now, the panels beside it in the event loop's next turn.

        In one go both would block the window for twice as long.
        """
        self._show_beside()
        self.live.show_frame(tick.frame, tick.scene, tick.advice)
        self._beside = tick, max_block_ms
        QTimer.singleShot(0, self, self._show_beside)

    def _show_beside(self) -> None:
        """What stands beside the picture, if the picture is still the one that it was put off for."""
        if self._beside is None:
            return
        (tick, max_block_ms), self._beside = self._beside, None
        self._has_picture = True
        scene = tick.scene
        renew_text = self._renews_text(scene)
        self.badge.show_scene(scene, tick.advice, renew_text=renew_text)
        if self._needle_pace.due() or renew_text:
            self._show_dials(scene, tick.status, renew_text=renew_text)
            self.jog.show_status(tick.status)
        self.jog.show_advised(advised_motions(tick.advice))
        self._show_advice(tick, self._blanked or tr("the pose is not steady yet"), renew_text=renew_text)
        self.trends.add(scene)
        self.performance.add(tick, max_block_ms)

    def blank(self, title: str, why: str) -> None:
        """Show nothing that was understood of an older picture, and say why."""
        self._beside = None
        self._has_picture = False
        self.live.blank_overlays()
        self.jog.show_advised(frozenset())
        self._blank_dials(title, why)

    def show_phase(self, phase: EnginePhase, what: str, message: str) -> None:
        """How far the rig is, and why; `what` is its phantom, source or name."""
        notice, kind = self.notice, NoticeKind.PROGRESS
        if phase is EnginePhase.STARTING:
            self._blank_all(tr("Starting"), what)
            notice.show_notice(kind, tr("Starting: {what}", what=what), tr("Opening camera and robot, loading the network"))
        elif phase is EnginePhase.RUNNING:
            self._blank_all(tr("Waiting for the first picture"), "")
            notice.show_notice(kind, tr("Waiting for the first picture"), what)
        elif phase is EnginePhase.ENDED:
            self._blank_all(tr("Recording is over"), tr("F5 plays it again"))
            notice.show_notice(NoticeKind.WARNING, tr("Recording is over"), message, restartable=True)
        elif phase is EnginePhase.FAULT:
            self._blank_all(tr("Fault"), message)
            notice.show_notice(NoticeKind.FAULT, tr("The rig stopped"), message, restartable=True)

    def show_stale(self, age_s: float, problem: str | None) -> None:
        """No new picture has come for so long, and why, where the camera tells it."""
        told = tr_text(problem) if problem is not None else ""
        waits = tr("The simulation waits for this computer, which is busy") if self.banner.kind is RigKind.SIM else ""
        self.blank(tr("No new picture"), told or waits or tr("Check the camera; F5 starts the rig again"))
        self.performance.clear()
        self.trends.show_silence(age_s)
        title = tr("No new picture for {seconds:.0f} s", seconds=age_s)
        detail = told or waits or tr("The camera or the program is behind")
        self._warn(title, detail, restartable=problem is not None)

    def show_no_picture(self, problem: str) -> None:
        """None has come since the rig was opened, and why."""
        self.blank(tr("No picture"), tr_text(problem))
        self._warn(tr("No picture from the camera"), tr_text(problem), restartable=True)

    def _warn(self, title: str, detail: str, *, restartable: bool) -> None:
        """Below the alerts: they are read first, and each can be dismissed."""
        self.notice.show_notice(NoticeKind.WARNING, title, detail, restartable=restartable)
        self.alerts.raise_()

    def _blank_all(self, title: str, why: str) -> None:
        self.blank(title, why)
        self._blank_title = title
        self.jog.set_enabled(False, title)

    @property
    def shows_performance(self) -> bool:
        """Whether frame rates and latencies are shown; they are of no use in driving."""
        return not self._performance.isHidden()

    def toggle_performance(self) -> None:
        self._performance.setHidden(self.shows_performance)
        self.performance_shown.emit(self.shows_performance)

    def clear_history(self) -> None:
        self._beside = None
        self.performance.clear()
        self.trends.clear()

    def follow_theme(self) -> None:
        """The legend's colours are in its text."""
        self._show_legend(self.trends.has_distances)

    def _show_legend(self, with_distances: bool) -> None:
        self._legend.setText(_trend_legend(with_distances))

    def _header(self) -> QHBoxLayout:
        picker = [self.picker] if self.picker is not None else []
        return line((self.banner, 1), *picker, self.record_bar, self.mode, spacing=16)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        tall = self.height() >= _TALL_PX
        if tall is not self._is_tall:
            self._place_trends(tall=tall)

    def _place_trends(self, *, tall: bool) -> None:
        """The trends stand by themselves where there is room, else on a page of their own."""
        self._is_tall = tall
        card = self._trends_card
        if tall:
            self.pages.removeTab(self.pages.indexOf(card))
            self._right.insertWidget(self._right.indexOf(self.pages), card, 3)
            card.show()
        else:
            self._right.removeWidget(card)
            self.pages.insertTab(1, card, tr("Trends"))

    def _right_side(self) -> QVBoxLayout:
        self._legend = card_note(_trend_legend(True))
        self.trends.distances_shown.connect(self._show_legend)
        self._performance = Card(tr("Performance"), self.performance)
        self._performance.hide()
        hands = row(Card(tr("Move the robot"), self.jog, tr("hold a key")), self._performance)
        self.pages.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.pages.tabBar().setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the arrows move the robot
        for page, name in (
            (hands, tr("Drive")),
            (self.servos, tr("Servos")),
            (self.commands, tr("Commands")),
            (self.events, tr("Log")),
        ):
            self.pages.addTab(page, name)
        self._trends_card = Card(tr("Last 30 seconds"), self.trends, self._legend)
        self._right = column((Card("", self.badge), 0), (self._dials(), 3), (self.clearance, 0), (self.pages, 3))
        self._place_trends(tall=False)
        return self._right


def _calibration_of(config: Config) -> CalibrationConfig | None:
    """None without a calibration. What is wrong with a rig file is reported when the rig is opened."""
    try:
        return calibration_of(config)
    except RigFileError:
        return None


def _trend_legend(with_distances: bool) -> str:
    """What the colours of the trends mean."""
    theta = f'<span style="color:{theme.THETA}">\N{HORIZONTAL BAR} \N{GREEK SMALL LETTER THETA} °</span>'
    distances = (
        f'&nbsp;&nbsp;&nbsp;<span style="color:{theme.D_HEAD}">\N{HORIZONTAL BAR} d_head px</span>&nbsp;&nbsp;&nbsp;'
        f'<span style="color:{theme.D_TAIL}">\N{MIDDLE DOT}\N{MIDDLE DOT}\N{MIDDLE DOT} d_tail px</span>'
    )
    return theta + distances if with_distances else theta
