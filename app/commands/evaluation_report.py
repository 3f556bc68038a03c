"""Tables of an evaluation, on the terminal and in ``report.html``."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.table import Table

from app.annotator.comparison import agreement_tables, between_words, report_words, within_words
from core.config.models import RESOURCES
from core.evaluation.metrics import RESAMPLES
from core.evaluation.paper import ANGLE_FIGURES, CLASS_SCORES, PAPER, STATE_FIGURES, FigureFormat, FigureKind, Verdict, verdict
from core.program import missing, program_line
from core.session.rehearsed_run import beside_line

_NAMED = 8
"""Figures that are not bettered are named up to this number; the tables have them all."""
_AVERAGES = {"macro": "Macro average", "weighted": "Weighted average"}


@dataclass(frozen=True, slots=True)
class Row:
    """One figure of the evaluation beside the paper's, as text."""

    label: str
    ours: str
    interval: str
    paper: str
    verdict: str


@dataclass(frozen=True, slots=True)
class ClassRow:
    """Precision, recall and F1 of a state or an average, ours and the paper's, as text; ``index`` is the state's own FM."""

    label: str
    n: str
    ours: tuple[str, ...]
    index: str
    paper: tuple[str, ...]
    is_average: bool


def comparison_rows(metrics: Mapping[str, Any], figures: Sequence[FigureKind]) -> list[Row]:
    """The given figures with their intervals, and the paper's where it has them."""
    rows = []
    for figure in figures:
        section, write = metrics[figure.section], figure.kind.write
        ours, interval = section[figure.name], section["ci95"][figure.name]
        paper = PAPER.get(figure.section, {}).get(figure.name)
        judged = verdict(figure.kind, figure.better, ours, paper)
        span = f"{write(interval[0], unit=False)} to {write(interval[1])}" if interval else "–"
        rows.append(Row(figure.label, write(ours), span, write(paper), judged.value if judged else ""))
    return rows


def class_rows(state: Mapping[str, Any]) -> list[ClassRow]:
    """The paper's table of states: one row per state that occurs, then both averages."""

    def texts(row: Mapping[str, Any] | None) -> tuple[str, ...]:
        return tuple(FigureFormat.RATIO.write(row[score] if row else None) for score in CLASS_SCORES)

    papers = PAPER["state"]
    rows = []
    for label, row in state["per_class"].items():
        index, paper = FigureFormat.RATIO.write(row["fowlkes_mallows"]), texts(papers["per_class"].get(label))
        rows.append(ClassRow(label, str(row["n"]), texts(row), index, paper, False))
    if rows:
        n = str(state["n"])
        rows += [ClassRow(words, n, texts(state[key]), "", texts(papers[key]), True) for key, words in _AVERAGES.items()]
    return rows


def print_tables(metrics: Mapping[str, Any]) -> None:
    """All figures on standard output, the paper's beside ours, then the notes."""
    console, judged = Console(markup=False, emoji=False), "against_paper" in metrics
    for title, figures, n in (("Angle", ANGLE_FIGURES, metrics["angle"]["n"]), ("State", STATE_FIGURES, metrics["state"]["n"])):
        table = _table(f"{title} (n = {n})", "here", "95 % interval", "paper", *(["verdict"] if judged else []))
        for row in comparison_rows(metrics, figures):
            table.add_row(row.label, row.ours, row.interval, row.paper, *([row.verdict] if judged else []))
        console.print(table, "")
    classes, state = class_rows(metrics["state"]), metrics["state"]
    if classes:
        table = _table("State", "n", "precision", "recall", "F1", "FM", "paper's P, R, F1")
        for each in classes:
            table.add_row(each.label, each.n, *each.ours, each.index, "  ".join(each.paper))
        counts = _table("manual \\ algorithm", *state["labels"])
        for label, numbers in zip(state["labels"], state["confusion"], strict=True):
            counts.add_row(label, *map(str, numbers))
        console.print(table, "", counts, "")
    if judged:
        console.print(summary_against_paper(metrics["against_paper"]), soft_wrap=True)
    for note in metrics["notes"]:
        console.print(f"note: {note}", soft_wrap=True, highlight=False)


def _table(first: str, *others: str) -> Table:
    """Without lines, so that the widest one fits into eighty columns."""
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column(first, no_wrap=True)
    for heading in others:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def summary_against_paper(verdicts: Mapping[str, str | None]) -> str:
    """How many of the paper's figures are bettered, and which are not."""
    rest = [f"{name} ({value or 'undefined'})" for name, value in verdicts.items() if value != Verdict.BETTER]
    better = f"{len(verdicts) - len(rest)} of the paper’s {len(verdicts)} figures are bettered"
    return f"{better}; not: {', '.join(rest)}." if 0 < len(rest) <= _NAMED else f"{better}."


