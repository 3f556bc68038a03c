"""Commands that try the program itself, for minutes or hours: trial, benchmark, faults, soak, screenshots."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli_options import ConfigOption, JsonOption, ModelOption, PresetOption, SchedulerOption, check_masks
from core.errors import UserError

_FRAMES = 120


def trial(
    seeds: Annotated[str, typer.Option(help="A:B, phantoms, looks, robots and targets A to B - 1")],
    policy: Annotated[
        list[str] | None,
        typer.Option(help="pursuit, table, push or random; may be repeated to compare; default: the configured one"),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes")] = 1,
    json: Annotated[bool, typer.Option("--json", help="one JSON object per trial, then the summary, on standard output")] = False,
    out: Annotated[Path | None, typer.Option(help="folder for trials.jsonl and report.html; trials already there are kept")] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="the twin's own masks instead of the network's")] = False,
    max_seconds: Annotated[float, typer.Option(min=1.0, max=3600.0, help="simulated time after which a trial has failed")] = 120.0,
    look: Annotated[
        str, typer.Option(help="random: every trial another picture; bench: the default clear one; or a family, as in synth")
    ] = "random",
    scheduler: SchedulerOption = None,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """Closed-loop trials in the bench twin: a policy drives the robot to a target that it has never seen."""
    from app.trial_command import run_trials

    check_masks(model, true_masks=true_masks)
    run_trials(
        seeds,
        policy or [],
        workers=workers,
        out=out,
        model=model,
        config_path=config,
        true_masks=true_masks,
        max_seconds=max_seconds,
        look=look,
        scheduler=scheduler,
        as_json=json,
    )


def benchmark(
    json: JsonOption = False,
    accuracy: Annotated[Path | None, typer.Option(help="measure accuracy on this synth set instead of speed")] = None,
    window: Annotated[
        float | None,
        typer.Option(min=5.0, max=3600.0, help="measure the window's pace for so many seconds from its first picture on"),
    ] = None,
    recording: Annotated[bool, typer.Option("--recording", help="how much a recording slows perception down, in turns")] = False,
    player: Annotated[
        float | None, typer.Option(min=0.5, max=600.0, help="open a session of so many minutes in the player and seek in it")
    ] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="accuracy of the geometry alone, without the network")] = False,
    store: Annotated[bool, typer.Option("--store", help="keep the accuracy in the model's model.json")] = False,
    frames: Annotated[
        int | None, typer.Option(min=3, max=10_000, help="frames to time, also with --recording; default: 120")
    ] = None,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """Latency per stage, throughput, memory and start-up, against the paper-literal baseline in the same run; or accuracy."""
    from app.benchmark_command import run_accuracy, run_player, run_recording, run_speed, run_window_pace

    asked = {"--window": window is not None, "--player": player is not None, "--recording": recording}
    asked["--accuracy"] = accuracy is not None
    if sum(asked.values()) > 1:
        raise UserError(f"{', '.join(name for name, given in asked.items() if given)} are different things: give one of them")
    if accuracy is None and (store or true_masks):
        raise UserError(f"{'--store' if store else '--true-masks'} is for --accuracy SET")
    if store and (true_masks or preset is not None or config is not None):
        raise UserError("--store keeps figures of the model as it is shipped: leave --true-masks, --preset and --config out")
    check_masks(model, true_masks=true_masks)
    others = [name for name, given in asked.items() if given and name != "--recording"]
    if frames is not None and others:
        raise UserError(f"--frames is for speed and --recording: leave it out with {others[0]}")
    frames = _FRAMES if frames is None else frames
    if window is not None and (model is not None or preset is not None):
        raise UserError("--window runs with the settings of --config: leave --model and --preset out")
    if window is not None:
        run_window_pace(window, config_path=config, as_json=json)
    elif player is not None:
        run_player(player, model=model, preset=preset, config_path=config, as_json=json)
    elif recording:
        run_recording(frames, model=model, preset=preset, config_path=config, as_json=json)
    elif accuracy is not None:
        run_accuracy(accuracy, model=model, preset=preset, config_path=config, as_json=json, store=store, true_masks=true_masks)
    else:
        run_speed(frames, model=model, preset=preset, config_path=config, as_json=json)


def faults(
    only: Annotated[list[int] | None, typer.Option(min=1, help="this fault of the list only; may be repeated")] = None,
    json: Annotated[bool, typer.Option("--json", help="one JSON object per fault on standard output")] = False,
    out: Annotated[Path | None, typer.Option(help="also write the table as a page, as docs/faults.md")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="those that need no line, process or window, in lock-step")] = False,
) -> None:
    """Fault campaign: bring all 45 faults about and look for reaction, alert and record."""
    from app.faults_command import run_faults

    sys.exit(run_faults(only or [], out, quick=quick, as_json=json))


def soak(
    hours: Annotated[float, typer.Option(min=0.005, max=1000.0, help="Ctrl-C ends it sooner and tells the figures so far")] = 2.0,
    seed: Annotated[int, typer.Option(min=0, help="of faults and operator")] = 0,
    out: Annotated[Path | None, typer.Option(help="file for the samples and the summary, one JSON object a line")] = None,
    true_masks: Annotated[
        bool, typer.Option("--true-masks", help="the twin's own masks instead of the network's: lighter")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Hours of twin under random faults and operator input: memory, threads, files, records, and every goal on the wire."""
    from app.soak_command import run_soak

    sys.exit(run_soak(hours, seed, out, true_masks=true_masks, as_json=json))


def screenshots(
    out: Annotated[Path, typer.Option(help="folder of the pictures")],
    only: Annotated[list[str] | None, typer.Option(help="only this picture; may be repeated")] = None,
    config: ConfigOption = None,
) -> None:
    """The pictures of the documents, from the running program with fixed seeds. No screen is needed."""
    from app.screenshots_command import run_screenshots

    run_screenshots(out, only or (), config)
