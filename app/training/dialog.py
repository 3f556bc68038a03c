"""Training on one's own annotations, watched: what to call it, how it goes, what it changes, and stop.

Loss and Dice of a training, step by step.

The same picture before and after: what a network found of it then, and finds now.

A training on one's own annotations: masks become sets, ``train`` runs as a process at low priority, and its progress is kept.

Where a training's annotations come from: an annotation file and the images beside it, or those of an open annotator window.
"""

from __future__ import annotations

import re
import shutil
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import platformdirs
import pyqtgraph as pg
from PySide6.QtCore import QObject, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QKeyEvent, QPen, QPixmap, QResizeEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.operator.models import InstalledModel, installed_models
from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.workers import ChildProcess, Worker, command_of
from app.widgets.basics import Card, takes_enter
from core.annotation.model import AnnotationError
from core.annotation.store import AnnotationStore, FoundImage, StoredAnnotation
from core.perception.model_file import MODELS, own_models

if TYPE_CHECKING:
    from core.annotation.exchange import OwnFrames


STEPS = 400
_INTERRUPTED = 130
"""Exit code of ``train`` that was stopped before its first step."""
_BATCH, _RATE, _CROP, _LOOK_SHARE = 8, 2e-3, 256, 0.7
"""For a network that can see already: a fifth of the rate with which it was taught, so that it does not forget."""
REMEMBER = 80
"""Frames of the twin that are made first, in half a minute, and shown as often as the new ones (docs/method.md)."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
_END_WITHIN_MS = 3000

Collect = Callable[[], tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]]
"""Reads the annotations and finds their images; called in a thread of its own, may raise UserError."""


class TrainingPhase(Enum):
    """Where a training is."""

    IDLE = "idle"
    PREPARING = "preparing"
    RUNNING = "running"
    STOPPING = "stopping"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class HeldOutLook:
    """Dice on the frames that are not trained on, after so many steps, and pictures of some of them."""

    step: int
    vessel_dice: float
    robot_dice: float
    pictures: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TrainingState:
    """What the dialog shows. ``curve``: step, loss, and Dice of vessel and robot on what is trained on. ``line``: how it is."""

    phase: TrainingPhase = TrainingPhase.IDLE
    line: str = ""
    name: str = ""
    steps: int = STEPS
    curve: tuple[tuple[int, float, float, float], ...] = ()
    looks: tuple[HeldOutLook, ...] = ()
    left_s: float | None = None
    frames: OwnFrames | None = None

    @property
    def step(self) -> int:
        return self.curve[-1][0] if self.curve else 0

    @property
    def is_busy(self) -> bool:
        return self.phase in {TrainingPhase.PREPARING, TrainingPhase.RUNNING, TrainingPhase.STOPPING}


@dataclass(frozen=True, slots=True)
class Wish:
    """What is asked for: the new model's name, the one to start from, how long, and with how many frames of the twin beside."""

    name: str
    init: str = "default"
    steps: int = STEPS
    remember: int = REMEMBER


def name_problem(name: str) -> str:
    """Why a model cannot be called so; empty when it can."""
    if not _NAME.fullmatch(name):
        return tr("a name is letters, digits, - and _, 40 at most")
    if (MODELS / name).exists() or (own_models() / name).exists():
        return tr("there is a model {name} already; choose another name", name=name)
    return ""


@dataclass(slots=True)
class _Told:
    """What the process said last, beside its progress."""

    records: dict[str, Any] = field(default_factory=dict)


