"""The training dialog: what to train, loss and Dice by step, pictures before and after, and stop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QColor, QFontMetrics, QKeyEvent, QPen, QPixmap, QResizeEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QSizePolicy,
    QSpinBox,
    QWidget,
)

from app.operator.models import installed_models
from app.training.model import STEPS, Collect, TrainingJob, TrainingPhase, TrainingRequest, TrainingState, free_name, name_problem
from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.widgets.basics import Card, button, card_title, column, line, takes_enter


class TrainingCurves(QWidget):
    """Left the loss; right Dice of vessel and robot: thin on what is trained on, dots on the held-out pictures."""

    def __init__(self) -> None:
        super().__init__(accessibleName=tr("Loss and Dice of the training, by step"), minimumHeight=170)
        self.setToolTip(
            tr(
                "Left: the loss, which training makes small. Right: Dice, the agreement of what is found with what was drawn by "
                "hand, 1 at best. What counts are the held-out pictures: when they get no better any more, it has learnt enough."
            )
        )
        self._loss_plot, self._dice_plot = self._plot(tr("loss")), self._plot("Dice")
        self._dice_plot.setYRange(0.0, 1.0, padding=0.05)
        self.setLayout(line((self._loss_plot, 1), (self._dice_plot, 1)))
        self._loss = self._loss_plot.plot(pen=_pen(theme.TEXT, 1.8))
        self._lines, self._dots = {}, {}
        legend = self._dice_plot.addLegend(offset=(-6, -6), labelTextColor=theme.TEXT_DIM, verSpacing=-4)
        legend.setLabelTextSize("11px")
        for name, colour, symbol in (("vessel", theme.VESSEL, "o"), ("robot", theme.ROBOT, "s")):
            self._lines[name] = self._dice_plot.plot([], [], pen=_pen(colour, 1.0), name=tr("{name}, learning", name=tr_text(name)))
            dots = {"symbol": symbol, "symbolBrush": QColor(colour), "symbolPen": None, "symbolSize": 8}
            pen = _pen(colour, 2.0, Qt.PenStyle.DashLine)
            self._dots[name] = self._dice_plot.plot([], [], pen=pen, name=tr("{name}, held out", name=tr_text(name)), **dots)

    def _plot(self, unit: str) -> pg.PlotWidget:
        plot = pg.PlotWidget(background=theme.PANEL)
        plot.setMenuEnabled(False)
        plot.setMouseEnabled(False, False)
        plot.hideButtons()
        plot.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        for side, label in (("left", unit), ("bottom", tr("step"))):
            axis = plot.getAxis(side)
            axis.setPen(QPen(QColor(theme.LINE)))
            axis.setTextPen(QPen(QColor(theme.TEXT_DIM)))
            axis.setStyle(tickFont=theme.font(theme.Size.LABEL))
            axis.setLabel(label, color=theme.TEXT_DIM)
            axis.enableAutoSIPrefix(False)  # a loss has no milli
        plot.getPlotItem().layout.setContentsMargins(1, 8, 1, 1)  # the uppermost number is not cut
        return plot

    def show_state(self, state: TrainingState) -> None:
        curve = np.array(state.curve, np.float64).reshape(-1, 4)
        self._loss.setData(curve[:, 0], curve[:, 1])
        steps = [one.step for one in state.held_out]
        held_out = {"vessel": [one.vessel_dice for one in state.held_out], "robot": [one.robot_dice for one in state.held_out]}
        for place, name in ((2, "vessel"), (3, "robot")):
            self._lines[name].setData(curve[:, 0], curve[:, place])
            self._dots[name].setData(steps, held_out[name])
        for plot in (self._loss_plot, self._dice_plot):
            plot.setXRange(0, max(state.steps, 1), padding=0.02)


def _pen(colour: str, width: float, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    pen = QPen(QColor(colour), width, style)
    pen.setCosmetic(True)
    return pen


class _Picture(QLabel):
    """A file's picture, as large as fits."""

    def __init__(self, name: str, waiting: str) -> None:
        super().__init__(alignment=Qt.AlignmentFlag.AlignCenter)
        self._waiting = waiting
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        self.setMinimumSize(200, 130)
        theme.set_sheet(self, "color: @TEXT_FAINT;")
        self._pixmap = QPixmap()

    def show_file(self, path: Path | None) -> None:
        self._pixmap = QPixmap(str(path)) if path is not None and path.is_file() else QPixmap()
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._fit()

    def sizeHint(self) -> QSize:
        return QSize(320, 220)

    def _fit(self) -> None:
        if self._pixmap.isNull():
            self.setText(self._waiting)
            return
        smooth = Qt.TransformationMode.SmoothTransformation
        self.setPixmap(self._pixmap.scaled(self.size(), Qt.AspectRatioMode.KeepAspectRatio, smooth))


