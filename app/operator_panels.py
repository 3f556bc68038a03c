"""All that the operator sees below the menus: the panels of the operator window and their places."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QTabWidget, QVBoxLayout, QWidget

from app import palette, theme
from app.language import tr
from app.pace import Pace
from app.widgets.advice_line import AdviceLine
from app.widgets.alert_strip import AlertStrip
from app.widgets.card import Card
from app.widgets.clearance_bar import ClearanceBar
from app.widgets.columns import Columns
from app.widgets.command_panel import CommandPanel
from app.widgets.distance_bars import DistanceBars
from app.widgets.event_log import EventKind, EventLog
from app.widgets.help_overlay import operator_help
from app.widgets.jog_panel import JogPanel
from app.widgets.live_view import LiveView
from app.widgets.mode_badge import ModeBadge
from app.widgets.mode_bar import ModeBar
from app.widgets.notice import Notice
from app.widgets.offer_strip import OfferStrip
from app.widgets.overlay_bar import OverlayBar
from app.widgets.performance_panel import PerformancePanel
from app.widgets.phantom_picker import PhantomPicker
from app.widgets.record_bar import RecordBar
from app.widgets.servo_table import ServoTable
from app.widgets.sim_banner import SimBanner
from app.widgets.state_badge import StateBadge
from app.widgets.theta_gauge import ThetaGauge
from app.widgets.toast import Toast
from app.widgets.trend_plot import TrendPlot
from app.wording import REASON_TEXT
from core.calibration.scale import mm_per_working_px
from core.calibration_config import CalibrationConfig, ScaleConfig
from core.config import Config, PoseConfig
from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.rig_file import RigFileError, calibration_of, scaled
from core.types import Frame, PoseState, Scene, Tick
from hardware.rig import RigKind
from hardware.servos.bus_messages import BusStatus

TEXT_EVERY_S = 0.2
_NEEDLE_EVERY_S = 0.08
_LEFT_SHARE = 0.62
_RIGHT_WIDTH = (470, 660)
_TALL_PX = 780


class OperatorPanels(QWidget):
    """Makes the widgets and lays them out; shows a tick on all of them, or nothing and why.

    ``picker`` is None when there is no phantom to choose.
    """

    def __init__(self, config: Config, kind: RigKind, phantoms: Sequence[tuple[str, str]]) -> None:
        super().__init__()
        limits, pixels_per_mm = config.perception.pose, config.policy.pursuit.pixels_per_mm
        self._servo_config = config.servos
        self._scale: ScaleConfig | None = None
        self.banner = SimBanner(kind, has_servos=config.rig.robot != "none")
        self.mode = ModeBadge()
        self.record_bar = RecordBar()
        self.picker = PhantomPicker(phantoms, config.twin.phantom) if phantoms else None
        self.live = LiveView(pixels_per_mm)
        self.notice = Notice(self.live)
        self.alerts = AlertStrip(self.live)
        self.toast = Toast(self.live)
        self.offers = OfferStrip(self.live)
        self.offers.lifted.connect(self.toast.lift)
        self.overlay_bar = OverlayBar()
        self.advice = AdviceLine()
        self.badge = StateBadge(limits)
        self.gauge = ThetaGauge(limits.theta_allow_deg)
        self.bars = DistanceBars(limits.d_allow_px)
        self.trends = TrendPlot(limits)
        self.performance = PerformancePanel()
        self.jog = JogPanel(config.servos.max_pull_mm)
        self.mode_bar = ModeBar()
        self.servos = ServoTable()
        self.commands = CommandPanel()
        self.clearance = ClearanceBar(pixels_per_mm)
        self.events = EventLog()
        self._limits = limits
        self._text_pace = Pace(TEXT_EVERY_S)
        self._needle_pace = Pace(_NEEDLE_EVERY_S)
        self._state: PoseState | None = None
        self._blanked = ""
        stage = QWidget()
        self._lay_out(stage)
        self.help = operator_help(stage)  # the banner stays in sight

    def show_kind(self, kind: RigKind, *, has_servos: bool) -> None:
        """Another rig is being opened: what the banner says, and whether there are phantoms to choose."""
        self.banner.show_kind(kind, has_servos=has_servos)
        if self.picker is not None:
            self.picker.setVisible(kind is RigKind.SIM)
            self.picker.setEnabled(kind is RigKind.SIM)

    def set_limits(self, limits: PoseConfig) -> None:
        """Other limits of the pose states, on all dials."""
        self._limits = limits
        self.badge.set_limits(limits)
        self.gauge.set_allowed(limits.theta_allow_deg)
        self.bars.set_allowed(limits.d_allow_px)
        self.trends.set_limits(limits)
        self._allowed[0].setText(tr("allowed {limit:g}°", limit=limits.theta_allow_deg))
        self._allowed[1].setText(tr("allowed {limit:g} px", limit=limits.d_allow_px))

    def set_config(self, config: Config) -> None:
        """What the panels know of the configuration, for a rig that is being opened with another one."""
        self.set_limits(config.perception.pose)
        known = _calibration_of(config)
        self.live.set_scale(scaled(config, known).policy.pursuit.pixels_per_mm)
        self.clearance.set_scale(scaled(config, known).policy.pursuit.pixels_per_mm)
        self.jog.max_pull_mm = config.servos.max_pull_mm
        self._servo_config = config.servos
        self._scale = known.scale if known is not None else None
        if self.picker is not None:
            self.picker.show_name(config.twin.phantom)

    def show_still(self, frame: Frame, scene: Scene) -> None:
        """A frame of a rig that is closed, understood anew; nothing of it is added to trends."""
        self.notice.clear()
        self.live.show_frame(frame, scene)
        self.badge.show_scene(scene)
        self.gauge.show_pose(scene.pose)
        self.bars.show_pose(scene.pose)

    def show_drive(self, view: DriveView | None, bus: BusStatus | None) -> None:
        """Show who drives, and what the servos say; None: there is nothing to drive."""
        self._blanked = view.blanked if view is not None else ""
        self.mode.show_view(view)
        self.mode_bar.show_view(view)
        if view is not None:
            self.alerts.show_view(view)
        self.servos.show_status(bus, self._servo_config)
        self.commands.show_view(view, bus)

    def show_alerts(self, alerts: tuple[Alert, ...]) -> None:
        """Show new alerts over the picture."""
        self.alerts.show_alerts(alerts)

    def log(self, kind: EventKind, text: str) -> None:
        """Keep a line in the log."""
        self.events.add(kind, text)

    def show_tick(self, tick: Tick, max_block_ms: float) -> None:
        """Show one turn of the engine on all panels."""
        scene, pose = tick.scene, tick.scene.pose
        state = pose.state if pose is not None else None
        # a new state renews all texts together: the numbers beside it must be the ones that made it
        renew_text = self._text_pace.due() or state is not self._state
        self._state = state
        self.live.show_frame(tick.frame, scene, tick.advice)
        self.badge.show_scene(scene, renew_text=renew_text)
        if self._needle_pace.due() or renew_text:
            self.gauge.show_pose(pose, renew_text=renew_text)
            self.bars.set_scale(mm_per_working_px(self._scale, scene))
            self.bars.show_pose(pose, renew_text=renew_text)
            self.jog.show_status(tick.status)
            self.clearance.show_scene(scene, tick.status)
        why_none = self._blanked or tr("the pose is not steady yet")
        if scene.refusal is not None:
            why_none = tr(REASON_TEXT[scene.refusal.reason].title).lower()
        self.advice.show_advice(tick.advice, state, why_none, renew_text=renew_text)
        self.trends.add(scene)
        self.performance.add(tick, max_block_ms)

    def blank(self, title: str, why: str) -> None:
        """Show nothing that was understood of an older picture, and say why."""
        self.live.blank_overlays()
        self.badge.show_nothing(title, why)
        self.gauge.show_pose(None)
        self.bars.show_pose(None)
        self.advice.show_advice(None, None, title[0].lower() + title[1:])
        self.clearance.show_scene(None, None)

    def forget(self) -> None:
        """Empty trends and performance: what comes next has nothing to do with them."""
        self.performance.clear()
        self.trends.clear()

    def follow_theme(self) -> None:
        """The legend's colours are in its text."""
        self._show_legend(self.trends.has_distances)

    def _show_legend(self, with_distances: bool) -> None:
        self._legend.setText(_trend_legend(with_distances))

    def _lay_out(self, stage: QWidget) -> None:
        header = QHBoxLayout()
        header.setSpacing(16)
        header.addWidget(self.banner, 1)
        if self.picker is not None:
            header.addWidget(self.picker)
        header.addWidget(self.record_bar)
        header.addWidget(self.mode)
        left = QWidget()
        left.setLayout(_column((self.live, 1), (self.overlay_bar, 0), (self.advice, 0), (self.mode_bar, 0)))
        self.columns = Columns(left, self._right_side(), _LEFT_SHARE)
        room = QHBoxLayout(stage)
        room.setContentsMargins(0, 0, 0, 0)
        room.addWidget(self.columns)
        rows = QVBoxLayout(self)
        rows.setContentsMargins(theme.GAP, 4, theme.GAP, theme.GAP)
        rows.setSpacing(theme.GAP)
        rows.addLayout(header)
        rows.addWidget(stage, 1)

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

    def _right_side(self) -> QWidget:
        limits = self._limits
        self._allowed = (
            _note(tr("allowed {limit:g}°", limit=limits.theta_allow_deg)),
            _note(tr("allowed {limit:g} px", limit=limits.d_allow_px)),
        )
        angle = Card(tr("Angle to the vessel"), self.gauge, self._allowed[0])
        distances = Card(tr("Distances"), self.bars, self._allowed[1])
        self._legend = _note(_trend_legend(True))
        self.trends.distances_shown.connect(self._show_legend)
        trends = Card(tr("Last 30 seconds"), self.trends, self._legend)
        hands = _row(Card(tr("Move the robot"), self.jog, tr("hold")), Card(tr("Performance"), self.performance))
        side = QWidget()
        self.pages = QTabWidget()
        self.pages.setDocumentMode(True)
        self.pages.tabBar().setDrawBase(False)
        self.pages.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.pages.setAccessibleName(tr("Pages"))
        self.pages.tabBar().setAccessibleName(tr("Pages"))
        self.pages.tabBar().setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the arrows move the robot
        for page, name in (
            (hands, tr("Drive")),
            (self.servos, tr("Servos")),
            (self.commands, tr("Commands")),
            (self.events, tr("Log")),
        ):
            self.pages.addTab(page, name)
        self._trends_card = trends
        self._right = _column((Card("", self.badge), 0), (_row(angle, distances), 3), (self.clearance, 0), (self.pages, 3))
        self._place_trends(tall=False)
        side.setLayout(self._right)
        side.setMinimumWidth(_RIGHT_WIDTH[0])
        side.setMaximumWidth(_RIGHT_WIDTH[1])
        return side


