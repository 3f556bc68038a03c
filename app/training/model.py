"""A training on the user's own annotations: masks become sets, ``train`` runs as a process at low priority and is followed."""

from __future__ import annotations

import re
import shutil
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import platformdirs
from PySide6.QtCore import QObject, Signal

from app.ui.i18n import tr, tr_text
from app.ui.workers import ChildProcess, Worker, command_of
from core.annotation.model import AnnotationError
from core.annotation.store import AnnotationStore, FoundImage, StoredAnnotation
from core.perception.model_file import MODELS, own_models

if TYPE_CHECKING:
    from core.annotation.exchange import OwnFrames

STEPS = 400
_INTERRUPTED = 130
"""Exit code of ``train`` that was stopped before its first step."""
_PLAN = ("--batch", "8", "--rate", "2e-3", "--crop", "256", "--look-share", "0.7")
"""For a trained network: a fifth of the rate of its first training, so that it does not forget."""
REMEMBER = 80
"""Frames of the twin that are made first, in half a minute, and shown as often as the new ones (docs/method.md)."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
_END_WITHIN_MS = 3000
_COUNT = "count"
"""Key of the job that counts."""

Collect = Callable[[], tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]]
"""Reads the annotations and finds their images; called in a thread, may raise UserError."""


class TrainingPhase(Enum):
    """Where a training is."""

    IDLE = "idle"
    PREPARING = "preparing"
    RUNNING = "running"
    STOPPING = "stopping"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class HeldOutDice:
    """Dice on the frames that are not trained on, after so many steps, and pictures of some of them."""

    step: int
    vessel_dice: float
    robot_dice: float
    pictures: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TrainingState:
    """What the dialog shows. ``curve``: step, loss, and Dice of vessel and robot on what is trained on."""

    phase: TrainingPhase = TrainingPhase.IDLE
    line: str = ""
    name: str = ""
    steps: int = STEPS
    curve: tuple[tuple[int, float, float, float], ...] = ()
    held_out: tuple[HeldOutDice, ...] = ()
    left_s: float | None = None
    frames: OwnFrames | None = None

    @property
    def step(self) -> int:
        return self.curve[-1][0] if self.curve else 0

    @property
    def is_busy(self) -> bool:
        return self.phase in {TrainingPhase.PREPARING, TrainingPhase.RUNNING, TrainingPhase.STOPPING}


@dataclass(frozen=True, slots=True)
class TrainingRequest:
    """The new model's name, the one to start from, how many steps, and how many frames of the twin beside."""

    name: str
    init: str = "default"
    steps: int = STEPS
    remember: int = REMEMBER


def name_problem(name: str) -> str:
    """Why a model cannot have this name; empty when it can."""
    if not _NAME.fullmatch(name):
        return tr("a name is letters, digits, - and _, 40 at most")
    if (MODELS / name).exists() or (own_models() / name).exists():
        return tr("there is a model {name} already; choose another name", name=name)
    return ""


def free_name(stem: str) -> str:
    """A name that begins so, and that no model has."""
    number = 1
    while name_problem(name := f"{stem}_{number}"):
        number += 1
    return name


