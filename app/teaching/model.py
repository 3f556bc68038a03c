"""A teaching beside the window: jobs on its folder in a thread, frames from the live picture, ``teach`` as a process."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import platformdirs
from PySide6.QtCore import QObject, QTimer, Signal

from app.teaching.folder import ENOUGH_BENDS, LookKind, TakenLook, TeachingFolder, TeachingStep, TeachingView
from app.training.model import TrainingPhase, TrainingState, free_name, name_problem, with_record
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import sentence
from app.ui.workers import ChildProcess, QueuedCallback, Worker, command_of
from core.config.calibration import CalibrationConfig
from core.learning.teaching import Segment
from core.perception.model_file import BENCH, own_models
from core.types import Frame, Image, Mask
from hardware.twin.own_phantom import phantom_for_bench

MINUTES = 5
"""Of a training, as the window proposes it."""
BURST = 8
"""Pictures that "Take picture" takes."""
_POLL_MS = 40
_SILENT_MS = 3000
"""Without a new picture for so long the camera gives none."""
_LOOK_EVERY_MS = 250
"""A look takes a fifth of a second of a processor core, and perception goes on beside it."""
_TIME_EVERY_MS = 2000
_END_WITHIN_MS = 5000
_INTERRUPTED = 130
"""Exit code of ``teach`` that was stopped."""
_STOPPED = mark("Stopped. Frames and what was learnt are kept: Train goes on from there")

NewestFrame = Callable[[], Frame | None]
"""The newest frame of the live picture; None where it is not live."""


def teaching_folder(rig: str) -> Path:
    """Where the work on a rig's bench is kept."""
    name = re.sub(r"[^\w-]+", "_", rig).strip("_") or "bench"
    return Path(platformdirs.user_data_dir("LumenPilot")) / "teaching" / name


def name_for(rig: str) -> str:
    """A name for a model of a rig's bench, that no model has."""
    return free_name(re.sub(r"[^A-Za-z0-9-]+", "_", rig).strip("_-")[:30] or "bench")


@dataclass(frozen=True, slots=True)
class TaughtResult:
    """What ``teach`` measured on the frames that it held out; None: not measured."""

    frames: int
    answered: int
    right: int
    robot_dice: float | None
    head_px: float | None
    theta_deg: float | None
    time_s: float
    steps: int


def taught_result(record: dict[str, Any]) -> TaughtResult | None:
    """The figures of the last line that ``teach --json`` writes; None for another line."""
    held_out = record.get("held_out")
    if not isinstance(held_out, dict):
        return None
    try:
        return TaughtResult(
            int(held_out["frames"]),
            int(held_out["answered"]),
            int(held_out["right"]),
            held_out.get("robot_dice"),
            held_out.get("head_px"),
            held_out.get("theta_deg"),
            float(record["time_s"]),
            int(record["steps"]),
        )
    except (KeyError, TypeError, ValueError):  # a line of another version
        return None


