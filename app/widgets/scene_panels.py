"""What the operator window and the player have in common: the widgets that show a scene, their places, and their View menu."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QAction, QColor, QPainter, QPen
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.ui import theme
from app.ui.actions import MenuEntry, action_of, turn_page
from app.ui.i18n import tr, tr_text
from app.ui.texts import REASON_TEXT, advice_headline, override_line, tip
from app.ui.window_base import WindowFrame
from app.ui.workers import Pace
from app.widgets.basics import Card, Columns, card_note, column, line, page_tabs, row, set_window_margins, side
from app.widgets.distance_bars import ClearanceBar, DistanceBars
from app.widgets.live_view import LiveView
from app.widgets.mode_bar import ModeBadge
from app.widgets.painting import PaintedWidget, draw_box, draw_text, polygon, set_colours
from app.widgets.scene_overlay import Layer, OverlayBar, rehearsal_shapes
from app.widgets.state_badge import StateBadge
from app.widgets.theta_gauge import ThetaGauge
from core.calibration.camera import mm_per_working_px
from core.config.calibration import ScaleConfig
from core.config.models import PerceptionConfig, PoseConfig
from core.evaluation.rehearsal import RehearsalResult
from core.types import Advice, PoseState, RobotStatus, Scene, Speed, Tick

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
        return (self.live,)

    def set_layer(self, layer: Layer, on: bool) -> None:
        for view in self.views:
            view.set_layer(layer, on)

    def fit(self) -> None:
        for view in self.views:
            view.fit()

    def show_rehearsal(self, result: RehearsalResult | None) -> None:
        """What a rehearsal found on the way to the target, over the picture; None: nothing."""
        shapes = rehearsal_shapes(result) if result is not None else None
        for view in self.views:
            view.show_rehearsal(shapes)
        self.overlay_bar.show_rehearsal(shapes is not None)

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
        angle.setText(tr("A: up to {limit:g}°", limit=limits.theta_allow_deg))
        distances.setText(tr("A: up to {limit:g} px", limit=limits.d_allow_px))

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


def overlay_actions(window: WindowFrame) -> dict[str, QAction]:
    """The entries of the overlays in the View menu, by names for files."""
    return {layer.name.lower(): action_of(window, layer.value.key) for layer in Layer}


_CHEVRONS = {Speed.STOP: 0, Speed.SLOWEST: 1, Speed.SLOW: 2, Speed.MODERATE: 3, Speed.FAST: 4}


class AdviceLine(PaintedWidget):
    """An arrow turned by the steering angle, the speed as word and as one to four chevrons, the degrees and the reason.

    Arrow and chevrons point up to advance, and down to back off, as the keys do; Stop is a square. Where the route decides, not
    the state, it says so, as the badge does. Without advice it is blank and says why. Where the pose is unsure it says so.
    """

    def __init__(self) -> None:
        super().__init__(tr("Advice"), tip("advice"), hint=(600, 68), height=68)
        self._advice: Advice | None = None
        self._state: PoseState | None = None
        self._why_none = tr("waiting for the first picture")
        self._is_unsure = False
        self.is_recorded = False
        """It was given when the picture was recorded, not now."""

    @property
    def text(self) -> str:
        """Headline and reason as shown."""
        if self._advice is None:
            return tr("No advice: {why}", why=tr_text(self._why_none))
        return f"{advice_headline(self._advice)}: {self._why(self._advice)}"

    def show_advice(
        self,
        advice: Advice | None,
        state: PoseState | None,
        why_none: str,
        *,
        is_unsure: bool = False,
        renew_text: bool = True,
    ) -> None:
        """The advice for `state`, whose pose may be unsure, or the reason why there is no advice."""
        changed = (advice is None) is not (self._advice is None) or state is not self._state or why_none != self._why_none
        if not changed and not renew_text:
            return
        self._advice, self._state, self._why_none, self._is_unsure = advice, state, why_none, is_unsure
        self.setAccessibleDescription(self.text)
        self.update()

    def _why(self, advice: Advice) -> str:
        why = "; ".join(part for part in (tr_text(advice.why), override_line(advice, self._state, with_rule=False)) if part)
        return tr("the pose is unsure; {why}", why=why) if self._is_unsure else why

    def paint(self, painter: QPainter) -> None:
        frame, advice = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), self._advice
        draw_box(painter, frame, theme.RADIUS, theme.PANEL, theme.LINE)
        if advice is None:
            draw_text(painter, frame.adjusted(20, 0, -20, 0), self.text, theme.semi_bold(20), theme.TEXT_FAINT)
            return
        accent = theme.STATE_COLOUR[self._state]
        draw_box(painter, QRectF(frame.left(), frame.top(), 6, frame.height()), 3, accent)
        is_back = advice.advance_mm_s < 0.0
        if advice.speed is not Speed.STOP:
            _paint_arrow(painter, QPointF(frame.left() + 48, frame.center().y()), 24.0, advice.steer_deg, accent, is_back=is_back)
        _paint_chevrons(painter, QPointF(frame.left() + 92, frame.center().y()), _CHEVRONS[advice.speed], is_back=is_back)
        left = frame.left() + 168
        headline = QRectF(left, frame.top() + 6, frame.right() - left - 16, 34)
        words, ink = advice_headline(advice), theme.TEXT
        if self.is_recorded:
            words, ink = tr("Then: {advice}", advice=words), theme.TEXT_DIM
        draw_text(painter, headline, words, theme.bold(theme.Size.TITLE), ink, smallest_px=11)
        why = QRectF(left, frame.top() + 40, headline.width(), 22)
        colour = theme.FAULT if self._is_unsure else theme.TEXT_DIM
        draw_text(painter, why, self._why(advice), theme.font(15), colour, smallest_px=11, elided=True)


def _paint_arrow(painter: QPainter, middle: QPointF, size: float, turn_deg: float, colour: str, *, is_back: bool) -> None:
    """An arrow upwards (straight on), turned clockwise by the advised steering (to the robot's right).

    Backing off, it points down, and its upper end, where the head is, leans to the side to which the head turns.
    """
    painter.save()
    painter.translate(middle)
    painter.rotate(max(-90.0, min(90.0, turn_deg)))
    if is_back:
        painter.scale(1.0, -1.0)
    head, shaft = size * 0.62, size * 0.24
    right = [(0, -size), (head, -size * 0.28), (shaft, -size * 0.28), (shaft, size * 0.9)]
    set_colours(painter, colour, theme.edge_of(colour))
    painter.drawPolygon(polygon([*right, *((-x, y) for x, y in reversed(right[1:]))]))
    painter.restore()


def _paint_chevrons(painter: QPainter, left_middle: QPointF, count: int, *, is_back: bool) -> None:
    """Four chevrons, `count` of them lit, that point up, or down where the advice is to back off; a square where it is to stop."""
    if count == 0:
        set_colours(painter, theme.TEXT)
        painter.drawRect(QRectF(left_middle.x() + 20, left_middle.y() - 11, 22, 22))
        return
    across, along = 5.5, 4.5
    tip_y = along if is_back else -along
    for k in range(max(_CHEVRONS.values())):
        pen = QPen(QColor(theme.TEXT if k < count else theme.LINE), 3.5)
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
        set_colours(painter, None, pen)
        middle = left_middle + QPointF(across + 16 * k, 0)
        painter.drawPolyline(polygon([(-across, -tip_y), (0.0, tip_y), (across, -tip_y)], middle))
