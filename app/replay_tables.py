"""What ``replay`` prints: frames before and after in sum, the table of states, and the frames that changed most."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.wording import signed_degrees
from core.study.replay import Change, Seen, changed_most, runs
from core.study.replay_tally import STATES

_MOST_RUNS = 20
_DASH = "\N{EN DASH}"


def print_replay(result: dict[str, Any], changes: Sequence[Change], *, with_diff: bool, count: int) -> None:
    """On standard output."""
    console = Console(markup=False, emoji=False)
    console.print(_sums(result))
    console.print(_states(result["states"]["matrix"]))
    if with_diff:
        console.print(_frames(changed_most(changes, count), count))
        _print_runs(console, changes)


def print_replays(results: Sequence[dict[str, Any]], total: dict[str, Any], worst: Sequence[tuple[str, Change]] | None) -> None:
    """Of many sessions, and of all of them in sum, on standard output. `worst`: frames that changed most, by session."""
    console = Console(markup=False, emoji=False)
    console.print(_sessions(results))
    console.print(_sums(total))
    console.print(_states(total["states"]["matrix"]))
    if worst is not None:
        console.print(_frames([change for _, change in worst], len(worst), [name for name, _ in worst]))


def _sessions(results: Sequence[dict[str, Any]]) -> Table:
    table = Table(title=f"{len(results)} session{'s' if len(results) > 1 else ''} perceived again")
    table.add_column("session", overflow="fold")
    for heading in ("frames", "|theta change| median (°)", "p95", "state changed", "pose lost", "gained"):
        table.add_column(heading, justify="right")
    for result in results:
        theta, refusals = result["theta_change_deg"], result["refusals"]
        table.add_row(
            Path(result["session"]).name,
            str(result["frames"]),
            *(_DASH if theta[key] is None else f"{theta[key]:.2f}" for key in ("median", "p95")),
            str(result["states"]["changed"]),
            str(sum(refusals["gained"].values())),
            str(sum(refusals["lost"].values())),
        )
    return table


def _sums(result: dict[str, Any]) -> Table:
    table = Table(title=f"{result['frames']} frames perceived again, {result['ended']}", show_header=True)
    table.add_column("")
    for heading in ("mean", "median", "p95", "max", "frames"):
        table.add_column(heading, justify="right")
    latency = result["latency_ms"]
    for name, spread, digits in (
        ("|theta change| (°)", result["theta_change_deg"], 2),
        ("head shift (source px)", result["head_shift_px"], 2),
        ("latency before (ms)", latency["before"], 1),
        ("latency after (ms)", latency["after"], 1),
    ):
        numbers = (spread[key] for key in ("mean", "median", "p95", "max"))
        table.add_row(name, *(_DASH if value is None else f"{value:.{digits}f}" for value in numbers), str(spread["n"]))
    table.add_section()
    refusals, confidence = result["refusals"], result["confidence"]
    table.add_row("state changed", *[""] * 4, str(result["states"]["changed"]))
    table.add_row(f"pose lost{_reasons(refusals['gained'])}", *[""] * 4, str(sum(refusals["gained"].values())))
    table.add_row(f"pose gained{_reasons(refusals['lost'])}", *[""] * 4, str(sum(refusals["lost"].values())))
    for name in ("before", "after"):
        value = confidence[name]
        table.add_row(f"confidence {name}", "", _DASH if value is None else f"{value:.3f}", "", "", "")
    return table


def _reasons(counts: dict[str, int]) -> str:
    return f" ({', '.join(f'{reason} {count}' for reason, count in counts.items())})" if counts else ""


def _states(matrix: list[list[int]]) -> Table:
    table = Table(title='States: rows before, columns after, "-" no pose')
    table.add_column("before")
    for label in STATES:
        table.add_column(label, justify="right")
    for k, label in enumerate(STATES):
        cells = (Text(str(count), style="bold" if place == k else "") for place, count in enumerate(matrix[k]))
        table.add_row(label, *cells)
    return table


def _frames(worst: Sequence[Change], count: int, sessions: Sequence[str] | None = None) -> Table:
    title = f"The {len(worst)} frames that changed most" if len(worst) == count else f"The {len(worst)} frames that changed"
    table = Table(title=title if worst else "No frame changed")
    if sessions is not None:
        table.add_column("session", overflow="fold")
    for heading, is_number in (
        ("row", True),
        ("time (s)", True),
        ("theta before", True),
        ("after", True),
        ("change", True),
        ("head shift (px)", True),
        ("state", False),
        ("reason", False),
    ):
        table.add_column(heading, justify="right" if is_number else "left")
    for place, change in enumerate(worst):
        told_by = change.before if change.before.reason is not None else change.after
        table.add_row(
            *([] if sessions is None else [sessions[place]]),
            str(change.row),
            f"{change.time_s:.3f}",
            _theta(change.before),
            _theta(change.after),
            _DASH if change.theta_deg is None else signed_degrees(change.theta_deg, 1),
            _DASH if change.head_px is None else f"{change.head_px:.1f}",
            f"{change.before.state or '-'} \N{RIGHTWARDS ARROW} {change.after.state or '-'}",
            f"{change.kind}: {told_by.reason.value}" if told_by.reason is not None else "",
        )
    return table


def _theta(side: Seen) -> str:
    return _DASH if side.theta_signed_deg is None else signed_degrees(side.theta_signed_deg, 1)


def _print_runs(console: Console, changes: Sequence[Change]) -> None:
    found = runs(changes)
    for run in found[:_MOST_RUNS]:
        rows = f"row {run.first}" if run.frames == 1 else f"rows {run.first} to {run.last}"
        console.print(f"{run.kind} at {rows}: {run.reason}", soft_wrap=True)
    if len(found) > _MOST_RUNS:
        console.print(f"and {len(found) - _MOST_RUNS} more places where a pose was lost or gained", soft_wrap=True)
