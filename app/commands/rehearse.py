"""``rehearse``: many runs to a target of the user's own bench in the twin, before the real robot moves."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.options import ConfigOption, JsonOption, ProgressOption, point_option
from app.commands.progress import (
    ProgressWriter,
    console,
    end_like_an_interrupt,
    progress_bar,
    progress_writer,
    report_progress,
)
from app.commands.workers import over_processes
from core.config.models import Config, load_config
from core.config.rig_file import find_rig, set_pursuit
from core.devices import UserError
from core.evaluation.rehearsal import FEWEST_RUNS
from core.evaluation.trial import Row, summarise

if TYPE_CHECKING:
    from hardware.twin.rehearsal import RehearsalPicture, RehearsalPlan, SeenHeads

_FIRST_SHARE = 0.7
"""Of the time, for the pictures and the set speeds; slower ones are tried in the rest."""
_MANY_MISSING = 0.5
"""A larger share of the pictures without an answer is told."""
_SHOWN_EVERY_S = 2.0
Show = Callable[[Sequence[Row]], None]


def rehearse(
    target: Annotated[str, typer.Option(help="X,Y: where the robot is to go, in pixels of the bench's picture")],
    bench: Annotated[
        str | None, typer.Option(help="the phantom of your bench (see phantom): its folder, model, or rig; default: twin.phantom")
    ] = None,
    runs: Annotated[int, typer.Option(min=5, max=10_000, help="runs at each speed that is tried")] = 50,
    minutes: Annotated[float, typer.Option(min=0.1, max=1000.0, help="time that it may take; fewer runs then")] = 30.0,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes, at low priority")] = min(2, os.cpu_count() or 1),
    seed: Annotated[int, typer.Option(min=0, max=1_000_000, help="of the first run")] = 0,
    max_seconds: Annotated[float, typer.Option(min=1.0, max=3600.0, help="simulated time after which a run has failed")] = 120.0,
    tune: Annotated[bool, typer.Option("--tune", help="search better settings of pursuit for this way, instead")] = False,
    kept_in: Annotated[str | None, typer.Option("--rig", help="--tune: keep them in the file of this rig")] = None,
    as_json: JsonOption = False,
    progress_json: ProgressOption = False,
    given: Annotated[bool, typer.Option("--given", hidden=True, help="configuration and picture's size on standard input")] = False,
    config_path: ConfigOption = None,
) -> None:
    """Rehearse the way to a target: how many runs arrive, with which wall force, where it is weakest, at which speed to go.

    --json has the band of the heads' paths and the wall force along the way, too: "way" (core/evaluation/rehearsal.py).
    """
    from hardware.twin.own_phantom import with_own_perception, with_own_phantom
    from hardware.twin.rehearsal import RehearsalPicture, RehearsalPlan, figures
    from hardware.twin.trial import TrialPlan

    if kept_in is not None and not tune:
        raise UserError("--rig keeps what --tune finds: give both, or --bench for the bench of a rig")
    if progress_json:
        report_progress()
    end_like_an_interrupt()
    told = json.loads(sys.stdin.read()) if given else {}
    config = Config.model_validate(told["config"]) if given else load_config(config_path, None, {})
    config = with_own_perception(with_own_phantom(config, bench), bench) if bench is not None else config
    picture = RehearsalPicture.of(config, point_option(target), told.get("size_px"))
    trial = TrialPlan(config, max_seconds=max_seconds, look="bench", own=True, target_px=picture.trial_px)
    sharp = picture.sharp(config)
    is_read = not (as_json or progress_json)
    for turn in sharp if is_read else ():
        x, y = turn.xy
        console.print(
            f"too sharp: the branch at ({x:.0f}, {y:.0f}) turns by {turn.turn_deg:.0f} degrees, the head bends by "
            f"{turn.limit_deg:.0f} there",
            soft_wrap=True,
        )
    began_s, writer = time.monotonic(), progress_writer()
    seen = _seen(config, picture, workers, 60.0 * minutes * _FIRST_SHARE)
    if seen is None:
        raise _late(given=given)
    if seen.missing > _MANY_MISSING and is_read:
        no_answer = f"{seen.missing:.0%} of the pictures of the way give no answer: teach the bench (python main.py teach)"
        console.print(no_answer, soft_wrap=True)
    plan = RehearsalPlan(trial, seen)
    if tune:
        _tune(plan, runs, seed, workers, kept_in, as_json=as_json)
        return
    about: dict[str, Any] = {
        "bench": bench or config.twin.phantom,
        "target_xy": picture.pixels([picture.target.point_mm])[0],
        "size_px": picture.view.size,
        "sharp": [turn.model_dump(mode="json") for turn in sharp],
        "speed_mm_s": config.advice.fast_mm_s,
        "based_on": {
            "pictures": len(seen.confidence),
            "missing": round(seen.missing, 4),
            "robot": "identified" if config.twin.behaviour else "twin",
        },
    }
    show = _shows(writer, about, picture) if writer is not None else None
    tried, good = _at_speeds(plan, range(seed, seed + runs), workers, (began_s, 60.0 * minutes), show)
    if not tried:
        raise _late(given=given)
    about |= picture.found(tried[0][1])
    about["recommended_speed_mm_s"] = round(good * config.advice.fast_mm_s, 2) if good is not None else None
    about["at_speeds"] = [{"share": speed, **figures(rows)} for speed, rows in tried]
    if is_read:
        _print(about, runs)
    else:
        sys.stdout.write(json.dumps(about, allow_nan=False) + "\n")


def _late(*, given: bool) -> UserError:
    busy = "the computer is too busy; close other programs, and rehearse again"  # translated in the window
    return UserError(busy if given else "no run has ended in this time; give more --minutes")


def _at_speeds(
    plan: RehearsalPlan, seeds: range, workers: int, began_within_s: tuple[float, float], show: Show | None
) -> tuple[list[tuple[float, list[Row]]], float | None]:
    """The rows at each speed that was tried, and the good one; `show` is for the set speeds."""
    from hardware.twin.rehearsal import SPEEDS, is_good

    tried: list[tuple[float, list[Row]]] = []
    began_s, within_s = began_within_s
    for speed in SPEEDS:
        ends_s = began_s + within_s * (1.0 if tried else _FIRST_SHARE), began_s + within_s
        rows = _run(replace(plan, speed=speed), seeds, workers, ends_s, None if tried else show)
        if not rows:
            break
        tried.append((speed, rows))
        if len(rows) >= min(len(seeds), FEWEST_RUNS) and is_good(summarise(rows)):
            return tried, speed
    return tried, None


def _seen(config: Config, picture: RehearsalPicture, workers: int, within_s: float) -> SeenHeads | None:
    """How perception does in pictures of the way, of which it takes what is done in this time; None: nothing."""
    from hardware.twin.rehearsal import WANDERS, SeenHeads, seen_heads

    look = partial(seen_heads, config, picture.target)
    with progress_bar() as bar, closing(over_processes(workers, look, WANDERS, within_s)) as results:
        task = bar.add_task("perceiving the way in pictures", total=len(WANDERS))
        parts = []
        for part in results:
            parts.append(part)
            bar.advance(task)
    return SeenHeads.joined(parts) if parts else None


def _tune(plan: RehearsalPlan, runs: int, seed: int, workers: int, rig: str | None, *, as_json: bool) -> None:
    """Search settings of pursuit, compare them with the configured ones on other seeds, and keep them where they are better."""
    from hardware.twin.tuning import SEARCH_RUNS, tuned

    path = find_rig(rig)[0] if rig is not None else None
    with progress_bar() as bar:
        task = bar.add_task("runs of search and comparison", total=SEARCH_RUNS + 2 * runs)

        def spread(function: Any, tasks: Any) -> Iterator[Any]:
            for result in over_processes(workers, function, tasks):
                bar.advance(task)
                yield result

        about = tuned(plan, seed, runs, spread)
    is_better = about.get("changes", {}).get("is_better", False)
    if path is not None and is_better:
        set_pursuit(path, about["found"])
    about["kept"] = str(path) if path is not None and is_better else None
    if as_json:
        sys.stdout.write(json.dumps(about, allow_nan=False) + "\n")
    else:
        _print_tuned(about, is_better=is_better)


def _print_tuned(about: dict[str, Any], *, is_better: bool) -> None:
    own, found = about["configured"], about["found"]
    lines = [f"{name} {value:g} -> {found[name]:g}" for name, value in own.items() if found[name] != value]
    for title in ("before", "after") if lines else ():
        one, arrived = about[title], about[title]["arrived"]
        time_s, p95_n = one["time_s"]["median"], one["wall_force_n"]["p95"] or 0.0
        took = "" if time_s is None else f", {time_s:.1f} s (median)"
        lines.append(
            f"{title}: {arrived['share']:.0%} of {one['runs']} arrived ({arrived['low']:.0%} to {arrived['high']:.0%}){took}, "
            f"{p95_n:.3f} N (95 %)"
        )
    for name in ("time", "wall_force") if lines else ():
        one = about["changes"][name]
        lines.append(f"{name.replace('_', ' ')} {one['change']:+.0%} ({one['low']:+.0%} to {one['high']:+.0%})")
    kept = f"kept in {about['kept']}" if about["kept"] else "not kept; --rig NAME keeps them in the rig's file"
    lines.append(kept if is_better else "the configured settings stay: none is surely better")
    for line in lines:
        console.print(line, soft_wrap=True)


def _shows(writer: ProgressWriter, about: dict[str, Any], picture: RehearsalPicture) -> Show:
    """Tells a window what was found so far, every two seconds."""
    shown_s = time.monotonic()

    def show(rows: Sequence[Row]) -> None:
        nonlocal shown_s
        if time.monotonic() - shown_s >= _SHOWN_EVERY_S:
            shown_s = time.monotonic()
            writer.write({"so_far": about | picture.found(rows)})

    return show


def _run(
    plan: RehearsalPlan,
    seeds: range,
    workers: int,
    ends_s: tuple[float, float],
    show: Show | None,
) -> list[Row]:
    """The rows by seed, of the first ones where the time was too short; a slower speed is given up once it cannot be good.

    `ends_s` : after the run that ends first from then on, and at the latest.
    """
    from hardware.twin.rehearsal import is_hopeless, rehearse_once

    rows: list[Row] = []
    left_s = ends_s[1] - time.monotonic()
    writer = progress_writer()
    if writer is not None:
        writer.write({"speed": plan.speed})
    with progress_bar() as bar, closing(over_processes(workers, partial(rehearse_once, plan), seeds, left_s)) as results:
        task = bar.add_task(f"{plan.speed:.0%} speed", total=len(seeds))
        for row in results:
            rows.append(row)
            arrived = sum(r["reached"] for r in rows)
            bar.update(task, advance=1, description=f"{plan.speed:.0%} speed: {arrived} of {len(rows)} arrived")
            if show is not None:
                show(rows)
            if writer is not None and not writer.is_read:
                raise KeyboardInterrupt  # the window has gone
            if plan.speed < 1.0 and is_hopeless(rows, len(seeds)):
                return rows
            if time.monotonic() > ends_s[0]:
                break
    rows.sort(key=lambda row: int(row["seed"]))
    whole = next((k for k, row in enumerate(rows) if row["seed"] != seeds[k]), len(rows))
    return rows[:whole]  # a run that lasts long has not ended by then: those after it would be the quick ones


def _print(about: dict[str, Any], runs: int) -> None:
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
        few = about["runs"] < min(runs, FEWEST_RUNS)
        lines.append(
            "too few runs ended to recommend a speed: give more --minutes"
            if few
            else "no speed that was tried is good: choose another target"
        )
    else:
        lines.append(f"recommended: {speed / about['speed_mm_s']:.0%} of the set speeds, advice.fast_mm_s = {speed:g}")
    for line in lines:
        console.print(line, soft_wrap=True)