def _calibration_of(config: Config) -> CalibrationConfig | None:
    """What is known of the rig; None when nobody has measured it. A rig file that is broken is told by who opens the rig."""
    try:
        return calibration_of(config)
    except RigFileError:
        return None


def _note(text: str) -> QLabel:
    label = QLabel(text)
    label.setObjectName("card_note")
    return label


def _column(*parts: tuple[QWidget, int]) -> QVBoxLayout:
    """Widgets below each other, with their stretch."""
    column = QVBoxLayout()
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(theme.GAP)
    for widget, stretch in parts:
        column.addWidget(widget, stretch)
    return column


def _row(first: QWidget, second: QWidget) -> QWidget:
    """Two widgets side by side, equally wide."""
    holder = QWidget()
    row = QHBoxLayout(holder)
    row.setContentsMargins(0, 0, 0, 0)
    row.setSpacing(theme.GAP)
    row.addWidget(first, 1)
    row.addWidget(second, 1)
    return holder


def _trend_legend(with_distances: bool) -> str:
    """What the colours of the trends mean."""
    theta = f'<span style="color:{palette.THETA}">\N{HORIZONTAL BAR} \N{GREEK SMALL LETTER THETA} °</span>'
    distances = (
        f'&nbsp;&nbsp;&nbsp;<span style="color:{palette.D_HEAD}">\N{HORIZONTAL BAR} d_head px</span>&nbsp;&nbsp;&nbsp;'
        f'<span style="color:{palette.D_TAIL}">\N{MIDDLE DOT}\N{MIDDLE DOT}\N{MIDDLE DOT} d_tail px</span>'
    )
    return theta + distances if with_distances else theta
