"""``train``: long work with progress that can be interrupted and gone on with.

``synth``: labelled frames from the twin.

One lesson after another into one model folder, with progress that people and programs can follow.

What ``train`` can teach: the network that looks at whole pictures, or the one of a model's second look.

How a network that learns does on frames that it does not learn from.

Pictures of a held-out frame: what the network finds, over it the outlines of what was drawn by hand.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import cv2
import numpy as np
import torch
from rich.progress import Progress
from torch import Tensor
from torch.utils.data import Dataset

from app.commands.progress import Interrupt, ProgressWriter, asked_teller, console, is_same, progress_bar
from app.commands.workers import over_cluster
from app.ui import theme
from core.config.models import SegmentationConfig
from core.devices import UserError
from core.evaluation.accuracy import difficulty
from core.learning.augmentation import FrameCrops, Looks, NearCrops
from core.learning.dataset import WORKING_SIZE_PX, DatasetError, Sample, write_png
from core.learning.gpu_batches import DeviceCrops, DeviceFrames, DeviceWindows, first_looks, fits
from core.learning.growing import deepened, widened, with_first_look
from core.learning.model_writer import save_model, save_with_second_look
from core.learning.training import Attentive, HeldOut, HeldOutFrame, train
from core.learning.training import Progress as Report
from core.learning.training_plan import TrainingPlan
from core.perception.inference import open_second_look, open_segmenter
from core.perception.model_file import SECOND_LOOK, ModelError, check_model, load_network, model_folder, second_look_of
from core.perception.segmentation import Turned
from core.perception.tip_refinement import WINDOW_PX, Planes
from core.perception.unet import DualUNet, UNetShape
from core.types import Image, Mask


def run_synth(
    out: Path,
    count: int,
    seed: int,
    size: tuple[int, int],
    families: tuple[str, ...] | None,
    phantom: str | None,
    poses: int = 1,
    *,
    workers: int = 1,
    scheduler: str | None = None,
) -> None:
    """Write a labelled set; raises SynthError, and ClusterError with `scheduler`."""
    from hardware.twin.catalog import LOOKS
    from hardware.twin.dataset import SynthError, SynthPlan, write_set
    from hardware.twin.phantoms import make_phantom

    unknown = [name for name in families or () if name not in LOOKS]
    if unknown:
        raise SynthError(f"unknown look family {unknown[0]!r}; known: {', '.join(LOOKS)}")
    if phantom is not None:
        try:
            make_phantom(phantom)
        except ValueError as error:
            raise SynthError(str(error)) from None
    plan = SynthPlan(out, count, seed, size, families, phantom, poses)
    elsewhere = None if scheduler is None else partial(over_cluster, scheduler)
    with progress_bar() as bar:
        task = bar.add_task(f"frames -> {out}", total=count)
        write_set(plan, workers=workers, elsewhere=elsewhere, on_progress=lambda frames: bar.advance(task, frames))
    console.print(f"{count} labelled frames of phantom seeds {seed} to {seed + plan.episodes - 1} in {out}", soft_wrap=True)


class HeldOutWatch:
    """Looks now and then how the network does on the frames that it does not learn from; without any it does nothing."""

    def __init__(self, folder: Path | None, out: Path, teller: ProgressWriter | None, log: Callable[[str], object]) -> None:
        from core.learning.dataset import find_samples

        self._samples = find_samples([folder]) if folder is not None else []
        self._name = folder.name if folder is not None else ""
        self._pictures = out.with_name(out.name + "_pictures")
        self._teller, self._log = teller, log
        self.figures: dict[str, Any] = {}
        """For the model's manifest: what is known now, and what was before."""

    @property
    def is_on(self) -> bool:
        """Whether there are such frames."""
        return bool(self._samples)

    def look(self, network: Any, step: int) -> None:
        """Measure, write pictures, tell."""
        if not self._samples:
            return
        from core.learning.training import measure_held_out

        seen = measure_held_out(network, self._samples)
        now = {"vessel_dice": round(seen.vessel_dice, 4), "robot_dice": round(seen.robot_dice, 4)}
        before = self.figures.get("before", now)
        self.figures = {"set": self._name, "held_out": True, "frames": len(self._samples)} | now | {"before": before}
        self._log(f"{time.strftime('%H:%M:%S')} step {step} held out {now}\n")
        try:
            pictures = write_pictures(seen, self._pictures, "after" if step else "before")
        except OSError as error:
            pictures = []
            self._log(f"the pictures cannot be written ({error.strerror})\n")
        if self._teller is not None:
            self._teller.tell({"held_out_step": step, "pictures": pictures} | now)


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
        from hardware.twin.catalog import LOOKS
        from hardware.twin.rendering.presets import LOOK_FAMILIES

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
    from core.learning.model_writer import check_can_write, check_outside
    from core.perception.model_file import INFO, model_folder

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
    from hardware.twin.dataset import SynthFolderError

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
    from core.perception.model_file import trained_without

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


