"""``trial``: closed-loop campaigns in the twin, over processes or a Dask cluster; they can be interrupted and gone on with.

The folder of a campaign of trials: what was run with which settings, row by row as it is done.

What a campaign of trials shows: tables on the terminal, and ``report.html`` with its figures inside.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

from rich.console import Console
from rich.table import Table

from app.commands.progress import progress_bar
from app.commands.workers import over_cluster, over_processes
from core.config.models import RESOURCES, PolicyName, choose_model, load_config
from core.control.policies import POLICY_NAMES
from core.devices import UserError
from core.evaluation.trial import Row, TrialLog, summarise, trial_row, worst
from core.files import write_whole
from hardware.twin.catalog import BENCH_LOOK
from hardware.twin.trial import RANDOM_LOOK, TRIAL_LOOKS, TrialPlan

Job = tuple[PolicyName, int]
"""A policy and a seed."""
_KEYS = trial_row(TrialLog(), seed=0, policy="", phantom="", outcome="", way_mm=0.0, target_mm=(0.0, 0.0)).keys()
"""What every row has, whatever came of its trial."""


class TrialError(UserError):
    """The campaign cannot be run; the message is one line and says what to do."""


class KeptTrials:
    """The rows so far of these jobs, in ``trials.jsonl`` of the campaign's folder (if it has one)."""

    def __init__(self, out: Path | None, plan: TrialPlan, jobs: Iterable[Job]) -> None:
        self.rows: dict[Job, Row] = {}
        self._wanted = set(jobs)
        self._file: Path | None = None
        if out is not None:
            self._file = out / "trials.jsonl"
            self._open(out, plan)

    def add(self, row: Row) -> None:
        """Take in a row and write it at once. Raises TrialError."""
        self.rows[row["policy"], row["seed"]] = row
        if self._file is None:
            return
        try:
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(row, allow_nan=False) + "\n")
        except OSError as error:
            raise TrialError(f"{self._file}: cannot be written ({error.strerror}); free some space and go on") from None

    def _open(self, out: Path, plan: TrialPlan) -> None:
        described, path = _described(plan), out / "plan.json"
        try:
            out.mkdir(parents=True, exist_ok=True)
            if not path.is_file():
                write_whole(path, f"{json.dumps(described, indent=1)}\n".encode())
            elif json.loads(path.read_text(encoding="utf-8")) != described:
                raise TrialError(f"{out}: holds trials with other settings ({path.name}); choose another --out")
            self._read()
        except OSError as error:
            raise TrialError(f"{out}: cannot be used ({error.strerror}); choose another --out") from None
        except (ValueError, KeyError, TypeError, AttributeError):
            raise TrialError(f"{out}: plan.json or trials.jsonl is damaged; choose another --out") from None

    def _read(self) -> None:
        """Take over what is there; a last line that was cut off by a crash is dropped from the file."""
        assert self._file is not None
        if not self._file.is_file():
            return
        text = self._file.read_text(encoding="utf-8")
        if text and not text.endswith("\n"):
            text = text[: text.rfind("\n") + 1]
            write_whole(self._file, text.encode())
        for line in text.splitlines():
            row = json.loads(line)
            if not row.keys() >= _KEYS:
                raise KeyError
            if (row["policy"], row["seed"]) in self._wanted:
                self.rows[row["policy"], row["seed"]] = row


def _described(plan: TrialPlan) -> dict[str, Any]:
    """All that decides the result of a trial, apart from policy and seed."""
    settings = plan.config.model_dump(mode="json", exclude={"window", "rig", "servos"})
    settings["perception"]["segmentation"].pop("threads")
    settings["policy"].pop("name")
    settings["twin"].pop("phantom")
    settings["twin"].pop("appearance_seed")
    settings["twin"].pop("look")
    weights = None
    if not plan.true_masks:
        from core.perception.model_file import model_folder, read_model_info

        info = read_model_info(model_folder(plan.config.perception.segmentation.model), verify=())
        # What was measured of it decides nothing.
        weights = hashlib.sha256(info.model_dump_json(exclude={"figures"}).encode()).hexdigest()
    return {
        "true_masks": plan.true_masks,
        "max_seconds": plan.max_seconds,
        "look": plan.look,
        "model_sha256": weights,
        "config": settings,
    }


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
        from core.perception.model_file import check_model

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
    from core.evaluation.accuracy import TrueMasks
    from core.perception.pipeline import Pipeline, open_pipeline
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

    print_tables(rows, sums)
    if campaign.out is not None:
        _console.print(f"report: {campaign.out / 'report.html'}", soft_wrap=True)


Rows = Sequence[Mapping[str, Any]]
_WORST = 6


@dataclass(frozen=True, slots=True)
class _Figure:
    """A figure of the summary: how it is called and written, and what it should be."""

    name: str
    label: str
    write: Callable[[float], str]
    aim: str = ""
    met: Callable[[float], bool] | None = None


def _percent(value: float) -> str:
    return f"{100.0 * value:.0f} %"


def _newton(value: float) -> str:
    return f"{value:.3f} N"


def _plain(value: float) -> str:
    return f"{value:.3g}"


