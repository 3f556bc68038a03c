"""The last 30 seconds of theta and both distances, with the state as a band of colour below."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPen, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.ui.texts import tip
from app.ui.workers import Pace
from app.widgets.basics import column
from core.config.models import PoseConfig
from core.types import PoseState, Scene

SPAN_S = 30.0
_CAPACITY = 1024  # of the buffers
_DRAW_EVERY_S = 0.1
_CELL_S = 0.1  # of the band of states
_HOLD_S = 0.6  # a slow camera leaves no holes in the band, a silent one does
_ROOM_FOR_TICKS = 44.0  # height of a chart with three ticks
_ROOM_FOR_BOTH_PX = 130  # below this height two charts would be too low to be read
_UNLIMITED_PX = 16_777_215.0
_STATES: tuple[PoseState | None, ...] = (None, *PoseState)
_ANGLE_RANGES = (20.0, 45.0, 90.0, 180.0)
_DISTANCE_RANGES = (15.0, 30.0, 60.0, 120.0, 640.0)


class TrendPlot(QWidget):
    """Curves over fixed buffers, drawn ten times a second; frames without a pose are gaps.

    The scales change in a few steps only, so that a curve can be compared with what it was a second ago. In a low window only theta
    is drawn (``distances_shown``).
    """

    distances_shown = Signal(bool)

    def __init__(self, limits: PoseConfig) -> None:
        super().__init__()
        self._times_s = np.full(_CAPACITY, -np.inf)
        self._values = np.full((3, _CAPACITY), np.nan)
        self._states = np.zeros(_CAPACITY, np.uint8)
        self._pace = Pace(_DRAW_EVERY_S)
        self.setMinimumHeight(78)
        self.has_distances = True  # there is room for the chart of both distances
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Trends of theta, d_head and d_tail over the last 30 seconds"))
        self.setToolTip(tip("trends"))
        view = pg.GraphicsLayoutWidget()
        view.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        view.viewport().setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        view.ci.layout.setContentsMargins(0, 4, 14, 0)
        view.ci.layout.setVerticalSpacing(14)  # the ticks of two scales are told apart
        view.ci.layout.setHorizontalSpacing(0)
        self.setLayout(column(view))
        self._angle = _Chart(view, 0, _ANGLE_RANGES, is_signed=True, allowed=limits.theta_allow_deg)
        self._distance = _Chart(view, 1, _DISTANCE_RANGES, is_signed=False, allowed=limits.d_allow_px)
        self.curves = (self._angle.add_curve(), self._distance.add_curve(), self._distance.add_curve())  # theta, d_head, d_tail
        self._band = _StateBand(view, 2)
        self._view = view
        self.follow_theme()

    def follow_theme(self) -> None:
        """Ground, axes, curves and bands in the colours of the scheme."""
        self._view.setBackground(theme.PANEL)
        solid = Qt.PenStyle.SolidLine
        looks = ((theme.THETA, solid), (theme.D_HEAD, solid), (theme.D_TAIL, Qt.PenStyle.DotLine))
        for curve, (name, style) in zip(self.curves, looks, strict=True):
            curve.setPen(pg.mkPen(name, width=1.5, style=style))
        for part in (self._angle, self._distance, self._band):
            part.follow_theme()

    def set_limits(self, limits: PoseConfig) -> None:
        """The limits of the green bands."""
        self._angle.set_allowed(limits.theta_allow_deg)
        self._distance.set_allowed(limits.d_allow_px)

    def minimumSizeHint(self) -> QSize:
        return QSize(200, 78)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        fits = self.height() >= _ROOM_FOR_BOTH_PX
        if fits is not self.has_distances:
            self.has_distances = fits
            self._distance.set_visible(fits)
            self.distances_shown.emit(fits)

    def add(self, scene: Scene) -> None:
        """Append one frame's values; a clock that jumps back (a recording that starts again) clears the plot."""
        if scene.captured_s < self._times_s[-1]:
            self.clear()
        pose = scene.pose
        for buffer in (self._times_s, self._states, *self._values):
            buffer[:-1] = buffer[1:]
        self._times_s[-1] = scene.captured_s
        self._states[-1] = _STATES.index(pose.state if pose is not None else None)
        self._values[:, -1] = (pose.theta_signed_deg, pose.d_head_px, pose.d_tail_px) if pose is not None else np.nan
        if self._pace.due():
            self._draw()

    def show_silence(self, age_s: float) -> None:
        """No picture for so long: the curves move on to the left and end before now."""
        if self._pace.due():
            self._draw(age_s)

    def clear(self) -> None:
        self._times_s[:] = -np.inf
        self._values[:] = np.nan
        self._states[:] = 0
        self._draw()

    def _draw(self, age_s: float = 0.0) -> None:
        """As seen `age_s` after the newest value."""
        now_s = self._times_s[-1] + age_s
        first = int(np.searchsorted(self._times_s, now_s - SPAN_S)) if np.isfinite(now_s) else _CAPACITY
        ago_s = self._times_s[first:] - now_s
        values = self._values[:, first:]
        for curve, series in zip(self.curves, values, strict=True):
            curve.setData(ago_s, series, connect="finite")
        self._angle.fit(values[:1])
        self._distance.fit(values[1:])
        self._band.show(ago_s, self._states[first:])


