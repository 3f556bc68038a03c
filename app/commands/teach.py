"""``teach``: a model and a bench from pictures of the empty bench, one outline of the vessel, and frames of the moving robot."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import platformdirs
import typer
from rich.console import Console
from rich.table import Table

from app.commands.options import JsonOption, ProgressOption
from app.commands.progress import (
    Interrupt,
    console,
    end_like_an_interrupt,
    is_same,
    progress_bar,
    progress_writer,
    report_progress,
)
from core.config.rig_file import find_rig, set_bench
from core.devices import UserError
from core.learning.training_plan import TrainingPlan
from core.perception.model_file import BENCH
from core.program import need_package

if TYPE_CHECKING:
    from rich.progress import Progress

    from core.bench.bench import Bench
    from core.config.calibration import CalibrationConfig
    from core.evaluation.bench_calibration import TeachingResult
    from core.learning.dataset import Sample
    from core.learning.teaching import FrameSelection, TeachingPicture, TeachingSet
    from core.types import Image, Mask

_REMEMBER = 80
"""Frames of the twin that are made first, and shown as often as the bench's, so that nothing is forgotten."""
_OTHERS = 40
"""Of these, the pictures of another kind in the calibration, and the frames that the tip refinement is shown."""
_SPREAD = 16
"""Pictures, at least, from which the empty bench is made where there is no picture of it."""
_TWIN_SEED = 1_000_000
"""First phantom seed of these frames; trials have the seeds from 2000000 on."""
_FREE_BYTES = 200_000_000
"""Of the disk: frames, the model while it is made, and the model."""
_TIP_SHARE = 0.25
"""Share of the training time for the tip refinement."""
_MOST_STEPS = 700
"""More steps learn the few frames by heart."""
_LEAST_S = 45.0
"""A shorter training does not learn a bench."""
_MOST_RESERVED = 0.4
"""Of the time left, for writing and calibrating the model: where these take longer, they end later than asked for."""
_FEW_STEPS = 80
"""Fewer steps than this are reported: the machine is too slow for the time given."""
_EXAMPLES = 6
"""Frames from which eight-bit copies learn: those of one bench are alike."""
_EXPORT_PICTURES = 80.0
"""Writing both networks with these copies takes as long as perceiving so many pictures in all orientations."""
_PLAN = TrainingPlan(batch=8, learning_rate=2e-3, look_share=0.7, warmup_steps=20, keeps_statistics=True)
"""For a trained network and few frames, as the window "Train on my annotations" has it."""


def teach(
    source: Annotated[Path, typer.Argument(help="session, video or folder of pictures of one bench; or OUT_teaching")],
    out: Annotated[Path, typer.Option(help="folder of the new model, with its bench")],
    empty: Annotated[list[Path] | None, typer.Option(help="picture of the bench without the robot; may be repeated")] = None,
    vessel: Annotated[
        Path | None, typer.Option(help="mask of the vessel's lumen, white, drawn once; without it the model's proposal")
    ] = None,
    frames: Annotated[int, typer.Option(min=8, max=200, help="diverse frames to learn from, a quarter of them held out")] = 24,
    minutes: Annotated[float, typer.Option(min=0.5, max=600, help="time that it takes in all")] = 5.0,
    init: Annotated[str, typer.Option(help="model to begin with")] = "default",
    rig: Annotated[str | None, typer.Option(help="rig whose file takes the model and its bench")] = None,
    frames_only: Annotated[
        bool, typer.Option("--frames-only", help="stop before the training; look through OUT_teaching, and go on with it as SOURCE")
    ] = False,
    as_json: JsonOption = False,
    progress_json: ProgressOption = False,
) -> None:
    """Teach a bench: the robot's masks are made by difference to the empty bench, and nothing is drawn but the vessel, once.

    Ctrl-C keeps the frames, and what was learnt, in OUT_teaching; the model of that name is replaced in the very end only.
    """
    if progress_json:
        report_progress()
    end_like_an_interrupt()
    began_s = time.monotonic()
    clock = _Clock(began_s, began_s + 60 * minutes)
    taker = find_rig(rig)[0] if rig is not None else None
    out = Path(os.path.realpath(out))
    folder = out.with_name(out.name + "_teaching")
    _check_places(source, out, folder, init)
    made = _frames_of(source, folder, empty or [], vessel, frames, init)
    for name, why in made.rejected:
        sys.stderr.write(f"rejected: {name}: {why}\n")
    if frames_only:
        _print_frames(made, as_json or progress_json)
        return
    from hardware.twin.own_phantom import phantom_for_bench

    result, steps = _train(made, out, init, clock)
    sys.stderr.write(f"note: {phantom_for_bench(out / BENCH, _calibration(source, rig))}\n")
    if taker is not None:
        set_bench(taker, out / BENCH, str(out))
    _print_result(made, out, result, steps, clock.elapsed_s, as_json or progress_json)


