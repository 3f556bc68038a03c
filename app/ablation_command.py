"""``ablation``: from the paper taken literally to ours, step by step, on one labelled set and, if asked, on streams of the twin."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from app.ablation_streams import measure_streams
from app.ablation_tables import difference_table, markdown, stream_table, value_table
from app.left_out import LeftOut
from app.long_work import progress_bar
from core.config import PerceptionConfig, choose_model, load_config
from core.errors import UserError
from core.names import name_as_text
from core.study.ablation import OURS, PAPER, STEPS, TRACKING, SameMasks, Variant, make_variants
from core.study.ablation_figures import are_enough, figures, frame_rows, refusals
from core.study.accuracy import FrameScore, TrueMasks, score_frame
from core.types import Frame

if TYPE_CHECKING:
    from core.learning.dataset import Sample
    from core.perception.pipeline import Pipeline

    PipelineOf = Callable[[PerceptionConfig], Pipeline]

ALONE = "needs a stream: each frame of the set stands alone (measure it with --sequence N)"
_WIDTH = 170
"""Columns of the tables where the output is no terminal."""


class AblationError(UserError):
    """The ablation cannot be run; the message is one line and says what to do."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What to run. ``folder`` and ``sequence`` (frames of the twin) may each be missing; ``phantoms`` empty: all named ones."""

    folder: Path | None
    model: str | None = None
    config_path: Path | None = None
    true_masks: bool = False
    sequence: int = 0
    phantoms: tuple[str, ...] = ()
    seed: int = 0
    out: Path | None = None


def run_ablation(plan: Plan, *, as_json: bool) -> None:
    """Run it and print the tables; raises UserError. An interruption (Ctrl-C) prints what was measured until then."""
    from core.perception.pipeline import open_pipeline

    if plan.folder is None and not plan.sequence:
        raise AblationError("nothing to measure on: give a labelled set (as synth writes it), --sequence N, or both")
    overrides = choose_model(plan.model)
    ours = load_config(plan.config_path, None, overrides).perception
    paper = load_config(plan.config_path, "paper", overrides).perception
    samples, truth = _labelled(plan.folder) if plan.folder is not None else ([], {})
    phantoms = _known_phantoms(plan.phantoms)
    _make_folder(plan.out)
    masks, pipeline_of = _open_masks(ours, plan.true_masks)
    source = "true masks" if plan.true_masks else f"model {ours.segmentation.model}, {masks.engine}"
    result: dict[str, Any] = {"set": name_as_text(plan.folder) if plan.folder else None, "masks": source, "seed": plan.seed}
    interrupted, frames = False, []
    if samples:
        variants = make_variants(paper, ours, [step for step in STEPS if step.name != TRACKING])
        pipelines = [pipeline_of(variant.config) for variant in variants]
        left_out = LeftOut()
        scores, latency_ms, interrupted = _measure_set(samples, truth, pipelines, masks, ours.working_size_px, left_out)
        groups = [truth[score.stem].get("seed", score.stem) for score in scores[0]]
        result |= _described(variants, scores, latency_ms, groups, plan.seed) | {"left_out": len(left_out)}
        frames = frame_rows(variants, scores)
    if plan.sequence and not interrupted:
        named = {variant.name: variant.config for variant in make_variants(paper, ours)}
        chosen = {name: named[name] for name in (PAPER, f"{OURS} without {TRACKING}")} | {OURS: ours}
        result["stream"], interrupted = measure_streams(
            chosen,
            pipeline_of,
            masks,
            live=None if plan.true_masks else open_pipeline(ours),
            frames=plan.sequence,
            phantoms=phantoms,
            seed=plan.seed,
        )
    result["interrupted"] = interrupted
    try:
        _tell(result, as_json)
    finally:  # neither costs the other
        if plan.out is not None:
            _write(result, frames, plan.out)
    if interrupted:
        raise KeyboardInterrupt


def _labelled(folder: Path) -> tuple[list[Sample], dict[str, dict[str, Any]]]:
    from core.learning.dataset import POSE_KEYS, DatasetError, find_labelled

    samples, truth = find_labelled(folder, POSE_KEYS)
    if all(truth[sample.stem].get("state") is None for sample in samples):
        raise DatasetError(f"{folder}: no frame of truth.jsonl has a pose; nothing can be compared")
    return samples, truth


def _known_phantoms(names: tuple[str, ...]) -> tuple[str, ...]:
    from hardware.twin.phantom import PHANTOM_TITLES

    for name in names:
        if name not in PHANTOM_TITLES:
            raise AblationError(f"unknown phantom {name!r}; known: {', '.join(PHANTOM_TITLES)}")
    return names or tuple(PHANTOM_TITLES)


def _make_folder(out: Path | None) -> None:
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise AblationError(f"{out}: cannot be made ({error.strerror}); choose another --out") from None


