"""One lesson after another into one model folder, with progress that people and programs can follow."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.progress import Progress

from app.lessons import FrameLesson, Lesson, SecondLookLesson, has_second_look
from app.progress_lines import Teller
from core.learning.dataset import Sample
from core.learning.model_file import ModelError
from core.learning.training import Attentive, train
from core.learning.training import Progress as Report
from core.learning.training_plan import TrainingPlan
from core.perception.unet import DualUNet

if TYPE_CHECKING:
    from app.held_out_watch import HeldOutWatch
    from app.long_work import Interrupt

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
    teller: Teller | None
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
