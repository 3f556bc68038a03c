"""``train``: long work with progress that can be interrupted and gone on with."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from app.held_out_watch import HeldOutWatch
from app.long_work import Interrupt, console, progress_bar
from app.outputs import is_same
from app.progress_lines import asked_teller
from app.synth_command import run_synth
from core.learning.training_plan import TrainingPlan

if TYPE_CHECKING:
    from app.teaching import Classroom
    from core.learning.dataset import Sample


@dataclass(frozen=True, slots=True)
class TrainOutputs:
    """The model's folder, and labelled frames that stay out of training and say whether it helped."""

    out: Path
    held_out: Path | None = None


@dataclass(frozen=True, slots=True)
class TrainInputs:
    """Labelled folders, how many frames to make besides, and the families of looks that are left out of both."""

    data: Sequence[Path] = ()
    synthetic: int = 0
    without: Sequence[str] = ()

    def looks_to_make(self) -> tuple[str, ...] | None:
        """Families of the frames made now; None: all. Raises DatasetError when `without` names an unknown one, or leaves none."""
        from core.learning.dataset import DatasetError
        from hardware.twin.look_families import LOOK_FAMILIES
        from hardware.twin.look_titles import LOOKS

        unknown = next((look for look in self.without if look not in LOOKS), None)
        if unknown is not None:
            raise DatasetError(f"unknown look family {unknown!r} in --without; known: {', '.join(LOOKS)}")
        looks = tuple(look for look in LOOK_FAMILIES if look not in self.without)
        if self.synthetic and not looks:
            raise DatasetError("--without leaves no family of looks to make frames of; name fewer")
        return looks if self.without else None


def run_train(
    outputs: TrainOutputs,
    inputs: TrainInputs,
    init: str | None,
    base: int | None,
    plan: TrainingPlan,
    *,
    deepen: bool = False,
    shallow: bool = False,
    second_look: bool = False,
    widen: bool = False,
) -> None:
    """Train on labelled folders and, if asked, on frames made now; writes the model folder `out` and `out`.log.

    With `deepen`, the network that learns first gets the convolutions that the shipped one of its kind has more; with `shallow`, a
    new network has two convolutions on every level. With `second_look`, it is the network of the second look of `init` that learns,
    and `out` is `init` with it; with `widen`, it first gets the channels that the shipped one has more. Where the plan keeps the
    normalisation, `data` is shown as often as the frames made now.
    """
    looks = inputs.looks_to_make()
    _end_like_an_interrupt()
    _check_choices(init, base, plan, deepen=deepen, shallow=shallow, second_look=second_look, widen=widen)
    out, began_with = _check_places(outputs, inputs, init, second_look=second_look)
    folders = list(inputs.data)
    samples = [sample for folder in folders for sample in _samples_of(folder, inputs.without)]
    _tell_left_out(folders)

    import torch  # a broken one shows before hours of frames are made

    from app.lessons import FrameLesson, Lesson, SecondLookLesson
    from app.teaching import Classroom, second_plan, teach_second_look
    from core.learning.dataset import DatasetError
    from core.learning.training import LoaderLost

    if inputs.synthetic:
        folder, made = _made(out, inputs.synthetic, looks, plan)
        if plan.keeps_statistics:  # few frames of a new look, shown as often as all that is to be remembered
            samples *= max(1, round(inputs.synthetic / len(samples)))
        folders.append(folder)
        samples += made
    torch.manual_seed(plan.seed)
    lesson: Lesson
    if second_look:
        lesson = SecondLookLesson(samples, init, deepen=deepen, widen=widen)
    else:
        lesson = FrameLesson(samples, init, base, deepen=deepen, shallow=shallow)
    plan = replace(plan, crop=lesson.sides(plan.crop))
    then = None if second_look else second_plan(plan, init)
    notes: dict[str, Any] = {"init": init, "frames": len(samples), "sets": [_described(folder) for folder in folders]}
    without = _never_seen(inputs.without, began_with)
    if without:
        notes |= {"without": without}
    try:
        log = out.with_name(out.name + ".log").open("a", encoding="utf-8", buffering=1)
    except OSError as error:
        raise DatasetError(f"{out.parent}: cannot be written ({error.strerror}); choose another --out") from None
    teller, watch = asked_teller(), HeldOutWatch(outputs.held_out, out, asked_teller(), log.write)
    with log, Interrupt() as interrupt, progress_bar() as bar:
        room = Classroom(out, notes, log.write, teller, bar, interrupt, watch, steps_total=plan.steps + (then.steps if then else 0))
        try:
            done = room.teach(lesson, plan)
            if done is None:
                console.print(f"interrupted before the first step; nothing was written to {out}", soft_wrap=True)
                raise KeyboardInterrupt
            if then is not None and done == plan.steps:
                teach_second_look(room, samples, then)
        except DatasetError as error:
            advice = "" if isinstance(error, LoaderLost) else "; mend this frame, or remove it"
            raise DatasetError(f"{error}{advice}{_kept(room)}") from None
        except torch.OutOfMemoryError:
            problem = "the GPU has too little memory for this --batch and --crop; give smaller ones"
            raise DatasetError(problem + _kept(room)) from None
    steps, done = room.steps_total, room.steps_before
    if teller is not None:
        teller.tell({"model": str(out), "steps_done": done, "steps": steps})
    ending = "" if done == steps else f" (interrupted after {done} of {steps} steps; go on with --init {out})"
    console.print(f"model written to {out}{ending}", soft_wrap=True)