_EXAMPLES = 40
"""Training frames from which an eight-bit network learns its ranges."""
_MOST_THREADS = 64
"""As many as perception takes (``perception.segmentation.threads``)."""
_SECOND_LOOK_CONVOLUTIONS = ((3, 3, 3, 4, 4), 2)
"""Of each encoder level, and of every decoder level: a faint tip is decided on the fine ones."""
_SECOND_LOOK_WIDTHS = ((32, 64, 80, 128, 192), (32, 48, 48, 64))
"""Of its encoder and its decoders: half of the wrong states are decided by a pixel or a few degrees, which the fine levels see."""


class Lesson(Protocol):
    """A network to be trained, what it is shown, and how it is kept."""

    network: DualUNet

    def sides(self, crop: tuple[int, int]) -> tuple[int, int]:
        """The crops' height and width where these are asked for."""
        ...

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> Dataset[tuple[Tensor, Tensor]] | None:
        """What the network is shown; None when interrupted."""
        ...

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        """Write the model; without its eight-bit copy unless `whole`."""
        ...


class FrameLesson:
    """The network that looks at whole pictures: from nothing, or from the model `init`."""

    def __init__(self, samples: list[Sample], init: str | None, base: int | None, *, deepen: bool, shallow: bool) -> None:
        self._samples, self._init = samples, init
        self._second_look: Path | None = None
        if init is None:
            self.network = DualUNet(UNetShape.of_base(base) if base else default_shape(deep=not shallow))
            return
        self.network = load_network(model_folder(init))[0]
        check_model(init)  # its second look comes along as it is, and hours of training would end in a model that nobody can open
        self._second_look = second_look_of(model_folder(init))
        if deepen:
            if self.network.shape.encoder_convolutions == default_shape().encoder_convolutions:
                raise UserError(f"{init} is as deep already; leave --deepen out")
            images = [sample.load(WORKING_SIZE_PX)[0] for sample in _some(samples)]
            self.network = deepened(self.network, default_shape().encoder_convolutions, images)

    def sides(self, crop: tuple[int, int]) -> tuple[int, int]:
        stride = self.network.shape.stride
        return -(-crop[0] // stride) * stride, -(-crop[1] // stride) * stride

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> FrameCrops | DeviceCrops | None:
        if (frames := _on_device(self._samples, plan, bar, interrupt)) is not None:
            return DeviceCrops(frames, plan)
        if self._init is None or plan.focus_share == 0:
            return FrameCrops(self._samples, plan)
        segment = open_segmenter(_seen_by(self._init, plan))
        found = []
        for sample in bar.track(self._samples, description="finding hard frames"):
            if interrupt.asked:
                return None
            found.append(difficulty(sample, segment))
        return FrameCrops(self._samples, plan, np.array(found))

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        examples = list(_readable(_some(self._samples))) if whole else []
        save_model(network, out, training=training, figures=figures, examples=examples, second_look=self._second_look)


class SecondLookLesson:
    """The network of a model's second look, from the one that it has, or else from its network for whole pictures."""

    def __init__(self, samples: list[Sample], init: str | None, *, deepen: bool, widen: bool = False) -> None:
        if init is None:
            raise UserError("--second-look needs --init MODEL, whose first look it looks again after")
        self._samples, self._init, self._deepen = samples, init, deepen
        self._base = model_folder(init)
        check_model(init)  # both networks, whichever learns: what was learnt could not be kept beside a damaged one
        self._has_one = has_second_look(init)
        self.network = load_network(self._base / SECOND_LOOK)[0] if self._has_one else with_first_look(load_network(self._base)[0])
        shape = self.network.shape
        has = (*shape.encoder_convolutions, shape.decoder_convolutions)
        wanted = (*_SECOND_LOOK_CONVOLUTIONS[0], _SECOND_LOOK_CONVOLUTIONS[1])
        if deepen and (has == wanted or any(one > other for one, other in zip(has, wanted, strict=True))):
            raise UserError(f"the second look of {init} is as deep already; leave --deepen out")
        if widen:
            widths, decoder_widths = _SECOND_LOOK_WIDTHS
            wider = _each_larger(shape.widths, widths), _each_larger(shape.decoder_widths, decoder_widths)
            if wider == (shape.widths, shape.decoder_widths):
                raise UserError(f"the second look of {init} is as wide already; leave --widen out")
            self.network = widened(self.network, *wider)
        self._shown: NearCrops | DeviceWindows | None = None

    def sides(self, crop: tuple[int, int]) -> tuple[int, int]:
        return WINDOW_PX, WINDOW_PX

    def crops(self, plan: TrainingPlan, bar: Progress, interrupt: Interrupt) -> NearCrops | DeviceWindows | None:
        frames = None if self._deepen else _on_device(self._samples, plan, bar, interrupt, least_px=WINDOW_PX)
        if frames is not None:
            first, info = load_network(self._base)
            found = first_looks(first, info.stride, frames, _until_asked(len(frames), "first look", bar, interrupt))
            self._shown = None if found is None else DeviceWindows(frames, *found, plan)
            return self._shown
        plain = open_segmenter(_seen_by(self._init, plan))
        # Streams look once at the whole, single pictures eight times: the second look has to get on with both. Two stand for
        # eight here, where thousands of frames are looked at.
        ways = (plain, Turned(plain, turns=(0,)))
        # What the second look still gets wrong is worth more of its time than what only the first one did, and what it has seen it
        # may look at once more.
        near = open_second_look(_seen_by(self._init, plan)) if self._has_one else None
        looks: dict[Path, Looks] = {}  # a sample that is shown more often is looked at once
        for index, sample in enumerate(bar.track(self._samples, description="first look")):
            if interrupt.asked:
                return None
            if sample.image not in looks:
                looks[sample.image] = Looks.at(sample, ways[index % 2], near)
        self._shown = NearCrops(self._samples, [looks[sample.image] for sample in self._samples], plan)
        if self._deepen and not interrupt.asked:
            depths = _SECOND_LOOK_CONVOLUTIONS
            self.network = deepened(self.network, depths[0], self._examples(), decoder_convolutions=depths[1])
        return None if interrupt.asked else self._shown

    def save(self, network: DualUNet, out: Path, training: dict[str, Any], figures: dict[str, Any], *, whole: bool) -> None:
        examples = self._examples() if whole else []
        save_with_second_look(self._base, network, out, training=training, figures=figures, examples=examples)

    def _examples(self) -> list[Planes]:
        """Windows from all over the training."""
        examples: list[Planes] = []
        if isinstance(self._shown, DeviceWindows):
            return self._shown.examples(4 * _EXAMPLES)
        if self._shown is not None:
            step = max(1, len(self._shown) // (4 * _EXAMPLES))
            for index in range(0, len(self._shown), step):
                with suppress(DatasetError):  # as in _readable
                    examples.append(np.ascontiguousarray(self._shown[index][0].numpy().transpose(1, 2, 0)))
        return examples


def _gpu(frames: int, batch: int) -> torch.device | None:
    """A GPU with room for so many frames and the crops of a batch, if there is one."""
    device = torch.device("cuda")
    return device if torch.cuda.is_available() and fits(frames, batch, device) else None


def _on_device(
    samples: list[Sample], plan: TrainingPlan, bar: Progress, interrupt: Interrupt, least_px: int = 0
) -> DeviceFrames | None:
    """The frames in a GPU's memory, which makes its crops itself then.

    None: there is no GPU or no room, they are of several sizes or smaller than `least_px`, or it was interrupted.
    """
    count = len({sample.image for sample in samples})
    if (device := _gpu(count, plan.batch)) is None:
        return None
    frames = DeviceFrames.load(samples, device, _until_asked(count, "frames to the GPU", bar, interrupt))
    return frames if frames is not None and min(frames.size) >= least_px and not interrupt.asked else None


def _until_asked(count: int, what: str, bar: Progress, interrupt: Interrupt) -> Iterator[int]:
    """The numbers below `count`, told by a bar, until somebody interrupts."""
    for number in bar.track(range(count), description=what):
        if interrupt.asked:
            return
        yield number


def _seen_by(model: str, plan: TrainingPlan) -> SegmentationConfig:
    """How frames are looked at before the training, on as many threads as this has."""
    return SegmentationConfig(model=model, threads=min(plan.threads, _MOST_THREADS))


def has_second_look(model: str) -> bool:
    """Whether a model has a network for a second look; raises ModelError when there is no such model."""
    return second_look_of(model_folder(model)) is not None


def default_shape(*, deep: bool = True) -> UNetShape:
    """The shipped network: chosen in docs/method.md by accuracy against time on two cores without bf16."""
    return UNetShape((16, 32, 64, 128, 192), (16, 24, 48, 64), 1, 2, (2, 2, 3, 4, 4) if deep else (2, 2, 2, 2, 2))


def _each_larger(some: tuple[int, ...], others: tuple[int, ...]) -> Any:
    """The larger one at each place."""
    return tuple(max(one, other) for one, other in zip(some, others, strict=True))


def _some(samples: list[Sample]) -> list[Sample]:
    """From all over the sets."""
    return samples[:: max(1, len(samples) // _EXAMPLES)]


def _readable(samples: list[Sample]) -> Iterator[Image]:
    for sample in samples:
        with suppress(DatasetError):  # the training says it, and then wants to keep what was learnt without that frame
            yield sample.load(WORKING_SIZE_PX)[0]


_TOLD_EVERY = 2
"""Steps between two lines for another program: a step takes half a second and more."""
_SHOWN_EVERY = 50
"""Steps between two moves of the bar, and lines in the log, at most."""
_MAY_BE_LOST = 20
"""Steps that may be lost when the last, whole copy of the network cannot be made."""
_KEPT_EVERY = 1000
"""Steps from one checkpoint to the next."""
_LOOKS = 10
"""How often held-out frames are looked at during a training."""
_SECOND_SHARE, _SECOND_BATCH = 0.3, 24
"""After few frames of a new look the second look learns on, too: for so much of its steps (docs/method.md)."""


@dataclass(slots=True)
class Classroom:
    """What all lessons of one ``train`` share. ``log`` takes lines; ``steps_before`` and ``steps_total`` are of all
    lessons; ``has_kept``: a model has been written."""

    out: Path
    notes: dict[str, Any]
    log: Callable[[str], object]
    teller: ProgressWriter | None
    bar: Progress
    interrupt: Interrupt
    watch: HeldOutWatch
    steps_before: int = 0
    steps_total: int = 0
    has_kept: bool = False

    def teach(self, lesson: Lesson, plan: TrainingPlan) -> int | None:
        """Teach and save; the steps done, None when it was interrupted before the first."""
        held_out = self.watch if isinstance(lesson, FrameLesson) else None
        self.steps_total = max(self.steps_total, self.steps_before + plan.steps)
        self.log(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {self.notes | {'plan': plan.to_json()}}\n")
        crops = lesson.crops(plan, self.bar, self.interrupt)
        if crops is None:
            return None
        self.log(f"{time.strftime('%H:%M:%S')} the {'GPU' if isinstance(crops, Attentive) else 'processor'} makes the crops\n")
        if held_out is not None:
            held_out.look(lesson.network, 0)
        if self.interrupt.asked:
            return None
        task = self.bar.add_task("steps", total=plan.steps)

        def report(now: Report) -> None:
            dice = f"dice vessel {now.vessel_dice:.3f} robot {now.robot_dice:.3f}"
            self.log(f"{time.strftime('%H:%M:%S')} step {now.step} loss {now.loss:.4f} {dice} {now.images_per_s:.1f} images/s\n")
            if self.teller is None:
                self.bar.update(task, completed=now.step, description=f"loss {now.loss:.3f} {dice}")
                return
            left_s = round((plan.steps - now.step) * plan.batch / max(now.images_per_s, 1e-9), 1)
            steps = {"step": self.steps_before + now.step, "steps": self.steps_total}
            self.teller.tell(asdict(now) | steps | {"left_s": left_s})

        def keep(network: DualUNet, step: int, *, whole: bool) -> None:
            figures = self.watch.figures if held_out is not None else {}
            lesson.save(network, self.out, self.notes | {"plan": plan.to_json(), "steps_done": step}, figures, whole=whole)
            self.has_kept = True

        def look_and_keep(network: DualUNet, step: int, *, whole: bool = False) -> None:
            if held_out is not None:
                held_out.look(network, step)
            keep(network, step, whole=whole)

        def look_and_try_to_keep(network: DualUNet, step: int) -> None:
            # A disk that is full for a while must not end what takes hours: there are more checkpoints, and the end.
            try:
                look_and_keep(network, step)
            except ModelError as error:
                self.log(f"{time.strftime('%H:%M:%S')} step {step} could not be kept: {error}\n")
                if self.teller is None:
                    self.bar.console.print(f"step {step} could not be kept, the training goes on: {error}", soft_wrap=True)

        def keep_at_once(network: DualUNet, step: int) -> None:
            if self.teller is None:  # who has pressed Ctrl-C sees that it was heard
                self.bar.update(task, completed=step, description="saving ...", refresh=True)
            # Hours of learning must not hang on the eight-bit copy, which takes a while; nor either of them on the workers' end.
            if step > _MAY_BE_LOST:
                keep(network, step, whole=False)
            look_and_keep(network, step, whole=True)

        _, done = train(
            lesson.network,
            crops,
            plan,
            on_progress=report,
            on_checkpoint=look_and_try_to_keep,
            on_last=keep_at_once,
            # a window that has gone can no longer ask for the end
            should_stop=lambda: self.interrupt.asked or (self.teller is not None and not self.teller.is_heard),
            # a bar of few steps moves, too
            report_every=max(1, min(_SHOWN_EVERY, plan.steps // 10)) if self.teller is None else _TOLD_EVERY,
            checkpoint_every=_KEPT_EVERY if not self.watch.is_on else max(_TOLD_EVERY, plan.steps // _LOOKS),
        )
        self.steps_before += done
        return done


def second_plan(plan: TrainingPlan, init: str | None) -> TrainingPlan | None:
    """What the second look of `init` learns after the first one has; None where it is not to, or there is none."""
    if init is None or not plan.keeps_statistics or not has_second_look(init):
        return None
    steps = max(1, round(plan.steps * _SECOND_SHARE))
    return replace(plan, steps=steps, warmup_steps=min(100, max(1, steps // 10)), batch=min(_SECOND_BATCH, 3 * plan.batch))


def teach_second_look(room: Classroom, samples: list[Sample], plan: TrainingPlan) -> int | None:
    """After a lesson of whole frames: the second look of the model that came of it."""
    lesson = SecondLookLesson(samples, str(room.out), deepen=False)
    return room.teach(lesson, replace(plan, crop=lesson.sides(plan.crop)))


SHOWN = 4
"""Held-out frames of which pictures are made."""
_OPACITY = 0.45


def draw_found(frame: HeldOutFrame) -> Image:
    """Found masks as colours (vessel, then robot), true ones as lines, RGB at working size."""
    colours = theme.ON_PICTURE
    picture = frame.image.astype(np.float32)
    for mask, name in ((frame.vessel, colours.VESSEL), (frame.robot, colours.ROBOT)):
        picture[mask] = (1 - _OPACITY) * picture[mask] + _OPACITY * np.array(theme.rgb(name), np.float32)
    drawn = np.ascontiguousarray(np.clip(picture, 0, 255).astype(np.uint8))
    for mask, name in ((frame.true_vessel, colours.VESSEL_VECTOR), (frame.true_robot, colours.ROBOT_VECTOR)):
        cv2.drawContours(drawn, _outlines(mask), -1, theme.rgb(name), 1, cv2.LINE_AA)
    return drawn


def _outlines(mask: Mask) -> list[np.ndarray]:
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return list(found)


def write_pictures(held_out: HeldOut, folder: Path, when: str) -> list[str]:
    """``<stem>_<when>.png`` of the first frames; returns the paths. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for frame in held_out.frames[:SHOWN]:
        path = folder / f"{frame.stem}_{when}.png"
        write_png(path, draw_found(frame))  # as a whole: the window may be reading the older one
        paths.append(str(path))
    return paths