class TrainingJob(QObject):
    """One training at a time. ``changed`` carries the ``TrainingState``; ``installed`` the name of a model that is new.

    Parameters
    ----------
    collect : where the annotations come from.
    folder : where the sets are written; default: in the program's data folder.
    """

    changed = Signal(object)
    installed = Signal(str)

    def __init__(self, collect: Collect, parent: QObject | None = None, *, folder: Path | None = None) -> None:
        super().__init__(parent)
        self._collect = collect
        self._folder = folder if folder is not None else Path(platformdirs.user_data_dir("LumenPilot")) / "training"
        self.state = TrainingState()
        self._wish = Wish("")
        self._child: ChildProcess | None = None
        self._is_closed = threading.Event()
        self._told = _Told()
        self._work = Worker("preparing a training", self)
        self._work.done.connect(self._on_prepared)
        self._work.failed.connect(self._on_not_prepared)

    def start(self, wish: Wish) -> None:
        """Write the sets, then train; refused, with one line, where that makes no sense."""
        if self.state.is_busy:
            return
        if problem := name_problem(wish.name):
            self._show(TrainingState(TrainingPhase.FAILED, tr("Not started: {why}", why=tr_text(problem)), steps=wish.steps))
            return
        self._wish, self._told = wish, _Told()
        self._show(TrainingState(TrainingPhase.PREPARING, tr("Collecting the masks"), wish.name, wish.steps))
        collect, closed = self._collect, self._is_closed
        out = self._folder / f"{wish.name}_{datetime.now(UTC):%Y%m%dT%H%M%SZ}"

        def prepare() -> OwnFrames:
            from core.annotation.exchange import split_own_frames  # statistics, which a window does without until then

            annotations, images = collect()
            with ExitStack() as undo:
                undo.callback(shutil.rmtree, out, ignore_errors=True)  # half a set is none
                frames = split_own_frames(annotations, images, out, lambda: not closed.is_set())
                if not closed.is_set():
                    undo.pop_all()
            return frames

        self._work.submit("prepare", prepare)

    def stop(self) -> None:
        """End it soon; what was learnt until then becomes the model."""
        if self._child is not None and self.state.phase is TrainingPhase.RUNNING:
            line = tr("Stopping; what was learnt is kept, which takes some seconds")
            self._show(replace(self.state, phase=TrainingPhase.STOPPING, line=line))
            self._child.ask_to_end()

    def close(self) -> None:
        """The window goes; a running training ends by itself and keeps what it learnt."""
        if self._child is not None:
            self._child.leave()
            self._child.ask_to_end()
        self._is_closed.set()
        self._work.stop(finish=False)
        self._work.wait(_END_WITHIN_MS)

    def _show(self, state: TrainingState) -> None:
        self.state = state
        self.changed.emit(state)

    def _on_not_prepared(self, _key: object, line: str) -> None:
        self._show(
            TrainingState(TrainingPhase.FAILED, tr("Not started: {why}", why=tr_text(line)), self._wish.name, self._wish.steps)
        )

    def _on_prepared(self, _key: object, frames: OwnFrames) -> None:
        if self._is_closed.is_set():
            return
        wish, out = self._wish, own_models() / self._wish.name
        plan = ["--steps", wish.steps, "--batch", _BATCH, "--rate", _RATE, "--crop", _CROP, "--look-share", _LOOK_SHARE]
        plan += ["--remember", wish.remember]
        sets = ["--data", frames.train, "--held-out", frames.held_out, "--init", wish.init, "--out", out]
        child = ChildProcess(command_of("train", *map(str, (*sets, *plan)), "--progress-json"), self)
        child.told.connect(self._on_told)
        child.ended.connect(self._on_ended)
        self._child = child
        counted = tr(
            "{learning} pictures to learn from, {held_out} held out to judge by",
            learning=frames.train_count,
            held_out=frames.held_out_count,
        )
        if frames.problems:
            counted += tr("; {count} pictures left out: a mask or the picture itself is missing", count=len(frames.problems))
        self._show(replace(self.state, phase=TrainingPhase.RUNNING, line=counted, frames=frames))
        child.start()

    def _on_told(self, record: dict[str, Any]) -> None:
        state = self.state
        try:
            if "loss" in record:
                point = int(record["step"]), float(record["loss"]), float(record["vessel_dice"]), float(record["robot_dice"])
                steps = int(record.get("steps", state.steps))  # more than asked for where a second look learns, too
                state = replace(state, curve=(*state.curve, point), steps=steps, left_s=record.get("left_s"))
            elif "held_out_step" in record:
                dices = float(record["vessel_dice"]), float(record["robot_dice"])
                look = HeldOutLook(int(record["held_out_step"]), *dices, tuple(record.get("pictures", ())))
                state = replace(state, looks=(*state.looks, look))
            else:
                self._told.records.update(record)
                return
        except (KeyError, TypeError, ValueError):  # a line of another version; the curve does without it
            return
        self._show(state)

    def _on_ended(self, code: int, line: str) -> None:
        self._child = None
        if code == 0 and "model" in self._told.records:
            self._show(replace(self.state, phase=TrainingPhase.DONE, line=self._outcome(), left_s=None))
            self.installed.emit(self._wish.name)
        elif code == _INTERRUPTED:  # later it keeps what it has, and ends well
            line = tr("Stopped before the first step; there is no new model")
            self._show(replace(self.state, phase=TrainingPhase.FAILED, line=line, left_s=None))
        else:
            why = line or (tr("it was ended by signal {number}", number=-code) if code < 0 else tr("exit code {code}", code=code))
            self._show(replace(self.state, phase=TrainingPhase.FAILED, line=tr("Training failed: {why}", why=why), left_s=None))

    def _outcome(self) -> str:
        """What came of it, in one line."""
        done, steps = self._told.records.get("steps_done"), self._told.records.get("steps")
        early = tr(" after {done} of {steps} steps", done=done, steps=steps) if done != steps else ""
        looks = self.state.looks
        if len(looks) < 2:
            return tr("Model {name} is installed{early}; choose it in the Model menu", name=self._wish.name, early=early)
        first, last = looks[0], looks[-1]
        vessel = tr("vessel {before:.2f} → {after:.2f}", before=first.vessel_dice, after=last.vessel_dice)
        robot = tr("robot {before:.2f} → {after:.2f}", before=first.robot_dice, after=last.robot_dice)
        worse = last.vessel_dice + last.robot_dice < first.vessel_dice + first.robot_dice
        verdict = tr("It is WORSE than before on the held-out pictures") if worse else tr("Choose it in the Model menu")
        return tr(
            "Model {name} is installed{early}. Dice on held-out pictures: {vessel}, {robot}. {verdict}",
            name=self._wish.name,
            early=early,
            vessel=vessel,
            robot=robot,
            verdict=verdict,
        )


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


