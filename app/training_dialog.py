"""Training on one's own annotations, watched: what to call it, how it goes, what it changes, and stop."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QFontMetrics, QKeyEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app import theme
from app.installed_models import InstalledModel, installed_models
from app.language import tr, tr_text
from app.training_job import STEPS, Collect, Phase, TrainingJob, TrainingState, Wish, name_problem
from app.widgets.before_after import BeforeAfter
from app.widgets.card import Card
from app.widgets.enter_key import takes_enter
from app.widgets.training_curves import TrainingCurves

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
        for word, field, stretch in (
            (tr("New model"), self.name, 2),
            (tr("starts from"), self.init, 3),
            (tr("for"), self.steps, 1),
        ):
            label = QLabel(word)
            label.setBuddy(field)
            row.addWidget(label)
            row.addWidget(field, stretch)
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
        for field in (self.name, self.init, self.steps, self.start):
            field.setEnabled(not state.is_busy)
        self.stop.setEnabled(state.phase is Phase.RUNNING)
        self.hide_button.setText(tr("&Hide, go on training") if state.is_busy else tr("&Close"))
        self._bar.setRange(0, state.steps if state.step or not state.is_busy else 0)
        self._bar.setValue(state.steps if state.phase is Phase.DONE else state.step)
        self._line.setText(_words(state))
        self.setAccessibleDescription(self._line.text())
        self.curves.show_state(state)
        if state.looks:
            after = state.looks[-1].pictures if len(state.looks) > 1 else ()
            self.pictures.show_pictures(state.looks[0].pictures, after)
        if state.phase is Phase.DONE and name_problem(self.name.text()):
            self.name.setText(_free_name())


def _words(state: TrainingState) -> str:
    if state.phase is Phase.IDLE:
        return tr(
            "The masks become two sets: one to learn from, and a fifth of the pictures that stays out and shows whether it helped. "
            "It runs at low priority, and the new model is used only when you choose it."
        )
    if state.phase is not Phase.RUNNING or not state.step:
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
