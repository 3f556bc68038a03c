"""``calibrate``: teach a model what its confidence means, on labelled frames that it was not trained on."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from app.learning_commands import progress_bar
from core.config import load_config


def run_calibrate(folder: Path, *, model: str, config_path: Path | None) -> None:
    """Perceive every frame of a labelled set, fit the calibration and store it in the model's manifest."""
    from core.learning.dataset import find_labelled
    from core.learning.model_file import model_folder, sha256_of, write_calibration
    from core.perception.pipeline import open_pipeline
    from core.study.accuracy import TrueMasks, score_set
    from core.study.calibration import describe_confidence, fit, is_right

    # Answers that would be refused for low confidence are the ones to learn from.
    overrides = {"perception": {"segmentation": {"model": model}, "quality": {"min_confidence": 0.0}}}
    config = load_config(config_path, None, overrides)
    samples, truth = find_labelled(folder)
    pipeline = open_pipeline(config.perception)
    with progress_bar() as bar:
        scores = list(bar.track(score_set(samples, truth, pipeline, TrueMasks()), total=len(samples), description="frames"))
    pairs = [(score.evidence, is_right(score)) for score in scores if score.answered and score.evidence is not None]
    described = {"set": folder.name, "truth_sha256": sha256_of(folder / "truth.jsonl")}
    calibration = fit([evidence for evidence, _ in pairs], [right for _, right in pairs], described)
    target = model_folder(model)
    write_calibration(target, calibration)
    before = describe_confidence(scores)
    table = Table(title=f"{target}: confidence calibrated on {len(pairs)} answers of {folder.name}", show_header=False)
    table.add_row("right answers", str(sum(right for _, right in pairs)))
    table.add_row("AUROC before, on this set", f"{before['confidence_auroc']:.3f}")
    for name, weight in sorted(zip(calibration.features, calibration.weights, strict=True), key=lambda pair: -abs(pair[1])):
        table.add_row(f"weight of {name}", f"{weight:+.2f}")
    Console().print(table)
    sys.stderr.write("measure it on another set: main.py benchmark --accuracy SET\n")