class TeachingModel(QObject):
    """One teaching. All signals come in the window's thread.

    ``changed`` comes when anything that is shown has changed. ``said`` carries a line and whether it is a fault. ``looked`` carries
    the ``TakenLook`` of a picture of the moving robot. ``proposed`` carries the network's vessel, a mask. ``trained`` carries the
    name of a model that is there now.

    Parameters
    ----------
    folder : where the work is kept.
    rig : what the bench is called.
    newest : the live picture.
    segment : opens the network that proposes; called in the thread.
    known : the rig's calibration, for the twin's phantom of the bench; called in the thread. None: no phantom is made.
    """

    changed = Signal()
    said = Signal(str, bool)
    looked = Signal(object)
    proposed = Signal(object)
    trained = Signal(str)

    def __init__(
        self,
        folder: Path,
        rig: str,
        newest: NewestFrame,
        segment: Callable[[], Segment],
        parent: QObject | None = None,
        known: Callable[[], CalibrationConfig | None] | None = None,
    ) -> None:
        super().__init__(parent)
        self.rig, self._newest, self._known = rig, newest, known
        callback, dropped = QueuedCallback(self), threading.Event()

        def on_frame(done: int, count: int) -> bool:
            callback.send(lambda it: it._on_counted(done, count))
            return not dropped.is_set()

        self._is_dropped = dropped
        self._folder = TeachingFolder(folder, rig, segment, on_frame)
        self.view = TeachingView()
        self.busy = self._what = ""
        """The job that the window waits for, in words."""
        self.is_loaded = False
        """What was taken before is read; where it cannot be, it is tried again when the window is opened."""
        self.training = TrainingState()
        self.result: TaughtResult | None = None
        self._count = self._busy_job = 0
        self._then: dict[object, Callable[[object], None] | None] = {}
        self._burst: list[Image] = []
        self._wanted = 0
        self._waited_ms = 0
        self._last_index = -1
        self._is_looking = self._is_closed = False
        self._child: ChildProcess | None = None
        self._name = ""
        self._is_stopping = False
        self._began_s = self._given_s = 0.0
        self._poll = QTimer(self, interval=_POLL_MS)
        self._poll.timeout.connect(self._collect)
        self._pace = QTimer(self, interval=_TIME_EVERY_MS)  # a training is silent while it loads
        self._pace.timeout.connect(self.changed)
        self._watch = QTimer(self, interval=_LOOK_EVERY_MS)
        self._watch.timeout.connect(self._look)
        self._work = Worker("teaching", self, behind=True)
        self._work.done.connect(self._on_done)
        self._work.failed.connect(self._on_failed)

    # ---- jobs

    @property
    def is_busy(self) -> bool:
        return bool(self.busy)

    @property
    def is_training(self) -> bool:
        return self.training.is_busy

    def load(self) -> None:
        self._run(tr("reading what was taken before"), self._folder.load, self._on_loaded)

    def start_over(self) -> None:
        """Remove what was taken; models stay."""
        self._run(tr("removing what was taken"), self._folder.start_over, self._on_loaded)

    def _on_loaded(self, _nothing: object) -> None:
        self.is_loaded = True

    def go(self, step: TeachingStep) -> None:
        self._run(tr("one moment"), partial(self._folder.go, step))

    def propose_vessel(self) -> None:
        """The vessel that the network sees comes by ``proposed``."""
        self._run(tr("looking for the vessel"), self._folder.proposed_vessel, self.proposed.emit)

    def set_vessel(self, vessel: Mask, step: TeachingStep) -> None:
        """The vessel as it was drawn; then to another step."""

        def job() -> None:
            self._folder.set_vessel(vessel)
            self._folder.go(step)

        self._run(tr("keeping the vessel"), job)

    def keep_drawn(self, vessel: Mask) -> None:
        self._run("", partial(self._folder.keep_drawn, vessel), quiet=True)

    def leave_out(self, stem: str, on: bool) -> None:
        self._run("", partial(self._folder.leave_out, stem, on), quiet=True)

    def correct(self, stem: str, robot: Mask | None) -> None:
        """Another mask for the robot in a frame; None: that by difference again."""
        self._run("", partial(self._folder.correct, stem, robot), quiet=True)

    def _run(
        self, what: str, job: Callable[[], object], then: Callable[[object], None] | None = None, *, quiet: bool = False
    ) -> None:
        """Do a job in the thread, then show what there is. While another one runs it is ignored, but a `quiet` one waits.

        Where what was taken before could not be read, that is tried again instead: a new record would replace it.
        """
        if self._is_closed or (self.is_busy and not quiet):
            return
        if not (self.is_loaded or quiet or then == self._on_loaded):  # with that, the job itself reads or removes it
            self.load()
            return
        self._count += 1
        self._then[self._count] = then
        if not quiet:
            self._is_dropped.clear()
            self.busy = self._what = what
            self._busy_job = self._count
            self.changed.emit()
        self._work.submit(self._count, lambda: (job(), self._folder.view()))

    def _on_counted(self, done: int, count: int) -> None:
        if self.is_busy:
            self.busy = tr("{what}: {done} of {count}", what=self._what, done=done, count=count)
            self.changed.emit()

    def _on_done(self, key: object, result: object) -> None:
        assert isinstance(result, tuple)
        outcome, self.view = result
        if key == "look":
            self._is_looking = False
            self.looked.emit(outcome)
            self.changed.emit()
            return
        then = self._ended_job(key)
        if then is not None:
            then(outcome)
        self.changed.emit()

    def _ended_job(self, key: object) -> Callable[[object], None] | None:
        """What was to be done after the job that has ended."""
        then = self._then.pop(key, None)
        if key == self._busy_job:
            self.busy = ""
        return then

    def _on_failed(self, key: object, line: str) -> None:
        is_stopped = False
        if key == "look":
            self._is_looking = False
            self._watch.stop()  # a full disk is not reported eight times a second
        else:
            self._ended_job(key)
            if self.training.phase in (TrainingPhase.PREPARING, TrainingPhase.STOPPING) and key == self._busy_job:
                is_stopped = self._is_dropped.is_set()
                why = tr(_STOPPED) if is_stopped else tr("Not started: {why}", why=tr_text(line))
                self.training = TrainingState(TrainingPhase.FAILED, why, self._name)
        self.said.emit(tr_text(line), not is_stopped)
        self.changed.emit()

    # ---- the live picture

    def take_empty(self) -> None:
        """Take some pictures of the empty bench."""
        self._take(BURST, tr("taking pictures, keep still"))

    def take_place(self) -> None:
        """Take one picture with the robot in another place."""
        self._take(1, tr("taking a picture"))

    def _take(self, count: int, what: str) -> None:
        if self.is_busy:
            return
        self.busy, self._burst, self._wanted, self._waited_ms = what, [], count, 0
        frame = self._newest()
        self._last_index = frame.index if frame is not None else -1  # what is on the screen may be a moment old
        self._poll.start()
        self.changed.emit()

    def _collect(self) -> None:
        frame = self._newest()
        self._waited_ms += _POLL_MS
        if frame is not None and frame.index != self._last_index:
            self._last_index, self._waited_ms = frame.index, 0
            self._burst.append(frame.image)
        if len(self._burst) >= self._wanted:
            self._poll.stop()
            self.busy = ""
            images = tuple(self._burst)
            if self._wanted == 1:
                self._run(tr("comparing the pictures"), partial(self._folder.add_place, images[0]))
            else:
                self._run(tr("looking at the pictures"), partial(self._folder.add_empty, images))
        elif self._waited_ms >= _SILENT_MS:
            self._poll.stop()
            self.busy = ""
            self.said.emit(
                tr("The picture is not live: check the camera, or start the rig again (F5 in the operator window)"), True
            )
            self.changed.emit()

    def watch(self, on: bool) -> None:
        """Take frames from the live picture while the robot is moved."""
        if on and not self._is_closed:
            self._last_index = -1
            self._watch.start()
        else:
            self._watch.stop()

    @property
    def is_watching(self) -> bool:
        return self._watch.isActive()

    def _look(self) -> None:
        frame = self._newest()
        if frame is None or frame.index == self._last_index or self._is_looking or self.is_busy:
            return
        self._last_index, self._is_looking = frame.index, True
        image = frame.image
        self._work.submit("look", lambda: (self._folder.look(image), self._folder.view()))

    # ---- training

    def train(self, name: str, minutes: int) -> None:
        """Write the frames, then ``teach``; a name that makes no sense is refused with one line."""
        if self.is_training or self.is_busy:
            return
        if problem := name_problem(name):
            self.said.emit(tr("Not started: {why}", why=tr_text(problem)), True)
            return
        self._name, self.result = name, None
        self.training = TrainingState(TrainingPhase.PREPARING, tr("Writing the frames"), name)
        start = partial(self._start_training, minutes)
        self._run(tr("writing the frames"), self._folder.teaching_set, start)

    def _start_training(self, minutes: int, folder: object) -> None:
        if self._is_dropped.is_set():  # stopped when the last frame was written
            self._show(TrainingState(TrainingPhase.FAILED, tr(_STOPPED), self._name))
            return
        out = own_models() / self._name
        options = ("--out", str(out), "--minutes", str(minutes), "--json", "--progress-json")
        child = ChildProcess(command_of("teach", str(folder), *options), self)
        child.told.connect(self._on_progress)
        child.ended.connect(self._on_ended)
        self._child, self._is_stopping = child, False
        self._began_s, self._given_s = time.monotonic(), 60.0 * minutes
        self._show(TrainingState(TrainingPhase.RUNNING, tr("Loading the network and frames of the twin"), self._name))
        child.start()
        self._pace.start()

    @property
    def time_share(self) -> float:
        """Share of the given minutes that a running training has used, 0..1: it keeps to them."""
        return min(1.0, (time.monotonic() - self._began_s) / self._given_s) if self._given_s else 0.0

    @property
    def minutes_left(self) -> float:
        return (1.0 - self.time_share) * self._given_s / 60

    def stop_training(self) -> None:
        """End it soon; frames and what was learnt are kept, and it can go on later."""
        self._is_dropped.set()
        if self.training.phase in (TrainingPhase.PREPARING, TrainingPhase.RUNNING):
            self._show(replace(self.training, phase=TrainingPhase.STOPPING, line=tr("Stopping; what was learnt is kept")))
            if self._child is not None:
                self._is_stopping = True
                self._child.ask_to_end()

    def _show(self, state: TrainingState) -> None:
        self.training = state
        self.changed.emit()

    def _on_progress(self, record: dict[str, Any]) -> None:
        if (result := taught_result(record)) is not None:
            self.result = result
        elif (state := with_record(self.training, record)) is not None:
            self._show(replace(state, line=tr("Learns the bench") if state.phase is TrainingPhase.RUNNING else state.line))
        elif record.get("what") == "calibration" and self.training.phase is TrainingPhase.RUNNING:
            self._show(replace(self.training, line=tr("Has learnt; is judged on the frames that are held out")))

    def _on_ended(self, code: int, line: str) -> None:
        self._child = None
        self._pace.stop()
        if code == 0:
            self._show(replace(self.training, phase=TrainingPhase.DONE, line="", left_s=None))
            self._run("", partial(self._keep_model, self._name), self._on_kept, quiet=True)
            self.trained.emit(self._name)
        elif code == _INTERRUPTED or self._is_stopping:
            self._show(replace(self.training, phase=TrainingPhase.FAILED, line=tr(_STOPPED), left_s=None))
        else:
            signalled = tr("it was ended by signal {number}", number=-code)
            why = tr_text(line) or (signalled if code < 0 else tr("exit code {code}", code=code))
            self._show(replace(self.training, phase=TrainingPhase.FAILED, line=tr("Training failed: {why}", why=why), left_s=None))

    def _keep_model(self, name: str) -> str:
        self._folder.keep_model(name)
        return phantom_for_bench(own_models() / name / BENCH, self._known()) if self._known is not None else ""

    def _on_kept(self, line: object) -> None:
        if isinstance(line, str) and line:
            self.said.emit(sentence(tr_text(line)), False)

    # ---- the end

    def close(self) -> None:
        """End it beside the window: reading stops, writing does not, and then others may have the folder.

        A running training ends by itself and keeps what it learnt.
        """
        self._run("", self._folder.release, quiet=True)
        self._is_closed = True
        self._is_dropped.set()
        self._poll.stop()
        self._watch.stop()
        self._pace.stop()
        if self._child is not None:
            self._child.leave()
            self._child.ask_to_end()
        self._work.stop(finish=True)

    def wait(self) -> bool:
        """Whether all is written once it is closed, for the end of the program."""
        return self._work.wait(_END_WITHIN_MS)


def look_line(look: TakenLook, view: TeachingView) -> str:
    """What became of a picture, for people."""
    count, on = view.used, view.bends >= ENOUGH_BENDS and bool(view.missing)
    texts = {
        LookKind.STILL: tr("The robot does not move"),
        LookKind.SEEN: tr("Seen already: go on to the orange branch") if on else tr("Seen already: move on, or bend the head"),
        LookKind.ABSENT: tr("No robot is seen in the vessel: push it in"),
        LookKind.PLACE: tr("Frame {count} taken: a new place", count=count),
        LookKind.BEND: tr("Frame {count} taken: a new bend", count=count),
        LookKind.FULL: tr("Enough frames"),
    }
    return texts.get(look.kind) or tr("Not taken: {why}", why=tr_text(look.reason))
