"""``calibrate``: fit a model's confidence, and the kinds of pictures that it knows, on labelled frames that it has not seen."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from app.commands.options import ConfigOption
from app.commands.progress import LeftOut, progress_bar
from core.config.models import PerceptionConfig, load_config
from core.perception.quality import ConfidenceCalibration
from core.program import CALLED, need_package
from core.types import Image

if TYPE_CHECKING:
    from core.learning.dataset import Sample


_EXAMPLES = 80
"""Frames from which eight-bit networks learn ranges and rounding, at most."""


def calibrate(
    folder: Annotated[Path, typer.Argument(help="labelled folder as synth writes it, which training has never seen")],
    model: Annotated[str, typer.Option(help="model in resources/models, or a folder; its model.json is rewritten")] = "default",
    knows: Annotated[
        list[Path] | None, typer.Option("--knows", help="another folder of pictures, labelled or not, of a kind that it knows, too")
    ] = None,
    eight_bit: Annotated[
        bool, typer.Option("--eight-bit", help="first make the networks' eight-bit copies anew, from some of the frames")
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Teach a model what its confidence means: the share of right answers among those that it is so sure of.

    And which kinds of pictures it knows: it refuses others from then on (perception.quality.max_novelty).
    """
    from core.evaluation.confidence import check_frames, check_known, find_known
    from core.learning.dataset import POSE_KEYS, find_labelled
    from core.learning.model_writer import changed, check_can_change, renew_eight_bit
    from core.perception.model_file import model_folder

    if eight_bit:
        need_package("torch")
        need_package("onnx")
    check_can_change(model)
    samples, truth = find_labelled(folder, POSE_KEYS)
    pictures = [picture for known in (folder, *(knows or ())) for picture in find_known(known)]
    check_frames(len(samples))
    check_known(pictures)
    frames = _CalibrationFrames(folder, samples, truth, pictures, [also.name for also in knows or ()])
    target = model_folder(model)
    # New networks must not come with the calibration of the old ones: both are replaced, or neither.
    with progress_bar() as bar, changed(target) if eight_bit else nullcontext(target) as work:
        if eight_bit:
            task = bar.add_task("eight-bit networks", total=100)
            images = _examples(samples, _configuration(work, config, "never"))
            renew_eight_bit(work, images, lambda share: bar.update(task, completed=round(100 * share)))
        tables = _calibrated(work, frames, config, bar)
    Console(markup=False, emoji=False).print(*[_table(f"{target}, {title}", *of_it) for title, of_it in tables])
    sys.stderr.write(f"measure it on another set: {CALLED} benchmark --accuracy SET\n")


@dataclass(frozen=True, slots=True)
class _CalibrationFrames:
    """A labelled set and its truth; all pictures of kinds that the model knows, and the names of further folders."""

    folder: Path
    samples: list[Sample]
    truth: dict[str, dict[str, Any]]
    pictures: Sequence[Any]
    knows: Sequence[str]


def _calibrated(
    model: Path, frames: _CalibrationFrames, config_path: Path | None, bar: Progress
) -> list[tuple[str, tuple[ConfidenceCalibration, int, float]]]:
    """Calibrate the model in this folder; returns titles and the other arguments of ``_table``, without and with mirroring."""
    from core.evaluation.accuracy import TrueMasks, score_set
    from core.evaluation.confidence import describe_confidence, fit, fit_out_of_distribution, is_right, signatures_in
    from core.learning.model_writer import write_calibration
    from core.perception.inference import open_segmenter
    from core.perception.model_file import sha256_of
    from core.perception.pipeline import open_calibrated, open_pipeline
    from core.perception.tip_refinement import TipRefinement

    folder, samples, pictures = frames.folder, frames.samples, frames.pictures
    described = {"set": folder.name, "truth_sha256": sha256_of(folder / "truth.jsonl")}
    tables: list[tuple[str, tuple[ConfidenceCalibration, int, float]]] = []
    left_out = LeftOut()
    config = _configuration(model, config_path, "always")
    for mirrored in ("never", "always"):
        pipeline = open_pipeline(_configuration(model, config_path, mirrored), recalibrating=True)
        title = "frames" if mirrored == "never" else "all orientations"
        found = score_set(samples, frames.truth, pipeline, TrueMasks(), left_out.add)
        scores = list(bar.track(found, total=len(samples), description=title))
        if not scores:
            break
        answered = [score for score in scores if score.answered and score.is_measured]
        pairs = [(score.evidence, is_right(score)) for score in answered if score.evidence is not None]
        calibration = fit([evidence for evidence, _ in pairs], [right for _, right in pairs], described)
        right, auroc = sum(right for _, right in pairs), describe_confidence(scores)["confidence_auroc"]
        tables.append((f"mirrored {mirrored}: {len(pairs)} answers of {folder.name}", (calibration, right, auroc)))
    looked = signatures_in(pictures, open_segmenter(config.segmentation), config, left_out.add) if scores else iter(())
    signed = [one for one in bar.track(looked, total=len(pictures), description="kinds of pictures") if one is not None]
    left_out.print_note(len(pictures) - len(left_out) if scores else 0)
    known, signatures = [picture for picture, _ in signed], np.array([signature for _, signature in signed])
    familiarity = fit_out_of_distribution(known, signatures, config.working_size_px, described | {"knows": list(frames.knows)})
    again = open_calibrated(config, recalibrating=True)[1].segment
    looks = again.passes if isinstance(again, TipRefinement) else 1
    write_calibration(model, *[calibration for _, (calibration, _, _) in tables], second_looks=looks, familiarity=familiarity)
    return tables


def _examples(samples: Sequence[Sample], config: PerceptionConfig) -> list[Image]:
    """Pictures from all over the set; one that cannot be read is reported when it is perceived."""
    from core.learning.dataset import DatasetError

    images = []
    count = min(_EXAMPLES, len(samples))
    for sample in (samples[index * len(samples) // count] for index in range(count)):
        with suppress(DatasetError):
            images.append(sample.load(config.working_size_px)[0])
    return images


def _configuration(model: Path, config_path: Path | None, mirrored: str) -> PerceptionConfig:
    """Answers that would be refused for low confidence are the ones to learn from."""
    overrides = {"segmentation": {"model": str(model), "mirrored": mirrored}, "quality": {"min_confidence": 0.0}}
    return load_config(config_path, None, {"perception": overrides}).perception


def _table(title: str, calibration: ConfidenceCalibration, right: int, auroc_before: float) -> Table:
    table = Table(title=title, show_header=False)
    for name, weight in sorted(zip(calibration.features, calibration.weights, strict=True), key=lambda pair: -abs(pair[1])):
        table.add_row(f"weight of {name}", f"{weight:+.2f}")
    table.add_row("right answers", str(right))
    table.add_row("AUROC before, on this set", f"{auroc_before:.3f}")
    return table
