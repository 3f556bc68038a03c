"""One training after another into one model folder: what is trained, checkpoints, held-out frames, progress."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from rich.progress import Progress
from torch.utils.data import Dataset

from app.commands.progress import Interrupt, ProgressWriter
from app.ui import palette
from core.config.models import SegmentationConfig
from core.devices import UserError
from core.learning.augmentation import Crop, CropDataset, FrameCrops, PriorViews, TipCrops
from core.learning.dataset import WORKING_SIZE_PX, DatasetError, Sample, find_samples, write_png
from core.learning.model_writer import save_model, save_with_second_look
from core.learning.scene_crops import CROPS_PER_BENCH, MixedCrops, SceneCrops
from core.learning.training import HeldOutFrame, HeldOutResult, TrainingProgress, measure_held_out, train
from core.learning.training_plan import TrainingPlan
from core.perception.inference import open_second_look, open_segmenter
from core.perception.model_file import SECOND_LOOK, ModelError, check_model, load_network, model_folder, second_look_of
from core.perception.segmentation import OrientationAverage
from core.perception.tip_refinement import WINDOW_PX, Planes
from core.perception.unet import DualUNet, UNetShape, with_prior_planes
from core.program import program_id
from core.types import Image

_EXAMPLES = 40
"""Training frames from which an eight-bit network learns its ranges."""
_CROPS_A_FRAME = 4
"""Crops, or tip windows, that stand for one of these frames."""
_MOST_THREADS = 64
"""As many as perception takes (``perception.segmentation.threads``)."""
_REPORT_EVERY = 2
"""Steps between two lines for another program: a step takes half a second and more."""
_SHOW_EVERY = 50
"""Steps between two moves of the bar, and lines in the log, at most."""
_MAY_BE_LOST = 20
"""Steps that may be lost when the last copy of the network, with its eight-bit one, cannot be made."""
_KEEP_EVERY = 1000
"""Steps between two checkpoints."""
_HELD_OUT_TIMES = 10
"""How often held-out frames are measured during a training."""
_TIP_SHARE, _TIP_BATCH = 0.3, 24
"""After few frames of a new look the tip refinement is trained, too: for this share of the steps, with at most this batch."""
_PICTURES = 4
"""Held-out frames of which pictures are written."""
_OPACITY = 0.45
"""Of the colours over found masks in these pictures."""


class FrameTraining:
    """The network of whole pictures: from nothing, or from the model `init`, whose tip refinement is kept.

    `scenes`: files of ``core.learning.scenes``, from which crops are painted. `examples`: frames from which its eight-bit copy
    learns; None: ``_EXAMPLES``.

    As each ``TrainingTask`` it gives its crops (None when interrupted), and saves itself, with its eight-bit copy if `whole`.
    """

    measures_held_out = True

    def __init__(
        self,
        samples: list[Sample],
        init: str | None,
        base: int | None = None,
        *,
        examples: int | None = None,
        scenes: Sequence[Path] = (),
    ) -> None:
        self._samples, self._init, self._examples, self._scenes = samples, init, examples or _EXAMPLES, scenes
        self._tip_model: Path | None = None
        self._crops: Dataset[Crop] | None = None
        if init is None:
            self.network = DualUNet(UNetShape.of_base(base) if base else default_shape())
        else:
            check_model(init)  # a damaged tip refinement is refused before hours of training, too
            self.network = load_network(model_folder(init))[0]
            self._tip_model = second_look_of(model_folder(init))

    def crop_size(self, crop: tuple[int, int]) -> tuple[int, int]:
        stride = self.network.shape.stride
        return -(-crop[0] // stride) * stride, -(-crop[1] // stride) * stride

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> Dataset[Crop] | None:
        if not self._samples:
            self._crops = SceneCrops(self._scenes, plan)
            return self._crops
        frames = FrameCrops(self._samples, plan)
        self._crops = MixedCrops(self._scenes, frames, plan) if self._scenes else frames
        return self._crops

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        examples = list(self._example_images()) if whole else []
        save_model(network, out, training=training, figures=figures, examples=examples, second_look=self._tip_model)

    def _example_images(self) -> Iterator[Image]:
        """Whole frames; with scenes, crops of the training."""
        if self._scenes and self._crops is not None:
            for number in range(_CROPS_A_FRAME * self._examples):
                with suppress(DatasetError):  # the training reports it, and keeps what it learnt without that one
                    yield np.ascontiguousarray(self._crops[number * CROPS_PER_BENCH][0].numpy().transpose(1, 2, 0))
            return
        for sample in self._samples[:: max(1, len(self._samples) // self._examples)]:
            with suppress(DatasetError):
                yield sample.load(WORKING_SIZE_PX)[0]


class TipTraining:
    """The network of a model's tip refinement, from the one that it has, or else from its network of whole pictures."""

    measures_held_out = False

    def __init__(self, samples: list[Sample], init: str | None, examples: int | None = None) -> None:
        if init is None:
            raise UserError("--second-look needs --init MODEL, whose first look it looks again after")
        check_model(init)
        self._samples, self._init, self._base = samples, init, model_folder(init)
        self._examples = examples or _EXAMPLES
        self._has_one = second_look_of(self._base) is not None
        folder = self._base / SECOND_LOOK if self._has_one else self._base
        self.network = load_network(folder)[0] if self._has_one else with_prior_planes(load_network(folder)[0])
        self._crops: TipCrops | None = None

    def crop_size(self, crop: tuple[int, int]) -> tuple[int, int]:
        return WINDOW_PX, WINDOW_PX

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> CropDataset | None:
        plain = open_segmenter(_segmentation(self._init, plan))
        # Streams are segmented once, single pictures in eight orientations: the refinement has to work after both. Two stand for
        # eight here, where thousands of frames are segmented.
        ways = (plain, OrientationAverage(plain, turns=(0,)))
        near = open_second_look(_segmentation(self._init, plan)) if self._has_one else None
        views: dict[Path, PriorViews] = {}  # a sample that is shown more often is segmented once
        for index, sample in enumerate(bar.track(self._samples, description="first look")):
            if interrupt.asked:
                return None
            if sample.image not in views:
                views[sample.image] = PriorViews.at(sample, ways[index % 2], near)
        self._crops = TipCrops(self._samples, [views[sample.image] for sample in self._samples], plan)
        return None if interrupt.asked else self._crops

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        examples: list[Planes] = []
        if whole and self._crops is not None:
            for index in range(0, len(self._crops), max(1, len(self._crops) // (_CROPS_A_FRAME * self._examples))):
                with suppress(DatasetError):
                    examples.append(np.ascontiguousarray(self._crops[index][0].numpy().transpose(1, 2, 0)))
        save_with_second_look(self._base, network, out, training=training, figures=figures, examples=examples)


TrainingTask = FrameTraining | TipTraining


def default_shape() -> UNetShape:
    """The shipped network: chosen in docs/method.md by accuracy against time on two cores without bf16."""
    return UNetShape((16, 32, 64, 128, 192), (16, 24, 48, 64), 1, 2, (2, 2, 3, 4, 4))


def _segmentation(model: str, plan: TrainingPlan) -> SegmentationConfig:
    """Of frames before the training, on as many threads as this has."""
    return SegmentationConfig(model=model, threads=min(plan.threads, _MOST_THREADS))


def tip_plan(plan: TrainingPlan, init: str | None) -> TrainingPlan | None:
    """The plan for the tip refinement of `init` after the training of `plan`; None where it has none, or is to stay as it is."""
    if init is None or not plan.keeps_statistics or second_look_of(model_folder(init)) is None:
        return None
    steps = max(1, round(plan.steps * _TIP_SHARE))
    return replace(plan, steps=steps, warmup_steps=min(100, max(1, steps // 10)), batch=min(_TIP_BATCH, 3 * plan.batch))


class HeldOutMonitor:
    """Measures the network on frames that it is not trained on: a `folder`, or `samples` of it. Without any it does nothing."""

    def __init__(
        self,
        folder: Path | None,
        out: Path,
        writer: ProgressWriter | None,
        log: Callable[[str], object],
        samples: Sequence[Sample] | None = None,
    ) -> None:
        self._samples = samples if samples is not None else find_samples([folder]) if folder is not None else []
        self._name = folder.name if folder is not None else ""
        self._pictures = out.with_name(out.name + "_pictures")
        self._writer, self._log = writer, log
        self.figures: dict[str, Any] = {}
        """For the model's manifest: the last figures, and those before the training."""

    @property
    def is_on(self) -> bool:
        """Whether there are such frames."""
        return bool(self._samples)

    def measure(self, network: DualUNet, step: int) -> None:
        """Measure, write pictures, report."""
        if not self._samples:
            return
        result = measure_held_out(network, self._samples)
        now = {"vessel_dice": round(result.vessel_dice, 4), "robot_dice": round(result.robot_dice, 4)}
        before = self.figures.get("before", now)
        self.figures = {"set": self._name, "held_out": True, "frames": len(self._samples)} | now | {"before": before}
        self._log(f"{time.strftime('%H:%M:%S')} step {step} held out {now}\n")
        try:
            pictures = write_pictures(result, self._pictures, "after" if step else "before")
        except OSError as error:
            pictures = []
            self._log(f"the pictures cannot be written ({error.strerror})\n")
        if self._writer is not None:
            self._writer.write({"held_out_step": step, "pictures": pictures} | now)


def write_pictures(result: HeldOutResult, folder: Path, when: str) -> list[str]:
    """``<stem>_<when>.png`` of the first frames; returns the paths. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for frame in result.frames[:_PICTURES]:
        path = folder / f"{frame.stem}_{when}.png"
        write_png(path, draw_held_out(frame))  # as a whole: the window may be reading the older one
        paths.append(str(path))
    return paths


def draw_held_out(frame: HeldOutFrame) -> Image:
    """Found masks as colours (vessel, then robot), true ones as outlines, RGB at working size."""
    colours = palette.ON_PICTURE
    picture = frame.image.astype(np.float32)
    for mask, name in ((frame.vessel, colours.VESSEL), (frame.robot, colours.ROBOT)):
        picture[mask] = (1 - _OPACITY) * picture[mask] + _OPACITY * np.array(palette.rgb(name), np.float32)
    drawn = np.ascontiguousarray(np.clip(picture, 0, 255).astype(np.uint8))
    for mask, name in ((frame.true_vessel, colours.VESSEL_VECTOR), (frame.true_robot, colours.ROBOT_VECTOR)):
        outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(drawn, list(outlines), -1, palette.rgb(name), 1, cv2.LINE_AA)
    return drawn


@dataclass(slots=True)
class Trainer:
    """Runs trainings into the model folder ``out``. ``log`` takes lines; ``steps_before`` and ``steps_total`` are of all trainings;
    ``has_saved``: a model has been written."""

    out: Path
    notes: dict[str, Any]
    log: Callable[[str], object]
    writer: ProgressWriter | None
    bar: Progress
    interrupt: Interrupt
    held_out: HeldOutMonitor
    steps_before: int = 0
    steps_total: int = 0
    has_saved: bool = False

    def run_tip(self, samples: list[Sample], plan: TrainingPlan, examples: int | None = None) -> int | None:
        """Train the tip refinement of the model that the training before wrote."""
        task = TipTraining(samples, str(self.out), examples)
        return self.run(task, replace(plan, crop=task.crop_size(plan.crop)))

    def run(self, task: TrainingTask, plan: TrainingPlan) -> int | None:
        """Train and save; the steps done, None when it was interrupted before the first."""
        monitor = self.held_out if task.measures_held_out else None
        self.steps_total = max(self.steps_total, self.steps_before + plan.steps)
        self.log(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {self.notes | {'plan': plan.to_json()}}\n")
        began_s = time.monotonic()
        crops = task.crops(plan, self.bar, self.interrupt)
        if crops is None:
            return None
        if plan.seconds is not None:
            plan = replace(plan, seconds=max(1.0, plan.seconds - (time.monotonic() - began_s)))
        self.log(f"{time.strftime('%H:%M:%S')} trains on the {'GPU' if torch.cuda.is_available() else 'processor'}\n")
        if monitor is not None:
            monitor.measure(task.network, 0)
        if self.interrupt.asked:
            return None
        bar_task = self.bar.add_task("steps", total=plan.steps)

        def report(now: TrainingProgress) -> None:
            dice = f"dice vessel {now.vessel_dice:.3f} robot {now.robot_dice:.3f}"
            self.log(f"{time.strftime('%H:%M:%S')} step {now.step} loss {now.loss:.4f} {dice} {now.images_per_s:.1f} images/s\n")
            if self.writer is None:
                self.bar.update(bar_task, completed=now.step, total=now.steps, description=f"loss {now.loss:.3f} {dice}")
                return
            left_s = round((now.steps - now.step) * plan.batch / max(now.images_per_s, 1e-9), 1)
            steps = {"step": self.steps_before + now.step, "steps": self.steps_total}
            self.writer.write(asdict(now) | steps | {"left_s": left_s})

        told = {"program": program_id(), "plan": plan.to_json()}

        def save(network: DualUNet, step: int, *, whole: bool) -> None:
            figures = monitor.figures if monitor is not None else {}
            task.save(network, self.out, self.notes | told | {"steps_done": step}, figures, whole=whole)
            self.has_saved = True

        def on_checkpoint(network: DualUNet, step: int) -> None:
            # A disk that is full for a while does not end what takes hours: there are more checkpoints, and the end.
            try:
                if monitor is not None:
                    monitor.measure(network, step)
                save(network, step, whole=False)
            except ModelError as error:
                self.log(f"{time.strftime('%H:%M:%S')} step {step} could not be kept: {error}\n")
                if self.writer is None:
                    self.bar.console.print(f"step {step} could not be kept, the training goes on: {error}", soft_wrap=True)

        def on_last(network: DualUNet, step: int) -> None:
            if self.writer is None:  # shows that Ctrl-C was received
                self.bar.update(bar_task, completed=step, description="saving ...", refresh=True)
            # Saved first without the eight-bit copy, which takes a while and may fail.
            if step > _MAY_BE_LOST:
                save(network, step, whole=False)
            if monitor is not None:
                monitor.measure(network, step)
            save(network, step, whole=True)

        _, done = train(
            task.network,
            crops,
            plan,
            on_progress=report,
            on_checkpoint=on_checkpoint,
            on_last=on_last,
            # A window that has gone can no longer ask for the end.
            should_stop=lambda: self.interrupt.asked or (self.writer is not None and not self.writer.is_read),
            # The bar of a training of few steps moves, too.
            report_every=max(1, min(_SHOW_EVERY, plan.steps // 10)) if self.writer is None else _REPORT_EVERY,
            checkpoint_every=min(_KEEP_EVERY, max(_REPORT_EVERY, plan.steps // _HELD_OUT_TIMES))
            if self.held_out.is_on
            else _KEEP_EVERY,
        )
        self.steps_before += done
        return done
