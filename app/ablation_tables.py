"""The tables of ``ablation`` on screen and in Markdown, from its result (the same object that ``--json`` prints)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.table import Table

from core.study.ablation_figures import MEASURES, Figure, Measure
from core.study.ablation_stream import JUMP_PX

_MINUS = "\N{MINUS SIGN}"
_CUMULATIVE, _WITHOUT = "each step added to the ones above", "ours without one step"
_STREAM_COLUMNS = (
    ("frames", "frames"),
    ("answered_share", "answered"),
    ("state_agreement", "state agrees"),
    ("theta_median_deg", "theta median, deg"),
    ("theta_mean_deg", "theta mean, deg"),
    ("head_median_px", "head median, px"),
    ("wrong_share", "wrong"),
    ("swapped_frames", "head-tail swaps"),
    ("jumps", f"jumps > {JUMP_PX:.0f} px"),
    ("theta_lag_frames", "theta lag, frames"),
    ("theta_jitter_deg", "theta jitter, deg"),
    ("head_jitter_px", "head jitter, px"),
    ("state_changes", "state changes"),
    ("true_state_changes", "true changes"),
)


def value_table(result: dict[str, Any]) -> Table:
    """One row per variant, one column per measure."""
    table = Table(title=_title(result), caption=None if not result.get("interrupted") else "interrupted: not all frames of the set")
    for title in _headings():
        table.add_column(title, justify="left" if title == "variant" else "right", no_wrap=title == "variant")
    for row, cells in _with_cells(result, lambda figure, measure: _number(figure.value, measure)):
        table.add_row(row["name"], *cells, f"{row['after_network_ms']:.1f}" if "after_network_ms" in row else "-")
        if _ends_part(result, row):
            table.add_section()
    return table


def difference_table(result: dict[str, Any]) -> Table:
    """What each step changed, with its interval; a star where the interval leaves out zero."""
    caption = "difference to the row before, or to ours; below it its 95 % bootstrap interval; * zero lies outside it; = the same"
    table = Table(title=f"differences, drawn: {result['drawn']}", caption=caption)
    for title in _headings()[:-1]:
        table.add_column(title, justify="left" if title == "variant" else "right", no_wrap=title == "variant")
    for row, cells in _with_cells(result, _difference):
        if row.get("compared_with") is not None:
            table.add_row(row["name"], *cells)
        if _ends_part(result, row):
            table.add_section()
    return table


def stream_table(stream: dict[str, Any]) -> Table:
    """Errors and steadiness in a stream, one row per variant."""
    table = Table(title=f"streams of {stream['frames_each']} frames in each of: {', '.join(stream['phantoms'])}")
    table.add_column("variant", no_wrap=True)
    for _, title in _STREAM_COLUMNS:
        table.add_column(title, justify="right")
    for row in stream["rows"]:
        table.add_row(row["name"], *_stream_cells(row["figures"]))
    return table


def markdown(result: dict[str, Any]) -> str:
    """All tables for a document."""
    parts = []
    if "rows" in result:
        brackets = f"the difference to the row before (below: to ours) and its 95 % bootstrap interval over {result['drawn']}"
        parts.append(f"{_title(result)}; in brackets {brackets}; * zero lies outside it.\n")
        parts.append(_markdown_table(_headings(), [_full_row(row) for row in result["rows"]]))
    if result.get("stream"):
        stream = result["stream"]
        phantoms = ", ".join(stream["phantoms"])
        parts.append(f"Streams of the twin, {stream['frames_each']} frames in each of: {phantoms} ({result['masks']}).\n")
        rows = [[row["name"], *_stream_cells(row["figures"])] for row in stream["rows"]]
        parts.append(_markdown_table(["variant", *(title for _, title in _STREAM_COLUMNS)], rows))
    return "\n".join(parts)


def _title(result: dict[str, Any]) -> str:
    without = f", {result['left_out']} frames left out that cannot be read" if result.get("left_out") else ""
    return f"{result['set']}: {result['expected']} frames with a pose{without}; the same masks for all rows ({result['masks']})"


def _headings() -> list[str]:
    return ["variant", *(measure.title + (", %" if measure.is_share else "") for measure in MEASURES), "ms after network"]


def _with_cells(result: dict[str, Any], show: Any) -> list[tuple[dict[str, Any], list[str]]]:
    """Each row with its cells; a row without numbers has its note in the first cell."""
    rows = []
    for row in result["rows"]:
        if "figures" in row:
            cells = [show(Figure(**row["figures"][measure.key]), measure) for measure in MEASURES]
        else:
            cells = ["needs a stream", *["-"] * (len(MEASURES) - 1)]
        rows.append((row, cells))
    return rows


def _full_row(row: dict[str, Any]) -> list[str]:
    if "figures" not in row:
        return [row["name"], row["note"], *[""] * len(MEASURES)]
    cells = []
    for measure in MEASURES:
        figure = Figure(**row["figures"][measure.key])
        change = _difference(figure, measure).replace("\n", ", ")
        cells.append(_number(figure.value, measure) + (f" ({change})" if change not in ("-", "=") else ""))
    return [row["name"], *cells, f"{row['after_network_ms']:.1f}"]


def _markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _ends_part(result: dict[str, Any], row: dict[str, Any]) -> bool:
    following = result["rows"][result["rows"].index(row) + 1 :]
    return bool(following) and following[0]["kind"] != row["kind"]


def _number(value: float | None, measure: Measure, *, signed: bool = False) -> str:
    if value is None:
        return "-"
    shown = f"{100.0 * value:{'+' if signed else ''}.1f}" if measure.is_share else f"{value:{'+' if signed else ''}.2f}"
    return shown.replace("-", _MINUS)


def _difference(figure: Figure, measure: Measure) -> str:
    if figure.difference is None:
        return "-"
    if figure.difference == figure.low == figure.high == 0.0:
        return "="
    star = "*" if figure.is_clear else ""
    low, high = (_number(value, measure, signed=True) for value in (figure.low, figure.high))
    return f"{_number(figure.difference, measure, signed=True)}{star}\n{low} to {high}"


def _stream_cells(figures: dict[str, Any]) -> list[str]:
    cells = []
    for key, _ in _STREAM_COLUMNS:
        value = figures[key]
        if value is None:
            cells.append("-")
        elif key in ("answered_share", "state_agreement", "wrong_share"):
            cells.append(f"{100.0 * value:.1f} %")
        else:
            cells.append(f"{value:.2f}".replace("-", _MINUS) if isinstance(value, float) else str(value))
    return cells