def _check_places(outputs: TrainOutputs, inputs: TrainInputs, init: str | None, *, second_look: bool) -> tuple[Path, Path | None]:
    """Where the model goes, and the folder of the one that is gone on with; raises DatasetError, ModelError."""
    from core.learning.dataset import DatasetError, find_samples
    from core.learning.model_file import INFO, model_folder
    from core.learning.model_writing import check_can_write, check_outside

    if second_look and outputs.held_out is not None:
        raise DatasetError("--held-out measures whole pictures; after --second-look measure with benchmark --accuracy")
    if outputs.held_out is not None and any(is_same(outputs.held_out, folder) for folder in inputs.data):
        raise DatasetError(f"{outputs.held_out}: is trained on, so that it cannot judge; give --held-out another folder")
    if not inputs.data and not inputs.synthetic:
        raise DatasetError("nothing to train on: give --data DIR (a labelled folder) or --synthetic N")
    out = Path(os.path.realpath(outputs.out))
    began_with = model_folder(init) if init is not None else None  # said before half a minute of frames is made
    check_outside(out, [began_with] if began_with is not None else [])
    if (out / INFO).is_file() and (began_with is None or not is_same(began_with, out)):
        raise DatasetError(f"{out}: is a model already; choose another --out, or give --init {outputs.out} to go on with it")
    check_can_write(out)
    for read in [*inputs.data, *([outputs.held_out] if outputs.held_out is not None else [])]:
        if out in (place := Path(os.path.realpath(read)), *place.parents):
            raise DatasetError(f"{read}: lies within --out, which is replaced now and then; choose another --out")
    if outputs.held_out is not None:
        find_samples([outputs.held_out])  # raises where there are none
    return out, began_with


def _made(out: Path, count: int, looks: tuple[str, ...] | None, plan: TrainingPlan) -> tuple[Path, list[Sample]]:
    """Frames that are made now, of these `looks`, in a folder beside the model's; raises DatasetError."""
    from core.learning.dataset import DatasetError, find_samples
    from hardware.twin.synth import SynthFolderError

    folder = out.with_name(out.name + "_frames")
    first = 1_000_000 + plan.seed % 10 * 100_000  # trials have the seeds from 2000000 on
    try:
        run_synth(folder, count, first, (640, 480), looks, None)
    except SynthFolderError as error:  # the folder goes with --out, and the set in it with these options
        made = "frames are made there: give --seed, --without and their number as before, or choose another --out"
        raise DatasetError(f"{error.problem}; {made}") from None
    return folder, find_samples([folder])