class TrainingJob(QObject):
    """One training at a time. ``changed`` carries the ``TrainingState``; ``installed`` the name of the new model.

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
        self._request = TrainingRequest("")
        self._child: ChildProcess | None = None
        self._is_closed = threading.Event()
        self._outcome: dict[str, Any] = {}
        self._work = Worker("preparing a training", self)
        self._work.done.connect(lambda key, found: self._on_counted(found) if key == _COUNT else self._on_prepared(found))
        self._work.failed.connect(self._on_failed)

    def count(self) -> None:
        """Say, before a training begins, how many pictures there are to learn from."""
        collect = self._collect

        def count() -> str:
            from core.annotation.exchange import trainable  # loads statistics, which a window does not need before

            return tr("{count} pictures have both masks.", count=len(trainable(*collect())))

        self._work.submit(_COUNT, count)

    def start(self, request: TrainingRequest) -> None:
        """Write the sets, then train; a request that makes no sense is refused with one line."""
        if self.state.is_busy:
            return
        if problem := name_problem(request.name):
            self._show(TrainingState(TrainingPhase.FAILED, tr("Not started: {why}", why=tr_text(problem)), steps=request.steps))
            return
        self._request, self._outcome = request, {}
        self._show(TrainingState(TrainingPhase.PREPARING, tr("Collecting the masks"), request.name, request.steps))
        collect, closed = self._collect, self._is_closed
        out = self._folder / f"{request.name}_{datetime.now(UTC):%Y%m%dT%H%M%SZ}"

        def prepare() -> OwnFrames:
            from core.annotation.exchange import split_own_frames  # loads statistics, which a window does not need before

            annotations, images = collect()
            with ExitStack() as undo:
                undo.callback(shutil.rmtree, out, ignore_errors=True)  # no half sets
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
        """The window closes; a running training ends by itself and keeps what it learnt."""
        if self._child is not None:
            self._child.leave()
            self._child.ask_to_end()
        self._is_closed.set()
        self._work.stop(finish=False)
        self._work.wait(_END_WITHIN_MS)

    def _show(self, state: TrainingState) -> None:
        self.state = state
        self.changed.emit(state)

    def _fail(self, line: str) -> None:
        self._show(replace(self.state, phase=TrainingPhase.FAILED, line=line, left_s=None))

    def _on_counted(self, line: str) -> None:
        if self.state.phase is TrainingPhase.IDLE:
            self._show(replace(self.state, line=line))

    def _on_failed(self, key: object, line: str) -> None:
        if key == _COUNT:
            self._on_counted(line)
        else:
            self._fail(tr("Not started: {why}", why=tr_text(line)))

    def _on_prepared(self, frames: OwnFrames) -> None:
        if self._is_closed.is_set():
            return
        request, out = self._request, own_models() / self._request.name
        sets = ["--data", frames.train, "--held-out", frames.held_out, "--init", request.init, "--out", out]
        plan = ["--steps", request.steps, *_PLAN, "--remember", request.remember]
        child = ChildProcess(command_of("train", *map(str, (*sets, *plan)), "--progress-json"), self)
        child.told.connect(self._on_progress)
        child.ended.connect(self._on_ended)
        self._child = child
        train, held_out, left_out = frames.train_count, frames.held_out_count, len(frames.problems)
        line = tr("{learning} pictures to learn from, {held_out} held out to judge by", learning=train, held_out=held_out)
        if left_out:
            line += tr("; {count} pictures left out: a mask or the picture itself is missing", count=left_out)
        self._show(replace(self.state, phase=TrainingPhase.RUNNING, line=line, frames=frames))
        child.start()

    def _on_progress(self, record: dict[str, Any]) -> None:
        state = with_record(self.state, record)
        if state is not None:
            self._show(state)
        else:
            self._outcome.update(record)

    def _on_ended(self, code: int, line: str) -> None:
        self._child = None
        if code == 0 and "model" in self._outcome:
            self._show(replace(self.state, phase=TrainingPhase.DONE, line=self._outcome_line(), left_s=None))
            self.installed.emit(self._request.name)
        elif code == _INTERRUPTED:  # one that is interrupted later ends well, with what it has learnt
            self._fail(tr("Stopped before the first step; there is no new model"))
        else:
            signalled = tr("it was ended by signal {number}", number=-code)
            why = line or (signalled if code < 0 else tr("exit code {code}", code=code))
            self._fail(tr("Training failed: {why}", why=why))

    def _outcome_line(self) -> str:
        done, steps, name = self._outcome.get("steps_done"), self._outcome.get("steps"), self._request.name
        early = tr(" after {done} of {steps} steps", done=done, steps=steps) if done != steps else ""
        if len(self.state.held_out) < 2:
            return tr("Model {name} is installed{early}; choose it in the Model menu", name=name, early=early)
        first, last = self.state.held_out[0], self.state.held_out[-1]
        worse = last.vessel_dice + last.robot_dice < first.vessel_dice + first.robot_dice
        return tr(
            "Model {name} is installed{early}. Dice on held-out pictures: {vessel}, {robot}. {verdict}",
            name=name,
            early=early,
            vessel=tr("vessel {before:.2f} → {after:.2f}", before=first.vessel_dice, after=last.vessel_dice),
            robot=tr("robot {before:.2f} → {after:.2f}", before=first.robot_dice, after=last.robot_dice),
            verdict=tr("It is WORSE than before on the held-out pictures") if worse else tr("Choose it in the Model menu"),
        )


def with_record(state: TrainingState, record: dict[str, Any]) -> TrainingState | None:
    """The state after a line of ``--progress-json``; None for a line that is no progress, and the same for one that is damaged."""
    try:
        if "loss" in record:
            point = int(record["step"]), float(record["loss"]), float(record["vessel_dice"]), float(record["robot_dice"])
            steps = int(record.get("steps", state.steps))  # more than requested where the tip refinement learns, too
            return replace(state, curve=(*state.curve, point), steps=steps, left_s=record.get("left_s"))
        if "held_out_step" in record:
            dices = float(record["vessel_dice"]), float(record["robot_dice"])
            held_out = HeldOutDice(int(record["held_out_step"]), *dices, tuple(record.get("pictures", ())))
            return replace(state, held_out=(*state.held_out, held_out))
    except (KeyError, TypeError, ValueError):  # a line of another version
        return state
    return None


def collect_from_file(path: Path) -> tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]:
    """All annotations of a file, and those of their images that lie beside it. Raises AnnotationError."""
    from app.annotator.sources import read_annotated  # loads statistics, which a window does not need before

    return read_annotated(path, [path.parent])


def collect_from_store(
    store: AnnotationStore, images: Sequence[FoundImage]
) -> tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]:
    """The same of a file that is open; images that are shown twice count once. Raises AnnotationError."""
    annotations = store.annotations()
    if not annotations:
        raise AnnotationError(f"{store.path.name}: nothing is annotated yet")
    return annotations, list({image.sha256: image for image in images}.values())
