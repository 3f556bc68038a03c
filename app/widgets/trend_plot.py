"""The last 30 seconds of theta and both distances, with the state as a band of colour."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPen
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from app import theme
from app.pace import Pace
from core.config import PoseConfig
from core.types import PoseState, Scene

SPAN_S = 30.0
_CAPACITY = 1024
_DRAW_EVERY_S = 0.1
_BAND_CELLS = 300
_STATES: tuple[PoseState | None, ...] = (None, PoseState.A, PoseState.B, PoseState.C, PoseState.D)


class TrendPlot(QWidget):
    """Curves over fixed buffers; frames without a pose are gaps. Drawn ten times a second, however fast ticks come."""

    def __init__(self, limits: PoseConfig) -> None:
        super().__init__()
        self._times_s = np.full(_CAPACITY, -np.inf)
        self._values = np.full((3, _CAPACITY), np.nan)
        self._states = np.zeros(_CAPACITY, np.uint8)
        self._pace = Pace(_DRAW_EVERY_S)
        self.setMinimumHeight(130)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Trends of the last 30 seconds")
        view = pg.GraphicsLayoutWidget()
        view.setBackground(theme.PANEL)
        view.ci.layout.setContentsMargins(0, 0, 0, 0)
        view.ci.layout.setSpacing(2)
        view.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(view)
        self._angle = _plot(view, 0, (-45.0, 45.0), "θ", "[-45, 0, 45]")
        self._distance = _plot(view, 1, (0.0, 30.0), "d", "")
        self._angle.addItem(_band(-limits.theta_allow_deg, limits.theta_allow_deg))
        self._distance.addItem(_band(0.0, limits.d_allow_px))
        self._curves = (
            self._angle.plot(pen=_pen(theme.THETA, 1.6), connect="finite"),
            self._distance.plot(pen=_pen(theme.D_HEAD, 1.6), connect="finite"),
            self._distance.plot(pen=_pen(theme.D_TAIL, 1.6, Qt.PenStyle.DotLine), connect="finite"),
        )
        self._state_band = _StateBand()
        self._distance.addItem(self._state_band)


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

    def clear(self) -> None:
        self._times_s[:] = -np.inf
        self._values[:] = np.nan
        self._states[:] = 0
        self._draw()
