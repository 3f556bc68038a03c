"""``synth`` and ``train``: long work with progress that can be interrupted and gone on with."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from app.progress_lines import ProgressLines, Teller, asked_teller

_console = Console(stderr=True)
_TOLD_EVERY = 2
"""Steps between two lines for another program: a step takes half a second and more."""
_LOOKS = 10
"""How often held-out frames are looked at during a training."""


def progress_bar() -> Progress:
    """The bar that all long commands show, on standard error; as lines where another program asked for them."""
    if (teller := asked_teller()) is not None:
        return ProgressLines(teller)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TaskProgressColumn())
    return Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=_console)


def run_synth(
    out: Path, count: int, seed: int, size: tuple[int, int], families: tuple[str, ...] | None, phantom: str | None, workers: int
) -> None:
    """Write a labelled set; raises SynthError."""
    from hardware.twin.appearance import LOOK_FAMILIES
    from hardware.twin.phantoms import make_phantom
    from hardware.twin.synth import SynthError, SynthPlan, write_set

    unknown = [name for name in families or () if name not in LOOK_FAMILIES]
    if unknown:
        raise SynthError(f"unknown look family {unknown[0]!r}; known: {', '.join(LOOK_FAMILIES)}")
    if phantom is not None:
        try:
            make_phantom(phantom)
        except ValueError as error:
            raise SynthError(str(error)) from None
    plan = SynthPlan(out, count, seed, size, families, phantom)
    with progress_bar() as bar:
        task = bar.add_task(f"frames -> {out}", total=count)
        write_set(plan, workers=workers, on_progress=lambda frames: bar.advance(task, frames))
    _console.print(f"{count} labelled frames of phantom seeds {seed} to {seed + plan.episodes - 1} in {out}", soft_wrap=True)


class Interrupt:
    """Ctrl-C and a termination request ask the work to stop at the next good moment instead of tearing it down."""

    def __init__(self) -> None:
        self.asked = False
        self._old: dict[int, Any] = {}

    def __enter__(self) -> Interrupt:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._old[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._old.items():
            signal.signal(number, handler)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.asked = True


@dataclass(frozen=True, slots=True)
class TrainOutputs:
    """The model's folder, and labelled frames that stay out of training and say whether it helped."""

    out: Path
    held_out: Path | None = None


def run_train(
    outputs: TrainOutputs,
    data: list[Path],
    synthetic: int,
    init: str | None,
    base: int | None,
    plan: Any,
    *,
    deepen: bool = False,
    shallow: bool = False,
    second_look: bool = False,
) -> None:
    """Train on labelled folders and, if asked, on frames made now; writes the model folder `out` and `out`.log.

    With `deepen`, the network of `init` first gets the convolutions that today's default shape has more than it; with `shallow`, a
    new network has two convolutions on every level. With `second_look`, it is the network of the second look of `init` that learns,
    and `out` is `init` with it.
    """
    import torch

    from app.lessons import FrameLesson, Lesson, SecondLookLesson
    from core.learning.dataset import DatasetError, find_samples
    from core.learning.model_file import check_can_write
    from core.learning.training import Progress as Report
    from core.learning.training import train
    from core.perception.unet import DualUNet

    if second_look and outputs.held_out is not None:
        raise DatasetError("--held-out measures whole pictures; after --second-look measure with benchmark --accuracy")
    if not data and not synthetic:
        raise DatasetError("nothing to train on: give --data DIR (a labelled folder) or --synthetic N")
    check_can_write(outputs.out)
    out = outputs.out.resolve()
    try:
        log = out.with_name(out.name + ".log").open("a", encoding="utf-8", buffering=1)
    except OSError as error:
        raise DatasetError(f"{out.parent}: cannot be written ({error.strerror}); choose another --out") from None
    folders = list(data)
    if synthetic:
        folder = out.with_name(out.name + "_frames")
        run_synth(folder, synthetic, 1_000_000 + plan.seed * 100_000, (640, 480), None, None, 1)
        folders.append(folder)
    samples = find_samples(folders)
    torch.manual_seed(plan.seed)
    lesson: Lesson
    if second_look:
        lesson = SecondLookLesson(samples, init)
    else:
        lesson = FrameLesson(samples, init, base, deepen=deepen, shallow=shallow)
    plan = replace(plan, crop=lesson.sides(plan.crop))
    notes = {"plan": plan.to_json(), "init": init, "frames": len(samples), "sets": [_described(folder) for folder in folders]}
    log.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {notes}\n")
    teller, watch = asked_teller(), HeldOutWatch(outputs.held_out, out, asked_teller(), log.write)
    with log, Interrupt() as interrupt, progress_bar() as bar:
        crops = lesson.crops(plan, bar, interrupt)
        if crops is None:
            _console.print(f"interrupted before the first step; nothing was written to {out}", soft_wrap=True)
            return
        watch.look(lesson.network, 0)
        task = bar.add_task("steps", total=plan.steps)

        def report(now: Report) -> None:
            dice = f"dice vessel {now.vessel_dice:.3f} robot {now.robot_dice:.3f}"
            log.write(f"{time.strftime('%H:%M:%S')} step {now.step} loss {now.loss:.4f} {dice} {now.images_per_s:.1f} images/s\n")
            if teller is None:
                bar.update(task, completed=now.step, description=f"loss {now.loss:.3f} {dice}")
            else:
                teller.tell(asdict(now) | {"left_s": round((plan.steps - now.step) * plan.batch / max(now.images_per_s, 1e-9), 1)})

        def checkpoint(average: DualUNet, step: int) -> None:
            watch.look(average, step)
            lesson.save(average, out, notes | {"steps_done": step}, watch.figures, whole=False)

        network, done = train(
            lesson.network,
            crops,
            plan,
            on_progress=report,
            on_checkpoint=checkpoint,
            # a window that has gone can no longer ask for the end
            should_stop=lambda: interrupt.asked or (teller is not None and not teller.is_heard),
            report_every=50 if teller is None else _TOLD_EVERY,
            checkpoint_every=1000 if outputs.held_out is None else max(_TOLD_EVERY, plan.steps // _LOOKS),
        )
        watch.look(network, done)
    lesson.save(network, out, notes | {"steps_done": done}, watch.figures, whole=True)
    if teller is not None:
        teller.tell({"model": str(out), "steps_done": done, "steps": plan.steps})
    ending = "" if done == plan.steps else f" (interrupted after {done} of {plan.steps} steps; go on with --init {out})"
    _console.print(f"model written to {out}{ending}", soft_wrap=True)


class HeldOutWatch:
    """Looks now and then how the network does on the frames that it does not learn from; without any it does nothing."""

    def __init__(self, folder: Path | None, out: Path, teller: Teller | None, log: Callable[[str], object]) -> None:
        from core.learning.dataset import find_samples

        self._samples = find_samples([folder]) if folder is not None else []
        self._name = folder.name if folder is not None else ""
        self._pictures = out.with_name(out.name + "_pictures")
        self._teller, self._log = teller, log
        self.figures: dict[str, Any] = {}
        """For the model's manifest: what is known now, and what was before."""

    def look(self, network: Any, step: int) -> None:
        """Measure, write pictures, tell."""
        if not self._samples:
            return
        from app.training_pictures import write_pictures
        from core.learning.held_out import measure_held_out

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


def _described(folder: Path) -> dict[str, Any]:
    """What is known of a set: synth leaves its plan beside the frames."""
    import json

    plan = folder / "plan.json"
    try:
        return {"name": folder.name} | (json.loads(plan.read_text(encoding="utf-8")) if plan.is_file() else {})
    except (OSError, ValueError):
        return {"name": folder.name}
