"""What a campaign of trials shows: tables on the terminal, and ``report.html`` with its figures inside."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from core.config import RESOURCES
from core.study.trial import worst
from hardware.twin.look_titles import BENCH_LOOK
from hardware.twin.trial import RANDOM_LOOK, TrialPlan

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

    from app.evaluation_figures import drawn
    from app.evaluation_report import inline_svg
    from app.trial_figures import draw_spreads, draw_track
    from core.study.trial import summarise

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