def _calibration(source: Path, rig: str | None) -> CalibrationConfig | None:
    """Of the rig, or else of the rig that recorded the session."""
    from core.session.manifest import MANIFEST, SessionError, read_manifest

    if rig is not None:
        return find_rig(rig)[1].calibration
    try:
        return read_manifest(source).known if (source / MANIFEST).is_file() else None
    except SessionError:  # its pictures were taken all the same
        return None


@dataclass(frozen=True, slots=True)
class _Clock:
    """Monotonic times of the beginning and of when all is to be done."""

    began_s: float
    ends_s: float

    @property
    def elapsed_s(self) -> float:
        return time.monotonic() - self.began_s

    @property
    def left_s(self) -> float:
        return self.ends_s - time.monotonic()


def _check_places(source: Path, out: Path, folder: Path, init: str) -> None:
    """Raise UserError for a model or a place that would end it after minutes of work."""
    from core.learning.model_writer import check_can_write, check_outside
    from core.perception.model_file import check_model, model_folder

    need_package("torch")
    check_model(init)
    began_with = model_folder(init)
    if is_same(began_with, out):
        raise UserError(f"{out}: is the model to begin with; choose another --out")
    check_outside(out, [began_with])
    check_can_write(out)
    if not source.exists():
        raise UserError(f"{source}: is not there")
    if is_same(source, out) or out in Path(os.path.realpath(source)).parents:
        raise UserError(f"{source}: lies within --out, which is replaced; choose another --out")
    free = shutil.disk_usage(out.parent).free
    if free < _FREE_BYTES:
        raise UserError(f"{out.parent}: {free // 1_000_000} MB are free, {_FREE_BYTES // 1_000_000} MB are needed; make room")


def _frames_of(source: Path, folder: Path, empty: Sequence[Path], vessel: Path | None, count: int, init: str) -> TeachingSet:
    """The set of frames: made from the pictures, or made before and perhaps corrected."""
    from core.config.models import PerceptionConfig, SegmentationConfig
    from core.learning import teaching
    from core.perception.pipeline import open_calibrated

    if teaching.is_teaching_set(source):
        if empty or vessel is not None:
            raise UserError(f"{source}: holds frames with their bench; leave --empty and --vessel out")
        return teaching.read_teaching_set(source)
    name = source.resolve().name
    bench = _bench_of(empty, vessel, name, init) if empty else _bench_without_picture(source, vessel, name, init)
    segment = open_calibrated(PerceptionConfig(segmentation=SegmentationConfig(model=init)))[0].segment
    with progress_bar() as bar:
        selection = _pick(source, bench, count, bar)
        tracked = bar.track(selection.pictures(), description="masks by difference")
        proposed = [teaching.propose(picture, bench, segment) for picture in tracked]
    checked = [*teaching.check(proposed, bench, has_pictures=bool(empty)), *selection.refused]
    chosen = teaching.choose(checked, count)
    return teaching.write_teaching_set(folder, bench, chosen, [frame for frame in checked if frame.reason], selection.seen)


def _bench_of(empty: Sequence[Path], vessel: Path | None, name: str, init: str) -> Bench:
    from core.bench.bench import bench_from_pictures
    from core.files import read_image
    from core.learning.dataset import WORKING_SIZE_PX, read_mask

    images = [read_image(path) for path in empty]
    mask = read_mask(vessel) if vessel is not None else _proposed_vessel(images[:1], init)
    return bench_from_pictures(images, mask, name, WORKING_SIZE_PX)


