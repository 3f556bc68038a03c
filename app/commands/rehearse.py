"""``rehearse``: many runs to a target of the user's own bench in the twin, before the real robot moves."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.options import ConfigOption, JsonOption, point_option
from app.commands.progress import console, progress_bar
from app.commands.workers import over_processes
from core.config.models import load_config
from core.evaluation.trial import Row, summarise

if TYPE_CHECKING:
    from core.types import Point
    from hardware.twin.phantom import Phantom
    from hardware.twin.rehearsal import RehearsalPlan


def rehearse(
    bench: Annotated[str, typer.Option(help="the phantom of your bench (see phantom): its folder, model, or rig")],
    target: Annotated[str, typer.Option(help="X,Y: where the robot is to go, in pixels of the bench's picture")],
    runs: Annotated[int, typer.Option(min=5, max=10_000, help="runs at each speed that is tried")] = 50,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes, at low priority")] = min(2, os.cpu_count() or 1),
    seed: Annotated[int, typer.Option(min=0, max=1_000_000, help="of the first run")] = 0,
    head_px: Annotated[float, typer.Option(min=0.0, max=50.0, help="error of the perceived head, median, in px at 640")] = 1.5,
    missing: Annotated[float, typer.Option(min=0.0, max=0.9, help="share of the frames without an answer")] = 0.05,
    max_seconds: Annotated[float, typer.Option(min=1.0, max=3600.0, help="simulated time after which a run has failed")] = 120.0,
    as_json: JsonOption = False,
    config_path: ConfigOption = None,
) -> None:
    """Rehearse the way to a target: how many runs arrive, with which wall force, where it is weakest, at which speed to go."""
    from hardware.twin.own_phantom import with_own_phantom
    from hardware.twin.phantoms import make_phantom
    from hardware.twin.rehearsal import SPEEDS, RehearsalPlan, is_good, sharp_turns
    from hardware.twin.rendering.appearance import Appearance, make_view
    from hardware.twin.trial import TrialPlan, target_near

    config = with_own_phantom(load_config(config_path, None, {}), bench)
    phantom = make_phantom(config.twin.phantom)
    view = make_view(Appearance(), (config.twin.image_width_px, config.twin.image_height_px), phantom)
    place = target_near(phantom, view, point_option(target))  # refused here, not by a worker
    trial = TrialPlan(config, max_seconds=max_seconds, look="bench", wall_force=False, own=True, target_px=place.click_px)
    sharp: list[dict[str, Any]] = [
        {"xy": _pixel(phantom, turn.point_mm), "turn_deg": round(turn.turn_deg, 1), "limit_deg": round(turn.limit_deg, 1)}
        for turn in sharp_turns(phantom, place)
    ]
    for turn in sharp if not as_json else ():
        console.print(
            f"too sharp: the branch at ({turn['xy'][0]:.0f}, {turn['xy'][1]:.0f}) turns by {turn['turn_deg']:.0f} degrees, the "
            f"head bends by {turn['limit_deg']:.0f} there",
            soft_wrap=True,
        )
    tried: list[tuple[float, list[Row]]] = []
    for speed in SPEEDS:
        rows = _run(RehearsalPlan(trial, head_px, missing, speed), range(seed, seed + runs), workers)
        tried.append((speed, rows))
        if is_good(summarise(rows)):
            break
    good = [speed for speed, rows in tried if is_good(summarise(rows))]
    about = _about(tried[0][1], phantom, place.route)
    about |= {
        "bench": bench,
        "target_xy": [round(value, 1) for value in place.click_px],
        "sharp": sharp,
        "speed_mm_s": config.advice.fast_mm_s,
        "recommended_speed_mm_s": round(good[0] * config.advice.fast_mm_s, 2) if good else None,
        "at_speeds": [{"share": speed, **_figures(rows)} for speed, rows in tried],
        "assumed": {"head_px": head_px, "missing": missing, "robot": "twin"},
    }
    if as_json:
        sys.stdout.write(json.dumps(about, allow_nan=False) + "\n")
    else:
        _print(about)


def _run(plan: RehearsalPlan, seeds: range, workers: int) -> list[Row]:
    """The rows by seed."""
    from hardware.twin.rehearsal import rehearse_once

    rows = []
    with progress_bar() as bar:
        task = bar.add_task(f"runs at {plan.speed:.0%} speed", total=len(seeds))
        for row in over_processes(workers, partial(rehearse_once, plan), seeds):
            rows.append(row)
            bar.update(task, advance=1, description=f"{sum(r['reached'] for r in rows)} of {len(rows)} arrived")
    return sorted(rows, key=lambda row: int(row["seed"]))


def _figures(rows: Sequence[Row]) -> dict[str, Any]:
    """Share that arrived with its interval, times, forces."""
    import numpy as np

    from core.evaluation.metrics import wilson_95

    sums = summarise(rows)
    times = [row["time_s"] for row in rows if row["reached"]]
    low, high = wilson_95(sums["reached_share"], len(rows))
    return {
        "runs": len(rows),
        "arrived": {"share": sums["reached_share"], "low": round(low, 4), "high": round(high, 4)},
        "outcomes": sums["outcomes"],
        "time_s": {"median": sums["median_time_s"], "p95": round(float(np.percentile(times, 95)), 2) if times else None},
        "wall_force_n": {"p95": sums["wall_force_p95_n"], "max": sums["wall_force_max_n"]},
    }


def _about(rows: Sequence[Row], phantom: Phantom, route: Any) -> dict[str, Any]:
    """The figures at full speed, and the weakest place in pixels."""
    from hardware.twin.rehearsal import weakest_place

    weakest = weakest_place(rows, route)
    if weakest is not None:
        weakest = {"xy": _pixel(phantom, weakest.pop("point_mm")), **weakest}
    return _figures(rows) | {"weakest": weakest}


def _pixel(phantom: Phantom, point_mm: Point) -> list[float]:
    import numpy as np

    assert phantom.view is not None
    return [round(value, 1) for value in phantom.view.project(np.array([point_mm]))[0].tolist()]


def _print(about: dict[str, Any]) -> None:
    arrived, force, weakest, speed = about["arrived"], about["wall_force_n"], about["weakest"], about["recommended_speed_mm_s"]
    lines = [
        f"{arrived['share']:.0%} of {about['runs']} runs arrived (95 % interval {arrived['low']:.0%} to {arrived['high']:.0%}): "
        + ", ".join(f"{name} {count}" for name, count in about["outcomes"].items())
    ]
    if about["time_s"]["median"] is not None:
        lines.append(f"time {about['time_s']['median']:.1f} s (median), {about['time_s']['p95']:.1f} s (95 %)")
    if force["p95"] is not None:
        lines.append(f"wall force {force['p95']:.3f} N (95 %), {force['max']:.3f} N (largest)")
    if weakest is not None:
        why = f"{weakest['ended_here']} runs ended there" if weakest["ended_here"] else f"{weakest['wall_force_p95_n']:.3f} N"
        x, y = weakest["xy"]
        lines.append(
            f"weakest at ({x:.0f}, {y:.0f}), {weakest['along_mm']:.0f} mm in, a turn of {weakest['turn_deg']:.0f} degrees: {why}"
        )
    if speed is None:
        lines.append("no speed that was tried is good: choose another target")
    else:
        lines.append(f"recommended: {speed / about['speed_mm_s']:.0%} of the set speeds, advice.fast_mm_s = {speed:g}")
    for line in lines:
        console.print(line, soft_wrap=True)
