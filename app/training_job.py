"""A training on one's own annotations: masks become sets, ``train`` runs as a process at low priority, and its progress is kept."""

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

import platformdirs
from PySide6.QtCore import QObject, Signal

from app.child_process import ChildProcess, command_of
from app.language import tr, tr_text
from app.work_thread import WorkThread
from core.learning.model_file import MODELS, own_models
from core.study.annotation_images import FoundImage
from core.study.annotation_records import StoredAnnotation

if TYPE_CHECKING:
    from core.study.own_frames import OwnFrames

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


class Phase(Enum):
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

    phase: Phase = Phase.IDLE
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
        return self.phase in {Phase.PREPARING, Phase.RUNNING, Phase.STOPPING}


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
        self._work = WorkThread("preparing a training", self)
        self._work.done.connect(self._on_prepared)
        self._work.failed.connect(self._on_not_prepared)

    def start(self, wish: Wish) -> None:
        """Write the sets, then train; refused, with one line, where that makes no sense."""
        if self.state.is_busy:
            return
        if problem := name_problem(wish.name):
            self._show(TrainingState(Phase.FAILED, tr("Not started: {why}", why=tr_text(problem)), steps=wish.steps))
            return
        self._wish, self._told = wish, _Told()
        self._show(TrainingState(Phase.PREPARING, tr("Collecting the masks"), wish.name, wish.steps))
        collect, closed = self._collect, self._is_closed
        out = self._folder / f"{wish.name}_{datetime.now(UTC):%Y%m%dT%H%M%SZ}"

        def prepare() -> OwnFrames:
            from core.study.own_frames import split_own_frames  # statistics, which a window does without until then

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
        if self._child is not None and self.state.phase is Phase.RUNNING:
            line = tr("Stopping; what was learnt is kept, which takes some seconds")
            self._show(replace(self.state, phase=Phase.STOPPING, line=line))
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
        self._show(TrainingState(Phase.FAILED, tr("Not started: {why}", why=tr_text(line)), self._wish.name, self._wish.steps))

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
        self._show(replace(self.state, phase=Phase.RUNNING, line=counted, frames=frames))
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
            self._show(replace(self.state, phase=Phase.DONE, line=self._outcome(), left_s=None))
            self.installed.emit(self._wish.name)
        elif code == _INTERRUPTED:  # later it keeps what it has, and ends well
            line = tr("Stopped before the first step; there is no new model")
            self._show(replace(self.state, phase=Phase.FAILED, line=line, left_s=None))
        else:
            why = line or (tr("it was ended by signal {number}", number=-code) if code < 0 else tr("exit code {code}", code=code))
            self._show(replace(self.state, phase=Phase.FAILED, line=tr("Training failed: {why}", why=why), left_s=None))

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