def _bench_without_picture(source: Path, vessel: Path | None, name: str, init: str) -> Bench:
    """The bench as most of some pictures show it, evenly over all of them, with the robot in another place in each."""
    from core.bench.bench import bench_from_frames, with_vessel
    from core.config.models import PerceptionConfig
    from core.learning.dataset import WORKING_SIZE_PX, read_mask
    from core.perception.inference import open_segmenter

    images: list[Image] = []
    step = 1
    for index, picture in enumerate(_pictures_of(source)):
        if index % step == 0:
            images.append(picture.image)
        if len(images) == 2 * _SPREAD:
            images, step = images[::2], 2 * step
    if not images:
        raise UserError(f"{source}: no picture in it can be read; give a session, a video or a folder of pictures of one bench")
    images = [image for image in images if image.shape == images[0].shape]  # others are reported where frames are picked
    segment = open_segmenter(PerceptionConfig().segmentation.model_copy(update={"model": init}))
    robots = [segment(image)[1] for image in images]
    mask = read_mask(vessel) if vessel is not None else _proposed_vessel(images, init)
    height, width = mask.shape  # of the camera's pictures, which are smaller here
    scale = WORKING_SIZE_PX / max(height, width)
    if (round(height * scale), round(width * scale)) != images[0].shape[:2]:
        sizes = [f"{one.shape[1]}x{one.shape[0]}" for one in (mask, images[0])]
        raise UserError(f"the vessel mask has {sizes[0]} px, the pictures {sizes[1]} at working size: draw it on one of them")
    sys.stderr.write("note: without --empty the empty bench is what most pictures show\n")
    return with_vessel(bench_from_frames(images, name, WORKING_SIZE_PX, None, robots), mask)


def _proposed_vessel(images: Sequence[Image], init: str) -> Mask:
    """The vessel that the model sees in the empty pictures, in all orientations; raises UserError where it sees none."""
    import cv2
    import numpy as np

    from core.config.models import PerceptionConfig
    from core.learning.dataset import WORKING_SIZE_PX
    from core.perception.inference import open_segmenter
    from core.perception.segmentation import OrientationAverage, clean_mask, to_working

    config = PerceptionConfig()
    segment = OrientationAverage(open_segmenter(config.segmentation.model_copy(update={"model": init})))
    found = np.mean([segment(to_working(image, WORKING_SIZE_PX)[0])[0] for image in images], axis=0)
    cleaning = config.cleaning
    mask = clean_mask(found >= config.segmentation.vessel_threshold, cleaning.min_vessel_area_px, cleaning.max_hole_area_px)
    if not mask.any():
        raise UserError("the model finds no vessel in the empty picture: draw it once, and give it with --vessel MASK.png")
    sys.stderr.write("note: without --vessel the vessel is the model's proposal; look at OUT_teaching/bench/vessel.png\n")
    size = images[0].shape[1], images[0].shape[0]
    return np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0)


def _pictures_of(source: Path, bar: Progress | None = None) -> Iterator[TeachingPicture]:
    """The pictures of the source that can be read, at working size; a note tells the others."""
    from core.learning.dataset import WORKING_SIZE_PX
    from core.learning.teaching import TeachingPicture
    from core.perception.segmentation import to_working
    from hardware.cameras.picture_files import expand, is_video
    from hardware.cameras.picture_files import pictures as pictures_of

    files, problems = expand([source]), []
    task = bar.add_task("pictures", total=None if any(map(is_video, files)) else len(files)) if bar is not None else None
    for picture in pictures_of(files):
        if bar is not None and task is not None:
            bar.advance(task)
        if picture.image is None:
            problems.append(picture.problem or f"{picture.name}: cannot be read")
            continue
        yield TeachingPicture(Path(picture.name).name, picture.stem, to_working(picture.image, WORKING_SIZE_PX)[0])
    if problems and bar is not None:
        sys.stderr.write(f"note: {len(problems)} pictures could not be read; the first: {problems[0]}\n")