def _add_box(view: pg.GraphicsLayoutWidget, row: int) -> pg.ViewBox:
    """A view of the last 30 s, without the menus and buttons of a ``PlotItem``."""
    box = pg.ViewBox(enableMenu=False, enableMouse=False, defaultPadding=0.0)
    box.setXRange(-SPAN_S, 0.0, padding=0)
    view.addItem(box, row, 1)
    return box


def _colour_axis(axis: pg.AxisItem) -> None:
    axis.setPen(QPen(QColor(theme.LINE)))
    axis.setTextPen(QPen(QColor(theme.TEXT_DIM)))


def _add_axis(view: pg.GraphicsLayoutWidget, row: int, side: str, box: pg.ViewBox) -> pg.AxisItem:
    axis = pg.AxisItem(side)
    axis.linkToView(box)
    axis.setStyle(tickFont=theme.font(theme.Size.LABEL), tickLength=-3, hideOverlappingLabels=False)
    axis.setStyle(autoExpandTextSpace=False, autoReduceTextSpace=False)
    view.addItem(axis, row, 0 if side == "left" else 1)
    return axis


class _Chart:
    """Curves over a fixed time axis, with a value axis that steps through a few ranges."""

    def __init__(
        self, view: pg.GraphicsLayoutWidget, row: int, ranges: tuple[float, ...], *, is_signed: bool, allowed: float
    ) -> None:
        self._ranges = ranges
        self._is_signed = is_signed
        self._range = 0.0
        self._ticks: tuple[float, ...] = ()
        self._box = _add_box(view, row)
        self._axis = _add_axis(view, row, "left", self._box)
        self._axis.setWidth(40)
        self._band = pg.LinearRegionItem(orientation="horizontal", movable=False, pen=QPen(QColor(0, 0, 0, 0)))
        self._band.setZValue(-10)
        self._box.addItem(self._band, ignoreBounds=True)
        self.set_allowed(allowed)
        self.fit(np.full((1, 1), np.nan))

    def follow_theme(self) -> None:
        _colour_axis(self._axis)
        self._band.setBrush(theme.colour(theme.ALLOWED, 0.16))

    def set_allowed(self, allowed: float) -> None:
        self._band.setRegion((-allowed if self._is_signed else 0.0, allowed))

    def add_curve(self) -> pg.PlotCurveItem:
        curve = pg.PlotCurveItem(connect="finite")
        self._box.addItem(curve, ignoreBounds=True)
        return curve

    def set_visible(self, on: bool) -> None:
        """Show the chart, or give its room to the other one."""
        for item in (self._box, self._axis):
            item.setVisible(on)
            item.setMaximumHeight(_UNLIMITED_PX if on else 0.0)

    def fit(self, values: np.ndarray) -> None:
        """The smallest range that holds all values; it shrinks again only when there is room to spare."""
        finite = values[np.isfinite(values)]
        largest = float(np.abs(finite).max()) if finite.size else 0.0
        wanted = next((r for r in self._ranges if largest <= r), self._ranges[-1])
        if wanted < self._range and largest > 0.8 * wanted:
            wanted = self._range
        low = -wanted if self._is_signed else 0.0
        if wanted != self._range:
            self._range = wanted
            self._box.setYRange(low, wanted, padding=0.04)
        ticks = (low, (low + wanted) / 2, wanted) if self._box.height() > _ROOM_FOR_TICKS else (0.0, wanted)
        if ticks != self._ticks:
            self._ticks = ticks
            self._axis.setTicks([[(tick, f"{tick:g}".replace("-", "\N{MINUS SIGN}")) for tick in ticks]])


class _StateBand:
    """A narrow strip whose colour is the state, with the time axis below it."""

    def __init__(self, view: pg.GraphicsLayoutWidget, row: int) -> None:
        box = _add_box(view, row)
        box.setYRange(0.0, 1.0, padding=0)
        box.setFixedHeight(8)
        self._axis = bottom = _add_axis(view, row + 1, "bottom", box)
        bottom.setHeight(18)
        bottom.setTicks([[(float(s), f"\N{MINUS SIGN}{-s}" if s else "0 s") for s in (-30, -20, -10, 0)]])
        self._cells_s = np.arange(-SPAN_S + _CELL_S / 2, 0.0, _CELL_S)
        self._image = pg.ImageItem(axisOrder="row-major")
        box.addItem(self._image, ignoreBounds=True)
        self._cells = np.zeros(len(self._cells_s), np.uint8)
        self.follow_theme()

    def follow_theme(self) -> None:
        _colour_axis(self._axis)
        colours = [theme.colour(theme.LINE, 0.6)] + [QColor(theme.STATE_COLOUR[state]) for state in PoseState]
        self._table = np.array([[c.red(), c.green(), c.blue(), c.alpha()] for c in colours], np.uint8)
        self._paint()

    def show(self, ago_s: np.ndarray, states: np.ndarray) -> None:
        cells = np.zeros(len(self._cells_s), np.uint8)
        if len(ago_s):
            newest = np.searchsorted(ago_s, self._cells_s + _CELL_S, side="right") - 1
            fresh = (newest >= 0) & (self._cells_s - ago_s[np.maximum(newest, 0)] < _HOLD_S)
            cells[fresh] = states[newest[fresh]]
        self._cells = cells
        self._paint()

    def _paint(self) -> None:
        self._image.setImage(self._table[self._cells][None], autoLevels=False)
        self._image.setRect(QRectF(-SPAN_S, 0.0, SPAN_S, 1.0))
