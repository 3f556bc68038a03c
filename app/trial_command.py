"""``trial``: closed-loop campaigns in the twin, over processes or a Dask cluster; they can be interrupted and gone on with."""

from __future__ import annotations

import json
import re
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

from rich.console import Console

from app.cluster import over_cluster
from app.long_work import progress_bar
from app.trial_store import Job, KeptTrials, TrialError
from app.worker_pool import over_processes
from core.config import choose_model, load_config
from core.control.policies import POLICY_NAMES
from core.policy_config import PolicyName
from core.study.trial import Row, summarise
from hardware.twin.trial import TRIAL_LOOKS, TrialPlan

_console = Console(stderr=True, markup=False, emoji=False)
_MAX_SEEDS = 100_000


@dataclass(frozen=True, slots=True)
class Campaign:
    """What to run. Without `out` nothing is kept; with `scheduler` the trials run on that Dask cluster."""

    plan: TrialPlan
    policies: tuple[PolicyName, ...]
    seeds: range
    workers: int = 1
    out: Path | None = None
    scheduler: str | None = None

    @property
    def jobs(self) -> list[Job]:
        """All policies meet a seed one after the other, so that a part of a campaign can already be compared."""
        return [(policy, seed) for seed in self.seeds for policy in self.policies]


def parse_seeds(text: str) -> range:
    """``A:B`` is A to B - 1, as in Python; ``A`` alone is one seed. Raises TrialError."""
    match = re.fullmatch(r"(\d{1,9})(?::(\d{1,9}))?", text.strip())
    if match is None:
        raise TrialError(f"--seeds {text!r}: give A:B (A to B - 1), for example 0:100")
    first = int(match[1])
    last = int(match[2]) if match[2] is not None else first + 1
    if not first < last <= first + _MAX_SEEDS:
        raise TrialError(f"--seeds {text!r}: B must be above A, by at most {_MAX_SEEDS}")
    return range(first, last)


def parse_policies(names: Sequence[str]) -> tuple[PolicyName, ...]:
    """Known names, each once, in order. Raises TrialError."""
    for name in names:
        if name not in POLICY_NAMES:
            raise TrialError(f"unknown policy {name!r}; known: {', '.join(POLICY_NAMES)}")
    return cast("tuple[PolicyName, ...]", tuple(dict.fromkeys(names)))


def parse_look(name: str) -> str:
    """Raises TrialError."""
    if name not in TRIAL_LOOKS:
        raise TrialError(f"unknown look {name!r}; known: {', '.join(TRIAL_LOOKS)}")
    return name


def run_trials(
    seeds: str,
    policies: Sequence[str],
    *,
    workers: int,
    out: Path | None,
    model: str | None,
    config_path: Path | None,
    true_masks: bool,
    max_seconds: float,
    look: str,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Run a campaign and tell its results; raises TrialError, ConfigError, ModelError, and KeyboardInterrupt once all is kept."""
    overrides = choose_model(model)
    config = load_config(config_path, None, overrides)
    chosen = parse_policies(policies or [config.policy.name])
    if workers > 1 or scheduler is not None:  # one thread each: workers must not fight for the cores
        overrides.setdefault("perception", {}).setdefault("segmentation", {})["threads"] = 1
        config = load_config(config_path, None, overrides)
    campaign = Campaign(
        TrialPlan(config, true_masks, max_seconds, parse_look(look)), chosen, parse_seeds(seeds), workers, out, scheduler
    )
    rows, interrupted = _run(campaign)
    _tell(campaign, rows, as_json)
    if interrupted:
        kept = f"kept in {out}; the same command goes on" if out is not None else "give --out to keep and go on with a campaign"
        _console.print(f"{len(rows)} of {len(campaign.jobs)} trials were done: {kept}", soft_wrap=True)
        raise KeyboardInterrupt


def _run(campaign: Campaign) -> tuple[list[Row], bool]:
    """The rows of the campaign in the order of its jobs, and whether it was interrupted."""
    _check(campaign.plan)
    kept = KeptTrials(campaign.out, campaign.plan, campaign.jobs)
    missing = [job for job in campaign.jobs if job not in kept.rows]
    interrupted = False
    with progress_bar() as bar:
        task = bar.add_task("trials", total=len(campaign.jobs), completed=len(campaign.jobs) - len(missing))
        try:
            for row in _results(campaign, missing):
                kept.add(row)
                reached = sum(bool(r["reached"]) for r in kept.rows.values())
                bar.update(task, advance=1, description=f"trials, {reached} of {len(kept.rows)} reached")
        except KeyboardInterrupt:
            interrupted = True
    return [kept.rows[job] for job in campaign.jobs if job in kept.rows], interrupted


def _check(plan: TrialPlan) -> None:
    """A model that cannot be used is told before anything starts, not by a worker."""
    if not plan.true_masks:
        from core.learning.model_file import check_model

        check_model(plan.config.perception.segmentation.model)


def _results(campaign: Campaign, jobs: list[Job]) -> Iterator[Row]:
    if not jobs:
        return iter(())
    if campaign.scheduler is not None:
        return over_cluster(campaign.scheduler, partial(run_one, campaign.plan), jobs)
    if campaign.workers > 1:
        return over_processes(campaign.workers, partial(run_one, campaign.plan), jobs)
    return (run_one(campaign.plan, job) for job in jobs)


class _Opened(threading.local):
    """The perception of this thread, by its settings: loading the network takes over a second, and none serves two at once."""

    def __init__(self) -> None:
        self.pipelines: dict[str, tuple[Any, Any]] = {}


_opened = _Opened()


def run_one(plan: TrialPlan, job: Job) -> Row:
    """One trial in this thread."""
    from core.perception.pipeline import Pipeline, open_pipeline
    from core.study.accuracy import TrueMasks
    from hardware.twin.trial import Trial

    key = f"{plan.true_masks} {plan.config.perception.model_dump_json()}"
    pipelines = _opened.pipelines
    if key not in pipelines:
        masks = TrueMasks() if plan.true_masks else None
        pipelines[key] = open_pipeline(plan.config.perception) if masks is None else Pipeline(masks, plan.config.perception), masks
    pipeline, masks = pipelines[key]
    return Trial(plan, job[1], job[0], pipeline, masks).run()


def _tell(campaign: Campaign, rows: list[Row], as_json: bool) -> None:
    by_policy: dict[str, list[Row]] = {policy: [row for row in rows if row["policy"] == policy] for policy in campaign.policies}
    sums = {policy: summarise(own) for policy, own in by_policy.items()}
    if campaign.out is not None:
        from app.trial_report import write_report

        try:
            write_report(campaign.out, by_policy, campaign.plan)
        except OSError as error:
            raise TrialError(f"{campaign.out}: the report cannot be written ({error.strerror}); free some space") from None
    if as_json:
        for row in rows:
            sys.stdout.write(json.dumps({key: value for key, value in row.items() if key != "track"}, allow_nan=False) + "\n")
        last: dict[str, Any] = {"summary": {"policy": campaign.policies[0]} | sums[campaign.policies[0]]}
        if len(sums) > 1:
            last["by_policy"] = sums
        sys.stdout.write(json.dumps(last, allow_nan=False) + "\n")
        return
    from app.trial_report import print_tables

    print_tables(rows, sums)
    if campaign.out is not None:
        _console.print(f"report: {campaign.out / 'report.html'}", soft_wrap=True)