class BeforeAfter(QWidget):
    """Two pictures side by side, of one frame at a time. ``is_drawn``: the lines are masks drawn by hand, not the difference."""

    def __init__(self, *, is_drawn: bool = True) -> None:
        super().__init__()
        self._is_drawn = is_drawn
        self._before: tuple[str, ...] = ()
        self._after: tuple[str, ...] = ()
        self._place = 0
        self._left = _Picture(tr("Before"), tr("shown when the training has begun"))
        self._right = _Picture(tr("After"), tr("shown when it has learnt"))
        self._title = QLabel()
        self._title.setObjectName("card_note")
        self._next = button(tr("&Next picture"), self._on_next)
        left = column(card_title(tr("Before")), (self._left, 1), spacing=6)
        right = column(card_title(tr("After")), (self._right, 1), spacing=6)
        foot = line((self._title, 1), self._next, spacing=6)
        self.setLayout(column((line((left, 1), (right, 1), spacing=6), 1), foot, spacing=6))
        self._show()

    def show_pictures(self, before: tuple[str, ...], after: tuple[str, ...]) -> None:
        """Paths of the same frames then and now; the files are read again, for they may have been rewritten."""
        self._before, self._after = before, after
        self._place = min(self._place, max(0, len(before) - 1))
        self._show()

    def _on_next(self) -> None:
        self._place = (self._place + 1) % max(1, len(self._before))
        self._show()

    def _show(self) -> None:
        count = len(self._before)
        self._next.setEnabled(count > 1)
        for picture, paths in ((self._left, self._before), (self._right, self._after)):
            picture.show_file(Path(paths[self._place]) if self._place < len(paths) else None)
        colours = theme.ON_PICTURE
        square = '<span style="color:{}">\N{BLACK SQUARE}</span>&nbsp;{}'.format
        vessel, robot = square(colours.VESSEL, tr("vessel")), square(colours.ROBOT, tr("robot"))
        found, place = tr("colour: found ({vessel}, {robot})", vessel=vessel, robot=robot), self._place + 1
        if self._is_drawn:
            which = tr("Held-out picture {place} of {count}; {found}, line: drawn by hand", place=place, count=count, found=found)
        else:
            which = tr("Held-out picture {place} of {count}; {found}, line: the difference", place=place, count=count, found=found)
        self._title.setText(which if count else tr("Held-out pictures"))


_SIZE = QSize(940, 640)


