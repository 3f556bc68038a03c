"""``synth``: labelled frames from the twin."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from app.cluster import over_cluster
from app.long_work import console, progress_bar


def run_synth(
    out: Path,
    count: int,
    seed: int,
    size: tuple[int, int],
    families: tuple[str, ...] | None,
    phantom: str | None,
    poses: int = 1,
    *,
    workers: int = 1,
    scheduler: str | None = None,
) -> None:
    """Write a labelled set; raises SynthError, and ClusterError with `scheduler`."""
    from hardware.twin.look_titles import LOOKS
    from hardware.twin.phantoms import make_phantom
    from hardware.twin.synth import SynthError, SynthPlan, write_set

    unknown = [name for name in families or () if name not in LOOKS]
    if unknown:
        raise SynthError(f"unknown look family {unknown[0]!r}; known: {', '.join(LOOKS)}")
    if phantom is not None:
        try:
            make_phantom(phantom)
        except ValueError as error:
            raise SynthError(str(error)) from None
    plan = SynthPlan(out, count, seed, size, families, phantom, poses)
    elsewhere = None if scheduler is None else partial(over_cluster, scheduler)
    with progress_bar() as bar:
        task = bar.add_task(f"frames -> {out}", total=count)
        write_set(plan, workers=workers, elsewhere=elsewhere, on_progress=lambda frames: bar.advance(task, frames))
    console.print(f"{count} labelled frames of phantom seeds {seed} to {seed + plan.episodes - 1} in {out}", soft_wrap=True)
