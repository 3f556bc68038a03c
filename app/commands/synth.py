"""``synth``: labelled frames from the twin."""

from __future__ import annotations

import json
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from app.commands.options import BenchOption, SchedulerOption
from app.commands.progress import console, progress_bar
from core.program import need_package


def synth(
    out: Annotated[Path, typer.Option(help="folder of the set; an interrupted one is continued")],
    count: Annotated[int, typer.Option(min=1, help="frames, or scenes")],
    seed: Annotated[int, typer.Option(min=0, help="first phantom seed; 16 x --poses frames, or 4 scenes, use one")] = 0,
    width: Annotated[int, typer.Option(min=160, max=4096)] = 640,
    height: Annotated[int, typer.Option(min=120, max=4096)] = 480,
    family: Annotated[
        list[str] | None,
        typer.Option(
            help="only these families of looks, rare ones among them (gel, drape, stage_light, glow, tank, picture, resin: drawn "
            "only where they are named), bench: the twin's own, own: your bench's picture (--bench), or painted: drawn from "
            "geometry alone; may be repeated"
        ),
    ] = None,
    phantom: Annotated[str | None, typer.Option(help="one named phantom instead of random ones")] = None,
    bench: BenchOption = None,
    poses: Annotated[
        int, typer.Option(min=1, max=8, help="poses of the robot in every look: more frames in the same time, but fewer looks")
    ] = 1,
    scenes: Annotated[
        bool, typer.Option("--scenes", help="scenes for train --scenes in place of frames: geometry that benches are painted from")
    ] = False,
    workers: Annotated[int, typer.Option(min=1, max=64, help="processes")] = 1,
    scheduler: SchedulerOption = None,
) -> None:
    """Randomised labelled frames from the bench twin: images, masks, truth."""
    families = tuple(family) if family else None
    if bench is not None:
        from hardware.twin.own_phantom import phantom_name

        phantom = phantom_name(bench)
    make_set(out, count, seed, (width, height), families, phantom, poses, workers, scheduler, scenes=scenes)


def make_set(
    out: Path,
    count: int,
    seed: int,
    size: tuple[int, int] = (640, 480),
    families: tuple[str, ...] | None = None,
    phantom: str | None = None,
    poses: int = 1,
    workers: int = 1,
    scheduler: str | None = None,
    *,
    scenes: bool = False,
) -> None:
    """Write a set of frames, or of scenes; raises SynthError, and ClusterError with `scheduler`."""
    from hardware.twin.catalog import LOOKS
    from hardware.twin.dataset import PAINTED_LOOK, SynthError, SynthPlan, write_set
    from hardware.twin.phantoms import make_phantom

    unknown = [name for name in families or () if name not in (*LOOKS, PAINTED_LOOK)]
    if unknown:
        raise SynthError(f"unknown look family {unknown[0]!r}; known: {', '.join((*LOOKS, PAINTED_LOOK))}")
    if PAINTED_LOOK in (families or ()):
        need_package("skimage")  # its photographs are boards
    if scenes and poses != 1:
        raise SynthError("--poses is for frames: a scene has several robots already; leave it out")
    if phantom is not None:
        try:
            make_phantom(phantom)
        except ValueError as error:
            raise SynthError(str(error)) from None
    plan = SynthPlan(out, count, seed, size, families, phantom, poses, scenes)
    remote = None
    if scheduler is not None:
        from app.commands.workers import over_cluster

        remote = partial(over_cluster, scheduler)
    with progress_bar() as bar:
        task = bar.add_task(f"{'scenes' if scenes else 'frames'} -> {out}", total=count)
        write_set(plan, workers=workers, remote=remote, on_progress=lambda frames: bar.advance(task, frames))
    kind = "scenes" if scenes else "labelled frames"
    seeds = f"seeds {seed} to {seed + plan.episodes - 1}" if plan.episodes > 1 else f"seed {seed}"
    console.print(f"{count} {kind if count > 1 else kind[:-1]} of phantom {seeds} in {out}", soft_wrap=True)
    if not scenes:
        rows = (out / "truth.jsonl").read_text(encoding="utf-8").splitlines()
        looks = Counter(json.loads(row)["family"] for row in rows)
        console.print(f"looks: {', '.join(f'{name} ({n})' for name, n in looks.most_common())}", soft_wrap=True)
