"""Prints how well raters agree: a column for each rater with himself, and for each two raters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

_NONE = "\N{EN DASH}"
_COLUMNS = 5
"""So many raters or pairs fit beside each other into eighty columns."""


def print_agreement(report: Mapping[str, Any], *, within: bool = True) -> None:
    """Tables on standard output: first against second measure, then rater against rater, then all together.

    Without `within` the SD of one manual measure is left to another table.
    """
    console = Console(markup=False, emoji=False)
    name = f"Study {report['study']}" if report["study"] else "Annotations outside studies"
    console.print(f"{name}: {report['annotations']} answers on {report['images']} images", "", sep="\n", highlight=False)
    for title, columns in agreement_tables(report).items():
        _print(console, title, columns)
    for words in (within_words(report) if within else "", between_words(report)):
        if words:
            console.print(words, highlight=False)


def agreement_tables(report: Mapping[str, Any]) -> dict[str, dict[str, dict[str, str]]]:
    """By title: by column (a rater, two raters) the quantities as text."""
    pairs = {f"{row['first']}, {row['second']}": _compared(row) for row in report["pairs"]}
    raters = {rater: _of_rater(row) | _compared(row) for rater, row in report["raters"].items()}
    return {"First against second": raters, "Rater against rater": pairs}


def within_words(report: Mapping[str, Any]) -> str:
    """What one measure is uncertain by, over all raters, in one line; empty where nobody measured an image twice."""
    within = report["within"]
    if not within["n"]:
        return ""
    span = f" (95 % interval {_number(within['ci95'][0], 2)} to {_number(within['ci95'][1], 2)}°)" if within["ci95"] else ""
    return f"SD of one manual measure, over all repeats of {within['n']} images: {_degrees(within['sd_deg'])}{span}"


def between_words(report: Mapping[str, Any]) -> str:
    """All raters together in one line; empty when there is only one."""
    both = report["between"]
    if not both["n"]:
        return ""
    spread = f"SD about an image's mean {_degrees(both['sd_deg'])}, ICC(2,1) {_number(both['icc'], 3)}"
    return f"All {both['raters']} raters on {both['n']} images: {spread}"


def _print(console: Console, title: str, columns: Mapping[str, Mapping[str, str]]) -> None:
    names = list(columns)
    for first in range(0, len(names), _COLUMNS):
        shown = names[first : first + _COLUMNS]
        table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
        table.add_column(title, no_wrap=True)
        for name in shown:
            table.add_column(name, justify="right")
        for quantity in columns[shown[0]]:
            table.add_row(quantity, *(columns[name][quantity] for name in shown))
        console.print(table, "", sep="\n", highlight=False)


def _of_rater(row: Mapping[str, Any]) -> dict[str, str]:
    return {
        "Answers": str(row["annotations"]),
        "of these can't tell": str(row["cannot_tell"]),
        "Median time an image": f"{_number(row['median_time_s'], 0)} s",
        "SD within an image": _degrees(row["sd_deg"]),
    }


def _compared(row: Mapping[str, Any]) -> dict[str, str]:
    angle, state = row["angle"], row["state"]
    return {
        "Images with two angles": str(angle["n"]),
        "Mean difference": _degrees(angle["mean_difference_deg"]),
        "Lower limit of agreement": _degrees(angle["loa_low_deg"]),
        "Upper limit of agreement": _degrees(angle["loa_high_deg"]),
        "ICC(2,1)": _number(angle["icc"], 3),
        "Images with two states": str(state["n"]),
        "Equal states": _NONE if state["equal"] is None else f"{state['equal']:.0%}",
        "Cohen’s kappa": _number(state["kappa"], 3),
        "Only one can’t tell": str(state["one_cannot_tell"]),
        "Neither can tell": str(state["neither_can_tell"]),
    }


def _degrees(value: float | None) -> str:
    return _NONE if value is None else f"{_number(value, 2)}°"


def _number(value: float | None, digits: int) -> str:
    return _NONE if value is None else f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")
