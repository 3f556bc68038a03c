"""``trial``: closed-loop campaigns in the twin, over processes or a Dask cluster; kept row by row, so that they can go on."""

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
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from app.commands.options import BenchOption, ConfigOption, ModelOption, SchedulerOption, check_masks
from app.commands.progress import console, progress_bar
from app.commands.workers import over_cluster, over_processes
from core.config.models import POLICIES, choose_model, load_config
from core.config.rig_file import find_rig, read_rig
from core.devices import UserError, disk_errors
from core.evaluation.trial import Row, TrialLog, summarise, trial_row, worst
from core.files import write_atomic
from core.program import program_line
from hardware.twin.catalog import BENCH_LOOK, RANDOM_LOOK, TRIAL_LOOKS
from hardware.twin.phantom import own_file

if TYPE_CHECKING:
    from hardware.twin.trial import TrialPlan

Job = tuple[str, int]
"""A policy and a seed."""
Rows = Sequence[Mapping[str, Any]]
_KEYS = trial_row(TrialLog(), seed=0, policy="", phantom="", outcome="", way_mm=0.0, target_mm=(0.0, 0.0)).keys()
"""What every row has, whatever came of its trial."""
_MAX_SEEDS = 100_000
_WORST = 6
"""Trials whose track is drawn in the report."""
HEADINGS = ("policy", "seed", "outcome", "time", "path", "offset", "p95 N", "max N", "help")


class TrialError(UserError):
    """The campaign cannot be run; the message is one line and says what to do."""


def trial(
    seeds: Annotated[str, typer.Option(help="A:B, phantoms, looks, robots and targets A to B - 1")],
    policy: Annotated[
        list[str] | None,
        typer.Option(help="pursuit, table, push, random or a plugin's; may be repeated to compare; default: the configured one"),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes")] = 1,
    as_json: Annotated[
        bool, typer.Option("--json", help="one JSON object per trial, then the summary, on standard output")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="folder for trials.jsonl and report.html; trials already there are kept")] = None,
    true_masks: Annotated[bool, typer.Option("--true-masks", help="the twin's own masks instead of the network's")] = False,
    max_seconds: Annotated[float, typer.Option(min=1.0, max=3600.0, help="simulated time after which a trial has failed")] = 120.0,
    look: Annotated[
        str,
        typer.Option(
            help="random: every trial another picture; bench: the clear one; own: your bench's picture; or a family, as in synth"
        ),
    ] = "random",
    rig: Annotated[
        str | None, typer.Option(help="rig file, by name or path: the robot has its joints (resources/rigs has examples)")
    ] = None,
    bench: BenchOption = None,
    scheduler: SchedulerOption = None,
    no_wall_force: Annotated[bool, typer.Option("--no-wall-force", hidden=True, help="policies are never told it")] = True,
    model: ModelOption = None,
    config_path: ConfigOption = None,
) -> None:
    """Closed-loop trials in the bench twin: a policy drives the robot to a target that it has never seen."""
    from hardware.twin.trial import TrialPlan

    check_masks(model, true_masks=true_masks)
    overrides = choose_model(model)
    config = load_config(config_path, None, overrides)
    policies = parse_policies(policy or [config.policy.name])
    if workers > 1 or scheduler is not None:  # one thread each: workers must not fight for the cores
        overrides.setdefault("perception", {}).setdefault("segmentation", {})["threads"] = 1
        config = load_config(config_path, None, overrides)
    if rig is not None:
        shape = read_rig(Path(rig)) if rig.endswith(".toml") else find_rig(rig)[1]
        config = config.model_copy(update={"servos": shape.servos})
    if look not in TRIAL_LOOKS:
        raise TrialError(f"unknown look {look!r}; known: {', '.join(TRIAL_LOOKS)}")
    if bench is not None:
        from hardware.twin.own_phantom import with_own_phantom

        config = with_own_phantom(config, bench)
    plan = TrialPlan(config, true_masks, max_seconds, look, bench is not None)
    # All policies meet a seed one after the other, so that a part of a campaign can already be compared.
    jobs: list[Job] = [(name, seed) for seed in parse_seeds(seeds) for name in policies]
    rows, interrupted = _run(plan, jobs, out, workers, scheduler)
    by_policy: dict[str, list[Row]] = {name: [row for row in rows if row["policy"] == name] for name in policies}
    if out is not None:
        with disk_errors(TrialError, out, "the report cannot be written", "; free some space"):
            write_report(out, by_policy, plan)
    sums = {name: summarise(own) for name, own in by_policy.items()}
    if as_json:
        for row in rows:
            sys.stdout.write(json.dumps({key: value for key, value in row.items() if key != "track"}, allow_nan=False) + "\n")
        last: dict[str, Any] = {"summary": {"policy": policies[0]} | sums[policies[0]]}
        if len(sums) > 1:
            last["by_policy"] = sums
        sys.stdout.write(json.dumps(last, allow_nan=False) + "\n")
    else:
        print_tables(rows, sums)
        if out is not None:
            console.print(f"report: {out / 'report.html'}", soft_wrap=True)
    if interrupted:
        kept = f"kept in {out}; the same command goes on" if out is not None else "give --out to keep and go on with a campaign"
        console.print(f"{len(rows)} of {len(jobs)} trials were done: {kept}", soft_wrap=True)
        raise KeyboardInterrupt


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