class TrainingDialog(QDialog):
    """Shows a job and starts and stops it. Closing it while it trains only hides it: the training goes on.

    Parameters
    ----------
    collect : reads annotations and images; see ``TrainingJob``.
    source : where they come from, for the heading.
    """

    def __init__(self, collect: Collect, source: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.job = TrainingJob(collect, self)
        self.setWindowTitle(tr("Train on my annotations"))
        self.setModal(False)
        self.resize(_SIZE)
        theme.set_sheet(self, theme.FORM_SHEET)
        self.name, self.init, self.steps = QLineEdit(), QComboBox(), QSpinBox()
        self.start, self.stop = button(tr("&Train"), self._on_start), button(tr("&Stop, keep what was learnt"), self.job.stop)
        self.hide_button = button(tr("&Close"), self.close)
        self.curves, self.pictures = TrainingCurves(), BeforeAfter()
        self._bar, self._line = QProgressBar(), QLabel()
        self._line.setWordWrap(True)
        self._line.setMinimumHeight(38)
        self._bar.setTextVisible(False)
        self._bar.setFixedHeight(8)
        self.start.setObjectName("main_button")
        heading = card_title("")
        from_where, room = tr("Masks from {source}", source=source), _SIZE.width() - 48
        heading.setText(QFontMetrics(theme.semi_bold(12)).elidedText(from_where, Qt.TextElideMode.ElideMiddle, room))
        heading.setToolTip(source)
        heading.setAccessibleName(from_where)
        foot = line((self._bar, 1), self.stop, self.hide_button)
        cards = (Card("", self.curves), 4), (Card("", self.pictures), 6)
        self.setLayout(column(heading, self._form(), *cards, self._line, foot, margins=(16, 12, 16, 12)))
        self.job.changed.connect(self._on_changed)
        self._on_changed(self.job.state)
        self.job.count()

    def _form(self) -> QHBoxLayout:
        self.name.setMaxLength(40)
        self.name.setText(free_name("own"))
        for model in installed_models():
            if not model.problem:
                self.init.addItem(tr("{name} (own)", name=model.name) if model.is_own else model.name, model.name)
        self.steps.setRange(10, 20_000)
        self.steps.setSingleStep(100)
        self.steps.setValue(STEPS)
        self.steps.setSuffix(tr(" steps"))
        own = tr("Letters, digits, - and _; the Model menu lists it under this name")
        kept = tr("What this model can do is kept as far as possible, and the new look is learnt on top")
        longer = tr("More steps learn more and take longer: on two processor cores a step takes about a second")
        row = QHBoxLayout()
        for word, entry, stretch, name, tip in (
            (tr("New model"), self.name, 2, tr("Name of the new model"), own),
            (tr("starts from"), self.init, 3, tr("Model to start from"), kept),
            (tr("for"), self.steps, 1, tr("Steps of training"), longer),
        ):
            label = QLabel(word)
            label.setBuddy(entry)
            entry.setAccessibleName(name)
            entry.setToolTip(tip)
            row.addWidget(label)
            row.addWidget(entry, stretch)
        row.addWidget(self.start)
        return row

    @property
    def line(self) -> str:
        """The state in words, as shown."""
        return self._line.text()

    @property
    def is_busy(self) -> bool:
        return self.job.state.is_busy

    def end(self) -> None:
        """The window behind it closes: a training that goes on ends by itself and keeps what it learnt."""
        self.job.close()
        self.close()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not takes_enter(self, event):
            super().keyPressEvent(event)

    def _on_start(self) -> None:
        self.job.start(TrainingRequest(self.name.text().strip(), str(self.init.currentData() or "default"), self.steps.value()))

    def _on_changed(self, state: TrainingState) -> None:
        for entry in (self.name, self.init, self.steps, self.start):
            entry.setEnabled(not state.is_busy)
        self.stop.setEnabled(state.phase is TrainingPhase.RUNNING)
        self.hide_button.setText(tr("&Hide, go on training") if state.is_busy else tr("&Close"))
        self._bar.setRange(0, state.steps if state.step or not state.is_busy else 0)
        self._bar.setValue(state.steps if state.phase is TrainingPhase.DONE else state.step)
        self._line.setText(_words(state))
        self.setAccessibleDescription(self._line.text())
        self.curves.show_state(state)
        if state.held_out:
            after = state.held_out[-1].pictures if len(state.held_out) > 1 else ()
            self.pictures.show_pictures(state.held_out[0].pictures, after)
        if state.phase is TrainingPhase.DONE and name_problem(self.name.text()):
            self.name.setText(free_name("own"))


def _words(state: TrainingState) -> str:
    if state.phase is TrainingPhase.IDLE:
        how = tr(
            "The masks become two sets: one to learn from, and a fifth of the pictures that stays out and shows whether it helped. "
            "It runs at low priority, and the new model is used only when you choose it."
        )
        return f"{tr_text(state.line)} {how}" if state.line else how
    if state.phase is not TrainingPhase.RUNNING or not state.step:
        return tr_text(state.line)
    left = ""
    if state.left_s is not None:
        time = f"{state.left_s:.0f} s" if state.left_s < 90 else tr("{minutes:.0f} min", minutes=state.left_s / 60)
        left = tr(", {duration} left", duration=time)
    _, loss, vessel, robot = state.curve[-1]
    return tr(
        "Step {step} of {steps}{left}. Loss {loss:.3f}, Dice vessel {vessel:.2f}, robot {robot:.2f}. {line}",
        step=state.step,
        steps=state.steps,
        left=left,
        loss=loss,
        vessel=vessel,
        robot=robot,
        line=tr_text(state.line),
    )
