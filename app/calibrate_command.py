"""``calibrate``: teach a model what its confidence means, on labelled frames that it was not trained on."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from app.learning_commands import progress_bar
from app.left_out import LeftOut
from core.config import PerceptionConfig, load_config
from core.perception.evidence import Calibration
from core.types import Image

if TYPE_CHECKING:
    from core.learning.dataset import Sample


_EXAMPLES = 80
"""Frames from which the eight-bit networks are made: they see two windows of each at their second look."""


def run_calibrate(
    folder: Path, *, model: str, config_path: Path | None, knows: Sequence[Path] = (), eight_bit: bool = False
) -> None:
    """Perceive every frame of a labelled set, once and in all orientations; store a calibration of each in the model's manifest.

    And what kind of pictures these and those in `knows` are: others are refused from then on. With `eight_bit`, the networks'
    eight-bit copies are first made anew from some of the frames.
    """
    from core.learning.dataset import POSE_KEYS, find_labelled
    from core.learning.eight_bit import renew_eight_bit
    from core.learning.model_file import model_folder, sha256_of, write_calibration
    from core.perception.pipeline import open_pipeline, open_sights
    from core.perception.second_look import SecondLook
    from core.perception.segmentation import open_segmenter
    from core.study.accuracy import TrueMasks, score_set
    from core.study.calibration import describe_confidence, fit, is_right
    from core.study.known_pictures import find_known, fit_familiarity, signatures_in

    samples, truth = find_labelled(folder, POSE_KEYS)
    pictures = [picture for known in (folder, *knows) for picture in find_known(known)]
    described = {"set": folder.name, "truth_sha256": sha256_of(folder / "truth.jsonl")}
    calibrations: list[Calibration] = []
    target, tables, left_out = model_folder(model), [], LeftOut()
    config = _configuration(model, config_path, "always")
    with progress_bar() as bar:
        if eight_bit:
            task = bar.add_task("eight-bit networks", total=100)
            renew_eight_bit(target, _examples(samples, config), lambda share: bar.update(task, completed=round(100 * share)))
        for mirrored in ("never", "always"):
            pipeline = open_pipeline(_configuration(model, config_path, mirrored), recalibrating=True)
            title = "frames" if mirrored == "never" else "all orientations"
            found = score_set(samples, truth, pipeline, TrueMasks(), left_out.add)
            scores = list(bar.track(found, total=len(samples), description=title))
            if not scores:
                break
            pairs = [(score.evidence, is_right(score)) for score in scores if score.answered and score.evidence is not None]
            calibrations.append(fit([evidence for evidence, _ in pairs], [right for _, right in pairs], described))
            table = _table(f"{target}, mirrored {mirrored}: {len(pairs)} answers of {folder.name}", calibrations[-1])
            table.add_row("right answers", str(sum(right for _, right in pairs)))
            table.add_row("AUROC before, on this set", f"{describe_confidence(scores)['confidence_auroc']:.3f}")
            tables.append(table)
        looked = signatures_in(pictures, open_segmenter(config.segmentation), config, left_out.add) if scores else iter(())
        signed = [one for one in bar.track(looked, total=len(pictures), description="kinds of pictures") if one is not None]
    left_out.tell(len(pictures) - len(left_out) if scores else 0)
    known, signatures = [picture for picture, _ in signed], np.array([signature for _, signature in signed])
    familiarity = fit_familiarity(known, signatures, config.working_size_px, described | {"knows": [also.name for also in knows]})
    again = open_sights(config, recalibrating=True)[1].segment
    looks = again.looks if isinstance(again, SecondLook) else 1
    write_calibration(target, *calibrations, second_looks=looks, familiarity=familiarity)
    Console(markup=False, emoji=False).print(*tables)
    sys.stderr.write("measure it on another set: main.py benchmark --accuracy SET\n")


def _examples(samples: Sequence[Sample], config: PerceptionConfig) -> list[Image]:
    """Pictures from all over the set; one that cannot be read is told when it is perceived."""
    from core.learning.dataset import DatasetError

    images = []
    for sample in samples[:: max(1, len(samples) // _EXAMPLES)]:
        with suppress(DatasetError):
            images.append(sample.load(config.working_size_px)[0])
    return images


def _configuration(model: str, config_path: Path | None, mirrored: str) -> PerceptionConfig:
    """Answers that would be refused for low confidence are the ones to learn from."""
    overrides = {"segmentation": {"model": model, "mirrored": mirrored}, "quality": {"min_confidence": 0.0}}
    return load_config(config_path, None, {"perception": overrides}).perception


def _table(title: str, calibration: Calibration) -> Table:
    table = Table(title=title, show_header=False)
    for name, weight in sorted(zip(calibration.features, calibration.weights, strict=True), key=lambda pair: -abs(pair[1])):
        table.add_row(f"weight of {name}", f"{weight:+.2f}")
    return table