class _Picture(QLabel):
    """A file's picture, as large as fits."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
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
            self.setText(tr("shown when the training has begun"))
            return
        smooth = Qt.TransformationMode.SmoothTransformation
        self.setPixmap(self._pixmap.scaled(self.size(), Qt.AspectRatioMode.KeepAspectRatio, smooth))


class BeforeAfter(QWidget):
    """Two pictures side by side, of one frame at a time."""

    def __init__(self) -> None:
        super().__init__()
        self._before: tuple[str, ...] = ()
        self._after: tuple[str, ...] = ()
        self._place = 0
        self._left, self._right = _Picture(tr("Before")), _Picture(tr("After"))
        self._title = QLabel()
        self._title.setObjectName("card_note")
        self._next = QPushButton(tr("&Next picture"))
        self._next.setAutoDefault(False)
        self._next.clicked.connect(self._on_next)
        head = QHBoxLayout()
        head.addWidget(self._title, 1)
        head.addWidget(self._next)
        pictures = QHBoxLayout()
        for word, picture in ((tr("Before"), self._left), (tr("After"), self._right)):
            column = QVBoxLayout()
            label = QLabel(word)
            label.setObjectName("card_title")
            column.addWidget(label)
            column.addWidget(picture, 1)
            pictures.addLayout(column, 1)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addLayout(pictures, 1)
        whole.addLayout(head)
        self._show()

    @property
    def title(self) -> str:
        return self._title.text()

    def show_pictures(self, before: tuple[str, ...], after: tuple[str, ...]) -> None:
        """Paths of the same frames then and now; they are read again, for they may have been written anew."""
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
        vessel, robot = (
            f'<span style="color:{c}">\N{BLACK SQUARE}</span>&nbsp;{n}'
            for c, n in ((colours.VESSEL, tr("vessel")), (colours.ROBOT, tr("robot")))
        )
        found = tr("colour: found ({vessel}, {robot})", vessel=vessel, robot=robot)
        which = (
            tr("Held-out picture {place} of {count}; {found}, line: drawn by hand", place=self._place + 1, count=count, found=found)
            if count
            else tr("Held-out pictures")
        )
        self._title.setText(which)


_SIZE = QSize(940, 640)


class TrainingDialog(QDialog):
    """Shows a job and hands it the user's wishes. Closing it while it trains only hides it: the training goes on.

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
        self.start, self.stop = QPushButton(tr("&Train")), QPushButton(tr("&Stop, keep what was learnt"))
        self.hide_button = QPushButton(tr("&Close"))
        self.curves, self.pictures = TrainingCurves(), BeforeAfter()
        self._bar, self._line = QProgressBar(), QLabel()
        self._fill_form()
        heading = QLabel()
        heading.setObjectName("card_title")
        from_where, room = tr("Masks from {source}", source=source), _SIZE.width() - 48
        heading.setText(QFontMetrics(theme.semi_bold(12)).elidedText(from_where, Qt.TextElideMode.ElideMiddle, room))
        heading.setToolTip(source)
        heading.setAccessibleName(from_where)
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 12, 16, 12)
        column.setSpacing(theme.GAP)
        column.addWidget(heading)
        column.addLayout(self._form())
        column.addWidget(Card("", self.curves), 4)
        column.addWidget(Card("", self.pictures), 6)
        column.addWidget(self._line)
        column.addLayout(self._foot())
        self.job.changed.connect(self._on_changed)
        self._on_changed(self.job.state)

    @property
    def line(self) -> str:
        """What is the matter, as shown."""
        return self._line.text()

    @property
    def is_busy(self) -> bool:
        """A training goes on."""
        return self.job.state.is_busy

    def end(self) -> None:
        """The window behind it closes: a training that goes on ends by itself and keeps what it learnt."""
        self.job.close()
        self.close()

    def _fill_form(self) -> None:
        self.name.setMaxLength(40)
        self.name.setText(_free_name())
        self.name.setAccessibleName(tr("Name of the new model"))
        for model in installed_models():
            if not model.problem:
                self.init.addItem(_title(model), model.name)
        self.init.setAccessibleName(tr("Model to start from"))
        self.steps.setRange(10, 20_000)
        self.steps.setSingleStep(100)
        self.steps.setValue(STEPS)
        self.steps.setSuffix(tr(" steps"))
        self.steps.setAccessibleName(tr("Steps of training"))
        self.name.setToolTip(tr("Letters, digits, - and _; the Model menu lists it under this name"))
        self.init.setToolTip(tr("What this model can do is kept as far as possible, and the new look is learnt on top"))
        self.steps.setToolTip(tr("More steps learn more and take longer: on two processor cores a step takes about a second"))
        self.start.setObjectName("main_button")
        self._line.setWordWrap(True)
        self._line.setMinimumHeight(38)
        self._bar.setTextVisible(False)
        self._bar.setFixedHeight(8)
        for button, slot in ((self.start, self._on_start), (self.stop, self.job.stop), (self.hide_button, self.close)):
            button.setAutoDefault(False)
            button.clicked.connect(slot)

    def _form(self) -> QHBoxLayout:
        row = QHBoxLayout()
        for word, entry, stretch in (
            (tr("New model"), self.name, 2),
            (tr("starts from"), self.init, 3),
            (tr("for"), self.steps, 1),
        ):
            label = QLabel(word)
            label.setBuddy(entry)
            row.addWidget(label)
            row.addWidget(entry, stretch)
        row.addWidget(self.start)
        return row

    def _foot(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.addWidget(self._bar, 1, Qt.AlignmentFlag.AlignVCenter)
        row.addWidget(self.stop)
        row.addWidget(self.hide_button)
        return row

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not takes_enter(self, event):
            super().keyPressEvent(event)

    def _on_start(self) -> None:
        self.job.start(Wish(self.name.text().strip(), str(self.init.currentData() or "default"), self.steps.value()))

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
        if state.looks:
            after = state.looks[-1].pictures if len(state.looks) > 1 else ()
            self.pictures.show_pictures(state.looks[0].pictures, after)
        if state.phase is TrainingPhase.DONE and name_problem(self.name.text()):
            self.name.setText(_free_name())


def _words(state: TrainingState) -> str:
    if state.phase is TrainingPhase.IDLE:
        return tr(
            "The masks become two sets: one to learn from, and a fifth of the pictures that stays out and shows whether it helped. "
            "It runs at low priority, and the new model is used only when you choose it."
        )
    if state.phase is not TrainingPhase.RUNNING or not state.step:
        return tr_text(state.line)
    left = tr(", {duration} left", duration=_duration(state.left_s)) if state.left_s is not None else ""
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


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else tr("{minutes:.0f} min", minutes=seconds / 60)


def _title(model: InstalledModel) -> str:
    return tr("{name} (own)", name=model.name) if model.is_own else model.name


def _free_name() -> str:
    """A name that no model has."""
    number = 1
    while name_problem(name := f"own_{number}"):
        number += 1
    return name


def collect_from_file(path: Path) -> tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]:
    """All annotations of a file, and those of their images that lie beside it. Raises AnnotationError."""
    from app.annotator.sources import read_annotated  # statistics, which a window does without until then

    return read_annotated(path, [path.parent])


def collect_from_store(
    store: AnnotationStore, images: Sequence[FoundImage]
) -> tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]:
    """The same of a file that is open; images that are shown twice count once. Raises AnnotationError."""
    annotations = store.annotations()
    if not annotations:
        raise AnnotationError(f"{store.path.name}: nothing is annotated yet")
    return annotations, list({image.sha256: image for image in images}.values())
