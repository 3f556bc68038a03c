"""``benchmark``: speed against the paper-literal baseline in the same run, or accuracy on a labelled set."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, MutableMapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from app.commands.options import ConfigOption, JsonOption, ModelOption, PresetOption, check_masks
from app.commands.progress import LeftOut, progress_bar
from core.config.models import Config, TwinConfig, choose_model, load_config
from core.devices import UserError
from core.program import ROOT, need_package
from core.types import Frame, Image, Scene

if TYPE_CHECKING:
    from core.bench.bench import Bench
    from core.evaluation.accuracy import FrameScore
    from core.evaluation.paper_baseline import PaperBaseline
    from core.perception.pipeline import Pipeline


_FRAMES = 120
_BASELINE_EVERY = 8
"""Frames from one frame of the baseline to the next."""
_WARM_UP = 3
"""Frames that are not timed."""


def benchmark(
    json: JsonOption = False,
    accuracy: Annotated[
        list[Path] | None,
        typer.Option(
            help="measure accuracy on this labelled set instead of speed; if it has a folder bench, with this bench, too; "
            "may be repeated: sets stand side by side"
        ),
    ] = None,
    window: Annotated[float | None, typer.Option(hidden=True)] = None,
    recording: Annotated[bool, typer.Option("--recording", hidden=True)] = False,
    player: Annotated[float | None, typer.Option(hidden=True)] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="accuracy of the geometry alone, without the network")] = False,
    store: Annotated[bool, typer.Option("--store", help="keep the accuracy in the model's model.json")] = False,
    frames: Annotated[int | None, typer.Option(min=3, max=10_000, help="frames to time; default: 120")] = None,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """Latency per stage, throughput, memory and start-up, against the paper-literal baseline in the same run; or accuracy."""
    for name, given in {"window": window is not None, "player": player is not None, "recording": recording}.items():
        if given:
            raise UserError(f"benchmark --{name} is a development tool now: .venv/bin/python -m tools.benchmarks {name}")
    if not accuracy and (store or true_masks):
        raise UserError(f"{'--store' if store else '--true-masks'} is for --accuracy SET")
    if store and (true_masks or preset is not None or config is not None):
        raise UserError("--store keeps figures of the model as it is shipped: leave --true-masks, --preset and --config out")
    check_masks(model, true_masks=true_masks)
    if frames is not None and accuracy:
        raise UserError("--frames is for speed: leave it out with --accuracy")
    if store and accuracy and len(accuracy) > 1:
        raise UserError("--store keeps the figures of one set: give one --accuracy SET")
    settings = load_config(config, preset, choose_model(model))
    if not accuracy:
        need_package("torch")  # of the baseline, as is scikit-image
        need_package("skimage")
        # The window takes the configuration's model: start-up with another one is not measured.
        first_frame_s = _first_frame_s(config) if model is None and preset is None else None
        print_figures(measure_speed(settings, frames or _FRAMES, first_frame_s), json, "speed")
    else:
        measure_accuracy(accuracy, settings, as_json=json, store=store, true_masks=true_masks)


def stream_config(config: Config) -> Config:
    """With frames segmented once, as in a stream, where the configuration has single pictures segmented in all orientations."""
    segmentation = config.perception.segmentation
    if segmentation.mirrored != "pictures":
        return config
    once = config.perception.model_copy(update={"segmentation": segmentation.model_copy(update={"mirrored": "never"})})
    return config.model_copy(update={"perception": once})


def quantiles(values: Sequence[float]) -> dict[str, float]:
    """Median and 95th percentile, rounded to microseconds when the values are milliseconds."""
    return {"p50": round(float(np.median(values)), 3), "p95": round(float(np.percentile(values, 95)), 3)}


def measure_speed(config: Config, frames: int, first_frame_s: float | None = None) -> dict[str, Any]:
    """Time perception frame by frame on twin pictures, with a frame of the baseline after every eighth; raises UserError."""
    from core.perception.pipeline import open_pipeline

    pipeline = open_pipeline(stream_config(config).perception)
    peak_memory_mb, baseline = _warm_up(pipeline)
    scenes: list[Scene] = []
    baseline_ms: list[float] = []
    started, spent = time.perf_counter(), 0.0
    with progress_bar() as bar:
        task = bar.add_task("frames", total=frames)
        for index, image in enumerate(_pictures(frames + _WARM_UP)):
            before = time.perf_counter()
            scene = pipeline.perceive_single(Frame(index, index / 30, image))
            if index < _WARM_UP:
                continue
            spent += time.perf_counter() - before
            scenes.append(scene)
            if (index - _WARM_UP) % _BASELINE_EVERY == 0 and scene.masks is not None:
                baseline_ms.append(baseline.time(image, scene.masks.vessel, scene.masks.robot).total_ms)
            bar.advance(task)
    if not baseline_ms:
        reason = next((scene.refusal.reason.value for scene in scenes if scene.refusal is not None), "no masks")
        raise UserError(f"the pictures are refused before there are masks to compare ({reason}); change [perception.quality]")
    stages = sorted({stage for scene in scenes for stage in scene.latency_ms} - {"total"})
    totals = [scene.latency_ms["total"] for scene in scenes]
    until_seen = [scene.latency_ms.get("prepare", 0.0) + scene.latency_ms.get("network", 0.0) for scene in scenes]
    after = [total - network for total, network in zip(totals, until_seen, strict=True)]
    return {
        "total_ms": quantiles(totals),
        "after_network_ms": quantiles(after),
        "stages_ms": {stage: quantiles([scene.latency_ms.get(stage, 0.0) for scene in scenes]) for stage in stages},
        "baseline_total_ms": quantiles(baseline_ms),
        "speedup": round(float(np.median(baseline_ms) / np.median(totals)), 2),
        "fps": round(len(scenes) / spent, 2),
        "peak_memory_mb": peak_memory_mb,
        "first_frame_s": first_frame_s,
        "engine": pipeline.engine,
        "cores": os.cpu_count(),
        "frames": len(scenes),
        "answered": sum(scene.pose is not None for scene in scenes),
        "seconds": round(time.perf_counter() - started, 1),
    }


def _warm_up(pipeline: Pipeline) -> tuple[float, PaperBaseline]:
    """Perceive some frames, measure the memory before torch is loaded, then load the baseline and run it once cold."""
    for index, image in enumerate(_pictures(_WARM_UP)):
        scene = pipeline.perceive_single(Frame(index, index / 30, image))
    peak_memory_mb = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1)
    from core.evaluation.paper_baseline import PaperBaseline

    baseline = PaperBaseline()
    if scene.masks is not None:
        baseline.time(image, scene.masks.vessel, scene.masks.robot)
    return peak_memory_mb, baseline


def _pictures(count: int) -> Iterator[Image]:
    """Pictures of the named phantoms in the default look, with the robot at various depths; rendered before they are timed."""
    from hardware.twin.phantoms import PHANTOM_NAMES
    from hardware.twin.world import TwinWorld

    ready: list[Image] = []
    for place, name in enumerate(PHANTOM_NAMES):
        world = TwinWorld(TwinConfig(phantom=name, appearance_seed=place), seed=place)
        for depth in (50.0, 80.0):
            world.insert(depth)
            ready.append(world.frame().image)
    for index in range(count):
        yield ready[index % len(ready)]


def _first_frame_s(config_path: Path | None) -> float | None:
    """Seconds from starting ``main.py`` to its first overlaid frame, in a process of its own (offscreen without a display).

    As at the very first start: without caches of earlier ones.
    """
    environment = dict(os.environ)
    use_offscreen(environment)
    started = time.monotonic()
    command = [sys.executable, str(ROOT / "main.py"), "gui", "--until-first-frame", "--rig", "twin"]
    command += ["--config", str(config_path)] if config_path is not None else []
    try:
        with tempfile.TemporaryDirectory() as cache:
            environment["XDG_CACHE_HOME"] = cache
            done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    except subprocess.TimeoutExpired:
        sys.stderr.write("the window showed no understood frame within 120 s\n")
        return None
    try:
        return round(float(json.loads(done.stdout)["first_frame_monotonic_s"]) - started, 2)
    except (ValueError, KeyError):
        sys.stderr.write(f"the window did not start (exit code {done.returncode}): {done.stderr.strip()[-300:]}\n")
        return None


def use_offscreen(environment: MutableMapping[str, str]) -> None:
    """Let Qt draw offscreen where there is no display."""
    if sys.platform.startswith("linux") and not environment.get("DISPLAY") and not environment.get("WAYLAND_DISPLAY"):
        environment.setdefault("QT_QPA_PLATFORM", "offscreen")


def measure_accuracy(
    folders: Sequence[Path], config: Config, *, as_json: bool, store: bool = False, true_masks: bool = False
) -> None:
    """Perceive every frame of labelled sets as a single image and compare with its truth; where a set has a bench, with it, too.

    `store` keeps the result of one set in model.json; with `true_masks` the geometry alone is measured, without the network: not
    both. After an interruption (Ctrl-C) the figures of the frames until then are shown, and nothing is stored.
    """
    from core.bench.bench import read_bench
    from core.learning.dataset import POSE_KEYS, find_labelled
    from core.learning.model_writer import check_can_change, write_figures
    from core.perception.model_file import model_folder, sha256_of

    model = config.perception.segmentation.model
    if store:
        check_can_change(model)
    sets: list[tuple[str, Path, Bench | None]] = []
    for folder in folders:  # all are read before the first is measured
        find_labelled(folder, POSE_KEYS)
        sets.append((str(folder), folder, None))
        if not true_masks and (folder / _BENCH).is_dir():
            sets.append((f"{folder} with its bench", folder, read_bench(folder / _BENCH)))
    results: dict[str, dict[str, Any]] = {}
    interrupted = False
    for name, folder, bench in sets:
        figures, interrupted = _accuracy_of(folder, config, bench, true_masks=true_masks)
        if figures:
            results[name] = figures
        if interrupted:
            break
    if not results:
        raise KeyboardInterrupt
    try:
        if len(sets) == 1:
            (figures,) = results.values()
            part = f", interrupted after {figures['frames']} of {figures['frames_of_set']} frames" if interrupted else ""
            print_figures(figures, as_json, f"accuracy on {folders[0]}{part}")
        else:
            print_side_by_side(results, as_json)
    finally:  # stored where it cannot be printed, too
        if store and not interrupted:
            described = {"set": folders[0].name, "truth_sha256": sha256_of(folders[0] / "truth.jsonl")}
            write_figures(model_folder(model), described | results[str(folders[0])])
    if interrupted:
        raise KeyboardInterrupt


_BENCH = "bench"
"""Folder within a labelled set that holds its bench."""


def _accuracy_of(folder: Path, config: Config, bench: Bench | None, *, true_masks: bool) -> tuple[dict[str, Any], bool]:
    """Figures of a set, empty where no frame was measured, and whether it was interrupted."""
    from core.evaluation.accuracy import TrueMasks, score_set, summarise, summarise_looks
    from core.evaluation.confidence import describe_confidence, describe_gates
    from core.learning.dataset import POSE_KEYS, find_labelled
    from core.perception.pipeline import Pipeline, open_pipeline

    samples, truth = find_labelled(folder, POSE_KEYS)
    masks, left_out = TrueMasks(), LeftOut()
    pipeline = Pipeline(masks, config.perception) if true_masks else open_pipeline(config.perception, bench=bench)
    scores: list[FrameScore] = []
    interrupted = False
    with progress_bar() as bar:
        found = score_set(samples, truth, pipeline, masks, left_out.add)
        try:
            for score in bar.track(found, total=len(samples), description="frames"):
                scores.append(score)
        except KeyboardInterrupt:
            interrupted = True
    if interrupted and not scores:
        return {}, True
    left_out.print_note(len(scores))
    confident_from = config.perception.quality.confident_from
    figures = summarise(scores, confident_from) | describe_confidence(scores) | {"stricter_gates": describe_gates(scores)}
    if left_out:
        figures["left_out"] = len(left_out)
    if interrupted:
        figures |= {"interrupted": True, "frames_of_set": len(samples)}
    looks = {stem: str(row["family"]) for stem, row in truth.items() if row.get("family") is not None}
    if scores and all(score.stem in looks for score in scores):
        figures |= summarise_looks(scores, looks, confident_from)
    return figures, interrupted


_SIDE_BY_SIDE = {
    "frames": "frames",
    "answered": "answered_share",
    "states right": "state_agreement",
    "answered and wrong": "answered_and_wrong_share",
    "Dice vessel": "vessel_dice",
    "Dice robot": "robot_dice",
    "head, px": "head_error_px",
    "theta, deg": "theta_error_deg",
    "frames without robot": "empty_frames",
    "answered of these": "answers_on_empty_frames",
}
"""Rows of the table of several sets; errors as medians."""


def print_side_by_side(results: dict[str, dict[str, Any]], as_json: bool) -> None:
    """The main figures of several sets, a column each; all of them as JSON."""
    if as_json:
        sys.stdout.write(json.dumps({"sets": results}, allow_nan=False) + "\n")
        return
    table = Table(title="accuracy; errors are medians")
    for name in ("", *results):
        table.add_column(name, overflow="fold")
    for row, key in _SIDE_BY_SIDE.items():
        values = [figures[key] for figures in results.values()]
        table.add_row(row, *(_text(value["median"] if isinstance(value, dict) else value) for value in values))
    Console(markup=False, emoji=False).print(table)


def print_figures(result: dict[str, Any], as_json: bool, title: str) -> None:
    if as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
        return
    table = Table(title=title, show_header=False)
    for key, value in result.items():
        if isinstance(value, dict) and any(isinstance(inner, dict) for inner in value.values()):
            for inner_key, inner in value.items():
                table.add_row(f"{key}.{inner_key}", _text(inner))
        else:
            table.add_row(key, _text(value))
    Console(markup=False, emoji=False).print(table)


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(inner)}" for key, inner in value.items()) or "-"
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
