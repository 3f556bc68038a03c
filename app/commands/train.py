"""``train``: a network from nothing or from a model; long work with progress, which can be interrupted and continued."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.options import ProgressOption
from app.commands.progress import (
    Interrupt,
    console,
    end_like_an_interrupt,
    is_same,
    progress_bar,
    progress_writer,
    report_progress,
)
from app.commands.synth import make_set
from core.devices import UserError, disk_errors
from core.learning.training_plan import TrainingPlan
from core.program import need_package

if TYPE_CHECKING:
    from app.commands.trainer import TrainingTask
    from core.learning.dataset import Sample

_STEPS = TrainingPlan().steps
"""Of a training whose time is not given."""
_MOST_STEPS = 1_000_000
"""Of a training whose time is given: more than any machine does."""


@dataclass(frozen=True, slots=True)
class TrainOptions:
    """What ``train`` reads and writes.

    Attributes
    ----------
    out : folder of the new model.
    data : labelled folders.
    synthetic : frames to make besides.
    held_out : labelled frames that stay out of training and say whether it helped.
    scenes : folders of scenes, from which crops are painted.
    init : the model to begin with; None: a new network, plain of width ``base``, or as the shipped one.
    tip : train the network of the tip refinement of ``init``.
    """

    out: Path
    data: Sequence[Path] = ()
    synthetic: int = 0
    held_out: Path | None = None
    init: str | None = None
    base: int | None = None
    tip: bool = False
    scenes: Sequence[Path] = ()


def train(
    out: Annotated[Path, typer.Option(help="folder of the new model")],
    data: Annotated[list[Path] | None, typer.Option(help="labelled folder as synth writes it; may be repeated")] = None,
    scenes: Annotated[
        list[Path] | None, typer.Option(help="folder of synth --scenes, from which crops of benches are painted; may be repeated")
    ] = None,
    scene_share: Annotated[
        float, typer.Option(min=0, max=1, help="share of the crops painted from --scenes where there is --data, too")
    ] = 0.5,
    synthetic: Annotated[int, typer.Option(min=0, help="also make this many frames with the twin")] = 0,
    init: Annotated[str | None, typer.Option(help="start from this model instead of from nothing")] = None,
    remember: Annotated[
        int, typer.Option(min=0, help="for few frames of a new look: as often show so many of the twin, that nothing is forgotten")
    ] = 0,
    second_look: Annotated[
        bool, typer.Option("--second-look", help="train the network of the --init model's second look, near the robot's ends")
    ] = False,
    steps: Annotated[int | None, typer.Option(min=1, help=f"{_STEPS} without --minutes")] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.01, help="train for so long; the rate falls with the time, and --steps is the most")
    ] = None,
    batch: Annotated[int, typer.Option(min=1, max=512)] = 12,
    rate: Annotated[float, typer.Option(min=1e-6, max=0.1, help="peak learning rate")] = 1e-2,
    crop: Annotated[int, typer.Option(min=64, max=2048, help="side of the training crops, working pixels")] = 256,
    look_share: Annotated[float, typer.Option(min=0, max=1, help="share of the crops whose look is changed at random")] = 1.0,
    end_weight: Annotated[
        float, typer.Option(min=0, max=20, help="how much more than elsewhere a pixel counts near the robot's ends")
    ] = 0.0,
    robot_weight: Annotated[
        float, typer.Option(min=0.1, max=10, help="how much the robot's loss counts beside the vessel's")
    ] = 1.5,
    base: Annotated[
        int | None, typer.Option(min=4, max=128, help="plain U-Net of this base width instead of the folded one")
    ] = None,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    threads: Annotated[int, typer.Option(min=0, max=256, help="CPU threads; 0 = all")] = 0,
    held_out: Annotated[
        Path | None, typer.Option(help="labelled folder that is not trained on: its Dice before and after goes into the model")
    ] = None,
    progress_json: ProgressOption = False,
) -> None:
    """Train or fine-tune the network; Ctrl-C keeps what was learnt."""
    if remember and (synthetic or not data or init is None):
        raise UserError("--remember N is for --data DIR and --init MODEL, without --synthetic")
    if minutes is not None and remember:
        raise UserError("--minutes is for a training without --remember; give --steps")
    steps = steps or (_STEPS if minutes is None else _MOST_STEPS)
    plan = TrainingPlan(
        steps=steps,
        batch=batch,
        learning_rate=rate,
        warmup_steps=min(100, max(1, steps // 10)),
        crop=(crop, crop),
        look_share=look_share,
        end_weight=end_weight,
        robot_weight=robot_weight,
        keeps_statistics=remember > 0,
        scene_share=scene_share,
        seconds=None if minutes is None else 60 * minutes,
        seed=seed,
        threads=threads,
    )
    if progress_json:
        report_progress()
    frames = synthetic or remember
    run_train(TrainOptions(out, data or (), frames, held_out, init, base, second_look, scenes or ()), plan)


def run_train(options: TrainOptions, plan: TrainingPlan) -> None:
    """Train on labelled folders, scenes and, if asked, frames made now; writes the model folder `out` and `out`.log.

    Where the plan keeps the normalisation, ``data`` is shown as often as the frames made now, and the tip refinement is trained.
    """
    from core.learning.dataset import DatasetError, find_samples, without_masks
    from core.learning.scenes import find_scenes

    need_package("torch")
    init = options.init
    end_like_an_interrupt()
    _check_choices(options, plan)
    out = _check_places(options)
    folders = list(options.data)
    samples, scenes = find_samples(folders), find_scenes(options.scenes)
    if left_out := without_masks(folders):
        first = left_out[0]
        masks = f"masks/{first.stem}_vessel.png and masks/{first.stem}_robot.png"
        sys.stderr.write(f"note: {len(left_out)} images without both masks are left out; the first: {first} needs {masks}\n")

    import torch  # a broken one shows before hours of frames are made

    from app.commands.trainer import FrameTraining, HeldOutMonitor, TipTraining, Trainer, tip_plan
    from core.learning.training import LoaderLost

    if options.synthetic:
        folder, made = _make_frames(out, options, plan)
        if plan.keeps_statistics:  # few frames of a new look, shown as often as all that is to be remembered
            samples *= max(1, round(options.synthetic / len(samples)))
        folders.append(folder)
        samples += made
    torch.manual_seed(plan.seed)
    task: TrainingTask = TipTraining(samples, init) if options.tip else FrameTraining(samples, init, options.base, scenes=scenes)
    plan = replace(plan, crop=task.crop_size(plan.crop))
    then = None if options.tip else tip_plan(plan, init)
    notes: dict[str, Any] = {"init": init, "frames": len(samples), "sets": [_described(folder) for folder in folders]}
    if scenes:
        notes |= {"scenes": len(scenes), "scene_sets": [_described(folder) for folder in options.scenes]}
    with disk_errors(DatasetError, out.parent, "cannot be written", "; choose another --out"):
        log = out.with_name(out.name + ".log").open("a", encoding="utf-8", buffering=1)
    writer = progress_writer()
    held_out = HeldOutMonitor(options.held_out, out, writer, log.write)
    with log, Interrupt() as interrupt, progress_bar() as bar:
        steps = plan.steps + (then.steps if then else 0)
        trainer = Trainer(out, notes, log.write, writer, bar, interrupt, held_out, steps_total=steps)
        try:
            done = trainer.run(task, plan)
            if done is None:
                console.print(f"interrupted before the first step; nothing was written to {out}", soft_wrap=True)
                raise KeyboardInterrupt
            if then is not None and done == plan.steps:
                trainer.run_tip(samples, then)
        except (DatasetError, torch.OutOfMemoryError) as error:
            problem, kept = str(error), f"; what was learnt before is kept, go on with --init {out}" if trainer.has_saved else ""
            if isinstance(error, torch.OutOfMemoryError):
                problem = "the GPU has too little memory for this --batch and --crop; give smaller ones"
            elif not isinstance(error, LoaderLost):
                problem += "; mend this frame, or remove it"
            raise DatasetError(problem + kept) from None
    steps, done = trainer.steps_total, trainer.steps_before
    if writer is not None:
        writer.write({"model": str(out), "steps_done": done, "steps": steps})
    if plan.seconds is not None:
        ending = f" (interrupted after {done} steps; go on with --init {out})" if interrupt.asked else f" ({done} steps)"
    else:
        ending = "" if done == steps else f" (interrupted after {done} of {steps} steps; go on with --init {out})"
    console.print(f"model written to {out}{ending}", soft_wrap=True)


def _check_choices(options: TrainOptions, plan: TrainingPlan) -> None:
    """Raise DatasetError for options that could have no effect beside the others."""
    from core.learning.dataset import DatasetError

    init, tip = options.init, options.tip
    first, default = "--base" if options.base is not None else "", TrainingPlan()
    windows = "--crop is for whole pictures: the second look has windows of its own size; leave it out"
    problems = (
        (tip and first, f"{first} is for the first look; with --second-look leave it out"),
        (init and first, f"{first} shapes a new network; the one of --init {init} has its shape: leave one of them out"),
        (tip and options.scenes, "--scenes is for whole pictures; with --second-look leave it out"),
        (tip and plan.crop != default.crop, windows),
    )
    for applies, problem in problems:
        if applies:
            raise DatasetError(problem)


def _check_places(options: TrainOptions) -> Path:
    """Where the model goes; raises DatasetError, ModelError."""
    from core.learning.dataset import DatasetError, find_samples
    from core.learning.model_writer import check_can_write, check_outside
    from core.perception.model_file import INFO, model_folder

    held_out = options.held_out
    if options.tip and held_out is not None:
        raise DatasetError("--held-out measures whole pictures; after --second-look measure with benchmark --accuracy")
    if held_out is not None and any(is_same(held_out, folder) for folder in options.data):
        raise DatasetError(f"{held_out}: is trained on, so that it cannot judge; give --held-out another folder")
    if not options.data and not options.synthetic and not options.scenes:
        raise DatasetError("nothing to train on: give --data DIR (a labelled folder), --scenes DIR or --synthetic N")
    out = Path(os.path.realpath(options.out))
    began_with = model_folder(options.init) if options.init is not None else None  # refused before frames are made
    check_outside(out, [began_with] if began_with is not None else [])
    if (out / INFO).is_file() and (began_with is None or not is_same(began_with, out)):
        raise DatasetError(f"{out}: is a model already; choose another --out, or give --init {options.out} to go on with it")
    check_can_write(out)
    for read in [*options.data, *options.scenes, *([held_out] if held_out is not None else [])]:
        if out in (place := Path(os.path.realpath(read)), *place.parents):
            raise DatasetError(f"{read}: lies within --out, which is replaced now and then; choose another --out")
    if held_out is not None:
        find_samples([held_out])  # raises without any
    return out


def _make_frames(out: Path, options: TrainOptions, plan: TrainingPlan) -> tuple[Path, list[Sample]]:
    """Frames of the twin in a folder beside the model's; raises DatasetError."""
    from core.learning.dataset import DatasetError, find_samples
    from hardware.twin.dataset import SynthFolderError

    folder = out.with_name(out.name + "_frames")
    first = 1_000_000 + plan.seed % 10 * 100_000  # trials have the seeds from 2000000 on
    try:
        make_set(folder, options.synthetic, first)
    except SynthFolderError as error:  # the folder goes with --out, and the set in it with these options
        made = "frames are made there: give --seed and their number as before, or choose another --out"
        raise DatasetError(f"{error.problem}; {made}") from None
    return folder, find_samples([folder])


def _described(folder: Path) -> dict[str, Any]:
    """Name of a set, and the plan that ``synth`` leaves beside its frames."""
    plan = folder / "plan.json"
    try:
        described = json.loads(plan.read_text(encoding="utf-8")) if plan.is_file() else {}
    except (OSError, ValueError, RecursionError):
        described = {}
    return {"name": folder.name} | (described if isinstance(described, dict) else {})