def _open_masks(config: PerceptionConfig, true_masks: bool) -> tuple[SameMasks, PipelineOf]:
    """Where all variants get their masks from, and how a pipeline on them is made."""
    from core.perception.pipeline import Pipeline, open_sights

    if true_masks:
        masks, calibration, known = SameMasks(TrueMasks()), None, None
    else:
        sight = open_sights(config)[0]
        masks, calibration, known = SameMasks(sight.segment), sight.calibration, sight.familiarity
    return masks, lambda settings: Pipeline(masks, settings, calibration, familiarity=known)


def _measure_set(
    samples: Sequence[Sample],
    truth: dict[str, dict[str, Any]],
    pipelines: Sequence[Pipeline],
    masks: SameMasks,
    working_size_px: int,
    left_out: LeftOut,
) -> tuple[list[list[FrameScore]], list[list[float]], bool]:
    """For each pipeline the scores of all frames and the milliseconds after the network, and whether it was interrupted."""
    from core.learning.dataset import DatasetError
    from core.perception.segmentation import to_working

    scores: list[list[FrameScore]] = [[] for _ in pipelines]
    latency_ms: list[list[float]] = [[] for _ in pipelines]
    interrupted = False
    with progress_bar() as bar:
        try:
            for sample in bar.track(samples, description=f"frames x {len(pipelines)} variants"):
                try:
                    image, *true = sample.load()
                except DatasetError as error:
                    left_out.add(error)
                    continue
                masks.next_frame(true[0], true[1])
                vessel, robot = (to_working(mask.astype(np.uint8) * 255, working_size_px)[0] > 127 for mask in true)
                for place, pipeline in enumerate(pipelines):
                    scene = pipeline.perceive_single(Frame(0, 0.0, image))
                    scores[place].append(score_frame(sample.stem, scene, vessel, robot, truth[sample.stem]))
                    spent = scene.latency_ms
                    latency_ms[place].append(spent["total"] - spent.get("prepare", 0.0) - spent.get("network", 0.0))
        except KeyboardInterrupt:
            interrupted = True
    count = len(latency_ms[-1])  # an interruption leaves the last frame with some of the pipelines only
    has_pose = any(score.expected for score in scores[-1][:count])
    if interrupted and not has_pose:
        raise KeyboardInterrupt
    left_out.tell(count)
    if not has_pose:
        raise AblationError("no frame with a pose can be read; nothing can be compared")
    return [row[:count] for row in scores], [row[:count] for row in latency_ms], interrupted


def _described(
    variants: Sequence[Variant],
    scores: Sequence[Sequence[FrameScore]],
    latency_ms: Sequence[Sequence[float]],
    groups: Sequence[Any],
    seed: int,
) -> dict[str, Any]:
    table = figures(scores, [variant.compared_with for variant in variants], groups, seed)
    rows: list[dict[str, Any]] = []
    for place, variant in enumerate(variants):
        row: dict[str, Any] = {"name": variant.name, "kind": variant.kind}
        row["compared_with"] = None if variant.compared_with is None else variants[variant.compared_with].name
        row["figures"] = {key: figure.to_json() for key, figure in table[place].items()}
        row["after_network_ms"] = float(np.median(latency_ms[place]))
        row["refused"] = refusals(scores[place])
        rows.append(row)
    last = next(place for place, row in enumerate(rows) if row["kind"] == "without")
    rows.insert(last, {"name": f"+ {TRACKING}", "kind": "cumulative", "note": ALONE})
    rows.append({"name": f"{OURS} without {TRACKING}", "kind": "without", "note": ALONE})
    expected = [group for group, score in zip(groups, scores[0], strict=True) if score.expected]
    drawn = f"{len(set(expected))} phantoms{'' if are_enough(expected) else ' (too few for intervals)'}"
    return {"frames": len(scores[0]), "expected": len(expected), "drawn": drawn, "rows": rows}


def _tell(result: dict[str, Any], as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
    else:
        console = Console(markup=False, emoji=False) if sys.stdout.isatty() else Console(width=_WIDTH, markup=False, emoji=False)
        if "rows" in result:
            console.print(value_table(result), difference_table(result))
        if result.get("stream"):
            console.print(stream_table(result["stream"]))


def _write(result: dict[str, Any], frames: list[dict[str, Any]], out: Path) -> None:
    try:
        (out / "ablation.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        (out / "ablation.md").write_text(markdown(result), encoding="utf-8")
    except OSError as error:
        raise AblationError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    if frames:
        _write_frames(out / "ablation_frames.csv", frames)


def _write_frames(path: Path, rows: list[dict[str, Any]]) -> None:
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(row | {"stem": name_as_text(row["stem"])} for row in rows)
    except OSError as error:
        raise AblationError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None
