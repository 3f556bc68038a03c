"""What the operator window and the player have in common: the widgets that show a scene, their places, and their View menu."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.ui.actions import MenuEntry, turn_page
from app.ui.i18n import tr
from app.ui.texts import REASON_TEXT
from app.ui.window_base import WindowFrame
from app.ui.workers import Pace
from app.widgets.advice_line import AdviceLine
from app.widgets.basics import Card, Columns, card_note, column, line, page_tabs, row, set_window_margins, side
from app.widgets.distance_bars import ClearanceBar, DistanceBars
from app.widgets.live_view import LiveView
from app.widgets.mode_bar import ModeBadge
from app.widgets.overlay_bar import OverlayBar
from app.widgets.scene_overlay import Layer
from app.widgets.state_badge import StateBadge
from app.widgets.theta_gauge import ThetaGauge
from core.calibration.camera import mm_per_working_px
from core.config.calibration import ScaleConfig
from core.config.models import PerceptionConfig, PoseConfig
from core.types import PoseState, RobotStatus, Scene, Tick

_LEFT_SHARE = 0.62
_RIGHT_WIDTH = (470, 660)  # least and most, px


class ScenePanels(QWidget):
    """Makes the widgets of a scene; a subclass lays them out and adds others.

    Parameters
    ----------
    perception : its limits of the pose states are shown on all dials.
    pixels_per_mm : of the picture.
    text_every_s : texts are renewed no more often, unless the state changes.
    """

    def __init__(self, perception: PerceptionConfig, pixels_per_mm: float, text_every_s: float) -> None:
        super().__init__()
        limits = perception.pose
        self.mode = ModeBadge()
        self.live = LiveView(pixels_per_mm)
        self.overlay_bar = OverlayBar()
        self.overlay_bar.toggled.connect(self.set_layer)
        self.advice = AdviceLine()
        self.badge = StateBadge(limits, perception.quality.confident_from)
        self.gauge = ThetaGauge(limits.theta_allow_deg)
        self.bars = DistanceBars(limits.d_allow_px)
        self.clearance = ClearanceBar()
        self.pages = page_tabs()
        self._allowed = (card_note(""), card_note(""))
        self._show_allowed(limits)
        self._scale: ScaleConfig | None = None
        self._text_pace = Pace(text_every_s)
        self._state: PoseState | None = None

    @property
    def views(self) -> tuple[LiveView, ...]:
        """The pictures that the overlays are drawn in."""
        return (self.live,)

    def set_layer(self, layer: Layer, on: bool) -> None:
        """An overlay on or off."""
        for view in self.views:
            view.set_layer(layer, on)

    def fit(self) -> None:
        """The whole picture."""
        for view in self.views:
            view.fit()

    # ---- a scene

    def _renews_text(self, scene: Scene, *, asked: bool = False) -> bool:
        """Whether texts are renewed now. A new state renews all of them, as it follows from the numbers beside it."""
        state = scene.pose.state if scene.pose is not None else None
        is_due = asked or self._text_pace.due() or state is not self._state
        self._state = state
        return is_due

    def _show_dials(self, scene: Scene, status: RobotStatus | None, *, renew_text: bool) -> None:
        self.gauge.show_pose(scene.pose, renew_text=renew_text)
        mm_per_px = mm_per_working_px(self._scale, scene)
        self.bars.set_scale(mm_per_px)
        self.clearance.set_scale(1.0 / mm_per_px if mm_per_px else None)
        self.bars.show_pose(scene.pose, renew_text=renew_text)
        self.clearance.show_scene(scene, status)

    def _show_advice(self, tick: Tick, why_none: str, *, renew_text: bool) -> None:
        """`why_none` is shown where the scene itself has no reason for the lack of advice."""
        if tick.scene.refusal is not None:
            why_none = tr(REASON_TEXT[tick.scene.refusal.reason].title).lower()
        self.advice.show_advice(tick.advice, self._state, why_none, is_unsure=self.badge.is_unsure, renew_text=renew_text)

    def _blank_dials(self, title: str, why: str) -> None:
        """Nothing is known now, and why."""
        self.badge.show_nothing(title, why)
        self.gauge.show_pose(None)
        self.bars.show_pose(None)
        self.advice.show_advice(None, None, title[0].lower() + title[1:])
        self.clearance.show_scene(None, None)

    def _show_allowed(self, limits: PoseConfig) -> None:
        angle, distances = self._allowed
        angle.setText(tr("allowed {limit:g}°", limit=limits.theta_allow_deg))
        distances.setText(tr("allowed {limit:g} px", limit=limits.d_allow_px))

    # ---- places

    def _dials(self) -> QWidget:
        """Angle and distances, side by side."""
        angle, distances = self._allowed
        return row(Card(tr("Angle to the vessel"), self.gauge, angle), Card(tr("Distances"), self.bars, distances))

    def _lay_out(self, header: QHBoxLayout, left: QWidget, right: QVBoxLayout) -> QWidget:
        """A header and two columns below it, ``columns``; returns their place, which a page may cover without the header."""
        stage = QWidget()
        self.columns = Columns(left, side(right, *_RIGHT_WIDTH), _LEFT_SHARE)
        stage.setLayout(line(self.columns))
        rows = column(header, (stage, 1))
        set_window_margins(rows)
        self.setLayout(rows)
        return stage


def add_scene_view_menu(window: WindowFrame, panels: ScenePanels, more: Sequence[MenuEntry] = ()) -> list[QAction]:
    """Overlays, the whole picture and `more`, pages; returns the actions in this order. Those of overlays follow their switches."""
    bar = panels.overlay_bar

    def toggle_all() -> None:
        bar.set_all(not any(bar.is_on(layer) for layer in Layer))

    layers = [MenuEntry(tr(layer.value.label), partial(bar.toggle, layer), (layer.value.key,), checked=True) for layer in Layer]
    entries = [
        *layers,
        MenuEntry(tr("&All overlays on or off"), toggle_all, ("0",)),
        None,
        MenuEntry(tr("&Whole picture"), panels.fit, ("F",)),
        *more,
        None,
        MenuEntry(tr("&Next page"), partial(turn_page, panels.pages, 1), ("Ctrl+Tab",)),
        MenuEntry(tr("&Previous page"), partial(turn_page, panels.pages, -1), ("Ctrl+Shift+Tab",)),
    ]
    actions = window.add_view_menu(entries)
    of_layer = dict(zip(Layer, actions, strict=False))
    bar.toggled.connect(lambda layer, on: of_layer[layer].setChecked(on))
    return actions