def render_report(metrics: Mapping[str, Any], figures: Mapping[str, bytes]) -> str:
    """The report as one HTML page that needs nothing else, inside it the figures, which are SVG files."""
    source, angle, state = metrics["source"], metrics["angle"], metrics["state"]
    verdicts = metrics.get("against_paper")
    notes = [*([summary_against_paper(verdicts)] if verdicts else []), *metrics["notes"]]
    if session_notes := source.get("session", {}).get("notes"):
        notes.append(f"Notes on the session: {session_notes}")
    notes += [f"A run beside its rehearsal: {beside_line(run)}." for run in source.get("session", {}).get("rehearsals", ())]
    return render_page(
        "evaluation.html.j2",
        title=f"Evaluation of {source['name']}",
        lead=_lead(metrics),
        notes=notes,
        verdicts=bool(verdicts),
        angle_rows=_typeset(comparison_rows(metrics, ANGLE_FIGURES)),
        state_rows=_typeset(comparison_rows(metrics, STATE_FIGURES)),
        class_rows=class_rows(state),
        angle_caption=f"Angle between robot and vessel, algorithm against manual, n = {angle['n']}.",
        state_caption=f"Pose state, algorithm against manual, n = {state['n']}.",
        figures={name: inline_svg(file, name) for name, file in figures.items()},
        agreement=_agreement(metrics.get("agreement")),
        resamples=RESAMPLES,
        drawn=_drawn(metrics["intervals"]),
        seed=metrics["seed"],
    )


def agreement_page(report: Mapping[str, Any]) -> str:
    """The report of raters alone, as one HTML page."""
    return render_page(
        "agreement.html.j2",
        title=f"Raters of study {report['study']}" if report["study"] else "Raters, outside studies",
        lead=f"{report['annotations']} answers on {report['images']} images, {time.strftime('%Y-%m-%d', time.gmtime())}",
        notes=[words for words in (report_words(report), within_words(report), between_words(report)) if words],
        agreement=_agreement(report),
    )


def render_page(template: str, **values: Any) -> str:
    """One of ``resources/report`` filled in, without empty lines."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(loader=FileSystemLoader(RESOURCES / "report"), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    return re.sub(r"\n\s*\n+", "\n", environment.get_template(template).render(**values)) + "\n"


def _drawn(intervals: Mapping[str, Any]) -> str:
    """A sentence on the intervals: images of one group are alike."""
    groups = intervals["groups"]
    if intervals["drawn"] == "groups":
        return f"Whole groups (sessions or phantoms; {groups} of them) are drawn, since images of one are alike."
    if intervals["drawn"] == "nothing":
        return f"There are too few groups (sessions or phantoms; {groups}) for intervals, since images of one are alike."
    if groups:
        return "Images are taken as independent, each of another session or phantom."
    return "Images are taken as independent; where several show the same phantom, the true intervals are wider."


def _agreement(report: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """The raters against themselves and each other, as the template's tables."""
    if report is None:
        return []
    captions = {
        "First against second": "Each rater’s second measure of an image against their first.",
        "Rater against rater": " ".join(["Two raters’ first measures of the same images.", between_words(report)]).strip(),
    }
    return [
        {
            "title": title,
            "caption": captions[title],
            "columns": list(columns),
            "rows": [(quantity, [cells[quantity] for cells in columns.values()]) for quantity in next(iter(columns.values()))],
        }
        for title, columns in agreement_tables(report).items()
        if columns
    ]


def _typeset(rows: list[Row]) -> list[Row]:
    """With true minus signs."""

    def minus(text: str) -> str:
        return re.sub(r"-(?=\d)", "−", text)

    return [Row(row.label, minus(row.ours), minus(row.interval), minus(row.paper), row.verdict) for row in rows]


def _lead(metrics: Mapping[str, Any]) -> str:
    source, images = metrics["source"], metrics["images"]
    parts = [f"{source['kind'][0].upper()}{source['kind'][1:]}, {images['n']} images"]
    if images["unanswered"]:
        parts.append(f"{images['answered']} of {images['measured']} measured ones answered")
    if "model" in source:
        parts.append(f"model {source['model']}" + (f", preset {source['preset']}" if source["preset"] else ""))
    session = source.get("session", {})
    names = ("operator", "task", "condition", "phantom")
    parts += [f"{name} {session[name]}" for name in names if session.get(name)]
    parts += [f"LumenPilot {program_line()}", time.strftime("%Y-%m-%d", time.gmtime())]
    return " · ".join(parts)


def can_draw() -> bool:
    """Whether there can be figures; else says so on standard error."""
    if why := missing("matplotlib"):
        sys.stderr.write(f"no figures: {why}\n")
    return not why


def inline_svg(file: bytes, prefix: str) -> str:
    """A figure's SVG file as an ``<svg>`` element for HTML: no outside names, and ids of its own among other figures."""
    svg = file.decode()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", svg)  # HTML knows both name spaces by itself
    svg = re.sub(r'\sid="', rf"\g<0>{prefix}-", svg)
    svg = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{prefix}-", svg)
    return svg.strip()