def parse_policies(names: Sequence[str]) -> tuple[str, ...]:
    """Known names, each once, in order. Raises TrialError."""
    for name in names:
        if name not in POLICIES.names:
            raise TrialError(f"unknown policy {name!r}; known: {', '.join(POLICIES.names)}")
    return tuple(dict.fromkeys(names))


class KeptTrials:
    """The rows so far of these jobs, in ``trials.jsonl`` of the campaign's folder (if it has one)."""

    def __init__(self, out: Path | None, plan: TrialPlan, jobs: Iterable[Job]) -> None:
        self.rows: dict[Job, Row] = {}
        self._wanted = set(jobs)
        self._file = out / "trials.jsonl" if out is not None else None
        if out is not None:
            self._open(out, plan)

    def add(self, row: Row) -> None:
        """Add a row and write it at once. Raises TrialError."""
        self.rows[row["policy"], row["seed"]] = row
        if self._file is None:
            return
        with disk_errors(TrialError, self._file, "cannot be written", "; free some space and go on"):
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(row, allow_nan=False) + "\n")

    def _open(self, out: Path, plan: TrialPlan) -> None:
        described, path = _described(plan), out / "plan.json"
        try:
            out.mkdir(parents=True, exist_ok=True)
            if not path.is_file():
                write_atomic(path, f"{json.dumps(described, indent=1)}\n".encode())
            elif json.loads(path.read_text(encoding="utf-8")) != described:
                raise TrialError(f"{out}: holds trials with other settings ({path.name}); choose another --out")
            self._read()
        except OSError as error:
            raise TrialError(f"{out}: cannot be used ({error.strerror}); choose another --out") from None
        except (ValueError, KeyError, TypeError, AttributeError):
            raise TrialError(f"{out}: plan.json or trials.jsonl is damaged; choose another --out") from None

    def _read(self) -> None:
        """Read the rows that are there; a last line that was cut off by a crash is dropped from the file."""
        assert self._file is not None
        if not self._file.is_file():
            return
        text = self._file.read_text(encoding="utf-8")
        if text and not text.endswith("\n"):
            text = text[: text.rfind("\n") + 1]
            write_atomic(self._file, text.encode())
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
    for key in ("phantom", "appearance_seed", "look"):
        settings["twin"].pop(key)
    model_sha256 = None
    if not plan.true_masks:
        from core.perception.model_file import model_folder, read_model_info

        info = read_model_info(model_folder(plan.config.perception.segmentation.model), verify=())
        model_sha256 = hashlib.sha256(info.model_dump_json(exclude={"figures"}).encode()).hexdigest()
    described: dict[str, Any] = {"true_masks": plan.true_masks, "max_seconds": plan.max_seconds, "look": plan.look}
    if plan.own and (file := own_file(plan.config.twin.phantom)) is not None:
        described["own_phantom"] = hashlib.sha256(file.read_bytes()).hexdigest()
    if not plan.config.servos.is_default:
        described["joints"] = [joint.model_dump(mode="json") for joint in plan.config.servos.joints]
    return described | {"model_sha256": model_sha256, "config": settings}