def _pick(source: Path, bench: Bench, count: int, bar: Progress) -> FrameSelection:
    """Diverse pictures of the source."""
    from core.learning.teaching import FrameSelection, TeachingError

    selection = FrameSelection(bench, count)
    for picture in _pictures_of(source, bar):
        if picture.image.shape != bench.empty.shape:
            sizes = [f"{one.shape[1]}x{one.shape[0]}" for one in (picture.image, bench.empty)]
            raise TeachingError(f"{picture.name}: {sizes[0]} px at working size, the empty picture {sizes[1]}: take both alike")
        selection.add(picture)
    return selection


def _train(made: TeachingSet, out: Path, init: str, clock: _Clock) -> tuple[TeachingResult, int]:
    """Train, calibrate, and put the model in its place; the result on the held-out frames, and the steps."""
    import torch

    from app.commands.trainer import FrameTraining, HeldOutMonitor, Trainer
    from core.bench.bench import read_bench
    from core.bench.robot_texture import textures_of, write_textures
    from core.config.models import PerceptionConfig
    from core.evaluation.bench_calibration import BenchCalibration
    from core.learning.dataset import find_samples
    from core.learning.model_writer import install_model, write_figures
    from core.perception.model_file import load_network, model_folder, read_model_info, second_look_of

    twin = _twin_frames(made.folder)
    remembered = find_samples([twin])
    bench = read_bench(made.bench)
    write_textures(textures_of(made.train, bench), made.bench)
    begin = _resumed(made, init)
    network = made.network
    prior = read_model_info(model_folder(init))
    if prior.calibration is None:
        prior = read_model_info(model_folder("default"))
    config = PerceptionConfig()
    calibration = BenchCalibration(network, prior, made.train, made.held_out, remembered[:_OTHERS], config)
    counted_s = calibration.count_s(begin, _EXPORT_PICTURES)
    reserved_s = min(counted_s, _MOST_RESERVED * clock.left_s)
    left_s = clock.left_s - reserved_s
    if left_s < _LEAST_S:
        needed = (clock.elapsed_s + min(counted_s + _LEAST_S, _LEAST_S / (1 - _MOST_RESERVED))) / 60
        left = f"{max(0.0, left_s):.0f} s would be left for the training"
        raise UserError(f"too short a time: {left}; give it {math.ceil(needed)} minutes or more")
    samples = _shown_as_often(made.train, remembered)
    has_tip = second_look_of(model_folder(begin)) is not None
    plan = replace(_PLAN, steps=_MOST_STEPS, seconds=left_s * (1 - _TIP_SHARE if has_tip else 1.0))
    notes: dict[str, Any] = {
        "init": init,
        "frames": len(samples),
        "taught": {"bench": bench.name, "frames": len(made.train)},
    }
    torch.manual_seed(plan.seed)
    task = FrameTraining(samples, begin, examples=_EXAMPLES)
    plan = replace(plan, crop=task.crop_size(plan.crop))
    writer = progress_writer()
    with (made.folder / "log.txt").open("a", encoding="utf-8", buffering=1) as log, Interrupt() as interrupt, progress_bar() as bar:
        monitor = HeldOutMonitor(made.folder, made.folder / "held_out", writer, log.write, made.held_out)
        monitor.measure(task.network, 0)  # its pictures are for the window, or a look into the folder
        off = HeldOutMonitor(None, network, writer, log.write)
        trainer = Trainer(network, notes, log.write, writer, bar, interrupt, off, steps_total=plan.steps)
        done = trainer.run(task, plan)
        if has_tip and not interrupt.asked:
            # Where other programs have made all slower than was measured, it still gets most of its share.
            tip_s = max(0.7 * _TIP_SHARE * left_s, clock.left_s - reserved_s)
            tip = replace(plan, steps=_MOST_STEPS // 3, batch=16, seconds=tip_s)
            trainer.run_tip(_shown_as_often(made.train, remembered[:_OTHERS]), tip, _EXAMPLES)
        result = None
        if not interrupt.asked:
            monitor.measure(load_network(network)[0], trainer.steps_before)
            bar_task = bar.add_task("calibration", total=calibration.count)
            result = calibration.run(lambda count, _of: bar.update(bar_task, completed=count), lambda: interrupt.asked)
    if result is None:
        console.print(
            f"interrupted; frames and what was learnt are kept: go on with teach {made.folder} --out {out}", soft_wrap=True
        )
        raise KeyboardInterrupt
    write_figures(network, monitor.figures)
    install_model(network, out, made.bench)
    shutil.rmtree(network, ignore_errors=True)
    if done is not None and done < _FEW_STEPS:
        sys.stderr.write(f"note: only {done} steps in this time; give more --minutes, or close other programs\n")
    return result, trainer.steps_before


def _twin_frames(folder: Path) -> Path:
    """Frames of the twin: made once for all benches, in the program's cache, or else in `folder`."""
    from app.commands.synth import make_set
    from hardware.twin.dataset import SynthFolderError

    workers = min(2, os.cpu_count() or 1)
    for twin in (Path(platformdirs.user_cache_dir("LumenPilot")) / f"twin_frames_{_REMEMBER}", folder / "twin"):
        try:
            make_set(twin, _REMEMBER, _TWIN_SEED, workers=workers)
        except (OSError, SynthFolderError):
            if twin.parent == folder:
                raise
            continue  # it cannot be written, or another version of the program made it
        break
    return twin


def _resumed(made: TeachingSet, init: str) -> str:
    """The network of an interrupted call on the same frames, or else the model to begin with."""
    from core.perception.model_file import ModelError, check_model

    network = made.network
    try:
        check_model(str(network))
    except ModelError:
        return init
    sys.stderr.write(f"note: goes on with what was learnt before in {network}\n")
    return str(network)


def _shown_as_often(train: Sequence[Sample], remembered: Sequence[Sample]) -> list[Sample]:
    """Few frames of a new look, repeated to be as many as those that are remembered."""
    return [*train] * max(1, round(len(remembered) / len(train))) + [*remembered]


def _print_frames(made: TeachingSet, as_json: bool) -> None:
    rows = {
        "frames": len(made.train) + len(made.held_out),
        "held_out": len(made.held_out),
        "rejected": [{"name": name, "reason": why} for name, why in made.rejected],
        "pictures": made.seen,
        "folder": str(made.folder),
    }
    if as_json:
        sys.stdout.write(json.dumps(rows, allow_nan=False) + "\n")
    else:
        console.print(f"{rows['frames']} frames in {made.folder}; go on with it as SOURCE", soft_wrap=True)


def _print_result(made: TeachingSet, out: Path, result: TeachingResult, steps: int, elapsed_s: float, as_json: bool) -> None:
    if as_json:
        rows: dict[str, Any] = {
            "model": str(out),
            "bench": str(out / "bench"),
            "frames": len(made.train),
            "rejected": [{"name": name, "reason": why} for name, why in made.rejected],
            "pictures": made.seen,
            "steps": steps,
            "time_s": round(elapsed_s, 1),
            "held_out": asdict(result),
        }
        sys.stdout.write(json.dumps(rows, allow_nan=False) + "\n")
        return
    table = Table(title=f"{out}: what to expect on this bench", show_header=False)
    share = result.answered / result.frames if result.frames else 0.0
    auroc = "-" if result.confidence_auroc is None else f"{result.confidence_auroc:.2f}"
    lines = (
        ("frames", f"{len(made.train)} learnt from, {len(made.held_out)} held out, {len(made.rejected)} rejected of {made.seen}"),
        ("answered", f"{share:.0%} of {result.frames} held-out frames, {result.right} of {result.answered} right"),
        ("agreement with the difference", f"Dice robot {result.robot_dice:.3f}, vessel {result.vessel_dice:.3f}"),
        ("head, theta (medians)", f"{_number(result.head_px, 'px')}, {_number(result.theta_deg, 'deg')}"),
        ("confidence", f"{_share(result.confidence)}; calibration error {_share(result.calibration_error)}, AUROC {auroc}"),
        ("other benches refused", _share(result.refused)),
        ("doubtful places", f"{result.doubtful_share:.1%} of the robot"),
        ("time", f"{elapsed_s / 60:.1f} min, {steps} steps"),
    )
    for name, value in lines:
        table.add_row(name, value)
    Console(markup=False, emoji=False).print(table)


def _number(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:.1f} {unit}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.0%}"
