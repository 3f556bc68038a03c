"""Loss and Dice of a training, step by step."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPen
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app import palette, theme
from app.language import tr, tr_text
from app.training_job import TrainingState


class TrainingCurves(QWidget):
    """Left the loss; right Dice of vessel and robot: thin on what is trained on, dots on the held-out pictures."""

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName(tr("Loss and Dice of the training, by step"))
        self.setMinimumHeight(170)
        self.setToolTip(
            tr(
                "Left: the loss, which training makes small. Right: Dice, the agreement of what is found with what was drawn by "
                "hand, 1 at best. What counts are the held-out pictures: when they get no better any more, it has learnt enough."
            )
        )
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(theme.GAP)
        self._loss_plot, self._dice_plot = self._plot(tr("loss")), self._plot("Dice")
        self._dice_plot.setYRange(0.0, 1.0, padding=0.05)
        for plot in (self._loss_plot, self._dice_plot):
            row.addWidget(plot, 1)
        self._loss = self._loss_plot.plot(pen=_pen(palette.TEXT, 1.8))
        self._lines, self._dots = {}, {}
        legend = self._dice_plot.addLegend(offset=(-6, -6), labelTextColor=palette.TEXT_DIM, verSpacing=-4)
        legend.setLabelTextSize("11px")
        for name, colour, symbol in (("vessel", palette.VESSEL, "o"), ("robot", palette.ROBOT, "s")):
            self._lines[name] = self._dice_plot.plot([], [], pen=_pen(colour, 1.0), name=tr("{name}, learning", name=tr_text(name)))
            dots = {"symbol": symbol, "symbolBrush": QColor(colour), "symbolPen": None, "symbolSize": 8}
            pen = _pen(colour, 2.0, Qt.PenStyle.DashLine)
            self._dots[name] = self._dice_plot.plot([], [], pen=pen, name=tr("{name}, held out", name=tr_text(name)), **dots)

    def _plot(self, unit: str) -> pg.PlotWidget:
        plot = pg.PlotWidget(background=palette.PANEL)
        plot.setMenuEnabled(False)
        plot.setMouseEnabled(False, False)
        plot.hideButtons()
        plot.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        for side, label in (("left", unit), ("bottom", tr("step"))):
            axis = plot.getAxis(side)
            axis.setPen(QPen(QColor(palette.LINE)))
            axis.setTextPen(QPen(QColor(palette.TEXT_DIM)))
            axis.setStyle(tickFont=theme.font(theme.Size.LABEL))
            axis.setLabel(label, color=palette.TEXT_DIM)
            axis.enableAutoSIPrefix(False)  # a loss has no milli
        plot.getPlotItem().layout.setContentsMargins(1, 8, 1, 1)  # the uppermost number is not cut
        return plot

    def show_state(self, state: TrainingState) -> None:
        """Draw all that is known."""
        curve = np.array(state.curve, np.float64).reshape(-1, 4)
        self._loss.setData(curve[:, 0], curve[:, 1])
        steps = [look.step for look in state.looks]
        held_out = {"vessel": [look.vessel_dice for look in state.looks], "robot": [look.robot_dice for look in state.looks]}
        for place, name in ((2, "vessel"), (3, "robot")):
            self._lines[name].setData(curve[:, 0], curve[:, place])
            self._dots[name].setData(steps, held_out[name])
        for plot in (self._loss_plot, self._dice_plot):
            plot.setXRange(0, max(state.steps, 1), padding=0.02)


def _pen(colour: str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    pen = QPen(QColor(colour), width, style)
    pen.setCosmetic(True)
    return pen