def _run(plan: TrialPlan, jobs: list[Job], out: Path | None, workers: int, scheduler: str | None) -> tuple[list[Row], bool]:
    """The rows of the campaign in the order of its jobs, and whether it was interrupted."""
    if not plan.true_masks:
        from core.perception.model_file import check_model

        check_model(plan.config.perception.segmentation.model)  # refused here, not by a worker
    kept = KeptTrials(out, plan, jobs)
    missing = [job for job in jobs if job not in kept.rows]
    results: Iterator[Row] = (run_one(plan, job) for job in missing)
    if missing and scheduler is not None:
        results = over_cluster(scheduler, partial(run_one, plan), missing)
    elif missing and workers > 1:
        results = over_processes(workers, partial(run_one, plan), missing)
    interrupted = False
    with progress_bar() as bar:
        task = bar.add_task("trials", total=len(jobs), completed=len(jobs) - len(missing))
        try:
            for row in results:
                kept.add(row)
                reached = sum(bool(r["reached"]) for r in kept.rows.values())
                bar.update(task, advance=1, description=f"trials, {reached} of {len(kept.rows)} reached")
        except KeyboardInterrupt:
            interrupted = True
    return [kept.rows[job] for job in jobs if job in kept.rows], interrupted


class _Pipelines(threading.local):
    """Pipelines of this thread by their settings: loading the network takes over a second, and none serves two threads at once."""

    def __init__(self) -> None:
        self.by_settings: dict[str, tuple[Any, Any]] = {}


_pipelines = _Pipelines()


def run_one(plan: TrialPlan, job: Job) -> Row:
    from core.evaluation.accuracy import TrueMasks
    from core.perception.pipeline import Pipeline, open_pipeline
    from hardware.twin.trial import Trial

    opened, key = _pipelines.by_settings, f"{plan.true_masks} {plan.config.perception.model_dump_json()}"
    if key not in opened:
        masks = TrueMasks() if plan.true_masks else None
        opened[key] = open_pipeline(plan.config.perception) if masks is None else Pipeline(masks, plan.config.perception), masks
    pipeline, masks = opened[key]
    return Trial(plan, job[1], job[0], pipeline, masks).run()


@dataclass(frozen=True, slots=True)
class _SummaryFigure:
    """A figure of the summary: its key, label and format, and what it should be."""

    name: str
    label: str
    format: Callable[[float], str]
    aim: str = ""
    met: Callable[[float], bool] | None = None


def _percent(value: float) -> str:
    return f"{100.0 * value:.0f} %"


_NEWTON, _PLAIN, _SECONDS, _WHOLE = "{:.3f} N".format, "{:.3g}".format, "{:.1f} s".format, "{:.0f}".format
FIGURES = (
    _SummaryFigure("trials", "Trials", _WHOLE),
    _SummaryFigure("reached_share", "Target reached", _percent, "≥ 95 %", lambda v: v >= 0.95),
    _SummaryFigure("unaided_share", "Reached without help", _percent),
    _SummaryFigure("wall_force_p95_n", "Wall contact force, p95", _NEWTON, "≤ 0.15 N", lambda v: v <= 0.15),
    _SummaryFigure("wall_force_median_n", "Wall contact force, median", _NEWTON),
    _SummaryFigure("wall_force_max_n", "Wall contact force, largest", _NEWTON, "≤ 0.5 N", lambda v: v <= 0.5),
    _SummaryFigure("mean_offset_ratio", "Distance to centerline over lumen radius, mean", _PLAIN, "≤ 0.25", lambda v: v <= 0.25),
    _SummaryFigure("median_offset_ratio", "The same, median", _PLAIN),
    _SummaryFigure("median_path_ratio", "Path over route, median", _PLAIN),
    _SummaryFigure("mean_time_s", "Time to the target, mean", _SECONDS),
    _SummaryFigure("median_time_s", "Time to the target, median", _SECONDS),
    _SummaryFigure("mean_interventions", "Interventions per trial", _PLAIN),
    _SummaryFigure("answered_share", "Frames with a pose", _percent),
    _SummaryFigure("theta_error_median_deg", "Error of theta, median", "{:.2f}°".format),
    _SummaryFigure("head_error_median_px", "Error of the head, median", "{:.2f} px".format),
)