def _kept(room: Classroom) -> str:
    """What is told of a training that breaks off."""
    return f"; what was learnt before is kept, go on with --init {room.out}" if room.has_kept else ""


def _end_like_an_interrupt() -> None:
    """A request to end, which a window sends, is Ctrl-C from the first moment on, before ``Interrupt`` hears it."""

    def end(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, end)


def _tell_left_out(folders: Sequence[Path]) -> None:
    """Pictures that nobody learns from, because a mask is missing or has another name."""
    from core.learning.dataset import without_masks

    if left_out := without_masks(folders):
        first = left_out[0]
        masks = f"masks/{first.stem}_vessel.png and masks/{first.stem}_robot.png"
        sys.stderr.write(f"note: {len(left_out)} images without both masks are left out; the first: {first} needs {masks}\n")


def _check_choices(
    init: str | None, base: int | None, plan: TrainingPlan, *, deepen: bool, shallow: bool, second_look: bool, widen: bool
) -> None:
    """Raise DatasetError for options that could have no effect beside the others."""
    from core.learning.dataset import DatasetError

    told = {"--base": base is not None, "--shallow": shallow, "--deepen": deepen}
    shapes = [name for name, given in told.items() if given]
    if len(shapes) > 1:
        raise DatasetError(f"{' and '.join(shapes)} contradict each other; give one of them")
    if second_look and shapes and not deepen:
        raise DatasetError(f"{shapes[0]} is for the first look; with --second-look leave it out")
    if init is not None and (base is not None or shallow):
        raise DatasetError(f"{shapes[0]} shapes a new network; the one of --init {init} has its shape: leave one of them out")
    if init is None and deepen:
        raise DatasetError("--deepen needs --init MODEL, which is to be made deeper")
    if widen and not second_look:
        raise DatasetError("--widen is for the second look; give --second-look too, or leave it out")
    if widen and plan.keeps_statistics:
        raise DatasetError("--widen needs the normalisation that --remember keeps as it is; leave one of them out")
    if init is None and plan.focus_share > 0:
        raise DatasetError("--focus needs --init MODEL, which tells what is hard")
    if second_look and plan.strip_share > 0:
        raise DatasetError("--strips is for whole pictures; with --second-look leave it out")
    if second_look and plan.crop != TrainingPlan().crop:
        raise DatasetError("--crop is for whole pictures: the second look has windows of its own size; leave it out")
    if plan.stop_after is not None and plan.stop_after >= plan.steps:
        raise DatasetError(f"--stop-after {plan.stop_after} is no earlier than the end, --steps {plan.steps}; leave it out")


def _never_seen(without: Sequence[str], init: Path | None) -> list[str]:
    """Looks that neither this training sees nor the one that it begins with has seen; the others are said."""
    from core.learning.model_file import trained_without

    unseen = [look for look in without if init is None or look in trained_without(init)]
    known = [look for look in without if look not in unseen]
    if known:
        sys.stderr.write(f"note: {', '.join(known)} are left out now, but {init} may have been trained with them\n")
    return unseen


def _samples_of(folder: Path, without: Sequence[str]) -> list[Sample]:
    from core.learning.dataset import find_samples, leave_out_looks

    found = find_samples([folder])
    return leave_out_looks(folder, found, without) if without else found


def _described(folder: Path) -> dict[str, Any]:
    """What is known of a set: synth leaves its plan beside the frames."""
    import json

    plan = folder / "plan.json"
    try:
        told = json.loads(plan.read_text(encoding="utf-8")) if plan.is_file() else {}
    except (OSError, ValueError, RecursionError):
        told = {}
    return {"name": folder.name} | (told if isinstance(told, dict) else {})