FIGURES = (
    _Figure("trials", "Trials", lambda v: f"{v:.0f}"),
    _Figure("reached_share", "Target reached", _percent, "≥ 95 %", lambda v: v >= 0.95),
    _Figure("unaided_share", "Reached without help", _percent),
    _Figure("wall_force_p95_n", "Wall contact force, p95", _newton, "≤ 0.15 N", lambda v: v <= 0.15),
    _Figure("wall_force_median_n", "Wall contact force, median", _newton),
    _Figure("wall_force_max_n", "Wall contact force, largest", _newton, "≤ 0.5 N", lambda v: v <= 0.5),
    _Figure("mean_offset_ratio", "Distance to centerline over lumen radius, mean", _plain, "≤ 0.25", lambda v: v <= 0.25),
    _Figure("median_offset_ratio", "The same, median", _plain),
    _Figure("median_path_ratio", "Path over route, median", _plain),
    _Figure("mean_time_s", "Time to the target, mean", lambda v: f"{v:.1f} s"),
    _Figure("median_time_s", "Time to the target, median", lambda v: f"{v:.1f} s"),
    _Figure("mean_interventions", "Interventions per trial", _plain),
    _Figure("answered_share", "Frames with a pose", _percent),
    _Figure("theta_error_median_deg", "Error of theta, median", lambda v: f"{v:.2f}°"),
    _Figure("head_error_median_px", "Error of the head, median", lambda v: f"{v:.2f} px"),
)


@dataclass(frozen=True, slots=True)
class SummaryRow:
    """A line of the summary: one cell per policy as (text, verdict), the verdict being "met", "missed" or ""."""

    label: str
    aim: str
    cells: tuple[tuple[str, str], ...]


def summary_rows(sums: Mapping[str, Mapping[str, Any]]) -> list[SummaryRow]:
    """The figures of all policies side by side; "–" where there is nothing to tell."""
    rows = []
    for figure in FIGURES:
        cells = []
        for own in sums.values():
            value = own[figure.name]
            verdict = "" if value is None or figure.met is None else "met" if figure.met(value) else "missed"
            cells.append(("–" if value is None else figure.write(value), verdict))
        rows.append(SummaryRow(figure.label, figure.aim, tuple(cells)))
    return rows


def trial_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """A trial as text: policy, seed, outcome, time, path ratio, offset, force p95 and largest, interventions."""
    force = row["wall_contact_n"] or {}
    return (
        row["policy"],
        str(row["seed"]),
        row["outcome"],
        f"{row['time_s']:.1f} s",
        _or_dash(row["path_ratio"]),
        _or_dash(row["offset_ratio"]),
        _or_dash(force.get("p95")),
        _or_dash(force.get("max")),
        str(row["interventions"]),
    )


HEADINGS = ("policy", "seed", "outcome", "time", "path", "offset", "p95 N", "max N", "help")


def _or_dash(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def print_tables(rows: Rows, sums: Mapping[str, Mapping[str, Any]]) -> None:
    """Every trial, then the sums, on standard output."""
    console = Console(markup=False, emoji=False)
    trials = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    for heading in HEADINGS:
        trials.add_column(heading, no_wrap=True)
    for row in rows:
        trials.add_row(*trial_cells(row))
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column("")
    for policy in sums:
        table.add_column(policy, justify="right", no_wrap=True)
    table.add_column("target", justify="right", no_wrap=True)
    for line in summary_rows(sums):
        table.add_row(line.label, *(f"{text} {'✗' if verdict == 'missed' else ' '}" for text, verdict in line.cells), line.aim)
    console.print(trials, "", table)


def write_report(out: Path, by_policy: Mapping[str, Rows], plan: TrialPlan) -> None:
    """``report.html`` and ``summary.json`` in `out`; raises OSError."""
    import json

    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    from app.commands.evaluation_report import inline_svg
    from app.commands.figures import draw_spreads, draw_track, drawn
    from core.evaluation.trial import summarise

    sums = {policy: summarise(rows) for policy, rows in by_policy.items()}
    everything = [row for rows in by_policy.values() for row in rows]
    lowest = worst(everything, _WORST)
    environment = Environment(loader=FileSystemLoader(RESOURCES / "report"), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    looks = {RANDOM_LOOK: "random looks", BENCH_LOOK: "the default look"}.get(plan.look, f"looks: {plan.look}")
    seen = "true masks instead of the network" if plan.true_masks else f"model {plan.config.perception.segmentation.model}"
    text = environment.get_template("trial.html.j2").render(
        title="Closed-loop trials in the bench twin",
        lead=f"{len(everything)} trials · {looks} · {seen} · {time.strftime('%Y-%m-%d', time.gmtime())}",
        policies=list(sums),
        summary=summary_rows(sums),
        spreads=inline_svg(drawn(draw_spreads(by_policy), ".svg"), "spreads") if everything else "",
        tracks=[
            (trial_cells(row), inline_svg(drawn(draw_track(row), ".svg"), f"track{place}")) for place, row in enumerate(lowest)
        ],
        headings=HEADINGS,
        trials=[trial_cells(row) for row in everything],
    )
    (out / "report.html").write_text(re.sub(r"\n\s*\n+", "\n", text) + "\n", encoding="utf-8")
    (out / "summary.json").write_text(json.dumps(sums, indent=1, allow_nan=False) + "\n", encoding="utf-8")