@dataclass(frozen=True, slots=True)
class SummaryRow:
    """A line of the summary: one cell per policy as (text, verdict), the verdict being "met", "missed" or ""."""

    label: str
    aim: str
    cells: tuple[tuple[str, str], ...]


def summary_rows(sums: Mapping[str, Mapping[str, Any]]) -> list[SummaryRow]:
    """The figures of all policies side by side; "–" where one has no value."""
    rows = []
    for figure in FIGURES:
        cells = []
        for own in sums.values():
            value = own[figure.name]
            verdict = "" if value is None or figure.met is None else "met" if figure.met(value) else "missed"
            cells.append(("–" if value is None else figure.format(value), verdict))
        rows.append(SummaryRow(figure.label, figure.aim, tuple(cells)))
    return rows


def trial_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """A trial as text, under ``HEADINGS``."""
    force = row["wall_contact_n"] or {}
    ratios = (row["path_ratio"], row["offset_ratio"], force.get("p95"), force.get("max"))
    shown = ("–" if value is None else f"{value:.2f}" for value in ratios)
    return row["policy"], str(row["seed"]), row["outcome"], f"{row['time_s']:.1f} s", *shown, str(row["interventions"])


def print_tables(rows: Rows, sums: Mapping[str, Mapping[str, Any]]) -> None:
    """Every trial, then the sums, on standard output."""
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
    Console(markup=False, emoji=False).print(trials, "", table)


def write_report(out: Path, by_policy: Mapping[str, Rows], plan: TrialPlan) -> None:
    """``report.html`` and ``summary.json`` in `out`; raises OSError."""
    from app.commands.evaluation_report import can_draw, inline_svg, render_page

    spreads, tracks = "", []
    sums = {policy: summarise(rows) for policy, rows in by_policy.items()}
    everything = [row for rows in by_policy.values() for row in rows]
    looks = {RANDOM_LOOK: "random looks", BENCH_LOOK: "the default look"}.get(plan.look, f"looks: {plan.look}")
    seen = "true masks instead of the network" if plan.true_masks else f"model {plan.config.perception.segmentation.model}"
    made = f"LumenPilot {program_line()} · {time.strftime('%Y-%m-%d', time.gmtime())}"
    if everything and can_draw():
        from app.commands.figures import draw_spreads, draw_track, drawn

        spreads = inline_svg(drawn(draw_spreads(by_policy), ".svg"), "spreads")
        for place, row in enumerate(worst(everything, _WORST)):
            tracks.append((trial_cells(row), inline_svg(drawn(draw_track(row), ".svg"), f"track{place}")))
    text = render_page(
        "trial.html.j2",
        title="Closed-loop trials in the bench twin",
        lead=f"{len(everything)} trials · {looks} · {seen} · {made}",
        policies=list(sums),
        summary=summary_rows(sums),
        spreads=spreads,
        tracks=tracks,
        headings=HEADINGS,
        trials=[trial_cells(row) for row in everything],
    )
    (out / "report.html").write_text(text, encoding="utf-8")
    (out / "summary.json").write_text(json.dumps(sums, indent=1, allow_nan=False) + "\n", encoding="utf-8")
