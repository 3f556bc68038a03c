"""``calibrate``: teach a model what its confidence means, on labelled frames that it was not trained on."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from app.learning_commands import progress_bar
from app.left_out import LeftOut
from core.config import load_config
from core.perception.evidence import Calibration


def run_calibrate(folder: Path, *, model: str, config_path: Path | None) -> None:
    """Perceive every frame of a labelled set, once and in all orientations; store a calibration of each in the model's manifest."""
    from core.learning.dataset import POSE_KEYS, find_labelled
    from core.learning.model_file import model_folder, sha256_of, write_calibration
    from core.perception.pipeline import open_pipeline
    from core.study.accuracy import TrueMasks, score_set
    from core.study.calibration import describe_confidence, fit, is_right

    samples, truth = find_labelled(folder, POSE_KEYS)
    described = {"set": folder.name, "truth_sha256": sha256_of(folder / "truth.jsonl")}
    calibrations: list[Calibration] = []
    target, tables, left_out = model_folder(model), [], LeftOut()
    with progress_bar() as bar:
        for mirrored in ("never", "always"):
            # Answers that would be refused for low confidence are the ones to learn from.
            segmentation = {"model": model, "mirrored": mirrored}
            overrides = {"perception": {"segmentation": segmentation, "quality": {"min_confidence": 0.0}}}
            pipeline = open_pipeline(load_config(config_path, None, overrides).perception, recalibrating=True)
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
    left_out.tell(len(scores))
    write_calibration(target, *calibrations)
    Console(markup=False, emoji=False).print(*tables)
    sys.stderr.write("measure it on another set: main.py benchmark --accuracy SET\n")


def _table(title: str, calibration: Calibration) -> Table:
    table = Table(title=title, show_header=False)
    for name, weight in sorted(zip(calibration.features, calibration.weights, strict=True), key=lambda pair: -abs(pair[1])):
        table.add_row(f"weight of {name}", f"{weight:+.2f}")
    return table
